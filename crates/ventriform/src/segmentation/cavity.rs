//! The cavity of a ventricle as a mask, from what the files of a segmentation say.

use crate::geometry::Vec3;
use crate::geometry::frame::VoxelToPatient;
use crate::grid::voxelise::Mask;
use crate::locate::cup::Cup;
use crate::mesh::TriMesh;
use crate::model::wall::VentricleWall;
use crate::progress::{Cancelled, Monitor};
use serde_json::Value;

/// The voxels of the cavity within the wall `mesh` (LPS mm), whose mask on the grid at `frame` is `wall`.
/// The long axis and the patient's superior direction are those of the report; `None` if it states
/// none, as of organs without a cavity.
///
/// # Errors
/// [`Cancelled`].
pub fn cavity(
    report: &Value,
    mesh: &TriMesh,
    (wall, frame): (&Mask, &VoxelToPatient),
    monitor: &Monitor<'_>,
) -> Result<Option<Mask>, Cancelled> {
    let [base, apex, superior] = [
        "/fit/long_axis/base",
        "/fit/long_axis/apex",
        "/posture/superior",
    ]
    .map(|place| report.pointer(place).and_then(point));
    let (Some(base), Some(apex)) = (base, apex) else {
        return Ok(None);
    };
    let Some(axis) = (apex - base).try_normalize(1e-6) else {
        return Ok(None);
    };
    let cup = Cup {
        centre: (base + apex) / 2.0,
        axis,
        length: (apex - base).norm(),
        breadth: 1.0,
    };
    let superior = superior.unwrap_or_else(Vec3::z);
    let seen = VentricleWall::new(mesh, &cup, &superior, monitor)?;
    seen.cavity(wall, frame, monitor).map(Some)
}

fn point(value: &Value) -> Option<Vec3> {
    let numbers: Vec<f64> = value.as_array()?.iter().filter_map(Value::as_f64).collect();
    <[f64; 3]>::try_from(numbers).ok().map(Vec3::from)
}
