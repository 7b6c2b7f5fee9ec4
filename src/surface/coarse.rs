//! The volume on a grid of about 4 mm, where the ventricle is searched.
//!
//! Finer voxels are averaged in blocks: the search needs organs, not noise, and its cost must
//! not grow with the resolution.

use std::borrow::Cow;

use crate::geometry::Vec3;
use crate::volume::Volume;

/// Voxels coarser than this are taken as they are, mm.
const FINE_ENOUGH: f64 = 3.0;

/// Block means of a volume.
#[derive(Debug, Clone)]
pub struct Coarse<'a> {
    /// Values, i fastest; NaN counts as the volume's minimum.
    pub values: Cow<'a, [f32]>,
    /// Number of blocks along i, j, k.
    pub shape: [usize; 3],
    /// Size of a block, mm.
    pub spacing: [f64; 3],
    /// Voxels in a block along i, j, k.
    pub factor: [usize; 3],
    /// Largest value.
    pub maximum: f32,
    inverse_spacing: Vec3,
}

impl<'a> Coarse<'a> {
    /// Averages `volume`; `minimum` stands in for NaN and is what lies beyond the border.
    pub fn new(volume: &'a Volume, minimum: f32, has_nan: bool) -> Self {
        let fine = volume.frame.spacing();
        let factor = [0, 1, 2].map(|r| {
            let wanted = if fine[r] < FINE_ENOUGH {
                (4.0 / fine[r]).floor()
            } else {
                1.0
            };
            (wanted as usize).clamp(1, volume.shape[r])
        });
        let shape = [0, 1, 2].map(|r| volume.shape[r] / factor[r]);
        let spacing = [0, 1, 2].map(|r| fine[r] * factor[r] as f64);
        let values: Cow<[f32]> = if factor == [1; 3] && !has_nan {
            Cow::Borrowed(&volume.voxels)
        } else {
            Cow::Owned(block_means(volume, shape, factor, minimum))
        };
        let maximum = values.iter().copied().fold(minimum, f32::max);
        Self {
            values,
            shape,
            spacing,
            factor,
            maximum,
            inverse_spacing: Vec3::from(spacing.map(|s| 1.0 / s)),
        }
    }

    /// The value of the block at `p` (mm along the array's axes); 0 beyond the border.
    pub fn at_mm(&self, p: &Vec3) -> f64 {
        let mut index = [0; 3];
        for r in 0..3 {
            let x = p[r] * self.inverse_spacing[r] + 0.5;
            // Negative numbers saturate at 0 in the cast and would land in the first block.
            if x < 0.0 || x >= self.shape[r] as f64 {
                return 0.0;
            }
            index[r] = x as usize;
        }
        let [i, j, k] = index;
        f64::from(self.values[i + self.shape[0] * (j + self.shape[1] * k)])
    }

    /// Middle of the grid, mm.
    pub fn middle(&self) -> Vec3 {
        Vec3::from_fn(|r, _| (self.shape[r] as f64 - 1.0) / 2.0 * self.spacing[r])
    }

    /// Half the longest side, mm.
    pub fn half_extent(&self) -> f64 {
        (0..3)
            .map(|r| self.shape[r] as f64 * self.spacing[r] / 2.0)
            .fold(0.0, f64::max)
    }
}

fn block_means(volume: &Volume, shape: [usize; 3], factor: [usize; 3], minimum: f32) -> Vec<f32> {
    use rayon::prelude::*;
    let share = 1.0 / factor.iter().product::<usize>() as f32;
    let mut means = vec![0.0; shape.iter().product()];
    means
        .par_chunks_mut(shape[0] * shape[1])
        .enumerate()
        .for_each(|(k, plane)| {
            for (at, mean) in plane.iter_mut().enumerate() {
                let (i, j) = (at % shape[0] * factor[0], at / shape[0] * factor[1]);
                let mut sum = 0.0;
                for c in k * factor[2]..(k + 1) * factor[2] {
                    for b in j..j + factor[1] {
                        let start = i + volume.shape[0] * (b + volume.shape[1] * c);
                        for &v in &volume.voxels[start..start + factor[0]] {
                            sum += if v.is_finite() { v } else { minimum };
                        }
                    }
                }
                *mean = sum * share;
            }
        });
    means
}
