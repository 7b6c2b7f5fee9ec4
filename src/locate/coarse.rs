//! The volume on a coarser grid, where the ventricle is searched.
//!
//! Voxels are averaged in blocks: the search needs organs, not noise, and its cost must not
//! grow with the resolution.

use std::borrow::Cow;

use crate::geometry::Vec3;
use crate::grid::survey::Survey;
use crate::grid::volume::Volume;
use crate::progress::{Cancelled, Monitor};

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
    /// Middle of the first block against that of the first voxel, mm.
    shift: Vec3,
}

impl<'a> Coarse<'a> {
    /// Averages `volume` to blocks of at most `size` mm, or of one voxel where that is larger; the
    /// minimum that `survey` found stands in for what is not finite.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn new(
        volume: &'a Volume,
        size: f64,
        survey: &Survey,
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let fine = volume.frame.spacing();
        let factor = [0, 1, 2].map(|r| ((size / fine[r]) as usize).clamp(1, volume.shape[r]));
        let shape = [0, 1, 2].map(|r| volume.shape[r] / factor[r]);
        let spacing = [0, 1, 2].map(|r| fine[r] * factor[r] as f64);
        let (values, maximum): (Cow<[f32]>, f32) = if factor == [1; 3] && survey.not_finite == 0 {
            (Cow::Borrowed(&volume.voxels), survey.maximum)
        } else {
            let means = block_means(volume, shape, factor, survey.minimum, monitor)?;
            let maximum = means.iter().copied().fold(survey.minimum, f32::max);
            (Cow::Owned(means), maximum)
        };
        Ok(Self {
            values,
            shape,
            spacing,
            factor,
            maximum,
            inverse_spacing: Vec3::from(spacing.map(|s| 1.0 / s)),
            shift: Vec3::from_fn(|r, _| (spacing[r] - fine[r]) / 2.0),
        })
    }

    /// The value of the block at `p` (mm along the array's axes); 0 beyond the border.
    pub fn at_mm(&self, p: &Vec3) -> f64 {
        let mut index = [0; 3];
        for r in 0..3 {
            let x = (p[r] - self.shift[r]) * self.inverse_spacing[r] + 0.5;
            // Negative numbers saturate at 0 in the cast and would land in the first block.
            if x < 0.0 || x >= self.shape[r] as f64 {
                return 0.0;
            }
            index[r] = x as usize;
        }
        let [i, j, k] = index;
        f64::from(self.values[i + self.shape[0] * (j + self.shape[1] * k)])
    }

    /// Middle of block `index`, mm along the array's axes from the first voxel's middle.
    pub fn position(&self, index: [usize; 3]) -> Vec3 {
        Vec3::from_fn(|r, _| index[r] as f64 * self.spacing[r] + self.shift[r])
    }

    /// Middle of the grid, mm.
    pub fn middle(&self) -> Vec3 {
        Vec3::from_fn(|r, _| (self.shape[r] as f64 - 1.0) / 2.0 * self.spacing[r] + self.shift[r])
    }

    /// Half the longest side, mm.
    pub fn half_extent(&self) -> f64 {
        (0..3)
            .map(|r| self.shape[r] as f64 * self.spacing[r] / 2.0)
            .fold(0.0, f64::max)
    }
}

fn block_means(
    volume: &Volume,
    shape: [usize; 3],
    factor: [usize; 3],
    missing: f32,
    monitor: &Monitor,
) -> Result<Vec<f32>, Cancelled> {
    use rayon::prelude::*;
    let share = 1.0 / factor.iter().product::<usize>() as f32;
    let width = shape[0] * factor[0];
    let mut means = vec![0.0; shape.iter().product()];
    means
        .par_chunks_mut(shape[0] * shape[1])
        .enumerate()
        .try_for_each(|(k, plane)| {
            monitor.check()?;
            let mut line = vec![0f32; width];
            for (j, row) in plane.chunks_mut(shape[0]).enumerate() {
                line.fill(0.0);
                for c in k * factor[2]..(k + 1) * factor[2] {
                    for b in j * factor[1]..(j + 1) * factor[1] {
                        let start = volume.shape[0] * (b + volume.shape[1] * c);
                        for (sum, &v) in line.iter_mut().zip(&volume.voxels[start..]) {
                            *sum += if v.is_finite() { v } else { missing };
                        }
                    }
                }
                for (mean, block) in row.iter_mut().zip(line.chunks_exact(factor[0])) {
                    *mean = block.iter().sum::<f32>() * share;
                }
            }
            Ok(())
        })?;
    Ok(means)
}
