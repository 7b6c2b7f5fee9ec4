//! Means over blocks of voxels: a volume on a coarser grid.
//!
//! In: a volume, a window of voxel indices, and how many voxels make a block along each axis.
//! Out: one mean for each block, `i` fastest. Voxels at the window's end that do not fill a block
//! are left out.
//!
//! Every block is summed in the order of its voxels in memory, so the means do not depend on the
//! number of threads. Values that are not finite count as 0: no uptake.

use rayon::prelude::*;

use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::volume::Volume;

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
                        match factor[0] {
                            1 => add_row::<1>(sums, row),
                            2 => add_row::<2>(sums, row),
                            3 => add_row::<3>(sums, row),
                            4 => add_row::<4>(sums, row),
                            n => add_blocks(sums, row.chunks_exact(n)),
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

/// [`add_blocks`] for blocks of a width known to the compiler, several times as fast.
fn add_row<const N: usize>(sums: &mut [f32], row: &[f32]) {
    add_blocks(sums, row.as_chunks::<N>().0.iter().map(|b| &b[..]));
}

/// Adds the finite values of each block to its sum, in their order.
#[inline]
fn add_blocks<'a>(sums: &mut [f32], blocks: impl Iterator<Item = &'a [f32]>) {
    for (sum, block) in sums.iter_mut().zip(blocks) {
        for v in block {
            *sum += if v.is_finite() { *v } else { 0.0 };
        }
    }
}

/// The whole of `volume` as a window.
pub fn whole(volume: &Volume) -> Window {
    volume.shape.map(|n| (0, n))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::base::geometry::frame::VoxelToPatient;

    #[test]
    fn means_of_all_widths_are_those_of_the_finite_voxels() {
        let shape = [13, 7, 5];
        let mut voxels: Vec<f32> = (0..shape.iter().product::<usize>())
            .map(|n| (n * n % 97) as f32 / 3.0)
            .collect();
        voxels[40] = f32::NAN;
        voxels[41] = f32::INFINITY;
        let volume = Volume {
            shape,
            frame: VoxelToPatient::centred(shape, [2.0; 3], Vec3::zeros()).unwrap(),
            voxels,
            integral: false,
        };
        for width in 1..=6 {
            let factor = [width, 2, 3];
            let window = [(1, 13), (0, 7), (1, 5)];
            let found = BlockMeans::new(&volume, window, factor, &Monitor::silent()).unwrap();
            assert_eq!(found.shape, [12 / width, 3, 1]);
            for j in 0..3 {
                for i in 0..12 / width {
                    let mut sum = 0.0;
                    for (c, b, a) in (0..3)
                        .flat_map(|c| (0..2).flat_map(move |b| (0..width).map(move |a| (c, b, a))))
                    {
                        let v = volume.at(1 + i * width + a, 2 * j + b, 1 + c);
                        sum += if v.is_finite() { v } else { 0.0 };
                    }
                    let mean = sum / (6 * width) as f32;
                    assert_eq!(found.values[i + 12 / width * j], mean, "{width} {i} {j}");
                }
            }
        }
    }
}
