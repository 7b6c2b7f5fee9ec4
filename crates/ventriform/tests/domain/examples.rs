//! The examples do what their pages say. `cargo test` compiles them before it runs this.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::Command;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PhantomParameters, phantom};
use ventriform::{Monitor, Volume};

/// The program of an example; `None`, after a line that says so, if it was not compiled.
fn example(name: &str) -> Option<PathBuf> {
    let this = std::env::current_exe().unwrap();
    let path = this.ancestors().nth(2)?.join("examples").join(name);
    if !path.is_file() {
        println!("skipped: the example {name} was not compiled");
        return None;
    }
    Some(path)
}

fn run(program: &Path, arguments: &[&Path]) -> String {
    let made = Command::new(program).args(arguments).output().unwrap();
    assert!(made.status.success(), "{made:?}");
    String::from_utf8(made.stdout).unwrap()
}

#[test]
fn a_file_becomes_a_model_a_mask_and_figures() {
    let (Some(generate), Some(segment), Some(measure)) =
        (example("generate"), example("segment"), example("measure"))
    else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let parameters = PhantomParameters {
        shape: [64; 3],
        spacing_mm: [6.4; 3],
        ..PhantomParameters::default()
    };
    let made = phantom(&parameters, &Monitor::silent()).unwrap();
    let write = |name: &str, volume: &Volume, stored| {
        std::fs::write(at(name), nifti::write(volume, stored, true).unwrap()).unwrap();
    };
    write("scan.nii.gz", &made.volume, StoredType::Int16);
    write("truth.nii.gz", &made.truth, StoredType::Uint8);

    let told = run(&generate, &[&at("scan.nii.gz"), &at("heart.glb")]);
    assert!(told.contains("150 points"), "{told}");
    assert!(std::fs::read(at("heart.glb")).unwrap().starts_with(b"glTF"));
    let told = run(&segment, &[&at("scan.nii.gz"), &at("out")]);
    assert!(told.contains("confidence"), "{told}");
    let told = run(&measure, &[&at("out/mask.nii.gz"), &at("truth.nii.gz")]);
    let jaccard = told.split([' ', ',']).nth(1).unwrap();
    assert!(jaccard.parse::<f64>().unwrap() > 0.6, "{told}");
}
