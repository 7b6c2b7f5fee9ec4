//! The pass over a data set that is written here.

use super::attributes::{PIXEL_SPACING, ROWS, SOP_CLASS};
use super::bytes::InMemory;
use super::scan::{self, PixelElement, PixelPlace};
use super::syntax::Syntax;
use super::{ReadError, kind::Kind};
use crate::write::data_set::DataSet;
use dicom_dictionary_std::{tags, uids};

/// A CT slice of two pixels.
fn slice() -> Vec<u8> {
    let mut set = DataSet::new();
    set.text(tags::SOP_CLASS_UID, uids::CT_IMAGE_STORAGE);
    set.text(tags::SOP_INSTANCE_UID, "1.2.3");
    set.short(tags::ROWS, 1);
    set.short(tags::COLUMNS, 2);
    set.decimals(tags::PIXEL_SPACING, &[2.0, 1.5]);
    set.bytes(tags::PIXEL_DATA, vec![7, 9]);
    set.file().unwrap()
}

#[test]
fn what_is_written_is_read() {
    let bytes = slice();
    let syntax = Syntax::new("slice.dcm", &bytes).unwrap();
    let mut source = InMemory::new("slice.dcm", &bytes, syntax.data_set);
    let scan = scan::scan(&mut source, &syntax, &|| true).unwrap();
    let a = &scan.attributes;
    assert_eq!(a.text(SOP_CLASS).as_deref(), Some(uids::CT_IMAGE_STORAGE));
    assert_eq!(a.short(ROWS), Ok(1));
    assert_eq!(a.decimals(PIXEL_SPACING), Ok(Some([2.0, 1.5])));
    assert_eq!(
        (scan.kind, scan.element),
        (Kind::Slice, PixelElement::Integer)
    );
    let PixelPlace::Whole { begin, length } = scan.pixels else {
        panic!("{:?}", scan.pixels);
    };
    assert_eq!((begin, length), (bytes.len() as u64 - 2, 2));
}

#[test]
fn a_cut_off_file_is_refused_and_a_stopped_pass_ends() {
    let bytes = slice();
    let syntax = Syntax::new("slice.dcm", &bytes).unwrap();
    let cut = &bytes[..bytes.len() - 1];
    let mut source = InMemory::new("slice.dcm", cut, syntax.data_set);
    let error = scan::scan(&mut source, &syntax, &|| true).unwrap_err();
    let needed = bytes.len() as u64;
    let expected = ReadError::Truncated {
        file: "slice.dcm".into(),
        needed,
        found: needed - 1,
    };
    assert_eq!(error, expected);

    // The pass asks after so many tokens.
    let mut set = DataSet::new();
    set.text(tags::SOP_CLASS_UID, uids::CT_IMAGE_STORAGE);
    set.text(tags::SOP_INSTANCE_UID, "1.2.3");
    set.items(tags::SOURCE_IMAGE_SEQUENCE, vec![DataSet::new(); 4096]);
    let bytes = set.file().unwrap();
    let mut source = InMemory::new("slice.dcm", &bytes, syntax.data_set);
    let stopped = scan::attributes(&mut source, &syntax, &|| false);
    assert_eq!(stopped.unwrap_err(), ReadError::Stopped);
}
