//! A picture as Secondary Capture Image Storage (PS3.3 A.8.1), in colour.

use super::{DicomError, SourceScan, Structure};
use crate::image::draw::Image;
use crate::results::report::DrawnPage;
use ventriform_dicom::tags;
use ventriform_dicom::write::data_set::DataSet;
use ventriform_dicom::write::image::PixelFormat;

/// The pixels of a PNG file of an object; `name` names the object in errors.
///
/// # Errors
/// [`DicomError::Picture`].
pub(super) fn decoded(name: &'static str, png: &[u8]) -> Result<Image<3>, DicomError> {
    Image::from_png(png).map_err(|reason| DicomError::Picture { name, reason })
}

/// A picture that shows the organ and numbers of segments, nothing about the patient.
pub(super) fn anonymous(image: Image<3>) -> DrawnPage {
    DrawnPage {
        image,
        is_identified: false,
    }
}

/// Puts everything that is particular to this object of `scan`; `name` names it in errors, `picture` is what it shows.
///
/// # Errors
/// [`DicomError::Picture`] if the picture has more rows or columns than an image may have.
pub(super) fn put(
    scan: &SourceScan,
    structure: Structure,
    name: &'static str,
    picture: DrawnPage,
    set: &mut DataSet,
) -> Result<(), DicomError> {
    let DrawnPage {
        image,
        is_identified,
    } = picture;
    let side = |length: usize| {
        u16::try_from(length).map_err(|_| DicomError::Picture {
            name,
            reason: format!("{length} rows or columns are more than 65535"),
        })
    };
    let (rows, columns) = (side(image.height)?, side(image.width)?);
    scan.put_made(set);
    set.text(tags::IMAGE_TYPE, "DERIVED\\SECONDARY");
    set.text(tags::CONVERSION_TYPE, "SYN");
    set.text(tags::DERIVATION_DESCRIPTION, structure.label);
    set.known(tags::BODY_PART_EXAMINED, Some(structure.body_part));
    set.empty(tags::PATIENT_ORIENTATION);
    let burned_in = if is_identified { "YES" } else { "NO" };
    set.text(tags::BURNED_IN_ANNOTATION, burned_in);
    set.text(tags::LOSSY_IMAGE_COMPRESSION, "00");
    scan.put_sources(set);
    let format = PixelFormat {
        rows,
        columns,
        samples: 3,
        photometric: "RGB",
        bits: 8,
    };
    format.put(set);
    set.bytes(tags::PIXEL_DATA, image.pixels.into_flattened());
    Ok(())
}
