//! A picture as Secondary Capture Image Storage (PS3.3 A.8.1), in colour.

use super::data_set::DataSet;
use super::{DicomError, SourceScan, Structure};
use dicom_dictionary_std::tags;
use std::io::Cursor;

/// Puts everything that is particular to this object of `scan`; `name` names it in errors, `png` is the picture.
pub(super) fn put(
    scan: &SourceScan,
    structure: Structure,
    name: &'static str,
    png: &[u8],
    set: &mut DataSet,
) -> Result<(), DicomError> {
    let picture = Picture::decode(png).map_err(|reason| DicomError::Picture { name, reason })?;
    scan.put_made(set);
    set.text(tags::IMAGE_TYPE, "DERIVED\\SECONDARY");
    set.text(tags::CONVERSION_TYPE, "SYN");
    set.text(tags::DERIVATION_DESCRIPTION, structure.label);
    set.known(tags::BODY_PART_EXAMINED, Some(structure.body_part));
    set.empty(tags::PATIENT_ORIENTATION);
    // The pictures show the organ and numbers of segments, nothing about the patient.
    set.text(tags::BURNED_IN_ANNOTATION, "NO");
    set.text(tags::LOSSY_IMAGE_COMPRESSION, "00");
    if let Some(images) = scan.images() {
        set.items(tags::SOURCE_IMAGE_SEQUENCE, images.processed());
    }
    set.short(tags::SAMPLES_PER_PIXEL, 3);
    set.text(tags::PHOTOMETRIC_INTERPRETATION, "RGB");
    set.short(tags::PLANAR_CONFIGURATION, 0);
    set.short(tags::ROWS, picture.rows);
    set.short(tags::COLUMNS, picture.columns);
    set.short(tags::BITS_ALLOCATED, 8);
    set.short(tags::BITS_STORED, 8);
    set.short(tags::HIGH_BIT, 7);
    set.short(tags::PIXEL_REPRESENTATION, 0);
    set.bytes(tags::PIXEL_DATA, picture.pixels);
    Ok(())
}

struct Picture {
    rows: u16,
    columns: u16,
    /// Red, green and blue of each pixel.
    pixels: Vec<u8>,
}

impl Picture {
    /// Decodes a PNG file with eight bits per channel; transparent pixels become white.
    fn decode(png: &[u8]) -> Result<Self, String> {
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
        let side = |length: u32| u16::try_from(length).map_err(|_| "too large".to_owned());
        Ok(Self {
            rows: side(info.height)?,
            columns: side(info.width)?,
            pixels: bytes.chunks_exact(channels).flat_map(pixel).collect(),
        })
    }
}

fn over_white(colour: [u8; 3], alpha: u8) -> [u8; 3] {
    let (own, white) = (u32::from(alpha), u32::from(255 - alpha));
    colour.map(|c| ((u32::from(c) * own + 255 * white) / 255) as u8)
}
