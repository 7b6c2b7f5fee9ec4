//! Readers' profiles: learnt from masks drawn by known distances, and applied to other scans.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use tempfile::TempDir;
use ventriform::deform::WallEdge;
use ventriform::evaluate::calibration::{Calibration, calibrate, cases_of};
use ventriform::evaluate::sample::Sample;
use ventriform::export::Format;
use ventriform::grid::Volume;
use ventriform::grid::voxelise::voxelise;
use ventriform::model::Organ;
use ventriform::parameters::FitParameters;
use ventriform::progress::Monitor;
use ventriform::reader::{LearntOn, ReaderOffset, ReaderOffsets, ReaderProfile, drawn, measure};
use ventriform::report::{SegmentationReport, object};
use ventriform::segmentation::{
    NamedReader, SegmentationError, SegmentationOrder, SegmentedVolume, from_files,
};
use ventriform::volume::nifti::{self, StoredType};
use ventriform::volume::phantom::{PhantomParameters, phantom};
use ventriform::volume::{ReadLimits, VolumeFile};

fn write(path: &Path, volume: &Volume, stored: StoredType) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, nifti::write(volume, stored, true).unwrap()).unwrap();
}

fn scan(path: &Path, seed: u64) {
    let parameters = PhantomParameters {
        shape: [64; 3],
        spacing_mm: [4.0; 3],
        seed,
        ..PhantomParameters::default()
    };
    let made = phantom(&parameters, &Monitor::silent()).unwrap();
    write(path, &made.volume, StoredType::Int16);
}

fn profile(offsets: [f64; 3]) -> ReaderProfile {
    ReaderProfile {
        edge: WallEdge::Apparent,
        offsets: offsets.map(|value| ReaderOffset {
            value,
            mean: value,
            spread: 0.0,
        }),
        learnt_on: vec![LearntOn {
            scan: "0".repeat(64),
            mask: "1".repeat(64),
        }],
    }
}

fn segmented(
    scan: &Path,
    profile: Option<ReaderProfile>,
    parameters: &FitParameters,
) -> Result<SegmentedVolume, SegmentationError> {
    let order = SegmentationOrder {
        volume: &[VolumeFile::at(scan)],
        expert: None,
        auto: true,
        models: Vec::new(),
        reader: profile.map(|profile| NamedReader {
            name: "one".into(),
            profile,
        }),
        normals: None,
        parameters,
    };
    from_files(&order, &ReadLimits::default(), &Monitor::silent())
}

/// Scans of these seeds and the masks of a reader who draws by `offsets` on top of the fitted wall.
fn cohort(seeds: &[u64], offsets: &ReaderOffsets) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for seed in seeds {
        let case = folder.path().join(format!("case{seed}"));
        let path = case.join("spect.nii.gz");
        scan(&path, *seed);
        let made = segmented(&path, None, &FitParameters::default()).unwrap();
        let volume = &made.reading.volume;
        let (fit, share) = drawn(made.segmentation.fit.model, offsets, &Monitor::silent()).unwrap();
        assert_eq!(share, 1.0);
        let mask = voxelise(&fit.mesh, volume.shape, &volume.frame);
        let mask = Volume {
            voxels: mask
                .voxels
                .iter()
                .map(|v| f32::from(u8::from(*v)))
                .collect(),
            ..volume.clone()
        };
        write(&case.join("lv_expert_img.nii.gz"), &mask, StoredType::Uint8);
    }
    folder
}

fn calibrated(folder: &Path) -> Calibration {
    let cases = cases_of(folder, "lv_expert_img").unwrap();
    calibrate(&cases, &FitParameters::default(), &|_| ()).unwrap()
}

#[test]
fn calibration_recovers_the_distances_that_masks_were_drawn_by() {
    let known = ReaderOffsets {
        endocardium: 1.2,
        epicardium: -1.2,
        rim: 4.0,
    };
    let folder = cohort(&[1, 2, 3, 4], &known);
    let made = calibrated(folder.path());
    assert_eq!(made.problems, []);
    let tolerance = [0.25, 0.25, 0.8];
    for ((found, known), tolerance) in made
        .profile
        .offsets
        .iter()
        .zip(known.to_array())
        .zip(tolerance)
    {
        assert!((found.mean - known).abs() < tolerance, "{:?}", made.profile);
        // Four masks are believed, but not wholly.
        assert!(found.value.abs() < found.mean.abs(), "{found:?}");
    }
    assert_eq!(made.profile.masks(), 4);
    for row in &made.rows {
        let held_out = row.held_out.unwrap();
        assert!(held_out.jaccard > row.without.jaccard, "{row:?}");
        assert!(held_out.contour < row.without.contour, "{row:?}");
        let off = |ml: f64| (ml - row.reader_ml).abs();
        assert!(off(held_out.wall_ml) < off(row.without.wall_ml), "{row:?}");
    }
    let gain = made.gain(Sample::HeldOut).unwrap();
    assert!(gain.mean > 0.02 && gain.signs == [4, 0], "{gain:?}");
    // The profile names no case, and is the same whatever the folders are called.
    let text = made.profile.to_json();
    assert!(
        !text.contains("case") && !text.contains("lv_expert"),
        "{text}"
    );
    let other = tempfile::tempdir().unwrap();
    for (from, to) in [
        ("case1", "z"),
        ("case2", "y"),
        ("case3", "x"),
        ("case4", "w"),
    ] {
        std::fs::rename(folder.path().join(from), other.path().join(to)).unwrap();
    }
    assert_eq!(calibrated(other.path()).profile, made.profile);
}

#[test]
fn a_profile_learnt_on_one_mask_helps_another_of_that_reader() {
    let known = ReaderOffsets {
        endocardium: -2.5,
        epicardium: 2.5,
        rim: 0.0,
    };
    let made = calibrated(cohort(&[5, 6], &known).path());
    for row in &made.rows {
        assert!(
            row.held_out.unwrap().jaccard > row.without.jaccard,
            "{row:?}"
        );
    }
}

#[test]
fn a_profile_moves_the_wall_by_its_millimetres_and_a_profile_of_zeros_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.nii.gz");
    scan(&path, 7);
    let defaults = FitParameters::default();
    let without = segmented(&path, None, &defaults).unwrap();
    let quiet = Monitor::silent();
    let files = |made: &SegmentedVolume| made.files(&[Format::Stl], None, &quiet).unwrap();
    let zeros = segmented(&path, Some(profile([0.0; 3])), &defaults).unwrap();
    for (zero, plain) in files(&zeros).iter().zip(files(&without)) {
        assert_eq!(zero.name, plain.name);
        assert!(
            zero.name == "report.json" || zero.bytes == plain.bytes,
            "{}",
            zero.name
        );
    }
    let offsets = [1.5, -0.5, 3.0];
    let made = segmented(&path, Some(profile(offsets)), &defaults).unwrap();
    let frame = &made.reading.volume.frame;
    let fit = &without.segmentation.fit.model;
    let found = measure(
        fit,
        &without.segmentation.mask,
        &made.segmentation.mask,
        frame,
    )
    .unwrap();
    for (found, wanted) in found.to_array().iter().zip(offsets) {
        assert!((found - wanted).abs() < 0.3, "{found} for {wanted}");
    }
    let report = made.report();
    let reader = report.reader.as_ref().unwrap();
    assert_eq!(reader.name, "one");
    assert_eq!(reader.offsets_mm.epicardium, -0.5);
    assert_eq!(reader.share_applied, 1.0);
    let plain = without.report();
    assert_eq!(plain.reader, None);
    // What the image shows does not depend on who draws it.
    let walls = |r: &SegmentationReport| (r.volumes_ml.apparent, r.volumes_ml.anatomical);
    assert_eq!(walls(&report), walls(&plain));
    let drawn = ["reader", "volumes_ml", "wall_thickness_mm", "fit"];
    for (name, value) in object(&report) {
        let same = value == object(&plain)[&name];
        assert!(same || drawn.contains(&name.as_str()), "{name}");
    }
    let page = made.page(&files(&made), None);
    let page = String::from_utf8(page.bytes).unwrap();
    assert!(page.contains("drawn as reader one: endocardium +1.50 mm outward"));
}

#[test]
fn a_profile_of_another_wall_or_organ_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.nii.gz");
    scan(&path, 8);
    let mut anatomical = FitParameters::default();
    anatomical.deform.edge = WallEdge::Anatomical;
    let refused = segmented(&path, Some(profile([1.0; 3])), &anatomical).unwrap_err();
    assert!(matches!(
        refused,
        SegmentationError::ReaderOfOtherWall { .. }
    ));
    let kidney = FitParameters {
        organ: Organ::Kidney,
        ..FitParameters::default()
    };
    let refused = segmented(&path, Some(profile([1.0; 3])), &kidney).unwrap_err();
    assert!(matches!(
        refused,
        SegmentationError::ReaderOfVentricles { .. }
    ));
}
