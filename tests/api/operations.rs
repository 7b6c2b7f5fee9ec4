//! Health checks, the start page, the documentation, and unknown paths.

use crate::helpers::{TestApp, problem, text};
use reqwest::StatusCode;
use reqwest::header::ACCEPT;

#[tokio::test]
async fn health_readiness_and_metrics_are_served() {
    let app = TestApp::start().await;
    assert_eq!(app.json("/healthz").await["status"], "ok");
    let ready = app.json("/readyz").await;
    assert_eq!(ready["status"], "ok");
    let names = ["database", "audit", "files", "disk", "workers", "clock"];
    for (check, name) in ready["checks"].as_array().unwrap().iter().zip(names) {
        assert_eq!(
            (&check["name"], &check["status"]),
            (&name.into(), &"ok".into())
        );
        assert_eq!(check["required"], !["workers", "clock"].contains(&name));
    }
    assert_eq!(ready["checks"].as_array().unwrap().len(), names.len());
    app.finished("sphere").await;
    let metrics = app.metrics().await;
    assert!(
        metrics.contains("ventriform_jobs{state=\"queued\"} 0"),
        "{metrics}"
    );
}

#[tokio::test]
async fn the_start_page_is_html_for_browsers_and_text_for_curl() {
    let app = TestApp::start().await;
    let page = app
        .get("/")
        .header(ACCEPT, "text/html,application/xhtml+xml,*/*;q=0.8");
    let page = page.send().await.unwrap().text().await.unwrap();
    assert!(page.starts_with("<!doctype html>"));
    for elsewhere in ["http://", "https://"] {
        let links = page.replace("http://www.w3.org/2000/svg", "");
        assert!(
            !links.contains(elsewhere),
            "the page needs nothing from elsewhere"
        );
    }
    let text = app
        .get("/")
        .header(ACCEPT, "*/*")
        .send()
        .await
        .unwrap()
        .text()
        .await
        .unwrap();
    assert_eq!(
        text.lines()
            .filter(|line| line.contains("curl -fsS"))
            .count(),
        8
    );
    assert!(text.contains(&app.url));
}

#[tokio::test]
async fn the_documentation_needs_no_network() {
    let app = TestApp::start().await;
    let page = app.get("/docs").send().await.unwrap();
    assert_eq!(page.status(), StatusCode::OK);
    let page = page.text().await.unwrap();
    assert!(!page.contains("http://") && !page.contains("https://"));
    let mut scripts = page.split('"').filter(|word| word.ends_with(".js"));
    // Relative to the page, under a hash of all its files.
    let script = scripts.next().unwrap().strip_prefix('.').unwrap();
    let parts: Vec<&str> = script.split('/').collect();
    let [_, "assets", version, name] = parts[..] else {
        panic!("{script}");
    };
    assert!(version.len() == 16 && version.bytes().all(|digit| digit.is_ascii_hexdigit()));
    let plain = app.get(script).send().await.unwrap();
    assert_eq!(plain.headers()["content-type"], "text/javascript");
    let kept = plain.headers()["cache-control"].to_str().unwrap();
    assert!(kept.contains("immutable"));
    let etag = plain.headers()["etag"].clone();
    let plain = plain.bytes().await.unwrap();
    let known = app.get(script).header("if-none-match", &etag);
    let known = known.send().await.unwrap();
    assert_eq!(known.status(), StatusCode::NOT_MODIFIED);
    for (accepted, coding) in [("gzip, br", Some("gzip")), ("br", None), ("gzip;q=0", None)] {
        let packed = app.get(script).header("accept-encoding", accepted);
        let packed = packed.send().await.unwrap();
        let stated = packed.headers().get("content-encoding");
        assert_eq!(stated.map(|value| value.to_str().unwrap()), coding);
        assert_eq!(packed.headers()["vary"], "accept-encoding");
        assert_eq!(packed.headers()["etag"] != etag, coding.is_some());
        let length = packed.bytes().await.unwrap().len();
        assert_eq!(length < plain.len(), coding.is_some(), "{accepted}");
    }
    // A page of another version gets none of this version's files.
    let of_another = format!("/assets/{}/{name}", "0".repeat(16));
    let of_page = format!("/assets/{version}/index.html");
    let outside = format!("/assets/{version}/..%2findex.html");
    let nothing = format!("/assets/{version}/nothing.js");
    for path in [
        &*of_another,
        &of_page,
        &outside,
        &nothing,
        "/assets/nothing.js",
    ] {
        problem(app.get(path).send().await.unwrap(), 404, "no-such-path").await;
    }
    let icon = app.get("/favicon.ico").send().await.unwrap();
    assert_eq!(icon.headers()["content-type"], "image/svg+xml");
}

#[tokio::test]
async fn unknown_paths_and_methods_are_answered_with_problems() {
    let app = TestApp::start().await;
    problem(
        app.get("/v2/models").send().await.unwrap(),
        404,
        "no-such-path",
    )
    .await;
    let wrong = app.delete("/v1/models").send().await.unwrap();
    let allow = wrong.headers()["allow"].to_str().unwrap().to_owned();
    assert!(allow.contains("GET") && allow.contains("POST"), "{allow}");
    problem(wrong, 405, "method-not-allowed").await;
}

#[tokio::test]
async fn request_ids_and_trace_headers_are_returned() {
    let app = TestApp::start().await;
    let parent = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";
    let answer = app
        .get("/healthz")
        .header("x-request-id", "mine")
        .header("traceparent", parent);
    let answer = answer.send().await.unwrap();
    assert_eq!(answer.headers()["x-request-id"], "mine");
    let trace = answer.headers()["traceparent"].to_str().unwrap();
    assert!(trace.starts_with(&parent[..36]) && trace != parent);
    let odd = app
        .get("/healthz")
        .header("traceparent", "00-é-")
        .send()
        .await
        .unwrap();
    assert!(!odd.headers().contains_key("traceparent"));
    assert!(!text(&odd.headers()["x-request-id"].to_str().unwrap().into()).is_empty());
}

#[tokio::test]
async fn the_document_has_validators_and_a_compressed_form() {
    let app = TestApp::start().await;
    let get = |encoding: &str| app.get("/openapi.json").header("accept-encoding", encoding);
    let plain = get("identity, gzip;q=0").send().await.unwrap();
    assert!(!plain.headers().contains_key("content-encoding"));
    let etag = plain.headers()["etag"].clone();
    let plain = plain.bytes().await.unwrap();
    let again = get("").header("if-none-match", &etag).send().await.unwrap();
    assert_eq!(again.status(), StatusCode::NOT_MODIFIED);
    assert!(again.bytes().await.unwrap().is_empty());
    let packed = get("br, gzip;q=0.5").send().await.unwrap();
    assert_eq!(packed.headers()["content-encoding"], "gzip");
    assert_ne!(packed.headers()["etag"], etag);
    let packed = packed.bytes().await.unwrap();
    let mut unpacked = Vec::new();
    std::io::copy(
        &mut flate2::read::GzDecoder::new(&packed[..]),
        &mut unpacked,
    )
    .unwrap();
    assert_eq!(unpacked, plain);
}

#[tokio::test]
async fn head_and_expect_are_answered_as_clients_expect() {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    let app = TestApp::start().await;
    let id = app.volume("sphere").await;
    for path in ["/healthz".to_owned(), format!("/v1/volumes/{id}")] {
        let head = app.client.head(format!("{}{path}", app.url));
        let head = head.send().await.unwrap();
        let full = app.get(&path).send().await.unwrap();
        assert_eq!(head.status(), full.status(), "{path}");
        let length = &head.headers()["content-length"];
        assert_eq!(length, &full.headers()["content-length"], "{path}");
        assert!(head.bytes().await.unwrap().is_empty());
    }
    let address = app.url.strip_prefix("http://").unwrap();
    let mut stream = tokio::net::TcpStream::connect(address).await.unwrap();
    let head = "POST /v1/volumes HTTP/1.1\r\nhost: x\r\ncontent-length: 12\r\n\
        connection: close\r\nexpect: 100-continue\r\n\r\n";
    stream.write_all(head.as_bytes()).await.unwrap();
    let mut said = vec![0; 25];
    stream.read_exact(&mut said).await.unwrap();
    assert_eq!(said, b"HTTP/1.1 100 Continue\r\n\r\n");
    stream.write_all(b"VOLUME other").await.unwrap();
    let mut rest = String::new();
    stream.read_to_string(&mut rest).await.unwrap();
    assert!(rest.starts_with("HTTP/1.1 201"), "{rest}");
}

#[tokio::test]
async fn log_files_have_no_colours() {
    for format in ["text", "json"] {
        let data = tempfile::tempdir().unwrap();
        let path = data.path().join("log");
        let log = std::fs::File::create(&path).unwrap();
        let mut process = std::process::Command::new(env!("CARGO_BIN_EXE_ventriform"))
            .args(["serve", "--listen", "127.0.0.1:0", "--log-format", format])
            .arg("--data-dir")
            .arg(data.path().join("data"))
            .env_remove("NO_COLOR")
            .stdout(std::process::Stdio::null())
            .stderr(log)
            .spawn()
            .unwrap();
        let mut text = String::new();
        for _ in 0..1000 {
            text = std::fs::read_to_string(&path).unwrap();
            if text.contains("listening") {
                break;
            }
            tokio::time::sleep(std::time::Duration::from_millis(20)).await;
        }
        process.kill().unwrap();
        process.wait().unwrap();
        assert!(text.contains("listening"), "{text}");
        assert!(!text.contains('\u{1b}'), "{text}");
    }
}
