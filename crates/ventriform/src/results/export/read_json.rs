//! Reads the JSON meshes that [`super::json`] writes.
//!
//! In: the bytes of a file. Out: a mesh in LPS millimetres whose triangles refer to existing
//! vertices. Whether it is closed is not checked.

use serde::Deserialize;
use serde_json::{Map, Value};

use super::{Metadata, VertexField};
use crate::base::geometry::Vec3;
use crate::mesh::TriMesh;
use crate::mesh::part::Part;

/// Size of the largest file that is read, bytes: about 100 000 vertices with normals.
const MAX_BYTES: usize = 32 << 20;

#[derive(Deserialize)]
struct ReadMesh {
    #[serde(default)]
    frame: Option<String>,
    #[serde(default)]
    unit: Option<String>,
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

/// Why a file could not be read as a mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReadMeshError {
    /// The file is too large.
    #[error("the model file has {bytes} bytes; at most {MAX_BYTES} are read")]
    TooLong {
        /// Size of the file.
        bytes: usize,
    },
    /// The file is not JSON, or has no `vertices` or `triangles`.
    #[error("the model file is not a JSON mesh: {0}")]
    Json(String),
    /// The frame is not LPS or the unit not mm.
    #[error("the model's {field} is {value:?}; it must be {expected}")]
    Frame {
        /// `frame` or `unit`.
        field: &'static str,
        /// Its value in the file.
        value: String,
        /// The only supported value.
        expected: &'static str,
    },
    /// A triangle refers to a vertex that does not exist.
    #[error("triangle {triangle} refers to a vertex that does not exist")]
    IndexOutOfRange {
        /// Index of the triangle.
        triangle: usize,
    },
}

/// Reads the mesh in `bytes`, LPS mm.
///
/// # Errors
/// See [`ReadMeshError`].
pub fn decode(bytes: &[u8]) -> Result<TriMesh, ReadMeshError> {
    if bytes.len() > MAX_BYTES {
        return Err(ReadMeshError::TooLong { bytes: bytes.len() });
    }
    let document: ReadMesh =
        serde_json::from_slice(bytes).map_err(|e| ReadMeshError::Json(e.to_string()))?;
    demand("frame", document.frame, super::COORDINATE_FRAME)?;
    demand("unit", document.unit, super::LENGTH_UNIT)?;
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

/// [`super::Metadata::uncertainty`] of the mesh in `bytes`; empty if the file has none.
pub fn uncertainty(bytes: &[u8]) -> Vec<f64> {
    #[derive(Default, Deserialize)]
    #[serde(default)]
    struct ReadUncertainty {
        uncertainty_mm: Vec<f64>,
    }
    serde_json::from_slice(bytes)
        .map_or_else(|_| Vec::new(), |read: ReadUncertainty| read.uncertainty_mm)
}

/// The colours that show a field of that name and with those values: red, green, blue from 0 to 1.
pub type Colouring<'a> = dyn Fn(&str, &[f64]) -> Vec<[f64; 3]> + 'a;

/// The mesh in `bytes` with what [`super::json`] wrote of it: title, origin, figures, and what is known of each
/// vertex and triangle. `colours` gives the colours that show a field, by its name and values.
///
/// # Errors
/// See [`ReadMeshError`].
pub fn document(
    bytes: &[u8],
    colours: &Colouring<'_>,
) -> Result<(TriMesh, Metadata), ReadMeshError> {
    #[derive(Default, Deserialize)]
    #[serde(default)]
    struct Written {
        title: String,
        volume: Option<String>,
        frame_of_reference_uid: Option<String>,
        software: String,
        quality: Map<String, Value>,
        uncertainty_mm: Vec<f64>,
        fields: Map<String, Value>,
        part: Vec<u64>,
    }
    let mesh = decode(bytes)?;
    let written: Written =
        serde_json::from_slice(bytes).map_err(|e| ReadMeshError::Json(e.to_string()))?;
    let field = written.fields.iter().find_map(|(name, values)| {
        let name = VertexField::FIELD_NAMES
            .into_iter()
            .find(|known| known == name)?;
        let values = values.as_array()?.iter();
        let values: Vec<f64> = values.map(|x| x.as_f64().unwrap_or(f64::NAN)).collect();
        Some(VertexField {
            name,
            colours: colours(name, &values),
            values,
        })
    });
    let parts: Option<Vec<Part>> = written.part.iter().map(|n| Part::numbered(*n)).collect();
    let metadata = Metadata {
        title: written.title,
        volume_id: written.volume,
        frame_of_reference_uid: written.frame_of_reference_uid,
        software: written.software,
        quality: written.quality,
        uncertainty: written.uncertainty_mm,
        field,
        parts: parts.unwrap_or_default(),
    };
    Ok((mesh, metadata))
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
    fn a_written_mesh_is_read_back_exactly() {
        let mesh = shapes::icosphere(12.3, 2);
        let bytes = json::encode(&mesh, &Metadata::new("sphere"));
        let back = decode(&bytes).unwrap();
        assert_eq!(back.triangles, mesh.triangles);
        assert_eq!(back.vertices, mesh.vertices);
    }

    #[test]
    fn the_uncertainty_of_each_vertex_is_read_back_where_it_is_known() {
        let mesh = shapes::tetrahedron(2.0);
        let mut metadata = Metadata::new("uncertain");
        assert!(uncertainty(&json::encode(&mesh, &metadata)).is_empty());
        metadata.uncertainty = vec![0.5, 1.25, 2.0, 3.5];
        let bytes = json::encode(&mesh, &metadata);
        assert_eq!(uncertainty(&bytes), metadata.uncertainty);
        // A list for another mesh is left out.
        metadata.uncertainty.pop();
        assert!(uncertainty(&json::encode(&mesh, &metadata)).is_empty());
    }

    #[test]
    fn errors_name_what_is_wrong_with_a_file() {
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
