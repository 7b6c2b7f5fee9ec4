//! `ventriform segment --dicom` and its flags, by the program itself.

use crate::dicom::{JANE, contains, nm};
use crate::helpers::scan;
use dicom_dictionary_std::tags;
use dicom_object::from_reader;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const DICOM_OBJECTS: [&str; 7] = [
    "mask.dcm",
    "contours.dcm",
    "mesh.dcm",
    "surface.dcm",
    "measurements.dcm",
    "polar.dcm",
    "page.dcm",
];

fn segment(folder: &Path, line: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ventriform"))
        .arg("segment")
        .args(line.split_whitespace())
        .current_dir(folder)
        .env_remove("VENTRIFORM_DEIDENTIFY_SECRET")
        .output()
        .unwrap()
}

fn made(folder: &Path, line: &str) {
    let output = segment(folder, line);
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{line}: {words}");
}

#[test]
fn deidentified_objects_name_nobody_and_stay_together() {
    let folder = tempfile::tempdir().unwrap();
    let scan = nm(&JANE, 1);
    fs::write(folder.path().join("scan.dcm"), &scan).unwrap();
    let of_jane = [
        JANE.name,
        JANE.id,
        JANE.accession,
        "19500102",
        "Referrer^Ann",
        "S1",
    ];
    // Every UID of hers begins with that of the study.
    let hers = |bytes: &[u8]| {
        of_jane[..5]
            .iter()
            .chain([&JANE.study, &"Doe, Jane", &"1950-01-02"])
            .any(|text| contains(bytes, text))
    };
    assert!(of_jane.iter().all(|text| contains(&scan, text)));
    let flags = "scan.dcm --model auto -o out --dicom --deidentify --deidentify-secret s";
    made(folder.path(), &format!("{flags} --patient-id ANON-1"));
    let mut studies = BTreeSet::new();
    for name in DICOM_OBJECTS {
        let bytes = fs::read(folder.path().join("out").join(name)).unwrap();
        assert!(!hers(&bytes), "{name}");
        let object = from_reader(&bytes[..]).unwrap();
        let text = |tag| {
            object
                .element(tag)
                .unwrap()
                .to_str()
                .unwrap()
                .trim()
                .to_owned()
        };
        assert_eq!(text(tags::PATIENT_ID), "ANON-1");
        assert_eq!(text(tags::PATIENT_NAME), "");
        assert_eq!(text(tags::PATIENT_IDENTITY_REMOVED), "YES");
        studies.insert(text(tags::STUDY_INSTANCE_UID));
    }
    assert_eq!(studies.len(), 1, "{studies:?}");
    // The other files are as always: they name nobody.
    for entry in fs::read_dir(folder.path().join("out")).unwrap() {
        let path = entry.unwrap().path();
        let named = contains(&fs::read(&path).unwrap(), JANE.id);
        assert!(!named, "{}", path.display());
    }
}

#[test]
fn a_scan_that_is_not_dicom_gives_objects_only_for_a_stated_patient_and_study() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scan.nii.gz"), scan()).unwrap();
    for (given, missing) in [
        ("", "patient_id"),
        ("--study-uid 1.2.3", "patient_id"),
        ("--patient-id P-1", "study_uid"),
    ] {
        let line = format!("scan.nii.gz --model auto -o out --dicom {given}");
        let refused = segment(folder.path(), &line);
        assert!(!refused.status.success(), "{line}");
        let words = String::from_utf8_lossy(&refused.stderr);
        assert!(words.contains(missing), "{line}: {words}");
        assert!(
            !folder.path().join("out").exists(),
            "it is refused before it is computed"
        );
    }
    let stated = "--patient-id P-1 --study-uid 1.2.3 --made-at 2026-11-23T13:45:00Z";
    made(
        folder.path(),
        &format!("scan.nii.gz --model auto -o out --dicom {stated}"),
    );
    for name in DICOM_OBJECTS {
        let object = from_reader(&fs::read(folder.path().join("out").join(name)).unwrap()[..]);
        let object = object.unwrap();
        let text = |tag| object.element(tag).unwrap().to_str().unwrap();
        assert_eq!(text(tags::PATIENT_ID).trim(), "P-1");
        assert_eq!(
            text(tags::STUDY_INSTANCE_UID).trim_end_matches('\0'),
            "1.2.3"
        );
    }

    // A DICOM file says whose scan it is; another patient is refused.
    fs::write(folder.path().join("scan.dcm"), nm(&JANE, 1)).unwrap();
    let refused = segment(
        folder.path(),
        "scan.dcm --model auto -o other --dicom --patient-id X",
    );
    assert!(!refused.status.success());
    let words = String::from_utf8_lossy(&refused.stderr);
    assert!(words.contains("patient"), "{words}");
    assert!(!words.contains(JANE.id), "{words}");
}
