//! Archives: what jobs say of them, fetching scans, sending results.

use crate::dicom::{JANE, nm, nm_of};
use crate::fake_archive::{FakeArchive, FakeScp, Fault, implicit};
use crate::gated::beating;
use crate::helpers::{TestApp, engine_with, fake_engine, problem, sphere, text};
use crate::scu::{Object, Scu};
use crate::tls::{Authority, file as pem};
use rcgen::ExtendedKeyUsagePurpose;
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::{Duration, Instant};
use ventriform::image::volume::{ReadLimits, Volume};
use ventriform_service::config::Settings;
use ventriform_service::network::archive::{Archive, Archives, Credentials};
use ventriform_service::work::Engine;

pub const STUDY_UID: &str = "1.2.826.0.1.3680043.8.498.1";
const SERIES_UID: &str = "1.2.826.0.1.3680043.8.498.1.2";

/// An archive of the settings.
pub fn archive(entry: &[(&str, &str)], tenants: &[&str]) -> Archive {
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
        job["source"]["study"] = json!(STUDY_UID);
        job["source"]["series"] = json!(SERIES_UID);
        let answer = file(&app, &job).await;
        assert_eq!(answer.status(), 202);
        let job: Value = answer.json().await.unwrap();
        assert_eq!(job["volume"], Value::Null);
        assert_eq!(job["state"], "queued");
        assert_eq!(job["source"]["archive"], archive, "{job}");
        assert_eq!(job["source"]["dicomweb"], dicomweb, "{job}");
        assert_eq!(job["source"]["study"], STUDY_UID);
        assert_eq!(job["source"]["series"], SERIES_UID);
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
        let mut source = json!({"study": STUDY_UID, "series": SERIES_UID});
        source
            .as_object_mut()
            .unwrap()
            .extend(more.as_object().unwrap().clone());
        json!({ "source": source })
    };
    let sends = |send: Value, to: Value| json!({"kind": "segmentation", "volume": volume, "parameters": {"model": "auto"}, "send": send, "to": to});
    let both = json!({"volume": volume, "source": {"archive": "pacs", "study": STUDY_UID, "series": SERIES_UID}});
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
    let job = |series: &str, send: Value| json!({"source": {"archive": "pacs", "study": STUDY_UID, "series": series}, "send": send});
    let keyed = |job: Value| {
        app.post("/v1/jobs")
            .header("Idempotency-Key", "k1")
            .json(&job)
            .send()
    };
    let first = keyed(job(SERIES_UID, json!(["mesh.dcm"]))).await.unwrap();
    let first: Value = first.json().await.unwrap();
    let again = keyed(job(SERIES_UID, json!(["mesh.dcm"]))).await.unwrap();
    let again: Value = again.json().await.unwrap();
    assert_eq!(again["id"], first["id"]);
    for other in [
        job("1.2.3", json!(["mesh.dcm"])),
        job(SERIES_UID, json!(["surface.dcm"])),
    ] {
        problem(keyed(other).await.unwrap(), 422, "idempotency-key-reused").await;
    }
}

/// A service whose only archive is that one, with fast retries.
async fn app_with(archive: &FakeArchive, change: impl FnOnce(&mut Settings)) -> TestApp {
    TestApp::with(|settings| {
        set(settings, archive);
        change(settings);
    })
    .await
}

fn set(settings: &mut Settings, fake: &FakeArchive) {
    let mut pacs = archive(&[("name", "pacs"), ("dicomweb", &fake.url)], &[]);
    pacs.credentials = Credentials::Basic {
        username: "me".into(),
        password: "secret".into(),
    };
    settings.archives = Archives(vec![pacs]);
    settings.archive_backoff = "20ms".parse().unwrap();
    settings.archive_timeout = "5s".parse().unwrap();
}

fn order() -> Value {
    json!({"source": {"archive": "pacs", "study": STUDY_UID, "series": SERIES_UID}})
}

/// Files a job on the series and waits for its end.
async fn pulled(app: &TestApp, order: &Value) -> Value {
    let answer = file(app, order).await;
    assert_eq!(answer.status(), 202);
    let job: Value = answer.json().await.unwrap();
    app.until(&job, &["succeeded", "failed"]).await
}

#[tokio::test]
async fn a_series_is_fetched_stored_and_computed() {
    let one = b"VOLUME sphere one";
    let fake = FakeArchive::start(&[one, b"VOLUME sphere two", one]).await;
    let app = app_with(&fake, |_| {}).await;
    let job = pulled(&app, &order()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    assert_eq!(job["source"]["state"], "fetched");
    assert_eq!(job["source"]["attempts"], 1);
    assert_eq!(job["source"]["last_error"], Value::Null);
    assert_eq!(job["attempts"], 1);
    let volume = app.json(&text(&job["links"]["volume"])).await;
    assert_eq!(volume["id"], job["volume"]);
    // The fake reader lists the files as warnings: a file that came twice is one.
    assert_eq!(volume["warnings"], json!(["0000.nii", "0001.nii"]));
    let [asked] = &fake.transfers()[..] else {
        panic!("{:?}", fake.transfers());
    };
    assert_eq!(asked.method, "GET");
    assert_eq!(
        asked.path,
        format!("/dicom-web/studies/{STUDY_UID}/series/{SERIES_UID}")
    );
    assert_eq!(
        asked.headers["accept"],
        "multipart/related; type=\"application/dicom\"; transfer-syntax=*"
    );
    assert_eq!(asked.headers["authorization"], "Basic bWU6c2VjcmV0");
}

#[tokio::test]
async fn a_series_that_is_held_and_unchanged_is_not_fetched_again() {
    let fake = FakeArchive::start(&[b"VOLUME sphere"]).await;
    let app = app_with(&fake, |_| {}).await;
    let first = pulled(&app, &order()).await;
    let second = pulled(&app, &order()).await;
    assert_eq!(second["state"], "succeeded");
    assert_eq!(second["volume"], first["volume"]);
    assert_eq!(fake.transfers().len(), 1);
    // The series has grown.
    fake.hold(&[b"VOLUME sphere", b"VOLUME sphere more"]);
    let third = pulled(&app, &order()).await;
    assert_ne!(third["volume"], first["volume"]);
    assert_eq!(fake.transfers().len(), 2);
    // The volume was erased.
    let path = format!("/v1/volumes/{}?cascade=true", text(&third["volume"]));
    assert!(
        app.delete(&path)
            .send()
            .await
            .unwrap()
            .status()
            .is_success()
    );
    let fourth = pulled(&app, &order()).await;
    assert_eq!(fourth["volume"], third["volume"]);
    assert_eq!(fake.transfers().len(), 3);
    // The archive does not search.
    fake.search(false);
    pulled(&app, &order()).await;
    assert_eq!(fake.transfers().len(), 4);
}

#[tokio::test]
async fn what_may_pass_is_tried_again() {
    let fake = FakeArchive::start(&[b"VOLUME sphere"]).await;
    fake.fail(&[Fault::Status(500), Fault::Cut, Fault::Status(429)]);
    let app = app_with(&fake, |_| {}).await;
    let job = pulled(&app, &order()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    assert_eq!(job["source"]["attempts"], 4);
    let metrics = app.metrics().await;
    for line in [
        "ventriform_archive_fetches_total{outcome=\"done\"} 1",
        "ventriform_archive_fetches_total{outcome=\"failed\"} 3",
        "ventriform_archive_fetches_pending 0",
    ] {
        assert!(metrics.contains(line), "{line}");
    }
}

#[tokio::test]
async fn what_lasts_fails_the_job_with_its_reason() {
    let elsewhere = FakeArchive::start(&[b"VOLUME sphere"]).await;
    let fake = FakeArchive::start(&[b"VOLUME sphere"]).await;
    let app = app_with(&fake, |settings| {
        settings.body_limit = "1MiB".parse().unwrap();
        settings.parts_limit = 3;
    })
    .await;
    for (fault, code) in [
        (Fault::Status(404), "no-such-series"),
        (Fault::Status(401), "archive-credentials"),
        (Fault::Status(403), "archive-refuses"),
        (Fault::Page, "archive-answer"),
        (Fault::Boundary, "archive-answer"),
        (Fault::Endless, "too-large"),
        (Fault::Redirect(elsewhere.url.clone()), "archive-answer"),
        (
            Fault::Redirect("http://169.254.169.254/latest".into()),
            "archive-answer",
        ),
    ] {
        fake.fail(std::slice::from_ref(&fault));
        let job = pulled(&app, &order()).await;
        assert_eq!(job["state"], "failed", "{fault:?}: {job}");
        let kind = format!("urn:ventriform:problem:{code}");
        assert_eq!(job["error"]["type"], kind, "{fault:?}: {job}");
        assert!(!text(&job["error"]["fix"]).is_empty());
        assert!(!job["error"].to_string().contains(STUDY_UID));
        assert_eq!(job["source"]["state"], "failed");
        assert_eq!(job["volume"], Value::Null);
    }
    assert!(elsewhere.asked().is_empty(), "redirects are not followed");
    for (series, code) in [
        (&[&b"no volume"[..]][..], "unrecognised-format"),
        (
            &[&b"VOLUME a"[..], b"VOLUME b", b"VOLUME c", b"VOLUME d"],
            "too-large",
        ),
    ] {
        fake.hold(series);
        let job = pulled(&app, &order()).await;
        let kind = format!("urn:ventriform:problem:{code}");
        assert_eq!(job["error"]["type"], kind, "{job}");
    }
    assert!(app.stored().is_empty(), "{:?}", app.stored());
}

#[tokio::test]
async fn an_archive_that_does_not_answer_is_given_up_at_last() {
    let fake = FakeArchive::start(&[b"VOLUME sphere"]).await;
    fake.fail(&[Fault::Status(503), Fault::Silence]);
    let app = app_with(&fake, |settings| {
        settings.archive_attempts = 2;
        settings.archive_timeout = "200ms".parse().unwrap();
    })
    .await;
    let job = pulled(&app, &order()).await;
    assert_eq!(
        job["error"]["type"],
        "urn:ventriform:problem:archive-unavailable"
    );
    assert!(text(&job["error"]["detail"]).contains("2 attempts"));
    assert_eq!(job["source"]["attempts"], 2);
}

#[tokio::test]
async fn a_waiting_fetch_survives_a_restart_and_ends_with_its_job() {
    let fake = FakeArchive::start(&[b"VOLUME sphere"]).await;
    fake.fail(&[Fault::Silence, Fault::Silence, Fault::Silence]);
    let app = app_with(&fake, |settings| {
        settings.shutdown_grace = "50ms".parse().unwrap();
    })
    .await;
    let job: Value = file(&app, &order()).await.json().await.unwrap();
    let other: Value = file(&app, &order()).await.json().await.unwrap();
    while fake.transfers().len() < 2 {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    app.delete(&text(&other["links"]["self"]))
        .send()
        .await
        .unwrap();
    let cancelled = app.until(&other, &["cancelled"]).await;
    assert_eq!(cancelled["source"]["state"], "failed");
    let data = app.stop().await;
    fake.recover();
    let app = TestApp::on(data, fake_engine(), |settings| set(settings, &fake)).await;
    let job = app.until(&job, &["succeeded"]).await;
    assert_eq!(job["source"]["state"], "fetched");
    let cancelled = app.json(&text(&other["links"]["self"])).await;
    assert_eq!(cancelled["state"], "cancelled");
    assert_eq!(cancelled["volume"], Value::Null);
}

/// Otherwise a fetch with which the process ends would be repeated after every start.
#[tokio::test]
async fn a_fetch_during_which_the_service_ended_counts() {
    let fake = FakeArchive::start(&[b"VOLUME sphere"]).await;
    fake.fail(&[Fault::Silence]);
    let app = app_with(&fake, |settings| {
        settings.archive_attempts = 1;
        settings.shutdown_grace = "50ms".parse().unwrap();
    })
    .await;
    let job: Value = file(&app, &order()).await.json().await.unwrap();
    while fake.transfers().is_empty() {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let data = app.stop().await;
    fake.recover();
    let app = TestApp::on(data, fake_engine(), |settings| {
        set(settings, &fake);
        settings.archive_attempts = 1;
    })
    .await;
    let job = app.until(&job, &["failed"]).await;
    assert_eq!(
        job["error"]["type"],
        "urn:ventriform:problem:archive-unavailable"
    );
    assert_eq!(job["source"]["attempts"], 1);
    assert_eq!(fake.transfers().len(), 1);
}

/// As with fetches.
#[tokio::test]
async fn a_delivery_during_which_the_service_ended_counts() {
    let once = |settings: &mut Settings| {
        settings.archive_attempts = 1;
        settings.shutdown_grace = "50ms".parse().unwrap();
    };
    let (app, fake) = real(once).await;
    fake.fail_storing(&[Fault::Silence]);
    let job = sending(&app, &["mesh.dcm"], "pacs").await;
    let path = text(&job["links"]["self"]);
    let deadline = Instant::now() + Duration::from_secs(60);
    while app.json(&path).await["deliveries"][0]["attempts"] != 1 {
        assert!(Instant::now() < deadline, "{}", app.json(&path).await);
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let data = app.stop().await;
    fake.recover();
    let app = TestApp::on(data, engine(), |settings| {
        set(settings, &fake);
        once(settings);
    })
    .await;
    let job = sent(&app, &job, "dead").await;
    assert_eq!(job["deliveries"][0]["attempts"], 1);
    let why = text(&job["deliveries"][0]["last_error"]);
    assert!(why.contains("was not written down"), "{why}");
    assert_eq!(fake.stored().1, 0);
}

#[tokio::test]
async fn a_listed_service_is_used_without_credentials() {
    let fake = FakeArchive::start(&[b"VOLUME sphere"]).await;
    let app = TestApp::with(|settings| {
        settings.dicomweb_allow = "127.0.0.1".parse().unwrap();
    })
    .await;
    let order = json!({"source": {"dicomweb": fake.url, "study": STUDY_UID, "series": SERIES_UID}});
    let job = pulled(&app, &order).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let asked = fake.asked();
    assert!(
        asked
            .iter()
            .all(|asked| !asked.headers.contains_key("authorization"))
    );
}

/// The objects that a model can send.
const SENT_OBJECTS: [&str; 4] = ["mask.dcm", "contours.dcm", "mesh.dcm", "surface.dcm"];

/// Reads real volumes and makes a sphere of each.
fn engine() -> Engine {
    engine_with(|_, _| Ok(sphere()))
}

/// A service that reads real volumes, and an archive that holds the scan of a patient.
async fn real(change: impl FnOnce(&mut Settings)) -> (TestApp, FakeArchive) {
    let fake = FakeArchive::start(&[&nm(&JANE, 1)]).await;
    let data = Arc::new(tempfile::tempdir().unwrap());
    let app = TestApp::on(data, engine(), |settings| {
        set(settings, &fake);
        change(settings);
    })
    .await;
    (app, fake)
}

/// Files a job on the patient's scan that sends these objects.
async fn sending(app: &TestApp, objects: &[&str], to: &str) -> Value {
    let series = format!("{}.2", JANE.study);
    let order = json!({
        "source": {"archive": "pacs", "study": JANE.study, "series": series},
        "parameters": {"points": 60}, "send": objects, "to": to,
    });
    let answer = file(app, &order).await;
    assert_eq!(answer.status(), 202);
    answer.json().await.unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_rule_makes_a_beat_and_delivers_its_objects() {
    let names = ["mask_ed.dcm", "mask_es.dcm", "measurements.dcm"];
    let rule = format!(
        r#"[{{ image_type = "RECON GATED TOMO", kind = "beat", send = {names:?}, to = "pacs" }}]"#
    );
    let fake = FakeArchive::start(&[]).await;
    let data = Arc::new(tempfile::tempdir().unwrap());
    let app = TestApp::on(data, Engine::new(ReadLimits::default()), |settings| {
        set(settings, &fake);
        settings.dicom_listen = "127.0.0.1:0".parse().unwrap();
        settings.series_quiet = "100ms".parse().unwrap();
        settings.rules = rule.parse().unwrap();
    })
    .await;
    let gates: Vec<&Volume> = beating().iter().collect();
    let mut scu = Scu::open(app.running.as_ref().unwrap().dicom_address().unwrap());
    assert_eq!(scu.store(&Object::of_nm(&nm_of(&JANE, &gates))), 0);
    scu.release();
    let deadline = Instant::now() + Duration::from_secs(20);
    let job = loop {
        let jobs = app.json("/v1/jobs").await;
        match &jobs["jobs"][0] {
            Value::Null => assert!(Instant::now() < deadline, "no job"),
            job => break job.clone(),
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    };
    let job = sent(&app, &job, "delivered").await;
    assert_eq!(job["kind"], "beat");
    let deliveries = job["deliveries"].as_array().unwrap().iter();
    assert_eq!(
        deliveries.map(|d| text(&d["name"])).collect::<Vec<_>>(),
        names
    );
    let (stored, storings) = fake.stored();
    assert_eq!((stored.len(), storings), (3, 3));
    for name in names {
        let path = format!("{}/{name}", text(&job["links"]["beat"]));
        let offered = app.get(&path).send().await.unwrap().bytes().await.unwrap();
        assert!(stored.values().any(|object| *object == offered), "{name}");
    }
}

/// Waits until all deliveries of a job are in that state; returns the job.
async fn sent(app: &TestApp, job: &Value, state: &str) -> Value {
    let path = text(&job["links"]["self"]);
    let deadline = Instant::now() + Duration::from_secs(120);
    loop {
        let job = app.json(&path).await;
        assert_ne!(job["state"], "failed", "{job}");
        let deliveries = job["deliveries"].as_array().unwrap();
        if job["state"] == "succeeded" && deliveries.iter().all(|d| d["state"] == state) {
            return job;
        }
        assert!(Instant::now() < deadline, "not {state}: {job}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

fn outcomes(job: &Value) -> Vec<String> {
    let deliveries = job["deliveries"].as_array().unwrap().iter();
    deliveries.map(|d| text(&d["last_outcome"])).collect()
}

#[tokio::test]
async fn results_are_delivered_once_whatever_happens() {
    let (app, fake) = real(|_| {}).await;
    fake.fail_storing(&[
        Fault::Status(503),
        Fault::LostAnswer,
        Fault::Status(401),
        Fault::Failure(0xA700),
        Fault::Page,
    ]);
    let job = sending(&app, &SENT_OBJECTS, "pacs").await;
    assert_eq!(job["deliveries"][0]["name"], "mask.dcm");
    assert_eq!(job["deliveries"][0]["state"], "pending");
    let job = sent(&app, &job, "delivered").await;
    let names: Vec<String> = job["deliveries"]
        .as_array()
        .unwrap()
        .iter()
        .map(|delivery| {
            assert_eq!(delivery["to"], "pacs");
            assert_eq!(delivery["last_error"], Value::Null);
            text(&delivery["name"])
        })
        .collect();
    assert_eq!(names, SENT_OBJECTS);
    let mut found = outcomes(&job);
    found.sort();
    assert_eq!(found, ["present", "stored", "stored", "stored"]);
    let (stored, storings) = fake.stored();
    assert_eq!((stored.len(), storings), (4, 4));
    for name in SENT_OBJECTS {
        let path = format!("{}/{name}", text(&job["links"]["model"]));
        let offered = app.get(&path).send().await.unwrap().bytes().await.unwrap();
        assert!(stored.values().any(|object| *object == offered), "{name}");
    }

    // The same result is not stored twice.
    let again = sending(&app, &SENT_OBJECTS, "pacs").await;
    let again = sent(&app, &again, "delivered").await;
    assert_eq!(again["model"], job["model"]);
    assert_eq!(outcomes(&again), ["present"; 4]);
    assert_eq!(fake.stored().1, 4);

    // What the archive refuses is shown, and sent again on request.
    fake.forget();
    fake.fail_storing(&[Fault::Failure(0xC000)]);
    let refused = sending(&app, &["mesh.dcm"], "pacs").await;
    let refused = sent(&app, &refused, "dead").await;
    let delivery = &refused["deliveries"][0];
    assert_eq!(delivery["last_outcome"], "refused");
    assert!(
        text(&delivery["last_error"]).contains("C000H"),
        "{delivery}"
    );
    let itself = text(&refused["links"]["self"]);
    let path = format!("{itself}/deliveries/{}/redeliver", text(&delivery["id"]));
    let answer = app.post(&path).send().await.unwrap();
    assert_eq!(answer.status(), 202);
    sent(&app, &refused, "delivered").await;
    let unknown = format!("{itself}/deliveries/snd_0/redeliver");
    problem(app.post(&unknown).send().await.unwrap(), 404, "not-found").await;
    let metrics = app.metrics().await;
    for line in [
        "ventriform_archive_deliveries_total{outcome=\"failed\"} 5",
        "ventriform_archive_deliveries_total{outcome=\"given-up\"} 1",
        "ventriform_archive_deliveries_pending 0",
        "ventriform_archive_deliveries_dead 0",
    ] {
        assert!(metrics.contains(line), "{line}");
    }
    let trail = app
        .json("/v1/audit?limit=100&agent=archive%20exchange")
        .await;
    let trail = trail.to_string();
    for item in [&refused["id"], &refused["volume"]] {
        assert!(trail.contains(&text(item)), "{item}: {trail}");
    }
}

#[tokio::test]
async fn deliveries_survive_a_restart_and_end_with_their_result() {
    let (app, fake) = real(|settings| settings.archive_backoff = "200ms".parse().unwrap()).await;
    let down = vec![Fault::Status(503); 1000];
    fake.fail_storing(&down);
    let job = sending(&app, &["mesh.dcm"], "pacs").await;
    sent(&app, &job, "pending").await;
    let data = app.stop().await;
    fake.recover();
    let app = TestApp::on(data, engine(), |settings| set(settings, &fake)).await;
    let job = sent(&app, &job, "delivered").await;
    assert_eq!(fake.stored().1, 1);

    fake.forget();
    fake.fail_storing(&down);
    let other = sending(&app, &["mesh.dcm"], "pacs").await;
    sent(&app, &other, "pending").await;
    let erased = app.delete(&text(&job["links"]["model"])).send().await;
    assert!(erased.unwrap().status().is_success());
    // An attempt that began before may still be on its way; the archive refuses that one too.
    let other = sent(&app, &other, "dead").await;
    fake.recover();
    assert_eq!(outcomes(&other), ["erased"]);
    tokio::time::sleep(Duration::from_millis(500)).await;
    assert_eq!(fake.stored().1, 1);
}

#[tokio::test]
async fn an_old_archive_takes_objects_by_c_store() {
    let scp = FakeScp::start(&[0xA700, 0x0000]);
    let address = scp.address.clone();
    let (app, _) = real(move |settings| {
        let entry = [
            ("name", "old"),
            ("dicom", address.as_str()),
            ("ae_title", "OLD"),
        ];
        settings.archives.0.push(archive(&entry, &[]));
    })
    .await;
    let job = sending(&app, &["surface.dcm"], "old").await;
    let job = sent(&app, &job, "delivered").await;
    assert_eq!(job["deliveries"][0]["attempts"], 2);
    let path = format!("{}/surface.dcm", text(&job["links"]["model"]));
    let offered = app.get(&path).send().await.unwrap().bytes().await.unwrap();
    let offered = dicom_object::from_reader(&offered[..]).unwrap();
    let received = scp.received();
    assert_eq!(received.len(), 2);
    for (titles, data_set) in received {
        assert_eq!(titles, "VENTRIFORM -> OLD");
        assert_eq!(implicit(&data_set), implicit(&offered));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn objects_go_over_tls_from_and_to_those_who_are_known() {
    let folder = tempfile::tempdir().unwrap();
    let (hospital, stranger) = (Authority::new(), Authority::new());
    hospital.equip(folder.path());
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    write("ca.pem", hospital.pem());
    write("stranger.pem", stranger.pem());
    let (certificate, key) = hospital.sign(&["client"], ExtendedKeyUsagePurpose::ClientAuth);
    write("own.pem", certificate);
    write("own.key", key);
    let data = Arc::new(tempfile::tempdir().unwrap());
    let receiver = TestApp::on(data, engine(), |settings| {
        settings.dicom_listen = "127.0.0.1:0".parse().unwrap();
        settings.dicom_tls_cert = pem(folder.path(), "cert.pem");
        settings.dicom_tls_key = pem(folder.path(), "key.pem");
        settings.dicom_tls_client_ca = pem(folder.path(), "ca.pem");
    })
    .await;
    let address = receiver.running.as_ref().unwrap().dicom_address().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let own = [
        ("dicom_cert_file", path("own.pem")),
        ("dicom_key_file", path("own.key")),
    ];
    let (app, _) = real(|settings| {
        settings.archive_backoff = "50ms".parse().unwrap();
        for (name, authority, own) in [
            ("known", "ca.pem", &own[..]),
            ("nameless", "ca.pem", &[]),
            ("doubted", "stranger.pem", &own[..]),
        ] {
            let address = address.to_string();
            let authority = path(authority);
            let mut entry = vec![
                ("name", name),
                ("dicom", &address),
                ("ae_title", "VENTRIFORM"),
                ("dicom_ca_file", &authority),
            ];
            entry.extend(own.iter().map(|(key, file)| (*key, file.as_str())));
            settings.archives.0.push(archive(&entry, &[]));
        }
    })
    .await;
    let job = sending(&app, &["mask.dcm"], "known").await;
    let job = sent(&app, &job, "delivered").await;
    assert_eq!(outcomes(&job), ["stored"]);
    let received = receiver.json("/v1/intake").await;
    assert_eq!(received["intake"].as_array().unwrap().len(), 1);

    // Neither without a certificate, nor to a certificate of another authority, nor without TLS.
    for name in ["nameless", "doubted"] {
        let job = sending(&app, &["mask.dcm"], name).await;
        let deadline = Instant::now() + Duration::from_secs(60);
        let delivery = loop {
            let job = app.json(&text(&job["links"]["self"])).await;
            let delivery = job["deliveries"][0].clone();
            if delivery["attempts"].as_u64() >= Some(2) {
                break delivery;
            }
            assert!(Instant::now() < deadline, "{job}");
            tokio::time::sleep(Duration::from_millis(20)).await;
        };
        assert_eq!(delivery["state"], "pending", "{name}: {delivery}");
        if name == "doubted" {
            assert!(text(&delivery["last_error"]).contains("TLS"), "{delivery}");
        }
    }
    let plain =
        tokio::task::spawn_blocking(move || Scu::call(address, "CAMERA", "VENTRIFORM").err());
    assert!(plain.await.unwrap().is_some());
}

#[tokio::test]
async fn who_erases_whose_scan_it_is_erases_its_uids_in_jobs() {
    for whole in [false, true] {
        let (app, _) = real(|_| {}).await;
        let job = sending(&app, &["mesh.dcm"], "pacs").await;
        let job = sent(&app, &job, "delivered").await;
        assert_eq!(job["source"]["study"], JANE.study);
        let volume = text(&job["links"]["volume"]);
        let erased = if whole {
            volume.clone()
        } else {
            format!("{volume}/identity")
        };
        let erased = app.delete(&erased).send().await.unwrap();
        assert!(erased.status().is_success());
        let source = app.json(&text(&job["links"]["self"])).await["source"].clone();
        assert_eq!(source["archive"], "pacs");
        assert_eq!(
            (&source["study"], &source["series"]),
            (&Value::Null, &Value::Null)
        );
        let jobs = app.json("/v1/jobs").await.to_string();
        assert!(!jobs.contains(JANE.study), "{jobs}");
    }
}

const ITEMS_PATH: &str = "/dicom-web/workitems";

/// Schedules work on a series of the patient; returns the item's path.
async fn scheduled(app: &TestApp, code: &str, series: &str) -> String {
    let text = |vr: &str, value: &str| json!({"vr": vr, "Value": [value]});
    let body = json!([{
        "00741000": text("CS", "SCHEDULED"),
        "00741200": text("CS", "HIGH"),
        "00404041": text("CS", "READY"),
        "00404018": {"vr": "SQ", "Value": [{
            "00080100": text("SH", code),
            "00080102": text("SH", "99TEST"),
            "00080104": text("LO", "Model of the left ventricle"),
        }]},
        "00404021": {"vr": "SQ", "Value": [{
            "0040E020": text("CS", "DICOM"),
            "0020000D": text("UI", JANE.study),
            "0020000E": text("UI", series),
        }]},
    }]);
    let request = app
        .post(ITEMS_PATH)
        .header("content-type", "application/dicom+json");
    let answer = request.body(body.to_string()).send().await.unwrap();
    assert_eq!(answer.status(), 201);
    answer.headers()["location"].to_str().unwrap().to_owned()
}

/// Waits until an item is in that state; returns it.
async fn becomes(app: &TestApp, path: &str, state: &str) -> Value {
    let deadline = Instant::now() + Duration::from_secs(120);
    loop {
        let item = app.json(path).await[0].clone();
        if item["00741000"]["Value"][0] == state {
            return item;
        }
        assert!(Instant::now() < deadline, "not {state}: {item}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

fn performing(settings: &mut Settings) {
    let procedures = r#"[{ code = "LVMODEL", scheme = "99TEST", archive = "pacs", kind = "model",
        parameters = { points = 60 }, send = ["mesh.dcm", "mask.dcm"] }]"#;
    settings.procedures = procedures.replace('\n', " ").parse().unwrap();
}

#[tokio::test]
async fn work_items_with_the_code_of_a_procedure_are_performed() {
    let (app, fake) = real(performing).await;
    let other = scheduled(&app, "OTHER", "1.2.3").await;
    let path = scheduled(&app, "LVMODEL", "1.2.3").await;
    let item = becomes(&app, &path, "COMPLETED").await;
    let performed = &item["00741216"]["Value"][0];
    let outputs = performed["00404033"]["Value"].as_array().unwrap();
    let mut named: Vec<String> = outputs
        .iter()
        .map(|output| {
            assert_eq!(output["0020000D"]["Value"][0], JANE.study);
            let url = text(&output["0040E025"]["Value"][0]["00081190"]["Value"][0]);
            assert!(
                url.starts_with(&format!("{}/studies/{}", fake.url, JANE.study)),
                "{url}"
            );
            text(&output["00081199"]["Value"][0]["00081155"]["Value"][0])
        })
        .collect();
    named.sort();
    assert_eq!(named, fake.stored().0.into_keys().collect::<Vec<_>>());
    assert_eq!(
        performed["00404019"]["Value"][0]["00080100"]["Value"][0],
        "LVMODEL"
    );
    let progress = &item["00741002"]["Value"][0];
    assert_eq!(progress["00741004"]["Value"][0], "100");
    becomes(&app, &other, "SCHEDULED").await;
    let jobs = app.json("/v1/jobs").await;
    let trail = app.json("/v1/audit?agent=procedure:1").await.to_string();
    let uid = path.rsplit('/').next().unwrap().to_owned();
    for item in [uid, text(&jobs["jobs"][0]["id"])] {
        assert!(trail.contains(&item), "{item}: {trail}");
    }

    // What cannot be done is given up with the reason.
    fake.fail(&[Fault::Status(404)]);
    let path = scheduled(&app, "LVMODEL", "1.2.4").await;
    let item = becomes(&app, &path, "CANCELED").await;
    let reason = text(&item["00741002"]["Value"][0]["00741238"]["Value"][0]);
    assert!(!reason.is_empty());
    let path = scheduled(&app, "LVMODEL", "").await;
    let item = becomes(&app, &path, "CANCELED").await;
    let reason = text(&item["00741002"]["Value"][0]["00741238"]["Value"][0]);
    assert!(reason.contains("Series Instance UID"), "{reason}");

    // Who asks to cancel it ends the job.
    fake.fail(&vec![Fault::Status(503); 1000]);
    let path = scheduled(&app, "LVMODEL", "1.2.5").await;
    becomes(&app, &path, "IN PROGRESS").await;
    let answer = app.post(&format!("{path}/cancelrequest")).send().await;
    assert_eq!(answer.unwrap().status(), 202);
    becomes(&app, &path, "CANCELED").await;
}

#[tokio::test]
async fn a_work_item_is_performed_once_across_a_restart() {
    let (app, fake) = real(performing).await;
    fake.fail_storing(&vec![Fault::Status(503); 1000]);
    let path = scheduled(&app, "LVMODEL", "1.2.3").await;
    becomes(&app, &path, "IN PROGRESS").await;
    let claim = json!([{"00741000": {"vr": "CS", "Value": ["IN PROGRESS"]},
                        "00081195": {"vr": "UI", "Value": ["9.9"]}}]);
    let request = app.client.put(format!("{}{path}/state", app.url));
    let request = request.header("content-type", "application/dicom+json");
    let answer = request.body(claim.to_string()).send().await.unwrap();
    problem(answer, 409, "workitem-state").await;
    let data = app.stop().await;
    fake.recover();
    let app = TestApp::on(data, engine(), |settings| {
        set(settings, &fake);
        performing(settings);
    })
    .await;
    becomes(&app, &path, "COMPLETED").await;
    let jobs = app.json("/v1/jobs").await;
    assert_eq!(jobs["jobs"].as_array().unwrap().len(), 1, "{jobs}");
    assert_eq!(jobs["jobs"][0]["priority"], "urgent");
    assert_eq!(fake.stored().1, 2);
}
