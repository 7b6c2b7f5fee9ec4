//! Reads the meshes that [`super::json`] writes.

use serde::Deserialize;

use crate::geometry::Vec3;
use crate::mesh::TriMesh;

/// Largest file that is looked at, bytes: some 100 000 vertices with normals.
const MAX_BYTES: usize = 32 << 20;

#[derive(Deserialize)]
struct Document {
    #[serde(default)]
    frame: Option<String>,
    #[serde(default)]
    unit: Option<String>,
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

/// Why a file is no mesh of ours.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReadMeshError {
    /// More bytes than are looked at.
    #[error("the model file has {bytes} bytes; at most {MAX_BYTES} are read")]
    TooLong {
        /// Its length.
        bytes: usize,
    },
    /// No JSON, or without `vertices` and `triangles`.
    #[error("the model file is not a JSON mesh: {0}")]
    Json(String),
    /// Another frame or unit than LPS millimetres.
    #[error("the model's {field} is {value:?}; {expected} is needed")]
    Frame {
        /// `frame` or `unit`.
        field: &'static str,
        /// What the file says.
        value: String,
        /// What is understood.
        expected: &'static str,
    },
    /// A triangle names a vertex that is not there.
    #[error("triangle {triangle} names a vertex beyond the last one")]
    IndexOutOfRange {
        /// Index of the triangle.
        triangle: usize,
    },
}

/// The mesh in `bytes`, LPS mm.
///
/// # Errors
/// [`ReadMeshError`]. Whether the mesh is closed is not looked at.
pub fn decode(bytes: &[u8]) -> Result<TriMesh, ReadMeshError> {
    if bytes.len() > MAX_BYTES {
        return Err(ReadMeshError::TooLong { bytes: bytes.len() });
    }
    let document: Document =
        serde_json::from_slice(bytes).map_err(|e| ReadMeshError::Json(e.to_string()))?;
    demand("frame", document.frame, super::FRAME)?;
    demand("unit", document.unit, super::UNIT)?;
    let count = document.vertices.len() as u32;
    let stray = |t: &[u32; 3]| t.iter().any(|v| *v >= count);
    if let Some(triangle) = document.triangles.iter().position(stray) {
        return Err(ReadMeshError::IndexOutOfRange { triangle });
    }
    Ok(TriMesh {
        vertices: document.vertices.into_iter().map(Vec3::from).collect(),
        triangles: document.triangles,
    })
}

fn demand(
    field: &'static str,
    value: Option<String>,
    expected: &'static str,
) -> Result<(), ReadMeshError> {
    match value {
        Some(value) if value != expected => Err(ReadMeshError::Frame {
            field,
            value,
            expected,
        }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Metadata, json};
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn what_was_written_comes_back_to_the_last_bit() {
        let mesh = shapes::icosphere(12.3, 2);
        let bytes = json::encode(&mesh, &Metadata::new("sphere"));
        let back = decode(&bytes).unwrap();
        assert_eq!(back.triangles, mesh.triangles);
        assert_eq!(back.vertices, mesh.vertices);
    }

    #[test]
    fn other_files_are_refused_with_the_reason() {
        assert!(matches!(decode(b"solid x"), Err(ReadMeshError::Json(_))));
        let stray = br#"{"vertices":[[0,0,0]],"triangles":[[0,1,2]]}"#;
        assert_eq!(
            decode(stray),
            Err(ReadMeshError::IndexOutOfRange { triangle: 0 })
        );
        let ras = br#"{"frame":"RAS","vertices":[],"triangles":[]}"#;
        assert!(matches!(
            decode(ras),
            Err(ReadMeshError::Frame { field: "frame", .. })
        ));
    }
}
