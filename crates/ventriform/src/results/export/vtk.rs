//! Legacy VTK PolyData, binary: big-endian numbers after lines of text, positions and normals in double precision.
//!
//! After "VTK File Formats", version 3.0. The title, the second line, holds frame and unit and as much of the
//! other metadata as fits into its 256 characters.

use super::{ExportError, Format, Metadata};
use crate::base::geometry::Vec3;
use crate::mesh::TriMesh;

/// Longest title, characters without the end of the line.
const MAX_TITLE_CHARS: usize = 255;

/// A VTK file.
///
/// # Errors
/// [`ExportError::TooLarge`] where the numbers of triangles exceed 32 bits.
pub fn encode(mesh: &TriMesh, metadata: &Metadata) -> Result<Vec<u8>, ExportError> {
    let (points, triangles) = (mesh.vertices.len(), mesh.triangles.len());
    let size = i32::try_from(4 * triangles).ok();
    let (Some(size), Ok(_)) = (size, i32::try_from(points)) else {
        return Err(ExportError::TooLarge {
            format: Format::Vtk.extension(),
        });
    };
    let mut title = metadata.comments().join("; ");
    title.truncate(MAX_TITLE_CHARS);
    let mut bytes = format!(
        "# vtk DataFile Version 3.0\n{title}\nBINARY\nDATASET POLYDATA\nPOINTS {points} double\n"
    )
    .into_bytes();
    put(&mut bytes, vectors(&mesh.vertices));
    bytes.extend(format!("POLYGONS {triangles} {size}\n").into_bytes());
    let polygons = (mesh.triangles.iter())
        .flat_map(|&[a, b, c]| [3, a, b, c])
        .flat_map(u32::to_be_bytes);
    put(&mut bytes, polygons);
    // Arrays of a field: the reader of VTK reads all of them, of SCALARS the first only unless told otherwise.
    if let Some(parts) = metadata.parts_of(mesh) {
        let head =
            format!("CELL_DATA {triangles}\nFIELD FieldData 1\nPart 1 {triangles} unsigned_char\n");
        bytes.extend(head.into_bytes());
        put(&mut bytes, parts.iter().map(|part| part.number()));
    }
    bytes.extend(format!("POINT_DATA {points}\nNORMALS Normals double\n").into_bytes());
    put(&mut bytes, vectors(&mesh.vertex_normals()));
    let uncertainty = metadata.uncertainty_of(mesh);
    let uncertainty = uncertainty.map(|all| ("Uncertainty", all));
    let field = metadata.field_of(mesh);
    let field = field.map(|field| (field.name, field.values.as_slice()));
    let figures: Vec<(&str, &[f64])> = uncertainty.into_iter().chain(field).collect();
    if !figures.is_empty() {
        bytes.extend(format!("FIELD FieldData {}\n", figures.len()).into_bytes());
    }
    for (name, values) in figures {
        bytes.extend(format!("{name} 1 {points} double\n").into_bytes());
        put(&mut bytes, values.iter().flat_map(|x| x.to_be_bytes()));
    }
    Ok(bytes)
}

/// The numbers and the end of the line.
fn put(bytes: &mut Vec<u8>, numbers: impl Iterator<Item = u8>) {
    bytes.extend(numbers);
    bytes.push(b'\n');
}

fn vectors(vectors: &[Vec3]) -> impl Iterator<Item = u8> + '_ {
    let numbers = vectors.iter().flat_map(|v| [v.x, v.y, v.z]);
    numbers.flat_map(f64::to_be_bytes)
}
