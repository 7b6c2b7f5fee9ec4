//! All stages from a file to a model, on simulated scans.

#![allow(clippy::unwrap_used)] // A test states its expectations by panicking.

use std::sync::OnceLock;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::{CancelToken, Monitor, Observer, Stage};
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PhantomParameters, phantom};
use ventriform::image::volume::{self, ReadLimits, Volume, VolumeFile};
use ventriform::mesh::{intersections, topology};
use ventriform::parameters::ModelParameters;
use ventriform::results::export::{self, Format};
use ventriform::runs::pipeline::{self, Model, PipelineError};

/// A simulated scan, small enough for many runs.
fn scan() -> &'static [u8] {
    static PACKED_SCAN: OnceLock<Vec<u8>> = OnceLock::new();
    PACKED_SCAN.get_or_init(|| {
        let parameters = PhantomParameters {
            shape: [72; 3],
            spacing_mm: [4.0; 3],
            ..PhantomParameters::default()
        };
        let made = phantom(&parameters, &Monitor::silent()).unwrap();
        nifti::write(&made.volume, StoredType::Int16, true).unwrap()
    })
}

fn parameters(pairs: &[(&str, &str)]) -> ModelParameters {
    ModelParameters::from_pairs(pairs.iter().copied()).unwrap()
}

fn generate(pairs: &[(&str, &str)]) -> Result<Model, PipelineError> {
    pipeline::generate(
        &[VolumeFile::in_memory("scan.nii.gz", scan())],
        &parameters(pairs),
        &ReadLimits::default(),
        &Monitor::silent(),
    )
}

#[test]
fn every_model_keeps_the_promises() {
    for method in ["refined", "paper"] {
        for points in ["12", "67", "150", "300"] {
            let model = generate(&[("points", points), ("method", method)])
                .unwrap_or_else(|e| panic!("{method} {points}: {e}"));
            let census = topology::check(&model.mesh).expect("a closed manifold");
            assert_eq!(census.vertices.to_string(), points);
            assert_eq!((census.euler_characteristic, census.components), (2, 1));
            assert!(intersections::self_intersections(&model.mesh).is_empty());
            assert!(model.mesh.volume() > 0.0, "faces outward");
            assert!(model.report.is_sound());
            assert!(
                model.report.fitness.optimised >= model.report.fitness.retiled,
                "{method} {points}: the flips lost fitness"
            );
        }
    }
}

#[test]
fn a_model_stands_for_the_volume_of_its_surface() {
    let model = generate(&[("points", "300")]).unwrap();
    let error = model.mesh.volume() / model.reference.volume() - 1.0;
    assert!(error.abs() < 0.0005, "{error}");
    let distance = model.report.distance.mean_mm / model.report.surface.voxel_mm;
    assert!(distance < 0.04, "{distance} voxels");
}

/// Two cups, each with a label that 32-bit floats do not tell from the other's, in a NIfTI file of 32-bit
/// integers with `spacing` mm.
fn atlas(spacing: [f64; 3], labels: [i32; 2]) -> (Vec<u8>, [f64; 2]) {
    let shape = spacing.map(|s| (120.0 / s) as usize);
    let frame = VoxelToPatient::centred(shape, spacing, Vec3::zeros()).unwrap();
    let cup = |p: &Vec3, scale: f64| {
        let within =
            |a: f64, c: f64| p.xy().norm_squared() / (a * a) + p.z * p.z / (c * c) < scale * scale;
        within(30.0, 45.0) && !within(20.0, 35.0) && p.z < 25.0 * scale
    };
    let kind = |p: &Vec3| {
        let second = p - Vec3::new(30.0, 30.0, 0.0);
        match (
            cup(&(p + Vec3::new(20.0, 20.0, 0.0)), 1.0),
            cup(&second, 0.6),
        ) {
            (true, _) => 1.0,
            (_, true) => 2.0,
            _ => 0.0,
        }
    };
    let kinds = Volume::sampled(shape, frame, kind);
    let mut bytes = nifti::write(&kinds, StoredType::Float32, false).unwrap();
    bytes[70..74].copy_from_slice(&[8, 0, 32, 0]);
    bytes.truncate(352);
    let mut millilitres = [0.0; 2];
    for kind in &kinds.voxels {
        let label = match *kind as usize {
            0 => 0,
            kind => {
                millilitres[kind - 1] += spacing.iter().product::<f64>() / 1000.0;
                labels[kind - 1]
            }
        };
        bytes.extend(label.to_le_bytes());
    }
    (bytes, millilitres)
}

/// The model of a mask has the volume of the mask's voxels, whatever their shape, and of a label beyond
/// 2^24 those of no other; the report has both volumes.
#[test]
fn a_model_of_a_label_has_the_volume_of_its_voxels_alone() {
    let labels = [576_073_729, 576_073_732];
    for spacing in [[3.0; 3], [2.0, 2.0, 10.0], [2.0, 10.0, 2.0], [7.0; 3]] {
        let (bytes, millilitres) = atlas(spacing, labels);
        let file = [VolumeFile::in_memory("atlas.nii", bytes)];
        let make = |pairs: &[(&str, &str)]| {
            let (limits, silent) = (ReadLimits::default(), Monitor::silent());
            pipeline::generate(&file, &parameters(pairs), &limits, &silent)
        };
        for (label, wanted) in labels.iter().zip(millilitres) {
            let label = label.to_string();
            let model = make(&[("label", &label), ("points", "400")]).unwrap();
            let found = model.mesh.volume() / 1000.0;
            let facts = &model.report.surface;
            assert_eq!(facts.label.unwrap().to_string(), label);
            assert!((facts.mask_ml.unwrap() / wanted - 1.0).abs() < 1e-6);
            // Also where coarse voxels tear the small cup, and topology control closes it.
            let surface = model.report.surface.volume_ml;
            for (volume, most) in [(surface, 0.01), (found, 0.02)] {
                let off = volume / wanted - 1.0;
                if off.abs() >= most {
                    eprintln!("BAD {spacing:?} {label}: {volume} {wanted}");
                }
            }
            eprintln!(
                "{spacing:?} {label} {surface} {found} {wanted} {facts:?} {:?}",
                model.report.warnings
            );
            let told = model.report.warnings.iter();
            let told = told.filter(|w| w.contains("the mask's voxels have"));
            assert_eq!(told.count(), 0, "{spacing:?} {label}");
        }
        for pairs in [&[][..], &[("label", "576073728")], &[("label", "1")]] {
            let refused = make(pairs).unwrap_err();
            assert_eq!(refused.field(), Some("label"), "{refused}");
            for label in labels {
                assert!(
                    refused.to_string().contains(&label.to_string()),
                    "{refused}"
                );
            }
        }
        let listed = volume::inspect(&file, &ReadLimits::default(), &Monitor::silent()).unwrap();
        let listed = listed.intensity.labels.unwrap();
        let listed: Vec<i64> = listed.iter().map(|l| l.label).collect();
        assert_eq!(listed, labels.map(i64::from));
    }
}

/// A level of one's own does not keep the volume, and the report says so.
#[test]
fn a_model_that_lost_its_masks_volume_says_so() {
    let (bytes, _) = atlas([3.0; 3], [1, 2]);
    let file = [VolumeFile::in_memory("labels.nii", bytes)];
    let pairs = [("label", "1"), ("iso", "absolute:0.8"), ("points", "300")];
    let (limits, silent) = (ReadLimits::default(), Monitor::silent());
    let model = pipeline::generate(&file, &parameters(&pairs), &limits, &silent).unwrap();
    let told = model
        .report
        .warnings
        .iter()
        .find(|w| w.contains("the mask's voxels have"));
    assert!(told.is_some(), "{:?}", model.report.warnings);
}

#[test]
fn the_same_bytes_come_from_any_number_of_threads() {
    for method in ["refined", "paper"] {
        let with_threads = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let model = pool.install(|| generate(&[("method", method), ("seed", "5")]).unwrap());
            let glb = export::encode(Format::Glb, &model.mesh, &model.metadata()).unwrap();
            let json = export::encode(Format::Json, &model.mesh, &model.metadata()).unwrap();
            (glb, json)
        };
        let one = with_threads(1);
        for threads in [2, 3, 16] {
            assert!(
                with_threads(threads) == one,
                "{method} on {threads} threads"
            );
        }
    }
}

#[test]
fn another_seed_gives_another_mesh_of_the_same_surface() {
    let (a, b) = (
        generate(&[("seed", "1")]).unwrap(),
        generate(&[("seed", "2")]).unwrap(),
    );
    assert_ne!(a.mesh, b.mesh);
    assert_eq!(a.reference, b.reference);
}

#[test]
fn adaptive_density_puts_smaller_triangles_where_the_surface_bends() {
    let spread = |adaptive: &str| {
        let everywhere = ("adaptive_from", "0");
        let model = generate(&[("adaptive", adaptive), everywhere, ("points", "300")]).unwrap();
        model.report.shape.area_mm2.cv
    };
    assert!(spread("0.5") > spread("0") + 0.05);
}

#[test]
fn refusals_name_the_field_and_a_way_out() {
    let refused = |pairs: &[(&str, &str)]| generate(pairs).unwrap_err();
    let high = refused(&[("iso", "absolute:1e9")]);
    assert_eq!(high.field(), Some("iso"));
    assert_eq!(refused(&[("label", "3")]).field(), Some("label"));
    let outside = refused(&[("seed_point", "900,1,1")]);
    assert!(outside.to_string().contains("72"), "{outside}");
    assert_eq!(refused(&[("frame", "4")]).field(), Some("frame"));
}

/// Cancels the work as soon as a stage begins.
struct CancelAt(Stage, CancelToken);

impl Observer for CancelAt {
    fn progress(&self, stage: Stage, _: f64) {
        if stage == self.0 {
            self.1.cancel();
        }
    }
}

#[test]
fn every_stage_obeys_the_token() {
    for stage in [
        Stage::Read,
        Stage::Surface,
        Stage::Retile,
        Stage::Optimise,
        Stage::Report,
    ] {
        let token = CancelToken::new();
        let observer = CancelAt(stage, token.clone());
        let outcome = pipeline::generate(
            &[VolumeFile::in_memory("scan.nii.gz", scan())],
            &parameters(&[]),
            &ReadLimits::default(),
            &Monitor::new(&observer, token),
        );
        assert!(outcome.unwrap_err().is_cancelled(), "{stage:?}");
    }
}

#[test]
fn the_report_carries_the_names_that_others_rely_on() {
    let model = generate(&[]).unwrap();
    let report: serde_json::Value = serde_json::from_str(&model.report.to_json_text()).unwrap();
    for path in [
        "/surface/iso_value",
        "/surface/euler_characteristic",
        "/mesh/vertices",
        "/mesh/euler_characteristic",
        "/mesh/self_intersections",
        "/fitness/retiled",
        "/fitness/optimised",
        "/fitness/gain_percent",
        "/timings_ms/total",
        "/parameters/points",
    ] {
        assert!(
            report.pointer(path).is_some_and(|v| v.is_number()),
            "{path}"
        );
    }
}
