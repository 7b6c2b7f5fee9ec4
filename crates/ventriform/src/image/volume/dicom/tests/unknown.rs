//! Values and sequences of unknown or of another representation, and what is stated in an odd way.

use super::super::stored::StoredDataSet;
use super::objects::{ct, files, read_files};
use super::*;
use dicom_core::{Tag, VR};
use ventriform_dicom::read::attributes::WANTED_ATTRIBUTES;
use ventriform_dicom::read::representation::standard;
use ventriform_dicom::read::scan;

/// The attributes of the file in `bytes`.
fn attributes(bytes: Vec<u8>) -> Attributes {
    let file = VolumeFile::in_memory("test", bytes);
    let limits = ReadLimits::default();
    let stored = StoredDataSet::find(&file, &limits).unwrap();
    let mut source = stored.open(&file, limits.unpacked_bytes).unwrap();
    scan::attributes(&mut source, &stored.syntax, &|| true).unwrap()
}

fn pair(tag: Tag) -> (u16, u16) {
    (tag.0, tag.1)
}

/// A value that an attribute of that representation can have.
fn value_of(vr: VR) -> Value {
    match vr {
        VR::US | VR::SS => Shorts(vec![0x0102]),
        VR::AT => Shorts(vec![0x0054, 0x0080]),
        VR::UL => Longs(vec![0x0102_0304]),
        VR::FL => Single(1.25),
        VR::FD => Double(1.25),
        _ => Text("12"),
    }
}

/// The data set with `value` in nested sequences. Sequence number `unknown` has the VR UN; the value if there are so
/// many sequences.
fn nested(path: &[Tag], (tag, value): ((u16, u16), Value), unknown: Option<usize>) -> Elements {
    let vr = standard(Tag(tag.0, tag.1)).to_string();
    let bytes = |elements: &Elements| {
        let mut bytes = vec![0xfe, 0xff, 0x00, 0xe0];
        let item = Encoding::Implicit.elements(elements);
        bytes.extend((item.len() as u32).to_le_bytes());
        bytes.extend(item);
        Bytes(bytes)
    };
    let mut inner = if unknown == Some(path.len()) {
        let value = Bytes(Encoding::Implicit.value(&value));
        BTreeMap::from([(tag, ("UN", value))])
    } else {
        BTreeMap::from([(tag, (vr, value))])
    };
    for (depth, sequence) in path.iter().enumerate().rev() {
        let element = if unknown == Some(depth) {
            ("UN", bytes(&inner))
        } else {
            ("SQ", Items(vec![inner]))
        };
        inner = BTreeMap::from([(pair(*sequence), element)]);
    }
    inner
}

#[test]
fn every_attribute_is_found_in_sequences_and_values_of_unknown_representation() {
    for attribute in WANTED_ATTRIBUTES {
        let (path, tag) = (attribute.path, pair(attribute.tag));
        let vr = standard(attribute.tag);
        let value = match vr {
            // A sequence in the table is one whose presence counts.
            VR::SQ | VR::OB | VR::OW => continue,
            vr => value_of(vr),
        };
        for encoding in [Encoding::Explicit, Encoding::BigEndian] {
            let found = |unknown: Option<usize>| {
                let mut elements = nested(path, (tag, value.clone()), unknown);
                // The data set begins and goes on as others do.
                elements.insert((0x08, 0x16), ("UI", Text("1.2.840.10008.5.1.4.1.1.20")));
                elements.insert((0x7fdf, 0x10), ("LO", Text("a private group")));
                let read = attributes(encoding.file(&elements));
                read.raw(*attribute)
            };
            let stated = found(None);
            if tag == (0x08, 0x16) && path.is_empty() {
                continue;
            }
            assert!(stated.is_some(), "{} {encoding:?}", attribute.name);
            for unknown in 0..=path.len() {
                assert_eq!(
                    found(Some(unknown)),
                    stated,
                    "{} {encoding:?} {unknown}",
                    attribute.name
                );
            }
        }
    }
}

/// The data set whose Detector Information is of unknown representation, as `bytes`.
fn with_detector(bytes: Vec<u8>) -> Elements {
    let mut elements = slices();
    elements.insert((0x54, 0x22), ("UN", Bytes(bytes)));
    elements
}

fn item_of(encoding: Encoding, length: Option<u32>) -> Vec<u8> {
    let detector = BTreeMap::from([
        ((0x20, 0x32), ("DS", Text("10\\-20.5\\30"))),
        ((0x20, 0x37), ("DS", Text("0.6\\0.8\\0\\0\\0\\-1"))),
    ]);
    let content = encoding.elements(&detector);
    let mut bytes = vec![0xfe, 0xff, 0x00, 0xe0];
    bytes.extend(length.unwrap_or(content.len() as u32).to_le_bytes());
    bytes.extend(content);
    if length.is_some() {
        bytes.extend([0xfe, 0xff, 0x0d, 0xe0, 0, 0, 0, 0]);
    }
    bytes
}

#[test]
fn detectors_of_unknown_representation_place_the_slices() {
    let expected = read_elements(&slices()).unwrap();
    let two = [
        item_of(Encoding::Implicit, None),
        item_of(Encoding::Implicit, None),
    ];
    for (bytes, is_explicit) in [
        (item_of(Encoding::Implicit, None), false),
        (item_of(Encoding::Implicit, Some(u32::MAX)), false),
        // Some writers keep the representation inside.
        (item_of(Encoding::Explicit, None), true),
        (two.concat(), false),
    ] {
        let elements = with_detector(bytes);
        for encoding in [Encoding::Explicit, Encoding::BigEndian] {
            // Items in Explicit VR Little Endian belong to a file of that syntax.
            if is_explicit && encoding == Encoding::BigEndian {
                continue;
            }
            let reading = read_frame(encoding.file(&elements), None).unwrap();
            assert_eq!(reading.volume.frame, expected.volume.frame, "{encoding:?}");
            assert_eq!(reading.volume.voxels, expected.volume.voxels);
            assert_eq!(reading.facts.warnings, Vec::<String>::new());
        }
    }
    // Bytes that are no items are passed over.
    for bytes in [
        vec![],
        vec![1, 2, 3, 4],
        vec![0xff, 0xfe, 0xe0, 0, 0, 0, 0, 0],
    ] {
        let reading = read_elements(&with_detector(bytes)).unwrap();
        assert_eq!(reading.volume.voxels, expected.volume.voxels);
    }
    // Items that end beyond their sequence are damage.
    let mut cut = item_of(Encoding::Implicit, None);
    cut.truncate(cut.len() - 8);
    read_elements(&with_detector(cut)).unwrap_err();
}

#[test]
fn pixels_of_unknown_representation_are_little_endian() {
    for encoding in [Encoding::Explicit, Encoding::BigEndian] {
        let mut elements = slices();
        let pixels = (0..24_u16).flat_map(u16::to_le_bytes).collect();
        elements.insert((0x7fe0, 0x10), ("UN", Bytes(pixels)));
        let reading = read_frame(encoding.file(&elements), None).unwrap();
        let ramp: Vec<f32> = (0..24).map(|n| n as f32).collect();
        assert_eq!(reading.volume.voxels, ramp);
    }
}

#[test]
fn numbers_of_another_representation_are_converted_or_refused() {
    let expected = read_elements(&slices()).unwrap().volume;
    for encoding in [Encoding::Explicit, Encoding::BigEndian] {
        for (tag, vr, value) in [
            ((0x28, 0x10), "UL", Longs(vec![2])),
            ((0x28, 0x10), "IS", Text("2")),
            ((0x28, 0x11), "DS", Text("3.0")),
            ((0x28, 0x11), "FD", Double(3.0)),
            ((0x28, 0x30), "FL", Single(4.0)),
            ((0x28, 0x100), "UL", Longs(vec![16])),
            ((0x28, 0x08), "US", Shorts(vec![4])),
            ((0x28, 0x103), "IS", Text("0")),
            ((0x54, 0x80), "IS", Text("1\\2\\3\\4")),
        ] {
            let mut elements = slices();
            if tag == (0x28, 0x30) {
                elements.insert((0x28, 0x30), ("DS", Text("4\\4")));
            }
            let value = match (tag, encoding) {
                ((0x28, 0x30), _) => Longs(vec![4_f32.to_bits(); 2]),
                _ => value,
            };
            elements.insert(tag, (vr, value));
            let reading = read_frame(encoding.file(&elements), None);
            let reading = reading.unwrap_or_else(|e| panic!("{tag:?} {vr}: {e}"));
            assert_eq!(reading.volume.voxels, expected.voxels, "{tag:?} {vr}");
            assert_eq!(reading.volume.shape, expected.shape);
            let warnings = reading.facts.warnings.join(" ");
            assert!(
                warnings.contains(&format!("value representation {vr}")),
                "{warnings}"
            );
        }
    }
    for (vr, value) in [
        ("LO", Text("many")),
        ("FD", Double(2.5)),
        ("UL", Longs(vec![65_538])),
    ] {
        let refused = changed(|e| {
            e.insert((0x28, 0x10), (vr, value));
        });
        let (field, value) = complaint(refused);
        assert_eq!(field, "Rows (0028,0010)");
        assert!(value.contains(vr), "{value}");
    }
}

#[test]
fn a_slope_of_zero_is_that_of_an_empty_slice() {
    let scaled = |slope: &'static str, intercept: &'static str, pixels: Vec<u16>| {
        changed(|e| {
            e.insert((0x28, 0x1052), ("DS", Text(intercept)));
            e.insert((0x28, 0x1053), ("DS", Text(slope)));
            e.insert((0x28, 0x103), ("US", Shorts(vec![1])));
            e.insert((0x7fe0, 0x10), ("OW", Shorts(pixels)));
        })
    };
    for slope in ["0", "0.0", "-0", "0E+00"] {
        let empty = scaled(slope, "0", vec![0; 24]).unwrap();
        assert_eq!(empty.volume.voxels, vec![0.0; 24]);
        let shifted = scaled(slope, "-3", vec![0x8000; 24]).unwrap();
        assert_eq!(shifted.volume.voxels, vec![-3.0; 24]);
        let (field, value) = complaint(scaled(slope, "0", [vec![0; 23], vec![7]].concat()));
        assert_eq!((field, &*value), ("Rescale Slope (0028,1053)", "0"));
    }
    let (field, _) = complaint(scaled("NaN", "0", vec![0; 24]));
    assert_eq!(field, "Rescale Slope (0028,1053)");
    // Slices of a series that are scaled each by its own maximum.
    let slice = |height, slope, pixels| {
        let mut slice = ct(height, 0);
        slice.insert((0x28, 0x1052), ("DS", Text("0")));
        slice.insert((0x28, 0x1053), ("DS", Text(slope)));
        slice.insert((0x7fe0, 0x10), ("OW", Shorts(pixels)));
        slice
    };
    let series = [
        slice("0", "0", vec![0; 6]),
        slice("3", "0.5", (0..6).collect()),
        slice("6", "0", vec![0; 6]),
    ];
    let reading = read_files(&files(&series)).unwrap();
    assert_eq!(reading.volume.voxels[..6], [0.0; 6]);
    assert_eq!(reading.volume.voxels[6..9], [0.0, 0.5, 1.0]);
    let lost = [series[1].clone(), slice("6", "0", vec![0, 0, 0, 0, 0, 2])];
    let (field, _) = complaint(read_files(&files(&lost)));
    assert_eq!(field, "Rescale Slope (0028,1053)");
}

/// An item of the Real World Value Mapping.
fn mapping(unit: &'static str, range: [u16; 2], by: &[((u16, u16), Value)]) -> Elements {
    let code = BTreeMap::from([((0x08, 0x100), ("SH", Text(unit)))]);
    let mut item = BTreeMap::from([
        ((0x40, 0x8ea), ("SQ", Items(vec![code]))),
        ((0x40, 0x9216), ("US", Shorts(vec![range[0]]))),
        ((0x40, 0x9211), ("US", Shorts(vec![range[1]]))),
    ]);
    item.extend(by.iter().map(|(tag, value)| (*tag, ("FD", value.clone()))));
    item
}

#[test]
fn real_world_values_are_mapped_by_one_slope_or_refused() {
    let slope = |slope: f64| {
        [
            ((0x40, 0x9225), Double(slope)),
            ((0x40, 0x9224), Double(1.0)),
        ]
    };
    let table = || {
        let values = (0..24)
            .flat_map(|n| f64::from(n * n).to_le_bytes())
            .collect();
        [((0x40, 0x9212), Bytes(values))]
    };
    let mapped = |items: Vec<Elements>, place: usize, vr: &'static str| {
        let items = match vr {
            "UN" => {
                let mut bytes = Vec::new();
                for item in &items {
                    let item = Encoding::Implicit.elements(item);
                    bytes.extend([0xfe, 0xff, 0x00, 0xe0]);
                    bytes.extend((item.len() as u32).to_le_bytes());
                    bytes.extend(item);
                }
                Bytes(bytes)
            }
            _ => Items(items),
        };
        let sequence = BTreeMap::from([((0x40, 0x9096), (vr, items))]);
        match place {
            0 => changed(|e| e.extend(sequence)),
            group => {
                let mut elements = super::objects::enhanced();
                let groups = [(0x5200, 0x9229), (0x5200, 0x9230)][group - 1];
                elements.remove(&(0x28, 0x1052));
                elements.remove(&(0x28, 0x1053));
                let Some((_, Items(frames))) = elements.get_mut(&groups) else {
                    panic!("no groups");
                };
                for frame in frames {
                    frame.remove(&(0x28, 0x9145));
                    frame.extend(sequence.clone());
                }
                for other in [(0x5200, 0x9229), (0x5200, 0x9230)] {
                    if let Some((_, Items(frames))) = elements.get_mut(&other) {
                        for frame in frames {
                            frame.remove(&(0x28, 0x9145));
                        }
                    }
                }
                read_elements(&elements)
            }
        }
    };
    for place in 0..3 {
        for vr in ["SQ", "UN"] {
            let plain = mapped(vec![], place, vr).unwrap().volume.voxels;
            let right: Vec<f32> = plain.iter().map(|v| 0.5 * v + 1.0).collect();
            for items in [
                vec![mapping("1", [0, 99], &slope(0.5))],
                // The same in other units, by a slope or by a table.
                vec![
                    mapping("Bq/ml", [0, 99], &slope(0.5)),
                    mapping("g/ml", [0, 99], &slope(2.0)),
                ],
                vec![
                    mapping("Bq/ml", [0, 99], &slope(0.5)),
                    mapping("g/ml", [0, 99], &table()),
                ],
                vec![
                    mapping("1", [0, 9], &slope(0.5)),
                    mapping("1", [10, 99], &slope(0.5)),
                ],
            ] {
                let reading = mapped(items, place, vr).unwrap();
                assert_eq!(reading.volume.voxels, right, "{place} {vr}");
            }
            for (items, word) in [
                (vec![mapping("1", [0, 99], &table())], "table"),
                (
                    vec![
                        mapping("1", [0, 9], &slope(1.0)),
                        mapping("1", [10, 99], &slope(2.0)),
                    ],
                    "ranges",
                ),
                (
                    vec![
                        mapping("1", [0, 9], &slope(1.0)),
                        mapping("1", [10, 99], &table()),
                    ],
                    "table",
                ),
            ] {
                let error = mapped(items, place, vr).unwrap_err().to_string();
                assert!(
                    error.contains("Real World Value Mapping") && error.contains(word),
                    "{place} {error}"
                );
            }
        }
    }
}

#[test]
fn vectors_count_from_anywhere_and_pointers_name_what_they_like() {
    let expected = read_elements(&slices()).unwrap().volume.voxels;
    for (vector, from) in [
        (vec![0, 1, 2, 3], "from 0"),
        (vec![18, 19, 20, 21], "from 18"),
    ] {
        let reading = changed(|e| {
            e.insert((0x54, 0x80), ("US", Shorts(vector)));
            e.insert((0x54, 0x81), ("US", Shorts(vec![4])));
        });
        let reading = reading.unwrap();
        assert_eq!(reading.volume.voxels, expected);
        assert!(
            reading.facts.warnings[0].contains(from),
            "{:?}",
            reading.facts.warnings
        );
    }
    // Whole gates: the vectors as they are, from 0, without R-R intervals, and pointers of every kind.
    let gate = |elements: &Elements, n| {
        let reading = read_frame(Encoding::Explicit.file(elements), Some(n));
        reading.unwrap_or_else(|e| panic!("{e}")).volume.voxels
    };
    let mut plain = gated();
    plain.insert((0x54, 0x60), ("US", Shorts(vec![1; 8])));
    plain.insert((0x54, 0x70), ("US", Shorts(vec![2, 2, 1, 1, 4, 4, 3, 3])));
    plain.insert((0x54, 0x71), ("US", Shorts(vec![4])));
    let expected: Vec<Vec<f32>> = (0..4).map(|n| gate(&plain, n)).collect();
    type Change = fn(&mut Elements);
    let changes: [Change; 6] = [
        |e| {
            e.remove(&(0x54, 0x60));
        },
        |e| {
            e.remove(&(0x54, 0x60));
            e.insert((0x28, 0x09), ("AT", Shorts(vec![0x54, 0x70, 0x54, 0x80])));
        },
        |e| {
            e.insert((0x28, 0x09), ("AT", Shorts(vec![0x54, 0x80])));
        },
        |e| {
            e.insert(
                (0x28, 0x09),
                ("AT", Shorts(vec![0x54, 0x80, 0x54, 0x70, 0x54, 0x60])),
            );
        },
        |e| {
            e.remove(&(0x28, 0x09));
        },
        |e| {
            e.insert((0x54, 0x60), ("US", Shorts(vec![0; 8])));
            e.insert((0x54, 0x70), ("US", Shorts(vec![1, 1, 0, 0, 3, 3, 2, 2])));
            e.insert((0x54, 0x80), ("US", Shorts(vec![0, 1, 0, 1, 1, 0, 0, 1])));
        },
    ];
    for (number, change) in changes.into_iter().enumerate() {
        let mut elements = plain.clone();
        change(&mut elements);
        for (n, expected) in expected.iter().enumerate() {
            assert_eq!(gate(&elements, n), *expected, "{number}");
        }
    }
    // Two intervals need their vector, and a pointer to what else counts is refused.
    let refused = |change: Change| {
        let mut elements = plain.clone();
        change(&mut elements);
        complaint(read_frame(Encoding::Explicit.file(&elements), Some(0))).0
    };
    let intervals = refused(|e| {
        e.remove(&(0x54, 0x60));
        e.insert((0x54, 0x61), ("US", Shorts(vec![2])));
    });
    assert_eq!(intervals, "R-R Interval Vector (0054,0060)");
    let angles = refused(|e| {
        e.insert((0x28, 0x09), ("AT", Shorts(vec![0x54, 0x90, 0x54, 0x80])));
    });
    assert_eq!(angles, "Frame Increment Pointer (0028,0009)");
    // A vector of the whole volume beside frames of a part of it.
    let cropped = changed(|e| {
        e.insert((0x54, 0x80), ("US", Shorts((1..=9).collect())));
    });
    let error = cropped.unwrap_err().to_string();
    assert!(
        error.contains("4 frames") && error.contains("there are 9"),
        "{error}"
    );
}

/// Slice `k` of [`slices`] as a Nuclear Medicine image of its own.
fn one_nm_slice(k: usize) -> Elements {
    let mut elements = slices();
    let normal = [-0.8, 0.6, 0.0];
    let first = [10.0, -20.5, 30.0];
    let at: Vec<String> = (0..3)
        .map(|axis| (first[axis] - 5.0 * k as f64 * normal[axis]).to_string())
        .collect();
    let detector = BTreeMap::from([
        ((0x20, 0x32), ("DS", written(at.join("\\")))),
        ((0x20, 0x37), ("DS", Text("0.6\\0.8\\0\\0\\0\\-1"))),
    ]);
    let from = 6 * k as u16;
    elements.extend([
        ((0x08, 0x18), ("UI", written(format!("1.2.3.{k}")))),
        ((0x20, 0x0d), ("UI", Text("1.2.3"))),
        ((0x20, 0x0e), ("UI", Text("1.2.3.4"))),
        ((0x20, 0x13), ("IS", written(k + 1))),
        ((0x28, 0x08), ("IS", Text("1"))),
        ((0x54, 0x22), ("SQ", Items(vec![detector]))),
        ((0x54, 0x80), ("US", Shorts(vec![k as u16 + 1]))),
        ((0x54, 0x81), ("US", Shorts(vec![4]))),
        ((0x7fe0, 0x10), ("OW", Shorts((from..from + 6).collect()))),
    ]);
    elements
}

#[test]
fn nuclear_slices_of_one_file_each_are_a_volume() {
    let whole = read_elements(&slices()).unwrap().volume;
    for order in [[0, 1, 2, 3], [3, 1, 0, 2]] {
        let reading = read_files(&files(&order.map(one_nm_slice))).unwrap().volume;
        // Slices rise along row x column; those of the image fall.
        assert_eq!(reading.shape, whole.shape);
        for k in 0..4 {
            assert_eq!(
                reading.voxels[6 * k..6 * k + 6],
                whole.voxels[18 - 6 * k..24 - 6 * k]
            );
        }
        let (last, first) = (Vec3::new(0.0, 0.0, 3.0), Vec3::zeros());
        let apart = reading.frame.to_patient(&last) - whole.frame.to_patient(&first);
        assert!(apart.norm() < 1e-3, "{apart}");
    }
    let error = read_files(&files(&[0, 1].map(one_nm_slice)))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("slices are missing") && error.contains("is 4"),
        "{error}"
    );
    let many: Vec<Elements> = (0..7).map(one_nm_slice).collect();
    assert_eq!(read_files(&files(&many)).unwrap().volume.shape, [3, 2, 7]);
}

#[test]
fn volumes_and_slices_of_one_series_are_told_apart() {
    let mut whole = slices();
    whole.extend([
        ((0x08, 0x18), ("UI", Text("1.2.9"))),
        ((0x20, 0x0d), ("UI", Text("1.2.3"))),
        ((0x20, 0x0e), ("UI", Text("1.2.3.4"))),
    ]);
    let mut other = whole.clone();
    other.insert((0x08, 0x18), ("UI", Text("1.2.10")));
    let refused = |slices: &[Elements]| {
        let error = read_files(&files(slices)).unwrap_err().to_string();
        assert!(!error.contains("1 series"), "{error}");
        error
    };
    let beside = refused(&[ct("0", 0), whole.clone(), ct("3", 0)]);
    for part in [
        "one file is a volume of its own and the others are slices of a series",
        "all have one Series Instance UID",
        "1 (a Nuclear Medicine image)",
        "2 files",
    ] {
        assert!(beside.contains(part), "{beside}");
    }
    let two = refused(&[whole, other]);
    assert!(two.contains("each file is a volume of its own"), "{two}");
}

#[test]
fn an_image_type_written_as_one_text_is_read() {
    for text in [
        "['ORIGINAL', 'PRIMARY', 'RECON TOMO', 'EMISSION']",
        "[\"ORIGINAL\", \"PRIMARY\", \"RECON TOMO\", \"EMISSION\"]",
        "('ORIGINAL', 'PRIMARY', 'RECON TOMO', 'EMISSION')",
        "ORIGINAL, PRIMARY, RECON TOMO, EMISSION",
        "ORIGINAL/PRIMARY/RECON TOMO/EMISSION",
    ] {
        let reading = changed(|e| {
            e.insert((0x08, 0x08), ("CS", Text(text)));
        });
        let reading = reading.unwrap_or_else(|e| panic!("{text}: {e}"));
        assert!(
            reading.facts.warnings[0].contains("one value"),
            "{:?}",
            reading.facts.warnings
        );
        let stated = reading.provenance.unwrap().image_type;
        assert_eq!(
            stated.as_deref(),
            Some("ORIGINAL\\PRIMARY\\RECON TOMO\\EMISSION")
        );
    }
    let planar = changed(|e| {
        e.insert(
            (0x08, 0x08),
            ("CS", Text("['ORIGINAL', 'PRIMARY', 'STATIC', 'EMISSION']")),
        );
    });
    assert!(matches!(planar, Err(VolumeError::NotSlices { .. })));
}

#[test]
fn the_retired_class_of_nuclear_medicine_images_is_read() {
    let reading = changed(|e| {
        e.insert((0x08, 0x16), ("UI", Text("1.2.840.10008.5.1.4.1.1.5")));
    });
    let expected = read_elements(&slices()).unwrap();
    assert_eq!(reading.unwrap().volume.voxels, expected.volume.voxels);
}

#[test]
fn what_is_no_value_of_its_representation_is_left_out_and_said() {
    for (tag, vr, name) in [
        ((0x20, 0x0d), "UI", "Study Instance UID"),
        ((0x20, 0x0e), "UI", "Series Instance UID"),
        ((0x20, 0x52), "UI", "Frame of Reference UID"),
        ((0x08, 0x18), "UI", "SOP Instance UID"),
        ((0x08, 0x20), "DA", "Study Date"),
        ((0x10, 0x30), "DA", "Patient's Birth Date"),
        ((0x08, 0x30), "TM", "Study Time"),
        ((0x10, 0x40), "CS", "Patient's Sex"),
    ] {
        for wrong in ["..", "1..2", "01.2", "1.2.a", "?", "20251399"] {
            let reading = changed(|e| {
                e.insert(tag, (vr, Text(wrong)));
            });
            let reading = reading.unwrap();
            assert_eq!(reading.facts.warnings.len(), 1, "{name} {wrong}");
            assert!(
                reading.facts.warnings[0].starts_with(name),
                "{:?}",
                reading.facts.warnings
            );
            let scan = reading.provenance.unwrap();
            let stated = scan.stated();
            assert!(
                stated.iter().all(|(_, value)| *value != wrong),
                "{name} {wrong}"
            );
        }
    }
    let dotted = changed(|e| {
        e.insert((0x08, 0x20), ("DA", Text("2025.03.10")));
        e.insert((0x08, 0x30), ("TM", Text("09:15:00")));
    });
    let scan = dotted.unwrap().provenance.unwrap();
    assert_eq!(scan.study_date.as_deref(), Some("20250310"));
    assert_eq!(scan.study_time.as_deref(), Some("091500"));
}
