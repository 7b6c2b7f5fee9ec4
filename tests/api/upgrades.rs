//! Data that released versions have left: a copy is opened by the current program, every item is read back, and work
//! goes on.
//!
//! `tests/data/VERSION/` holds what a service of that version had stored, written once, at its release, by
//! [`data_of_this_version_is_written`]:
//!
//! - `folder.zip`: a backup of its data folder, records in SQLite;
//! - `database.sql.gz`: the same records in PostgreSQL, as `pg_dump` writes them;
//! - `seen.json.gz`: the items of each list, the SHA-256 of each stored file, and the status of every other path.
//!
//! Scans are small, and what no version reads again (pictures, tables, meshes in other formats than JSON, all of single
//! gates) is exchanged for a few bytes.

use crate::comparisons::person;
use crate::dicom::{JANE, Patient, nm_of};
use crate::gated::{beating, nifti_of};
use crate::helpers::{TestApp, text};
use crate::postgres::{reached, server};
use crate::readers::profile;
use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use reqwest::StatusCode;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PerfusionDefect, PhantomParameters, phantom};
use ventriform::image::volume::{ReadLimits, Volume};
use ventriform_service::base::records::{
    Clock, Custody, Filed, ItemRecord, JobStore, NewJob, Resource, SystemClock, Tags, Tenant, hex,
};
use ventriform_service::callers::{
    AccessStore, Activity, ApiKey, AuditEvent, KeyRequest, Maker, Quota, Scope, verify,
};
use ventriform_service::config::{PostgresSettings, Settings};
use ventriform_service::work::Engine;
use ventriform_store::{
    Destination, MovedFiles, Store, backup, examine, migrate, note_moved_files, open_database,
};

/// The lists of all items, and the field that names one of each.
const LISTS: [(&str, &str); 13] = [
    ("/v1/volumes", "/id"),
    ("/v1/models", "/id"),
    ("/v1/segmentations", "/id"),
    ("/v1/beats", "/id"),
    ("/v1/comparisons", "/id"),
    ("/v1/normals", "/id"),
    ("/v1/templates", "/id"),
    ("/v1/readers", "/id"),
    ("/v1/jobs", "/id"),
    ("/v1/erasures", "/id"),
    ("/v1/webhooks", "/id"),
    ("/v1/intake", "/id"),
    ("/dicom-web/workitems", "/00080018/Value/0"),
];

/// The folder with the data of each released version.
fn kept() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data")
}

/// What a service answers: the items of each list, the SHA-256 of each file, and the status of each other path.
#[derive(Default, PartialEq, Debug)]
struct Seen {
    lists: BTreeMap<String, Vec<String>>,
    files: BTreeMap<String, String>,
    answers: BTreeMap<String, u16>,
}

impl Seen {
    /// Follows every link from the lists.
    async fn of(app: &TestApp) -> Self {
        let mut seen = Self::default();
        let mut open: Vec<String> = Vec::new();
        for (list, id) in LISTS {
            let page = app.json(list).await;
            let items = page
                .as_array()
                .or_else(|| page[list.rsplit('/').next()?].as_array());
            let items = items.unwrap_or_else(|| panic!("{list}: {page}"));
            let ids = items.iter().map(|item| text(item.pointer(id).unwrap()));
            seen.lists.insert(list.to_owned(), ids.collect());
            open.extend(seen.links(&page));
        }
        while let Some(path) = open.pop() {
            if seen.files.contains_key(&path) || seen.answers.contains_key(&path) {
                continue;
            }
            let answer = app.get(&path).send().await.unwrap();
            let status = answer.status().as_u16();
            seen.answers.insert(path, status);
            let kind = answer.headers().get("content-type").cloned();
            if kind.is_some_and(|kind| kind == "application/json") {
                let page = answer.json().await.unwrap();
                open.extend(seen.links(&page));
            } else {
                answer.bytes().await.unwrap();
            }
        }
        for (path, hash) in &mut seen.files {
            let answer = app.get(path).send().await.unwrap();
            assert_eq!(answer.status(), StatusCode::OK, "{path}");
            *hash = hex(&Sha256::digest(answer.bytes().await.unwrap()));
        }
        seen
    }

    /// The paths that a document names; those of stored files are noted as such.
    fn links(&mut self, document: &Value) -> Vec<String> {
        let mut found = Vec::new();
        let mut open = vec![document];
        while let Some(value) = open.pop() {
            match value {
                Value::String(path) if path.starts_with("/v1/") => found.push(path.clone()),
                Value::Array(values) => open.extend(values),
                Value::Object(object) => open.extend(object.values()),
                _ => {}
            }
            // A file of a product.
            if value.get("bytes").is_some()
                && let Some(path) = value.get("href").and_then(Value::as_str)
            {
                self.files.insert(path.to_owned(), String::new());
            }
        }
        found
    }

    fn read(path: &Path) -> Self {
        let seen: Value = serde_json::from_str(&unzipped(path)).unwrap();
        let part = |name: &str| seen[name].clone();
        Self {
            lists: serde_json::from_value(part("lists")).unwrap(),
            files: serde_json::from_value(part("files")).unwrap(),
            answers: serde_json::from_value(part("answers")).unwrap(),
        }
    }

    fn write(&self, path: &Path) {
        let seen = json!({"lists": self.lists, "files": self.files, "answers": self.answers});
        zipped(&serde_json::to_string_pretty(&seen).unwrap(), path);
    }
}

fn unzipped(path: &Path) -> String {
    let mut text = String::new();
    GzDecoder::new(File::open(path).unwrap())
        .read_to_string(&mut text)
        .unwrap();
    text
}

fn zipped(text: &str, to: &Path) {
    let mut file = GzEncoder::new(File::create(to).unwrap(), Compression::best());
    file.write_all(text.as_bytes()).unwrap();
    file.finish().unwrap();
}

/// A service of the current program.
async fn service(data: Arc<TempDir>, key: &str, change: impl FnOnce(&mut Settings)) -> TestApp {
    let app = TestApp::on(data, Engine::new(ReadLimits::default()), change).await;
    app.seen_with(key).running_as(app)
}

/// Makes an administrator's key, beside no service.
async fn admin(data: &Path, database: Option<&PostgresSettings>) -> String {
    let rows = open_database(data, database).await.unwrap();
    let now = SystemClock.now();
    let request = KeyRequest {
        name: "of this test".into(),
        tenant: Tenant::default(),
        scope: Scope::Admin,
        quota: Quota::default(),
        maker: Maker::Operator,
        owner: None,
        expires_at: None,
    };
    let (key, secret) = ApiKey::make(request, now).unwrap();
    let event = AuditEvent::new(now, Activity::KeyCreated, key.tenant.clone(), "test".into());
    rows.add_key(&key, &event.on(&key.id)).await.unwrap();
    let trail = verify(&*rows).await.unwrap();
    assert_eq!(trail.broken, None, "{trail:?}");
    rows.close().await;
    secret
}

/// Unpacks a data folder.
fn unpacked(version: &Path) -> Arc<TempDir> {
    let folder = tempfile::tempdir().unwrap();
    let archive = File::open(version.join("folder.zip")).unwrap();
    let mut archive = zip::ZipArchive::new(archive).unwrap();
    archive.extract(folder.path()).unwrap();
    Arc::new(folder)
}

/// Reads back what a version has stored, and has the job done that waited.
async fn reads_back_and_goes_on(app: &TestApp, version: &Path) {
    let expected = Seen::read(&version.join("seen.json.gz"));
    let waiting = app.json("/v1/jobs?state=queued").await;
    let running = app.json("/v1/jobs?state=running").await;
    for job in [waiting, running]
        .iter()
        .flat_map(|page| page["jobs"].as_array().unwrap())
    {
        let done = app.until(job, &["succeeded", "failed"]).await;
        assert_eq!(done["state"], "succeeded", "{done}");
    }
    let seen = Seen::of(app).await;
    for (list, ids) in &expected.lists {
        let known = seen.lists[list].iter().filter(|id| ids.contains(id));
        assert!(known.eq(ids), "{list}: {:?}, not {ids:?}", seen.lists[list]);
    }
    for (path, hash) in &expected.files {
        assert_eq!(seen.files.get(path), Some(hash), "{path}");
    }
    for (path, status) in &expected.answers {
        assert_eq!(seen.answers.get(path), Some(status), "{path}");
    }
    assert!(expected.files.len() > 100 && expected.answers.len() > 50);
}

fn versions() -> Vec<PathBuf> {
    let folders = fs::read_dir(kept()).unwrap();
    let versions: Vec<PathBuf> = folders.map(|folder| folder.unwrap().path()).collect();
    assert!(!versions.is_empty());
    versions
}

#[tokio::test(flavor = "multi_thread")]
async fn a_folder_of_every_released_version_is_read_and_goes_on() {
    for version in versions() {
        let data = unpacked(&version);
        let key = admin(data.path(), None).await;
        let in_file = |settings: &mut Settings| settings.database = "sqlite".parse().unwrap();
        let app = service(data, &key, in_file).await;
        reads_back_and_goes_on(&app, &version).await;
        let data = app.stop().await;
        let found = examine(data.path(), None, None).await.unwrap();
        assert!(found.is_healthy(), "{:?}", found.findings);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dump_of_every_released_version_is_read_and_goes_on() {
    for version in versions() {
        let data = unpacked(&version);
        fs::remove_file(data.path().join("ventriform.db")).unwrap();
        let url = server().database().await;
        let dump = unzipped(&version.join("database.sql.gz"));
        server().run(url.rsplit('/').next().unwrap(), &dump).await;
        let database = reached(&url);
        let files = MovedFiles::Folder(data.path().to_owned());
        note_moved_files(data.path(), Some(&database), &files)
            .await
            .unwrap();
        let key = admin(data.path(), Some(&database)).await;
        let app = service(data, &key, |settings| {
            settings.database = url.parse().unwrap();
            settings.blobs = "folder".parse().unwrap();
        })
        .await;
        reads_back_and_goes_on(&app, &version).await;
        app.stop().await;
    }
}

/// The parts of the database in `folder`: kind, name and definition of each.
async fn parts(folder: &Path) -> Vec<(String, String, Option<String>)> {
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(folder.join("ventriform.db"));
    let pool = sqlx::SqlitePool::connect_with(options).await.unwrap();
    let parts = sqlx::query_as("SELECT type, name, sql FROM sqlite_schema ORDER BY type, name");
    let parts = parts.fetch_all(&pool).await.unwrap();
    pool.close().await;
    parts
}

#[tokio::test]
async fn a_database_of_every_released_version_becomes_what_a_new_one_is() {
    let new = tempfile::tempdir().unwrap();
    Store::open(new.path()).await.unwrap().close().await;
    let expected = parts(new.path()).await;
    assert!(expected.len() > 100, "{}", expected.len());
    for version in versions() {
        let data = unpacked(&version);
        Store::open(data.path()).await.unwrap().close().await;
        assert_eq!(parts(data.path()).await, expected, "{}", version.display());
    }
}

// ------------------------------------------------------------------------------ at a release

/// A small heart.
fn small_heart() -> Volume {
    let parameters = PhantomParameters {
        shape: [20; 3],
        spacing_mm: [10.4; 3],
        noise: 0.0,
        ..PhantomParameters::default()
    };
    phantom(&parameters, &Monitor::silent()).unwrap().volume
}

fn packed(volume: &Volume) -> Vec<u8> {
    nifti::write(volume, StoredType::Int16, true).unwrap()
}

/// A service that is filled with items.
struct Filling(TestApp);

impl Filling {
    async fn sent(&self, request: reqwest::RequestBuilder) -> Value {
        let answer = request.send().await.unwrap();
        let status = answer.status();
        let body = answer.text().await.unwrap();
        assert!(status.is_success(), "{status} {body}");
        serde_json::from_str(&body).unwrap_or_default()
    }

    async fn volume(&self, bytes: Vec<u8>) -> String {
        let volume = self.sent(self.0.post("/v1/volumes").body(bytes)).await;
        text(&volume["id"])
    }

    async fn put(&self, path: &str, body: Value) {
        let url = format!("{}{path}", self.0.url);
        self.sent(self.0.client.put(url).json(&body)).await;
    }

    /// Files a job and waits for its end; returns the job.
    async fn done(&self, path: &str, order: Value) -> Value {
        let job = self.sent(self.0.post(path).json(&order)).await;
        self.0.until(&job, &["succeeded", "failed"]).await
    }

    /// The id of what a job makes.
    async fn made(&self, path: &str, order: Value) -> String {
        let job = self.done(path, order).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        let kind = text(&job["kind"]);
        text(&job[&kind])
    }

    /// Erases a volume alone.
    async fn erase(&self, volume: &str) {
        self.sent(self.0.delete(&format!("/v1/volumes/{volume}")))
            .await;
    }
}

/// Stores something of every kind; what is large is erased again. Returns the volume that stays.
async fn fill(app: &Filling) -> String {
    let small = app.volume(packed(&small_heart())).await;
    app.put(
        &format!("/v1/volumes/{small}/identity"),
        json!({"patient_id": "7", "study_uid": "1.2.3"}),
    )
    .await;
    let order = json!({"kind": "model", "volume": small, "parameters": {"points": 50},
        "external_id": "A17", "labels": {"study": "42"}, "priority": "bulk"});
    let model = app.made("/v1/jobs", order).await;
    let mesh = app.0.get(&format!("/v1/models/{model}/mesh.json"));
    let mesh = mesh.send().await.unwrap().bytes().await.unwrap();
    let template = app.0.post("/v1/templates?name=small&organ=left_ventricle");
    let template = app
        .sent(
            template
                .header("content-type", "application/json")
                .body(mesh),
        )
        .await;
    let template = text(&template["id"]);
    let reader = app.0.post("/v1/readers?name=anna").json(&profile(1.25));
    let reader = text(&app.sent(reader).await["id"]);

    // A received image, which names its patient.
    let received = nm_of(&JANE, &[&small_heart()]);
    let request = app.0.post("/dicom-web/studies/1.2.840.99999.7");
    app.sent(
        request
            .header("content-type", "application/dicom")
            .body(received),
    )
    .await;
    let groups = loop {
        let groups = app.0.json("/v1/intake").await;
        if groups["intake"][0]["state"] == "stored" {
            break groups;
        }
        tokio::time::sleep(std::time::Duration::from_millis(20)).await;
    };
    let scan = text(&groups["intake"][0]["volume"]);
    let order = json!({"kind": "segmentation", "volume": scan,
        "parameters": {"model": template, "reader": reader}});
    app.made("/v1/jobs", order).await;

    // Limits, and two scans that are scored by them.
    let mut cases = Vec::new();
    for seed in 0..13 {
        let volume = app.volume(packed(&person(seed, &[]))).await;
        let sex = if seed % 2 == 0 { "F" } else { "M" };
        cases.push(
            json!({"case": format!("n{seed}"), "volume": volume, "sex": sex, "protocol": "rest",
            "tracer": "none (simulated)", "attenuation_corrected": false}),
        );
    }
    let order = json!({"name": "simulated", "cases": cases, "parameters": {"mixed": true}});
    let normals = app.made("/v1/normals", order).await;
    for case in &cases {
        app.erase(&text(&case["volume"])).await;
    }
    let later = Patient {
        study: "1.2.840.99999.7.20",
        ..JANE
    };
    let defects = [7, 8, 13, 14].map(|segment| PerfusionDefect {
        segment,
        severity: 0.6,
    });
    let stress = app.volume(nm_of(&JANE, &[&person(100, &defects)])).await;
    let rest = app.volume(nm_of(&later, &[&person(101, &[])])).await;
    let order = json!({"stress": stress, "rest": rest, "normals": normals, "parameters": {
        "stress_protocol": "rest", "rest_protocol": "rest", "sex": "F", "model": template}});
    app.made("/v1/comparisons", order).await;
    let gates = app.volume(nifti_of(&beating()[..6], None)).await;
    let order = json!({"kind": "beat", "volume": gates, "parameters": {"model": template}});
    app.made("/v1/jobs", order).await;
    for volume in [stress, rest, gates] {
        app.erase(&volume).await;
    }

    // A failure, of which a webhook is told; a work item; a legal hold.
    app.sent(
        app.0
            .post("/v1/webhooks")
            .json(&json!({"url": "http://127.0.0.1:9/", "events": ["failed"]})),
    )
    .await;
    let order = json!({"kind": "model", "volume": small, "parameters": {"iso": "absolute:1e30"}});
    assert_eq!(app.done("/v1/jobs", order).await["state"], "failed");
    let item = json!([{
        "00741000": {"vr": "CS", "Value": ["SCHEDULED"]},
        "00741200": {"vr": "CS", "Value": ["HIGH"]},
        "00741204": {"vr": "LO", "Value": ["Fit a ventricle"]},
        "00404005": {"vr": "DT", "Value": ["20261123101500"]},
        "00404041": {"vr": "CS", "Value": ["READY"]},
        "00081195": {"vr": "UI"},
    }]);
    let request = app.0.post("/dicom-web/workitems?1.2.3.4");
    app.sent(
        request
            .header("content-type", "application/dicom+json")
            .body(item.to_string()),
    )
    .await;
    app.put(
        &format!("/v1/volumes/{scan}/hold"),
        json!({"reason": "a study"}),
    )
    .await;
    small
}

/// Exchanges the files of products that no version reads again.
async fn exchange_files(data: &Path) {
    let mut store = Store::open(data).await.unwrap();
    let page = store.rows.records(Resource::Model, 0, 100).await.unwrap();
    for mut record in page {
        let ItemRecord::Product(product) = &mut record else {
            panic!("{record:?}");
        };
        let shelf = data.join(product.resource().plural()).join(&product.id);
        for file in &mut product.files {
            let is_read_again = !file.name.contains("_gate") && !file.name.starts_with("region");
            let (_, extension) = file.name.rsplit_once('.').unwrap();
            let content = match extension {
                "json" | "gz" if is_read_again => continue,
                "png" => black_pixel(),
                "svg" => b"<svg xmlns=\"http://www.w3.org/2000/svg\"/>".to_vec(),
                _ => b"exchanged".to_vec(),
            };
            file.bytes = content.len() as u64;
            file.sha256 = hex(&Sha256::digest(&content));
            fs::write(shelf.join(&file.name), content).unwrap();
        }
        store.rows.amend(&record).await.unwrap();
        store.blobs.describe(&record).await.unwrap();
    }
    store.close().await;
}

/// A picture of one pixel.
fn black_pixel() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 1, 1);
    encoder.set_color(png::ColorType::Rgb);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[0; 3]).unwrap();
    writer.finish().unwrap();
    bytes
}

/// Files a job that waits for the next service.
async fn leave_a_job(data: &Path, volume: &str) {
    let mut store = Store::open(data).await.unwrap();
    let work = Engine::new(ReadLimits::default());
    let work = work.work("model").unwrap().clone();
    let parameters = work.parameters_from_json(json!({"points": 67}).as_object().unwrap());
    let order = NewJob {
        kind: "model".into(),
        volume: Some(volume.into()),
        parameters: parameters.unwrap(),
        tags: Tags::default(),
        ..NewJob::default()
    };
    let filed = store
        .rows
        .file(&order, 10, SystemClock.now())
        .await
        .unwrap();
    assert!(matches!(filed, Filed::New(_)));
    store.close().await;
}

/// Packs a folder.
fn pack(folder: &Path, to: &Path) {
    let mut archive = zip::ZipWriter::new(File::create(to).unwrap());
    let options = zip::write::SimpleFileOptions::default().compression_level(Some(9));
    let mut open = vec![folder.to_owned()];
    let mut files = BTreeSet::new();
    while let Some(path) = open.pop() {
        for entry in fs::read_dir(&path).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                files.insert(path);
            }
        }
    }
    for path in files {
        let name = path.strip_prefix(folder).unwrap().to_str().unwrap();
        archive.start_file(name, options).unwrap();
        archive.write_all(&fs::read(&path).unwrap()).unwrap();
    }
    archive.finish().unwrap();
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "writes the folder of this version in tests/data, at its release"]
async fn data_of_this_version_is_written() {
    let data = Arc::new(tempfile::tempdir().unwrap());
    let key = admin(data.path(), None).await;
    let app = service(data, &key, |settings| {
        settings.database = "sqlite".parse().unwrap();
        settings.webhook_allow = "127.0.0.0/8".parse().unwrap();
    })
    .await;
    let filling = Filling(app);
    let volume = fill(&filling).await;
    let data = filling.0.stop().await;
    exchange_files(data.path()).await;
    let app = service(data, &key, |settings| {
        settings.database = "sqlite".parse().unwrap();
    })
    .await;
    let seen = Seen::of(&app).await;
    assert!(
        seen.answers.values().all(|status| *status < 500),
        "{seen:?}"
    );
    let data = app.stop().await;
    leave_a_job(data.path(), &volume).await;

    let to = kept().join(env!("CARGO_PKG_VERSION"));
    fs::create_dir_all(&to).unwrap();
    seen.write(&to.join("seen.json.gz"));
    let scratch = tempfile::tempdir().unwrap();
    let copy = scratch.path().join("folder");
    backup(data.path(), &copy).await.unwrap();
    pack(&copy, &to.join("folder.zip"));

    let url = server().database().await;
    let on_server = Destination {
        database: Some(reached(&url)),
        s3: None,
        folder: Some(scratch.path().join("on_server")),
    };
    migrate(data.path(), &on_server, |_| {}).await.unwrap();
    let dumped = server()
        .program("pg_dump")
        .args(["--no-owner", "--no-unlogged-table-data", "--inserts"])
        .arg(&url)
        .output()
        .unwrap();
    assert!(dumped.status.success());
    // Without lines for psql alone, and a setting that servers before version 17 do not know.
    let dump = String::from_utf8(dumped.stdout).unwrap();
    let dump = dump
        .lines()
        .filter(|line| !line.starts_with('\\') && !line.starts_with("SET transaction_timeout"));
    let dump: Vec<&str> = dump.collect();
    zipped(&dump.join("\n"), &to.join("database.sql.gz"));
    let sizes = fs::read_dir(&to)
        .unwrap()
        .map(|file| file.unwrap().metadata().unwrap().len());
    let bytes: u64 = sizes.sum();
    assert!(bytes < 300_000, "{bytes} bytes");
}
