//! Normal limits of simulated healthy hearts, from their files to the report of a scan.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::sync::LazyLock;
use ventriform::base::progress::Monitor;
use ventriform::heart::normals::{NormalLimits, NormalsError, ScanKind, Sex};
use ventriform::heart::polar::PlaceState;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{
    PerfusionDefect, PhantomParameters, healthy_person, phantom,
};
use ventriform::image::volume::{ReadLimits, VolumeFile};
use ventriform::parameters::{FitParameters, NormalsChoice, NormalsParameters};
use ventriform::runs::evaluate::normals::{NormalsOptions, build};
use ventriform::runs::segmentation::{
    SegmentationError, SegmentationOrder, SegmentedVolume, from_files,
};

/// Healthy hearts of the limits, and the first seed of others.
const HEALTHY_PEOPLE: u64 = 14;
const OTHERS_SEED: u64 = 100;

fn scan(seed: u64, defects: &[PerfusionDefect]) -> Vec<u8> {
    let base = PhantomParameters {
        shape: [52; 3],
        spacing_mm: [5.0; 3],
        ..PhantomParameters::default()
    };
    let mut parameters = healthy_person(seed, &base).parameters;
    parameters.defects = defects.to_vec();
    let made = phantom(&parameters, &Monitor::silent()).unwrap();
    nifti::write(&made.volume, StoredType::Int16, false).unwrap()
}

fn options() -> NormalsOptions {
    NormalsOptions {
        parameters: NormalsParameters {
            choice: NormalsChoice { mixed: true },
            ..NormalsParameters::default()
        },
        program_version: env!("CARGO_PKG_VERSION").to_owned(),
        limits: ReadLimits::default(),
    }
}

/// Limits of the healthy hearts, and one of the table that is not there.
static HEALTHY_LIMITS: LazyLock<NormalLimits> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let mut table = "case,file,sex,protocol,tracer,attenuation_corrected,healthy\n".to_owned();
    for seed in 0..HEALTHY_PEOPLE {
        fs::write(folder.path().join(format!("n{seed}.nii")), scan(seed, &[])).unwrap();
        let sex = if seed % 2 == 0 { "F" } else { "M" };
        table += &format!("n{seed},n{seed}.nii,{sex},rest,none (simulated),no,yes\n");
    }
    table +=
        "ill,n0.nii,M,rest,none (simulated),no,no\ngone,gone.nii,M,rest,none (simulated),no,yes\n";
    fs::write(folder.path().join("cohort.csv"), table).unwrap();
    build(folder.path(), &options(), &|_, _| (), &Monitor::silent()).unwrap()
});

fn judged(bytes: Vec<u8>, kind: &ScanKind) -> Result<SegmentedVolume, SegmentationError> {
    let parameters = FitParameters {
        scan: kind.clone(),
        ..FitParameters::default()
    };
    let files = [VolumeFile::in_memory("scan.nii", bytes)];
    let order = SegmentationOrder {
        normals: Some(&HEALTHY_LIMITS),
        ..SegmentationOrder::of_built_in_hearts(&files, &parameters)
    };
    from_files(&order, &ReadLimits::default(), &Monitor::silent())
}

fn kind() -> ScanKind {
    ScanKind {
        sex: Some(Sex::F),
        protocol: Some("rest".to_owned()),
        tracer: Some("none (simulated)".to_owned()),
        attenuation_corrected: Some(false),
    }
}

#[test]
fn limits_name_their_people_and_say_that_they_are_simulated() {
    assert!(HEALTHY_LIMITS.simulated);
    let group = &HEALTHY_LIMITS.groups[0];
    assert_eq!(group.sex.as_str(), "mixed");
    assert!(group.cases.len() >= 12, "{:?}", HEALTHY_LIMITS.excluded);
    let reason = |case: &str| {
        let found = HEALTHY_LIMITS
            .excluded
            .iter()
            .find(|excluded| excluded.case == case);
        found
            .map(|excluded| excluded.reason.as_str())
            .unwrap_or_default()
    };
    assert!(reason("ill").contains("healthy") && reason("gone").contains("gone.nii"));
    assert!(group.leave_one_out.mean_extent_percent < 3.0);
    let names: Vec<&str> = group
        .figures
        .iter()
        .map(|limit| limit.figure.as_str())
        .collect();
    assert_eq!(names, ["cavity_ml", "wall_ml"]);
    let read = NormalLimits::from_json(HEALTHY_LIMITS.to_json().as_bytes()).unwrap();
    assert_eq!(read, *HEALTHY_LIMITS);
}

#[test]
fn a_healthy_heart_lies_within_and_a_dark_segment_below() {
    let healthy = judged(scan(OTHERS_SEED, &[]), &kind()).unwrap();
    let found = healthy.perfusion.as_ref().unwrap();
    assert!(found.extent_percent < 5.0, "{}", found.extent_percent);
    for segment in [4, 10, 12] {
        let defect = PerfusionDefect {
            segment,
            severity: 0.9,
        };
        let ill = judged(scan(OTHERS_SEED, &[defect]), &kind()).unwrap();
        let found = ill.perfusion.as_ref().unwrap();
        let scored = found
            .segments
            .iter()
            .max_by(|a, b| a.deficit_percent.total_cmp(&b.deficit_percent));
        assert_eq!(scored.unwrap().segment, usize::from(segment));
        assert!(scored.unwrap().score.unwrap() >= 1);
        let report = ill.report().perfusion.unwrap();
        assert_eq!(report.segments.len(), 17);
        assert!(
            report
                .flags
                .iter()
                .any(|flag| flag.code == "normals_simulated")
        );
        assert!(
            report
                .figures
                .iter()
                .any(|figure| figure.figure == "cavity_ml")
        );
        let map = ill.segmentation.polar.as_ref().unwrap();
        for (index, z) in found.z.iter().enumerate() {
            let state = map.state(index / 60, index % 60);
            assert!(z.is_none() || state == PlaceState::Muscle);
        }
        let names: Vec<String> = (ill.files(&[], None, &Monitor::silent()).unwrap())
            .into_iter()
            .map(|file| file.name)
            .collect();
        for name in [
            "polar_z.json",
            "polar_z.svg",
            "polar_z.png",
            "polar_score.json",
        ] {
            assert!(names.iter().any(|found| found == name), "{name}");
        }
    }
}

#[test]
fn a_scan_of_another_kind_is_refused_with_what_there_is() {
    let other = ScanKind {
        protocol: Some("stress".to_owned()),
        ..kind()
    };
    let error = judged(scan(OTHERS_SEED, &[]), &other).unwrap_err();
    assert!(
        matches!(
            error,
            SegmentationError::Normals(NormalsError::OtherKind { .. })
        ),
        "{error}"
    );
    assert!(error.to_string().contains("protocol rest"), "{error}");
}
