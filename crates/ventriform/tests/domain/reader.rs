//! Readers' profiles: learnt from masks drawn by known distances, and applied to other scans.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use tempfile::TempDir;
use ventriform::base::progress::{CancelToken, Monitor, Silent};
use ventriform::heart::deform::WallEdge;
use ventriform::heart::model::Organ;
use ventriform::heart::reader::{
    Learnt, LearntOn, ReaderDrawing, ReaderKind, ReaderLevel, ReaderOffset, ReaderOffsets,
    ReaderProfile, WallImage, drawn, measure,
};
use ventriform::image::grid::Volume;
use ventriform::image::grid::voxelise::voxelise;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PerfusionDefect, PhantomParameters, phantom};
use ventriform::image::volume::{ReadLimits, VolumeFile};
use ventriform::mesh::intersections::self_intersections;
use ventriform::mesh::topology::check;
use ventriform::parameters::FitParameters;
use ventriform::results::export::Format;
use ventriform::results::report::{SegmentationReport, object};
use ventriform::runs::evaluate::calibration::{Calibration, CalibrationError, calibrate, cases_of};
use ventriform::runs::evaluate::sample::Sample;
use ventriform::runs::segmentation::{
    NamedReader, SegmentationError, SegmentationOrder, SegmentedVolume, from_files,
};

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
        learnt: Learnt::Edge(offsets.map(|value| ReaderOffset {
            value,
            mean: value,
            spread: 0.0,
        })),
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
    let files = [VolumeFile::at(scan)];
    let order = SegmentationOrder {
        reader: profile.map(|profile| NamedReader {
            name: "one".into(),
            profile,
        }),
        ..SegmentationOrder::of_built_in_hearts(&files, parameters)
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
        let drawing = ReaderDrawing::Edge(*offsets);
        let fit = made.segmentation.fit.model;
        let image = WallImage::about(&fit, volume, 1.0, &Monitor::silent()).unwrap();
        let made = drawn(fit, &drawing, &image, &Monitor::silent()).unwrap();
        assert_eq!(made.share, 1.0);
        let mask = voxelise(
            &made.model.mesh,
            volume.shape,
            &volume.frame,
            &Monitor::silent(),
        )
        .unwrap();
        write_mask(&case, &mask.voxels, volume);
    }
    folder
}

fn write_mask(case: &Path, mask: &[bool], volume: &Volume) {
    let mask = Volume {
        voxels: mask.iter().map(|v| f32::from(u8::from(*v))).collect(),
        ..volume.clone()
    };
    write(&case.join("lv_expert_img.nii.gz"), &mask, StoredType::Uint8);
}

/// Greatest distance from the known wall at which a reader of levels draws, mm.
const LEVEL_READER_REACH_MM: f64 = 8.0;

/// Scans of these seeds and the masks of a reader who sets every voxel near the wall that has `level` of the brightest
/// quarter of the wall, with the reader's own variation from scan to scan and from side to side.
fn level_cohort(seeds: &[u64], level: f64) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for seed in seeds {
        let case = folder.path().join(format!("case{seed}"));
        let parameters = PhantomParameters {
            shape: [64; 3],
            spacing_mm: [4.0; 3],
            seed: *seed,
            ..PhantomParameters::default()
        };
        let made = phantom(&parameters, &Monitor::silent()).unwrap();
        let volume = &made.volume;
        write(&case.join("spect.nii.gz"), volume, StoredType::Int16);
        let [nx, ny, _] = volume.shape;
        let place = |index: usize| [index % nx, index / nx % ny, index / (nx * ny)];
        let wall: Vec<usize> = (0..volume.voxels.len())
            .filter(|index| made.truth.voxels[*index] > 0.5)
            .collect();
        let mut uptake: Vec<f32> = wall.iter().map(|index| volume.voxels[*index]).collect();
        uptake.sort_by(f32::total_cmp);
        let brightest = &uptake[uptake.len() * 3 / 4..];
        let reference = f64::from(brightest.iter().sum::<f32>()) / brightest.len() as f64;
        let reach = (LEVEL_READER_REACH_MM / parameters.spacing_mm[0]) as usize;
        let mut near = vec![false; volume.voxels.len()];
        for index in &wall {
            let [i, j, k] = place(*index);
            for (i, j, k) in (i - reach..=i + reach)
                .flat_map(|i| (j - reach..=j + reach).map(move |j| (i, j)))
                .flat_map(|(i, j)| (k - reach..=k + reach).map(move |k| (i, j, k)))
            {
                near[i + nx * (j + ny * k)] = true;
            }
        }
        let of_scan = level + 0.02 * ((*seed % 3) as f64 - 1.0);
        let drawn: Vec<bool> = (0..volume.voxels.len())
            .map(|index| {
                let [i, j, _] = place(index);
                let own = of_scan + 0.03 * (0.2 * (i + j) as f64).sin();
                near[index] && f64::from(volume.voxels[index]) >= own * reference
            })
            .collect();
        write_mask(&case, &drawn, volume);
    }
    folder
}

#[test]
fn a_reader_who_draws_a_level_is_told_from_one_who_draws_the_edge() {
    for (seeds, level) in [(&[11, 12, 13, 14][..], 0.42), (&[15][..], 0.4)] {
        let made = calibrated(level_cohort(seeds, level).path());
        assert_eq!(made.kind(), ReaderKind::Level, "{:?}", made.mean_jaccards());
        let means = made.mean_jaccards();
        assert!(means.level > means.without + 0.02, "{means:?}");
        assert!(means.level > 0.87, "{means:?}");
        let Learnt::Level(learnt) = made.profile.learnt else {
            panic!("a level");
        };
        // The polar map's reference is that of the fitted wall, the reader's that of the known one.
        assert!((learnt.mean - level).abs() < 0.08, "{learnt:?}");
        let text = made.profile.to_json();
        assert_eq!(ReaderProfile::from_json(text.as_bytes()), Ok(made.profile));
    }
}

/// A level leaves everything as it is but the wall that is drawn, and dark wall keeps its fitted edge.
#[test]
fn a_level_draws_mask_and_mesh_alike_and_keeps_infarcts() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.nii.gz");
    let parameters = PhantomParameters {
        shape: [64; 3],
        spacing_mm: [4.0; 3],
        seed: 21,
        defects: [10, 11, 16]
            .map(|segment| PerfusionDefect {
                segment,
                severity: 0.9,
            })
            .into(),
        ..PhantomParameters::default()
    };
    let known = phantom(&parameters, &Monitor::silent()).unwrap();
    write(&path, &known.volume, StoredType::Int16);
    let defaults = FitParameters::default();
    let plain = segmented(&path, None, &defaults).unwrap();
    let by_level = ReaderProfile {
        learnt: Learnt::Level(ReaderLevel {
            value: 0.5,
            mean: 0.5,
            spread: 0.0,
        }),
        ..profile([0.0; 3])
    };
    let made = segmented(&path, Some(by_level), &defaults).unwrap();
    let [report, without] = [&made, &plain].map(SegmentedVolume::report);
    let reader = report.reader.as_ref().unwrap();
    assert_eq!((reader.kind.as_str(), reader.level), ("level", Some(0.5)));
    assert_eq!(reader.offsets_mm, None);
    assert!(
        (0.95..=1.0).contains(&reader.share_applied),
        "{}",
        reader.share_applied
    );
    assert_eq!(report.volumes_ml.apparent, without.volumes_ml.apparent);
    assert_eq!(report.volumes_ml.anatomical, without.volumes_ml.anatomical);
    let [mesh, fitted] = [&made, &plain].map(|made| &made.segmentation.fit.model.mesh);
    // The same surface in smaller triangles, which intersect nowhere.
    let times = mesh.triangles.len() / fitted.triangles.len();
    assert!([4, 16, 64].contains(&times), "{times}");
    assert_eq!(mesh.triangles.len(), times * fitted.triangles.len());
    assert!(self_intersections(mesh).is_empty());
    let census = check(mesh).unwrap();
    assert_eq!((census.components, census.genus()), (1, 0));
    let uncertainty = made.segmentation.fit.uncertainty(WallEdge::Apparent);
    assert_eq!(uncertainty.map(<[f64]>::len), Some(mesh.vertices.len()));
    let volume = &made.reading.volume;
    let own = voxelise(mesh, volume.shape, &volume.frame, &Monitor::silent()).unwrap();
    assert_eq!(own.voxels, made.segmentation.mask.voxels);
    // Dark wall stays wall: of the known wall as much is in the mask as by the fit.
    let share = |mask: &[bool]| {
        let wall = || (0..mask.len()).filter(|index| known.truth.voxels[*index] > 0.5);
        let map = plain.segmentation.polar.as_ref().unwrap();
        let dark = |index: &usize| f64::from(volume.voxels[*index]) < 0.4 * map.reference;
        let infarct: Vec<usize> = wall().filter(dark).collect();
        (
            infarct.iter().filter(|index| mask[**index]).count(),
            infarct.len(),
        )
    };
    let (drawn, all) = share(&made.segmentation.mask.voxels);
    let (by_fit, _) = share(&plain.segmentation.mask.voxels);
    assert!(
        all > 20 && drawn * 10 >= by_fit * 9,
        "{drawn} {by_fit} of {all}"
    );
    let quiet = Monitor::silent();
    let page = made.page(&made.files(&[Format::Stl], None, &quiet).unwrap(), None);
    let page = String::from_utf8(page.bytes).unwrap();
    assert!(page.contains("drawn as reader one: at 50 % of the wall's brightest uptake"));
}

#[test]
fn a_calibration_that_is_cancelled_blames_no_case() {
    let drawn_by = ReaderOffsets {
        endocardium: -2.5,
        epicardium: 2.5,
        rim: 0.0,
    };
    let folder = cohort(&[5, 6], &drawn_by);
    let cases = cases_of(folder.path(), "lv_expert_img").unwrap();
    let token = CancelToken::new();
    let monitor = Monitor::new(&Silent, token.clone());
    // After the first case, and before the others are judged.
    let ended = calibrate(
        &cases,
        &FitParameters::default(),
        &|_| token.cancel(),
        &monitor,
    );
    assert!(matches!(ended, Err(CalibrationError::Cancelled(_))));
}

fn calibrated(folder: &Path) -> Calibration {
    let cases = cases_of(folder, "lv_expert_img").unwrap();
    calibrate(
        &cases,
        &FitParameters::default(),
        &|_| (),
        &Monitor::silent(),
    )
    .unwrap()
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
    assert_eq!(made.kind(), ReaderKind::Edge, "{:?}", made.mean_jaccards());
    let Learnt::Edge(offsets) = made.profile.learnt else {
        panic!("distances");
    };
    for ((found, known), tolerance) in offsets.iter().zip(known.to_array()).zip(tolerance) {
        assert!((found.mean - known).abs() < tolerance, "{:?}", made.profile);
        // Four masks are believed, but not wholly.
        assert!(found.value.abs() < found.mean.abs(), "{found:?}");
    }
    assert_eq!(made.profile.masks(), 4);
    for row in &made.rows {
        let held_out = row.by_edge.held_out.unwrap();
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
            row.by_edge.held_out.unwrap().jaccard > row.without.jaccard,
            "{row:?}"
        );
    }
}

/// The distance of the mask drawn by a profile from the one without it: endocardium, epicardium, rim, mm.
fn moved_by(without: &SegmentedVolume, made: &SegmentedVolume) -> [f64; 3] {
    let masks = [without, made].map(|made| &made.segmentation.mask);
    let fit = &without.segmentation.fit.model;
    let found = measure(fit, masks[0], masks[1], &made.reading.volume.frame);
    found.unwrap().to_array()
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
    // A rim of few voxels of 4 mm is measured to .6 mm; the mean of several scans is surer.
    let mut moved = vec![moved_by(&without, &made)];
    for seed in [8, 9] {
        scan(&path, seed);
        let drawn = |profile| segmented(&path, profile, &defaults).unwrap();
        moved.push(moved_by(&drawn(None), &drawn(Some(profile(offsets)))));
    }
    for (which, wanted) in offsets.into_iter().enumerate() {
        let each = moved.iter().map(|found| found[which]);
        assert!(
            each.clone().all(|found| (found - wanted).abs() < 0.6),
            "{moved:?}"
        );
        let mean = each.sum::<f64>() / moved.len() as f64;
        assert!(
            (mean - wanted).abs() < 0.3,
            "{mean} for {wanted}: {moved:?}"
        );
    }
    let report = made.report();
    let reader = report.reader.as_ref().unwrap();
    assert_eq!(reader.name, "one");
    assert_eq!(reader.offsets_mm.unwrap().epicardium, -0.5);
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
