//! Binary little-endian PLY with positions and normals in double precision.

use super::{ExportError, Format, LENGTH_UNIT, Metadata};
use crate::mesh::TriMesh;
use crate::mesh::part::Part;

/// A PLY file.
///
/// # Errors
/// [`ExportError::TooLarge`] beyond 2³¹ vertices, since readers expect signed indices.
pub fn encode(mesh: &TriMesh, metadata: &Metadata) -> Result<Vec<u8>, ExportError> {
    if i32::try_from(mesh.vertices.len()).is_err() {
        return Err(ExportError::TooLarge {
            format: Format::Ply.extension(),
        });
    }
    let mut bytes = header(mesh, metadata).into_bytes();
    bytes.reserve(48 * mesh.vertices.len() + 13 * mesh.triangles.len());
    let (uncertainty, field) = (metadata.uncertainty_of(mesh), metadata.field_of(mesh));
    for (vertex, normal) in mesh.vertex_normals().iter().enumerate() {
        let numbers = mesh.vertices[vertex].iter().chain(normal.iter());
        let numbers = numbers.chain(uncertainty.map(|all| &all[vertex]));
        let numbers = numbers.chain(field.map(|field| &field.values[vertex]));
        bytes.extend(numbers.flat_map(|x| x.to_le_bytes()));
        if let Some(field) = field {
            let colour = field.colours[vertex];
            bytes.extend(colour.map(|part| (255.0 * part.clamp(0.0, 1.0)).round() as u8));
        }
    }
    let parts = metadata.parts_of(mesh);
    for (number, t) in mesh.triangles.iter().enumerate() {
        bytes.push(3);
        bytes.extend(t.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend(parts.map(|parts| parts[number].number()));
    }
    Ok(bytes)
}

fn header(mesh: &TriMesh, metadata: &Metadata) -> String {
    let mut lines = vec![
        "ply".to_owned(),
        "format binary_little_endian 1.0".to_owned(),
    ];
    lines.extend(metadata.comments().iter().map(|c| format!("comment {c}")));
    lines.push(format!(
        "comment coordinates are {LENGTH_UNIT}, x to the left, y to posterior, z to superior"
    ));
    if metadata.parts_of(mesh).is_some() {
        let names = Part::ALL.map(|part| format!("{} {}", part.number(), part.as_str()));
        lines.push(format!("comment parts: {}", names.join(", ")));
    }
    lines.push(format!("element vertex {}", mesh.vertices.len()));
    for name in ["x", "y", "z", "nx", "ny", "nz"] {
        lines.push(format!("property double {name}"));
    }
    if metadata.uncertainty_of(mesh).is_some() {
        lines.push("property double uncertainty".to_owned());
    }
    if let Some(field) = metadata.field_of(mesh) {
        lines.push(format!("property double {}", field.name.to_lowercase()));
        lines.extend(["red", "green", "blue"].map(|part| format!("property uchar {part}")));
    }
    lines.push(format!("element face {}", mesh.triangles.len()));
    lines.push("property list uchar int vertex_indices".to_owned());
    if metadata.parts_of(mesh).is_some() {
        lines.push("property uchar part".to_owned());
    }
    lines.push("end_header\n".to_owned());
    lines.join("\n")
}
