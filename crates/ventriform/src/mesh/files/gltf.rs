//! glTF 2.0: GLB, and JSON with its buffers embedded.
//!
//! The triangles (also strips and fans) of every mesh that the scene shows, at the place where its nodes put it.
//! Positions in files of our own are taken as they are stored, LPS millimetres; of others they are those of the world,
//! which has Y up and metres. Not read: buffers in other files, sparse accessors, required extensions.

use super::MeshFormat;
use super::error::MeshFileError;
use super::number::NumberType;
use super::parsed::{Faces, Parsed};
use super::said::Said;
use crate::base::geometry::Vec3;
use crate::base::progress::Monitor;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use nalgebra::{Matrix4, Quaternion, UnitQuaternion};
use serde::de::{Deserializer, Error as _, IgnoredAny, SeqAccess, Visitor};
use serde::{Deserialize, de};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

const OWN_FORMAT: MeshFormat = MeshFormat::Gltf;
/// Most nodes, meshes, accessors ... of a file.
const MAX_ITEMS: usize = 1024;
/// Longest JSON document, bytes, without the buffers in it.
const MAX_JSON_BYTES: usize = 4 << 20;

/// The matrix of the node of our own files, by columns: LPS millimetres to metres, Y up (`export::gltf`).
const PATIENT_TO_WORLD: [f64; 16] = [
    0.001, 0.0, 0.0, 0.0, //
    0.0, 0.0, -0.001, 0.0, //
    0.0, 0.001, 0.0, 0.0, //
    0.0, 0.0, 0.0, 1.0,
];

/// A list of at most [`MAX_ITEMS`] entries.
#[derive(Debug)]
struct Few<T>(Vec<T>);

impl<T> Default for Few<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Few<T> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Take<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Take<T> {
            type Value = Few<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a list of at most {MAX_ITEMS} entries")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut from: A) -> Result<Few<T>, A::Error> {
                let mut list = Vec::new();
                while let Some(entry) = from.next_element()? {
                    if list.len() == MAX_ITEMS {
                        return Err(A::Error::invalid_length(
                            MAX_ITEMS + 1,
                            &self as &dyn de::Expected,
                        ));
                    }
                    list.push(entry);
                }
                Ok(Few(list))
            }
        }
        from.deserialize_seq(Take(PhantomData))
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Document<'a> {
    asset: Asset,
    scene: Option<usize>,
    scenes: Few<Scene>,
    nodes: Few<Node>,
    meshes: Few<Mesh>,
    accessors: Few<Accessor>,
    buffer_views: Few<View>,
    #[serde(borrow)]
    buffers: Few<Buffer<'a>>,
    extensions_required: Few<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Asset {
    /// Those of our own files name frame and unit; others hold anything.
    extras: Option<Extras>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Extras {
    frame: Option<String>,
    unit: Option<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Scene {
    nodes: Few<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Node {
    children: Few<usize>,
    mesh: Option<usize>,
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Mesh {
    primitives: Few<Primitive>,
}

#[derive(Debug, Deserialize)]
struct Primitive {
    attributes: Attributes,
    indices: Option<usize>,
    #[serde(default = "triangles")]
    mode: u32,
}

fn triangles() -> u32 {
    4
}

#[derive(Debug, Deserialize)]
struct Attributes {
    #[serde(rename = "POSITION")]
    position: Option<usize>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
    count: usize,
    #[serde(rename = "type")]
    kind: String,
    #[serde(default)]
    normalized: bool,
    sparse: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct View {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
}

#[derive(Debug, Deserialize)]
struct Buffer<'a> {
    #[serde(borrow)]
    uri: Option<Cow<'a, str>>,
}

pub(super) fn parse(
    bytes: &[u8],
    limit: u64,
    monitor: &Monitor<'_>,
) -> Result<Parsed, MeshFileError> {
    let (json, binary) = if bytes.starts_with(b"glTF") {
        chunks(bytes)?
    } else {
        (bytes, None)
    };
    let document: Document<'_> = serde_json::from_slice(json).map_err(|error| {
        broken(
            format!(
                "line {}, column {} of the document",
                error.line(),
                error.column()
            ),
            error.to_string(),
        )
    })?;
    if let Some(extension) = document.extensions_required.0.first() {
        return Err(unsupported(format!("the required extension {extension:?}")));
    }
    let mut embedded = 0;
    let mut buffers: Vec<Cow<'_, [u8]>> = Vec::new();
    for (number, buffer) in document.buffers.0.iter().enumerate() {
        buffers.push(match (&buffer.uri, binary) {
            (Some(uri), _) => {
                embedded += uri.len();
                let data = uri
                    .strip_prefix("data:")
                    .and_then(|uri| uri.split_once(";base64,"));
                let (_, data) =
                    data.ok_or_else(|| unsupported("a buffer in another file".into()))?;
                monitor.check()?;
                let decoded = STANDARD.decode(data.as_bytes());
                Cow::Owned(decoded.map_err(|error| {
                    broken(format!("buffer {number}"), format!("its base64: {error}"))
                })?)
            }
            (None, Some(binary)) if number == 0 => Cow::Borrowed(binary),
            _ => return Err(broken(format!("buffer {number}"), "it has no bytes".into())),
        });
    }
    if json.len().saturating_sub(embedded) > MAX_JSON_BYTES {
        return Err(MeshFileError::TooLong {
            bytes: json.len() as u64,
            limit: MAX_JSON_BYTES as u64,
        });
    }
    let mut said = Said::default();
    let ours = document.asset.extras.as_ref();
    let stated = ours.and_then(|extras| Some((extras.frame.as_ref()?, extras.unit.as_ref()?)));
    let mut reader = Reader {
        document: &document,
        buffers,
        patient: false,
        budget: limit,
        seen: vec![false; document.nodes.0.len()],
        vertices: Vec::new(),
        faces: Faces::new(monitor),
        monitor: monitor.without_observer(),
    };
    if let Some((frame, unit)) = stated {
        // The positions of our own files are those of the patient; their node leads to the world of glTF.
        let shown = document.nodes.0.iter().filter(|node| node.mesh.is_some());
        reader.patient = shown
            .map(|node| node.matrix)
            .all(|m| m == Some(PATIENT_TO_WORLD));
        if reader.patient {
            said.frame("frame", frame.as_bytes())?;
            said.unit("unit", unit.as_bytes())?;
        }
    }
    let scene = document.scenes.0.get(document.scene.unwrap_or(0));
    match scene {
        Some(scene) => {
            for root in &scene.nodes.0 {
                reader.node(*root, &Matrix4::identity(), 0)?;
            }
        }
        // A document without scenes shows no mesh in particular.
        None => {
            for mesh in 0..document.meshes.0.len() {
                reader.mesh(mesh, &Matrix4::identity())?;
            }
        }
    }
    Ok(reader.faces.over(reader.vertices).said(said))
}

/// The JSON document of a GLB file, and its buffer.
fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), MeshFileError> {
    let number = |at: usize| {
        let four = bytes.get(at..at + 4);
        four.map(|b| NumberType::U32.read(b, false) as usize)
    };
    let cut = |at: usize| broken(format!("byte {at}"), "the file is cut off".into());
    match number(4) {
        Some(2) => {}
        Some(version) => return Err(unsupported(format!("version {version}, not 2"))),
        None => return Err(cut(4)),
    }
    let mut at = 12;
    let (mut json, mut binary) = (None, None);
    while at < bytes.len() {
        let length = number(at).ok_or_else(|| cut(at))?;
        let kind = bytes.get(at + 4..at + 8).ok_or_else(|| cut(at))?;
        let chunk = (at + 8)
            .checked_add(length)
            .and_then(|end| bytes.get(at + 8..end));
        let chunk = chunk.ok_or_else(|| cut(at))?;
        match kind {
            b"JSON" if json.is_none() => json = Some(chunk),
            b"BIN\0" if binary.is_none() => binary = Some(chunk),
            _ => {}
        }
        at += 8 + length;
    }
    let json = json.ok_or_else(|| broken("byte 12".into(), "there is no JSON chunk".into()))?;
    Ok((json, binary))
}

struct Reader<'a> {
    document: &'a Document<'a>,
    buffers: Vec<Cow<'a, [u8]>>,
    monitor: Monitor<'static>,
    /// Whether positions are taken as they are stored.
    patient: bool,
    /// Bytes of vertices and triangles that may still be made.
    budget: u64,
    /// Which nodes were met.
    seen: Vec<bool>,
    vertices: Vec<Vec3>,
    faces: Faces,
}

impl Reader<'_> {
    fn node(
        &mut self,
        number: usize,
        above: &Matrix4<f64>,
        depth: usize,
    ) -> Result<(), MeshFileError> {
        let node = self.document.nodes.0.get(number);
        let node = node.ok_or_else(|| missing("node", number))?;
        if std::mem::replace(&mut self.seen[number], true) || depth > 32 {
            return Err(broken(
                format!("node {number}"),
                "nodes form no tree of at most 32 levels".into(),
            ));
        }
        let own = match node.matrix {
            Some(matrix) => Matrix4::from_column_slice(&matrix),
            None => {
                let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
                let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
                let shift = Vec3::from(node.translation.unwrap_or([0.0; 3]));
                let scale = Vec3::from(node.scale.unwrap_or([1.0; 3]));
                Matrix4::new_translation(&shift)
                    * turn.to_homogeneous()
                    * Matrix4::new_nonuniform_scaling(&scale)
            }
        };
        let world = above * own;
        if let Some(mesh) = node.mesh {
            self.mesh(mesh, &world)?;
        }
        for child in &node.children.0 {
            self.node(*child, &world, depth + 1)?;
        }
        Ok(())
    }

    fn mesh(&mut self, number: usize, world: &Matrix4<f64>) -> Result<(), MeshFileError> {
        let mesh = self.document.meshes.0.get(number);
        let mesh = mesh.ok_or_else(|| missing("mesh", number))?;
        // Primitives of one mesh share positions.
        let mut starts: BTreeMap<usize, [usize; 2]> = BTreeMap::new();
        let mirrored = !self.patient && world.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        for primitive in &mesh.primitives.0 {
            if primitive.mode < 4 {
                continue;
            }
            let position = primitive.attributes.position;
            let position =
                position.ok_or_else(|| missing("accessor of the attribute POSITION", 0))?;
            let [start, count] = match starts.get(&position) {
                Some(known) => *known,
                None => {
                    let (numbers, count) = self.numbers(position, 3)?;
                    let start = self.vertices.len();
                    for p in numbers.chunks_exact(3) {
                        self.monitor.check()?;
                        let p = Vec3::new(p[0], p[1], p[2]);
                        self.vertices.push(if self.patient {
                            p
                        } else {
                            world.transform_point(&p.into()).coords
                        });
                    }
                    starts.insert(position, [start, count]);
                    [start, count]
                }
            };
            let corners: Vec<f64> = match primitive.indices {
                Some(indices) => self.numbers(indices, 1)?.0,
                None => (0..count).map(|v| v as f64).collect(),
            };
            let own = |corner: &f64| {
                if *corner >= 0.0 && *corner < count as f64 {
                    corner + start as f64
                } else {
                    f64::from(u32::MAX)
                }
            };
            let (before, all) = (self.faces.triangles.len(), self.vertices.len());
            match primitive.mode {
                4 => {
                    for triangle in corners.chunks_exact(3) {
                        self.faces.polygon(triangle.iter().map(own), all)?;
                    }
                }
                5 => self.faces.strip(corners.iter().map(own), all)?,
                6 => self.faces.polygon(corners.iter().map(own), all)?,
                mode => return Err(broken(format!("mesh {number}"), format!("mode {mode}"))),
            }
            if mirrored {
                let added = &mut self.faces.triangles[before..];
                added.iter_mut().for_each(|t| t.swap(1, 2));
            }
        }
        Ok(())
    }

    /// The numbers of an accessor of `width` components, and its count.
    fn numbers(&mut self, number: usize, width: usize) -> Result<(Vec<f64>, usize), MeshFileError> {
        let place = || format!("accessor {number}");
        let accessor = self.document.accessors.0.get(number);
        let accessor = accessor.ok_or_else(|| missing("accessor", number))?;
        if accessor.sparse.is_some() || accessor.normalized {
            return Err(unsupported("sparse or normalized accessors".into()));
        }
        let wanted = if width == 3 { "VEC3" } else { "SCALAR" };
        let kind = match accessor.component_type {
            5121 => NumberType::U8,
            5123 => NumberType::U16,
            5125 => NumberType::U32,
            5126 => NumberType::F32,
            other => return Err(broken(place(), format!("componentType {other}"))),
        };
        if accessor.kind != wanted {
            return Err(broken(
                place(),
                format!("its type is {:?}, not {wanted}", accessor.kind),
            ));
        }
        // Single bytes number 256 vertices.
        if kind == NumberType::U8 && accessor.count > 1 << 16 {
            return Err(unsupported("more than 65536 indices of one byte".into()));
        }
        let view = accessor
            .buffer_view
            .and_then(|v| self.document.buffer_views.0.get(v));
        let view = view.ok_or_else(|| missing("bufferView", accessor.buffer_view.unwrap_or(0)))?;
        let buffer = self.buffers.get(view.buffer);
        let buffer = buffer.ok_or_else(|| missing("buffer", view.buffer))?;
        let end = view.byte_offset.checked_add(view.byte_length);
        let bytes = end.and_then(|end| buffer.get(view.byte_offset..end));
        let each = width * kind.bytes();
        let stride = view.byte_stride.unwrap_or(each).max(each);
        let needed = accessor.count.checked_sub(1).and_then(|steps| {
            let steps = steps.checked_mul(stride)?;
            steps.checked_add(accessor.byte_offset)?.checked_add(each)
        });
        let there = bytes.filter(|b| needed.is_some_and(|needed| needed <= b.len()));
        let there = there.ok_or_else(|| {
            broken(
                place(),
                format!(
                    "it states {} elements, and the buffer is shorter",
                    accessor.count
                ),
            )
        })?;
        // Nodes may show one mesh again and again.
        let made = accessor.count as u64 * each as u64;
        self.budget = match self.budget.checked_sub(made) {
            Some(left) => left,
            None => {
                return Err(MeshFileError::TooLong {
                    bytes: made,
                    limit: self.budget,
                });
            }
        };
        let mut numbers = Vec::with_capacity(accessor.count * width);
        for element in 0..accessor.count {
            self.monitor.check()?;
            let at = accessor.byte_offset + element * stride;
            let components = there[at..at + each].chunks_exact(kind.bytes());
            numbers.extend(components.map(|c| kind.read(c, false)));
        }
        Ok((numbers, accessor.count))
    }
}

fn broken(place: String, reason: String) -> MeshFileError {
    MeshFileError::Damaged {
        format: OWN_FORMAT,
        place,
        reason,
    }
}

fn missing(what: &str, number: usize) -> MeshFileError {
    broken(format!("{what} {number}"), "it does not exist".into())
}

fn unsupported(what: String) -> MeshFileError {
    MeshFileError::Unsupported {
        format: OWN_FORMAT,
        what,
    }
}
