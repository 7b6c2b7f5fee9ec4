//! Text of a data set: whose scan it is, in every way of saying in which characters.

use super::objects::{ct, headers};
use super::*;
use crate::image::volume::{ReadLimits, inspect};

fn file(elements: &Elements) -> VolumeFile {
    VolumeFile::in_memory("scan", Encoding::Explicit.file(elements))
}

fn warnings(elements: &Elements) -> Vec<String> {
    let (limits, quiet) = (ReadLimits::default(), Monitor::silent());
    inspect(&[file(elements)], &limits, &quiet)
        .unwrap()
        .warnings
}

/// A slice whose texts are `name`, and the character sets `terms`.
fn named(terms: &'static str, name: &[u8]) -> Elements {
    let mut padded = name.to_vec();
    padded.resize(name.len().next_multiple_of(2), b' ');
    let mut slice = ct("0", 0);
    slice.insert((0x08, 0x05), ("CS", Text(terms)));
    for (tag, vr) in [
        ((0x08, 0x80), "LO"),
        ((0x08, 0x90), "PN"),
        ((0x08, 0x1030), "LO"),
        ((0x08, 0x103e), "LO"),
        ((0x10, 0x10), "PN"),
        ((0x10, 0x20), "LO"),
        ((0x20, 0x10), "SH"),
        ((0x08, 0x50), "SH"),
        ((0x18, 0x1030), "LO"),
    ] {
        slice.insert(tag, (vr, Bytes(padded.clone())));
    }
    slice
}

#[test]
fn every_text_is_read_in_the_characters_that_the_file_names() {
    let japanese: &[u8] = b"Yamada=\x1b$B;3ED\x1b(B=\x1b$B$d$^$@\x1b(B";
    for (terms, bytes, text) in [
        ("\\ISO 2022 IR 87", japanese, "Yamada=山田=やまだ"),
        ("ISO_IR 100", b"J\xe9r\xf4me", "Jérôme"),
        ("ISO_IR 192", "王^小东".as_bytes(), "王^小东"),
        ("GB18030", b"\xcd\xf5^\xd0\xa1\xb6\xab", "王^小东"),
    ] {
        let slice = named(terms, bytes);
        let found = headers(&[file(&slice)], None);
        for value in [
            found.patient_name,
            found.patient_id,
            found.referring_physician,
            found.study_id,
            found.study_description,
            found.series_description,
            found.accession_number,
            found.protocol_name,
        ] {
            assert_eq!(value.as_deref(), Some(text), "{terms}");
        }
        assert!(found.undecoded.is_empty(), "{terms}");
        assert!(!warnings(&slice).iter().any(|w| w.contains("decoded")));
    }
}

#[test]
fn what_cannot_be_decoded_is_no_value_and_a_warning_without_it() {
    for (terms, bytes) in [
        ("", &b"JANEDOE\xe9"[..]),
        ("ISO_IR 999", b"JANEDOE\xe9"),
        ("ISO_IR 192", b"JANEDOE\xe9"),
        ("ISO_IR 100", b"JANEDOE\x1b[2J"),
        ("\\ISO 2022 IR 87", b"JANEDOE\x1b$B;"),
        ("ISO_IR 100", b"JANEDOE\x9b2J"),
    ] {
        let slice = named(terms, bytes);
        let found = headers(&[file(&slice)], None);
        assert_eq!((found.patient_name, found.patient_id), (None, None));
        for field in [
            "patient_name",
            "patient_id",
            "referring_physician",
            "study_id",
        ] {
            assert!(found.undecoded.iter().any(|lost| lost == field), "{field}");
        }
        let warnings = warnings(&slice);
        let about = |tag: &str| {
            warnings
                .iter()
                .any(|w| w.contains(tag) && w.contains("decoded"))
        };
        assert!(about("(0010,0010)") && about("(0010,0020)"), "{warnings:?}");
        assert!(!warnings.iter().any(|w| w.contains("JANE")), "{warnings:?}");
    }
    let unknown = warnings(&named("ISO_IR 999\u{7f}", b"JANEDOE"));
    assert!(
        unknown.iter().any(|w| w.contains("ISO_IR 999")),
        "{unknown:?}"
    );
}

#[test]
fn an_item_may_name_characters_of_its_own() {
    let mut slices = slices();
    slices.insert((0x08, 0x05), ("CS", Text("ISO_IR 100")));
    let mut tracer = BTreeMap::from([((0x18, 0x31), ("LO", Bytes(b"\xc4t".to_vec())))]);
    let drug = |slices: &Elements, tracer: &Elements| {
        let mut slices = slices.clone();
        slices.insert((0x54, 0x16), ("SQ", Items(vec![tracer.clone()])));
        headers(&[file(&slices)], None).radiopharmaceutical
    };
    assert_eq!(drug(&slices, &tracer).as_deref(), Some("Ät"));
    tracer.insert((0x08, 0x05), ("CS", Text("ISO_IR 126")));
    assert_eq!(drug(&slices, &tracer).as_deref(), Some("Δt"));
}
