//! From a mesh to a template of the library.

use super::files::mesh_file;
use super::problems::{Explain, unknown_organ, unsuitable_mesh};
use crate::export::{Format, Metadata, read_json};
use crate::jobs::{Failure, OutputFile, WorkOutput};
use crate::model::{Organ, Template, wall_parts};
use crate::progress::Monitor;
use serde_json::json;

/// Checks that a JSON mesh can serve as a template of `organ`. Returns its main figures and the
/// mesh in every format.
///
/// # Errors
/// If the organ is unknown, the mesh cannot be parsed, or it cannot be fitted.
pub(super) fn make(mesh: &[u8], organ: &str) -> Result<WorkOutput, Failure> {
    let mesh = read_json::decode(mesh).map_err(|error| error.explain())?;
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
    let summary = [
        ("vertices", json!(template.mesh.vertices.len())),
        ("triangles", json!(template.mesh.triangles.len())),
        ("volume_ml", json!(template.mesh.volume() / 1000.0)),
        ("length_mm", json!(template.cup.map(|cup| cup.length))),
    ];
    Ok(WorkOutput {
        summary: summary
            .map(|(name, figure)| (name.to_owned(), figure))
            .into_iter()
            .collect(),
        files,
    })
}
