//! Archives: what jobs say of them, fetching scans, sending results.

use crate::helpers::{TestApp, problem, text};
use serde_json::{Value, json};
use ventriform::archive::{Archive, Archives};

const STUDY: &str = "1.2.826.0.1.3680043.8.498.1";
const SERIES: &str = "1.2.826.0.1.3680043.8.498.1.2";

/// An archive of the settings.
fn archive(entry: &[(&str, &str)], tenants: &[&str]) -> Archive {
    let value = |key: &str| entry.iter().find(|(k, _)| *k == key).map(|(_, v)| *v);
    let tenants = tenants.iter().map(|name| name.parse().unwrap()).collect();
    Archive::read(value, tenants).unwrap()
}

/// A service with two archives: one for DICOMweb, one for C-STORE alone.
async fn app_with_archives() -> TestApp {
    TestApp::with(|settings| {
        settings.archives = Archives(vec![
            archive(
                &[
                    ("name", "pacs"),
                    ("dicomweb", "http://127.0.0.1:9/dicom-web"),
                ],
                &[],
            ),
            archive(
                &[
                    ("name", "old"),
                    ("dicom", "127.0.0.1:9"),
                    ("ae_title", "OLD"),
                ],
                &[],
            ),
            archive(
                &[("name", "north"), ("dicomweb", "http://127.0.0.1:9/north")],
                &["north"],
            ),
        ]);
        settings.dicomweb_allow = "127.0.0.2".parse().unwrap();
    })
    .await
}

async fn file(app: &TestApp, job: &Value) -> reqwest::Response {
    app.post("/v1/jobs").json(job).send().await.unwrap()
}

#[tokio::test]
async fn a_job_with_a_source_is_accepted_and_waits_for_its_volume() {
    let app = app_with_archives().await;
    for (source, archive, dicomweb) in [
        (json!({"archive": "pacs"}), json!("pacs"), Value::Null),
        (
            json!({"dicomweb": "http://127.0.0.1:9/dicom-web/"}),
            json!("pacs"),
            Value::Null,
        ),
        (
            json!({"dicomweb": "http://127.0.0.2:9/other/"}),
            Value::Null,
            json!("http://127.0.0.2:9/other"),
        ),
    ] {
        let mut job =
            json!({"kind": "segmentation", "source": source, "parameters": {"model": "auto"}});
        job["source"]["study"] = json!(STUDY);
        job["source"]["series"] = json!(SERIES);
        let answer = file(&app, &job).await;
        assert_eq!(answer.status(), 202);
        let job: Value = answer.json().await.unwrap();
        assert_eq!(job["volume"], Value::Null);
        assert_eq!(job["state"], "queued");
        assert_eq!(job["source"]["archive"], archive, "{job}");
        assert_eq!(job["source"]["dicomweb"], dicomweb, "{job}");
        assert_eq!(job["source"]["study"], STUDY);
        assert_eq!(job["source"]["series"], SERIES);
        let cancelled = app.delete(&text(&job["links"]["self"])).send().await;
        let cancelled: Value = cancelled.unwrap().json().await.unwrap();
        assert_eq!(cancelled["state"], "cancelled");
    }
}

#[tokio::test]
async fn what_a_job_says_of_archives_is_checked() {
    let app = app_with_archives().await;
    let volume = app.volume("sphere").await;
    let series = |more: Value| {
        let mut source = json!({"study": STUDY, "series": SERIES});
        source
            .as_object_mut()
            .unwrap()
            .extend(more.as_object().unwrap().clone());
        json!({ "source": source })
    };
    let sends = |send: Value, to: Value| json!({"kind": "segmentation", "volume": volume, "parameters": {"model": "auto"}, "send": send, "to": to});
    let both =
        json!({"volume": volume, "source": {"archive": "pacs", "study": STUDY, "series": SERIES}});
    for (job, field) in [
        (json!({}), "volume"),
        (json!({"source": "pacs"}), "source"),
        (both, "source"),
        (series(json!({})), "source.archive"),
        (series(json!({"archive": "none"})), "source.archive"),
        (series(json!({"archive": "old"})), "source.archive"),
        (series(json!({"archive": "north"})), "source.archive"),
        (
            series(json!({"archive": "pacs", "dicomweb": "http://127.0.0.2/"})),
            "source.dicomweb",
        ),
        (
            series(json!({"dicomweb": "http://127.0.0.1:9/north"})),
            "source.dicomweb",
        ),
        (
            series(json!({"dicomweb": "http://127.0.0.1:9/else"})),
            "source.dicomweb",
        ),
        (
            series(json!({"dicomweb": "http://127.0.0.2/x?y=z"})),
            "source.dicomweb",
        ),
        (
            series(json!({"dicomweb": "https://8.8.8.8/dicom-web"})),
            "source.dicomweb",
        ),
        (
            series(json!({"archive": "pacs", "study": null})),
            "source.study",
        ),
        (
            series(json!({"archive": "pacs", "series": "1.2/../.."})),
            "source.series",
        ),
        (sends(json!("mask.dcm"), json!("pacs")), "send"),
        (sends(json!([]), json!("pacs")), "send"),
        (sends(json!(["mask.nii.gz"]), json!("pacs")), "send"),
        (
            sends(json!(["mask.dcm", "mask.dcm"]), json!("pacs")),
            "send",
        ),
        (sends(json!(["mask.dcm"]), json!("none")), "to"),
        (sends(json!(["mask.dcm"]), json!("north")), "to"),
        (json!({"volume": volume, "send": ["mesh.dcm"]}), "to"),
        (json!({"volume": volume, "to": "pacs"}), "send"),
        (
            json!({"volume": volume, "send": ["polar.dcm"], "to": "pacs"}),
            "send",
        ),
    ] {
        let answer = file(&app, &job).await;
        assert_eq!(answer.status(), 422, "{job}");
        let body: Value = answer.json().await.unwrap();
        assert_eq!(body["field"], field, "{job}: {body}");
        assert!(!text(&body["fix"]).is_empty());
    }
    let secret = series(json!({"archive": "pacs", "password": "x"}));
    let unknown = problem(file(&app, &secret).await, 400, "unknown-parameter").await;
    assert_eq!(unknown["field"], "source.password");
}

#[tokio::test]
async fn a_key_stands_for_the_source_and_the_order_too() {
    let app = app_with_archives().await;
    let job = |series: &str, send: Value| json!({"source": {"archive": "pacs", "study": STUDY, "series": series}, "send": send});
    let keyed = |job: Value| {
        app.post("/v1/jobs")
            .header("Idempotency-Key", "k1")
            .json(&job)
            .send()
    };
    let first = keyed(job(SERIES, json!(["mesh.dcm"]))).await.unwrap();
    let first: Value = first.json().await.unwrap();
    let again = keyed(job(SERIES, json!(["mesh.dcm"]))).await.unwrap();
    let again: Value = again.json().await.unwrap();
    assert_eq!(again["id"], first["id"]);
    for other in [
        job("1.2.3", json!(["mesh.dcm"])),
        job(SERIES, json!(["surface.dcm"])),
    ] {
        problem(keyed(other).await.unwrap(), 422, "idempotency-key-reused").await;
    }
}
