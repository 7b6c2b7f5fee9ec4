//! The attributes of a data set that the reader needs, and their values.

use super::super::VolumeError;
use super::super::facts::ByteOrder;
use dicom_core::Tag;
use std::collections::BTreeMap;

/// An attribute that the reader needs: its tag, its sequence and its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Attribute {
    /// The sequence whose first item holds the attribute; `None` at the top level.
    sequence: Option<Tag>,
    tag: Tag,
    /// Name and tag for error messages.
    pub name: &'static str,
}

macro_rules! attributes {
    ($($id:ident = $sequence:expr, $group:literal, $element:literal, $name:literal;)*) => {
        $(pub(super) const $id: Attribute = Attribute {
            sequence: $sequence,
            tag: Tag($group, $element),
            name: $name,
        };)*
        /// Every attribute above.
        const WANTED: &[Attribute] = &[$($id),*];
    };
}

const DETECTOR: Option<Tag> = Some(Tag(0x0054, 0x0022));
const REAL_WORLD: Option<Tag> = Some(Tag(0x0040, 0x9096));

attributes! {
    IMAGE_TYPE = None, 0x0008, 0x0008, "Image Type (0008,0008)";
    SOP_CLASS = None, 0x0008, 0x0016, "SOP Class UID (0008,0016)";
    INSTANCE = None, 0x0008, 0x0018, "SOP Instance UID (0008,0018)";
    STUDY_DATE = None, 0x0008, 0x0020, "Study Date (0008,0020)";
    STUDY_TIME = None, 0x0008, 0x0030, "Study Time (0008,0030)";
    ACCESSION_NUMBER = None, 0x0008, 0x0050, "Accession Number (0008,0050)";
    MODALITY = None, 0x0008, 0x0060, "Modality (0008,0060)";
    MANUFACTURER = None, 0x0008, 0x0070, "Manufacturer (0008,0070)";
    REFERRING_PHYSICIAN = None, 0x0008, 0x0090, "Referring Physician's Name (0008,0090)";
    SERIES_DESCRIPTION = None, 0x0008, 0x103e, "Series Description (0008,103E)";
    MODEL_NAME = None, 0x0008, 0x1090, "Manufacturer's Model Name (0008,1090)";
    PATIENT_NAME = None, 0x0010, 0x0010, "Patient's Name (0010,0010)";
    PATIENT_ID = None, 0x0010, 0x0020, "Patient ID (0010,0020)";
    PATIENT_BIRTH_DATE = None, 0x0010, 0x0030, "Patient's Birth Date (0010,0030)";
    PATIENT_SEX = None, 0x0010, 0x0040, "Patient's Sex (0010,0040)";
    SLICE_THICKNESS = None, 0x0018, 0x0050, "Slice Thickness (0018,0050)";
    SPACING_BETWEEN_SLICES = None, 0x0018, 0x0088, "Spacing Between Slices (0018,0088)";
    STUDY = None, 0x0020, 0x000d, "Study Instance UID (0020,000D)";
    SERIES = None, 0x0020, 0x000e, "Series Instance UID (0020,000E)";
    STUDY_ID = None, 0x0020, 0x0010, "Study ID (0020,0010)";
    SERIES_NUMBER = None, 0x0020, 0x0011, "Series Number (0020,0011)";
    POSITION = None, 0x0020, 0x0032, "Image Position (Patient) (0020,0032)";
    ORIENTATION = None, 0x0020, 0x0037, "Image Orientation (Patient) (0020,0037)";
    FRAME_OF_REFERENCE = None, 0x0020, 0x0052, "Frame of Reference UID (0020,0052)";
    POSITION_REFERENCE_INDICATOR = None, 0x0020, 0x1040, "Position Reference Indicator (0020,1040)";
    SAMPLES = None, 0x0028, 0x0002, "Samples per Pixel (0028,0002)";
    NUMBER_OF_FRAMES = None, 0x0028, 0x0008, "Number of Frames (0028,0008)";
    FRAME_POINTER = None, 0x0028, 0x0009, "Frame Increment Pointer (0028,0009)";
    ROWS = None, 0x0028, 0x0010, "Rows (0028,0010)";
    COLUMNS = None, 0x0028, 0x0011, "Columns (0028,0011)";
    PIXEL_SPACING = None, 0x0028, 0x0030, "Pixel Spacing (0028,0030)";
    BITS_ALLOCATED = None, 0x0028, 0x0100, "Bits Allocated (0028,0100)";
    BITS_STORED = None, 0x0028, 0x0101, "Bits Stored (0028,0101)";
    HIGH_BIT = None, 0x0028, 0x0102, "High Bit (0028,0102)";
    PIXEL_REPRESENTATION = None, 0x0028, 0x0103, "Pixel Representation (0028,0103)";
    RESCALE_INTERCEPT = None, 0x0028, 0x1052, "Rescale Intercept (0028,1052)";
    RESCALE_SLOPE = None, 0x0028, 0x1053, "Rescale Slope (0028,1053)";
    RR_INTERVAL_VECTOR = None, 0x0054, 0x0060, "R-R Interval Vector (0054,0060)";
    TIME_SLOT_VECTOR = None, 0x0054, 0x0070, "Time Slot Vector (0054,0070)";
    ENERGY_WINDOW_VECTOR = None, 0x0054, 0x0010, "Energy Window Vector (0054,0010)";
    DETECTOR_VECTOR = None, 0x0054, 0x0020, "Detector Vector (0054,0020)";
    ROTATION_VECTOR = None, 0x0054, 0x0050, "Rotation Vector (0054,0050)";
    SLICE_VECTOR = None, 0x0054, 0x0080, "Slice Vector (0054,0080)";
    DETECTOR_POSITION = DETECTOR, 0x0020, 0x0032, "Image Position (Patient) (0020,0032)";
    DETECTOR_ORIENTATION = DETECTOR, 0x0020, 0x0037, "Image Orientation (Patient) (0020,0037)";
    REAL_WORLD_INTERCEPT = REAL_WORLD, 0x0040, 0x9224, "Real World Value Intercept (0040,9224)";
    REAL_WORLD_SLOPE = REAL_WORLD, 0x0040, 0x9225, "Real World Value Slope (0040,9225)";
}

impl Attribute {
    /// Group and element, as the Frame Increment Pointer names the attribute.
    pub(super) fn pointer(self) -> [u16; 2] {
        [self.tag.0, self.tag.1]
    }

    /// Key of the attribute in [`Attributes`].
    fn key(self) -> (Option<Tag>, Tag) {
        (self.sequence, self.tag)
    }

    /// The needed attribute with `tag` at the top level or in the first item of `sequence`.
    pub(super) fn find(sequence: Option<Tag>, tag: Tag) -> Option<Self> {
        let key = (sequence, tag);
        WANTED.iter().find(|a| a.key() == key).copied()
    }
}

/// `text`, cut to 100 characters for an error message.
pub(super) fn clip(text: &str) -> String {
    const LONGEST: usize = 100;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

/// Values of the needed attributes that the data set contains, as stored bytes.
#[derive(Debug)]
pub(super) struct Attributes {
    /// Name of the file, for error messages.
    pub file: String,
    /// Byte order of the values.
    pub byte_order: ByteOrder,
    values: BTreeMap<(Option<Tag>, Tag), Vec<u8>>,
}

impl Attributes {
    /// No values yet, for the data set of `file`.
    pub(super) fn new(file: &str, byte_order: ByteOrder) -> Self {
        Self {
            file: file.into(),
            byte_order,
            values: BTreeMap::new(),
        }
    }

    /// Stores the bytes of `attribute`.
    pub(super) fn insert(&mut self, attribute: Attribute, value: Vec<u8>) {
        self.values.insert(attribute.key(), value);
    }

    /// The error for an invalid value of `field`. Long values are cut.
    pub(super) fn wrong(&self, field: &'static str, value: &str, reason: String) -> VolumeError {
        VolumeError::Field {
            file: self.file.clone(),
            field,
            value: clip(value),
            reason,
            byte: None,
        }
    }

    /// The error for a required attribute that the data set lacks.
    pub(super) fn missing(&self, attribute: Attribute) -> VolumeError {
        self.wrong(
            attribute.name,
            "missing",
            "the attribute is required".into(),
        )
    }

    fn bytes(&self, attribute: Attribute) -> Option<&[u8]> {
        let value = self.values.get(&attribute.key())?;
        (!value.is_empty()).then_some(value)
    }

    /// The values of a text attribute, which are separated by backslashes; an empty list if the
    /// attribute is absent or empty.
    pub(super) fn texts(&self, attribute: Attribute) -> Vec<String> {
        let text = String::from_utf8_lossy(self.bytes(attribute).unwrap_or_default());
        let parts = text
            .split('\\')
            .map(|p| p.trim_matches(['\0', ' ']).to_owned());
        let parts: Vec<_> = parts.collect();
        match parts.iter().all(String::is_empty) {
            true => Vec::new(),
            false => parts,
        }
    }

    /// The `N` decimal numbers (DS, IS) of an attribute, `None` if it is absent or empty.
    ///
    /// # Errors
    /// [`VolumeError::Field`] for any other count or text.
    pub(super) fn decimals<const N: usize>(
        &self,
        attribute: Attribute,
    ) -> Result<Option<[f64; N]>, VolumeError> {
        let texts = self.texts(attribute);
        if texts.is_empty() {
            return Ok(None);
        }
        let number = |t: &String| t.parse().ok().filter(|v: &f64| v.is_finite());
        let numbers: Option<Vec<f64>> = texts.iter().map(number).collect();
        match numbers.map(<[f64; N]>::try_from) {
            Some(Ok(numbers)) => Ok(Some(numbers)),
            _ => {
                let reason = format!("{N} decimal number(s) expected");
                Err(self.wrong(attribute.name, &texts.join("\\"), reason))
            }
        }
    }

    /// The 16-bit numbers (US, AT) of an attribute; an empty list if it is absent.
    pub(super) fn shorts(&self, attribute: Attribute) -> Vec<u16> {
        let (numbers, _) = self.bytes(attribute).unwrap_or_default().as_chunks::<2>();
        let number = |b: &[u8; 2]| match self.byte_order {
            ByteOrder::Little => u16::from_le_bytes(*b),
            ByteOrder::Big => u16::from_be_bytes(*b),
        };
        numbers.iter().map(number).collect()
    }

    /// The first 16-bit number of a required attribute.
    ///
    /// # Errors
    /// [`VolumeError::Field`] if the attribute is absent.
    pub(super) fn short(&self, attribute: Attribute) -> Result<u16, VolumeError> {
        let number = self.shorts(attribute).first().copied();
        number.ok_or_else(|| self.missing(attribute))
    }

    /// The 64-bit floating-point number (FD) of an attribute, `None` if it is absent.
    pub(super) fn double(&self, attribute: Attribute) -> Option<f64> {
        let bytes = self.bytes(attribute)?.first_chunk()?;
        Some(match self.byte_order {
            ByteOrder::Little => f64::from_le_bytes(*bytes),
            ByteOrder::Big => f64::from_be_bytes(*bytes),
        })
    }
}
