//! Whatever the service refuses has a line in its log, also what never becomes a request.

use crate::helpers::Service;
use crate::tls::Authority;
use std::path::Path;
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

fn log_of(path: &Path) -> Vec<String> {
    let log = std::fs::read_to_string(path).unwrap();
    log.lines().map(str::to_owned).collect()
}

/// Sends bytes on a connection of its own; returns what comes back until the service closes it.
async fn send(address: &str, bytes: &[u8]) -> Vec<u8> {
    let mut stream = TcpStream::connect(address).await.unwrap();
    // The service may refuse before everything is sent.
    let _ = stream.write_all(bytes).await;
    let mut answer = Vec::new();
    let read = stream.read_to_end(&mut answer);
    let _ = tokio::time::timeout(Duration::from_secs(20), read).await;
    answer
}

/// Waits for a line at `INFO` that holds all of these words.
async fn has_line(log: &Path, words: &[&str]) {
    let deadline = Instant::now() + Duration::from_secs(20);
    loop {
        let lines = log_of(log);
        let fits =
            |line: &&String| line.contains("INFO") && words.iter().all(|word| line.contains(word));
        if lines.iter().any(|line| fits(&line)) {
            return;
        }
        assert!(Instant::now() < deadline, "{words:?}: {lines:#?}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

const REFUSED_LINE: &str = "a connection was refused";

#[tokio::test]
async fn what_never_becomes_a_request_has_a_line_in_the_log() {
    let data = tempfile::tempdir().unwrap();
    let log = data.path().join("log.txt");
    let limits = ["--header-timeout", "700ms", "--keep-alive-timeout", "1s"];
    let service = Service::start_logging(&data.path().join("data"), &limits, &log).await;
    let address = service.url.strip_prefix("http://").unwrap().to_owned();
    let long = format!(
        "GET / HTTP/1.1\r\nHost: x\r\nA: {}\r\n\r\n",
        "a".repeat(200 << 10)
    );
    for (bytes, status, words) in [
        (&b"\x16\x03\x01 hello\r\n\r\n"[..], 400, &["invalid"][..]),
        (
            b"GET / HTTP/1.1\r\nHost x\r\n\r\n",
            400,
            &["invalid HTTP header"],
        ),
        (long.as_bytes(), 431, &["too large"]),
        (b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", 0, &["HTTP2"]),
        (
            b"GET / HTTP/1.1\r\nHost: x\r\n",
            0,
            &["no request came in time"],
        ),
        (b"", 0, &["no request came in time"]),
    ] {
        std::fs::write(&log, "").unwrap();
        let answer = send(&address, bytes).await;
        let answer = String::from_utf8_lossy(&answer);
        let stated = format!("status={status}");
        let mut words = [&[REFUSED_LINE, "127.0.0.1"], words].concat();
        match status {
            0 => assert_eq!(answer, ""),
            _ => {
                assert!(
                    answer.starts_with(&format!("HTTP/1.1 {status}")),
                    "{answer}"
                );
                words.push(&stated);
            }
        }
        has_line(&log, &words).await;
    }
    // Nobody is refused where a client closes, or leaves a connection idle after its answer.
    std::fs::write(&log, "").unwrap();
    let mut idle = TcpStream::connect(&address).await.unwrap();
    idle.write_all(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n")
        .await
        .unwrap();
    drop(TcpStream::connect(&address).await.unwrap());
    let mut answer = Vec::new();
    idle.read_to_end(&mut answer).await.unwrap();
    assert!(answer.starts_with(b"HTTP/1.1 200"));
    // A client that goes away with its request half sent.
    let mut half = TcpStream::connect(&address).await.unwrap();
    half.write_all(
        b"POST /v1/volumes HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000\r\n\r\nabc",
    )
    .await
    .unwrap();
    tokio::time::sleep(Duration::from_millis(300)).await;
    drop(half);
    has_line(&log, &["/v1/volumes", "POST"]).await;
    let refused: Vec<String> = log_of(&log)
        .into_iter()
        .filter(|line| line.contains(REFUSED_LINE))
        .collect();
    assert!(refused.is_empty(), "{refused:#?}");
}

#[tokio::test]
async fn handshakes_that_fail_have_a_line_in_the_log() {
    let folder = tempfile::tempdir().unwrap();
    Authority::new().equip(folder.path());
    let log = folder.path().join("log.txt");
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (certificate, key) = (file("cert.pem"), file("key.pem"));
    let arguments = [
        "--tls-cert",
        &certificate,
        "--tls-key",
        &key,
        "--header-timeout",
        "700ms",
    ];
    let service = Service::start_logging(&folder.path().join("data"), &arguments, &log).await;
    let address = service.url.strip_prefix("https://").unwrap().to_owned();
    for (bytes, words) in [
        (
            &b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"[..],
            &["status=400", "plain HTTP"][..],
        ),
        (b"\x16\x03\x01\x00\x05hello", &[]),
        (b"\x16\x03\x01\x02\x00\x01", &["in time"]),
    ] {
        std::fs::write(&log, "").unwrap();
        send(&address, bytes).await;
        has_line(&log, &[&[REFUSED_LINE, "127.0.0.1"], words].concat()).await;
    }
}
