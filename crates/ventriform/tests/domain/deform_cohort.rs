//! The fit on simulated and clinical scans with automatic start.
//!
//! The scans lie beside the project; where they are absent, the tests say so.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use crate::shared_data::shared_data;
use std::path::Path;

use ventriform::base::progress::Monitor;
use ventriform::heart::model::{Organ, Template};
use ventriform::image::grid::voxelise::Mask;
use ventriform::image::volume::given_mask::{MaskChoice, read_mask};
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::{self, ReadLimits, ReadOptions, Reading, Volume, VolumeFile};
use ventriform::parameters::ModelParameters;
use ventriform::runs::pipeline;
use ventriform::runs::segmentation::{NamedTemplate, SegmentationParameters, segment};

fn read(path: &Path) -> Reading {
    volume::read(
        &[VolumeFile::at(path)],
        &ReadOptions::default(),
        &ReadLimits::default(),
        &Monitor::silent(),
    )
    .unwrap()
}

fn template(scan: &Path) -> NamedTemplate {
    let parameters = ModelParameters::from_pairs([("points", "150")]).unwrap();
    let model = pipeline::from_reading(&read(scan), &parameters, 0.0, &Monitor::silent()).unwrap();
    NamedTemplate {
        name: "t1".into(),
        template: Template::new(model.mesh, Organ::LeftVentricle, &Monitor::silent()).unwrap(),
        built_in: false,
    }
}

#[test]
fn no_patient_of_the_cohort_is_lost() {
    let Some(cohort) = shared_data("cohort") else {
        return;
    };
    let template = template(&cohort.join("t1/spect.nii.gz"));
    // Three defects beside a hot liver; small; large with defects; gut twice as hot.
    for case in ["p06", "p03", "p14", "p08"] {
        let scan = read(&cohort.join(case).join("spect.nii.gz")).volume;
        let expert = expert_on(&scan, &cohort.join(case).join("lv_expert_img.nii.gz"));
        let made = segment(
            &scan,
            std::slice::from_ref(&template),
            &SegmentationParameters::default(),
            Some(&expert),
            &Monitor::silent(),
        )
        .unwrap();
        let agreement = made.agreement.unwrap();
        assert!(agreement.jaccard > 0.7, "{case}: {agreement:?}");
        assert_eq!(
            made.fit.model.self_intersections + made.fit.model.turned_triangles,
            0
        );
    }
}

/// The expert's mask in the file at `path`, on the grid of `scan`.
fn expert_on(scan: &Volume, path: &Path) -> Mask {
    let (choice, silent) = (MaskChoice::default(), Monitor::silent());
    let given = read_mask(
        &[VolumeFile::at(path)],
        &choice,
        &ReadLimits::default(),
        &silent,
    );
    let placed = given.unwrap().on((scan.shape, &scan.frame), false, &silent);
    placed.unwrap().mask
}

#[test]
fn a_clinical_scan_is_segmented_where_its_expert_drew_alike_in_every_container() {
    let (Some(clinical), Some(cohort)) = (shared_data("clinical"), shared_data("cohort")) else {
        return;
    };
    let name = "1.2.840.4267.32.118564058634314627767242469443335771432";
    let scan = read(&clinical.join(format!("{name}.dcm"))).volume;
    let expert = expert_on(&scan, &clinical.join(format!("{name}_mask.nii.gz")));
    let template = [template(&cohort.join("t1/spect.nii.gz"))];
    let segmented = |scan: &Volume| {
        let parameters = SegmentationParameters::default();
        segment(
            scan,
            &template,
            &parameters,
            Some(&expert),
            &Monitor::silent(),
        )
        .unwrap()
    };
    let made = segmented(&scan);
    // Readers draw wider or narrower; none of them elsewhere.
    let dice = made.agreement.unwrap().dice;
    assert!(dice > 0.7, "{dice}");
    let bytes = nifti::write(&scan, StoredType::Float32, false).unwrap();
    let converted = volume::read(
        &[VolumeFile::in_memory("converted.nii", bytes)],
        &ReadOptions::default(),
        &ReadLimits::default(),
        &Monitor::silent(),
    );
    let converted = converted.unwrap().volume;
    assert_eq!(converted.frame, scan.frame);
    assert!(converted.voxels == scan.voxels);
    let again = segmented(&converted);
    assert_eq!(again.mask, made.mask);
    assert_eq!(again.fit.model.mesh.vertices, made.fit.model.mesh.vertices);
}
