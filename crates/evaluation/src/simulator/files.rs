//! Files of a case: NIfTI-1 images of three and four dimensions, surfaces as PLY, parameters as JSON.
//!
//! The same numbers give the same bytes: compressed files name neither time nor file.

use super::anatomy::Vec3;
use super::grid::Grid;
use flate2::{Compression, GzBuilder};
use serde::Serialize;
use serde_json::Value;
use std::fs;
use std::io::{self, Write};
use std::path::Path;

/// Bytes before the first voxel.
const VOXELS_AT: usize = 352;
/// The text in the header.
const DESCRIPTION: &[u8] = b"simulated";

/// How the voxels of an image lie in the patient: the columns of its directions, RAS mm for a step, and its first
/// voxel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageFrame {
    /// What a step along each axis adds.
    pub steps: [Vec3; 3],
    /// Middle of the first voxel.
    pub origin: Vec3,
}

impl ImageFrame {
    /// Voxels along the patient's axes.
    pub fn along_axes(origin: Vec3, step_mm: f64) -> Self {
        let steps = [Vec3::x(), Vec3::y(), Vec3::z()].map(|axis| axis * step_mm);
        Self { steps, origin }
    }

    /// The rows of the affine from indices to RAS mm.
    pub fn rows(&self) -> [[f64; 4]; 3] {
        [0, 1, 2].map(|row| {
            let [a, b, c] = self.steps.map(|step| step[row]);
            [a, b, c, self.origin[row]]
        })
    }
}

/// How values are stored.
#[derive(Debug, Clone, Copy)]
pub enum Stored {
    /// As 16-bit numbers of this slope.
    Scaled {
        /// Value of 1.
        slope: f64,
    },
    /// As bytes of this slope.
    Bytes {
        /// Value of 1.
        slope: f64,
    },
}

/// Writes images, one for each gate, as `.nii.gz`.
///
/// # Errors
/// If the file cannot be written.
pub fn write_nifti(
    path: &Path,
    gates: &[Grid],
    frame: &ImageFrame,
    stored: Stored,
) -> io::Result<()> {
    let mut bytes = header(gates[0].shape, gates.len(), frame, stored).to_vec();
    for gate in gates {
        append(&mut bytes, gate, stored);
    }
    let mut packed = GzBuilder::new().write(Vec::new(), Compression::new(6));
    packed.write_all(&bytes)?;
    fs::write(path, packed.finish()?)
}

fn header(shape: [usize; 3], gates: usize, frame: &ImageFrame, stored: Stored) -> [u8; VOXELS_AT] {
    let mut header = [0_u8; VOXELS_AT];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    let short = |n: usize| (n as i16).to_le_bytes();
    let float = |x: f64| (x as f32).to_le_bytes();
    put(0, &348_i32.to_le_bytes());
    put(38, b"r");
    let dimensions = if gates > 1 { 4 } else { 3 };
    let sizes = [dimensions, shape[0], shape[1], shape[2], gates, 1, 1, 1];
    sizes
        .iter()
        .enumerate()
        .for_each(|(i, n)| put(40 + 2 * i, &short(*n)));
    let (code, bits, slope) = match stored {
        Stored::Scaled { slope } => (4, 16, slope),
        Stored::Bytes { slope } => (2, 8, slope),
    };
    put(70, &short(code));
    put(72, &short(bits));
    let spacing = frame.steps.map(|step| step.norm());
    let pixdim = [1.0, spacing[0], spacing[1], spacing[2], 1.0, 0.0, 0.0, 0.0];
    pixdim
        .iter()
        .enumerate()
        .for_each(|(i, x)| put(76 + 4 * i, &float(*x)));
    put(108, &float(VOXELS_AT as f64));
    put(112, &float(slope));
    // Millimetres.
    put(123, &[2]);
    put(148, DESCRIPTION);
    // The sform alone states the frame.
    put(254, &short(1));
    for (row, numbers) in frame.rows().iter().enumerate() {
        for (column, x) in numbers.iter().enumerate() {
            put(280 + 16 * row + 4 * column, &float(*x));
        }
    }
    put(344, b"n+1\0");
    header
}

/// Appends the values, x fastest.
fn append(bytes: &mut Vec<u8>, grid: &Grid, stored: Stored) {
    let [nx, ny, nz] = grid.shape;
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let value = f64::from(grid.at([x, y, z]));
                match stored {
                    Stored::Scaled { slope } => {
                        bytes.extend(((value / slope).round() as i16).to_le_bytes());
                    }
                    Stored::Bytes { slope } => bytes.push((value / slope).round() as u8),
                }
            }
        }
    }
}

/// Writes a closed surface, RAS mm, as binary PLY.
///
/// # Errors
/// If the file cannot be written.
pub fn write_ply(path: &Path, vertices: &[Vec3], triangles: &[[u32; 3]]) -> io::Result<()> {
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\ncomment RAS mm\nelement vertex {}\nproperty float x\nproperty float \
         y\nproperty float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        triangles.len()
    )
    .into_bytes();
    for v in vertices {
        bytes.extend(
            [v.x, v.y, v.z]
                .iter()
                .flat_map(|x| (*x as f32).to_le_bytes()),
        );
    }
    for triangle in triangles {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|i| i.to_le_bytes()));
    }
    fs::write(path, bytes)
}

/// Writes JSON. Numbers have at most five digits after the point.
///
/// # Errors
/// If the file cannot be written.
pub fn write_json(path: &Path, document: &impl Serialize) -> io::Result<()> {
    let mut value = serde_json::to_value(document)?;
    round(&mut value);
    let mut bytes = serde_json::to_vec_pretty(&value)?;
    bytes.push(b'\n');
    fs::write(path, bytes)
}

/// Adds the fields of one object to another.
pub fn merge(into: &mut Value, more: Value) {
    if let (Value::Object(into), Value::Object(more)) = (into, more) {
        into.extend(more);
    }
}

fn round(value: &mut Value) {
    match value {
        Value::Number(number) if number.is_f64() => {
            let rounded = number.as_f64().map(|x| (x * 1e5).round() / 1e5);
            *value = rounded.into();
        }
        Value::Array(values) => values.iter_mut().for_each(round),
        Value::Object(fields) => fields.values_mut().for_each(round),
        _ => {}
    }
}
