//! `ventriform serial`.

use dicom_object::{Tag, from_reader};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output};
use ventriform::base::progress::Monitor;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PhantomParameters, phantom};
use ventriform::image::volume::{Provenance, Volume};
use ventriform::results::export::dicom::{Moment, SourceScan, nuclear_image};
use ventriform::runs::serial::FILE_NAMES;

/// Current Requested Procedure Evidence Sequence, and Pertinent Other Evidence Sequence: an item for each study.
const EVIDENCE: Tag = Tag(0x0040, 0xA375);
const OTHER_EVIDENCE: Tag = Tag(0x0040, 0xA385);

fn serial(here: &Path, arguments: &str, threads: usize) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ventriform"))
        .current_dir(here)
        .env("RAYON_NUM_THREADS", threads.to_string())
        .arg("serial")
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

/// The volume as a Nuclear Medicine Image of a study that all scans share.
fn of_one_study(volume: &Volume) -> Vec<u8> {
    let whose = Provenance {
        patient_id: Some("4711".into()),
        study_uid: Some("1.2.3".into()),
        ..Provenance::default()
    };
    let made = Moment {
        date: "20261123".into(),
        time: "134500".into(),
    };
    let scan = SourceScan::new(whose, volume.frame.clone(), volume.shape, true, made);
    nuclear_image(
        &scan,
        std::slice::from_ref(volume),
        None,
        "slices",
        "simulated",
    )
    .unwrap()
}

#[test]
fn three_scans_become_the_same_documented_files_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    for seed in 1..=3 {
        let parameters = PhantomParameters {
            shape: [52; 3],
            spacing_mm: [5.0; 3],
            pose_spread_deg: 0.0,
            pose_spread_mm: 0.0,
            seed,
            ..PhantomParameters::default()
        };
        let made = phantom(&parameters, &Monitor::silent()).unwrap();
        let bytes = nifti::write(&made.volume, StoredType::Int16, false).unwrap();
        std::fs::write(here.join(format!("scan{seed}.nii")), bytes).unwrap();
        let bytes = of_one_study(&made.volume);
        std::fs::write(here.join(format!("scan{seed}.dcm")), bytes).unwrap();
    }
    let scans = "scan1.nii scan2.nii scan3.nii --format glb";
    let made = [1, 4].map(|threads| {
        let run = serial(here, &format!("{scans} -o out{threads}"), threads);
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(run.status.success(), "{said}");
        assert!(said.contains("scan 1 to 2: cavity "), "{said}");
        files(&here.join(format!("out{threads}")))
    });
    assert!(made[0] == made[1], "threads changed the results");
    let mut wanted: Vec<String> = FILE_NAMES.iter().map(|name| (*name).to_owned()).collect();
    for scan in ["01", "02", "03"] {
        wanted.extend([
            format!("mesh_scan{scan}.glb"),
            format!("region_scan{scan}.nii.gz"),
        ]);
        wanted.extend(["svg", "png", "json"].map(|kind| format!("polar_scan{scan}.{kind}")));
    }
    for pair in ["01_02", "01_03", "02_03"] {
        wanted.extend(["svg", "png", "json"].map(|kind| format!("polar_change_{pair}.{kind}")));
    }
    wanted.sort_unstable();
    assert_eq!(made[0].keys().cloned().collect::<Vec<_>>(), wanted);

    let more = "--dicom --patient-id 4711 --study-uid 1.2.3 --made-at 2026-11-23T13:45:00Z";
    let run = serial(here, &format!("{scans} -o dicom {more}"), 2);
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(run.status.success(), "{said}");
    let objects = files(&here.join("dicom"));
    assert_eq!(&objects["measurements.dcm"][128..132], b"DICM");

    // Scans of one study stay together without their identity, whatever the secret.
    let named = "scan1.dcm scan2.dcm scan3.dcm -o nobody --dicom --deidentify";
    let run = serial(here, named, 2);
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(run.status.success(), "{said}");
    let report = &files(&here.join("nobody"))["measurements.dcm"];
    let report = from_reader(report.as_slice()).unwrap();
    let studies = [EVIDENCE, OTHER_EVIDENCE].map(|tag| {
        let sequence = report.element_opt(tag).unwrap();
        sequence.map_or(0, |sequence| sequence.items().unwrap().len())
    });
    assert_eq!(studies, [1, 0]);

    for (arguments, said) in [
        ("scan1.nii -o bad", "2"),
        ("scan1.nii scan1.nii -o bad", "are one"),
        ("scan1.nii scan2.nii -o bad --center 1,2,3", "no use for it"),
        ("scan1.nii scan2.nii -o bad --mass-g 5", "20 to 600"),
    ] {
        let run = serial(here, arguments, 1);
        let told = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(
            !run.status.success() && told.contains(said),
            "{arguments}: {told}"
        );
        assert!(!here.join("bad").exists(), "{arguments}");
    }
}
