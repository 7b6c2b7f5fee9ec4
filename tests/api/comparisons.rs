//! `/v1/comparisons` and `/v1/normals`: with the fake computation, and with the real one.

use crate::dicom::{JANE, Patient, contains, nm_of};
use crate::helpers::{Service, TestApp, problem, text, volume as words};
use dicom_object::from_reader;
use reqwest::header::{ACCEPT, LOCATION};
use reqwest::multipart::{Form, Part};
use reqwest::{Response, StatusCode};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::Volume;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{
    PerfusionDefect, PhantomParameters, healthy_person, phantom,
};
use ventriform::results::export::Format;
use ventriform::runs::rest_stress::FILE_NAMES;

impl TestApp {
    async fn post_json(&self, path: &str, body: Value) -> Response {
        self.post(path).json(&body).send().await.unwrap()
    }

    /// Compares two volumes; returns the comparison.
    pub async fn comparison(&self, stress: &str, rest: &str) -> Value {
        let (stress, rest) = (self.volume(stress).await, self.volume(rest).await);
        let order = json!({"stress": stress, "rest": rest});
        let answer = self.post_json("/v1/comparisons", order).await;
        assert_eq!(answer.status(), StatusCode::ACCEPTED);
        let job = self
            .until(&answer.json().await.unwrap(), &["succeeded"])
            .await;
        assert_eq!(job["kind"], "comparison");
        assert_eq!(job["volume"], stress.as_str());
        let made = self.json(&text(&job["links"]["comparison"])).await;
        assert_eq!(made["id"], job["comparison"]);
        made
    }

    /// Builds normal limits of one volume, which the fake computation does not mind; returns them.
    pub async fn normals(&self, said: &str) -> Value {
        let case = case("n1", &self.volume(said).await);
        let order = json!({"name": "few", "cases": [case]});
        let answer = self.post_json("/v1/normals", order).await;
        assert_eq!(answer.status(), StatusCode::ACCEPTED);
        let job = self
            .until(&answer.json().await.unwrap(), &["succeeded"])
            .await;
        assert!(job["links"]["report"].is_null() && job["links"]["mesh"].is_null());
        let made = self.json(&text(&job["links"]["normals"])).await;
        assert_eq!(made["id"], job["normals"]);
        assert_eq!(made["name"], "few");
        made
    }
}

/// A row of a cohort's table.
fn case(name: &str, volume: &str) -> Value {
    json!({"case": name, "volume": volume, "sex": "F", "protocol": "rest", "tracer": "none (simulated)",
        "attenuation_corrected": false})
}

#[tokio::test]
async fn comparisons_are_listed_downloaded_and_go_with_either_scan() {
    let app = TestApp::start().await;
    let made = app.comparison("sphere stress", "sphere rest").await;
    let path = text(&made["links"]["self"]);
    assert_eq!(
        app.json("/v1/comparisons?limit=1").await["comparisons"][0],
        made
    );
    let rest = text(&made["parameters"]["rest"]);
    assert_eq!(made["links"]["rest"], format!("/v1/volumes/{rest}"));
    assert_eq!(
        made["links"]["stress"],
        format!("/v1/volumes/{}", text(&made["volume"]))
    );
    let report = app.json(&format!("{path}/report")).await;
    assert_eq!(report, app.json(&format!("{path}/comparison.json")).await);
    let get = async |name: &str, accept: &str| {
        let request = app.get(&format!("{path}/{name}")).header(ACCEPT, accept);
        request.send().await.unwrap()
    };
    let stl = get("mesh", "model/stl").await;
    let place = stl.headers()["content-location"].to_str().unwrap();
    assert_eq!(place, format!("{path}/mesh_stress.stl"));
    let page = get("report", "text/html").await;
    assert_eq!(page.headers()["content-type"], "text/html; charset=utf-8");
    problem(get("mask.nii.gz", "*/*").await, 404, "not-found").await;

    let erased = app.delete(&path).send().await.unwrap();
    assert_eq!(erased.status(), StatusCode::NO_CONTENT);
    problem(app.get(&path).send().await.unwrap(), 410, "gone").await;
    for scan in ["volume", "rest"] {
        let made = app.comparison("sphere stress", "sphere rest").await;
        assert_eq!(text(&made["links"]["self"]), path);
        let scan = match scan {
            "rest" => text(&made["parameters"]["rest"]),
            _ => text(&made["volume"]),
        };
        let erased = app
            .delete(&format!("/v1/volumes/{scan}?cascade=true"))
            .header("prefer", "return=representation");
        let receipt: Value = erased.send().await.unwrap().json().await.unwrap();
        assert!(
            receipt.to_string().contains(&text(&made["id"])),
            "{receipt}"
        );
        problem(app.get(&path).send().await.unwrap(), 410, "gone").await;
    }
}

#[tokio::test]
async fn the_scan_at_rest_is_kept_while_a_comparison_needs_it() {
    let app = TestApp::start().await;
    let (stress, rest) = (app.volume("slow").await, app.volume("sphere rest").await);
    let order = json!({"stress": stress, "rest": rest});
    let job: Value = app
        .post_json("/v1/comparisons", order)
        .await
        .json()
        .await
        .unwrap();
    app.until(&job, &["running"]).await;
    let erase = app.delete(&format!("/v1/volumes/{rest}")).send().await;
    problem(erase.unwrap(), 409, "in-use").await;
    app.delete(&text(&job["links"]["self"]))
        .send()
        .await
        .unwrap();
    app.until(&job, &["cancelled"]).await;
    let erase = app.delete(&format!("/v1/volumes/{rest}")).send().await;
    assert_eq!(erase.unwrap().status(), StatusCode::NO_CONTENT);
}

#[tokio::test]
async fn what_cannot_be_compared_is_refused_with_its_field() {
    let app = TestApp::start().await;
    let stress = app.volume("sphere stress").await;
    let rest = app.volume("sphere rest").await;
    for (order, field, code) in [
        (json!({"rest": rest}), "stress", "invalid-field"),
        (json!({"stress": stress}), "rest", "invalid-field"),
        (
            json!({"stress": stress, "rest": stress}),
            "rest",
            "invalid-field",
        ),
        (
            json!({"stress": stress, "rest": "vol_00"}),
            "rest",
            "invalid-field",
        ),
        (
            json!({"stress": "vol_00", "rest": rest}),
            "stress",
            "invalid-field",
        ),
        (
            json!({"stress": "seg_00", "rest": rest}),
            "stress",
            "invalid-field",
        ),
        (
            json!({"stress": "mdl_00", "rest": rest}),
            "stress",
            "invalid-field",
        ),
        (
            json!({"stress": 1, "rest": rest}),
            "stress",
            "invalid-field",
        ),
        (
            json!({"stress": stress, "rest": rest, "normals": "nrm_00"}),
            "normals",
            "invalid-field",
        ),
        (
            json!({"stress": stress, "rest": rest, "normals": "rdr_00"}),
            "normals",
            "invalid-parameter",
        ),
        (
            json!({"stress": stress, "rest": rest, "parameters": {"rest": rest}}),
            "rest",
            "invalid-field",
        ),
        (
            json!({"stress": stress, "rest": rest, "parameters": {"expert": rest}}),
            "expert",
            "invalid-parameter",
        ),
        (
            json!({"stress": stress, "rest": rest, "parameters": []}),
            "parameters",
            "invalid-field",
        ),
        (
            json!({"stress": stress, "rest": rest, "send": ["mask.dcm"], "to": "pacs"}),
            "send",
            "invalid-field",
        ),
    ] {
        let refused = app.post_json("/v1/comparisons", order.clone()).await;
        let refused = problem(refused, 422, code).await;
        assert_eq!(refused["field"], field, "{order}");
        assert!(refused["fix"].is_string(), "{refused}");
    }
    let unknown = json!({"stress": stress, "rest": rest, "model": "auto"});
    let unknown = app.post_json("/v1/comparisons", unknown).await;
    problem(unknown, 400, "unknown-parameter").await;
    let both = json!({"stress": stress, "rest": rest});
    let both = app
        .post_json("/v1/comparisons?same_patient=true", both)
        .await;
    problem(both, 400, "invalid-parameter").await;
    // A job of its kind has the same bounds.
    let order = json!({"kind": "comparison", "volume": stress});
    let refused = problem(app.post_json("/v1/jobs", order).await, 422, "invalid-field").await;
    assert_eq!(refused["field"], "rest");
    let form = || Form::new().part("stress", Part::bytes(words("sphere")).file_name("a.nii"));
    let alone = app.post("/v1/comparisons").multipart(form());
    let alone = problem(alone.send().await.unwrap(), 422, "invalid-field").await;
    assert_eq!(alone["field"], "rest");
    let twice = form().part("rest", Part::bytes(words("sphere")).file_name("b.nii"));
    let twice = app.post("/v1/comparisons").multipart(twice);
    problem(twice.send().await.unwrap(), 422, "invalid-field").await;
    let large = json!({"stress": "x".repeat(300_000), "rest": rest});
    let large = app.post_json("/v1/comparisons", large).await;
    problem(large, 413, "body-too-large").await;
}

#[tokio::test]
async fn segmentations_and_beats_stand_for_their_volumes_and_keys_for_one_job() {
    let app = TestApp::start().await;
    let beat = app.beat("sphere rest").await;
    let fit = app.post("/v1/segmentations").body(words("brief stress"));
    let fit: Value = fit.send().await.unwrap().json().await.unwrap();
    let fit = app.until(&fit, &["succeeded"]).await;
    let file = |same: bool| {
        let order = json!({"stress": fit["segmentation"], "rest": beat["id"], "external_id": "A17",
            "parameters": {"same_patient": same}});
        let request = app.post("/v1/comparisons").header("idempotency-key", "k");
        request.json(&order).send()
    };
    let first: Value = file(true).await.unwrap().json().await.unwrap();
    assert_eq!(first["volume"], fit["volume"]);
    assert_eq!(first["parameters"]["rest"], beat["volume"]);
    assert_eq!(first["external_id"], "A17");
    let again: Value = file(true).await.unwrap().json().await.unwrap();
    assert_eq!(first["id"], again["id"]);
    problem(file(false).await.unwrap(), 422, "idempotency-key-reused").await;
    let order = json!({"stress": fit["segmentation"], "rest": beat["id"]});
    let waited = app
        .post("/v1/comparisons")
        .header("prefer", super::helpers::UNTIL_DONE);
    let waited = waited.header(ACCEPT, "application/json").json(&order);
    let waited = waited.send().await.unwrap();
    assert_eq!(waited.status(), StatusCode::OK);
    assert!(
        waited.headers()[LOCATION]
            .to_str()
            .unwrap()
            .contains("cmp_")
    );
    let other = app
        .post("/v1/comparisons")
        .header("prefer", super::helpers::UNTIL_DONE);
    let other = other.header(ACCEPT, "model/stl").json(&order).send().await;
    problem(other.unwrap(), 406, "not-acceptable").await;
    // What was corrected of a fit is kept, each scan's own, unless the request says otherwise.
    let fit = app.post("/v1/segmentations?center=1,2,3&base=4,5,6");
    let fit = fit.body(words("brief stress")).send().await.unwrap();
    let fit = (app.until(&fit.json().await.unwrap(), &["succeeded"])).await;
    for (stated, base) in [
        (json!({}), json!([4.0, 5.0, 6.0])),
        (json!({"stress_base": [7, 8, 9]}), json!([7.0, 8.0, 9.0])),
    ] {
        let order =
            json!({"stress": fit["segmentation"], "rest": beat["id"], "parameters": stated});
        let filed = app.post_json("/v1/comparisons", order).await;
        let filed: Value = filed.json().await.unwrap();
        let parameters = &filed["parameters"];
        assert_eq!(parameters["stress_base"], base, "{filed}");
        assert_eq!(parameters["stress_center"], json!([1.0, 2.0, 3.0]));
        assert!(parameters["rest_center"].is_null());
    }
    // A form with both files is a comparison too.
    let part = |said: &str| Part::bytes(words(said)).file_name("scan.nii");
    let form = Form::new()
        .part("stress", part("sphere a"))
        .part("rest", part("sphere b"));
    let filed = app.post("/v1/comparisons?superior=0,0,1").multipart(form);
    let job: Value = filed.send().await.unwrap().json().await.unwrap();
    let job = app.until(&job, &["succeeded"]).await;
    assert_eq!(job["parameters"]["superior"], json!([0.0, 0.0, 1.0]));
}

#[tokio::test]
async fn normal_limits_are_listed_used_and_outlive_their_cohort() {
    let app = TestApp::with(|s| s.normals_limit = 1).await;
    let made = app.normals("sphere").await;
    let path = text(&made["links"]["self"]);
    assert_eq!(app.json("/v1/normals").await["normals"][0], made);
    assert_eq!(app.json(&text(&made["links"]["limits"])).await, json!({}));
    let more = json!({"cases": [case("n1", "vol_00")]});
    problem(
        app.post_json("/v1/normals", more).await,
        409,
        "library-full",
    )
    .await;

    let id = text(&made["id"]);
    for kind in ["segmentations", "beats"] {
        let request = app.post(&format!("/v1/{kind}?normals={id}&sex=F"));
        let job = request.body(words("sphere other")).send().await.unwrap();
        let job = app.until(&job.json().await.unwrap(), &["succeeded"]).await;
        assert_eq!(job["parameters"]["normals"], id.as_str(), "{kind}");
        let other = app.post(&format!("/v1/{kind}?sex=X")).body(words("sphere"));
        let other = problem(other.send().await.unwrap(), 422, "invalid-parameter").await;
        assert_eq!(other["field"], "sex");
    }
    let volumes = app.json("/v1/volumes").await;
    for volume in volumes["volumes"].as_array().unwrap() {
        let id = text(&volume["id"]);
        let erased = app.delete(&format!("/v1/volumes/{id}?cascade=true"));
        assert_eq!(
            erased.send().await.unwrap().status(),
            StatusCode::NO_CONTENT
        );
    }
    assert_eq!(app.json(&path).await, made, "limits are statistics");
    let erased = app.delete(&path).send().await.unwrap();
    assert_eq!(erased.status(), StatusCode::NO_CONTENT);
    problem(app.get(&path).send().await.unwrap(), 410, "gone").await;
    let gone = app.post(&format!("/v1/segmentations?normals={id}"));
    let gone = gone.body(words("sphere")).send().await.unwrap();
    assert_eq!(
        problem(gone, 422, "invalid-field").await["field"],
        "normals"
    );
}

#[tokio::test]
async fn a_repeated_cohort_gets_its_job_although_the_library_is_full_since() {
    let app = TestApp::with(|s| s.normals_limit = 1).await;
    let order = json!({"cases": [case("n1", &app.volume("sphere").await)]});
    let send = || {
        let request = app.post("/v1/normals").header("idempotency-key", "one");
        request.json(&order).send()
    };
    let first: Value = send().await.unwrap().json().await.unwrap();
    app.until(&first, &["succeeded"]).await;
    let again = send().await.unwrap();
    assert_eq!(again.status(), StatusCode::ACCEPTED);
    let again: Value = again.json().await.unwrap();
    assert_eq!(again["id"], first["id"]);
    let other = app.post_json("/v1/normals", order.clone()).await;
    problem(other, 409, "library-full").await;
}

#[tokio::test]
async fn a_table_that_is_none_is_refused_with_its_row() {
    let app = TestApp::start().await;
    let volume = app.volume("sphere").await;
    let with = |field: &str, value: Value| {
        let mut row = case("n2", &volume);
        row[field] = value;
        json!({"cases": [case("n1", &volume), row]})
    };
    for (order, field) in [
        (json!({"cases": []}), "cases"),
        (json!({}), "cases"),
        (json!({"cases": {"case": "n1"}}), "cases"),
        (with("case", json!("n1")), "cases[1].case"),
        (with("case", json!("")), "cases[1].case"),
        (with("volume", json!("seg_00")), "cases[1].volume"),
        (with("volume", json!("vol_00")), "cases[1].volume"),
        (with("sex", json!("X")), "cases[1]"),
        (with("age", json!(70)), "cases[1]"),
        (with("protocol", json!("a\nb")), "cases[1].protocol"),
        (with("tracer", json!("x".repeat(300))), "cases[1].tracer"),
        (with("rest_case", json!("n3")), "cases[1].rest_case"),
        (with("rest_case", json!("n2")), "cases[1].rest_case"),
        (json!({"cases": [case("n1", "vol_00")]}), "cases[0].volume"),
        (json!({"name": "", "cases": [case("n1", &volume)]}), "name"),
        (
            json!({"parameters": {"model": "mdl_00"}, "cases": [case("n1", &volume)]}),
            "model",
        ),
        (json!({"format": "ventriform-normal-limits"}), "normals"),
    ] {
        let refused = app.post_json("/v1/normals", order.clone()).await;
        assert_eq!(refused.status(), 422, "{order}");
        let refused: Value = refused.json().await.unwrap();
        assert_eq!(refused["field"], field, "{order}: {refused}");
        assert!(refused["fix"].is_string(), "{refused}");
    }
    let order = json!({"kind": "normals", "volume": app.volume("sphere b").await,
        "parameters": {"cases": [case("n1", &volume)]}});
    let refused = problem(app.post_json("/v1/jobs", order).await, 422, "invalid-field").await;
    assert_eq!(refused["field"], "volume");
}

pub fn person(seed: u64, defects: &[PerfusionDefect]) -> Volume {
    let base = PhantomParameters {
        shape: [52; 3],
        spacing_mm: [5.0; 3],
        ..PhantomParameters::default()
    };
    let mut parameters = healthy_person(seed, &base).parameters;
    parameters.defects = defects.to_vec();
    phantom(&parameters, &Monitor::silent()).unwrap().volume
}

fn packed(volume: &Volume) -> Vec<u8> {
    nifti::write(volume, StoredType::Int16, true).unwrap()
}

/// Healthy people of the limits.
const HEALTHY_PEOPLE: u64 = 13;
/// Mid and apical segments of the LAD.
const LAD_SEGMENTS: [u8; 4] = [7, 8, 13, 14];

#[tokio::test]
async fn a_cohort_becomes_limits_and_two_scans_a_scored_comparison() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let json = async |path: &str| -> Value {
        let answer = service.get(path).send().await.unwrap();
        assert_eq!(answer.status(), 200, "{path}");
        answer.json().await.unwrap()
    };
    let ended = async |job: Value| -> Value {
        let path = text(&job["links"]["self"]);
        loop {
            let job = json(&path).await;
            match job["state"].as_str() {
                Some("queued" | "running") => {}
                _ => return job,
            }
            tokio::time::sleep(std::time::Duration::from_millis(50)).await;
        }
    };
    let upload = async |bytes: Vec<u8>| -> String {
        let stored = service.post("/v1/volumes").body(bytes).send().await;
        text(&stored.unwrap().json::<Value>().await.unwrap()["id"])
    };
    let mut cases = Vec::new();
    for seed in 0..HEALTHY_PEOPLE {
        let volume = upload(packed(&person(seed, &[]))).await;
        let mut row = case(&format!("n{seed}"), &volume);
        row["sex"] = json!(if seed % 2 == 0 { "F" } else { "M" });
        row["protocol"] = json!("rest");
        cases.push(row);
    }
    // Limits of too few are no limits.
    let few = json!({"cases": cases[..4], "parameters": {"mixed": true}});
    let few = service.post("/v1/normals").json(&few).send().await.unwrap();
    let few = ended(few.json().await.unwrap()).await;
    assert_eq!(few["state"], "failed");
    assert_eq!(few["error"]["field"], "cases", "{few}");
    let order = json!({"name": "simulated", "cases": cases, "parameters": {"mixed": true}});
    let built = service
        .post("/v1/normals")
        .json(&order)
        .send()
        .await
        .unwrap();
    let built = ended(built.json().await.unwrap()).await;
    assert_eq!(built["state"], "succeeded", "{built}");
    let normals = json(&text(&built["links"]["normals"])).await;
    let group = &normals["summary"]["groups"][0];
    assert!(group["cases"].as_u64().unwrap() >= 12, "{normals}");
    assert_eq!(normals["summary"]["simulated"], true);
    let limits = json(&text(&normals["links"]["limits"])).await;
    assert_eq!(limits["sha256"], normals["summary"]["sha256"]);
    // The file can be added again, and is then known by its content.
    let added = service.post("/v1/normals?name=copy").json(&limits).send();
    assert_eq!(added.await.unwrap().status(), StatusCode::CREATED);

    // A segmentation beside them has maps of z and scores, by documented names.
    let id = text(&normals["id"]);
    let fit = service.post(&format!("/v1/segmentations?normals={id}&sex=F"));
    let fit = fit.body(packed(&person(102, &[]))).send().await.unwrap();
    let fit = ended(fit.json().await.unwrap()).await;
    let fit = json(&text(&fit["links"]["segmentation"])).await;
    let report = json(&text(&fit["links"]["report"])).await;
    assert!(report["perfusion"]["extent_percent"].as_f64().unwrap() < 10.0);
    for file in fit["files"].as_array().unwrap() {
        let file = service.get(&text(&file["href"])).send().await.unwrap();
        assert_eq!(file.status(), StatusCode::OK, "{}", file.url());
    }
    for name in ["polar_z.svg", "polar_score.json"] {
        let path = format!("{}/{name}", text(&fit["links"]["self"]));
        assert_eq!(
            service.get(&path).send().await.unwrap().status(),
            StatusCode::OK
        );
    }

    let defects = LAD_SEGMENTS.map(|segment| PerfusionDefect {
        segment,
        severity: 0.6,
    });
    let later = Patient {
        study: "1.2.840.99999.7.20",
        ..JANE
    };
    let stress = upload(nm_of(&JANE, &[&person(100, &defects)])).await;
    let rest = upload(nm_of(&later, &[&person(101, &[])])).await;
    let order = json!({"stress": stress, "rest": rest, "normals": normals["id"], "parameters": {
        "stress_protocol": "rest", "rest_protocol": "rest", "sex": "F"}});
    let filed = service.post("/v1/comparisons").json(&order).send().await;
    let job = ended(filed.unwrap().json().await.unwrap()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let made = json(&text(&job["links"]["comparison"])).await;
    let report = json(&text(&made["links"]["report"])).await;
    assert!(
        report["reversible_percent"].as_f64().unwrap() > 8.0,
        "{report}"
    );
    let scores = ["sss", "srs", "sds"].map(|name| report[name].as_u64().unwrap());
    assert!(
        scores[0] > 4 && scores[2] > 4 && scores[1] < scores[0],
        "{scores:?}"
    );
    for name in ["tid", "sss", "srs", "sds", "reversible_percent", "flags"] {
        assert_eq!(made["summary"][name], report[name], "{name}");
    }

    // Every file is documented by its name, and is what it says.
    let mut names = BTreeSet::new();
    for file in made["files"].as_array().unwrap() {
        let name = text(&file["name"]);
        let mesh = ["mesh_stress.", "mesh_rest."].iter().any(|stem| {
            let extension = name.strip_prefix(stem);
            extension.is_some_and(|extension| Format::from_extension(extension).is_some())
        });
        assert!(mesh || FILE_NAMES.contains(&&name[..]), "{name}");
        let answer = service.get(&text(&file["href"])).send().await.unwrap();
        assert_eq!(answer.headers()["content-type"], text(&file["media_type"]));
        assert_eq!(
            file["bytes"],
            answer.bytes().await.unwrap().len() as u64,
            "{name}"
        );
        names.insert(name);
    }
    for name in FILE_NAMES.iter().filter(|name| **name != "report.html") {
        assert!(names.contains(*name), "{name}");
    }
    let path = text(&made["links"]["self"]);
    let page = service.get(&format!("{path}/report.html")).send().await;
    let page = page.unwrap().text().await.unwrap();
    assert!(
        page.contains("rest and stress") && page.contains("Doe, Jane"),
        "whose it is"
    );
    assert_eq!(page.matches("data:image/svg+xml").count(), 7);
    assert_eq!(page.matches("data:image/png").count(), 1);
    assert!(page.contains("SSS, summed stress score"));
    let part = json(&format!("{path}/mesh_rest.json?part=endocardium")).await;
    assert!(!part["triangles"].as_array().unwrap().is_empty());

    // DICOM objects belong to the study at stress, and refer to both.
    for link in made["links"]["dicom"].as_array().unwrap() {
        let link = text(link);
        let object = service.get(&link).send().await.unwrap();
        assert_eq!(
            object.headers()["content-type"],
            "application/dicom",
            "{link}"
        );
        let object = object.bytes().await.unwrap();
        for of_scan in [JANE.name, JANE.id, JANE.study] {
            assert!(contains(&object, of_scan), "{link} lacks {of_scan}");
        }
        from_reader(&object[..]).unwrap();
        if link.ends_with("measurements.dcm") {
            let figures = [report["tid"].to_string(), scores[0].to_string()];
            let named = ["428832008", "82648-7", "82644-6", "427751006", later.study];
            for said in figures.iter().map(String::as_str).chain(named) {
                assert!(contains(&object, said), "{said}");
            }
            // It names the limits behind the scores.
            let limits = &report["stress"]["perfusion"]["normals"];
            for said in ["sha256", "people", "program_version"] {
                assert!(contains(&object, &text(&limits[said])), "{said}");
            }
        }
        let hidden = service.get(&format!("{link}?deidentify=true")).send().await;
        let hidden = hidden.unwrap().bytes().await.unwrap();
        for secret in ["Doe", JANE.id, JANE.study, later.study] {
            assert!(!contains(&hidden, secret), "{link} shows {secret}");
        }
    }
    assert_eq!(made["links"]["dicom"].as_array().unwrap().len(), 5);
}
