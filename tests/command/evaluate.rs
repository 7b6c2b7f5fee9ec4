//! `ventriform evaluate` on a simulated cohort, from folder to page.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output};
use std::time::SystemTime;

use ventriform::base::progress::Monitor;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PerfusionDefect, PhantomParameters, phantom};

/// A case's folder with scan and truth.
fn case(cohort: &Path, name: &str, seed: u64, defects: Vec<PerfusionDefect>) {
    let made = phantom(
        &PhantomParameters {
            shape: [56; 3],
            spacing_mm: [4.5; 3],
            seed,
            defects,
            ..PhantomParameters::default()
        },
        &Monitor::silent(),
    )
    .unwrap();
    let folder = cohort.join(name);
    std::fs::create_dir_all(&folder).unwrap();
    for (file, volume, stored) in [
        ("spect.nii.gz", &made.volume, StoredType::Float32),
        ("lv_truth.nii.gz", &made.truth, StoredType::Uint8),
        ("lv_expert_img.nii.gz", &made.truth, StoredType::Uint8),
    ] {
        std::fs::write(
            folder.join(file),
            nifti::write(volume, stored, true).unwrap(),
        )
        .unwrap();
    }
}

/// One usable and one unusable template; a complete patient, one without the expert's mask, one
/// with a truncated scan, one without a scan.
fn cohort() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    case(path, "t1", 1, Vec::new());
    std::fs::create_dir_all(path.join("t2")).unwrap();
    std::fs::write(path.join("t2/spect.nii.gz"), b"no NIfTI").unwrap();
    let defect = PerfusionDefect {
        segment: 8,
        severity: 0.6,
    };
    case(path, "p1", 2, vec![defect]);
    case(path, "p2", 3, Vec::new());
    std::fs::remove_file(path.join("p2/lv_expert_img.nii.gz")).unwrap();
    case(path, "p3", 4, Vec::new());
    let whole = std::fs::read(path.join("p3/spect.nii.gz")).unwrap();
    std::fs::write(path.join("p3/spect.nii.gz"), &whole[..whole.len() / 3]).unwrap();
    case(path, "p4", 5, Vec::new());
    std::fs::remove_file(path.join("p4/spect.nii.gz")).unwrap();
    folder
}

fn evaluate(cohort: &Path, out: &Path, threads: usize) -> Output {
    let output = Command::new(env!("CARGO_BIN_EXE_ventriform"))
        .args([
            "evaluate",
            "--points",
            "67",
            "--models",
            "reference,optimised,auto",
        ])
        .arg(cohort)
        .arg("--output")
        .arg(out)
        .env("RAYON_NUM_THREADS", threads.to_string())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    output
}

/// Every file below a folder.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let (path, name) = (
            entry.path(),
            entry.file_name().to_string_lossy().into_owned(),
        );
        if path.is_dir() {
            let below = files(&path).into_iter();
            found.extend(below.map(|(n, bytes)| (format!("{name}/{n}"), bytes)));
        } else {
            found.insert(name, std::fs::read(&path).unwrap());
        }
    }
    found
}

fn modified(path: &Path) -> SystemTime {
    path.metadata().unwrap().modified().unwrap()
}

#[test]
fn a_cohort_with_gaps_is_evaluated_resumed_and_reproduced() {
    let cohort = cohort();
    let work = tempfile::tempdir().unwrap();
    let (first, second) = (work.path().join("first"), work.path().join("second"));
    evaluate(cohort.path(), &first, 1);
    evaluate(cohort.path(), &second, 4);
    let whole = files(&first);
    assert!(whole == files(&second), "threads changed the results");

    let page = String::from_utf8(whole["evaluation.html"].clone()).unwrap();
    for case in ["t2", "p2", "p3", "p4"] {
        let gaps = page.split("What is missing").nth(1).unwrap();
        let gaps = gaps.split("</table>").next().unwrap();
        let row = format!("<th scope=\"row\">{case}</th>");
        assert!(gaps.contains(&row), "{case}: {gaps}");
    }
    assert_eq!(page.matches("data:image/png;base64,").count(), 2);
    let listed: serde_json::Value = serde_json::from_slice(&whole["evaluation.json"]).unwrap();
    let pictures = listed["pictures"].as_array().unwrap();
    assert_eq!(pictures.len(), 2);
    for picture in pictures {
        assert!(whole[picture["file"].as_str().unwrap()].starts_with(b"\x89PNG"));
    }
    assert!(page.contains("unreadable") && page.contains("no gold standard"));
    // No address: the policy's attribute is the only word with http in it.
    assert!(!page.replace("http-equiv=", "").contains("http"));
    let json: serde_json::Value = serde_json::from_slice(&whole["evaluation.json"]).unwrap();
    let mean = |gold: &str| {
        let means = json["means"].as_array().unwrap();
        let wanted = |m: &&serde_json::Value| {
            m["gold"] == gold && m["template"] == "all" && m["model"] == "optimised"
        };
        means.iter().find(wanted).unwrap().clone()
    };
    // Only fits with a gold standard count.
    assert_eq!(mean("expert")["fits"], 1);
    assert_eq!(mean("truth")["fits"], 2);
    assert!(mean("truth")["jaccard"].as_f64().unwrap() > 0.6);
    // What `auto` keeps is a result like any other model's.
    let fits = String::from_utf8(whole["fits.csv"].clone()).unwrap();
    let auto = |line: &&str| line.contains("built-in,") && line.contains(",auto,");
    let auto: Vec<&str> = fits.lines().filter(auto).collect();
    assert_eq!(auto.len(), 3, "{fits}");
    assert!(
        auto[0].contains("p1") && auto[0].contains("fitted"),
        "{auto:?}"
    );

    // As after a crash: one record truncated, one missing, one file half written.
    let fit = |case: &str, model: &str| first.join(format!("fits/{case}_t1_{model}_67.json"));
    let torn = std::fs::read(fit("p1", "optimised")).unwrap();
    std::fs::write(fit("p1", "optimised"), &torn[..torn.len() / 2]).unwrap();
    std::fs::remove_file(fit("p2", "optimised")).unwrap();
    std::fs::write(
        first.join("fits/.p2_t1_optimised_67.json.part"),
        &torn[..99],
    )
    .unwrap();
    let kept = modified(&fit("p1", "reference"));
    evaluate(cohort.path(), &first, 2);
    assert!(
        files(&first) == whole,
        "a resumed run differs from one that was not stopped"
    );
    assert_eq!(
        modified(&fit("p1", "reference")),
        kept,
        "a complete record is not made again"
    );

    // Another gold standard: the patient's fits are measured again.
    let other = std::fs::read(cohort.path().join("p2/lv_truth.nii.gz")).unwrap();
    std::fs::write(cohort.path().join("p1/lv_expert_img.nii.gz"), other).unwrap();
    evaluate(cohort.path(), &first, 2);
    assert_ne!(modified(&fit("p1", "reference")), kept);
    assert_ne!(files(&first)["table1.csv"], whole["table1.csv"]);
}

#[test]
fn an_unusable_cohort_is_an_error_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let run = |cohort: &Path| {
        let output = Command::new(env!("CARGO_BIN_EXE_ventriform"))
            .arg("evaluate")
            .arg(cohort)
            .arg("--output")
            .arg(&out)
            .output()
            .unwrap();
        assert!(!output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    let said = run(&folder.path().join("nowhere"));
    assert!(said.contains("nowhere"), "{said}");
    for case in ["t1", "p1"] {
        std::fs::create_dir_all(folder.path().join(case)).unwrap();
        std::fs::write(folder.path().join(case).join("spect.nii.gz"), b"?").unwrap();
    }
    let said = run(folder.path());
    assert!(said.contains("no model could be made"), "{said}");
}
