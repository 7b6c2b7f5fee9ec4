//! The cavity of a ventricle as a mask, from its wall and long axis.

use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::model::wall::VentricleWall;
use crate::image::grid::voxelise::Mask;
use crate::image::locate::cup::Cup;
use crate::mesh::TriMesh;
use crate::results::report::LongAxis;

/// The voxels of the cavity within the wall `mesh` (LPS mm) with the long axis `axis`, whose mask on the grid at
/// `frame` is `wall`. `superior` is the direction to the patient's head, LPS. `None` if the axis has no length.
///
/// # Errors
/// [`Cancelled`].
pub fn cavity(
    axis: &LongAxis,
    superior: &Vec3,
    mesh: &TriMesh,
    wall: &Mask,
    frame: &VoxelToPatient,
    monitor: &Monitor<'_>,
) -> Result<Option<Mask>, Cancelled> {
    let [base, apex] = axis.ends();
    let Some(axis) = (apex - base).try_normalize(1e-6) else {
        return Ok(None);
    };
    let cup = Cup {
        centre: (base + apex) / 2.0,
        axis,
        length: (apex - base).norm(),
        breadth: 1.0,
    };
    let seen = VentricleWall::new(mesh, &cup, superior, monitor)?;
    seen.cavity(wall, frame, monitor).map(Some)
}
