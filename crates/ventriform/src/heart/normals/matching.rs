//! The scale and the pattern of a scan: what its counts are beside the normal mean, as far as the wall looks normal.

use super::pattern::{Coefficients, RatioAt, TermMatrix, fitted, share_at};
use super::place_limits::{ComparedPlace, PlaceLimits, ScanPlaces};
use crate::base::numeric::order::weighted_quantile;

/// Standard deviations from the mean up to which a place looks normal, on either side.
pub const MATCHED_Z: f64 = 2.0;
/// Share of the wall that has a smaller ratio to the mean than the scale of the first round: high, because a defect
/// may fill most of the wall.
const FIRST_SCALE_SHARE: f64 = 0.75;
/// Most rounds.
const MOST_ROUNDS: usize = 30;
/// Fewest places that set scale and pattern.
const FEWEST_PLACES: usize = 50;

/// The scale and the pattern of a scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matched {
    /// The counts that a normal mean of 1 has in this scan.
    pub counts: f64,
    /// The coefficients of its pattern.
    pub pattern: Coefficients,
    /// Share of the compared places that took part, 0..=1.
    pub share: f64,
}

/// The scale and the pattern that put the normal-looking wall of a scan on the normal mean; `None` if too few places
/// can be compared, or the wall has no uptake.
pub fn matched(scan: &ScanPlaces, limits: &PlaceLimits) -> Option<Matched> {
    matched_places(&limits.compared(scan), &limits.precision())
}

impl Matched {
    /// The normal mean of a place in this scan.
    pub(super) fn expected(&self, place: &ComparedPlace) -> f64 {
        place.mean * share_at(place.index, &self.pattern)
    }

    /// Standard deviations from the normal mean.
    pub(super) fn z(&self, place: &ComparedPlace) -> f64 {
        (place.uptake / self.counts - self.expected(place)) / place.sd
    }
}

pub(super) fn matched_places(places: &[ComparedPlace], precision: &TermMatrix) -> Option<Matched> {
    if places.len() < FEWEST_PLACES {
        return None;
    }
    let mut found = Matched {
        counts: first_scale(places),
        pattern: Coefficients::zeros(),
        share: 0.0,
    };
    let mean_area = places.iter().map(|place| place.area).sum::<f64>() / places.len() as f64;
    let mut before: Vec<bool> = Vec::new();
    for _ in 0..MOST_ROUNDS {
        if !(found.counts > 0.0 && mean_area > 0.0) {
            return None;
        }
        let normal: Vec<bool> = places
            .iter()
            .map(|place| found.z(place).abs() < MATCHED_Z)
            .collect();
        let kept = normal.iter().filter(|is| **is).count();
        found.share = kept as f64 / places.len() as f64;
        if normal == before || kept < FEWEST_PLACES {
            break;
        }
        let ratios: Vec<RatioAt> = (places.iter().zip(&normal))
            .filter(|(_, is)| **is)
            .map(|(place, _)| RatioAt {
                index: place.index,
                ratio: place.uptake / found.counts / place.mean,
                area: place.area / mean_area,
                relative_sd: place.sd / place.mean,
            })
            .collect();
        let (level, pattern) = fitted(&ratios, precision)?;
        found.counts *= level;
        found.pattern = pattern;
        before = normal;
    }
    Some(found)
}

/// The ratio to the mean below which [`FIRST_SCALE_SHARE`] of the wall lies.
fn first_scale(places: &[ComparedPlace]) -> f64 {
    let ratios = places.iter();
    let ratios = ratios.map(|place| (place.uptake / place.mean, place.area));
    weighted_quantile(ratios.collect(), FIRST_SCALE_SHARE).unwrap_or(0.0)
}
