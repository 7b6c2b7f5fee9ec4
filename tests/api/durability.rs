//! Crashes: the real program is killed without warning and started again.

use crate::helpers::{Service, fake_engine, heart, scan, text};
use serde_json::{Value, json};
use std::time::Duration;
use ventriform_service::records::{
    Catalogue, Claimant, DeathLimit, Failure, Fault, FileRecord, Filed, ItemFilter, JobOutcome,
    JobState, JobStore, Lease, ListRequest, NewJob, Resource, StoredVolume, Tags, Tenant,
    random_id,
};
use ventriform_store::Store;

#[tokio::test]
async fn every_accepted_job_succeeds_once_although_the_service_is_killed() {
    let data = tempfile::tempdir().unwrap();
    let mut accepted = Vec::new();
    for round in 0..4u64 {
        let service = Service::start(data.path(), &["--workers", "1"]).await;
        for seed in 0..3 {
            let number = round * 10 + seed;
            let (path, body) = match seed {
                1 => (format!("/v1/segmentations?roll={number}"), heart().0),
                _ => (format!("/v1/models?points=67&seed={number}"), scan()),
            };
            let answer = service.post(&path).body(body).send().await.unwrap();
            let job: Value = answer.json().await.unwrap();
            accepted.push(text(&job["id"]));
        }
        tokio::time::sleep(Duration::from_millis(60 * round)).await;
        service.kill();
    }
    let service = Service::start(data.path(), &[]).await;
    for id in &accepted {
        let job = service.ended(id).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        let mesh = service.get(&format!("{}.json", text(&job["links"]["mesh"])));
        let mesh: Value = mesh.send().await.unwrap().json().await.unwrap();
        let points = match job["kind"].as_str() {
            Some("model") => 67,
            _ => 150,
        };
        assert_eq!(mesh["vertices"].as_array().unwrap().len(), points);
    }
    let all: Value = service
        .get("/v1/jobs?limit=100")
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert_eq!(
        all["jobs"].as_array().unwrap().len(),
        accepted.len(),
        "none twice"
    );
    for (list, count) in [("models", 8), ("segmentations", 4)] {
        let made = service.get(&format!("/v1/{list}?limit=100"));
        let made: Value = made.send().await.unwrap().json().await.unwrap();
        assert_eq!(made[list].as_array().unwrap().len(), count, "{list}");
    }
    let folders = [
        "staging",
        "volumes",
        "models",
        "segmentations",
        "templates",
        "readers",
    ];
    let stored = folders.map(|name| std::fs::read_dir(data.path().join(name)).unwrap().count());
    assert_eq!(stored, [0, 2, 8, 4, 0, 0], "no orphans");
}

#[tokio::test]
async fn a_job_is_failed_by_deaths_of_its_own_process_but_not_of_the_service() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let rows = &store.rows;
    let id = filed(&store).await;
    for interruption in 1..=9 {
        rows.claim(&claimant("one"), 0).await.unwrap().unwrap();
        let released = rows.release_dead(None, None, 0).await.unwrap();
        assert_eq!(released[0].state, JobState::Queued);
        assert_eq!(released[0].interruptions, interruption);
    }
    let limit = DeathLimit {
        deaths: 3,
        reason: Failure::new(Fault::Service, "attempt-limit", "It ends its process."),
    };
    for crash in 1..=3 {
        let by = claimant("one");
        rows.claim(&by, 0).await.unwrap().unwrap();
        let lease = Lease {
            job: id.clone(),
            token: by.token,
        };
        let job = rows.crashed(&lease, &limit, 5).await.unwrap().unwrap();
        assert_eq!(job.crashes, crash);
        let (state, failure) = match crash {
            3 => (JobState::Failed, Some(&limit.reason)),
            _ => (JobState::Queued, None),
        };
        assert_eq!((job.state, job.failure.as_ref()), (state, failure));
        assert!(rows.crashed(&lease, &limit, 5).await.unwrap().is_none());
    }
    assert!(rows.claim(&claimant("one"), 0).await.unwrap().is_none());
}

#[tokio::test]
async fn without_a_process_of_its_own_a_job_is_failed_by_deaths_of_the_service() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let rows = &store.rows;
    filed(&store).await;
    let limit = DeathLimit {
        deaths: 2,
        reason: Failure::new(Fault::Service, "attempt-limit", "The service died."),
    };
    for state in [JobState::Queued, JobState::Failed] {
        rows.claim(&claimant("one"), 0).await.unwrap().unwrap();
        let released = rows.release_dead(None, Some(&limit), 0).await.unwrap();
        assert_eq!(released[0].state, state);
    }
}

fn claimant(run: &str) -> Claimant {
    Claimant {
        token: random_id(""),
        run: run.into(),
        lease: Duration::from_millis(10),
    }
}

#[tokio::test]
async fn a_lease_of_the_living_run_does_not_expire_and_a_lost_one_cannot_write() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let rows = &store.rows;
    let job = filed(&store).await;
    let lease = |by: &Claimant| Lease {
        job: job.clone(),
        token: by.token.clone(),
    };
    let first = claimant("one");
    rows.claim(&first, 0).await.unwrap().unwrap();
    let year = 365 * 24 * 3_600_000;
    for now in [-year, 9, 10, year] {
        let released = rows.release_dead(Some("one"), None, now).await.unwrap();
        assert!(released.is_empty(), "its run lives, at {now}");
        assert!(rows.claim(&claimant("one"), now).await.unwrap().is_none());
    }
    assert!(
        rows.release_dead(Some("two"), None, 9)
            .await
            .unwrap()
            .is_empty()
    );
    let released = rows.release_dead(Some("two"), None, 10).await.unwrap();
    assert_eq!(released.len(), 1);
    let second = claimant("two");
    rows.claim(&second, 10).await.unwrap().unwrap();
    let (lost, held) = (lease(&first), lease(&second));
    let length = Duration::from_secs(1);
    assert_eq!(rows.renew_lease(&lost, length, 10).await.unwrap(), None);
    assert!(rows.progress(&lost, "read", 0.5).await.unwrap().is_none());
    assert!(rows.hand_back(&lost, 11).await.unwrap().is_none());
    let cancelled = JobOutcome::Cancelled;
    assert!(rows.finish(&lost, &cancelled, 11).await.unwrap().is_none());
    let ended = rows.finish(&held, &cancelled, 12).await.unwrap().unwrap();
    assert_eq!((ended.state, ended.attempts), (JobState::Cancelled, 2));
    let again = rows.finish(&held, &cancelled, 13).await.unwrap();
    assert!(again.is_none(), "once");
}

async fn filed(store: &Store) -> String {
    let volume = StoredVolume {
        id: "vol_1".into(),
        sequence: 0,
        created_at: 0,
        bytes: 1,
        files: vec![FileRecord {
            name: "volume.nii".into(),
            bytes: 1,
            sha256: String::new(),
            place: None,
        }],
        facts: json!({}),
    };
    let (tenant, tags) = (Tenant::default(), Tags::default());
    let added = store.rows.add_volume(&volume, &tenant, &tags, None).await;
    assert!(added.unwrap());
    let parameters = fake_engine()
        .work("model")
        .unwrap()
        .parameters_from_json(json!({"points": 67}).as_object().unwrap())
        .unwrap();
    let order = NewJob {
        tenant,
        tags,
        kind: "model".into(),
        volume: Some("vol_1".into()),
        needs: Default::default(),
        parameters,
        idempotency: None,
        ..NewJob::default()
    };
    match store.rows.file(&order, 10, 0).await.unwrap() {
        Filed::New(job) => job.id,
        other => panic!("{other:?}"),
    }
}

/// A database in `folder` as the program left it when it had the first `count` migrations.
async fn older_database(folder: &std::path::Path, count: usize) -> sqlx::SqlitePool {
    let older = folder.join("migrations");
    std::fs::create_dir(&older).unwrap();
    for file in migrations().iter().take(count) {
        std::fs::copy(file, older.join(file.file_name().unwrap())).unwrap();
    }
    let options = sqlx::sqlite::SqliteConnectOptions::new()
        .filename(folder.join("ventriform.db"))
        .create_if_missing(true);
    let pool = sqlx::SqlitePool::connect_with(options).await.unwrap();
    let migrator = sqlx::migrate::Migrator::new(older.as_path()).await.unwrap();
    migrator.run(&pool).await.unwrap();
    pool
}

/// The files of the migrations, in the order in which they run.
fn migrations() -> Vec<std::path::PathBuf> {
    let source =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/store/src/migrations");
    let files = std::fs::read_dir(source).unwrap();
    let mut files: Vec<_> = files.map(|file| file.unwrap().path()).collect();
    files.sort();
    files
}

/// The parts of the database in `folder`: kind, name and definition of each.
async fn parts(folder: &std::path::Path) -> Vec<(String, String, Option<String>)> {
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(folder.join("ventriform.db"));
    let pool = sqlx::SqlitePool::connect_with(options).await.unwrap();
    let sound: String = sqlx::query_scalar("PRAGMA integrity_check")
        .fetch_one(&pool)
        .await
        .unwrap();
    assert_eq!(sound, "ok");
    let parts = sqlx::query_as("SELECT type, name, sql FROM sqlite_schema ORDER BY type, name")
        .fetch_all(&pool)
        .await
        .unwrap();
    pool.close().await;
    parts
}

#[tokio::test]
async fn every_older_database_becomes_what_a_new_one_is() {
    let new = tempfile::tempdir().unwrap();
    let mut store = Store::open(new.path()).await.unwrap();
    store.close().await;
    let expected = parts(new.path()).await;
    for count in 1..migrations().len() {
        let folder = tempfile::tempdir().unwrap();
        let pool = older_database(folder.path(), count).await;
        pool.close().await;
        let mut store = Store::open(folder.path()).await.unwrap();
        store.close().await;
        assert_eq!(parts(folder.path()).await, expected, "from {count}");
    }
}

#[tokio::test]
async fn models_of_an_older_database_are_migrated() {
    let folder = tempfile::tempdir().unwrap();
    let pool = older_database(folder.path(), 1).await;
    sqlx::query(
        "INSERT INTO models (id, created_at, volume, parameters, summary, software, files)
         VALUES ('mdl_1', 5, 'vol_1', '{}', '{}', '0', '[]')",
    )
    .execute(&pool)
    .await
    .unwrap();
    pool.close().await;

    let store = Store::open(folder.path()).await.unwrap();
    let tenant = Tenant::default();
    let model = store.rows.product(&tenant, "mdl_1").await.unwrap().unwrap();
    assert_eq!(model.volume.as_deref(), Some("vol_1"));
    assert_eq!(model.created_at, 5);
    let page = ListRequest {
        before: None,
        limit: 9,
    };
    for (kind, count) in [(Resource::Model, 1), (Resource::Segmentation, 0)] {
        let filter = ItemFilter::default();
        let listed = store.rows.products(&tenant, kind, &filter, page).await;
        let listed = listed.unwrap();
        assert_eq!(listed.items.len(), count);
    }
}
