//! Crashes: the real program is killed without warning and started again.

use crate::helpers::{Service, fake_engine, heart, scan, text};
use serde_json::{Value, json};
use std::time::Duration;
use ventriform::jobs::{
    Catalogue, Failure, Fault, Filed, JobOutcome, JobState, JobStore, Lease, ListRequest, NewJob,
    Resource, StoredVolume, Tenant,
};
use ventriform::store::Store;

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
    let folders = ["staging", "volumes", "models", "segmentations", "templates"];
    let stored = folders.map(|name| std::fs::read_dir(data.path().join(name)).unwrap().count());
    assert_eq!(stored, [0, 2, 8, 4, 0], "no orphans");
}

#[tokio::test]
async fn a_job_that_crashes_the_process_is_failed_after_its_attempts() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let rows = &store.rows;
    let job = filed(&store).await;
    for attempt in 1..=3 {
        let claimed = rows.claim("token", 3, 0, 10).await.unwrap().unwrap();
        assert_eq!(
            (claimed.id.as_str(), claimed.attempts),
            (job.as_str(), attempt)
        );
        assert_eq!(rows.release_all().await.unwrap(), 1);
    }
    assert!(rows.claim("token", 3, 0, 10).await.unwrap().is_none());
    let reason = Failure::new(Fault::Service, "attempt-limit", "The job never ends.");
    let ended_jobs = rows.end_unclaimable(3, &reason, 5).await.unwrap();
    assert_eq!(ended_jobs[0].state, JobState::Failed);
    assert_eq!(ended_jobs[0].failure.as_ref(), Some(&reason));
}

#[tokio::test]
async fn a_worker_that_lost_its_lease_cannot_write() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let rows = &store.rows;
    let job = filed(&store).await;
    let lease = |token: &str| Lease {
        job: job.clone(),
        token: token.into(),
    };
    rows.claim("first", 3, 0, 10).await.unwrap().unwrap();
    assert!(
        rows.claim("second", 3, 9, 20).await.unwrap().is_none(),
        "it is held"
    );
    rows.claim("second", 3, 10, 20).await.unwrap().unwrap();
    assert_eq!(rows.renew_lease(&lease("first"), 99).await.unwrap(), None);
    assert!(
        rows.progress(&lease("first"), "read", 0.5)
            .await
            .unwrap()
            .is_none()
    );
    assert!(rows.hand_back(&lease("first")).await.unwrap().is_none());
    let cancelled = JobOutcome::Cancelled;
    assert!(
        rows.finish(&lease("first"), &cancelled, 11)
            .await
            .unwrap()
            .is_none()
    );
    let ended = rows
        .finish(&lease("second"), &cancelled, 12)
        .await
        .unwrap()
        .unwrap();
    assert_eq!((ended.state, ended.attempts), (JobState::Cancelled, 2));
    assert!(
        rows.finish(&lease("second"), &cancelled, 13)
            .await
            .unwrap()
            .is_none(),
        "once"
    );
}

async fn filed(store: &Store) -> String {
    let volume = StoredVolume {
        id: "vol_1".into(),
        sequence: 0,
        created_at: 0,
        bytes: 1,
        files: vec!["volume.nii".into()],
        facts: json!({}),
    };
    store.rows.add_volume(&volume).await.unwrap();
    let parameters = fake_engine()
        .work("model")
        .unwrap()
        .parameters_from_json(json!({"points": 67}).as_object().unwrap())
        .unwrap();
    let order = NewJob {
        tenant: Tenant::default(),
        kind: "model".into(),
        volume: "vol_1".into(),
        needs: Default::default(),
        parameters,
        idempotency: None,
        webhook: None,
        trace_parent: None,
    };
    match store.rows.file(&order, 10, 0).await.unwrap() {
        Filed::New(job) => job.id,
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn models_of_an_older_database_are_migrated() {
    let folder = tempfile::tempdir().unwrap();
    let older = folder.path().join("migrations");
    std::fs::create_dir(&older).unwrap();
    let first = "0001_queue_and_catalogue.sql";
    let source = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/store/migrations");
    std::fs::copy(source.join(first), older.join(first)).unwrap();
    let options = sqlx::sqlite::SqliteConnectOptions::new()
        .filename(folder.path().join("ventriform.db"))
        .create_if_missing(true);
    let pool = sqlx::SqlitePool::connect_with(options).await.unwrap();
    let migrator = sqlx::migrate::Migrator::new(older.as_path()).await.unwrap();
    migrator.run(&pool).await.unwrap();
    sqlx::query(
        "INSERT INTO models (id, created_at, volume, parameters, summary, software, files)
         VALUES ('mdl_1', 5, 'vol_1', '{}', '{}', '0', '[]')",
    )
    .execute(&pool)
    .await
    .unwrap();
    pool.close().await;

    let store = Store::open(folder.path()).await.unwrap();
    let model = store.rows.product("mdl_1").await.unwrap().unwrap();
    assert_eq!(model.volume.as_deref(), Some("vol_1"));
    assert_eq!(model.created_at, 5);
    let page = ListRequest {
        before: None,
        limit: 9,
    };
    for (kind, count) in [(Resource::Model, 1), (Resource::Segmentation, 0)] {
        let listed = store.rows.products(kind, page).await.unwrap();
        assert_eq!(listed.items.len(), count);
    }
}
