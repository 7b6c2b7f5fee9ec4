//! Files made by code in every supported encoding, hostile files, and random damage.

use super::super::{
    AffineSource, ReadOptions, Reading, VolumeFile, inspect as inspect_volume, read as read_volume,
};
use super::*;
use crate::base::geometry::Vec3;
use proptest::prelude::*;
use std::collections::BTreeMap;

mod company;
mod compressed;
mod objects;
mod one_scan;
mod padding;
mod posture;
mod projections;
mod refused;
mod sorted;
mod text;
mod unknown;

/// An element's value.
#[derive(Clone)]
enum Value {
    Text(&'static str),
    /// As it is, of an even length.
    Bytes(Vec<u8>),
    Shorts(Vec<u16>),
    Longs(Vec<u32>),
    Single(f32),
    Double(f64),
    Items(Vec<Elements>),
}
use Value::{Bytes, Double, Items, Longs, Shorts, Single, Text};

/// A text that the test made.
fn written(text: impl ToString) -> Value {
    Text(Box::leak(text.to_string().into_boxed_str()))
}

/// Elements by tag, with their VR.
type Elements = BTreeMap<(u16, u16), (&'static str, Value)>;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Encoding {
    Implicit,
    Explicit,
    BigEndian,
}

impl Encoding {
    fn uid(self) -> &'static str {
        match self {
            Encoding::Implicit => "1.2.840.10008.1.2",
            Encoding::Explicit => "1.2.840.10008.1.2.1",
            Encoding::BigEndian => "1.2.840.10008.1.2.2",
        }
    }

    fn short(self, n: u16) -> [u8; 2] {
        match self {
            Encoding::BigEndian => n.to_be_bytes(),
            _ => n.to_le_bytes(),
        }
    }

    fn long(self, n: u32) -> [u8; 4] {
        match self {
            Encoding::BigEndian => n.to_be_bytes(),
            _ => n.to_le_bytes(),
        }
    }

    fn elements(self, elements: &Elements) -> Vec<u8> {
        let mut bytes = Vec::new();
        for ((group, element), (vr, value)) in elements {
            let value = self.value(value);
            bytes.extend(self.short(*group));
            bytes.extend(self.short(*element));
            if self == Encoding::Implicit {
                bytes.extend(self.long(value.len() as u32));
            } else {
                bytes.extend(vr.as_bytes());
                if matches!(*vr, "SQ" | "OW" | "OB" | "UN") {
                    bytes.extend([0, 0]);
                    bytes.extend(self.long(value.len() as u32));
                } else {
                    bytes.extend(self.short(value.len() as u16))
                }
            }
            bytes.extend(value);
        }
        bytes
    }

    fn value(self, value: &Value) -> Vec<u8> {
        match value {
            Text(text) => {
                let padding = if text.len() % 2 == 1 { " " } else { "" };
                format!("{text}{padding}").into_bytes()
            }
            Bytes(bytes) => bytes.clone(),
            Shorts(numbers) => numbers.iter().flat_map(|n| self.short(*n)).collect(),
            Longs(numbers) => numbers.iter().flat_map(|n| self.long(*n)).collect(),
            Single(number) => self.long(number.to_bits()).to_vec(),
            Double(number) => match self {
                Encoding::BigEndian => number.to_be_bytes().to_vec(),
                _ => number.to_le_bytes().to_vec(),
            },
            Items(items) => {
                let mut bytes = Vec::new();
                for item in items {
                    let item = self.elements(item);
                    bytes.extend(self.short(0xfffe));
                    bytes.extend(self.short(0xe000));
                    bytes.extend(self.long(item.len() as u32));
                    bytes.extend(item);
                }
                bytes
            }
        }
    }

    /// The whole file, with preamble and meta information.
    fn file(self, elements: &Elements) -> Vec<u8> {
        with_meta(self.uid(), self.elements(elements))
    }
}

fn with_meta(uid: &'static str, data_set: Vec<u8>) -> Vec<u8> {
    let mut bytes = vec![0; 128];
    bytes.extend(b"DICM");
    let meta = BTreeMap::from([((2, 0x10), ("UI", Text(uid)))]);
    bytes.extend(Encoding::Explicit.elements(&meta));
    bytes.extend(data_set);
    bytes
}

const ROW_DIRECTION: [f64; 3] = [0.6, 0.8, 0.0];
const COLUMN_DIRECTION: [f64; 3] = [0.0, 0.0, -1.0];

/// 3 columns, 2 rows, 4 slices of 0..24, oblique, slices 5 mm apart backwards.
fn slices() -> Elements {
    let detector = BTreeMap::from([
        ((0x20, 0x32), ("DS", Text("10\\-20.5\\30"))),
        ((0x20, 0x37), ("DS", Text("0.6\\0.8\\0\\0\\0\\-1"))),
    ]);
    let elsewhere = BTreeMap::from([((0x20, 0x32), ("DS", Text("7\\7\\7")))]);
    BTreeMap::from([
        (
            (0x08, 0x08),
            ("CS", Text("ORIGINAL\\PRIMARY\\RECON TOMO\\EMISSION")),
        ),
        ((0x08, 0x16), ("UI", Text("1.2.840.10008.5.1.4.1.1.20"))),
        ((0x08, 0x60), ("CS", Text("NM"))),
        ((0x18, 0x50), ("DS", Text("6"))),
        ((0x18, 0x88), ("DS", Text("-5.0"))),
        ((0x28, 0x02), ("US", Shorts(vec![1]))),
        ((0x28, 0x08), ("IS", Text("4"))),
        ((0x28, 0x09), ("AT", Shorts(vec![0x54, 0x80]))),
        ((0x28, 0x10), ("US", Shorts(vec![2]))),
        ((0x28, 0x11), ("US", Shorts(vec![3]))),
        ((0x28, 0x30), ("DS", Text("2.5\\4"))),
        ((0x28, 0x100), ("US", Shorts(vec![16]))),
        ((0x28, 0x101), ("US", Shorts(vec![16]))),
        ((0x28, 0x102), ("US", Shorts(vec![15]))),
        ((0x28, 0x103), ("US", Shorts(vec![0]))),
        ((0x54, 0x22), ("SQ", Items(vec![detector, elsewhere]))),
        ((0x54, 0x80), ("US", Shorts(vec![1, 2, 3, 4]))),
        ((0x7fe0, 0x10), ("OW", Shorts((0..24).collect()))),
    ])
}

/// 2 slices of 2 gates in 2 R-R intervals; slices fastest, gates from behind.
fn gated() -> Elements {
    let mut elements = slices();
    elements.extend([
        (
            (0x08, 0x08),
            ("CS", Text("ORIGINAL\\PRIMARY\\RECON GATED TOMO\\EMISSION")),
        ),
        ((0x28, 0x08), ("IS", Text("8"))),
        (
            (0x28, 0x09),
            ("AT", Shorts(vec![0x54, 0x60, 0x54, 0x70, 0x54, 0x80])),
        ),
        ((0x54, 0x60), ("US", Shorts(vec![1, 1, 1, 1, 2, 2, 2, 2]))),
        ((0x54, 0x70), ("US", Shorts(vec![2, 2, 1, 1, 2, 2, 1, 1]))),
        ((0x54, 0x80), ("US", Shorts(vec![1, 2, 1, 2, 2, 1, 1, 2]))),
        ((0x7fe0, 0x10), ("OW", Shorts((0..48).collect()))),
    ]);
    elements
}

fn read_frame(bytes: Vec<u8>, frame: Option<usize>) -> Result<Reading, VolumeError> {
    let files = [VolumeFile::in_memory("test", bytes)];
    let options = ReadOptions { frame };
    read_volume(&files, &options, &ReadLimits::default(), &Monitor::silent())
}

fn read_elements(elements: &Elements) -> Result<Reading, VolumeError> {
    read_frame(Encoding::Explicit.file(elements), None)
}

/// The file after `change`.
fn changed(change: impl FnOnce(&mut Elements)) -> Result<Reading, VolumeError> {
    let mut elements = slices();
    change(&mut elements);
    read_elements(&elements)
}

fn complaint(result: Result<Reading, VolumeError>) -> (&'static str, String) {
    match result {
        Err(VolumeError::Field { field, value, .. }) => (field, value),
        other => panic!("{other:?}"),
    }
}

#[test]
fn every_encoding_gives_the_same() {
    let ramp: Vec<f32> = (0..24).map(|n| n as f32).collect();
    for encoding in [Encoding::Implicit, Encoding::Explicit, Encoding::BigEndian] {
        let whole = encoding.file(&slices());
        let bare = encoding.elements(&slices());
        for bytes in [whole, bare] {
            let reading = read_frame(bytes, None).unwrap();
            assert_eq!(reading.volume.shape, [3, 2, 4]);
            assert_eq!(reading.volume.voxels, ramp);
            assert_eq!(reading.facts.warnings, Vec::<String>::new());
            assert_eq!(reading.facts.format, FileFormat::DicomNm);
        }
    }
}

#[test]
fn sequences_of_unknown_representation_are_in_implicit_vr() {
    let implicit = |tag: [u16; 2], length: u32, value: &[u8]| {
        let mut bytes: Vec<u8> = tag.iter().flat_map(|n| n.to_le_bytes()).collect();
        bytes.extend(length.to_le_bytes());
        bytes.extend(value);
        bytes
    };
    let end_of_item = implicit([0xfffe, 0xe00d], 0, b"");
    let end_of_sequence = implicit([0xfffe, 0xe0dd], 0, b"");
    // A text whose length looks like no VR, then a sequence of undefined length, and one of defined length.
    let text = implicit([0x09, 0x1001], 4, b"text");
    let begin = implicit([0xfffe, 0xe000], u32::MAX, b"");
    let inner = [
        begin.clone(),
        text.clone(),
        end_of_item.clone(),
        end_of_sequence.clone(),
    ]
    .concat();
    let item = implicit([0xfffe, 0xe000], text.len() as u32, &text);
    let content = [
        begin,
        text,
        implicit([0x09, 0x1002], u32::MAX, &inner),
        implicit([0x08, 0x1140], item.len() as u32, &item),
        end_of_item,
        end_of_sequence,
    ]
    .concat();
    let elements = Encoding::Explicit.elements(&slices());
    let nm = elements
        .windows(4)
        .position(|tag| tag == [0x08, 0, 0x60, 0])
        .unwrap();
    let mut unknown = vec![0x08, 0, 0x12, 0x21];
    unknown.extend(b"UN\0\0");
    unknown.extend(u32::MAX.to_le_bytes());
    let data_set = [
        &elements[..nm + 10],
        &unknown,
        &content,
        &elements[nm + 10..],
    ]
    .concat();
    let found = read_frame(with_meta(Encoding::Explicit.uid(), data_set), None).unwrap();
    assert_eq!(
        found.volume.voxels,
        read_elements(&slices()).unwrap().volume.voxels
    );
}

#[test]
fn slices_lie_where_the_standard_puts_them() {
    let reading = read_elements(&slices()).unwrap();
    let (x, y) = (Vec3::from(ROW_DIRECTION), Vec3::from(COLUMN_DIRECTION));
    for (i, j, k) in [(0, 0, 0), (2, 0, 0), (0, 1, 0), (0, 0, 3), (2, 1, 3)] {
        let [i, j, k] = [i, j, k].map(f64::from);
        // Columns are 4 mm apart, rows 2.5, slices 5 against row x column.
        let expected =
            Vec3::new(10.0, -20.5, 30.0) + 4.0 * i * x + 2.5 * j * y - 5.0 * k * x.cross(&y);
        let at = reading.volume.frame.to_patient(&Vec3::new(i, j, k));
        // Single precision.
        assert!((at - expected).norm() < 1e-5);
    }
    assert_eq!(reading.facts.affine_source, AffineSource::ImagePosition);
    assert!(reading.volume.frame.is_left_handed());
}

#[test]
fn the_slice_vector_orders_the_frames() {
    let reading = changed(|e| {
        e.insert((0x54, 0x80), ("US", Shorts(vec![3, 1, 4, 2])));
    });
    let voxels = reading.unwrap().volume.voxels;
    let first_of_slices = [6.0, 18.0, 0.0, 12.0];
    for (slice, first) in first_of_slices.into_iter().enumerate() {
        assert_eq!(voxels[6 * slice], first);
        assert_eq!(voxels[6 * slice + 5], first + 5.0);
    }
    for wrong in [
        vec![1, 2, 3],
        vec![1, 2, 2, 4],
        vec![0, 1, 1, 3],
        vec![1, 2, 3, 5],
    ] {
        let result = changed(|e| {
            e.insert((0x54, 0x80), ("US", Shorts(wrong)));
        });
        assert_eq!(complaint(result).0, SLICE_VECTOR);
    }
    let without = changed(|e| {
        e.remove(&(0x54, 0x80));
    });
    assert!(without.unwrap().facts.warnings[0].contains("no Slice Vector"));
    let windows = |vector: Vec<u16>| {
        changed(|e| {
            let pointer = vec![0x54, 0x10, 0x54, 0x80];
            e.insert((0x28, 0x09), ("AT", Shorts(pointer)));
            e.insert((0x54, 0x10), ("US", Shorts(vector)));
        })
    };
    assert!(windows(vec![1; 4]).is_ok());
    assert_eq!(
        complaint(windows(vec![1, 1, 2, 2])).1,
        "(0054,0010) (0054,0080)"
    );
}

const SLICE_VECTOR: &str = "Slice Vector (0054,0080)";

#[test]
fn gates_are_volumes_of_their_own() {
    let bytes = Encoding::BigEndian.file(&gated());
    // Gate by gate the stored frames of the two slices.
    for (gate, frames) in [[2, 3], [0, 1], [6, 7], [5, 4]].into_iter().enumerate() {
        let reading = read_frame(bytes.clone(), Some(gate)).unwrap();
        assert_eq!(reading.volume.shape, [3, 2, 2]);
        assert_eq!(reading.facts.file_shape, [3, 2, 2, 4]);
        for (slice, frame) in frames.into_iter().enumerate() {
            assert_eq!(reading.volume.voxels[6 * slice], 6.0 * frame as f32);
        }
    }
    let files = [VolumeFile::in_memory("test", bytes)];
    let facts = inspect_volume(&files, &ReadLimits::default(), &Monitor::silent()).unwrap();
    assert_eq!((facts.frames, facts.frame), (4, None));
    assert_eq!(facts.intensity.sum, 47.0 * 24.0);
    let mut elements = gated();
    elements.remove(&(0x54, 0x70));
    let (field, value) = complaint(read_elements(&elements));
    assert_eq!(
        (field, &*value),
        ("Time Slot Vector (0054,0070)", "missing")
    );
}

/// The attributes of the beats of an R-R interval of about `nominal` ms.
fn said_of_interval(nominal: &'static str) -> Elements {
    BTreeMap::from([
        ((0x18, 0x1062), ("IS", Text(nominal))),
        ((0x18, 0x1063), ("DS", Text("212.5"))),
        ((0x18, 0x1081), ("IS", Text("700"))),
        ((0x18, 0x1082), ("IS", Text("1000"))),
        ((0x18, 0x1083), ("IS", Text("300"))),
        ((0x18, 0x1084), ("IS", Text("100"))),
    ])
}

/// Gates of two slices, of one R-R interval or of two, with the items of the Gated Information Sequence.
fn gates_with_timing(intervals: Vec<u16>, slots: Vec<u16>, said: Vec<Vec<Elements>>) -> Vec<u8> {
    let mut elements = gated();
    elements.insert((0x54, 0x60), ("US", Shorts(intervals)));
    elements.insert((0x54, 0x70), ("US", Shorts(slots)));
    let gate = |data| BTreeMap::from([((0x54, 0x63), ("SQ", Items(data)))]);
    let gates = said.into_iter().map(gate).collect();
    elements.insert((0x54, 0x62), ("SQ", Items(gates)));
    Encoding::Explicit.file(&elements)
}

#[test]
fn every_gate_is_read_with_the_timing_of_the_beats() {
    let read = |bytes: &[u8]| {
        let files = [VolumeFile::in_memory("test", bytes)];
        let limits = ReadLimits::default();
        crate::image::volume::read_gates(&files, false, &limits, &Monitor::silent()).unwrap()
    };
    let said = vec![vec![said_of_interval("850")]];
    let one = gates_with_timing(vec![1; 8], vec![1, 1, 2, 2, 3, 3, 4, 4], said);
    let reading = read(&one);
    assert_eq!(reading.gates.len(), 4);
    for (index, gate) in reading.gates.iter().enumerate() {
        let alone = read_frame(one.clone(), Some(index)).unwrap();
        assert_eq!(gate.voxels, alone.volume.voxels);
    }
    let timing = reading.timing;
    assert_eq!(
        (timing.rr_ms, timing.frame_time_ms),
        (Some(850.0), Some(212.5))
    );
    assert_eq!(
        (timing.low_rr_ms, timing.high_rr_ms),
        (Some(700.0), Some(1000.0))
    );
    assert_eq!(timing.rejected_share(), Some(0.25));
    // Of two intervals that with the most counts is taken, with its own timing, and the other is named.
    let two = |said| {
        gates_with_timing(
            vec![1, 1, 1, 1, 2, 2, 2, 2],
            vec![1, 1, 2, 2, 1, 1, 2, 2],
            said,
        )
    };
    let [shorter, longer] = ["850", "990"].map(said_of_interval);
    let forms = [
        (vec![vec![shorter.clone(), longer.clone()]], Some(990.0)),
        (vec![vec![shorter.clone()], vec![longer]], Some(990.0)),
        (vec![vec![shorter.clone()]], None),
    ];
    for (said, rr_ms) in forms {
        assert_eq!(read(&two(said)).timing.rr_ms, rr_ms);
    }
    let two = two(vec![vec![shorter]]);
    let reading = read(&two);
    let later = [2, 3].map(|frame| read_frame(two.clone(), Some(frame)).unwrap().volume.voxels);
    let found: Vec<_> = reading
        .gates
        .iter()
        .map(|gate| gate.voxels.clone())
        .collect();
    assert_eq!(found, later);
    assert_eq!(reading.frames, [2, 3]);
    let told = |warning: &String| warning.contains("2 R-R intervals of 2 gates: interval 2");
    assert!(reading.facts.warnings.iter().any(told));
    let gates = reading.facts.gates.unwrap();
    assert_eq!((gates.number, gates.intervals, gates.rr_ms), (2, 2, None));
}

#[test]
fn more_gates_stated_than_the_vectors_count_are_missing() {
    for (tag, name) in [
        ((0x54, 0x61), "Number of R-R Intervals (0054,0061)"),
        ((0x54, 0x71), "Number of Time Slots (0054,0071)"),
    ] {
        let mut elements = gated();
        elements.insert(tag, ("US", Shorts(vec![3])));
        let (field, value) = complaint(read_frame(Encoding::Explicit.file(&elements), Some(0)));
        assert_eq!((field, &*value), (name, "3"));
    }
}

#[test]
fn a_timing_that_is_no_duration_is_refused_by_its_name() {
    let mut elements = gated();
    let data = BTreeMap::from([((0x18, 0x1062), ("IS", Text("-850")))]);
    let gate = BTreeMap::from([((0x54, 0x63), ("SQ", Items(vec![data])))]);
    elements.insert((0x54, 0x62), ("SQ", Items(vec![gate])));
    let (field, value) = complaint(read_frame(Encoding::Explicit.file(&elements), Some(0)));
    assert_eq!((field, &*value), ("Nominal Interval (0018,1062)", "-850"));
}

#[test]
fn values_are_rescaled_trimmed_and_signed() {
    let scaled = changed(|e| {
        e.insert((0x28, 0x1052), ("DS", Text("-10")));
        e.insert((0x28, 0x1053), ("DS", Text("0.5")));
    });
    assert_eq!(scaled.unwrap().volume.voxels[3], -8.5);
    let real_world = changed(|e| {
        let slope = ((0x40, 0x9225), ("FD", Double(0.25)));
        let inter = ((0x40, 0x9224), ("FD", Double(1.0)));
        let map = BTreeMap::from([inter, slope]);
        e.insert((0x40, 0x9096), ("SQ", Items(vec![map])));
    });
    assert_eq!(real_world.unwrap().volume.voxels[2], 1.5);
    // 12 bits: the upper four are none of the value.
    let pixels: Vec<u16> = (0..24).map(|n| 0xa000 | (0x0fff - n)).collect();
    let trimmed = |signed: u16| {
        let reading = changed(|e| {
            e.insert((0x28, 0x101), ("US", Shorts(vec![12])));
            e.insert((0x28, 0x102), ("US", Shorts(vec![11])));
            e.insert((0x28, 0x103), ("US", Shorts(vec![signed])));
            e.insert((0x7fe0, 0x10), ("OW", Shorts(pixels.clone())));
        });
        reading.unwrap().volume.voxels[..2].to_vec()
    };
    assert_eq!(trimmed(0), [4095.0, 4094.0]);
    assert_eq!(trimmed(1), [-1.0, -2.0]);
    let none = changed(|e| {
        e.insert((0x28, 0x1053), ("DS", Text("0")));
    });
    assert_eq!(complaint(none).0, "Rescale Slope (0028,1053)");
}

#[test]
fn what_is_not_known_of_the_place_is_said() {
    let without = |tags: &[(u16, u16)]| {
        changed(|e| {
            if let Some((_, Items(detectors))) = e.get_mut(&(0x54, 0x22)) {
                tags.iter().for_each(|tag| drop(detectors[0].remove(tag)));
            }
            tags.iter().for_each(|tag| drop(e.remove(tag)));
        })
    };
    let facts = without(&[(0x20, 0x32)]).unwrap().facts;
    assert_eq!(facts.affine_source, AffineSource::UnknownOrigin);
    assert!(facts.warnings[0].contains("origin is placed at the centre"));
    let facts = without(&[(0x20, 0x37)]).unwrap().facts;
    assert_eq!(facts.affine_source, AffineSource::UnknownOrigin);
    assert!(facts.warnings[0].contains("supine patient are assumed"));
    let facts = without(&[(0x18, 0x88)]).unwrap().facts;
    assert!((facts.spacing_mm[2] - 6.0).abs() < 1e-6);
    assert!(facts.warnings[0].contains("Slice Thickness 6 is used"));
    let neither = without(&[(0x18, 0x88), (0x18, 0x50)]);
    assert_eq!(complaint(neither).0, "Spacing Between Slices (0018,0088)");
    let spacing = without(&[(0x28, 0x30)]);
    assert_eq!(
        complaint(spacing),
        ("Pixel Spacing (0028,0030)", "missing".into())
    );
}

#[test]
fn what_cannot_be_is_named() {
    for (tag, vr, value, field) in [
        (
            (0x18, 0x88),
            "DS",
            Text("0"),
            "Spacing Between Slices (0018,0088)",
        ),
        (
            (0x18, 0x88),
            "DS",
            Text("wide"),
            "Spacing Between Slices (0018,0088)",
        ),
        (
            (0x28, 0x02),
            "US",
            Shorts(vec![3]),
            "Samples per Pixel (0028,0002)",
        ),
        (
            (0x28, 0x08),
            "IS",
            Text("0"),
            "Number of Frames (0028,0008)",
        ),
        (
            (0x28, 0x08),
            "IS",
            Text("1e9"),
            "Number of Frames (0028,0008)",
        ),
        ((0x28, 0x10), "US", Shorts(vec![0]), "Rows (0028,0010)"),
        (
            (0x28, 0x30),
            "DS",
            Text("4\\-4"),
            "Pixel Spacing (0028,0030)",
        ),
        ((0x28, 0x30), "DS", Text("4"), "Pixel Spacing (0028,0030)"),
        (
            (0x28, 0x100),
            "US",
            Shorts(vec![12]),
            "Bits Allocated (0028,0100)",
        ),
        (
            (0x28, 0x101),
            "US",
            Shorts(vec![17]),
            "Bits Stored (0028,0101)",
        ),
        ((0x28, 0x102), "US", Shorts(vec![7]), "High Bit (0028,0102)"),
        (
            (0x28, 0x103),
            "US",
            Shorts(vec![2]),
            "Pixel Representation (0028,0103)",
        ),
    ] {
        let result = changed(|e| {
            e.insert(tag, (vr, value));
        });
        assert_eq!(complaint(result).0, field);
    }
    let bent = changed(|e| {
        if let Some((_, Items(detectors))) = e.get_mut(&(0x54, 0x22)) {
            detectors[0].insert((0x20, 0x37), ("DS", Text("1\\0\\0\\1\\0\\0")));
        }
    });
    assert_eq!(complaint(bent).0, "Image Orientation (Patient) (0020,0037)");
    let blind = changed(|e| {
        e.remove(&(0x7fe0, 0x10));
    });
    assert_eq!(
        complaint(blind),
        ("Pixel Data (7FE0,0010)", "missing".into())
    );
    let short = changed(|e| {
        e.insert((0x7fe0, 0x10), ("OW", Shorts((0..23).collect())));
    });
    assert!(matches!(short, Err(VolumeError::Truncated { .. })));
}

#[test]
fn planar_pictures_and_maps_are_refused() {
    for (image_type, shown) in [
        ("ORIGINAL\\PRIMARY\\TOMO\\TRANSMISSION", "transmission"),
        ("ORIGINAL\\PRIMARY\\DYNAMIC\\EMISSION", "planar"),
        ("ORIGINAL\\PRIMARY\\STATIC\\EMISSION", "planar"),
        ("ORIGINAL\\PRIMARY\\WHOLE BODY\\EMISSION", "planar"),
        ("ORIGINAL\\PRIMARY", "only RECON TOMO"),
    ] {
        let result = changed(|e| {
            e.insert((0x08, 0x08), ("CS", Text(image_type)));
        });
        match result {
            Err(VolumeError::NotSlices { reason, .. }) => assert!(reason.contains(shown)),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn hostile_files_cost_nothing() {
    // Sequences inside sequences, as deep as 400 kB reach.
    let mut nested = Vec::new();
    for _ in 0..20_000 {
        nested.extend([0x54, 0, 0x22, 0, b'S', b'Q', 0, 0, 0xff, 0xff, 0xff, 0xff]);
        nested.extend([0xfe, 0xff, 0, 0xe0, 0xff, 0xff, 0xff, 0xff]);
    }
    let deep = read_frame(with_meta(Encoding::Explicit.uid(), nested), None);
    assert_eq!(complaint(deep), ("depth of sequences", "33".into()));
    // An element of nearly 4 GiB in a small file, plain and packed.
    let mut long = vec![0x08, 0, 0x70, 0, b'U', b'N', 0, 0, 0xfe, 0xff, 0xff, 0xff];
    long.extend([0; 500]);
    let long = with_meta(Encoding::Explicit.uid(), long);
    assert!(matches!(
        read_frame(long.clone(), None),
        Err(VolumeError::Truncated { .. })
    ));
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut packed, &long).unwrap();
    let packed = read_frame(packed.finish().unwrap(), None);
    assert!(matches!(packed, Err(VolumeError::Truncated { .. })));
    // Meta information that claims to be 4 GiB long.
    let mut meta = vec![0; 128];
    meta.extend(b"DICM");
    meta.extend([2, 0, 1, 0, b'O', b'B', 0, 0, 0xff, 0xff, 0xff, 0xff]);
    assert_eq!(complaint(read_frame(meta, None)).1, "cut off");
    // An attribute that matters, longer than it may be.
    let vector = vec![1; 600_000];
    let mut bytes = vec![0x28, 0, 0x10, 0, b'U', b'N', 0, 0];
    bytes.extend((2 * vector.len() as u32).to_le_bytes());
    bytes.extend(vector.iter().flat_map(|n: &u16| n.to_le_bytes()));
    let long = read_frame(with_meta(Encoding::Explicit.uid(), bytes), None);
    assert_eq!(
        complaint(long),
        ("Rows (0028,0010)", "1200000 bytes long".into())
    );
}

#[test]
fn cut_files_are_refused_at_every_byte() {
    for encoding in [Encoding::Implicit, Encoding::Explicit, Encoding::BigEndian] {
        let whole = encoding.file(&slices());
        for cut in 0..whole.len() {
            assert!(
                read_frame(whole[..cut].to_vec(), None).is_err(),
                "cut at {cut}"
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    /// Damage of any bytes: an error, or voxels as many as the shape says.
    #[test]
    fn damage_never_panics(
        changes in prop::collection::vec((128_usize..900, any::<u8>()), 1..6),
        encoding in 0_usize..3,
        gates: bool,
    ) {
        let encoding = [Encoding::Implicit, Encoding::Explicit, Encoding::BigEndian][encoding];
        let elements = if gates { gated() } else { slices() };
        let mut bytes = encoding.file(&elements);
        for (at, value) in changes {
            let at = at % bytes.len();
            bytes[at] = value;
        }
        let limits = ReadLimits { voxels: 1 << 16, unpacked_bytes: 1 << 20, ..ReadLimits::DEFAULT };
        let files = [VolumeFile::in_memory("damaged", bytes)];
        for frame in [None, Some(0), Some(1)] {
            let options = ReadOptions { frame };
            if let Ok(reading) = read_volume(&files, &options, &limits, &Monitor::silent()) {
                let count: usize = reading.volume.shape.iter().product();
                prop_assert_eq!(reading.volume.voxels.len(), count);
                prop_assert!(count <= 1 << 16);
            }
        }
    }
}
