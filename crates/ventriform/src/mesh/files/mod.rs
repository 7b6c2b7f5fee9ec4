//! Reads surfaces from files of meshes: templates, and an expert's drawings.
//!
//! In: the bytes of a file, and what the caller states of it ([`MeshStatement`]). Out: a closed triangle mesh in LPS
//! millimetres, and what was assumed ([`ReadMesh`]). The steps:
//!
//! 1. [`recognise`]: the format, by the content.
//! 2. One reader per format gives points, triangles and what the file says of unit and frame: `stl` (text and
//!    binary), `ply` (text, binary of both byte orders), `obj`, `vtk` (legacy PolyData, text and binary), `vtp` (text,
//!    base64, appended; zlib or plain), `gltf` (GLB, and glTF with its buffers embedded), `json` (our own). Polygons
//!    are split into triangles from their first corner, strips into their triangles. Lines and single points are no
//!    surface and are left out.
//! 3. `weld`: STL names no shared vertices, and others often repeat them. Points with exactly equal coordinates
//!    become one vertex, of STL always, of the others where the surface is not closed as it stands. If edges are still
//!    open, points within 2^-20 of the greatest coordinate (a ten-thousandth of a millimetre at 100 mm) become one.
//!    Triangles that lose their area by that, and vertices without triangle, are left out.
//! 4. `closed`: every edge must have as many triangles on one side as on the other.
//! 5. Unit and frame: what the file says, or the caller. Files of our own and of 3D Slicer say `SPACE=LPS` or
//!    `SPACE=RAS`, ours `UNIT=mm` also. Without that: millimetres, LPS; of glTF metres, Y up, as its specification
//!    says. The size of a mesh whose unit nobody states must be that of an organ.
//! 6. A surface whose triangles face inward is turned.
//!
//! Guaranteed: never a panic. No memory is taken by a count in a file before the bytes for it are there: at most
//! about eight times the size of the file, arrays of packed VTP files counted unpacked. The same bytes give the same
//! mesh.
//!
//! Not guaranteed: that the surface does not intersect itself, or touches itself nowhere: an edge may have four
//! triangles. [`topology::check`](crate::mesh::topology::check) tells a manifold.

mod closed;
mod cursor;
mod error;
mod gltf;
pub mod json;
mod number;
mod obj;
mod parsed;
mod ply;
mod said;
mod size;
mod statement;
mod stl;
mod vtk;
mod vtp;
mod weld;
mod xml;

pub use error::MeshFileError;
pub use size::UnlikelySize;
pub use statement::{MeshFrame, MeshStatement, MeshUnit};

use crate::base::geometry::Vec3;
use crate::base::geometry::frame;
use crate::base::progress::Monitor;
use crate::mesh::TriMesh;
use parsed::Parsed;

/// Formats of meshes that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshFormat {
    /// STL, text or binary.
    Stl,
    /// PLY, text or binary.
    Ply,
    /// Wavefront OBJ.
    Obj,
    /// Legacy VTK PolyData.
    Vtk,
    /// VTK XML PolyData.
    Vtp,
    /// glTF 2.0, binary or JSON.
    Gltf,
    /// Our own JSON.
    Json,
}

impl MeshFormat {
    /// The common name of the format.
    pub fn as_str(self) -> &'static str {
        match self {
            MeshFormat::Stl => "STL",
            MeshFormat::Ply => "PLY",
            MeshFormat::Obj => "OBJ",
            MeshFormat::Vtk => "VTK",
            MeshFormat::Vtp => "VTP",
            MeshFormat::Gltf => "glTF",
            MeshFormat::Json => "JSON",
        }
    }

    /// Endings of the names of such files, without the dot.
    pub const FILE_EXTENSIONS: [&'static str; 8] =
        ["stl", "ply", "obj", "vtk", "vtp", "glb", "gltf", "json"];
}

/// A surface that was read.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadMesh {
    /// The closed surface, LPS mm, its triangles facing outward.
    pub mesh: TriMesh,
    /// The format of the file.
    pub format: MeshFormat,
    /// Assumptions and changes, in sentences.
    pub notes: Vec<String>,
    /// Why its size is not that of an organ, if nobody stated its unit.
    pub unlikely: Option<UnlikelySize>,
}

/// The format that `start`, the first bytes of a file (1024 suffice), shows. `length` is the length of the file; a
/// binary STL file is told by it.
pub fn recognise(start: &[u8], length: u64) -> Option<MeshFormat> {
    let has = |word: &str| start.windows(word.len()).any(|w| w == word.as_bytes());
    let text = start.trim_ascii_start();
    if stl::is_binary(start, length) {
        return Some(MeshFormat::Stl);
    }
    if start.starts_with(b"glTF") {
        return Some(MeshFormat::Gltf);
    }
    if start.starts_with(b"ply\n") || start.starts_with(b"ply\r") {
        return Some(MeshFormat::Ply);
    }
    if start.starts_with(b"# vtk DataFile") {
        return Some(MeshFormat::Vtk);
    }
    if text.starts_with(b"<") {
        return has("<VTKFile").then_some(MeshFormat::Vtp);
    }
    if text.starts_with(b"{") {
        let gltf = ["\"asset\"", "\"bufferViews\"", "\"accessors\""];
        let ours = ["\"vertices\"", "\"frame\""];
        return match (gltf.into_iter().any(has), ours.into_iter().any(has)) {
            (true, _) => Some(MeshFormat::Gltf),
            (false, true) => Some(MeshFormat::Json),
            _ => None,
        };
    }
    if stl::is_text(text) {
        return Some(MeshFormat::Stl);
    }
    obj::is_obj(start).then_some(MeshFormat::Obj)
}

/// Reads the surface in `bytes`. `limit` bounds the bytes of the file, and those that its arrays unpack to.
///
/// # Errors
/// [`MeshFileError`].
pub fn read(bytes: &[u8], stated: &MeshStatement, limit: u64) -> Result<ReadMesh, MeshFileError> {
    read_watched(bytes, stated, limit, &Monitor::silent())
}

/// As [`read`], until the caller cancels.
///
/// # Errors
/// [`MeshFileError`].
pub fn read_watched(
    bytes: &[u8],
    stated: &MeshStatement,
    limit: u64,
    monitor: &Monitor<'_>,
) -> Result<ReadMesh, MeshFileError> {
    let read = look_watched(bytes, stated, limit, monitor)?;
    match read.unlikely {
        Some(unlikely) => Err(MeshFileError::Size(unlikely)),
        None => Ok(read),
    }
}

/// As [`read`], where `stated` counts only for what the file does not state: for several files of which some do.
///
/// # Errors
/// [`MeshFileError`].
pub fn read_where_silent(
    bytes: &[u8],
    stated: &MeshStatement,
    limit: u64,
    monitor: &Monitor<'_>,
) -> Result<ReadMesh, MeshFileError> {
    let mut stated = *stated;
    loop {
        match read_watched(bytes, &stated, limit, monitor) {
            Err(MeshFileError::Contradiction { field: "unit", .. }) if stated.unit.is_some() => {
                stated.unit = None;
            }
            Err(MeshFileError::Contradiction { field: "frame", .. }) if stated.frame.is_some() => {
                stated.frame = None;
            }
            other => return other,
        }
    }
}

/// As [`read`], also for a surface whose size is not that of an organ.
///
/// # Errors
/// [`MeshFileError`], never [`MeshFileError::Size`].
pub fn look(bytes: &[u8], stated: &MeshStatement, limit: u64) -> Result<ReadMesh, MeshFileError> {
    look_watched(bytes, stated, limit, &Monitor::silent())
}

/// As [`look`], until the caller cancels.
///
/// # Errors
/// [`MeshFileError`], never [`MeshFileError::Size`].
pub fn look_watched(
    bytes: &[u8],
    stated: &MeshStatement,
    limit: u64,
    monitor: &Monitor<'_>,
) -> Result<ReadMesh, MeshFileError> {
    let length = bytes.len() as u64;
    if length > limit {
        return Err(MeshFileError::TooLong {
            bytes: length,
            limit,
        });
    }
    let start = &bytes[..bytes.len().min(1024)];
    let format = recognise(start, length).ok_or_else(|| error::unknown(start))?;
    let parsed = match format {
        MeshFormat::Stl => stl::parse(bytes, monitor),
        MeshFormat::Ply => ply::parse(bytes, monitor),
        MeshFormat::Obj => obj::parse(bytes, monitor),
        MeshFormat::Vtk => vtk::parse(bytes, monitor),
        MeshFormat::Vtp => vtp::parse(bytes, limit, monitor),
        MeshFormat::Gltf => gltf::parse(bytes, limit, monitor),
        MeshFormat::Json => json::parse(bytes, monitor),
    }?;
    finish(format, parsed, stated, monitor)
}

/// Steps 3 to 6.
fn finish(
    format: MeshFormat,
    parsed: Parsed,
    stated: &MeshStatement,
    monitor: &Monitor<'_>,
) -> Result<ReadMesh, MeshFileError> {
    monitor.check()?;
    if parsed.triangles.is_empty() {
        return Err(MeshFileError::Empty);
    }
    let finite = |p: &Vec3| p.iter().all(|x| x.is_finite());
    if let Some(vertex) = parsed.vertices.iter().position(|p| !finite(p)) {
        return Err(MeshFileError::NotFinite { vertex });
    }
    let unit = said::agreed("unit", stated.unit, parsed.unit)?;
    let frame = said::agreed("frame", stated.frame, parsed.frame)?;
    let mut notes = parsed.notes;
    let mut mesh = TriMesh {
        vertices: parsed.vertices,
        triangles: parsed.triangles,
    };
    weld::close(&mut mesh, parsed.corners_only, &mut notes, monitor)?;
    monitor.check()?;

    let world = format == MeshFormat::Gltf;
    let used_unit = unit.unwrap_or(if world {
        MeshUnit::Metre
    } else {
        MeshUnit::Millimetre
    });
    let scale = used_unit.in_millimetres();
    for p in &mut mesh.vertices {
        let lps = match frame {
            Some(MeshFrame::Ras) => frame::lps_of_ras(p),
            None if world => frame::lps_of_y_up(p),
            Some(MeshFrame::Lps) | None => *p,
        };
        *p = lps * scale;
    }
    if frame.is_none() {
        notes.push(if world {
            "The file does not say which way the patient lies; the axes of glTF were assumed: x to \
                     the left, y to superior, z to anterior."
                .into()
        } else {
            "The file does not say in which frame its coordinates are; LPS was assumed.".into()
        });
    }
    if unit.is_none() {
        let assumed = if world {
            "metres were assumed, as glTF says"
        } else {
            "millimetres were assumed"
        };
        notes.push(format!(
            "The file does not state its unit of length; {assumed}."
        ));
    }
    if let Some(vertex) = mesh.vertices.iter().position(|p| !finite(p)) {
        return Err(MeshFileError::NotFinite { vertex });
    }
    let volume = mesh.volume();
    if !volume.is_finite() || volume == 0.0 {
        return Err(MeshFileError::Flat);
    }
    if volume < 0.0 {
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        notes.push("The triangles faced inward and were turned.".into());
    }
    mesh.vertices.shrink_to_fit();
    mesh.triangles.shrink_to_fit();
    let unlikely = match unit {
        Some(_) => None,
        None => size::unlikely(&mesh, used_unit),
    };
    Ok(ReadMesh {
        mesh,
        format,
        notes,
        unlikely,
    })
}
