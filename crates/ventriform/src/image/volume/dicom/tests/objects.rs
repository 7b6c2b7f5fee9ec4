//! Series, Enhanced images, Segmentations, archives, and objects that hold no slices.

use super::super::super::given_mask::{GivenMaskError, MaskChoice, read_mask};
use super::super::super::{FileFormat, ReadLimits, VolumeFile, provenance};
use super::super::Provenance;
use super::*;
use std::io::Write as _;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// A CT slice of 3 x 2 pixels at `height` mm, with the numbers from `first` on.
pub(super) fn ct(height: &'static str, first: u16) -> Elements {
    BTreeMap::from([
        ((0x08, 0x05), ("CS", Text("ISO_IR 192"))),
        ((0x08, 0x08), ("CS", Text("ORIGINAL\\PRIMARY\\AXIAL"))),
        ((0x08, 0x16), ("UI", Text("1.2.840.10008.5.1.4.1.1.2"))),
        ((0x08, 0x18), ("UI", written(format!("1.2.{height}")))),
        ((0x08, 0x60), ("CS", Text("CT"))),
        ((0x10, 0x10), ("PN", Text("Müller^Ä"))),
        ((0x18, 0x50), ("DS", Text("2"))),
        ((0x20, 0x0d), ("UI", Text("1.2.3"))),
        ((0x20, 0x0e), ("UI", Text("1.2.3.4"))),
        ((0x20, 0x11), ("IS", Text("7"))),
        ((0x20, 0x32), ("DS", Text(position(height)))),
        ((0x20, 0x37), ("DS", Text("1\\0\\0\\0\\1\\0"))),
        ((0x28, 0x02), ("US", Shorts(vec![1]))),
        ((0x28, 0x04), ("CS", Text("MONOCHROME2"))),
        ((0x28, 0x10), ("US", Shorts(vec![2]))),
        ((0x28, 0x11), ("US", Shorts(vec![3]))),
        ((0x28, 0x30), ("DS", Text("2.5\\4"))),
        ((0x28, 0x100), ("US", Shorts(vec![16]))),
        ((0x28, 0x101), ("US", Shorts(vec![16]))),
        ((0x28, 0x102), ("US", Shorts(vec![15]))),
        ((0x28, 0x103), ("US", Shorts(vec![1]))),
        ((0x28, 0x1052), ("DS", Text("-5"))),
        ((0x28, 0x1053), ("DS", Text("1"))),
        ((0x7fe0, 0x10), ("OW", Shorts((first..first + 6).collect()))),
    ])
}

fn position(height: &str) -> &'static str {
    match height {
        "0" => "1\\2\\0",
        "3" => "1\\2\\3",
        "6" => "1\\2\\6",
        "9" => "1\\2\\9",
        other => panic!("no position {other}"),
    }
}

pub(super) fn files(slices: &[Elements]) -> Vec<VolumeFile> {
    let named = slices.iter().enumerate();
    named
        .map(|(n, e)| VolumeFile::in_memory(format!("{n}"), Encoding::Explicit.file(e)))
        .collect()
}

/// Whose scan the volume `frame` of `files` is, by the headers alone.
pub(super) fn headers(files: &[VolumeFile], frame: Option<usize>) -> Provenance {
    let (options, limits) = (ReadOptions { frame }, ReadLimits::default());
    let found = provenance(files, &options, &limits, &Monitor::silent());
    found.unwrap().unwrap()
}

pub(super) fn read_files(files: &[VolumeFile]) -> Result<Reading, VolumeError> {
    let (options, limits) = (ReadOptions::default(), ReadLimits::default());
    read_volume(files, &options, &limits, &Monitor::silent())
}

pub(super) fn archive(files: &[(&str, Vec<u8>)], method: CompressionMethod) -> VolumeFile {
    let mut zip = ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(method);
    for (name, bytes) in files {
        zip.start_file(*name, options).unwrap();
        zip.write_all(bytes).unwrap();
    }
    VolumeFile::in_memory("series.zip", zip.finish().unwrap().into_inner())
}

#[test]
fn slices_of_a_series_are_ordered_by_their_positions() {
    let mut scaled = ct("3", 100);
    scaled.insert((0x28, 0x1053), ("DS", Text("0.5")));
    let slices = [ct("6", 200), ct("0", 0), scaled];
    let expected: Vec<f32> = (0..18)
        .map(|n| match n / 6 {
            0 => n as f32 - 5.0,
            1 => (100 + n - 6) as f32 * 0.5 - 5.0,
            _ => (200 + n - 12) as f32 - 5.0,
        })
        .collect();
    let mut with_company: Vec<(&str, Vec<u8>)> = vec![
        ("study/DICOMDIR", vec![0; 200]),
        ("study/read me.txt", b"a series".to_vec()),
    ];
    let bytes: Vec<_> = slices.iter().map(|s| Encoding::Explicit.file(s)).collect();
    for (name, bytes) in ["study/a", "study/b.dcm", "study/c"]
        .into_iter()
        .zip(&bytes)
    {
        with_company.push((name, bytes.clone()));
    }
    for given in [
        files(&slices),
        vec![archive(&with_company, CompressionMethod::Stored)],
        vec![archive(&with_company, CompressionMethod::Deflated)],
    ] {
        let reading = read_files(&given).unwrap();
        assert_eq!(reading.volume.shape, [3, 2, 3]);
        assert_eq!(reading.volume.voxels, expected);
        let facts = &reading.facts;
        assert_eq!(facts.format, FileFormat::DicomSeries);
        assert_eq!(facts.spacing_mm, [4.0, 2.5, 3.0]);
        assert_eq!((facts.scaling, facts.warnings.len()), (None, 0));
        let corner = reading.volume.frame.to_patient(&Vec3::new(2.0, 1.0, 2.0));
        assert!((corner - Vec3::new(9.0, 4.5, 6.0)).norm() < 1e-12);
        let from = reading.provenance.unwrap();
        assert_eq!(from.instance_uids, ["1.2.0", "1.2.3", "1.2.6"]);
        assert_eq!(from.patient_name.as_deref(), Some("Müller^Ä"));
        assert_eq!(from.study_uid.as_deref(), Some("1.2.3"));
        assert!(!format!("{from:?}").contains("ller"));
    }
}

#[test]
fn files_that_are_not_one_series_are_named() {
    let complain = |slices: &[Elements]| match read_files(&files(slices)) {
        Err(VolumeError::NotOneSeries { reason, .. }) => reason,
        other => panic!("{other:?}"),
    };
    let gap = complain(&[ct("0", 0), ct("3", 0), ct("9", 0)]);
    assert!(gap.contains("slices are missing"), "{gap}");
    let mut other = ct("3", 0);
    other.insert((0x20, 0x0e), ("UI", Text("9")));
    other.insert((0x20, 0x11), ("IS", Text("8")));
    let two = complain(&[ct("0", 0), other]);
    assert!(
        two.contains("2 series: number 7 (UID 1.2.3.4, 1 files), number 8 (UID 9"),
        "{two}"
    );
    let mut wide = ct("3", 0);
    wide.insert((0x28, 0x10), ("US", Shorts(vec![1])));
    wide.insert((0x7fe0, 0x10), ("OW", Shorts(vec![0; 3])));
    assert!(complain(&[ct("0", 0), wide]).contains("3 x 1"));
    let volume = complain(&[ct("0", 0), slices()]);
    assert!(volume.contains("a volume of its own"), "{volume}");
    let twice = read_files(&files(&[ct("0", 0), ct("3", 0), ct("3", 0)])).unwrap();
    assert_eq!(twice.volume.shape, [3, 2, 2]);
    assert!(twice.facts.warnings[0].starts_with("1 files repeat"));
    let one = read_files(&files(&[ct("3", 0)])).unwrap();
    assert_eq!(one.facts.spacing_mm, [4.0, 2.5, 2.0]);
    assert!(one.facts.warnings[0].contains("single slice"));
}

#[test]
fn several_slices_at_one_place_are_several_volumes() {
    let late = |height, first, instance| {
        let mut slice = ct(height, first);
        slice.insert((0x08, 0x18), ("UI", written(format!("1.2.{instance}"))));
        slice.insert((0x18, 0x1060), ("DS", Text("400")));
        slice
    };
    let four = [
        late("0", 60, "7"),
        ct("3", 6),
        late("3", 70, "8"),
        ct("0", 0),
    ];
    let needed = read_files(&files(&four)).unwrap_err();
    assert_eq!(
        needed,
        VolumeError::FrameNeeded {
            frames: 2,
            why: None
        }
    );
    let options = ReadOptions { frame: Some(1) };
    let limits = ReadLimits::default();
    let second = read_volume(&files(&four), &options, &limits, &Monitor::silent()).unwrap();
    assert_eq!(
        second.volume.voxels[..7],
        [55.0, 56.0, 57.0, 58.0, 59.0, 60.0, 65.0]
    );
    assert_eq!(second.provenance.unwrap().instance_uids, ["1.2.7", "1.2.8"]);
}

pub(super) fn item(tag: (u16, u16), vr: &'static str, value: Value) -> Elements {
    BTreeMap::from([(tag, (vr, value))])
}

pub(super) fn group(tag: (u16, u16), content: Elements) -> ((u16, u16), (&'static str, Value)) {
    (tag, ("SQ", Items(vec![content])))
}

/// An Enhanced PET image of four frames, stored from above, with a scaling of its own each.
pub(super) fn enhanced() -> Elements {
    let mut elements = ct("0", 0);
    let heights = ["1\\2\\9", "1\\2\\3", "1\\2\\0", "1\\2\\6"];
    let slopes = ["4", "2", "1", "3"];
    let frames = heights.into_iter().zip(slopes).map(|(height, slope)| {
        BTreeMap::from([
            group((0x20, 0x9113), item((0x20, 0x32), "DS", Text(height))),
            group((0x28, 0x9145), item((0x28, 0x1053), "DS", Text(slope))),
        ])
    });
    let shared = BTreeMap::from([
        group(
            (0x20, 0x9116),
            item((0x20, 0x37), "DS", Text("1\\0\\0\\0\\1\\0")),
        ),
        group((0x28, 0x9110), item((0x28, 0x30), "DS", Text("2.5\\4"))),
    ]);
    for tag in [
        (0x20, 0x32),
        (0x20, 0x37),
        (0x28, 0x30),
        (0x28, 0x1052),
        (0x28, 0x1053),
    ] {
        elements.remove(&tag);
    }
    elements.extend([
        ((0x08, 0x16), ("UI", Text("1.2.840.10008.5.1.4.1.1.130"))),
        ((0x28, 0x08), ("IS", Text("4"))),
        ((0x5200, 0x9229), ("SQ", Items(vec![shared]))),
        ((0x5200, 0x9230), ("SQ", Items(frames.collect()))),
        ((0x7fe0, 0x10), ("OW", Shorts((0..24).collect()))),
    ]);
    elements
}

#[test]
fn frames_of_an_enhanced_image_lie_where_they_say() {
    for encoding in [Encoding::Implicit, Encoding::Explicit, Encoding::BigEndian] {
        let reading = read_frame(encoding.file(&enhanced()), None).unwrap();
        assert_eq!(reading.facts.format, FileFormat::DicomEnhanced);
        assert_eq!(reading.facts.spacing_mm, [4.0, 2.5, 3.0]);
        // Slices from below: stored frames 2, 1, 3, 0, each with its slope.
        let of = |frame: usize, slope: f32| (0..6).map(move |n| (6 * frame + n) as f32 * slope);
        let expected = of(2, 1.0)
            .chain(of(1, 2.0))
            .chain(of(3, 3.0))
            .chain(of(0, 4.0));
        assert_eq!(reading.volume.voxels, expected.collect::<Vec<_>>());
        assert_eq!(reading.provenance.unwrap().slice_frames, [3, 2, 4, 1]);
        let corner = reading.volume.frame.to_patient(&Vec3::new(0.0, 1.0, 3.0));
        assert!((corner - Vec3::new(1.0, 4.5, 9.0)).norm() < 1e-12);
    }
}

/// Nine bits for each of three frames without padding, the first pixel in the lowest bit: pixels 0 and 1
/// of the first frame, 1 and 3 of the second, 2 and 3 of the third.
const SEGMENT_BITS: u32 = 1 | 1 << 1 | 1 << (9 + 1) | 1 << (9 + 3) | 1 << (18 + 2) | 1 << (18 + 3);

/// A segmentation of 3 x 3 pixels: segment 1 in slices 0 and 3, segment 2 in slice 0.
fn segmentation() -> Elements {
    let mut elements = enhanced();
    let frames = [("1\\2\\9", 1_u16), ("1\\2\\0", 1), ("1\\2\\0", 2)];
    let frames = frames.map(|(height, segment)| {
        BTreeMap::from([
            group((0x20, 0x9113), item((0x20, 0x32), "DS", Text(height))),
            group(
                (0x62, 0x0a),
                item((0x62, 0x0b), "US", Shorts(vec![segment])),
            ),
        ])
    });
    let measures = BTreeMap::from([
        ((0x18, 0x88), ("DS", Text("3"))),
        ((0x28, 0x30), ("DS", Text("2.5\\4"))),
    ]);
    let shared = BTreeMap::from([
        group(
            (0x20, 0x9116),
            item((0x20, 0x37), "DS", Text("1\\0\\0\\0\\1\\0")),
        ),
        group((0x28, 0x9110), measures),
    ]);
    let (low, high) = (SEGMENT_BITS as u16, (SEGMENT_BITS >> 16) as u16);
    elements.extend([
        ((0x08, 0x16), ("UI", Text("1.2.840.10008.5.1.4.1.1.66.4"))),
        ((0x28, 0x08), ("IS", Text("3"))),
        ((0x28, 0x10), ("US", Shorts(vec![3]))),
        ((0x28, 0x100), ("US", Shorts(vec![1]))),
        ((0x28, 0x101), ("US", Shorts(vec![1]))),
        ((0x28, 0x102), ("US", Shorts(vec![0]))),
        ((0x28, 0x103), ("US", Shorts(vec![0]))),
        ((0x62, 0x01), ("CS", Text("BINARY"))),
        ((0x5200, 0x9229), ("SQ", Items(vec![shared]))),
        ((0x5200, 0x9230), ("SQ", Items(frames.to_vec()))),
        ((0x7fe0, 0x10), ("OB", Shorts(vec![low, high]))),
    ]);
    elements
}

#[test]
fn segments_become_labels() {
    let reading = read_elements(&segmentation()).unwrap();
    assert_eq!(reading.facts.format, FileFormat::DicomSeg);
    assert_eq!(reading.volume.shape, [3, 3, 4]);
    let mut expected = vec![0.0; 36];
    // Pixel 3 of the lowest slice belongs to both segments.
    for (slice, pixel, label) in [(3, 0, 1), (3, 1, 1), (0, 1, 1), (0, 2, 2), (0, 3, 2)] {
        expected[9 * slice + pixel] = label as f32;
    }
    assert!(reading.facts.warnings[0].starts_with("1 voxels belong to several"));
    assert_eq!(reading.volume.voxels, expected);
    assert_eq!(reading.facts.spacing_mm, [4.0, 2.5, 3.0]);
    let labels = reading.facts.intensity.labels.unwrap();
    assert!(labels.iter().all(|label| [1, 2].contains(&label.label)));
    // Far apart frames of a thin grid: refused before memory is taken.
    let mut far = segmentation();
    if let Some((_, Items(shared))) = far.get_mut(&(0x5200, 0x9229))
        && let Some((_, Items(measures))) = shared[0].get_mut(&(0x28, 0x9110))
    {
        measures[0].insert((0x18, 0x88), ("DS", Text("0.0001")));
    }
    let (field, _) = complaint(read_elements(&far));
    assert_eq!(field, "Per-frame Functional Groups Sequence (5200,9230)");
}

/// [`segmentation`] with a description of each segment: number, label, code and its meaning.
fn described(segments: [(u16, &'static str, &'static str, &'static str); 2]) -> Elements {
    let items = segments.map(|(number, label, value, meaning)| {
        let code = BTreeMap::from([
            ((0x08, 0x100), ("SH", Text(value))),
            ((0x08, 0x102), ("SH", Text("SCT"))),
            ((0x08, 0x104), ("LO", Text(meaning))),
        ]);
        BTreeMap::from([
            ((0x62, 0x04), ("US", Shorts(vec![number]))),
            ((0x62, 0x05), ("LO", Text(label))),
            ((0x62, 0x0f), ("SQ", Items(vec![code]))),
        ])
    });
    let mut elements = segmentation();
    elements.insert((0x62, 0x02), ("SQ", Items(items.to_vec())));
    elements
}

/// The pixels of [`segmentation`] by slice, of each segment alone: the shared one is of both.
const OF_SEGMENT: [&[(usize, usize)]; 2] = [&[(3, 0), (3, 1), (0, 1), (0, 3)], &[(0, 2), (0, 3)]];

/// A mask is the segment whose code says myocardium, wherever it stands in the file, or the one that is
/// named; where neither tells, all are listed.
#[test]
fn a_segment_is_chosen_by_its_code_or_name_and_never_by_its_place() {
    let read = |elements: &Elements, label: Option<&str>| {
        let files = [VolumeFile::in_memory(
            "seg",
            Encoding::Explicit.file(elements),
        )];
        let choice = MaskChoice {
            label: label.map(|text| text.parse().unwrap()),
            ..MaskChoice::default()
        };
        read_mask(&files, &choice, &ReadLimits::default(), &Monitor::silent())
    };
    let is_segment = |elements: &Elements, label: Option<&str>, segment: usize| {
        let given = read(elements, label).unwrap();
        let mut wanted = vec![false; 36];
        for (slice, pixel) in OF_SEGMENT[segment - 1] {
            wanted[9 * slice + pixel] = true;
        }
        assert_eq!(given.mask.voxels, wanted, "{label:?}");
        let told = given.structure.unwrap();
        assert!(told.starts_with(&format!("segment {segment}")), "{told}");
    };
    let muscle = [
        ("49848007", "Left Ventricle Myocardium"),
        ("T-32020", "Myocardium"),
        ("X", "LV myocardium"),
    ];
    let others = [
        ("LV-CAVITY", "Cavity of left ventricle"),
        ("87878005", "Left Ventricle"),
        ("70335002", "Myocardium of right ventricle"),
    ];
    for (code, meaning) in muscle {
        for (other, named) in others {
            let first = described([(1, "a", code, meaning), (2, "b", other, named)]);
            let last = described([(1, "a", other, named), (2, "b", code, meaning)]);
            is_segment(&first, None, 1);
            is_segment(&last, None, 2);
            // In the order of the file the second comes first.
            let turned = described([(2, "b", code, meaning), (1, "a", other, named)]);
            is_segment(&turned, None, 2);
            for (label, segment) in [
                ("1", 1),
                ("2", 2),
                ("A", 1),
                ("b", 2),
                (code, 1),
                (named, 2),
            ] {
                is_segment(&first, Some(label), segment);
            }
        }
    }
    let heart = ("80891009", "Heart");
    let unclear = described([(1, "one", heart.0, heart.1), (2, "two", "123", "Liver")]);
    let both = described([
        (1, "one", muscle[0].0, muscle[0].1),
        (2, "two", muscle[1].0, muscle[1].1),
    ]);
    for several in [&unclear, &both] {
        let refused = read(several, None).unwrap_err();
        assert!(
            matches!(refused, GivenMaskError::SeveralStructures { .. }),
            "{refused}"
        );
        for text in ["1 (one)", "2 (two)"] {
            assert!(refused.to_string().contains(text), "{refused}");
        }
    }
    let absent = read(&unclear, Some("3")).unwrap_err();
    assert!(absent.to_string().contains("1 (one)"), "{absent}");
    let same_name = described([(1, "wall", heart.0, heart.1), (2, "Wall", "123", "Liver")]);
    assert!(read(&same_name, Some("wall")).is_err());
    is_segment(&same_name, Some("liver"), 2);
    // Without descriptions, as the standard does not allow, segments are labels.
    let bare = read(&segmentation(), None).unwrap_err();
    assert!(
        matches!(bare, GivenMaskError::SeveralStructures { .. }),
        "{bare}"
    );
}

#[test]
fn gates_are_summed_unless_one_is_chosen() {
    let reading = read_elements(&gated()).unwrap();
    // Stored frames 2 0 6 5 hold the first slices of the gates, 3 1 7 4 the second.
    let first = |frames: [usize; 4]| frames.map(|f| 6.0 * f as f32).iter().sum::<f32>();
    assert_eq!(reading.volume.voxels[0], first([2, 0, 6, 5]));
    assert_eq!(reading.volume.voxels[7], first([3, 1, 7, 4]) + 4.0);
    assert_eq!((reading.facts.frames, reading.facts.frame), (4, None));
    assert!(reading.facts.warnings[0].contains("4 gates were summed"));
    assert_eq!(reading.facts.intensity.sum, 47.0 * 24.0);
    assert_eq!(reading.provenance.unwrap().slice_frames, [3, 4]);
    let file = VolumeFile::in_memory("gated", Encoding::Explicit.file(&gated()));
    for (frame, frames) in [(None, [3, 4]), (Some(1), [1, 2]), (Some(3), [6, 5])] {
        let from = headers(std::slice::from_ref(&file), frame);
        assert_eq!(from.slice_frames, frames, "{frame:?}");
    }
}

#[test]
fn objects_without_slices_are_refused_by_name() {
    for (class, named, instead) in [
        (
            "1.2.840.10008.5.1.4.1.1.481.3",
            "an RT Structure Set",
            "image series",
        ),
        (
            "1.2.840.10008.5.1.4.1.1.88.33",
            "a Comprehensive SR",
            "image series",
        ),
        ("1.2.840.10008.5.1.4.1.1.481.2", "an RT Dose", "RECON TOMO"),
        (
            "1.2.840.10008.5.1.4.1.1.7",
            "a Secondary Capture Image",
            "RECON TOMO",
        ),
        ("1.2.840.10008.1.3.10", "a DICOMDIR", "files that it lists"),
        ("1.2.3", "unknown SOP class (1.2.3", "RECON TOMO"),
    ] {
        let result = changed(|e| {
            e.insert((0x08, 0x16), ("UI", Text(class)));
        });
        let Err(VolumeError::NotVolume {
            found, reason, fix, ..
        }) = result
        else {
            panic!("{class}: {result:?}");
        };
        assert!(found.contains(named), "{found}");
        assert!(
            format!("{reason} {fix}").contains(instead),
            "{reason} {fix}"
        );
    }
    let nameless = changed(|e| {
        e.remove(&(0x08, 0x16));
    });
    assert!(
        nameless
            .unwrap_err()
            .to_string()
            .contains("without a SOP Class UID")
    );
    let mut localizer = ct("0", 0);
    localizer.insert((0x08, 0x08), ("CS", Text("ORIGINAL\\PRIMARY\\LOCALIZER")));
    let refused = read_elements(&localizer);
    assert!(matches!(refused, Err(VolumeError::NotSlices { .. })));
    let mut table = ct("0", 0);
    table.remove(&(0x28, 0x1053));
    let descriptor = item((0x28, 0x3002), "US", Shorts(vec![1, 0, 16]));
    table.extend([group((0x28, 0x3000), descriptor)]);
    assert_eq!(
        complaint(read_elements(&table)).0,
        "Modality LUT Sequence (0028,3000)"
    );
}

#[test]
fn provenance_tells_how_the_scan_was_made() {
    let mut elements = slices();
    let drug = BTreeMap::from([
        ((0x18, 0x1074), ("DS", Text("740"))),
        group(
            (0x54, 0x304),
            item((0x08, 0x104), "LO", Text("Tc-99m tetrofosmin")),
        ),
        group(
            (0x54, 0x300),
            item((0x08, 0x104), "LO", Text("^99m^Technetium")),
        ),
    ]);
    elements.extend([
        ((0x08, 0x2a), ("DT", Text("20260102030405.5"))),
        ((0x08, 0x70), ("LO", Text("Maker"))),
        ((0x08, 0x103e), ("LO", Text("MYOCARDIUM STRESS [Recon]"))),
        ((0x20, 0x52), ("UI", Text("1.2.9"))),
        ((0x54, 0x16), ("SQ", Items(vec![drug]))),
        (
            (0x54, 0x52),
            ("SQ", Items(vec![item((0x18, 0x1143), "DS", Text("180"))])),
        ),
    ]);
    let given = [VolumeFile::in_memory(
        "nm",
        Encoding::Implicit.file(&elements),
    )];
    let from = headers(&given, None);
    let stated = from.stated();
    for pair in [
        ("acquisition_date", "20260102"),
        ("acquisition_time", "030405.5"),
        ("frame_of_reference_uid", "1.2.9"),
        ("injected_dose", "740"),
        ("manufacturer", "Maker"),
        ("modality", "NM"),
        ("radionuclide", "^99m^Technetium"),
        ("radiopharmaceutical", "Tc-99m tetrofosmin"),
        ("rest_or_stress", "stress"),
        ("scan_arc", "180"),
    ] {
        assert!(stated.contains(&pair), "{pair:?} {stated:?}");
    }
    assert_eq!(from.patient_id, None);
    assert_eq!(from.scan_arc_deg(), Some(180.0));
    assert_eq!(from.slice_frames, [1, 2, 3, 4]);
    elements.insert((0x08, 0x103e), ("LO", Text("rest/stress")));
    let given = [VolumeFile::in_memory(
        "nm",
        Encoding::Implicit.file(&elements),
    )];
    let both = headers(&given, None);
    assert_eq!(both.rest_or_stress, None);
}

#[test]
fn archives_cost_no_more_than_they_hold() {
    let zeros = vec![0; 8 << 20];
    let bomb = archive(&[("a.dcm", zeros)], CompressionMethod::Deflated);
    let limits = ReadLimits {
        unpacked_bytes: 1 << 20,
        ..ReadLimits::default()
    };
    let refused = inspect_volume(std::slice::from_ref(&bomb), &limits, &Monitor::silent());
    assert!(matches!(refused, Err(VolumeError::TooLarge { .. })));
    let nothing = read_files(&[bomb]).unwrap_err();
    assert!(nothing.to_string().contains("without DICOM or NIfTI"));
    let slice = Encoding::Explicit.file(&ct("0", 0));
    for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
        let whole = archive(&[("a.dcm", slice.clone())], method);
        assert!(read_files(std::slice::from_ref(&whole)).is_ok());
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut whole.bytes().unwrap(), &mut bytes).unwrap();
        for cut in (4..bytes.len()).step_by(7) {
            let files = [VolumeFile::in_memory("cut.zip", bytes[..cut].to_vec())];
            assert!(read_files(&files).is_err(), "{cut}");
        }
        // The directory says that the file is smaller than it is.
        let at = bytes.windows(4).position(|w| w == b"PK\x01\x02").unwrap();
        bytes[at + 24..at + 28].copy_from_slice(&100_u32.to_le_bytes());
        let files = [VolumeFile::in_memory("lie.zip", bytes)];
        if method == CompressionMethod::Deflated {
            assert!(read_files(&files).is_err());
        }
    }
}

/// A series of gated PET: for each of `gates` two slices, told apart by `told`.
fn gated_pet(gates: usize, told: fn(usize, usize) -> Elements) -> Vec<Elements> {
    let slice = |gate: usize, slice: usize| {
        let mut elements = ct("0", (100 * gate + 10 * slice) as u16);
        elements.extend([
            ((0x08, 0x16), ("UI", Text("1.2.840.10008.5.1.4.1.1.128"))),
            ((0x08, 0x18), ("UI", written(format!("1.{gate}.{slice}")))),
            ((0x08, 0x60), ("CS", Text("PT"))),
            ((0x18, 0x1062), ("IS", Text("900"))),
            ((0x18, 0x1063), ("DS", Text("112.5"))),
            ((0x18, 0x1081), ("IS", Text("700"))),
            ((0x18, 0x1082), ("IS", Text("1100"))),
            ((0x18, 0x1083), ("IS", Text("390"))),
            ((0x18, 0x1084), ("IS", Text("130"))),
            (
                (0x20, 0x32),
                ("DS", written(format!("1\\2\\{}", 3 * slice))),
            ),
            ((0x28, 0x1052), ("DS", Text("0"))),
            ((0x54, 0x71), ("US", Shorts(vec![8]))),
            ((0x54, 0x1000), ("CS", Text("GATED\\IMAGE"))),
        ]);
        elements.extend(told(gate, slice));
        elements
    };
    (0..gates)
        .flat_map(|gate| [slice(gate, 1), slice(gate, 0)])
        .collect()
}

/// Gates are told apart by the time after the R wave, or by the slots that Image Index counts; their order is that of
/// the beat whatever the order of the files.
#[test]
fn a_series_of_gated_pet_is_read_gate_by_gate() {
    type Said = fn(usize, usize) -> Elements;
    let by_trigger: Said = |gate, _| {
        let ms = 112.5 * gate as f64;
        item((0x18, 0x1060), "DS", written(ms))
    };
    let by_index: Said = |gate, slice| {
        let index = (2 * gate + slice + 1) as u16;
        item((0x54, 0x1330), "US", Shorts(vec![index]))
    };
    for told in [by_trigger, by_index] {
        let mut slices = gated_pet(8, told);
        slices.reverse();
        let limits = ReadLimits::default();
        let read = |slices: &[Elements]| {
            crate::image::volume::read_gates(&files(slices), false, &limits, &Monitor::silent())
        };
        let reading = read(&slices).unwrap();
        assert_eq!(reading.gates.len(), 8);
        for (index, gate) in reading.gates.iter().enumerate() {
            let first = 100.0 * index as f32;
            assert_eq!([gate.voxels[0], gate.voxels[6]], [first, first + 10.0]);
            let uids = [0, 1].map(|slice| format!("1.{index}.{slice}"));
            assert_eq!(reading.scans[index].instance_uids, uids);
        }
        let timing = &reading.timing;
        assert_eq!(
            (timing.rr_ms, timing.frame_time_ms),
            (Some(900.0), Some(112.5))
        );
        assert_eq!(timing.rejected_share(), Some(0.25));
        // A dynamic series is none, and its numbers do not matter.
        for slice in &mut slices {
            slice.insert((0x54, 0x1000), ("CS", Text("DYNAMIC\\IMAGE")));
            slice.insert((0x18, 0x1062), ("IS", Text("-900")));
        }
        let refused = read(&slices).unwrap_err();
        assert!(
            matches!(refused, VolumeError::FrameNeeded { frames: 8, .. }),
            "{refused}"
        );
    }
}

#[test]
fn gated_pet_of_several_intervals_has_the_timing_of_the_one_with_the_most_counts() {
    let told = |gate: usize, slice: usize| {
        let mut said = item(
            (0x54, 0x1330),
            "US",
            Shorts(vec![(2 * gate + slice + 1) as u16]),
        );
        said.insert((0x54, 0x61), ("US", Shorts(vec![2])));
        if gate >= 8 {
            said.insert((0x18, 0x1062), ("IS", Text("1050")));
        }
        said
    };
    let slices = gated_pet(16, told);
    let limits = ReadLimits::default();
    let reading =
        crate::image::volume::read_gates(&files(&slices), false, &limits, &Monitor::silent())
            .unwrap();
    assert_eq!((reading.gates.len(), reading.frames[0]), (8, 8));
    assert_eq!(reading.timing.rr_ms, Some(1050.0));
}

/// Gate `n` as an image of its own, whose numbers begin with 100 n.
pub(super) fn one_gate(n: usize, series: &'static str) -> Elements {
    let first = 100 * n as u16;
    let mut elements = slices();
    elements.extend([
        ((0x08, 0x18), ("UI", written(format!("1.2.9.{n}")))),
        ((0x20, 0x0d), ("UI", Text("1.2"))),
        ((0x20, 0x0e), ("UI", Text(series))),
        ((0x20, 0x11), ("IS", written(n + 1))),
        ((0x20, 0x13), ("IS", written(n + 1))),
        (
            (0x7fe0, 0x10),
            ("OW", Shorts((first..first + 24).collect())),
        ),
    ]);
    elements
}

/// As [`one_gate`], with the time after the R wave, which calls it a gate.
pub(super) fn timed_gate(n: usize, series: &'static str) -> Elements {
    let mut elements = one_gate(n, series);
    elements.insert((0x18, 0x1060), ("DS", written(112 * n)));
    elements
}

/// As they are, in any order, and in an archive: like one image of all gates.
#[test]
fn images_of_one_gate_each_are_read_as_one_gated_study() {
    let limits = ReadLimits::default();
    let quiet = Monitor::silent();
    // Names that order them otherwise.
    let mut images: Vec<Elements> = (0..8).map(|n| timed_gate(n, "1.2.9")).collect();
    images.reverse();
    let loose = files(&images);
    let named: Vec<String> = (0..8).map(|n| format!("S/{n}")).collect();
    let packed: Vec<(&str, Vec<u8>)> = (named.iter().zip(&images))
        .map(|(name, image)| (name.as_str(), Encoding::Explicit.file(image)))
        .collect();
    let packed = vec![archive(&packed, CompressionMethod::Deflated)];
    for given in [&loose, &packed] {
        let reading = crate::image::volume::read_gates(given, false, &limits, &quiet).unwrap();
        assert_eq!(reading.gates.len(), 8);
        for (n, gate) in reading.gates.iter().enumerate() {
            // Slices lie backwards.
            let alone = read_elements(&images[7 - n]).unwrap();
            assert_eq!(gate.voxels, alone.volume.voxels);
            let scan = &reading.scans[n];
            assert_eq!(scan.sop_instance_uid, Some(format!("1.2.9.{n}")));
            assert_eq!(scan.slice_frames.len(), 4);
        }
        let held = crate::image::volume::hold_gates(given, false, &limits, &quiet);
        assert_eq!(held.unwrap(), crate::image::volume::HeldGates::Beat);
        let facts = inspect_volume(given, &limits, &quiet).unwrap();
        assert_eq!((facts.frames, facts.gates.is_some()), (8, true));
        let told = facts.warnings.iter().any(|w| w.contains("Trigger Time"));
        assert!(told, "{:?}", facts.warnings);
        let sum = read_files(given).unwrap().volume;
        let gates = reading.gates.iter().map(|gate| gate.voxels[5]);
        assert_eq!(sum.voxels[5], gates.sum::<f32>());
    }
    // What does not belong together is what it was: volumes of their own.
    let apart = |change: fn(&mut Elements, usize)| {
        let mut images: Vec<Elements> = (0..8).map(|n| timed_gate(n, "1.2.9")).collect();
        for (n, image) in images.iter_mut().enumerate() {
            change(image, n);
        }
        read_files(&files(&images))
    };
    let changes: [fn(&mut Elements, usize); 6] = [
        // One or all do not say that they are gates.
        |image, n| {
            if n == 3 {
                image.remove(&(0x18, 0x1060));
            }
        },
        |image, _| drop(image.remove(&(0x18, 0x1060))),
        // Each moment twice, as of two beats.
        |image, n| drop(image.insert((0x18, 0x1060), ("DS", written(100 * (n % 4))))),
        |image, n| drop(image.insert((0x20, 0x0d), ("UI", written(format!("1.{n}"))))),
        // No number orders them.
        |image, n| {
            image.insert((0x20, 0x11), ("IS", written(1)));
            image.insert((0x20, 0x13), ("IS", written(1 + n / 2)));
            image.insert((0x18, 0x1060), ("DS", written(0)));
        },
        |image, n| drop(image.insert((0x18, 0x88), ("DS", written(5 + n % 2)))),
    ];
    for (at, change) in changes.into_iter().enumerate() {
        let refused = apart(change).unwrap_err();
        let is_refused = matches!(refused, VolumeError::NotOneSeries { .. });
        assert!(is_refused, "{at}: {refused}");
    }
    let few = read_files(&files(&images[..5])).unwrap_err();
    assert!(matches!(few, VolumeError::NotOneSeries { .. }), "{few}");
    // Gates by their own words need not be of one series.
    let gated: fn(&mut Elements, usize) = |image, n| {
        image.remove(&(0x18, 0x1060));
        image.extend([
            (
                (0x08, 0x08),
                ("CS", Text("ORIGINAL\\PRIMARY\\RECON GATED TOMO\\EMISSION")),
            ),
            ((0x20, 0x0e), ("UI", written(format!("1.2.9.{n}")))),
            (
                (0x28, 0x09),
                ("AT", Shorts(vec![0x54, 0x60, 0x54, 0x70, 0x54, 0x80])),
            ),
            ((0x54, 0x60), ("US", Shorts(vec![1; 4]))),
            ((0x54, 0x70), ("US", Shorts(vec![1; 4]))),
        ]);
    };
    let reading = apart(gated).unwrap();
    assert_eq!(reading.facts.frames, 8);
    // Received one by one, such an object waits for the others of its series; a volume of its own does not.
    let mut gate = one_gate(0, "1.2.9");
    for is_part in [false, true] {
        let file = VolumeFile::in_memory("gate", Encoding::Explicit.file(&gate));
        let header = crate::image::volume::dicom::read_header(&file, &limits, &quiet).unwrap();
        assert_eq!(header.is_part, is_part);
        gated(&mut gate, 0);
    }
}

/// Frames of an Enhanced PET image in two gates of two slices, told apart by a delay, a phase or, where the image was
/// made of single ones, their Trigger Time.
#[test]
fn an_enhanced_image_of_several_moments_of_the_beat_is_gated() {
    let of = |tag: (u16, u16), modality: &'static str| {
        let said = |moment: usize| match tag {
            (0x18, 0x1060) => {
                let time = ["50", "0"][moment];
                vec![group((0x20, 0x9171), item(tag, "DS", Text(time)))]
            }
            _ => {
                let mut cardiac = item(tag, "FD", Double([50.0, 0.0][moment]));
                cardiac.extend([
                    ((0x18, 0x1081), ("IS", Text("700"))),
                    ((0x18, 0x1083), ("IS", Text("90"))),
                    ((0x18, 0x1084), ("IS", Text("10"))),
                    ((0x20, 0x9251), ("FD", Double(880.0))),
                ]);
                vec![group((0x18, 0x9118), cardiac)]
            }
        };
        let frame = |n: usize| {
            let height = ["1\\2\\0", "1\\2\\3"][n % 2];
            let mut frame = BTreeMap::from([
                group((0x20, 0x9113), item((0x20, 0x32), "DS", Text(height))),
                group((0x28, 0x9145), item((0x28, 0x1053), "DS", Text("1"))),
            ]);
            // The later gate is stored first.
            frame.extend(said(n / 2));
            frame
        };
        let mut elements = enhanced();
        let frames = (0..4).map(frame).collect();
        elements.insert((0x5200, 0x9230), ("SQ", Items(frames)));
        elements.insert((0x08, 0x60), ("CS", Text(modality)));
        let files = [VolumeFile::in_memory(
            "test",
            Encoding::Explicit.file(&elements),
        )];
        crate::image::volume::read_gates(&files, false, &ReadLimits::default(), &Monitor::silent())
    };
    for tag in [
        (0x20, 0x9153),
        (0x20, 0x9252),
        (0x20, 0x9241),
        (0x18, 0x1060),
    ] {
        let reading = of(tag, "PT").unwrap();
        let first = |gate: usize| reading.gates[gate].voxels[0];
        assert_eq!([first(0), first(1)], [12.0, 0.0]);
        assert_eq!(reading.scans[1].slice_frames, [1, 2]);
        if tag != (0x18, 0x1060) {
            assert_eq!(reading.timing.rr_ms, Some(880.0));
            assert_eq!(reading.timing.low_rr_ms, Some(700.0));
            assert_eq!(reading.timing.rejected_share(), Some(0.1));
        }
        // A film of a heart is no image of uptake.
        let film = of(tag, "MR").unwrap_err();
        assert!(matches!(film, VolumeError::FrameNeeded { .. }), "{film}");
    }
}
