//! Jobs in a process of their own: kills of the service fail no job, and a job that kills its
//! process harms no other.

use crate::helpers::{Service, TestApp, fake_engine, heart, send_signal, text};
use serde_json::{Map, Value};
use std::ffi::OsString;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use ventriform_service::base::records::{Claimant, Filed, JobStore, NewJob, Tenant};
use ventriform_service::jobs::{Isolation, serve_isolated};
use ventriform_service::work::Engine;
use ventriform_store::Store;

const EVENT_PATIENCE: Duration = Duration::from_secs(30);

/// A job of several seconds.
const LONG_JOB: &str = "/v1/models?points=3000&starts=4&method=paper";

async fn job_of(service: &Service, path: &str) -> String {
    let filed = service.post(path).body(heart().0).send().await.unwrap();
    let job: Value = filed.json().await.unwrap();
    text(&job["id"])
}

async fn state_of(service: &Service, id: &str) -> Value {
    let job = service.get(&format!("/v1/jobs/{id}")).send().await.unwrap();
    job.json().await.unwrap()
}

async fn until_running(service: &Service, id: &str) {
    let deadline = Instant::now() + EVENT_PATIENCE;
    while state_of(service, id).await["state"] != "running" {
        assert!(Instant::now() < deadline);
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

/// The process that computes a job.
async fn child_of(service: &Service, other_than: &[u32]) -> u32 {
    let deadline = Instant::now() + EVENT_PATIENCE;
    loop {
        let children = service.children();
        if let Some(child) = children.iter().find(|child| !other_than.contains(child)) {
            return *child;
        }
        assert!(Instant::now() < deadline, "no process of its own");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

/// Whether a process exists and has not ended.
fn lives(process: u32) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{process}/status"));
    status.is_ok_and(|status| !status.contains("State:\tZ"))
}

#[tokio::test]
async fn kills_of_the_service_fail_no_job_and_leave_no_process() {
    let data = tempfile::tempdir().unwrap();
    let arguments = ["--workers", "1", "--attempt-limit", "2"];
    let mut service = Service::start(data.path(), &arguments).await;
    let id = job_of(&service, LONG_JOB).await;
    for kill in 0..4 {
        until_running(&service, &id).await;
        let child = match kill {
            0 => None,
            _ => Some(child_of(&service, &[]).await),
        };
        service.kill();
        let deadline = Instant::now() + EVENT_PATIENCE;
        while child.is_some_and(lives) {
            assert!(
                Instant::now() < deadline,
                "the process outlives its service"
            );
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        service = Service::start(data.path(), &arguments).await;
    }
    until_running(&service, &id).await;
    assert_eq!(state_of(&service, &id).await["attempts"], 5);
    let cancelled = service.delete(&format!("/v1/jobs/{id}")).send().await;
    assert_eq!(cancelled.unwrap().status(), 202);
    assert_eq!(service.ended(&id).await["state"], "cancelled");
}

#[tokio::test]
async fn a_job_whose_own_process_dies_is_failed_and_the_service_goes_on() {
    let data = tempfile::tempdir().unwrap();
    let arguments = ["--workers", "1", "--attempt-limit", "2"];
    let service = Service::start(data.path(), &arguments).await;
    let id = job_of(&service, LONG_JOB).await;
    until_running(&service, &id).await;
    service.kill();
    let service = Service::start(data.path(), &arguments).await;
    let mut killed = Vec::new();
    for _ in 0..2 {
        let child = child_of(&service, &killed).await;
        send_signal(child, "KILL");
        killed.push(child);
    }
    let job = service.ended(&id).await;
    assert_eq!(job["state"], "failed");
    assert_eq!(job["error"]["type"], "urn:ventriform:problem:attempt-limit");
    let other = job_of(&service, "/v1/models?points=67").await;
    assert_eq!(service.ended(&other).await["state"], "succeeded");
}

#[tokio::test]
async fn a_process_of_its_own_makes_the_same_model() {
    let (data, calm) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let path = "/v1/models?points=400&starts=2";
    let service = Service::start(data.path(), &[]).await;
    let id = job_of(&service, path).await;
    until_running(&service, &id).await;
    service.kill();
    let service = Service::start(data.path(), &[]).await;
    let job = service.ended(&id).await;
    assert_eq!(job["attempts"], 2, "{job}");
    let calm = Service::start(calm.path(), &[]).await;
    let other = job_of(&calm, path).await;
    assert_eq!(job["model"], calm.ended(&other).await["model"]);
}

#[tokio::test]
async fn a_service_that_stood_still_for_longer_than_the_lease_keeps_its_job() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &["--workers", "2", "--lease", "1s"]).await;
    let id = job_of(&service, LONG_JOB).await;
    until_running(&service, &id).await;
    service.signal("STOP");
    tokio::time::sleep(Duration::from_millis(2500)).await;
    service.signal("CONT");
    tokio::time::sleep(Duration::from_millis(1500)).await;
    assert_eq!(state_of(&service, &id).await["attempts"], 1);
    let cancelled = service.delete(&format!("/v1/jobs/{id}")).send().await;
    assert_eq!(cancelled.unwrap().status(), 202);
    let job = service.ended(&id).await;
    assert_eq!(
        (&job["state"], &job["attempts"]),
        (&"cancelled".into(), &1.into())
    );
}

/// An argument that changes nothing else, and that nobody else gives.
const BY_SERVICE: &str = "--skip=started-by-a-service";

/// The child's side of [`isolated_engine`]; does nothing when it is run as a test.
#[test]
fn computes_one_job_when_started_by_a_service() {
    if std::env::args().any(|argument| argument == BY_SERVICE) {
        serve_isolated(&fake_engine().works).unwrap();
    }
}

/// The fake computation, which this test program can do in a process of its own.
fn isolated_engine() -> Engine {
    let mut engine = fake_engine();
    let arguments = [
        "isolation::computes_one_job_when_started_by_a_service",
        "--exact",
        "--nocapture",
        BY_SERVICE,
    ];
    engine.works = engine.works.with_isolation(Isolation {
        program: std::env::current_exe().unwrap(),
        arguments: arguments.into_iter().map(OsString::from).collect(),
    });
    engine
}

/// Files a job and lets it look as if the service had died while it was running.
async fn file_suspected(data: &Path, volume: &str) {
    let store = Store::open(data).await.unwrap();
    let work = fake_engine().work("model").unwrap().clone();
    let order = NewJob {
        tags: Default::default(),
        tenant: Tenant::default(),
        kind: "model".into(),
        volume: Some(volume.into()),
        needs: Default::default(),
        parameters: work.parameters_from_json(&Map::new()).unwrap(),
        idempotency: None,
        ..NewJob::default()
    };
    let filed = store.rows.file(&order, 10, 0).await.unwrap();
    assert!(matches!(filed, Filed::New(_)), "{filed:?}");
    let by = Claimant {
        token: "token".into(),
        run: "earlier".into(),
        lease: Duration::from_secs(1),
    };
    store.rows.claim(&by, 0).await.unwrap().unwrap();
    store.rows.release_dead(None, None, 0).await.unwrap();
}

#[tokio::test]
async fn a_job_on_a_large_volume_is_computed_apart_from_the_start() {
    let data = Arc::new(tempfile::tempdir().unwrap());
    let app = TestApp::on(data, isolated_engine(), |_| {}).await;
    // In the process of the service, this would end the tests.
    let job = app.finished("large abort").await;
    assert_eq!(job["state"], "failed", "{job}");
    let problem = "urn:ventriform:problem:attempt-limit";
    assert_eq!(job["error"]["type"], problem, "{job}");
    assert_eq!(app.finished("large sphere").await["state"], "succeeded");
}

#[tokio::test]
async fn a_computation_that_aborts_fails_its_job_only() {
    for (words, state, code) in [
        ("abort", "failed", "attempt-limit"),
        ("panic", "failed", "internal"),
        ("fail", "failed", "no-surface"),
        ("sphere", "succeeded", ""),
    ] {
        let app = TestApp::start().await;
        let volume = app.volume(words).await;
        let data = app.stop().await;
        file_suspected(data.path(), &volume).await;
        let app = TestApp::on(data, isolated_engine(), |_| {}).await;
        let jobs = app.json("/v1/jobs").await;
        let job = app.until(&jobs["jobs"][0], &["succeeded", "failed"]).await;
        assert_eq!(job["state"], state, "{words}: {job}");
        if state == "failed" {
            let problem = format!("urn:ventriform:problem:{code}");
            assert_eq!(job["error"]["type"], problem, "{words}");
        }
        assert_eq!(app.finished("sphere").await["state"], "succeeded");
    }
}
