//! `ventriform beat`: the files, keys, errors and exit statuses that other programs rely on.

use crate::dicom::{JANE, nm, nm_of};
use crate::gated::{beating, nifti_of};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output};
use ventriform::image::volume::Volume;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::runs::gated::FILE_NAMES;

fn beat(folder: &Path, line: &str, threads: usize) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ventriform"))
        .arg("beat")
        .args(line.split_whitespace())
        .env("RAYON_NUM_THREADS", threads.to_string())
        .current_dir(folder)
        .output()
        .unwrap()
}

/// The files that the command writes to `out`.
fn made(folder: &Path, line: &str, out: &str, threads: usize) -> BTreeMap<String, Vec<u8>> {
    let output = beat(folder, &format!("{line} -o {out}"), threads);
    let words = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{line}: {words}");
    assert!(words.contains("EDV ") && words.contains("EF "), "{words}");
    let files = std::fs::read_dir(folder.join(out)).unwrap().map(|file| {
        let path = file.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        (name, std::fs::read(path).unwrap())
    });
    files.collect()
}

fn figures(files: &BTreeMap<String, Vec<u8>>) -> Value {
    serde_json::from_slice(&files["beat.json"]).unwrap()
}

/// A folder with the gates as `gated.nii`, `gated.dcm` and, one by one, `gate5.nii.gz` to `gate12.nii.gz`.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    write("gated.nii", &nifti_of(beating(), None));
    let all: Vec<&Volume> = beating().iter().collect();
    write("gated.dcm", &nm_of(&JANE, &all));
    for (index, gate) in beating().iter().enumerate() {
        let bytes = nifti::write(gate, StoredType::Float32, true).unwrap();
        write(&format!("gate{}.nii.gz", index + 5), &bytes);
    }
    folder
}

#[test]
fn a_gated_study_becomes_the_same_files_on_any_number_of_threads() {
    let folder = folder();
    let here = folder.path();
    let one = made(here, "gated.nii --format stl --format json", "one", 1);
    let four = made(here, "gated.nii --format stl --format json", "four", 4);
    assert!(one == four, "threads changed the results");
    // Maps of z and scores are of beats with normal limits.
    let of_normals = |name: &&&str| name.starts_with("polar_z") || name.starts_with("polar_score");
    let names = FILE_NAMES.iter().filter(|name| !of_normals(name));
    let mut wanted: Vec<String> = names.map(|name| (*name).to_owned()).collect();
    let gates = (1..=8).map(|gate| format!("gate{gate:02}"));
    let moments: Vec<String> = gates.clone().chain(["ed".into(), "es".into()]).collect();
    for extension in ["stl", "json"] {
        wanted.extend(
            moments
                .iter()
                .map(|moment| format!("mesh_{moment}.{extension}")),
        );
    }
    wanted.extend(gates.map(|gate| format!("labels_{gate}.nii.gz")));
    wanted.sort();
    assert_eq!(one.keys().cloned().collect::<Vec<_>>(), wanted);
    let page = String::from_utf8_lossy(&one["report.html"]);
    assert!(page.starts_with("<!DOCTYPE html>") && !page.contains("Patient"));

    // One file for each gate, as a shell lists them: gate10 before gate5.
    let mut names: Vec<String> = (5..=12)
        .map(|number| format!("gate{number}.nii.gz"))
        .collect();
    names.sort();
    let apart = made(here, &names.join(" "), "apart", 2);
    for name in [
        "gates.csv",
        "segments.csv",
        "curve.svg",
        "polar_phase.json",
        "labels_gate03.nii.gz",
    ] {
        assert!(apart[name] == one[name], "{name}");
    }

    // DICOM has the same figures, up to the rounding of its place, and objects of its patient.
    let dicom = made(
        here,
        "gated.dcm --dicom --made-at 2026-01-01T12:00:00Z",
        "dicom",
        2,
    );
    let [of_nifti, of_dicom] = [&one, &dicom].map(figures);
    for name in ["edv_ml", "esv_ml", "ef_percent"] {
        let [a, b] = [&of_nifti, &of_dicom].map(|report| report[name].as_f64().unwrap());
        assert!((a - b).abs() < 0.1, "{name}: {a} and {b}");
    }
    for name in ["mask_ed.dcm", "mask_es.dcm", "measurements.dcm"] {
        assert_eq!(&dicom[name][128..132], b"DICM", "{name}");
    }
    let page = String::from_utf8_lossy(&dicom["report.html"]);
    assert!(page.contains("Doe, Jane") && page.contains(JANE.accession));
}

#[test]
fn what_is_no_gated_study_is_refused_and_nothing_is_written() {
    let folder = folder();
    let here = folder.path();
    let write = |name: &str, bytes: &[u8]| std::fs::write(here.join(name), bytes).unwrap();
    write("dynamic.nii", &nifti_of(beating(), Some(60.0)));
    write("few.nii", &nifti_of(&beating()[..5], None));
    write("single.dcm", &nm(&JANE, 1));
    let short = Volume::sampled([40, 40, 39], beating()[0].frame.clone(), |_| 1.0);
    write(
        "gate99.nii.gz",
        &nifti::write(&short, StoredType::Float32, true).unwrap(),
    );
    for (line, status, said) in [
        ("gone.nii", 1, "gone.nii"),
        ("single.dcm", 1, "one volume"),
        ("dynamic.nii", 1, "480 s"),
        ("few.nii", 1, "5 gates"),
        ("gate5.nii.gz gate6.nii.gz", 1, "2 gates"),
        (
            "gate5.nii.gz gate6.nii.gz gate7.nii.gz gate8.nii.gz gate9.nii.gz gate99.nii.gz",
            1,
            "gate 6 has 40 x 40 x 39 voxels where gate 1 has 40 x 40 x 40",
        ),
        ("gated.nii --mass-g 5", 2, "20 to 600"),
        ("gated.nii --frame 1", 2, "all gates are fitted together"),
        ("gated.nii --format doc", 2, "give one of"),
        ("gated.nii --dicom", 1, "patient"),
    ] {
        let output = beat(here, &format!("{line} -o out"), 2);
        let words = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(status), "{line}: {words}");
        assert!(
            words.to_lowercase().contains(&said.to_lowercase()),
            "{line}: {words}"
        );
        assert!(!here.join("out").exists(), "{line}");
    }
    // What the file denies, the caller may state.
    let stated = made(here, "dynamic.nii --gated=true", "stated", 2);
    assert_eq!(figures(&stated)["gates"].as_array().unwrap().len(), 8);
}
