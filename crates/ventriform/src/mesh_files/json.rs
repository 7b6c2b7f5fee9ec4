//! Our own JSON: `vertices`, `triangles`, and `frame` and `unit` of both.

use super::MeshFormat;
use super::error::MeshFileError;
use super::parsed::{Faces, Parsed};
use super::said::Said;
use crate::geometry::Vec3;
use serde::Deserialize;

/// A JSON mesh's statements about the surface.
#[derive(Debug, Deserialize)]
pub struct JsonMesh {
    /// Name of the frame.
    #[serde(default)]
    pub frame: Option<String>,
    /// Symbol of the unit.
    #[serde(default)]
    pub unit: Option<String>,
    /// Positions.
    pub vertices: Vec<[f64; 3]>,
    /// Corners of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, MeshFileError> {
    let read: JsonMesh = serde_json::from_slice(bytes).map_err(|error| MeshFileError::Damaged {
        format: MeshFormat::Json,
        place: format!("line {}, column {}", error.line(), error.column()),
        reason: error.to_string(),
    })?;
    let mut said = Said::default();
    if let Some(frame) = &read.frame {
        said.frame("frame", frame.as_bytes())?;
    }
    if let Some(unit) = &read.unit {
        said.unit("unit", unit.as_bytes())?;
    }
    let mut faces = Faces::default();
    for triangle in &read.triangles {
        faces.polygon(triangle.map(f64::from), read.vertices.len())?;
    }
    let vertices = read.vertices.into_iter().map(Vec3::from).collect();
    Ok(faces.over(vertices).said(said))
}
