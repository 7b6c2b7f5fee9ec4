//! Several processes on one PostgreSQL database and one S3 store.

use crate::helpers::{TestApp, cutoff, fake_engine, problem, text, trusted, volume};
use crate::postgres::{reached, server};
use crate::s3::in_bucket;
use crate::s3_server::S3Server;
use futures::future::join_all;
use serde_json::{Value, json};
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use ventriform_service::base::records::{
    Catalogue, Erased, ErasureAgent, ErasureOrder, ErasureReason, FileRecord, News, Resource,
    StoreFault, StoredVolume, Tags, Tenant, random_id,
};
use ventriform_service::config::Settings;
use ventriform_store::{OpenError, Store, StoreSettings};

/// Longest time until another process knows of a change. Their own looks come later.
const NOTICE_PATIENCE: Duration = Duration::from_secs(8);

/// A database and a part of a bucket.
struct Shared {
    database: String,
    s3: S3Server,
    prefix: String,
}

impl Shared {
    async fn new() -> Self {
        Self {
            database: server().database().await,
            s3: S3Server::start().await,
            prefix: random_id(""),
        }
    }

    /// The settings of a process on it.
    fn settings(&self, role: &str) -> impl FnOnce(&mut Settings) + use<> {
        let files = in_bucket(&self.s3.url, &self.prefix);
        let (database, role) = (self.database.parse(), role.parse());
        move |settings| {
            files(settings);
            settings.database = database.unwrap();
            settings.role = role.unwrap();
        }
    }

    async fn process(&self, role: &str) -> TestApp {
        let data = Arc::new(tempfile::tempdir().unwrap());
        TestApp::on(data, fake_engine(), self.settings(role)).await
    }

    /// The store of a process without a service, which has a data folder of its own.
    async fn store(&self) -> (Store, TempDir) {
        self.opened().await.unwrap()
    }

    async fn opened(&self) -> Result<(Store, TempDir), OpenError> {
        let folder = tempfile::tempdir().unwrap();
        let settings = StoreSettings {
            min_free: Some(0),
            s3: Some(self.s3.location(&self.prefix)),
            database: Some(reached(&self.database)),
            ..StoreSettings::default()
        };
        let store = Store::open_with(folder.path(), settings).await?;
        Ok((store, folder))
    }
}

async fn within<T>(what: &str, look: impl AsyncFn() -> Option<T>) -> T {
    let deadline = Instant::now() + NOTICE_PATIENCE;
    loop {
        if let Some(found) = look().await {
            return found;
        }
        assert!(Instant::now() < deadline, "{what}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn jobs_are_filed_followed_and_cancelled_at_any_process() {
    let shared = Shared::new().await;
    let (a, b, worker) = (
        shared.process("api").await,
        shared.process("api").await,
        shared.process("worker").await,
    );
    for path in ["/healthz", "/readyz", "/metrics"] {
        let answer = worker.get(path).send().await.unwrap();
        assert_eq!(answer.status(), 200, "{path}");
    }
    let metrics = worker.metrics().await;
    let size = metrics
        .lines()
        .find_map(|line| line.strip_prefix("ventriform_database_bytes "));
    assert!(
        size.unwrap().parse::<f64>().unwrap() > 100_000.0,
        "{size:?}"
    );
    for path in ["/v1/volumes", "/", "/openapi.json"] {
        let answer = worker.get(path).send().await.unwrap();
        problem(answer, 404, "no-such-path").await;
    }

    // A request waits at one, events come from the other; the worker is neither.
    let job = a.file("brief").await;
    let events = b
        .get(&format!("/v1/jobs/{}/events", text(&job["id"])))
        .send();
    let waiting = b
        .post("/v1/models")
        .header("prefer", super::helpers::UNTIL_DONE)
        .body(volume("brief again"))
        .send();
    let (events, waited) = tokio::join!(events, waiting);
    let events = events.unwrap().text().await.unwrap();
    assert!(events.contains("\"state\":\"succeeded\""), "{events}");
    let waited = waited.unwrap();
    assert_eq!(waited.status(), 200, "{waited:?}");
    assert!(waited.headers().contains_key("location"));
    let done = b.json(&text(&job["links"]["self"])).await;
    a.json(&text(&done["links"]["model"])).await;

    // Cancelled where nobody computes it, long before its lease is renewed.
    let slow = a.file("slow").await;
    a.until(&slow, &["running"]).await;
    let path = text(&slow["links"]["self"]);
    assert!(b.delete(&path).send().await.unwrap().status().is_success());
    let cancelled = Instant::now();
    b.until(&slow, &["cancelled"]).await;
    assert!(cancelled.elapsed() < NOTICE_PATIENCE);

    // The same key at both at once files one job.
    let id = a.volume("brief").await;
    let order = json!({"kind": "model", "volume": id});
    let file = |at: &TestApp| {
        let request = at.post("/v1/jobs").header("idempotency-key", "the-same");
        request.json(&order).send()
    };
    let filed = join_all([&a, &b, &a, &b].map(file)).await;
    let mut jobs = Vec::new();
    for answer in filed {
        let job: Value = answer.unwrap().json().await.unwrap();
        jobs.push(text(&job["id"]));
    }
    jobs.dedup();
    assert_eq!(jobs.len(), 1, "{jobs:?}");
    for process in [worker, b, a] {
        process.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_item_is_erased_for_all_processes_unless_one_holds_it() {
    let shared = Shared::new().await;
    let (a, b) = (shared.process("all").await, shared.process("all").await);
    let model = a.model("sphere").await;
    let id = text(&model["volume"]);
    let (path, content) = (
        format!("/v1/volumes/{id}"),
        format!("/v1/volumes/{id}/content"),
    );
    let read = b.get(&content).send().await.unwrap();
    assert_eq!(read.bytes().await.unwrap(), volume("sphere"));
    let copied = |at: &TestApp| {
        let copies = std::fs::read_dir(at.data.path().join("cache")).unwrap();
        let names = copies.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name.starts_with(&id)).count()
    };
    assert_eq!(copied(&b), 1);

    let queue = b.running.as_ref().unwrap().queue().clone();
    let hold = queue.items().pin(&id).await.unwrap();
    let kept = a.delete(&format!("{path}?cascade=true"));
    problem(kept.send().await.unwrap(), 409, "in-use").await;
    // A hold that ends while the erasure waits for it does not stop it.
    tokio::spawn(async move {
        tokio::time::sleep(Duration::from_millis(100)).await;
        drop(hold);
    });
    let erased = a.delete(&format!("{path}?cascade=true")).send();
    let reading = join_all((0..20).map(|_| b.get(&content).send()));
    let (erased, reading) = tokio::join!(erased, reading);
    assert!(erased.unwrap().status().is_success());
    for answer in reading {
        let answer = answer.unwrap();
        match answer.status().as_u16() {
            // Its end may be cut off.
            200 => drop(answer.bytes().await),
            410 => drop(answer),
            other => panic!("{other}: {}", answer.text().await.unwrap()),
        }
    }
    problem(b.get(&path).send().await.unwrap(), 410, "gone").await;
    within("the copy is still there", async || {
        (copied(&b) == 0).then_some(())
    })
    .await;

    // It can come back at either, also while the other erases it.
    for _ in 0..5 {
        let upload = b.post("/v1/volumes").body(volume("sphere")).send();
        let erase = a.delete(&path).send();
        let (uploaded, _) = tokio::join!(upload, erase);
        assert!(uploaded.unwrap().status().is_success());
        match b.get(&content).send().await.unwrap() {
            whole if whole.status() == 200 => {
                assert_eq!(whole.bytes().await.unwrap(), volume("sphere"));
            }
            gone => drop(problem(gone, 410, "gone").await),
        }
    }
    for process in [a, b] {
        process.stop().await;
    }
}

/// A process in a runtime of its own, which ends without warning.
struct Mortal {
    runtime: tokio::runtime::Runtime,
}

impl Mortal {
    async fn start(settings: impl FnOnce(&mut Settings) + Send + 'static) -> Self {
        let started = tokio::task::spawn_blocking(move || {
            let runtime = tokio::runtime::Runtime::new().unwrap();
            let data = Arc::new(tempfile::tempdir().unwrap());
            std::mem::forget(runtime.block_on(TestApp::on(data, fake_engine(), settings)));
            runtime
        });
        let runtime = started.await.unwrap();
        Self { runtime }
    }

    fn kill(self) {
        self.runtime.shutdown_background();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_a_killed_worker_computed_is_computed_by_another_once() {
    let shared = Shared::new().await;
    let with_short_leases = |role| {
        let settings = shared.settings(role);
        move |own: &mut Settings| {
            settings(own);
            own.lease = "5s".parse().unwrap();
        }
    };
    let process = async |role| {
        let data = Arc::new(tempfile::tempdir().unwrap());
        TestApp::on(data, fake_engine(), with_short_leases(role)).await
    };
    let api = process("api").await;
    let doomed = Mortal::start(with_short_leases("worker")).await;
    let job = api.file("stubborn").await;
    api.until(&job, &["running"]).await;
    doomed.kill();
    let worker = process("worker").await;
    let done = api.until(&job, &["succeeded", "failed"]).await;
    assert_eq!(done["state"], "succeeded", "{done}");
    assert!(done["attempts"].as_u64() >= Some(2), "{done}");
    let models = api.json("/v1/models").await;
    assert_eq!(models["models"].as_array().unwrap().len(), 1, "{models}");
    for process in [worker, api] {
        process.stop().await;
    }
}

#[tokio::test]
async fn one_process_has_the_duty_and_all_hear_the_news() {
    ventriform_http::install_cryptography();
    let shared = Shared::new().await;
    let ((first, _kept), (second, _too)) = (shared.store().await, shared.store().await);
    let (a, b) = (first.peers.clone().unwrap(), second.peers.clone().unwrap());
    let short = Duration::from_millis(600);
    assert!(a.lead("sweep", short).await.unwrap());
    assert!(!b.lead("sweep", short).await.unwrap());
    assert!(a.lead("sweep", short).await.unwrap());
    within("the duty is not free", async || {
        b.lead("sweep", short).await.unwrap().then_some(())
    })
    .await;
    assert!(!a.lead("sweep", short).await.unwrap());
    b.leave().await.unwrap();
    assert!(a.lead("sweep", short).await.unwrap());

    let long = Duration::from_secs(60);
    for (peers, workers) in [(&a, 2), (&b, 3)] {
        peers.heartbeat(workers, long).await.unwrap();
    }
    assert_eq!(a.workers().await.unwrap(), 5);
    let item = [random_id(Resource::Volume.prefix())];
    a.pin("token", &item[0]).await.unwrap();
    assert!(!a.pinned_by_others(&item).await.unwrap());
    assert!(b.pinned_by_others(&item).await.unwrap());
    // A process that does not live holds nothing.
    a.heartbeat(2, Duration::ZERO).await.unwrap();
    assert!(!b.pinned_by_others(&item).await.unwrap());
    a.heartbeat(2, long).await.unwrap();
    b.tidy(trusted(1)).await.unwrap();
    assert!(b.pinned_by_others(&item).await.unwrap());
    a.unpin("token").await.unwrap();
    assert!(!b.pinned_by_others(&item).await.unwrap());

    let mut news = b.news();
    assert_eq!(news.next().await, News::Missed);
    let tenant = Tenant::default();
    let mut stored = StoredVolume {
        sequence: 0,
        created_at: 1,
        bytes: 1,
        files: vec![FileRecord {
            name: "volume.nii".into(),
            bytes: 1,
            sha256: "00".into(),
            place: Some("first".into()),
        }],
        facts: Default::default(),
        id: item[0].clone(),
    };
    let tags = Tags::default();
    let add =
        async |stored: &StoredVolume| first.rows.add_volume(stored, &tenant, &tags, None).await;
    assert!(add(&stored).await.unwrap());
    let order = ErasureOrder {
        tenant: tenant.clone(),
        id: item[0].clone(),
        cascade: false,
        renewed_before: Some(cutoff(1)),
        by: ErasureAgent::default(),
        reason: ErasureReason::Retention,
    };
    // Renewed since it was found to be too old.
    let kept = first.rows.erase(&order, &item, 2).await.unwrap();
    assert_eq!(kept, Erased::Unknown);
    let order = ErasureOrder {
        renewed_before: None,
        ..order
    };
    b.pin("of b", &item[0]).await.unwrap();
    let kept = first.rows.erase(&order, &item, 2).await.unwrap();
    assert_eq!(kept, Erased::InUse);
    b.unpin("of b").await.unwrap();
    let erased = first.rows.erase(&order, &item, 2).await.unwrap();
    assert!(matches!(erased, Erased::Done(_)));
    assert_eq!(news.next().await, News::Erased(item[0].clone()));
    // No row names files that were erased.
    let refused = add(&stored).await.unwrap_err();
    assert_eq!(refused.cause(), StoreFault::Busy, "{refused}");
    stored.files[0].place = Some("second".into());
    assert!(add(&stored).await.unwrap());
    assert!(second.blobs.copied().is_empty());
}

#[tokio::test]
async fn a_process_that_starts_while_the_first_upload_is_on_its_way_is_not_refused() {
    let shared = Shared::new().await;
    let first = shared.store().await;
    // The files of an upload come before its row.
    let key = format!("{}/volumes/vol_1/0/scan.nii", shared.prefix);
    shared.s3.write(&key, b"voxels").await;
    let second = shared.store().await;
    drop((first, second));
    // With a database that never saw these files, it is.
    let other = Shared {
        database: server().database().await,
        ..shared
    };
    let error = other.opened().await.err().unwrap().to_string();
    assert!(error.contains("is empty"), "{error}");
}

#[tokio::test]
async fn a_process_that_would_not_share_is_refused() {
    let shared = Shared::new().await;
    let refused = |arguments: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        let ended = Command::new(env!("CARGO_BIN_EXE_ventriform"))
            .args(["serve", "--listen", "127.0.0.1:0", "--data-dir"])
            .arg(folder.path())
            .args(arguments)
            .envs(shared.s3.location(&shared.prefix).variables)
            .output()
            .unwrap();
        assert!(!ended.status.success(), "{arguments:?}");
        String::from_utf8(ended.stderr).unwrap()
    };
    let said = refused(&["--role", "api"]);
    assert!(said.contains("--database postgres://"), "{said}");
    let said = refused(&["--role", "worker", "--database", &shared.database]);
    assert!(said.contains("--blobs s3://"), "{said}");
    assert!(refused(&["--role", "boss"]).contains("`worker`"));
    ventriform_http::install_cryptography();
    let (store, _folder) = shared.store().await;
    drop(store);
    // Its files would be seen by nobody else.
    let said = refused(&["--database", &shared.database]);
    assert!(said.contains("same `blobs`"), "{said}");
}
