//! Decoding: stored numbers of any real type to `f32`, in portions, straight into place.

use super::super::VolumeError;
use super::super::facts::ByteOrder;
use super::super::source::Source;
use super::header::Header;
use crate::progress::Cancelled;

/// Voxels decoded at a time: a few milliseconds of unpacking, half a mebibyte at most.
const PORTION: usize = 1 << 16;

/// Whole numbers beyond this are not all representable as `f32`; as its bits.
const EXACT: u32 = 16_777_216_f32.to_bits();
/// The bits of infinity.
const INFINITY: u32 = f32::INFINITY.to_bits();
/// The bit of the sign.
const SIGN: u32 = 1 << 31;

/// How a voxel is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DataType {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

impl DataType {
    /// The type with NIfTI's `code`, or the reason why it is not read.
    pub(super) fn from_code(code: i16) -> Result<Self, String> {
        Ok(match code {
            2 => Self::U8,
            4 => Self::I16,
            8 => Self::I32,
            16 => Self::F32,
            64 => Self::F64,
            256 => Self::I8,
            512 => Self::U16,
            768 => Self::U32,
            1024 => Self::I64,
            1280 => Self::U64,
            other => return Err(refusal(other)),
        })
    }

    /// Bytes of a voxel.
    pub(super) fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    /// The usual name.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::U8 => "uint8",
            Self::I8 => "int8",
            Self::U16 => "uint16",
            Self::I16 => "int16",
            Self::U32 => "uint32",
            Self::I32 => "int32",
            Self::U64 => "uint64",
            Self::I64 => "int64",
            Self::F32 => "float32",
            Self::F64 => "float64",
        }
    }
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

/// Reads the volumes of a file, front to back.
pub(super) struct FrameReader<'a> {
    header: &'a Header,
    source: &'a mut Source,
    buffer: Vec<u8>,
    infinite: u64,
    inexact: bool,
}

impl<'a> FrameReader<'a> {
    /// A reader for the voxels that `header` announces in `source`; sizes were checked.
    pub(super) fn new(header: &'a Header, source: &'a mut Source) -> Result<Self, VolumeError> {
        let portion = header.voxels().min(PORTION);
        Ok(Self {
            buffer: vec![0; portion * header.data_type.size()],
            header,
            source,
            infinite: 0,
            inexact: false,
        })
    }

    /// Fills `voxels` with volume number `frame`, which lies behind all that were read before.
    pub(super) fn read(
        &mut self,
        frame: usize,
        voxels: &mut Vec<f32>,
        report: &mut dyn FnMut(f64) -> Result<(), Cancelled>,
    ) -> Result<(), VolumeError> {
        let header = self.header;
        let count = header.voxels();
        voxels.clear();
        voxels
            .try_reserve_exact(count)
            .map_err(|_| VolumeError::Memory {
                bytes: 4 * count as u64,
            })?;
        let begin = header.vox_offset + frame as u64 * header.frame_bytes();
        self.source.skip_to(begin)?;
        let end = begin + header.frame_bytes();
        while voxels.len() < count {
            report(voxels.len() as f64 / count as f64)?;
            let portion = (count - voxels.len()).min(PORTION);
            let bytes = &mut self.buffer[..portion * header.data_type.size()];
            self.source.fill_all(bytes, end)?;
            let start = voxels.len();
            decode(bytes, header, voxels);
            self.settle(voxels, start)?;
        }
        Ok(report(1.0)?)
    }

    /// Looks for values that `f32` cannot hold.
    fn settle(&mut self, voxels: &mut [f32], start: usize) -> Result<(), VolumeError> {
        let (mut infinite, mut large) = (false, false);
        for v in &voxels[start..] {
            // Without their sign bit, floats are ordered as their bits are.
            let size = v.to_bits() & !SIGN;
            infinite |= size == INFINITY;
            large |= size > EXACT && size < INFINITY;
        }
        self.inexact |= large && self.header.data_type != DataType::F32;
        match infinite {
            true => self.settle_infinite(voxels, start),
            false => Ok(()),
        }
    }

    /// Makes infinities NaN, and refuses those that the file does not hold: numbers too large.
    fn settle_infinite(&mut self, voxels: &mut [f32], start: usize) -> Result<(), VolumeError> {
        let header = self.header;
        let stored = self.buffer.chunks_exact(header.data_type.size());
        for ((n, v), bytes) in (start..).zip(&mut voxels[start..]).zip(stored) {
            if v.is_infinite() {
                let value = exact(bytes, header);
                if value.is_finite() {
                    return Err(overflow(header, n, value));
                }
                *v = f32::NAN;
                self.infinite += 1;
            }
        }
        Ok(())
    }

    /// What happened to the values.
    pub(super) fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.infinite > 0 {
            let n = self.infinite;
            warnings.push(format!(
                "{n} voxels are infinite and were taken as missing (NaN)."
            ));
        }
        if self.inexact {
            let name = self.header.data_type.name();
            warnings.push(format!(
                "Some {name} values exceed 2^24 and were rounded to 24 binary digits."
            ));
        }
        warnings
    }

    /// Looks at what follows the last volume.
    pub(super) fn finish(&mut self) -> Result<Option<String>, VolumeError> {
        let left_over = self.source.finish()?;
        Ok(left_over.then(|| "Bytes that follow the last voxel were left aside.".into()))
    }
}

fn overflow(header: &Header, index: usize, value: f64) -> VolumeError {
    let [nx, ny, _] = header.shape;
    VolumeError::Overflow {
        file: header.file.clone(),
        voxel: [index % nx, index / nx % ny, index / nx / ny],
        value,
    }
}

/// A number that NIfTI stores.
trait Stored: Copy {
    /// Appends `take` of each number in `bytes` to `out`.
    fn each<O>(bytes: &[u8], order: ByteOrder, out: &mut Vec<O>, take: impl Fn(Self) -> O);
    fn single(self) -> f32;
    fn double(self) -> f64;
}

macro_rules! stored {
    ($($t:ty),*) => {$(
        impl Stored for $t {
            fn each<O>(bytes: &[u8], order: ByteOrder, out: &mut Vec<O>, take: impl Fn(Self) -> O) {
                let (numbers, _) = bytes.as_chunks::<{ size_of::<$t>() }>();
                match order {
                    ByteOrder::Little => {
                        out.extend(numbers.iter().map(|b| take(<$t>::from_le_bytes(*b))));
                    }
                    ByteOrder::Big => {
                        out.extend(numbers.iter().map(|b| take(<$t>::from_be_bytes(*b))));
                    }
                }
            }
            fn single(self) -> f32 { self as f32 }
            fn double(self) -> f64 { self as f64 }
        }
    )*};
}
stored!(u8, i8, u16, i16, u32, i32, u64, i64, f32, f64);

/// Evaluates `$body` with `$t` standing for the Rust type of `$data_type`.
macro_rules! with_type {
    ($data_type:expr, $t:ident => $body:expr) => {
        match $data_type {
            DataType::U8 => {
                type $t = u8;
                $body
            }
            DataType::I8 => {
                type $t = i8;
                $body
            }
            DataType::U16 => {
                type $t = u16;
                $body
            }
            DataType::I16 => {
                type $t = i16;
                $body
            }
            DataType::U32 => {
                type $t = u32;
                $body
            }
            DataType::I32 => {
                type $t = i32;
                $body
            }
            DataType::U64 => {
                type $t = u64;
                $body
            }
            DataType::I64 => {
                type $t = i64;
                $body
            }
            DataType::F32 => {
                type $t = f32;
                $body
            }
            DataType::F64 => {
                type $t = f64;
                $body
            }
        }
    };
}

/// Appends the numbers in `bytes` to `voxels`, slope and intercept applied in double precision
/// as nibabel does.
fn decode(bytes: &[u8], header: &Header, voxels: &mut Vec<f32>) {
    let order = header.byte_order;
    with_type!(header.data_type, T => match header.scaling {
        None => T::each(bytes, order, voxels, |v| v.single()),
        Some((slope, inter)) => {
            T::each(bytes, order, voxels, |v| (v.double() * slope + inter) as f32);
        }
    });
}

/// The first number in `bytes` in double precision, which tells large from infinite.
fn exact(bytes: &[u8], header: &Header) -> f64 {
    let (slope, inter) = header.scaling.unwrap_or((1.0, 0.0));
    let mut value = Vec::with_capacity(1);
    with_type!(header.data_type, T => {
        T::each(bytes, header.byte_order, &mut value, |v| v.double() * slope + inter);
    });
    value.first().copied().unwrap_or(f64::NAN)
}
