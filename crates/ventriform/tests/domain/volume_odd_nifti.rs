//! Odd and broken NIfTI files of other projects, against what nibabel 5 reads of them.

#![allow(clippy::unwrap_used)] // A test states its expectations by panicking.

use crate::shared_data::shared_data;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::{self, ReadLimits, ReadOptions, Reading, VolumeError, VolumeFile};

fn read(names: &[&str], frame: Option<usize>) -> Option<Result<Reading, VolumeError>> {
    let folder = shared_data("nifti-odd")?;
    let files: Vec<_> = names
        .iter()
        .map(|n| VolumeFile::at(folder.join(n)))
        .collect();
    let options = ReadOptions { frame };
    let limits = ReadLimits::default();
    Some(volume::read(&files, &options, &limits, &Monitor::silent()))
}

/// File(s), frame, shape, sum, NaN count, and the RAS position of voxel (1, 2, 3): computed
/// with nibabel 5 in double precision.
type Expected = (
    &'static [&'static str],
    Option<usize>,
    [usize; 3],
    f64,
    u64,
    [f64; 3],
);

#[rustfmt::skip]
const READABLE_FILES: &[Expected] = &[
    (&["nibabel/anatomical.nii"], None, [33, 41, 25], 284166082.0, 0, [30.0, -36.0, -10.0]),
    (&["nibabel/reoriented_anat_moved.nii"], None, [21, 26, 22], 32739769.449157715, 0, [-31.297897, -39.977585, -15.599409]),
    (&["nibabel/resampled_anat_moved.nii"], None, [17, 21, 3], 7749957.09866333, 153, [28.0, -32.0, 24.0]),
    (&["nibabel/standard.nii.gz"], None, [4, 5, 7], 7650.0, 0, [1.0, 6.0, 6.0]),
    (&["nifti-reader-js/avg152T1_LR_nifti.nii"], None, [91, 109, 91], 74825382.0, 0, [88.0, -122.0, -66.0]),
    (&["nifti-reader-js/avg152T1_LR_nifti.nii.gz"], None, [91, 109, 91], 74825382.0, 0, [88.0, -122.0, -66.0]),
    (&["nifti-reader-js/avg152T1_LR_nifti2.nii.gz"], None, [91, 109, 91], 74825382.0, 0, [88.0, -122.0, -66.0]),
    (&["nifti-reader-js/big.nii.gz"], None, [64, 64, 21], 11648.372022011292, 0, [-4.0, 8.0, 18.0]),
    (&["nifti-reader-js/little.nii.gz"], None, [64, 64, 21], 11648.372022011292, 0, [-4.0, 8.0, 18.0]),
    (&["nifti-reader-js/with_extension.nii.gz"], None, [161, 191, 151], 1472871.0, 0, [79.0, 78.0, 82.0]),
    (&["nifti-rs/27/float32.nii"], None, [3, 3, 3], 351.0, 0, [1.0, 2.0, 3.0]),
    (&["nifti-rs/27/float64.nii"], None, [3, 3, 3], 351.0, 0, [1.0, 2.0, 3.0]),
    (&["nifti-rs/27/int16.nii"], None, [3, 3, 3], 351.0, 0, [1.0, 2.0, 3.0]),
    (&["nifti-rs/27/int32.nii"], None, [3, 3, 3], 351.0, 0, [1.0, 2.0, 3.0]),
    (&["nifti-rs/27/int64.nii"], None, [3, 3, 3], 351.0, 0, [1.0, 2.0, 3.0]),
    (&["nifti-rs/27/int8.nii"], None, [3, 3, 3], 351.0, 0, [1.0, 2.0, 3.0]),
    (&["nifti-rs/27/uint16.nii"], None, [3, 3, 3], 351.0, 0, [1.0, 2.0, 3.0]),
    (&["nifti-rs/27/uint32.nii"], None, [3, 3, 3], 351.0, 0, [1.0, 2.0, 3.0]),
    (&["nifti-rs/27/uint64.nii"], None, [3, 3, 3], 351.0, 0, [1.0, 2.0, 3.0]),
    (&["nifti-rs/27/uint8.nii"], None, [3, 3, 3], 351.0, 0, [1.0, 2.0, 3.0]),
    (&["nifti-rs/avg152T1_LR_nifti.nii.gz"], None, [91, 109, 91], 74825382.0, 0, [88.0, -122.0, -66.0]),
    (&["nifti-rs/f32.nii.gz"], None, [11, 11, 11], 166.00000071525574, 0, [1.0, 2.0, 3.0]),
    (&["nifti-rs/minimal.nii"], None, [64, 64, 10], 1290240.0, 0, [91.5, -88.5, -4.5]),
    (&["nifti-rs/minimal.nii.gz"], None, [64, 64, 10], 1290240.0, 0, [91.5, -88.5, -4.5]),
    (&["nifti-rs/minimal_extended_hdr.nii"], None, [8, 8, 1], 0.0, 0, [1.0, 2.0, 3.0]),
    (&["nifti-rs/zstat1.nii.gz"], None, [64, 64, 21], 11648.372022011292, 0, [-4.0, 8.0, 18.0]),
    (&["nibabel/example4d.nii.gz"], Some(0), [128, 96, 24], 50994397.0, 0, [115.855103, -32.842104, -0.089138]),
    (&["nibabel/example4d.nii.gz"], Some(1), [128, 96, 24], 50990959.0, 0, [115.855103, -32.842104, -0.089138]),
    (&["nibabel/example_nifti2.nii.gz"], Some(1), [32, 20, 12], 3465054.0, 0, [115.855103, -32.842104, -0.089138]),
    (&["nibabel/functional.nii"], Some(0), [17, 21, 3], 3883746.552329719, 0, [28.0, -32.0, 24.0]),
    (&["nibabel/functional.nii"], Some(19), [17, 21, 3], 3888072.273083091, 0, [28.0, -32.0, 24.0]),
    (&["nifti-reader-js/5D_small.nii"], Some(2), [1, 2, 3], 1.9867660377640277, 0, [-84.896763, 146.663767, -118.500677]),
    (&["nifti-reader-js/air.img.gz", "nifti-reader-js/air.hdr.gz"], None, [79, 67, 64], 11398461.247137904, 0, [-68.606838, -108.372781, 79.692587]),
    (&["nifti-reader-js/air2.hdr.gz", "nifti-reader-js/air2.img.gz"], None, [79, 67, 64], 11398461.247137904, 0, [-68.606838, -108.372781, 79.692587]),
    (&["nifti-rs/minimal.hdr", "nifti-rs/minimal.img"], None, [64, 64, 10], 1290240.0, 0, [91.5, -88.5, -4.5]),
    (&["nifti-rs/minimal.hdr.gz", "nifti-rs/minimal.img.gz"], None, [64, 64, 10], 1290240.0, 0, [91.5, -88.5, -4.5]),
    (&["nifti-rs/minimal.img.gz", "nifti-rs/minimal.hdr"], None, [64, 64, 10], 1290240.0, 0, [91.5, -88.5, -4.5]),
];

#[test]
fn readable_files_give_the_voxels_that_nibabel_reads() {
    for (names, frame, shape, sum, missing, position) in READABLE_FILES {
        let Some(reading) = read(names, *frame) else {
            return;
        };
        let reading = reading.unwrap_or_else(|e| panic!("{names:?}: {e}"));
        let facts = reading.facts;
        assert_eq!(reading.volume.shape, *shape, "{names:?}");
        assert_eq!(facts.intensity.missing, *missing, "{names:?}");
        let off = (facts.intensity.sum - sum).abs();
        assert!(
            off <= 1e-6 * sum.abs().max(1.0),
            "{names:?}: {} {sum}",
            facts.intensity.sum
        );
        let at = facts.affine_ras * nalgebra::Vector4::new(1.0, 2.0, 3.0, 1.0);
        for axis in 0..3 {
            assert!(
                (at[axis] - position[axis]).abs() < 1e-4,
                "{names:?}: {at} {position:?}"
            );
        }
    }
}

/// Files and a part of the message that must be there.
const REFUSED_FILES: &[(&[&str], &str)] = &[
    (&["nibabel/analyze.hdr"], "Analyze 7.5"),
    (&["nibabel/nifti1.hdr"], "second file, which is missing"),
    (&["nibabel/nifti2.hdr"], "second file, which is missing"),
    (&["nibabel/small.mnc"], "MINC"),
    (&["nibabel/row_major.dconn.nii"], "intent_code is 3001"),
    (&["nibabel/example4d.nii.gz"], "holds 2 frames"),
    (&["nibabel/functional.nii"], "holds 20 frames"),
    (&["nifti-reader-js/5D_small.nii"], "holds 3 frames"),
    (
        &["nifti-reader-js/not-nifti.nii"],
        "not in a known volume format",
    ),
    (&["nifti-reader-js/LICENSE"], "not in a known volume format"),
    (&["nifti-rs/README.md"], "not in a known volume format"),
    (&["nifti-rs/complex/complex32.nii"], "datatype is 32"),
    (&["nifti-rs/complex/complex64.nii"], "datatype is 1792"),
    (&["nifti-rs/rgb/3D.nii"], "datatype is 128"),
    (&["nifti-rs/rgb/4D.nii"], "datatype is 128"),
    (&["nifti-rs/rgba/4D.nii"], "datatype is 2304"),
    (&["nifti-rs/fuzz_artifacts/crash-1.nii"], "sizeof_hdr is 0"),
    (
        &["nifti-rs/fuzz_artifacts/crash-08123ef33416bd6f0c5fa63d44b681b8581d62a0"],
        "sizeof_hdr is 1090519807",
    ),
    (
        &["nifti-rs/fuzz_artifacts/crash-98aa054390f8d3f932f190dc22ef62c6ff2d6619"],
        "sizeof_hdr is 255",
    ),
    (
        &["nifti-rs/fuzz_artifacts/crash-d03c6346fe83a026738f6b8cd2a9335a3f8cb158"],
        "sizeof_hdr is 255",
    ),
    (
        &["nifti-rs/fuzz_artifacts/crash-ed7d46344d7efb3b9f0c374d66d2e02f66cc447d.nii"],
        "sizeof_hdr is 11842740",
    ),
    (&["nifti-rs/minimal2.hdr"], "second file, which is missing"),
    (
        &["nifti-rs/minimal2.img.gz"],
        "not in a known volume format",
    ),
    (
        &["nifti-rs/minimal.hdr", "nifti-rs/27/int8.nii"],
        "1 NIfTI file (int8.nii), 1 NIfTI header, which are not one volume",
    ),
];

#[test]
fn other_files_are_refused_by_field_and_value() {
    for (names, part) in REFUSED_FILES {
        let Some(result) = read(names, None) else {
            return;
        };
        let error = result.err().unwrap_or_else(|| panic!("{names:?} was read"));
        let message = error.to_string();
        assert!(message.contains(part), "{names:?}: {message}");
    }
}

/// A whole volume does not need the file of voxels beside it, and the reader says that it left it out.
#[test]
fn a_file_beside_a_whole_volume_is_left_out_with_a_note() {
    let Some(alone) = read(&["nifti-rs/minimal.nii"], None) else {
        return;
    };
    let beside = read(&["nifti-rs/minimal.nii", "nifti-rs/minimal.img"], None);
    let (alone, beside) = (alone.unwrap(), beside.unwrap().unwrap());
    assert_eq!(alone.volume.voxels, beside.volume.voxels);
    let warnings = beside.facts.warnings;
    assert!(
        warnings.iter().any(|w| w.contains("minimal.img")),
        "{warnings:?}"
    );
}
