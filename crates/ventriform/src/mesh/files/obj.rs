//! Wavefront OBJ: vertices and polygons. Groups, materials, normals and texture coordinates are passed over.

use super::MeshFormat;
use super::cursor::{Cursor, number, words};
use super::error::MeshFileError;
use super::parsed::{Faces, Parsed};
use super::said::Said;
use crate::base::geometry::Vec3;
use crate::base::progress::Monitor;

const OWN_FORMAT: MeshFormat = MeshFormat::Obj;

/// Statements that say nothing of the surface.
const SKIPPED_STATEMENTS: [&[u8]; 17] = [
    b"vn",
    b"vt",
    b"vp",
    b"g",
    b"o",
    b"s",
    b"mg",
    b"usemtl",
    b"mtllib",
    b"usemap",
    b"maplib",
    b"lod",
    b"shadow_obj",
    b"trace_obj",
    b"bevel",
    b"c_interp",
    b"d_interp",
];

/// Whether a file that begins with `start` is an OBJ file: its lines are statements of OBJ, and a vertex or a comment
/// that names the frame or the format is among them.
pub(super) fn is_obj(start: &[u8]) -> bool {
    let mut known = false;
    // The last line may be cut off.
    let whole = start.iter().rposition(|b| *b == b'\n').unwrap_or(0);
    for line in start[..whole].split(|b| *b == b'\n') {
        let mut words = words(line);
        match words.next() {
            None => {}
            Some(b"v") => {
                let numbers = words.map(number);
                let (mut count, mut numeric) = (0, true);
                for number in numbers {
                    count += 1;
                    numeric &= number.is_some();
                }
                if count < 3 || !numeric {
                    return false;
                }
                known = true;
            }
            Some(word) if word.starts_with(b"#") => {
                let lower = line.to_ascii_lowercase();
                let has = |name: &[u8]| lower.windows(name.len()).any(|w| w == name);
                known |= has(b"space=lps") || has(b"space=ras") || has(b"wavefront");
            }
            Some(b"f" | b"l" | b"p") => {}
            Some(word) if SKIPPED_STATEMENTS.contains(&word) => {}
            Some(_) => return false,
        }
    }
    known
}

pub(super) fn parse(bytes: &[u8], monitor: &Monitor<'_>) -> Result<Parsed, MeshFileError> {
    let mut cursor = Cursor::new(bytes, OWN_FORMAT, monitor);
    let mut said = Said::default();
    let mut vertices: Vec<Vec3> = Vec::new();
    let mut faces = Faces::new(monitor);
    let mut lines = 0;
    while let Some(line) = cursor.line()? {
        let mut words = words(line);
        match words.next() {
            None => {}
            Some(word) if word.starts_with(b"#") => said.hear(line)?,
            Some(b"v") => {
                let mut axis = || words.next().and_then(number);
                let (Some(x), Some(y), Some(z)) = (axis(), axis(), axis()) else {
                    return Err(cursor.damaged("the vertex before here has no three numbers"));
                };
                vertices.push(Vec3::new(x, y, z));
            }
            Some(b"f") => {
                let corners: Option<Vec<f64>> =
                    words.map(|word| corner(word, vertices.len())).collect();
                let corners = corners.ok_or_else(|| {
                    cursor.damaged("a corner of the face before here is not the number of a vertex")
                })?;
                faces.polygon(corners, vertices.len())?;
            }
            Some(b"l" | b"p") => lines += 1,
            Some(word) if SKIPPED_STATEMENTS.contains(&word) => {}
            Some(word) => {
                let shown = word[..word.len().min(32)].escape_ascii();
                return Err(MeshFileError::Unsupported {
                    format: OWN_FORMAT,
                    what: format!("the statement `{shown}`"),
                });
            }
        }
        if line.ends_with(b"\\") {
            return Err(MeshFileError::Unsupported {
                format: OWN_FORMAT,
                what: "lines that continue after a backslash".into(),
            });
        }
    }
    let mut parsed = faces.over(vertices).said(said);
    if lines > 0 {
        parsed
            .notes
            .push(format!("{lines} lines or points were left out."));
    }
    Ok(parsed)
}

/// The vertex of a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`, from 0. Negative numbers count back from the last vertex.
fn corner(word: &[u8], count: usize) -> Option<f64> {
    let vertex = word.split(|b| *b == b'/').next()?;
    let vertex: i64 = std::str::from_utf8(vertex).ok()?.parse().ok()?;
    Some(match vertex {
        1.. => vertex as f64 - 1.0,
        _ if vertex < 0 => count as f64 + vertex as f64,
        _ => return None,
    })
}
