//! Our own JSON: `vertices`, `triangles`, and `frame` and `unit` of both.

use super::MeshFormat;
use super::error::MeshFileError;
use super::parsed::{Faces, Parsed};
use super::said::Said;
use crate::base::geometry::Vec3;
use crate::base::progress::Monitor;
use serde::Deserialize;
use std::io::{self, BufReader, Read};

/// A JSON mesh's statements about the surface.
#[derive(Debug, Deserialize)]
pub struct JsonMesh {
    /// Name of the frame.
    #[serde(default)]
    pub frame: Option<String>,
    /// Symbol of the unit.
    #[serde(default)]
    pub unit: Option<String>,
    /// Positions.
    pub vertices: Vec<[f64; 3]>,
    /// Corners of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// Bytes of a text that is parsed in portions; shorter ones take little time and are parsed twice as fast at once.
const LARGE_BYTES: usize = 4 << 20;
/// Bytes between two checks of the cancel token.
const BYTES_PER_CHECK: usize = 1 << 16;

/// A text, which ends with an error once the caller cancelled.
struct Watched<'a> {
    rest: &'a [u8],
    monitor: &'a Monitor<'a>,
}

impl Read for Watched<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.monitor.check().map_err(io::Error::other)?;
        self.rest.read(buffer)
    }
}

pub(super) fn parse(bytes: &[u8], monitor: &Monitor<'_>) -> Result<Parsed, MeshFileError> {
    let read: Result<JsonMesh, _> = if bytes.len() < LARGE_BYTES {
        serde_json::from_slice(bytes)
    } else {
        let rest = bytes;
        let text = BufReader::with_capacity(BYTES_PER_CHECK, Watched { rest, monitor });
        serde_json::from_reader(text)
    };
    monitor.check()?;
    let read = read.map_err(|error| MeshFileError::Damaged {
        format: MeshFormat::Json,
        place: format!("line {}, column {}", error.line(), error.column()),
        reason: error.to_string(),
    })?;
    let mut said = Said::default();
    if let Some(frame) = &read.frame {
        said.frame("frame", frame.as_bytes())?;
    }
    if let Some(unit) = &read.unit {
        said.unit("unit", unit.as_bytes())?;
    }
    let mut faces = Faces::new(monitor);
    for triangle in &read.triangles {
        faces.polygon(triangle.map(f64::from), read.vertices.len())?;
    }
    let vertices = read.vertices.into_iter().map(Vec3::from).collect();
    Ok(faces.over(vertices).said(said))
}
