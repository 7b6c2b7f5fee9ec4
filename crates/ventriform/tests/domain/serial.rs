//! Scans over the years: one heart that changed, and one that did not.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::Monitor;
use ventriform::heart::comparison::Verdict;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PerfusionDefect, PhantomParameters, phantom};
use ventriform::image::volume::{ReadLimits, Volume, VolumeFile};
use ventriform::parameters::{FitParameters, SerialParameters};
use ventriform::results::report::SerialReport;
use ventriform::runs::segmentation::{self, SegmentationOrder};
use ventriform::runs::serial::{SerialError, SerialHearts, SerialOrder, from_files};

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

/// The scan of a patient who lies so many millimetres elsewhere, turned about the axis from head to feet.
fn moved(volume: &Volume, by: Vec3, degrees: f64) -> Volume {
    let turn = nalgebra::Rotation3::from_axis_angle(&Vec3::z_axis(), degrees.to_radians());
    let origin = volume.frame.to_patient(&Vec3::zeros());
    let frame = VoxelToPatient::new(turn * volume.frame.linear(), turn * origin + by).unwrap();
    Volume {
        frame,
        ..volume.clone()
    }
}

fn file(volume: &Volume) -> Vec<VolumeFile> {
    let bytes = nifti::write(volume, StoredType::Float32, false).unwrap();
    vec![VolumeFile::in_memory("scan.nii", bytes)]
}

fn compared(volumes: &[Volume]) -> Result<SerialHearts, Box<SerialError>> {
    let scans: Vec<Vec<VolumeFile>> = volumes.iter().map(file).collect();
    let order = SerialOrder {
        scans: &scans,
        auto: true,
        models: Vec::new(),
        normals: None,
        parameters: &SerialParameters::default(),
    };
    from_files(&order, &ReadLimits::default(), &Monitor::silent()).map_err(Box::new)
}

fn verdict(report: &SerialReport, figure: &str, later: usize) -> Verdict {
    report.change(figure, 1, later).unwrap().verdict
}

/// The images of a round heart agree whichever way it is turned about its axis; its nodes do not.
#[test]
fn a_heart_that_looks_alike_from_all_sides_is_not_turned() {
    let scans = [7, 8].map(|seed| {
        let parameters = PhantomParameters {
            shape: [40; 3],
            spacing_mm: [6.0; 3],
            pose_spread_deg: 0.0,
            pose_spread_mm: 0.0,
            seed,
            ..PhantomParameters::default()
        };
        phantom(&parameters, &Monitor::silent()).unwrap().volume
    });
    let made = compared(&scans).unwrap();
    let turned = made.scans[1].registration.motion.degrees();
    assert!(turned < 25.0, "{turned}");
    let report = made.report();
    let volumes: Vec<f64> = report
        .scans
        .iter()
        .filter_map(|scan| scan.cavity_ml)
        .collect();
    assert!((volumes[0] / volumes[1] - 1.0).abs() < 0.1, "{volumes:?}");
}

/// The heart lies elsewhere in the second scan; the third has a defect.
#[test]
fn what_changed_is_told_and_what_moved_is_not() {
    let shift = Vec3::new(9.0, -6.0, 4.0);
    let volumes = [scan(1, 0.0), moved(&scan(2, 0.0), shift, 8.0), scan(3, 0.6)];
    let made = compared(&volumes).unwrap();
    let found = &made.scans[1].registration;
    let heart = made.scans[0]
        .heart
        .segmentation()
        .fit
        .model
        .cup
        .unwrap()
        .centre;
    let turn = nalgebra::Rotation3::from_axis_angle(&Vec3::z_axis(), 8.0_f64.to_radians());
    let wrong = found.motion.point(&heart) - (turn * heart + shift);
    assert!(wrong.norm() < 1.5, "{wrong}");
    assert!(
        (found.motion.degrees() - 8.0).abs() < 2.0,
        "{}",
        found.motion.degrees()
    );
    assert!(found.correlation > 0.95, "{}", found.correlation);

    let report = made.report();
    assert_eq!(report.pairs.len(), 3);
    for (figure, later) in [
        ("cavity_ml", 2),
        ("mass_g", 2),
        ("dark_percent", 2),
        ("cavity_ml", 3),
    ] {
        assert_ne!(
            verdict(&report, figure, later),
            Verdict::Yes,
            "{figure} of scan {later}"
        );
    }
    let [still, worse, since] = [0, 1, 2].map(|pair| &report.pairs[pair]);
    assert_eq!(
        (still.worse_verdict, still.better_verdict),
        (Verdict::No, Verdict::No)
    );
    assert_eq!([worse.later, since.earlier, since.later], [3, 2, 3]);
    for pair in [worse, since] {
        assert_eq!(pair.worse_verdict, Verdict::Yes);
        assert!(pair.worse_percent > 8.0, "{}", pair.worse_percent);
        let mean = |in_defect: bool| {
            let own = pair.segments.iter();
            let own = own.filter(|own| LAD_SEGMENTS.contains(&(own.segment as u8)) == in_defect);
            let changes: Vec<f64> = own.filter_map(|own| own.change_points).collect();
            changes.iter().sum::<f64>() / changes.len() as f64
        };
        // Blur takes uptake from the segments beside them, too.
        assert!(
            mean(true) < mean(false) - 3.0,
            "{} {}",
            mean(true),
            mean(false)
        );
        let told = (pair.segments.iter()).filter(|own| own.change_verdict == Some(Verdict::Yes));
        assert!(told.count() >= 3);
    }
    // All stand on one muscle.
    let muscle = |scan: usize| made.scans[scan].heart.muscle_ml();
    for scan in [1, 2] {
        assert!(
            (muscle(scan) / muscle(0) - 1.0).abs() < 0.02,
            "{} {}",
            muscle(scan),
            muscle(0)
        );
    }
    let codes: Vec<&str> = report.flags.iter().map(|flag| flag.code.as_str()).collect();
    assert!(codes.contains(&"dates_not_stated") && codes.contains(&"patient_not_stated"));
    assert!(!codes.contains(&"not_registered") && !codes.contains(&"fitted_alone"));
}

/// An odd scan between two that agree is named.
#[test]
fn the_odd_scan_is_named() {
    let made = compared(&[scan(1, 0.0), scan(2, 0.9), scan(3, 0.0)]).unwrap();
    let odd: Vec<String> = (made.report().flags.into_iter())
        .filter(|flag| flag.code == "odd_scan")
        .map(|flag| flag.reason)
        .collect();
    assert!(odd.len() == 1 && odd[0].starts_with("scan 2"), "{odd:?}");
}

#[test]
fn one_scan_given_twice_and_one_alone_are_refused() {
    let one = scan(1, 0.0);
    let same = moved(&one, Vec3::x(), 0.0);
    let refused = compared(&[one.clone(), scan(2, 0.0), same]).unwrap_err();
    assert!(
        matches!(*refused, SerialError::SameScan { scans: [1, 3], .. }),
        "{refused}"
    );
    let refused = compared(&[one]).unwrap_err();
    assert_eq!(*refused, SerialError::ScanCount { found: 1 });
    let few = ReadLimits {
        voxels: 64 * 64 * 64 + 1,
        ..ReadLimits::default()
    };
    let scans = [file(&scan(1, 0.0)), file(&scan(2, 0.0))];
    let order = SerialOrder {
        scans: &scans,
        auto: true,
        models: Vec::new(),
        normals: None,
        parameters: &SerialParameters::default(),
    };
    let refused = from_files(&order, &few, &Monitor::silent()).unwrap_err();
    assert!(
        matches!(refused, SerialError::TooManyVoxels { .. }),
        "{refused}"
    );
}

/// A mass that is stated is that of the anatomical wall, and leaves the cavity what the wall does not take.
#[test]
fn a_stated_mass_is_met_by_a_segmentation() {
    let volume = file(&scan(1, 0.0));
    let of = |mass_g: Option<f64>| {
        let parameters = FitParameters {
            mass_g,
            ..FitParameters::default()
        };
        let order = SegmentationOrder::of_built_in_hearts(&volume, &parameters);
        let made = segmentation::from_files(&order, &ReadLimits::default(), &Monitor::silent());
        let report = made.unwrap().report();
        let anatomical = report.volumes_ml.anatomical.unwrap();
        (report.mass_g.unwrap(), anatomical.cavity)
    };
    let (usual_g, usual_ml) = of(None);
    let cavities: Vec<f64> = [0.8, 1.25]
        .map(|share| {
            let (found_g, cavity_ml) = of(Some(share * usual_g));
            assert!(
                (found_g / (share * usual_g) - 1.0).abs() < 0.01,
                "{found_g}"
            );
            cavity_ml
        })
        .to_vec();
    assert!(
        cavities[0] > usual_ml && usual_ml > cavities[1],
        "{cavities:?} {usual_ml}"
    );
}
