//! All stages from a file to a model, on simulated scans.

#![allow(clippy::unwrap_used)] // A test states its expectations by panicking.

use std::sync::OnceLock;
use ventriform::export::{self, Format};
use ventriform::mesh::{intersections, topology};
use ventriform::parameters::ModelParameters;
use ventriform::pipeline::{self, Model, PipelineError};
use ventriform::progress::{CancelToken, Monitor, Observer, Stage};
use ventriform::volume::nifti::{self, StoredType};
use ventriform::volume::phantom::{PhantomParameters, phantom};
use ventriform::volume::{ReadLimits, VolumeFile};
use ventriform::work::problems::advice;

/// A simulated scan, small enough for many runs.
fn scan() -> &'static [u8] {
    static SCAN: OnceLock<Vec<u8>> = OnceLock::new();
    SCAN.get_or_init(|| {
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
    assert!(advice(&high).contains("between"), "{}", advice(&high));
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
