//! VTK XML PolyData: text, base64 within the tags, or appended as base64 or raw bytes; plain or packed by zlib; both
//! byte orders; 32- and 64-bit headers; several pieces.
//!
//! After "VTK XML Formats". The field data `SPACE` and `UNIT` say frame and unit.

use super::MeshFormat;
use super::cursor::Cursor;
use super::error::MeshFileError;
use super::number::NumberType;
use super::parsed::{Faces, Parsed, damaged};
use super::said::Said;
use super::xml::{self, Tag};
use crate::base::geometry::Vec3;
use crate::base::progress::Monitor;
use flate2::read::ZlibDecoder;
use std::io::Read;

const OWN_FORMAT: MeshFormat = MeshFormat::Vtp;
/// Most pieces of a file.
const MAX_PIECES: usize = 64;
/// Deepest tags.
const MAX_TAG_DEPTH: usize = 16;

/// An array as its tag states it.
#[derive(Debug, Clone, Copy)]
struct Array<'a> {
    kind: Option<NumberType>,
    content: Content<'a>,
}

#[derive(Debug, Clone, Copy)]
enum Content<'a> {
    Text(&'a [u8]),
    Base64(&'a [u8]),
    /// Place in the appended data.
    Appended(usize),
}

#[derive(Debug, Default)]
struct Piece<'a> {
    points: Option<Array<'a>>,
    stated_points: Option<u64>,
    /// Corners and offsets of polygons.
    polygons: [Option<Array<'a>>; 2],
    strips: [Option<Array<'a>>; 2],
    others: bool,
}

pub(super) fn parse(
    bytes: &[u8],
    limit: u64,
    monitor: &Monitor<'_>,
) -> Result<Parsed, MeshFileError> {
    let mut file = File::new(monitor);
    let mut path: Vec<&[u8]> = Vec::new();
    let mut pieces: Vec<Piece<'_>> = Vec::new();
    let mut texts: Vec<(&'static str, Array<'_>)> = Vec::new();
    let mut at = 0;
    while let Some(tag) = xml::next(bytes, at)? {
        at = tag.end;
        if tag.closes {
            if path.pop() != Some(tag.name) {
                return Err(damaged(
                    OWN_FORMAT,
                    at,
                    "a tag closes another than the last",
                ));
            }
            continue;
        }
        match (tag.name, path.last().copied().unwrap_or_default()) {
            (b"VTKFile", _) => file.open(&tag)?,
            (b"AppendedData", _) => {
                let begin = xml::find(bytes, at, b"_");
                let begin =
                    begin.ok_or_else(|| damaged(OWN_FORMAT, at, "no `_` begins the data"))?;
                file.appended = &bytes[begin + 1..];
                file.raw = tag.value(b"encoding") == Some(b"raw");
                break;
            }
            (b"Piece", _) => {
                if pieces.len() == MAX_PIECES {
                    return Err(damaged(
                        OWN_FORMAT,
                        at,
                        format!("more than {MAX_PIECES} pieces"),
                    ));
                }
                pieces.push(Piece {
                    stated_points: tag.value(b"NumberOfPoints").and_then(whole),
                    ..Piece::default()
                });
                let lines = ["NumberOfVerts", "NumberOfLines"].map(|name| {
                    let count = tag.value(name.as_bytes()).and_then(whole);
                    count.is_some_and(|count| count > 0)
                });
                if let Some(piece) = pieces.last_mut() {
                    piece.others = lines.contains(&true);
                }
            }
            (b"DataArray" | b"Array", parent) => {
                let array = array(bytes, &tag)?;
                let name = tag.value(b"Name").unwrap_or_default();
                let place = match name {
                    b"connectivity" => Some(0),
                    b"offsets" => Some(1),
                    _ => None,
                };
                match (parent, pieces.last_mut(), place) {
                    (b"FieldData", ..) if name == b"SPACE" => texts.push(("SPACE", array)),
                    (b"FieldData", ..) if name == b"UNIT" => texts.push(("UNIT", array)),
                    (b"Points", Some(piece), _) => piece.points = Some(array),
                    (b"Polys", Some(piece), Some(place)) => piece.polygons[place] = Some(array),
                    (b"Strips", Some(piece), Some(place)) => piece.strips[place] = Some(array),
                    _ => {}
                }
            }
            _ => {}
        }
        if !tag.empty {
            if path.len() == MAX_TAG_DEPTH {
                return Err(damaged(OWN_FORMAT, at, "the tags nest too deep"));
            }
            path.push(tag.name);
        }
    }
    file.budget = limit;
    let mut said = Said::default();
    // A hostile file has many of them.
    for (field, array) in texts.iter().take(4) {
        let text = file.text(*array)?;
        match *field {
            "SPACE" => said.frame(field, &text)?,
            _ => said.unit(field, &text)?,
        }
    }
    let mut vertices = Vec::new();
    let mut faces = Faces::new(monitor);
    for piece in &pieces {
        file.add(piece, &mut vertices, &mut faces)?;
    }
    let mut parsed = faces.over(vertices).said(said);
    if pieces.iter().any(|piece| piece.others) {
        parsed.notes.push("Lines or points were left out.".into());
    }
    Ok(parsed)
}

/// The statements of the whole file, and the bytes that may still be unpacked.
struct File<'a> {
    monitor: Monitor<'static>,
    big_endian: bool,
    wide_headers: bool,
    packed: bool,
    appended: &'a [u8],
    raw: bool,
    budget: u64,
}

impl File<'_> {
    fn new(monitor: &Monitor<'_>) -> Self {
        Self {
            monitor: monitor.without_observer(),
            big_endian: false,
            wide_headers: false,
            packed: false,
            appended: &[],
            raw: false,
            budget: 0,
        }
    }

    fn open(&mut self, tag: &Tag<'_>) -> Result<(), MeshFileError> {
        let unsupported = |what: String| MeshFileError::Unsupported {
            format: OWN_FORMAT,
            what,
        };
        let kind = tag.value(b"type").unwrap_or_default();
        if kind != b"PolyData" {
            return Err(unsupported(format!(
                "the type {}, not PolyData",
                kind.escape_ascii()
            )));
        }
        self.big_endian = tag.value(b"byte_order") == Some(b"BigEndian");
        self.wide_headers = tag.value(b"header_type") == Some(b"UInt64");
        self.packed = match tag.value(b"compressor") {
            None | Some(b"") => false,
            Some(b"vtkZLibDataCompressor") => true,
            Some(other) => {
                return Err(unsupported(format!(
                    "arrays packed by {}, not by vtkZLibDataCompressor",
                    other.escape_ascii()
                )));
            }
        };
        Ok(())
    }

    fn add(
        &mut self,
        piece: &Piece<'_>,
        vertices: &mut Vec<Vec3>,
        faces: &mut Faces,
    ) -> Result<(), MeshFileError> {
        let Some(points) = piece.points else {
            return Ok(());
        };
        let points = self.numbers(points)?;
        let count = points.len() / 3;
        if points.len() % 3 != 0 || piece.stated_points.is_some_and(|n| n != count as u64) {
            return Err(MeshFileError::Damaged {
                format: OWN_FORMAT,
                place: "Points".into(),
                reason: format!(
                    "the array has {} numbers, and the piece states {} points",
                    points.len(),
                    piece.stated_points.unwrap_or(0)
                ),
            });
        }
        let before = vertices.len();
        vertices.extend(points.chunks_exact(3).map(|p| Vec3::new(p[0], p[1], p[2])));
        drop(points);
        for (arrays, strip) in [(piece.polygons, false), (piece.strips, true)] {
            let [Some(corners), Some(offsets)] = arrays else {
                continue;
            };
            let (corners, offsets) = (self.numbers(corners)?, self.numbers(offsets)?);
            let mut begin = 0.0;
            for end in offsets {
                let cell = if end >= begin && end.fract() == 0.0 {
                    corners.get(begin as usize..end as usize)
                } else {
                    None
                };
                let cell = cell.ok_or_else(|| MeshFileError::Damaged {
                    format: OWN_FORMAT,
                    place: "offsets".into(),
                    reason: format!("a cell leads from {begin} to {end} of {}", corners.len()),
                })?;
                // Pieces number their own points.
                let own = |corner: &f64| {
                    if *corner >= 0.0 && *corner < count as f64 {
                        corner + before as f64
                    } else {
                        f64::from(u32::MAX)
                    }
                };
                if strip {
                    faces.strip(cell.iter().map(own), vertices.len())?
                } else {
                    faces.polygon(cell.iter().map(own), vertices.len())?
                }
                begin = end;
            }
        }
        Ok(())
    }

    /// The numbers of an array.
    fn numbers(&mut self, array: Array<'_>) -> Result<Vec<f64>, MeshFileError> {
        let kind = array.kind.ok_or_else(|| MeshFileError::Unsupported {
            format: OWN_FORMAT,
            what: "an array of points or cells without a type of numbers".into(),
        })?;
        if let Content::Text(text) = array.content {
            let mut cursor = Cursor::new(text.trim_ascii(), OWN_FORMAT, &self.monitor);
            let mut numbers = Vec::new();
            while !cursor.rest().is_empty() {
                numbers.push(cursor.number()?);
            }
            return Ok(numbers);
        }
        // Numbers take eight bytes of memory each.
        if kind.bytes() == 1 {
            return Err(MeshFileError::Unsupported {
                format: OWN_FORMAT,
                what: "points or cells of one byte".into(),
            });
        }
        let bytes = self.bytes(array.content)?;
        self.monitor.check()?;
        let numbers = bytes.chunks_exact(kind.bytes());
        match numbers.remainder() {
            [] => Ok(numbers.map(|n| kind.read(n, self.big_endian)).collect()),
            _ => Err(broken("the bytes are not a whole number of entries".into())),
        }
    }

    /// A text: the codes of its characters, ended by 0.
    fn text(&mut self, array: Array<'_>) -> Result<Vec<u8>, MeshFileError> {
        let bytes = match array.content {
            Content::Text(text) => {
                let mut cursor = Cursor::new(text, OWN_FORMAT, &self.monitor);
                let mut bytes = Vec::new();
                while let Some(word) = cursor.word()? {
                    let code = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
                    bytes
                        .push(code.ok_or_else(|| cursor.damaged("a text is not a list of codes"))?);
                }
                bytes
            }
            content => self.bytes(content)?,
        };
        let end = bytes.iter().position(|b| *b == 0);
        Ok(bytes[..end.unwrap_or(bytes.len())].to_vec())
    }

    /// The bytes of an array that is not text: after a header that states their number, or with packed arrays the
    /// numbers of blocks and bytes.
    fn bytes(&mut self, content: Content<'_>) -> Result<Vec<u8>, MeshFileError> {
        let (source, raw) = match content {
            Content::Text(text) | Content::Base64(text) => (text, false),
            Content::Appended(at) => {
                let rest = self.appended.get(at..);
                let rest =
                    rest.ok_or_else(|| broken(format!("the appended data has no byte {at}")))?;
                (rest, self.raw)
            }
        };
        let monitor = self.monitor.clone();
        let first = |count: u64| -> Result<Vec<u8>, MeshFileError> {
            monitor.check()?;
            let found = if raw {
                source[..source
                    .len()
                    .min(usize::try_from(count).unwrap_or(usize::MAX))]
                    .to_vec()
            } else {
                base64(source, count)
            };
            if found.len() as u64 == count {
                Ok(found)
            } else {
                Err(broken(format!(
                    "{count} bytes are stated, and {} are there",
                    found.len()
                )))
            }
        };
        let word: u64 = if self.wide_headers { 8 } else { 4 };
        let big_endian = self.big_endian;
        let integer = |bytes: &[u8]| {
            let mut padded = [0; 8];
            padded[..bytes.len()].copy_from_slice(bytes);
            if big_endian {
                padded[..bytes.len()].reverse();
            }
            u64::from_le_bytes(padded)
        };
        let there = source.len() as u64;
        let stated = integer(&first(word)?);
        if !self.packed {
            self.spend(stated)?;
            let all = first(word.saturating_add(stated))?;
            return Ok(all[word as usize..].to_vec());
        }
        let (blocks, head) = (stated, word.saturating_mul(stated.saturating_add(3)));
        if blocks == 0 {
            return Ok(Vec::new());
        }
        if head > there {
            return Err(broken(format!(
                "{blocks} blocks are stated in {there} bytes"
            )));
        }
        let header = first(head)?;
        let sizes: Vec<u64> = header.chunks_exact(word as usize).map(integer).collect();
        let (size, last) = (sizes[1], sizes[2]);
        let total = match last {
            0 => size.saturating_mul(blocks),
            _ => size.saturating_mul(blocks - 1).saturating_add(last),
        };
        self.spend(total)?;
        let packed: u64 = sizes[3..].iter().fold(0, |sum, n| sum.saturating_add(*n));
        let all = first(head.saturating_add(packed))?;
        let mut rest = &all[head as usize..];
        let mut bytes = Vec::new();
        for (block, packed) in sizes[3..].iter().enumerate() {
            monitor.check()?;
            let (own, later) = rest.split_at(*packed as usize);
            rest = later;
            let unpacked = match last {
                0 => size,
                _ if block as u64 + 1 < blocks => size,
                last => last,
            };
            let before = bytes.len() as u64;
            let read = ZlibDecoder::new(own).take(unpacked.saturating_add(1));
            let read = { read }.read_to_end(&mut bytes);
            if read.is_err() || bytes.len() as u64 - before != unpacked {
                return Err(broken(format!(
                    "block {block} does not unpack to {unpacked} bytes"
                )));
            }
        }
        Ok(bytes)
    }

    fn spend(&mut self, bytes: u64) -> Result<(), MeshFileError> {
        if bytes <= self.budget {
            self.budget -= bytes;
            Ok(())
        } else {
            Err(MeshFileError::TooLong {
                bytes,
                limit: self.budget,
            })
        }
    }
}

fn broken(reason: String) -> MeshFileError {
    MeshFileError::Damaged {
        format: OWN_FORMAT,
        place: "an array".into(),
        reason,
    }
}

/// The array that `tag` begins.
fn array<'a>(bytes: &'a [u8], tag: &Tag<'a>) -> Result<Array<'a>, MeshFileError> {
    let kind = match tag.value(b"type").unwrap_or_default() {
        b"Int8" => Some(NumberType::I8),
        b"UInt8" => Some(NumberType::U8),
        b"Int16" => Some(NumberType::I16),
        b"UInt16" => Some(NumberType::U16),
        b"Int32" => Some(NumberType::I32),
        b"UInt32" => Some(NumberType::U32),
        b"Int64" => Some(NumberType::I64),
        b"UInt64" => Some(NumberType::U64),
        b"Float32" => Some(NumberType::F32),
        b"Float64" => Some(NumberType::F64),
        _ => None,
    };
    let text = if tag.empty {
        &[][..]
    } else {
        let end = xml::find(bytes, tag.end, b"<").unwrap_or(bytes.len());
        &bytes[tag.end..end]
    };
    let content =
        match tag.value(b"format").unwrap_or(b"ascii") {
            b"ascii" => Content::Text(text),
            b"binary" => Content::Base64(text),
            b"appended" => {
                let offset = tag.value(b"offset").and_then(whole);
                let offset = offset.and_then(|o| usize::try_from(o).ok());
                Content::Appended(offset.ok_or_else(|| {
                    damaged(OWN_FORMAT, tag.end, "an appended array has no offset")
                })?)
            }
            other => {
                let shown = other.escape_ascii();
                return Err(damaged(
                    OWN_FORMAT,
                    tag.end,
                    format!("the format `{shown}` is unknown"),
                ));
            }
        };
    Ok(Array { kind, content })
}

fn whole(text: &[u8]) -> Option<u64> {
    std::str::from_utf8(text).ok()?.trim().parse().ok()
}

/// The first `count` bytes that `text` encodes, or as many as there are. Padding within the text, as between header and
/// data, ends a group of characters; white space is passed over.
fn base64(text: &[u8], count: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    let (mut group, mut digits, mut padding) = (0_u32, 0, 0);
    for byte in text {
        if bytes.len() as u64 >= count {
            break;
        }
        let digit = match *byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            b'=' => {
                padding += 1;
                0
            }
            white if white.is_ascii_whitespace() => continue,
            _ => break,
        };
        group = group << 6 | u32::from(digit);
        digits += 1;
        if digits == 4 {
            let [_, a, b, c] = group.to_be_bytes();
            let whole = 3_usize.saturating_sub(padding);
            bytes.extend_from_slice(&[a, b, c][..whole]);
            (group, digits, padding) = (0, 0, 0);
        }
    }
    bytes.truncate(usize::try_from(count).unwrap_or(usize::MAX));
    bytes
}
