//! `ventriform compare`.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output};
use ventriform::base::progress::Monitor;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PhantomParameters, phantom};
use ventriform::results::export::dicom::ComparisonObject;
use ventriform::runs::rest_stress::FILE_NAMES;

fn compare(here: &Path, arguments: &str, threads: usize) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ventriform"))
        .current_dir(here)
        .env("RAYON_NUM_THREADS", threads.to_string())
        .arg("compare")
        .args(arguments.split(' '))
        .output()
        .unwrap()
}

fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap();
    let file = |entry: std::io::Result<std::fs::DirEntry>| {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        (name, std::fs::read(path).unwrap())
    };
    entries.map(file).collect()
}

#[test]
fn two_scans_become_the_same_documented_files_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    for (name, seed) in [("stress.nii", 1), ("rest.nii", 2)] {
        let parameters = PhantomParameters {
            shape: [52; 3],
            spacing_mm: [5.0; 3],
            seed,
            ..PhantomParameters::default()
        };
        let made = phantom(&parameters, &Monitor::silent()).unwrap();
        let bytes = nifti::write(&made.volume, StoredType::Int16, false).unwrap();
        std::fs::write(here.join(name), bytes).unwrap();
    }
    let scans = "--stress stress.nii --rest rest.nii --format glb";
    let made = ["1", "4"].map(|threads| {
        let arguments = format!("{scans} -o out{threads}");
        let run = compare(here, &arguments, threads.parse().unwrap());
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(run.status.success(), "{said}");
        assert!(
            said.contains("TID") && said.contains("reversible"),
            "{said}"
        );
        files(&here.join(format!("out{threads}")))
    });
    assert!(made[0] == made[1], "threads changed the results");
    let of_normals = |name: &&&str| name.starts_with("polar_z") || name.starts_with("polar_score");
    let names = FILE_NAMES.iter().filter(|name| !of_normals(name));
    let mut wanted: Vec<&str> = names.copied().collect();
    wanted.extend(["mesh_stress.glb", "mesh_rest.glb"]);
    wanted.sort_unstable();
    assert_eq!(made[0].keys().collect::<Vec<_>>(), wanted);

    let more = "--dicom --patient-id 4711 --study-uid 1.2.3 --made-at 2026-11-23T13:45:00Z";
    let run = compare(here, &format!("{scans} -o dicom {more}"), 2);
    assert!(
        run.status.success(),
        "{}",
        String::from_utf8_lossy(&run.stderr)
    );
    let objects = files(&here.join("dicom"));
    for object in ComparisonObject::ALL {
        assert!(
            &objects[object.file_name()][128..132] == b"DICM",
            "{object:?}"
        );
    }

    for (more, said) in [
        ("--sex F", "--normals"),
        ("--rest-protocol rest", "--normals"),
        ("--protocol rest", "stress_protocol"),
        ("--expert stress.nii", "--expert"),
    ] {
        let run = compare(here, &format!("{scans} -o bad {more}"), 1);
        let told = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(
            !run.status.success() && told.contains(said),
            "{more}: {told}"
        );
        assert!(!here.join("bad").exists(), "{more}");
    }
    let same = compare(here, "--stress rest.nii --rest rest.nii -o bad", 1);
    let told = String::from_utf8_lossy(&same.stderr).into_owned();
    assert!(
        !same.status.success() && told.contains("one scan"),
        "{told}"
    );
}
