//! The report's stable names and the page's promises, on a model made without the pipeline.

// A test's helpers state their expectations by panicking, as the test does.
#![allow(clippy::unwrap_used)]
// Stages may add facts without a change here.
#![allow(clippy::needless_update)]

use base64::Engine;
use nalgebra::Matrix3;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::Monitor;
use ventriform::image::grid::Volume;
use ventriform::image::volume::describe;
use ventriform::mesh::{TriMesh, shapes};
use ventriform::results::report::{
    Closeness, FileFacts, MeasureParameters, ModelReport, ReportInput, StartSummary, measure,
    model_page, object,
};
use ventriform::surface::Surface;
use ventriform::surface::optimise::{
    FitnessForm, FitnessSummary, OptimiseFacts, OptimiseParameters, Optimised, Reference,
};
use ventriform::surface::retile::{RetileFacts, Tiled};

const HOSTILE_TEXT: &str = "</script><img src=x onerror=alert(1)>\"'&";

fn surface() -> Surface {
    let mut surface = Surface::exact(shapes::cup(80.0, 32.0, 10.0, 48), 2.0);
    surface.facts.iso_value = 0.47;
    surface.facts.warnings = vec![format!("A warning {HOSTILE_TEXT}")];
    surface
}

fn fitness(normalised: f64) -> FitnessSummary {
    FitnessSummary {
        normalised,
        ..FitnessSummary::default()
    }
}

fn volume() -> Volume {
    Volume {
        shape: [2; 3],
        voxels: vec![1.0; 8],
        frame: VoxelToPatient::new(Matrix3::identity(), Vec3::zeros()).unwrap(),
        integral: true,
    }
}

/// The report on `model`, as if it had come out of the pipeline.
fn report(model: &TriMesh) -> ModelReport {
    let surface = surface();
    let reference = Reference::new(&surface);
    let measures = measure(
        model,
        &reference,
        &MeasureParameters::default(),
        &Monitor::silent(),
    )
    .unwrap();
    let tiled = Tiled {
        mesh: model.clone(),
        sizing: vec![1.0; model.vertices.len()],
        facts: RetileFacts::default(),
    };
    let optimised = Optimised {
        mesh: model.clone(),
        fitted_mesh: model.clone(),
        retiled: fitness(0.5),
        fitted: fitness(0.6),
        optimised: fitness(0.625),
        lengths: reference.lengths(model.triangles.len()),
        facts: OptimiseFacts::default(),
    };
    ModelReport::new(ReportInput {
        input: FileFacts {
            data_type: HOSTILE_TEXT.to_owned(),
            ..FileFacts::from_facts(&describe(&volume()).unwrap())
        },
        parameters: object(&json!({ "points": model.vertices.len(), "seed": 1 })),
        surface: &surface,
        tiled: &tiled,
        optimised: &optimised,
        optimise_parameters: &OptimiseParameters {
            fitness: FitnessForm::Normalised,
            ..OptimiseParameters::default()
        },
        starts: vec![StartSummary::new(&tiled, &measures)],
        measures,
        timings_ms: vec![("surface".to_owned(), 12.0), ("retile".to_owned(), 30.5)],
    })
}

/// Distances of `model` from the surface.
fn closeness(model: &TriMesh) -> Closeness {
    Closeness::new(model, &surface().mesh, &Monitor::silent()).unwrap()
}

fn model() -> TriMesh {
    shapes::cup(80.0, 32.0, 10.0, 12)
}

#[test]
fn the_names_that_others_rely_on_are_there() {
    let model = model();
    let value = serde_json::to_value(report(&model)).unwrap();
    let at = |path: &str| {
        let pointer = format!("/{}", path.replace('.', "/"));
        value
            .pointer(&pointer)
            .unwrap_or_else(|| panic!("no {path}"))
    };
    assert_eq!(at("surface.iso_value"), 0.47);
    assert_eq!(at("surface.euler_characteristic"), 2);
    assert_eq!(at("mesh.vertices"), model.vertices.len());
    assert_eq!(at("mesh.euler_characteristic"), 2);
    assert_eq!(at("mesh.self_intersections"), 0);
    assert_eq!(at("fitness.retiled"), 0.5);
    assert_eq!(at("fitness.optimised"), 0.625);
    assert_eq!(at("fitness.gain_percent"), 25.0);
    assert_eq!(
        at("timings_ms"),
        &json!({ "surface": 12.0, "retile": 30.5, "total": 42.5 })
    );
    assert_eq!(at("software.name"), "ventriform");
    assert_eq!(at("parameters.points"), model.vertices.len());
    for path in [
        "shape.radius_ratio.mean",
        "shape.min_angle_deg.min",
        "shape.valence.counts.6",
        "shape.edge_length_mm.cv",
        "smoothness.dihedral_deg.mean",
        "distance.mean_mm",
        "distance.rms_mm",
        "distance.hausdorff_mm",
        "distance.volume_error_percent",
        "histograms.radius_ratio.optimised",
    ] {
        assert!(!at(path).is_null(), "{path} is null");
    }
}

#[test]
fn broken_promises_are_reported() {
    let sound = report(&model());
    assert!(sound.is_sound());
    let mut open = model();
    open.triangles.pop();
    let open = report(&open);
    assert!(!open.is_sound());
    assert!(
        open.warnings
            .iter()
            .any(|w| w.contains("not a closed manifold"))
    );

    // A vertex of the outer wall drawn through the inner one.
    let mut crossed = model();
    let far = (0..crossed.vertices.len())
        .max_by(|&a, &b| crossed.vertices[a].x.total_cmp(&crossed.vertices[b].x))
        .unwrap();
    crossed.vertices[far].x = 0.0;
    let crossed = report(&crossed);
    assert!(crossed.mesh.self_intersections > 0 && !crossed.is_sound());
    let page = model_page(&crossed, &model(), None, None);
    assert!(page.contains("promises are broken"));
}

#[test]
fn the_page_fetches_nothing_and_lets_no_text_become_markup() {
    let model = model();
    let page = model_page(&report(&model), &model, Some(&closeness(&model)), None);
    // Names of markup languages are no addresses to fetch.
    let page = page.replace("http://www.w3.org/", "");
    for outside in ["http:", "https:", "src=\"/", "url(h", "@import", "<link"] {
        assert!(!page.contains(outside), "{outside}");
    }
    assert!(!page.contains("<img src=x"));
    assert!(page.contains("&lt;/script&gt;&lt;img"));
    for view in ["anterior", "left lateral", "superior"] {
        assert_eq!(
            page.matches(&format!(", {view} view\"")).count(),
            2,
            "{view}"
        );
    }
}

#[test]
fn the_policy_allows_the_pages_own_style_and_script_alone() {
    let model = model();
    let page = model_page(&report(&model), &model, None, None);
    let policy = ventriform::image::draw::document::content_security_policy(true);
    assert!(page.contains(&policy) && policy.starts_with("default-src 'none'"));
    let mut hashed = 0;
    for kind in ["style", "script"] {
        for part in page.split(&format!("<{kind}>")).skip(1) {
            let text = part.split(&format!("</{kind}>")).next().unwrap();
            let digest = Sha256::digest(text.as_bytes());
            let hash = base64::engine::general_purpose::STANDARD.encode(digest);
            assert!(policy.contains(&format!("'sha256-{hash}'")));
            hashed += 1;
        }
    }
    // The style of pages, that of what the script draws, and the script.
    assert_eq!(hashed, 3);
    // Neither inline handlers nor style attributes would run under it.
    assert!(!page.contains(" style=\"") && !page.contains(" onclick="));
}

#[test]
fn the_script_is_given_the_model_and_its_distances() {
    let model = model();
    let page = model_page(&report(&model), &model, Some(&closeness(&model)), None);
    let open = "<script type=\"application/json\" id=\"data\">";
    let from = page.find(open).unwrap() + open.len();
    let data = &page[from..from + page[from..].find("</script>").unwrap()];
    let data: Value = serde_json::from_str(data).unwrap();
    let mesh = &data["mesh"];
    assert_eq!(
        mesh["vertices"].as_array().unwrap().len(),
        3 * model.vertices.len()
    );
    let triangles: Vec<u32> = serde_json::from_value(mesh["triangles"].clone()).unwrap();
    assert_eq!(triangles.as_chunks::<3>().0, model.triangles);
    let distances = data["distance"]["distances_mm"].as_array().unwrap();
    assert_eq!(distances.len(), model.triangles.len());
    assert!(page.contains("<div id=\"viewer\" hidden></div>"));
}

#[test]
fn measures_do_not_depend_on_the_number_of_threads() {
    let model = model();
    let with_threads = |n| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(n)
            .build()
            .unwrap();
        pool.install(|| {
            let report = report(&model);
            let page = model_page(&report, &model, Some(&closeness(&model)), None);
            (serde_json::to_string(&report).unwrap(), page)
        })
    };
    assert_eq!(with_threads(1), with_threads(5));
}

#[test]
fn a_shifted_model_is_measured_the_same() {
    let shift = Vec3::new(-250.0, 120.0, 900.0);
    let mut surface = surface();
    let near = measure(
        &model(),
        &Reference::new(&surface),
        &MeasureParameters::default(),
        &Monitor::silent(),
    )
    .unwrap();
    let mut moved = model();
    moved.vertices.iter_mut().for_each(|v| *v += shift);
    surface.mesh.vertices.iter_mut().for_each(|v| *v += shift);
    let far = measure(
        &moved,
        &Reference::new(&surface),
        &MeasureParameters::default(),
        &Monitor::silent(),
    )
    .unwrap();
    for (a, b) in [
        (near.distance.mean_mm, far.distance.mean_mm),
        (near.distance.hausdorff_mm, far.distance.hausdorff_mm),
        (near.mesh.volume_ml, far.mesh.volume_ml),
        (near.shape.radius_ratio.min, far.shape.radius_ratio.min),
    ] {
        assert!((a / b - 1.0).abs() < 1e-3, "{a} {b}");
    }
}
