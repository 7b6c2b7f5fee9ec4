//! The harmonics of the beat that the gates show.
//!
//! In: the gates about the heart. Out: the number of harmonics that the fit gives to the motion. The steps:
//!
//! 1. The energy of every order of the gates' Fourier series, over all voxels. Noise has the same in each.
//! 2. Orders above those that a fit may have are noise: their mean is that of one order.
//! 3. Two harmonics are always fitted. A third, from [`GATES_OF_FOUR`] gates on a fourth, is where its energy is more than
//!    [`ENERGY_OVER_NOISE`] times the noise.
//!
//! A harmonic that noise hides follows the noise: docs/evaluation.md has what it costs.

use nalgebra::Complex;
use std::f64::consts::TAU;

/// Harmonics that are always fitted.
const LEAST_HARMONICS: usize = 2;
/// Gates from which on a third and a fourth harmonic can be told from noise.
const GATES_OF_THREE: usize = 8;
const GATES_OF_FOUR: usize = 16;
/// Energy of a harmonic that stands out, as a multiple of an order's noise. Energies of noise alone scatter by a tenth.
const ENERGY_OVER_NOISE: f64 = 1.5;

/// Number of harmonics that stand out of the noise of these gates, each voxel with its weight.
pub(super) fn harmonics_shown(images: &[Vec<f32>], weights: &[f32]) -> usize {
    let gates = images.len();
    let most = match gates {
        0..GATES_OF_THREE => return LEAST_HARMONICS,
        GATES_OF_THREE..GATES_OF_FOUR => 3,
        _ => 4,
    };
    let beyond = most + 1..=gates / 2;
    let orders = beyond.clone().count() as f64;
    let noise = beyond
        .map(|order| energy(images, weights, order))
        .sum::<f64>()
        / orders;
    (LEAST_HARMONICS + 1..=most)
        .take_while(|order| energy(images, weights, *order) > ENERGY_OVER_NOISE * noise)
        .last()
        .unwrap_or(LEAST_HARMONICS)
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
    fn a_harmonic_is_fitted_where_it_stands_out_of_the_noise() {
        let shown =
            |count, amplitudes: &[f64]| harmonics_shown(&gates(count, amplitudes), &[1.0; VOXELS]);
        for count in [6, 7, 8, 12, 16, 24, 32] {
            assert_eq!(shown(count, &[]), 2, "{count} gates of noise");
            assert_eq!(shown(count, &[3.0, 1.0, 0.1]), 2, "{count} gates");
        }
        for count in [8, 12, 16, 32] {
            assert_eq!(shown(count, &[3.0, 1.0, 1.0]), 3, "{count} gates");
        }
        for count in [16, 24, 32] {
            assert_eq!(shown(count, &[3.0, 1.0, 1.0, 1.0]), 4, "{count} gates");
        }
    }

    #[test]
    fn gates_that_stand_still_have_two() {
        let still = vec![vec![1.0; VOXELS]; 8];
        assert_eq!(harmonics_shown(&still, &[1.0; VOXELS]), 2);
    }

    #[test]
    fn gates_that_begin_elsewhere_in_the_cycle_show_the_same() {
        let mut images = gates(16, &[3.0, 1.0, 0.6]);
        let shown = harmonics_shown(&images, &[1.0; VOXELS]);
        for _ in 0..16 {
            images.rotate_left(1);
            assert_eq!(harmonics_shown(&images, &[1.0; VOXELS]), shown);
        }
    }
}
