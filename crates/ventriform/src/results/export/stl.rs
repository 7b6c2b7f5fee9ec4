//! Binary STL: an 80-byte header, the number of triangles, and 50 bytes per triangle.

use super::{ExportError, Format, Metadata, single};
use crate::base::geometry::{Vec3, triangle};
use crate::mesh::TriMesh;

const HEADER_BYTES: usize = 80;

/// A binary STL file.
///
/// # Errors
/// [`ExportError::NotFinite`], [`ExportError::Inseparable`]: see [`single`];
/// [`ExportError::TooLarge`] beyond 2³² triangles.
pub fn encode(mesh: &TriMesh, metadata: &Metadata) -> Result<Vec<u8>, ExportError> {
    let positions = single::positions(&mesh.vertices)?;
    let count = u32::try_from(mesh.triangles.len()).map_err(|_| ExportError::TooLarge {
        format: Format::Stl.extension(),
    })?;
    let mut bytes = Vec::with_capacity(HEADER_BYTES + 4 + 50 * mesh.triangles.len());
    bytes.extend(header(metadata));
    bytes.extend(count.to_le_bytes());
    for t in &mesh.triangles {
        let corners = t.map(|v| positions[v as usize]);
        let corners_f64 = corners.map(|p| Vec3::from(p.map(f64::from)));
        let normal = triangle::unit_normal(&corners_f64);
        let numbers = [normal.x as f32, normal.y as f32, normal.z as f32];
        let numbers = numbers.iter().chain(corners.iter().flatten());
        bytes.extend(numbers.flat_map(|x| x.to_le_bytes()));
        bytes.extend(0u16.to_le_bytes());
    }
    Ok(bytes)
}

/// Frame and unit, followed by as much of the other metadata as fits. The header never begins
/// with `solid`, by which readers recognise the text form.
fn header(metadata: &Metadata) -> Vec<u8> {
    let mut header = metadata.comments().join("; ").into_bytes();
    header.resize(HEADER_BYTES, b' ');
    header
}
