//! Volumes that nothing calls gates are summed only where they show a beat, however they are given.

#![allow(clippy::unwrap_used)] // A test states its expectations by panicking.

use std::f64::consts::TAU;
use ventriform::base::geometry::Vec3;
use ventriform::base::progress::Monitor;
use ventriform::image::grid::Affine;
use ventriform::image::volume::gates::GATE_COUNTS;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::{
    ReadLimits, ReadOptions, Volume, VolumeError, VolumeFile, inspect, read, read_gates,
};

const EDGE: usize = 28;
const VOXEL_MM: f64 = 6.0;

/// A heart as the image shows it, in a body.
#[derive(Clone, Copy)]
struct Heart {
    /// Radius of the middle of the wall, mm.
    radius_mm: f64,
    /// Standard deviation of the wall across it, mm.
    blur_mm: f64,
    /// Uptake of the inferior part.
    inferior: f64,
}

const USUAL: Heart = Heart {
    radius_mm: 30.0,
    blur_mm: 7.0,
    inferior: 1.0,
};

impl Heart {
    fn image(self) -> Volume {
        let value = |at: usize| {
            let index = [at % EDGE, at / EDGE % EDGE, at / EDGE / EDGE];
            let p = Vec3::from(index.map(|n| VOXEL_MM * n as f64));
            let centre = Vec3::new(100.0, 80.0, 85.0);
            let apart = (p - centre).norm() - self.radius_mm;
            let uptake = if p.z < centre.z - 8.0 {
                self.inferior
            } else {
                1.0
            };
            let wall = 900.0 * uptake * (-(apart / self.blur_mm).powi(2)).exp();
            let body = 60.0 * f64::from(u8::from((p - Vec3::repeat(84.0)).norm() < 75.0));
            (wall + body).round() as f32
        };
        let affine = Affine::Lps([
            [VOXEL_MM, 0.0, 0.0, 0.0],
            [0.0, VOXEL_MM, 0.0, 0.0],
            [0.0, 0.0, VOXEL_MM, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ]);
        Volume::from_array((0..EDGE.pow(3)).map(value).collect(), [EDGE; 3], affine).unwrap()
    }
}

fn hearts(count: usize, heart: impl Fn(usize) -> Heart) -> Vec<Volume> {
    (0..count).map(|n| heart(n).image()).collect()
}

fn beat(gates: usize) -> Vec<Volume> {
    hearts(gates, |n| {
        let turn = (n as f64 + 0.5) / gates as f64;
        let contraction = 0.5 - 0.5 * (TAU * turn.powf(0.8)).cos();
        Heart {
            radius_mm: 30.0 - 6.0 * contraction,
            ..USUAL
        }
    })
}

/// The volumes as files of these names.
fn files(volumes: &[Volume], name: impl Fn(usize) -> String) -> Vec<VolumeFile> {
    let file = |(n, volume)| {
        let bytes = nifti::write(volume, StoredType::Float32, false).unwrap();
        VolumeFile::in_memory(name(n), bytes)
    };
    volumes.iter().enumerate().map(file).collect()
}

/// The volumes as one file of four dimensions.
fn four_dimensions(volumes: &[Volume]) -> VolumeFile {
    VolumeFile::in_memory("volumes.nii", nifti_of(volumes))
}

fn nifti_of(volumes: &[Volume]) -> Vec<u8> {
    let mut bytes = nifti::write(&volumes[0], StoredType::Float32, false).unwrap();
    let shape = [4, EDGE, EDGE, EDGE, volumes.len()];
    for (at, extent) in shape.into_iter().enumerate() {
        bytes[40 + 2 * at..][..2].copy_from_slice(&(extent as i16).to_le_bytes());
    }
    for volume in &volumes[1..] {
        bytes.extend(volume.voxels.iter().flat_map(|value| value.to_le_bytes()));
    }
    bytes
}

/// The volumes in all the ways in which nothing calls them gates.
fn wordless(volumes: &[Volume]) -> [Vec<VolumeFile>; 3] {
    let letters = |n: usize| format!("{}.nii", char::from(b'a' + n as u8));
    [
        vec![VolumeFile::of_arrays("the array", volumes.to_vec())],
        vec![four_dimensions(volumes)],
        files(volumes, letters),
    ]
}

fn gates_summed(files: &[VolumeFile]) -> Result<usize, VolumeError> {
    let (limits, quiet) = (ReadLimits::default(), Monitor::silent());
    let reading = read(files, &ReadOptions::default(), &limits, &quiet)?;
    assert_eq!(inspect(files, &limits, &quiet)?.gates, reading.facts.gates);
    Ok(reading.facts.gates.unwrap().number)
}

#[track_caller]
fn needs_a_frame(files: &[VolumeFile], word: &str) {
    let (limits, quiet) = (ReadLimits::default(), Monitor::silent());
    let error = gates_summed(files).unwrap_err();
    assert!(matches!(error, VolumeError::FrameNeeded { .. }), "{error}");
    assert!(error.to_string().contains(word), "{error}: {word}");
    let facts = inspect(files, &limits, &quiet).unwrap();
    assert_eq!(facts.gates, None);
    assert!(
        !facts.warnings.join(" ").contains("taken for"),
        "{:?}",
        facts.warnings
    );
    // Whoever asks for a beat says that they are gates.
    let asked = read_gates(files, true, &limits, &quiet).unwrap();
    assert!(asked.gates.len() >= *GATE_COUNTS.start());
}

#[test]
fn a_beat_is_summed_without_a_word() {
    for count in [6, 7, 8, 12, 16, 24] {
        for given in wordless(&beat(count)) {
            assert_eq!(gates_summed(&given).unwrap(), count, "{}", given[0].name());
        }
    }
}

#[test]
fn what_shows_no_beat_needs_a_frame_or_a_word() {
    // A step of 3 or 5 visits every number of volumes that has no such factor.
    let stride = |count: usize| if count.is_multiple_of(5) { 3 } else { 5 };
    for count in [6, 7, 8, 12, 16] {
        let people = hearts(count, |n| Heart {
            radius_mm: 26.0 + 8.0 * ((stride(count) * n) % count) as f64 / count as f64,
            inferior: 1.0 - 0.2 * (n % 3) as f64,
            ..USUAL
        });
        let filters = hearts(count, |n| Heart {
            blur_mm: 7.0 + 6.0 * n as f64 / count as f64,
            ..USUAL
        });
        let iterations = hearts(count, |n| Heart {
            blur_mm: 7.0 + 8.0 * 0.6_f64.powi(n as i32),
            ..USUAL
        });
        // Six in steps of five are the same cycle backwards.
        let moments = beat(count);
        let order = |n: usize| match count {
            6 => [0, 3, 1, 4, 2, 5][n],
            _ => (stride(count) * n) % count,
        };
        let mixed: Vec<Volume> = (0..count).map(|n| moments[order(n)].clone()).collect();
        for volumes in [people, filters, iterations, mixed] {
            for given in wordless(&volumes) {
                needs_a_frame(&given, "nothing in the file calls them gates");
            }
        }
    }
}

#[test]
fn names_of_files_are_a_word() {
    let gates = beat(8);
    let mut few = gates.clone();
    few.swap(1, 4);
    few.swap(2, 6);
    for word in ["gate", "bin", "phase", "frame", "slot", "time"] {
        let named = files(&few, |n| format!("stress_{word}{}.nii.gz", n + 1));
        assert_eq!(gates_summed(&named).unwrap(), 8);
    }
    for word in [
        "sub-", "case_", "patient", "subject ", "id", "iter", "recon",
    ] {
        let named = files(&gates, |n| format!("{word}{:03}_0000.nii.gz", n + 1));
        let told = format!(
            "something else (\"{}\")",
            word.trim_end_matches(['-', '_', ' '])
        );
        needs_a_frame(&named, &told);
    }
}

#[test]
fn a_time_of_a_beat_is_a_word() {
    let mut gates = beat(8);
    gates.swap(1, 4);
    gates.swap(2, 6);
    let timed = four_dimensions(&gates);
    needs_a_frame(std::slice::from_ref(&timed), "no heart that beats");
    let mut bytes = nifti_of(&gates);
    bytes[92..96].copy_from_slice(&0.11_f32.to_le_bytes());
    bytes[123] = 2 | 8;
    assert_eq!(
        gates_summed(&[VolumeFile::in_memory("timed.nii", bytes)]).unwrap(),
        8
    );
}
