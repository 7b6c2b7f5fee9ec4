//! `/v1/beats`: with the fake computation, and with the real one in the real program.

use crate::dicom::{JANE, nm, nm_numbered, nm_of};
use crate::gated::{beating, nifti_of};
use crate::helpers::{Service, TestApp, heart, problem, text, volume as words};
use reqwest::header::{ACCEPT, LOCATION};
use reqwest::multipart::{Form, Part};
use reqwest::{Response, StatusCode};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::{self, ReadLimits, ReadOptions, Volume, VolumeFile};
use ventriform::results::export::Format;
use ventriform::runs::gated::{FILE_NAMES, GATE_FILE_PATTERN};

impl TestApp {
    /// Makes a beat; returns it.
    pub async fn beat(&self, said: &str) -> Value {
        let answer = self.post("/v1/beats").body(words(said)).send().await;
        let answer = answer.unwrap();
        assert_eq!(answer.status(), StatusCode::ACCEPTED);
        let job = answer.json().await.unwrap();
        let job = self.until(&job, &["succeeded"]).await;
        assert_eq!(job["kind"], "beat");
        assert!(job["model"].is_null() && job["segmentation"].is_null());
        let beat = self.json(&text(&job["links"]["beat"])).await;
        assert_eq!(beat["id"], job["beat"]);
        assert_eq!(beat["links"]["report"], job["links"]["report"]);
        assert_eq!(beat["links"]["mesh"], job["links"]["mesh"]);
        beat
    }
}

#[tokio::test]
async fn beats_are_listed_downloaded_and_deleted_like_segmentations() {
    let app = TestApp::start().await;
    let made = app.beat("sphere").await;
    let path = text(&made["links"]["self"]);
    let list = app.json("/v1/beats?limit=1").await;
    assert_eq!(list["beats"][0], made);
    let others = app.json("/v1/segmentations").await;
    assert_eq!(others["segmentations"], json!([]));

    let report = app.json(&format!("{path}/report")).await;
    assert_eq!(report, app.json(&format!("{path}/beat.json")).await);
    let get = async |name: &str, accept: &str| {
        let request = app.get(&format!("{path}/{name}")).header(ACCEPT, accept);
        request.send().await.unwrap()
    };
    let stl = get("mesh", "model/stl").await;
    assert_eq!(stl.headers()["content-type"], "model/stl");
    let place = stl.headers()["content-location"].to_str().unwrap();
    assert_eq!(place, format!("{path}/mesh_ed.stl"));
    let labels = get("labels_gate01.nii.gz", "*/*").await;
    assert_eq!(labels.headers()["content-type"], "application/gzip");
    let page = get("report", "text/html").await;
    assert_eq!(page.status(), StatusCode::OK);
    assert_eq!(page.headers()["content-type"], "text/html; charset=utf-8");
    assert_eq!(text(&made["links"]["page"]), format!("{path}/report.html"));
    for name in ["labels_gate09.nii.gz", "mask.dcm"] {
        let refused = problem(get(name, "*/*").await, 404, "not-found").await;
        assert!(text(&refused["fix"]).contains("beat.json"), "{refused}");
    }
    let as_model = format!("/v1/models/{}", text(&made["id"]));
    problem(app.get(&as_model).send().await.unwrap(), 404, "not-found").await;

    let erased = app.delete(&path).send().await.unwrap();
    assert_eq!(erased.status(), StatusCode::NO_CONTENT);
    problem(app.get(&path).send().await.unwrap(), 410, "gone").await;
    problem(get("beat.json", "*/*").await, 410, "gone").await;
    assert_eq!(app.stored(), [text(&made["volume"])]);
    assert_eq!(app.beat("sphere").await["id"], made["id"]);

    // The beat goes with its volume.
    let scan = format!("/v1/volumes/{}?cascade=true", text(&made["volume"]));
    let erased = app.delete(&scan).header("prefer", "return=representation");
    let receipt: Value = erased.send().await.unwrap().json().await.unwrap();
    assert!(
        receipt.to_string().contains(&text(&made["id"])),
        "{receipt}"
    );
    problem(app.get(&path).send().await.unwrap(), 410, "gone").await;
    assert!(app.stored().is_empty());
}

#[tokio::test]
async fn invalid_parameters_of_a_beat_are_rejected_with_the_field() {
    let app = TestApp::start().await;
    for (query, field, hint) in [
        ("mas_g=130", "mas_g", "`mass_g`"),
        ("mass_g=5", "mass_g", "20 to 600"),
        ("rr_ms=inf", "rr_ms", "300 to 2500"),
        ("gated=1", "gated", "true or false"),
        ("gated=true&gated=true", "gated", "true or false"),
        ("frame=1", "frame", "Leave it out"),
        ("organ=left_ventricle", "organ", "Leave it out"),
        ("expert=vol_00", "expert", "Leave it out"),
        ("center=1,2", "center", "3 finite numbers"),
        ("model=lv.json", "model", "mdl_"),
    ] {
        let answer = app
            .post(&format!("/v1/beats?{query}"))
            .body(words("sphere"));
        let body = problem(answer.send().await.unwrap(), 422, "invalid-parameter").await;
        assert_eq!(body["field"], field, "{query}");
        assert!(text(&body["fix"]).contains(hint), "{body}");
    }
    let volume = app.volume("sphere").await;
    let file = |parameters: Value| {
        let order = json!({"kind": "beat", "volume": volume, "parameters": parameters});
        app.post("/v1/jobs").json(&order).send()
    };
    for parameters in [json!({"mass_g": "130"}), json!({"frame": 0})] {
        problem(file(parameters).await.unwrap(), 422, "invalid-parameter").await;
    }
    let missing = file(json!({"model": "tpl_00"})).await.unwrap();
    let missing = problem(missing, 422, "invalid-field").await;
    assert_eq!(missing["field"], "model");
    let filed = file(json!({"mass_g": 130, "axis": [0, 0, -1]}))
        .await
        .unwrap();
    let job: Value = filed.json().await.unwrap();
    assert_eq!(job["parameters"]["mass_g"], 130.0);
    assert_eq!(
        job["parameters"]["gated"], false,
        "defaults are written out"
    );
    assert!(job["parameters"]["organ"].is_null());
    let order = json!({"kind": "beat", "volume": volume, "send": ["mask.dcm"], "to": "pacs"});
    let unsent = app.post("/v1/jobs").json(&order).send().await.unwrap();
    let unsent = problem(unsent, 422, "invalid-field").await;
    let there = "mask_ed.dcm, mask_es.dcm, measurements.dcm";
    assert!(text(&unsent["fix"]).contains(there), "{unsent}");
}

#[tokio::test]
async fn idempotency_keys_cancelling_and_webhooks_work_as_for_segmentations() {
    let app = TestApp::start().await;
    let post = |query: &str| {
        app.post(&format!("/v1/beats?{query}"))
            .header("idempotency-key", "k")
            .body(words("slow"))
            .send()
    };
    let first: Value = post("mass_g=130").await.unwrap().json().await.unwrap();
    let again: Value = post("mass_g=130").await.unwrap().json().await.unwrap();
    assert_eq!(first["id"], again["id"]);
    let other = post("mass_g=131").await.unwrap();
    problem(other, 422, "idempotency-key-reused").await;
    app.until(&first, &["running"]).await;
    let cancelled = app.delete(&text(&first["links"]["self"])).send().await;
    assert_eq!(cancelled.unwrap().status(), StatusCode::ACCEPTED);
    app.until(&first, &["cancelled"]).await;
    app.beat("sphere").await;
    let jobs = app.json("/v1/jobs?kind=beat&state=succeeded").await;
    assert_eq!(jobs["jobs"].as_array().unwrap().len(), 1);
    let metrics = app.metrics().await;
    assert!(metrics.contains("ventriform_jobs_filed_total{kind=\"beat\"} 2"));
    let audit = app.json("/v1/audit").await.to_string();
    assert!(audit.contains("bea_"), "reading and making it is recorded");
}

/// The figures that other programs read of `beat.json`.
fn assert_figures(report: &Value) {
    for name in ["edv_ml", "esv_ml", "sv_ml", "ef_percent"] {
        assert!(
            report[name].as_f64().is_some_and(|x| x > 0.0),
            "{name}: {report}"
        );
    }
    for name in ["end_diastole_gate", "end_systole_gate"] {
        assert!((1..=8).contains(&report[name].as_u64().unwrap()), "{name}");
    }
    let gates = report["gates"].as_array().unwrap();
    assert_eq!(gates.len(), 8);
    for name in ["cavity_ml", "wall_ml", "counts_factor"] {
        assert!(gates.iter().all(|gate| gate[name].is_f64()), "{name}");
    }
    let segments = report["segments"].as_array().unwrap();
    assert_eq!(segments.len(), 17);
    for name in ["motion_mm", "thickening_percent", "phase_degrees"] {
        assert!(
            segments.iter().any(|segment| segment[name].is_f64()),
            "{name}"
        );
    }
    let phase = &report["phase"];
    assert!(phase["sd_degrees"].is_f64() && phase["bandwidth_degrees"].is_f64());
    assert!(phase["reliable"].is_boolean() && report["flags"].is_array());
}

/// Whether `name` is of the form of [`GATE_FILE_PATTERN`], read by hand.
fn is_of_gate(name: &str) -> bool {
    let numbered = |rest: &str| {
        let (number, extension) = rest.split_once('.')?;
        let digits = number.len() == 2 && number.bytes().all(|byte| byte.is_ascii_digit());
        digits.then(|| extension.to_owned())
    };
    let mesh = name.strip_prefix("mesh_gate").and_then(numbered);
    let labels = name.strip_prefix("labels_gate").and_then(numbered);
    let known = |extension: String| {
        let form = GATE_FILE_PATTERN.split(['(', '|', ')']);
        form.into_iter().any(|word| word == extension)
            && Format::from_extension(&extension).is_some()
    };
    mesh.is_some_and(known) || labels.is_some_and(|extension| extension == "nii.gz")
}

#[tokio::test]
async fn a_gated_study_becomes_a_beat_whatever_its_format() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let post = async |query: &str, accept: &str, body: Vec<u8>| -> Response {
        let request = service.post(&format!("/v1/beats{query}"));
        let request = request
            .header("prefer", super::helpers::UNTIL_DONE)
            .header(ACCEPT, accept);
        request.body(body).send().await.unwrap()
    };
    let json = async |path: &str| -> Value {
        let answer = service.get(path).send().await.unwrap();
        assert_eq!(answer.status(), 200, "{path}");
        answer.json().await.unwrap()
    };
    let answer = post("", "*/*", nifti_of(beating(), None)).await;
    assert_eq!(answer.status(), 200, "{}", answer.text().await.unwrap());
    assert_eq!(answer.headers()["content-type"], "application/json");
    let path = answer.headers()[LOCATION].to_str().unwrap().to_owned();
    let report: Value = answer.json().await.unwrap();
    assert_figures(&report);
    assert_eq!(report["end_systole_gate"], 4, "{report}");
    let beat = json(&path).await;
    assert_eq!(beat["summary"]["ef_percent"], report["ef_percent"]);
    assert_eq!(beat["summary"]["gates"], 8);
    assert_eq!(beat["parameters"], report["parameters"]);

    // Every file is documented by its name or its form, and is what it says.
    let mut names = BTreeSet::new();
    for file in beat["files"].as_array().unwrap() {
        let name = text(&file["name"]);
        let mesh = ["mesh_ed.", "mesh_es."]
            .iter()
            .any(|stem| name.starts_with(stem));
        assert!(
            mesh || FILE_NAMES.contains(&&name[..]) || is_of_gate(&name),
            "{name}"
        );
        let answer = service.get(&text(&file["href"])).send().await.unwrap();
        assert_eq!(answer.status(), 200, "{name}");
        assert_eq!(answer.headers()["content-type"], text(&file["media_type"]));
        let length = answer.bytes().await.unwrap().len() as u64;
        assert_eq!(file["bytes"], length, "{name}");
        names.insert(name);
    }
    assert!(names.contains("mesh_gate08.vtp") && names.contains("labels_gate08.nii.gz"));
    let [ed, first] = ["mesh_ed.json", "mesh_gate01.json"].map(|name| format!("{path}/{name}"));
    let (ed, first) = (json(&ed).await, json(&first).await);
    assert_eq!(ed["triangles"], first["triangles"]);

    // Parts of every mesh are open surfaces of fewer triangles.
    let get = async |name: &str| service.get(&format!("{path}/{name}")).send().await.unwrap();
    for mesh in [
        "mesh_ed.json",
        "mesh_es.json",
        "mesh_gate01.json",
        "mesh_gate08.json",
    ] {
        let whole = json(&format!("{path}/{mesh}")).await["triangles"].clone();
        let mut together = 0;
        for part in ["endocardium", "epicardium"] {
            let part = json(&format!("{path}/{mesh}?part={part}")).await["triangles"].clone();
            together += part.as_array().unwrap().len();
        }
        let whole = whole.as_array().unwrap().len();
        assert!(
            (whole / 2..whole).contains(&together),
            "{mesh}: {together} of {whole}"
        );
    }
    let by_accept = get("mesh?part=endocardium").await;
    assert_eq!(by_accept.status(), 200);
    let animation = get("mesh.glb?part=endocardium").await;
    let animation = problem(animation, 400, "unknown-parameter").await;
    assert_eq!(animation["field"], "part");
    problem(
        get("mesh_gate09.json?part=endocardium").await,
        404,
        "not-found",
    )
    .await;

    // The page has every figure and picture in it.
    let page = get("report.html").await.text().await.unwrap();
    assert!(page.contains("Left ventricle: beat") && !page.contains("<script"));
    assert_eq!(page.matches("data:image/svg+xml").count(), 8);
    let ef = report["ef_percent"].as_f64().unwrap();
    assert!(
        page.contains(&format!("<b>{ef:.0} <small>%</small></b>")),
        "EF {ef}"
    );

    // The same study as DICOM has the same figures, up to the rounding of its place.
    let gates: Vec<&Volume> = beating().iter().collect();
    let answer = post("?rr_ms=800", "model/gltf-binary", nm_of(&JANE, &gates)).await;
    assert_eq!(answer.status(), 200);
    assert_eq!(answer.headers()["content-type"], "model/gltf-binary");
    let of_dicom = answer.headers()[LOCATION].to_str().unwrap().to_owned();
    assert!(answer.bytes().await.unwrap().starts_with(b"glTF"));
    let of_dicom = json(&format!("{of_dicom}/report")).await;
    for name in ["edv_ml", "esv_ml", "ef_percent"] {
        let [one, other] = [&report, &of_dicom].map(|report| report[name].as_f64().unwrap());
        assert!((one - other).abs() < 0.1, "{name}: {one} and {other}");
    }
    assert_eq!(of_dicom["rr_ms"], 800.0);

    // A correction of the axis refits all gates of a stored volume, which may be said to be gated.
    let ends = ["base", "apex"].map(|end| report["long_axis"][end].clone());
    let [base, apex] = ends.map(|end| serde_json::from_value::<[f64; 3]>(end).unwrap());
    let axis = json!([0, 1, 2].map(|axis| apex[axis] - base[axis]));
    let dynamic = nifti_of(beating(), Some(60.0));
    let stored = service
        .post("/v1/volumes")
        .body(dynamic)
        .send()
        .await
        .unwrap();
    let stored: Value = stored.json().await.unwrap();
    let order = json!({"kind": "beat", "volume": stored["id"],
        "parameters": {"gated": true, "axis": axis, "mass_g": 130}});
    let job = service.succeeded(&order).await;
    let refitted = json(&format!("{}/report", text(&job["links"]["beat"]))).await;
    assert_eq!(refitted["parameters"]["axis"], axis);
    // 130 g of muscle of 1.05 g/ml.
    let wall = refitted["wall_ml"].as_f64().unwrap();
    assert!((wall - 130.0 / 1.05).abs() < 6.0, "{wall} ml");
}

#[tokio::test]
async fn what_is_no_gated_study_is_refused_with_advice() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let post = async |query: &str, body: Vec<u8>| -> Response {
        let request = service.post(&format!("/v1/beats{query}"));
        request
            .header("prefer", super::helpers::UNTIL_DONE)
            .body(body)
            .send()
            .await
            .unwrap()
    };
    let gates = beating();
    for ungated in [heart().0, nm(&JANE, 1)] {
        let refused = problem(post("", ungated).await, 422, "not-gated").await;
        let fix = text(&refused["fix"]);
        assert!(fix.contains("gated series"), "{refused}");
        assert!(fix.contains("one file for each gate"), "{refused}");
    }
    // Eight volumes that last a minute each are no heart beat.
    let dynamic = nifti_of(gates, Some(60.0));
    let refused = problem(post("", dynamic).await, 422, "not-gated").await;
    assert_eq!(refused["field"], "gated");
    assert!(text(&refused["detail"]).contains("480 s"), "{refused}");
    let few = problem(
        post("", nifti_of(&gates[..5], None)).await,
        422,
        "gate-count",
    )
    .await;
    assert!(text(&few["detail"]).contains("5 gates"), "{few}");
    let mut empty = gates.to_vec();
    empty[2].voxels.fill(0.0);
    let empty = problem(post("", nifti_of(&empty, None)).await, 422, "empty-gate").await;
    assert!(text(&empty["detail"]).contains("gate 3") || text(&empty["detail"]).contains("Gate 3"));
    // A heart that stands still has no ejection fraction, which is a result.
    let still = vec![&gates[0]; 8];
    let answer = post("", nm_of(&JANE, &still)).await;
    assert_eq!(answer.status(), 200);
    let report: Value = answer.json().await.unwrap();
    assert!(report["ef_percent"].is_null(), "{report}");
    assert!(report["flags"].to_string().contains("no_contraction"));
}

/// A form with one NIfTI file for each gate.
fn form_of(files: Vec<(String, Vec<u8>)>) -> Form {
    files.into_iter().fold(Form::new(), |form, (name, bytes)| {
        form.part("file", Part::bytes(bytes).file_name(name))
    })
}

#[tokio::test]
async fn dicom_images_of_one_gate_each_become_one_gated_volume() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let upload = async |order: [usize; 8]| -> Value {
        // Names in the order of the form, which means nothing.
        let named = order.into_iter().enumerate();
        let form = form_of(
            named
                .map(|(n, gate)| {
                    let image = nm_numbered(&JANE, &[&beating()[gate]], Some(gate + 1));
                    (format!("{n}.dcm"), image)
                })
                .collect(),
        );
        let answer = service.post("/v1/volumes").multipart(form).send().await;
        answer.unwrap().json().await.unwrap()
    };
    let stored = upload([7, 2, 5, 0, 1, 6, 3, 4]).await;
    assert_eq!(stored["frames"], 8, "{stored}");
    assert_eq!(stored["gates"]["number"], 8);
    let again = upload([0, 1, 2, 3, 4, 5, 6, 7]).await;
    assert_eq!(again["id"], stored["id"], "headers decide, not the form");
    // The smallest cavity is that of the fourth gate.
    let order = json!({"kind": "beat", "volume": stored["id"]});
    let job = service.succeeded(&order).await;
    let report = format!("{}/report", text(&job["links"]["beat"]));
    let beat: Value = service
        .get(&report)
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert_eq!(beat["end_systole_gate"], 4, "{beat}");
}

#[tokio::test]
async fn files_of_one_gate_each_become_one_gated_volume() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let post = async |path: &str, form: Form| -> Response {
        let request = service
            .post(path)
            .header("prefer", super::helpers::UNTIL_DONE);
        request.multipart(form).send().await.unwrap()
    };
    let file = |gate: &Volume| nifti::write(gate, StoredType::Float32, true).unwrap();
    let numbered = |order: [usize; 8]| {
        let named = |gate: usize| (format!("Gate {}.nii.gz", gate + 5), file(&beating()[gate]));
        form_of(order.map(named).into())
    };
    let stored: Value = post("/v1/volumes", numbered([7, 2, 5, 0, 1, 6, 3, 4]))
        .await
        .json()
        .await
        .unwrap();
    assert_eq!(stored["frames"], 8, "{stored}");
    assert_eq!(stored["gates"]["number"], 8);
    assert_eq!(stored["gates"]["intervals"], 1);
    let again: Value = post("/v1/volumes", numbered([0, 1, 2, 3, 4, 5, 6, 7]))
        .await
        .json()
        .await
        .unwrap();
    assert_eq!(again["id"], stored["id"], "numbers decide, not the form");
    for (gate, made) in beating().iter().enumerate() {
        let path = format!(
            "/v1/volumes/{}/voxels.nii.gz?frame={gate}",
            text(&stored["id"])
        );
        let voxels = service
            .get(&path)
            .send()
            .await
            .unwrap()
            .bytes()
            .await
            .unwrap();
        let read = VolumeFile::in_memory("gate.nii.gz", voxels.to_vec());
        let read = volume::read(
            &[read],
            &ReadOptions::default(),
            &ReadLimits::default(),
            &Monitor::silent(),
        );
        let read = read.unwrap().volume;
        let pairs = read.voxels.iter().zip(&made.voxels);
        assert!(
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) < 1.0,
            "gate {gate}"
        );
    }
    // Names without numbers leave the order to the form, which then makes another volume.
    let lettered = |order: [usize; 8]| {
        form_of(
            order
                .map(|gate| {
                    (
                        format!("{}.nii.gz", b"hgfedcba"[gate] as char),
                        file(&beating()[gate]),
                    )
                })
                .into(),
        )
    };
    let straight: Value = post("/v1/volumes", lettered([0, 1, 2, 3, 4, 5, 6, 7]))
        .await
        .json()
        .await
        .unwrap();
    assert_eq!(straight["id"], stored["id"]);
    let shuffled: Value = post("/v1/volumes", lettered([1, 0, 2, 3, 4, 5, 6, 7]))
        .await
        .json()
        .await
        .unwrap();
    assert_ne!(shuffled["id"], stored["id"]);

    // The beat is that of the same gates in one file.
    let answer = post("/v1/beats", numbered([4, 2, 5, 0, 1, 6, 3, 7])).await;
    assert_eq!(answer.status(), 200);
    let of_files: Value = answer.json().await.unwrap();
    let request = service
        .post("/v1/beats")
        .header("prefer", super::helpers::UNTIL_DONE);
    let answer = request
        .body(nifti_of(beating(), None))
        .send()
        .await
        .unwrap();
    let of_one: Value = answer.json().await.unwrap();
    for name in [
        "edv_ml",
        "esv_ml",
        "ef_percent",
        "gates",
        "segments",
        "phase",
        "flags",
    ] {
        assert_eq!(of_files[name], of_one[name], "{name}");
    }

    // Gates on another grid are refused by what they are.
    let other = |index: usize, gate: Volume| {
        let mut gates = beating().to_vec();
        gates[index] = gate;
        form_of(
            gates
                .iter()
                .enumerate()
                .map(|(n, gate)| (format!("{n}.nii.gz"), file(gate)))
                .collect(),
        )
    };
    let frame = beating()[0].frame.clone();
    let small = Volume::sampled([40, 40, 39], frame, |_| 1.0);
    let moved = VoxelToPatient::centred([40; 3], [6.4; 3], Vec3::new(500.0, 0.0, 0.0)).unwrap();
    let moved = Volume {
        frame: moved,
        ..beating()[5].clone()
    };
    for (form, said) in [
        (
            other(3, small),
            "gate 4 has 40 x 40 x 39 voxels where gate 1 has 40 x 40 x 40",
        ),
        (other(5, moved), "gate 6 lies elsewhere"),
    ] {
        let refused = problem(post("/v1/volumes", form).await, 422, "gates-differ").await;
        let detail = text(&refused["detail"]).to_lowercase();
        assert!(detail.starts_with(said), "{refused}");
    }
    let few = form_of(
        (0..4)
            .map(|n| (format!("{n}.nii.gz"), file(&beating()[n])))
            .collect(),
    );
    let few = problem(post("/v1/volumes", few).await, 422, "unusable-volume").await;
    assert!(text(&few["fix"]).contains("6 to 32 NIfTI files"), "{few}");
}

#[tokio::test]
async fn a_volume_says_whether_it_is_gated() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let gates = async |body: Vec<u8>| -> Value {
        let answer = service.post("/v1/volumes").body(body).send().await.unwrap();
        let volume: Value = answer.json().await.unwrap();
        volume["gates"].clone()
    };
    assert_eq!(gates(heart().0).await, Value::Null);
    assert_eq!(
        gates(nifti_of(beating(), Some(60.0))).await,
        Value::Null,
        "a dynamic study"
    );
    let in_one = gates(nifti_of(beating(), None)).await;
    assert_eq!(
        in_one,
        json!({"number": 8, "intervals": 1, "rr_ms": null, "beats_accepted": null, "beats_rejected": null})
    );
    let of_dicom = gates(nm_of(&JANE, &beating().iter().collect::<Vec<_>>())).await;
    assert_eq!(of_dicom["number"], 8, "{of_dicom}");
}
