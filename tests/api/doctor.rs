//! `ventriform doctor` and `ventriform backup`, on folders of the real program.

use crate::helpers::{Service, scan, text};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;
use ventriform::jobs::Tenant;
use ventriform::store::{backup, examine};

/// A volume and a model; returns the paths that must be served, and the folder's service.
async fn filled(data: &Path) -> (Service, Vec<String>) {
    let service = Service::start(data, &["--workers", "1"]).await;
    let answer = service.post("/v1/models?points=67").body(scan());
    let job: Value = answer.send().await.unwrap().json().await.unwrap();
    let job = service.ended(&text(&job["id"])).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let volume = format!("/v1/volumes/{}", text(&job["volume"]));
    let paths = vec![
        volume,
        text(&job["links"]["model"]),
        text(&job["links"]["mesh"]) + ".stl",
    ];
    (service, paths)
}

async fn serves(data: &Path, paths: &[String]) {
    let service = Service::start(data, &[]).await;
    for path in paths {
        let answer = service.get(path).send().await.unwrap();
        assert_eq!(answer.status(), 200, "{path}");
    }
    service.kill();
}

fn kinds(found: &ventriform::store::Examination) -> Vec<&str> {
    found.findings.iter().map(|finding| finding.kind).collect()
}

#[tokio::test]
async fn rows_are_made_anew_from_what_lies_beside_the_files() {
    let data = tempfile::tempdir().unwrap();
    let (service, paths) = filled(data.path()).await;
    service.kill();
    let healthy = examine(data.path(), None).await.unwrap();
    assert!(healthy.is_healthy(), "{healthy:?}");
    assert_eq!(healthy.items, 2);
    for end in ["", "-wal", "-shm"] {
        // The log may have been moved into the database by the examination.
        let _ = fs::remove_file(data.path().join(format!("ventriform.db{end}")));
    }
    let lost = examine(data.path(), None).await.unwrap();
    assert_eq!(
        kinds(&lost),
        ["database-missing", "unknown-item", "unknown-item"]
    );
    assert!(!lost.is_healthy());
    let repaired = examine(data.path(), Some(&Tenant::default()))
        .await
        .unwrap();
    assert!(repaired.is_healthy(), "{repaired:?}");
    serves(data.path(), &paths).await;
}

#[tokio::test]
async fn readable_rows_of_a_damaged_database_are_kept_and_broken_items_set_aside() {
    let data = tempfile::tempdir().unwrap();
    let (service, paths) = filled(data.path()).await;
    let lost = service.post("/v1/volumes").body(crate::helpers::heart().1);
    let lost: Value = lost.send().await.unwrap().json().await.unwrap();
    service.kill();
    let shelf = data.path().join("volumes").join(text(&lost["id"]));
    fs::write(shelf.join("volume.nii.gz"), "other").unwrap();
    // Moves the log into the database, whose second half is then destroyed.
    ventriform::store::Store::open(data.path())
        .await
        .unwrap()
        .close()
        .await;
    let database = data.path().join("ventriform.db");
    let mut content = fs::read(&database).unwrap();
    let half = content.len() / 2;
    content[half..].fill(0xa5);
    fs::write(&database, content).unwrap();
    let found = examine(data.path(), None).await.unwrap();
    assert!(kinds(&found).contains(&"database-damaged"), "{found:?}");
    let repaired = examine(data.path(), Some(&Tenant::default()))
        .await
        .unwrap();
    assert!(repaired.is_healthy(), "{repaired:?}");
    assert!(!shelf.exists());
    let again = examine(data.path(), None).await.unwrap();
    assert!(again.is_healthy() && again.items == 2, "{again:?}");
    serves(data.path(), &paths).await;
}

#[tokio::test]
async fn a_backup_made_while_the_service_runs_is_restored_with_everything() {
    let data = tempfile::tempdir().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("backup");
    let (service, paths) = filled(data.path()).await;
    let first = backup(data.path(), &target).await.unwrap();
    assert_eq!((first.items, first.copied), (2, 2));
    let erased = format!("/v1/volumes/{}", text(&Value::from(&paths[0][12..])));
    assert_eq!(service.delete(&erased).send().await.unwrap().status(), 204);
    let second = backup(data.path(), &folder.path().join("second"))
        .await
        .unwrap();
    assert_eq!((second.items, second.copied), (1, 1));
    let again = backup(data.path(), &folder.path().join("second"))
        .await
        .unwrap();
    assert_eq!((again.items, again.copied), (1, 0));
    service.kill();
    serves(&target, &paths).await;
    let found = examine(&target, None).await.unwrap();
    assert!(found.is_healthy() && found.items == 2, "{found:?}");
    serves(&folder.path().join("second"), &paths[1..]).await;
}

#[test]
fn the_command_reports_by_its_status() {
    let data = tempfile::tempdir().unwrap();
    let doctor = |arguments: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_ventriform"))
            .args(["doctor", "--data-dir"])
            .arg(data.path())
            .args(arguments)
            .output()
            .unwrap()
    };
    let sick = doctor(&["--json"]);
    assert_eq!(sick.status.code(), Some(1));
    let report: Value = serde_json::from_slice(&sick.stdout).unwrap();
    assert_eq!(report["findings"][0]["kind"], "database-missing");
    assert_eq!(doctor(&["--repair"]).status.code(), Some(0));
    assert_eq!(doctor(&[]).status.code(), Some(0));
}
