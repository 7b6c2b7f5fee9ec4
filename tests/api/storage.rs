//! The service's answers when its disk is nearly full or its database is locked.

use crate::helpers::{TestApp, problem, text, volume};
use futures::future::join_all;
use serde_json::json;
use sqlx::ConnectOptions;
use sqlx::sqlite::SqliteConnectOptions;
use std::time::Duration;
use ventriform_program::cli::advice::advised;
use ventriform_store::Store;

/// More than any disk has.
const ENDLESS_SPACE: &str = "1000000GiB";

#[tokio::test]
async fn below_the_reserve_uploads_and_jobs_are_refused_and_reads_go_on() {
    let app = TestApp::start().await;
    let id = app.volume("sphere").await;
    let model = app.model("sphere").await;
    let data = app.stop().await;
    let app = TestApp::on(data, crate::helpers::fake_engine(), |settings| {
        settings.min_free = ENDLESS_SPACE.parse().unwrap();
    })
    .await;
    let upload = || app.post("/v1/volumes").body(volume("other"));
    let answer = upload().send().await.unwrap();
    assert!(answer.headers().contains_key("retry-after"));
    problem(answer, 507, "insufficient-storage").await;
    let direct = app.post("/v1/models").body(volume("other"));
    problem(direct.send().await.unwrap(), 507, "insufficient-storage").await;
    let job = app
        .post("/v1/jobs")
        .json(&json!({"kind": "model", "volume": id}));
    problem(job.send().await.unwrap(), 507, "insufficient-storage").await;
    problem(app.get("/readyz").send().await.unwrap(), 503, "not-ready").await;
    let links = &model["links"];
    for path in ["/healthz", "/v1/volumes", links["self"].as_str().unwrap()] {
        app.json(path).await;
    }
    let erased = app
        .delete(&format!("/v1/volumes/{id}"))
        .send()
        .await
        .unwrap();
    assert_eq!(erased.status(), 204, "erasing makes room");
}

#[tokio::test]
async fn overlapping_probes_share_one_check() {
    let app = TestApp::start().await;
    for _ in 0..3 {
        let probes = (0..100).map(|_| app.get("/readyz").send());
        for answer in join_all(probes).await {
            assert_eq!(answer.unwrap().status(), 200);
        }
    }
    assert!(app.stored().is_empty(), "{:?}", app.stored());
}

#[tokio::test]
async fn a_locked_database_is_said_to_be_busy_and_recovers() {
    let app = TestApp::with(|settings| settings.write_wait = "200ms".parse().unwrap()).await;
    let id = app.volume("sphere").await;
    let path = app.data.path().join("ventriform.db");
    let mut other = SqliteConnectOptions::new()
        .filename(path)
        .connect()
        .await
        .unwrap();
    sqlx::query("BEGIN IMMEDIATE")
        .execute(&mut other)
        .await
        .unwrap();
    let upload = || app.post("/v1/volumes").body(volume("other"));
    let answer = upload().send().await.unwrap();
    assert_eq!(answer.headers()["retry-after"], "5");
    problem(answer, 503, "storage-busy").await;
    let job = app
        .post("/v1/jobs")
        .json(&json!({"kind": "model", "volume": id}));
    problem(job.send().await.unwrap(), 503, "storage-busy").await;
    let unready = problem(app.get("/readyz").send().await.unwrap(), 503, "not-ready").await;
    assert!(
        unready["detail"].as_str().unwrap().contains("not free"),
        "{unready}"
    );
    app.json(&format!("/v1/volumes/{id}")).await;
    sqlx::query("ROLLBACK").execute(&mut other).await.unwrap();
    assert_eq!(upload().send().await.unwrap().status(), 201);
    tokio::time::sleep(Duration::from_millis(1100)).await;
    app.json("/readyz").await;
}

#[tokio::test]
async fn files_without_a_record_are_set_aside_and_unfinished_erasures_ended() {
    let app = TestApp::start().await;
    let kept = app.volume("kept").await;
    let erased = app.volume("erased").await;
    app.delete(&format!("/v1/volumes/{erased}"))
        .send()
        .await
        .unwrap();
    let data = app.stop().await;
    let lost = "vol_00000000000000000000000000000000";
    for id in [lost, &erased] {
        let folder = data.path().join("volumes").join(id);
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(folder.join("volume.nii"), "content").unwrap();
    }
    let app = TestApp::on(data, crate::helpers::fake_engine(), |_| {}).await;
    let until = std::time::Instant::now() + Duration::from_secs(20);
    while app.stored() != [kept.clone()] {
        assert!(std::time::Instant::now() < until, "{:?}", app.stored());
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let days = std::fs::read_dir(app.data.path().join("quarantine")).unwrap();
    let days: Vec<_> = days.map(|day| day.unwrap().path()).collect();
    assert_eq!(days.len(), 1);
    assert_eq!(
        std::fs::read(days[0].join(lost).join("volume.nii")).unwrap(),
        b"content"
    );
    assert_eq!(std::fs::read_dir(&days[0]).unwrap().count(), 1);
}

#[tokio::test]
async fn without_its_database_a_folder_with_items_is_refused_and_left_alone() {
    let app = TestApp::start().await;
    let id = app.volume("sphere").await;
    let data = app.stop().await;
    let database = data.path().join("ventriform.db");
    let whole = std::fs::read(&database).unwrap();
    for emptied in [false, true] {
        if emptied {
            std::fs::write(&database, "").unwrap()
        } else {
            std::fs::remove_file(&database).unwrap()
        }
        let Err(refusal) = Store::open(data.path()).await else {
            panic!("it started");
        };
        let said = advised(&refusal.into());
        assert!(
            said.contains("doctor") && said.contains("ventriform.db"),
            "{said}"
        );
        assert!(
            data.path()
                .join("volumes")
                .join(&id)
                .join("volume.nii")
                .exists()
        );
    }
    std::fs::write(&database, whole).unwrap();
    let app = TestApp::on(data, crate::helpers::fake_engine(), |_| {}).await;
    app.json(&format!("/v1/volumes/{id}")).await;
}

#[tokio::test]
async fn a_lost_write_ahead_log_is_noticed_after_a_crash_only() {
    let data = tempfile::tempdir().unwrap();
    let service = crate::helpers::Service::start(data.path(), &[]).await;
    service.kill();
    let log = data.path().join("ventriform.db-wal");
    let content = std::fs::read(&log).unwrap();
    std::fs::remove_file(&log).unwrap();
    let Err(refusal) = Store::open(data.path()).await else {
        panic!("it started");
    };
    assert!(
        refusal.to_string().contains("ventriform.db-wal"),
        "{refusal}"
    );
    std::fs::write(&log, content).unwrap();
    let mut store = Store::open(data.path()).await.unwrap();
    store.close().await;
    drop(store);
    assert!(!log.exists(), "closed in order");
    Store::open(data.path()).await.unwrap();
}

#[tokio::test]
async fn damaged_files_are_neither_served_nor_computed_on_and_a_new_upload_repairs_them() {
    let app = TestApp::start().await;
    let id = app.volume("sphere damaged").await;
    let model = app.model("sphere").await;
    let mesh = text(&model["links"]["mesh"]) + ".json";
    let whole = app.get(&mesh).send().await.unwrap().bytes().await.unwrap();
    let file = app
        .data
        .path()
        .join(format!("models/{}/mesh.json", text(&model["id"])));
    let mut altered = whole.to_vec();
    altered[100] ^= 1;
    for content in [&altered[..], &whole[..50]] {
        std::fs::write(&file, content).unwrap();
        problem(app.get(&mesh).send().await.unwrap(), 500, "damaged-file").await;
    }
    std::fs::remove_file(&file).unwrap();
    problem(app.get(&mesh).send().await.unwrap(), 500, "damaged-file").await;
    let again = app.model("sphere").await;
    assert_eq!(
        again["id"], model["id"],
        "the same job gives the same model"
    );
    let mended = app.get(&mesh).send().await.unwrap();
    let etag = mended.headers()["etag"].to_str().unwrap().to_owned();
    let mended = mended.bytes().await.unwrap();
    use sha2::{Digest, Sha256};
    let hash: String = Sha256::digest(&mended)
        .iter()
        .map(|b| format!("{b:02x}"))
        .collect();
    assert_eq!((etag, &mended), (format!("\"{hash}\""), &whole));

    let file = app.data.path().join(format!("volumes/{id}/volume.nii"));
    for content in [&b"VOLUME sphere changed"[..], b"VOL"] {
        std::fs::write(&file, content).unwrap();
        problem(
            app.get(&format!("/v1/volumes/{id}/preview.png"))
                .send()
                .await
                .unwrap(),
            500,
            "damaged-file",
        )
        .await;
        let job = app
            .post("/v1/jobs")
            .json(&json!({"kind": "model", "volume": id}));
        let job = job.send().await.unwrap().json().await.unwrap();
        let job = app.until(&job, &["failed", "succeeded"]).await;
        assert_eq!(
            job["error"]["type"], "urn:ventriform:problem:damaged-file",
            "{job}"
        );
        assert_eq!(app.volume("sphere damaged").await, id);
        assert_eq!(std::fs::read(&file).unwrap(), volume("sphere damaged"));
    }
    std::fs::remove_dir_all(file.parent().unwrap()).unwrap();
    assert_eq!(app.volume("sphere damaged").await, id);
    assert_eq!(std::fs::read(&file).unwrap(), volume("sphere damaged"));
}
