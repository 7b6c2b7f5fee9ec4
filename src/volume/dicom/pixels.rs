//! Storage of the pixels, checked against the length of their element.

use super::super::VolumeError;
use super::super::decode::{DataType, VoxelFormat};
use super::super::facts::ByteOrder;
use super::super::limits::ReadLimits;
use super::super::source::Source;
use super::attributes::{
    Attributes, BITS_ALLOCATED, BITS_STORED, COLUMNS, HIGH_BIT, PIXEL_REPRESENTATION,
    REAL_WORLD_INTERCEPT, REAL_WORLD_SLOPE, RESCALE_INTERCEPT, RESCALE_SLOPE, ROWS, SAMPLES,
};
use super::scan::{PixelElement, Scan};

/// Layout of the pixels of all frames.
#[derive(Debug)]
pub(super) struct Pixels {
    /// Columns, rows, slices: voxels along i, j, k.
    pub shape: [usize; 3],
    /// How a pixel is stored.
    pub format: VoxelFormat,
    /// Offset of the first frame in the unpacked file, bytes.
    begin: u64,
}

impl Pixels {
    /// Checks the layout of the pixels found by `scan`: `gates` volumes of `slices` frames.
    ///
    /// # Errors
    /// [`VolumeError`] for unsupported pixel formats, more voxels than `limits` allows, and
    /// elements too short for the stated frames.
    pub(super) fn of(
        scan: &Scan,
        slices: usize,
        gates: usize,
        limits: &ReadLimits,
        source: &Source,
    ) -> Result<Self, VolumeError> {
        let a = &scan.attributes;
        let samples = a.shorts(SAMPLES).first().copied().unwrap_or(1);
        if samples != 1 {
            let reason = "expected 1: colour images are not supported".into();
            return Err(a.wrong(SAMPLES.name, &samples.to_string(), reason));
        }
        let extent = |attribute| match a.short(attribute)? {
            0 => Err(a.wrong(attribute.name, "0", "expected at least 1".into())),
            n => Ok(usize::from(n)),
        };
        let shape = [extent(COLUMNS)?, extent(ROWS)?, slices];
        let (data_type, unused_bits) = data_type(scan)?;
        let pixels = Self {
            shape,
            format: VoxelFormat {
                file: a.file.clone(),
                shape,
                data_type,
                byte_order: a.byte_order,
                unused_bits,
                scaling: scaling(a)?,
            },
            begin: scan.begin,
        };
        // Cannot overflow: two factors of 16 bits and one of 20 bits.
        let voxels = (pixels.frame_voxels() * slices) as u64;
        if voxels > limits.voxels {
            return Err(VolumeError::TooLarge {
                file: a.file.clone(),
                what: "voxels",
                asked: voxels,
                limit: limits.voxels,
            });
        }
        let bytes = voxels * gates as u64 * data_type.size() as u64;
        match bytes > scan.length {
            true => Err(source.truncated(scan.begin + bytes, scan.begin + scan.length)),
            false => Ok(pixels),
        }
    }

    /// Voxels of one frame.
    pub(super) fn frame_voxels(&self) -> usize {
        self.shape[0] * self.shape[1]
    }

    /// Offset of stored frame number `frame`, from 0, bytes.
    pub(super) fn frame_begin(&self, frame: usize) -> u64 {
        let bytes = self.frame_voxels() * self.format.data_type.size();
        self.begin + frame as u64 * bytes as u64
    }
}

/// The data type, and the number of leading bits that are not part of the value.
fn data_type(scan: &Scan) -> Result<(DataType, u32), VolumeError> {
    let a = &scan.attributes;
    match scan.element {
        PixelElement::Integer => {}
        PixelElement::Float => return Ok((DataType::F32, 0)),
        PixelElement::Double => return Ok((DataType::F64, 0)),
    }
    let allocated = a.short(BITS_ALLOCATED)?;
    let signed = match a.short(PIXEL_REPRESENTATION)? {
        0 => false,
        1 => true,
        other => {
            let reason = "expected 0 (unsigned) or 1 (signed)".into();
            return Err(a.wrong(PIXEL_REPRESENTATION.name, &other.to_string(), reason));
        }
    };
    let data_type = match (allocated, signed) {
        // In big endian files two 8-bit pixels share a word in swapped order.
        (8, _) if a.byte_order == ByteOrder::Big => {
            let reason = "8-bit pixels in big endian byte order are not supported".into();
            return Err(a.wrong(BITS_ALLOCATED.name, "8", reason));
        }
        (8, false) => DataType::U8,
        (8, true) => DataType::I8,
        (16, false) => DataType::U16,
        (16, true) => DataType::I16,
        (32, false) => DataType::U32,
        (32, true) => DataType::I32,
        (other, _) => {
            let reason = "expected 8, 16 or 32".into();
            return Err(a.wrong(BITS_ALLOCATED.name, &other.to_string(), reason));
        }
    };
    let stored = a.shorts(BITS_STORED).first().copied().unwrap_or(allocated);
    if stored == 0 || stored > allocated {
        let reason = format!("expected 1 to {allocated} (Bits Allocated)");
        return Err(a.wrong(BITS_STORED.name, &stored.to_string(), reason));
    }
    let high_bit = a.shorts(HIGH_BIT).first().copied().unwrap_or(stored - 1);
    if high_bit != stored - 1 {
        let reason = format!("expected {} (Bits Stored - 1)", stored - 1);
        return Err(a.wrong(HIGH_BIT.name, &high_bit.to_string(), reason));
    }
    Ok((data_type, u32::from(allocated - stored)))
}

/// Slope and intercept: Rescale Slope and Intercept, otherwise the first item of the Real World
/// Value Mapping; `None` if there is neither or they change nothing.
fn scaling(a: &Attributes) -> Result<Option<(f64, f64)>, VolumeError> {
    let (field, slope, inter) = match a.decimals(RESCALE_SLOPE)? {
        Some([slope]) => {
            let [inter] = a.decimals(RESCALE_INTERCEPT)?.unwrap_or([0.0]);
            (RESCALE_SLOPE.name, slope, inter)
        }
        None => match a.double(REAL_WORLD_SLOPE) {
            Some(slope) => {
                let inter = a.double(REAL_WORLD_INTERCEPT).unwrap_or(0.0);
                (REAL_WORLD_SLOPE.name, slope, inter)
            }
            None => return Ok(None),
        },
    };
    if !slope.is_finite() || slope == 0.0 || !inter.is_finite() {
        let value = format!("{slope} (intercept {inter})");
        let reason = "expected a finite slope other than 0 and a finite intercept".into();
        return Err(a.wrong(field, &value, reason));
    }
    Ok(((slope, inter) != (1.0, 0.0)).then_some((slope, inter)))
}
