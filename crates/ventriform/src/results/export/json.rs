//! Plain JSON, with every coordinate as the shortest decimal that gives the same number when read.

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::Metadata;
use crate::base::geometry::Vec3;
use crate::mesh::TriMesh;

#[derive(Serialize)]
struct WrittenMesh<'a> {
    #[serde(flatten)]
    metadata: Map<String, Value>,
    vertices: Vec<[f64; 3]>,
    triangles: &'a [[u32; 3]],
    normals: Vec<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    part: Option<Vec<u8>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    uncertainty_mm: Option<&'a [f64]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fields: Option<Value>,
}

/// A JSON file with `frame`, `unit`, the other metadata, `vertices`, `triangles` and `normals`,
/// and with what is known of each vertex: `uncertainty_mm`, and `fields` with an array by its name, in which
/// `null` is an unknown value; of each triangle, `part` is the part of the wall, 1 endocardium, 2 epicardium,
/// 3 base.
pub fn encode(mesh: &TriMesh, metadata: &Metadata) -> Vec<u8> {
    let rows = |vectors: &[Vec3]| vectors.iter().map(|&v| v.into()).collect();
    let document = WrittenMesh {
        metadata: metadata.to_object(),
        vertices: rows(&mesh.vertices),
        triangles: &mesh.triangles,
        normals: rows(&mesh.vertex_normals()),
        part: metadata
            .parts_of(mesh)
            .map(|parts| parts.iter().map(|part| part.number()).collect()),
        uncertainty_mm: metadata.uncertainty_of(mesh),
        fields: metadata
            .field_of(mesh)
            .map(|field| json!({ (field.name): field.values })),
    };
    serde_json::to_vec(&document).expect("numbers and text keys can always be serialised")
}
