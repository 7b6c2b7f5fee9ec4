//! The service behind a proxy, and what clients and proxies send in many ways. scripts/check/proxy.sh tries the same
//! with nginx.

use crate::helpers::{Service, TestApp, closed, key, problem, text, volume};
use crate::tls::{Authority, file};
use reqwest::header::{AUTHORIZATION, HOST, ORIGIN};
use reqwest::{Client, Method, StatusCode};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::time::{Duration, Instant, SystemTime};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use ventriform_http::document_json;
use ventriform_service::callers::{Quota, Scope};
use ventriform_service::config::Settings;

/// More than the buffers of both sockets hold.
const LARGE_BYTES: usize = 24 << 20;

/// The status of the answer to a client that sends a whole request before it reads.
async fn sends_all_then_reads(
    mut stream: impl AsyncReadExt + AsyncWriteExt + Unpin,
    head: &str,
) -> String {
    stream.write_all(head.as_bytes()).await.unwrap();
    let piece = vec![0; 1 << 16];
    for _ in 0..LARGE_BYTES / piece.len() {
        stream.write_all(&piece).await.unwrap();
    }
    let mut said = Vec::new();
    stream.read_to_end(&mut said).await.unwrap();
    String::from_utf8_lossy(&said).into_owned()
}

fn address(app: &TestApp) -> &str {
    app.url.strip_prefix("http://").unwrap()
}

#[tokio::test]
async fn a_refusal_during_an_upload_reaches_the_client() {
    let app = TestApp::with(|s| s.body_limit = "1MiB".parse().unwrap()).await;
    let (_, submit) = key(app.data.path(), Scope::Submit, "default", Quota::default()).await;
    let (_, read) = key(app.data.path(), Scope::Read, "default", Quota::default()).await;
    closed(&app).await;
    let bearer = |key: &str| format!("Authorization: Bearer {key}\r\n");
    let (submit, read) = (bearer(&submit), bearer(&read));
    let length = format!("Content-Length: {LARGE_BYTES}\r\n");
    for (path, credentials, rest, status) in [
        ("/v1/volumes", "", length.as_str(), 401),
        ("/v1/volumes", read.as_str(), length.as_str(), 403),
        ("/v1/volumes", submit.as_str(), length.as_str(), 413),
        ("/v1/jobs", submit.as_str(), length.as_str(), 413),
        ("/v1/nothing", submit.as_str(), length.as_str(), 404),
        ("/healthz", submit.as_str(), length.as_str(), 405),
    ] {
        let head = format!("POST {path} HTTP/1.1\r\nHost: localhost\r\n{credentials}{rest}\r\n");
        let stream = TcpStream::connect(address(&app)).await.unwrap();
        let said = sends_all_then_reads(stream, &head).await;
        assert_eq!(
            said.split(' ').nth(1),
            Some(&*status.to_string()),
            "{path}: {said}"
        );
    }
    // A body whose length is not announced is refused in the middle.
    let pieces = (0..LARGE_BYTES >> 16).map(|_| Ok::<_, std::io::Error>(vec![0_u8; 1 << 16]));
    let body = reqwest::Body::wrap_stream(futures::stream::iter(pieces));
    let chunked = app
        .post("/v1/volumes")
        .header(AUTHORIZATION, submit[15..].trim());
    problem(
        chunked.body(body).send().await.unwrap(),
        413,
        "body-too-large",
    )
    .await;
}

#[tokio::test]
async fn a_refusal_during_an_upload_reaches_the_client_under_tls() {
    let authority = Authority::new();
    let folder = tempfile::tempdir().unwrap();
    authority.equip(folder.path());
    let app = TestApp::with(|settings| {
        settings.tls_cert = file(folder.path(), "cert.pem");
        settings.tls_key = file(folder.path(), "key.pem");
        settings.body_limit = "1MiB".parse().unwrap();
    })
    .await;
    for _ in 0..3 {
        let stream = TcpStream::connect(address(&app)).await.unwrap();
        let stream = authority.secured(stream).await;
        let head = format!(
            "POST /v1/volumes HTTP/1.1\r\nHost: localhost\r\nContent-Length: {LARGE_BYTES}\r\n\r\n"
        );
        let said = sends_all_then_reads(stream, &head).await;
        assert!(said.starts_with("HTTP/1.1 413"), "{said}");
    }
}

#[tokio::test]
async fn a_connection_is_kept_between_requests_for_longer_than_a_head_may_take() {
    let app = TestApp::with(|settings| {
        settings.header_timeout = "300ms".parse().unwrap();
        settings.keep_alive_timeout = "4s".parse().unwrap();
    })
    .await;
    let mut stream = TcpStream::connect(address(&app)).await.unwrap();
    let mut buffer = [0; 4096];
    for _ in 0..2 {
        stream
            .write_all(b"GET /healthz HTTP/1.1\r\nhost: x\r\n\r\n")
            .await
            .unwrap();
        let read = stream.read(&mut buffer).await.unwrap();
        assert!(buffer[..read].starts_with(b"HTTP/1.1 200"));
        tokio::time::sleep(Duration::from_millis(900)).await;
    }
    // A head that has begun does not get the time of an idle connection.
    let begun = Instant::now();
    stream.write_all(b"GET /healthz HT").await.unwrap();
    let _ = stream.read_to_end(&mut Vec::new()).await;
    assert!(begun.elapsed() < Duration::from_secs(3));
}

/// A service that trusts the test's own address.
async fn trusting(change: impl FnOnce(&mut Settings)) -> TestApp {
    TestApp::with(|settings| {
        settings.trusted_proxies = "127.0.0.1".parse().unwrap();
        change(settings);
    })
    .await
}

/// Every text in a JSON value that is a path of the service.
fn paths_in(value: &Value, into: &mut Vec<String>) {
    match value {
        Value::String(text) if text.contains("/v1/") && !text.contains(' ') => {
            into.push(text.clone());
        }
        Value::Array(items) => items.iter().for_each(|item| paths_in(item, into)),
        Value::Object(fields) => fields.values().for_each(|item| paths_in(item, into)),
        _ => {}
    }
}

#[tokio::test]
async fn every_path_in_an_answer_begins_as_the_client_must_write_it() {
    let app = trusting(|_| {}).await;
    let via = |method: Method, path: &str, prefix: Option<&str>| {
        let request = app.client.request(method, format!("{}{path}", app.url));
        match prefix {
            Some(prefix) => request.header("x-forwarded-prefix", prefix),
            None => request,
        }
    };
    let filed = via(Method::POST, "/v1/models?points=150", Some("/heart"));
    let filed = filed.body(volume("sphere")).send().await.unwrap();
    let location = filed.headers()["location"].to_str().unwrap().to_owned();
    assert!(location.starts_with("/heart/v1/jobs/"), "{location}");
    let job: Value = filed.json().await.unwrap();
    let id = text(&job["id"]);
    app.until(
        &json!({"links": {"self": format!("/v1/jobs/{id}")}}),
        &["succeeded"],
    )
    .await;
    app.post("/v1/segmentations")
        .body(volume("sphere"))
        .send()
        .await
        .unwrap();
    let job = app.json(&format!("/v1/jobs/{id}")).await;
    let model = text(&job["links"]["model"]);
    let volume_path = text(&job["links"]["volume"]);
    let lists = [
        "/v1/jobs",
        "/v1/models",
        "/v1/volumes",
        "/v1/segmentations",
        "/v1/templates",
        "/v1/readers",
        "/v1/erasures",
    ];
    let single = [format!("/v1/jobs/{id}"), model.clone(), volume_path.clone()];
    let mut found = 0;
    // Twice each, as answers are kept in memory.
    for path in lists.iter().map(|path| (*path).to_owned()).chain(single) {
        for prefix in [None, Some("/heart"), Some("/other"), Some("/heart"), None] {
            let answer = via(Method::GET, &path, prefix).send().await.unwrap();
            assert_eq!(answer.status(), StatusCode::OK, "{path}");
            let mut paths = Vec::new();
            paths_in(&answer.json().await.unwrap(), &mut paths);
            let start = format!("{}/v1/", prefix.unwrap_or_default());
            let wrong = paths.iter().find(|path| !path.starts_with(&start));
            assert_eq!(wrong, None, "{path} for {prefix:?}");
            found += paths.len();
        }
    }
    assert!(found > 50, "{found}");
    let events = via(
        Method::GET,
        &format!("/v1/jobs/{id}/events"),
        Some("/heart"),
    );
    let events = events.send().await.unwrap();
    assert_eq!(events.headers()["x-accel-buffering"], "no");
    let events = events.text().await.unwrap();
    assert!(
        events.contains(&format!("\"/heart/v1/jobs/{id}\"")),
        "{events}"
    );
    let erased = via(Method::DELETE, &model, Some("/heart"))
        .send()
        .await
        .unwrap();
    assert!(erased.status().is_success());
    if let Some(location) = erased.headers().get("location") {
        assert!(location.to_str().unwrap().starts_with("/heart/v1/"));
    }
}

#[tokio::test]
async fn pages_commands_and_document_name_the_address_that_the_client_used() {
    let app = trusting(|settings| settings.base_path = "/own".parse().unwrap()).await;
    let own = [("x-ignored", "")];
    let proxied = [
        ("x-forwarded-proto", "https"),
        ("x-forwarded-host", "heart.example"),
        ("x-forwarded-prefix", "/heart"),
    ];
    let standard = [(
        "forwarded",
        "for=192.0.2.1;proto=https;host=\"heart.example:8443\"",
    )];
    for (headers, base) in [
        (&own[..], format!("{}/own", app.url)),
        (&proxied[..], "https://heart.example/heart".to_owned()),
        (&standard[..], "https://heart.example:8443/own".to_owned()),
    ] {
        let get = |path: &str, accept: &str| {
            let request = app.get(path).header("accept", accept);
            headers
                .iter()
                .fold(request, |request, (name, value)| {
                    request.header(*name, *value)
                })
                .send()
        };
        // With the path of the setting and without it.
        for path in ["/", "/own", "/own/"] {
            let commands = get(path, "text/plain").await.unwrap().text().await.unwrap();
            assert!(
                commands.contains(&format!("'{base}/v1/jobs'")),
                "{commands}"
            );
        }
        let prefix = format!("/{}", base.splitn(4, '/').nth(3).unwrap());
        for path in ["/", "/docs", "/docs/", "/own", "/own/docs/"] {
            let page = get(path, "text/html").await.unwrap();
            assert_eq!(page.status(), StatusCode::OK);
            let page = page.text().await.unwrap();
            let names: Vec<&str> = page
                .split('"')
                .filter(|word| word.contains("assets/"))
                .collect();
            assert!(names.len() >= 3, "{page}");
            for name in names {
                let rest = name
                    .strip_prefix(&prefix)
                    .unwrap_or_else(|| panic!("{name}"));
                assert!(rest.starts_with("/assets/"), "{name}");
                let asset = app.get(&format!("/own{rest}")).send().await.unwrap();
                assert_eq!(asset.status(), StatusCode::OK, "{name}");
            }
        }
        let document: Value = get("/openapi.json", "*/*")
            .await
            .unwrap()
            .json()
            .await
            .unwrap();
        assert_eq!(document["servers"], json!([{"url": prefix}]));
    }
    let outside = app.get("/owner/v1/jobs").send().await.unwrap();
    problem(outside, 404, "no-such-path").await;
}

#[tokio::test]
async fn nobody_else_names_the_address() {
    let app = TestApp::start().await;
    let answer = app
        .get("/")
        .header("accept", "text/plain")
        .header("x-forwarded-proto", "https")
        .header("x-forwarded-host", "evil.example")
        .header("x-forwarded-prefix", "/evil")
        .header("forwarded", "host=evil.example;proto=https");
    let commands = answer.send().await.unwrap().text().await.unwrap();
    assert!(
        commands.contains(&format!("'{}/v1/jobs'", app.url)),
        "{commands}"
    );
    assert!(!commands.contains("evil"));
    // Without a known path, the page finds its files from where it is.
    let page = app
        .get("/docs/")
        .header("accept", "text/html")
        .send()
        .await
        .unwrap();
    let page = page.text().await.unwrap();
    assert!(
        page.contains("\"../assets/") && !page.contains("\"./assets/"),
        "{page}"
    );
    let document: Value = app.json("/openapi.json").await;
    assert_eq!(document.get("servers"), None);
}

#[tokio::test]
async fn a_page_behind_a_proxy_with_another_host_may_change_things() {
    let app = trusting(|_| {}).await;
    let upload = |host: Option<&'static str>| {
        let request = app
            .post("/v1/volumes")
            .header(ORIGIN, "https://heart.example");
        let request = match host {
            Some(host) => request.header("x-forwarded-host", host),
            None => request,
        };
        request.body(volume("sphere")).send()
    };
    assert_eq!(upload(Some("heart.example")).await.unwrap().status(), 201);
    problem(
        upload(Some("other.example")).await.unwrap(),
        403,
        "cross-site",
    )
    .await;
    problem(upload(None).await.unwrap(), 403, "cross-site").await;
    // What a proxy says of the host does not replace the name that must be known.
    let rebound = app.get("/v1/jobs").header(HOST, "evil.example");
    let rebound = rebound.header("x-forwarded-host", "localhost").send().await;
    problem(rebound.unwrap(), 421, "unknown-host").await;
}

#[tokio::test]
async fn a_header_that_stands_once_is_refused_twice() {
    let app = TestApp::start().await;
    let (_, submit) = key(app.data.path(), Scope::Submit, "default", Quota::default()).await;
    closed(&app).await;
    let bearer = format!("Bearer {submit}");
    let twice = |name: &'static str, first: &str, second: &str| {
        let request = app.get("/v1/jobs").header(AUTHORIZATION, &bearer);
        request.header(name, first).header(name, second).send()
    };
    let doubled = app.get("/v1/jobs").header(AUTHORIZATION, &bearer);
    let doubled = doubled
        .header(AUTHORIZATION, "Bearer other")
        .send()
        .await
        .unwrap();
    let said = problem(doubled, 400, "repeated-header").await;
    assert_eq!(said["field"], "authorization");
    for name in [
        "content-type",
        "range",
        "if-range",
        "idempotency-key",
        "last-event-id",
    ] {
        problem(twice(name, "a", "b").await.unwrap(), 400, "repeated-header").await;
    }
    let lists = twice("accept", "application/json", "*/*").await.unwrap();
    assert_eq!(lists.status(), StatusCode::OK);
}

#[tokio::test]
async fn ranges_count_for_get_alone() {
    let app = TestApp::start().await;
    let model = app.model("sphere").await;
    let path = format!("{}/mesh.json", text(&model["links"]["self"]));
    let whole = app.get(&path).send().await.unwrap();
    let length = whole.content_length().unwrap();
    let ranged = |method: Method| {
        let request = app.client.request(method, format!("{}{path}", app.url));
        request.header("range", "bytes=0-9").send()
    };
    let part = ranged(Method::GET).await.unwrap();
    assert_eq!(
        (part.status(), part.content_length()),
        (StatusCode::PARTIAL_CONTENT, Some(10))
    );
    let head = ranged(Method::HEAD).await.unwrap();
    assert_eq!(head.status(), StatusCode::OK);
    assert_eq!(
        head.headers()["content-length"],
        length.to_string().as_str()
    );
    assert!(!head.headers().contains_key("content-range"));
}

#[tokio::test]
async fn answers_carry_the_time_of_the_clock() {
    let app = TestApp::start().await;
    for path in ["/healthz", "/v1/jobs", "/nothing"] {
        let before = SystemTime::now() - Duration::from_secs(1);
        let answer = app.get(path).send().await.unwrap();
        let dates: Vec<_> = answer.headers().get_all("date").iter().collect();
        assert_eq!(dates.len(), 1);
        let date = httpdate::parse_http_date(dates[0].to_str().unwrap()).unwrap();
        assert!(before <= date && date <= SystemTime::now(), "{date:?}");
    }
}

#[tokio::test]
async fn the_same_format_has_many_names() {
    let app = TestApp::start().await;
    for name in [
        "application/zip",
        "application/x-zip-compressed",
        "application/x-zip",
        "application/gzip",
        "application/x-gzip",
        "Application/X-GZip-Compressed",
        "application/x-compressed",
        "application/octet-stream",
        "binary/octet-stream",
        "application/dicom; transfer-syntax=1.2.840.10008.1.2.1",
        "application/x-www-form-urlencoded",
        "",
    ] {
        for path in ["/v1/volumes", "/v1/models", "/v1/segmentations"] {
            let request = app.post(path).header("content-type", name);
            let answer = request
                .body(volume(&format!("sphere {name}")))
                .send()
                .await
                .unwrap();
            assert!(
                answer.status().is_success(),
                "{path} of {name}: {}",
                answer.status()
            );
        }
    }
    let picture = app.post("/v1/volumes").header("content-type", "image/png");
    problem(
        picture.body(volume("sphere")).send().await.unwrap(),
        415,
        "unsupported-media-type",
    )
    .await;
}

#[tokio::test]
async fn preflights_allow_and_expose_every_header_of_the_document() {
    let document: Value = serde_json::from_str(&document_json()).unwrap();
    let (mut sent, mut received) = (BTreeSet::new(), BTreeSet::new());
    let resolve = |value: &Value| match value["$ref"].as_str() {
        Some(reference) => document.pointer(&reference[1..]).unwrap().clone(),
        None => value.clone(),
    };
    for item in document["paths"].as_object().unwrap().values() {
        for operation in item.as_object().unwrap().values() {
            for parameter in operation["parameters"].as_array().into_iter().flatten() {
                let parameter = resolve(parameter);
                if parameter["in"] == "header" {
                    sent.insert(text(&parameter["name"]).to_lowercase());
                }
            }
            for answer in operation["responses"]
                .as_object()
                .into_iter()
                .flat_map(|all| all.values())
            {
                let headers = &resolve(answer)["headers"];
                let names = headers.as_object().into_iter().flat_map(|all| all.keys());
                received.extend(names.map(|name| name.to_lowercase()));
            }
        }
    }
    assert!(
        sent.len() > 4 && received.len() > 3,
        "{sent:?} {received:?}"
    );
    let site = "https://viewer.example";
    let app = TestApp::with(|settings| settings.cors_origins = site.parse().unwrap()).await;
    let preflight = app
        .client
        .request(Method::OPTIONS, format!("{}/v1/volumes", app.url))
        .header(ORIGIN, site)
        .header("access-control-request-method", "POST")
        .send();
    let words = |headers: &reqwest::header::HeaderMap, name: &str| -> BTreeSet<String> {
        let list = headers[name].to_str().unwrap();
        list.split(',')
            .map(|word| word.trim().to_lowercase())
            .collect()
    };
    let preflight = preflight.await.unwrap();
    let allowed = words(preflight.headers(), "access-control-allow-headers");
    let missing: Vec<_> = sent.difference(&allowed).collect();
    assert!(missing.is_empty(), "{missing:?}");
    let answer = app
        .get("/v1/jobs")
        .header(ORIGIN, site)
        .send()
        .await
        .unwrap();
    let exposed = words(answer.headers(), "access-control-expose-headers");
    let missing: Vec<_> = received.difference(&exposed).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

#[tokio::test]
async fn the_log_has_a_line_for_each_request() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log");
    let service =
        Service::start_logging(&folder.path().join("data"), &["--log-format", "json"], &log).await;
    let client = Client::new();
    for (number, path) in ["/v1/jobs", "/v1/volumes/vol_0", "/nothing"]
        .iter()
        .enumerate()
    {
        let request = client.get(format!("{}{path}", service.url));
        let id = format!("request-{number}");
        request.header("x-request-id", &id).send().await.unwrap();
        let deadline = Instant::now() + Duration::from_secs(20);
        loop {
            let lines = std::fs::read_to_string(&log).unwrap();
            let own: Vec<Value> = lines
                .lines()
                .filter(|line| line.contains(&id))
                .map(|line| serde_json::from_str(line).unwrap())
                .collect();
            if let [line] = &own[..] {
                assert_eq!(line["level"], "INFO", "{line}");
                let status = if number == 0 { 200 } else { 404 };
                assert_eq!(line["fields"]["status"], status, "{line}");
                break;
            }
            assert!(Instant::now() < deadline && own.is_empty(), "{own:?}");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
}

#[tokio::test]
async fn a_key_can_be_made_while_the_service_starts_for_the_first_time() {
    if std::env::var_os("VENTRIFORM_TEST_DATABASE").is_some() {
        println!("skipped: the command of this test uses the file of SQLite");
        return;
    }
    for _ in 0..4 {
        let folder = tempfile::tempdir().unwrap();
        let data = folder.path().join("data");
        // A command makes no folder: the operator does.
        std::fs::create_dir(&data).unwrap();
        let create = std::process::Command::new(env!("CARGO_BIN_EXE_ventriform"))
            .args([
                "keys",
                "create",
                "--name",
                "a",
                "--scope",
                "submit",
                "--data-dir",
            ])
            .arg(&data)
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        let service = Service::start(&data, &[]).await;
        let made = create.wait_with_output().unwrap();
        assert!(
            made.status.success(),
            "{}",
            String::from_utf8_lossy(&made.stderr)
        );
        let bearer = String::from_utf8(made.stdout).unwrap();
        let list = service
            .get("/v1/jobs")
            .bearer_auth(bearer.trim())
            .send()
            .await
            .unwrap();
        assert_eq!(list.status(), StatusCode::OK);
    }
}
