//! Every refusal of the library comes with what to do about it.

#![allow(clippy::unwrap_used)] // A test states its expectations by panicking.

use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::{self, ReadLimits, ReadOptions, Volume, VolumeFile};
use ventriform::parameters::ModelParameters;
use ventriform::runs::advice::advice;
use ventriform::runs::pipeline::{PipelineError, generate_from};
use ventriform::surface::retile::RetileError;

/// A ball of ones among zeros, or of other values.
fn ball(inside: f32, outside: f32) -> Volume {
    let shape = [30; 3];
    let frame = VoxelToPatient::centred(shape, [2.0; 3], Vec3::zeros()).unwrap();
    let from_middle = |n: usize| (n as f64 - 14.5).powi(2);
    let voxels = (0..30 * 30 * 30).map(|n| {
        let [i, j, k] = [n % 30, n / 30 % 30, n / 900].map(from_middle);
        if i + j + k < 90.0 { inside } else { outside }
    });
    Volume {
        shape,
        voxels: voxels.collect(),
        frame,
        integral: false,
    }
}

fn refused(volume: &Volume, pairs: &[(&str, &str)]) -> PipelineError {
    let parameters = ModelParameters::from_pairs(pairs.iter().copied()).unwrap();
    let made = generate_from(volume, &parameters, &Monitor::silent());
    made.err().unwrap()
}

#[test]
fn an_iso_value_outside_of_the_image_is_told_the_range() {
    let error = refused(&ball(1.0, 0.0), &[("iso", "absolute:1e9")]);
    assert_eq!(error.field(), Some("iso"));
    assert!(advice(&error).contains("between"), "{}", advice(&error));
}

#[test]
fn a_blank_volume_has_advice() {
    let error = refused(&ball(3.0, 3.0), &[]);
    assert!(!advice(&error).is_empty(), "{error}");
}

#[test]
fn a_surface_that_no_model_carries_is_told_of_topology() {
    let error = RetileError::NotCarried {
        points: 12,
        tried: 700,
    };
    assert!(advice(&error).contains("topology"), "{}", advice(&error));
}

#[test]
fn files_that_are_no_volume_have_advice() {
    let header = [0x5c, 1, 0, 0].into_iter().chain([0; 344]).collect();
    for (name, bytes) in [
        ("text.nii", b"no volume".to_vec()),
        ("cut.nii.gz", vec![0x1f, 0x8b, 8, 0]),
        ("alone.hdr", header),
    ] {
        let file = VolumeFile::in_memory(name, bytes);
        let (options, limits) = (ReadOptions::default(), ReadLimits::default());
        let error = volume::read(&[file], &options, &limits, &Monitor::silent());
        let error = error.err().unwrap();
        assert!(!advice(&error).is_empty(), "{name}: {error}");
    }
}
