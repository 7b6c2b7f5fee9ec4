//! The polar map of short-axis slices: right where something tells the orientation, and without sides where
//! nothing does.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

use nalgebra::Matrix3;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::Monitor;
use ventriform::heart::deform::DeformParameters;
use ventriform::heart::fit::{Fit, fit};
use ventriform::heart::model::{Organ, Template};
use ventriform::heart::polar::{self, PolarMap, PolarParameters};
use ventriform::image::grid::field::Field;
use ventriform::image::locate::patient_orientation::{OrientationSource, Superior};
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PerfusionDefect, PhantomParameters, phantom};
use ventriform::image::volume::{Phantom, ReadLimits, Volume, VolumeFile};
use ventriform::mesh::shapes;
use ventriform::parameters::{FitParameters, Parameters};
use ventriform::runs::segmentation::{Segmentation, SegmentationOrder, from_files};

/// A patient whose inferior wall takes up little.
fn patient() -> Phantom {
    let defects = [4, 10, 15].map(|segment| PerfusionDefect {
        segment,
        severity: 0.8,
    });
    let parameters = PhantomParameters {
        shape: [64; 3],
        spacing_mm: [4.4; 3],
        defects: defects.to_vec(),
        pose_spread_deg: 0.0,
        ..PhantomParameters::default()
    };
    phantom(&parameters, &Monitor::silent()).unwrap()
}

/// Short-axis slices: 48 voxels of 4.4 mm along each of the three directions of `rows`, which are unit
/// vectors at right angles in the patient.
struct ShortAxis {
    volume: Volume,
    /// Patient to the frame that a header without directions states.
    turn: Matrix3<f64>,
}

impl ShortAxis {
    fn new(patient: &Phantom, apex_first: bool) -> Self {
        let axis = patient.pose.axis;
        let up = (Vec3::z() - axis * axis.z).normalize();
        // Anterior on top: rows run down, towards inferior.
        let third = if apex_first { -axis } else { axis };
        let sides = Matrix3::from_columns(&[-up.cross(&third), -up, third]);
        let middle = (patient.pose.apex + patient.pose.base) / 2.0;
        let (shape, step) = ([48; 3], 4.4);
        let linear = sides * step;
        let half = Vec3::repeat((48.0 - 1.0) / 2.0);
        let frame = VoxelToPatient::new(linear, middle - linear * half).unwrap();
        let image = Field::new(&patient.volume, None, 0.0);
        Self {
            volume: Volume::sampled(shape, frame, |p| image.at(p)),
            turn: sides.transpose(),
        }
    }

    /// The same voxels with a header that states no directions.
    fn plain(&self) -> Volume {
        let frame = VoxelToPatient::centred(self.volume.shape, [4.4; 3], Vec3::zeros()).unwrap();
        Volume {
            frame,
            ..self.volume.clone()
        }
    }
}

fn fitted(volume: &Volume, parameters: &DeformParameters) -> (Fit, PolarMap) {
    let mesh = shapes::cup(75.0, 33.0, 13.0, 14);
    let template = Template::new(mesh, Organ::LeftVentricle, &Monitor::silent()).unwrap();
    let fit = fit(volume, &template, parameters, &Monitor::silent()).unwrap();
    let surfaces = fit.model.surfaces.as_ref().unwrap();
    let (apparent, anatomical) = (&surfaces.apparent.wall, &surfaces.anatomical.wall);
    let source = fit.model.patient_orientation.unwrap().source;
    let map = polar::map(volume, apparent, anatomical, &PolarParameters::default());
    (fit, map.counted_by(source))
}

/// The inferior wall is the dark one of the mid ring.
fn is_right(map: &PolarMap) -> bool {
    let mean = |segment: usize| map.segments[segment - 1].mean_percent.unwrap();
    (7..=12).all(|segment| segment == 10 || mean(segment) > mean(10) + 15.0)
}

#[test]
fn short_axis_slices_are_oriented_by_their_header_or_by_what_is_stated_or_not_at_all() {
    let patient = patient();
    for apex_first in [false, true] {
        let slices = ShortAxis::new(&patient, apex_first);
        let usual = DeformParameters::default();
        let (_, map) = fitted(&slices.volume, &usual);
        assert_eq!(map.orientation, OrientationSource::Frame, "{apex_first}");
        assert!(is_right(&map), "{apex_first}: {:?}", map.segments);

        let plain = slices.plain();
        let (guessed, map) = fitted(&plain, &usual);
        assert_eq!(map.orientation, OrientationSource::Unknown, "{apex_first}");

        let up = slices.turn * Vec3::z();
        let stated = [
            (Superior::Stated(up * 2.0), None),
            (Superior::Body, Some(-Vec3::y())),
        ];
        for (superior, anterior) in stated {
            let parameters = DeformParameters {
                superior,
                anterior,
                ..usual.clone()
            };
            let (fit, map) = fitted(&plain, &parameters);
            assert!(map.orientation.is_stated(), "{apex_first} {superior:?}");
            assert!(
                is_right(&map),
                "{apex_first} {superior:?}: {:?}",
                map.segments
            );
            let change = (fit.model.wall_ml / guessed.model.wall_ml - 1.0).abs();
            assert!(change < 0.1, "{apex_first} {superior:?}: {change}");
        }
    }
}

/// The image in a NIfTI file, the coordinate `mirrored` exchanged, with the codes of its affines set to `code`.
fn file(volume: &Volume, mirrored: Option<usize>, code: u8) -> Vec<VolumeFile> {
    let mut bytes = nifti::write(volume, StoredType::Int16, false).unwrap();
    // qform_code and sform_code; srow_x, srow_y, srow_z.
    bytes[252] = code;
    bytes[254] = code;
    if let Some(axis) = mirrored {
        bytes[252] = 0;
        for at in (280..296).step_by(4) {
            bytes[at + 16 * axis + 3] ^= 0x80;
        }
    }
    vec![VolumeFile::in_memory("scan.nii", bytes)]
}

fn segmented(files: &[VolumeFile], pairs: &[(&str, &str)]) -> Segmentation {
    let parameters = FitParameters::from_pairs(pairs.iter().copied()).unwrap();
    let order = SegmentationOrder::of_built_in_hearts(files, &parameters);
    let made = from_files(&order, &ReadLimits::default(), &Monitor::silent());
    made.unwrap().segmentation
}

fn is_mirrored(made: &Segmentation) -> bool {
    let flags = &made.fit.judgement.flags;
    flags.iter().any(|flag| flag.code() == "mirrored")
}

/// A heart in one of the poses that the phantom has.
fn posed(seed: u64) -> Volume {
    let parameters = PhantomParameters {
        shape: [52; 3],
        spacing_mm: [5.0; 3],
        seed,
        ..PhantomParameters::default()
    };
    phantom(&parameters, &Monitor::silent()).unwrap().volume
}

/// An apex at the back, or well above the base.
#[test]
fn a_heart_with_front_and_back_or_up_and_down_exchanged_is_flagged() {
    for seed in 0..3 {
        let volume = posed(seed);
        let coded = segmented(&file(&volume, None, 1), &[]);
        let axis = coded.fit.model.cup.as_ref().unwrap().axis;
        assert!(axis.y < -0.2, "{axis}");
        assert!(
            is_mirrored(&segmented(&file(&volume, Some(1), 1), &[])),
            "{seed}"
        );
        if axis.z < -0.3 {
            assert!(
                is_mirrored(&segmented(&file(&volume, Some(2), 1), &[])),
                "{seed}"
            );
        }
    }
}

/// Hearts of all poses that the phantom has: told when the file exchanges left and right, and only then.
#[test]
fn a_heart_the_wrong_way_round_is_flagged_and_none_that_is_not() {
    for seed in 0..8 {
        let volume = posed(seed);
        assert!(
            !is_mirrored(&segmented(&file(&volume, None, 1), &[])),
            "{seed}"
        );
        let mirrored = segmented(&file(&volume, Some(0), 1), &[]);
        assert!(is_mirrored(&mirrored), "{seed}");
        // It is told of frames that claim a patient only.
        assert!(
            !is_mirrored(&segmented(&file(&volume, Some(0), 0), &[])),
            "{seed}"
        );
    }
}

/// An apex that points straight to the front tells no side: the liver does.
#[test]
fn below_an_apex_that_points_to_the_front_the_liver_tells_the_side() {
    let parameters = PhantomParameters {
        shape: [52; 3],
        spacing_mm: [5.0; 3],
        apex_direction: [0.03, -0.88, -0.48],
        pose_spread_deg: 0.0,
        gut: 0.1,
        ..PhantomParameters::default()
    };
    let volume = phantom(&parameters, &Monitor::silent()).unwrap().volume;
    let right = segmented(&file(&volume, None, 1), &[]);
    let axis = right.fit.model.cup.as_ref().unwrap().axis;
    assert!(axis.x.abs() < 0.1, "{axis}");
    assert!(!is_mirrored(&right));
    assert!(is_mirrored(&segmented(&file(&volume, Some(0), 1), &[])));
    // It is told of frames that claim a patient only.
    assert!(!is_mirrored(&segmented(&file(&volume, Some(0), 0), &[])));
}

/// Without codes nothing says how the axes lie in the patient: the wall is found, its sides are not known.
#[test]
fn a_file_without_codes_has_no_sides_unless_they_are_stated() {
    let volume = patient().volume;
    let coded = segmented(&file(&volume, None, 1), &[]);
    let bare = file(&volume, None, 0);
    let untold = segmented(&bare, &[]);
    let map = untold.polar.as_ref().unwrap();
    assert_eq!(map.orientation, OrientationSource::Unknown);
    assert!(!is_mirrored(&untold));
    let ml = |made: &Segmentation| made.fit.model.wall_ml;
    assert!((ml(&untold) / ml(&coded) - 1.0).abs() < 0.05);
}
