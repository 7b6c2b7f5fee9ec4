//! Where a grid lies, in words.

use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;

/// Where a grid of voxels lies, for people to compare.
#[derive(Debug, Clone, PartialEq)]
pub struct GridGeometry {
    /// Voxels along i, j, k.
    pub shape: [usize; 3],
    /// Distances of voxel centres along i, j, k, mm.
    pub spacing: [f64; 3],
    /// Centre of the first voxel, LPS mm.
    pub origin: [f64; 3],
    /// Directions of i, j, k, LPS.
    pub axes: [[f64; 3]; 3],
}

impl GridGeometry {
    pub(super) fn new(shape: [usize; 3], frame: &VoxelToPatient) -> Self {
        let axis = |a: usize| frame.linear().column(a).normalize().into();
        Self {
            shape,
            spacing: frame.spacing(),
            origin: frame.to_patient(&Vec3::zeros()).into(),
            axes: [0, 1, 2].map(axis),
        }
    }
}

impl std::fmt::Display for GridGeometry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [i, j, k] = self.shape;
        let list = |numbers: &[f64; 3]| {
            // Adding 0 turns negative zeros into positive ones.
            let round = |x: &f64| ((x * 1e4).round() / 1e4 + 0.0).to_string();
            numbers.iter().map(round).collect::<Vec<_>>().join(", ")
        };
        let axes = self.axes.iter().map(|axis| format!("({})", list(axis)));
        write!(
            f,
            "{i} x {j} x {k} voxels of {} mm from ({}) mm along {}",
            list(&self.spacing).replace(", ", " x "),
            list(&self.origin),
            axes.collect::<Vec<_>>().join(" ")
        )
    }
}
