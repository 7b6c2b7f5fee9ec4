//! A short run of the fuzz targets of the library (`fuzz/`) without libFuzzer: the same functions over the same
//! corpus, damaged at random with a fixed seed. `scripts/check/fuzz.sh` runs the real fuzzers.

#![allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]

#[path = "../../../fuzz/src/damage.rs"]
mod damage;

#[path = "../../../fuzz/src/targets.rs"]
mod targets;

use damage::drive;

#[test]
fn the_corpus_itself_is_read() {
    for (target, name) in [("nifti", "volume.nii"), ("dicom", "volume.dcm")] {
        let monitor = ventriform::base::progress::Monitor::silent();
        let read = targets::corpus(target).into_iter().filter(|file| {
            let files = [ventriform::image::volume::VolumeFile::in_memory(
                name,
                file.clone(),
            )];
            let limits = ventriform::image::volume::ReadLimits::default();
            ventriform::image::volume::inspect(&files, &limits, &monitor).is_ok()
        });
        let least = match target {
            "dicom" => 8,
            _ => 2,
        };
        assert!(read.count() >= least, "{target}");
    }
}

#[test]
fn damaged_nifti_files_never_panic() {
    drive("nifti", &targets::corpus("nifti"), 20_000, targets::nifti);
}

#[test]
fn damaged_dicom_files_never_panic() {
    drive("dicom", &targets::corpus("dicom"), 20_000, targets::dicom);
}

#[test]
fn damaged_meshes_never_panic() {
    drive("mesh", &targets::corpus("mesh"), 20_000, targets::mesh);
}

#[test]
fn damaged_parameters_never_panic() {
    drive(
        "parameters",
        &targets::corpus("parameters"),
        20_000,
        targets::parameters,
    );
}
