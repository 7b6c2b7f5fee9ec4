//! Activity beside the wall that changes over the beat: gut that moves, or what falls into single gates.
//!
//! In: the gates, scaled to equal counts, and the fitted wall. Out: the place outside of the wall where the counts
//! change most with the beat ([`ActivityBeside`]), if there is one as bright as the wall. The fit takes activity beside
//! the wall for the same in all gates; what changes is taken for motion of the wall.
//!
//! 1. Each gate is blurred, so that noise of single voxels does not count.
//! 2. Samples lie [`DISTANCES_MM`] outside of the wall, on its rays, at the same places in all gates: those of the
//!    outer surface in the mean of the beat. A wall that moves changes them by up to .14 of its own uptake, at less
//!    than .8 of it (thirty simulated studies, `docs/log/beat.md`).
//! 3. Of the samples that reach [`LEAST_SHARE`] of the wall's uptake in a gate, that with the greatest amplitude of the
//!    first harmonic is taken, if this is at least [`LEAST_CHANGE`].
//!
//! Not guaranteed: that activity which moves along the wall, or never gets as bright, is found.

use super::counts::WallCounts;
use super::fit::BeatFit;
use super::study::GatedStudy;
use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
use crate::heart::model::wall::RAY_COLUMNS;
use crate::heart::polar::PolarMap;
use crate::image::grid::field::Field;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Distances of the samples from the outer surface, mm: beyond the reach of the wall's own motion and blur, near enough
/// to disturb it.
const DISTANCES_MM: [f64; 5] = [8.0, 10.0, 12.0, 14.0, 16.0];
/// Gaussian blur of a gate before it is sampled, sigma in mm.
const BLUR_MM: f64 = 6.0;
/// Uptake of the wall that activity beside it reaches in a gate.
const LEAST_SHARE: f64 = 0.8;
/// Amplitude of its first harmonic, as a share of the wall's uptake.
const LEAST_CHANGE: f64 = 0.18;
/// The part of the wall whose uptake is the measure: its hottest quarter, as that of the polar map.
const REFERENCE_PART: usize = 4;

/// Activity beside the wall that changes over the beat.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActivityBeside {
    /// The segment that it lies beside, 1..=17.
    pub segment: usize,
    /// How far outside of the wall, mm.
    pub distance_mm: f64,
    /// Its greatest value in a gate, as a share of the wall's uptake.
    pub greatest: f64,
    /// Amplitude of its first harmonic, as a share of the wall's uptake.
    pub change: f64,
}

/// The activity beside the wall of `fit` that changes most, if it is as bright as the wall.
pub(super) fn found(
    study: &GatedStudy,
    fit: &BeatFit,
    counts: &WallCounts,
    map: &PolarMap,
) -> Option<ActivityBeside> {
    let gates = study.gates.len();
    let walls: Vec<_> = (0..gates)
        .map(|gate| fit.moment((gate as f64 + 0.5) / gates as f64))
        .collect();
    let rays: Vec<usize> = (0..walls[0].outer.len())
        .filter(|&ray| walls.iter().all(|wall| wall.on[ray]))
        .collect();
    let mean = |of: &dyn Fn(usize) -> Vec3| (0..gates).map(of).sum::<Vec3>() / gates as f64;
    let places: Vec<Vec3> = rays
        .iter()
        .flat_map(|&ray| {
            let outer = mean(&|gate| walls[gate].outer[ray]);
            let inner = mean(&|gate| walls[gate].inner[ray]);
            let way = (outer - inner).try_normalize(1e-9).unwrap_or_default();
            DISTANCES_MM.map(|distance| outer + way * distance)
        })
        .collect();
    let reference = hottest(&counts.means(), &rays)?;
    let mut region = Aabb::around(&places);
    let border = Vec3::repeat(4.0 * BLUR_MM);
    region.min -= border;
    region.max += border;
    let of_gate = |gate: usize| -> Vec<f64> {
        let field = Field::new(&study.gates[gate], Some(&region), BLUR_MM);
        let share = study.factors[gate] / reference;
        places.iter().map(|place| share * field.at(place)).collect()
    };
    let values: Vec<Vec<f64>> = (0..gates).into_par_iter().map(of_gate).collect();
    let of_place = |place: usize| {
        let own: Vec<f64> = values.iter().map(|gate| gate[place]).collect();
        let ray = rays[place / DISTANCES_MM.len()];
        ActivityBeside {
            segment: map.segment_of(ray / RAY_COLUMNS, ray % RAY_COLUMNS),
            distance_mm: DISTANCES_MM[place % DISTANCES_MM.len()],
            greatest: own.iter().copied().fold(f64::MIN, f64::max),
            change: first_harmonic(&own),
        }
    };
    (0..places.len())
        .map(of_place)
        .filter(|beside| beside.greatest >= LEAST_SHARE && beside.change >= LEAST_CHANGE)
        .max_by(|a, b| a.change.total_cmp(&b.change))
}

/// Mean of the largest of `counts` of these rays; `None` without any above 0.
fn hottest(counts: &[f64], rays: &[usize]) -> Option<f64> {
    let mut own: Vec<f64> = rays.iter().map(|&ray| counts[ray]).collect();
    own.sort_by(|a, b| b.total_cmp(a));
    own.truncate(own.len().div_ceil(REFERENCE_PART));
    let mean = own.iter().sum::<f64>() / own.len().max(1) as f64;
    (mean > 0.0).then_some(mean)
}

/// Amplitude of the first harmonic of values at equal steps of the beat.
fn first_harmonic(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let part = |wave: fn(f64) -> f64| {
        let weighted = values.iter().enumerate();
        weighted
            .map(|(n, value)| value * wave(TAU * n as f64 / count))
            .sum::<f64>()
    };
    2.0 / count * part(f64::cos).hypot(part(f64::sin))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_harmonic_is_told_from_others_and_the_mean() {
        let values: Vec<f64> = (0..8)
            .map(|n| {
                let angle = TAU * f64::from(n) / 8.0;
                5.0 + 0.75 * (angle - 0.4).cos() + 2.0 * (2.0 * angle).sin()
            })
            .collect();
        assert!((first_harmonic(&values) - 0.75).abs() < 1e-12);
        assert_eq!(
            hottest(&[1.0, 9.0, 4.0, 8.0, 7.0], &[0, 1, 2, 3]),
            Some(9.0)
        );
        assert_eq!(hottest(&[0.0; 4], &[0, 1]), None);
        assert_eq!(hottest(&[], &[]), None);
    }
}
