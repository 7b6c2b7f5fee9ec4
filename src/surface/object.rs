//! The voxels to surface.

use std::borrow::Cow;

use crate::geometry::frame::VoxelToPatient;
use crate::grid::labels::Labels;
use crate::volume::Volume;

/// The voxels to surface, and the samples that place the vertices.
pub(super) struct Object<'a> {
    pub labels: Labels,
    pub values: Cow<'a, [f32]>,
    pub shape: [usize; 3],
    pub frame: VoxelToPatient,
    pub iso: f32,
    pub is_mask: bool,
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
            is_mask: false,
        }
    }
}
