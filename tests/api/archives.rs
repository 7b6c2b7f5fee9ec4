//! Archives: what jobs say of them, fetching scans, sending results.

use crate::dicom::{JANE, nm};
use crate::fake_archive::{FakeArchive, FakeScp, Fault, implicit};
use crate::helpers::{TestApp, fake_engine, problem, sphere, text};
use serde_json::{Map, Value, json};
use std::sync::Arc;
use std::time::{Duration, Instant};
use ventriform::archive::{Archive, Archives, Credentials};
use ventriform::config::Settings;
use ventriform::jobs::{
    Failure, GivenParameters, Resource, StoredItem, Work, WorkError, WorkInput, WorkOutput,
};
use ventriform::progress::{Monitor, Plan};
use ventriform::volume::ReadLimits;
use ventriform::work::Engine;

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
    json!({"source": {"archive": "pacs", "study": STUDY, "series": SERIES}})
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
        format!("/dicom-web/studies/{STUDY}/series/{SERIES}")
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
        assert!(!job["error"].to_string().contains(STUDY));
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

#[tokio::test]
async fn a_listed_service_is_used_without_credentials() {
    let fake = FakeArchive::start(&[b"VOLUME sphere"]).await;
    let app = TestApp::with(|settings| {
        settings.dicomweb_allow = "127.0.0.1".parse().unwrap();
    })
    .await;
    let order = json!({"source": {"dicomweb": fake.url, "study": STUDY, "series": SERIES}});
    let job = pulled(&app, &order).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let asked = fake.asked();
    assert!(
        asked
            .iter()
            .all(|asked| !asked.headers.contains_key("authorization"))
    );
}

/// What a model can send.
const OBJECTS: [&str; 4] = ["mask.dcm", "contours.dcm", "mesh.dcm", "surface.dcm"];

/// Work that reads real volumes and makes a sphere of each.
struct Sphere(Arc<dyn Work>);

impl Work for Sphere {
    fn makes(&self) -> Resource {
        self.0.makes()
    }

    fn plan(&self) -> Plan {
        self.0.plan()
    }

    fn check_parameters(&self, given: GivenParameters<'_>) -> Result<Map<String, Value>, Failure> {
        self.0.check_parameters(given)
    }

    fn run(&self, _: &WorkInput, _: &Monitor<'_>) -> Result<WorkOutput, WorkError> {
        Ok(sphere())
    }

    fn page_files(&self) -> &'static [&'static str] {
        self.0.page_files()
    }

    fn page(&self, product: &StoredItem) -> Result<String, Failure> {
        self.0.page(product)
    }
}

fn engine() -> Engine {
    let real = Engine::new(ReadLimits::default());
    let quick = |work: &Arc<dyn Work>| -> Arc<dyn Work> { Arc::new(Sphere(work.clone())) };
    Engine {
        works: real.works.iter().map(quick).collect(),
        ..real
    }
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
    let job = sending(&app, &OBJECTS, "pacs").await;
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
    assert_eq!(names, OBJECTS);
    let mut found = outcomes(&job);
    found.sort();
    assert_eq!(found, ["present", "stored", "stored", "stored"]);
    let (stored, storings) = fake.stored();
    assert_eq!((stored.len(), storings), (4, 4));
    for name in OBJECTS {
        let path = format!("{}/{name}", text(&job["links"]["model"]));
        let offered = app.get(&path).send().await.unwrap().bytes().await.unwrap();
        assert!(stored.values().any(|object| *object == offered), "{name}");
    }

    // The same result is not stored twice.
    let again = sending(&app, &OBJECTS, "pacs").await;
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
    // Noted events are written within a second.
    tokio::time::sleep(Duration::from_millis(1500)).await;
    let trail = app.json("/v1/audit?limit=100").await.to_string();
    assert!(trail.contains("archive exchange"), "{trail}");
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
    fake.recover();
    let other = sent(&app, &other, "dead").await;
    assert_eq!(outcomes(&other), ["erased"]);
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
