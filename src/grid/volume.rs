//! Voxels and the map that puts them into the patient.

use crate::geometry::Vec3;
use crate::geometry::frame::VoxelToPatient;

/// Voxel values on a regular grid with its place in the patient.
///
/// The value of voxel (i, j, k) stands at `i + nx * (j + ny * k)`: i runs fastest.
#[derive(Debug, Clone)]
pub struct Volume {
    /// Number of voxels along i, j, k; each at least 1.
    pub shape: [usize; 3],
    /// The values, `shape[0] * shape[1] * shape[2]` of them, slope and intercept applied.
    /// Never infinite; NaN where the file has no number.
    pub voxels: Vec<f32>,
    /// Voxel index to LPS millimetres.
    pub frame: VoxelToPatient,
    /// Whether every value that is a number is a whole one: a candidate for a label map.
    pub integral: bool,
}

impl Volume {
    /// The values of a function of place (LPS mm) at the centres of the voxels; not integral.
    pub fn sampled(shape: [usize; 3], frame: VoxelToPatient, value: impl Fn(&Vec3) -> f64) -> Self {
        let [nx, ny, nz] = shape;
        let centre = |v: usize| [v % nx, v / nx % ny, v / nx / ny].map(|index| index as f64);
        let at = |v: usize| value(&frame.to_patient(&Vec3::from(centre(v)))) as f32;
        Self {
            shape,
            voxels: (0..nx * ny * nz).map(at).collect(),
            frame,
            integral: false,
        }
    }

    /// The value of voxel (i, j, k).
    ///
    /// # Panics
    /// If an index is out of range.
    pub fn at(&self, i: usize, j: usize, k: usize) -> f32 {
        assert!(i < self.shape[0] && j < self.shape[1] && k < self.shape[2]);
        self.voxels[i + self.shape[0] * (j + self.shape[1] * k)]
    }
}
