//! Extreme volumes through all stages from a file to a model. Each must give either a sound model with
//! exactly the requested number of points or an error that names what to change.

#![allow(clippy::unwrap_used)] // A test states its expectations by panicking.

use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::{ReadLimits, Volume, VolumeError, VolumeFile};
use ventriform::mesh::{intersections, topology};
use ventriform::parameters::ModelParameters;
use ventriform::runs::pipeline::{self, Model, PipelineError};
use ventriform::surface::retile::RetileError;

fn volume(shape: [usize; 3], spacing: [f64; 3], value: impl Fn(Vec3) -> f64) -> Volume {
    let frame = VoxelToPatient::centred(shape, spacing, Vec3::zeros()).unwrap();
    Volume::sampled(shape, frame, |p| value(*p))
}

/// A file of the volume, read, surfaced, re-tiled, optimised and measured.
fn generate(volume: &Volume, pairs: &[(&str, &str)]) -> Result<Model, PipelineError> {
    generate_stored(volume, StoredType::Float32, pairs)
}

fn generate_stored(
    volume: &Volume,
    stored: StoredType,
    pairs: &[(&str, &str)],
) -> Result<Model, PipelineError> {
    let bytes = nifti::write(volume, stored, false).unwrap();
    let parameters = ModelParameters::from_pairs(pairs.iter().copied()).unwrap();
    let outcome = pipeline::generate(
        &[VolumeFile::in_memory("edge.nii", bytes)],
        &parameters,
        &ReadLimits::default(),
        &Monitor::silent(),
    );
    match &outcome {
        Ok(model) => {
            let census = topology::check(&model.mesh).unwrap();
            let surface = topology::check(&model.reference).unwrap();
            assert_eq!(census.vertices, parameters.retile.points);
            assert_eq!(census.euler_characteristic, surface.euler_characteristic);
            assert_eq!(census.components, surface.components);
            assert!(model.mesh.volume() > 0.0);
            assert_eq!(
                intersections::self_intersections(&model.mesh),
                Vec::<[ventriform::mesh::FaceId; 2]>::new()
            );
            let text = model.report.to_json_text();
            assert!(serde_json::from_str::<serde_json::Value>(&text).is_ok());
        }
        Err(error) => {
            assert!(!matches!(error, PipelineError::Unsound { .. }), "{error}");
        }
    }
    outcome
}

/// A model; an error fails the test.
fn model(volume: &Volume, pairs: &[(&str, &str)]) -> Model {
    generate(volume, pairs).unwrap_or_else(|e| panic!("{:?} {pairs:?}: {e}", volume.shape))
}

/// A blunt body that fills most of the box; its values fall by 1 over its radius.
fn filling(shape: [usize; 3], spacing: [f64; 3]) -> Volume {
    let half = [0, 1, 2].map(|r| shape[r] as f64 * spacing[r] / 2.0);
    volume(shape, spacing, |p| {
        let powers = [0, 1, 2].map(|r| (p[r] / half[r]).powi(6));
        1.5 - powers.iter().sum::<f64>().powf(1.0 / 6.0)
    })
}

const HALF_LEVEL: (&str, &str) = ("iso", "absolute:0.75");

#[test]
fn any_shape_from_three_to_a_thousand_voxels_an_axis() {
    for shape in [
        [3, 3, 3],
        [4, 3, 5],
        [3, 3, 40],
        [3, 1024, 40],
        [1024, 64, 3],
        [200, 7, 90],
    ] {
        for method in ["refined", "paper"] {
            let body = filling(shape, [2.0; 3]);
            let pairs = [HALF_LEVEL, ("points", "150"), ("method", method)];
            if method == "paper" && shape.contains(&1024) {
                continue; // Takes a minute and tells nothing new.
            }
            // A long plate or rod may take more points to go round it.
            if let Err(error) = generate(&body, &pairs) {
                assert_eq!(error.field(), Some("points"), "{shape:?} {method}: {error}");
                if let PipelineError::Retile(RetileError::TooFewPoints { needed, .. }) = error {
                    let enough = needed.to_string();
                    model(
                        &body,
                        &[HALF_LEVEL, ("points", &enough), ("method", method)],
                    );
                }
            }
        }
    }
}

/// On a rod three voxels thick, the points are ten times as far apart as the rod is thick. No seed
/// changes that.
#[test]
fn a_model_that_cannot_follow_its_surface_says_so() {
    for (shape, coarse, starts) in [([3, 3, 1024], true, 1), ([30, 30, 40], false, 3)] {
        let report = model(&filling(shape, [2.0; 3]), &[HALF_LEVEL, ("points", "67")]).report;
        assert_eq!(report.retile.starts.len(), starts);
        let lost = report.distance.volume_error_percent;
        assert_eq!(lost < -10.0, coarse, "{shape:?} lost {lost} %");
        let said = report
            .warnings
            .iter()
            .any(|w| w.contains("too few to follow"));
        assert_eq!(said, coarse, "{shape:?}: {:?}", report.warnings);
    }
}

#[test]
fn fewer_than_three_voxels_an_axis_are_a_model_or_an_error() {
    for shape in [[1, 1, 1], [2, 2, 2], [1, 30, 30], [2, 40, 9]] {
        let made = generate(&filling(shape, [2.0; 3]), &[HALF_LEVEL]);
        let refused = matches!(
            made,
            Err(PipelineError::Volume(VolumeError::SingleSlice { .. }))
        );
        assert_eq!(refused, shape.contains(&1), "{shape:?}");
    }
}

#[test]
fn voxels_ten_times_longer_than_wide() {
    for spacing in [[1.0, 1.0, 10.0], [10.0, 1.0, 1.0], [0.5, 5.0, 1.0]] {
        let shape = [0, 1, 2].map(|r| (60.0 / spacing[r]) as usize);
        for (method, points) in [("refined", "12"), ("refined", "300"), ("paper", "150")] {
            let pairs = [HALF_LEVEL, ("points", points), ("method", method)];
            let model = model(&filling(shape, spacing), &pairs);
            assert_eq!(model.report.mesh.euler_characteristic, 2);
        }
    }
}

#[test]
fn walls_one_voxel_thin_as_mask_and_as_intensities() {
    let bowl = |p: Vec3| (p.norm() - 20.0).abs() <= 0.5 * 2.0 && p.z < 8.0;
    let mut mask = volume([28; 3], [2.0; 3], |p| f64::from(u8::from(bowl(p))));
    mask.integral = true;
    let soft = volume([28; 3], [2.0; 3], |p| {
        (2.0 - (p.norm() - 20.0).abs()).min(10.0 - p.z).max(0.0)
    });
    for (method, points) in [("refined", "600"), ("paper", "600")] {
        let pairs = [("points", points), ("method", method)];
        for outcome in [
            generate_stored(&mask, StoredType::Uint8, &pairs),
            generate(&soft, &[pairs[0], pairs[1], ("isolate", "largest")]),
        ] {
            if let Err(error) = outcome {
                // A sheet may be too thin for its points, never for its voxels.
                assert_eq!(error.field(), Some("points"), "{error}");
            }
        }
    }
}

#[test]
fn several_components_are_kept_or_dropped_as_asked() {
    let balls = volume([80, 24, 24], [2.0; 3], |p| {
        let ball = |x: f64, r: f64| 1.0 + (r - (p - Vec3::x() * x).norm()) / 10.0;
        ball(-50.0, 20.0).max(ball(0.0, 14.0)).max(ball(45.0, 9.0))
    });
    let pairs = [("iso", "absolute:1"), ("isolate", "none")];
    let one = model(&balls, &pairs);
    assert_eq!(one.report.mesh.components, 1);
    for method in ["refined", "paper"] {
        let three = model(
            &balls,
            &[pairs[0], pairs[1], ("topology", "keep"), ("method", method)],
        );
        assert_eq!(three.report.mesh.components, 3);
    }
    // Three spheres take twelve points, four each; anything less is refused by the parameter.
    let least = generate(
        &balls,
        &[pairs[0], pairs[1], ("topology", "keep"), ("points", "12")],
    );
    if let Err(error) = least {
        assert_eq!(error.field(), Some("points"));
    }
}

#[test]
fn from_twelve_points_to_fifty_thousand() {
    let ball = filling([40; 3], [2.0; 3]);
    for (method, points) in [("refined", "12"), ("paper", "12"), ("refined", "20000")] {
        model(&ball, &[HALF_LEVEL, ("points", points), ("method", method)]);
    }
    for points in ["11", "50001"] {
        let error = ModelParameters::from_pairs([("points", points)]).unwrap_err();
        assert!(
            error.field == "points" && error.fix.contains("50000"),
            "{error}"
        );
    }
}

#[test]
fn missing_and_infinite_voxels_count_as_outside() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut holed = filling([30; 3], [2.0; 3]);
        for n in (0..holed.voxels.len()).step_by(97) {
            holed.voxels[n] = bad;
        }
        let made = model(&holed, &[HALF_LEVEL, ("isolate", "largest")]);
        let warned = |w: &String| w.contains("NaN or infinite");
        assert!(made.report.warnings.iter().any(warned));
        let mut slab = filling([30; 3], [2.0; 3]);
        slab.voxels[..12 * 900].fill(bad);
        model(&slab, &[HALF_LEVEL]);
        let nothing = volume([6; 3], [1.0; 3], |_| f64::from(bad));
        let error = generate(&nothing, &[]).unwrap_err();
        assert!(error.to_string().contains("finite"), "{error}");
    }
}

#[test]
fn an_iso_value_that_many_voxels_have() {
    // Whole numbers, as of counts: every voxel lies on a plateau.
    let mut steps = volume([30; 3], [2.0; 3], |p| {
        (8.0 - p.norm() / 4.0).max(0.0).floor()
    });
    steps.integral = true;
    // Saturated: the whole inside has the largest value there is.
    let saturated = volume([30; 3], [2.0; 3], |p| (30.0 - p.norm()).clamp(0.0, 10.0));
    // A mask cut exactly at its own value.
    let mut mask = volume([30; 3], [2.0; 3], |p| f64::from(u8::from(p.norm() < 19.0)));
    mask.integral = true;
    for (volume, isos) in [
        (&steps, ["absolute:1", "absolute:4", "absolute:7", "auto"]),
        (&saturated, ["absolute:10", "absolute:5", "50%", "auto"]),
        (&mask, ["absolute:1", "absolute:0.5", "50%", "auto"]),
    ] {
        for iso in isos {
            for (method, topology) in [("refined", "genus0"), ("paper", "keep")] {
                let pairs = [
                    ("iso", iso),
                    ("isolate", "largest"),
                    ("method", method),
                    ("topology", topology),
                ];
                model(volume, &pairs);
            }
        }
    }
    // The plateau is above every other value, and the lowest of all is no level.
    for (volume, iso) in [(&steps, "absolute:9"), (&saturated, "absolute:10.5")] {
        let error = generate(volume, &[("iso", iso)]).unwrap_err();
        assert_eq!(error.field(), Some("iso"));
    }
}

#[test]
fn constant_volumes_are_refused() {
    for value in [0.0, -3.5, 1e30] {
        let error = generate(&volume([9; 3], [1.0; 3], |_| value), &[]).unwrap_err();
        assert!(error.to_string().contains("every voxel"), "{error}");
    }
}

#[test]
fn an_object_that_touches_every_border_is_closed_there() {
    // All inside but for one corner voxel; everything inside; a ball beyond the box.
    let mut full = volume([12, 9, 15], [2.0; 3], |_| 5.0);
    full.voxels[0] = 1.0;
    let mut corner = volume([12; 3], [2.0; 3], |p| 100.0 + p.x + 2.0 * p.y);
    corner.voxels[0] = 0.0;
    let beyond = volume([20; 3], [2.0; 3], |p| 40.0 - p.norm());
    for (volume, iso) in [
        (&full, "absolute:3"),
        (&full, "auto"),
        (&corner, "absolute:50"),
        (&beyond, "absolute:12"),
        (&beyond, "absolute:8"),
    ] {
        for method in ["refined", "paper"] {
            let pairs = [("iso", iso), ("isolate", "largest"), ("method", method)];
            let made = model(volume, &pairs);
            assert!(made.report.warnings.iter().any(|w| w.contains("border")));
        }
    }
}
