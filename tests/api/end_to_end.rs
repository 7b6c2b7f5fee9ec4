//! The real computation in the real program, from file to mesh.

use crate::helpers::{Service, heart, problem, scan, text};
use reqwest::Response;
use reqwest::multipart::{Form, Part};
use serde_json::Value;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::image::volume::Volume;
use ventriform::image::volume::nifti::{self, StoredType};

#[tokio::test]
async fn a_scan_becomes_a_closed_mesh_of_exactly_the_points_asked_for() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let answer = service
        .post("/v1/models?points=110&seed=2")
        .header("prefer", super::helpers::UNTIL_DONE)
        .header("accept", "application/json")
        .body(scan())
        .send()
        .await
        .unwrap();
    assert_eq!(answer.status(), 200);
    let model = answer.headers()["location"].to_str().unwrap().to_owned();
    let mesh: Value = answer.json().await.unwrap();
    assert_eq!(mesh["vertices"].as_array().unwrap().len(), 110);
    assert_eq!(mesh["triangles"].as_array().unwrap().len(), 2 * 110 - 4);
    let report = service
        .get(&format!("{model}/report"))
        .send()
        .await
        .unwrap();
    let report: Value = report.json().await.unwrap();
    assert_eq!(report["mesh"]["vertices"], 110);
    assert_eq!(report["mesh"]["euler_characteristic"], 2);
    assert!(report["fitness"]["gain_percent"].as_f64().unwrap() > 0.0);
    let facts: Value = service
        .get("/v1/volumes")
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert_eq!(facts["volumes"][0]["format"], "NIfTI-1");
    let preview = text(&facts["volumes"][0]["links"]["preview"]);
    let preview = service
        .get(&preview)
        .send()
        .await
        .unwrap()
        .bytes()
        .await
        .unwrap();
    assert!(preview.starts_with(b"\x89PNG"));

    // The page is made of the model's files; the volume may have been deleted.
    let page = async || {
        let page = service
            .get(&format!("{model}/report.html"))
            .send()
            .await
            .unwrap();
        assert_eq!(page.status(), 200);
        page.text().await.unwrap()
    };
    let before = page().await;
    assert!(before.contains("every promise") && before.contains("How close the model is"));
    let volume = text(&facts["volumes"][0]["links"]["self"]);
    let erased = service.delete(&volume).send().await.unwrap();
    assert_eq!(erased.status(), 204);
    assert_eq!(page().await, before);
}

#[tokio::test]
async fn errors_name_the_problem_with_a_file_or_a_parameter() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let scan = scan();
    let post = |path: &str, body: Vec<u8>| {
        service
            .post(path)
            .header("prefer", super::helpers::UNTIL_DONE)
            .body(body)
            .send()
    };
    let cut = post("/v1/models", scan[..scan.len() / 2].to_vec())
        .await
        .unwrap();
    assert_eq!(cut.status(), 422);
    let text_file = post("/v1/models", b"not a volume at all".to_vec())
        .await
        .unwrap();
    problem(text_file, 422, "unrecognised-format").await;
    let beyond = post("/v1/models?iso=absolute:1e9", scan.clone())
        .await
        .unwrap();
    let body = problem(beyond, 422, "no-surface").await;
    assert_eq!(body["field"], "iso");
    assert!(body["fix"].is_string());
}

/// Uploads are streamed to disk, so the memory of the service does not grow with their size.
#[cfg(target_os = "linux")]
#[tokio::test]
async fn uploads_are_not_held_in_memory() {
    const BYTES_PER_MIB: usize = 1 << 20;
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    service.get("/healthz").send().await.unwrap();
    let before = service.peak_memory_kib();
    let pieces =
        futures::stream::iter((0..256).map(|_| Ok::<_, std::io::Error>(vec![1u8; BYTES_PER_MIB])));
    let body = reqwest::Body::wrap_stream(pieces);
    let answer = service.post("/v1/volumes").body(body).send().await.unwrap();
    assert_eq!(answer.status(), 422);
    let grown = service.peak_memory_kib() - before;
    assert!(grown < 32 << 10, "{grown} KiB for 256 MiB");
}

/// A cube of voxels around `centre` as a `.nii` file; `value` gives each voxel by its position in
/// millimetres.
fn cube(voxels: usize, spacing: f64, centre: Vec3, value: impl Fn(&Vec3) -> f32) -> Vec<u8> {
    let shape = [voxels; 3];
    let frame = VoxelToPatient::centred(shape, [spacing; 3], centre).unwrap();
    let place = |v: usize| {
        let index = [v % voxels, v / voxels % voxels, v / (voxels * voxels)];
        frame.to_patient(&Vec3::from(index.map(|x| x as f64)))
    };
    let volume = Volume {
        voxels: (0..voxels.pow(3)).map(|v| value(&place(v))).collect(),
        shape,
        integral: true,
        frame,
    };
    nifti::write(&volume, StoredType::Uint8, false).unwrap()
}

fn ball(p: &Vec3) -> f32 {
    if p.norm() < 40.0 { 100.0 } else { 5.0 }
}

struct Segmenter(Service);

impl Segmenter {
    /// Sends a scan, optionally with an expert's mask, and waits for the report.
    async fn report(&self, query: &str, scan: Vec<u8>, expert: Option<Vec<u8>>) -> Response {
        let part = |bytes: Vec<u8>| Part::bytes(bytes).file_name("volume.nii.gz");
        let mut form = Form::new().part("volume", part(scan));
        if let Some(expert) = expert {
            form = form.part("expert", part(expert));
        }
        self.0
            .post(&format!("/v1/segmentations?{query}"))
            .header("prefer", super::helpers::UNTIL_DONE)
            .header("accept", "application/json")
            .multipart(form)
            .send()
            .await
            .unwrap()
    }

    async fn json(&self, path: &str) -> Value {
        let answer = self.0.get(path).send().await.unwrap();
        assert_eq!(answer.status(), 200, "{path}");
        answer.json().await.unwrap()
    }
}

#[tokio::test]
async fn a_scan_is_segmented_and_measured_against_an_expert() {
    let data = tempfile::tempdir().unwrap();
    let service = Segmenter(Service::start(data.path(), &[]).await);
    let (scan, truth) = heart();
    let answer = service
        .report("model=auto", scan.clone(), Some(truth.clone()))
        .await;
    assert_eq!(answer.status(), 200);
    let path = answer.headers()["location"].to_str().unwrap().to_owned();
    let report: Value = answer.json().await.unwrap();
    assert!(text(&report["template"]).starts_with("built-in "));
    assert_eq!(report["fit"]["reason"], "converged");
    assert!(report["fit"]["confidence"].as_f64().unwrap() > 0.8);
    // Blur moves the apparent edge outward.
    assert!(report["measures"]["jaccard"].as_f64().unwrap() > 0.75);
    assert!(
        report["measures"]["contour_distance_voxels"]
            .as_f64()
            .unwrap()
            < 0.6
    );
    assert!((140.0..165.0).contains(&report["volumes_ml"]["wall"].as_f64().unwrap()));
    assert!((61.0..75.0).contains(&report["volumes_ml"]["cavity"].as_f64().unwrap()));
    assert!(report["flags"].is_array());
    let nodes = report["fit"]["displacement_mm"].as_array().unwrap();
    assert_eq!(nodes.len(), 150);

    let made = service.json(&path).await;
    assert_eq!(made["summary"]["measures"], report["measures"]);
    let names: Vec<_> = made["files"].as_array().unwrap().iter().collect();
    for file in names {
        let answer = service.0.get(&text(&file["href"])).send().await.unwrap();
        assert_eq!(answer.headers()["content-type"], text(&file["media_type"]));
        let bytes = answer.bytes().await.unwrap();
        assert_eq!(bytes.len() as u64, file["bytes"].as_u64().unwrap());
    }
    let page = service.0.get(&format!("{path}/report"));
    let page = page.header("accept", "text/html").send().await.unwrap();
    let page = page.text().await.unwrap();
    for shown in [
        "Short axis",
        "Uptake of the wall",
        "the expert's mask",
        "The fitted model",
    ] {
        assert!(page.contains(shown), "{shown}");
    }
    assert!(page.matches("data:image/png").count() == 4 && page.contains("data:image/svg+xml"));
    let polar = service.json(&format!("{path}/polar.json")).await;
    assert_eq!(polar["segments"].as_array().unwrap().len(), 17);

    // The mask is on the scan's grid: sent back as the expert's mask, it agrees with itself.
    let mask = service.0.get(&format!("{path}/mask.nii.gz"));
    let mask = mask.send().await.unwrap().bytes().await.unwrap().to_vec();
    let again = service.report("model=auto", scan.clone(), Some(mask)).await;
    let again: Value = again.json().await.unwrap();
    assert_eq!(again["measures"]["jaccard"], 1.0);

    // A model made by a job can be fitted by its id, and as a template by auto.
    let model = service.0.post("/v1/models?points=110").body(scan.clone());
    let model = model
        .header("prefer", super::helpers::UNTIL_DONE)
        .send()
        .await
        .unwrap();
    let model = model.headers()["location"].to_str().unwrap().to_owned();
    let id = model.rsplit('/').next().unwrap();
    let fitted = service
        .report(&format!("model={id}"), scan.clone(), None)
        .await;
    let fitted: Value = fitted.json().await.unwrap();
    assert_eq!(fitted["template"], id);
    assert!(fitted["measures"].is_null());
    let mut own = String::new();
    for (from, query) in [
        (id, "name=own"),
        (path.rsplit('/').next().unwrap(), "name=fitted&library=true"),
    ] {
        let template = service
            .0
            .post(&format!("/v1/templates?model={from}&{query}"))
            .send()
            .await
            .unwrap();
        assert_eq!(template.status(), 201);
        let template: Value = template.json().await.unwrap();
        own = if own.is_empty() {
            text(&template["id"])
        } else {
            own
        };
    }
    // The built-in hearts always, with the flagged template and those that are named.
    for (query, added) in [
        ("template=auto".to_owned(), vec!["fitted"]),
        (
            format!("model=auto,{own},{id}"),
            vec!["own", "mdl_", "fitted"],
        ),
    ] {
        let best = service.report(&query, scan.clone(), None).await;
        let best: Value = best.json().await.unwrap();
        let candidates = best["candidates"].as_array().unwrap();
        let names: Vec<String> = candidates.iter().map(|c| text(&c["template"])).collect();
        assert_eq!(names.len(), 4 + added.len(), "{names:?}");
        for (n, name) in names.iter().enumerate() {
            let begins = if n < 4 { "built-in " } else { added[n - 4] };
            assert!(name.starts_with(begins), "{names:?}");
        }
        let confidence = |c: &&Value| c["confidence"].as_f64().unwrap();
        let greatest = candidates
            .iter()
            .map(|c| confidence(&c))
            .fold(0.0, f64::max);
        let chosen = candidates
            .iter()
            .find(|c| c["template"] == best["template"]);
        assert_eq!(confidence(&chosen.unwrap()), greatest, "{best}");
        assert!(
            text(&best["choice"]).contains("greatest confidence"),
            "{best}"
        );
        assert!(best["evidence"]["template_spread_mm"].is_number());
        let greatest = &best["uncertainty_mm"]["anatomical"]["greatest"];
        assert!(greatest.as_f64().unwrap() > 0.0);
    }
}

#[tokio::test]
async fn a_scan_that_cannot_be_segmented_is_reported_with_the_reason() {
    let data = tempfile::tempdir().unwrap();
    let service = Segmenter(Service::start(data.path(), &[]).await);
    let (scan, _) = heart();
    let solid = cube(48, 4.0, Vec3::zeros(), ball);
    let refused = service.report("", solid.clone(), None).await;
    let refused = problem(refused, 422, "no-heart").await;
    assert_eq!(refused["field"], "center");
    assert!(text(&refused["detail"]).contains("correlates"), "{refused}");
    assert!(text(&refused["job"]).starts_with("job_"));

    let empty = cube(64, 3.2, Vec3::zeros(), |_| 0.0);
    let refused = service.report("", scan.clone(), Some(empty)).await;
    assert_eq!(problem(refused, 422, "empty-mask").await["field"], "expert");
    let far = Vec3::new(900.0, 0.0, 0.0);
    let elsewhere = cube(48, 4.0, far, |p| ball(&(p - far)));
    let refused = service.report("", scan.clone(), Some(elsewhere)).await;
    let refused = problem(refused, 422, "mask-elsewhere").await;
    assert_eq!(refused["field"], "expert");
    // Several structures and another grid: refused by what to send, and taken with it.
    let shells = |p: &Vec3| match p.norm() {
        r if r < 30.0 => 3.0,
        r if r < 45.0 => 2.0,
        _ => 0.0,
    };
    let map = cube(64, 3.2, Vec3::zeros(), shells);
    let refused = service.report("", scan.clone(), Some(map)).await;
    let refused = problem(refused, 422, "label-needed").await;
    assert_eq!(refused["field"], "label");
    assert!(text(&refused["detail"]).contains("2 ("), "{refused}");
    let beside = Vec3::new(1.0, 0.0, 0.0);
    let shifted = cube(64, 3.2, beside, |p| shells(&(p - beside)));
    let refused = service
        .report("label=2", scan.clone(), Some(shifted.clone()))
        .await;
    let refused = problem(refused, 422, "other-grid").await;
    assert_eq!(refused["field"], "resample");
    assert!(text(&refused["detail"]).contains("64 x 64 x 64 voxels of 3.2 x 3.2 x 3.2 mm"));
    let taken = service
        .report("label=2&resample=true", scan.clone(), Some(shifted))
        .await;
    assert_eq!(taken.status(), 200);
    let taken: Value = taken.json().await.unwrap();
    assert_eq!(taken["parameters"]["resample"], true);
    assert!(taken["measures"]["jaccard"].is_number(), "{taken}");
    let blank = cube(32, 4.0, Vec3::zeros(), |_| 7.0);
    let refused = service.report("", blank, None).await;
    assert_eq!(refused.status(), 422);

    let outside = service.report("center=900,0,0", scan.clone(), None).await;
    let outside = problem(outside, 422, "invalid-parameter").await;
    assert_eq!(outside["field"], "center");
    let liver = service.report("organ=liver", scan.clone(), None).await;
    assert_eq!(problem(liver, 422, "no-model").await["field"], "model");

    // A model of another organ is rejected, by its shape and by its declared organ.
    let model = service
        .0
        .post("/v1/models?isolate=none")
        .body(solid.clone());
    let model = model
        .header("prefer", super::helpers::UNTIL_DONE)
        .send()
        .await
        .unwrap();
    assert_eq!(model.status(), 200);
    let model = model.headers()["location"].to_str().unwrap().to_owned();
    let id = model.rsplit('/').next().unwrap();
    let refused = service
        .report(&format!("model={id}"), scan.clone(), None)
        .await;
    let refused = problem(refused, 422, "unsuitable-model").await;
    assert_eq!(refused["field"], "model");
    assert!(text(&refused["fix"]).contains("organ"));
    let template = service
        .0
        .post(&format!("/v1/templates?model={id}&organ=generic"));
    let template: Value = template.send().await.unwrap().json().await.unwrap();
    let other = format!("model={}", text(&template["id"]));
    let refused = service.report(&other, scan, None).await;
    let refused = problem(refused, 422, "unsuitable-model").await;
    assert!(text(&refused["detail"]).contains("generic"), "{refused}");

    // The model of the ball fits the ball; there is no polar map.
    let own = cube(48, 4.0, Vec3::zeros(), |p| ball(p) - 5.0);
    let fitted = service
        .report(&format!("{other}&organ=generic"), solid, Some(own))
        .await;
    assert_eq!(fitted.status(), 200);
    let fitted: Value = fitted.json().await.unwrap();
    let dice = fitted["measures"]["dice"].as_f64().unwrap();
    assert!(dice > 0.9, "{dice}");
    assert!(fitted["polar"].is_null());
}

/// A fit's labels and the parts of its wall, as clients fetch them.
#[tokio::test]
async fn a_fit_has_labels_and_parts_of_its_wall() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let answer = service
        .post("/v1/segmentations?model=auto")
        .header("prefer", super::helpers::UNTIL_DONE)
        .header("accept", "application/json")
        .body(scan())
        .send()
        .await
        .unwrap();
    assert_eq!(answer.status(), 200);
    let fit = answer.headers()["location"].to_str().unwrap().to_owned();
    let get = async |path: &str| {
        let answer = service.get(&format!("{fit}/{path}")).send().await.unwrap();
        assert_eq!(answer.status(), 200, "{path}");
        let media_type = answer.headers()["content-type"]
            .to_str()
            .unwrap()
            .to_owned();
        (media_type, answer.bytes().await.unwrap().to_vec())
    };
    let voxels = |bytes: Vec<u8>| {
        let files = [ventriform::VolumeFile::in_memory("labels", bytes)];
        let (options, limits) = Default::default();
        let quiet = ventriform::Monitor::silent();
        let reading = ventriform::image::volume::read(&files, &options, &limits, &quiet).unwrap();
        reading.volume.voxels
    };
    let (_, mask) = get("mask.nii.gz").await;
    let (_, labels) = get("labels.nii.gz").await;
    let (mask, labels) = (voxels(mask), voxels(labels));
    assert_eq!(mask.len(), labels.len());
    for (wall, label) in mask.iter().zip(&labels) {
        assert_eq!(*wall == 1.0, *label == 1.0);
        assert!([0.0, 1.0, 2.0].contains(label));
    }
    assert!(labels.contains(&2.0));
    let (media_type, segments) = get("labels.seg.nrrd").await;
    assert_eq!(media_type, "application/x-nrrd");
    assert!(segments.starts_with(b"NRRD0004\n"));

    let mesh: Value = serde_json::from_slice(&get("mesh.json").await.1).unwrap();
    let triangles = |mesh: &Value| mesh["triangles"].as_array().unwrap().len();
    let mut sum = 0;
    for (number, part) in [(1, "endocardium"), (2, "epicardium"), (3, "base")] {
        let (_, open) = get(&format!("mesh.json?part={part}")).await;
        let open: Value = serde_json::from_slice(&open).unwrap();
        let stated = mesh["part"].as_array().unwrap().iter();
        assert_eq!(triangles(&open), stated.filter(|n| **n == number).count());
        sum += triangles(&open);
        for name in ["uncertainty_mm", "vertices"] {
            let count = open[name].as_array().unwrap().len();
            assert_eq!(count, open["normals"].as_array().unwrap().len(), "{name}");
        }
        let (media_type, vtk) = get(&format!("mesh_anatomical.vtk?part={part}")).await;
        assert_eq!(media_type, "application/x-vtk");
        assert!(vtk.starts_with(b"# vtk DataFile Version 3.0\n"));
        // The format by Accept is the same file.
        let chosen = service.get(&format!("{fit}/mesh?part={part}"));
        let chosen = chosen
            .header("accept", "application/x-ply")
            .send()
            .await
            .unwrap();
        assert_eq!(chosen.headers()["vary"], "accept");
        let named = get(&format!("mesh.ply?part={part}")).await.1;
        assert_eq!(chosen.bytes().await.unwrap(), named);
    }
    assert_eq!(sum, triangles(&mesh));
    let wrong = service.get(&format!("{fit}/mesh.ply?part=septum"));
    problem(wrong.send().await.unwrap(), 400, "invalid-parameter").await;
    let other = service.get(&format!("{fit}/report.json?part=base"));
    problem(other.send().await.unwrap(), 400, "unknown-parameter").await;
}
