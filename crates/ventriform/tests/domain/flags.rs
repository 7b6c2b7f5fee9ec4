//! Flags of a segmentation: motion, masks, objects that are no hearts.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use ventriform::base::geometry::Vec3;
use ventriform::base::progress::Monitor;
use ventriform::heart::fit::Fit;
use ventriform::image::grid::agreement::compare;
use ventriform::image::grid::voxelise::{Mask, voxelise};
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PerfusionDefect, PhantomParameters, phantom};
use ventriform::image::volume::{Phantom, ReadLimits, Volume, VolumeFile};
use ventriform::parameters::FitParameters;
use ventriform::runs::segmentation::{SegmentationError, SegmentationOrder, from_files};

fn patient() -> PhantomParameters {
    PhantomParameters {
        shape: [64; 3],
        spacing_mm: [4.4; 3],
        ..PhantomParameters::default()
    }
}

fn scan(parameters: &PhantomParameters) -> Phantom {
    phantom(parameters, &Monitor::silent()).unwrap()
}

fn segmented(volume: &Volume) -> Result<Fit, SegmentationError> {
    let bytes = nifti::write(volume, StoredType::Float32, false).unwrap();
    let files = [VolumeFile::in_memory("scan.nii", bytes)];
    let parameters = FitParameters::default();
    let order = SegmentationOrder::of_built_in_hearts(&files, &parameters);
    let segmented = from_files(&order, &ReadLimits::default(), &Monitor::silent())?;
    Ok(segmented.segmentation.fit)
}

fn codes(fit: &Fit) -> Vec<&'static str> {
    fit.judgement.flags.iter().map(|flag| flag.code()).collect()
}

#[test]
fn a_usual_scan_is_believed() {
    for seed in 1..4 {
        let fit = segmented(&scan(&PhantomParameters { seed, ..patient() }).volume).unwrap();
        assert_eq!(
            codes(&fit),
            Vec::<&str>::new(),
            "{:?}",
            fit.judgement.evidence
        );
        assert!(
            fit.judgement.confidence > 0.9,
            "{}",
            fit.judgement.confidence
        );
    }
}

#[test]
fn a_scan_with_motion_is_doubted_the_more_the_farther_the_patient_moved() {
    let confidence = |motion_mm: f64, heads: u8| {
        let moved = PhantomParameters {
            motion_mm,
            heads,
            ..patient()
        };
        match segmented(&scan(&moved).volume) {
            Ok(fit) => {
                let flagged = codes(&fit).contains(&"motion");
                assert!(flagged || motion_mm < 20.0, "{:?}", fit.judgement.evidence);
                fit.judgement.confidence
            }
            Err(_) => 0.0,
        }
    };
    let [still, moved] = [0.0, 24.0].map(|motion_mm| confidence(motion_mm, 1));
    assert!(still > 0.9 && moved < 0.5, "{still} {moved}");
    let moved = confidence(24.0, 2);
    assert!(moved < 0.5, "two heads: {moved}");
}

#[test]
fn a_mask_of_a_heart_is_no_image_of_uptake() {
    if let Ok(fit) = segmented(&scan(&patient()).truth) {
        assert!(codes(&fit).contains(&"label_map"), "{:?}", codes(&fit));
        assert!(
            fit.judgement.confidence <= 0.5,
            "{}",
            fit.judgement.confidence
        );
    }
}

#[test]
fn balls_shells_and_beans_are_no_hearts() {
    let mut volume = scan(&patient()).volume;
    let frame = volume.frame.clone();
    let [nx, ny, _] = volume.shape;
    let mut draw = |value: &dyn Fn(Vec3) -> f32| {
        for n in 0..volume.voxels.len() {
            let index = [n % nx, n / nx % ny, n / (nx * ny)].map(|i| i as f64);
            volume.voxels[n] = value(frame.to_patient(&Vec3::from(index)));
        }
        segmented(&volume)
    };
    let centre = Vec3::new(40.0, -30.0, 5.0);
    let ball = draw(&|p| (36.0 - (p - centre).norm()).clamp(0.0, 8.0) as f32);
    assert!(ball.is_err());
    let shell = draw(&|p| (8.0 - ((p - centre).norm() - 30.0).abs()).clamp(0.0, 5.0) as f32);
    assert!(shell.is_err());
    // A ball with a dent, as a kidney's mask has it.
    let dent = centre + Vec3::new(20.0, 18.0, 0.0);
    let bean = draw(&|p| {
        let inside = (p - centre).norm() < 34.0 && (p - dent).norm() > 20.0;
        f32::from(u8::from(inside))
    });
    if let Ok(fit) = bean {
        assert!(codes(&fit).contains(&"label_map"), "{:?}", codes(&fit));
        assert!(
            fit.judgement.confidence <= 0.5,
            "{}",
            fit.judgement.confidence
        );
    }
}

#[test]
fn the_right_ventricles_wall_is_not_taken_for_an_infarcted_septum_without_doubt() {
    for (seed, septal) in [(7, [3, 8, 9, 14]), (8, [2, 8, 9, 14]), (2, [2, 3, 9, 14])] {
        let defect = |segment: u8| PerfusionDefect {
            segment,
            severity: 1.0,
        };
        let beside = PhantomParameters {
            spacing_mm: [4.0; 3],
            right_ventricle: 1.6,
            defects: septal.map(defect).to_vec(),
            seed,
            ..patient()
        };
        let Phantom { volume, truth, .. } = scan(&beside);
        let fit = segmented(&volume).unwrap();
        let wall = &fit.model.surfaces.as_ref().unwrap().anatomical.mesh;
        let mask = voxelise(wall, volume.shape, &volume.frame, &Monitor::silent()).unwrap();
        let truth = Mask {
            shape: truth.shape,
            voxels: truth.voxels.iter().map(|v| *v > 0.5).collect(),
        };
        let spacing = volume.frame.spacing();
        let agreement = compare(&mask, &truth, spacing, &Monitor::silent()).unwrap();
        let right = agreement.jaccard >= 0.75;
        assert!(
            right || codes(&fit).contains(&"right_ventricle"),
            "{seed}: {} {:?}",
            agreement.jaccard,
            fit.judgement.evidence
        );
    }
}

#[test]
fn a_wall_that_is_not_seen_is_less_certain() {
    let infarct = PhantomParameters {
        defects: [5, 6, 11, 12]
            .map(|segment| PerfusionDefect {
                segment,
                severity: 1.0,
            })
            .to_vec(),
        ..patient()
    };
    let median = |parameters: &PhantomParameters| {
        let fit = segmented(&scan(parameters).volume).unwrap();
        let uncertainty = fit.judgement.uncertainty.unwrap();
        // The other built-in hearts lie near, but not on the same surface.
        let spreads = fit.judgement.nodes.iter().map(|node| node.spread.unwrap());
        let mean = spreads.sum::<f64>() / fit.judgement.nodes.len() as f64;
        assert!((0.05..5.0).contains(&mean), "{mean}");
        [uncertainty.apparent, uncertainty.anatomical].map(|mut all| {
            assert_eq!(all.len(), fit.model.mesh.vertices.len());
            all.sort_by(f64::total_cmp);
            all[all.len() * 9 / 10]
        })
    };
    let (whole, dark) = (median(&patient()), median(&infarct));
    for (whole, dark) in whole.iter().zip(dark) {
        assert!((0.5..4.0).contains(whole), "{whole}");
        assert!(dark > 1.2 * whole, "{dark} {whole}");
    }
}
