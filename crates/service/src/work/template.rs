//! From a mesh to a template of the library.
//!
//! The mesh may be in any format that [`files`] reads; it is stored as our own JSON, LPS mm, and in every format.

use super::failures::{unknown_organ, unsuitable_mesh};
use super::files::mesh_file;
use crate::base::records::Failure;
use crate::items::{OutputFile, WorkOutput};
use ventriform::base::progress::Monitor;
use ventriform::heart::model::{Organ, Template, wall_parts};
use ventriform::mesh::files::{self, MeshStatement};
use ventriform::results::export::{Format, Metadata};
use ventriform::results::report::{TemplateSummary, object};
use ventriform::runs::advice::Explain;

/// Largest mesh of a template: a model to be fitted has at most 5000 points of about 200 bytes, and as many
/// bytes of triangles.
pub const TEMPLATE_BYTES: u64 = 4 << 20;

/// Checks that a mesh can serve as a template of `organ`. Returns its main figures, what was assumed of it, and the
/// mesh in every format.
///
/// # Errors
/// If the organ is unknown, the mesh cannot be parsed, or it cannot be fitted.
pub(super) fn make(
    mesh: &[u8],
    organ: &str,
    stated: &MeshStatement,
) -> Result<WorkOutput, Failure> {
    let read = files::read(mesh, stated, TEMPLATE_BYTES).map_err(|error| error.explain())?;
    let (mesh, notes) = (read.mesh, read.notes);
    let organ = Organ::parse(organ).ok_or_else(|| unknown_organ(organ))?;
    let template =
        Template::new(mesh, organ, &Monitor::silent()).map_err(|error| error.explain())?;
    let metadata = Metadata::new(format!("Template of a {}", organ.as_str()));
    let parts = match &template.cup {
        // A silent monitor is never cancelled.
        Some(cup) => wall_parts(&template.mesh, cup, &Monitor::silent()).unwrap_or_default(),
        None => None,
    };
    let metadata = Metadata {
        parts: parts.unwrap_or_default(),
        ..metadata
    };
    let files: Vec<OutputFile> = Format::ALL
        .into_iter()
        .map(|format| mesh_file(format, &template.mesh, &metadata))
        .collect::<Result<_, _>>()
        .map_err(|error| unsuitable_mesh(&error))?;
    let summary = TemplateSummary {
        vertices: template.mesh.vertices.len(),
        triangles: template.mesh.triangles.len(),
        volume_ml: template.mesh.volume() / 1000.0,
        length_mm: template.cup.map(|cup| cup.length),
        warnings: notes,
    };
    Ok(WorkOutput {
        summary: object(&summary),
        files,
    })
}
