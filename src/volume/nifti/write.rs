//! Volumes into NIfTI-1 files.
//!
//! The affine goes out exactly as far as `f32` reaches: as sform always, and as qform too where
//! it is a rotation with spacing (the only thing that a quaternion can say). The bytes depend on
//! the volume alone: the gzip header carries neither name nor time.

use super::super::Volume;
use crate::geometry::frame::VoxelToPatient;
use crate::progress::{Cancelled, Monitor};
use flate2::Compression;
use flate2::write::GzEncoder;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use std::io::Write;

/// Bytes before the first voxel: the header and the four that say "no extension".
const VOX_OFFSET: usize = 352;

/// `scanner anatomical` coordinates.
const XFORM_CODE: i16 = 1;

/// How far columns of a rotation may be from perpendicular and of unit length.
const RIGID: f64 = 1e-5;

/// How voxels are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoredType {
    /// As they are.
    Float32,
    /// Scaled onto -32000..=32000 by slope and intercept, a quarter of the size when packed;
    /// whole values of that range go unscaled and exact. NaN becomes the smallest value.
    Int16,
    /// Rounded and clamped to 0..=255, for masks and label maps. NaN becomes 0.
    Uint8,
}

impl StoredType {
    fn code_and_bits(self) -> (i16, i16) {
        match self {
            StoredType::Float32 => (16, 32),
            StoredType::Int16 => (4, 16),
            StoredType::Uint8 => (2, 8),
        }
    }
}

/// A volume cannot be said in NIfTI-1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{size} voxels along an axis; NIfTI-1 counts to 32767")]
pub struct TooLong {
    /// Voxels along the offending axis.
    pub size: usize,
}

/// A mask cannot be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum MaskError {
    /// NIfTI-1 cannot say its size.
    #[error(transparent)]
    TooLong(#[from] TooLong),
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// The bytes of a `.nii.gz` with `mask` as 0 and 1 on the grid of `shape` and `frame`. Packed
/// slice by slice: takes no memory but that of the result, and looks at the token in between.
///
/// # Errors
/// [`MaskError`].
pub fn write_mask(
    mask: &[bool],
    shape: [usize; 3],
    frame: &VoxelToPatient,
    monitor: &Monitor<'_>,
) -> Result<Vec<u8>, MaskError> {
    let header = header(shape, frame, StoredType::Uint8, Scaling::NONE)?;
    let mut encoder = GzEncoder::new(Vec::new(), Compression::new(6));
    put(&mut encoder, &header);
    for slice in mask.chunks((shape[0] * shape[1]).max(1)) {
        monitor.check()?;
        let bytes: Vec<u8> = slice.iter().map(|inside| u8::from(*inside)).collect();
        put(&mut encoder, &bytes);
    }
    Ok(finish(encoder))
}

/// The bytes of a `.nii` (of a `.nii.gz` where `gzip` is set) with `volume`.
///
/// # Errors
/// [`TooLong`] where an axis has more than 32 767 voxels.
pub fn write(volume: &Volume, stored: StoredType, gzip: bool) -> Result<Vec<u8>, TooLong> {
    let scaling = match stored {
        StoredType::Int16 => scaling(&volume.voxels),
        StoredType::Float32 | StoredType::Uint8 => Scaling::NONE,
    };
    let mut bytes = header(volume.shape, &volume.frame, stored, scaling)?;
    append_voxels(&mut bytes, &volume.voxels, stored, scaling);
    Ok(if gzip { pack(&bytes) } else { bytes })
}

/// Slope and intercept: value = slope * stored + inter.
#[derive(Debug, Clone, Copy)]
struct Scaling {
    slope: f32,
    inter: f32,
}

impl Scaling {
    const NONE: Self = Self {
        slope: 1.0,
        inter: 0.0,
    };
}

/// The scaling that takes the range of `voxels` onto that of the stored numbers.
fn scaling(voxels: &[f32]) -> Scaling {
    const REACH: f64 = 32_000.0;
    let numbers = || voxels.iter().copied().filter(|v| v.is_finite());
    let (low, high) = numbers().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
        (l.min(f64::from(v)), h.max(f64::from(v)))
    });
    let whole = numbers().all(|v| v.trunc() == v);
    if !(low < high) || (whole && low >= -REACH && high <= REACH) {
        return match low.is_finite() && !whole {
            true => Scaling {
                slope: 1.0,
                inter: low as f32,
            },
            false => Scaling::NONE,
        };
    }
    Scaling {
        slope: ((high - low) / (2.0 * REACH)) as f32,
        inter: ((high + low) / 2.0) as f32,
    }
}

fn append_voxels(bytes: &mut Vec<u8>, voxels: &[f32], stored: StoredType, scaling: Scaling) {
    let (slope, inter) = (f64::from(scaling.slope), f64::from(scaling.inter));
    match stored {
        StoredType::Float32 => bytes.extend(voxels.iter().flat_map(|v| v.to_le_bytes())),
        // `as` rounds nothing and takes NaN to 0, hence the detour.
        StoredType::Int16 => bytes.extend(voxels.iter().flat_map(|&v| {
            let n = ((f64::from(v) - inter) / slope).round();
            (if n.is_nan() { -32_000 } else { n as i16 }).to_le_bytes()
        })),
        StoredType::Uint8 => bytes.extend(voxels.iter().map(|v| v.round() as u8)),
    }
}

fn header(
    shape: [usize; 3],
    frame: &VoxelToPatient,
    stored: StoredType,
    scaling: Scaling,
) -> Result<Vec<u8>, TooLong> {
    let mut bytes = vec![0; VOX_OFFSET];
    let mut put = |at: usize, field: &[u8]| bytes[at..at + field.len()].copy_from_slice(field);
    let (datatype, bitpix) = stored.code_and_bits();
    put(0, &348_i32.to_le_bytes());
    put(40, &3_i16.to_le_bytes());
    for axis in 0..7 {
        let size = shape.get(axis).copied().unwrap_or(1);
        let extent = i16::try_from(size).map_err(|_| TooLong { size })?;
        put(42 + 2 * axis, &extent.to_le_bytes());
    }
    put(70, &datatype.to_le_bytes());
    put(72, &bitpix.to_le_bytes());
    let reals =
        |values: &[f32]| -> Vec<u8> { values.iter().flat_map(|v| v.to_le_bytes()).collect() };
    let spacing = frame.spacing().map(|s| s as f32);
    let pose = quaternion(frame);
    let qfac = if frame.is_left_handed() { -1.0 } else { 1.0 };
    put(
        76,
        &reals(&[qfac, spacing[0], spacing[1], spacing[2], 1.0, 1.0, 1.0, 1.0]),
    );
    put(
        108,
        &reals(&[VOX_OFFSET as f32, scaling.slope, scaling.inter]),
    );
    put(123, &[2]);
    put(148, b"ventriform");
    let ras = frame.to_ras();
    if let Some(bcd) = pose {
        put(252, &XFORM_CODE.to_le_bytes());
        put(256, &reals(&bcd));
        put(268, &reals(&[0, 1, 2].map(|r| ras[(r, 3)] as f32)));
    }
    put(254, &XFORM_CODE.to_le_bytes());
    for row in 0..3 {
        let srow = [0, 1, 2, 3].map(|c| ras[(row, c)] as f32);
        put(280 + 16 * row, &reals(&srow));
    }
    put(344, b"n+1\0");
    Ok(bytes)
}

/// `quatern_b`, `_c`, `_d` where the frame is a rotation (k perhaps turned) with spacing.
fn quaternion(frame: &VoxelToPatient) -> Option<[f32; 3]> {
    let ras = frame.to_ras();
    let mut rotation: Matrix3<f64> = ras.fixed_view::<3, 3>(0, 0).into_owned();
    for mut column in rotation.column_iter_mut() {
        column.normalize_mut();
    }
    if frame.is_left_handed() {
        rotation.column_mut(2).neg_mut();
    }
    let off = (rotation.transpose() * rotation - Matrix3::identity())
        .abs()
        .max();
    if off > RIGID {
        return None;
    }
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    // The standard keeps a >= 0 and stores only the rest; q and -q are the same turn.
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    Some([q.i, q.j, q.k].map(|c| (sign * c) as f32))
}

fn pack(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::new(6));
    put(&mut encoder, bytes);
    finish(encoder)
}

fn put(encoder: &mut GzEncoder<Vec<u8>>, bytes: &[u8]) {
    encoder
        .write_all(bytes)
        .expect("writing to memory does not fail");
}

fn finish(encoder: GzEncoder<Vec<u8>>) -> Vec<u8> {
    encoder.finish().expect("writing to memory does not fail")
}
