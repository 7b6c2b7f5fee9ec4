//! One pass over a data set: collects the needed attributes and finds the pixels.
//!
//! The lazy reader of dicom-rs reports elements, sequences and items one by one without reading
//! their values. The pass keeps the values of needed attributes as bytes (at most one mebibyte
//! each), skips all others and ends at the pixels. Memory and stack stay bounded whatever
//! lengths and depths the file states.

use super::ReadError;
use super::attributes::{Attribute, Attributes, IMAGE_TYPE, clip};
use super::bytes::Bytes;
use super::kind::{self, Kind};
use super::real_world::{Item, MAPPING_NAME, Part, Stated};
use super::representation;
use super::syntax::Syntax;
use super::unknown::UnknownSequences;
use crate::codec::Compression;
use dicom_core::header::DataElementHeader;
use dicom_core::{Tag, VR};
use dicom_dictionary_std::tags;
use dicom_encoding::decode::explicit_be::ExplicitVRBigEndianDecoder;
use dicom_encoding::decode::explicit_le::ExplicitVRLittleEndianDecoder;
use dicom_encoding::text::SpecificCharacterSet;
use dicom_encoding::transfer_syntax::{DynDecoder, Endianness};
use dicom_parser::dataset::LazyDataToken;
use dicom_parser::dataset::lazy_read::LazyDataSetReader;
use dicom_parser::{DynStatefulDecoder, StatefulDecode, StatefulDecoder};
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;

/// Deepest nesting of sequences that is read.
const MAX_SEQUENCE_DEPTH: usize = 32;

/// Longest value of a needed attribute, bytes.
const MAX_VALUE_BYTES: u64 = 1 << 20;

/// Most pieces of compressed pixels in one file.
const MOST_FRAGMENTS: usize = 1 << 18;

/// Tokens between two checks for cancellation.
const TOKENS_PER_CHECK: usize = 4096;

/// Which element holds the pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PixelElement {
    /// Pixel Data (7FE0,0010).
    Integer,
    /// Float Pixel Data (7FE0,0008).
    Float,
    /// Double Float Pixel Data (7FE0,0009).
    Double,
}

/// The needed attributes and the place of the pixels.
#[derive(Debug)]
pub struct Scan {
    /// Values of the needed attributes.
    pub attributes: Attributes,
    /// The kind of the object.
    pub kind: Kind,
    /// The element that holds the pixels.
    pub element: PixelElement,
    /// Whether the value representation of the pixels is OW.
    pub words: bool,
    /// Byte order of the pixels in one piece.
    pub byte_order: Endianness,
    /// Where the pixels are.
    pub pixels: PixelPlace,
}

/// Where the pixels of a file are. Offsets are those of the unpacked file.
#[derive(Debug)]
pub enum PixelPlace {
    /// In one piece of `length` bytes from byte `begin` on.
    Whole {
        /// Offset of the first byte.
        begin: u64,
        /// Length, bytes.
        length: u64,
    },
    /// In fragments, of which the first item, the Basic Offset Table, is kept apart.
    Fragments {
        /// The Basic Offset Table: where each frame begins after it.
        offsets: Vec<u32>,
        /// The fragments in their order.
        fragments: Vec<Fragment>,
    },
}

/// A piece of compressed pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fragment {
    /// Offset of its first byte.
    pub begin: u64,
    /// Its length, bytes.
    pub length: u32,
}

/// Scans the data set that begins at the position of `source`, up to its pixels.
///
/// # Errors
/// [`ReadError`] for damaged data sets, stated lengths beyond the file's size, sequences nested
/// deeper than [`MAX_SEQUENCE_DEPTH`], and data sets without pixels.
pub fn scan(
    source: &mut dyn Bytes,
    syntax: &Syntax,
    goes_on: &dyn Fn() -> bool,
) -> Result<Scan, ReadError> {
    let mut walk = Walk::new(source, syntax);
    let found = walk_to_pixels(source, syntax, &mut walk, goes_on);
    // For another class of object, the class is the more useful error. What else a damaged data set
    // says of itself may be part of the damage.
    let kind = match &found {
        Err(ReadError::Stopped) => None,
        Err(_) if !walk.attributes.names_a_class() => None,
        Err(_) | Ok(None) => match Kind::from_attributes(&walk.attributes) {
            Err(other @ ReadError::NotVolume { .. }) => return Err(other),
            _ => None,
        },
        Ok(Some(_)) => Some(Kind::from_attributes(&walk.attributes)?),
    };
    let (Some(found), Some(kind)) = (found?, kind) else {
        return Err(walk.attributes.wrong(
            "Pixel Data (7FE0,0010)",
            "missing",
            "the file contains no image".into(),
        ));
    };
    Ok(Scan {
        attributes: walk.attributes,
        kind,
        element: found.element,
        words: found.words,
        byte_order: found.byte_order,
        pixels: found.pixels,
    })
}

/// The kind of the object whose data set begins at the position of `source`, which must be one that is read; `None` if
/// it does not tell.
///
/// # Errors
/// As [`Kind::from_attributes`]; for one that names no class, as [`attributes`].
pub fn check_kind(
    source: &mut dyn Bytes,
    syntax: &Syntax,
    goes_on: &dyn Fn() -> bool,
) -> Result<Option<Kind>, ReadError> {
    let mut walk = Walk::new(source, syntax);
    match walk_to_pixels(source, syntax, &mut walk, goes_on) {
        Err(error @ ReadError::Stopped) => Err(error),
        _ if walk.attributes.names_a_class() => Kind::from_attributes(&walk.attributes).map(Some),
        found => found.map(|_| None),
    }
}

/// Reads the needed attributes of a data set of any kind, up to its pixels if it has any.
///
/// # Errors
/// As [`scan`], except that neither the kind of object nor pixels are asked for.
pub fn attributes(
    source: &mut dyn Bytes,
    syntax: &Syntax,
    goes_on: &dyn Fn() -> bool,
) -> Result<Attributes, ReadError> {
    let mut walk = Walk::new(source, syntax);
    walk_to_pixels(source, syntax, &mut walk, goes_on)?;
    Ok(walk.attributes)
}

/// The pixel element.
struct Found {
    element: PixelElement,
    words: bool,
    byte_order: Endianness,
    pixels: PixelPlace,
}

/// As [`find_pixels`]. The parser states invariants of its own by panics, which are errors of the file.
fn walk_to_pixels(
    source: &mut dyn Bytes,
    syntax: &Syntax,
    walk: &mut Walk,
    goes_on: &dyn Fn() -> bool,
) -> Result<Option<Found>, ReadError> {
    let file = source.file().to_owned();
    let found = catch_unwind(AssertUnwindSafe(|| {
        find_pixels(source, syntax, walk, goes_on)
    }));
    found.unwrap_or_else(|_| {
        Err(ReadError::Corrupt {
            file,
            byte: 0,
            reason: "the data set's structure contradicts itself".into(),
        })
    })
}

/// Walks through the data set up to its pixels; `None` if there are none.
fn find_pixels(
    source: &mut dyn Bytes,
    syntax: &Syntax,
    walk: &mut Walk,
    goes_on: &dyn Fn() -> bool,
) -> Result<Option<Found>, ReadError> {
    let file = source.file().to_owned();
    let capacity = source.capacity();
    let ts = syntax.transfer_syntax;
    let damaged = |byte: u64, e: &dyn std::fmt::Display| ReadError::Corrupt {
        file: file.clone(),
        byte,
        reason: e.to_string(),
    };
    let start = source.position();
    let little = &mut walk.little;
    let decoder = decoder(source, syntax, little).map_err(|e| damaged(start, &e))?;
    let mut reader = LazyDataSetReader::new(decoder);
    let mut pixels: Option<Pieces> = None;
    // Whether fragments of a picture inside a sequence, such as an icon, are passed over.
    let mut inner = false;
    let mut tokens = 0_usize;
    let mut byte = start;
    while let Some(token) = reader.advance() {
        tokens += 1;
        if tokens.is_multiple_of(TOKENS_PER_CHECK) && !goes_on() {
            return Err(ReadError::Stopped);
        }
        match token.map_err(|e| damaged(byte, &e))? {
            LazyDataToken::ElementHeader(_) => {}
            LazyDataToken::LazyValue { header, decoder } => {
                byte = decoder.position();
                let Some(length) = header.len.get().map(u64::from) else {
                    let element = format!("the length of {} is undefined", header.tag);
                    return Err(damaged(byte, &element));
                };
                if length > capacity.saturating_sub(byte) {
                    return Err(ReadError::Truncated {
                        file,
                        needed: byte.saturating_add(length),
                        found: capacity,
                    });
                }
                if let Some(element) = walk.pixels(&header) {
                    if syntax.compression != Compression::None {
                        return Err(walk.attributes.wrong(
                            "Pixel Data (7FE0,0010)",
                            "in one piece",
                            format!(
                                "the transfer syntax {} stores pixels in fragments",
                                ts.name()
                            ),
                        ));
                    }
                    return Ok(Some(Found {
                        element,
                        words: header.vr == VR::OW,
                        byte_order: if walk.little.get() {
                            Endianness::Little
                        } else {
                            walk.attributes.byte_order
                        },
                        pixels: PixelPlace::Whole {
                            begin: byte,
                            length,
                        },
                    }));
                }
                let kept = walk.take(&header, length, decoder)?;
                kept.map_err(|e| damaged(byte, &e))?;
            }
            LazyDataToken::LazyItemValue { len, decoder } => {
                byte = decoder.position();
                let end = byte.saturating_add(u64::from(len));
                if end > capacity {
                    return Err(ReadError::Truncated {
                        file,
                        needed: end,
                        found: capacity,
                    });
                }
                let done = match &mut pixels {
                    Some(pieces) => pieces.take(byte, len, decoder),
                    None => decoder.skip_bytes(len),
                };
                done.map_err(|e| damaged(byte, &e))?;
                if pixels.as_ref().is_some_and(Pieces::are_too_many) {
                    return Err(walk.attributes.wrong(
                        "Pixel Data (7FE0,0010)",
                        "in more fragments",
                        format!("at most {MOST_FRAGMENTS} fragments are read"),
                    ));
                }
            }
            LazyDataToken::PixelSequenceStart if !walk.path.is_empty() => inner = true,
            LazyDataToken::SequenceEnd if inner => inner = false,
            LazyDataToken::ItemStart { .. } if inner => {}
            LazyDataToken::PixelSequenceStart => {
                if syntax.compression == Compression::None {
                    return Err(walk.attributes.wrong(
                        "Pixel Data (7FE0,0010)",
                        "in fragments",
                        format!(
                            "the transfer syntax {} stores pixels in one piece",
                            ts.name()
                        ),
                    ));
                }
                pixels = Some(Pieces::default());
            }
            LazyDataToken::SequenceEnd if pixels.is_some() => break,
            // Each item is either the offset table or a fragment.
            LazyDataToken::ItemStart { len } if pixels.is_some() => {
                if let Some(pieces) = &mut pixels
                    && len.get() == Some(0)
                {
                    pieces.empty();
                }
            }
            LazyDataToken::SequenceStart { tag, .. } => walk.enter(tag)?,
            LazyDataToken::ItemStart { .. } => walk.next_item(),
            LazyDataToken::SequenceEnd => walk.leave(),
            _ => {}
        }
    }
    let pieces = pixels.filter(|pieces| !pieces.fragments.is_empty());
    Ok(pieces.map(|pieces| Found {
        element: PixelElement::Integer,
        words: false,
        byte_order: Endianness::Little,
        pixels: PixelPlace::Fragments {
            offsets: pieces.offsets,
            fragments: pieces.fragments,
        },
    }))
}

/// A decoder of what follows in `source`. In explicit VR, `little` becomes what says of every header whether
/// its value is in Little Endian whatever the file is in.
fn decoder<'a>(
    source: &'a mut (dyn Bytes + 'a),
    syntax: &Syntax,
    little: &mut Rc<Cell<bool>>,
) -> dicom_parser::stateful::decode::Result<DynStatefulDecoder<&'a mut (dyn Bytes + 'a)>> {
    let (ts, start) = (syntax.transfer_syntax, source.position());
    let headers: DynDecoder<&'a mut (dyn Bytes + 'a)> = if syntax.is_implicit() {
        return DynStatefulDecoder::new_with_ts(source, ts, start);
    } else if ts.endianness() == Endianness::Big {
        let headers = UnknownSequences::<ExplicitVRBigEndianDecoder>::default();
        *little = headers.little();
        Box::new(headers)
    } else {
        let headers = UnknownSequences::<ExplicitVRLittleEndianDecoder>::default();
        *little = headers.little();
        Box::new(headers)
    };
    let text = SpecificCharacterSet::default();
    let values = ts.basic_decoder();
    Ok(StatefulDecoder::new_with_position(
        source, headers, values, text, start,
    ))
}

/// The fragments of the pixels found so far.
#[derive(Default)]
struct Pieces {
    /// Whether the first item, the Basic Offset Table, has been seen.
    begun: bool,
    offsets: Vec<u32>,
    fragments: Vec<Fragment>,
}

impl Pieces {
    /// Adds an item without content.
    fn empty(&mut self) {
        self.begun = true;
    }

    /// Adds the item of `length` bytes at `begin`, which `decoder` is about to read.
    fn take<D: StatefulDecode>(
        &mut self,
        begin: u64,
        length: u32,
        decoder: &mut D,
    ) -> dicom_parser::stateful::decode::Result<()> {
        let table = !std::mem::replace(&mut self.begun, true);
        if !table {
            self.fragments.push(Fragment { begin, length });
            return decoder.skip_bytes(length);
        }
        // A longer table belongs to more frames than are read, and is not needed.
        if u64::from(length) > MAX_VALUE_BYTES {
            return decoder.skip_bytes(length);
        }
        let mut bytes = Vec::new();
        decoder.read_to_vec(length, &mut bytes)?;
        let (offsets, _) = bytes.as_chunks::<4>();
        self.offsets = offsets.iter().map(|b| u32::from_le_bytes(*b)).collect();
        Ok(())
    }

    fn are_too_many(&self) -> bool {
        self.fragments.len() > MOST_FRAGMENTS
    }
}

/// State of the pass: the open sequences and the values collected so far.
struct Walk {
    attributes: Attributes,
    /// Open sequences from the outermost inward, each with the number of items begun so far.
    path: Vec<(Tag, usize)>,
    /// Whether the value of the last header is in Little Endian whatever the file is in.
    little: Rc<Cell<bool>>,
}

impl Walk {
    /// At the start of the data set of `source`.
    fn new(source: &dyn Bytes, syntax: &Syntax) -> Self {
        let byte_order = syntax.transfer_syntax.endianness();
        let mut attributes = Attributes::new(source.file(), byte_order);
        attributes.media_class.clone_from(&syntax.media_class);
        Self {
            attributes,
            path: Vec::new(),
            little: Rc::default(),
        }
    }

    fn enter(&mut self, tag: Tag) -> Result<(), ReadError> {
        self.path.push((tag, 0));
        if self.path.len() > MAX_SEQUENCE_DEPTH {
            Err(self.attributes.wrong(
                "depth of sequences",
                &self.path.len().to_string(),
                format!("sequences may be nested at most {MAX_SEQUENCE_DEPTH} deep"),
            ))
        } else {
            Ok(())
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
            (true, tags::PIXEL_DATA) => Some(PixelElement::Integer),
            (true, tags::FLOAT_PIXEL_DATA) => Some(PixelElement::Float),
            (true, tags::DOUBLE_FLOAT_PIXEL_DATA) => Some(PixelElement::Double),
            _ => None,
        }
    }

    /// Reads the value of `header` if its attribute is needed, and skips it otherwise.
    fn take<D: StatefulDecode>(
        &mut self,
        header: &DataElementHeader,
        length: u64,
        decoder: &mut D,
    ) -> Result<dicom_parser::stateful::decode::Result<()>, ReadError> {
        // The caller has checked that the length comes from a 32-bit field.
        let bytes = length as u32;
        if let Some((item, part)) = Item::find(&self.path, header.tag) {
            return self.take_mapping(item, part, header, length, decoder);
        }
        let Some((attribute, frame)) = Attribute::find(&self.path, header.tag) else {
            return Ok(decoder.skip_bytes(bytes));
        };
        if !self.attributes.has_room(length) {
            let reason = "the file describes more frames than are read".into();
            return Err(self
                .attributes
                .wrong(attribute.name, "given too often", reason));
        }
        if length > MAX_VALUE_BYTES {
            let reason = format!("a value may be at most {MAX_VALUE_BYTES} bytes long");
            let value = format!("{length} bytes long");
            return Err(self.attributes.wrong(attribute.name, &value, reason));
        }
        let mut value = Vec::new();
        let read = decoder.read_to_vec(bytes, &mut value);
        let (value, changed) = self.settled(header, value).map_err(|own| {
            let stated = format!("of the value representation {}", header.vr);
            let reason = format!("expected {own}, and the value cannot be converted");
            self.attributes.wrong(attribute.name, &stated, reason)
        })?;
        if changed {
            self.attributes.put_right(attribute, header.vr);
        }
        let value = self.unlisted(attribute, value);
        self.attributes.insert(attribute, frame, value);
        Ok(read)
    }

    /// `value`, of an Image Type that is one text its values.
    fn unlisted(&mut self, attribute: Attribute, value: Vec<u8>) -> Vec<u8> {
        if attribute != IMAGE_TYPE {
            return value;
        }
        match kind::unlisted(&String::from_utf8_lossy(&value)) {
            Some(values) => {
                self.attributes.note(format!(
                    "{} has one value, which looks like a list: it is read as {}.",
                    IMAGE_TYPE.name,
                    clip(&values)
                ));
                values.into_bytes()
            }
            None => value,
        }
    }

    /// `value` in the representation of its attribute, and whether that changed it.
    fn settled(&self, header: &DataElementHeader, value: Vec<u8>) -> Result<(Vec<u8>, bool), VR> {
        let (order, little) = (self.attributes.byte_order, self.little.get());
        representation::settled(header.tag, header.vr, value, order, little)
    }

    /// Reads what an element says of an item of the Real World Value Mapping.
    fn take_mapping<D: StatefulDecode>(
        &mut self,
        item: Item,
        part: Part,
        header: &DataElementHeader,
        length: u64,
        decoder: &mut D,
    ) -> Result<dicom_parser::stateful::decode::Result<()>, ReadError> {
        let bytes = length as u32;
        if !self.attributes.mappings.has_room() {
            let reason = "the file describes more frames than are read".into();
            return Err(self
                .attributes
                .wrong(MAPPING_NAME, "given too often", reason));
        }
        if part.is_long() {
            let count = Stated::Count(bytes as usize / size_of::<f64>());
            self.attributes.mappings.insert(item, part, count);
            return Ok(decoder.skip_bytes(bytes));
        }
        if length > MAX_VALUE_BYTES {
            return Ok(decoder.skip_bytes(bytes));
        }
        let mut value = Vec::new();
        let read = decoder.read_to_vec(bytes, &mut value);
        let settled = self.settled(header, value);
        let (value, _) = settled.map_err(|own| {
            let stated = format!("of the value representation {}", header.vr);
            let reason = format!("expected {own}, and the value cannot be converted");
            self.attributes.wrong(MAPPING_NAME, &stated, reason)
        })?;
        // Bounds have the sign of the pixels, in whose representation they are written.
        let vr = match (representation::standard(header.tag), header.vr) {
            (VR::US, VR::SS) => VR::SS,
            (own, _) => own,
        };
        if let Some(stated) = Stated::new(&value, vr, self.attributes.byte_order) {
            self.attributes.mappings.insert(item, part, stated);
        }
        Ok(read)
    }
}
