//! What the fuzzers do with their bytes. `tests/fuzz.rs` of the library and of the program drive the same functions
//! over the same corpus with random damage, for a few seconds and without libFuzzer.

#![allow(clippy::unwrap_used, reason = "a panic is what a fuzzer looks for")]

#[path = "targets.rs"]
mod targets;

pub use targets::{corpus, dicom, mesh, nifti, parameters};

#[cfg(feature = "service")]
#[path = "service.rs"]
pub mod service;

/// Writes the made files of a target where libFuzzer looks for its corpus.
pub fn write_corpus(target: &str) {
    let folder = std::path::Path::new("corpus").join(target);
    std::fs::create_dir_all(&folder).unwrap();
    for (number, file) in corpus(target).iter().enumerate() {
        std::fs::write(folder.join(format!("made-{number}")), file).unwrap();
    }
}
