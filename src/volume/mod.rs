//! A reconstructed volume: voxels and the map that puts them into the patient.
//!
//! STUB: the owner of this folder writes the module page.

use crate::geometry::frame::VoxelToPatient;

/// Voxel values on a regular grid with its place in the patient.
///
/// The value of voxel (i, j, k) stands at `i + nx * (j + ny * k)`: i runs fastest.
#[derive(Debug, Clone)]
pub struct Volume {
    /// Number of voxels along i, j, k; each at least 1.
    pub shape: [usize; 3],
    /// The values, `shape[0] * shape[1] * shape[2]` of them, slope and intercept applied.
    /// May hold NaN where the file does.
    pub voxels: Vec<f32>,
    /// Voxel index to LPS millimetres.
    pub frame: VoxelToPatient,
    /// Whether the file's data type was an integer one and no slope made fractions of it: a
    /// candidate for a label map.
    pub integral: bool,
}

impl Volume {
    /// The value of voxel (i, j, k).
    ///
    /// # Panics
    /// If an index is out of range.
    pub fn at(&self, i: usize, j: usize, k: usize) -> f32 {
        assert!(i < self.shape[0] && j < self.shape[1] && k < self.shape[2]);
        self.voxels[i + self.shape[0] * (j + self.shape[1] * k)]
    }
}
