//! GLB, the binary form of glTF: document and buffer in one file (glTF 2.0, section 4).

use super::{ExportError, Format, Metadata, gltf};
use crate::mesh::TriMesh;
use serde_json::Value;

/// A GLB file: a header, a JSON chunk and a binary chunk, each a multiple of 4 bytes long.
///
/// # Errors
/// See [`gltf::document`]; [`ExportError::TooLarge`] beyond 4 GiB.
pub fn encode(mesh: &TriMesh, metadata: &Metadata) -> Result<Vec<u8>, ExportError> {
    let (document, buffer) = gltf::document(mesh, metadata)?;
    container(&document, &buffer)
}

/// Document and buffer, a multiple of 4 bytes long, in one file.
///
/// # Errors
/// [`ExportError::TooLarge`] beyond 4 GiB.
pub(super) fn container(document: &Value, buffer: &[u8]) -> Result<Vec<u8>, ExportError> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');

    let size = |bytes: usize| {
        u32::try_from(bytes)
            .map(u32::to_le_bytes)
            .map_err(|_| ExportError::TooLarge {
                format: Format::Glb.extension(),
            })
    };
    let total = 12 + 8 + json.len() + 8 + buffer.len();
    let mut bytes = Vec::with_capacity(total);
    bytes.extend(b"glTF");
    bytes.extend(2u32.to_le_bytes());
    bytes.extend(size(total)?);
    bytes.extend(size(json.len())?);
    bytes.extend(b"JSON");
    bytes.extend(json);
    bytes.extend(size(buffer.len())?);
    bytes.extend(b"BIN\0");
    bytes.extend(buffer);
    Ok(bytes)
}
