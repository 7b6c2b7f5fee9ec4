//! How slices lie, by attributes beside Image Orientation (Patient).

use super::*;

/// An item with a code.
fn code(value: &'static str, meaning: &'static str) -> Elements {
    BTreeMap::from([
        ((0x08, 0x100), ("SH", Text(value))),
        ((0x08, 0x104), ("LO", Text(meaning))),
    ])
}

/// A sequence of one item.
fn one(item: Elements) -> (&'static str, Value) {
    ("SQ", Items(vec![item]))
}

/// A Patient Orientation Code Sequence with this modifier.
fn modified(value: &'static str, meaning: &'static str) -> (&'static str, Value) {
    let mut lying = code("102538003", "recumbent");
    lying.insert((0x54, 0x412), one(code(value, meaning)));
    one(lying)
}

fn detector(e: &mut Elements) -> &mut Elements {
    match e.get_mut(&(0x54, 0x22)) {
        Some((_, Items(detectors))) => &mut detectors[0],
        _ => panic!("no detector"),
    }
}

/// The file with Image Orientation (Patient) `stated`, after `change`.
fn with(
    stated: Option<&'static str>,
    change: impl FnOnce(&mut Elements),
) -> Result<Reading, VolumeError> {
    changed(|e| {
        match stated {
            Some(cosines) => detector(e).insert((0x20, 0x37), ("DS", Text(cosines))),
            None => detector(e).remove(&(0x20, 0x37)),
        };
        change(e);
    })
}

/// The warnings about a readable file, as one text.
fn said(reading: Result<Reading, VolumeError>) -> String {
    reading.unwrap().facts.warnings.join(" ")
}

const PLAIN: Option<&str> = Some("1\\0\\0\\0\\1\\0");
const POSITION: (u16, u16) = (0x18, 0x5100);
const LYING: (u16, u16) = (0x54, 0x410);
const GANTRY: (u16, u16) = (0x54, 0x414);
const PROGRESSION: (u16, u16) = (0x54, 0x500);
const LETTERS: (u16, u16) = (0x20, 0x20);

/// The directions of rows and columns as read.
fn directions(reading: &Reading) -> [[f64; 3]; 2] {
    let linear = reading.volume.frame.linear();
    [0, 1].map(|axis| linear.column(axis).normalize().map(f64::round).into())
}

const RIGHT: [f64; 3] = [-1.0, 0.0, 0.0];
const LEFT: [f64; 3] = [1.0, 0.0, 0.0];
const FRONT: [f64; 3] = [0.0, -1.0, 0.0];
const BACK: [f64; 3] = [0.0, 1.0, 0.0];
const HEAD: [f64; 3] = [0.0, 0.0, 1.0];
const FEET: [f64; 3] = [0.0, 0.0, -1.0];

#[test]
fn without_directions_slices_lie_as_the_patient_did() {
    for (position, expected) in [
        ("HFS", [LEFT, BACK]),
        ("HFP", [RIGHT, FRONT]),
        ("FFS", [RIGHT, BACK]),
        ("FFP", [LEFT, FRONT]),
        ("HFDL", [FRONT, LEFT]),
        ("HFDR", [BACK, RIGHT]),
        ("FFDL", [BACK, LEFT]),
        ("FFDR", [FRONT, RIGHT]),
    ] {
        let reading = with(None, |e| {
            e.insert(POSITION, ("CS", Text(position)));
        });
        let reading = reading.unwrap();
        assert_eq!(directions(&reading), expected, "{position}");
        let warning = &reading.facts.warnings[0];
        assert!(
            warning.contains("Patient Position (0018,5100)") && warning.contains(position),
            "{warning}"
        );
    }
    for (lying, gantry, expected) in [
        (("1240000", "x"), ("102540008", "x"), [RIGHT, FRONT]),
        (("F-10310", ""), ("F-10480", ""), [LEFT, FRONT]),
        (("zz", "Prone"), ("zz", "Feet-first"), [LEFT, FRONT]),
        (("F-10340", "supine"), ("zz", "feet first"), [RIGHT, BACK]),
        (
            ("zz", "left lateral decubitus"),
            ("F-10470", "headfirst"),
            [FRONT, LEFT],
        ),
    ] {
        let reading = with(None, |e| {
            e.insert(LYING, modified(lying.0, lying.1));
            e.insert(GANTRY, one(code(gantry.0, gantry.1)));
        });
        assert_eq!(
            directions(&reading.unwrap()),
            expected,
            "{lying:?} {gantry:?}"
        );
    }
    // What is no such position says nothing.
    let unknown = with(None, |e| {
        e.insert(POSITION, ("CS", Text("SITTING")));
        e.insert(LYING, modified("F-10316", "semi-prone"));
    });
    assert!(said(unknown).contains("supine patient are assumed"));
}

#[test]
fn two_statements_of_the_position_that_differ_are_named() {
    let position = |e: &mut Elements| drop(e.insert(POSITION, ("CS", Text("HFS"))));
    let prone = |e: &mut Elements| drop(e.insert(LYING, modified("F-10310", "prone")));
    let feet = |e: &mut Elements| drop(e.insert(GANTRY, one(code("F-10480", "feet-first"))));
    for (other, names) in [
        (&prone as &dyn Fn(&mut Elements), ["(0054,0412)", "prone"]),
        (&feet, ["(0054,0414)", "feet-first"]),
    ] {
        let both = |e: &mut Elements| {
            position(e);
            other(e);
        };
        let warned = said(with(PLAIN, both));
        let refused = with(None, both).unwrap_err().to_string();
        for name in names.into_iter().chain(["(0018,5100)", "HFS"]) {
            assert!(warned.contains(name), "{name}: {warned}");
            assert!(refused.contains(name), "{name}: {refused}");
        }
        assert_eq!(said(with(PLAIN, other)), "");
    }
    let agreed = with(PLAIN, |e| {
        position(e);
        e.insert(LYING, modified("F-10340", "supine"));
        e.insert(GANTRY, one(code("102540008", "headfirst")));
    });
    assert_eq!(said(agreed), "");
}

#[test]
fn letters_of_rows_and_columns_decide_or_contradict() {
    let letters =
        |stated, text: &'static str| with(stated, |e| drop(e.insert(LETTERS, ("CS", Text(text)))));
    for (text, expected) in [
        ("L\\P", [LEFT, BACK]),
        ("R\\A", [RIGHT, FRONT]),
        ("L\\F", [LEFT, FEET]),
        ("P\\F", [BACK, FEET]),
        ("A\\H", [FRONT, HEAD]),
    ] {
        assert_eq!(
            directions(&letters(None, text).unwrap()),
            expected,
            "{text}"
        );
    }
    // The letters of the position do not count beside them.
    let both = with(None, |e| {
        e.insert(LETTERS, ("CS", Text("L\\P")));
        e.insert(POSITION, ("CS", Text("HFP")));
    });
    assert_eq!(directions(&both.unwrap()), [LEFT, BACK]);
    for nothing in ["L\\R", "L", "X\\P", "LA\\PH"] {
        assert!(
            said(letters(None, nothing)).contains("supine patient are assumed"),
            "{nothing}"
        );
    }
    assert_eq!(said(letters(PLAIN, "L\\P")), "");
    assert_eq!(said(letters(PLAIN, "LA\\PF")), "");
    for other in ["R\\P", "L\\A", "P\\L", "L\\F"] {
        let warned = said(letters(PLAIN, other));
        for name in ["(0020,0020)", other, "(0020,0037)", "1\\0\\0\\0\\1\\0"] {
            assert!(warned.contains(name), "{name}: {warned}");
        }
    }
}

#[test]
fn a_view_decides_or_contradicts() {
    let of = |stated, in_detector: bool, value: &'static str, meaning: &'static str| {
        with(stated, |e| {
            let view = one(code(value, meaning));
            if in_detector {
                detector(e).insert((0x54, 0x220), view);
            } else {
                e.insert((0x54, 0x220), view);
            }
        })
    };
    let coronal = Some("1\\0\\0\\0\\0\\-1");
    let oblique = Some("0.6\\0.8\\0\\0\\0\\-1");
    let tilted = Some("0.6\\0.64\\0.48\\0\\0.6\\-0.8");
    for in_detector in [true, false] {
        for (value, meaning, right, wrong) in [
            ("62824007", "", PLAIN, coronal),
            ("G-A117", "Transverse", PLAIN, oblique),
            ("zz", "Transaxial", PLAIN, coronal),
            ("G-A138", "Coronal", coronal, PLAIN),
            ("zz", "sagittal", Some("0\\1\\0\\0\\0\\-1"), PLAIN),
            ("103340004", "", tilted, PLAIN),
            ("G-A186", "Short Axis", tilted, PLAIN),
            ("zz", "Vertical Long Axis", tilted, coronal),
            ("131186000", "", tilted, PLAIN),
        ] {
            assert_eq!(
                said(of(right, in_detector, value, meaning)),
                "",
                "{value} {meaning}"
            );
            let warned = said(of(wrong, in_detector, value, meaning));
            let shown = if meaning.is_empty() { value } else { meaning };
            for name in ["(0054,0220)", shown, "(0020,0037)", wrong.unwrap()] {
                assert!(warned.contains(name), "{name}: {warned}");
            }
        }
        let read = of(None, in_detector, "zz", "coronal").unwrap();
        assert_eq!(directions(&read), [LEFT, FEET]);
        let read = of(None, in_detector, "zz", "sagittal").unwrap();
        assert_eq!(directions(&read), [BACK, FEET]);
        let unknown = said(of(None, in_detector, "zz", "short axis"));
        assert!(
            unknown.contains("(0054,0220)") && unknown.contains("nothing says"),
            "{unknown}"
        );
    }
}

#[test]
fn the_way_through_the_heart_is_compared_with_the_directions() {
    let of = |stated, value: &'static str| {
        with(stated, |e| {
            e.insert(PROGRESSION, ("CS", Text(value)));
            e.insert((0x18, 0x88), ("DS", Text("4")));
        })
    };
    // Rows x columns run from base to apex: to the left, to the front and down.
    let short = Some("-0.6\\-0.8\\0\\-0.386\\0.289\\-0.876");
    for (stated, right, wrong) in [
        (short, "BASE_TO_APEX", "APEX_TO_BASE"),
        // To the anterior wall, and to the lateral one.
        (
            Some("0.8\\-0.5\\-0.33\\0.554\\0.827\\0.09"),
            "INF_TO_ANT",
            "ANT_TO_INF",
        ),
        (
            Some("0.6\\-0.8\\0\\0\\0\\-1"),
            "SEPTUM_TO_WALL",
            "WALL_TO_SEPTUM",
        ),
    ] {
        assert_eq!(said(of(stated, right)), "", "{right}");
        let warned = said(of(stated, wrong));
        for name in ["(0054,0500)", wrong, "(0020,0037)"] {
            assert!(warned.contains(name), "{name}: {warned}");
        }
    }
    // In directions that are not the patient's, either way is doubtful.
    for way in [
        "BASE_TO_APEX",
        "APEX_TO_BASE",
        "ANT_TO_INF",
        "SEPTUM_TO_WALL",
    ] {
        for stated in [PLAIN, None] {
            let warned = said(of(stated, way));
            assert!(
                warned.contains("(0054,0500)") && warned.contains(way),
                "{warned}"
            );
        }
    }
    assert_eq!(said(of(PLAIN, "OTHER")), "");
}
