//! The fields of a NIfTI header as the file states them, before any check of their values.
//!
//! The `nifti` crate parses NIfTI-1 headers. It gets exactly 348 bytes whose byte order and rank
//! have been checked here, since it derives the byte order from the rank alone. It does not read
//! NIfTI-2, so the fields of that version are read here by their offsets.

use super::super::VolumeError;
use super::super::facts::ByteOrder;
use super::super::source::Source;
use ::nifti::header::MAGIC_CODE_NI1;
use ::nifti::{Endianness, NiftiHeader};

/// Bytes of a NIfTI-1 header.
const FIRST_SIZE: usize = 348;
/// Bytes of a NIfTI-2 header.
const SECOND_SIZE: usize = 540;

/// Offsets of the fields that errors name, in bytes from the start of the file.
#[derive(Debug, Clone, Copy)]
pub(super) struct Offsets {
    /// `sizeof_hdr`, which is also the offset of the first byte after the header.
    pub size: usize,
    dim: usize,
    /// Bytes of one number of `dim`.
    dim_width: usize,
    pub intent_code: usize,
    pub datatype: usize,
    pub bitpix: usize,
    pub vox_offset: usize,
    pub scl_slope: usize,
    pub scl_inter: usize,
}

impl Offsets {
    /// Offset of `dim[index]`.
    pub(super) fn dim(&self, index: usize) -> usize {
        self.dim + self.dim_width * index
    }
}

const NIFTI1_OFFSETS: Offsets = Offsets {
    size: FIRST_SIZE,
    dim: 40,
    dim_width: 2,
    intent_code: 68,
    datatype: 70,
    bitpix: 72,
    vox_offset: 108,
    scl_slope: 112,
    scl_inter: 116,
};

const NIFTI2_OFFSETS: Offsets = Offsets {
    size: SECOND_SIZE,
    dim: 16,
    dim_width: 8,
    intent_code: 504,
    datatype: 12,
    bitpix: 14,
    vox_offset: 168,
    scl_slope: 176,
    scl_inter: 184,
};

/// `vox_offset`, which is a real number in NIfTI-1 and a whole one in NIfTI-2.
#[derive(Debug, Clone, Copy)]
pub(super) enum StatedOffset {
    Real(f64),
    Whole(i64),
}

/// The fields of either version, in the wider type of the two.
#[derive(Debug)]
pub(super) struct StatedHeader {
    /// Name of the file, for error messages.
    pub file: String,
    /// Whether the header is of NIfTI-2.
    pub second_version: bool,
    /// Whether the voxels are in another file.
    pub pair: bool,
    pub byte_order: ByteOrder,
    pub offsets: Offsets,
    /// Rank, then one extent per dimension.
    pub dim: [i64; 8],
    pub intent_code: i32,
    pub datatype: i16,
    pub bitpix: i16,
    pub pixdim: [f64; 8],
    pub vox_offset: StatedOffset,
    pub scl_slope: f64,
    pub scl_inter: f64,
    pub xyzt_units: i32,
    pub qform_code: i32,
    pub sform_code: i32,
    pub quatern: [f64; 3],
    pub qoffset: [f64; 3],
    pub srow: [[f64; 4]; 3],
}

impl StatedHeader {
    /// Reads the header at the start of `source`.
    ///
    /// # Errors
    /// [`VolumeError::Truncated`] if the file is shorter than its header, and
    /// [`VolumeError::Field`] for an invalid `sizeof_hdr`, `dim[0]` or `magic`.
    pub(super) fn read(source: &mut Source) -> Result<Self, VolumeError> {
        let mut bytes = vec![0; FIRST_SIZE];
        source.fill_all(&mut bytes, FIRST_SIZE as u64)?;
        let second = matches!(&bytes[4..8], b"n+2\0" | b"ni2\0");
        if second {
            bytes.resize(SECOND_SIZE, 0);
            source.fill_all(&mut bytes[FIRST_SIZE..], SECOND_SIZE as u64)?;
        }
        let offsets = if second {
            NIFTI2_OFFSETS
        } else {
            NIFTI1_OFFSETS
        };
        let file = source.file();
        let byte_order = byte_order(&bytes, offsets.size as i32, file)?;
        let fields = Fields {
            bytes: &bytes,
            big_endian: byte_order == ByteOrder::Big,
        };
        let rank = if second {
            fields.long(offsets.dim)
        } else {
            i64::from(fields.short(offsets.dim))
        };
        if !(1..=7).contains(&rank) {
            let reason = "the number of dimensions must be 1 to 7".into();
            return Err(invalid(file, "dim[0]", rank, reason, offsets.dim(0)));
        }
        if second {
            Ok(Self::second(&fields, byte_order, file))
        } else {
            Self::first(&bytes, file)
        }
    }

    /// A NIfTI-1 header, parsed by the `nifti` crate.
    fn first(bytes: &[u8], file: &str) -> Result<Self, VolumeError> {
        let h = NiftiHeader::from_reader(bytes).map_err(|e| {
            let magic = bytes[FIRST_SIZE - 4..].escape_ascii();
            invalid(file, "magic", magic, e.to_string(), FIRST_SIZE - 4)
        })?;
        Ok(Self {
            file: file.into(),
            second_version: false,
            pair: h.magic == *MAGIC_CODE_NI1,
            byte_order: match h.endianness {
                Endianness::Little => ByteOrder::Little,
                Endianness::Big => ByteOrder::Big,
            },
            offsets: NIFTI1_OFFSETS,
            // The crate reads the standard's signed numbers as unsigned ones.
            dim: h.dim.map(|d| i64::from(d.cast_signed())),
            intent_code: i32::from(h.intent_code),
            datatype: h.datatype,
            bitpix: h.bitpix,
            pixdim: h.pixdim.map(f64::from),
            vox_offset: StatedOffset::Real(f64::from(h.vox_offset)),
            scl_slope: f64::from(h.scl_slope),
            scl_inter: f64::from(h.scl_inter),
            xyzt_units: i32::from(h.xyzt_units),
            qform_code: i32::from(h.qform_code),
            sform_code: i32::from(h.sform_code),
            quatern: [h.quatern_b, h.quatern_c, h.quatern_d].map(f64::from),
            qoffset: [h.quatern_x, h.quatern_y, h.quatern_z].map(f64::from),
            srow: [h.srow_x, h.srow_y, h.srow_z].map(|row| row.map(f64::from)),
        })
    }

    /// A NIfTI-2 header.
    fn second(fields: &Fields<'_>, byte_order: ByteOrder, file: &str) -> Self {
        Self {
            file: file.into(),
            second_version: true,
            pair: fields.bytes[4..].starts_with(b"ni"),
            byte_order,
            offsets: NIFTI2_OFFSETS,
            dim: std::array::from_fn(|i| fields.long(NIFTI2_OFFSETS.dim(i))),
            intent_code: fields.int(NIFTI2_OFFSETS.intent_code),
            datatype: fields.short(NIFTI2_OFFSETS.datatype),
            bitpix: fields.short(NIFTI2_OFFSETS.bitpix),
            pixdim: fields.doubles(104),
            vox_offset: StatedOffset::Whole(fields.long(NIFTI2_OFFSETS.vox_offset)),
            scl_slope: fields.double(NIFTI2_OFFSETS.scl_slope),
            scl_inter: fields.double(NIFTI2_OFFSETS.scl_inter),
            xyzt_units: fields.int(500),
            qform_code: fields.int(344),
            sform_code: fields.int(348),
            quatern: fields.doubles(352),
            qoffset: fields.doubles(376),
            srow: [400, 432, 464].map(|row| fields.doubles(row)),
        }
    }

    /// The error for an invalid value of `field`, which begins at byte `at`.
    pub(super) fn invalid(
        &self,
        field: &'static str,
        value: impl ToString,
        reason: String,
        at: usize,
    ) -> VolumeError {
        invalid(&self.file, field, value, reason, at)
    }
}

fn invalid(
    file: &str,
    field: &'static str,
    value: impl ToString,
    reason: String,
    at: usize,
) -> VolumeError {
    VolumeError::Field {
        file: file.into(),
        field,
        value: value.to_string(),
        reason,
        byte: Some(at as u64),
    }
}

/// The byte order in which `sizeof_hdr` is `size`.
fn byte_order(bytes: &[u8], size: i32, file: &str) -> Result<ByteOrder, VolumeError> {
    let little = Fields {
        bytes,
        big_endian: false,
    };
    match little.int(0) {
        stated if stated == size => Ok(ByteOrder::Little),
        stated if stated.swap_bytes() == size => Ok(ByteOrder::Big),
        stated => {
            let reason = format!("expected {size}, in either byte order");
            Err(invalid(file, "sizeof_hdr", stated, reason, 0))
        }
    }
}

/// The bytes of a header, read by offset.
struct Fields<'a> {
    bytes: &'a [u8],
    big_endian: bool,
}

impl Fields<'_> {
    /// The bytes of a number in little endian order.
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

    fn int(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.number(at))
    }

    fn long(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.number(at))
    }

    fn double(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.number(at))
    }

    /// `N` numbers one after the other.
    fn doubles<const N: usize>(&self, at: usize) -> [f64; N] {
        std::array::from_fn(|i| self.double(at + 8 * i))
    }
}
