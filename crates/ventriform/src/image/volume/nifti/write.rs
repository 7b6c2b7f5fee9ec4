//! Writes volumes, masks and maps of labels as NIfTI-1 files.
//!
//! Masks and labels of a NIfTI scan state its grid as it does ([`StatedGrid`]): qform, sform, their codes,
//! `pixdim` and units are copied, and so are trailing dimensions of length 1. Everything else states its affine
//! as the sform, rounded to `f32`, and also as the qform if it is a rotation
//! with spacing, which is all that a quaternion can express. The bytes depend on the volume alone:
//! the gzip header contains neither name nor time.
//!
//! Names and colours of labels are a header extension of code 0 with the XML table of labels of Caret, as
//! TotalSegmentator writes and reads it. Programs that do not know it skip it.
//!
//! The header is a [`NiftiHeader`] of the `nifti` crate. It is serialised here because the crate's
//! writer writes to paths only, and always with slope 1 and intercept 0.

use super::super::Volume;
use super::grid::StatedGrid;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::{Cancelled, Monitor};
use ::nifti::header::MAGIC_CODE_NIP1;
use ::nifti::typedef::{Unit, XForm};
use ::nifti::{Endianness, NiftiHeader, NiftiType};
use flate2::Compression;
use flate2::write::GzEncoder;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use std::io::Write;

/// `descrip` of the files that are written.
pub(super) const FILE_DESCRIPTION: &[u8] = b"ventriform";

/// Bytes before the first voxel: the header and four bytes that announce no extensions.
const VOX_OFFSET: usize = 352;

/// Largest deviation of the columns of a rotation from unit length and from a right angle.
const RIGID_TOLERANCE: f64 = 1e-5;

/// Data type of the stored voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoredType {
    /// The values unchanged.
    Float32,
    /// Scaled to -32000..=32000 by slope and intercept, a quarter of the size after compression.
    /// Whole values in that range are stored exactly. NaN becomes the smallest value.
    Int16,
    /// Scaled to 0..=255 by slope and intercept, for pictures to look at. NaN becomes the smallest value.
    Scaled8,
    /// Rounded and clamped to 0..=255, for masks and label maps. NaN becomes 0.
    Uint8,
}

impl StoredType {
    fn nifti_type(self) -> NiftiType {
        match self {
            StoredType::Float32 => NiftiType::Float32,
            StoredType::Int16 => NiftiType::Int16,
            StoredType::Scaled8 | StoredType::Uint8 => NiftiType::Uint8,
        }
    }
}

/// An axis is too long for NIfTI-1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("an axis has {size} voxels; NIfTI-1 allows at most 32767")]
pub struct TooLong {
    /// Voxels along that axis.
    pub size: usize,
}

/// A mask cannot be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum MaskError {
    /// An axis is too long for NIfTI-1.
    #[error(transparent)]
    TooLong(#[from] TooLong),
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// The bytes of a `.nii.gz` file with `mask` as 0 and 1 on the grid of `shape` and `frame`.
/// Compresses slice by slice: needs little memory beyond the result, and checks for cancellation
/// between slices. `grid` is how the scan's file states that grid, if it is NIfTI.
///
/// # Errors
/// [`MaskError`].
pub fn write_mask(
    mask: &[bool],
    shape: [usize; 3],
    frame: &VoxelToPatient,
    grid: Option<&StatedGrid>,
    monitor: &Monitor<'_>,
) -> Result<Vec<u8>, MaskError> {
    let header = mask_header(shape, frame, grid)?;
    let mut encoder = GzEncoder::new(Vec::new(), Compression::new(6));
    put(&mut encoder, &to_bytes(&header));
    for slice in mask.chunks((shape[0] * shape[1]).max(1)) {
        monitor.check()?;
        let bytes: Vec<u8> = slice.iter().map(|inside| u8::from(*inside)).collect();
        put(&mut encoder, &bytes);
    }
    Ok(finish(encoder))
}

/// A label of a map of labels, for people and screens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LabelEntry {
    /// The value of its voxels.
    pub value: u8,
    /// Its name.
    pub name: &'static str,
    /// Its colour: red, green, blue, sRGB.
    pub colour: [u8; 3],
}

/// The bytes of a `.nii.gz` file with `labels` on the grid of `shape` and `frame`, and with the names and
/// colours of `entries`. `grid` as for [`write_mask`].
///
/// # Errors
/// [`MaskError`].
pub fn write_labels(
    labels: &[u8],
    entries: &[LabelEntry],
    (shape, frame): ([usize; 3], &VoxelToPatient),
    grid: Option<&StatedGrid>,
    monitor: &Monitor<'_>,
) -> Result<Vec<u8>, MaskError> {
    /// NIFTI_INTENT_LABEL
    const INTENT_LABELS: i16 = 1002;
    let extension = extension(entries);
    let mut header = mask_header(shape, frame, grid)?;
    header.intent_code = INTENT_LABELS;
    header.vox_offset = (VOX_OFFSET + extension.len()) as f32;
    let mut bytes = to_bytes(&header);
    // The four bytes after the header: extensions follow.
    bytes[VOX_OFFSET - 4] = 1;
    let mut encoder = GzEncoder::new(Vec::new(), Compression::new(6));
    put(&mut encoder, &bytes);
    put(&mut encoder, &extension);
    for slice in labels.chunks((shape[0] * shape[1]).max(1)) {
        monitor.check()?;
        put(&mut encoder, slice);
    }
    Ok(finish(encoder))
}

/// The extension with the table of `entries`: its length, a multiple of 16, its code and the text.
fn extension(entries: &[LabelEntry]) -> Vec<u8> {
    /// NIFTI_ECODE_IGNORE: nibabel gives the content of no other code that fits as it is.
    const ECODE_IGNORE: i32 = 0;
    let mut text = String::from(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<CaretExtension>\n<VolumeInformation \
         Index=\"0\">\n<LabelTable>\n",
    );
    let background = "<Label Key=\"0\" Red=\"0\" Green=\"0\" Blue=\"0\" Alpha=\"0\"><![CDATA[background]]></Label>\n";
    text.push_str(background);
    for entry in entries {
        let [red, green, blue] = entry.colour.map(|part| f64::from(part) / 255.0);
        text.push_str(&format!(
            "<Label Key=\"{}\" Red=\"{red:.4}\" Green=\"{green:.4}\" Blue=\"{blue:.4}\" \
             Alpha=\"1\"><![CDATA[{}]]></Label>\n",
            entry.value, entry.name
        ));
    }
    text.push_str(
        "</LabelTable>\n<StudyMetaDataLinkSet>\n</StudyMetaDataLinkSet>\n\
         <VolumeType><![CDATA[Label]]></VolumeType>\n</VolumeInformation>\n</CaretExtension>\n",
    );
    let length = (8 + text.len()).next_multiple_of(16);
    let mut bytes = (length as i32).to_le_bytes().to_vec();
    bytes.extend(ECODE_IGNORE.to_le_bytes());
    bytes.extend(text.into_bytes());
    bytes.resize(length, 0);
    bytes
}

/// The header of a mask on the grid of `shape` and `frame`, which the scan's file states as `grid`.
fn mask_header(
    shape: [usize; 3],
    frame: &VoxelToPatient,
    grid: Option<&StatedGrid>,
) -> Result<NiftiHeader, TooLong> {
    let mut header = header(shape, frame, StoredType::Uint8, Scaling::NONE)?;
    let Some(grid) = grid else {
        return Ok(header);
    };
    let reals = |numbers: &[f64; 3]| numbers.map(|x| x as f32);
    header.dim[0] = grid.rank as u16;
    header.pixdim = grid.pixdim.map(|x| x as f32);
    // NIfTI-2 has wider numbers, but no other codes.
    header.xyzt_units = (grid.xyzt_units & 0xff) as u8;
    header.qform_code = i16::try_from(grid.qform_code).unwrap_or_default();
    header.sform_code = i16::try_from(grid.sform_code).unwrap_or_default();
    [header.quatern_b, header.quatern_c, header.quatern_d] = reals(&grid.quatern);
    [header.quatern_x, header.quatern_y, header.quatern_z] = reals(&grid.qoffset);
    [header.srow_x, header.srow_y, header.srow_z] = grid.srow.map(|row| row.map(|x| x as f32));
    Ok(header)
}

/// The bytes of a `.nii` file with `volume`, or of a `.nii.gz` file if `gzip` is set.
///
/// # Errors
/// [`TooLong`] if an axis has more than 32 767 voxels.
pub fn write(volume: &Volume, stored: StoredType, gzip: bool) -> Result<Vec<u8>, TooLong> {
    let scaling = match stored {
        StoredType::Int16 => scaling(&volume.voxels),
        StoredType::Scaled8 => scaling_to_bytes(&volume.voxels),
        StoredType::Float32 | StoredType::Uint8 => Scaling::NONE,
    };
    let mut bytes = to_bytes(&header(volume.shape, &volume.frame, stored, scaling)?);
    append_voxels(&mut bytes, &volume.voxels, stored, scaling);
    Ok(if gzip { pack(&bytes) } else { bytes })
}

/// The bytes of a `.nii` file with `volumes`, of which there is at least one, all on the first's grid, as 32-bit floats
/// along the fourth dimension, `step_ms` apart if that is known; of a `.nii.gz` file if `gzip` is set.
///
/// # Errors
/// [`TooLong`] if an axis has more than 32 767 voxels, or there are more volumes.
pub fn write_gates(
    volumes: &[Volume],
    step_ms: Option<f64>,
    gzip: bool,
) -> Result<Vec<u8>, TooLong> {
    let Some(first) = volumes.first() else {
        return Err(TooLong { size: 0 });
    };
    let mut header = header(
        first.shape,
        &first.frame,
        StoredType::Float32,
        Scaling::NONE,
    )?;
    let size = volumes.len();
    if size > 1 {
        let count = i16::try_from(size).map_err(|_| TooLong { size })?;
        header.dim[0] = 4;
        header.dim[4] = count.cast_unsigned();
        if let Some(step_ms) = step_ms {
            header.pixdim[4] = step_ms as f32;
            header.xyzt_units = Unit::Mm as u8 | Unit::Msec as u8;
        }
    }
    let mut bytes = to_bytes(&header);
    for volume in volumes {
        append_voxels(
            &mut bytes,
            &volume.voxels,
            StoredType::Float32,
            Scaling::NONE,
        );
    }
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

/// The least and the greatest of the finite values; infinite where there is none.
fn range(voxels: &[f32]) -> [f64; 2] {
    let numbers = voxels.iter().filter(|v| v.is_finite());
    numbers.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
        [low.min(f64::from(*v)), high.max(f64::from(*v))]
    })
}

/// The scaling that maps the range of `voxels` to 0..=255.
fn scaling_to_bytes(voxels: &[f32]) -> Scaling {
    match range(voxels) {
        [low, high] if low < high => Scaling {
            slope: ((high - low) / 255.0) as f32,
            inter: low as f32,
        },
        [low, _] if low.is_finite() => Scaling {
            slope: 1.0,
            inter: low as f32,
        },
        _ => Scaling::NONE,
    }
}

/// The scaling that maps the range of `voxels` to the range of the stored numbers.
fn scaling(voxels: &[f32]) -> Scaling {
    const MAX_STORED_VALUE: f64 = 32_000.0;
    let [low, high] = range(voxels);
    let mut numbers = voxels.iter().filter(|v| v.is_finite());
    let whole = numbers.all(|v| v.trunc() == *v);
    if !(low < high) || (whole && low >= -MAX_STORED_VALUE && high <= MAX_STORED_VALUE) {
        return if low.is_finite() && !whole {
            Scaling {
                slope: 1.0,
                inter: low as f32,
            }
        } else {
            Scaling::NONE
        };
    }
    Scaling {
        slope: ((high - low) / (2.0 * MAX_STORED_VALUE)) as f32,
        inter: ((high + low) / 2.0) as f32,
    }
}

fn append_voxels(bytes: &mut Vec<u8>, voxels: &[f32], stored: StoredType, scaling: Scaling) {
    let (slope, inter) = (f64::from(scaling.slope), f64::from(scaling.inter));
    match stored {
        StoredType::Float32 => bytes.extend(voxels.iter().flat_map(|v| v.to_le_bytes())),
        // `as` truncates and turns NaN into 0.
        StoredType::Int16 => bytes.extend(voxels.iter().flat_map(|&v| {
            let n = ((f64::from(v) - inter) / slope).round();
            (if n.is_nan() { -32_000 } else { n as i16 }).to_le_bytes()
        })),
        StoredType::Scaled8 | StoredType::Uint8 => {
            let stored = |v: &f32| ((f64::from(*v) - inter) / slope).round() as u8;
            bytes.extend(voxels.iter().map(stored));
        }
    }
}

/// The header of a single file with one volume.
fn header(
    shape: [usize; 3],
    frame: &VoxelToPatient,
    stored: StoredType,
    scaling: Scaling,
) -> Result<NiftiHeader, TooLong> {
    let mut dim = [3, 1, 1, 1, 1, 1, 1, 1];
    for (extent, size) in dim[1..].iter_mut().zip(shape) {
        // The crate counts to 65535, the standard to 32767.
        let signed = i16::try_from(size).map_err(|_| TooLong { size })?;
        *extent = signed.cast_unsigned();
    }
    let data_type = stored.nifti_type();
    let [dx, dy, dz] = frame.spacing().map(|s| s as f32);
    let qfac = if frame.is_left_handed() { -1.0 } else { 1.0 };
    let ras = frame.to_ras();
    // Frames of other containers differ in the sign of zeros: -0 + 0 is 0.
    let srow = |row: usize| [0, 1, 2, 3].map(|c| ras[(row, c)] as f32 + 0.0);
    let mut descrip = FILE_DESCRIPTION.to_vec();
    descrip.resize(80, 0);
    let mut header = NiftiHeader {
        dim,
        datatype: data_type as i16,
        bitpix: 8 * data_type.size_of() as i16,
        pixdim: [qfac, dx, dy, dz, 1.0, 1.0, 1.0, 1.0],
        vox_offset: VOX_OFFSET as f32,
        scl_slope: scaling.slope,
        scl_inter: scaling.inter,
        xyzt_units: Unit::Mm as u8,
        descrip,
        qform_code: XForm::Unknown as i16,
        sform_code: XForm::ScannerAnat as i16,
        srow_x: srow(0),
        srow_y: srow(1),
        srow_z: srow(2),
        magic: *MAGIC_CODE_NIP1,
        endianness: Endianness::Little,
        ..NiftiHeader::default()
    };
    if let Some([b, c, d]) = quaternion(frame) {
        header.qform_code = XForm::ScannerAnat as i16;
        (header.quatern_b, header.quatern_c, header.quatern_d) = (b, c, d);
        [header.quatern_x, header.quatern_y, header.quatern_z] =
            [0, 1, 2].map(|row| ras[(row, 3)] as f32);
    }
    Ok(header)
}

/// The bytes of `h` in little endian order, and four zeros: no extensions.
fn to_bytes(h: &NiftiHeader) -> Vec<u8> {
    let mut out = HeaderBytes(Vec::with_capacity(VOX_OFFSET));
    out.int(h.sizeof_hdr).raw(&h.data_type).raw(&h.db_name);
    out.int(h.extents).shorts([h.session_error]);
    out.raw(&[h.regular, h.dim_info]);
    out.shorts(h.dim.map(u16::cast_signed));
    out.reals([h.intent_p1, h.intent_p2, h.intent_p3]);
    out.shorts([h.intent_code, h.datatype, h.bitpix, h.slice_start]);
    out.reals(h.pixdim);
    out.reals([h.vox_offset, h.scl_slope, h.scl_inter]);
    out.shorts([h.slice_end]).raw(&[h.slice_code, h.xyzt_units]);
    out.reals([h.cal_max, h.cal_min, h.slice_duration, h.toffset]);
    out.int(h.glmax).int(h.glmin);
    out.raw(&h.descrip).raw(&h.aux_file);
    out.shorts([h.qform_code, h.sform_code]);
    out.reals([h.quatern_b, h.quatern_c, h.quatern_d]);
    out.reals([h.quatern_x, h.quatern_y, h.quatern_z]);
    out.reals(h.srow_x).reals(h.srow_y).reals(h.srow_z);
    out.raw(&h.intent_name).raw(&h.magic).raw(&[0; 4]);
    out.0
}

/// Fields of a header, written one after the other.
struct HeaderBytes(Vec<u8>);

impl HeaderBytes {
    fn raw(&mut self, bytes: &[u8]) -> &mut Self {
        self.0.extend_from_slice(bytes);
        self
    }

    fn int(&mut self, number: i32) -> &mut Self {
        self.raw(&number.to_le_bytes())
    }

    fn shorts<const N: usize>(&mut self, numbers: [i16; N]) -> &mut Self {
        self.raw(numbers.map(i16::to_le_bytes).as_flattened())
    }

    fn reals<const N: usize>(&mut self, numbers: [f32; N]) -> &mut Self {
        self.raw(numbers.map(f32::to_le_bytes).as_flattened())
    }
}

/// `quatern_b`, `_c`, `_d` if the frame is a rotation with spacing, k possibly reversed.
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
    if off > RIGID_TOLERANCE {
        return None;
    }
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    // The standard stores b, c, d of the quaternion with a >= 0; q and -q are the same rotation.
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
