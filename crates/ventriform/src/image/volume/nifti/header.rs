//! The checked header.

use super::super::VolumeError;
use super::super::decode::{DataType, VoxelFormat};
use super::super::facts::{ByteOrder, FileFormat, LengthUnit};
use super::super::limits::ReadLimits;
use super::super::source::Source;
use super::stated::{StatedHeader, StatedOffset};
use ::nifti::{NiftiHeader, NiftiType};

/// Bytes between the header and the first voxel that announce extensions.
const EXTENDER_BYTES: u64 = 4;

/// The fields of a header after all checks, the same for both versions.
#[derive(Debug, Clone)]
pub(super) struct Header {
    /// Name of the file, for error messages.
    pub file: String,
    /// Whether the voxels are in another file.
    pub pair: bool,
    second_version: bool,
    /// Byte order of header and voxels.
    pub byte_order: ByteOrder,
    /// All dimensions, each at least 1.
    pub dim: Vec<usize>,
    /// The first three dimensions, 1 for those the file does not have.
    pub shape: [usize; 3],
    /// Number of volumes: the product of the other dimensions.
    pub frames: usize,
    pub data_type: DataType,
    /// Offset of the first voxel, bytes.
    pub vox_offset: u64,
    /// Slope and intercept, if the voxels are scaled.
    pub scaling: Option<(f64, f64)>,
    /// The unit of all lengths below.
    pub unit: LengthUnit,
    /// `xyzt_units` as stated.
    pub xyzt_units: i32,
    /// Intent code of the file.
    pub intent_code: i32,
    /// `pixdim`, entry 0 being qfac.
    pub pixdim: [f64; 8],
    /// 0 if there is no qform.
    pub qform_code: i32,
    /// 0 if there is no sform.
    pub sform_code: i32,
    /// `quatern_b`, `_c`, `_d`.
    pub quatern: [f64; 3],
    /// `qoffset_x`, `_y`, `_z`.
    pub qoffset: [f64; 3],
    /// `srow_x`, `_y`, `_z`.
    pub srow: [[f64; 4]; 3],
    /// Oddities that do not prevent reading.
    pub warnings: Vec<String>,
}

impl Header {
    /// Whether it is that of NIfTI-2.
    pub(super) fn is_second(&self) -> bool {
        self.second_version
    }

    /// Reads and checks the header at the start of `source`.
    ///
    /// # Errors
    /// [`VolumeError`]; for an invalid field [`VolumeError::Field`] with its name, value and
    /// offset.
    pub(super) fn read(source: &mut Source) -> Result<Self, VolumeError> {
        let stated = StatedHeader::read(source)?;
        let mut warnings = Vec::new();
        let dim = stated.extents()?;
        stated.reject_cifti()?;
        let extent = |axis: usize| dim.get(axis).copied().unwrap_or(1);
        let frames = dim
            .iter()
            .skip(3)
            .try_fold(1_usize, |n, &d| n.checked_mul(d));
        let frames = frames.ok_or_else(|| {
            let reason = "the number of volumes exceeds the range of integers".into();
            stated.invalid(
                "dim[4..8]",
                format!("{dim:?}"),
                reason,
                stated.offsets.dim(0),
            )
        })?;
        Ok(Self {
            pair: stated.pair,
            second_version: stated.second_version,
            byte_order: stated.byte_order,
            shape: [extent(0), extent(1), extent(2)],
            frames,
            data_type: stated.data_type()?,
            vox_offset: stated.first_voxel()?,
            scaling: stated.scaling(&mut warnings)?,
            unit: stated.unit(&mut warnings),
            xyzt_units: stated.xyzt_units,
            intent_code: stated.intent_code,
            pixdim: stated.pixdim,
            qform_code: stated.qform_code,
            sform_code: stated.sform_code,
            quatern: stated.quatern,
            qoffset: stated.qoffset,
            srow: stated.srow,
            dim,
            warnings,
            file: stated.file,
        })
    }

    /// Version and number of files.
    pub(super) fn format(&self) -> FileFormat {
        match (self.second_version, self.pair) {
            (false, false) => FileFormat::Nifti1,
            (false, true) => FileFormat::Nifti1Pair,
            (true, false) => FileFormat::Nifti2,
            (true, true) => FileFormat::Nifti2Pair,
        }
    }

    /// Voxels of one volume. Cannot overflow after [`Header::check_size`].
    pub(super) fn voxels(&self) -> usize {
        self.shape.iter().product()
    }

    /// Storage format of the voxels.
    pub(super) fn voxel_format(&self) -> VoxelFormat {
        VoxelFormat {
            file: self.file.clone(),
            shape: self.shape,
            data_type: self.data_type,
            byte_order: self.byte_order,
            unused_bits: 0,
            scaling: self.scaling,
            padding: None,
        }
    }

    /// Offset of volume number `frame`, from 0, bytes.
    pub(super) fn frame_begin(&self, frame: usize) -> u64 {
        let bytes = self.voxels() as u64 * self.data_type.size() as u64;
        self.vox_offset + frame as u64 * bytes
    }

    /// Checks before any allocation that the volume is within `limits` and that `source` can hold all
    /// volumes.
    ///
    /// # Errors
    /// [`VolumeError::TooLarge`] or [`VolumeError::Truncated`].
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
        if end > limits.unpacked_bytes {
            Err(source.beyond_limit(end))
        } else {
            Ok(())
        }
    }
}

/// The data type with NIfTI's `code`.
///
/// # Errors
/// The reason why voxels of the type are not supported.
fn data_type(code: i16) -> Result<DataType, &'static str> {
    const COMPLEX_REFUSAL: &str = "complex numbers are not supported: the uptake cannot be told from two \
                         parts per voxel";
    const COLOUR_REFUSAL: &str = "colour images are not supported";
    let header = NiftiHeader {
        datatype: code,
        ..NiftiHeader::default()
    };
    match header.data_type() {
        Ok(NiftiType::Uint8) => Ok(DataType::U8),
        Ok(NiftiType::Int8) => Ok(DataType::I8),
        Ok(NiftiType::Uint16) => Ok(DataType::U16),
        Ok(NiftiType::Int16) => Ok(DataType::I16),
        Ok(NiftiType::Uint32) => Ok(DataType::U32),
        Ok(NiftiType::Int32) => Ok(DataType::I32),
        Ok(NiftiType::Uint64) => Ok(DataType::U64),
        Ok(NiftiType::Int64) => Ok(DataType::I64),
        Ok(NiftiType::Float32) => Ok(DataType::F32),
        Ok(NiftiType::Float64) => Ok(DataType::F64),
        Ok(NiftiType::Float128) => Err("float128 is not supported: convert to float32"),
        Ok(NiftiType::Complex64 | NiftiType::Complex128 | NiftiType::Complex256) => {
            Err(COMPLEX_REFUSAL)
        }
        Ok(NiftiType::Rgb24 | NiftiType::Rgba32) => Err(COLOUR_REFUSAL),
        Err(_) if code == 1 => Err("single bits are not supported"),
        Err(_) => Err("NIfTI defines no such data type"),
    }
}

impl StatedHeader {
    /// The dimensions, each at least 1.
    fn extents(&self) -> Result<Vec<usize>, VolumeError> {
        const FIELD_NAMES: [&str; 8] = [
            "dim[0]", "dim[1]", "dim[2]", "dim[3]", "dim[4]", "dim[5]", "dim[6]", "dim[7]",
        ];
        let rank = (self.dim[0] as usize).min(7);
        let extent = |index: usize| match usize::try_from(self.dim[index]) {
            Ok(n) if n > 0 => Ok(n),
            _ => {
                let reason = "a dimension must be at least 1".into();
                let at = self.offsets.dim(index);
                Err(self.invalid(FIELD_NAMES[index], self.dim[index], reason, at))
            }
        };
        (1..=rank).map(extent).collect()
    }

    fn reject_cifti(&self) -> Result<(), VolumeError> {
        let code = self.intent_code;
        if self.second_version && (3000..3100).contains(&code) {
            let reason = "a CIFTI-2 file holds a matrix over brain locations, not a volume".into();
            return Err(self.invalid("intent_code", code, reason, self.offsets.intent_code));
        }
        Ok(())
    }

    fn data_type(&self) -> Result<DataType, VolumeError> {
        let code = self.datatype;
        let data_type = data_type(code).map_err(|reason| {
            self.invalid("datatype", code, reason.into(), self.offsets.datatype)
        })?;
        let bits = self.bitpix;
        if i32::from(bits) != 8 * data_type.size() as i32 {
            let reason = format!(
                "datatype {code} ({}) has {} bits per voxel",
                data_type.name(),
                8 * data_type.size()
            );
            return Err(self.invalid("bitpix", bits, reason, self.offsets.bitpix));
        }
        Ok(data_type)
    }

    /// Offset of the first voxel, bytes.
    fn first_voxel(&self) -> Result<u64, VolumeError> {
        let least = if self.pair {
            0
        } else {
            self.offsets.size as u64 + EXTENDER_BYTES
        };
        let invalid = |value: String, reason: String| {
            self.invalid("vox_offset", value, reason, self.offsets.vox_offset)
        };
        let offset = match self.vox_offset {
            StatedOffset::Whole(stated) => u64::try_from(stated).map_err(|_| {
                let reason = "the offset of the first voxel cannot be negative".into();
                invalid(stated.to_string(), reason)
            })?,
            // Above 2^53 not every whole number is representable. NaN fails as well.
            StatedOffset::Real(stated)
                if !(0.0..=9.0e15).contains(&stated) || stated.fract() != 0.0 =>
            {
                let reason = "the offset of the first voxel must be a whole number".into();
                return Err(invalid(stated.to_string(), reason));
            }
            StatedOffset::Real(stated) => stated as u64,
        };
        if offset < least {
            Err(invalid(
                offset.to_string(),
                format!("the voxels cannot begin before byte {least}"),
            ))
        } else {
            Ok(offset)
        }
    }

    /// Slope and intercept. A slope of 0 means "no scaling" in the standard; several writers use
    /// NaN for the same.
    fn scaling(&self, warnings: &mut Vec<String>) -> Result<Option<(f64, f64)>, VolumeError> {
        let (slope, inter) = (self.scl_slope, self.scl_inter);
        if slope == 0.0 || slope.is_nan() {
            if inter.is_finite() && inter != 0.0 {
                warnings.push(format!(
                    "scl_inter {inter} is not applied, since scl_slope {slope} means no scaling."
                ));
            }
            return Ok(None);
        }
        let check = |name, value: f64, at| {
            if value.is_finite() {
                Ok(())
            } else {
                Err(self.invalid(name, value, "must be a finite number".into(), at))
            }
        };
        check("scl_slope", slope, self.offsets.scl_slope)?;
        check("scl_inter", inter, self.offsets.scl_inter)?;
        Ok(((slope, inter) != (1.0, 0.0)).then_some((slope, inter)))
    }

    fn unit(&self, warnings: &mut Vec<String>) -> LengthUnit {
        let code = self.xyzt_units;
        match code & 7 {
            0 => LengthUnit::Unknown,
            1 => LengthUnit::Metre,
            2 => LengthUnit::Millimetre,
            3 => LengthUnit::Micrometre,
            other => {
                warnings.push(format!(
                    "xyzt_units {code} states the unknown unit of length {other}: read as mm."
                ));
                LengthUnit::Unknown
            }
        }
    }
}
