//! Clients against a server that answers byte for byte as a test says.

use super::ReqwestFactory;
use bytes::Bytes;
use futures::StreamExt;
use http::header::{AUTHORIZATION, LOCATION};
use http::{Request, Response, StatusCode};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpListener;
use ventriform_service::base::http_client::{
    ByteStream, ClientError, ClientFactory, ClientOptions, HttpClient, Redirects, Resolver,
    SendError, USER_AGENT, bounded_body, build_client,
};

/// Longest time of a test's request; a test that takes it fails.
const TEST_LIMIT: Duration = Duration::from_secs(30);

/// A word that no error may hold.
const SECRET: &str = "word-of-the-query";

/// A server of raw answers.
struct RawServer {
    address: SocketAddr,
    connections: Arc<AtomicUsize>,
    heads: Arc<Mutex<Vec<String>>>,
}

impl RawServer {
    /// Answers each request by the pieces that `answer` makes of its head, with a pause before each but the first, and
    /// closes the connection if the answer does.
    async fn start(
        pause: Duration,
        answer: impl Fn(&str) -> Vec<String> + Send + Sync + 'static,
    ) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let (connections, heads) = (Arc::<AtomicUsize>::default(), Arc::default());
        let (answer, counted, seen) = (Arc::new(answer), connections.clone(), Arc::clone(&heads));
        tokio::spawn(async move {
            while let Ok((stream, _)) = listener.accept().await {
                counted.fetch_add(1, Ordering::SeqCst);
                tokio::spawn(converse(stream, pause, answer.clone(), Arc::clone(&seen)));
            }
        });
        Self {
            address,
            connections,
            heads,
        }
    }

    fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }

    fn heads(&self) -> Vec<String> {
        self.heads.lock().unwrap().clone()
    }
}

async fn converse(
    mut stream: impl AsyncRead + AsyncWrite + Unpin,
    pause: Duration,
    answer: Arc<impl Fn(&str) -> Vec<String>>,
    heads: Arc<Mutex<Vec<String>>>,
) {
    while let Some(head) = read_request(&mut stream).await {
        let pieces = answer(&head);
        heads.lock().unwrap().push(head);
        for (n, piece) in pieces.iter().enumerate() {
            if n > 0 {
                tokio::time::sleep(pause).await;
            }
            let written = stream.write_all(piece.as_bytes()).await;
            if written.is_err() || stream.flush().await.is_err() {
                return;
            }
        }
        if pieces.concat().contains("Connection: close") {
            return;
        }
    }
}

/// The head of the next request, and its body if it has a `content-length`; `None` if the connection was closed.
async fn read_request(stream: &mut (impl AsyncRead + Unpin)) -> Option<String> {
    let mut request = Vec::new();
    loop {
        request.push(stream.read_u8().await.ok()?);
        if request.ends_with(b"\r\n\r\n") {
            break;
        }
    }
    let head = String::from_utf8_lossy(&request).to_lowercase();
    let length = head.split("content-length: ").nth(1);
    let length = length.and_then(|rest| rest.split("\r\n").next()?.parse().ok());
    let mut body = vec![0; length.unwrap_or(0)];
    stream.read_exact(&mut body).await.ok()?;
    request.extend(body);
    String::from_utf8(request).ok()
}

fn ok(body: &str) -> String {
    format!(
        "HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n{body}",
        body.len()
    )
}

fn redirect(to: &str) -> String {
    format!("HTTP/1.1 302 Found\r\nLocation: {to}\r\nContent-Length: 0\r\n\r\n")
}

/// Nothing is limited but the test itself.
fn options() -> ClientOptions {
    ClientOptions {
        total_timeout: Some(TEST_LIMIT),
        ..ClientOptions::default()
    }
}

async fn client(options: ClientOptions) -> Arc<dyn HttpClient> {
    let _ = rustls::crypto::ring::default_provider().install_default();
    build_client(Arc::new(ReqwestFactory), options)
        .await
        .unwrap()
}

async fn get(client: &dyn HttpClient, url: &str) -> Result<Response<ByteStream>, SendError> {
    let request = Request::get(url).body(Bytes::new()).unwrap();
    client.send(request).await
}

async fn text(response: Response<ByteStream>) -> Result<String, SendError> {
    let body = bounded_body(response.into_body(), usize::MAX).await?;
    Ok(String::from_utf8(body.unwrap()).unwrap())
}

/// The addresses of one name.
#[derive(Debug)]
struct OneName(&'static str, SocketAddr);

impl Resolver for OneName {
    fn resolve(&self, host: &str) -> Option<Vec<SocketAddr>> {
        (host == self.0).then(|| vec![self.1])
    }
}

#[tokio::test]
async fn requests_arrive_as_they_were_made_and_answers_whatever_their_status() {
    let server = RawServer::start(Duration::ZERO, |_| {
        vec!["HTTP/1.1 503 Busy\r\nRetry-After: 7\r\nContent-Length: 4\r\n\r\nwait".into()]
    })
    .await;
    let named = client(ClientOptions {
        user_agent: Some(USER_AGENT),
        ..options()
    });
    let request = Request::post(server.url("/studies?a=%20b"))
        .header(AUTHORIZATION, "Bearer token")
        .body(Bytes::from("object"))
        .unwrap();
    let response = named.await.send(request).await.unwrap();
    assert_eq!(response.status(), StatusCode::SERVICE_UNAVAILABLE);
    assert_eq!(response.headers()["retry-after"], "7");
    assert_eq!(text(response).await.unwrap(), "wait");
    let plain = client(options()).await;
    get(&*plain, &server.url("/")).await.unwrap();
    let heads = server.heads();
    assert!(heads[0].starts_with("POST /studies?a=%20b HTTP/1.1\r\n"));
    assert!(heads[0].ends_with("\r\n\r\nobject"), "{}", heads[0]);
    for line in [
        "authorization: bearer token".to_owned(),
        format!("user-agent: {USER_AGENT}"),
    ] {
        assert!(heads[0].to_lowercase().contains(&line), "{}", heads[0]);
    }
    let second = heads[1].to_lowercase();
    for name in ["user-agent", "referer", "content-length", "authorization"] {
        assert!(!second.contains(name), "{second}");
    }
}

#[tokio::test]
async fn redirects_are_followed_as_far_as_the_rule_says() {
    let elsewhere = RawServer::start(Duration::ZERO, |_| vec![ok("elsewhere")]).await;
    let away = elsewhere.url("/");
    let server = RawServer::start(Duration::ZERO, move |head| {
        let path = head.split(' ').nth(1).unwrap_or_default();
        vec![match path {
            "/away" => redirect(&away),
            "/3" => redirect("/2"),
            "/2" => redirect("/1"),
            "/1" => redirect("/0"),
            _ => ok("here"),
        }]
    })
    .await;
    let found = |redirects, path| {
        let url = server.url(path);
        async move {
            let client = client(ClientOptions {
                redirects,
                ..options()
            })
            .await;
            let response = get(&*client, &url).await?;
            let to = response.headers().get(LOCATION).cloned();
            match to {
                Some(to) => Ok(format!("to {}", to.to_str().unwrap())),
                None => text(response).await,
            }
        }
    };
    let at = |path: &str| Ok(format!("to {path}"));
    let away = at(&elsewhere.url("/"));
    assert_eq!(found(Redirects::Never, "/1").await, at("/0"));
    assert_eq!(
        found(Redirects::WithinOrigin(2), "/2").await,
        Ok("here".into())
    );
    assert_eq!(found(Redirects::WithinOrigin(2), "/3").await, at("/0"));
    assert_eq!(found(Redirects::WithinOrigin(2), "/away").await, away);
    assert_eq!(elsewhere.connections.load(Ordering::SeqCst), 0);
    assert_eq!(
        found(Redirects::Anywhere(2), "/away").await,
        Ok("elsewhere".into())
    );
    assert_eq!(
        found(Redirects::Anywhere(2), "/3").await,
        Err(SendError::Redirect)
    );
    // Nobody is told where a request comes from.
    let heads = [server.heads(), elsewhere.heads()].concat();
    assert!(heads.iter().all(|h| !h.to_lowercase().contains("referer")));
}

#[tokio::test]
async fn a_client_reaches_the_addresses_of_its_resolver_and_no_other_name() {
    let server = RawServer::start(Duration::ZERO, |_| vec![ok("pinned")]).await;
    let client = client(ClientOptions {
        resolver: Some(Arc::new(OneName("pinned.invalid", server.address))),
        ..options()
    })
    .await;
    let port = server.address.port();
    let url = format!("http://pinned.invalid:{port}/");
    let response = get(&*client, &url).await.unwrap();
    assert_eq!(text(response).await.unwrap(), "pinned");
    let error = get(&*client, &format!("http://localhost:{port}/")).await;
    let error = error.err().unwrap();
    assert!(matches!(error, SendError::Connect(_)), "{error:?}");
    assert_eq!(server.connections.load(Ordering::SeqCst), 1);
}

#[tokio::test]
async fn each_time_limit_ends_a_request_by_itself() {
    let short = Duration::from_millis(200);
    let never = client(ClientOptions {
        read_timeout: Some(short),
        ..options()
    });
    let never = never.await;
    let silent = RawServer::start(Duration::ZERO, |_| Vec::new()).await;
    let unanswered = get(&*never, &silent.url("/")).await;
    assert_eq!(unanswered.err(), Some(SendError::Timeout));
    // A body whose pieces come more often than the pause allows may take longer than the pause.
    let slow = |_: &str| {
        let mut pieces = vec!["HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\n".to_owned()];
        pieces.extend((0..5).map(|n| n.to_string()));
        pieces
    };
    let server = RawServer::start(Duration::from_millis(100), slow).await;
    let patient = client(ClientOptions {
        read_timeout: Some(Duration::from_secs(10)),
        ..options()
    });
    let response = get(&*patient.await, &server.url("/")).await.unwrap();
    assert_eq!(text(response).await.unwrap(), "01234");
    let hurried = client(ClientOptions {
        total_timeout: Some(short),
        ..options()
    });
    let whole = async {
        let response = get(&*hurried.await, &server.url("/")).await?;
        text(response).await
    };
    assert_eq!(whole.await, Err(SendError::Timeout));
    let halting = RawServer::start(TEST_LIMIT, slow).await;
    let response = get(&*never, &halting.url("/")).await;
    let read = async { text(response?).await };
    assert_eq!(read.await, Err(SendError::Timeout));
}

#[tokio::test]
async fn errors_tell_their_kind_and_no_url() {
    let cut = "HTTP/1.1 200 OK\r\nContent-Length: 9\r\nConnection: close\r\n\r\nhalf";
    let broken = RawServer::start(Duration::ZERO, |_| vec![cut.into()]).await;
    let odd = RawServer::start(Duration::ZERO, |_| {
        vec!["SSH-2.0 Connection: close\r\n\r\n".into()]
    })
    .await;
    let circle = RawServer::start(Duration::ZERO, |head| {
        vec![redirect(head.split(' ').nth(1).unwrap_or_default())]
    })
    .await;
    let closed = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let nobody = format!("http://{}", closed.local_addr().unwrap());
    drop(closed);
    let client = client(ClientOptions {
        redirects: Redirects::Anywhere(2),
        ..options()
    })
    .await;
    let path = format!("/{SECRET}?token={SECRET}");
    let mut kinds = Vec::new();
    for base in [&broken.url(""), &odd.url(""), &circle.url(""), &nobody] {
        let read = async { text(get(&*client, &format!("{base}{path}")).await?).await };
        let error = read.await.unwrap_err();
        for told in [error.to_string(), format!("{error:?}")] {
            assert!(!told.contains(SECRET), "{told}");
            assert!(!told.contains("http://"), "{told}");
        }
        kinds.push(match error {
            SendError::Timeout => "timeout",
            SendError::Connect(_) => "connect",
            SendError::Redirect => "redirect",
            SendError::Body(_) => "body",
            SendError::Request(_) => "request",
        });
    }
    assert_eq!(kinds, ["body", "request", "redirect", "connect"]);
}

#[tokio::test]
async fn unused_connections_are_kept_as_long_as_the_options_say() {
    for (idle_timeout, connections) in [(Duration::ZERO, 3), (TEST_LIMIT, 1)] {
        let server = RawServer::start(Duration::ZERO, |_| vec![ok("again")]).await;
        let client = client(ClientOptions {
            idle_timeout,
            ..options()
        })
        .await;
        for _ in 0..3 {
            let response = get(&*client, &server.url("/")).await.unwrap();
            assert_eq!(text(response).await.unwrap(), "again");
            // The connection goes back to the pool after the body has ended.
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        assert_eq!(server.connections.load(Ordering::SeqCst), connections);
    }
}

#[tokio::test]
async fn bodies_are_handed_out_as_they_come() {
    let server = RawServer::start(Duration::from_millis(100), |_| {
        vec![
            "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n3\r\none\r\n".into(),
            "3\r\ntwo\r\n".into(),
            "0\r\n\r\n".into(),
        ]
    })
    .await;
    let client = client(options()).await;
    let response = get(&*client, &server.url("/")).await.unwrap();
    let pieces: Vec<_> = response.into_body().collect().await;
    assert_eq!(
        pieces,
        [Ok(Bytes::from("one")), Ok(Bytes::from("two"))],
        "pieces were gathered"
    );
}

#[tokio::test]
async fn a_server_of_a_private_authority_is_trusted_with_its_certificate_alone() {
    let name = "pacs.invalid";
    let made = rcgen::generate_simple_self_signed([name.to_owned()]).unwrap();
    let key = rustls::pki_types::PrivateKeyDer::try_from(made.signing_key.serialize_der());
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = rustls::ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_no_client_auth()
        .with_single_cert(vec![made.cert.der().clone()], key.unwrap())
        .unwrap();
    let acceptor = tokio_rustls::TlsAcceptor::from(Arc::new(config));
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    tokio::spawn(async move {
        while let Ok((stream, _)) = listener.accept().await {
            let Ok(stream) = acceptor.accept(stream).await else {
                continue;
            };
            let answer = Arc::new(|_: &str| vec![ok("trusted")]);
            tokio::spawn(converse(stream, Duration::ZERO, answer, Arc::default()));
        }
    });
    let asked = |authorities| async move {
        let client = client(ClientOptions {
            authorities,
            resolver: Some(Arc::new(OneName(name, address))),
            ..options()
        })
        .await;
        let url = format!("https://{name}:{}/", address.port());
        text(get(&*client, &url).await?).await
    };
    let authority = made.cert.pem().into_bytes();
    assert_eq!(asked(Some(authority)).await, Ok("trusted".into()));
    let strange = asked(None).await;
    assert!(matches!(strange, Err(SendError::Connect(_))), "{strange:?}");
}

#[test]
fn certificates_that_cannot_be_read_make_no_client() {
    let _ = rustls::crypto::ring::default_provider().install_default();
    let pem = "-----BEGIN CERTIFICATE-----\n?\n-----END CERTIFICATE-----\n";
    let built = ReqwestFactory.build(ClientOptions {
        authorities: Some(pem.into()),
        ..options()
    });
    let error = built.err().unwrap();
    assert!(matches!(error, ClientError::Authorities(_)), "{error:?}");
}
