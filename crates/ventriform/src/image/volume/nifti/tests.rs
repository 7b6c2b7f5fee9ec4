//! Unusual files made by code, and random damage.

use super::super::{
    AffineSource, ByteOrder, FileFormat, HeldGates, ReadOptions, Reading, Volume, VolumeFile,
    hold_gates, read as read_volume,
};
use super::*;
use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::Monitor;
use flate2::Compression;
use flate2::write::GzEncoder;
use nalgebra::Matrix3;
use proptest::prelude::*;
use std::io::Write;

/// A NIfTI-1 file under construction: 4 x 3 x 2 voxels of int16, 0..24, 2 mm, sform.
struct File {
    bytes: Vec<u8>,
    big_endian: bool,
}

impl File {
    fn new(big_endian: bool) -> Self {
        let mut file = Self {
            bytes: vec![0; 352],
            big_endian,
        };
        file.put(0, 348_i32.to_le_bytes());
        file.dim(&[4, 3, 2]);
        file.data_type(4, 16);
        file.reals(76, &[1.0, 2.0, 2.0, 2.0, 1.0, 1.0, 1.0, 1.0]);
        file.reals(108, &[352.0, 0.0, 0.0]);
        file.bytes[123] = 2;
        file.put(254, 1_i16.to_le_bytes());
        file.reals(
            280,
            &[2.0, 0.0, 0.0, -3.0, 0.0, 2.0, 0.0, 5.0, 0.0, 0.0, 2.0, 7.0],
        );
        file.bytes[344..348].copy_from_slice(b"n+1\0");
        for n in 0..24_i16 {
            file.push(n.to_le_bytes());
        }
        file
    }

    fn ordered<const N: usize>(&self, mut little: [u8; N]) -> [u8; N] {
        if self.big_endian {
            little.reverse();
        }
        little
    }

    fn put<const N: usize>(&mut self, at: usize, little: [u8; N]) {
        let ordered = self.ordered(little);
        self.bytes[at..at + N].copy_from_slice(&ordered);
    }

    fn push<const N: usize>(&mut self, little: [u8; N]) {
        let ordered = self.ordered(little);
        self.bytes.extend(ordered);
    }

    fn reals(&mut self, at: usize, values: &[f32]) {
        for (n, v) in values.iter().enumerate() {
            self.put(at + 4 * n, v.to_le_bytes());
        }
    }

    fn dim(&mut self, dim: &[i16]) {
        self.put(40, (dim.len() as i16).to_le_bytes());
        for (n, d) in dim.iter().enumerate() {
            self.put(42 + 2 * n, d.to_le_bytes());
        }
    }

    fn data_type(&mut self, code: i16, bits: i16) {
        self.put(70, code.to_le_bytes());
        self.put(72, bits.to_le_bytes());
    }

    fn read(&self) -> Result<Reading, VolumeError> {
        read_bytes(&self.bytes)
    }
}

fn read_bytes(bytes: &[u8]) -> Result<Reading, VolumeError> {
    read_files(&[bytes], None)
}

fn read_files(files: &[&[u8]], frame: Option<usize>) -> Result<Reading, VolumeError> {
    let file = |bytes: &&[u8]| VolumeFile::in_memory("test", *bytes);
    let files: Vec<_> = files.iter().map(file).collect();
    let options = ReadOptions { frame };
    read_volume(&files, &options, &ReadLimits::default(), &Monitor::silent())
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// The field and value that `result` complains of.
fn complaint(result: Result<Reading, VolumeError>) -> (&'static str, String) {
    match result {
        Err(VolumeError::Field { field, value, .. }) => (field, value),
        other => panic!("{other:?}"),
    }
}

const RAMP_VALUES: [f32; 24] = {
    let mut ramp = [0.0; 24];
    let mut n = 0;
    while n < 24 {
        ramp[n] = n as f32;
        n += 1;
    }
    ramp
};

#[test]
fn both_byte_orders_give_the_same() {
    for big_endian in [false, true] {
        let reading = File::new(big_endian).read().unwrap();
        assert_eq!(reading.volume.voxels, RAMP_VALUES);
        assert_eq!(reading.volume.shape, [4, 3, 2]);
        let order = [ByteOrder::Little, ByteOrder::Big][usize::from(big_endian)];
        assert_eq!(reading.facts.byte_order, order);
        assert_eq!(reading.facts.format, FileFormat::Nifti1);
        assert_eq!(reading.facts.affine_source, AffineSource::Sform);
        let origin = reading.volume.frame.to_patient(&Vec3::zeros());
        assert_eq!(origin, Vec3::new(3.0, -5.0, 7.0), "LPS");
        assert_eq!(reading.facts.warnings, Vec::<String>::new());
        assert!(reading.volume.integral);
    }
}

#[test]
fn every_real_type_is_read() {
    fn check<const N: usize>(code: i16, of: impl Fn(u8) -> [u8; N]) {
        for big_endian in [false, true] {
            let mut file = File::new(big_endian);
            file.data_type(code, 8 * N as i16);
            file.bytes.truncate(352);
            for n in 0..24 {
                file.push(of(n));
            }
            assert_eq!(
                file.read().unwrap().volume.voxels,
                RAMP_VALUES,
                "type {code}"
            );
        }
    }
    check(2, |n| [n]);
    check(256, |n| (n as i8).to_le_bytes());
    check(4, |n| i16::from(n).to_le_bytes());
    check(512, |n| u16::from(n).to_le_bytes());
    check(8, |n| i32::from(n).to_le_bytes());
    check(768, |n| u32::from(n).to_le_bytes());
    check(1024, |n| i64::from(n).to_le_bytes());
    check(1280, |n| u64::from(n).to_le_bytes());
    check(16, |n| f32::from(n).to_le_bytes());
    check(64, |n| f64::from(n).to_le_bytes());
}

#[test]
fn other_types_are_refused_by_code() {
    for (code, bits) in [
        (32, 64),
        (1792, 128),
        (128, 24),
        (2304, 32),
        (1536, 128),
        (0, 16),
        (1, 1),
    ] {
        let mut file = File::new(false);
        file.data_type(code, bits);
        assert_eq!(complaint(file.read()), ("datatype", code.to_string()));
    }
    let mut file = File::new(false);
    file.data_type(4, 8);
    assert_eq!(complaint(file.read()), ("bitpix", "8".into()));
}

#[test]
fn slope_and_intercept_apply_unless_the_slope_is_none() {
    let with = |slope: f32, inter: f32| {
        let mut file = File::new(false);
        file.reals(112, &[slope, inter]);
        file.read()
    };
    assert_eq!(with(0.5, 10.0).unwrap().volume.voxels[3], 11.5);
    assert!(!with(0.5, 10.0).unwrap().volume.integral);
    assert_eq!(with(-2.0, 0.0).unwrap().volume.voxels[3], -6.0);
    for slope in [0.0, f32::NAN] {
        let reading = with(slope, 7.0).unwrap();
        assert_eq!(reading.volume.voxels, RAMP_VALUES);
        assert!(reading.facts.warnings[0].contains("scl_inter 7"));
    }
    assert_eq!(complaint(with(f32::INFINITY, 0.0)).0, "scl_slope");
    assert_eq!(complaint(with(1.0, f32::NAN)).0, "scl_inter");
    let beyond = with(f32::MAX, 0.0);
    assert!(matches!(
        beyond,
        Err(VolumeError::Overflow {
            voxel: [2, 0, 0],
            ..
        })
    ));
}

#[test]
fn vox_offset_is_where_the_voxels_are() {
    let mut file = File::new(false);
    file.reals(108, &[417.0]);
    // An extension of 48 bytes, then padding.
    file.bytes[348] = 1;
    let mut between = vec![0xEE; 65];
    between[..4].copy_from_slice(&48_i32.to_le_bytes());
    file.bytes.splice(352..352, between);
    for bytes in [file.bytes.clone(), gzip(&file.bytes)] {
        assert_eq!(read_bytes(&bytes).unwrap().volume.voxels, RAMP_VALUES);
    }
    for wrong in [f32::NAN, f32::INFINITY, -1.0, 0.0, 351.0, 352.5] {
        file.reals(108, &[wrong]);
        assert_eq!(complaint(file.read()), ("vox_offset", wrong.to_string()));
    }
    file.reals(108, &[1e15]);
    assert!(matches!(file.read(), Err(VolumeError::Truncated { .. })));
    assert!(matches!(
        read_bytes(&gzip(&file.bytes)),
        Err(VolumeError::Truncated { .. })
    ));
}

#[test]
fn a_header_that_asks_for_the_moon_is_refused() {
    let mut file = File::new(false);
    file.dim(&[32767, 32767, 32767]);
    assert!(matches!(
        file.read(),
        Err(VolumeError::TooLarge { what: "voxels", .. })
    ));
    // 18 GB in 377 bytes, as 4-D within the limit of voxels.
    file.dim(&[512, 512, 512, 70]);
    file.bytes.truncate(377);
    assert!(matches!(
        file.read(),
        Err(VolumeError::FrameNeeded { .. } | VolumeError::Truncated { .. })
    ));
    assert!(matches!(
        read_bytes(&gzip(&file.bytes)),
        Err(VolumeError::Truncated { .. })
    ));
    file.dim(&[32767, 1, 1, 32767, 32767, 32767, 32767]);
    assert!(matches!(file.read(), Err(VolumeError::Truncated { .. })));
}

#[test]
fn dimensions_are_checked() {
    for (dim, field) in [
        (&[0_i16, 3, 2][..], "dim[1]"),
        (&[4, -3, 2], "dim[2]"),
        (&[4, 3, 2, 0], "dim[4]"),
        (&[], "dim[0]"),
        (&[4, 3, 2, 1, 1, 1, 1, 1], "dim[0]"),
    ] {
        let mut file = File::new(false);
        file.dim(dim);
        assert_eq!(complaint(file.read()).0, field);
    }
    let mut file = File::new(false);
    file.dim(&[4, 3, 2, 1, 1, 1, 1]);
    let reading = file.read().unwrap();
    assert_eq!((reading.volume.shape, reading.facts.frames), ([4, 3, 2], 1));
    assert_eq!(reading.facts.file_shape.len(), 7);
    file.dim(&[24]);
    assert_eq!(file.read().unwrap().volume.shape, [24, 1, 1]);
}

#[test]
fn of_several_volumes_one_must_be_named() {
    let mut file = File::new(false);
    file.dim(&[4, 3, 1, 2]);
    // A vector's components are no gates.
    file.put(68, 1007_i16.to_le_bytes());
    let refused = file.read().unwrap_err();
    assert!(matches!(
        refused,
        VolumeError::FrameNeeded { frames: 2, .. }
    ));
    assert!(
        refused.to_string().contains("intent_code 1007"),
        "{refused}"
    );
    let second = |bytes: &[u8]| read_files(&[bytes], Some(1)).unwrap();
    for bytes in [file.bytes.clone(), gzip(&file.bytes)] {
        assert_eq!(second(&bytes).volume.voxels, RAMP_VALUES[12..]);
        assert_eq!(second(&bytes).facts.frame, Some(1));
    }
    let third = read_files(&[&file.bytes], Some(2)).err();
    assert_eq!(
        third,
        Some(VolumeError::FrameOutOfRange {
            frame: 2,
            frames: 2
        })
    );
    let files = [VolumeFile::in_memory("test", file.bytes)];
    let facts = super::super::inspect(&files, &ReadLimits::default(), &Monitor::silent()).unwrap();
    assert_eq!(
        (facts.frames, facts.frame, facts.intensity.sum),
        (2, None, 276.0)
    );
}

/// sform, qform and `pixdim` in both versions and as a pair: what agrees is read in silence, what
/// differs is refused or warned of with both figures.
#[test]
fn geometry_that_contradicts_itself_is_told_with_both_figures() {
    /// Columns of the sform, origin.
    struct Sform([[f32; 3]; 3], [f32; 3]);
    /// Quaternion, offset, qfac.
    struct Qform([f32; 3], [f32; 3], f32);
    #[derive(Clone, Copy, Debug)]
    enum Form {
        First,
        Pair,
        Second,
    }
    let read = |form: Form, s: Option<&Sform>, q: Option<&Qform>, sizes: [f32; 3]| {
        let mut file = File::new(false);
        file.put(254, i16::from(s.is_some()).to_le_bytes());
        file.put(252, i16::from(q.is_some()).to_le_bytes());
        file.reals(76, &[q.map_or(1.0, |q| q.2), sizes[0], sizes[1], sizes[2]]);
        let srow = |r: usize| {
            let s = s.unwrap_or(&Sform([[0.0; 3]; 3], [0.0; 3]));
            [s.0[0][r], s.0[1][r], s.0[2][r], s.1[r]]
        };
        for r in 0..3 {
            file.reals(280 + 16 * r, &srow(r));
        }
        if let Some(q) = q {
            file.reals(256, &q.0);
            file.reals(268, &q.1);
        }
        let voxels = file.bytes[352..].to_vec();
        match form {
            Form::First => file.read(),
            Form::Pair => {
                file.bytes[344..348].copy_from_slice(b"ni1\0");
                file.reals(108, &[0.0]);
                read_files(&[&file.bytes[..348], &voxels], None)
            }
            Form::Second => {
                let first = file;
                let mut file = File {
                    bytes: vec![0; 544],
                    big_endian: false,
                };
                file.put(0, 540_i32.to_le_bytes());
                file.bytes[4..12].copy_from_slice(b"n+2\0\r\n\x1a\n");
                file.put(12, 4_i16.to_le_bytes());
                file.put(14, 16_i16.to_le_bytes());
                for (n, d) in [3_i64, 4, 3, 2].iter().enumerate() {
                    file.put(16 + 8 * n, d.to_le_bytes());
                }
                let real = |at: usize| {
                    let bytes = first.bytes[at..at + 4].try_into().unwrap();
                    f64::from(f32::from_le_bytes(bytes)).to_le_bytes()
                };
                for n in 0..4 {
                    file.put(104 + 8 * n, real(76 + 4 * n));
                }
                file.put(168, 544_i64.to_le_bytes());
                file.put(344, i32::from(q.is_some()).to_le_bytes());
                file.put(348, i32::from(s.is_some()).to_le_bytes());
                for n in 0..6 {
                    file.put(352 + 8 * n, real(256 + 4 * n));
                }
                for n in 0..12 {
                    file.put(400 + 8 * n, real(280 + 4 * n));
                }
                file.put(500, 2_i32.to_le_bytes());
                file.bytes.extend(&voxels);
                file.read()
            }
        }
    };
    let along = |x: f32, y: f32, z: f32| [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]];
    let origin = [10.0, 20.0, 30.0];
    let sform = |columns| Sform(columns, origin);
    let upright = Qform([0.0; 3], origin, 1.0);
    let (cosine, sine) = (5.0 * 0.8_f32, 5.0 * 0.6_f32);
    let turned = [[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 6.0]];
    for form in [Form::First, Form::Pair, Form::Second] {
        let quiet = |s: Option<&Sform>, q: Option<&Qform>, sizes| {
            let reading = read(form, s, q, sizes).unwrap();
            assert_eq!(reading.facts.warnings, Vec::<String>::new(), "{form:?}");
            reading.facts.spacing_mm
        };
        let told = |s: &Sform, q: Option<&Qform>, sizes, words: &[&str]| {
            let text = match read(form, Some(s), q, sizes) {
                Ok(reading) => reading.facts.warnings.join(" "),
                Err(VolumeError::Field { field, .. }) => panic!("{form:?} refused for {field}"),
                Err(error) => panic!("{error}"),
            };
            for word in words {
                assert!(text.contains(word), "{form:?}: {text}: {word}");
            }
        };
        let refused = |s: &Sform, q: Option<&Qform>, sizes, words: &[&str]| {
            let error = read(form, Some(s), q, sizes).unwrap_err();
            assert_eq!(error.field(), Some("pixdim"));
            for word in words {
                assert!(error.to_string().contains(word), "{error}: {word}");
            }
        };
        let plain = sform(along(5.0, 5.5, 6.0));
        let sizes = [5.0, 5.5, 6.0];
        assert_eq!(quiet(Some(&plain), None, sizes), [5.0, 5.5, 6.0]);
        assert_eq!(quiet(Some(&plain), Some(&upright), sizes), [5.0, 5.5, 6.0]);
        assert_eq!(quiet(None, Some(&upright), sizes), [5.0, 5.5, 6.0]);
        quiet(Some(&plain), None, [5.002, 5.498, 6.0]);
        // An sform of unit size beside the voxels' true size, with and without a qform, and the reverse.
        let unit = sform(along(-1.0, -1.0, 1.0));
        refused(&unit, None, [5.0; 3], &["5 x 5 x 5 mm", "1 x 1 x 1 mm"]);
        refused(
            &unit,
            Some(&upright),
            sizes,
            &["5 x 5.5 x 6 mm", "1 x 1 x 1 mm"],
        );
        refused(
            &plain,
            Some(&upright),
            [1.0; 3],
            &["1 x 1 x 1 mm", "5 x 5.5 x 6 mm"],
        );
        refused(&plain, None, [5.0, 5.5, 60.0], &["60", "6 mm"]);
        // Sizes that an alignment may scale, and fields that were never filled in.
        told(
            &plain,
            None,
            [5.0, 5.0, 6.0],
            &["5 x 5.5 x 6 mm", "5 x 5 x 6 mm", "sform was used"],
        );
        told(
            &plain,
            None,
            [1.0; 3],
            &["5 x 5.5 x 6 mm", "1 x 1 x 1 mm", "sform was used"],
        );
        told(&plain, None, [0.0; 3], &["5 x 5.5 x 6 mm", "sform's"]);
        // Place, direction and handedness between sform and qform.
        let moved = Qform([0.0; 3], [14.0, 20.0, 27.0], 1.0);
        told(
            &plain,
            Some(&moved),
            sizes,
            &[
                "5.0000 mm apart",
                "(10.000, 20.000, 30.000)",
                "(14.000, 20.000, 27.000)",
            ],
        );
        let square = [5.0, 5.0, 6.0];
        told(
            &sform(turned),
            Some(&upright),
            square,
            &["36.9 degrees", "sform was used"],
        );
        let mirrored = sform(along(5.0, 5.5, -6.0));
        told(
            &mirrored,
            Some(&upright),
            sizes,
            &["left-handed", "right-handed", "mirrors"],
        );
        let other_hand = Qform([0.0; 3], origin, -1.0);
        told(&plain, Some(&other_hand), sizes, &["mirrors"]);
        quiet(Some(&mirrored), Some(&other_hand), sizes);
        let half_turn = Qform([0.0, 0.0, (0.1_f32).sqrt()], origin, 1.0);
        quiet(Some(&sform(turned)), Some(&half_turn), square);
    }
}

/// The value of a voxel of a gate, which are alike.
fn gate_value(voxel: usize, gate: usize) -> i16 {
    (100 * (voxel % 7) + (5 * gate) % 8) as i16
}

/// The voxels, of 12 each, that are read of a file with these volumes along the fourth dimension: the sum
/// unless the header contradicts that they are gates of one heart beat.
#[test]
fn gates_are_summed_and_what_is_none_needs_a_frame() {
    /// Unit of time, step, intent.
    type Time = (u8, f32, i16);
    let file = |dim: &[i16], (unit, step, intent): Time| {
        let mut file = File::new(false);
        file.dim(dim);
        file.bytes[123] = 2 | unit;
        file.reals(92, &[step]);
        file.put(68, intent.to_le_bytes());
        let count: usize = dim.iter().map(|d| *d as usize).product();
        file.bytes.truncate(352);
        for n in 0..count {
            file.push(gate_value(n % 12, n / 12).to_le_bytes());
        }
        file
    };
    let gated: [(i16, Time); 7] = [
        (8, (0, 1.0, 0)),
        (6, (16, 140.0, 0)),
        (16, (8, 0.05, 0)),
        (8, (16, 110.0, 2001)),
        (8, (24, 110_000.0, 0)),
        // One unit of time is the default of writers.
        (16, (8, 1.0, 0)),
        (32, (0, 30.0, 0)),
    ];
    let held = |file: &File, stated: bool| {
        let files = [VolumeFile::in_memory("test", &file.bytes[..])];
        let held = hold_gates(&files, stated, &ReadLimits::default(), &Monitor::silent());
        held.unwrap() == HeldGates::Beat
    };
    for (gates, time) in gated {
        let file = file(&[4, 3, 1, gates], time);
        assert!(held(&file, false));
        let reading = file.read().unwrap();
        let value = |v: usize, gate: usize| f32::from(gate_value(v, gate));
        let sums: Vec<f32> = (0..12)
            .map(|v| (0..gates as usize).map(|gate| value(v, gate)).sum())
            .collect();
        assert_eq!(reading.volume.voxels, sums, "{gates} {time:?}");
        assert_eq!(reading.facts.frame, None);
        let told = reading.facts.warnings.join(" ");
        assert!(
            told.contains(&format!("The {gates} gates were summed")),
            "{told}"
        );
        assert!(told.contains("taken for gates"), "{told}");
        // A single one is still read by its number, from 0.
        let second = read_files(&[&file.bytes], Some(1)).unwrap().volume.voxels;
        let expected: Vec<f32> = (0..12).map(|v| value(v, 1)).collect();
        assert_eq!(second, expected);
    }
    let others: [(&[i16], Time, &str); 10] = [
        // Nothing calls them gates, and a beat has more.
        (&[4, 3, 1, 2], (8, 0.0, 0), "fewer than the 6"),
        (&[4, 3, 1, 5], (0, 0.0, 0), "fewer than the 6"),
        // A dynamic study: 12 volumes of 10 s.
        (&[4, 3, 1, 12], (8, 10.0, 0), "120 s"),
        (&[4, 3, 1, 8], (16, 5000.0, 0), "40 s"),
        (&[4, 3, 1, 8], (8, 0.5, 0), "4 s"),
        (&[4, 3, 1, 33], (0, 0.0, 0), "33"),
        (&[4, 3, 1, 3], (0, 0.0, 1005), "1005"),
        (&[4, 3, 1, 8], (32, 1.0, 0), "unit 32"),
        (&[4, 3, 1, 1, 3], (0, 0.0, 0), "dim"),
        (&[4, 3, 1, 4, 2], (0, 0.0, 0), "dim"),
    ];
    for (dim, time, word) in others {
        let volumes: i16 = dim[3..].iter().product();
        assert!(!held(&file(dim, time), false));
        assert_eq!(held(&file(dim, time), true), (6..=32).contains(&volumes));
        let refused = file(dim, time).read().unwrap_err();
        assert!(
            matches!(refused, VolumeError::FrameNeeded { .. }),
            "{refused}"
        );
        assert!(refused.to_string().contains(word), "{refused}: {word}");
    }
    // One volume is one volume, whatever the header says of time.
    let single = file(&[4, 3, 1, 1], (8, 30.0, 0)).read().unwrap();
    assert_eq!(single.facts.frame, Some(0));
    assert_eq!(single.facts.warnings, Vec::<String>::new());
}

#[test]
fn pairs_come_in_any_order_and_packing() {
    let mut file = File::new(true);
    file.bytes[344..348].copy_from_slice(b"ni1\0");
    file.reals(108, &[6.0]);
    let header = file.bytes[..348].to_vec();
    let mut image = vec![9; 6];
    image.extend(&file.bytes[352..]);
    let (packed_header, packed_image) = (gzip(&header), gzip(&image));
    for (a, b) in [
        (&header, &image),
        (&packed_header, &image),
        (&image, &packed_header),
        (&packed_image, &header),
    ] {
        let reading = read_files(&[a, b], None).unwrap();
        assert_eq!(reading.volume.voxels, RAMP_VALUES);
        assert_eq!(reading.facts.format, FileFormat::Nifti1Pair);
    }
    assert!(matches!(
        read_bytes(&header),
        Err(VolumeError::ImageMissing { .. })
    ));
    let both = read_files(&[&header, &header], None);
    let error = both.err().unwrap().to_string();
    assert!(error.contains("2 NIfTI headers"), "{error}");
}

#[test]
fn gzip_members_padding_damage_and_cuts() {
    let bytes = File::new(false).bytes;
    let mut members = Vec::new();
    for part in bytes.chunks(97) {
        members.extend(gzip(part));
    }
    assert_eq!(read_bytes(&members).unwrap().volume.voxels, RAMP_VALUES);
    members.extend([0; 512]);
    assert_eq!(read_bytes(&members).unwrap().volume.voxels, RAMP_VALUES);
    let packed = gzip(&bytes);
    for cut in 3..packed.len() {
        assert!(read_bytes(&packed[..cut]).is_err(), "cut at {cut}");
    }
    let mut wrong_sum = packed.clone();
    let end = wrong_sum.len() - 8;
    wrong_sum[end] ^= 1;
    assert!(matches!(
        read_bytes(&wrong_sum),
        Err(VolumeError::Corrupt { .. })
    ));
}

#[test]
fn what_follows_the_voxels_is_not_unpacked() {
    let mut bytes = File::new(false).bytes;
    bytes.resize(bytes.len() + (64 << 20), 0);
    let reading = read_bytes(&gzip(&bytes)).unwrap();
    assert_eq!(reading.volume.voxels, RAMP_VALUES);
    assert!(reading.facts.warnings[0].contains("were ignored"));
}

#[test]
fn reading_can_be_cancelled() {
    let token = crate::base::progress::CancelToken::new();
    token.cancel();
    let monitor = Monitor::new(&crate::base::progress::Silent, token);
    let files = [VolumeFile::in_memory("test", File::new(false).bytes)];
    let result = read_volume(
        &files,
        &ReadOptions::default(),
        &ReadLimits::default(),
        &monitor,
    );
    assert!(matches!(result, Err(VolumeError::Cancelled(_))));
}

#[test]
fn limits_are_kept() {
    let file = File::new(false);
    let limited = |bytes: &[u8], limits: ReadLimits| {
        let files = [VolumeFile::in_memory("test", bytes)];
        read_volume(&files, &ReadOptions::default(), &limits, &Monitor::silent()).err()
    };
    let few = ReadLimits {
        voxels: 23,
        ..ReadLimits::default()
    };
    let short = ReadLimits {
        unpacked_bytes: 399,
        ..ReadLimits::default()
    };
    let enough = ReadLimits {
        voxels: 24,
        unpacked_bytes: 400,
        ..ReadLimits::DEFAULT
    };
    for bytes in [file.bytes.clone(), gzip(&file.bytes)] {
        let e = limited(&bytes, few);
        assert!(matches!(
            e,
            Some(VolumeError::TooLarge {
                what: "voxels",
                asked: 24,
                limit: 23,
                ..
            })
        ));
        let e = limited(&bytes, short);
        assert!(matches!(
            e,
            Some(VolumeError::TooLarge {
                what: "unpacked bytes",
                ..
            })
        ));
        assert_eq!(limited(&bytes, enough), None);
    }
}

#[test]
fn units_become_millimetres() {
    for (code, scale) in [(1, 1000.0), (2, 1.0), (3, 0.001), (0, 1.0)] {
        let mut file = File::new(false);
        file.bytes[123] = code | 8;
        let facts = file.read().unwrap().facts;
        assert!((facts.spacing_mm[0] - 2.0 * scale).abs() < 1e-12);
        assert!((facts.affine_ras[(2, 3)] - 7.0 * scale).abs() < 1e-12);
        assert_eq!(facts.warnings.is_empty(), scale == 1.0);
    }
}

#[test]
fn qform_turns_and_mirrors() {
    let mut file = File::new(false);
    file.put(254, 0_i16.to_le_bytes());
    file.put(252, 1_i16.to_le_bytes());
    // A quarter turn about z, spacing 2, 3, 4, k backwards.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    file.reals(76, &[-1.0, 2.0, 3.0, 4.0]);
    file.reals(256, &[0.0, 0.0, half, 10.0, 20.0, 30.0]);
    let facts = file.read().unwrap().facts;
    let expected = nalgebra::Matrix4::new(
        0.0, -3.0, 0.0, 10.0, 2.0, 0.0, 0.0, 20.0, 0.0, 0.0, -4.0, 30.0, 0.0, 0.0, 0.0, 1.0,
    );
    assert!((facts.affine_ras - expected).abs().max() < 1e-6);
    assert_eq!(facts.affine_source, AffineSource::Qform);
    file.reals(256, &[1.0, 1.0, half]);
    assert_eq!(complaint(file.read()).0, "quatern_b/c/d");
    file.reals(256, &[0.0, 0.0, half]);
    file.reals(84, &[f32::NAN]);
    assert_eq!(complaint(file.read()), ("pixdim[2]", "NaN".into()));
    file.reals(84, &[-3.0]);
    assert!(
        file.read().is_ok(),
        "the reference library takes the absolute value"
    );
}

#[test]
fn disagreeing_forms_are_told_and_the_sform_taken() {
    let mut file = File::new(false);
    file.put(252, 1_i16.to_le_bytes());
    file.reals(268, &[-3.0, 5.0, 7.0]);
    assert!(file.read().unwrap().facts.warnings.is_empty());
    file.reals(268, &[-3.0, 15.0, 7.0]);
    let facts = file.read().unwrap().facts;
    assert!(
        facts.warnings[0].contains("up to 10.0000 mm apart"),
        "{:?}",
        facts.warnings
    );
    assert_eq!(facts.affine_ras[(1, 3)], 5.0);
    file.reals(280, &[0.0; 12]);
    assert_eq!(complaint(file.read()).0, "srow_x/y/z");
}

#[test]
fn without_forms_the_assumption_is_told() {
    let mut file = File::new(false);
    file.put(254, 0_i16.to_le_bytes());
    let facts = file.read().unwrap().facts;
    assert_eq!(facts.affine_source, AffineSource::Pixdim);
    assert!(facts.warnings[0].contains("Neither sform nor qform"));
    assert_eq!(facts.affine_ras[(0, 0)], -2.0);
    assert_eq!(facts.affine_ras[(0, 3)], 3.0);
}

/// Packed voxels of four bytes are decoded within the memory that they were unpacked to, plain ones
/// on their way from the file.
#[test]
fn packed_voxels_of_four_bytes_are_what_plain_ones_are() {
    // More than one portion, the last one not full; numbers that `f32` does not hold in the last.
    let shape = [60, 40, 30];
    let count = shape.iter().map(|n| *n as usize).product::<usize>();
    let odd = 70_001;
    for (code, at_odd) in [
        (16, f32::INFINITY.to_bits()),
        (8, 20_000_001),
        (768, u32::MAX),
    ] {
        for big_endian in [false, true] {
            for begin in [352, 353, 368] {
                let mut file = File::new(big_endian);
                file.dim(&shape);
                file.data_type(code, 32);
                file.reals(108, &[begin as f32]);
                file.bytes.resize(begin, 0);
                for n in 0..count {
                    let bits = match n {
                        _ if n == odd => at_odd,
                        _ if code == 16 => (n as f32).sqrt().to_bits(),
                        _ => n as u32,
                    };
                    file.push(bits.to_le_bytes());
                }
                let plain = file.read().unwrap();
                let packed = read_bytes(&gzip(&file.bytes)).unwrap();
                let bits = |reading: &Reading| -> Vec<u32> {
                    reading.volume.voxels.iter().map(|v| v.to_bits()).collect()
                };
                assert_eq!(bits(&plain), bits(&packed));
                assert_eq!(plain.facts.intensity, packed.facts.intensity);
                assert_eq!(plain.facts.warnings, packed.facts.warnings);
                assert_eq!(packed.facts.warnings.len(), 1, "of the odd voxel");
                if code != 16 {
                    file.reals(112, &[1e32, 0.0]);
                    let expected = [odd % 60, odd / 60 % 40, odd / 2400];
                    for bytes in [file.bytes.clone(), gzip(&file.bytes)] {
                        let overflow = read_bytes(&bytes);
                        assert!(
                            matches!(overflow, Err(VolumeError::Overflow { voxel, .. }) if voxel == expected),
                            "{overflow:?}"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn infinities_are_missing_and_emptiness_is_refused() {
    let mut file = File::new(false);
    file.data_type(16, 32);
    file.bytes.truncate(352);
    for n in 0..24 {
        file.push([1.0, f32::INFINITY, f32::NAN][n % 3].to_le_bytes());
    }
    let reading = file.read().unwrap();
    assert_eq!(reading.facts.intensity.missing, 16);
    assert!(reading.volume.voxels.iter().all(|v| !v.is_infinite()));
    assert!(reading.facts.warnings[0].starts_with("8 voxels are infinite"));
    for chunk in file.bytes[352..].as_chunks_mut::<4>().0 {
        *chunk = f32::NAN.to_le_bytes();
    }
    assert!(matches!(
        file.read(),
        Err(VolumeError::NoFiniteVoxel { .. })
    ));
    file.data_type(64, 64);
    file.bytes.truncate(352);
    for n in 0..24 {
        file.push([1.0_f64, 1e300][n % 2].to_le_bytes());
    }
    assert!(matches!(
        file.read(),
        Err(VolumeError::Overflow { value: 1e300, .. })
    ));
}

#[test]
fn version_2_is_read() {
    for big_endian in [false, true] {
        let mut file = File {
            bytes: vec![0; 560],
            big_endian,
        };
        file.put(0, 540_i32.to_le_bytes());
        file.bytes[4..12].copy_from_slice(b"n+2\0\r\n\x1a\n");
        file.put(12, 512_i16.to_le_bytes());
        file.put(14, 16_i16.to_le_bytes());
        for (n, d) in [3_i64, 4, 3, 2].iter().enumerate() {
            file.put(16 + 8 * n, d.to_le_bytes());
        }
        file.put(168, 560_i64.to_le_bytes());
        file.put(176, 0.25_f64.to_le_bytes());
        file.put(348, 2_i32.to_le_bytes());
        for (n, v) in [0.0, 0.0, 3.5, 1.0, 3.5, 0.0, 0.0, 2.0, 0.0, 3.5, 0.0, 3.0]
            .iter()
            .enumerate()
        {
            let v: &f64 = v;
            file.put(400 + 8 * n, v.to_le_bytes());
        }
        file.put(500, 2_i32.to_le_bytes());
        for n in 0..24_u16 {
            file.push(n.to_le_bytes());
        }
        let reading = file.read().unwrap();
        assert_eq!(reading.facts.format, FileFormat::Nifti2);
        assert_eq!(reading.volume.voxels, RAMP_VALUES.map(|v| v / 4.0));
        assert_eq!(reading.facts.spacing_mm, [3.5; 3]);
        file.put(16 + 8, i64::MAX.to_le_bytes());
        assert!(matches!(file.read(), Err(VolumeError::TooLarge { .. })));
        file.put(16 + 8, 4_i64.to_le_bytes());
        file.put(168, (-1_i64).to_le_bytes());
        assert_eq!(complaint(file.read()), ("vox_offset", "-1".into()));
    }
}

/// The `nifti` crate reads the header and the voxels that are written here.
#[test]
fn written_files_are_read_by_the_nifti_crate() {
    use ::nifti::{InMemNiftiVolume, NiftiHeader, RandomAccessNiftiVolume};
    let volume = oblique();
    let bytes = write(&volume, StoredType::Float32, false).unwrap();
    let header = NiftiHeader::from_reader(&bytes[..348]).unwrap();
    let voxels = InMemNiftiVolume::from_reader(&bytes[352..], &header).unwrap();
    for k in 0..3 {
        for j in 0..4 {
            for i in 0..5 {
                let index = [i, j, k].map(|x| x as u16);
                assert_eq!(voxels.get_f32(&index).unwrap(), volume.at(i, j, k));
            }
        }
    }
    assert_eq!(header.dim, [3, 5, 4, 3, 1, 1, 1, 1]);
    assert_eq!(
        (header.datatype, header.bitpix, header.vox_offset),
        (16, 32, 352.0)
    );
    let ras = volume.frame.to_ras();
    for (r, srow) in [header.srow_x, header.srow_y, header.srow_z]
        .iter()
        .enumerate()
    {
        for c in 0..4 {
            assert!((f64::from(srow[c]) - ras[(r, c)]).abs() < 1e-5);
        }
    }
    let [b, c, d] = [header.quatern_b, header.quatern_c, header.quatern_d].map(f64::from);
    let a = (1.0 - b * b - c * c - d * d).max(0.0).sqrt();
    let turn = nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(a, b, c, d));
    for axis in 0..3 {
        let mut step = Vec3::zeros();
        step[axis] = f64::from(header.pixdim[axis + 1]);
        if axis == 2 {
            step *= f64::from(header.pixdim[0]);
        }
        let column = ras.fixed_view::<3, 1>(0, axis);
        assert!((turn * step - column).norm() < 1e-4);
    }
}

/// 5 x 4 x 3 voxels of a turned, left-handed grid with values of both signs.
fn oblique() -> Volume {
    let turn = nalgebra::Rotation3::from_euler_angles(0.3, -2.0, 1.1);
    let steps = Matrix3::from_diagonal(&Vec3::new(2.0, 3.0, -4.5));
    let frame = VoxelToPatient::new(turn.matrix() * steps, Vec3::new(-7.0, 11.0, 42.0)).unwrap();
    let voxels = (0..60).map(|n| (n as f32 * 0.731).sin() * 250.0).collect();
    Volume {
        shape: [5, 4, 3],
        voxels,
        frame,
        integral: false,
    }
}

#[test]
fn what_is_written_comes_back() {
    let volume = oblique();
    for gzip in [false, true] {
        // Half of a step: of the range of 500, a 64 000th or a 255th.
        for (stored, most) in [
            (StoredType::Float32, 0.0),
            (StoredType::Int16, 0.004),
            (StoredType::Scaled8, 0.99),
        ] {
            let bytes = write(&volume, stored, gzip).unwrap();
            assert_eq!(bytes, write(&volume, stored, gzip).unwrap());
            let reading = read_bytes(&bytes).unwrap();
            assert!(
                reading.facts.warnings.is_empty(),
                "{:?}",
                reading.facts.warnings
            );
            let off = |(a, b): (&f32, &f32)| (a - b).abs();
            let pairs = reading.volume.voxels.iter().zip(&volume.voxels);
            let worst = pairs.map(off).fold(0.0, f32::max);
            assert!(worst <= most, "{stored:?}: {worst}");
            let apart = (reading.volume.frame.matrix() - volume.frame.matrix())
                .abs()
                .max();
            assert!(apart < 1e-5);
        }
    }
}

#[test]
fn masks_and_counts_are_written_exactly() {
    let mut volume = oblique();
    volume.voxels = (0..60).map(|n| (n % 3) as f32).collect();
    for stored in [StoredType::Uint8, StoredType::Int16, StoredType::Float32] {
        let reading = read_bytes(&write(&volume, stored, true).unwrap()).unwrap();
        assert_eq!(reading.volume.voxels, volume.voxels);
        assert!(reading.volume.integral);
    }
    volume.voxels = vec![0.37; 60];
    for stored in [StoredType::Int16, StoredType::Scaled8] {
        let constant = read_bytes(&write(&volume, stored, false).unwrap()).unwrap();
        assert_eq!(constant.volume.voxels, volume.voxels);
    }
}

#[test]
fn a_sheared_affine_goes_out_as_sform_alone() {
    let mut volume = oblique();
    let mut sheared = *volume.frame.linear();
    sheared[(0, 1)] += 0.5;
    volume.frame = VoxelToPatient::new(sheared, Vec3::zeros()).unwrap();
    let bytes = write(&volume, StoredType::Float32, false).unwrap();
    assert_eq!(&bytes[252..254], &[0, 0], "qform_code");
    let back = read_bytes(&bytes).unwrap().volume.frame;
    assert!((back.linear() - sheared).abs().max() < 1e-6);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    /// Damage of any header bytes: an error, or voxels as many as the shape says.
    #[test]
    fn damage_never_panics(
        changes in prop::collection::vec((0_usize..400, any::<u8>()), 1..6),
        big_endian: bool,
        packed: bool,
        cut in 0_usize..500,
    ) {
        let mut bytes = File::new(big_endian).bytes;
        for (at, value) in changes {
            bytes[at] = value;
        }
        if cut < bytes.len() && cut % 2 == 1 {
            bytes.truncate(cut);
        }
        let bytes = if packed { gzip(&bytes) } else { bytes };
        let limits = ReadLimits { voxels: 1 << 16, unpacked_bytes: 1 << 20, ..ReadLimits::DEFAULT };
        let files = [VolumeFile::in_memory("damaged", bytes)];
        for frame in [None, Some(0), Some(3)] {
            let options = ReadOptions { frame };
            if let Ok(reading) = read_volume(&files, &options, &limits, &Monitor::silent()) {
                let count: usize = reading.volume.shape.iter().product();
                prop_assert_eq!(reading.volume.voxels.len(), count);
                prop_assert!(count <= 1 << 16);
            }
        }
    }

    /// Damage of packed bytes.
    #[test]
    fn damaged_gzip_never_panics(at in 0_usize..200, value: u8) {
        let mut bytes = gzip(&File::new(false).bytes);
        let at = at % bytes.len();
        bytes[at] = value;
        let _ = read_bytes(&bytes);
    }
}

#[test]
fn a_mask_written_by_slices_is_the_mask_written_whole() {
    let mut volume = Volume {
        shape: [5, 4, 3],
        voxels: (0..60).map(|v| f32::from(u8::from(v % 7 < 3))).collect(),
        frame: VoxelToPatient::centred([5, 4, 3], [1.0, 2.0, 3.0], Vec3::new(4.0, 5.0, 6.0))
            .unwrap(),
        integral: true,
    };
    let mask: Vec<bool> = volume.voxels.iter().map(|v| *v > 0.5).collect();
    let written = write_mask(&mask, volume.shape, &volume.frame, None, &Monitor::silent()).unwrap();
    let unpacked = |bytes: &[u8]| {
        let mut plain = Vec::new();
        std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(bytes), &mut plain).unwrap();
        plain
    };
    let whole = write(&volume, StoredType::Uint8, true).unwrap();
    assert_eq!(unpacked(&written), unpacked(&whole));
    volume.shape = [40_000, 1, 1];
    let long = write_mask(&mask, volume.shape, &volume.frame, None, &Monitor::silent());
    assert!(matches!(long, Err(MaskError::TooLong(_))));
}

fn unpacked(bytes: &[u8]) -> Vec<u8> {
    let mut plain = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(bytes), &mut plain).unwrap();
    plain
}

/// The mask of every voxel of `reading`, unpacked.
fn mask_of(reading: &Reading) -> Vec<u8> {
    let volume = &reading.volume;
    let mask: Vec<bool> = volume.voxels.iter().map(|v| *v > 0.5).collect();
    let grid = reading.stated_grid.as_ref();
    let bytes = write_mask(&mask, volume.shape, &volume.frame, grid, &Monitor::silent());
    unpacked(&bytes.unwrap())
}

/// The fields of a header that state the place: pixdim, xyzt_units, both codes, quaternion, offset, srow.
const PLACE_FIELDS: [std::ops::Range<usize>; 4] = [76..108, 123..124, 252..280, 280..328];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Whatever the fields say of the place, and however they contradict each other: the mask says the same.
    #[test]
    fn a_mask_states_the_place_of_its_scan_field_by_field(
        codes in (0_i16..=5, 0_i16..=5),
        unit in 0_u8..=3,
        quatern in prop::array::uniform3(-0.57_f32..0.57),
        offset in prop::array::uniform3(-900.0_f32..900.0),
        turn in prop::array::uniform3(-3.0_f64..3.0),
        shift in prop::array::uniform3(-900.0_f32..900.0),
        spacing in prop::array::uniform3(0.5_f32..9.0),
        qfac in prop::sample::select(vec![-1.0_f32, 0.0, 1.0]),
        trailing in 0_usize..=4,
    ) {
        let mut file = File::new(false);
        let mut dim = vec![4_i16, 3, 2];
        dim.resize(3 + trailing, 1);
        file.dim(&dim);
        file.bytes[123] = unit + 8;
        file.reals(76, &[qfac, spacing[0], spacing[1], spacing[2], 2.5, 1.0, 0.0, 1.0]);
        file.put(252, codes.0.to_le_bytes());
        file.put(254, codes.1.to_le_bytes());
        file.reals(256, &quatern);
        file.reals(268, &offset);
        let rotation = nalgebra::Rotation3::from_euler_angles(turn[0], turn[1], turn[2]);
        for axis in 0..3 {
            let row: Vec<f32> = (0..3).map(|c| rotation[(axis, c)] as f32 * spacing[c]).collect();
            file.reals(280 + 16 * axis, &row);
            file.reals(280 + 16 * axis + 12, &[shift[axis]]);
        }
        let reading = file.read().unwrap();
        let mask = mask_of(&reading);
        for range in PLACE_FIELDS {
            prop_assert_eq!(&mask[range.clone()], &file.bytes[range.clone()], "bytes {:?}", range);
        }
        let dim = 40..40 + 2 * (1 + 3 + trailing);
        prop_assert_eq!(&mask[dim.clone()], &file.bytes[dim], "dim");
        let back = read_bytes(&mask).unwrap();
        prop_assert_eq!(back.volume.frame, reading.volume.frame);
        prop_assert_eq!(back.facts.file_shape, reading.facts.file_shape);
    }
}

#[test]
fn a_mask_of_one_of_several_volumes_has_their_grid_in_three_dimensions() {
    let mut file = File::new(true);
    file.dim(&[4, 3, 1, 2]);
    file.put(252, 3_i16.to_le_bytes());
    file.reals(268, &[1.0, 2.0, 3.0]);
    let reading = read_files(&[&file.bytes], Some(1)).unwrap();
    let mask = mask_of(&reading);
    let short = |at: usize| i16::from_le_bytes([mask[at], mask[at + 1]]);
    assert_eq!([40, 42, 44, 46, 48].map(short), [3, 4, 3, 1, 1]);
    assert_eq!([252, 254].map(short), [3, 1], "codes");
    let real = |at: usize| f32::from_le_bytes(mask[at..at + 4].try_into().unwrap());
    assert_eq!([268, 272, 276].map(real), [1.0, 2.0, 3.0]);
}

#[test]
fn labels_have_names_and_colours_that_readers_without_them_skip() {
    let volume = oblique();
    let labels: Vec<u8> = (0..60).map(|n| n % 3).collect();
    let entry = |value, name, colour| LabelEntry {
        value,
        name,
        colour,
    };
    let entries = [
        entry(1, "wall", [255, 0, 51]),
        entry(2, "cavity", [0, 255, 0]),
    ];
    let grid = (volume.shape, &volume.frame);
    let bytes = write_labels(&labels, &entries, grid, None, &Monitor::silent()).unwrap();
    let back = read_bytes(&bytes).unwrap();
    let read: Vec<u8> = back.volume.voxels.iter().map(|v| *v as u8).collect();
    assert_eq!(read, labels);
    assert_eq!(back.facts.warnings, Vec::<String>::new());
    let plain = unpacked(&bytes);
    let int = |at: usize| i32::from_le_bytes(plain[at..at + 4].try_into().unwrap());
    // The extension: flag, length (a multiple of 16), code 0, text, and the voxels after it.
    let length = int(352) as usize;
    assert_eq!((plain[348], length % 16, int(356)), (1, 0, 0));
    assert_eq!(plain.len(), 352 + length + 60);
    let text = String::from_utf8_lossy(&plain[360..352 + length]);
    for label in [
        r#"<Label Key="1" Red="1.0000" Green="0.0000" Blue="0.2000" Alpha="1"><![CDATA[wall]]></Label>"#,
        r#"<Label Key="2" Red="0.0000" Green="1.0000" Blue="0.0000" Alpha="1"><![CDATA[cavity]]></Label>"#,
    ] {
        assert!(text.contains(label), "{text}");
    }
}
