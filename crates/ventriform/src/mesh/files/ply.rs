//! PLY 1.0: elements with properties, as text or in binary of either byte order.
//!
//! Of the element `vertex` x, y and z are read, of `face` the list `vertex_indices` (or `vertex_index`); all else is
//! passed over. Triangle strips (`tristrips`) are refused.

use super::MeshFormat;
use super::cursor::{Cursor, words};
use super::error::MeshFileError;
use super::number::NumberType;
use super::parsed::{Faces, Parsed};
use super::said::Said;
use crate::base::geometry::Vec3;
use crate::base::progress::Monitor;

const OWN_FORMAT: MeshFormat = MeshFormat::Ply;
/// Most properties of an element, and most elements.
const MAX_PROPERTIES: usize = 256;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Text,
    Little,
    Big,
}

struct Property {
    name: Vec<u8>,
    /// Type of the number of entries, if it is a list.
    list: Option<NumberType>,
    kind: NumberType,
}

struct Element {
    name: Vec<u8>,
    count: u64,
    properties: Vec<Property>,
}

pub(super) fn parse(bytes: &[u8], monitor: &Monitor<'_>) -> Result<Parsed, MeshFileError> {
    let mut cursor = Cursor::new(bytes, OWN_FORMAT, monitor);
    let (encoding, elements, said) = header(&mut cursor)?;
    let mut vertices = Vec::new();
    let mut faces = Faces::new(monitor);
    // Faces refer to vertices, which may come later.
    let number = |name: &[u8]| elements.iter().find(|e| e.name == name).map(|e| e.count);
    let count = number(b"vertex").unwrap_or(0) as usize;
    for element in &elements {
        let each = element.properties.iter().map(|p| match encoding {
            Encoding::Text => 2,
            _ => p.list.unwrap_or(p.kind).bytes(),
        });
        let each = each.sum::<usize>();
        if each == 0 && element.count > 0 {
            return Err(cursor.damaged("an element has no properties"));
        }
        let rows = cursor.require(element.count, each, "elements")?;
        match element.name.as_slice() {
            b"vertex" => vertices = points(&mut cursor, element, rows, encoding)?,
            name => {
                let is_face = name == b"face";
                for _ in 0..rows {
                    for property in &element.properties {
                        let corners = matches!(
                            property.name.as_slice(),
                            b"vertex_indices" | b"vertex_index"
                        );
                        let list = values(&mut cursor, property, encoding)?;
                        if is_face && corners && property.list.is_some() {
                            faces.polygon(list, count)?;
                        }
                    }
                }
            }
        }
    }
    if faces.triangles.is_empty() && elements.iter().any(|e| e.name == b"tristrips") {
        return Err(MeshFileError::Unsupported {
            format: OWN_FORMAT,
            what: "triangle strips (tristrips)".into(),
        });
    }
    Ok(faces.over(vertices).said(said))
}

fn points(
    cursor: &mut Cursor<'_>,
    element: &Element,
    rows: usize,
    encoding: Encoding,
) -> Result<Vec<Vec3>, MeshFileError> {
    let place = |axis: &[u8]| {
        let mut all = element.properties.iter();
        all.position(|p| p.name == axis && p.list.is_none())
    };
    let [Some(x), Some(y), Some(z)] = [&b"x"[..], b"y", b"z"].map(place) else {
        return Err(cursor.damaged("the element vertex has no x, y, z"));
    };
    // A point takes 24 bytes of memory, eight times those of a point of single bytes.
    if [x, y, z]
        .iter()
        .any(|place| element.properties[*place].kind.bytes() == 1)
    {
        return Err(MeshFileError::Unsupported {
            format: OWN_FORMAT,
            what: "coordinates of one byte".into(),
        });
    }
    let mut vertices = Vec::with_capacity(rows);
    let mut row = vec![0.0; element.properties.len()];
    for _ in 0..rows {
        for (value, property) in row.iter_mut().zip(&element.properties) {
            let found = values(cursor, property, encoding)?;
            *value = found.first().copied().unwrap_or(f64::NAN);
        }
        vertices.push(Vec3::new(row[x], row[y], row[z]));
    }
    Ok(vertices)
}

/// The values of a property: one, or those of a list.
fn values(
    cursor: &mut Cursor<'_>,
    property: &Property,
    encoding: Encoding,
) -> Result<Vec<f64>, MeshFileError> {
    let one = |cursor: &mut Cursor<'_>, kind: NumberType| match encoding {
        Encoding::Text => cursor.number(),
        _ => cursor.binary(kind, encoding == Encoding::Big),
    };
    let Some(length) = property.list else {
        return Ok(vec![one(cursor, property.kind)?]);
    };
    let length = one(cursor, length)?;
    if !(length >= 0.0 && length.fract() == 0.0) {
        return Err(cursor.damaged(format!("a list has {length} entries")));
    }
    let each = match encoding {
        Encoding::Text => 2,
        _ => property.kind.bytes(),
    };
    let length = cursor.require(length as u64, each, "entries of a list")?;
    (0..length).map(|_| one(cursor, property.kind)).collect()
}

fn header(cursor: &mut Cursor<'_>) -> Result<(Encoding, Vec<Element>, Said), MeshFileError> {
    let mut said = Said::default();
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    cursor.line()?;
    loop {
        let line = cursor.line()?;
        let line = line.ok_or_else(|| cursor.damaged("the header has no end_header"))?;
        let mut words_of_line = words(line);
        let wrong = |cursor: &Cursor<'_>| {
            let shown = line[..line.len().min(64)].escape_ascii();
            cursor.damaged(format!(
                "this line of the header is not understood: {shown}"
            ))
        };
        match words_of_line.next() {
            None => {}
            Some(b"comment" | b"obj_info") => said.hear(line)?,
            Some(b"end_header") => break,
            Some(b"format") => {
                encoding = Some(match words_of_line.next() {
                    Some(b"ascii") => Encoding::Text,
                    Some(b"binary_little_endian") => Encoding::Little,
                    Some(b"binary_big_endian") => Encoding::Big,
                    _ => return Err(wrong(cursor)),
                });
            }
            Some(b"element") if elements.len() < MAX_PROPERTIES => {
                let name = words_of_line.next().map(<[u8]>::to_vec);
                let count = words_of_line.next().and_then(whole);
                let (Some(name), Some(count)) = (name, count) else {
                    return Err(wrong(cursor));
                };
                elements.push(Element {
                    name,
                    count,
                    properties: Vec::new(),
                });
            }
            Some(b"property") => {
                let mut next = || words_of_line.next();
                let first = next();
                let (list, kind) = match first {
                    Some(b"list") => (Some(next().and_then(kind_of)), next().and_then(kind_of)),
                    word => (None, word.and_then(kind_of)),
                };
                let name = next().map(<[u8]>::to_vec);
                let room = elements
                    .last()
                    .is_some_and(|e| e.properties.len() < MAX_PROPERTIES);
                let (Some(kind), Some(name), true, false) = (kind, name, room, list == Some(None))
                else {
                    return Err(wrong(cursor));
                };
                if let Some(element) = elements.last_mut() {
                    element.properties.push(Property {
                        name,
                        list: list.flatten(),
                        kind,
                    });
                }
            }
            _ => return Err(wrong(cursor)),
        }
    }
    let encoding = encoding.ok_or_else(|| cursor.damaged("the header names no format"))?;
    Ok((encoding, elements, said))
}

fn whole(word: &[u8]) -> Option<u64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

fn kind_of(word: &[u8]) -> Option<NumberType> {
    Some(match word {
        b"char" | b"int8" => NumberType::I8,
        b"uchar" | b"uint8" => NumberType::U8,
        b"short" | b"int16" => NumberType::I16,
        b"ushort" | b"uint16" => NumberType::U16,
        b"int" | b"int32" => NumberType::I32,
        b"uint" | b"uint32" => NumberType::U32,
        b"float" | b"float32" => NumberType::F32,
        b"double" | b"float64" => NumberType::F64,
        _ => return None,
    })
}
