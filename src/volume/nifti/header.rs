//! The header's fields, read from either version's layout and checked one by one.
//!
//! The two versions hold the same fields in other places and widths. [`Layout`] says where;
//! everything after it knows no versions.

use super::super::decode::{DataType, VoxelFormat};
use super::super::facts::{ByteOrder, Format, LengthUnit};
use super::super::source::Source;
use super::super::{ReadLimits, VolumeError};

/// Where the fields of a version stand, in bytes from the start. In NIfTI-1 `dim` is of
/// `i16`, codes are `i16` and reals `f32`; in NIfTI-2 they are `i64`, `i32` and `f64`.
struct Layout {
    size: usize,
    dim: usize,
    intent_code: usize,
    datatype: usize,
    bitpix: usize,
    pixdim: usize,
    vox_offset: usize,
    scl_slope: usize,
    scl_inter: usize,
    xyzt_units: usize,
    qform_code: usize,
    sform_code: usize,
    quatern_b: usize,
    qoffset_x: usize,
    srow_x: usize,
}

const NIFTI_1: Layout = Layout {
    size: 348,
    dim: 40,
    intent_code: 68,
    datatype: 70,
    bitpix: 72,
    pixdim: 76,
    vox_offset: 108,
    scl_slope: 112,
    scl_inter: 116,
    xyzt_units: 123,
    qform_code: 252,
    sform_code: 254,
    quatern_b: 256,
    qoffset_x: 268,
    srow_x: 280,
};

const NIFTI_2: Layout = Layout {
    size: 540,
    dim: 16,
    intent_code: 504,
    datatype: 12,
    bitpix: 14,
    pixdim: 104,
    vox_offset: 168,
    scl_slope: 176,
    scl_inter: 184,
    xyzt_units: 500,
    qform_code: 344,
    sform_code: 348,
    quatern_b: 352,
    qoffset_x: 376,
    srow_x: 400,
};

/// Bytes between the header and the first voxel that mark extensions.
const EXTENDER: u64 = 4;

/// A header's checked content.
#[derive(Debug, Clone)]
pub(super) struct Header {
    /// The file's name, for messages.
    pub file: String,
    /// Whether the voxels stand in another file.
    pub pair: bool,
    second_version: bool,
    /// Order of the bytes of header and voxels.
    pub byte_order: ByteOrder,
    /// All dimensions, each at least 1.
    pub dim: Vec<usize>,
    /// The first three, 1 where there are fewer.
    pub shape: [usize; 3],
    /// Product of the others.
    pub frames: usize,
    /// How a voxel is stored.
    pub data_type: DataType,
    /// First byte of the first voxel.
    pub vox_offset: u64,
    /// Slope and intercept, where the file has a scaling.
    pub scaling: Option<(f64, f64)>,
    /// The unit of all lengths below.
    pub unit: LengthUnit,
    /// `pixdim`, entry 0 being qfac.
    pub pixdim: [f64; 8],
    /// 0 where there is no qform.
    pub qform_code: i32,
    /// 0 where there is no sform.
    pub sform_code: i32,
    /// `quatern_b`, `_c`, `_d`.
    pub quatern: [f64; 3],
    /// `qoffset_x`, `_y`, `_z`.
    pub qoffset: [f64; 3],
    /// `srow_x`, `_y`, `_z`.
    pub srow: [[f64; 4]; 3],
    /// Oddities that do no harm.
    pub warnings: Vec<String>,
}

impl Header {
    /// Reads the header at the start of `source`.
    pub(super) fn read(source: &mut Source) -> Result<Self, VolumeError> {
        let mut bytes = vec![0; NIFTI_1.size];
        source.fill_all(&mut bytes, NIFTI_1.size as u64)?;
        let second = matches!(&bytes[4..8], b"n+2\0" | b"ni2\0");
        if second {
            bytes.resize(NIFTI_2.size, 0);
            source.fill_all(&mut bytes[NIFTI_1.size..], NIFTI_2.size as u64)?;
        }
        let layout = if second { &NIFTI_2 } else { &NIFTI_1 };
        let magic = if second { 4 } else { 344 };
        let size = layout.size as i32;
        let big_endian = match bytes[..4].try_into().map(i32::from_le_bytes) {
            Ok(stated) if stated == size => false,
            Ok(stated) if stated.swap_bytes() == size => true,
            stated => {
                return Err(VolumeError::Field {
                    file: source.file().into(),
                    field: "sizeof_hdr",
                    value: stated.unwrap_or_default().to_string(),
                    reason: format!("{size} expected, in either byte order"),
                    byte: Some(0),
                });
            }
        };
        let fields = Fields {
            file: source.file(),
            bytes: &bytes,
            layout,
            second,
            big_endian,
        };
        let pair = &bytes[magic..magic + 2] == b"ni";
        Self::check(&fields, pair)
    }

    fn check(fields: &Fields, pair: bool) -> Result<Self, VolumeError> {
        let layout = fields.layout;
        let mut warnings = Vec::new();
        let dim = fields.dim()?;
        fields.refuse_cifti()?;
        let extent = |axis: usize| dim.get(axis).copied().unwrap_or(1);
        let frames = dim
            .iter()
            .skip(3)
            .try_fold(1_usize, |n, &d| n.checked_mul(d));
        let frames = frames.ok_or_else(|| {
            let reason = "more volumes than can be counted".into();
            fields.wrong("dim[4..8]", format!("{dim:?}"), reason, layout.dim)
        })?;
        Ok(Self {
            file: fields.file.into(),
            pair,
            second_version: fields.second,
            byte_order: match fields.big_endian {
                true => ByteOrder::Big,
                false => ByteOrder::Little,
            },
            shape: [extent(0), extent(1), extent(2)],
            frames,
            data_type: fields.data_type()?,
            vox_offset: fields.vox_offset(pair)?,
            scaling: fields.scaling(&mut warnings)?,
            unit: fields.unit(&mut warnings),
            pixdim: std::array::from_fn(|i| fields.real_at(layout.pixdim, i)),
            qform_code: fields.code(layout.qform_code),
            sform_code: fields.code(layout.sform_code),
            quatern: std::array::from_fn(|i| fields.real_at(layout.quatern_b, i)),
            qoffset: std::array::from_fn(|i| fields.real_at(layout.qoffset_x, i)),
            srow: std::array::from_fn(|row| {
                std::array::from_fn(|i| fields.real_at(layout.srow_x, 4 * row + i))
            }),
            dim,
            warnings,
        })
    }

    /// The format's name.
    pub(super) fn format(&self) -> Format {
        match (self.second_version, self.pair) {
            (false, false) => Format::Nifti1,
            (false, true) => Format::Nifti1Pair,
            (true, false) => Format::Nifti2,
            (true, true) => Format::Nifti2Pair,
        }
    }

    /// Voxels of one volume. Checked by [`Header::check_size`].
    pub(super) fn voxels(&self) -> usize {
        self.shape.iter().product()
    }

    /// How to decode them.
    pub(super) fn voxel_format(&self) -> VoxelFormat {
        VoxelFormat {
            file: self.file.clone(),
            shape: self.shape,
            data_type: self.data_type,
            byte_order: self.byte_order,
            unused_bits: 0,
            scaling: self.scaling,
        }
    }

    /// First byte of volume number `frame`.
    pub(super) fn frame_begin(&self, frame: usize) -> u64 {
        let bytes = self.voxels() as u64 * self.data_type.size() as u64;
        self.vox_offset + frame as u64 * bytes
    }

    /// Checks that the voxels may be read and can be there, before memory is taken for them.
    pub(super) fn check_size(
        &self,
        source: &mut Source,
        limits: &ReadLimits,
    ) -> Result<(), VolumeError> {
        let product = |n: u64, &d: &usize| n.checked_mul(d as u64);
        let voxels = self.shape.iter().try_fold(1, product).unwrap_or(u64::MAX);
        if voxels > limits.voxels {
            return Err(VolumeError::TooLarge {
                file: self.file.clone(),
                what: "voxels",
                asked: voxels,
                limit: limits.voxels,
            });
        }
        let end = voxels
            .checked_mul(self.data_type.size() as u64)
            .and_then(|frame| frame.checked_mul(self.frames as u64))
            .and_then(|all| all.checked_add(self.vox_offset))
            .unwrap_or(u64::MAX);
        if end > source.capacity() {
            return Err(source.truncated(end, source.capacity()));
        }
        match end > limits.unpacked_bytes {
            true => Err(source.beyond_limit(end)),
            false => Ok(()),
        }
    }
}

/// The type with NIfTI's `code`, or the reason why it is not read.
fn data_type(code: i16) -> Result<DataType, String> {
    Ok(match code {
        2 => DataType::U8,
        4 => DataType::I16,
        8 => DataType::I32,
        16 => DataType::F32,
        64 => DataType::F64,
        256 => DataType::I8,
        512 => DataType::U16,
        768 => DataType::U32,
        1024 => DataType::I64,
        1280 => DataType::U64,
        other => return Err(refusal(other)),
    })
}

/// Why voxels of the type `code` are not read.
fn refusal(code: i16) -> String {
    let what = match code {
        1 => "single bits are not read",
        32 => "complex64 has two parts per voxel, and no telling which one is the uptake",
        1792 => "complex128 has two parts per voxel, and no telling which one is the uptake",
        2048 => "complex256 has two parts per voxel, and no telling which one is the uptake",
        1536 => "float128 is not read: convert to float32",
        128 => "RGB24 is a picture in colours, not a measurement",
        2304 => "RGBA32 is a picture in colours, not a measurement",
        _ => "no such data type in NIfTI",
    };
    what.into()
}

/// The raw bytes with their layout.
struct Fields<'a> {
    file: &'a str,
    bytes: &'a [u8],
    layout: &'static Layout,
    second: bool,
    big_endian: bool,
}

impl Fields<'_> {
    fn number<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut bytes = [0; N];
        bytes.copy_from_slice(&self.bytes[at..at + N]);
        if self.big_endian {
            bytes.reverse();
        }
        bytes
    }

    fn short(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.number(at))
    }

    fn code(&self, at: usize) -> i32 {
        match self.second {
            true => i32::from_le_bytes(self.number(at)),
            false => i32::from(self.short(at)),
        }
    }

    fn dim_at(&self, index: usize) -> i64 {
        match self.second {
            true => i64::from_le_bytes(self.number(self.layout.dim + 8 * index)),
            false => i64::from(self.short(self.layout.dim + 2 * index)),
        }
    }

    fn real_at(&self, at: usize, index: usize) -> f64 {
        match self.second {
            true => f64::from_le_bytes(self.number(at + 8 * index)),
            false => f64::from(f32::from_le_bytes(self.number(at + 4 * index))),
        }
    }

    fn wrong(
        &self,
        field: &'static str,
        value: impl ToString,
        reason: String,
        at: usize,
    ) -> VolumeError {
        VolumeError::Field {
            file: self.file.into(),
            field,
            value: value.to_string(),
            reason,
            byte: Some(at as u64),
        }
    }

    fn dim(&self) -> Result<Vec<usize>, VolumeError> {
        const NAMES: [&str; 8] = [
            "dim[0]", "dim[1]", "dim[2]", "dim[3]", "dim[4]", "dim[5]", "dim[6]", "dim[7]",
        ];
        let at = |index: usize| self.layout.dim + index * if self.second { 8 } else { 2 };
        let rank = self.dim_at(0);
        if !(1..=7).contains(&rank) {
            let reason = "the number of dimensions must be 1 to 7".into();
            return Err(self.wrong("dim[0]", rank, reason, at(0)));
        }
        let extent = |index: usize| match usize::try_from(self.dim_at(index)) {
            Ok(n) if n > 0 => Ok(n),
            _ => {
                let reason = "a dimension must be at least 1".into();
                Err(self.wrong(NAMES[index], self.dim_at(index), reason, at(index)))
            }
        };
        (1..=rank as usize).map(extent).collect()
    }

    fn refuse_cifti(&self) -> Result<(), VolumeError> {
        let code = self.code(self.layout.intent_code);
        if self.second && (3000..3100).contains(&code) {
            let reason = "a CIFTI-2 file holds a matrix over brain locations, not a volume".into();
            return Err(self.wrong("intent_code", code, reason, self.layout.intent_code));
        }
        Ok(())
    }

    fn data_type(&self) -> Result<DataType, VolumeError> {
        let code = self.short(self.layout.datatype);
        let refuse = |reason: String| self.wrong("datatype", code, reason, self.layout.datatype);
        let data_type = data_type(code).map_err(refuse)?;
        let bits = self.short(self.layout.bitpix);
        if i32::from(bits) != 8 * data_type.size() as i32 {
            let reason = format!(
                "datatype {code} ({}) has {} bits per voxel",
                data_type.name(),
                8 * data_type.size()
            );
            return Err(self.wrong("bitpix", bits, reason, self.layout.bitpix));
        }
        Ok(data_type)
    }

    fn vox_offset(&self, pair: bool) -> Result<u64, VolumeError> {
        let at = self.layout.vox_offset;
        let least = match pair {
            true => 0,
            false => self.layout.size as u64 + EXTENDER,
        };
        let refuse = |value: String, reason: String| self.wrong("vox_offset", value, reason, at);
        let offset = match self.second {
            true => {
                let stated = i64::from_le_bytes(self.number(at));
                let reason = "the first voxel's byte cannot be negative".into();
                u64::try_from(stated).map_err(|_| refuse(stated.to_string(), reason))?
            }
            false => {
                let stated = self.real_at(at, 0);
                // Above 2^53 a float's steps are wider than a byte; and NaN fails as well.
                if !(0.0..=9.0e15).contains(&stated) || stated.fract() != 0.0 {
                    let reason = "the first voxel's byte must be a whole number".into();
                    return Err(refuse(stated.to_string(), reason));
                }
                stated as u64
            }
        };
        match offset < least {
            true => Err(refuse(
                offset.to_string(),
                format!("the voxels cannot begin before byte {least}"),
            )),
            false => Ok(offset),
        }
    }

    /// The standard: a slope of 0 means that there is no scaling. A slope that is no number
    /// is how several writers say the same.
    fn scaling(&self, warnings: &mut Vec<String>) -> Result<Option<(f64, f64)>, VolumeError> {
        let slope = self.real_at(self.layout.scl_slope, 0);
        let inter = self.real_at(self.layout.scl_inter, 0);
        if slope == 0.0 || slope.is_nan() {
            if inter.is_finite() && inter != 0.0 {
                warnings.push(format!(
                    "scl_inter {inter} is not applied, since scl_slope {slope} means no scaling."
                ));
            }
            return Ok(None);
        }
        let check = |name, value: f64, at| match value.is_finite() {
            true => Ok(()),
            false => Err(self.wrong(name, value, "must be a finite number".into(), at)),
        };
        check("scl_slope", slope, self.layout.scl_slope)?;
        check("scl_inter", inter, self.layout.scl_inter)?;
        Ok(((slope, inter) != (1.0, 0.0)).then_some((slope, inter)))
    }

    fn unit(&self, warnings: &mut Vec<String>) -> LengthUnit {
        let code = match self.second {
            true => self.code(self.layout.xyzt_units),
            false => i32::from(self.bytes[self.layout.xyzt_units]),
        };
        match code & 7 {
            0 => LengthUnit::Unknown,
            1 => LengthUnit::Metre,
            2 => LengthUnit::Millimetre,
            3 => LengthUnit::Micrometre,
            other => {
                warnings.push(format!(
                    "xyzt_units {code} has the unknown unit of length {other}: read as mm."
                ));
                LengthUnit::Unknown
            }
        }
    }
}
