//! Counts of the wall through the beat: a second opinion on thickening, beside that of the model.
//!
//! In: the gates, scaled to equal counts, and the fitted wall. Out: for every ray of the wall the largest count on the
//! way through it, as a periodic function of time. A wall thinner than the image's resolution looks the brighter the
//! thicker it is (Galt, Garcia, Robbins, IEEE Transactions on Medical Imaging 9, 1990), so the change of the counts is
//! that of the thickness, as far as the image's filter lets it through: on simulated studies about half of it.
//!
//! 1. Each gate is blurred a little, because the largest of many noisy values is too large.
//! 2. The largest value is taken within [`REACH_MM`] of the middle of the wall, where the fit has it in that gate.
//! 3. The gates' values become [`COUNT_HARMONICS`] harmonics, from which the width of a gate is taken off.
//!
//! Not guaranteed: that a bright neighbour within reach, such as gut, is told from the wall.

use super::fields::{gate_harmonics, harmonics};
use super::fit::BeatFit;
use super::study::GatedStudy;
use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
use crate::image::grid::field::Field;
use rayon::prelude::*;

/// Distance from the middle of the wall, on both sides, within which the largest count is sought, mm.
const REACH_MM: f64 = 8.0;
/// Distance of the samples along a ray, mm.
const SAMPLE_STEP_MM: f64 = 1.0;
/// Gaussian blur of a gate before it is sampled, sigma in mm.
const BLUR_MM: f64 = 3.0;
/// Harmonics of the counts: noise of single rays hides higher ones.
const COUNT_HARMONICS: usize = 2;

/// The largest count on each ray of the wall through the beat.
#[derive(Debug, Clone, PartialEq)]
pub struct WallCounts {
    /// For every ray: the mean, then cosines and sines of the harmonics.
    coefficients: Vec<[f64; 1 + 2 * COUNT_HARMONICS]>,
}

impl WallCounts {
    /// The counts of `study` on the rays of `fit`.
    pub fn new(study: &GatedStudy, fit: &BeatFit) -> Self {
        let width = 1.0 / study.gates.len() as f64;
        let of_gate = |gate: usize| -> Vec<f64> {
            let wall = fit.moment((gate as f64 + 0.5) * width);
            let rays: Vec<[Vec3; 2]> = (wall.inner.iter().zip(&wall.outer))
                .map(|(inner, outer)| {
                    let way = (outer - inner).try_normalize(1e-9).unwrap_or_default();
                    let middle = (inner + outer) / 2.0;
                    [-REACH_MM, REACH_MM].map(|reach| middle + way * reach)
                })
                .collect();
            let mut region = Aabb::around(rays.as_flattened());
            let border = Vec3::repeat(4.0 * BLUR_MM);
            region.min -= border;
            region.max += border;
            let field = Field::new(&study.gates[gate], Some(&region), BLUR_MM);
            let largest = rays.iter().map(|ends| largest(&field, ends));
            largest.map(|value| study.factors[gate] * value).collect()
        };
        let gates: Vec<Vec<f64>> = (0..study.gates.len())
            .into_par_iter()
            .map(of_gate)
            .collect();
        Self::through(&gates)
    }

    /// Through the values of each gate on each ray.
    fn through(gates: &[Vec<f64>]) -> Self {
        let width = 1.0 / gates.len() as f64;
        let bases = gate_harmonics(COUNT_HARMONICS, gates.len());
        let of_ray = |ray: usize| {
            let mut of = [0.0; 1 + 2 * COUNT_HARMONICS];
            of[0] = gates.iter().map(|gate| gate[ray]).sum::<f64>() * width;
            // Cosines and sines at equal steps are orthogonal, so least squares are one division.
            for (index, of) in of[1..].iter_mut().enumerate() {
                let own = gates.iter().zip(&bases);
                let sum: f64 = own.map(|(gate, basis)| gate[ray] * basis[index]).sum();
                *of = sum / bases.iter().map(|basis| basis[index].powi(2)).sum::<f64>();
            }
            of
        };
        let rays = gates.first().map_or(0, Vec::len);
        Self {
            coefficients: (0..rays).map(of_ray).collect(),
        }
    }

    /// The mean counts of every ray over the beat.
    pub(super) fn means(&self) -> Vec<f64> {
        self.coefficients.iter().map(|of| of[0]).collect()
    }

    /// The counts of every ray at `turns` of the beat; not below 0.
    pub fn at(&self, turns: f64) -> Vec<f64> {
        let basis = harmonics(COUNT_HARMONICS, turns, 0.0);
        let value = |of: &[f64; 1 + 2 * COUNT_HARMONICS]| {
            let moving: f64 = of[1..].iter().zip(&basis).map(|(c, b)| c * b).sum();
            (of[0] + moving).max(0.0)
        };
        self.coefficients.iter().map(value).collect()
    }
}

fn largest(field: &Field, [from, to]: &[Vec3; 2]) -> f64 {
    let steps = (2.0 * REACH_MM / SAMPLE_STEP_MM) as usize;
    (0..=steps)
        .map(|step| field.at(&(from + (to - from) * (step as f64 / steps as f64))))
        .fold(f64::NEG_INFINITY, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Gates that are means of a curve of two harmonics give the curve back.
    #[test]
    fn the_width_of_a_gate_is_taken_off() {
        let curve = |turns: f64| {
            100.0 + 20.0 * (TAU * (turns - 0.1)).cos() + 5.0 * (TAU * 2.0 * (turns - 0.3)).sin()
        };
        const MOMENTS_PER_GATE: usize = 200;
        for gates in [6, 7, 8, 16] {
            let mean = |gate: usize| {
                let moment = |n: usize| gate as f64 + (n as f64 + 0.5) / MOMENTS_PER_GATE as f64;
                let all = (0..MOMENTS_PER_GATE).map(|n| curve(moment(n) / gates as f64));
                vec![all.sum::<f64>() / MOMENTS_PER_GATE as f64]
            };
            let counts = WallCounts::through(&(0..gates).map(mean).collect::<Vec<_>>());
            for turns in [0.0, 0.2, 0.55, 0.9] {
                let found = counts.at(turns)[0];
                assert!(
                    (found - curve(turns)).abs() < 0.01,
                    "{gates} gates: {found}"
                );
            }
        }
    }
}
