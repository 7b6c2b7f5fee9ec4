//! Writes meshes to files, one module per format.
//!
//! In: a mesh (LPS mm) and its metadata. Out: the bytes of a file. All formats contain the same
//! vertices in the same order, in millimetres in the patient frame LPS (x to the patient's left,
//! y to posterior, z to superior), and the same triangles, counter-clockwise seen from outside.
//!
//! | format | precision | frame and unit are stored in |
//! |---|---|---|
//! | [`Format::Glb`], [`Format::Gltf`] | single | `extras`; the node's matrix converts to glTF's metres, Y up |
//! | [`Format::Stl`] | single | the 80-byte header |
//! | [`Format::Ply`] | double | comments |
//! | [`Format::Obj`] | double, shortest decimal | comments |
//! | [`Format::Vtp`] | double | field data `SPACE`, `LENGTH_UNIT` |
//! | [`Format::Vtk`] | double | the title line |
//! | [`Format::Json`] | double, shortest decimal | `frame`, `unit` |
//!
//! 3D Slicer recognises the frame of STL, PLY, OBJ and VTK files by the text `SPACE=LPS`.
//!
//! Where it is known, the uncertainty of each vertex is the attribute `_UNCERTAINTY` of glTF files, the
//! property `uncertainty` of PLY files, the array `Uncertainty` of VTP and VTK files and `uncertainty_mm` of
//! JSON files, millimetres.
//!
//! GLB and glTF files show a figure of each vertex ([`VertexField`]) as vertex colours, VTP and VTK files hold it as an
//! array of its name, PLY files as a property of its name in lower case beside `red`, `green` and `blue`, and JSON
//! files as the entry of `fields` with that name: the uptake of a fitted wall, the distance of a model to the surface
//! it was made of.
//!
//! Where the parts of a ventricle's wall are known ([`Metadata::parts`]), each triangle says which it is of: 1
//! endocardium, 2 epicardium, 3 base. That is the cell array `Part` of VTP and VTK files, the face property `part` of
//! PLY files, `part` of JSON files; OBJ files have a group and glTF files a primitive of each part, named
//! after it. STL files cannot hold it. [`mod@open_part`] cuts a part out as an open surface.
//!
//! [`mod@animated`] writes a surface in motion as GLB. [`dicom`] writes results as DICOM objects, [`fhir`] the structured
//! reports among them as FHIR resources.
//!
//! Guaranteed: the same mesh and metadata give the same bytes; vertices stay distinct in single
//! precision (see `single.rs`). Not checked: whether the mesh is a manifold; see
//! [`crate::mesh::topology`].

pub mod animated;
pub mod dicom;
pub mod fhir;
mod glb;
mod gltf;
mod json;
mod obj;
pub mod open_part;
mod ply;
pub mod read_json;
pub mod seg_nrrd;
mod single;
mod stl;
mod vtk;
mod vtp;

use serde_json::{Map, Value};

pub use crate::mesh::part::Part;

use crate::mesh::TriMesh;

/// The coordinate frame of all formats.
pub const COORDINATE_FRAME: &str = "LPS";

/// The unit of length of all formats.
pub const LENGTH_UNIT: &str = "mm";

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
    /// Legacy VTK PolyData, binary.
    Vtk,
    /// Plain JSON: vertices, triangles, normals.
    Json,
}

impl Format {
    /// All formats.
    pub const ALL: [Format; 8] = [
        Format::Glb,
        Format::Gltf,
        Format::Stl,
        Format::Ply,
        Format::Obj,
        Format::Vtp,
        Format::Vtk,
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
            Format::Vtk => "vtk",
            Format::Json => "json",
        }
    }

    /// The media type. All are registered with IANA except those of PLY, VTP and VTK:
    /// `application/x-ply` is customary, and the others follow its pattern.
    pub fn media_type(self) -> &'static str {
        match self {
            Format::Glb => "model/gltf-binary",
            Format::Gltf => "model/gltf+json",
            Format::Stl => "model/stl",
            Format::Ply => "application/x-ply",
            Format::Obj => "model/obj",
            Format::Vtp => "application/x-vtp",
            Format::Vtk => "application/x-vtk",
            Format::Json => "application/json",
        }
    }

    /// The format with this file extension, with or without the dot, in upper or lower case.
    pub fn from_extension(extension: &str) -> Option<Self> {
        let extension = extension.strip_prefix('.').unwrap_or(extension);
        Self::ALL
            .into_iter()
            .find(|f| f.extension().eq_ignore_ascii_case(extension))
    }

    /// The format with this media type, in upper or lower case; parameters (`; q=0.9`) are ignored.
    /// Older names that clients still send are recognised as well.
    pub fn from_media_type(media_type: &str) -> Option<Self> {
        let essence = media_type.split(';').next()?.trim().to_ascii_lowercase();
        let old = match essence.as_str() {
            "model/x.stl-binary" | "application/sla" | "application/vnd.ms-pki.stl" => {
                Some(Format::Stl)
            }
            "model/ply" | "model/x-ply" | "application/ply" => Some(Format::Ply),
            "application/x-tgif" | "text/prs.wavefront-obj" => Some(Format::Obj),
            "model/vtk" | "model/x-vtk" | "application/vtk" => Some(Format::Vtk),
            "model/vtp" | "model/x-vtp" | "application/vtp" => Some(Format::Vtp),
            _ => None,
        };
        old.or_else(|| Self::ALL.into_iter().find(|f| f.media_type() == essence))
    }
}

/// Content of a file besides the mesh.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Metadata {
    /// Title for people; also the name of the object if the format has one.
    pub title: String,
    /// Id of the volume that the mesh was made from.
    pub volume_id: Option<String>,
    /// DICOM Frame of Reference UID of that volume.
    pub frame_of_reference_uid: Option<String>,
    /// Name and version of the software, such as `ventriform 0.1.0`.
    pub software: String,
    /// Measures of quality, in the order in which they are written.
    pub quality: Map<String, Value>,
    /// Standard deviation of each vertex's distance from the true surface, mm; empty if it is not known.
    /// STL and OBJ files cannot hold it.
    pub uncertainty: Vec<f64>,
    /// A figure of every vertex that GLB and glTF files show as colours, other formats hold as an array.
    pub field: Option<VertexField>,
    /// The part of the wall that each triangle is of; empty if it is not known.
    pub parts: Vec<Part>,
}

/// A figure of every vertex and the colour that shows it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VertexField {
    /// Its name in VTP, VTK and JSON files: `Uptake` (per cent), `Distance` (mm).
    pub name: &'static str,
    /// Its values; NaN where it is not known.
    pub values: Vec<f64>,
    /// Red, green and blue of each vertex, sRGB, 0..=1.
    pub colours: Vec<[f64; 3]>,
}

impl VertexField {
    /// All names that a field may have.
    pub const FIELD_NAMES: [&'static str; 2] = ["Uptake", "Distance"];
}

impl Metadata {
    /// Metadata with a title and the name and version of this software.
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            software: concat!("ventriform ", env!("CARGO_PKG_VERSION")).to_owned(),
            ..Self::default()
        }
    }

    /// All metadata as one JSON object, with frame and unit first.
    fn to_object(&self) -> Map<String, Value> {
        let mut object = Map::new();
        object.insert("frame".into(), COORDINATE_FRAME.into());
        object.insert("unit".into(), LENGTH_UNIT.into());
        for (key, value) in self.identity() {
            object.insert(key.into(), value.into());
        }
        object.insert("quality".into(), self.quality.clone().into());
        object
    }

    /// Title, origin and software as pairs of key and value; unknown ones are left out.
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

    /// The uncertainty of each vertex of `mesh`, if it is known.
    fn uncertainty_of(&self, mesh: &TriMesh) -> Option<&[f64]> {
        (!mesh.vertices.is_empty() && self.uncertainty.len() == mesh.vertices.len())
            .then_some(&self.uncertainty)
    }

    /// The figure of each vertex of `mesh`, if there is one.
    fn field_of(&self, mesh: &TriMesh) -> Option<&VertexField> {
        let count = mesh.vertices.len();
        let suits =
            |field: &&VertexField| field.values.len() == count && field.colours.len() == count;
        self.field.as_ref().filter(|_| count > 0).filter(suits)
    }

    /// The part of each triangle of `mesh`, if it is known.
    fn parts_of(&self, mesh: &TriMesh) -> Option<&[Part]> {
        (!mesh.triangles.is_empty() && self.parts.len() == mesh.triangles.len())
            .then_some(&self.parts)
    }

    /// The metadata as comment lines, in ASCII without control characters.
    fn comments(&self) -> Vec<String> {
        let mut lines = vec![format!("SPACE={COORDINATE_FRAME} UNIT={LENGTH_UNIT}")];
        let identity = self.identity();
        lines.extend(identity.iter().map(|(k, v)| format!("{k}: {v}")));
        lines.extend(self.quality.iter().map(|(k, v)| format!("{k}: {v}")));
        for line in &mut lines {
            *line = printable(line);
        }
        lines
    }
}

/// `text` with all characters other than printable ASCII replaced by `?`, so that no title can end
/// a comment or a header.
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

/// Why a mesh could not be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ExportError {
    /// The mesh has no triangles.
    #[error("the mesh has no triangles")]
    Empty,
    /// A coordinate is NaN or infinite; for GLB, glTF and STL, in single precision.
    #[error("a coordinate of vertex {vertex} is not finite")]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// A triangle refers to a vertex that does not exist.
    #[error("triangle {triangle} refers to a vertex that does not exist")]
    IndexOutOfRange {
        /// Index of the triangle.
        triangle: usize,
    },
    /// The vertex coincides with others in single precision, even if moved slightly.
    #[error(
        "vertex {vertex} coincides with others in single precision; PLY, OBJ, VTP, VTK and JSON have double precision"
    )]
    Inseparable {
        /// Index of the vertex.
        vertex: usize,
    },
    /// A mesh of a cycle has not the vertices and triangles of the others, or is not there.
    #[error("mesh {index} of the cycle has not the vertices and triangles of the others")]
    OtherMesh {
        /// Its place in the cycle.
        index: usize,
    },
    /// The mesh has more bytes or elements than the format can count.
    #[error("the mesh is too large for {format}")]
    TooLarge {
        /// Extension of the format.
        format: &'static str,
    },
}

/// Writes `mesh` as the bytes of a file.
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
        Format::Vtk => vtk::encode(mesh, metadata),
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
