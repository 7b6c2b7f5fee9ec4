//! The timing that a file states of the beats that were gated.

use super::facts::GateFacts;
use std::ops::RangeInclusive;

/// R-R intervals that a heart can have, ms: 200 to 24 beats per minute.
pub const RR_MS: RangeInclusive<f64> = 300.0..=2500.0;
/// Share of the R-R interval by which the gates together may last longer or shorter.
const GATES_APART_SHARE: f64 = 0.2;

/// The stated timing of the gated beats of one R-R interval. Parts that the file leaves out are `None`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GateTiming {
    /// Length of a gate, ms: Frame Time (0018,1063).
    pub frame_time_ms: Option<f64>,
    /// The R-R interval, ms: Nominal Interval (0018,1062).
    pub rr_ms: Option<f64>,
    /// The shortest R-R interval accepted, ms: Low R-R Value (0018,1081).
    pub low_rr_ms: Option<f64>,
    /// The longest R-R interval accepted, ms: High R-R Value (0018,1082).
    pub high_rr_ms: Option<f64>,
    /// Beats accepted: Intervals Acquired (0018,1083).
    pub beats_accepted: Option<f64>,
    /// Beats rejected: Intervals Rejected (0018,1084).
    pub beats_rejected: Option<f64>,
    /// Gates of each R-R interval; `None` if the format does not say, and all volumes are of one.
    pub gates_per_interval: Option<usize>,
}

impl GateTiming {
    /// Facts about a study of `volumes` gates of all R-R intervals, of which a file states `timings`.
    pub(super) fn facts(timings: &[Self], volumes: usize) -> GateFacts {
        let stated = timings.first().cloned().unwrap_or_default();
        let number = stated.gates_of_interval(volumes);
        // Which interval is taken depends on the counts, which are not read here.
        let known = if number < volumes {
            Self::default()
        } else {
            stated
        };
        GateFacts {
            number,
            intervals: volumes / number.max(1),
            rr_ms: known.rr_of(number),
            beats_accepted: known.beats_accepted,
            beats_rejected: known.beats_rejected,
        }
    }

    /// Gates of each R-R interval of `volumes` gates.
    pub(super) fn gates_of_interval(&self, volumes: usize) -> usize {
        let stated = self.gates_per_interval;
        let divides = stated.filter(|each| *each > 0 && volumes.is_multiple_of(*each));
        divides.unwrap_or(volumes)
    }

    /// The R-R interval of `gates` gates, ms: as stated, or of the length of a gate; `None` if no heart beats so.
    pub fn rr_of(&self, gates: usize) -> Option<f64> {
        self.stated_rr(gates).filter(|ms| RR_MS.contains(ms))
    }

    fn stated_rr(&self, gates: usize) -> Option<f64> {
        self.rr_ms.or_else(|| self.rr_of_frames(gates))
    }

    fn rr_of_frames(&self, gates: usize) -> Option<f64> {
        self.frame_time_ms.map(|ms| ms * gates as f64)
    }

    /// Warnings about the R-R interval of `gates` gates: no heart beats so, or the gates last longer or shorter.
    pub(super) fn warnings(&self, gates: usize) -> Vec<String> {
        let [least, most] = [RR_MS.start(), RR_MS.end()];
        let stated = self.stated_rr(gates);
        let impossible = stated.filter(|ms| !RR_MS.contains(ms)).map(|ms| {
            format!(
                "The header's R-R interval of {ms:.0} ms is none of a heart ({least:.0} to {most:.0} ms) and was left \
                 out."
            )
        });
        let both = self.rr_ms.zip(self.rr_of_frames(gates));
        let apart = both.filter(|(rr, frames)| (frames / rr - 1.0).abs() > GATES_APART_SHARE);
        let apart = apart.map(|(rr, frames)| {
            format!(
                "{gates} gates of the header's Frame Time last {frames:.0} ms, and its R-R interval is {rr:.0} ms: the \
                 gates may not cover the beat, on which EF and phases depend."
            )
        });
        impossible.into_iter().chain(apart).collect()
    }

    /// Share of the beats that were rejected, 0..=1.
    pub fn rejected_share(&self) -> Option<f64> {
        let (accepted, rejected) = (self.beats_accepted?, self.beats_rejected?);
        (accepted + rejected > 0.0).then(|| rejected / (accepted + rejected))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// R-R interval and frame time of a header, for eight gates: the interval that is taken, and the number of
    /// warnings.
    #[test]
    fn intervals_of_no_heart_are_left_out_and_contradictions_told() {
        for (rr_ms, frame_time_ms, taken, warnings) in [
            (Some(850.0), None, Some(850.0), 0),
            (None, Some(100.0), Some(800.0), 0),
            (Some(850.0), Some(100.0), Some(850.0), 0),
            (Some(850.0), Some(50.0), Some(850.0), 1),
            (Some(30_000.0), None, None, 1),
            (None, Some(8000.0), None, 1),
            (Some(f64::NAN), None, None, 1),
            (None, None, None, 0),
        ] {
            let timing = GateTiming {
                rr_ms,
                frame_time_ms,
                ..GateTiming::default()
            };
            assert_eq!(timing.rr_of(8), taken, "{timing:?}");
            assert_eq!(timing.warnings(8).len(), warnings, "{timing:?}");
        }
    }
}
