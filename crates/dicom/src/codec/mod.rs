//! Compressed pixels of one frame -> stored numbers.
//!
//! In: the bytes of one frame and the layout that the data set states. Out: the numbers as an
//! uncompressed little endian file would hold them. Steps:
//!
//! 1. The code stream must be of the kind that the transfer syntax names, and have one component and
//!    as many columns and rows as the data set states. Its structure (scans, tiles, layers, code
//!    blocks) must be such that decoding costs a bounded time per pixel. Only then is memory taken.
//! 2. RLE, [JPEG-LS](jpeg_ls) and [JPEG](jpeg) are decoded here, JPEG 2000 by
//!    [`hayro-jpeg2000`](jpeg_2000); none of them has `unsafe` code.
//! 3. Of a number with more bits than are stored, the lowest Bits Stored bits count, as in native pixels:
//!    the others may hold an overlay or nothing (PS3.5 8.1.1). A number of a lossy code stream, where such bits
//!    do not survive, must be one that Bits Stored and Pixel Representation can hold, and so must a number with
//!    fewer bits than are stored.
//! 4. A panic of a decoder becomes an error of this frame.
//!
//! Guaranteed: the numbers are those that the standard defines, or the frame is refused. (The cosine
//! transform of JPEG and the irreversible wavelet of JPEG 2000 are defined up to the rounding of a
//! decoder's arithmetic.) The caller is asked whether to go on after every [`PIXELS_PER_REPORT`] pixels; in
//! JPEG 2000 once a frame.

mod jpeg;
mod jpeg_2000;
mod jpeg_ls;
mod rle;

pub use jpeg::Process;

use std::panic::{AssertUnwindSafe, catch_unwind};

/// Most pixels of a compressed frame. Slices have at most 1024 columns and rows; decoders take up to
/// 40 bytes per pixel.
pub const MOST_PIXELS: usize = 1 << 20;

/// Pixels decoded between two reports: a few milliseconds of work.
const PIXELS_PER_REPORT: usize = 1 << 14;

/// The compression of stored pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compression {
    /// Not at all.
    None,
    /// Run lengths, PS3.5 annex G.
    Rle,
    /// JPEG (ISO 10918-1): baseline, or lossless with any predictor.
    Jpeg(Process),
    /// JPEG-LS (ISO 14495-1), near-lossless or only lossless.
    JpegLs {
        /// Whether near-lossless frames are allowed.
        near: bool,
    },
    /// JPEG 2000 (ISO 15444-1), irreversible or only reversible.
    Jpeg2000 {
        /// Whether irreversible frames are allowed.
        irreversible: bool,
    },
}

/// Layout of a decoded frame.
#[derive(Debug, Clone, Copy)]
pub struct FrameLayout {
    /// Pixels of a row.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
    /// Bytes of a stored number: 1, 2 or 4.
    pub size: usize,
    /// Bits Stored: bits of a number that count.
    pub bits: u32,
    /// Whether the numbers are signed.
    pub signed: bool,
}

/// Why a frame was not decoded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FrameError {
    /// Its bytes are wrong or not supported.
    Wrong(String),
    /// The caller stopped it.
    Stopped,
}

impl From<String> for FrameError {
    fn from(reason: String) -> Self {
        Self::Wrong(reason)
    }
}

impl From<&str> for FrameError {
    fn from(reason: &str) -> Self {
        Self::Wrong(reason.to_owned())
    }
}

/// Asks the caller regularly whether to go on.
struct Pace<'a> {
    goes_on: &'a mut dyn FnMut() -> bool,
    left: usize,
}

impl Pace<'_> {
    /// Counts `pixels` that are decoded.
    fn step(&mut self, pixels: usize) -> Result<(), FrameError> {
        match self.left.checked_sub(pixels) {
            Some(left) => self.left = left,
            None => {
                self.left = PIXELS_PER_REPORT;
                if !(self.goes_on)() {
                    return Err(FrameError::Stopped);
                }
            }
        }
        Ok(())
    }
}

/// The numbers of a code stream.
struct Numbers {
    values: Vec<i32>,
    /// Bits of a number in the code stream.
    bits: u32,
    /// Whether every bit is that of the encoder's input.
    lossless: bool,
}

impl FrameLayout {
    fn pixels(self) -> usize {
        self.columns * self.rows
    }

    /// Checks the size that a code stream states.
    fn check(self, columns: u64, rows: u64, components: u64) -> Result<(), String> {
        if (columns, rows, components) == (self.columns as u64, self.rows as u64, 1) {
            Ok(())
        } else {
            Err(format!(
                "the compressed frame has {columns} columns, {rows} rows and {components} \
                 component(s), the data set {} columns and {} rows",
                self.columns, self.rows
            ))
        }
    }

    /// Checks the width of a code stream's numbers.
    fn check_bits(self, bits: u32) -> Result<(), String> {
        if bits <= 8 * self.size as u32 {
            Ok(())
        } else {
            Err(format!(
                "the compressed numbers have {bits} bits, and Bits Allocated is {}",
                8 * self.size
            ))
        }
    }

    /// The value that a reader takes the lowest Bits Stored bits of `number` for.
    fn stored(self, number: i32) -> i64 {
        let unused = 64 - self.bits;
        if self.signed {
            i64::from(number) << unused >> unused
        } else {
            ((number as u64) << unused >> unused) as i64
        }
    }

    /// `numbers` as little endian numbers of this layout.
    ///
    /// A code stream of as many bits as are stored holds the stored bits, whatever sign it states
    /// (PS3.5 8.2), and a lossless one of more bits holds them in its lowest. Any other holds numbers, which must
    /// be the same in the stored bits; an unsigned one may also hold signed numbers extended to its width, and one
    /// of more bits signed numbers with zeros above the stored bits.
    fn pack(self, numbers: &Numbers) -> Result<Vec<u8>, String> {
        let spare = 64 - numbers.bits;
        let holds = |value: i32| {
            let stored = self.stored(value);
            let extended = i64::from(value) << spare >> spare;
            let bare = numbers.bits > self.bits && i64::from(value) >> self.bits == 0;
            stored == i64::from(value) || (self.signed && (stored == extended || bare))
        };
        let holds_bits = numbers.lossless && numbers.bits > self.bits;
        let wrong = if numbers.bits == self.bits || holds_bits {
            None
        } else {
            numbers.values.iter().find(|value| !holds(**value))
        };
        if let Some(value) = wrong {
            let kind = if self.signed { "signed" } else { "unsigned" };
            return Err(format!(
                "the compressed frame holds the number {value} of {} bits, which Bits Stored {} \
                 ({kind}) cannot hold",
                numbers.bits, self.bits
            ));
        }
        let mut bytes = Vec::with_capacity(self.pixels() * self.size);
        for value in &numbers.values {
            bytes.extend_from_slice(&value.to_le_bytes()[..self.size]);
        }
        Ok(bytes)
    }
}

/// Decodes the frame in `bytes`. `goes_on` is called regularly, and stops it by `false`.
///
/// # Errors
/// The problem of the bytes, or that it was stopped.
pub fn decode(
    compression: Compression,
    bytes: &[u8],
    layout: FrameLayout,
    goes_on: &mut dyn FnMut() -> bool,
) -> Result<Vec<u8>, FrameError> {
    let mut pace = Pace { goes_on, left: 0 };
    let decoded = catch_unwind(AssertUnwindSafe(|| -> Result<Vec<u8>, FrameError> {
        pace.step(1)?;
        let numbers = match compression {
            Compression::None => return Ok(bytes.to_vec()),
            Compression::Rle => return Ok(rle::decode(bytes, layout)?),
            Compression::Jpeg(process) => jpeg::decode(process, bytes, layout, &mut pace)?,
            Compression::JpegLs { near } => jpeg_ls::decode(near, bytes, layout, &mut pace)?,
            Compression::Jpeg2000 { irreversible } => {
                jpeg_2000::decode(irreversible, bytes, layout)?
            }
        };
        Ok(layout.pack(&numbers)?)
    }));
    let decoded = decoded.unwrap_or_else(|_| Err("the decoder failed on this frame".into()))?;
    if decoded.len() == layout.pixels() * layout.size {
        Ok(decoded)
    } else {
        Err(FrameError::Wrong(format!(
            "the frame holds {} bytes after decompression; expected {}",
            decoded.len(),
            layout.pixels() * layout.size
        )))
    }
}

#[cfg(test)]
mod tests;
