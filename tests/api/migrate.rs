//! Moving a data folder to PostgreSQL and an S3 store: what is served before and after is the same.

use crate::helpers::{TestApp, fake_engine, key, text};
use crate::postgres::{reached, reached_at, server};
use crate::s3_server::{FaultProxy, Network, S3Server};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use tempfile::TempDir;
use ventriform_program::cli::advice::advised;
use ventriform_service::base::records::{Clock, Resource, SystemClock, Tenant, random_id};
use ventriform_service::callers::{AccessStore, Activity, AuditEvent, Quota, Scope, verify};
use ventriform_service::config::{AwsVariables, PostgresSettings, Settings};
use ventriform_store::{
    Destination, MigrateError, Migrated, MovedFiles, OpenError, Progress, Store, StoreSettings,
    migrate, note_moved_files, open_database, open_rows,
};

/// Lists whose answers must not change.
const LIST_PATHS: [&str; 5] = [
    "/v1/volumes",
    "/v1/models",
    "/v1/jobs?state=succeeded",
    "/v1/jobs?labels=study:42",
    "/v1/erasures",
];

/// A folder on which a service has worked, with an administrator's key.
struct Folder {
    data: Arc<TempDir>,
    key: String,
    seen: BTreeMap<String, Vec<u8>>,
}

/// The answers that a caller gets: lists, and the files behind their links.
async fn seen(app: &TestApp) -> BTreeMap<String, Vec<u8>> {
    let mut seen = BTreeMap::new();
    for list in LIST_PATHS {
        let page = app.json(list).await;
        seen.insert(list.to_owned(), serde_json::to_vec(&page).unwrap());
    }
    for model in app.json("/v1/models").await["models"].as_array().unwrap() {
        for link in ["mesh", "report"] {
            let path = text(&model["links"][link]);
            let answer = app.get(&path).send().await.unwrap();
            let content = answer.error_for_status().unwrap().bytes().await.unwrap();
            seen.insert(path, content.to_vec());
        }
    }
    for volume in app.json("/v1/volumes").await["volumes"].as_array().unwrap() {
        let path = format!("/v1/volumes/{}/content", text(&volume["id"]));
        let answer = app.get(&path).send().await.unwrap();
        let content = answer.error_for_status().unwrap().bytes().await.unwrap();
        seen.insert(path, content.to_vec());
    }
    seen
}

async fn service(data: Arc<TempDir>, key: &str, change: impl FnOnce(&mut Settings)) -> TestApp {
    let app = TestApp::on(data, fake_engine(), change).await;
    app.seen_with(key).running_as(app)
}

/// A service's folder with volumes, models, labels, an erasure and keys.
async fn worked_on() -> Folder {
    let data = Arc::new(tempfile::tempdir().unwrap());
    let quota = Quota::default();
    let (_, key) = key(data.path(), Scope::Admin, "clinic", quota).await;
    let app = service(data, &key, |_| {}).await;
    for words in ["sphere", "sphere again"] {
        app.model(words).await;
    }
    let tagged = app
        .post("/v1/models?external_id=A17&labels=study:42&points=99")
        .body(crate::helpers::volume("sphere tagged"))
        .send();
    let tagged: Value = tagged.await.unwrap().json().await.unwrap();
    app.until(&tagged, &["succeeded"]).await;
    let gone = app.volume("to be erased").await;
    let gone = app.delete(&format!("/v1/volumes/{gone}?cascade=true"));
    gone.send().await.unwrap().error_for_status().unwrap();
    let seen = seen(&app).await;
    let data = app.stop().await;
    Folder { data, key, seen }
}

/// The content of every file of a folder, except what every start writes.
fn content(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut content = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(path) = open.pop() {
        for entry in std::fs::read_dir(&path).unwrap() {
            let path = entry.unwrap().path();
            let name = path
                .strip_prefix(folder)
                .unwrap()
                .to_str()
                .unwrap()
                .to_owned();
            match path.is_dir() {
                true => open.push(path),
                false if ["lock", "kept.json"].contains(&name.as_str()) => {}
                false => {
                    let hash = Sha256::digest(std::fs::read(&path).unwrap());
                    content.insert(name, hash.to_vec());
                }
            }
        }
    }
    content
}

/// Admits callers without credentials again: files that were moved by other tools may be a restored copy, from before
/// the first key.
async fn opened(data: &Path, database: Option<&PostgresSettings>) {
    let rows = open_database(data, database).await.unwrap();
    let event = AuditEvent::new(1, Activity::AccessOpened, Tenant::default(), "me".into());
    let now = SystemClock.now();
    assert!(rows.open_access(now, &event).await.unwrap());
    rows.close().await;
}

async fn moved(from: &Path, to: &Destination) -> Result<Migrated, MigrateError> {
    ventriform_http::install_cryptography();
    migrate(from, to, |_| {}).await
}

/// The settings of a service on the targets.
fn on(to: &Destination, url: &str) -> impl FnOnce(&mut Settings) {
    let database = to.database.as_ref().map(|_| url.parse().unwrap());
    let s3 = to.s3.clone();
    move |settings| {
        settings.database = database.unwrap_or_else(|| "sqlite".parse().unwrap());
        settings.blobs = match &s3 {
            Some(location) => location.to_string().parse().unwrap(),
            None => "folder".parse().unwrap(),
        };
        settings.aws = AwsVariables(s3.map(|location| location.variables).unwrap_or_default());
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_moved_folder_is_served_as_before_from_every_kind_of_target() {
    let folder = worked_on().await;
    let before = content(folder.data.path());
    let store = S3Server::start().await;
    let (both, beside) = (server().database().await, server().database().await);
    let new = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let below = |place: usize| new[place].path().join("data");
    let targets = [
        (both, Some(store.location(&random_id(""))), None),
        (beside, None, Some(below(0))),
        (
            String::new(),
            Some(store.location(&random_id(""))),
            Some(below(1)),
        ),
    ];
    for (url, s3, place) in targets {
        let to = Destination {
            database: (!url.is_empty()).then(|| reached(&url)),
            s3,
            folder: place.clone(),
        };
        let done = moved(folder.data.path(), &to).await.unwrap();
        assert_eq!((done.items, done.copied), (6, 6));
        assert!(
            before == content(folder.data.path()),
            "the source has changed"
        );
        if to.database.is_some() {
            assert!(moved(folder.data.path(), &to).await.unwrap().was_done);
        }
        let trail = open_rows(folder.data.path()).await.unwrap();
        let own = verify(&*trail).await.unwrap();
        trail.close().await;
        let data = match &place {
            Some(_) => {
                Arc::new(TempDir::new_in(place.as_ref().unwrap().parent().unwrap()).unwrap())
            }
            None => Arc::new(tempfile::tempdir().unwrap()),
        };
        // A test's service owns its folder: the new data folder takes its place.
        if let Some(place) = &place {
            std::fs::remove_dir(data.path()).unwrap();
            std::fs::rename(place, data.path()).unwrap();
        }
        let rows = open_database(data.path(), to.database.as_ref())
            .await
            .unwrap();
        let copied = verify(&*rows).await.unwrap();
        rows.close().await;
        assert_eq!(
            (copied.newest, copied.head, copied.broken),
            (own.newest, own.head, None)
        );
        let app = service(data, &folder.key, on(&to, &url)).await;
        for (path, answer) in seen(&app).await {
            assert!(folder.seen[&path] == answer, "{path}");
        }
        // New rows come after all that were moved, in order too.
        let made = app.model("sphere made afterwards").await;
        let models = app.json("/v1/models").await;
        assert_eq!(models["models"][0]["id"], made["id"]);
        app.stop().await;
        // It has its own life now.
        let again = moved(folder.data.path(), &to).await.unwrap_err();
        if to.database.is_some() && place.is_none() {
            assert!(matches!(again, MigrateError::Occupied { .. }), "{again}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_migration_that_breaks_off_goes_on_where_it_stopped() {
    let folder = worked_on().await;
    let store = S3Server::start().await;
    let proxy = FaultProxy::before(&store.url).await;
    let prefix = random_id("");
    let url = server().database().await;
    let to = Destination {
        database: Some(reached(&url)),
        s3: Some(S3Server::location_at(&proxy.url, &prefix)),
        folder: None,
    };
    ventriform_http::install_cryptography();
    let told = AtomicU64::new(0);
    let broken = migrate(folder.data.path(), &to, |progress| {
        if let Progress::Items { done: 2, .. } = progress {
            proxy.set(Network::Away);
        }
        told.fetch_add(1, Ordering::Relaxed);
    });
    let broken = broken.await.unwrap_err();
    assert!(matches!(broken, MigrateError::Store(_)), "{broken}");
    assert!(told.into_inner() >= 2);
    // No service starts on half a store, nor does a migration of another folder.
    let settings = StoreSettings {
        database: to.database.clone(),
        s3: Some(store.location(&prefix)),
        ..StoreSettings::default()
    };
    let own = tempfile::tempdir().unwrap();
    let refused = Store::open_with(own.path(), settings).await.err().unwrap();
    assert!(matches!(refused, OpenError::Unfinished { .. }), "{refused}");
    proxy.set(Network::Whole);
    let other = worked_on().await;
    let refused = moved(other.data.path(), &to).await.unwrap_err();
    assert!(
        matches!(refused, MigrateError::Occupied { .. }),
        "{refused}"
    );
    let done = moved(folder.data.path(), &to).await.unwrap();
    assert_eq!(done.items, 6);
    assert!((1..6).contains(&done.copied), "{done:?}");
    let data = Arc::new(tempfile::tempdir().unwrap());
    let app = service(data, &folder.key, on(&to, &url)).await;
    for (path, answer) in seen(&app).await {
        assert!(folder.seen[&path] == answer, "{path}");
    }
}

#[tokio::test]
async fn a_damaged_file_is_named_and_nothing_is_finished_before_it_is_set_aside() {
    let folder = worked_on().await;
    let shelf = folder.data.path().join(Resource::Volume.plural());
    let item = std::fs::read_dir(shelf).unwrap().next().unwrap().unwrap();
    let files = std::fs::read_dir(item.path()).unwrap();
    let file = files
        .map(|file| file.unwrap().path())
        .find(|file| !file.ends_with("record.json"))
        .unwrap();
    let whole = std::fs::read(&file).unwrap();
    let mut damaged = whole.clone();
    damaged[0] ^= 1;
    let store = S3Server::start().await;
    for s3 in [None, Some(store.location(&random_id("")))] {
        let url = server().database().await;
        let new = tempfile::tempdir().unwrap();
        let to = Destination {
            database: Some(reached(&url)),
            folder: s3.is_none().then(|| new.path().join("data")),
            s3,
        };
        std::fs::write(&file, &damaged).unwrap();
        let error = moved(folder.data.path(), &to).await.unwrap_err();
        let id = item.file_name().into_string().unwrap();
        assert!(matches!(error, MigrateError::Damaged(_)), "{error}");
        assert!(error.to_string().contains(&id), "{error}");
        let none = "DO $$ BEGIN ASSERT (SELECT count(*) FROM jobs) = 0; END $$";
        server().run(url.rsplit('/').next().unwrap(), none).await;
        std::fs::write(&file, &whole).unwrap();
        let done = moved(folder.data.path(), &to).await.unwrap();
        assert_eq!((done.items, done.copied), (6, 1));
    }
}

#[tokio::test]
async fn a_target_that_holds_something_and_a_folder_in_use_are_refused() {
    let folder = worked_on().await;
    let url = server().database().await;
    let new = tempfile::tempdir().unwrap();
    let to = Destination {
        database: Some(reached_at(url.parse().unwrap())),
        s3: None,
        folder: Some(new.path().to_owned()),
    };
    std::fs::write(new.path().join("mine"), "").unwrap();
    let refused = moved(folder.data.path(), &to).await.unwrap_err();
    assert!(refused.to_string().contains("mine"), "{refused}");
    std::fs::remove_file(new.path().join("mine")).unwrap();
    let name = url.rsplit('/').next().unwrap();
    let key = "INSERT INTO webhook_secrets (tenant, secret) VALUES ('a', 'b')";
    server().run(name, key).await;
    let refused = moved(folder.data.path(), &to).await.unwrap_err();
    assert!(refused.to_string().contains("webhook_secrets"), "{refused}");
    server().run(name, "DELETE FROM webhook_secrets").await;
    let app = TestApp::on(folder.data.clone(), fake_engine(), |_| {}).await;
    let refused = moved(folder.data.path(), &to).await.unwrap_err();
    assert!(
        matches!(refused, MigrateError::Open(OpenError::InUse(_))),
        "{refused}"
    );
    app.stop().await;
    for (database, s3, folder) in [
        (false, false, true),
        (true, false, false),
        (true, true, true),
    ] {
        let to = Destination {
            database: database.then(|| reached(&url)),
            s3: s3.then(|| S3Server::location_at("http://127.0.0.1:1", "x")),
            folder: folder.then(|| new.path().to_owned()),
        };
        let refused = moved(new.path(), &to).await.unwrap_err();
        assert!(matches!(refused, MigrateError::Destination(_)), "{refused}");
    }
}

/// As docs/operations.md says: the database first, then the files; what came in between is not restored, and
/// nothing that is restored lacks its files.
#[tokio::test(flavor = "multi_thread")]
async fn a_dump_and_a_later_copy_of_the_bucket_are_a_backup() {
    let store = S3Server::start().await;
    let (prefix, restored) = (random_id("own-"), random_id("restored-"));
    let (url, fresh) = (server().database().await, server().database().await);
    let at = |url: &str, prefix: &str| Destination {
        database: Some(reached(url)),
        s3: Some(store.location(prefix)),
        folder: None,
    };
    let app = TestApp::with(on(&at(&url, &prefix), &url)).await;
    app.model("sphere").await;
    let before = seen(&app).await;
    let dump = tempfile::tempdir().unwrap();
    let file = dump.path().join("ventriform.dump");
    let dumped = server()
        .program("pg_dump")
        .args(["--format=custom", "--no-unlogged-table-data", "--file"])
        .args([file.as_os_str(), url.as_ref()])
        .status();
    assert!(dumped.unwrap().success());
    let later = app.model("sphere between").await;
    store.copy_all(&prefix, &restored).await;
    app.stop().await;
    let filled = server()
        .program("pg_restore")
        .args(["--no-owner", "--dbname", &fresh])
        .arg(&file)
        .status();
    assert!(filled.unwrap().success());
    let to = at(&fresh, &restored);
    let files = MovedFiles::Bucket(to.s3.clone().unwrap());
    let scratch = tempfile::tempdir().unwrap();
    let noted = note_moved_files(scratch.path(), to.database.as_ref(), &files).await;
    assert_eq!(noted.unwrap(), 2, "a volume and a model");
    opened(scratch.path(), to.database.as_ref()).await;
    let app = TestApp::with(on(&to, &fresh)).await;
    assert!(seen(&app).await == before);
    let gone = app
        .get(&text(&later["links"]["self"]))
        .send()
        .await
        .unwrap();
    assert_eq!(gone.status(), 404);
    app.model("sphere afterwards").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bucket_that_was_moved_is_noted_if_it_has_all_files() {
    let store = S3Server::start().await;
    let url = server().database().await;
    for database in [None, Some(reached(&url))] {
        let (old, new) = (random_id("old-"), random_id("new-"));
        let at = |prefix: &str| Destination {
            database: database.clone(),
            s3: Some(store.location(prefix)),
            folder: None,
        };
        let note = async |data: &Path, prefix: &str| {
            let files = MovedFiles::Bucket(store.location(prefix));
            note_moved_files(data, database.as_ref(), &files).await
        };
        let app = TestApp::with(on(&at(&old), &url)).await;
        app.model("sphere").await;
        let before = seen(&app).await;
        let running = note(app.data.path(), &old).await.unwrap_err();
        let in_use = matches!(running, MigrateError::Open(OpenError::InUse(_)));
        assert!(in_use, "{running}");
        if database.is_some() {
            let other = tempfile::tempdir().unwrap();
            let running = note(other.path(), &old).await.unwrap_err();
            assert!(matches!(running, MigrateError::Running(_)), "{running}");
        }
        let data = app.stop().await;
        let lacking = note(data.path(), &new).await.unwrap_err();
        assert!(
            matches!(lacking, MigrateError::FilesMissing { .. }),
            "{lacking}"
        );
        store.copy_all(&old, &new).await;
        assert_eq!(note(data.path(), &new).await.unwrap(), 2);
        opened(data.path(), database.as_ref()).await;
        let app = TestApp::on(data, fake_engine(), on(&at(&new), &url)).await;
        assert!(seen(&app).await == before);
        let data = app.stop().await;
        let settings = StoreSettings {
            database: database.clone(),
            s3: Some(store.location(&old)),
            ..StoreSettings::default()
        };
        let refused = Store::open_with(data.path(), settings).await.err().unwrap();
        let said = advised(&refused.into());
        assert!(said.contains("--moved-files"), "{said}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_folder_of_files_that_was_moved_is_noted_if_it_is_of_no_other_database() {
    let url = server().database().await;
    let at = Destination {
        database: Some(reached(&url)),
        s3: None,
        folder: None,
    };
    let new = tempfile::tempdir().unwrap();
    let files = MovedFiles::Folder(new.path().to_owned());
    let note = || note_moved_files(Path::new("unused"), at.database.as_ref(), &files);
    let early = note().await.unwrap_err();
    assert!(matches!(early, MigrateError::NoPlace(_)), "{early}");
    let app = TestApp::with(on(&at, &url)).await;
    app.model("sphere").await;
    let before = seen(&app).await;
    let old = app.stop().await;
    let lacking = note().await.unwrap_err();
    assert!(lacking.to_string().contains("volumes/vol_"), "{lacking}");
    let from = format!("{}/.", old.path().display());
    let copied = std::process::Command::new("cp")
        .args(["-a", &from])
        .arg(new.path())
        .status();
    assert!(copied.unwrap().success());
    let marker = new.path().join("database");
    std::fs::write(&marker, "postgres://elsewhere/other\nfolder 1\n").unwrap();
    let other = note().await.unwrap_err();
    assert!(matches!(other, MigrateError::OtherStore { .. }), "{other}");
    std::fs::remove_file(marker).unwrap();
    std::fs::write(new.path().join("ventriform.db"), "").unwrap();
    let beside = note().await.unwrap_err();
    assert!(
        matches!(beside, MigrateError::Open(OpenError::InFile(_))),
        "{beside}"
    );
    let beside = note_moved_files(new.path(), None, &files)
        .await
        .unwrap_err();
    assert!(matches!(beside, MigrateError::Destination(_)), "{beside}");
    std::fs::remove_file(new.path().join("ventriform.db")).unwrap();
    for _ in 0..2 {
        assert_eq!(note().await.unwrap(), 2);
    }
    opened(new.path(), at.database.as_ref()).await;
    let app = TestApp::on(Arc::new(new), fake_engine(), on(&at, &url)).await;
    assert!(seen(&app).await == before);
    let settings = StoreSettings {
        database: at.database.clone(),
        ..StoreSettings::default()
    };
    let refused = Store::open_with(old.path(), settings).await.err().unwrap();
    let said = advised(&refused.into());
    assert!(said.contains("--moved-files"), "{said}");
}
