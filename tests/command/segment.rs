//! `ventriform segment` and `measure`: the files, keys and errors that other programs rely on.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::Mutex;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::{CancelToken, Monitor, Observer, Plan, Stage, TotalProgress};
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PhantomParameters, phantom};
use ventriform::image::volume::{self, ReadLimits, ReadOptions, Volume, VolumeFile};
use ventriform::mesh::shapes;
use ventriform::parameters::FitParameters;
use ventriform::results::export::{self, Format, Metadata};
use ventriform::runs::segmentation::{SegmentationFilesError, SegmentationOrder, from_files};

/// A folder with `scan.nii.gz`, its `truth.nii.gz`, and masks that do not match it.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let parameters = PhantomParameters {
        shape: [64; 3],
        ..PhantomParameters::default()
    };
    let made = phantom(&parameters, &Monitor::silent()).unwrap();
    let write = |name: &str, volume: &Volume, stored| {
        let bytes = nifti::write(volume, stored, true).unwrap();
        std::fs::write(folder.path().join(name), bytes).unwrap();
    };
    write("scan.nii.gz", &made.volume, StoredType::Int16);
    write("truth.nii.gz", &made.truth, StoredType::Uint8);
    let mut mask = made.truth.clone();
    mask.frame = VoxelToPatient::centred(mask.shape, [3.2; 3], Vec3::repeat(900.0)).unwrap();
    write("elsewhere.nii.gz", &mask, StoredType::Uint8);
    mask = made.truth;
    mask.voxels.fill(0.0);
    write("empty.nii.gz", &mask, StoredType::Uint8);
    mask.voxels.fill(3.0);
    write("blank.nii.gz", &mask, StoredType::Uint8);
    let sphere = shapes::icosphere(40.0, 2);
    let sphere = export::encode(Format::Json, &sphere, &Metadata::new("sphere")).unwrap();
    std::fs::write(folder.path().join("sphere.json"), sphere).unwrap();
    folder
}

fn ventriform(folder: &Path, line: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ventriform"))
        .args(line.split_whitespace())
        .current_dir(folder)
        .output()
        .unwrap()
}

fn succeeds(folder: &Path, line: &str) -> String {
    let output = ventriform(folder, line);
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{line}: {words}");
    String::from_utf8(output.stdout).unwrap()
}

fn refusal(folder: &Path, line: &str) -> String {
    let output = ventriform(folder, line);
    assert!(!output.status.success(), "{line}");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

#[test]
fn a_model_of_a_scan_segments_it_with_stable_names() {
    let folder = folder();
    let here = folder.path();
    succeeds(here, "generate scan.nii.gz -o lv.json --points 150");
    succeeds(
        here,
        "segment scan.nii.gz --model lv.json -o out --expert truth.nii.gz",
    );
    for name in [
        "mask.nii.gz",
        "mesh.glb",
        "mesh.stl",
        "mesh.json",
        "region.nii.gz",
        "polar.svg",
        "polar.png",
    ] {
        assert!(here.join("out").join(name).is_file(), "{name}");
    }
    let report = std::fs::read(here.join("out/report.json")).unwrap();
    let report: Value = serde_json::from_slice(&report).unwrap();
    assert_eq!(report["fit"]["reason"], "converged");
    assert!(number(&report["fit"]["confidence"]) > 0.8);
    // Blur moves the apparent edge outward: the wall itself has 125 ml.
    assert!(number(&report["measures"]["jaccard"]) > 0.75);
    assert!(number(&report["measures"]["contour_distance_voxels"]) < 0.6);
    assert!((140.0..165.0).contains(&number(&report["volumes_ml"]["wall"])));
    assert!((61.0..75.0).contains(&number(&report["volumes_ml"]["cavity"])));
    let interval = &report["volumes_ml"]["anatomical_interval"]["wall"];
    assert!(number(&interval[0]) < 125.0 && 125.0 < number(&interval[1]));
    assert!(report["flags"].is_array());

    let measured = succeeds(here, "measure out/mask.nii.gz truth.nii.gz");
    let measured: Value = serde_json::from_str(&measured).unwrap();
    for key in ["jaccard", "contour_distance_voxels", "dice", "hausdorff_mm"] {
        assert_eq!(measured[key], report["measures"][key], "{key}");
    }
}

#[test]
fn formats_hints_and_the_built_in_model_are_accepted() {
    let folder = folder();
    let here = folder.path();
    let all = Format::ALL.map(|format| format!(" --format {}", format.extension()));
    let line = format!("segment scan.nii.gz --model auto -o all{}", all.concat());
    succeeds(here, &line);
    for format in Format::ALL {
        let name = format!("all/mesh.{}", format.extension());
        assert!(here.join(name).is_file());
    }
    let mask = std::fs::read(here.join("all/mask.nii.gz")).unwrap();
    // The heart lies near the middle of its small field: hints that say so change nothing.
    for hint in ["--box 12,12,12,52,52,52", "--axis 0.64,-0.6,-0.48"] {
        succeeds(
            here,
            &format!("segment scan.nii.gz --model auto -o hinted {hint}"),
        );
        let hinted = std::fs::read(here.join("hinted/mask.nii.gz")).unwrap();
        let agrees = hinted == mask
            || number(
                &serde_json::from_str::<Value>(&succeeds(
                    here,
                    "measure hinted/mask.nii.gz all/mask.nii.gz",
                ))
                .unwrap()["jaccard"],
            ) > 0.9;
        assert!(agrees, "{hint}");
    }
}

#[test]
fn errors_name_the_field_and_what_to_do() {
    let folder = folder();
    let here = folder.path();
    let segment = "segment scan.nii.gz -o out --model auto";
    for (line, words) in [
        (format!("{segment} --expert empty.nii.gz"), "mask is empty"),
        (
            format!("{segment} --expert elsewhere.nii.gz"),
            "voxels lie inside the volume",
        ),
        (format!("{segment} --center nan,0,0"), "3 finite numbers"),
        (format!("{segment} --center 900,0,0"), "64 x 64 x 64 voxels"),
        (
            format!("{segment} --seed-point 64,0,0"),
            "outside the volume",
        ),
        (
            format!("{segment} --center 0,0,0 --seed-point 1,1,1"),
            "not both",
        ),
        (format!("{segment} --margin inf"), "-5 to 5"),
        (format!("{segment} --blur 11"), "0 to 10"),
        (format!("{segment} --organ liver"), "no model of a liver"),
        (format!("{segment} --model sphere.json"), "no ventricle"),
        (
            "segment scan.nii.gz -o out --model sphere.json".into(),
            "no ventricle",
        ),
        (
            "segment blank.nii.gz -o out --model auto".into(),
            "shows nothing",
        ),
        (
            "segment truth.nii.gz -o out --model scan.nii.gz".into(),
            "not in a known format of meshes: it begins with the bytes 1f 8b",
        ),
        ("measure empty.nii.gz truth.nii.gz".into(), "mask is empty"),
        ("measure truth.nii.gz empty.nii.gz".into(), "mask is empty"),
        (
            "measure truth.nii.gz elsewhere.nii.gz".into(),
            "inside the volume",
        ),
    ] {
        let said = refusal(here, &line);
        assert!(said.contains(words), "{line}: {said}");
    }
    assert!(!here.join("out").exists(), "nothing is written");
}

/// The same masks to `measure`, `segment --expert` and `calibrate`: the structure is chosen by its number,
/// never guessed; what is on another grid is refused with both geometries, or resampled if asked.
#[test]
fn masks_are_read_alike_by_every_command() {
    let folder = folder();
    let here = folder.path();
    let read = |name: &str| {
        let file = VolumeFile::at(here.join(name));
        let (options, limits) = (ReadOptions::default(), ReadLimits::default());
        volume::read(&[file], &options, &limits, &Monitor::silent())
            .unwrap()
            .volume
    };
    let write = |name: &str, volume: &Volume| {
        let bytes = nifti::write(volume, StoredType::Uint8, true).unwrap();
        std::fs::write(here.join(name), bytes).unwrap();
    };
    let truth = read("truth.nii.gz");
    // The wall as 2, and as 3 all that lies within 40 mm of it along i, on one side.
    let mut map = truth.clone();
    for v in 0..map.voxels.len() {
        let near = (1..12).any(|n| truth.voxels.get(v + n).is_some_and(|t| *t > 0.0));
        map.voxels[v] = match (truth.voxels[v] > 0.0, near) {
            (true, _) => 2.0,
            (_, true) => 3.0,
            _ => 0.0,
        };
    }
    write("map.nii.gz", &map);
    let mut fine = truth.clone();
    let shift = fine.frame.linear().column(0) * 0.3;
    let origin = fine.frame.to_patient(&Vec3::zeros()) + shift;
    fine.frame = VoxelToPatient::new(*fine.frame.linear(), origin).unwrap();
    write("shifted.nii.gz", &fine);
    let jaccard = |line: &str| {
        let measured: Value = serde_json::from_str(&succeeds(here, line)).unwrap();
        number(&measured["jaccard"])
    };
    assert_eq!(jaccard("measure truth.nii.gz map.nii.gz --label 2"), 1.0);
    assert_eq!(jaccard("measure truth.nii.gz map.nii.gz --label-b 2"), 1.0);
    assert_eq!(
        jaccard("measure map.nii.gz truth.nii.gz --label-a 2 --label-b 1"),
        1.0
    );
    assert!(jaccard("measure truth.nii.gz map.nii.gz --label-b 3") < 0.01);
    assert_eq!(
        jaccard("measure truth.nii.gz shifted.nii.gz --resample"),
        1.0
    );
    let several = ["2 (", "3 (", "`label`"];
    let other = ["64 x 64 x 64 voxels of", "different grids", "`resample`"];
    for (line, words) in [
        ("measure truth.nii.gz map.nii.gz", &several[..]),
        (
            "segment scan.nii.gz -o out --model auto --expert map.nii.gz",
            &several,
        ),
        (
            "measure truth.nii.gz map.nii.gz --label 4",
            &["no structure 4", "2 ("],
        ),
        ("measure truth.nii.gz scan.nii.gz", &["no mask"]),
        ("measure truth.nii.gz shifted.nii.gz", &other),
        (
            "segment scan.nii.gz -o out --model auto --expert shifted.nii.gz",
            &other,
        ),
        ("measure truth.nii.gz truth.nii.gz --label 7", &["neither"]),
        (
            "measure truth.nii.gz truth.nii.gz --label-a 7",
            &["no structure 7"],
        ),
    ] {
        let said = refusal(here, line);
        for word in words {
            assert!(said.contains(word), "{line}: {said}");
        }
    }
    // The agreement is the one with the wall alone, and the report says what was compared.
    let compared = |name: &str, line: &str| {
        succeeds(
            here,
            &format!("segment scan.nii.gz -o {name} --model auto {line}"),
        );
        let report = std::fs::read(here.join(name).join("report.json")).unwrap();
        let report: Value = serde_json::from_slice(&report).unwrap();
        (report["measures"].clone(), report["warnings"].to_string())
    };
    let (alone, quiet) = compared("alone", "--expert truth.nii.gz");
    let (named, told) = compared("named", "--expert map.nii.gz --label 2");
    assert_eq!(named, alone);
    assert!(
        !quiet.contains("label 2") && told.contains("label 2"),
        "{told}"
    );
    let (resampled, told) = compared("resampled", "--expert shifted.nii.gz --resample");
    assert_eq!(resampled, alone);
    assert!(told.contains("resampled"), "{told}");
    for (case, scan) in [("a", "scan.nii.gz"), ("b", "scan.nii.gz")] {
        let case = here.join("cohort").join(case);
        std::fs::create_dir_all(&case).unwrap();
        std::fs::copy(here.join(scan), case.join("spect.nii.gz")).unwrap();
        std::fs::copy(here.join("map.nii.gz"), case.join("lv_expert_img.nii.gz")).unwrap();
    }
    let said = refusal(here, "calibrate cohort -o reader.json");
    assert!(said.contains("2 (") && said.contains("its mask"), "{said}");
    succeeds(here, "calibrate cohort -o reader.json --label 2");
}

#[test]
fn without_a_model_the_built_in_hearts_are_fitted() {
    let folder = folder();
    let here = folder.path();
    succeeds(here, "segment scan.nii.gz -o unnamed");
    succeeds(here, "segment scan.nii.gz --model auto -o auto");
    for file in ["mask.nii.gz", "mesh.stl"] {
        let read = |of: &str| std::fs::read(here.join(of).join(file)).unwrap();
        assert_eq!(read("unnamed"), read("auto"), "{file}");
    }
}

#[test]
fn templates_are_imported_into_a_data_folder() {
    let folder = folder();
    let here = folder.path();
    succeeds(here, "generate scan.nii.gz -o lv.json --points 110");
    let nowhere = refusal(here, "templates import lv.json --data-dir data");
    assert!(nowhere.contains("no such folder"), "{nowhere}");
    std::fs::create_dir(here.join("data")).unwrap();
    let first = succeeds(here, "templates import lv.json --data-dir data");
    assert!(
        first.starts_with("tpl_") && first.trim().ends_with(" lv"),
        "{first}"
    );
    let again = succeeds(here, "templates import lv.json --data-dir data");
    assert_eq!(first, again);
    let ball = refusal(here, "templates import sphere.json --data-dir data");
    assert!(ball.contains("no ventricle"), "{ball}");
}

/// Records the stages and the progress of the whole, and cancels at one of them.
struct Watcher {
    gauge: TotalProgress,
    stages: Mutex<Vec<Stage>>,
    whole: Mutex<f64>,
    stop_at: Option<Stage>,
    token: CancelToken,
    raised: Mutex<Option<Instant>>,
}

impl Watcher {
    fn new(stop_at: Option<Stage>) -> Self {
        Self {
            gauge: TotalProgress::new(Plan::SEGMENTATION),
            stages: Mutex::default(),
            whole: Mutex::new(0.0),
            stop_at,
            token: CancelToken::new(),
            raised: Mutex::default(),
        }
    }

    /// Segments the scan and encodes every file; returns whether it was cancelled.
    fn segment(&self, scan: &Path) -> bool {
        let monitor = Monitor::new(self, self.token.clone());
        let parameters = FitParameters::default();
        let files = [VolumeFile::at(scan)];
        let order = SegmentationOrder::of_built_in_hearts(&files, &parameters);
        match from_files(&order, &ReadLimits::default(), &monitor) {
            Ok(made) => match made.files(&Format::ALL, None, &monitor) {
                Ok(_) => false,
                Err(error) => matches!(error, SegmentationFilesError::Cancelled(_)),
            },
            Err(error) => error.is_cancelled(),
        }
    }
}

impl Observer for Watcher {
    fn progress(&self, stage: Stage, fraction: f64) {
        let mut stages = self.stages.lock().unwrap();
        // Alignment and deformation come again with each of the built-in hearts.
        if !stages.contains(&stage) {
            stages.push(stage);
        }
        let now = self.gauge.advance(stage, fraction);
        let mut whole = self.whole.lock().unwrap();
        assert!(now >= *whole);
        *whole = now;
        if self.stop_at == Some(stage) {
            self.token.cancel();
            self.raised.lock().unwrap().get_or_insert_with(Instant::now);
        }
    }
}

#[test]
fn every_stage_reports_progress_and_can_be_cancelled() {
    let folder = folder();
    let scan = folder.path().join("scan.nii.gz");
    let watcher = Watcher::new(None);
    assert!(!watcher.segment(&scan));
    let planned: Vec<Stage> = Plan::SEGMENTATION
        .0
        .iter()
        .map(|(stage, _)| *stage)
        .collect();
    assert_eq!(*watcher.stages.lock().unwrap(), planned);
    assert!((*watcher.whole.lock().unwrap() - 1.0).abs() < 1e-9);
    for stage in planned {
        let watcher = Watcher::new(Some(stage));
        assert!(watcher.segment(&scan), "{stage:?}");
        let raised = watcher.raised.lock().unwrap().unwrap();
        // Generous, because the machine may be busy: without load no stage takes a tenth of it.
        assert!(raised.elapsed() < Duration::from_secs(1), "{stage:?}");
    }
}
