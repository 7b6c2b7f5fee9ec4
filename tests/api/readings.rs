//! `/v1/readings`: signed, amended, kept from those who may not sign, and gone with the scan; with the fake computation of
//! results, and with real ones.

use crate::helpers::{Service, TestApp, closed, key, problem, text};
use dicom_object::{Tag, from_reader};
use reqwest::StatusCode;
use serde_json::{Value, json};
use ventriform::base::progress::Monitor;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PhantomParameters, phantom};
use ventriform_service::callers::{Quota, Scope};

const VERIFICATION_FLAG: Tag = Tag(0x0040, 0xA493);
const VERIFYING_OBSERVERS: Tag = Tag(0x0040, 0xA073);

impl TestApp {
    /// Signs a reading; returns it.
    pub async fn reading(&self, stated: Value) -> Value {
        let answer = self
            .post("/v1/readings")
            .json(&stated)
            .send()
            .await
            .unwrap();
        assert_eq!(answer.status(), StatusCode::ACCEPTED);
        let job = self
            .until(&answer.json().await.unwrap(), &["succeeded"])
            .await;
        assert_eq!(job["kind"], "reading");
        self.json(&text(&job["links"]["reading"])).await
    }
}

/// What a reader states of a single scan.
pub fn stated(result: &str) -> Value {
    json!({
        "result": result, "reader": "Doe^Jane^^Dr.", "impression": "No perfusion defect.\nSmall heart.",
        "scores": [0, 0, 0, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1], "quality": "good",
    })
}

#[tokio::test]
async fn a_reading_is_signed_listed_amended_and_goes_with_the_scan() {
    let app = TestApp::start().await;
    let result = text(&app.segmentation("sphere read").await["id"]);
    let first = app.reading(stated(&result)).await;
    assert_eq!(first["summary"]["sss"], 4);
    assert_eq!(first["summary"]["reader"], "Doe^Jane^^Dr.");
    assert_eq!(
        first["links"]["result"],
        format!("/v1/segmentations/{result}")
    );
    let path = text(&first["links"]["self"]);
    let report = app.json(&format!("{path}/report")).await;
    assert_eq!(report["scores"][0]["segments"][6], 3);
    assert!(report["read_at"].as_str().unwrap().ends_with('Z'));
    let page = app
        .get(&format!("{path}/report.html"))
        .send()
        .await
        .unwrap();
    let page = page.text().await.unwrap();
    assert!(page.contains("read by Doe, Jane Dr.") && page.contains("Small heart."));

    // A second reading names the first one, which is kept.
    let again = app
        .post("/v1/readings")
        .json(&stated(&result))
        .send()
        .await
        .unwrap();
    let told = problem(again, 409, "already-read").await;
    assert_eq!(told["field"], "amends");
    let mut amended = stated(&result);
    amended["impression"] = "Reversible defect.".into();
    amended["amends"] = first["id"].clone();
    let second = app.reading(amended.clone()).await;
    assert_eq!(second["links"]["amends"], path);
    assert_eq!(app.json(&path).await, first);
    // The newest one alone can be amended.
    let late = app
        .post("/v1/readings")
        .json(&amended)
        .send()
        .await
        .unwrap();
    let told = problem(late, 409, "already-read").await;
    assert!(text(&told["fix"]).contains(&text(&second["id"])), "{told}");
    let listed = app.json("/v1/readings").await;
    assert_eq!(listed["readings"][0], second);
    assert_eq!(listed["readings"][1], first);

    // The result may go: the reading keeps what was read.
    let gone = app.delete(&format!("/v1/segmentations/{result}"));
    assert!(gone.send().await.unwrap().status().is_success());
    assert_eq!(app.json(&format!("{path}/report")).await, report);
    let volume = text(&first["volume"]);
    let gone = app.delete(&format!("/v1/volumes/{volume}?cascade=true"));
    assert!(gone.send().await.unwrap().status().is_success());
    problem(app.get(&path).send().await.unwrap(), 410, "gone").await;
    let jobs = app.json("/v1/jobs").await.to_string();
    assert!(
        !jobs.contains("Small heart") && !jobs.contains("Jane"),
        "{jobs}"
    );
}

#[tokio::test]
async fn what_cannot_be_signed_is_refused_by_field() {
    let app = TestApp::start().await;
    let result = text(&app.segmentation("sphere read").await["id"]);
    let refused = async |change: &dyn Fn(&mut Value)| {
        let mut order = stated(&result);
        change(&mut order);
        let answer = app.post("/v1/readings").json(&order).send().await.unwrap();
        let status = answer.status().as_u16();
        let told: Value = answer.json().await.unwrap();
        assert!((400..500).contains(&status), "{order}: {told}");
        assert!(told["fix"].is_string(), "{told}");
        text(&told["field"])
    };
    assert_eq!(
        refused(&|own| own["result"] = Value::from("mdl_12")).await,
        "result"
    );
    let nobodys = "seg_00000000000000000000000000000000";
    assert_eq!(
        refused(&|own| own["result"] = nobodys.into()).await,
        "result"
    );
    assert_eq!(
        refused(&|own| drop(own.as_object_mut().unwrap().remove("reader"))).await,
        "reader"
    );
    assert_eq!(refused(&|own| own["scores"][3] = 5.into()).await, "scores");
    assert_eq!(
        refused(&|own| own["scores"] = json!([1, 2])).await,
        "scores"
    );
    assert_eq!(
        refused(&|own| own["quality"] = "splendid".into()).await,
        "quality"
    );
    assert_eq!(
        refused(&|own| own["read_at"] = "2026-11-30T22:15:00Z".into()).await,
        "read_at"
    );
    assert_eq!(
        refused(&|own| own["amends"] = "rdg_12".into()).await,
        "amends"
    );
    let filed = json!({"kind": "reading", "volume": "vol_12"});
    let filed = app.post("/v1/jobs").json(&filed).send().await.unwrap();
    let told = problem(filed, 422, "invalid-field").await;
    assert_eq!(told["field"], "kind");

    // A place that the result does not have is known when the job runs.
    let mut order = stated(&result);
    order["rest_scores"] = json!(vec![0; 17]);
    let answer = app.post("/v1/readings").json(&order).send().await.unwrap();
    let failed = app.until(&answer.json().await.unwrap(), &["failed"]).await;
    assert_eq!(failed["error"]["field"], "rest_scores");
}

#[tokio::test]
async fn a_text_must_not_name_the_patient() {
    let app = TestApp::start().await;
    let result = text(&app.segmentation("sphere read").await["id"]);
    let volume = app.json(&format!("/v1/segmentations/{result}")).await;
    let volume = text(&volume["volume"]);
    let identity =
        json!({"patient_id": "4711", "patient_name": "Roe^Richard", "study_uid": "1.2.3"});
    let identity = app
        .put(&format!("/v1/volumes/{volume}/identity"))
        .json(&identity);
    assert!(identity.send().await.unwrap().status().is_success());
    for field in ["impression", "limits"] {
        let mut order = stated(&result);
        order[field] = "Mr. RICHARD has no defect.".into();
        let answer = app.post("/v1/readings").json(&order).send().await.unwrap();
        let told = problem(answer, 422, "invalid-field").await;
        assert_eq!(told["field"], field);
        assert!(
            !told.to_string().to_lowercase().contains("richard"),
            "{told}"
        );
    }
    app.reading(stated(&result)).await;
}

#[tokio::test]
async fn only_the_scope_sign_signs_and_erases() {
    let app = TestApp::start().await;
    let as_key = async |scope: Scope| {
        let made = key(app.data.path(), scope, "default", Quota::default()).await;
        app.seen_with(&made.1)
    };
    let (read, submit, sign) = (
        as_key(Scope::Read).await,
        as_key(Scope::Submit).await,
        as_key(Scope::Sign).await,
    );
    closed(&app).await;
    let result = text(&submit.segmentation("sphere read").await["id"]);
    for weak in [&read, &submit] {
        let answer = weak
            .post("/v1/readings")
            .json(&stated(&result))
            .send()
            .await
            .unwrap();
        problem(answer, 403, "insufficient-scope").await;
    }
    let signed = sign.reading(stated(&result)).await;
    let path = text(&signed["links"]["self"]);
    assert_eq!(read.json(&path).await["id"], signed["id"]);
    let answer = submit.delete(&path).send().await.unwrap();
    problem(answer, 403, "insufficient-scope").await;
    // Objects that name the patient are not for the scope `read`.
    for file in ["measurements.dcm", "fhir.json"] {
        let answer = read.get(&format!("{path}/{file}")).send().await.unwrap();
        problem(answer, 403, "insufficient-scope").await;
    }
    assert!(
        sign.delete(&path)
            .send()
            .await
            .unwrap()
            .status()
            .is_success()
    );
}

/// A real fit: its reading as page, structured report and FHIR resources.
#[tokio::test]
async fn a_reading_becomes_a_verified_report_and_fhir_resources() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let parameters = PhantomParameters {
        shape: [52; 3],
        spacing_mm: [5.0; 3],
        ..PhantomParameters::default()
    };
    let made = phantom(&parameters, &Monitor::silent()).unwrap();
    let bytes = nifti::write(&made.volume, StoredType::Int16, false).unwrap();
    let waited = service
        .post("/v1/segmentations?model=auto")
        .header("prefer", super::helpers::UNTIL_DONE)
        .header("accept", "application/json")
        .body(bytes);
    assert_eq!(waited.send().await.unwrap().status(), StatusCode::OK);
    let json = async |path: &str| -> Value {
        let answer = service.get(path).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK, "{path}");
        answer.json().await.unwrap()
    };
    let fit = json("/v1/segmentations").await["segmentations"][0].clone();
    let volume = text(&fit["volume"]);
    let identity =
        json!({"patient_id": "4711", "patient_name": "Roe^Richard", "study_uid": "1.2.3"});
    let identity = service
        .put(&format!("/v1/volumes/{volume}/identity"))
        .json(&identity);
    assert!(identity.send().await.unwrap().status().is_success());
    let signed = service
        .post("/v1/readings")
        .header("prefer", super::helpers::UNTIL_DONE)
        .json(&stated(fit["id"].as_str().unwrap()));
    assert_eq!(signed.send().await.unwrap().status(), StatusCode::OK);
    let reading = json("/v1/readings").await["readings"][0].clone();
    let path = text(&reading["links"]["self"]);

    let unread = json(&format!("{}/fhir.json", text(&fit["links"]["self"]))).await;
    assert_eq!(unread["entry"][0]["resource"]["status"], "preliminary");
    let read = json(&format!("{path}/fhir.json")).await;
    let diagnostic = &read["entry"][0]["resource"];
    assert_eq!(diagnostic["status"], "final");
    assert_eq!(
        diagnostic["conclusion"],
        "No perfusion defect.\nSmall heart."
    );
    assert!(read.to_string().contains("Roe"));

    for (query, reader) in [("", "Doe^Jane^^Dr."), ("?deidentify=true", "reader")] {
        let file = service.get(&format!("{path}/measurements.dcm{query}"));
        let bytes = file.send().await.unwrap().bytes().await.unwrap();
        let report = from_reader(&*bytes).unwrap();
        let flag = report.element(VERIFICATION_FLAG).unwrap();
        assert_eq!(flag.to_str().unwrap(), "VERIFIED");
        let observers = report.element(VERIFYING_OBSERVERS).unwrap();
        let name = observers.items().unwrap()[0]
            .element(Tag(0x0040, 0xA075))
            .unwrap();
        assert_eq!(name.to_str().unwrap().trim_end(), reader);
        let said = String::from_utf8_lossy(&bytes);
        assert_eq!(said.contains("No perfusion defect."), query.is_empty());
        assert!(said.contains("Segment 7, scan, by the reader"));
    }
    // The report of the result itself is another object, and stays unverified.
    let file = service.get(&format!("{}/measurements.dcm", text(&fit["links"]["self"])));
    let bytes = file.send().await.unwrap().bytes().await.unwrap();
    let report = from_reader(&*bytes).unwrap();
    let flag = report.element(VERIFICATION_FLAG).unwrap();
    assert_eq!(flag.to_str().unwrap(), "UNVERIFIED");
}
