//! Legacy VTK PolyData, text or big-endian binary, versions 1 to 5.1 ("VTK File Formats").
//!
//! POINTS, POLYGONS and TRIANGLE_STRIPS are read, both as lists of cells (to version 4) and as OFFSETS and
//! CONNECTIVITY (from version 5). The title says the frame. What follows POINT_DATA or CELL_DATA is not read.

use super::MeshFormat;
use super::cursor::Cursor;
use super::error::MeshFileError;
use super::number::NumberType;
use super::parsed::{Faces, Parsed};
use super::said::Said;
use crate::base::geometry::Vec3;
use crate::base::progress::Monitor;

const OWN_FORMAT: MeshFormat = MeshFormat::Vtk;

/// The layout of a list of cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cells {
    Polygons,
    Strips,
    /// Lines and points.
    Other,
}

pub(super) fn parse(bytes: &[u8], monitor: &Monitor<'_>) -> Result<Parsed, MeshFileError> {
    let mut reader = Reader {
        cursor: Cursor::new(bytes, OWN_FORMAT, monitor),
        binary: false,
    };
    let version = reader.cursor.line()?.unwrap_or_default();
    let version = version.strip_prefix(b"# vtk DataFile Version ");
    let modern = version.is_some_and(|v| v.first().is_some_and(|b| *b >= b'5'));
    let mut said = Said::default();
    said.hear(reader.cursor.line()?.unwrap_or_default())?;
    let encoding = reader.cursor.line()?.unwrap_or_default();
    reader.binary = match encoding.trim_ascii() {
        b"ASCII" => false,
        b"BINARY" => true,
        _ => {
            return Err(reader
                .cursor
                .damaged("the third line is neither ASCII nor BINARY"));
        }
    };
    let mut vertices: Vec<Vec3> = Vec::new();
    let mut faces = Faces::new(monitor);
    let mut others = 0;
    while let Some(word) = reader.cursor.word()? {
        let word = word.to_ascii_uppercase();
        match word.as_slice() {
            b"DATASET" => {
                let kind = reader.cursor.word()?.unwrap_or_default();
                if !kind.eq_ignore_ascii_case(b"POLYDATA") {
                    return Err(MeshFileError::Unsupported {
                        format: OWN_FORMAT,
                        what: format!("a DATASET of kind {}, not POLYDATA", kind.escape_ascii()),
                    });
                }
            }
            b"FIELD" => reader.fields()?,
            b"METADATA" => reader.metadata()?,
            b"POINTS" => {
                let count = reader.count()?;
                let kind = reader.kind()?;
                if kind.bytes() == 1 {
                    return Err(MeshFileError::Unsupported {
                        format: OWN_FORMAT,
                        what: "coordinates of one byte".into(),
                    });
                }
                let count = reader.require(count, 3, kind)?;
                vertices.reserve_exact(count);
                for _ in 0..count {
                    let mut axis = || reader.number(kind);
                    vertices.push(Vec3::new(axis()?, axis()?, axis()?));
                }
            }
            b"POLYGONS" => reader.cells(Cells::Polygons, modern, &mut faces, vertices.len())?,
            b"TRIANGLE_STRIPS" => {
                reader.cells(Cells::Strips, modern, &mut faces, vertices.len())?
            }
            b"LINES" | b"VERTICES" => {
                others += 1;
                reader.cells(Cells::Other, modern, &mut faces, vertices.len())?;
            }
            b"POINT_DATA" | b"CELL_DATA" => break,
            other => {
                let shown = other.escape_ascii();
                return Err(reader
                    .cursor
                    .damaged(format!("`{shown}` is out of place before here")));
            }
        }
    }
    let mut parsed = faces.over(vertices).said(said);
    if others > 0 {
        parsed.notes.push("Lines or points were left out.".into());
    }
    Ok(parsed)
}

struct Reader<'a> {
    cursor: Cursor<'a>,
    binary: bool,
}

impl Reader<'_> {
    fn number(&mut self, kind: NumberType) -> Result<f64, MeshFileError> {
        if self.binary {
            self.cursor.binary(kind, true)
        } else {
            self.cursor.number()
        }
    }

    /// A number of elements, in text.
    fn count(&mut self) -> Result<u64, MeshFileError> {
        let count = self.cursor.number()?;
        if count >= 0.0 && count.fract() == 0.0 {
            Ok(count as u64)
        } else {
            Err(self.cursor.damaged(format!("{count} elements are stated")))
        }
    }

    /// `count` if the bytes of so many elements of `each` numbers are there.
    fn require(&self, count: u64, each: usize, kind: NumberType) -> Result<usize, MeshFileError> {
        let bytes = if self.binary { kind.bytes() } else { 2 };
        self.cursor.require(count, each * bytes, "elements")
    }

    /// The name of a type, and the end of its line.
    fn kind(&mut self) -> Result<NumberType, MeshFileError> {
        let word = self.cursor.word()?.unwrap_or_default().to_ascii_lowercase();
        let kind = kind_of(&word).ok_or_else(|| MeshFileError::Unsupported {
            format: OWN_FORMAT,
            what: format!("numbers of type `{}`", word.escape_ascii()),
        })?;
        self.cursor.line()?;
        Ok(kind)
    }

    fn cells(
        &mut self,
        cells: Cells,
        modern: bool,
        faces: &mut Faces,
        count: usize,
    ) -> Result<(), MeshFileError> {
        let (cell_count, size) = (self.count()?, self.count()?);
        self.cursor.line()?;
        if modern {
            return self.offsets(cells, [cell_count, size], faces, count);
        }
        let kind = NumberType::I32;
        let mut left = self.require(size, 1, kind)?;
        for _ in 0..self.require(cell_count, 1, kind)? {
            let corners = self.number(kind)?;
            if !(corners >= 0.0 && corners.fract() == 0.0 && corners < left as f64) {
                return Err(self.cursor.damaged(format!(
                    "a cell of {corners} corners exceeds the stated size"
                )));
            }
            let corners = corners as usize;
            left -= 1 + corners;
            let list: Vec<f64> = (0..corners)
                .map(|_| self.number(kind))
                .collect::<Result<_, _>>()?;
            add(cells, list, faces, count)?;
        }
        match left {
            0 => Ok(()),
            _ => Err(self
                .cursor
                .damaged(format!("the cells have {left} numbers fewer than stated"))),
        }
    }

    /// Cells as of version 5: their offsets, one more than cells, and their corners one after the other.
    fn offsets(
        &mut self,
        cells: Cells,
        [offsets, size]: [u64; 2],
        faces: &mut Faces,
        count: usize,
    ) -> Result<(), MeshFileError> {
        let mut list = |name: &[u8], length: u64| {
            let word = self.cursor.word()?.unwrap_or_default();
            if !word.eq_ignore_ascii_case(name) {
                let name = name.escape_ascii();
                return Err(self
                    .cursor
                    .damaged(format!("`{name}` is missing before here")));
            }
            let kind = self.kind()?;
            let length = self.require(length, 1, kind)?;
            (0..length)
                .map(|_| self.number(kind))
                .collect::<Result<Vec<f64>, _>>()
        };
        let offsets = list(b"OFFSETS", offsets)?;
        let corners = list(b"CONNECTIVITY", size)?;
        for pair in offsets.windows(2) {
            let cell = if pair[0] >= 0.0 && pair[0] <= pair[1] {
                corners.get(pair[0] as usize..pair[1] as usize)
            } else {
                None
            };
            let cell = cell.ok_or_else(|| {
                self.cursor
                    .damaged(format!("an offset leads from {} to {}", pair[0], pair[1]))
            })?;
            add(cells, cell.to_vec(), faces, count)?;
        }
        Ok(())
    }

    /// Passes over the arrays of a field.
    fn fields(&mut self) -> Result<(), MeshFileError> {
        self.cursor.word()?;
        for _ in 0..self.count()?.min(1 << 16) {
            let mut name = self.cursor.word()?.unwrap_or_default();
            if name == b"METADATA" {
                self.metadata()?;
                name = self.cursor.word()?.unwrap_or_default();
            }
            if name.is_empty() {
                return Err(self.cursor.damaged("an array of a field is missing"));
            }
            let (components, tuples) = (self.count()?, self.count()?);
            let entries = components.saturating_mul(tuples);
            let before = self.cursor.rest();
            let kind = self.cursor.word()?.unwrap_or_default();
            if kind == b"string" {
                self.cursor.line()?;
                self.texts(entries)?;
                continue;
            }
            self.cursor = Cursor::new(before, OWN_FORMAT, self.cursor.monitor());
            let kind = self.kind()?;
            let entries = self.require(entries, 1, kind)?;
            if self.binary {
                self.cursor.take(entries * kind.bytes())?;
            } else {
                for _ in 0..entries {
                    self.cursor.word()?;
                }
            }
        }
        Ok(())
    }

    /// Passes over texts: lines, or in binary a length in 1, 2, 4 or 8 bytes (told by the upper two bits of the first)
    /// and the bytes.
    fn texts(&mut self, entries: u64) -> Result<(), MeshFileError> {
        for _ in 0..self.cursor.require(entries, 1, "texts")? {
            if !self.binary {
                self.cursor.line()?;
                continue;
            }
            let first = self.cursor.take(1)?[0];
            let more = [7, 3, 1, 0][usize::from(first >> 6)];
            let mut length = u64::from(first & 0x3f);
            for byte in self.cursor.take(more)? {
                length = length << 8 | u64::from(*byte);
            }
            let length = self.cursor.require(length, 1, "bytes of a text")?;
            self.cursor.take(length)?;
        }
        Ok(())
    }

    /// Passes over a section that ends with an empty line.
    fn metadata(&mut self) -> Result<(), MeshFileError> {
        self.cursor.line()?;
        while let Some(line) = self.cursor.line()? {
            if line.trim_ascii().is_empty() {
                break;
            }
        }
        Ok(())
    }
}

fn add(
    cells: Cells,
    corners: Vec<f64>,
    faces: &mut Faces,
    count: usize,
) -> Result<(), MeshFileError> {
    match cells {
        Cells::Polygons => faces.polygon(corners, count),
        Cells::Strips => faces.strip(corners, count),
        Cells::Other => Ok(()),
    }
}

fn kind_of(word: &[u8]) -> Option<NumberType> {
    Some(match word {
        b"char" => NumberType::I8,
        b"unsigned_char" => NumberType::U8,
        b"short" => NumberType::I16,
        b"unsigned_short" => NumberType::U16,
        b"int" | b"vtkidtype" | b"vtktypeint32" => NumberType::I32,
        b"unsigned_int" | b"vtktypeuint32" => NumberType::U32,
        b"long" | b"vtktypeint64" => NumberType::I64,
        b"unsigned_long" | b"vtktypeuint64" => NumberType::U64,
        b"float" => NumberType::F32,
        b"double" => NumberType::F64,
        _ => return None,
    })
}
