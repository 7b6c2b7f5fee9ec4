//! The quotas of a tenant hold whichever way something comes: requests, STOW-RS, C-STORE, archives, rules, work
//! items, the command line; one by one and many at a time.

use crate::archives::{STUDY_UID, archive};
use crate::fake_archive::FakeArchive;
use crate::helpers::{TestApp, engine_with, fake_engine, mesh_json, problem, text, volume};
use crate::readers::profile;
use crate::scu::{Scu, nuclear, slice};
use futures::future::join_all;
use reqwest::{RequestBuilder, StatusCode};
use serde_json::{Value, json};
use std::net::SocketAddr;
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};
use ventriform::base::progress::{Monitor, Stage};
use ventriform::mesh::shapes::icosphere;
use ventriform_service::config::Settings;
use ventriform_service::items::WorkOutput;
use ventriform_service::jobs::{WorkError, WorkInput};
use ventriform_service::network::archive::Archives;
use ventriform_service::work::Engine;

const EVENT_PATIENCE: Duration = Duration::from_secs(60);

/// The status of C-STORE for an object that finds no room.
const OUT_OF_RESOURCES: u16 = 0xA700;

/// A service that receives objects, fetches from an archive, and has a rule and a procedure.
async fn service(
    engine: Engine,
    fake: &FakeArchive,
    change: impl FnOnce(&mut Settings),
) -> (TestApp, SocketAddr) {
    let data = Arc::new(tempfile::tempdir().unwrap());
    let pacs = archive(&[("name", "pacs"), ("dicomweb", &fake.url)], &[]);
    let app = TestApp::on(data, engine, |settings| {
        settings.dicom_listen = "127.0.0.1:0".parse().unwrap();
        settings.series_quiet = "100ms".parse().unwrap();
        settings.series_patience = "400ms".parse().unwrap();
        settings.archives = Archives(vec![pacs]);
        settings.archive_backoff = "20ms".parse().unwrap();
        settings.rules = r#"[{ kind = "model" }]"#.parse().unwrap();
        let procedure = r#"[{ code = "LV", scheme = "99TEST", archive = "pacs", kind = "model" }]"#;
        settings.procedures = procedure.parse().unwrap();
        change(settings);
    })
    .await;
    let address = app.running.as_ref().unwrap().dicom_address().unwrap();
    (app, address)
}

fn workitem(app: &TestApp) -> RequestBuilder {
    let text = |vr: &str, value: &str| json!({"vr": vr, "Value": [value]});
    let item = json!([{
        "00741000": text("CS", "SCHEDULED"),
        "00404041": text("CS", "READY"),
        "00404018": {"vr": "SQ", "Value": [{
            "00080100": text("SH", "LV"), "00080102": text("SH", "99TEST"), "00080104": text("LO", "LV")}]},
        "00404021": {"vr": "SQ", "Value": [{
            "0020000D": text("UI", STUDY_UID), "0020000E": text("UI", "1.2.3")}]},
    }]);
    let request = app.post("/dicom-web/workitems");
    let request = request.header("content-type", "application/dicom+json");
    request.body(item.to_string())
}

fn stow(app: &TestApp, object: Vec<u8>) -> RequestBuilder {
    let request = app.post("/dicom-web/studies");
    request
        .header("content-type", "application/dicom")
        .body(object)
}

#[tokio::test(flavor = "multi_thread")]
async fn no_way_in_goes_round_the_quota_of_bytes() {
    let fake = FakeArchive::start(&[&[b' '; 3000], &[b'x'; 3000]]).await;
    let quota = 20_000;
    let (app, address) = service(fake_engine(), &fake, |settings| {
        settings.quota_bytes = format!("{quota}B").parse().unwrap();
    })
    .await;
    let mut large = volume("sphere");
    large.resize(15_000, b' ');
    let stored = app.post("/v1/volumes").body(large).send().await.unwrap();
    assert_eq!(stored.status(), StatusCode::CREATED);
    let id = text(&stored.json::<Value>().await.unwrap()["id"]);
    // There is room for the record of a job that fetches a series, and none for the series.
    let order = json!({"source": {"archive": "pacs", "study": STUDY_UID, "series": "1.2.3"}});
    let filed = app.post("/v1/jobs").json(&order).send().await.unwrap();
    let ended = app
        .until(&filed.json().await.unwrap(), &["failed", "succeeded"])
        .await;
    assert_eq!(
        ended["error"]["type"], "urn:ventriform:problem:storage-quota",
        "{ended}"
    );
    for bytes in [2000, 1000, 500, 200, 100, 50, 30] {
        let mut rest = volume("sphere rest");
        rest.resize(bytes, b' ');
        let sent = app.post("/v1/volumes").body(rest).send().await.unwrap();
        let status = sent.status().as_u16();
        assert!([201, 507].contains(&status), "{status}");
    }
    // Now there is room for nothing.
    let upload = |path: &str| app.post(path).body(volume("sphere other").repeat(40));
    let mesh = mesh_json(&icosphere(20.0, 1));
    let json_body = |path: &str, body: Vec<u8>| {
        app.post(path)
            .header("content-type", "application/json")
            .body(body)
    };
    let ways = [
        ("volume", upload("/v1/volumes")),
        ("model", upload("/v1/models")),
        ("segmentation", upload("/v1/segmentations")),
        ("beat", upload("/v1/beats")),
        (
            "comparison",
            app.post("/v1/comparisons")
                .json(&json!({"stress": id, "rest": "vol_00"})),
        ),
        (
            "normals",
            app.post("/v1/normals").json(&json!({"cases": []})),
        ),
        ("job", app.post("/v1/jobs").json(&json!({"volume": id}))),
        ("fetch", app.post("/v1/jobs").json(&order)),
        ("template", json_body("/v1/templates?organ=generic", mesh)),
        ("reader", app.post("/v1/readers").json(&profile(1.25))),
        ("work item", workitem(&app)),
        ("STOW-RS", stow(&app, slice("1.2.5", 1).file())),
    ];
    for (way, request) in ways {
        let answer = request.send().await.unwrap();
        assert_eq!(answer.status(), 507, "{way}");
        problem(answer, 507, "storage-quota").await;
    }
    let mut scu = Scu::open(address);
    assert_eq!(scu.store(&slice("1.2.5", 1)), OUT_OF_RESOURCES);
    scu.release();
    // The command line meets it in the same folder.
    let data = app.stop().await;
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("model.json");
    std::fs::write(&model, mesh_json(&icosphere(20.0, 1))).unwrap();
    let import = |quota: u64| {
        let run = Command::new(env!("CARGO_BIN_EXE_ventriform"))
            .args(["templates", "import", "--organ", "generic", "--data-dir"])
            .args([data.path(), &model])
            .env("VENTRIFORM_QUOTA_BYTES", format!("{quota}B"))
            .output()
            .unwrap();
        (
            run.status.success(),
            String::from_utf8_lossy(&run.stderr).into_owned(),
        )
    };
    let (done, said) = import(quota);
    assert!(
        !done && said.contains("20000 bytes that it may store"),
        "{said}"
    );
    assert!(import(10 * quota).0);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_texts_of_a_job_count_before_it_is_filed() {
    let app = TestApp::with(|settings| settings.quota_bytes = "6000B".parse().unwrap()).await;
    let id = app.volume("sphere").await;
    let labels: serde_json::Map<String, Value> = (0..16)
        .map(|n| (format!("label-{n}"), json!("x".repeat(256))))
        .collect();
    let file = |order: Value| app.post("/v1/jobs").json(&order).send();
    let wordy = file(json!({"volume": id, "labels": labels})).await.unwrap();
    problem(wordy, 507, "storage-quota").await;
    let short = file(json!({"volume": id})).await.unwrap();
    assert_eq!(short.status(), StatusCode::ACCEPTED);
}

/// A computation that takes longer than any test.
fn compute_endlessly(_: &WorkInput, monitor: &Monitor<'_>) -> Result<WorkOutput, WorkError> {
    loop {
        monitor.report(Stage::Retile, 0.5)?;
        std::thread::sleep(Duration::from_millis(5));
    }
}

async fn jobs(app: &TestApp) -> Vec<Value> {
    let list = app.json("/v1/jobs?limit=100").await;
    list["jobs"].as_array().unwrap().clone()
}

/// Waits until `holds` of what the service answers on that path.
async fn becomes(app: &TestApp, path: &str, holds: impl Fn(&Value) -> bool) {
    let deadline = Instant::now() + EVENT_PATIENCE;
    loop {
        let answer = app.json(path).await;
        if holds(&answer) {
            return;
        }
        assert!(Instant::now() < deadline, "still {answer}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn no_way_in_goes_round_the_quota_of_jobs() {
    let fake = FakeArchive::start(&[b"VOLUME sphere"]).await;
    let (app, address) = service(engine_with(compute_endlessly), &fake, |settings| {
        settings.quota_jobs = "1".parse().unwrap();
        settings.workers = "1".parse().unwrap();
    })
    .await;
    let object = nuclear("1.2.3", 1, "RECON TOMO").file();
    let stored = app
        .post("/v1/volumes")
        .body(object.clone())
        .send()
        .await
        .unwrap();
    assert_eq!(stored.status(), StatusCode::CREATED);
    let id = text(&stored.json::<Value>().await.unwrap()["id"]);
    let file = || app.post("/v1/jobs").json(&json!({"volume": id})).send();
    let first: Value = file().await.unwrap().json().await.unwrap();
    app.until(&first, &["running"]).await;
    let waiting: Value = file().await.unwrap().json().await.unwrap();
    problem(file().await.unwrap(), 429, "job-quota").await;
    let uploaded = app.post("/v1/models").body(object).send().await.unwrap();
    problem(uploaded, 429, "job-quota").await;
    // The volume of a received series is made, its job has to wait; so has the job of a work item.
    let mut scu = Scu::open(address);
    assert_eq!(scu.store(&nuclear("1.2.4", 1, "RECON TOMO")), 0);
    scu.release();
    becomes(&app, "/v1/intake", |list| {
        list["intake"][0]["state"] == "filing"
    })
    .await;
    let made = workitem(&app).send().await.unwrap();
    assert_eq!(made.status(), StatusCode::CREATED);
    let path = made.headers()["location"].to_str().unwrap().to_owned();
    becomes(&app, &path, |item| {
        item[0]["00741000"]["Value"][0] == "IN PROGRESS"
    })
    .await;
    tokio::time::sleep(Duration::from_secs(2)).await;
    assert_eq!(jobs(&app).await.len(), 2);
    // As soon as no job waits, one of the two is filed, and the other waits for that one.
    let cancelled = app.delete(&text(&waiting["links"]["self"])).send().await;
    assert_eq!(cancelled.unwrap().status(), StatusCode::OK);
    becomes(&app, "/v1/jobs", |list| {
        list["jobs"].as_array().unwrap().len() == 3
    })
    .await;
    tokio::time::sleep(Duration::from_secs(2)).await;
    assert_eq!(jobs(&app).await.len(), 3);
}

#[tokio::test(flavor = "multi_thread")]
async fn twenty_at_a_time_do_not_exceed_a_quota_together() {
    let fake = FakeArchive::start(&[]).await;
    let quota: usize = 10_000;
    let (app, address) = service(fake_engine(), &fake, |settings| {
        settings.quota_bytes = format!("{quota}B").parse().unwrap();
        settings.rules = "[]".parse().unwrap();
        settings.series_quiet = "1h".parse().unwrap();
    })
    .await;
    let object = |number| slice("1.2.6", number).file();
    let length = object(1).len();
    let uploads = (0..10_usize).map(|n| {
        let mut body = volume(&format!("sphere {n}"));
        body.resize(length, b' ');
        app.post("/v1/volumes").body(body).send()
    });
    let objects = (1..=10).map(|n| stow(&app, object(n)).send());
    let received = tokio::task::spawn_blocking(move || {
        let mut scu = Scu::open(address);
        let stored = (11..=20)
            .filter(|n| scu.store(&slice("1.2.6", *n)) == 0)
            .count();
        scu.release();
        stored
    });
    let (uploads, objects, received) = tokio::join!(join_all(uploads), join_all(objects), received);
    let stored = uploads.into_iter().chain(objects).filter(|answer| {
        answer
            .as_ref()
            .is_ok_and(|answer| answer.status().is_success())
    });
    let stored = stored.count() + received.unwrap();
    // Objects are stored as they were sent, so all have about the same length.
    assert!(
        stored >= 1 && stored * length <= quota + 20 * 200,
        "{stored} of {length} bytes"
    );
}
