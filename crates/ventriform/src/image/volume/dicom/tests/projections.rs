//! Projections in files: their geometry, what contradicts it, and the volumes that are made of them.

use super::super::super::nifti::write_gates;
use super::super::super::{Reconstructed, read_gates, reconstructed};
use super::*;
use crate::image::reconstruct::{Method, Reconstruction};

const COLUMNS: usize = 32;
const ROWS: usize = 8;
const PIXEL_MM: f64 = 8.0;

/// A bright spot of the shape of a normal distribution: its centre, LPS mm, and its standard deviation, mm.
const SPOT: [f64; 3] = [40.0, -24.0, 8.0];
const SPOT_MM: f64 = 12.0;

/// How a camera turned.
#[derive(Clone)]
struct Turn {
    /// Start Angle of each detector.
    starts: Vec<f64>,
    direction: &'static str,
    step: f64,
    views: usize,
    gates: usize,
}

impl Turn {
    fn half() -> Self {
        Self {
            starts: vec![225.0],
            direction: "CW",
            step: 6.0,
            views: 30,
            gates: 1,
        }
    }

    /// The frame of a detector at an angle: 0 at the back, 90 at the left side, as seen from outside with the head on
    /// top.
    fn frame(angle_deg: f64, scale: f64) -> Vec<u16> {
        let angle = angle_deg.to_radians();
        let across = -angle.cos() * SPOT[0] + angle.sin() * SPOT[1];
        let pixel = |at: usize| {
            let column = (at % COLUMNS) as f64 - 0.5 * (COLUMNS as f64 - 1.0);
            let row = (at / COLUMNS) as f64 - 0.5 * (ROWS as f64 - 1.0);
            let off2 = (PIXEL_MM * column - across).powi(2) + (-PIXEL_MM * row - SPOT[2]).powi(2);
            (scale * 1000.0 * (-0.5 * off2 / SPOT_MM.powi(2)).exp()) as u16
        };
        (0..COLUMNS * ROWS).map(pixel).collect()
    }

    /// The image, its frames by gate, detector and view; each gate has a quarter more counts than the one before it.
    fn elements(&self) -> Elements {
        let sign = if self.direction == "CC" { 1.0 } else { -1.0 };
        let (mut pixels, mut vectors) = (Vec::new(), [const { Vec::new() }; 5]);
        for gate in 0..self.gates {
            for (detector, start) in self.starts.iter().enumerate() {
                for view in 0..self.views {
                    let angle = start + sign * self.step * view as f64;
                    pixels.extend(Self::frame(angle, 1.0 + 0.25 * gate as f64));
                    let numbers = [1, detector + 1, 1, gate + 1, view + 1];
                    for (vector, number) in vectors.iter_mut().zip(numbers) {
                        vector.push(number as u16);
                    }
                }
            }
        }
        let [windows, detectors, rotations, slots, views] = vectors;
        let several = self.starts.len() > 1;
        let of_detector = |start: &f64| {
            let mut item = BTreeMap::from([((0x18, 0x1181), ("CS", Text("PARA")))]);
            if several {
                item.insert((0x54, 0x200), ("DS", written(start)));
            }
            item
        };
        let rotation = BTreeMap::from([
            ((0x18, 0x1140), ("CS", Text(self.direction))),
            (
                (0x18, 0x1143),
                ("DS", written(self.step * self.views as f64)),
            ),
            ((0x18, 0x1144), ("DS", written(self.step))),
            ((0x18, 0x1242), ("IS", Text("20000"))),
            ((0x54, 0x53), ("US", Shorts(vec![self.views as u16]))),
            ((0x54, 0x200), ("DS", written(self.starts[0]))),
        ]);
        let gated = self.gates > 1;
        let kind = if gated { "GATED TOMO" } else { "TOMO" };
        let mut pointer = vec![0x54, 0x10, 0x54, 0x20, 0x54, 0x50];
        pointer.extend(if gated { vec![0x54, 0x70] } else { vec![] });
        pointer.extend([0x54, 0x90]);
        let mut elements = slices();
        elements.remove(&(0x54, 0x80));
        elements.extend([
            (
                (0x08, 0x08),
                (
                    "CS",
                    written(format!("ORIGINAL\\PRIMARY\\{kind}\\EMISSION")),
                ),
            ),
            ((0x28, 0x08), ("IS", written(windows.len()))),
            ((0x28, 0x09), ("AT", Shorts(pointer))),
            ((0x28, 0x10), ("US", Shorts(vec![ROWS as u16]))),
            ((0x28, 0x11), ("US", Shorts(vec![COLUMNS as u16]))),
            ((0x28, 0x30), ("DS", Text("8\\8"))),
            ((0x54, 0x10), ("US", Shorts(windows))),
            ((0x54, 0x11), ("US", Shorts(vec![1]))),
            ((0x54, 0x20), ("US", Shorts(detectors))),
            ((0x54, 0x21), ("US", Shorts(vec![self.starts.len() as u16]))),
            (
                (0x54, 0x22),
                ("SQ", Items(self.starts.iter().map(of_detector).collect())),
            ),
            ((0x54, 0x50), ("US", Shorts(rotations))),
            ((0x54, 0x51), ("US", Shorts(vec![1]))),
            ((0x54, 0x52), ("SQ", Items(vec![rotation]))),
            ((0x54, 0x90), ("US", Shorts(views))),
            ((0x7fe0, 0x10), ("OW", Shorts(pixels))),
        ]);
        if gated {
            let data = BTreeMap::from([((0x18, 0x1063), ("DS", Text("100")))]);
            let gates = BTreeMap::from([((0x54, 0x63), ("SQ", Items(vec![data])))]);
            elements.extend([
                ((0x54, 0x62), ("SQ", Items(vec![gates]))),
                ((0x54, 0x70), ("US", Shorts(slots))),
                ((0x54, 0x71), ("US", Shorts(vec![self.gates as u16]))),
            ]);
        }
        elements
    }
}

/// The item of a sequence.
fn item(elements: &mut Elements, sequence: (u16, u16), at: usize) -> &mut Elements {
    match elements.get_mut(&sequence) {
        Some((_, Items(items))) => &mut items[at],
        _ => panic!("no sequence {sequence:?}"),
    }
}

/// The centre of the values above half of the greatest, LPS mm.
fn centre(volume: &crate::image::grid::Volume) -> Vec3 {
    let half = 0.5 * volume.voxels.iter().copied().fold(0.0, f32::max);
    let [nx, ny, _] = volume.shape;
    let (mut sum, mut weight) = (Vec3::zeros(), 0.0);
    for (at, value) in volume.voxels.iter().enumerate().filter(|(_, v)| **v > half) {
        let index = [at % nx, at / nx % ny, at / (nx * ny)].map(|n| n as f64);
        sum += volume.frame.to_patient(&Vec3::from(index)) * f64::from(*value);
        weight += f64::from(*value);
    }
    sum / weight
}

#[test]
fn what_lies_at_a_place_is_found_there_however_the_camera_turned() {
    let half = Turn::half();
    let counter = Turn {
        starts: vec![45.0],
        direction: "CC",
        ..half.clone()
    };
    let whole = Turn {
        starts: vec![10.0],
        direction: "CC",
        views: 60,
        ..half.clone()
    };
    let heads = Turn {
        starts: vec![315.0, 225.0],
        views: 15,
        ..half.clone()
    };
    for (turn, arc) in [
        (half, "180"),
        (counter, "180"),
        (whole, "360"),
        (heads, "180"),
    ] {
        let reading = read_elements(&turn.elements()).unwrap();
        assert_eq!(reading.volume.shape, [COLUMNS, COLUMNS, ROWS]);
        let off = centre(&reading.volume) - Vec3::from(SPOT);
        assert!(
            off.norm() < 1.0,
            "{off:?} {:?} {}",
            turn.starts,
            turn.direction
        );
        assert_eq!(reading.facts.format, FileFormat::DicomProjections);
        assert_eq!(reading.facts.affine_source, AffineSource::UnknownOrigin);
        let told = reading.facts.warnings.join(" ");
        assert!(
            told.contains("OSEM 3 x 10, Butterworth 0.5 per cm, order 5"),
            "{told}"
        );
        let from = reading.provenance.unwrap();
        assert_eq!(
            from.reconstruction_method.as_deref(),
            Some("reconstructed here: OSEM 3 x 10")
        );
        assert_eq!(from.scan_arc.as_deref(), Some(arc));
    }
}

#[test]
fn contradicting_geometry_is_refused_by_its_name() {
    type Change = fn(&mut Elements);
    const DETECTORS: (u16, u16) = (0x54, 0x22);
    const ROTATIONS: (u16, u16) = (0x54, 0x52);
    let cases: [(Change, &str); 19] = [
        (
            |e| drop(e.remove(&(0x54, 0x90))),
            "Angular View Vector (0054,0090)",
        ),
        (
            |e| drop(e.insert((0x54, 0x90), ("US", Shorts(vec![1; 30])))),
            "Angular View Vector (0054,0090)",
        ),
        (
            |e| drop(e.insert((0x54, 0x90), ("US", Shorts((2..32).collect())))),
            "Angular View Vector (0054,0090)",
        ),
        (
            |e| drop(e.insert((0x54, 0x50), ("US", Shorts(vec![1; 29])))),
            "Rotation Vector (0054,0050)",
        ),
        (
            |e| drop(e.insert((0x54, 0x21), ("US", Shorts(vec![2])))),
            "Number of Detectors (0054,0021)",
        ),
        (
            |e| drop(e.insert((0x28, 0x09), ("AT", Shorts(vec![0x54, 0x80])))),
            "Frame Increment Pointer (0028,0009)",
        ),
        (
            |e| drop(e.remove(&(0x28, 0x30))),
            "Pixel Spacing (0028,0030)",
        ),
        (
            |e| drop(e.insert((0x28, 0x30), ("DS", Text("8\\7")))),
            "Pixel Spacing (0028,0030)",
        ),
        (
            |e| drop(item(e, DETECTORS, 0).insert((0x18, 0x1181), ("CS", Text("FANB")))),
            "Collimator Type (0018,1181)",
        ),
        (
            |e| drop(item(e, DETECTORS, 0).insert((0x18, 0x1120), ("DS", Text("10")))),
            "Gantry/Detector Tilt (0018,1120)",
        ),
        (
            |e| drop(item(e, DETECTORS, 0).insert((0x54, 0x200), ("DS", Text("90")))),
            "Start Angle (0054,0200)",
        ),
        (
            |e| drop(item(e, ROTATIONS, 0).remove(&(0x54, 0x200))),
            "Start Angle (0054,0200)",
        ),
        (
            |e| drop(item(e, ROTATIONS, 0).remove(&(0x18, 0x1144))),
            "Angular Step (0018,1144)",
        ),
        (
            |e| drop(item(e, ROTATIONS, 0).insert((0x18, 0x1144), ("DS", Text("-6")))),
            "Angular Step (0018,1144)",
        ),
        (
            |e| drop(item(e, ROTATIONS, 0).remove(&(0x18, 0x1140))),
            "Rotation Direction (0018,1140)",
        ),
        (
            |e| drop(item(e, ROTATIONS, 0).insert((0x18, 0x1140), ("CS", Text("LEFT")))),
            "Rotation Direction (0018,1140)",
        ),
        (
            |e| drop(item(e, ROTATIONS, 0).insert((0x18, 0x1143), ("DS", Text("360")))),
            "Scan Arc (0018,1143)",
        ),
        (
            |e| drop(item(e, ROTATIONS, 0).insert((0x54, 0x53), ("US", Shorts(vec![60])))),
            "Number of Frames in Rotation (0054,0053)",
        ),
        (
            // A quarter of a turn is too little for an image.
            |e| {
                let rotation = item(e, ROTATIONS, 0);
                rotation.insert((0x18, 0x1144), ("DS", Text("3")));
                rotation.insert((0x18, 0x1143), ("DS", Text("90")));
            },
            "Scan Arc (0018,1143)",
        ),
    ];
    for (change, field) in cases {
        let mut elements = Turn::half().elements();
        change(&mut elements);
        assert_eq!(complaint(read_elements(&elements)).0, field);
    }
}

#[test]
fn detectors_must_be_told_apart_and_be_alike() {
    type Change = fn(&mut Elements);
    let cases: [(Change, &str); 4] = [
        (
            |second| drop(second.remove(&(0x54, 0x200))),
            "Start Angle (0054,0200)",
        ),
        (
            |second| drop(second.insert((0x54, 0x200), ("DS", Text("315")))),
            "Start Angle (0054,0200)",
        ),
        (
            |second| drop(second.insert((0x18, 0x1181), ("CS", Text("CONE")))),
            "Collimator Type (0018,1181)",
        ),
        (
            |second| drop(second.insert((0x28, 0x31), ("DS", Text("2\\2")))),
            "Zoom Factor (0028,0031)",
        ),
    ];
    for (change, field) in cases {
        let turn = Turn {
            starts: vec![315.0, 225.0],
            views: 15,
            ..Turn::half()
        };
        let mut elements = turn.elements();
        item(&mut elements, (0x54, 0x22), 0).insert((0x28, 0x31), ("DS", Text("1\\1")));
        change(item(&mut elements, (0x54, 0x22), 1));
        assert_eq!(complaint(read_elements(&elements)).0, field);
    }
}

#[test]
fn the_stated_orientation_tells_which_end_the_first_row_is_at() {
    // At 225 degrees columns run along (-cos, sin).
    let stated = |rows: &str| {
        let mut elements = Turn::half().elements();
        let text = written(format!("0.7071068\\-0.7071068\\0\\0\\0\\{rows}"));
        item(&mut elements, (0x54, 0x22), 0).insert((0x20, 0x37), ("DS", text));
        read_elements(&elements).unwrap()
    };
    let [down, up] = [stated("-1"), stated("1")];
    assert!((centre(&down.volume) - Vec3::from(SPOT)).norm() < 1.0);
    let turned = Vec3::new(SPOT[0], SPOT[1], -SPOT[2]);
    assert!((centre(&up.volume) - turned).norm() < 1.0);
    for reading in [down, up] {
        let warnings = reading.facts.warnings;
        assert!(
            !warnings.iter().any(|w| w.contains("Image Orientation")),
            "{warnings:?}"
        );
    }
    let mut elements = Turn::half().elements();
    let other = ("DS", Text("-0.7071068\\0.7071068\\0\\0\\0\\-1"));
    item(&mut elements, (0x54, 0x22), 0).insert((0x20, 0x37), other);
    let warnings = read_elements(&elements).unwrap().facts.warnings;
    assert!(
        warnings.iter().any(|w| w.contains("Image Orientation")),
        "{warnings:?}"
    );
}

#[test]
fn the_window_with_the_photopeak_is_reconstructed() {
    let two = |second: &'static str| {
        let turn = Turn {
            starts: vec![225.0, 225.0],
            ..Turn::half()
        };
        // The frames of the second window are those of a second detector, which are alike.
        let mut elements = turn.elements();
        let numbers = elements.remove(&(0x54, 0x20)).unwrap();
        elements.insert((0x54, 0x10), numbers);
        elements.remove(&(0x54, 0x21));
        elements.insert((0x54, 0x11), ("US", Shorts(vec![2])));
        elements.insert(
            (0x28, 0x09),
            ("AT", Shorts(vec![0x54, 0x10, 0x54, 0x50, 0x54, 0x90])),
        );
        item(&mut elements, (0x54, 0x22), 0).remove(&(0x54, 0x200));
        let window = |low: &'static str, high: &'static str| {
            let range = BTreeMap::from([
                ((0x54, 0x14), ("DS", Text(low))),
                ((0x54, 0x15), ("DS", Text(high))),
            ]);
            BTreeMap::from([((0x54, 0x13), ("SQ", Items(vec![range])))])
        };
        let windows = vec![window("114", "126"), window(second, "154")];
        elements.insert((0x54, 0x12), ("SQ", Items(windows)));
        elements
    };
    let read = read_elements(&two("126.5")).unwrap();
    assert!(
        read.facts
            .warnings
            .iter()
            .any(|w| w.contains("number 2 was reconstructed"))
    );
    let error = complaint(read_elements(&two("141")));
    assert_eq!(error.0, "Energy Window Vector (0054,0010)");
    let file = VolumeFile::in_memory("raw.dcm", Encoding::Explicit.file(&two("141")));
    let how = Reconstruction {
        energy_window: Some(1),
        ..Reconstruction::default()
    };
    let limits = ReadLimits::default();
    assert!(reconstructed(&[file], &how, false, &limits, &Monitor::silent()).is_ok());
}

/// 8 gates.
fn gates() -> VolumeFile {
    let turn = Turn {
        gates: 8,
        ..Turn::half()
    };
    VolumeFile::in_memory("gated.dcm", Encoding::Explicit.file(&turn.elements()))
}

#[test]
fn gates_are_volumes_and_their_sum_is_that_of_their_counts() {
    let (limits, quiet) = (ReadLimits::default(), Monitor::silent());
    let sum = read_volume(&[gates()], &ReadOptions::default(), &limits, &quiet).unwrap();
    let all = read_gates(&[gates()], false, &limits, &quiet).unwrap();
    assert_eq!(
        (all.gates.len(), all.timing.frame_time_ms),
        (8, Some(100.0))
    );
    for (gate, volume) in all.gates.iter().enumerate() {
        assert!((centre(volume) - Vec3::from(SPOT)).norm() < 1.0);
        let share = volume.counts() / all.gates[0].counts();
        assert!(
            (share - (1.0 + 0.25 * gate as f64)).abs() < 0.01,
            "{gate} {share}"
        );
    }
    let counts: f64 = all.gates.iter().map(|gate| gate.counts()).sum();
    assert!((sum.volume.counts() / counts - 1.0).abs() < 0.01);
    let options = ReadOptions { frame: Some(3) };
    let fourth = read_volume(&[gates()], &options, &limits, &quiet).unwrap();
    assert_eq!(fourth.volume.voxels, all.gates[3].voxels);
    let facts = inspect_volume(&[gates()], &limits, &quiet).unwrap();
    assert_eq!((facts.frames, facts.shape), (8, [COLUMNS, COLUMNS, ROWS]));
    assert_eq!(facts.file_shape, [COLUMNS, ROWS, 240]);
}

#[test]
fn what_is_reconstructed_as_the_caller_says_is_read_back_as_gates() {
    let (limits, quiet) = (ReadLimits::default(), Monitor::silent());
    let made = |how: &Reconstruction, summed: bool| -> Reconstructed {
        reconstructed(&[gates()], how, summed, &limits, &quiet).unwrap()
    };
    let all = made(&Reconstruction::default(), false);
    assert_eq!((all.volumes.len(), all.gate_ms), (8, Some(100.0)));
    let bytes = write_gates(&all.volumes, all.gate_ms, true).unwrap();
    let file = VolumeFile::in_memory("gated.nii.gz", bytes);
    let back = read_gates(&[file], false, &limits, &quiet).unwrap();
    assert_eq!(back.timing.frame_time_ms.map(f64::round), Some(100.0));
    for (gate, volume) in back.gates.iter().enumerate() {
        assert_eq!(volume.voxels, all.volumes[gate].voxels);
    }
    let off = back.gates[0]
        .frame
        .greatest_distance(&all.volumes[0].frame, all.volumes[0].shape);
    assert!(off < 1e-3, "{off}");
    let fbp = Reconstruction {
        method: Method::Fbp,
        ..Reconstruction::default()
    };
    let one = made(&fbp, true);
    assert_eq!((one.volumes.len(), one.gate_ms), (1, None));
    assert!((centre(&one.volumes[0]) - Vec3::from(SPOT)).norm() < 1.5);
    let method = one.provenance.unwrap().reconstruction_method;
    assert_eq!(method.as_deref(), Some("reconstructed here: FBP"));
    let plain = VolumeFile::in_memory("slices.dcm", Encoding::Explicit.file(&slices()));
    let refused = reconstructed(&[plain], &fbp, true, &limits, &quiet).unwrap_err();
    assert!(
        matches!(refused, VolumeError::NotSlices { .. }),
        "{refused:?}"
    );
}

#[test]
fn a_matrix_beyond_the_budget_costs_nothing() {
    // Frames of 1024 x 1024 pixels, whose volume would have 2^30 voxels.
    let mut elements = Turn::half().elements();
    elements.insert((0x28, 0x10), ("US", Shorts(vec![1024])));
    elements.insert((0x28, 0x11), ("US", Shorts(vec![1024])));
    elements.insert((0x28, 0x100), ("US", Shorts(vec![8])));
    elements.insert((0x28, 0x101), ("US", Shorts(vec![8])));
    elements.insert((0x28, 0x102), ("US", Shorts(vec![7])));
    elements.insert((0x7fe0, 0x10), ("OB", Bytes(vec![0; 30 << 20])));
    let refused = read_elements(&elements);
    assert!(
        matches!(refused, Err(VolumeError::TooLarge { .. })),
        "{refused:?}"
    );
}
