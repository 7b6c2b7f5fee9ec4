//! Incomplete and impossible series, wrong transfer syntaxes, and pictures inside sequences.

use super::objects::{ct, enhanced, files};
use super::*;

fn read_files(slices: &[Elements]) -> Result<Reading, VolumeError> {
    let (options, limits) = (ReadOptions::default(), ReadLimits::default());
    read_volume(&files(slices), &options, &limits, &Monitor::silent())
}

/// The words of a refusal of the files in this and in reverse order.
fn refusal(slices: &[Elements]) -> String {
    let forward = read_files(slices).unwrap_err().to_string();
    let reversed: Vec<Elements> = slices.iter().rev().cloned().collect();
    let backward = read_files(&reversed).unwrap_err();
    assert!(matches!(backward, VolumeError::NotOneSeries { .. }));
    forward
}

fn with(mut elements: Elements, given: &[((u16, u16), &'static str, Value)]) -> Elements {
    for (tag, vr, value) in given {
        elements.insert(*tag, (vr, value.clone()));
    }
    elements
}

#[test]
fn series_that_cannot_be_are_refused_by_their_fault() {
    let uid = ((0x08, 0x18), "UI", Text("1.9"));
    let same = ["0", "3", "6"].map(|z| with(ct(z, 0), std::slice::from_ref(&uid)));
    let said = refusal(&same);
    assert!(
        said.contains("0 and 1 have the same SOP Instance UID (0008,0018)"),
        "{said}"
    );
    // The same place and UID, but another picture.
    let said = refusal(&[ct("0", 0), ct("3", 0), ct("3", 1)]);
    assert!(said.contains("same SOP Instance UID"), "{said}");
    let places = ["0", "3", "6"].map(|z| {
        let at = ((0x20, 0x32), "DS", Text("1\\2\\0"));
        with(ct(z, 0), &[at, ((0x20, 0x100), "IS", Text(z))])
    });
    let said = refusal(&places);
    assert!(
        said.contains("all 3 images lie at one place, 0.00 mm"),
        "{said}"
    );
    let five = ((0x54, 0x81), "US", Shorts(vec![5]));
    let cut = ["0", "3", "6"].map(|z| with(ct(z, 0), std::slice::from_ref(&five)));
    let said = refusal(&cut);
    assert!(
        said.contains("Number of Slices (0054,0081) is 5, and they hold 3 slices"),
        "{said}"
    );
    let warnings = read_files(&cut[..1]).unwrap().facts.warnings;
    assert!(
        warnings[0].contains("is 5, and the file holds one"),
        "{warnings:?}"
    );
    assert!(warnings[1].contains("single slice"), "{warnings:?}");
    let images = ((0x20, 0x1002), "IS", Text("44"));
    let part = ["0", "3"].map(|z| with(ct(z, 0), std::slice::from_ref(&images)));
    let warnings = read_files(&part).unwrap().facts.warnings;
    assert!(
        warnings[0].contains("Images in Acquisition (0020,1002) is 44, and 2"),
        "{warnings:?}"
    );
    let slots = ((0x54, 0x71), "US", Shorts(vec![8]));
    let one = ["0", "3"].map(|z| with(ct(z, 0), std::slice::from_ref(&slots)));
    let warnings = read_files(&one).unwrap().facts.warnings;
    assert!(warnings[0].contains("states 8 volumes"), "{warnings:?}");
}

#[test]
fn stress_and_rest_together_are_refused_by_their_names() {
    let named = |z, uid, number, text| {
        let series = [
            ((0x08, 0x103e), "LO", Text(text)),
            ((0x20, 0x0e), "UI", Text(uid)),
            ((0x20, 0x11), "IS", Text(number)),
        ];
        with(ct(z, 0), &series)
    };
    let said = refusal(&[
        named("0", "1.7", "3", "STRESS AC"),
        named("3", "1.7", "3", "STRESS AC"),
        named("6", "1.8", "4", "REST AC"),
    ]);
    for part in [
        "number 3 \"STRESS AC\" (UID 1.7, 2 files; rest or stress",
        "number 4 \"REST AC\" (UID 1.8, 1 files; rest or stress",
        "send the files of one of them alone",
    ] {
        assert!(said.contains(part), "{said}");
    }
    let nm = |uid, number, text| {
        let series = [
            ((0x08, 0x103e), "LO", Text(text)),
            ((0x20, 0x0e), "UI", Text(uid)),
            ((0x20, 0x11), "IS", Text(number)),
        ];
        with(slices(), &series)
    };
    let said = refusal(&[nm("1.7", "3", "STRESS"), nm("1.8", "4", "REST")]);
    for part in [
        "\"STRESS\" (UID 1.7",
        "\"REST\" (UID 1.8",
        "they are 2 scans, of which each file is a volume of its own: 0 (a Nuclear Medicine image): series number 3",
    ] {
        assert!(said.contains(part), "{said}");
    }
}

#[test]
fn images_that_hold_fewer_or_more_than_they_state_are_refused() {
    let number = |tag, n| changed(|e| drop(e.insert(tag, ("US", Shorts(vec![n])))));
    let (field, value) = complaint(number((0x54, 0x81), 6));
    assert_eq!((field, &*value), ("Number of Slices (0054,0081)", "6"));
    let warnings = number((0x54, 0x81), 3).unwrap().facts.warnings;
    assert!(
        warnings[0].contains("is 3, but the frames hold 4"),
        "{warnings:?}"
    );
    assert_eq!(
        number((0x54, 0x81), 4).unwrap().facts.warnings,
        Vec::<String>::new()
    );
    let mut gates = gated();
    gates.insert((0x54, 0x71), ("US", Shorts(vec![3])));
    gates.insert((0x54, 0x61), ("US", Shorts(vec![2])));
    assert_eq!(
        complaint(read_elements(&gates)).0,
        "Number of Time Slots (0054,0071)"
    );
    let more = changed(|e| drop(e.insert((0x7fe0, 0x10), ("OW", Shorts((0..30).collect())))));
    assert_eq!(complaint(more).0, "Number of Frames (0028,0008)");
    let odd = changed(|e| drop(e.insert((0x7fe0, 0x10), ("OW", Shorts((0..26).collect())))));
    assert!(odd.is_ok());
    let mut groups = enhanced();
    groups.insert((0x28, 0x08), ("IS", Text("3")));
    groups.insert((0x7fe0, 0x10), ("OW", Shorts((0..18).collect())));
    assert_eq!(
        complaint(read_elements(&groups)).0,
        "Number of Frames (0028,0008)"
    );
}

#[test]
fn what_is_no_scan_of_uptake_is_refused() {
    let map = changed(|e| {
        let kind = Text("ORIGINAL\\PRIMARY\\RECON TOMO\\TRANSMISSION");
        e.insert((0x08, 0x08), ("CS", kind));
    });
    let said = map.unwrap_err().to_string();
    assert!(said.contains("transmission map"), "{said}");
    for (tag, vr, value, word) in [
        (
            (0x08, 0x08),
            "CS",
            "ORIGINAL\\PRIMARY\\M\\ND\\MOSAIC",
            "many slices side by side",
        ),
        ((0x54, 0x1001), "CS", "1CM", "transmission map"),
        ((0x54, 0x1000), "CS", "STATIC\\REPROJECTION", "a projection"),
    ] {
        let series = ["0", "3"].map(|z| with(ct(z, 0), &[(tag, vr, Text(value))]));
        let said = read_files(&series).unwrap_err().to_string();
        assert!(said.contains(word), "{said}");
    }
    let named = changed(|e| {
        e.insert((0x08, 0x103e), ("LO", Text("Cardiac uMap")));
    });
    let warnings = named.unwrap().facts.warnings;
    assert!(warnings[0].contains("attenuation map"), "{warnings:?}");
    let nameless = changed(|e| drop(e.remove(&(0x08, 0x08))));
    assert_eq!(
        complaint(nameless),
        ("Image Type (0008,0008)", "missing".into())
    );
}

fn deflate(bytes: &[u8]) -> Vec<u8> {
    let packed = Vec::new();
    let mut packed = flate2::write::DeflateEncoder::new(packed, flate2::Compression::best());
    std::io::Write::write_all(&mut packed, bytes).unwrap();
    packed.finish().unwrap()
}

#[test]
fn a_wrong_transfer_syntax_is_the_fault_that_is_named() {
    const DEFLATED_UID: &str = "1.2.840.10008.1.2.1.99";
    const JPEG_LOSSLESS_UID: &str = "1.2.840.10008.1.2.4.70";
    let all = [Encoding::Implicit, Encoding::Explicit, Encoding::BigEndian];
    let fault =
        |uid: &'static str, data_set: Vec<u8>| match read_frame(with_meta(uid, data_set), None) {
            Err(VolumeError::Field {
                field,
                value,
                reason,
                ..
            }) => {
                assert_eq!(
                    field, "Transfer Syntax UID (0002,0010)",
                    "{uid}: {value} {reason}"
                );
                assert!(value.contains(uid));
                reason
            }
            other => panic!("{uid}: {other:?}"),
        };
    for is in all {
        for said in all
            .map(Encoding::uid)
            .into_iter()
            .chain([DEFLATED_UID, JPEG_LOSSLESS_UID])
        {
            let right = said == is.uid() || (said == JPEG_LOSSLESS_UID && is == Encoding::Explicit);
            if !right {
                let reason = fault(said, is.elements(&slices()));
                let name = [
                    "Implicit VR Little",
                    "Explicit VR Little",
                    "Explicit VR Big",
                ];
                assert!(reason.contains(name[is as usize]), "{reason}");
            }
        }
    }
    let plain = Encoding::Explicit.elements(&slices());
    for uid in [
        Encoding::Implicit.uid(),
        Encoding::Explicit.uid(),
        JPEG_LOSSLESS_UID,
    ] {
        assert!(fault(uid, deflate(&plain)).contains("is deflated"));
    }
    let implicit = deflate(&Encoding::Implicit.elements(&slices()));
    assert!(fault(DEFLATED_UID, implicit).contains("inflated data set is in Implicit VR"));
    let mut zlib = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    std::io::Write::write_all(&mut zlib, &plain).unwrap();
    assert!(fault(DEFLATED_UID, zlib.finish().unwrap()).contains("zlib header"));
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    std::io::Write::write_all(&mut gzip, &plain).unwrap();
    assert!(fault(DEFLATED_UID, gzip.finish().unwrap()).contains("gzip header"));
}

#[test]
fn damage_outranks_the_kind_of_image() {
    let whole = Encoding::Explicit.file(&with(
        slices(),
        &[(
            (0x08, 0x08),
            "CS",
            Text("ORIGINAL\\PRIMARY\\STATIC\\EMISSION"),
        )],
    ));
    for cut in 150..whole.len() {
        match read_frame(whole[..cut].to_vec(), None).unwrap_err() {
            VolumeError::NotSlices { .. } => panic!("cut at {cut}"),
            error => assert!(!error.to_string().contains("RECON TOMO"), "{cut}: {error}"),
        }
    }
    assert!(matches!(
        read_frame(whole, None),
        Err(VolumeError::NotSlices { .. })
    ));
}

/// Fragments as an icon holds them: an offset table and a piece.
fn fragments(vr: Option<&[u8; 2]>) -> Vec<u8> {
    let mut bytes = vec![0xe0, 0x7f, 0x10, 0x00];
    if let Some(vr) = vr {
        bytes.extend(vr);
        bytes.extend([0, 0]);
    }
    bytes.extend([0xff; 4]);
    for piece in [&[][..], &[0xff, 0xd8, 0xff, 0xd9]] {
        bytes.extend([0xfe, 0xff, 0x00, 0xe0]);
        bytes.extend((piece.len() as u32).to_le_bytes());
        bytes.extend(piece);
    }
    bytes.extend([0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0]);
    bytes
}

/// A sequence of one item, of defined or undefined lengths.
fn sequence(tag: [u8; 4], vr: Option<&[u8; 2]>, content: &[u8], defined: bool) -> Vec<u8> {
    let length = |n: usize| {
        if defined {
            (n as u32).to_le_bytes()
        } else {
            [0xff; 4]
        }
    };
    let mut item = vec![0xfe, 0xff, 0x00, 0xe0];
    item.extend(length(content.len()));
    item.extend(content);
    if !defined {
        item.extend([0xfe, 0xff, 0x0d, 0xe0, 0, 0, 0, 0]);
    }
    let mut bytes = tag.to_vec();
    if let Some(vr) = vr {
        bytes.extend(vr);
        bytes.extend([0, 0]);
    }
    bytes.extend(length(item.len()));
    bytes.extend(item);
    if !defined {
        bytes.extend([0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0]);
    }
    bytes
}

#[test]
fn pictures_inside_sequences_are_not_the_image() {
    const ICON_TAG_BYTES: [u8; 4] = [0x88, 0x00, 0x00, 0x02];
    const PRIVATE_TAG_BYTES: [u8; 4] = [0x09, 0x00, 0x10, 0x11];
    const RLE_UID: &str = "1.2.840.10008.1.2.5";
    let run_length = |data: &Elements| {
        // Each frame: 2 segments of 6 bytes in one literal run.
        let Some((_, Shorts(pixels))) = data.get(&(0x7fe0, 0x10)) else {
            panic!("no pixels");
        };
        let mut rest = data.clone();
        rest.remove(&(0x7fe0, 0x10));
        let mut bytes = vec![0xe0, 0x7f, 0x10, 0x00];
        bytes.extend(b"OB\0\0\xff\xff\xff\xff\xfe\xff\x00\xe0\0\0\0\0");
        for frame in pixels.chunks(6) {
            let mut packed = vec![0_u8; 64];
            (packed[0], packed[4], packed[8]) = (2, 64, 72);
            for shift in [8, 0] {
                packed.push(5);
                packed.extend(frame.iter().map(|v| (v >> shift) as u8));
                packed.push(0x80);
            }
            bytes.extend([0xfe, 0xff, 0x00, 0xe0]);
            bytes.extend((packed.len() as u32).to_le_bytes());
            bytes.extend(packed);
        }
        bytes.extend([0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0]);
        (rest, bytes)
    };
    let whole = slices();
    let (rest, packed) = run_length(&whole);
    let mut bare = whole.clone();
    let pixels = bare.remove(&(0x7fe0, 0x10)).unwrap();
    let pixels = BTreeMap::from([((0x7fe0, 0x10), pixels)]);
    let ramp: Vec<f32> = (0..24).map(|n| n as f32).collect();
    // A plain icon, as large as the image, and compressed ones of several representations.
    let plain = |e: Encoding| {
        let icon = BTreeMap::from([((0x7fe0, 0x10), ("OW", Shorts(vec![9; 24])))]);
        e.elements(&icon)
    };
    for defined in [true, false] {
        let mut icons = Vec::new();
        for content in [
            fragments(Some(b"OB")),
            fragments(Some(b"OW")),
            fragments(Some(b"UN")),
            plain(Encoding::Explicit),
        ] {
            let icon = sequence(ICON_TAG_BYTES, Some(b"SQ"), &content, defined);
            icons.push(sequence(PRIVATE_TAG_BYTES, Some(b"SQ"), &icon, defined));
            icons.push(icon);
        }
        // A private sequence of unknown representation is in implicit VR.
        let inner = sequence(ICON_TAG_BYTES, None, &fragments(None), false);
        icons.push(sequence(PRIVATE_TAG_BYTES, Some(b"UN"), &inner, false));
        for icon in icons {
            let place = |elements: &Elements, pixels: &[u8]| {
                let mut all = Encoding::Explicit.elements(elements);
                all.extend(&icon);
                all.extend(pixels);
                all
            };
            let plain = place(&bare, &Encoding::Explicit.elements(&pixels));
            let compressed = place(&rest, &packed);
            for made in [
                with_meta(Encoding::Explicit.uid(), plain),
                with_meta(RLE_UID, compressed),
            ] {
                let reading = read_frame(made, None).unwrap();
                assert_eq!(reading.volume.voxels, ramp);
            }
        }
        for content in [fragments(None), plain(Encoding::Implicit)] {
            let mut all = Encoding::Implicit.elements(&bare);
            all.extend(sequence(ICON_TAG_BYTES, None, &content, defined));
            all.extend(Encoding::Implicit.elements(&pixels));
            let reading = read_frame(with_meta(Encoding::Implicit.uid(), all), None).unwrap();
            assert_eq!(reading.volume.voxels, ramp);
        }
        // An icon is no image.
        let mut lone = Encoding::Explicit.elements(&bare);
        lone.extend(sequence(
            ICON_TAG_BYTES,
            Some(b"SQ"),
            &fragments(Some(b"OB")),
            defined,
        ));
        let (field, value) = complaint(read_frame(with_meta(RLE_UID, lone), None));
        assert_eq!((field, &*value), ("Pixel Data (7FE0,0010)", "missing"));
    }
}
