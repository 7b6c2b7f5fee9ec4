//! Compressed pixels of one frame -> stored numbers.
//!
//! In: the bytes of one frame and the layout that the data set states. Out: the numbers as an
//! uncompressed little endian file would hold them. Steps:
//!
//! 1. The width, height and component count in the code stream must be those of the data set. Only
//!    then is memory taken.
//! 2. RLE and [JPEG-LS](jpeg_ls) are decoded here, JPEG by `jpeg-decoder`, JPEG 2000 by
//!    `hayro-jpeg2000`; none of them has `unsafe` code.
//! 3. A panic of a decoder becomes an error of this frame.
//!
//! Numbers narrower than the stored type keep their bits; the reader trims and extends them by Bits
//! Stored and Pixel Representation, as for uncompressed pixels. A code stream that contradicts the
//! Pixel Representation is therefore read by the data set, as other readers do.

mod jpeg_ls;
mod rle;

use super::syntax::Compression;
use hayro_jpeg2000::{DecodeSettings, DecoderContext, Image};
use jpeg_decoder::PixelFormat;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Most pixels of a compressed frame. Slices have at most 1024 columns and rows; decoders take up to
/// 40 bytes per pixel.
pub(super) const MOST_PIXELS: usize = 1 << 20;

/// Most tiles of a JPEG 2000 frame.
const MOST_TILES: u64 = 4096;

/// Layout of a decoded frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrameLayout {
    pub columns: usize,
    pub rows: usize,
    /// Bytes of a stored number: 1, 2 or 4.
    pub size: usize,
}

impl FrameLayout {
    fn pixels(self) -> usize {
        self.columns * self.rows
    }

    /// Checks the size that a code stream states.
    fn check(self, columns: u64, rows: u64, components: u64) -> Result<(), String> {
        match (columns, rows, components) == (self.columns as u64, self.rows as u64, 1) {
            true => Ok(()),
            false => Err(format!(
                "the compressed frame has {columns} columns, {rows} rows and {components} \
                 component(s), the data set {} columns and {} rows",
                self.columns, self.rows
            )),
        }
    }

    /// `values` as little endian numbers of this layout.
    fn pack(self, values: impl Iterator<Item = i32>) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.pixels() * self.size);
        for value in values {
            bytes.extend_from_slice(&value.to_le_bytes()[..self.size]);
        }
        bytes
    }
}

/// Decodes the frame in `bytes`.
///
/// # Errors
/// What is wrong with the bytes.
pub(super) fn decode(
    compression: Compression,
    bytes: &[u8],
    layout: FrameLayout,
) -> Result<Vec<u8>, String> {
    let decoded = catch_unwind(AssertUnwindSafe(|| match compression {
        Compression::None => Ok(bytes.to_vec()),
        Compression::Rle => rle::decode(bytes, layout),
        Compression::Jpeg => jpeg(bytes, layout),
        Compression::JpegLs => jpeg_ls::decode(bytes, layout),
        Compression::Jpeg2000 => jpeg_2000(bytes, layout),
    }));
    let decoded = decoded.unwrap_or_else(|_| Err("the decoder failed on this frame".into()))?;
    match decoded.len() == layout.pixels() * layout.size {
        true => Ok(decoded),
        false => Err(format!(
            "the frame holds {} bytes after decompression; expected {}",
            decoded.len(),
            layout.pixels() * layout.size
        )),
    }
}

/// Error of a frame whose numbers need more bits than the data set allocates.
fn too_wide(bits: u32, layout: FrameLayout) -> String {
    format!(
        "the compressed numbers have {bits} bits, and Bits Allocated is {}",
        8 * layout.size
    )
}

fn jpeg(bytes: &[u8], layout: FrameLayout) -> Result<Vec<u8>, String> {
    let mut decoder = jpeg_decoder::Decoder::new(bytes);
    decoder.set_max_decoding_buffer_size(2 * layout.pixels());
    decoder.read_info().map_err(|e| e.to_string())?;
    let info = decoder.info().ok_or("the JPEG frame has no header")?;
    let (components, bits) = match info.pixel_format {
        PixelFormat::L8 => (1, 8),
        PixelFormat::L16 => (1, 16),
        PixelFormat::RGB24 => (3, 8),
        PixelFormat::CMYK32 => (4, 8),
    };
    layout.check(info.width.into(), info.height.into(), components)?;
    if bits > 8 * layout.size as u32 {
        return Err(too_wide(bits, layout));
    }
    let decoded = decoder.decode().map_err(|e| e.to_string())?;
    Ok(match bits {
        8 => layout.pack(decoded.into_iter().map(i32::from)),
        _ => {
            let (numbers, _) = decoded.as_chunks::<2>();
            layout.pack(numbers.iter().map(|n| u16::from_ne_bytes(*n).into()))
        }
    })
}

fn jpeg_2000(bytes: &[u8], layout: FrameLayout) -> Result<Vec<u8>, String> {
    const START: [u8; 4] = [0xff, 0x4f, 0xff, 0x51];
    let start = bytes.windows(4).position(|four| four == START);
    let stream = start.and_then(|start| bytes.get(start..));
    let size = stream.and_then(ImageSize::read);
    let size = size.ok_or("the JPEG 2000 frame has no image size (SIZ)")?;
    layout.check(size.columns, size.rows, size.components)?;
    if size.bits > 8 * layout.size as u32 || size.bits > 24 {
        return Err(too_wide(size.bits, layout));
    }
    if size.tiles > MOST_TILES {
        return Err(format!("the JPEG 2000 frame has {} tiles", size.tiles));
    }
    let settings = DecodeSettings {
        resolve_palette_indices: false,
        strict: true,
        target_resolution: None,
    };
    let stream = stream.unwrap_or_default();
    let image = Image::new(stream, &settings).map_err(|e| e.to_string())?;
    let mut context = DecoderContext::default();
    let decoded = image.decode(&mut context).map_err(|e| e.to_string())?;
    let [component] = decoded.components() else {
        return Err("the JPEG 2000 frame has several components".into());
    };
    // The decoder shifts signed numbers as it does unsigned ones, so that the least becomes 0.
    let shift = match size.signed {
        true => 1 << (size.bits - 1),
        false => 0,
    };
    let samples = component.samples().iter();
    Ok(layout.pack(samples.map(|v| v.round() as i32 - shift)))
}

/// The SIZ marker segment of a JPEG 2000 code stream (ISO 15444-1, A.5.1).
struct ImageSize {
    columns: u64,
    rows: u64,
    components: u64,
    tiles: u64,
    bits: u32,
    signed: bool,
}

impl ImageSize {
    /// Reads the segment at the start of `stream`; `None` if it is cut off or contradicts itself.
    fn read(stream: &[u8]) -> Option<Self> {
        let long = |at: usize| {
            let four = stream.get(at..)?.first_chunk()?;
            Some(u64::from(u32::from_be_bytes(*four)))
        };
        let [right, bottom, left, top] = [long(8)?, long(12)?, long(16)?, long(20)?];
        let [tile_width, tile_height] = [long(24)?, long(28)?];
        let components = stream.get(40..)?.first_chunk()?;
        let depth = *stream.get(42)?;
        if tile_width == 0 || tile_height == 0 {
            return None;
        }
        Some(Self {
            columns: right.checked_sub(left)?,
            rows: bottom.checked_sub(top)?,
            components: u16::from_be_bytes(*components).into(),
            tiles: right.div_ceil(tile_width) * bottom.div_ceil(tile_height),
            bits: u32::from(depth & 0x7f) + 1,
            signed: depth & 0x80 != 0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_stream_of_another_size_takes_no_memory() {
        let layout = FrameLayout {
            columns: 4,
            rows: 3,
            size: 2,
        };
        let mut huge = vec![0xff, 0x4f, 0xff, 0x51, 0, 41, 0, 0];
        for number in [60_000_u32, 60_000, 0, 0, 1, 1, 0, 0] {
            huge.extend(number.to_be_bytes());
        }
        huge.extend([0, 1, 15, 1, 1]);
        let error = decode(Compression::Jpeg2000, &huge, layout).unwrap_err();
        assert!(error.contains("60000 columns"), "{error}");
        // As many columns and rows as stated, but in 4096 million tiles.
        let mut tiles = huge.clone();
        tiles[8..16].copy_from_slice(&[0, 0, 0, 4, 0, 0, 0, 3]);
        tiles[16..24].copy_from_slice(&[0; 8]);
        assert!(decode(Compression::Jpeg2000, &tiles, layout).is_err());
        let jpeg = [
            0xff, 0xd8, 0xff, 0xc3, 0, 11, 16, 0xff, 0xff, 0xff, 0xff, 1, 1, 0x11, 0,
        ];
        let error = decode(Compression::Jpeg, &jpeg, layout).unwrap_err();
        assert!(error.contains("65535 columns"), "{error}");
        for compression in [
            Compression::Rle,
            Compression::Jpeg,
            Compression::JpegLs,
            Compression::Jpeg2000,
        ] {
            assert!(decode(compression, &[], layout).is_err());
        }
    }
}
