//! Slices that are cut across the heart instead of across the patient.
//!
//! Many hospitals store short-axis slices, whose third axis is the heart's long axis. A header that
//! states their directions in the patient places them as well as any; a header without directions (a
//! *plain* frame) says that they are axial, which they are not, and nothing tells the roll about the
//! long axis. In go a volume's frame and the heart's axis; out comes which axis of the grid it follows.
//!
//! Not told apart from short-axis slices: axial slices of a heart that points straight up, down,
//! forward or to the left by chance, of which too little body is in view to tell its own axis.

use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;

/// Greatest angle between the heart's axis and the third axis of the grid, across which slices are
/// stored, degrees. A patient's heart hardly ever points so straight up or down.
const MAX_THROUGH_ANGLE_DEG: f64 = 20.0;
/// Greatest angle to the first and the second axis of the grid, degrees. Hearts that lie flat or point
/// forward come near them.
const MAX_IN_PLANE_ANGLE_DEG: f64 = 8.0;
/// Greatest angle between the axes of a plain frame and the patient's, degrees.
const MAX_PLAIN_ANGLE_DEG: f64 = 1.0;

/// Slices cut across the heart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShortAxisSlices {
    /// The axis of the grid, 0..3, that follows the heart's.
    pub grid_axis: usize,
    /// Whether the apex lies at its first slices.
    pub apex_first: bool,
    /// Whether the frame's axes are the patient's, as those of a header without directions are.
    pub frame_is_plain: bool,
}

impl ShortAxisSlices {
    /// Whether a volume with this `frame`, whose heart has this `axis` (base to apex, unit vector), has
    /// slices across the heart.
    pub fn new(frame: &VoxelToPatient, axis: &Vec3) -> Option<Self> {
        let grid = [0, 1, 2].map(|a| frame.linear().column(a).normalize());
        let along = |a: &usize| axis.dot(&grid[*a]).abs();
        let limit = |a: usize| {
            if a == 2 {
                MAX_THROUGH_ANGLE_DEG
            } else {
                MAX_IN_PLANE_ANGLE_DEG
            }
        };
        let grid_axis = (0..3).max_by(|a, b| along(a).total_cmp(&along(b)))?;
        let plain = |direction: &Vec3| direction.amax() > MAX_PLAIN_ANGLE_DEG.to_radians().cos();
        (along(&grid_axis) > limit(grid_axis).to_radians().cos()).then(|| Self {
            grid_axis,
            apex_first: axis.dot(&grid[grid_axis]) < 0.0,
            frame_is_plain: grid.iter().all(plain),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Rotation3};

    #[test]
    fn an_axis_along_the_grid_is_told_with_the_end_of_its_apex() {
        let plain = VoxelToPatient::centred([64; 3], [4.0; 3], Vec3::zeros()).unwrap();
        let found = |axis: Vec3| ShortAxisSlices::new(&plain, &axis.normalize());
        let up = found(Vec3::new(0.2, 0.1, 1.0)).unwrap();
        assert_eq!((up.grid_axis, up.apex_first), (2, false));
        assert!(up.frame_is_plain);
        assert!(found(Vec3::new(0.0, 0.05, -1.0)).unwrap().apex_first);
        assert_eq!(found(Vec3::new(1.0, 0.1, 0.0)).unwrap().grid_axis, 0);
        for usual in [[0.64, -0.6, -0.48], [0.85, -0.5, 0.0], [1.0, 0.2, 0.0]] {
            assert_eq!(found(Vec3::from(usual)), None);
        }
    }

    #[test]
    fn an_oblique_frame_is_not_plain() {
        let axis = Vec3::new(0.64, -0.6, -0.48);
        let turn = Rotation3::rotation_between(&Vec3::z(), &axis).unwrap();
        let linear: Matrix3<f64> = turn.matrix() * 4.0;
        let frame = VoxelToPatient::new(linear, Vec3::zeros()).unwrap();
        let found = ShortAxisSlices::new(&frame, &axis).unwrap();
        assert!(!found.frame_is_plain && found.grid_axis == 2);
    }
}
