//! What files of one volume must agree on: slices, gates in files and gates in series, in any order of the files.

use super::objects::{ct, files, item, timed_gate};
use super::*;

/// An attribute as part of a data set.
type Says = fn(&'static str) -> Elements;

macro_rules! says {
    ($group:literal, $element:literal, $vr:literal) => {
        |value| item(($group, $element), $vr, Text(value))
    };
    ($sequence:expr => $group:literal, $element:literal, $vr:literal) => {
        |value| {
            let inner = item(($group, $element), $vr, Text(value));
            let around = |content, tag: &(u16, u16)| item(*tag, "SQ", Items(vec![content]));
            $sequence.iter().rev().fold(inner, around)
        }
    };
}

/// Statements about the scan: the name in the error, two that contradict each other, and another spelling of the first.
const STATED: &[(&str, Says, [&str; 3])] = &[
    (
        "Patient ID (0010,0020)",
        says!(0x10, 0x20, "LO"),
        ["F1", "F2", "F1 "],
    ),
    (
        "Patient's Name (0010,0010)",
        says!(0x10, 0x10, "PN"),
        ["Doe^John", "Roe^John", "DOE^JOHN^^"],
    ),
    (
        "Patient's Name (0010,0010)",
        says!(0x10, 0x10, "PN"),
        ["Doe^John^M", "Doe^Jane", "Doe^John"],
    ),
    (
        "Issuer of Patient ID (0010,0021)",
        says!(0x10, 0x21, "LO"),
        ["CLINIC A", "CLINIC B", "Clinic  A"],
    ),
    (
        "Patient's Birth Date (0010,0030)",
        says!(0x10, 0x30, "DA"),
        ["19500101", "19510101", "1950.01.01"],
    ),
    (
        "Patient's Sex (0010,0040)",
        says!(0x10, 0x40, "CS"),
        ["M", "F", "m"],
    ),
    (
        "Study Instance UID (0020,000D)",
        says!(0x20, 0x0d, "UI"),
        ["1.2.3", "1.2.4", "1.2.3\0"],
    ),
    (
        "Study Date (0008,0020)",
        says!(0x08, 0x20, "DA"),
        ["20250310", "20250311", "2025.03.10"],
    ),
    (
        "Frame of Reference UID (0020,0052)",
        says!(0x20, 0x52, "UI"),
        ["1.7", "1.8", "1.7\0"],
    ),
    (
        "Units (0054,1001)",
        says!(0x54, 0x1001, "CS"),
        ["BQML", "CNTS", "BQML "],
    ),
    (
        "SUV Type (0054,1006)",
        says!(0x54, 0x1006, "CS"),
        ["BW", "LBM", "bw"],
    ),
    (
        "Counts Source (0054,1002)",
        says!(0x54, 0x1002, "CS"),
        ["EMISSION", "OTHER", "EMISSION "],
    ),
    (
        "Manufacturer (0008,0070)",
        says!(0x08, 0x70, "LO"),
        ["GE", "SIEMENS", "Ge"],
    ),
    (
        "Manufacturer's Model Name (0008,1090)",
        says!(0x08, 0x1090, "LO"),
        ["One Two", "Three", "one  two"],
    ),
    (
        "Rescale Type (0028,1054)",
        says!(0x28, 0x1054, "LO"),
        ["HU", "US", "hu"],
    ),
    (
        "Patient Position (0018,5100)",
        says!(0x18, 0x5100, "CS"),
        ["HFS", "FFS", "HFS "],
    ),
    (
        "Corrected Image (0028,0051)",
        says!(0x28, 0x51, "CS"),
        ["ATTN\\DECY", "DECY", "DECY\\ATTN"],
    ),
    (
        "Attenuation Correction Method (0054,1101)",
        says!(0x54, 0x1101, "LO"),
        ["CT", "none", "ct"],
    ),
    (
        "Scatter Correction Method (0054,1105)",
        says!(0x54, 0x1105, "LO"),
        ["model", "none", "Model"],
    ),
    (
        "Randoms Correction Method (0054,1100)",
        says!(0x54, 0x1100, "CS"),
        ["DLYD", "NONE", "dlyd"],
    ),
    (
        "Decay Correction (0054,1102)",
        says!(0x54, 0x1102, "CS"),
        ["START", "ADMIN", "start"],
    ),
    (
        "Reconstruction Method (0054,1103)",
        says!(0x54, 0x1103, "LO"),
        ["OSEM 2i 8s", "FBP", "osem  2i 8s"],
    ),
    (
        "Convolution Kernel (0018,1210)",
        says!(0x18, 0x1210, "SH"),
        ["Gauss 5", "Hann", "gauss 5"],
    ),
    (
        "Radiopharmaceutical (0018,0031)",
        says!([(0x54, 0x16)] => 0x18, 0x31, "LO"),
        ["Tetrofosmin", "Sestamibi", "TETROFOSMIN"],
    ),
    (
        "Radiopharmaceutical Code (0054,0304)",
        says!([(0x54, 0x16), (0x54, 0x304)] => 0x08, 0x104, "LO"),
        ["Ammonia N^13^", "Rubidium chloride", "AMMONIA N^13^"],
    ),
    (
        "Radionuclide Code (0054,0300)",
        says!([(0x54, 0x16), (0x54, 0x300)] => 0x08, 0x104, "LO"),
        ["^99m^Technetium", "^201^Thallium", "^99M^Technetium"],
    ),
    (
        "Radionuclide Total Dose (0018,1074)",
        says!([(0x54, 0x16)] => 0x18, 0x1074, "DS"),
        ["740", "250", "7.40E+02"],
    ),
    (
        "Radiopharmaceutical Start Time (0018,1072)",
        says!([(0x54, 0x16)] => 0x18, 0x1072, "TM"),
        ["091500", "131500", "09:15:00.000000"],
    ),
    (
        "Energy Window Lower Limit (0054,0014)",
        says!([(0x54, 0x12), (0x54, 0x13)] => 0x54, 0x14, "DS"),
        ["126", "68", "126.0"],
    ),
    (
        "Energy Window Upper Limit (0054,0015)",
        says!([(0x54, 0x13)] => 0x54, 0x15, "DS"),
        ["650", "665", "650.000"],
    ),
];

/// Statements that differ from slice to slice of one scan.
const VARYING: &[(Says, [&str; 2])] = &[
    (says!(0x08, 0x32, "TM"), ["091500", "093000"]),
    (says!(0x08, 0x33, "TM"), ["091500", "093000"]),
    (says!(0x08, 0x22, "DA"), ["20250310", "20250311"]),
    (says!(0x20, 0x12, "IS"), ["1", "2"]),
    (says!(0x28, 0x1053, "DS"), ["1", "0.5"]),
    (says!(0x54, 0x1300, "DS"), ["0", "1000"]),
    (says!(0x18, 0x1242, "IS"), ["60000", "90000"]),
    (says!(0x54, 0x1321, "DS"), ["1.01", "1.09"]),
    (says!(0x08, 0x103e, "LO"), ["PET", "PET bed 2"]),
    (
        says!(0x08, 0x08, "CS"),
        ["ORIGINAL\\PRIMARY", "ORIGINAL\\PRIMARY\\AXIAL"],
    ),
    (says!(0x10, 0x20, "LO"), ["F1", ""]),
    (says!(0x28, 0x51, "CS"), ["ATTN", ""]),
];

/// Four slices of a PET series; the upper two say `of_upper`, the others `of_lower`.
fn slices_of(of_lower: &Elements, of_upper: &Elements) -> Vec<Elements> {
    let slice = |n: usize| {
        let mut slice = ct(["0", "3", "6", "9"][n], 10 * n as u16);
        slice.insert((0x08, 0x16), ("UI", Text("1.2.840.10008.5.1.4.1.1.128")));
        slice.insert((0x08, 0x60), ("CS", Text("PT")));
        slice.insert((0x20, 0x13), ("IS", written(n + 1)));
        slice.extend(if n < 2 {
            of_lower.clone()
        } else {
            of_upper.clone()
        });
        slice
    };
    (0..4).map(slice).collect()
}

/// What is said of `images`, whatever the order in which their files are given; files have names by their place.
fn said(images: &[Elements]) -> Result<(), String> {
    let all = files(images);
    let orders = [0, 1, all.len() / 2].map(|turn| {
        let mut files = all.clone();
        files.rotate_left(turn);
        files
    });
    let reversed = all.iter().rev().cloned().collect();
    let told: Vec<Result<(), String>> = (orders.into_iter().chain([reversed]))
        .map(|files| {
            let (options, limits) = (ReadOptions::default(), ReadLimits::default());
            let read = read_volume(&files, &options, &limits, &Monitor::silent());
            read.map(|_| ()).map_err(|error| error.to_string())
        })
        .collect();
    assert!(told.iter().all(|other| *other == told[0]), "{told:?}");
    told[0].clone()
}

fn is_refused_by(told: &Result<(), String>, name: &str, [first, second]: [&str; 2]) {
    let Err(text) = told else {
        panic!("{name} of two scans was read");
    };
    let first = format!("{name} is \"{first}\" in ");
    let second = format!("\"{}\" in ", second.trim_matches('\0'));
    assert!(text.contains(&first) && text.contains(&second), "{text}");
}

#[test]
fn slices_of_two_scans_are_refused_by_the_attribute_that_tells() {
    for (name, says, [one, other, spelled]) in STATED {
        let told = said(&slices_of(&says(one), &says(other)));
        is_refused_by(&told, name, [one, other]);
        let text = told.unwrap_err();
        let of_files = [
            "files, such as 0 (Instance Number 1), and",
            "files, such as 2 (Instance Number 3)",
        ];
        assert!(of_files.iter().all(|part| text.contains(part)), "{text}");
        for same in [says(one), says(spelled), says("")] {
            let told = said(&slices_of(&says(one), &same));
            assert_eq!(told, Ok(()), "{name} as {spelled}");
        }
    }
    for (says, [one, other]) in VARYING {
        assert_eq!(
            said(&slices_of(&says(one), &says(other))),
            Ok(()),
            "{one} {other}"
        );
    }
}

#[test]
fn every_attribute_that_differs_is_named() {
    let of = |id, name| {
        let mut all = item((0x10, 0x20), "LO", Text(id));
        all.extend(item((0x10, 0x10), "PN", Text(name)));
        all
    };
    let told = said(&slices_of(&of("F1", "Doe^John"), &of("F2", "Roe^Jane"))).unwrap_err();
    assert!(
        told.contains("they differ in Patient's Name (0010,0010) too"),
        "{told}"
    );
}

#[test]
fn gates_of_two_scans_are_refused_by_the_attribute_that_tells() {
    let of_gates: &[(&str, Says, [&str; 3])] = &[
        (
            "Acquisition Time (0008,0032)",
            says!(0x08, 0x32, "TM"),
            ["091500", "131500", "091501.5"],
        ),
        (
            "Acquisition Date (0008,0022)",
            says!(0x08, 0x22, "DA"),
            ["20250310", "20250311", "2025.03.10"],
        ),
        (
            "Image Type (0008,0008)",
            says!(0x08, 0x08, "CS"),
            [
                "ORIGINAL\\PRIMARY\\RECON TOMO\\EMISSION",
                "DERIVED\\PRIMARY\\RECON TOMO\\EMISSION",
                "ORIGINAL\\PRIMARY\\RECON TOMO",
            ],
        ),
        (
            "rest or stress (by protocol and descriptions)",
            says!(0x08, 0x103e, "LO"),
            ["Stress gate", "Rest gate", "STRESS 2"],
        ),
    ];
    for (name, says, [one, other, spelled]) in STATED.iter().chain(of_gates) {
        let gates = |of_last: Elements| {
            let gate = |n: usize| {
                let mut gate = timed_gate(n, "1.2.9");
                gate.extend(if n == 7 { of_last.clone() } else { says(one) });
                gate
            };
            (0..8).map(gate).collect::<Vec<_>>()
        };
        let values = match name.contains("rest or stress") {
            true => ["stress", "rest"],
            false => [*one, *other],
        };
        is_refused_by(&said(&gates(says(other))), name, values);
        assert_eq!(said(&gates(says(spelled))), Ok(()), "{name} as {spelled}");
    }
    // One by one, as a beat is told what its gates are, no other patient's gate is taken either.
    let gate = |n: usize| {
        let mut gate = super::objects::one_gate(n, "1.2.9");
        gate.extend(item(
            (0x10, 0x20),
            "LO",
            Text(if n == 4 { "F2" } else { "F1" }),
        ));
        gate
    };
    let images: Vec<Elements> = (0..8).map(gate).collect();
    let (limits, quiet) = (ReadLimits::default(), Monitor::silent());
    let told =
        crate::image::volume::read_gates(&files(&images), false, &limits, &quiet).unwrap_err();
    assert!(
        matches!(told, VolumeError::OtherGate { gate: 5, .. }),
        "{told}"
    );
    assert!(
        told.to_string()
            .contains("Patient ID (0010,0020) is \"F1\""),
        "{told}"
    );
}

/// Gate `n` of a gated PET scan: a series of two slices.
fn gate_of_pet(n: usize) -> [Elements; 2] {
    [0, 1].map(|slice: usize| {
        let mut elements = ct(["0", "3"][slice], (100 * n + 10 * slice) as u16);
        elements.extend([
            ((0x08, 0x16), ("UI", Text("1.2.840.10008.5.1.4.1.1.128"))),
            ((0x08, 0x18), ("UI", written(format!("1.{n}.{slice}")))),
            ((0x08, 0x60), ("CS", Text("PT"))),
            ((0x18, 0x1060), ("DS", written(112.5 * n as f64))),
            ((0x18, 0x1062), ("IS", Text("900"))),
            ((0x20, 0x0e), ("UI", written(format!("1.9.{n}")))),
            ((0x20, 0x11), ("IS", written(100 + n))),
            ((0x20, 0x13), ("IS", written(slice + 1))),
            ((0x28, 0x1052), ("DS", Text("0"))),
            ((0x54, 0x71), ("US", Shorts(vec![8]))),
            ((0x54, 0x81), ("US", Shorts(vec![2]))),
            ((0x54, 0x1000), ("CS", Text("GATED\\IMAGE"))),
        ]);
        elements
    })
}

#[test]
fn a_series_for_each_gate_of_pet_is_a_gated_study() {
    let (limits, quiet) = (ReadLimits::default(), Monitor::silent());
    let mut images: Vec<Elements> = (0..8).flat_map(gate_of_pet).collect();
    assert_eq!(said(&images), Ok(()));
    images.reverse();
    let reading =
        crate::image::volume::read_gates(&files(&images), false, &limits, &quiet).unwrap();
    assert_eq!(reading.gates.len(), 8);
    for (n, gate) in reading.gates.iter().enumerate() {
        let first = 100.0 * n as f32;
        assert_eq!([gate.voxels[0], gate.voxels[6]], [first, first + 10.0]);
        let uids = [0, 1].map(|slice| format!("1.{n}.{slice}"));
        assert_eq!(reading.scans[n].instance_uids, uids);
        assert_eq!(reading.scans[n].series_uid, Some(format!("1.9.{n}")));
    }
    assert_eq!(reading.timing.rr_ms, Some(900.0));
    let warnings = reading.facts.warnings.join(" ");
    assert!(
        warnings.contains("8 series of one volume each were taken"),
        "{warnings}"
    );
    assert!(!warnings.contains("missing"), "{warnings}");
    // Two beats, a gate that is missing, one of another patient or no gate: refused with what they are.
    let changed = |change: &dyn Fn(usize, &mut Elements)| {
        let mut images: Vec<Elements> = (0..8).flat_map(gate_of_pet).collect();
        for (at, image) in images.iter_mut().enumerate() {
            change(at / 2, image);
        }
        said(&images).unwrap_err()
    };
    let told = changed(&|n, image| {
        drop(image.insert((0x18, 0x1060), ("DS", written(100 * (n % 4)))));
    });
    assert!(told.contains("they belong to 8 series"), "{told}");
    let told = changed(&|n, image| {
        if n == 5 {
            image.insert((0x10, 0x20), ("LO", Text("F2")));
        } else {
            image.insert((0x10, 0x20), ("LO", Text("F1")));
        }
    });
    assert!(
        told.contains("not of one scan: Patient ID (0010,0020)"),
        "{told}"
    );
    let told = changed(&|n, image| {
        if n == 5 {
            image.insert((0x54, 0x1000), ("CS", Text("DYNAMIC\\IMAGE")));
        }
    });
    assert!(told.contains("Series Type (0054,1000) DYNAMIC"), "{told}");
    let seven: Vec<Elements> = (0..7).flat_map(gate_of_pet).collect();
    assert!(
        said(&seven)
            .unwrap_err()
            .contains("they belong to 7 series")
    );
}

/// Six reconstructions of one series are listed with what differs, whatever nothing says of gates.
#[test]
fn scans_of_one_series_are_listed_with_what_differs() {
    let names = [
        "STRESS FBP",
        "STRESS OSEM",
        "STRESS OSEM AC",
        "REST FBP",
        "REST OSEM",
        "REST OSEM AC",
    ];
    let image = |n: usize| {
        let mut image = super::objects::one_gate(n, "1.2.9");
        image.extend([
            (
                (0x08, 0x32),
                ("TM", Text(if n < 3 { "091500" } else { "131500" })),
            ),
            ((0x08, 0x103e), ("LO", Text(names[n]))),
            (
                (0x28, 0x51),
                ("CS", Text(if n % 3 == 2 { "ATTN" } else { "UNIF" })),
            ),
        ]);
        image
    };
    let images: Vec<Elements> = (0..6).map(image).collect();
    let told = said(&images).unwrap_err();
    for part in [
        "they are 6 scans",
        "2 (a Nuclear Medicine image): series number 3 \"STRESS OSEM AC\" (UID 1.2.9; Corrected Image (0028,0051) ATTN",
        "Acquisition Time (0008,0032) 131500",
        "send one of them alone",
        "do not all say that they are gates",
    ] {
        assert!(told.contains(part), "{told}");
    }
}
