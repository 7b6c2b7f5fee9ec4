//! Pixels, the one PNG encoder, and the decoder of what it wrote.

use std::io::Cursor;

use libdeflater::{CompressionLvl, Compressor};

/// Numbers of PNG's row filters: the bytes themselves, and their differences from the row above.
const NO_FILTER: u8 = 0;
const UP_FILTER: u8 = 2;
/// The usual compromise of zlib, of 1 to 12. Drawings of reports become a sixth to two fifths smaller than with a
/// filter chosen for each row, slices of scans stay as large, in a quarter of the instructions.
const COMPRESSION_LEVEL: i32 = 6;

/// Pixels of one (grey), three (RGB) or four (RGBA) bytes, row by row from the top left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image<const CHANNELS: usize> {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` of them.
    pub pixels: Vec<[u8; CHANNELS]>,
}

impl<const CHANNELS: usize> Image<CHANNELS> {
    const COLOUR_TYPE: png::ColorType = match CHANNELS {
        1 => png::ColorType::Grayscale,
        3 => png::ColorType::Rgb,
        4 => png::ColorType::Rgba,
        _ => panic!("a pixel has one, three or four channels"),
    };

    /// An image of one colour.
    pub fn filled(width: usize, height: usize, colour: [u8; CHANNELS]) -> Self {
        Self {
            width,
            height,
            pixels: vec![colour; width * height],
        }
    }

    /// `images` from left to right with `gap` columns of zeros between them. The tallest gives
    /// the height, the others stand in its middle with zeros above and below.
    pub fn side_by_side(images: &[Self], gap: usize) -> Self {
        let gaps = gap * images.len().saturating_sub(1);
        let width = images.iter().map(|image| image.width).sum::<usize>() + gaps;
        let height = images.iter().map(|image| image.height).max().unwrap_or(0);
        let mut row = Self::filled(width, height, [0; CHANNELS]);
        let mut left = 0;
        for image in images {
            let top = (height - image.height) / 2;
            for (y, pixels) in image.pixels.chunks_exact(image.width.max(1)).enumerate() {
                let start = (top + y) * width + left;
                row.pixels[start..start + image.width].copy_from_slice(pixels);
            }
            left += image.width + gap;
        }
        row
    }

    /// The image as a PNG file with 8 bits per channel.
    ///
    /// # Panics
    /// If the image has no pixels, or not as many as its sides say.
    pub fn png(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width as u32, self.height as u32);
        encoder.set_color(Self::COLOUR_TYPE);
        encoder.set_depth(png::BitDepth::Eight);
        encoder
            .write_header()
            .and_then(|mut writer| writer.write_chunk(png::chunk::IDAT, &self.compressed_rows()))
            .expect("one chunk can hold the pixels of any picture that fits in memory");
        bytes
    }

    /// The rows as a PNG file holds them: each after the number of its filter, together a zlib stream.
    fn compressed_rows(&self) -> Vec<u8> {
        assert!(
            !self.pixels.is_empty() && self.pixels.len() == self.width * self.height,
            "the image has as many pixels as its sides say"
        );
        let row_bytes = CHANNELS * self.width;
        let filter = if self.is_drawing() {
            NO_FILTER
        } else {
            UP_FILTER
        };
        let mut filtered = Vec::with_capacity((1 + row_bytes) * self.height);
        let first = vec![0; row_bytes];
        let mut above = first.as_slice();
        for row in self.pixels.as_flattened().chunks_exact(row_bytes) {
            filtered.push(filter);
            if filter == NO_FILTER {
                filtered.extend_from_slice(row);
            } else {
                filtered.extend(
                    row.iter()
                        .zip(above)
                        .map(|(byte, above)| byte.wrapping_sub(*above)),
                );
            }
            above = row;
        }
        let level = CompressionLvl::new(COMPRESSION_LEVEL).unwrap_or_default();
        let mut compressor = Compressor::new(level);
        let mut compressed = vec![0; compressor.zlib_compress_bound(filtered.len())];
        let length = compressor
            .zlib_compress(&filtered, &mut compressed)
            .expect("the buffer is as long as the bound says");
        compressed.truncate(length);
        compressed
    }

    /// Whether most pixels repeat the one to their left, as in drawings, which differences between rows make no
    /// shorter; in scans they do.
    fn is_drawing(&self) -> bool {
        let repeated = self.pixels.windows(2).filter(|pair| pair[0] == pair[1]);
        2 * repeated.count() > self.pixels.len()
    }
}

impl Image<3> {
    /// The pixels of a PNG file with eight bits per channel; transparent pixels become white.
    ///
    /// # Errors
    /// Why it cannot be read.
    pub fn from_png(png: &[u8]) -> Result<Self, String> {
        let text = |error: png::DecodingError| error.to_string();
        let mut decoder = png::Decoder::new(Cursor::new(png));
        decoder.set_transformations(png::Transformations::normalize_to_color8());
        let mut reader = decoder.read_info().map_err(text)?;
        let size = reader.output_buffer_size().ok_or("too large")?;
        let mut bytes = vec![0; size];
        let info = reader.next_frame(&mut bytes).map_err(text)?;
        bytes.truncate(info.buffer_size());
        let channels = info.color_type.samples();
        let pixel = |p: &[u8]| match *p {
            [grey] => [grey; 3],
            [grey, alpha] => over_white([grey; 3], alpha),
            [red, green, blue, alpha] => over_white([red, green, blue], alpha),
            _ => [p[0], p[1], p[2]],
        };
        Ok(Self {
            width: info.width as usize,
            height: info.height as usize,
            pixels: bytes.chunks_exact(channels).map(pixel).collect(),
        })
    }

    /// The image with `width` pixels in a row and as many rows as keep its shape: each pixel is the mean of what it
    /// covers of the image.
    #[must_use]
    pub fn of_width(&self, width: usize) -> Self {
        let height = (self.height * width + self.width / 2) / self.width.max(1);
        if (width, height) == (self.width, self.height) || self.pixels.is_empty() {
            return self.clone();
        }
        let columns = covered(self.width, width);
        let rows = covered(self.height, height);
        let mut pixels = Vec::with_capacity(width * height);
        for row in &rows {
            for column in &columns {
                let mut sums = [0.0; 3];
                for (y, high) in row {
                    for (x, wide) in column {
                        let pixel = self.pixels[y * self.width + x];
                        for (sum, part) in sums.iter_mut().zip(pixel) {
                            *sum += high * wide * f64::from(part);
                        }
                    }
                }
                pixels.push(sums.map(|sum| sum.round().clamp(0.0, 255.0) as u8));
            }
        }
        Self {
            width,
            height,
            pixels,
        }
    }
}

/// Of each of `to` equal parts of a row of `from` pixels, the pixels that it covers, and their shares of it.
fn covered(from: usize, to: usize) -> Vec<Vec<(usize, f64)>> {
    let ratio = from as f64 / to as f64;
    let part = |number: usize| {
        let (low, high) = (number as f64 * ratio, (number + 1) as f64 * ratio);
        let last = (high.ceil() as usize).min(from);
        (low as usize..last)
            .map(|pixel| {
                let inside = high.min(pixel as f64 + 1.0) - low.max(pixel as f64);
                (pixel, inside.max(0.0) / ratio)
            })
            .collect()
    };
    (0..to).map(part).collect()
}

fn over_white(colour: [u8; 3], alpha: u8) -> [u8; 3] {
    let (own, white) = (u32::from(alpha), u32::from(255 - alpha));
    colour.map(|c| ((u32::from(c) * own + 255 * white) / 255) as u8)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Width, height and bytes of a PNG file.
    pub(crate) fn decoded(png_bytes: &[u8]) -> (usize, usize, Vec<u8>) {
        let mut reader = png::Decoder::new(std::io::Cursor::new(png_bytes))
            .read_info()
            .unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        (info.width as usize, info.height as usize, bytes)
    }

    #[test]
    fn a_png_holds_the_pixels() {
        let mut image = Image::filled(3, 2, [9, 8, 7]);
        image.pixels[4] = [1, 2, 3];
        let (width, height, bytes) = decoded(&image.png());
        assert_eq!((width, height), (3, 2));
        assert_eq!(bytes, image.pixels.as_flattened());
        let grey = Image::filled(1, 2, [5]);
        assert_eq!(decoded(&grey.png()), (1, 2, vec![5, 5]));
        let clear = Image::filled(1, 1, [1, 2, 3, 4]);
        assert_eq!(decoded(&clear.png()), (1, 1, vec![1, 2, 3, 4]));
    }

    /// Drawings and scans are filtered in different ways; both come back as they were.
    #[test]
    fn both_ways_of_filtering_keep_the_pixels() {
        let (width, height) = (61, 37);
        let mut drawing = Image::filled(width, height, [250, 250, 250]);
        drawing.pixels[20 * width..24 * width].fill([10, 20, 200]);
        let mut scan = drawing.clone();
        for (n, pixel) in scan.pixels.iter_mut().enumerate() {
            *pixel = [0, 1, 2].map(|channel| ((n * n + 7 * channel) % 256) as u8);
        }
        assert!(drawing.is_drawing() && !scan.is_drawing());
        for image in [drawing, scan] {
            let file = image.png();
            let (w, h, bytes) = decoded(&file);
            assert_eq!((w, h), (width, height));
            assert_eq!(bytes, image.pixels.as_flattened());
            assert!(file.len() < bytes.len() + 200);
        }
    }

    #[test]
    #[should_panic(expected = "as many pixels as its sides say")]
    fn an_image_of_other_sides_than_pixels_is_refused() {
        let mut image = Image::filled(3, 2, [0]);
        image.pixels.pop();
        image.png();
    }

    #[test]
    fn images_stand_beside_each_other_in_the_middle_of_the_tallest() {
        let row = Image::side_by_side(&[Image::filled(1, 3, [1]), Image::filled(2, 1, [2])], 1);
        assert_eq!((row.width, row.height), (4, 3));
        let expected = [1, 0, 0, 0, 1, 0, 2, 2, 1, 0, 0, 0];
        assert_eq!(row.pixels.as_flattened(), expected);
    }

    #[test]
    fn a_png_is_read_again_and_what_is_clear_is_white() {
        let mut image = Image::filled(3, 2, [9, 8, 7]);
        image.pixels[4] = [1, 2, 3];
        assert_eq!(Image::from_png(&image.png()), Ok(image));
        let grey = Image::from_png(&Image::filled(2, 1, [5]).png());
        assert_eq!(grey, Ok(Image::filled(2, 1, [5; 3])));
        let clear = Image::from_png(&Image::filled(1, 1, [1, 2, 3, 0]).png());
        assert_eq!(clear, Ok(Image::filled(1, 1, [255; 3])));
        assert!(Image::from_png(b"no picture").is_err());
    }

    #[test]
    fn a_reduced_image_has_the_means_of_what_it_covers() {
        let mut image = Image::filled(3, 3, [0; 3]);
        image.pixels[4] = [90, 180, 45];
        let one = image.of_width(1);
        assert_eq!((one.width, one.height), (1, 1));
        assert_eq!(one.pixels, [[10, 20, 5]]);
        let two = image.of_width(2);
        assert_eq!(two.pixels, [[10, 20, 5]; 4]);
        assert_eq!(image.of_width(3), image);
        // Twice as large, each pixel is four.
        let large = image.of_width(6);
        assert_eq!(large.pixels[2 * 6 + 3], [90, 180, 45]);
        assert_eq!(large.pixels[5 * 6 + 5], [0; 3]);
    }
}
