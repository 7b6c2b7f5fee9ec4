//! Malicious and broken clients.

use crate::helpers::{TestApp, problem, volume};
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

async fn connect(app: &TestApp) -> TcpStream {
    TcpStream::connect(app.url.strip_prefix("http://").unwrap())
        .await
        .unwrap()
}

/// Everything the service sends until it closes the connection.
async fn rest_of(stream: &mut TcpStream) -> String {
    let mut said = Vec::new();
    let read = tokio::time::timeout(Duration::from_secs(60), stream.read_to_end(&mut said));
    // The service may also reset the connection.
    let _ = read.await.expect("the service hangs up");
    String::from_utf8_lossy(&said).into_owned()
}

#[tokio::test]
async fn a_request_names_its_host_once() {
    let app = TestApp::start().await;
    for (head, status) in [
        ("GET /healthz HTTP/1.1\r\n", 400),
        (
            "GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\nHost: 127.0.0.1\r\n",
            400,
        ),
        (
            "GET http://evil.example/healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n",
            421,
        ),
        (
            "GET http://127.0.0.1/healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n",
            200,
        ),
        ("GET /healthz HTTP/1.0\r\n", 200),
    ] {
        let mut stream = connect(&app).await;
        let request = format!("{head}Connection: close\r\n\r\n");
        stream.write_all(request.as_bytes()).await.unwrap();
        let answer = rest_of(&mut stream).await;
        assert_eq!(
            answer.split(' ').nth(1),
            Some(&*status.to_string()),
            "{head}"
        );
    }
}

#[tokio::test]
async fn idle_connections_and_partial_headers_are_closed() {
    let app = TestApp::with(|s| {
        s.header_timeout = "300ms".parse().unwrap();
        s.keep_alive_timeout = "600ms".parse().unwrap();
    })
    .await;
    let mut silent = connect(&app).await;
    let mut slow = connect(&app).await;
    slow.write_all(b"GET /healthz HT").await.unwrap();
    let mut idle = connect(&app).await;
    idle.write_all(b"GET /healthz HTTP/1.1\r\nhost: x\r\n\r\n")
        .await
        .unwrap();
    rest_of(&mut silent).await;
    rest_of(&mut slow).await;
    assert!(rest_of(&mut idle).await.starts_with("HTTP/1.1 200"));
    app.json("/healthz").await;
}

/// Connections that do not stall, however slow the machine: they wait for the events of a job.
async fn hold(app: &TestApp, count: usize) -> Vec<TcpStream> {
    let mut filing = connect(app).await;
    let body = volume("slow");
    let head = format!(
        "POST /v1/models HTTP/1.1\r\nhost: x\r\ncontent-length: {}\r\nconnection: close\r\n\r\n",
        body.len()
    );
    filing
        .write_all(&[head.as_bytes(), &body].concat())
        .await
        .unwrap();
    let answer = rest_of(&mut filing).await;
    let (_, events) = answer.split_once("\"events\":\"").expect("a job");
    let (events, _) = events.split_once('"').unwrap();
    let mut held = Vec::new();
    for _ in 0..count {
        let mut stream = connect(app).await;
        let request = format!("GET {events} HTTP/1.1\r\nhost: x\r\n\r\n");
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut first = [0; 12];
        stream.read_exact(&mut first).await.unwrap();
        assert_eq!(&first, b"HTTP/1.1 200");
        held.push(stream);
    }
    held
}

#[tokio::test]
async fn connections_beyond_the_limit_are_closed_at_once() {
    let app = TestApp::with(|s| s.connection_limit = 3).await;
    let held = hold(&app, 3).await;
    assert_eq!(rest_of(&mut connect(&app).await).await, "");
    drop(held);
    app.json("/healthz").await;
}

#[tokio::test]
async fn an_upload_that_stalls_is_ended_and_leaves_nothing() {
    let app = TestApp::with(|s| s.body_timeout = "200ms".parse().unwrap()).await;
    let mut stream = connect(&app).await;
    let head = "POST /v1/volumes HTTP/1.1\r\nhost: x\r\ncontent-length: 1000\r\n\r\nVOLUME ";
    stream.write_all(head.as_bytes()).await.unwrap();
    assert!(rest_of(&mut stream).await.starts_with("HTTP/1.1 408"));
    assert!(app.stored().is_empty());
}

#[tokio::test]
async fn an_upload_that_breaks_off_leaves_nothing() {
    let app = TestApp::start().await;
    let mut stream = connect(&app).await;
    let head = "POST /v1/volumes HTTP/1.1\r\nhost: x\r\ncontent-length: 1000\r\n\r\nVOLUME ";
    stream.write_all(head.as_bytes()).await.unwrap();
    drop(stream);
    let deadline = Instant::now() + Duration::from_secs(60);
    while !app.stored().is_empty() {
        assert!(Instant::now() < deadline, "{:?}", app.stored());
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    app.volume("sphere").await;
}

#[tokio::test]
async fn a_form_with_endless_headers_is_rejected() {
    let app = TestApp::start().await;
    let start = b"--B\r\ncontent-disposition: form-data; name=\"".to_vec();
    let pieces = std::iter::once(start).chain((0..400).map(|_| vec![b'x'; 16 << 10]));
    let pieces = futures::stream::iter(pieces.map(Ok::<_, std::io::Error>));
    let answer = app
        .post("/v1/volumes")
        .header("content-type", "multipart/form-data; boundary=B")
        .body(reqwest::Body::wrap_stream(pieces))
        .send()
        .await;
    assert_eq!(answer.unwrap().status(), 400);
    assert!(app.stored().is_empty());
}

#[tokio::test]
async fn malformed_requests_are_rejected() {
    let app = TestApp::start().await;
    for path in [
        "/v1/jobs/%00",
        "/v1/jobs/%ff%fe",
        "/v1/models/..%2f..%2flock/mesh",
        "/v1/volumes/%2e%2e",
    ] {
        let answer = app.get(path).send().await.unwrap();
        assert!(
            answer.status().is_client_error(),
            "{path}: {}",
            answer.status()
        );
        let media_type = answer.headers()["content-type"]
            .to_str()
            .unwrap()
            .to_owned();
        assert_eq!(media_type, "application/problem+json", "{path}");
    }
    for name in [
        "prefer",
        "accept",
        "idempotency-key",
        "if-none-match",
        "range",
        "x-request-id",
    ] {
        let odd = reqwest::header::HeaderValue::from_bytes(b"\xff\xfe;q=;;,=\"").unwrap();
        let answer = app
            .post("/v1/models")
            .header(name, odd)
            .body(volume("sphere"))
            .send()
            .await;
        assert!(answer.unwrap().status().as_u16() < 500, "{name}");
    }
}

#[tokio::test]
async fn clients_that_send_a_few_bytes_and_wait_occupy_no_files() {
    let app = TestApp::start().await;
    let mut slow = Vec::new();
    for _ in 0..8 {
        let mut stream = connect(&app).await;
        let head = "POST /v1/volumes HTTP/1.1\r\nhost: x\r\ncontent-length: 90000\r\n\r\n";
        stream.write_all(head.as_bytes()).await.unwrap();
        stream.write_all(&[b'.'; 4000]).await.unwrap();
        slow.push(stream);
    }
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert_eq!(app.stored(), [""; 0]);
    // The rest arrives, and the body is judged as a whole.
    let mut last = slow.pop().unwrap();
    last.write_all(&[b'.'; 86_000]).await.unwrap();
    let answer = tokio::time::timeout(Duration::from_secs(60), async {
        let mut said = [0; 12];
        last.read_exact(&mut said).await.unwrap();
        String::from_utf8_lossy(&said).into_owned()
    });
    assert_eq!(answer.await.unwrap(), "HTTP/1.1 422");
}

/// Sends requests whose answers are many times as large as what the system buffers.
async fn ask_for_much(app: &TestApp) -> TcpStream {
    let socket = tokio::net::TcpSocket::new_v4().unwrap();
    socket.set_recv_buffer_size(4096).unwrap();
    let address = app.url.strip_prefix("http://").unwrap();
    let mut stream = socket.connect(address.parse().unwrap()).await.unwrap();
    let request = "GET /openapi.json HTTP/1.1\r\nhost: x\r\n\r\n".repeat(100);
    stream.write_all(request.as_bytes()).await.unwrap();
    stream
}

#[tokio::test]
async fn a_client_that_never_reads_is_cut_off() {
    let app = TestApp::with(|s| s.write_timeout = "300ms".parse().unwrap()).await;
    let mut stream = ask_for_much(&app).await;
    let cut_off = async {
        // Writing fails once the service has closed the connection.
        while stream.write_all(b"GET ").await.is_ok() {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    tokio::time::timeout(Duration::from_secs(60), cut_off)
        .await
        .expect("the service hangs up");
}

#[tokio::test]
async fn a_full_service_still_answers_health_checks() {
    let app = TestApp::with(|s| s.connection_limit = 2).await;
    let _held = hold(&app, 2).await;
    app.json("/healthz").await;
    app.json("/readyz").await;
    let refused = app.get("/v1/volumes").send().await.unwrap();
    assert_eq!(refused.headers()["retry-after"], "1");
    assert_eq!(refused.status(), 503);
    let body: serde_json::Value = refused.json().await.unwrap();
    assert_eq!(body["type"], "urn:ventriform:problem:too-many-connections");
}

#[tokio::test]
async fn a_stalled_connection_makes_room_for_a_new_one() {
    let app = TestApp::with(|s| s.client_connection_limit = 2).await;
    let mut unread = ask_for_much(&app).await;
    let mut head = connect(&app).await;
    head.write_all(b"GET /healthz HT").await.unwrap();
    tokio::time::sleep(Duration::from_millis(1300)).await;
    app.json("/v1/volumes").await;
    // One of them is closed; the other one still has its place.
    let mut ended = 0;
    for stream in [&mut unread, &mut head] {
        let mut said = Vec::new();
        let read = stream.read_to_end(&mut said);
        let read = tokio::time::timeout(Duration::from_millis(500), read).await;
        ended += usize::from(read.is_ok() && said.len() < 5_000_000);
    }
    assert!(ended >= 1, "{ended}");
}

#[tokio::test]
async fn streams_of_events_are_limited_per_client() {
    let app = TestApp::with(|s| s.client_event_stream_limit = 1).await;
    let job = app.file("slow").await;
    let path = crate::helpers::text(&job["links"]["events"]);
    let first = app.get(&path).send().await.unwrap();
    assert_eq!(first.status(), 200);
    let second = app.get(&path).send().await.unwrap();
    problem(second, 429, "too-many-streams").await;
    drop(first);
    let deadline = Instant::now() + Duration::from_secs(60);
    while app.get(&path).send().await.unwrap().status() != 200 {
        assert!(Instant::now() < deadline, "the place of a closed stream");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}
