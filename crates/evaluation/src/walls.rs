//! The walls of fits beside the true walls of simulated hearts.

use std::error::Error;
use std::path::Path;

use serde_json::Value;
use ventriform::TriMesh;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::bvh::{Aabb, Bvh};
use ventriform::heart::deform::WallSurface;
use ventriform::heart::deform::anatomical::ray_terms;
use ventriform::heart::deform::ray_terms::RayTerms;
use ventriform::heart::model::wall::crossing;
use ventriform::image::grid::Volume;
use ventriform::image::grid::field::Field;
use ventriform::mesh::files::{self, MeshFrame, MeshStatement, MeshUnit};
use ventriform::parameters::FitParameters;

/// Width of the image about the wall, mm.
const BORDER_MM: f64 = 25.0;
/// Most bytes of a mesh.
const MAX_MESH_BYTES: u64 = 1 << 28;

/// The result of an instrument.
pub type Result<T> = std::result::Result<T, Box<dyn Error + Send + Sync>>;

/// The true wall of the case in a folder, `lv_surface.ply`, LPS mm; `None` if it has no heart.
///
/// # Errors
/// If params.json or the surface cannot be read.
pub fn true_wall(case: &Path) -> Result<Option<TriMesh>> {
    let params = std::fs::read(case.join("params.json"))?;
    let params: Value = serde_json::from_slice(&params)?;
    if params["made"] == "none" {
        return Ok(None);
    }
    let stated = MeshStatement {
        unit: Some(MeshUnit::Millimetre),
        frame: Some(MeshFrame::Ras),
    };
    let bytes = std::fs::read(case.join("lv_surface.ply"))?;
    Ok(Some(files::read(&bytes, &stated, MAX_MESH_BYTES)?.mesh))
}

/// Every `stride`th ray through the wall `apparent` that meets the `truth`: the numbers that describe it in the image
/// `scan`, and the distances by which the true inner and outer surface lie farther out, mm.
///
/// # Errors
/// If a direction has no wall.
pub fn true_shifts(
    apparent: &WallSurface,
    scan: &Volume,
    truth: &TriMesh,
    stride: usize,
) -> Result<Vec<(RayTerms, [f64; 2])>> {
    let mut region = Aabb::around(&apparent.mesh.vertices);
    region.min -= Vec3::repeat(BORDER_MM);
    region.max += Vec3::repeat(BORDER_MM);
    let image = Field::new(scan, Some(&region), FitParameters::default().deform.blur);
    let terms = ray_terms(&apparent.wall, &image).ok_or("a direction without a wall")?;
    let tree = Bvh::new(&truth.vertices, &truth.triangles);
    let shifts = apparent.wall.rays.iter().zip(terms).step_by(stride);
    let met = shifts.filter_map(|(ray, terms)| {
        let [inner, outer] = ray.wall?;
        let [real_inner, real_outer] = crossing(truth, &tree, &ray.start, &ray.direction)?;
        Some((terms, [real_inner - inner, real_outer - outer]))
    });
    Ok(met.collect())
}
