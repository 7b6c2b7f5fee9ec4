//! The header of a DICOM object, without reading its pixels: for those who receive objects and
//! have to tell which belong together.

use super::super::VolumeError;
use super::super::limits::ReadLimits;
use super::super::source::VolumeFile;
use super::one_scan::ScanStatement;
use super::stored::StoredDataSet;
use super::timing;
use crate::base::progress::Monitor;
use crate::base::text::hex;
use sha2::{Digest, Sha256};
use std::fmt;
use ventriform_dicom::read::ReadError;
use ventriform_dicom::read::attributes::{
    ACQUISITION_TIME, Attribute, Attributes, COLUMNS, IMAGE_TYPE, MODALITY, NUMBER_OF_FRAMES,
    ORIENTATION, PIXEL_SPACING, ROWS, SERIES_DESCRIPTION, SERIES_UID, SLICE_THICKNESS, SOP_CLASS,
    SOP_INSTANCE, STUDY_DESCRIPTION, STUDY_UID,
};
use ventriform_dicom::read::kind::{self, Kind};
use ventriform_dicom::read::{scan, syntax};

/// Longest UID (PS3.5, 9.1).
const LONGEST_UID: usize = 64;

/// Longest deflated data set before its pixels, or without pixels, bytes once inflated. Deflate packs up to a
/// thousand to one, and objects with many frames have a few megabytes there.
const LONGEST_INFLATED_BYTES: u64 = 64 << 20;

/// Identity and kind of one object. This is personal data: `Debug` shows none of it.
#[derive(Clone, PartialEq, Eq)]
pub struct DicomHeader {
    /// SOP Class UID (0008,0016).
    pub sop_class: String,
    /// SOP Instance UID (0008,0018).
    pub sop_instance: String,
    /// Study Instance UID (0020,000D).
    pub study: String,
    /// Series Instance UID (0020,000E).
    pub series: String,
    /// Whether the object is one slice or one gate of its series, and not a volume of its own.
    pub is_part: bool,
    /// What the objects of one gate each have in common, although each gate may be a series of its own: a hash. `None`
    /// if the object does not say that it is one gate of several, or a slice of one.
    pub gates: Option<String>,
    /// Modality (0008,0060).
    pub modality: Option<String>,
    /// The values of Image Type (0008,0008).
    pub image_type: Vec<String>,
    /// Study Description (0008,1030).
    pub study_description: Option<String>,
    /// Offset of the data set in the file, bytes.
    pub data_set: u64,
}

impl fmt::Debug for DicomHeader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DicomHeader").finish_non_exhaustive()
    }
}

/// Reads the header of the object in `file`, which must be whole up to the end of its pixels.
///
/// # Errors
/// [`VolumeError`] if the file is no DICOM object, is damaged or cut off, has a transfer syntax that is
/// not read, lacks one of its four UIDs, or has more than 64 MiB of deflated data before its pixels.
pub fn read_header(
    file: &VolumeFile,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<DicomHeader, VolumeError> {
    let stored = StoredDataSet::find(file, limits)?;
    let syntax = &stored.syntax;
    let longest = if syntax.deflated {
        let longest = syntax.data_set.saturating_add(LONGEST_INFLATED_BYTES);
        longest.min(limits.unpacked_bytes)
    } else {
        limits.unpacked_bytes
    };
    let mut source = stored.open(file, longest)?;
    let a = scan::attributes(&mut source, syntax, &monitor.goes_on())?;
    let sop_class = uid(&a, SOP_CLASS)?;
    let kind = Kind::from_attributes(&a).ok();
    let is_gate = kind.is_some_and(|kind| {
        timing::is_one_gate(&a, kind) || kind.is_single_slice() && timing::is_slice_of_a_gate(&a)
    });
    let is_part = kind.is_some_and(|kind| {
        let frames = a.decimals::<1>(NUMBER_OF_FRAMES).ok().flatten();
        let is_slice = matches!(kind, Kind::Nuclear { .. }) && frames == Some([1.0]);
        is_slice || timing::is_one_gate(&a, kind)
    });
    Ok(DicomHeader {
        is_part: kind::is_slice_class(&sop_class) || is_part,
        gates: is_gate.then(|| gates_key(&a)),
        sop_class,
        sop_instance: uid(&a, SOP_INSTANCE)?,
        study: uid(&a, STUDY_UID)?,
        series: uid(&a, SERIES_UID)?,
        modality: a.text(MODALITY),
        image_type: a.codes(IMAGE_TYPE),
        study_description: a.prose(STUDY_DESCRIPTION),
        data_set: syntax.data_set,
    })
}

/// A hash of what the headers of all gates of one acquisition have in common: what they say of the scan, the time to
/// the minute, the description without its numbers, and the grid of a slice.
fn gates_key(a: &Attributes) -> String {
    /// Characters of a time of day to the minute.
    const TO_THE_MINUTE: usize = 4;
    let mut hash = Sha256::new();
    let mut add = |text: Option<String>| {
        let text = text.unwrap_or_default();
        hash.update((text.len() as u64).to_le_bytes());
        hash.update(text);
    };
    for (attribute, value) in ScanStatement::from_attributes(a).stated() {
        add(Some(attribute.to_owned()));
        add(value.map(|value| match attribute == ACQUISITION_TIME.name {
            true => value
                .chars()
                .filter(char::is_ascii_digit)
                .take(TO_THE_MINUTE)
                .collect(),
            false => value.to_owned(),
        }));
    }
    let description = a.prose(SERIES_DESCRIPTION);
    add(description.map(|text| text.replace(|c: char| c.is_ascii_digit(), "")));
    for attribute in [ROWS, COLUMNS, PIXEL_SPACING, ORIENTATION, SLICE_THICKNESS] {
        add(a.text(attribute));
    }
    hex(&hash.finalize())
}

/// A UID that the object must have. Zeros before a number are accepted: objects are told apart by them all the
/// same, and what is made of such an object does not name it.
fn uid(a: &Attributes, attribute: Attribute) -> Result<String, ReadError> {
    let text = a.text(attribute).ok_or_else(|| a.missing(attribute))?;
    let number = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
    if text.len() <= LONGEST_UID && text.split('.').all(number) {
        Ok(text)
    } else {
        Err(a.wrong(
            attribute.name,
            &text,
            format!("a UID is numbers separated by dots, at most {LONGEST_UID} characters"),
        ))
    }
}

/// UIDs of the SOP classes of objects that can hold slices.
pub fn storage_classes() -> Vec<String> {
    kind::classes().collect()
}

/// UIDs of the transfer syntaxes that are read.
pub fn transfer_syntaxes() -> Vec<&'static str> {
    syntax::read_syntaxes().collect()
}
