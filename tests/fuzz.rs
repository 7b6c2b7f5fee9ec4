//! A short run of the fuzz targets (`fuzz/`) without libFuzzer: the same functions over the same
//! corpus, damaged at random with a fixed seed. `scripts/fuzz.sh` runs the real fuzzers.

#![allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]

#[path = "../fuzz/src/targets.rs"]
mod targets;

#[path = "../fuzz/src/service.rs"]
mod service;

use base64::Engine as _;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Bytes at which readers go wrong: signs, extremes, and the letters of formats.
const TELLING: [u8; 12] = [
    0, 1, 2, 0x7f, 0x80, 0xff, b'\\', b'-', b'"', b'\r', b'\n', b'=',
];

/// One to four damages to a file of the corpus.
fn damaged(corpus: &[Vec<u8>], random: &mut Pcg64Mcg) -> Vec<u8> {
    let pick = |random: &mut Pcg64Mcg| corpus[random.random_range(0..corpus.len())].clone();
    let mut file = pick(random);
    for _ in 0..random.random_range(1..=4) {
        let at = random.random_range(0..=file.len());
        let end = file.len().min(at + random.random_range(0..=16));
        match random.random_range(0..7) {
            0 => file.truncate(at),
            1 => drop(file.drain(at..end)),
            2 => drop(file.splice(at..at, file[at..end].to_vec())),
            3 => {
                let other = pick(random);
                let from = random.random_range(0..=other.len());
                file.splice(
                    at..end,
                    other[from..other.len().min(from + 64)].iter().copied(),
                );
            }
            4 => file[at..end].iter_mut().for_each(|byte| *byte = 0xff),
            5 => {
                if let Some(byte) = file.get_mut(at) {
                    *byte ^= 1 << random.random_range(0..8);
                }
            }
            _ => {
                if let Some(byte) = file.get_mut(at) {
                    *byte = TELLING[random.random_range(0..TELLING.len())];
                }
            }
        }
    }
    file
}

/// Runs `target` over the corpus and over `rounds` damaged files.
fn drive(name: &str, rounds: usize, target: impl Fn(&[u8])) {
    let corpus = targets::corpus(name);
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let damaged = (0..rounds).map(|_| damaged(&corpus, &mut random));
    for file in corpus.iter().cloned().chain(damaged) {
        let tried = catch_unwind(AssertUnwindSafe(|| target(&file)));
        let shown = || base64::prelude::BASE64_STANDARD.encode(&file);
        assert!(
            tried.is_ok(),
            "{name} fails on these bytes (base64): {}",
            shown()
        );
    }
}

#[test]
fn the_corpus_itself_is_read() {
    for (target, name) in [("nifti", "volume.nii"), ("dicom", "volume.dcm")] {
        let monitor = ventriform::progress::Monitor::silent();
        let read = targets::corpus(target).into_iter().filter(|file| {
            let files = [ventriform::volume::VolumeFile::in_memory(
                name,
                file.clone(),
            )];
            let limits = ventriform::volume::ReadLimits::default();
            ventriform::volume::inspect(&files, &limits, &monitor).is_ok()
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
    drive("nifti", 20_000, targets::nifti);
}

#[test]
fn damaged_dicom_files_never_panic() {
    drive("dicom", 20_000, targets::dicom);
}

#[test]
fn damaged_meshes_never_panic() {
    drive("mesh", 20_000, targets::mesh);
}

#[test]
fn damaged_parameters_never_panic() {
    drive("parameters", 20_000, targets::parameters);
}

#[test]
fn damaged_forms_are_answered() {
    let service = service::Target::start();
    drive("multipart", 400, |file| service.multipart(file));
}

#[test]
fn damaged_associations_end_and_harm_nobody() {
    let service = service::Target::start();
    drive("association", 400, |file| service.association(file));
}
