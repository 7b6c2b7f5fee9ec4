//! The scale of the stress scan to the rest scan.

use super::noise::Noise;
use crate::heart::normals::{self, Matched, PlaceLimits, ScanPlaces, TermMatrix};
use crate::heart::polar::PolarMap;

/// Two scans of one heart.
#[derive(Debug, Clone, Copy)]
pub struct Sides<'a> {
    /// The map at stress.
    pub stress: &'a PolarMap,
    /// The map at rest.
    pub rest: &'a PolarMap,
}

/// The scale of stress to rest. Where nothing changed, stress is rest but for noise: the rest map stands in for the
/// normal mean.
pub(super) fn matched(
    stress: &ScanPlaces,
    rest: &ScanPlaces,
    reference: f64,
    noise: Noise,
) -> Option<Matched> {
    let as_limits = PlaceLimits {
        mean: (rest.uptake.iter())
            .map(|uptake| uptake.filter(|uptake| *uptake > 0.0))
            .collect(),
        sd: vec![Some(noise.points / 100.0 * reference); rest.uptake.len()],
        // The pattern of one heart is the same in both scans.
        covariance: TermMatrix::zeros(),
    };
    normals::matched(stress, &as_limits)
}
