//! Figures of a pair with what noise lets them be: an interval, and whether there was a change.
//!
//! In: both maps side by side ([`Compared`]) with the pair's noise. Out: [`Answers`]. The steps:
//!
//! 1. Fields of correlated noise ([`fields`]) are drawn for stress and for rest.
//! 2. The lower end of a share of the wall is the 5th percentile over maps on which nothing but the wall that was found
//!    to have changed is changed, each with noise: a change that noise often hides may not be there.
//! 3. The upper end is the 95th percentile over what the maps may be without their noise: the difference shrunk by the
//!    share of its mean square that noise explains ([`believed_share`]), with the scatter that is left. So a difference
//!    that falls a little short of the limit may be a change.
//! 4. Both ends make room for the error of borders that is not noise ([`BORDER_SD_SHARE`]).
//! 5. A loss of a territory shows in nine of ten draws from [`Answers::detectable_percent`] on.
//!
//! Guaranteed: the same maps give the same intervals; an interval holds its figure.
//!
//! Not guaranteed: that intervals of shares hold the true share in nine of ten hearts: a loss of a fifth is often found
//! too small. docs/comparison.md has the figures.

use super::calibration::{BORDER_SD_SHARE, LIMIT_SDS, TID_SD, TID_SD_PER_POINT};
use super::noise::fields;
use super::side_by_side::Compared;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::polar::{ARTERY_NAMES, segments_of};
use serde::{Deserialize, Serialize};

/// Draws of noise.
pub(super) const DRAWS: usize = 200;
/// Shares of the draws below the ends of an interval.
const END_SHARES: [f64; 2] = [0.05, 0.95];
/// Standard deviations from the mean to the ends of an interval.
pub(super) const HALF_WIDTH_SDS: f64 = 1.645;
/// Share of the wall up to which nothing is said to have changed, per cent.
const SMALL_PERCENT: f64 = 1.0;
/// Share of the wall that may have changed without notice where it is said that nothing did, per cent.
const LARGE_PERCENT: f64 = 10.0;
/// The greatest normal TID (Abidov et al., J Am Coll Cardiol 2003: exercise, sestamibi).
const MOST_NORMAL_TID: f64 = 1.22;
/// Share of a loss that smoothed maps show at its middle: blur fills the rest from beside it.
const SHOWN_SHARE: f64 = 0.7;
/// The least share of a difference that is believed.
const LEAST_BELIEVED_SHARE: f64 = 0.75;
/// Share of the draws in which a detectable loss shows.
const DETECTED_SHARE: f64 = 0.9;
/// The least loss of a territory that usual counts show, per cent: beyond it, the counts are few.
pub const FEW_COUNTS_LOSS_PERCENT: f64 = 30.0;

/// What may be said of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// There is one, whatever the noise.
    Yes,
    /// There is none that matters, and one would have shown.
    No,
    /// Noise may hide a change, or make what looks like one.
    CannotTell,
}

impl Verdict {
    /// What may be said where noise excludes that there is none (`yes`), or that there is one (`no`).
    fn of(yes: bool, no: bool) -> Self {
        match (yes, no) {
            (true, _) => Self::Yes,
            (false, true) => Self::No,
            (false, false) => Self::CannotTell,
        }
    }

    /// `yes`, `no` or `cannot tell`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Yes => "yes",
            Self::No => "no",
            Self::CannotTell => "cannot tell",
        }
    }
}

/// A figure with its interval and verdict.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// The figure.
    pub value: f64,
    /// 5th and 95th percentile of what it may be.
    pub interval: [f64; 2],
    /// Whether there was a change; of a score, whether it is abnormal.
    pub verdict: Verdict,
}

impl Answer {
    /// Of a share of the wall, per cent, that noise lets be `low` to `high`.
    fn of_share(value: f64, low: f64, high: f64, detectable_percent: f64) -> Self {
        let border = HALF_WIDTH_SDS * BORDER_SD_SHARE * value;
        let interval = [
            (value - border.hypot(value - low.min(value))).max(0.0),
            (value + border.hypot(high.max(value) - value)).min(100.0),
        ];
        let seen = detectable_percent <= FEW_COUNTS_LOSS_PERCENT;
        let denied = value <= SMALL_PERCENT && interval[1] <= LARGE_PERCENT && seen;
        Self {
            value,
            interval,
            verdict: Verdict::of(low.min(value) > SMALL_PERCENT, denied),
        }
    }

    /// Of a score that is abnormal from `abnormal` on, in the interval that holds `drawn`.
    pub(super) fn of_score(value: f64, drawn: &[f64], abnormal: f64) -> Self {
        let [low, high] = ends(drawn);
        let interval = [low.min(value), high.max(value)];
        Self {
            value,
            interval,
            verdict: Verdict::of(interval[0] >= abnormal, interval[1] < abnormal),
        }
    }

    /// Of the ratio `tid` of the cavities, stress to rest, of a pair with this noise, points: whether the cavity is
    /// larger at stress.
    pub fn of_tid(tid: f64, noise_points: f64) -> Self {
        let deviation = TID_SD.hypot(TID_SD_PER_POINT * noise_points);
        let interval = [-1.0, 1.0].map(|side| tid * (side * HALF_WIDTH_SDS * deviation).exp());
        Self {
            value: tid,
            interval,
            verdict: Verdict::of(interval[0] > 1.0, interval[1] < MOST_NORMAL_TID),
        }
    }
}

/// Shares of the compared wall, per cent, and what noise lets be seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answers {
    /// Wall that loses uptake at stress.
    pub reversible: Answer,
    /// Wall below the threshold in both scans.
    pub fixed: Answer,
    /// Wall that lacks uptake at rest beside stress.
    pub reverse: Answer,
    /// The least loss, per cent of the uptake at rest, that is found in nine of ten scans if it takes up a territory.
    pub detectable_percent: f64,
}

/// The value below which a share of the values lies.
fn percentile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[(share * (values.len() - 1) as f64).round() as usize]
}

/// The ends of the interval of a figure, by its value in every draw.
pub(super) fn ends(values: &[f64]) -> [f64; 2] {
    END_SHARES.map(|share| percentile(values.to_vec(), share))
}

/// Figures of one draw.
struct Drawn {
    low: [f64; 3],
    high: [f64; 3],
    detectable: [f64; 3],
}

impl Answers {
    /// The answers about two maps.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub(super) fn new(both: &Compared, monitor: &Monitor) -> Result<Self, Cancelled> {
        let noise = fields(&both.areas, 2 * DRAWS, monitor)?;
        let changes = both.changes(&both.difference);
        let expected: Vec<Option<f64>> = (both.difference.iter().enumerate())
            .map(|(index, own)| own.map(|own| if changes.is_about(index) { own } else { 0.0 }))
            .collect();
        let believed = believed_share(both);
        let draws: Vec<Drawn> = (noise.chunks_exact(2))
            .map(|pair| {
                monitor.check()?;
                Ok(drawn(both, &expected, believed, [&pair[0], &pair[1]]))
            })
            .collect::<Result<_, _>>()?;
        let percentile = |share: f64, of: &dyn Fn(&Drawn) -> f64| {
            percentile(draws.iter().map(of).collect(), share)
        };
        let detectable = (0..ARTERY_NAMES.len())
            .map(|artery| percentile(DETECTED_SHARE, &|draw| draw.detectable[artery]))
            .fold(0.0, f64::max);
        let value = both.shares(&changes, &both.stress, &both.rest);
        let answer = |share: usize| {
            let low = percentile(END_SHARES[0], &|draw| draw.low[share]);
            let high = percentile(END_SHARES[1], &|draw| draw.high[share]);
            Answer::of_share(value[share], low, high, detectable)
        };
        Ok(Self {
            reversible: answer(0),
            fixed: answer(1),
            reverse: answer(2),
            detectable_percent: detectable.min(100.0),
        })
    }
}

/// The share of the difference that is not noise, by the mean squares of both.
fn believed_share(both: &Compared) -> f64 {
    let (mut sum, mut area) = (0.0, 0.0);
    for (index, own) in both.difference.iter().enumerate() {
        let own = own.unwrap_or(0.0) / both.noise.at(index);
        sum += both.areas[index] * own * own;
        area += both.areas[index];
    }
    (1.0 - area / sum).max(LEAST_BELIEVED_SHARE)
}

/// The figures of maps with one field of noise each, of mean square 1, at stress and at rest.
fn drawn(
    both: &Compared,
    expected: &[Option<f64>],
    believed: f64,
    [stress, rest]: [&[f64]; 2],
) -> Drawn {
    let of_scan = |field: &[f64], index: usize| {
        field[index] * both.noise.at(index) * std::f64::consts::FRAC_1_SQRT_2
    };
    let noise: Vec<f64> = (0..rest.len())
        .map(|index| of_scan(rest, index) - of_scan(stress, index))
        .collect();
    let with = |map: &[Option<f64>], noise: &dyn Fn(usize) -> f64| -> Vec<Option<f64>> {
        let places = map.iter().enumerate();
        places
            .map(|(index, own)| Some((*own)? + noise(index)))
            .collect()
    };
    let at_stress = with(&both.stress, &|index| of_scan(stress, index));
    let at_rest = with(&both.rest, &|index| of_scan(rest, index));
    let shares = |difference: &[Option<f64>], scatter: f64| {
        let changes = both.changes(&with(difference, &|index| scatter * noise[index]));
        both.shares(&changes, &at_stress, &at_rest)
    };
    let shrunk: Vec<Option<f64>> = (both.difference.iter())
        .map(|own| own.map(|own| believed * own))
        .collect();
    Drawn {
        low: shares(expected, 1.0),
        high: shares(&shrunk, believed.sqrt()),
        detectable: ARTERY_NAMES.map(|artery| least_found(both, artery, &noise)),
    }
}

/// The least loss of the artery's whole wall that is found beside this noise, per cent of the uptake at rest.
fn least_found(both: &Compared, artery: &str, noise: &[f64]) -> f64 {
    let own = |index: &usize| {
        both.difference[*index].is_some()
            && segments_of(artery).any(|segment| segment == both.segment[*index])
    };
    let places = (0..noise.len()).filter(own);
    let losses = places.map(|index| {
        let short = LIMIT_SDS * both.noise.at(index) - noise[index];
        100.0 * short / (SHOWN_SHARE * both.uptake[index].max(1.0))
    });
    losses.fold(100.0, f64::min).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tid_is_less_certain_where_there_is_more_noise() {
        let width = |noise: f64| {
            let [low, high] = Answer::of_tid(1.0, noise).interval;
            assert!(low < 1.0 && high > 1.0);
            high / low
        };
        assert!(width(8.0) > 1.1 * width(4.0));
        assert_eq!(Answer::of_tid(1.4, 4.0).verdict, Verdict::Yes);
        assert_eq!(Answer::of_tid(1.0, 4.0).verdict, Verdict::No);
        assert_eq!(Answer::of_tid(1.14, 8.0).verdict, Verdict::CannotTell);
    }

    #[test]
    fn nothing_is_denied_that_would_not_have_shown() {
        let verdict =
            |value, low, high, detectable| Answer::of_share(value, low, high, detectable).verdict;
        assert_eq!(verdict(0.0, 0.0, 4.0, 20.0), Verdict::No);
        assert_eq!(verdict(0.0, 0.0, 4.0, 45.0), Verdict::CannotTell);
        assert_eq!(verdict(0.0, 0.0, 15.0, 20.0), Verdict::CannotTell);
        assert_eq!(verdict(9.0, 0.0, 15.0, 20.0), Verdict::CannotTell);
        assert_eq!(verdict(12.0, 8.0, 15.0, 45.0), Verdict::Yes);
        // An interval holds its figure, and the error of its border even without noise.
        let [low, high] = Answer::of_share(12.0, 13.0, 11.0, 20.0).interval;
        assert!(low < 11.0 && 13.0 < high, "{low} {high}");
    }
}
