//! glTF 2.0 with one node, one mesh and one buffer. The mesh is one primitive, or one for each part of the
//! wall where these are known: they share the vertices, and have a material and `extras` with the part's name.
//!
//! The vertices are in patient coordinates, so a program that reads the accessor directly has
//! medical coordinates. The node's matrix converts them to the world frame of glTF, metres with
//! Y up, in which the patient stands upright and faces +Z:
//!
//! ```text
//! X = L / 1000,   Y = S / 1000,   Z = -P / 1000
//! ```
//!
//! The buffer contains positions (f32), normals (f32) and indices (u16 if they fit, otherwise u32), then the
//! uncertainty (f32) and the colours (u16, linear RGBA) of the vertices, where there are any.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use super::{COORDINATE_FRAME, ExportError, LENGTH_UNIT, Metadata, single};
use crate::mesh::TriMesh;
use crate::mesh::part::Part;

/// The matrix from LPS millimetres to glTF metres, by columns.
const PATIENT_TO_WORLD: [f64; 16] = [
    0.001, 0.0, 0.0, 0.0, //
    0.0, 0.0, -0.001, 0.0, //
    0.0, 0.001, 0.0, 0.0, //
    0.0, 0.0, 0.0, 1.0,
];

// Numbers of component types and buffer targets in the specification.
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
pub(super) const FLOAT_COMPONENT: u32 = 5126;
pub(super) const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// A glTF file with its buffer embedded.
///
/// # Errors
/// [`ExportError::NotFinite`], [`ExportError::Inseparable`]: see [`single`].
pub fn encode(mesh: &TriMesh, metadata: &Metadata) -> Result<Vec<u8>, ExportError> {
    let (mut document, buffer) = document(mesh, metadata)?;
    let uri = format!(
        "data:application/octet-stream;base64,{}",
        STANDARD.encode(buffer)
    );
    document["buffers"][0]["uri"] = uri.into();
    Ok(document.to_string().into_bytes())
}

/// The JSON document, in which the buffer has no URI, and the buffer, a multiple of 4 bytes long.
///
/// # Errors
/// [`ExportError::NotFinite`], [`ExportError::Inseparable`]: see [`single`].
pub fn document(mesh: &TriMesh, metadata: &Metadata) -> Result<(Value, Vec<u8>), ExportError> {
    let positions = single::positions(&mesh.vertices)?;
    let normals = single::normals(&mesh.vertex_normals());
    // The index 65535 is reserved for restarting a primitive.
    let narrow = positions.len() <= 65535;
    let groups = groups(mesh, metadata);
    let triangles: Vec<[u32; 3]> = groups
        .iter()
        .flat_map(|group| &group.triangles)
        .copied()
        .collect();
    let mut buffer = bytes_of(&positions, &normals, &triangles, narrow);
    let indices_end = buffer.len();
    buffer.resize(indices_end.next_multiple_of(4), 0);

    let name = if metadata.title.is_empty() {
        "model"
    } else {
        &metadata.title
    };
    let more = more_attributes(mesh, metadata);
    let mut more_starts = Vec::new();
    for attribute in &more {
        more_starts.push(buffer.len());
        buffer.extend(&attribute.bytes);
    }
    // Colours of vertices are multiplied by that of the material.
    let painted = more
        .iter()
        .any(|attribute| attribute.name == COLOUR_ATTRIBUTE);
    let base_colour = if painted {
        [1.0; 4]
    } else {
        [0.64, 0.13, 0.11, 1.0]
    };

    let vertex_bytes = 12 * positions.len();
    let (min, max) = extent(&positions);
    let mut document = json!({
        "asset": {
            "version": "2.0",
            "generator": metadata.software,
            "extras": metadata.to_object(),
        },
        "scene": 0,
        "scenes": [{ "name": name, "nodes": [0] }],
        "nodes": [{ "name": name, "mesh": 0, "matrix": PATIENT_TO_WORLD }],
        "meshes": [{
            "name": name,
            "primitives": [{
                "attributes": { "POSITION": 0, "NORMAL": 1 },
                "indices": 2,
                "material": 0,
            }],
            "extras": {
                "frame": COORDINATE_FRAME,
                "unit": LENGTH_UNIT,
                "frame_of_reference_uid": metadata.frame_of_reference_uid,
            },
        }],
        "materials": [{
            "name": groups[0].name,
            "pbrMetallicRoughness": {
                "baseColorFactor": base_colour,
                "metallicFactor": 0.0,
                "roughnessFactor": 0.55,
            },
        }],
        "accessors": [
            {
                "bufferView": 0, "componentType": FLOAT_COMPONENT, "type": "VEC3",
                "count": positions.len(), "min": min, "max": max,
            },
            {
                "bufferView": 1, "componentType": FLOAT_COMPONENT, "type": "VEC3",
                "count": normals.len(),
            },
            {
                "bufferView": 2, "type": "SCALAR",
                "componentType": if narrow { UNSIGNED_SHORT } else { UNSIGNED_INT },
                "count": 3 * mesh.triangles.len(),
            },
        ],
        "bufferViews": [
            {
                "buffer": 0, "target": ARRAY_BUFFER,
                "byteOffset": 0, "byteLength": vertex_bytes,
            },
            {
                "buffer": 0, "target": ARRAY_BUFFER,
                "byteOffset": vertex_bytes, "byteLength": vertex_bytes,
            },
            {
                "buffer": 0, "target": ELEMENT_ARRAY_BUFFER,
                "byteOffset": 2 * vertex_bytes, "byteLength": indices_end - 2 * vertex_bytes,
            },
        ],
        "buffers": [{ "byteLength": buffer.len() }],
    });
    if groups.len() > 1 {
        let index_bytes = if narrow { 2 } else { 4 };
        let mut start = 0;
        let mut primitives = Vec::new();
        let mut materials = Vec::new();
        for (number, group) in groups.iter().enumerate() {
            let mut material = document["materials"][0].clone();
            material["name"] = group.name.into();
            materials.push(material);
            let mut accessor = document["accessors"][2].clone();
            accessor["count"] = (3 * group.triangles.len()).into();
            accessor["byteOffset"] = start.into();
            start += 3 * group.triangles.len() * index_bytes;
            let mut primitive = document["meshes"][0]["primitives"][0].clone();
            primitive["material"] = number.into();
            primitive["extras"] = json!({ "part": group.name });
            primitive["indices"] = match number {
                0 => {
                    document["accessors"][2] = accessor;
                    2.into()
                }
                _ => push(&mut document["accessors"], accessor).into(),
            };
            primitives.push(primitive);
        }
        document["meshes"][0]["primitives"] = primitives.into();
        document["materials"] = materials.into();
    }
    for (attribute, start) in more.into_iter().zip(more_starts) {
        let view = json!({
            "buffer": 0, "target": ARRAY_BUFFER,
            "byteOffset": start, "byteLength": attribute.bytes.len(),
        });
        let mut accessor = attribute.accessor;
        accessor["bufferView"] = push(&mut document["bufferViews"], view).into();
        accessor["count"] = positions.len().into();
        let index = push(&mut document["accessors"], accessor);
        let primitives = document["meshes"][0]["primitives"].as_array_mut();
        for primitive in primitives.into_iter().flatten() {
            primitive["attributes"][attribute.name] = index.into();
        }
    }
    Ok((document, buffer))
}

/// Appends `entry` to a list; returns its place.
pub(super) fn push(list: &mut Value, entry: Value) -> usize {
    let list = list.as_array_mut();
    list.map_or(0, |list| {
        list.push(entry);
        list.len() - 1
    })
}

/// Triangles with one material.
struct Group {
    name: &'static str,
    triangles: Vec<[u32; 3]>,
}

/// The triangles of each part of the wall, in their order; all in one group where parts are not known.
fn groups(mesh: &TriMesh, metadata: &Metadata) -> Vec<Group> {
    let Some(parts) = metadata.parts_of(mesh) else {
        return vec![Group {
            name: "myocardium",
            triangles: mesh.triangles.clone(),
        }];
    };
    let group = |part: Part| {
        let of_part = mesh.triangles.iter().zip(parts);
        let of_part = of_part.filter(|(_, of)| **of == part);
        let triangles: Vec<[u32; 3]> = of_part.map(|(triangle, _)| *triangle).collect();
        (!triangles.is_empty()).then_some(Group {
            name: part.as_str(),
            triangles,
        })
    };
    Part::ALL.into_iter().filter_map(group).collect()
}

/// glTF's name of the colours of vertices.
const COLOUR_ATTRIBUTE: &str = "COLOR_0";

/// An attribute of vertices that not every mesh has.
struct MoreAttribute {
    name: &'static str,
    /// Its accessor, without view and count.
    accessor: Value,
    /// A multiple of 4 bytes for each vertex.
    bytes: Vec<u8>,
}

/// The uncertainty of each vertex, and the colour that shows its figure.
fn more_attributes(mesh: &TriMesh, metadata: &Metadata) -> Vec<MoreAttribute> {
    let uncertainty = metadata.uncertainty_of(mesh).map(|values| MoreAttribute {
        name: "_UNCERTAINTY",
        accessor: json!({ "componentType": FLOAT_COMPONENT, "type": "SCALAR" }),
        bytes: values
            .iter()
            .flat_map(|x| (*x as f32).to_le_bytes())
            .collect(),
    });
    let colours = metadata.field_of(mesh).map(|field| MoreAttribute {
        name: COLOUR_ATTRIBUTE,
        accessor: json!({
            "componentType": UNSIGNED_SHORT, "type": "VEC4", "normalized": true,
        }),
        bytes: field.colours.iter().flat_map(linear_bytes).collect(),
    });
    uncertainty.into_iter().chain(colours).collect()
}

/// A colour as four u16 in the linear light that glTF counts in; `colour` is sRGB, 0..=1.
fn linear_bytes(colour: &[f64; 3]) -> [u8; 8] {
    let [red, green, blue] = colour.map(|c| match c.clamp(0.0, 1.0) {
        low if low <= 0.04045 => low / 12.92,
        high => ((high + 0.055) / 1.055).powf(2.4),
    });
    let mut bytes = [0; 8];
    for (place, share) in bytes.chunks_exact_mut(2).zip([red, green, blue, 1.0]) {
        place.copy_from_slice(&((65535.0 * share).round() as u16).to_le_bytes());
    }
    bytes
}

/// Positions, normals and indices; these are u16 if `narrow`, otherwise u32.
fn bytes_of(
    positions: &[[f32; 3]],
    normals: &[[f32; 3]],
    triangles: &[[u32; 3]],
    narrow: bool,
) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(24 * positions.len() + 12 * triangles.len());
    bytes.extend(positions.iter().flatten().flat_map(|x| x.to_le_bytes()));
    bytes.extend(normals.iter().flatten().flat_map(|x| x.to_le_bytes()));
    for &v in triangles.iter().flatten() {
        if narrow {
            bytes.extend((v as u16).to_le_bytes());
        } else {
            bytes.extend(v.to_le_bytes());
        }
    }
    bytes
}

/// The smallest and largest coordinates, as `f64`, whose decimals represent an `f32` exactly.
pub(super) fn extent(positions: &[[f32; 3]]) -> ([f64; 3], [f64; 3]) {
    let mut min = [f32::INFINITY; 3];
    let mut max = [f32::NEG_INFINITY; 3];
    for p in positions {
        for r in 0..3 {
            min[r] = min[r].min(p[r]);
            max[r] = max[r].max(p[r]);
        }
    }
    (min.map(f64::from), max.map(f64::from))
}
