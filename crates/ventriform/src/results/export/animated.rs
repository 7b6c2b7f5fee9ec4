//! GLB of a surface in motion: one morph target for each mesh of a cycle, and an animation that closes.
//!
//! In: meshes with the same triangles, at equal steps of a cycle, and the cycle's length. Out: a GLB file as
//! [`Format::Glb`](super::Format::Glb) has it, of one of the meshes, with the others as displacements of its positions
//! and normals.
//!
//! 1. The mesh at rest is written as [`gltf::document`] does, with parts, colours and metadata.
//! 2. Each mesh becomes a morph target of the name "gate 1", "gate 2", ...; all parts share its accessors.
//! 3. The animation "beat" moves the weights linearly from each mesh to the next: at key n mesh n is shown. The last
//!    key, at the cycle's length, shows the first mesh again.
//!
//! Guaranteed: the same input gives the same bytes; at a key the positions are those of its mesh to the precision of
//! `f32`.

use serde_json::{Value, json};

use super::gltf::{self, ARRAY_BUFFER, FLOAT_COMPONENT, push};
use super::{ExportError, Metadata, check, glb, single};
use crate::mesh::TriMesh;

/// A cycle of meshes.
#[derive(Debug, Clone, Copy)]
pub struct Cycle<'a> {
    /// The meshes at equal steps of the cycle, with the same triangles.
    pub meshes: &'a [TriMesh],
    /// The mesh that is shown where nothing moves.
    pub rest: usize,
    /// Length of the cycle, s.
    pub seconds: f64,
}

/// A GLB file of `cycle`.
///
/// # Errors
/// As [`export::encode`](super::encode); [`ExportError::OtherMesh`] if the meshes do not have the same vertices and
/// triangles, or there is none.
pub fn encode(cycle: &Cycle<'_>, metadata: &Metadata) -> Result<Vec<u8>, ExportError> {
    let other = |index| ExportError::OtherMesh { index };
    let rest = cycle.meshes.get(cycle.rest).ok_or(other(cycle.rest))?;
    for (index, mesh) in cycle.meshes.iter().enumerate() {
        check(mesh)?;
        if mesh.triangles != rest.triangles || mesh.vertices.len() != rest.vertices.len() {
            return Err(other(index));
        }
    }
    let (mut document, mut buffer) = gltf::document(rest, metadata)?;
    let positions = single::positions(&rest.vertices)?;
    let normals = single::normals(&rest.vertex_normals());
    let mut targets = Vec::new();
    for mesh in cycle.meshes {
        let of_positions = displacements(&single::positions(&mesh.vertices)?, &positions);
        let of_normals = displacements(&single::normals(&mesh.vertex_normals()), &normals);
        let (min, max) = gltf::extent(&of_positions);
        let mut accessor = |vectors: &[[f32; 3]]| {
            let view = view(&mut document, &mut buffer, vectors.as_flattened(), true);
            json!({
                "bufferView": view, "componentType": FLOAT_COMPONENT, "type": "VEC3",
                "count": vectors.len(),
            })
        };
        let (mut moved, turned) = (accessor(&of_positions), accessor(&of_normals));
        moved["min"] = json!(min);
        moved["max"] = json!(max);
        let [moved, turned] = [moved, turned].map(|a| push(&mut document["accessors"], a));
        targets.push(json!({ "POSITION": moved, "NORMAL": turned }));
    }
    let count = cycle.meshes.len();
    let primitives = document["meshes"][0]["primitives"].as_array_mut();
    for primitive in primitives.into_iter().flatten() {
        primitive["targets"] = targets.clone().into();
    }
    let shown = |mesh: usize| (0..count).map(move |n| if n == mesh { 1.0f32 } else { 0.0 });
    document["meshes"][0]["weights"] = shown(cycle.rest).collect::<Vec<_>>().into();
    let names: Vec<String> = (1..=count).map(|gate| format!("gate {gate}")).collect();
    document["meshes"][0]["extras"]["targetNames"] = names.into();

    let time = |key: usize| (cycle.seconds * key as f64 / count as f64) as f32;
    let times: Vec<f32> = (0..=count).map(time).collect();
    let weights: Vec<f32> = (0..=count).flat_map(|key| shown(key % count)).collect();
    let mut scalars = |numbers: &[f32]| {
        let view = view(&mut document, &mut buffer, numbers, false);
        json!({
            "bufferView": view, "componentType": FLOAT_COMPONENT, "type": "SCALAR",
            "count": numbers.len(),
        })
    };
    let (mut input, output) = (scalars(&times), scalars(&weights));
    input["min"] = json!([f64::from(times[0])]);
    input["max"] = json!([f64::from(times[count])]);
    let [input, output] = [input, output].map(|a| push(&mut document["accessors"], a));
    document["animations"] = json!([{
        "name": "beat",
        "samplers": [{ "input": input, "output": output, "interpolation": "LINEAR" }],
        "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
    }]);
    document["buffers"][0]["byteLength"] = buffer.len().into();
    glb::container(&document, &buffer)
}

fn displacements(to: &[[f32; 3]], from: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let between = |(to, from): (&[f32; 3], &[f32; 3])| std::array::from_fn(|c| to[c] - from[c]);
    to.iter().zip(from).map(between).collect()
}

/// Appends numbers to the buffer; returns the place of their buffer view.
fn view(document: &mut Value, buffer: &mut Vec<u8>, numbers: &[f32], of_vertices: bool) -> usize {
    let mut view = json!({
        "buffer": 0, "byteOffset": buffer.len(), "byteLength": 4 * numbers.len(),
    });
    if of_vertices {
        view["target"] = ARRAY_BUFFER.into();
    }
    buffer.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
    push(&mut document["bufferViews"], view)
}
