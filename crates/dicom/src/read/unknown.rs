//! Elements of unknown representation in Explicit VR.
//!
//! A program that does not know an element writes it with the VR UN. Its value is in Implicit VR Little
//! Endian (PS3.5 6.2.2), whatever the transfer syntax of the file is: a single value in Little Endian, and a
//! sequence, of defined or of undefined length, with everything in it. [`UnknownSequences`] changes the
//! decoder there and back, and says of each value in which order its bytes are.
//!
//! An element of undefined length is a sequence. One of defined length is taken for a sequence if it is one
//! that is read ([`is_path`]) and begins as a sequence does; otherwise it stays bytes. Some writers keep the
//! items in Explicit VR: those whose first element has the VR that the dictionary gives it.

use super::attributes::is_path;
use super::bytes::Bytes;
use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::header::{DataElementHeader, Length, SequenceItemHeader};
use dicom_core::{Tag, VR};
use dicom_dictionary_std::{StandardDataDictionary, tags};
use dicom_encoding::decode::implicit_le::StandardImplicitVRLittleEndianDecoder;
use dicom_encoding::decode::{DecodeFrom, Result};
use std::cell::Cell;
use std::rc::Rc;

/// Group of items and their delimiters, which have no VR.
const ITEM_GROUP: u16 = 0xfffe;

/// Begin of an item in Little Endian: its tag.
const ITEM_START: [u8; 4] = [0xfe, 0xff, 0x00, 0xe0];

/// Bytes that show how the items of a sequence are encoded: an item's header, a tag and a VR.
const EXAMINED_BYTES: usize = 14;

/// What elements are decoded from.
type Input<'a> = &'a mut (dyn Bytes + 'a);

/// A decoder of headers in Explicit VR that reads elements of unknown representation too.
#[derive(Default)]
pub struct UnknownSequences<D> {
    explicit: D,
    implicit: StandardImplicitVRLittleEndianDecoder,
    place: Cell<Place>,
    little: Rc<Cell<bool>>,
}

/// Whether what follows lies in a sequence of unknown representation.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
enum Place {
    #[default]
    Outside,
    /// In one that ends at this byte of the file.
    Until(u64),
    /// In one of undefined length, with so many sequences of undefined length open.
    Open(usize),
}

/// The encoding of the items of a sequence.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Items {
    Implicit,
    Explicit,
    /// They are no items.
    None,
}

impl<D> UnknownSequences<D> {
    /// Whether the value of the header that was read last is in Little Endian whatever the file is in.
    pub fn little(&self) -> Rc<Cell<bool>> {
        Rc::clone(&self.little)
    }

    /// Leaves the sequence that ends before `position`.
    fn settle(&self, position: u64) {
        if let Place::Until(end) = self.place.get()
            && position >= end
        {
            self.place.set(Place::Outside);
        }
    }

    /// The header of an element of unknown representation, whose value begins at the position of `source`.
    fn unknown(&self, header: DataElementHeader, source: &mut dyn Bytes) -> DataElementHeader {
        let Some(length) = header.len.get() else {
            if items(source) != Items::Explicit {
                self.place.set(Place::Open(1));
            }
            return header;
        };
        if !is_path(header.tag) || !is_sequence(header.tag) {
            return header;
        }
        let found = if length == 0 {
            Items::Explicit
        } else {
            items(source)
        };
        match found {
            Items::None => return header,
            Items::Explicit => {}
            Items::Implicit => {
                let end = source.position().saturating_add(u64::from(length));
                self.place.set(Place::Until(end));
            }
        }
        DataElementHeader::new(header.tag, VR::SQ, Length(length))
    }
}

/// Whether the standard makes the element a sequence.
fn is_sequence(tag: Tag) -> bool {
    let entry = StandardDataDictionary.by_tag(tag);
    entry.is_some_and(|entry| entry.vr().exact() == Some(VR::SQ))
}

/// How the items that follow in `source` are encoded, as far as their beginning shows it.
fn items(source: &mut dyn Bytes) -> Items {
    let start = source.peek(EXAMINED_BYTES).unwrap_or_default();
    if !start.starts_with(&ITEM_START) {
        return Items::None;
    }
    let Some([g0, g1, e0, e1, vr @ ..]) = start.get(8..).and_then(<[u8]>::first_chunk::<6>) else {
        return Items::Implicit;
    };
    let tag = Tag(
        u16::from_le_bytes([*g0, *g1]),
        u16::from_le_bytes([*e0, *e1]),
    );
    let entry = StandardDataDictionary.by_tag(tag);
    let stated = VR::from_binary(*vr);
    if stated.is_some() && entry.map(|entry| entry.vr().relaxed()) == stated {
        Items::Explicit
    } else {
        Items::Implicit
    }
}

impl<'a, D: DecodeFrom<Input<'a>>> DecodeFrom<Input<'a>> for UnknownSequences<D> {
    fn decode_header(&self, source: &mut Input<'a>) -> Result<(DataElementHeader, usize)> {
        self.settle(source.position());
        let place = self.place.get();
        if place == Place::Outside {
            let (header, read) = self.explicit.decode_header(source)?;
            let unknown = header.vr == VR::UN && header.tag.group() != ITEM_GROUP;
            self.little.set(unknown);
            // Its undefined length means fragments.
            let encapsulated = header.tag == tags::PIXEL_DATA && header.len.is_undefined();
            if !unknown || encapsulated {
                return Ok((header, read));
            }
            return Ok((self.unknown(header, &mut **source), read));
        }
        let (header, read) = DecodeFrom::decode_header(&self.implicit, source)?;
        self.little.set(true);
        if let Place::Open(open) = place
            && header.len.is_undefined()
        {
            self.place.set(Place::Open(open + 1));
        }
        Ok((header, read))
    }

    fn decode_item_header(&self, source: &mut Input<'a>) -> Result<SequenceItemHeader> {
        self.settle(source.position());
        match self.place.get() {
            Place::Outside => self.explicit.decode_item_header(source),
            Place::Until(_) => DecodeFrom::decode_item_header(&self.implicit, source),
            Place::Open(open) => {
                let item = DecodeFrom::decode_item_header(&self.implicit, source)?;
                if item == SequenceItemHeader::SequenceDelimiter {
                    self.place.set(match open {
                        0 | 1 => Place::Outside,
                        more => Place::Open(more - 1),
                    });
                }
                Ok(item)
            }
        }
    }

    fn decode_tag(&self, source: &mut Input<'a>) -> Result<Tag> {
        self.settle(source.position());
        match self.place.get() {
            Place::Outside => self.explicit.decode_tag(source),
            _ => DecodeFrom::decode_tag(&self.implicit, source),
        }
    }
}
