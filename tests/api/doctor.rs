//! `ventriform doctor` and `ventriform backup`, on folders of the real program.

use crate::helpers::{Service, scan, text};
use crate::scu::slice;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use ventriform_service::base::records::{ListRequest, Tenant};
use ventriform_service::callers::{AccessStore, Activity, AuditFilter, verify};
use ventriform_store::{Repair, backup, examine, open_rows};

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

/// A repair that gives what nobody is known to have to the default tenant.
pub fn to_default() -> Repair {
    Repair {
        heir: Some(Tenant::default()),
    }
}

/// Admits callers without credentials to a restored copy, which may be from before the first key.
pub fn open(data: &Path) {
    let opened = Command::new(env!("CARGO_BIN_EXE_ventriform"))
        .args(["keys", "open", "--data-dir"])
        .arg(data)
        .status();
    assert!(opened.unwrap().success());
}

async fn serves(data: &Path, paths: &[String]) {
    let service = Service::start(data, &[]).await;
    for path in paths {
        let answer = service.get(path).send().await.unwrap();
        assert_eq!(answer.status(), 200, "{path}");
    }
    service.kill();
}

fn kinds(found: &ventriform_store::Examination) -> Vec<&str> {
    found.findings.iter().map(|finding| finding.kind).collect()
}

#[tokio::test]
async fn rows_are_made_anew_from_what_lies_beside_the_files() {
    let data = tempfile::tempdir().unwrap();
    let (service, paths) = filled(data.path()).await;
    service.kill();
    let healthy = examine(data.path(), None, None).await.unwrap();
    assert!(healthy.is_healthy(), "{healthy:?}");
    assert_eq!(healthy.items, 2);
    for end in ["", "-wal", "-shm"] {
        // The log may have been moved into the database by the examination.
        let _ = fs::remove_file(data.path().join(format!("ventriform.db{end}")));
    }
    let lost = examine(data.path(), None, None).await.unwrap();
    assert_eq!(
        kinds(&lost),
        ["database-missing", "unknown-item", "unknown-item"]
    );
    assert!(!lost.is_healthy());
    let repaired = examine(data.path(), None, Some(&to_default()))
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
    ventriform_store::Store::open(data.path())
        .await
        .unwrap()
        .close()
        .await;
    let database = data.path().join("ventriform.db");
    let mut content = fs::read(&database).unwrap();
    let half = content.len() / 2;
    content[half..].fill(0xa5);
    fs::write(&database, content).unwrap();
    let found = examine(data.path(), None, None).await.unwrap();
    assert!(kinds(&found).contains(&"database-damaged"), "{found:?}");
    let repaired = examine(data.path(), None, Some(&to_default()))
        .await
        .unwrap();
    // What is lost is named, and all else is repaired.
    assert!(kinds(&repaired).contains(&"rows-lost"), "{repaired:?}");
    let mut others = repaired.findings.iter().filter(|f| f.kind != "rows-lost");
    assert!(
        others.all(|f| f.harmless || f.repair.is_some()),
        "{repaired:?}"
    );
    assert!(!shelf.exists());
    let again = examine(data.path(), None, None).await.unwrap();
    assert!(again.is_healthy() && again.items == 2, "{again:?}");
    serves(data.path(), &paths).await;
}

#[tokio::test]
async fn totals_that_are_not_the_sums_are_found_and_made_anew() {
    use sqlx::{ConnectOptions, Connection, Executor};
    let data = tempfile::tempdir().unwrap();
    let (service, _) = filled(data.path()).await;
    service.kill();
    assert!(examine(data.path(), None, None).await.unwrap().is_healthy());
    let usage = async || {
        let rows = open_rows(data.path()).await.unwrap();
        let usage = rows.usage(&Tenant::default()).await.unwrap();
        rows.close().await;
        usage.bytes
    };
    let stored = usage().await;
    let database = data.path().join("ventriform.db");
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(database);
    let mut connection = options.connect().await.unwrap();
    let wrong = "UPDATE stored_bytes SET bytes = 5; UPDATE stored_items SET items = 9";
    connection.execute(sqlx::raw_sql(wrong)).await.unwrap();
    connection.close().await.unwrap();
    assert_eq!(usage().await, 5);
    let found = examine(data.path(), None, None).await.unwrap();
    assert_eq!(kinds(&found), ["wrong-totals"]);
    let said = &found.findings[0].detail;
    assert!(
        said.contains(&format!(
            "5 for the bytes of tenant default, and there are {stored}"
        )),
        "{said}"
    );
    let repair = Repair::default();
    let repaired = examine(data.path(), None, Some(&repair)).await.unwrap();
    assert!(repaired.is_healthy(), "{repaired:?}");
    assert_eq!(usage().await, stored);
    let again = examine(data.path(), None, None).await.unwrap();
    assert!(again.findings.is_empty(), "{again:?}");
}

/// What a repair takes away and what it brings back has a row of the trail each; a backup, which leaves out what is
/// damaged, adds none to its own.
#[tokio::test]
async fn what_a_repair_changes_is_in_the_trail_and_what_a_backup_leaves_out_is_not() {
    let data = tempfile::tempdir().unwrap();
    let (service, paths) = filled(data.path()).await;
    service.kill();
    let id = paths[0].rsplit('/').next().unwrap();
    let file = |place: &Path| {
        let mut names = fs::read_dir(place).unwrap().map(|one| one.unwrap().path());
        names.find(|path| path.ends_with("volume.nii.gz")).unwrap()
    };
    let whole = file(&data.path().join("volumes").join(id));
    let content = fs::read(&whole).unwrap();
    let rows_about = async |folder: &Path| {
        let rows = open_rows(folder).await.unwrap();
        let filter = AuditFilter {
            object: Some(id.to_owned()),
            ..AuditFilter::default()
        };
        let page = ListRequest {
            before: None,
            limit: 100,
        };
        let found = rows.audit(&filter, page).await.unwrap().items;
        assert_eq!(verify(&*rows).await.unwrap().broken, None);
        rows.close().await;
        let repaired = found
            .iter()
            .filter(|row| row.event.activity == Activity::Repaired);
        repaired
            .map(|row| row.event.tenant.clone())
            .collect::<Vec<_>>()
    };
    fs::write(&whole, "other").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("backup");
    let copied = backup(data.path(), &copy).await.unwrap();
    assert_eq!(copied.damaged.len(), 1, "{copied:?}");
    assert_eq!(rows_about(&copy).await, []);
    let found = examine(data.path(), None, None).await.unwrap();
    assert_eq!(kinds(&found), ["damaged-item"]);
    assert_eq!(rows_about(data.path()).await, [], "a look changes nothing");
    examine(data.path(), None, Some(&to_default()))
        .await
        .unwrap();
    assert_eq!(rows_about(data.path()).await, [Tenant::default()]);
    // Put right by hand, it is brought back to who had it.
    let mut folders = vec![data.path().join("quarantine")];
    let aside = loop {
        let place = folders.pop().unwrap();
        if place.join("volume.nii.gz").exists() {
            break place.join("volume.nii.gz");
        }
        let below = fs::read_dir(&place).unwrap().map(|one| one.unwrap().path());
        folders.extend(below.filter(|path| path.is_dir()));
    };
    fs::write(aside, content).unwrap();
    let back = examine(data.path(), None, Some(&Repair::default()))
        .await
        .unwrap();
    assert!(back.is_healthy(), "{back:?}");
    assert_eq!(
        rows_about(data.path()).await,
        [Tenant::default(), Tenant::default()]
    );
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
    open(&target);
    serves(&target, &paths).await;
    let found = examine(&target, None, None).await.unwrap();
    assert!(found.is_healthy() && found.items == 2, "{found:?}");
    open(&folder.path().join("second"));
    serves(&folder.path().join("second"), &paths[1..]).await;
}

/// Waits until the only group of received objects is a volume; returns it.
async fn gathered(service: &Service) -> Value {
    let deadline = Instant::now() + Duration::from_secs(60);
    loop {
        let list = service.get("/v1/intake").send().await.unwrap();
        let list: Value = list.json().await.unwrap();
        let [group] = &list["intake"].as_array().unwrap()[..] else {
            panic!("{list}");
        };
        if group["state"] == "stored" {
            return group.clone();
        }
        assert!(Instant::now() < deadline, "{list}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

async fn send_slice(service: &Service, number: u16) {
    let request = service.post("/dicom-web/studies");
    let request = request.header("content-type", "application/dicom");
    let answer = request.body(slice("1.2.4", number).file()).send().await;
    assert_eq!(answer.unwrap().status(), 200);
}

#[tokio::test]
async fn received_objects_are_backed_up_checked_and_set_aside() {
    const SERIES_WAIT_FLAGS: [&str; 4] = ["--series-quiet", "1h", "--series-patience", "2h"];
    const AT_ONCE: [&str; 4] = ["--series-quiet", "50ms", "--series-patience", "100ms"];
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &SERIES_WAIT_FLAGS).await;
    for number in 1..=3 {
        send_slice(&service, number).await;
    }
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("backup");
    backup(data.path(), &target).await.unwrap();
    service.kill();
    let found = examine(&target, None, None).await.unwrap();
    assert!(found.is_healthy() && found.files == 3, "{found:?}");
    open(&target);
    let restored = Service::start(&target, &AT_ONCE).await;
    assert_eq!(gathered(&restored).await["objects"], 3);
    restored.kill();

    // One is damaged, one is missing, and one has no row.
    let shelf = data.path().join("received");
    let names = fs::read_dir(&shelf).unwrap();
    let names: Vec<_> = names.map(|entry| entry.unwrap().path()).collect();
    assert_eq!(names.len(), 3);
    fs::write(&names[0], "other").unwrap();
    fs::remove_file(&names[1]).unwrap();
    fs::write(shelf.join("stray"), "x").unwrap();
    let sick = examine(data.path(), None, None).await.unwrap();
    let mut found = kinds(&sick);
    found.sort_unstable();
    assert_eq!(
        found,
        ["damaged-object", "damaged-object", "unknown-object"]
    );
    assert!(!sick.is_healthy());
    let repaired = examine(data.path(), None, Some(&to_default()))
        .await
        .unwrap();
    assert!(repaired.is_healthy(), "{repaired:?}");
    assert_eq!(fs::read_dir(&shelf).unwrap().count(), 1);
    let mut kept = Vec::new();
    for day in fs::read_dir(data.path().join("quarantine")).unwrap() {
        for set_aside in fs::read_dir(day.unwrap().path()).unwrap() {
            kept.push(set_aside.unwrap().file_name());
        }
    }
    assert_eq!(kept.len(), 2, "{kept:?}");
    assert!(examine(data.path(), None, None).await.unwrap().is_healthy());
    let service = Service::start(data.path(), &AT_ONCE).await;
    for number in 1..=3 {
        send_slice(&service, number).await;
    }
    let group = loop {
        let group = gathered(&service).await;
        if group["objects"] == 3 {
            break group;
        }
    };
    let volume = service.get(&text(&group["links"]["volume"])).send().await;
    let volume: Value = volume.unwrap().json().await.unwrap();
    assert_eq!(volume["shape"][2], 3);
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
