//! Pixels of images (PS3.3 C.7.6.3).

use super::data_set::DataSet;
use dicom_dictionary_std::tags;

/// How pixels are stored: unsigned numbers that fill the bits allocated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelFormat {
    /// Rows.
    pub rows: u16,
    /// Columns.
    pub columns: u16,
    /// Numbers of a pixel; of several, pixel after pixel.
    pub samples: u16,
    /// Photometric Interpretation (0028,0004).
    pub photometric: &'static str,
    /// Bits of a number.
    pub bits: u16,
}

impl PixelFormat {
    /// Puts the format into `set`.
    pub fn put(&self, set: &mut DataSet) {
        set.short(tags::SAMPLES_PER_PIXEL, self.samples);
        set.text(tags::PHOTOMETRIC_INTERPRETATION, self.photometric);
        if self.samples > 1 {
            set.short(tags::PLANAR_CONFIGURATION, 0);
        }
        set.short(tags::ROWS, self.rows);
        set.short(tags::COLUMNS, self.columns);
        set.short(tags::BITS_ALLOCATED, self.bits);
        set.short(tags::BITS_STORED, self.bits);
        set.short(tags::HIGH_BIT, self.bits - 1);
        set.short(tags::PIXEL_REPRESENTATION, 0);
    }
}

/// Pixels of one bit: eight to a byte, the first in the lowest bit; frames follow each other without padding
/// (PS3.5 8.1.1).
pub fn packed_bits(pixels: &[bool]) -> Vec<u8> {
    let byte = |eight: &[bool]| {
        let bits = eight.iter().enumerate();
        bits.fold(0, |byte, (bit, set)| byte | u8::from(*set) << bit)
    };
    pixels.chunks(8).map(byte).collect()
}
