//! The voxels to surface.

use std::borrow::Cow;

use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;
use crate::image::grid::Volume;
use crate::image::grid::labels::Labels;

/// The voxels to surface, and the samples that place the vertices.
pub(super) struct Object<'a> {
    pub labels: Labels,
    pub values: Cow<'a, [f32]>,
    pub shape: [usize; 3],
    pub frame: VoxelToPatient,
    pub iso: f32,
    /// `None` for intensities.
    pub mask: Option<MaskObject>,
}

/// Settings for the surface of a mask.
#[derive(Debug, Clone, Copy)]
pub(super) struct MaskObject {
    /// Passes of Taubin's smoothing.
    pub passes: usize,
    /// Parts left out before smoothing, and their voxels.
    pub dropped: [usize; 2],
    /// Voxels added between parts that touch along edges or at corners only.
    pub joined: usize,
}

impl<'a> Object<'a> {
    /// Some voxels of `volume`, whose values place the vertices.
    pub fn whole(volume: &'a Volume, labels: Labels, iso: f32) -> Self {
        Self {
            labels,
            values: volume.voxels.as_slice().into(),
            shape: volume.shape,
            frame: volume.frame.clone(),
            iso,
            mask: None,
        }
    }

    /// The value at a point of the patient, LPS mm, interpolated trilinearly. Beyond the border the value
    /// at the border continues; values that are not finite count as 0.
    pub fn at(&self, p: &Vec3) -> f64 {
        let index = self.frame.to_voxel(p);
        let mut corner = [0; 3];
        let mut share = [0.0; 3];
        for r in 0..3 {
            let place = index[r].clamp(0.0, (self.shape[r] - 1) as f64);
            corner[r] = (place as usize).min(self.shape[r].saturating_sub(2));
            share[r] = place - corner[r] as f64;
        }
        let mut sum = 0.0;
        for n in 0..8 {
            let side = [n & 1, n >> 1 & 1, n >> 2];
            let weight: f64 = (0..3)
                .map(|r| {
                    if side[r] == 1 {
                        share[r]
                    } else {
                        1.0 - share[r]
                    }
                })
                .product();
            let [i, j, k] = [0, 1, 2].map(|r| (corner[r] + side[r]).min(self.shape[r] - 1));
            let value = self.values[i + self.shape[0] * (j + self.shape[1] * k)];
            if value.is_finite() {
                sum += weight * f64::from(value);
            }
        }
        sum
    }
}
