//! One pass over a data set: the attributes that matter, and where the pixels stand.
//!
//! dicom-rs' lazy reader tells elements, sequences and items one by one and leaves the values
//! where they are. Values that matter are kept as bytes (a mebibyte at most); all others are
//! skipped, and the pass ends at the pixels. Memory and stack do not grow with what a hostile
//! file claims.

use super::super::VolumeError;
use super::super::facts::ByteOrder;
use super::super::source::Source;
use super::syntax::Syntax;
use crate::progress::Monitor;
use dicom_core::Tag;
use dicom_core::header::DataElementHeader;
use dicom_encoding::transfer_syntax::Endianness;
use dicom_parser::dataset::LazyDataToken;
use dicom_parser::dataset::lazy_read::LazyDataSetReader;
use dicom_parser::{DynStatefulDecoder, StatefulDecode};
use std::collections::BTreeMap;

/// Sequences inside sequences beyond this are refused.
const DEEPEST: usize = 32;

/// No attribute that matters is longer.
const LONGEST: u64 = 1 << 20;

/// Tokens between two looks at the monitor.
const TOKENS_PER_CHECK: usize = 4096;

/// An attribute that matters: its place and name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Attribute {
    /// The sequence whose first item holds it.
    sequence: Option<Tag>,
    tag: Tag,
    /// Name and tag, for messages.
    pub name: &'static str,
}

macro_rules! attributes {
    ($($id:ident = $sequence:expr, $group:literal, $element:literal, $name:literal;)*) => {
        $(pub(super) const $id: Attribute = Attribute {
            sequence: $sequence,
            tag: Tag($group, $element),
            name: $name,
        };)*
        const WANTED: &[Attribute] = &[$($id),*];
    };
}

const DETECTOR: Option<Tag> = Some(Tag(0x0054, 0x0022));
const REAL_WORLD: Option<Tag> = Some(Tag(0x0040, 0x9096));

attributes! {
    IMAGE_TYPE = None, 0x0008, 0x0008, "Image Type (0008,0008)";
    SOP_CLASS = None, 0x0008, 0x0016, "SOP Class UID (0008,0016)";
    MODALITY = None, 0x0008, 0x0060, "Modality (0008,0060)";
    SLICE_THICKNESS = None, 0x0018, 0x0050, "Slice Thickness (0018,0050)";
    SPACING_BETWEEN_SLICES = None, 0x0018, 0x0088, "Spacing Between Slices (0018,0088)";
    POSITION = None, 0x0020, 0x0032, "Image Position (Patient) (0020,0032)";
    ORIENTATION = None, 0x0020, 0x0037, "Image Orientation (Patient) (0020,0037)";
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
    /// The tag as the Frame Increment Pointer names it.
    pub(super) fn pointer(self) -> [u16; 2] {
        [self.tag.0, self.tag.1]
    }

    fn key(self) -> (Tag, Tag) {
        (self.sequence.unwrap_or(TOP), self.tag)
    }
}

/// Stands for "in no sequence".
const TOP: Tag = Tag(0, 0);

/// What the pixels' element holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PixelElement {
    /// Pixel Data (7FE0,0010).
    Integer,
    /// Float Pixel Data (7FE0,0008).
    Float,
    /// Double Float Pixel Data (7FE0,0009).
    Double,
}

/// What was found.
#[derive(Debug)]
pub(super) struct Scan {
    pub attributes: Attributes,
    pub element: PixelElement,
    /// First byte of the first pixel.
    pub begin: u64,
    /// Bytes of all pixels.
    pub length: u64,
}

/// Reads the data set at which `source` stands, up to its pixels.
pub(super) fn scan(
    source: &mut Source,
    syntax: &Syntax,
    monitor: &Monitor,
) -> Result<Scan, VolumeError> {
    let file = source.file().to_owned();
    let capacity = source.capacity();
    let ts = syntax.transfer_syntax;
    let byte_order = match ts.endianness() {
        Endianness::Little => ByteOrder::Little,
        Endianness::Big => ByteOrder::Big,
    };
    let damaged = |byte: u64, e: &dyn std::fmt::Display| VolumeError::Corrupt {
        file: file.clone(),
        byte,
        reason: e.to_string(),
    };
    let start = source.position();
    let decoder = DynStatefulDecoder::new_with(source, ts, Default::default(), start);
    let mut reader = LazyDataSetReader::new(decoder.map_err(|e| damaged(start, &e))?);
    let mut walk = Walk::new(Attributes {
        file: file.clone(),
        byte_order,
        values: BTreeMap::new(),
    });
    let mut tokens = 0_usize;
    let mut byte = start;
    while let Some(token) = reader.advance() {
        tokens += 1;
        if tokens.is_multiple_of(TOKENS_PER_CHECK) {
            monitor.check()?;
        }
        match token.map_err(|e| damaged(byte, &e))? {
            LazyDataToken::ElementHeader(_) => {}
            LazyDataToken::LazyValue { header, decoder } => {
                byte = decoder.position();
                let length = header.len.get().map_or(u64::MAX, u64::from);
                if length > capacity.saturating_sub(byte) {
                    return Err(VolumeError::Truncated {
                        file,
                        needed: byte.saturating_add(length),
                        found: capacity,
                    });
                }
                if let Some(element) = walk.pixels(&header) {
                    return Ok(Scan {
                        attributes: walk.attributes,
                        element,
                        begin: byte,
                        length,
                    });
                }
                let kept = walk.take(&header, length, decoder)?;
                kept.map_err(|e| damaged(byte, &e))?;
            }
            LazyDataToken::LazyItemValue { len, decoder } => {
                decoder.skip_bytes(len).map_err(|e| damaged(byte, &e))?;
            }
            LazyDataToken::PixelSequenceStart => {
                return Err(walk.attributes.wrong(
                    "Pixel Data (7FE0,0010)",
                    "in fragments",
                    format!("{} has none", ts.name()),
                ));
            }
            LazyDataToken::SequenceStart { tag, .. } => walk.enter(tag)?,
            LazyDataToken::ItemStart { .. } => walk.next_item(),
            LazyDataToken::SequenceEnd => walk.leave(),
            _ => {}
        }
    }
    // What the file is matters more than that it shows nothing.
    super::frames::check_kind(&walk.attributes)?;
    Err(walk.attributes.wrong(
        "Pixel Data (7FE0,0010)",
        "missing",
        "there is no image".into(),
    ))
}

/// Where the pass is, and what it has kept.
struct Walk {
    attributes: Attributes,
    /// Open sequences, each with the number of items that have begun.
    path: Vec<(Tag, usize)>,
}

impl Walk {
    fn new(attributes: Attributes) -> Self {
        Self {
            attributes,
            path: Vec::new(),
        }
    }

    fn enter(&mut self, tag: Tag) -> Result<(), VolumeError> {
        self.path.push((tag, 0));
        match self.path.len() > DEEPEST {
            true => Err(self.attributes.wrong(
                "depth of sequences",
                &self.path.len().to_string(),
                format!("sequences inside sequences are read down to {DEEPEST}"),
            )),
            false => Ok(()),
        }
    }

    fn next_item(&mut self) {
        if let Some((_, items)) = self.path.last_mut() {
            *items += 1;
        }
    }

    fn leave(&mut self) {
        self.path.pop();
    }

    /// The kind of pixels that `header` announces, if it does.
    fn pixels(&self, header: &DataElementHeader) -> Option<PixelElement> {
        match (self.path.is_empty(), header.tag) {
            (true, Tag(0x7fe0, 0x0010)) => Some(PixelElement::Integer),
            (true, Tag(0x7fe0, 0x0008)) => Some(PixelElement::Float),
            (true, Tag(0x7fe0, 0x0009)) => Some(PixelElement::Double),
            _ => None,
        }
    }

    /// Keeps the value of `header` if it matters, and skips it if not.
    fn take<D: StatefulDecode>(
        &mut self,
        header: &DataElementHeader,
        length: u64,
        decoder: &mut D,
    ) -> Result<dicom_parser::stateful::decode::Result<()>, VolumeError> {
        let place = match self.path.as_slice() {
            [] => Some((TOP, header.tag)),
            [(sequence, 1)] => Some((*sequence, header.tag)),
            _ => None,
        };
        let wanted = WANTED.iter().find(|a| place == Some(a.key()));
        // Checked against the file's size, which fits into a length of 32 bits here.
        let bytes = length as u32;
        let Some(attribute) = wanted else {
            return Ok(decoder.skip_bytes(bytes));
        };
        if length > LONGEST {
            let reason = format!("no value is longer than {LONGEST} bytes");
            let value = format!("{length} bytes long");
            return Err(self.attributes.wrong(attribute.name, &value, reason));
        }
        let mut value = Vec::new();
        let read = decoder.read_to_vec(bytes, &mut value);
        self.attributes.values.insert(attribute.key(), value);
        Ok(read)
    }
}

/// The beginning of `text`, fit for a message.
pub(super) fn clip(text: &str) -> String {
    const LONGEST: usize = 100;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

/// The attributes that were there, as bytes.
#[derive(Debug)]
pub(super) struct Attributes {
    pub file: String,
    pub byte_order: ByteOrder,
    values: BTreeMap<(Tag, Tag), Vec<u8>>,
}

impl Attributes {
    /// The error for a value that cannot be. Long values are cut: they come from outside.
    pub(super) fn wrong(&self, field: &'static str, value: &str, reason: String) -> VolumeError {
        VolumeError::Field {
            file: self.file.clone(),
            field,
            value: clip(value),
            reason,
            byte: None,
        }
    }

    /// The error for an attribute that must be there.
    pub(super) fn missing(&self, attribute: Attribute) -> VolumeError {
        self.wrong(attribute.name, "missing", "it must be given".into())
    }

    fn bytes(&self, attribute: Attribute) -> Option<&[u8]> {
        let value = self.values.get(&attribute.key())?;
        (!value.is_empty()).then_some(value)
    }

    /// The parts of a text, between backslashes; none where the attribute is absent or empty.
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

    /// `N` decimal numbers (DS, IS), if the attribute is there.
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

    /// The numbers of a list of 16-bit ones (US, AT).
    pub(super) fn shorts(&self, attribute: Attribute) -> Vec<u16> {
        let (numbers, _) = self.bytes(attribute).unwrap_or_default().as_chunks::<2>();
        let number = |b: &[u8; 2]| match self.byte_order {
            ByteOrder::Little => u16::from_le_bytes(*b),
            ByteOrder::Big => u16::from_be_bytes(*b),
        };
        numbers.iter().map(number).collect()
    }

    /// A single 16-bit number that must be there.
    pub(super) fn short(&self, attribute: Attribute) -> Result<u16, VolumeError> {
        let number = self.shorts(attribute).first().copied();
        number.ok_or_else(|| self.missing(attribute))
    }

    /// A binary number of 64 bits (FD).
    pub(super) fn double(&self, attribute: Attribute) -> Option<f64> {
        let bytes = self.bytes(attribute)?.first_chunk()?;
        Some(match self.byte_order {
            ByteOrder::Little => f64::from_le_bytes(*bytes),
            ByteOrder::Big => f64::from_be_bytes(*bytes),
        })
    }
}
