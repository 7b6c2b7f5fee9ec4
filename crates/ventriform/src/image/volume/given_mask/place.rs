//! A mask on the grid of a volume.
//!
//! Two grids are of one lattice if the map from the voxel indices of one to those of the other is a
//! permutation of axes with signs and whole steps, within [`SAME_LATTICE_VOXELS`] of a voxel everywhere on the mask.
//! Such a mask is carried over voxel by voxel, exactly.

use super::GivenMask;
use super::error::GivenMaskError;
use super::geometry::GridGeometry;
use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::Monitor;
use crate::image::grid::voxelise::{Mask, voxelise};
use nalgebra::Matrix3;

/// Largest distance of corresponding voxel centres of one lattice, in voxels.
const SAME_LATTICE_VOXELS: f64 = 1e-3;

/// Voxels between two checks of the cancel token.
const VOXELS_PER_CHECK: usize = 1 << 14;

/// Rows of voxels between two checks of the cancel token.
const ROWS_PER_CHECK: usize = 1024;

/// Most voxels of the box that holds two masks.
const MOST_VOXELS: u64 = 1 << 28;

/// A mask on the grid of a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedMask {
    /// The mask.
    pub mask: Mask,
    /// Whether it is not of the same lattice and was resampled by the nearest voxel.
    pub resampled: bool,
    /// Voxels of the given mask that lie outside the grid and are lost; at most a hundredth.
    pub outside: usize,
}

impl GivenMask {
    /// The mask on the grid of `shape` at `frame`. With `resample`, one of another lattice takes the
    /// value of the nearest voxel.
    ///
    /// # Errors
    /// [`GivenMaskError::Elsewhere`] if more than a hundredth of the mask lies outside the grid,
    /// [`GivenMaskError::OtherGrid`] for another lattice without `resample`,
    /// [`GivenMaskError::Empty`] if no voxel of the grid is hit.
    pub fn on(
        &self,
        (shape, frame): ([usize; 3], &VoxelToPatient),
        resample: bool,
        monitor: &Monitor,
    ) -> Result<PlacedMask, GivenMaskError> {
        let lattice = self.lattice(frame);
        let mut mask = Mask::empty(shape);
        let (mut inside, mut all) = (0, 0);
        for (v, set) in self.mask.voxels.iter().enumerate() {
            if v % VOXELS_PER_CHECK == 0 {
                monitor.check()?;
            }
            if !*set {
                continue;
            }
            all += 1;
            let index = frame.to_voxel(&self.centre(v));
            let Some(place) = voxel(&index, shape) else {
                continue;
            };
            inside += 1;
            if lattice.is_some() {
                mask.voxels[place] = true;
            }
        }
        let [own, other] = [(self.mask.shape, &self.frame), (shape, frame)]
            .map(|(shape, frame)| Box::new(GridGeometry::new(shape, frame)));
        if inside * 100 < all * 99 {
            return Err(GivenMaskError::Elsewhere {
                inside,
                all,
                mask: own,
                grid: other,
            });
        }
        if let Some(surface) = &self.surface {
            let mask = voxelise(surface, shape, frame, monitor)?;
            if !mask.voxels.contains(&true) {
                return Err(GivenMaskError::Empty);
            }
            return Ok(PlacedMask {
                mask,
                resampled: false,
                outside: all - inside,
            });
        }
        if lattice.is_none() && !resample {
            return Err(GivenMaskError::OtherGrid {
                mask: own,
                grid: other,
            });
        }
        if lattice.is_none() {
            let [nx, ny, _] = shape;
            for (v, set) in mask.voxels.iter_mut().enumerate() {
                if v % VOXELS_PER_CHECK == 0 {
                    monitor.check()?;
                }
                let index = [v % nx, v / nx % ny, v / (nx * ny)].map(|x| x as f64);
                let own = self.frame.to_voxel(&frame.to_patient(&Vec3::from(index)));
                *set = voxel(&own, self.mask.shape).is_some_and(|own| self.mask.voxels[own]);
            }
        }
        if !mask.voxels.contains(&true) {
            return Err(GivenMaskError::Empty);
        }
        Ok(PlacedMask {
            mask,
            resampled: lattice.is_none(),
            outside: all - inside,
        })
    }

    /// The mask on a grid of the same lattice that holds `other`, too.
    ///
    /// # Errors
    /// [`GivenMaskError::TooFarApart`].
    pub fn holding(&self, other: &Self, monitor: &Monitor) -> Result<Self, GivenMaskError> {
        let (mut low, mut high) = ([0_i64; 3], self.mask.shape.map(|n| n as i64 - 1));
        for (v, set) in other.mask.voxels.iter().enumerate() {
            if v % VOXELS_PER_CHECK == 0 {
                monitor.check()?;
            }
            if !*set {
                continue;
            }
            let index = self.frame.to_voxel(&other.centre(v));
            for axis in 0..3 {
                // A cast of a float beyond the integers ends at their bounds.
                low[axis] = low[axis].min(index[axis].round() as i64);
                high[axis] = high[axis].max(index[axis].round() as i64);
            }
        }
        let extent = [0, 1, 2].map(|a| high[a].saturating_sub(low[a]).saturating_add(1) as u64);
        let voxels = extent.iter().fold(1_u64, |n, e| n.saturating_mul(*e));
        let limit = MOST_VOXELS.max(self.mask.voxels.len() as u64);
        if voxels > limit {
            return Err(GivenMaskError::TooFarApart { voxels, limit });
        }
        let shape = extent.map(|e| e as usize);
        let mut mask = Mask::empty(shape);
        let before = low.map(|l| -l as usize);
        let [nx, ny, _] = self.mask.shape;
        for (row, values) in self.mask.voxels.chunks(nx).enumerate() {
            if row % ROWS_PER_CHECK == 0 {
                monitor.check()?;
            }
            let (j, k) = (row % ny + before[1], row / ny + before[2]);
            let begin = before[0] + shape[0] * (j + shape[1] * k);
            mask.voxels[begin..begin + nx].copy_from_slice(values);
        }
        let corner = Vec3::from(low.map(|l| l as f64));
        let frame = VoxelToPatient::new(*self.frame.linear(), self.frame.to_patient(&corner));
        Ok(Self {
            mask,
            frame: frame.expect("a moved frame is as invertible as the mask's own"),
            structure: self.structure.clone(),
            surface: self.surface.clone(),
        })
    }

    /// The patient's point at a voxel's centre.
    fn centre(&self, v: usize) -> Vec3 {
        let [nx, ny, _] = self.mask.shape;
        let index = [v % nx, v / nx % ny, v / (nx * ny)];
        self.frame.to_patient(&Vec3::from(index.map(|x| x as f64)))
    }

    /// The map between the axes, if the mask is of the lattice of `frame`.
    fn lattice(&self, frame: &VoxelToPatient) -> Option<Matrix3<f64>> {
        let at = |index: [f64; 3]| frame.to_voxel(&self.frame.to_patient(&Vec3::from(index)));
        let origin = at([0.0; 3]);
        let steps = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let turn = Matrix3::from_columns(&steps.map(|step| at(step) - origin)).map(f64::round);
        let whole = |m: &Matrix3<f64>| {
            let lines = (0..3).flat_map(|n| [m.row(n).transpose(), m.column(n).into_owned()]);
            lines.into_iter().all(|line| line.abs().sum() == 1.0)
        };
        if !whole(&turn) {
            return None;
        }
        let first = origin.map(f64::round);
        let near = |c: usize| {
            let end = [0, 1, 2].map(|a| match c >> a & 1 {
                0 => 0.0,
                _ => self.mask.shape[a] as f64 - 1.0,
            });
            (at(end) - (turn * Vec3::from(end) + first)).amax() <= SAME_LATTICE_VOXELS
        };
        (0..8).all(near).then_some(turn)
    }
}

/// The voxel of a grid of `shape` that holds the fractional index; `None` outside.
fn voxel(index: &Vec3, shape: [usize; 3]) -> Option<usize> {
    let inside = (0..3).all(|a| index[a] > -0.5 && index[a] < shape[a] as f64 - 0.5);
    inside.then(|| {
        let [i, j, k] = [0, 1, 2].map(|a| index[a].round().max(0.0) as usize);
        i + shape[0] * (j + shape[1] * k)
    })
}
