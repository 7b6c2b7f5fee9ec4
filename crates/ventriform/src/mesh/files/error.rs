//! Why a file gives no surface.

use super::MeshFormat;
use super::size::UnlikelySize;
use crate::base::progress::Cancelled;

/// Why a file gives no surface.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshFileError {
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The file, or what it unpacks to, is larger than the limit.
    #[error("the mesh has {bytes} bytes; the limit is {limit}")]
    TooLong {
        /// Size of the file, or of its arrays unpacked.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// The content shows no format that is read.
    #[error("the file is not in a known format of meshes: it begins with {start}")]
    Unknown {
        /// Its first bytes, escaped.
        start: String,
    },
    /// The content breaks the rules of its format.
    #[error("the {} file is damaged at {place}: {reason}", format.as_str())]
    Damaged {
        /// The format.
        format: MeshFormat,
        /// Byte, line or element.
        place: String,
        /// The problem there.
        reason: String,
    },
    /// The format allows it, and this program does not read it.
    #[error("the {} file has {what}, which is not supported", format.as_str())]
    Unsupported {
        /// The format.
        format: MeshFormat,
        /// Its content.
        what: String,
    },
    /// There is no triangle.
    #[error("the mesh has no triangles")]
    Empty,
    /// A coordinate is NaN or infinite.
    #[error("a coordinate of vertex {vertex} is not finite")]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// A face refers to a vertex that does not exist.
    #[error("face {face} refers to vertex {vertex}, counted from 0; there are {count}")]
    NoSuchVertex {
        /// Number of the face, from 0.
        face: usize,
        /// The target of the reference.
        vertex: String,
        /// Number of vertices.
        count: usize,
    },
    /// Edges with a triangle on one side only.
    #[error(
        "the surface is open: {edges} edges belong to one triangle only, the first from {from} to {to}"
    )]
    Open {
        /// Their number.
        edges: usize,
        /// One end of the first, as the file states it.
        from: String,
        /// The other end.
        to: String,
    },
    /// Edges whose triangles do not lie on opposite sides.
    #[error(
        "the triangles have no common orientation: at {edges} edges they traverse the edge in the same direction, at \
         the first from {from} to {to}"
    )]
    Orientation {
        /// Their number.
        edges: usize,
        /// One end of the first, as the file states it.
        from: String,
        /// The other end.
        to: String,
    },
    /// The surface encloses nothing.
    #[error("the surface encloses no volume")]
    Flat,
    /// Caller and file, or two places of the file, name different units or frames.
    #[error("the file says that its {field} is {file}, and {caller} was stated")]
    Contradiction {
        /// `unit` or `frame`.
        field: &'static str,
        /// The file's statement.
        file: &'static str,
        /// The caller's statement.
        caller: &'static str,
    },
    /// The file names a unit or frame that is not known.
    #[error("{field} is {word:?}; {known} are known")]
    UnknownWord {
        /// Name of the field in the file.
        field: &'static str,
        /// Its value.
        word: String,
        /// The names that are known.
        known: &'static str,
    },
    /// Nobody stated the unit, and the size is not that of an organ.
    #[error(transparent)]
    Size(UnlikelySize),
}

impl MeshFileError {
    /// The error without words of the file.
    #[must_use]
    pub fn without_text(&self) -> Self {
        let mut error = self.clone();
        let hidden = || "something that is not told here".to_owned();
        match &mut error {
            Self::Unknown { start: text }
            | Self::Damaged { reason: text, .. }
            | Self::Unsupported { what: text, .. }
            | Self::UnknownWord { word: text, .. } => *text = hidden(),
            _ => {}
        }
        error
    }
}

/// The error for a file that begins with `start`.
pub(super) fn unknown(start: &[u8]) -> MeshFileError {
    let first = &start[..start.len().min(8)];
    let is_text = first.iter().all(|b| (b' '..=b'~').contains(b));
    let start = if is_text {
        format!("{:?}", String::from_utf8_lossy(first))
    } else {
        let bytes: Vec<String> = first.iter().map(|b| format!("{b:02x}")).collect();
        format!("the bytes {}", bytes.join(" "))
    };
    MeshFileError::Unknown { start }
}
