//! STL: triangles with their corners, as text or in binary.
//!
//! A binary file has 80 bytes of header, the number of triangles and 50 bytes for each; its length tells it from a
//! text, since headers that begin with `solid` occur. Normals are not read: the order of the corners says the side.

use super::MeshFormat;
use super::cursor::Cursor;
use super::error::MeshFileError;
use super::number::NumberType;
use super::parsed::Parsed;
use super::said::Said;
use crate::base::geometry::Vec3;
use crate::base::progress::Monitor;

const HEADER_BYTES: usize = 84;
const TRIANGLE_BYTES: usize = 50;

/// Whether a file of `length` bytes that begins with `start` is a binary STL file.
pub(super) fn is_binary(start: &[u8], length: u64) -> bool {
    count(start).is_some_and(|count| {
        count > 0 && HEADER_BYTES as u64 + TRIANGLE_BYTES as u64 * u64::from(count) == length
    })
}

/// The number of triangles of a binary file.
fn count(start: &[u8]) -> Option<u32> {
    let count = start.get(80..HEADER_BYTES)?;
    Some(u32::from_le_bytes([count[0], count[1], count[2], count[3]]))
}

/// Whether a text begins as one of STL.
pub(super) fn is_text(text: &[u8]) -> bool {
    let lower = text.to_ascii_lowercase();
    let has = |word: &[u8]| lower.windows(word.len()).any(|w| w == word);
    lower.starts_with(b"solid") && (has(b"facet") || has(b"endsolid"))
}

pub(super) fn parse(bytes: &[u8], monitor: &Monitor<'_>) -> Result<Parsed, MeshFileError> {
    if is_binary(bytes, bytes.len() as u64) {
        binary(bytes, monitor)
    } else {
        text(bytes, monitor)
    }
}

fn binary(bytes: &[u8], monitor: &Monitor<'_>) -> Result<Parsed, MeshFileError> {
    let mut said = Said::default();
    said.hear(&bytes[..80])?;
    let body = bytes[HEADER_BYTES..].chunks_exact(TRIANGLE_BYTES);
    let mut parsed = soup(body.len());
    for triangle in body {
        monitor.check()?;
        for corner in triangle[12..48].chunks_exact(12) {
            let axis = |a: usize| NumberType::F32.read(&corner[4 * a..], false);
            parsed.vertices.push(Vec3::new(axis(0), axis(1), axis(2)));
        }
    }
    Ok(numbered(parsed).said(said))
}

fn text(bytes: &[u8], monitor: &Monitor<'_>) -> Result<Parsed, MeshFileError> {
    let mut cursor = Cursor::new(bytes, MeshFormat::Stl, monitor);
    let mut said = Said::default();
    let mut parsed = soup(0);
    let mut inside = false;
    // Corners of the loop that is open.
    let mut corners = None;
    while let Some(word) = cursor.word()? {
        let word = word.to_ascii_lowercase();
        match (word.as_slice(), inside, corners) {
            (b"solid", false, None) => {
                said.hear(cursor.line()?.unwrap_or_default())?;
                inside = true;
            }
            (b"endsolid", true, None) => {
                cursor.line()?;
                inside = false;
            }
            (b"facet" | b"endfacet", true, None) => {}
            (b"normal", true, None) => {
                for _ in 0..3 {
                    cursor.word()?;
                }
            }
            (b"outer", true, None) => corners = Some(0),
            (b"loop", true, Some(0)) => {}
            (b"vertex", true, Some(n)) if n < 3 => {
                let point = [cursor.number()?, cursor.number()?, cursor.number()?];
                parsed.vertices.push(point.into());
                corners = Some(n + 1);
            }
            (b"endloop", true, Some(3)) => corners = None,
            (other, ..) => {
                let shown = other.escape_ascii();
                return Err(cursor.damaged(format!("`{shown}` is out of place before here")));
            }
        }
    }
    if inside {
        Err(cursor.damaged("the text ends without `endsolid`"))
    } else {
        Ok(numbered(parsed).said(said))
    }
}

fn soup(triangles: usize) -> Parsed {
    Parsed {
        vertices: Vec::with_capacity(3 * triangles),
        corners_only: true,
        ..Parsed::default()
    }
}

fn numbered(mut parsed: Parsed) -> Parsed {
    let count = parsed.vertices.len() as u32 / 3;
    parsed.triangles = (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    parsed
}
