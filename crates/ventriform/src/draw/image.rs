//! Pixels, and the one PNG encoder.

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
            .and_then(|mut writer| writer.write_image_data(self.pixels.as_flattened()))
            .expect("the image has as many pixels as its sides say");
        bytes
    }
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

    #[test]
    fn images_stand_beside_each_other_in_the_middle_of_the_tallest() {
        let row = Image::side_by_side(&[Image::filled(1, 3, [1]), Image::filled(2, 1, [2])], 1);
        assert_eq!((row.width, row.height), (4, 3));
        let expected = [1, 0, 0, 0, 1, 0, 2, 2, 1, 0, 0, 0];
        assert_eq!(row.pixels.as_flattened(), expected);
    }
}
