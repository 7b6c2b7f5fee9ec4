//! Meshes as files: one module per format.
//!
//! Every format carries the same vertices in the same order: millimetres in the patient frame
//! LPS (x to the patient's left, y to posterior, z to superior), exactly as many as the mesh
//! has, and triangles that run counter-clockwise seen from outside.
//!
//! | format | precision | says frame and unit in |
//! |---|---|---|
//! | [`Format::Glb`], [`Format::Gltf`] | single | `extras`; the node's matrix leads to glTF's metres, Y up |
//! | [`Format::Stl`] | single | the 80-byte header |
//! | [`Format::Ply`] | double | comments |
//! | [`Format::Obj`] | double, shortest decimal | comments |
//! | [`Format::Vtp`] | double | field data `SPACE`, `UNIT` |
//! | [`Format::Json`] | double, shortest decimal | `frame`, `unit` |
//!
//! `SPACE=LPS` is the phrase by which 3D Slicer knows the frame of STL, PLY and OBJ files.
//!
//! Guaranteed: same mesh and metadata, same bytes; vertices stay distinct in single precision
//! (see `single.rs`). Not looked at: whether the mesh is a manifold; that is
//! [`crate::mesh::topology`]'s business.

mod glb;
mod gltf;
mod json;
mod obj;
mod ply;
pub mod read_json;
mod single;
mod stl;
mod vtp;

use serde_json::{Map, Value};

use crate::mesh::TriMesh;

/// The frame that every format speaks.
pub const FRAME: &str = "LPS";
/// The unit that every format speaks.
pub const UNIT: &str = "mm";

/// A file format for meshes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Format {
    /// Binary glTF 2.0, one file.
    Glb,
    /// glTF 2.0 as JSON, its buffer embedded as base64.
    Gltf,
    /// Binary STL.
    Stl,
    /// Binary little-endian PLY.
    Ply,
    /// Wavefront OBJ.
    Obj,
    /// VTK XML PolyData.
    Vtp,
    /// Plain JSON: vertices, triangles, normals.
    Json,
}

impl Format {
    /// Every format.
    pub const ALL: [Format; 7] = [
        Format::Glb,
        Format::Gltf,
        Format::Stl,
        Format::Ply,
        Format::Obj,
        Format::Vtp,
        Format::Json,
    ];

    /// The file extension, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Format::Glb => "glb",
            Format::Gltf => "gltf",
            Format::Stl => "stl",
            Format::Ply => "ply",
            Format::Obj => "obj",
            Format::Vtp => "vtp",
            Format::Json => "json",
        }
    }

    /// The media type. Registered with IANA, but for PLY and VTP, which nobody registered:
    /// `application/x-ply` is customary, `application/x-vtp` is ours after its pattern.
    pub fn media_type(self) -> &'static str {
        match self {
            Format::Glb => "model/gltf-binary",
            Format::Gltf => "model/gltf+json",
            Format::Stl => "model/stl",
            Format::Ply => "application/x-ply",
            Format::Obj => "model/obj",
            Format::Vtp => "application/x-vtp",
            Format::Json => "application/json",
        }
    }

    /// The format of a file extension, with or without the dot, in any case.
    pub fn from_extension(extension: &str) -> Option<Self> {
        let extension = extension.strip_prefix('.').unwrap_or(extension);
        Self::ALL
            .into_iter()
            .find(|f| f.extension().eq_ignore_ascii_case(extension))
    }

    /// The format of a media type, in any case, parameters (`; q=0.9`) not looked at. Old
    /// names that clients still send are understood too.
    pub fn from_media_type(media_type: &str) -> Option<Self> {
        let essence = media_type.split(';').next()?.trim().to_ascii_lowercase();
        let old = match essence.as_str() {
            "model/x.stl-binary" | "application/sla" | "application/vnd.ms-pki.stl" => {
                Some(Format::Stl)
            }
            "model/ply" | "model/x-ply" | "application/ply" => Some(Format::Ply),
            "application/x-tgif" | "text/prs.wavefront-obj" => Some(Format::Obj),
            "model/vtp" | "model/x-vtp" | "application/vtp" => Some(Format::Vtp),
            _ => None,
        };
        old.or_else(|| Self::ALL.into_iter().find(|f| f.media_type() == essence))
    }
}

/// What a file says about its mesh besides the mesh.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Metadata {
    /// Name for people; the object's name where the format has one.
    pub title: String,
    /// Identity of the volume that the mesh was made from.
    pub volume_id: Option<String>,
    /// DICOM Frame of Reference UID of that volume.
    pub frame_of_reference_uid: Option<String>,
    /// Name and version of the software, such as `ventriform 0.1.0`.
    pub software: String,
    /// A few figures of quality, in the order in which they shall appear.
    pub quality: Map<String, Value>,
}

impl Metadata {
    /// Metadata that name this software and nothing else.
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            software: concat!("ventriform ", env!("CARGO_PKG_VERSION")).to_owned(),
            ..Self::default()
        }
    }

    /// Everything as one JSON object, frame and unit first.
    fn to_object(&self) -> Map<String, Value> {
        let mut object = Map::new();
        object.insert("frame".into(), FRAME.into());
        object.insert("unit".into(), UNIT.into());
        for (key, value) in self.identity() {
            object.insert(key.into(), value.into());
        }
        object.insert("quality".into(), self.quality.clone().into());
        object
    }

    /// What is known of title, origin and software, as key and value.
    fn identity(&self) -> Vec<(&'static str, &str)> {
        let volume = self.volume_id.as_deref();
        let frame_uid = self.frame_of_reference_uid.as_deref();
        [
            ("title", Some(self.title.as_str())),
            ("volume", volume),
            ("frame_of_reference_uid", frame_uid),
            ("software", Some(self.software.as_str())),
        ]
        .into_iter()
        .filter_map(|(key, value)| Some((key, value?)))
        .filter(|(_, value)| !value.is_empty())
        .collect()
    }

    /// Comment lines for formats that have such, in ASCII without control characters.
    fn comments(&self) -> Vec<String> {
        let mut lines = vec![format!("SPACE={FRAME} UNIT={UNIT}")];
        let identity = self.identity();
        lines.extend(identity.iter().map(|(k, v)| format!("{k}: {v}")));
        lines.extend(self.quality.iter().map(|(k, v)| format!("{k}: {v}")));
        for line in &mut lines {
            *line = printable(line);
        }
        lines
    }
}

/// `text` with everything but printable ASCII replaced by `?`, so that no title can end a
/// comment or a header.
fn printable(text: &str) -> String {
    text.chars()
        .map(|c| {
            if c == ' ' || c.is_ascii_graphic() {
                c
            } else {
                '?'
            }
        })
        .collect()
}

/// Why a mesh cannot be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ExportError {
    /// No triangles.
    #[error("the mesh has no triangles")]
    Empty,
    /// A coordinate is NaN or infinite (for GLB, glTF and STL: in single precision).
    #[error("vertex {vertex} is not finite")]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// A triangle names a vertex that is not there.
    #[error("triangle {triangle} names a vertex beyond the last one")]
    IndexOutOfRange {
        /// Index of the triangle.
        triangle: usize,
    },
    /// Single precision cannot tell the vertex from others, even when moved a little.
    #[error(
        "vertex {vertex} coincides with others in single precision; write PLY, OBJ, VTP or JSON instead"
    )]
    Inseparable {
        /// Index of the vertex.
        vertex: usize,
    },
    /// More bytes or items than the format can count.
    #[error("the mesh is too large for {format}")]
    TooLarge {
        /// Extension of the format.
        format: &'static str,
    },
}

/// `mesh` as the bytes of a file.
///
/// # Errors
/// See [`ExportError`].
pub fn encode(format: Format, mesh: &TriMesh, metadata: &Metadata) -> Result<Vec<u8>, ExportError> {
    check(mesh)?;
    match format {
        Format::Glb => glb::encode(mesh, metadata),
        Format::Gltf => gltf::encode(mesh, metadata),
        Format::Stl => stl::encode(mesh, metadata),
        Format::Ply => ply::encode(mesh, metadata),
        Format::Obj => Ok(obj::encode(mesh, metadata)),
        Format::Vtp => Ok(vtp::encode(mesh, metadata)),
        Format::Json => Ok(json::encode(mesh, metadata)),
    }
}

fn check(mesh: &TriMesh) -> Result<(), ExportError> {
    if mesh.triangles.is_empty() {
        return Err(ExportError::Empty);
    }
    if let Some(vertex) = (mesh.vertices.iter()).position(|p| !p.iter().all(|x| x.is_finite())) {
        return Err(ExportError::NotFinite { vertex });
    }
    let beyond = |t: &[u32; 3]| t.iter().any(|&v| v as usize >= mesh.vertices.len());
    match mesh.triangles.iter().position(beyond) {
        Some(triangle) => Err(ExportError::IndexOutOfRange { triangle }),
        None => Ok(()),
    }
}
