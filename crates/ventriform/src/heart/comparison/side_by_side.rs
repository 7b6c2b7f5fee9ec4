//! Two maps of one heart on one scale, place by place.
//!
//! In: the maps ([`Sides`]), and the turn of one against the other. Out: [`Compared`]: uptake at stress and at rest, the
//! smoothed difference, and the noise that it has. Scale and noise follow from each other: the scale is found with the
//! noise of a usual pair, and then with that of this one.

use super::border::{Changed, Field};
use super::noise::Noise;
use super::scale::{Sides, matched};
use super::turn;
use crate::heart::normals::{Matched, ScanPlaces};
use crate::heart::polar::MapGaussian;

/// Standard deviations of the smoothing of the difference, rows and columns.
const SMOOTHING_PLACES: [f64; 2] = [1.2, 2.4];
/// Rows and columns on either side that it takes in.
const SMOOTHING_REACH: [usize; 2] = [4, 8];

/// Two maps, one entry for each place, row by row from apex to base; `None` without muscle in both. Uptake is in per
/// cent of the rest map's reference.
#[derive(Debug, Clone)]
pub(super) struct Compared {
    /// Uptake at stress, scaled to rest.
    pub stress: Vec<Option<f64>>,
    /// Uptake at rest.
    pub rest: Vec<Option<f64>>,
    /// Rest less stress, smoothed.
    pub difference: Vec<Option<f64>>,
    /// Uptake at rest, smoothed likewise; 0 without muscle in both.
    pub uptake: Vec<f64>,
    /// Areas, mm²; 0 without muscle in both.
    pub areas: Vec<f64>,
    /// Segments, 1 to 17.
    pub segment: Vec<usize>,
    /// Uptake below which wall is a defect.
    pub threshold: f64,
    /// The noise of the difference.
    pub noise: Noise,
    /// The scale of stress to rest.
    pub matched: Matched,
}

/// The wall that changed to either side.
#[derive(Debug, Clone)]
pub(super) struct Changes {
    /// Where uptake is lost at stress.
    pub lost: Changed,
    /// Where it is lost at rest.
    pub gained: Changed,
}

impl Changes {
    /// Whether the difference of a place belongs to a change.
    pub(super) fn is_about(&self, index: usize) -> bool {
        self.lost.about[index] || self.gained.about[index]
    }
}

impl Compared {
    /// The maps side by side, stress turned by `turn_degrees`; `None` where no wall can be compared, or one of them has
    /// no uptake.
    pub(super) fn new(sides: &Sides<'_>, turn_degrees: f64) -> Option<Self> {
        let rest = ScanPlaces::from_map(sides.rest);
        let stress = ScanPlaces {
            uptake: turn::turned(sides.stress, turn_degrees),
            ..rest.clone()
        };
        let usual = Self::with_noise(sides, &stress, &rest, Noise::USUAL)?;
        Self::with_noise(sides, &stress, &rest, usual.noise)
    }

    /// The maps on the scale that fits wall with this noise.
    fn with_noise(
        sides: &Sides<'_>,
        stress: &ScanPlaces,
        rest: &ScanPlaces,
        noise: Noise,
    ) -> Option<Self> {
        let reference = sides.rest.reference;
        let matched = matched(stress, rest, reference, noise)?;
        let both: Vec<Option<[f64; 2]>> = (stress.uptake.iter().zip(&rest.uptake))
            .map(|(stress, rest)| {
                let stress = 100.0 * (*stress)? / (reference * matched.counts);
                Some([stress, 100.0 * (*rest)? / reference])
            })
            .collect();
        let [at_stress, at_rest] = [0, 1].map(|scan| -> Vec<Option<f64>> {
            both.iter()
                .map(|both| both.map(|both| both[scan]))
                .collect()
        });
        let raw: Vec<Option<f64>> = (both.iter())
            .map(|both| both.map(|[stress, rest]| rest - stress))
            .collect();
        let areas: Vec<f64> = (both.iter().zip(&rest.area))
            .map(|(both, area)| both.map_or(0.0, |_| *area))
            .collect();
        let difference = smoothed(&raw, &areas);
        Some(Self {
            uptake: (smoothed(&at_rest, &areas).into_iter())
                .map(Option::unwrap_or_default)
                .collect(),
            noise: Noise::of_pair(&raw, &difference, &areas),
            stress: at_stress,
            rest: at_rest,
            difference,
            areas,
            segment: rest.segment.clone(),
            threshold: 100.0 * sides.rest.threshold,
            matched,
        })
    }

    /// The wall that changed, by a `difference` on these places.
    pub(super) fn changes(&self, difference: &[Option<f64>]) -> Changes {
        let gains: Vec<Option<f64>> = (difference.iter()).map(|own| own.map(|own| -own)).collect();
        let changed = |difference: &[Option<f64>]| {
            let field = Field {
                difference,
                uptake: &self.uptake,
                areas: &self.areas,
                noise: self.noise,
            };
            field.changed()
        };
        Changes {
            lost: changed(difference),
            gained: changed(&gains),
        }
    }

    /// Whether a place with this uptake at stress and at rest is below the threshold in both scans, and not reversible.
    pub(super) fn is_fixed(&self, changes: &Changes, index: usize, uptake: [f64; 2]) -> bool {
        !changes.lost.within[index] && uptake.iter().all(|own| *own < self.threshold)
    }

    /// Shares of the compared wall that are reversible, fixed, and worse at rest, per cent, of maps with these changes.
    pub(super) fn shares(
        &self,
        changes: &Changes,
        stress: &[Option<f64>],
        rest: &[Option<f64>],
    ) -> [f64; 3] {
        let mut sums = [0.0; 3];
        for (index, area) in self.areas.iter().enumerate() {
            let (Some(at_stress), Some(at_rest)) = (stress[index], rest[index]) else {
                continue;
            };
            let is = [
                changes.lost.within[index],
                self.is_fixed(changes, index, [at_stress, at_rest]),
                changes.gained.within[index],
            ];
            for (sum, is) in sums.iter_mut().zip(is) {
                *sum += if is { *area } else { 0.0 };
            }
        }
        let all: f64 = self.areas.iter().sum();
        sums.map(|sum| 100.0 * sum / all)
    }
}

/// Values in the mean over neighbouring places that have one, each by its area and a Gaussian.
fn smoothed(values: &[Option<f64>], areas: &[f64]) -> Vec<Option<f64>> {
    let known: Vec<f64> = values.iter().map(|own| own.unwrap_or(0.0)).collect();
    let means = MapGaussian::new(SMOOTHING_PLACES, SMOOTHING_REACH).means(&known, areas);
    (means.into_iter().zip(values))
        .map(|(mean, own)| own.map(|_| mean))
        .collect()
}
