//! The grey values that the ray search reads: block means by place along the array's axes.
//!
//! Blocks keep the search's cost from growing with the resolution, and noise out of it. Places
//! are millimetres along the array's axes from the middle of voxel (0, 0, 0), so that a step
//! along a ray needs no matrix.

use std::borrow::Cow;

use crate::base::geometry::Vec3;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::blocks::{self, BlockMeans};
use crate::image::grid::survey;
use crate::image::grid::volume::Volume;

/// Block means of a volume; its own voxels where a block is one voxel.
#[derive(Debug, Clone)]
pub struct GreyBlocks<'a> {
    /// Values, i fastest; 0 stands for those that are not finite.
    pub values: Cow<'a, [f32]>,
    /// Number of blocks along i, j, k.
    pub shape: [usize; 3],
    /// Size of a block, mm.
    pub spacing: [f64; 3],
    /// Largest value.
    pub maximum: f32,
    inverse_spacing: Vec3,
    /// Middle of the first block against that of the first voxel, mm.
    shift: Vec3,
}

impl<'a> GreyBlocks<'a> {
    /// Averages `volume` over blocks of at most `size` mm, or of one voxel where that is larger.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn new(volume: &'a Volume, size: f64, monitor: &Monitor) -> Result<Self, Cancelled> {
        let fine = volume.frame.spacing();
        let factor = factor(volume, size);
        let voxels = volume.voxels.as_slice();
        let own = match factor {
            [1, 1, 1] => Some(survey::range(voxels, monitor)?),
            _ => None,
        };
        let (values, shape, maximum) = match own {
            Some((_, maximum, 0)) => (Cow::Borrowed(voxels), volume.shape, maximum),
            _ => {
                let means = BlockMeans::new(volume, blocks::whole(volume), factor, monitor)?;
                let maximum = means
                    .values
                    .iter()
                    .copied()
                    .fold(f32::NEG_INFINITY, f32::max);
                (Cow::Owned(means.values), means.shape, maximum)
            }
        };
        let spacing = [0, 1, 2].map(|r| fine[r] * factor[r] as f64);
        Ok(Self {
            maximum,
            values,
            shape,
            spacing,
            inverse_spacing: Vec3::from(spacing.map(|s| 1.0 / s)),
            shift: Vec3::from_fn(|r, _| (spacing[r] - fine[r]) / 2.0),
        })
    }

    /// Whether blocks of at most `size` mm of `volume` have as many voxels as those of at most
    /// `other` mm.
    pub fn alike(volume: &Volume, size: f64, other: f64) -> bool {
        factor(volume, size) == factor(volume, other)
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

/// Voxels along i, j, k of blocks of at most `size` mm.
fn factor(volume: &Volume, size: f64) -> [usize; 3] {
    let fine = volume.frame.spacing();
    [0, 1, 2].map(|r| ((size / fine[r]) as usize).clamp(1, volume.shape[r]))
}
