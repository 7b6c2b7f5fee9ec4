//! Crashes: the real program is killed without warning and started again.

use crate::helpers::{Service, fake_engine, heart, scan, text};
use serde_json::{Value, json};
use std::time::Duration;
use ventriform_service::base::records::{
    Catalogue, Claimant, DeathLimit, Failure, Fault, FileRecord, Filed, JobOutcome, JobState,
    JobStore, Lease, NewJob, StoredVolume, Tags, Tenant, random_id,
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
