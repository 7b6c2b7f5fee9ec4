//! The scale of a scan: how many of its counts are the normal mean.

use super::place_limits::{ComparedPlace, PlaceLimits, ScanPlaces};

/// Standard deviations from the mean, above which a place takes part in the scale, and the same below the mean's other side.
pub const MATCHED_LEAST_Z: f64 = -2.0;
/// Share of the wall that has a smaller ratio to the mean than the scale of the first round: high, because a defect may fill most of the wall.
const FIRST_SCALE_SHARE: f64 = 0.75;
/// Most rounds.
const MOST_ROUNDS: usize = 50;

/// The scale of a scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MatchedScale {
    /// The counts that a normal mean of 1 has in this scan.
    pub counts: f64,
    /// Share of the compared wall that took part, 0..=1.
    pub share: f64,
}

/// The scale that puts the normal-looking wall of a scan on the normal mean; `None` if no place can be compared, or the wall has no uptake.
pub fn matched_scale(scan: &ScanPlaces, limits: &PlaceLimits) -> Option<MatchedScale> {
    scale_of(&limits.compared(scan))
}

pub(super) fn scale_of(places: &[ComparedPlace]) -> Option<MatchedScale> {
    let mut ratios: Vec<(f64, &ComparedPlace)> = places
        .iter()
        .map(|place| (place.uptake / place.mean, place))
        .collect();
    ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = places.iter().map(|place| place.area).sum();
    let quantile = |kept: &dyn Fn(&ComparedPlace) -> bool, q: f64| {
        let kept: Vec<(f64, f64)> = (ratios.iter())
            .filter(|(_, place)| kept(place))
            .map(|(ratio, place)| (*ratio, place.area))
            .collect();
        let area: f64 = kept.iter().map(|(_, area)| area).sum();
        let mut below = 0.0;
        let found = kept.iter().find(|(_, own)| {
            below += own;
            below >= q * area
        });
        Some((found?.0, area / all))
    };
    let (mut counts, _) = quantile(&|_| true, FIRST_SCALE_SHARE)?;
    let mut share = 0.0;
    for _ in 0..MOST_ROUNDS {
        if !(counts > 0.0) {
            return None;
        }
        let before = counts;
        let normal = |place: &ComparedPlace| place.z(before).abs() <= -MATCHED_LEAST_Z;
        (counts, share) = quantile(&normal, 0.5)?;
        if counts == before {
            break;
        }
    }
    Some(MatchedScale { counts, share })
}
