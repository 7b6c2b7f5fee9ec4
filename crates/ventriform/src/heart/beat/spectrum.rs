//! The number of harmonics that the fit gives to the motion.
//!
//! In: the gates about the heart. Out: 2 to 4. The steps:
//!
//! 1. The energy of orders of the gates' Fourier series, over all voxels. Noise has the same in each.
//! 2. Orders above those that a fit may have are noise: their mean is that of one order.
//! 3. Gates are noisy where the first order, which holds most of a beat, has less than [`ENERGY_OVER_NOISE`] times the
//!    noise. They have two harmonics, since a third follows the noise; others three, and four from [`GATES_OF_FOUR`]
//!    gates on.
//!
//! docs/log/beat.md compares two and three harmonics.

use nalgebra::Complex;
use std::f64::consts::TAU;

/// Harmonics of noisy gates, and of gates too few for more.
const LEAST_HARMONICS: usize = 2;
/// Gates from which on three and four harmonics can be told from noise.
const GATES_OF_THREE: usize = 8;
const GATES_OF_FOUR: usize = 16;
/// Energy of the first order, as a multiple of an order's noise, below which gates are noisy.
const ENERGY_OVER_NOISE: f64 = 1.6;
/// Energy of an order that is nothing but rounding, as a share of that of the gates' mean.
const ROUNDING: f64 = 1e-12;

/// Number of harmonics for these gates, each voxel with its weight.
pub(super) fn usual_harmonics(images: &[Vec<f32>], weights: &[f32]) -> usize {
    let gates = images.len();
    let most = match gates {
        0..GATES_OF_THREE => return LEAST_HARMONICS,
        GATES_OF_THREE..GATES_OF_FOUR => 3,
        _ => 4,
    };
    let energy = |order| energy(images, weights, order);
    let beyond = most + 1..=gates / 2;
    let orders = beyond.clone().count() as f64;
    let noise = beyond.map(energy).sum::<f64>() / orders;
    if energy(1) < ENERGY_OVER_NOISE * noise.max(ROUNDING * energy(0)) {
        LEAST_HARMONICS
    } else {
        most
    }
}

/// Energy of an order of the gates' Fourier series.
fn energy(images: &[Vec<f32>], weights: &[f32], order: usize) -> f64 {
    let turns = order as f64 / images.len() as f64;
    let waves: Vec<Complex<f64>> = (0..images.len())
        .map(|gate| Complex::from_polar(1.0, -TAU * turns * gate as f64))
        .collect();
    let of_voxel = |voxel: usize| {
        let sum: Complex<f64> = (images.iter().zip(&waves))
            .map(|(image, wave)| wave * f64::from(image[voxel]))
            .sum();
        sum.norm_sqr()
    };
    (weights.iter().enumerate())
        .filter(|(_, weight)| **weight > 0.0)
        .map(|(voxel, weight)| f64::from(*weight) * of_voxel(voxel))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    const VOXELS: usize = 4000;

    /// Gates whose voxels follow the beat with these amplitudes of harmonics 1, 2, ..., in noise of deviation 1.
    fn gates(count: usize, amplitudes: &[f64]) -> Vec<Vec<f32>> {
        let mut random = Pcg64Mcg::seed_from_u64(count as u64);
        let mut noise = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
        (0..count)
            .map(|gate| {
                let turn = TAU * gate as f64 / count as f64;
                let of_voxel = |voxel: usize| -> f64 {
                    let waves = amplitudes.iter().enumerate();
                    let wave = |(order, size): (usize, &f64)| {
                        size * ((order + 1) as f64 * turn + voxel as f64).cos()
                    };
                    waves.map(wave).sum()
                };
                (0..VOXELS)
                    .map(|voxel| (of_voxel(voxel) + noise()) as f32)
                    .collect()
            })
            .collect()
    }

    #[test]
    fn noisy_gates_have_two_harmonics() {
        let usual =
            |count, amplitudes: &[f64]| usual_harmonics(&gates(count, amplitudes), &[1.0; VOXELS]);
        for count in [6, 7, 8, 12, 16, 24, 32] {
            assert_eq!(usual(count, &[]), 2, "{count} gates of noise");
            assert_eq!(
                usual(count, &[0.1, 0.1]),
                2,
                "{count} gates that hardly move"
            );
        }
        for (count, harmonics) in [(6, 2), (8, 3), (12, 3), (16, 4), (32, 4)] {
            assert_eq!(usual(count, &[2.0, 0.5]), harmonics, "{count} gates");
        }
    }

    #[test]
    fn gates_that_stand_still_have_two() {
        let still = vec![vec![1.0; VOXELS]; 8];
        assert_eq!(usual_harmonics(&still, &[1.0; VOXELS]), 2);
    }

    #[test]
    fn gates_that_begin_elsewhere_in_the_cycle_have_as_many() {
        let mut images = gates(16, &[3.0, 1.0, 0.6]);
        let usual = usual_harmonics(&images, &[1.0; VOXELS]);
        for _ in 0..16 {
            images.rotate_left(1);
            assert_eq!(usual_harmonics(&images, &[1.0; VOXELS]), usual);
        }
    }
}
