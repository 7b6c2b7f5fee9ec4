//! Frames at one place are dealt out to volumes by what the header says, whatever the order of the files.

use super::objects::{ct, group, item};
use super::*;
use proptest::sample::select;

const SLICE_COUNT: usize = 4;
const VOLUME_COUNT: usize = 3;

/// The first voxel of a slice.
fn first_voxel(volume: usize, slice: usize) -> u16 {
    (1000 * volume + 10 * slice) as u16
}

/// The slice of a volume, without anything that tells the volume.
fn plain(volume: usize, slice: usize) -> Elements {
    let mut elements = ct("0", first_voxel(volume, slice));
    elements.extend([
        ((0x08, 0x18), ("UI", written(format!("1.{volume}.{slice}")))),
        (
            (0x20, 0x32),
            ("DS", written(format!("1\\2\\{}", 3 * slice))),
        ),
        ((0x28, 0x1052), ("DS", Text("0"))),
    ]);
    elements
}

/// Statements of one frame about its volume and slice.
type Said = fn(usize, usize) -> Vec<((u16, u16), (&'static str, Value))>;

/// One value of one attribute.
macro_rules! says {
    ($tag:expr, $vr:literal, |$v:ident, $s:ident| $value:expr) => {
        |$v: usize, $s: usize| {
            let _ = ($v, $s);
            vec![($tag, ($vr, $value))]
        }
    };
}

/// Every attribute of a file that tells volumes apart, with values as scanners write them.
const TELLING_ATTRIBUTES: &[Said] = &[
    says!((0x20, 0x100), "IS", |v, s| written(v + 1)),
    // Of the first volume nothing is said.
    |v, _| match v {
        0 => Vec::new(),
        _ => vec![((0x18, 0x1060), ("DS", written(300 * v)))],
    },
    // Slices one after the other within each volume.
    says!((0x18, 0x1060), "DS", |v, s| written(500 * v + 7 * s)),
    // Even steps, at another heart rate for every slice.
    says!((0x18, 0x1060), "DS", |v, s| written(v * (300 + 140 * s))),
    says!((0x20, 0x9153), "FD", |v, s| Double(250.5 * v as f64)),
    says!((0x20, 0x9241), "FD", |v, s| Double(12.5 * v as f64)),
    says!((0x18, 0x1081), "IS", |v, s| written(600 + 200 * v)),
    says!((0x54, 0x1300), "DS", |v, s| written(60_000 * v + 30_000)),
    says!((0x18, 0x86), "IS", |v, s| written(v + 1)),
    says!((0x18, 0x81), "DS", |v, s| written(2.4 + 2.4 * v as f64)),
    says!((0x18, 0x82), "DS", |v, s| written(100 * (v + 1))),
    says!((0x18, 0x1314), "DS", |v, s| written(5 * (v + 1))),
    says!((0x18, 0x9087), "FD", |v, s| Double(500.0 * v as f64)),
    says!((0x18, 0x60), "DS", |v, s| written(80 + 20 * v)),
    says!((0x08, 0x08), "CS", |v, s| Text(
        [
            "ORIGINAL\\PRIMARY\\A",
            "ORIGINAL\\PRIMARY\\B",
            "ORIGINAL\\PRIMARY\\C"
        ][v]
    )),
    says!((0x18, 0x1210), "SH", |v, s| Text(["B10", "B30", "B70"][v])),
    says!((0x08, 0x2a), "DT", |v, s| written(format!(
        "2025011510{:02}",
        10 + v
    ))),
    // Times of equal meaning, written in different ways.
    says!((0x08, 0x32), "TM", |v, s| written(match s {
        0 => format!("10{}", 30 + v),
        1 => format!("10{}00", 30 + v),
        2 => format!("10:{}:00.0", 30 + v),
        _ => format!("10{}00.000000", 30 + v),
    })),
    // Over midnight, slice after slice.
    |v, s| {
        let (date, hour) = [("20250114", 23), ("20250115", 0), ("20250115", 1)][v];
        vec![
            ((0x08, 0x22), ("DA", Text(date))),
            ((0x08, 0x32), ("TM", written(format!("{hour:02}10{s:02}")))),
        ]
    },
    says!((0x20, 0x12), "IS", |v, s| written(v + 4)),
    says!((0x54, 0x1330), "US", |v, s| Shorts(vec![
        (v * SLICE_COUNT + s + 1) as u16
    ])),
    // Image Index outranks Instance Numbers that begin again or run through the slices.
    |v, s| {
        let index = (v * SLICE_COUNT + SLICE_COUNT - s) as u16;
        vec![
            (
                (0x20, 0x13),
                ("IS", written(s * VOLUME_COUNT + VOLUME_COUNT - v)),
            ),
            ((0x54, 0x1330), ("US", Shorts(vec![index]))),
        ]
    },
    says!((0x20, 0x13), "IS", |v, s| written(1 + v * SLICE_COUNT + s)),
    says!((0x20, 0x13), "IS", |v, s| written(
        1 + v * SLICE_COUNT + SLICE_COUNT - s
    )),
    // Slices were taken in two passes.
    says!((0x20, 0x13), "IS", |v, s| written(
        v * SLICE_COUNT + [0, 2, 1, 3][s]
    )),
    says!((0x08, 0x33), "TM", |v, s| written(format!(
        "10{:02}{:02}",
        10 + v,
        s
    ))),
    // Numbers of the files are no reason to doubt a trigger.
    |v, s| {
        vec![
            ((0x18, 0x1060), ("DS", written(300 * v))),
            ((0x20, 0x13), ("IS", written((7 * s + 5 * v) % 12))),
        ]
    },
];

/// Every attribute of a frame that tells volumes apart: its sequence, and its value.
fn of_frame(kind: usize, v: usize, s: usize) -> ((u16, u16), Elements) {
    let content = (0x20, 0x9111);
    let unassigned = (0x20, 0x9171);
    let number = v as u32 + 1;
    let (sequence, tag, vr, value) = match kind {
        0 => (content, (0x20, 0x9128), "UL", Longs(vec![number])),
        1 => (
            content,
            (0x20, 0x9157),
            "UL",
            Longs(vec![1, s as u32 + 1, number]),
        ),
        2 => (
            content,
            (0x20, 0x9157),
            "UL",
            Longs(vec![number, s as u32 + 1]),
        ),
        3 => (
            content,
            (0x18, 0x9074),
            "DT",
            written(format!("2025011510300{v}.5")),
        ),
        4 => (
            content,
            (0x18, 0x9151),
            "DT",
            written(format!("202501151{v}30{s:02}")),
        ),
        5 => (content, (0x20, 0x9156), "US", Shorts(vec![v as u16 + 1])),
        6 => (content, (0x20, 0x9056), "SH", written(v)),
        7 => (
            (0x18, 0x9118),
            (0x20, 0x9153),
            "FD",
            Double(300.0 * v as f64),
        ),
        8 => (
            (0x18, 0x9118),
            (0x20, 0x9252),
            "FD",
            Double(300.0 * v as f64 + s as f64),
        ),
        9 => (
            (0x18, 0x9118),
            (0x20, 0x9241),
            "FD",
            Double(33.0 * v as f64),
        ),
        10 => (
            (0x20, 0x9253),
            (0x20, 0x9255),
            "FD",
            Double(900.0 * v as f64),
        ),
        11 => (
            (0x20, 0x9253),
            (0x20, 0x9245),
            "FD",
            Double(33.0 * v as f64),
        ),
        12 => (
            (0x20, 0x9310),
            (0x20, 0x930d),
            "FD",
            Double(60.0 * v as f64),
        ),
        13 => ((0x18, 0x9114), (0x18, 0x9082), "FD", Double(2.4 * v as f64)),
        14 => (
            (0x18, 0x9117),
            (0x18, 0x9087),
            "FD",
            Double(500.0 * v as f64),
        ),
        15 => ((0x18, 0x9325), (0x18, 0x60), "DS", written(80 + 20 * v)),
        16 => (
            (0x18, 0x9751),
            (0x08, 0x9007),
            "CS",
            written(format!("ORIGINAL\\{v}")),
        ),
        17 => (unassigned, (0x20, 0x100), "IS", written(v + 1)),
        18 => (unassigned, (0x18, 0x1060), "DS", written(300 * v)),
        19 => (unassigned, (0x54, 0x1300), "DS", written(300 * v)),
        20 => (
            unassigned,
            (0x08, 0x32),
            "TM",
            written(format!("10{:02}00", 30 + v)),
        ),
        21 => {
            let index = (v * SLICE_COUNT + s + 1) as u16;
            (unassigned, (0x54, 0x1330), "US", Shorts(vec![index]))
        }
        _ => (unassigned, (0x20, 0x13), "IS", written(v * SLICE_COUNT + s)),
    };
    (sequence, item(tag, vr, value))
}
const KINDS_OF_FRAMES: usize = 23;

/// An Enhanced image of frames of the given volumes and slices.
fn enhanced(frames: &[(usize, usize)], say: &dyn Fn(usize, usize) -> Elements) -> Elements {
    let mut elements = objects::enhanced();
    let items = frames.iter().map(|(volume, slice)| {
        let mut groups = say(*volume, *slice);
        let position = written(format!("1\\2\\{}", 3 * slice));
        groups.extend([group((0x20, 0x9113), item((0x20, 0x32), "DS", position))]);
        groups
    });
    let pixels = frames.iter().flat_map(|(volume, slice)| {
        let first = first_voxel(*volume, *slice);
        first..first + 6
    });
    elements.extend([
        ((0x28, 0x08), ("IS", written(frames.len()))),
        ((0x5200, 0x9230), ("SQ", Items(items.collect()))),
        ((0x7fe0, 0x10), ("OW", Shorts(pixels.collect()))),
    ]);
    elements
}

/// Volume number `frame` and its facts.
fn read_volume_of(files: &[VolumeFile], frame: usize) -> Result<Reading, VolumeError> {
    let options = ReadOptions { frame: Some(frame) };
    read_volume(files, &options, &ReadLimits::default(), &Monitor::silent())
}

fn expected(volume: usize) -> Vec<f32> {
    let slices = (0..SLICE_COUNT).map(|slice| first_voxel(volume, slice));
    slices
        .flat_map(|first| (first..first + 6).map(f32::from))
        .collect()
}

fn every_slice() -> Vec<(usize, usize)> {
    let volumes = 0..VOLUME_COUNT;
    volumes
        .flat_map(|v| (0..SLICE_COUNT).map(move |s| (v, s)))
        .collect()
}

/// The files in the order `order`; each keeps its name.
fn uploaded(order: &[(usize, usize)], say: Said) -> Vec<VolumeFile> {
    let each = order.iter().map(|(volume, slice)| {
        let mut elements = plain(*volume, *slice);
        elements.extend(say(*volume, *slice));
        let name = format!("{volume}-{slice}.dcm");
        VolumeFile::in_memory(name, Encoding::Explicit.file(&elements))
    });
    each.collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn files_in_any_order_give_the_same_volumes(
        order in Just(every_slice()).prop_shuffle(),
        say in select(TELLING_ATTRIBUTES),
    ) {
        let (given, sorted) = (uploaded(&order, say), uploaded(&every_slice(), say));
        for volume in 0..VOLUME_COUNT {
            let reading = read_volume_of(&given, volume).unwrap();
            prop_assert_eq!(&reading.volume.voxels, &expected(volume));
            let known = read_volume_of(&sorted, volume).unwrap();
            prop_assert_eq!(format!("{:?}", reading.facts), format!("{:?}", known.facts));
            prop_assert_eq!(reading.provenance, known.provenance);
        }
        prop_assert!(read_volume_of(&given, VOLUME_COUNT).is_err());
        let facts = |files| inspect_volume(files, &ReadLimits::default(), &Monitor::silent());
        prop_assert_eq!(
            format!("{:?}", facts(&given)),
            format!("{:?}", facts(&sorted))
        );
    }

    #[test]
    fn frames_stored_in_any_order_give_the_same_volumes(
        order in Just(every_slice()).prop_shuffle(),
        kind in 0..KINDS_OF_FRAMES,
        encoding in select(&[Encoding::Implicit, Encoding::Explicit, Encoding::BigEndian][..]),
    ) {
        let say = |v: usize, s: usize| {
            let (sequence, content) = of_frame(kind, v, s);
            BTreeMap::from([group(sequence, content)])
        };
        let given = encoding.file(&enhanced(&order, &say));
        let given = [VolumeFile::in_memory("enhanced", given)];
        for volume in 0..VOLUME_COUNT {
            let reading = read_volume_of(&given, volume).unwrap();
            prop_assert_eq!(reading.volume.voxels, expected(volume), "kind {}", kind);
        }
    }

    /// R-R intervals and echoes: neither alone tells the volumes apart.
    #[test]
    fn two_attributes_tell_apart_what_one_does_not(
        order in Just([0, 1, 2, 3].map(|v| (0..SLICE_COUNT).map(move |s| (v, s)).collect::<Vec<_>>()).concat())
            .prop_shuffle(),
    ) {
        let say: Said = |v, _| vec![
            ((0x18, 0x1060), ("DS", written(400 * (v / 2)))),
            ((0x18, 0x81), ("DS", written(5 + v % 2))),
        ];
        let given = uploaded(&order, say);
        for volume in 0..4 {
            prop_assert_eq!(read_volume_of(&given, volume).unwrap().volume.voxels, expected(volume));
        }
    }

    /// The same words in whatever order the files are sent.
    #[test]
    fn what_nothing_tells_apart_is_refused_in_the_same_words(
        order in Just(every_slice()).prop_shuffle(),
        (say, word) in select(UNTELLING_ATTRIBUTES),
    ) {
        let error = |order: &[(usize, usize)]| match read_volume_of(&uploaded(order, say), 0) {
            Err(VolumeError::NotOneSeries { reason, .. }) => reason,
            other => panic!("{word}: {other:?}"),
        };
        let said = error(&order);
        prop_assert_eq!(&said, &error(&every_slice()));
        prop_assert!(said.contains(word), "{said}");
        if !word.starts_with("contradict") {
            prop_assert!(said.contains("0-0.dcm") && said.contains("lie at the same place"), "{said}");
        }
    }
}

/// Attributes that do not tell which images belong to one volume, with a word of the refusal.
const UNTELLING_ATTRIBUTES: &[(Said, &str)] = &[
    (|_, _| Vec::new(), "no attribute tells apart"),
    // Numbers that begin again in every volume.
    (
        says!((0x20, 0x13), "IS", |v, s| written(s + 1)),
        "no attribute tells apart",
    ),
    // Numbers that run through the volumes at each place, as every way of writing the files gives them.
    (
        says!((0x20, 0x13), "IS", |v, s| written(s * VOLUME_COUNT + v)),
        "Instance Number (0020,0013) differ",
    ),
    (
        says!((0x20, 0x13), "IS", |v, s| written(
            s * VOLUME_COUNT
                + if s.is_multiple_of(2) {
                    v
                } else {
                    VOLUME_COUNT - v
                }
        )),
        "Instance Number",
    ),
    // Blocks, but each with the slices in an order of its own.
    (
        says!((0x20, 0x13), "IS", |v, s| written(
            v * SLICE_COUNT + [[0, 1, 2, 3], [2, 0, 3, 1], [3, 1, 2, 0]][v][s]
        )),
        "Instance Number",
    ),
    // Delays that jitter about the delay of the slice.
    (
        says!((0x18, 0x1060), "DS", |v, s| written(
            300 * s + [5, 0, 9][(v + s) % 3]
        )),
        "Trigger Time (0018,1060) differ",
    ),
    // Times of writing, slice by slice.
    (
        says!((0x08, 0x33), "TM", |v, s| written(format!(
            "1000{:02}",
            s * VOLUME_COUNT + v
        ))),
        "Content Time",
    ),
    (
        |v, s| {
            vec![
                ((0x18, 0x1060), ("DS", written(300 * v))),
                ((0x20, 0x100), ("IS", written((v + s) % VOLUME_COUNT))),
            ]
        },
        "contradict each other",
    ),
];

#[test]
fn frames_that_nothing_tells_apart_are_named() {
    let say = |_: usize, s: usize| {
        let place = Longs(vec![s as u32 + 1]);
        BTreeMap::from([group((0x20, 0x9111), item((0x20, 0x9057), "UL", place))])
    };
    let given = Encoding::Explicit.file(&enhanced(&every_slice(), &say));
    let error = read_frame(given, Some(0)).unwrap_err().to_string();
    assert!(
        error.contains("of frame 1 and frame 5, which lie at the same place"),
        "{error}"
    );
}

#[test]
fn images_side_by_side_are_not_one_volume() {
    let say: Said = |v, s| {
        let position = written(format!("{}\\2\\{}", 1 + 200 * v, 3 * s));
        vec![
            ((0x20, 0x32), ("DS", position)),
            ((0x20, 0x100), ("IS", written(v))),
        ]
    };
    let error = read_volume_of(&uploaded(&every_slice(), say), 0).unwrap_err();
    let error = error.to_string();
    assert!(
        error.contains("0-0.dcm and 2-0.dcm lie side by side"),
        "{error}"
    );
}

#[test]
fn one_file_twice_is_one_image_in_any_order() {
    let mut order: Vec<(usize, usize)> = every_slice()[..SLICE_COUNT].to_vec();
    order.push((0, 1));
    let read = |order: &[(usize, usize)]| {
        let given = uploaded(order, |_, _| Vec::new());
        let reading = read_volume_of(&given, 0).unwrap();
        (reading.volume.voxels, format!("{:?}", reading.facts))
    };
    let first = read(&order);
    assert_eq!(first.0, expected(0));
    order.reverse();
    assert_eq!(read(&order), first);
}
