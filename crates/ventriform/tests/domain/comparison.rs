//! Rest and stress: one heart with and without a defect.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;
use std::sync::Mutex;

use ventriform::base::geometry::Vec3;
use ventriform::base::progress::{CancelToken, Monitor, Observer, Stage};
use ventriform::heart::comparison::{Verdict, WhichScan};
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PerfusionDefect, PhantomParameters, phantom};
use ventriform::image::volume::{ReadLimits, Volume, VolumeFile};
use ventriform::parameters::ComparisonParameters;
use ventriform::results::report::NoBeatCode;
use ventriform::runs::rest_stress::{ComparedHearts, ComparisonError, ComparisonOrder, from_files};

/// Mid and apical segments of the LAD.
const LAD_SEGMENTS: [u8; 4] = [7, 8, 13, 14];

fn scan(seed: u64, severity: f64) -> Volume {
    let defects = LAD_SEGMENTS.map(|segment| PerfusionDefect { segment, severity });
    let parameters = PhantomParameters {
        shape: [64; 3],
        spacing_mm: [4.4; 3],
        // The heart lies where it lay; only the noise is another.
        pose_spread_deg: 0.0,
        pose_spread_mm: 0.0,
        seed,
        defects: defects.into_iter().filter(|_| severity > 0.0).collect(),
        ..PhantomParameters::default()
    };
    phantom(&parameters, &Monitor::silent()).unwrap().volume
}

fn file(volume: &Volume) -> Vec<VolumeFile> {
    let bytes = nifti::write(volume, StoredType::Float32, false).unwrap();
    vec![VolumeFile::in_memory("scan.nii", bytes)]
}

fn compared(stress: &Volume, rest: &Volume) -> Result<ComparedHearts, ComparisonError> {
    compared_with(&ComparisonParameters::default(), stress, rest)
}

fn compared_with(
    parameters: &ComparisonParameters,
    stress: &Volume,
    rest: &Volume,
) -> Result<ComparedHearts, ComparisonError> {
    let (stress, rest) = (file(stress), file(rest));
    let order = ComparisonOrder {
        stress: &stress,
        rest: &rest,
        auto: true,
        models: Vec::new(),
        normals: None,
        parameters,
    };
    from_files(&order, &ReadLimits::default(), &Monitor::silent())
}

fn scaled(volume: &Volume, factor: f32) -> Volume {
    Volume {
        voxels: volume.voxels.iter().map(|v| factor * v).collect(),
        ..volume.clone()
    }
}

#[test]
fn a_defect_at_stress_alone_is_reversible_and_one_in_both_is_fixed() {
    let made = compared(&scan(1, 0.6), &scan(2, 0.0)).unwrap();
    let change = &made.change;
    assert!(change.answers.reversible.value > 8.0, "{change:?}");
    assert!(
        change.answers.fixed.value < 2.0,
        "{}",
        change.answers.fixed.value
    );
    let losses = |in_defect: bool| {
        let own = change.segments.iter();
        own.filter(move |own| LAD_SEGMENTS.contains(&(own.segment as u8)) == in_defect)
            .map(|own| own.figures.difference_points.unwrap())
    };
    let least = losses(true).fold(f64::MAX, f64::min);
    // Blur carries some of the loss into the next segments.
    let most = losses(false).fold(f64::MIN, f64::max);
    assert!(least > 1.5 * change.limit_points(), "{least}");
    assert!(most < 0.6 * least, "{most} of {least}");
    let [lad, lcx, rca] = change.territories.map(|own| own.figures.reversible_percent);
    assert!(lad > 50.0 && lcx < 20.0 && rca < 20.0, "{lad} {lcx} {rca}");
    assert_eq!(change.answers.reversible.verdict, Verdict::Yes);

    // The other way round nothing is lost at stress.
    let swapped = compared(&scan(2, 0.0), &scan(1, 0.6)).unwrap();
    assert!(swapped.change.answers.reversible.value < 2.0);

    let fixed = compared(&scan(1, 0.6), &scan(2, 0.6)).unwrap();
    assert!(fixed.change.answers.reversible.value < 2.0);
    assert!(fixed.change.answers.fixed.value > 8.0, "{:?}", fixed.change);
}

#[test]
fn an_unchanged_heart_has_no_reversible_wall_and_cavities_alike() {
    for (stress, rest) in [(1, 2), (3, 4)] {
        let made = compared(&scan(stress, 0.0), &scan(rest, 0.0)).unwrap();
        let change = &made.change;
        assert!(
            change.answers.reversible.value < 3.0,
            "{}",
            change.answers.reversible.value
        );
        assert!((made.tid() - 1.0).abs() < 0.05, "{}", made.tid());
        assert_eq!(change.turn.degrees, 0.0);
        assert_ne!(change.answers.reversible.verdict, Verdict::Yes);
        let [low, high] = made.tid_answer().interval;
        assert!(low < 1.0 && 1.0 < high, "{low} {high}");
        assert!(change.matched_percent > 80.0, "{}", change.matched_percent);
    }
}

#[test]
fn a_factor_changes_no_figure() {
    let (stress, rest) = (scan(1, 0.4), scan(2, 0.0));
    let made = compared(&stress, &rest).unwrap();
    let brighter = compared(&scaled(&stress, 8.0), &rest).unwrap();
    assert!((brighter.change.scale / made.change.scale - 8.0).abs() < 1e-3);
    let percent = |made: &ComparedHearts| made.change.answers.reversible.value;
    assert!((percent(&brighter) - percent(&made)).abs() < 0.1);
    assert!((brighter.tid() - made.tid()).abs() < 1e-3);
}

/// A base that is put 8 mm towards the apex in one scan shortens that heart alone.
#[test]
fn a_correction_is_of_its_own_scan() {
    let (stress, rest) = (scan(1, 0.0), scan(2, 0.0));
    let made = compared(&stress, &rest).unwrap();
    let model = made.stress.template();
    for (scan, own) in [("stress", 0), ("rest", 1)] {
        let fit = &[&made.stress, &made.rest][own].segmentation().fit.model;
        let axis = fit.cup.unwrap().axis;
        let along = |vertex: &&Vec3| axis.dot(vertex);
        let vertices = fit.mesh.vertices.iter();
        let rim = vertices
            .min_by(|a, b| along(a).total_cmp(&along(b)))
            .unwrap();
        let base = rim + axis * 8.0;
        let base = format!("{},{},{}", base.x, base.y, base.z);
        let given = [
            (format!("{scan}_base"), base),
            ("kept_model".to_owned(), model.to_owned()),
        ];
        let given = given
            .iter()
            .map(|(name, value)| (name.as_str(), value.as_str()));
        let parameters = ComparisonParameters::from_pairs(given).unwrap();
        let corrected = compared_with(&parameters, &stress, &rest).unwrap();
        let cavities = |made: &ComparedHearts| [made.stress.cavity_ml(), made.rest.cavity_ml()];
        let (before, after) = (cavities(&made), cavities(&corrected));
        assert!(after[own] < 0.95 * before[own], "{before:?} {after:?}");
        assert!((after[1 - own] / before[1 - own] - 1.0).abs() < 0.02);
    }
}

/// Notes the stages that work reports.
#[derive(Default)]
struct Stages(Mutex<BTreeSet<Stage>>);

impl Observer for Stages {
    fn progress(&self, stage: Stage, _: f64) {
        self.0.lock().unwrap().insert(stage);
    }
}

/// Before anything is fitted, also where the files' formats and names differ.
#[test]
fn one_scan_twice_is_refused_at_once() {
    let rest = scan(2, 0.0);
    let packed = nifti::write(&rest, StoredType::Float32, true).unwrap();
    for other in [
        file(&rest),
        vec![VolumeFile::in_memory("other.nii.gz", packed)],
        vec![VolumeFile::of_arrays("array", vec![rest.clone()])],
    ] {
        let stages = Stages::default();
        let order = ComparisonOrder {
            stress: &other,
            rest: &file(&rest),
            auto: true,
            models: Vec::new(),
            normals: None,
            parameters: &ComparisonParameters::default(),
        };
        let monitor = Monitor::new(&stages, CancelToken::new());
        let refused = from_files(&order, &ReadLimits::default(), &monitor).unwrap_err();
        assert!(matches!(refused, ComparisonError::SameScan(_)), "{refused}");
        let stages = stages.0.into_inner().unwrap();
        assert!(
            stages.iter().all(|stage| *stage == Stage::Read),
            "{stages:?}"
        );
    }
}

#[test]
fn files_that_name_no_patient_are_flagged() {
    let made = compared(&scan(1, 0.0), &scan(2, 0.0)).unwrap();
    let report = made.report();
    let codes: Vec<&str> = report.flags.iter().map(|flag| flag.code.as_str()).collect();
    assert_eq!(codes, ["origin_not_stated"]);
    assert_eq!((report.sss, report.sds), (None, None));
    // Neither is gated, so there is no beat, and the report says so.
    assert_eq!(report.beat, None);
    let why: Vec<_> = (report.no_beat.iter())
        .map(|no_beat| (no_beat.scan, no_beat.code))
        .collect();
    let not_gated = |scan| (scan, NoBeatCode::NotGated);
    assert_eq!(why, [WhichScan::Stress, WhichScan::Rest].map(not_gated));
    let text = serde_json::to_string(&report).unwrap();
    let read: ventriform::results::report::ComparisonReport = serde_json::from_str(&text).unwrap();
    assert_eq!(read, report);
}
