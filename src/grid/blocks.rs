//! Means over blocks of voxels: a volume on a coarser grid.
//!
//! In: a volume, a window of voxel indices, and how many voxels make a block along each axis.
//! Out: one mean for each block, `i` fastest. Voxels at the window's end that do not fill a block
//! are left out.
//!
//! Every block is summed in the order of its voxels in memory, so the means do not depend on the
//! number of threads. Values that are not finite count as 0: no uptake.

use rayon::prelude::*;

use crate::grid::volume::Volume;
use crate::progress::{Cancelled, Monitor};

/// First voxel and end (exclusive) along i, j, k.
pub type Window = [(usize, usize); 3];

/// Block means and where the blocks lie.
#[derive(Debug, Clone)]
pub struct BlockMeans {
    /// The means, i fastest.
    pub values: Vec<f32>,
    /// Number of blocks along i, j, k; each at least 1.
    pub shape: [usize; 3],
    /// Voxels in a block along i, j, k.
    pub factor: [usize; 3],
    /// The first block's first voxel.
    pub origin: [usize; 3],
}

impl BlockMeans {
    /// Averages `window` of `volume` over blocks of `factor` voxels.
    ///
    /// `window` must lie in the volume and hold at least one voxel; factors above its width
    /// are lowered to it.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn new(
        volume: &Volume,
        window: Window,
        factor: [usize; 3],
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let origin = window.map(|(first, _)| first);
        let width = window.map(|(first, end)| end - first);
        let factor = [0, 1, 2].map(|a| factor[a].clamp(1, width[a]));
        let shape = [0, 1, 2].map(|a| width[a] / factor[a]);
        let count = factor.iter().product::<usize>() as f32;
        let mut values = vec![0f32; shape.iter().product()];
        let planes = values.par_chunks_mut(shape[0] * shape[1]);
        planes.enumerate().try_for_each(|(k, plane)| {
            monitor.check()?;
            for c in 0..factor[2] {
                for (j, sums) in plane.chunks_mut(shape[0]).enumerate() {
                    for b in 0..factor[1] {
                        let y = origin[1] + j * factor[1] + b;
                        let z = origin[2] + k * factor[2] + c;
                        let row = origin[0] + volume.shape[0] * (y + volume.shape[1] * z);
                        let row = &volume.voxels[row..row + shape[0] * factor[0]];
                        for (sum, block) in sums.iter_mut().zip(row.chunks_exact(factor[0])) {
                            for v in block {
                                *sum += if v.is_finite() { *v } else { 0.0 };
                            }
                        }
                    }
                }
            }
            plane.iter_mut().for_each(|v| *v /= count);
            Ok(())
        })?;
        Ok(Self {
            values,
            shape,
            factor,
            origin,
        })
    }
}

/// The whole of `volume` as a window.
pub fn whole(volume: &Volume) -> Window {
    volume.shape.map(|n| (0, n))
}
