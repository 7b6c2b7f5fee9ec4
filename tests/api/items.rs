//! Single items under concurrent requests, failures and age: files and records agree.

use crate::helpers::{TestApp, fake_engine, problem, text, volume};
use reqwest::StatusCode;
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::io::AsyncWriteExt;
use ventriform_service::base::records::{
    Catalogue, Clock, Erased, ErasureAgent, ErasureOrder, ErasureReason, FileRecord, Filed,
    JobState, JobStore, LegalHold, ListRequest, NewJob, Resource, StagedFiles, StagedFor,
    StoredVolume, Tags, Tenant, Timestamp,
};
use ventriform_service::items::{Items, RetentionAges};
use ventriform_service::jobs::{Queue, QueueSettings, WorkerSettings, Workers};
use ventriform_service::run::background::Upkeep;
use ventriform_store::Store;

/// A clock that a test sets, and whether it is in doubt.
#[derive(Default)]
struct TestClock(AtomicI64, AtomicBool);

impl Clock for TestClock {
    fn now(&self) -> Timestamp {
        self.0.load(Ordering::SeqCst)
    }

    fn is_trusted(&self) -> bool {
        !self.1.load(Ordering::SeqCst)
    }

    fn latest(&self) -> Timestamp {
        self.now()
    }
}

impl TestClock {
    fn set(&self, now: Timestamp) {
        self.0.store(now, Ordering::SeqCst);
    }

    fn doubt(&self, doubtful: bool) {
        self.1.store(doubtful, Ordering::SeqCst);
    }
}

/// A queue without workers on a folder of its own.
struct Bench {
    queue: Arc<Queue>,
    clock: Arc<TestClock>,
    store: Store,
    folder: TempDir,
}

impl Bench {
    async fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path()).await.unwrap();
        let clock = Arc::new(TestClock::default());
        let settings = QueueSettings {
            limit: 10,
            workers: 1,
        };
        let items = Items::new(store.rows.clone(), store.blobs.clone(), clock.clone(), None);
        let queue = Queue::new(store.rows.clone(), Arc::new(items), clock.clone(), settings);
        Self {
            queue: Arc::new(queue),
            clock,
            store,
            folder,
        }
    }

    async fn staged(&self) -> Box<dyn StagedFiles> {
        let staged = self.store.blobs.stage(StagedFor::Upload).await.unwrap();
        let mut file = staged.create("volume.nii").await.unwrap();
        file.write_all(b"VOLUME brief").await.unwrap();
        file.shutdown().await.unwrap();
        staged
    }

    fn volume(&self, id: &str) -> StoredVolume {
        StoredVolume {
            id: id.into(),
            sequence: 0,
            created_at: self.clock.now(),
            bytes: 12,
            files: vec![FileRecord {
                name: "volume.nii".into(),
                bytes: 12,
                sha256: String::new(),
                place: None,
            }],
            facts: json!({}),
        }
    }

    async fn add(&self, id: &str) {
        let files = self.staged().await;
        let (tenant, tags) = (Tenant::default(), Tags::default());
        let volume = self.volume(id);
        let added = self
            .queue
            .items()
            .add_volume(volume, files, &tenant, &tags, None)
            .await;
        added.unwrap();
    }

    fn has_files(&self, id: &str) -> bool {
        self.folder.path().join("volumes").join(id).exists()
    }

    fn upkeep(&self, retention: Option<Duration>) -> Upkeep {
        Upkeep {
            queue: self.queue.clone(),
            retention: RetentionAges {
                volumes: retention,
                results: retention,
                jobs: retention,
            },
            every: Duration::from_secs(60),
        }
    }
}

async fn database(folder: &TempDir) -> sqlx::SqliteConnection {
    let options =
        sqlx::sqlite::SqliteConnectOptions::new().filename(folder.path().join("ventriform.db"));
    sqlx::ConnectOptions::connect(&options).await.unwrap()
}

async fn run(database: &mut sqlx::SqliteConnection, statement: &'static str) {
    sqlx::query(statement).execute(database).await.unwrap();
}

#[tokio::test]
async fn an_upload_is_stored_to_its_end_although_the_client_hangs_up() {
    let app = TestApp::with(|s| s.write_wait = "60s".parse().unwrap()).await;
    let mut database = database(&app.data).await;
    // The record has to wait for this transaction, so the client leaves between files and record.
    run(&mut database, "BEGIN IMMEDIATE").await;
    let request = app.post("/v1/volumes").body(volume("sphere")).send();
    let client = tokio::spawn(request);
    let deadline = Instant::now() + Duration::from_secs(60);
    let folders = || std::fs::read_dir(app.data.path().join("volumes")).unwrap();
    while folders().next().is_none() {
        assert!(Instant::now() < deadline, "nothing is published");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    client.abort();
    assert!(client.await.unwrap_err().is_cancelled());
    tokio::time::sleep(Duration::from_millis(50)).await;
    run(&mut database, "ROLLBACK").await;
    let id = folders().next().unwrap().unwrap().file_name();
    let path = format!("/v1/volumes/{}", id.to_str().unwrap());
    while app.get(&path).send().await.unwrap().status() != StatusCode::OK {
        assert!(Instant::now() < deadline, "files without a record");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

#[tokio::test]
async fn files_whose_record_could_not_be_written_are_deleted_by_the_upkeep() {
    let bench = Bench::new().await;
    let mut database = database(&bench.folder).await;
    run(
        &mut database,
        "CREATE TRIGGER full BEFORE INSERT ON volumes BEGIN SELECT RAISE(ABORT, 'full'); END",
    )
    .await;
    let files = bench.staged().await;
    let (tenant, tags) = (Tenant::default(), Tags::default());
    let volume = bench.volume("vol_1");
    let added = bench
        .queue
        .items()
        .add_volume(volume, files, &tenant, &tags, None)
        .await;
    let error = added.err().unwrap();
    assert!(error.to_string().contains("full"), "{error}");
    assert!(bench.has_files("vol_1"));
    run(&mut database, "DROP TRIGGER full").await;
    run(&mut database, "ALTER TABLE volumes RENAME TO hidden").await;
    let upkeep = bench.upkeep(None);
    assert!(upkeep.run_once().await.is_err(), "it cannot tell yet");
    assert!(bench.has_files("vol_1"));
    run(&mut database, "ALTER TABLE hidden RENAME TO volumes").await;
    upkeep.run_once().await.unwrap();
    assert!(!bench.has_files("vol_1"));
    bench.add("vol_1").await;
    upkeep.run_once().await.unwrap();
    assert!(bench.has_files("vol_1"));
}

#[tokio::test]
async fn nothing_is_erased_by_age_while_the_time_is_in_doubt() {
    let bench = Bench::new().await;
    bench.add("vol_1").await;
    let upkeep = bench.upkeep(Some(Duration::from_secs(1)));
    bench.clock.doubt(true);
    bench.clock.set(i64::from(i32::MAX) * 1000);
    upkeep.run_once().await.unwrap();
    assert!(bench.has_files("vol_1"));
    bench.clock.doubt(false);
    upkeep.run_once().await.unwrap();
    assert!(!bench.has_files("vol_1"));
}

#[tokio::test]
async fn an_item_on_hold_is_deleted_neither_by_request_nor_by_age() {
    let bench = Bench::new().await;
    bench.add("vol_1").await;
    let hold = bench.queue.items().pin("vol_1").await;
    bench.clock.set(10_000);
    let upkeep = bench.upkeep(Some(Duration::from_secs(1)));
    let order = ErasureOrder {
        renewed_before: None,
        tenant: Tenant::default(),
        id: "vol_1".into(),
        cascade: false,
        by: ErasureAgent::default(),
        reason: ErasureReason::Request,
    };
    assert_eq!(
        bench.queue.items().erase(order).await.unwrap(),
        Erased::InUse
    );
    upkeep.run_once().await.unwrap();
    assert!(bench.has_files("vol_1"));
    drop(hold);
    upkeep.run_once().await.unwrap();
    assert!(!bench.has_files("vol_1"));
}

#[tokio::test]
async fn the_age_of_a_volume_counts_from_its_last_upload() {
    let bench = Bench::new().await;
    bench.add("vol_1").await;
    let upkeep = bench.upkeep(Some(Duration::from_secs(5)));
    for (now, kept) in [(4_000, true), (8_000, true), (14_000, false)] {
        bench.clock.set(now);
        upkeep.run_once().await.unwrap();
        let tenant = Tenant::default();
        let volume = bench.store.rows.volume(&tenant, "vol_1").await;
        let found = volume.unwrap().is_some();
        assert_eq!(found, kept, "at {now}");
        if now == 4_000 {
            let tags = Tags::default();
            let renewed = bench
                .queue
                .items()
                .renew_volume(&tenant, "vol_1", &tags, None)
                .await;
            assert!(renewed.unwrap().is_some());
        }
    }
}

/// A job of the tenant on `vol_1`, computed at once.
async fn use_volume(bench: &Bench, tenant: &Tenant) -> String {
    let work = fake_engine().work("model").unwrap().clone();
    let order = NewJob {
        tenant: tenant.clone(),
        tags: Tags::default(),
        kind: "model".into(),
        volume: Some("vol_1".into()),
        needs: Default::default(),
        parameters: work.parameters_from_json(&serde_json::Map::new()).unwrap(),
        idempotency: None,
        ..NewJob::default()
    };
    let Filed::New(job) = bench.queue.file(&order).await.unwrap() else {
        panic!("not filed");
    };
    job.id
}

#[tokio::test]
async fn the_age_of_a_volume_counts_from_the_last_use_by_its_tenant() {
    let bench = Bench::new().await;
    let (mine, other) = (Tenant::default(), "other".parse::<Tenant>().unwrap());
    bench.add("vol_1").await;
    let tags = Tags::default();
    let held = bench
        .queue
        .items()
        .renew_volume(&other, "vol_1", &tags, None)
        .await;
    assert!(held.unwrap().is_some_and(|(_, new)| new));
    bench.clock.set(4_000);
    let job = use_volume(&bench, &mine).await;
    bench.queue.interrupt(&job).await.unwrap();
    let upkeep = bench.upkeep(Some(Duration::from_secs(5)));
    // Uploaded by both at 0, used by one at 4 s.
    for (now, kept, others) in [
        (4_900, true, true),
        (8_900, true, false),
        (9_100, false, false),
    ] {
        bench.clock.set(now);
        upkeep.run_once().await.unwrap();
        for (tenant, kept) in [(&mine, kept), (&other, others)] {
            let volume = bench.store.rows.volume(tenant, "vol_1").await.unwrap();
            assert_eq!(volume.is_some(), kept, "{tenant} at {now}");
        }
        assert_eq!(bench.has_files("vol_1"), kept);
    }
}

#[tokio::test]
async fn a_legal_hold_keeps_a_volume_and_its_jobs_from_retention() {
    let bench = Bench::new().await;
    let tenant = Tenant::default();
    bench.add("vol_1").await;
    let job = use_volume(&bench, &tenant).await;
    bench.queue.interrupt(&job).await.unwrap();
    let hold = LegalHold {
        reason: "case 17".into(),
        since: 0,
        by: "test".into(),
    };
    let rows = &bench.store.rows;
    let set = async |hold: Option<&LegalHold>| {
        let set = rows.set_legal_hold(&tenant, "vol_1", hold).await;
        assert!(set.unwrap());
    };
    set(Some(&hold)).await;
    bench.clock.set(1_000_000_000);
    let upkeep = bench.upkeep(Some(Duration::from_secs(1)));
    upkeep.run_once().await.unwrap();
    assert!(bench.has_files("vol_1"));
    assert!(rows.job(&job).await.unwrap().is_some());
    set(None).await;
    upkeep.run_once().await.unwrap();
    assert!(!bench.has_files("vol_1"));
    assert!(rows.job(&job).await.unwrap().is_none());
    let every = ListRequest {
        before: None,
        limit: 10,
    };
    let receipts = rows.receipts(&tenant, Some("vol_1"), every).await.unwrap();
    assert_eq!(receipts.items.len(), 1);
    assert_eq!(receipts.items[0].reason, ErasureReason::Retention);
    assert_eq!(receipts.items[0].erased_by, "retention");
}

#[tokio::test]
async fn nothing_is_erased_by_age_unless_the_operator_says_so() {
    let ages = RetentionAges::default();
    for kind in [
        Resource::Volume,
        Resource::Model,
        Resource::Segmentation,
        Resource::Template,
        Resource::Job,
    ] {
        assert_eq!(ages.expires_at(kind, 0), None);
    }
    let app = TestApp::start().await;
    let job = app.finished("sphere").await;
    for kind in ["volume", "model"] {
        let shown = app.json(&text(&job["links"][kind])).await;
        assert_eq!(shown["expires_at"], serde_json::Value::Null, "{kind}");
    }
    let bench = Bench::new().await;
    bench.add("vol_1").await;
    bench.clock.set(i64::MAX / 2);
    bench.upkeep(None).run_once().await.unwrap();
    assert!(bench.has_files("vol_1"));
}

#[tokio::test]
async fn a_request_that_carries_its_volume_finds_it_although_others_delete_it() {
    let app = TestApp::start().await;
    for round in 0..20 {
        let words = format!("sphere {round}");
        let id = app.volume(&words).await;
        let delete = app.delete(&format!("/v1/volumes/{id}")).send();
        let file = app.post("/v1/models").body(volume(&words)).send();
        let (deleted, filed) = tokio::join!(delete, file);
        let filed = filed.unwrap();
        assert_eq!(filed.status(), StatusCode::ACCEPTED, "round {round}");
        let job = app
            .until(&filed.json().await.unwrap(), &["succeeded"])
            .await;
        assert_eq!(text(&job["volume"]), id);
        let deleted = deleted.unwrap();
        match deleted.status() {
            StatusCode::NO_CONTENT => {}
            _ => {
                problem(deleted, 409, "in-use").await;
            }
        }
    }
}

#[tokio::test]
async fn steps_of_the_clock_neither_expire_a_lease_nor_keep_a_job_for_ever() {
    let bench = Bench::new().await;
    bench.add("vol_1").await;
    let work = fake_engine().work("model").unwrap().clone();
    let parameters = work.parameters_from_json(&serde_json::Map::new()).unwrap();
    let order = NewJob {
        tags: Default::default(),
        tenant: Tenant::default(),
        kind: "model".into(),
        volume: Some("vol_1".into()),
        needs: Default::default(),
        parameters,
        idempotency: None,
        ..NewJob::default()
    };
    let Filed::New(job) = bench.queue.file(&order).await.unwrap() else {
        panic!("the queue is empty");
    };
    let settings = WorkerSettings {
        workers: 2,
        threads: 1,
        lease: Duration::from_millis(30),
        attempt_limit: 3,
        time_limit: Duration::from_secs(60),
    };
    let works = fake_engine().works;
    let workers = Workers::start(&bench.queue, &works, settings).unwrap();
    let upkeep = bench.upkeep(None);
    let year = 365 * 24 * 3_600_000;
    let deadline = Instant::now() + Duration::from_secs(20);
    for step in [year, -year, 0].into_iter().cycle() {
        bench.clock.set(step);
        upkeep.run_once().await.unwrap();
        let job = bench.store.rows.job(&job.id).await.unwrap().unwrap();
        assert!(job.attempts <= 1, "{job:?}");
        if job.state.is_final() {
            assert_eq!(job.state, JobState::Succeeded);
            break;
        }
        assert!(Instant::now() < deadline, "{job:?}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    workers.stop(Duration::from_secs(5)).await;
}
