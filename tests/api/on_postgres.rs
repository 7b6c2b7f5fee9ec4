//! The service on PostgreSQL. `VENTRIFORM_TEST_DATABASE=postgres cargo test --test api` runs all tests of
//! the service on it; these few always do.

use crate::helpers::{TestApp, fake_engine, problem, text, volume};
use crate::postgres::{Server, database_of, server};
use futures::StreamExt;
use serde_json::json;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use ventriform_service::callers::AccessStore;
use ventriform_store::open_database;

#[tokio::test]
async fn what_was_acknowledged_is_there_after_a_restart() {
    let data = Arc::new(tempfile::tempdir().unwrap());
    let database = database_of(data.path()).await;
    let on = |data| {
        let database = database.clone();
        TestApp::on(data, fake_engine(), move |settings| {
            settings.database = database;
        })
    };
    let app = on(data).await;
    let made = app.finished("sphere").await;
    let model = app.json(&text(&made["links"]["model"])).await;
    let waiting = app.file("slow").await;
    let followed = format!("/v1/jobs/{}/events", text(&made["id"]));
    let events = app
        .get(&followed)
        .send()
        .await
        .unwrap()
        .text()
        .await
        .unwrap();
    assert!(events.contains("succeeded"), "{events}");
    let data = app.stop().await;
    assert!(!data.path().join("ventriform.db").exists());
    let app = on(data).await;
    let again = app.json(&text(&made["links"]["model"])).await;
    assert_eq!(again["id"], model["id"]);
    app.get(&text(&model["links"]["mesh"]))
        .send()
        .await
        .unwrap()
        .error_for_status()
        .unwrap();
    // Handed back by the first run, and cancelled in the second.
    let path = text(&waiting["links"]["self"]);
    app.delete(&path)
        .send()
        .await
        .unwrap()
        .error_for_status()
        .unwrap();
    app.until(&waiting, &["cancelled"]).await;
    let volume = text(&model["volume"]);
    let erased = app.delete(&format!("/v1/volumes/{volume}?cascade=true"));
    assert!(erased.send().await.unwrap().status().is_success());
    let gone = app
        .get(&text(&made["links"]["model"]))
        .send()
        .await
        .unwrap();
    problem(gone, 410, "gone").await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_database_that_is_away_is_answered_with_503_and_named() {
    let own = Arc::new(tokio::task::spawn_blocking(Server::new).await.unwrap());
    let database = own.database().await;
    let app = TestApp::with(|settings| {
        settings.database = database.parse().unwrap();
        settings.write_wait = "500ms".parse().unwrap();
    })
    .await;
    let model = app.model("sphere").await;
    let running = app.file("stubborn").await;
    app.until(&running, &["running"]).await;
    let stopped = own.clone();
    tokio::task::spawn_blocking(move || stopped.end("crash"))
        .await
        .unwrap();
    let upload = app.post("/v1/volumes").body(volume("other"));
    for request in [
        app.get("/v1/volumes"),
        app.get(&text(&model["links"]["self"])),
        upload,
    ] {
        let answer = request.send().await.unwrap();
        assert!(answer.headers().contains_key("retry-after"));
        problem(answer, 503, "database-away").await;
    }
    let ready = app.get("/readyz").send().await.unwrap();
    let said = problem(ready, 503, "not-ready").await;
    assert!(text(&said["detail"]).contains("PostgreSQL"), "{said}");
    let failing = |name: &str| {
        let checks = said["checks"].as_array().unwrap();
        let check = checks.iter().find(|check| check["name"] == name).unwrap();
        check["status"] == "failing"
    };
    assert!(
        failing("database") && !failing("files") && !failing("disk"),
        "{said}"
    );
    assert!(!said.to_string().contains("127.0.0.1"), "{said}");
    assert_eq!(app.get("/healthz").send().await.unwrap().status(), 200);
    let started = own.clone();
    tokio::task::spawn_blocking(move || started.start())
        .await
        .unwrap();
    let deadline = Instant::now() + Duration::from_secs(10);
    while app.get("/readyz").send().await.unwrap().status() != 200 {
        assert!(Instant::now() < deadline, "it does not become ready again");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    app.json(&text(&model["links"]["self"])).await;
    // What was computed meanwhile is written down now.
    app.until(&running, &["succeeded"]).await;
}

/// Relays to a server. All connections are cut after this many answers; those made later are whole.
struct Cut {
    answers_left: AtomicUsize,
    upstream: u16,
}

impl Cut {
    /// Starts it; its port.
    async fn start(self: Arc<Self>) -> u16 {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let port = listener.local_addr().unwrap().port();
        tokio::spawn(async move {
            while let Ok((client, _)) = listener.accept().await {
                tokio::spawn(self.clone().relay(client));
            }
        });
        port
    }

    async fn relay(self: Arc<Self>, client: TcpStream) {
        let server = TcpStream::connect(("127.0.0.1", self.upstream)).await;
        let (mut from_client, mut to_client) = client.into_split();
        let (mut from_server, mut to_server) = server.unwrap().into_split();
        let asked = tokio::spawn(async move {
            let _ = tokio::io::copy(&mut from_client, &mut to_server).await;
        });
        let whole = self.answers_left.load(Ordering::SeqCst) == 0;
        let mut answer = vec![0; 1 << 16];
        while let Ok(length @ 1..) = from_server.read(&mut answer).await {
            let count = |left: usize| left.checked_sub(1);
            let left = self
                .answers_left
                .fetch_update(Ordering::SeqCst, Ordering::SeqCst, count);
            if !whole && left.is_err() || left == Ok(1) {
                break;
            }
            if to_client.write_all(&answer[..length]).await.is_err() {
                break;
            }
        }
        asked.abort();
    }
}

/// Opens a new database through a relay that cuts its connections after this many answers; how many of these are left.
async fn start_cut_after(answers: usize) -> usize {
    let mut url = reqwest::Url::parse(&server().database().await).unwrap();
    let relay = Arc::new(Cut {
        answers_left: AtomicUsize::new(answers),
        upstream: url.port().unwrap(),
    });
    url.set_port(Some(relay.clone().start().await)).unwrap();
    let data = tempfile::tempdir().unwrap();
    let settings = crate::postgres::reached(url.as_str());
    let opened = open_database(data.path(), Some(&settings)).await;
    if let Err(error) = opened {
        panic!("cut after {answers} answers: {error}");
    }
    relay.answers_left.load(Ordering::SeqCst)
}

#[tokio::test]
async fn a_server_that_goes_away_in_the_middle_of_a_start_is_waited_for() {
    const MANY: usize = 1 << 20;
    const STARTS_AT_ONCE: usize = 4;
    let answers = MANY - start_cut_after(MANY).await;
    assert!(answers > 12, "{answers}");
    // A few at a time: a start that waits for all the others' tables would outlast its patience.
    let starts = futures::stream::iter((1..=answers).map(start_cut_after));
    let left: Vec<usize> = starts.buffered(STARTS_AT_ONCE).collect().await;
    // How many answers come in one piece differs a little.
    assert!(
        left[..answers - 3].iter().all(|left| *left == 0),
        "{left:?}"
    );
}

#[tokio::test]
async fn commands_beside_the_service_use_the_same_database() {
    let data = tempfile::tempdir().unwrap();
    let url = server().database().await;
    let made = Command::new(env!("CARGO_BIN_EXE_ventriform"))
        .args([
            "keys",
            "create",
            "--name",
            "ward",
            "--scope",
            "read",
            "--data-dir",
        ])
        .arg(data.path())
        .env("VENTRIFORM_DATABASE", &url)
        .output()
        .unwrap();
    assert!(made.status.success(), "{made:?}");
    let rows = open_database(data.path(), Some(&crate::postgres::reached(&url))).await;
    assert!(rows.unwrap().is_closed().await.unwrap());
    assert!(!data.path().join("ventriform.db").exists());
    let bad = Command::new(env!("CARGO_BIN_EXE_ventriform"))
        .args(["serve", "--print-config"])
        .env("VENTRIFORM_DATABASE", "postgres://me:s3cret@host:port/name")
        .output()
        .unwrap();
    let said = String::from_utf8(bad.stderr).unwrap();
    assert!(
        !bad.status.success() && said.contains("postgres://user@host"),
        "{said}"
    );
    assert!(!said.contains("s3cret"), "{said}");
    let order = json!({"database": "postgres://me:s3cret@host:5432/name"});
    let shown = Command::new(env!("CARGO_BIN_EXE_ventriform"))
        .args(["serve", "--print-config"])
        .env("VENTRIFORM_DATABASE", text(&order["database"]))
        .output()
        .unwrap();
    let said = String::from_utf8(shown.stdout).unwrap();
    assert!(
        said.contains("database = \"postgres://me@host:5432/name\""),
        "{said}"
    );
}
