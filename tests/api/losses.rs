//! What a damaged, lost or older database takes with it: whatever page is lost, the service stays closed, nobody gets
//! what others had, holds hold, and what is lost is named, in the answer of the repair and by the check of the trail.

use crate::helpers::{TestApp, fake_engine, key, text};
use crate::postgres::{reached, server};
use serde_json::json;
use sqlx::{ConnectOptions, Connection, Row};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;
use ventriform_service::base::records::{Catalogue, ListRequest, Tenant};
use ventriform_service::callers::{
    AccessStore, Activity, ApiKey, AuditEvent, AuditFilter, BrokenLink, KeyRequest, Maker, Quota,
    Scope, verify,
};
use ventriform_service::config::{BlobPlace, Settings};
use ventriform_store::{
    Examination, NewerStore, Repair, SqlStore, Store, StoreSettings, apply, backup, examine,
    examine_on_server, missed, open_database, open_rows,
};

/// A page of SQLite here, bytes.
const PAGE_BYTES: usize = 4096;

/// Rows of the trail, so that its table has several pages.
const MANY_ROWS: i64 = 60;

fn in_folder(settings: &mut Settings) {
    settings.database = "sqlite".parse().unwrap();
    settings.blobs = BlobPlace::Folder;
}

/// Two tenants with a volume each, of which the first one's is on legal hold and has a model; a receipt of an erasure.
struct Ward {
    data: Arc<TempDir>,
    held: String,
    other: String,
}

impl Ward {
    async fn new() -> Self {
        let app = TestApp::with(in_folder).await;
        let (_, a) = key(app.data.path(), Scope::Admin, "ta", Quota::default()).await;
        let (_, b) = key(app.data.path(), Scope::Admin, "tb", Quota::default()).await;
        let (as_a, as_b) = (app.seen_with(&a), app.seen_with(&b));
        let model = as_a.model("sphere").await;
        let held = text(&model["volume"]);
        let hold = as_a
            .client
            .put(format!("{}/v1/volumes/{held}/hold", app.url));
        let hold = hold.json(&json!({"reason": "court"})).send().await.unwrap();
        assert!(hold.status().is_success(), "{hold:?}");
        let other = as_b.volume("other").await;
        let gone = as_a.volume("gone").await;
        let erased = as_a.delete(&format!("/v1/volumes/{gone}")).send().await;
        assert_eq!(erased.unwrap().status(), 204);
        let rows = open_rows(app.data.path()).await.unwrap();
        let reads: Vec<_> = (0..MANY_ROWS).map(read).collect();
        rows.append(&reads).await.unwrap();
        rows.close().await;
        Self {
            data: app.stop().await,
            held,
            other,
        }
    }
}

fn read(at: i64) -> AuditEvent {
    AuditEvent::new(at, Activity::Read, Tenant::default(), "x".into()).on(format!("vol_{at}"))
}

fn folder_of(data: &TempDir) -> NewerStore {
    NewerStore::Folder(data.path().to_owned())
}

fn copied(from: &Path) -> TempDir {
    let to = tempfile::tempdir().unwrap();
    copy_folder(from, to.path());
    to
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy_folder(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// Every table and index with its pages: the root, and what the root points to.
async fn pages(database: &Path) -> BTreeMap<String, Vec<usize>> {
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(database);
    let mut connection = options.connect().await.unwrap();
    let roots = sqlx::query("SELECT name, rootpage FROM sqlite_schema WHERE rootpage > 1")
        .fetch_all(&mut connection)
        .await
        .unwrap();
    connection.close().await.unwrap();
    let content = fs::read(database).unwrap();
    let of = |row: &sqlx::sqlite::SqliteRow| {
        let (name, root): (String, i64) = (row.get(0), row.get(1));
        let root = usize::try_from(root).unwrap();
        (name, [vec![root], children(&content, root)].concat())
    };
    roots.iter().map(of).collect()
}

/// The pages that an inner page of a tree points to.
fn children(content: &[u8], page: usize) -> Vec<usize> {
    let page = &content[(page - 1) * PAGE_BYTES..page * PAGE_BYTES];
    let number = |at: usize| u32::from_be_bytes(page[at..at + 4].try_into().unwrap()) as usize;
    if !matches!(page[0], 2 | 5) {
        return Vec::new();
    }
    let cells = usize::from(u16::from_be_bytes([page[3], page[4]]));
    let cell = |index: usize| {
        usize::from(u16::from_be_bytes([
            page[12 + 2 * index],
            page[13 + 2 * index],
        ]))
    };
    let left = (0..cells).map(|index| number(cell(index)));
    left.chain([number(8)]).collect()
}

fn lose(database: &Path, page: usize) {
    let mut content = fs::read(database).unwrap();
    content[(page - 1) * PAGE_BYTES..page * PAGE_BYTES].fill(0);
    fs::write(database, content).unwrap();
}

async fn counts(database: &Path) -> BTreeMap<String, i64> {
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(database);
    let mut connection = options.connect().await.unwrap();
    let names: Vec<String> = sqlx::query_scalar(
        "SELECT name FROM sqlite_schema WHERE type = 'table' AND name NOT LIKE 'sqlite%'
             AND name NOT IN ('_sqlx_migrations', 'probe', 'stored_bytes', 'stored_items')",
    )
    .fetch_all(&mut connection)
    .await
    .unwrap();
    let mut counts = BTreeMap::new();
    for name in names {
        let count = sqlx::AssertSqlSafe(format!("SELECT count(*) FROM {name}"));
        let count = sqlx::query_scalar(count).fetch_one(&mut connection).await;
        counts.insert(name, count.unwrap());
    }
    connection.close().await.unwrap();
    counts
}

async fn holders(database: &Path, id: &str) -> Vec<(String, bool)> {
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(database);
    let mut connection = options.connect().await.unwrap();
    let found = sqlx::query_as("SELECT tenant, held_at IS NOT NULL FROM holdings WHERE id = ?")
        .bind(id)
        .fetch_all(&mut connection)
        .await
        .unwrap();
    connection.close().await.unwrap();
    found
}

fn found(examination: &Examination, kind: &str) -> BTreeSet<String> {
    let found = examination.findings.iter().filter(|f| f.kind == kind);
    found.map(|finding| finding.subject.clone()).collect()
}

fn set_aside(folder: &Path, id: &str) -> bool {
    folder.join("quarantine/unowned").join(id).exists()
}

#[tokio::test]
async fn whatever_page_is_lost_the_service_stays_closed_and_nothing_is_lost_in_silence() {
    let ward = Ward::new().await;
    let whole = counts(&ward.data.path().join("ventriform.db")).await;
    for (name, pages) in pages(&ward.data.path().join("ventriform.db")).await {
        for page in pages {
            let case = format!("{name}, page {page}");
            let folder = copied(ward.data.path());
            let database = folder.path().join("ventriform.db");
            lose(&database, page);
            let repair = Repair::default();
            let repaired = examine(folder.path(), None, Some(&repair));
            let repaired = repaired
                .await
                .unwrap_or_else(|error| panic!("{case}: {error}"));
            let rows = open_rows(folder.path()).await.unwrap();
            assert!(rows.is_closed().await.unwrap(), "{case}: open to everybody");
            check_losses(&case, &rows, &repaired, &whole, &database).await;
            for (tenant, id) in [("ta", &ward.held), ("tb", &ward.other)] {
                match &holders(&database, id).await[..] {
                    [(holder, _)] => assert_eq!(holder, tenant, "{case}"),
                    [] => assert!(set_aside(folder.path(), id), "{case}: {id} is nobody's"),
                    several => panic!("{case}: {several:?}"),
                }
            }
            for (_, on_hold) in holders(&database, &ward.held).await {
                assert!(on_hold, "{case}: the hold is gone");
            }
            rows.close().await;
            let again = examine(folder.path(), None, None).await.unwrap();
            assert!(again.is_healthy(), "{case}: {again:?}");
        }
    }
}

/// Every table that has fewer rows than before is named, in the answer and in the trail; the trail is in order only if
/// all of its rows are there.
async fn check_losses(
    case: &str,
    rows: &SqlStore,
    repaired: &Examination,
    whole: &BTreeMap<String, i64>,
    database: &Path,
) {
    let named = found(repaired, "rows-lost");
    let now = counts(database).await;
    for (table, before) in whole {
        // Products take what they were made of with them, and so do volumes whose holder is not known.
        let of_items = [
            "sources",
            "scans",
            "holdings",
            "volumes",
            "products",
            "label_index",
        ];
        let set_aside = !found(repaired, "unowned-item").is_empty();
        let lost = now[table] < *before && !(set_aside && of_items.contains(&table.as_str()));
        let told = named.contains(table) || table == "store_marks" || table == "erased";
        assert!(
            !lost || told,
            "{case}: {table} {before} -> {}: {repaired:?}",
            now[table]
        );
    }
    let page = ListRequest {
        before: None,
        limit: 1000,
    };
    let trail = rows.audit(&AuditFilter::default(), page).await.unwrap();
    for table in &named {
        let told = trail.items.iter().any(|row| {
            let object = row.event.object.as_deref().unwrap_or_default();
            row.event.activity == Activity::RowsLost && object.split(':').next() == Some(table)
        });
        assert!(
            told,
            "{case}: the trail does not say that rows of {table} are lost"
        );
    }
    let report = verify(rows).await.unwrap();
    let is_whole = !named.contains("audit");
    assert_eq!(report.broken.is_none(), is_whole, "{case}: {report:?}");
}

#[tokio::test]
async fn a_lost_database_of_a_closed_service_makes_no_open_one() {
    let ward = Ward::new().await;
    for note in [true, false] {
        let folder = copied(ward.data.path());
        fs::remove_file(folder.path().join("ventriform.db")).unwrap();
        if !note {
            fs::remove_file(folder.path().join("kept.json")).unwrap();
        }
        let repair = Repair {
            heir: Some("ta".parse().unwrap()),
        };
        let repaired = examine(folder.path(), None, Some(&repair)).await.unwrap();
        assert_eq!(found(&repaired, "access-in-doubt").len(), 1, "{repaired:?}");
        let rows = open_rows(folder.path()).await.unwrap();
        assert!(rows.is_closed().await.unwrap());
        // The note knows the end of the trail that was lost.
        let broken = verify(&*rows).await.unwrap().broken;
        assert_eq!(broken.is_some(), note, "{broken:?}");
        let database = folder.path().join("ventriform.db");
        assert_eq!(
            holders(&database, &ward.held).await,
            [("ta".to_owned(), true)]
        );
        rows.close().await;
    }
}

#[tokio::test]
async fn an_older_copy_from_before_the_first_key_is_closed_until_it_is_opened_on_purpose() {
    let app = TestApp::with(in_folder).await;
    app.volume("one").await;
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("backup");
    backup(app.data.path(), &target).await.unwrap();
    let data = app.stop().await;
    // As long as nothing says otherwise, the service is open, also after its folder was moved.
    let app = TestApp::on(data, fake_engine(), in_folder).await;
    assert_eq!(app.get("/v1/volumes").send().await.unwrap().status(), 200);
    let data = app.stop().await;
    let moved = folder.path().join("moved");
    fs::rename(data.path(), &moved).unwrap();
    let is_closed = async |folder: &Path| {
        let rows = open_rows(folder).await.unwrap();
        let closed = rows.is_closed().await.unwrap();
        rows.close().await;
        closed
    };
    assert!(!is_closed(&moved).await);
    let before = folder.path().join("before");
    copy_folder(&moved, &before);
    key(&moved, Scope::Admin, "ta", Quota::default()).await;
    // The database alone put back, the whole folder as a copy, and the backup.
    fs::copy(before.join("ventriform.db"), moved.join("ventriform.db")).unwrap();
    let copies: [PathBuf; 3] = [moved, before, target];
    for copy in &copies {
        assert!(is_closed(copy).await, "{}", copy.display());
    }
    let rows = open_rows(&copies[2]).await.unwrap();
    let event = AuditEvent::new(1, Activity::AccessOpened, Tenant::default(), "me".into());
    assert!(rows.open_access(i64::MAX, &event).await.unwrap());
    assert!(!rows.is_closed().await.unwrap());
    let page = ListRequest {
        before: None,
        limit: 1,
    };
    let trail = rows.audit(&AuditFilter::default(), page).await.unwrap();
    assert_eq!(trail.items[0].event.activity, Activity::AccessOpened);
    rows.close().await;
    // It stays open, and the next key closes it.
    assert!(!is_closed(&copies[2]).await);
    key(&copies[2], Scope::Read, "ta", Quota::default()).await;
    assert!(is_closed(&copies[2]).await);
}

#[tokio::test]
async fn the_end_of_the_last_key_opens_nothing() {
    let app = TestApp::with(in_folder).await;
    let (id, _) = key(app.data.path(), Scope::Admin, "ta", Quota::default()).await;
    let rows = open_rows(app.data.path()).await.unwrap();
    let event = AuditEvent::new(1, Activity::KeyRevoked, Tenant::default(), "me".into());
    assert!(
        !rows.open_access(2, &event).await.unwrap(),
        "a key is valid"
    );
    rows.revoke_key(&id, 1, &event).await.unwrap();
    assert!(rows.is_closed().await.unwrap());
    rows.close().await;
    let app = TestApp::on(app.stop().await, fake_engine(), in_folder).await;
    assert_eq!(app.get("/v1/volumes").send().await.unwrap().status(), 401);
}

#[tokio::test]
async fn a_restored_copy_is_told_by_the_trail_and_catches_up_with_what_it_missed() {
    let app = TestApp::with(in_folder).await;
    let (_, a) = key(app.data.path(), Scope::Admin, "ta", Quota::default()).await;
    let (leaked, _) = key(app.data.path(), Scope::Submit, "ta", Quota::default()).await;
    let as_a = app.seen_with(&a);
    let (erased, held) = (as_a.volume("erased").await, as_a.volume("held").await);
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("backup");
    backup(app.data.path(), &target).await.unwrap();
    for path in [
        format!("/v1/keys/{leaked}"),
        format!("/v1/volumes/{erased}"),
    ] {
        let done = as_a.delete(&path).send().await.unwrap().status();
        assert_eq!(done, 204, "{path}");
    }
    let hold = as_a
        .client
        .put(format!("{}/v1/volumes/{held}/hold", app.url));
    hold.json(&json!({"reason": "court"})).send().await.unwrap();
    let newer = app.stop().await;

    // The database of the backup in the place of the newer one, beside the note; then the backup itself.
    let in_place = copied(newer.path());
    copy_folder(&target, in_place.path());
    for end in ["-wal", "-shm"] {
        let _ = fs::remove_file(in_place.path().join(format!("ventriform.db{end}")));
    }
    for (restored, knows) in [(in_place.path(), true), (&target, false)] {
        let mut store = Store::open(restored).await.unwrap();
        let report = verify(&*store.rows).await.unwrap();
        assert_eq!(report.broken.is_some(), knows, "{report:?}");
        if knows {
            // What is written meanwhile follows the rows that are missing.
            store.rows.append(&[read(1)]).await.unwrap();
            assert!(matches!(
                verify(&*store.rows).await.unwrap().broken,
                Some(BrokenLink::Missing { .. })
            ));
        }
        let what = missed(&store.rows, &folder_of(&newer)).await.unwrap();
        assert_eq!(what.acts.len(), 3, "{what:?}");
        assert_eq!(apply(&store, &what).await.unwrap(), Vec::<String>::new());
        let revoked = store.rows.key(&leaked).await.unwrap().unwrap();
        assert!(revoked.revoked_at.is_some());
        assert!(!restored.join("volumes").join(&erased).exists());
        let database = restored.join("ventriform.db");
        assert_eq!(holders(&database, &erased).await, []);
        assert_eq!(holders(&database, &held).await, [("ta".to_owned(), true)]);
        let report = verify(&*store.rows).await.unwrap();
        assert_eq!(report.broken, None, "{report:?}");
        let again = missed(&store.rows, &folder_of(&newer)).await.unwrap();
        assert!(again.acts.is_empty() && again.rows.is_empty(), "{again:?}");
        store.close().await;
    }
}

/// The records on a server: the database of the backup beside the newer one, whose URL tells what was missed.
#[tokio::test]
async fn a_restored_copy_on_a_server_catches_up_by_the_newer_database() {
    let url = server().database().await;
    let address = url.clone();
    let data = Arc::new(tempfile::tempdir().unwrap());
    let on_server = |address: String| {
        move |settings: &mut Settings| {
            settings.database = address.parse().unwrap();
            settings.blobs = BlobPlace::Folder;
        }
    };
    let app = TestApp::on(data, fake_engine(), on_server(address.clone())).await;
    let rows = open_database(app.data.path(), Some(&reached(&url)))
        .await
        .unwrap();
    let make = |name: &str| {
        let request = KeyRequest {
            name: name.into(),
            tenant: "ta".parse().unwrap(),
            scope: Scope::Admin,
            quota: Quota::default(),
            maker: Maker::Operator,
            owner: None,
            expires_at: None,
        };
        ApiKey::make(request, 1).unwrap()
    };
    let event = AuditEvent::new(1, Activity::KeyCreated, Tenant::default(), "me".into());
    let ((own, secret), (leaked, _)) = (make("own"), make("leaked"));
    for key in [&own, &leaked] {
        rows.add_key(key, &event).await.unwrap();
    }
    rows.close().await;
    let as_a = app.seen_with(&secret);
    let (erased, held) = (as_a.volume("erased").await, as_a.volume("held").await);
    let named = as_a.volume("named").await;
    let put = |path: String, body: serde_json::Value| {
        let request = as_a.client.put(format!("{}{path}", app.url)).json(&body);
        async move {
            let done = request.send().await.unwrap();
            assert!(done.status().is_success(), "{path}: {done:?}");
        }
    };
    let identity = format!("/v1/volumes/{named}/identity");
    put(
        identity.clone(),
        json!({"patient_id": "7", "study_uid": "1.2.3"}),
    )
    .await;
    let data = app.stop().await;
    // The copy, and what was done since.
    let (backup, copy) = (copied(data.path()), database_copied(&url).await);
    let app = TestApp::on(data, fake_engine(), on_server(address)).await;
    let as_a = app.seen_with(&secret);
    for path in [
        format!("/v1/keys/{}", leaked.id),
        format!("/v1/volumes/{erased}"),
        identity,
    ] {
        let done = as_a.delete(&path).send().await.unwrap().status();
        assert!(done.is_success(), "{path}: {done}");
    }
    let hold = as_a
        .client
        .put(format!("{}/v1/volumes/{held}/hold", app.url));
    let hold = hold.json(&json!({"reason": "court"})).send().await.unwrap();
    assert!(hold.status().is_success());
    app.stop().await;

    let newer = NewerStore::Server(reached(&url));
    let settings = StoreSettings {
        database: Some(reached(&copy)),
        ..StoreSettings::default()
    };
    let mut store = Store::open_with(backup.path(), settings).await.unwrap();
    let what = missed(&store.rows, &newer).await.unwrap();
    assert_eq!((what.acts.len(), what.unread.len()), (4, 0), "{what:?}");
    assert!(what.rows.len() >= 4, "{what:?}");
    assert_eq!(apply(&store, &what).await.unwrap(), Vec::<String>::new());
    let revoked = store.rows.key(&leaked.id).await.unwrap().unwrap();
    assert!(revoked.revoked_at.is_some());
    assert!(!backup.path().join("volumes").join(&erased).exists());
    let ta = "ta".parse().unwrap();
    let volume = store.rows.volume(&ta, &held).await.unwrap().unwrap();
    assert!(volume.ownership.legal_hold.is_some());
    assert!(store.rows.volume(&ta, &erased).await.unwrap().is_none());
    let report = verify(&*store.rows).await.unwrap();
    assert_eq!(report.broken, None, "{report:?}");
    let again = missed(&store.rows, &newer).await.unwrap();
    assert!(again.acts.is_empty() && again.rows.is_empty(), "{again:?}");
    store.close().await;
    // Another store, and none.
    let nothing = NewerStore::Server(reached(&server().database().await));
    let folder = tempfile::tempdir().unwrap();
    let mut store = Store::open(folder.path()).await.unwrap();
    store.rows.append(&[read(1)]).await.unwrap();
    let other = missed(&store.rows, &newer).await.unwrap_err();
    assert!(other.to_string().contains("not a newer copy"), "{other}");
    let unread = missed(&store.rows, &nothing).await.unwrap().unread;
    assert!(unread.len() >= 5, "{unread:?}");
    store.close().await;
}

/// Copies a database that nobody uses. Returns the URL of the copy.
async fn database_copied(url: &str) -> String {
    let name = |url: &str| url.rsplit('/').next().unwrap().to_owned();
    let made = server().database().await;
    let (from, to) = (name(url), name(&made));
    for statement in [
        format!("DROP DATABASE {to}"),
        format!("CREATE DATABASE {to} TEMPLATE {from}"),
    ] {
        server().run("postgres", &statement).await;
    }
    made
}

#[tokio::test]
async fn rows_that_are_missing_on_a_server_are_found_and_mended_alike() {
    let data = Arc::new(tempfile::tempdir().unwrap());
    let url = server().database().await;
    let settings = reached(&url);
    let address = url.clone();
    let app = TestApp::on(data, fake_engine(), move |settings| {
        settings.database = address.parse().unwrap();
        settings.blobs = BlobPlace::Folder;
    })
    .await;
    let (made, gone) = (app.volume("made").await, app.volume("gone").await);
    let erased = app.delete(&format!("/v1/volumes/{gone}")).send().await;
    assert_eq!(erased.unwrap().status(), 204);
    let rows = open_database(app.data.path(), Some(&settings))
        .await
        .unwrap();
    let event = AuditEvent::new(1, Activity::KeyCreated, Tenant::default(), "me".into());
    let request = KeyRequest {
        name: "k".into(),
        tenant: Tenant::default(),
        scope: Scope::Read,
        quota: Quota::default(),
        maker: Maker::Operator,
        owner: None,
        expires_at: None,
    };
    let (made_key, _) = ApiKey::make(request, 1).unwrap();
    rows.add_key(&made_key, &event).await.unwrap();
    let data = app.stop().await;
    let name = url.rsplit('/').next().unwrap();
    let name = name.split('?').next().unwrap();
    let lose = "SET session_replication_role = replica; DELETE FROM api_keys; DELETE FROM holdings;
                DELETE FROM sources; DELETE FROM scans; DELETE FROM audit;";
    server().run(name, lose).await;
    assert!(rows.is_closed().await.unwrap());
    let sick = examine_on_server(data.path(), &settings, None, None)
        .await
        .unwrap();
    assert!(!sick.is_healthy(), "{sick:?}");
    assert_eq!(found(&sick, "unowned-item"), BTreeSet::from([made.clone()]));
    assert_eq!(found(&sick, "keys-missing").len(), 1);
    assert_eq!(found(&sick, "trail-broken").len(), 1);
    let repair = Repair::default();
    let aside = examine_on_server(data.path(), &settings, None, Some(&repair))
        .await
        .unwrap();
    assert!(aside.is_healthy(), "{aside:?}");
    assert!(set_aside(data.path(), &made));
    let repair = Repair {
        heir: Some("ta".parse().unwrap()),
    };
    let back = examine_on_server(data.path(), &settings, None, Some(&repair))
        .await
        .unwrap();
    assert_eq!(found(&back, "quarantined-item").len(), 1, "{back:?}");
    let ta = "ta".parse().unwrap();
    let volume = rows.volume(&ta, &made).await.unwrap().unwrap();
    assert!(volume.ownership.legal_hold.is_some());
    let report = verify(&*rows).await.unwrap();
    assert!(
        report.broken.is_some() && !report.unconfirmed.is_empty(),
        "{report:?}"
    );
    rows.close().await;
}
