//! Sequences of unknown representation in Explicit VR Little Endian.
//!
//! A program that does not know an element writes it with the VR UN. If it is a sequence of undefined
//! length, everything in it is in Implicit VR Little Endian (PS3.5 6.2.2, note 4), whatever the transfer
//! syntax of the file is. [`UnknownSequences`] changes the decoder there and back.

use dicom_core::header::{DataElementHeader, SequenceItemHeader};
use dicom_core::{Tag, VR};
use dicom_encoding::decode::explicit_le::ExplicitVRLittleEndianDecoder;
use dicom_encoding::decode::implicit_le::StandardImplicitVRLittleEndianDecoder;
use dicom_encoding::decode::{DecodeFrom, Result};
use std::cell::Cell;
use std::io::Read;

/// Pixel Data: its undefined length means fragments.
const PIXEL_DATA: Tag = Tag(0x7fe0, 0x0010);

/// A decoder of headers in Explicit VR Little Endian that reads sequences of unknown representation too.
#[derive(Default)]
pub(super) struct UnknownSequences {
    explicit: ExplicitVRLittleEndianDecoder,
    implicit: StandardImplicitVRLittleEndianDecoder,
    /// Open sequences of undefined length, from the outermost of unknown representation on.
    open: Cell<usize>,
}

impl<S: Read> DecodeFrom<S> for UnknownSequences {
    fn decode_header(&self, source: &mut S) -> Result<(DataElementHeader, usize)> {
        let open = self.open.get();
        let (header, read) = match open {
            0 => DecodeFrom::decode_header(&self.explicit, source)?,
            _ => DecodeFrom::decode_header(&self.implicit, source)?,
        };
        let unknown = header.vr == VR::UN && header.tag != PIXEL_DATA;
        if header.len.is_undefined() && (open > 0 || unknown) {
            self.open.set(open + 1);
        }
        Ok((header, read))
    }

    fn decode_item_header(&self, source: &mut S) -> Result<SequenceItemHeader> {
        let item = DecodeFrom::decode_item_header(&self.explicit, source)?;
        if item == SequenceItemHeader::SequenceDelimiter {
            self.open.set(self.open.get().saturating_sub(1));
        }
        Ok(item)
    }

    fn decode_tag(&self, source: &mut S) -> Result<Tag> {
        DecodeFrom::decode_tag(&self.explicit, source)
    }
}
