//! What a file says of the beats that were gated.

use super::facts::GateFacts;

/// What a file says of the beats of one R-R interval that were gated. Parts that it leaves out are `None`.
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

    /// The R-R interval of `gates` gates, ms: as stated, or of the length of a gate.
    pub fn rr_of(&self, gates: usize) -> Option<f64> {
        let of_frames = || self.frame_time_ms.map(|ms| ms * gates as f64);
        self.rr_ms.or_else(of_frames)
    }

    /// Share of the beats that were rejected, 0..=1.
    pub fn rejected_share(&self) -> Option<f64> {
        let (accepted, rejected) = (self.beats_accepted?, self.beats_rejected?);
        (accepted + rejected > 0.0).then(|| rejected / (accepted + rejected))
    }
}
