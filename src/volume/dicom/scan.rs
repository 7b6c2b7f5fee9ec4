//! One pass over a data set: collects the needed attributes and finds the pixels.
//!
//! The lazy reader of dicom-rs reports elements, sequences and items one by one without reading
//! their values. The pass keeps the values of needed attributes as bytes (at most one mebibyte
//! each), skips all others and ends at the pixels. Memory and stack stay bounded whatever
//! lengths and depths the file states.

use super::super::VolumeError;
use super::super::facts::ByteOrder;
use super::super::source::Source;
use super::attributes::{Attribute, Attributes};
use super::frames::check_kind;
use super::syntax::Syntax;
use crate::progress::Monitor;
use dicom_core::Tag;
use dicom_core::header::DataElementHeader;
use dicom_encoding::transfer_syntax::Endianness;
use dicom_parser::dataset::LazyDataToken;
use dicom_parser::dataset::lazy_read::LazyDataSetReader;
use dicom_parser::{DynStatefulDecoder, StatefulDecode};

/// Deepest nesting of sequences that is read.
const DEEPEST: usize = 32;

/// Longest value of a needed attribute, bytes.
const LONGEST: u64 = 1 << 20;

/// Tokens between two checks for cancellation.
const TOKENS_PER_CHECK: usize = 4096;

/// Which element holds the pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PixelElement {
    /// Pixel Data (7FE0,0010).
    Integer,
    /// Float Pixel Data (7FE0,0008).
    Float,
    /// Double Float Pixel Data (7FE0,0009).
    Double,
}

/// The needed attributes and the place of the pixels.
#[derive(Debug)]
pub(super) struct Scan {
    /// Values of the needed attributes.
    pub attributes: Attributes,
    /// The element that holds the pixels.
    pub element: PixelElement,
    /// Offset of the first pixel in the unpacked file, bytes.
    pub begin: u64,
    /// Length of the pixel element, bytes.
    pub length: u64,
}

/// Scans the data set that begins at the position of `source`, up to its pixels.
///
/// # Errors
/// [`VolumeError`] for damaged data sets, stated lengths beyond the file's size, sequences nested
/// deeper than [`DEEPEST`], and data sets without pixels.
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
    let mut walk = Walk::new(Attributes::new(&file, byte_order));
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
                    format!(
                        "the transfer syntax {} stores pixels in one piece",
                        ts.name()
                    ),
                ));
            }
            LazyDataToken::SequenceStart { tag, .. } => walk.enter(tag)?,
            LazyDataToken::ItemStart { .. } => walk.next_item(),
            LazyDataToken::SequenceEnd => walk.leave(),
            _ => {}
        }
    }
    // For another kind of object, the kind is the more useful error.
    check_kind(&walk.attributes)?;
    Err(walk.attributes.wrong(
        "Pixel Data (7FE0,0010)",
        "missing",
        "the file contains no image".into(),
    ))
}

/// State of the pass: the open sequences and the values collected so far.
struct Walk {
    attributes: Attributes,
    /// Open sequences from the outermost inward, each with the number of items begun so far.
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
                format!("sequences may be nested at most {DEEPEST} deep"),
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

    /// The kind of pixels if `header` belongs to a pixel element.
    fn pixels(&self, header: &DataElementHeader) -> Option<PixelElement> {
        match (self.path.is_empty(), header.tag) {
            (true, Tag(0x7fe0, 0x0010)) => Some(PixelElement::Integer),
            (true, Tag(0x7fe0, 0x0008)) => Some(PixelElement::Float),
            (true, Tag(0x7fe0, 0x0009)) => Some(PixelElement::Double),
            _ => None,
        }
    }

    /// Reads the value of `header` if its attribute is needed, and skips it otherwise.
    fn take<D: StatefulDecode>(
        &mut self,
        header: &DataElementHeader,
        length: u64,
        decoder: &mut D,
    ) -> Result<dicom_parser::stateful::decode::Result<()>, VolumeError> {
        let wanted = match self.path.as_slice() {
            [] => Attribute::find(None, header.tag),
            [(sequence, 1)] => Attribute::find(Some(*sequence), header.tag),
            _ => None,
        };
        // The caller has checked that the length comes from a 32-bit field.
        let bytes = length as u32;
        let Some(attribute) = wanted else {
            return Ok(decoder.skip_bytes(bytes));
        };
        if length > LONGEST {
            let reason = format!("a value may be at most {LONGEST} bytes long");
            let value = format!("{length} bytes long");
            return Err(self.attributes.wrong(attribute.name, &value, reason));
        }
        let mut value = Vec::new();
        let read = decoder.read_to_vec(bytes, &mut value);
        self.attributes.insert(attribute, value);
        Ok(read)
    }
}
