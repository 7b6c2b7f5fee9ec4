//! An S3 store in the test's process (s3s-fs), and a proxy before it that fails as networks do.
//!
//! With `VENTRIFORM_TEST_S3`, the tests use the store at that address instead, which must have the
//! bucket `hearts` (scripts/check/s3.sh).

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures::{StreamExt, TryStreamExt, stream};
use hyper_util::rt::TokioIo;
use object_store::aws::{AmazonS3, AmazonS3Builder};
use object_store::path::Path as Key;
use object_store::{ClientOptions, ObjectStore, ObjectStoreExt};
use s3s::auth::SimpleAuth;
use s3s::service::S3ServiceBuilder;
use s3s_fs::FileSystem;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;
use tempfile::TempDir;
use tokio::net::TcpListener;
use ventriform_service::config::{AwsVariables, Settings};
use ventriform_store::S3Location;

/// The bucket that exists.
pub const BUCKET_NAME: &str = "hearts";

const ACCESS_KEY: &str = "test-key";
const SECRET_KEY: &str = "test-secret";

/// The variables for a store.
pub fn variables(url: &str, secret: &str) -> Vec<(String, String)> {
    let all = [
        ("AWS_ENDPOINT_URL", url),
        ("AWS_ACCESS_KEY_ID", ACCESS_KEY),
        ("AWS_SECRET_ACCESS_KEY", secret),
        ("AWS_REGION", "us-east-1"),
    ];
    all.map(|(name, value)| (name.to_owned(), value.to_owned()))
        .to_vec()
}

/// Puts the files of a service into a part of the bucket of its own at `VENTRIFORM_TEST_S3`.
pub fn keep_files_in_bucket(settings: &mut Settings) {
    let url = std::env::var("VENTRIFORM_TEST_S3").unwrap();
    let folder = settings.data_dir.file_name().unwrap().to_str().unwrap();
    let prefix = folder.trim_start_matches('.');
    settings.blobs = format!("s3://{BUCKET_NAME}/{prefix}").parse().unwrap();
    settings.aws = AwsVariables(variables(&url, SECRET_KEY));
}

/// A running store.
pub struct S3Server {
    pub url: String,
    /// Whether it refuses strangers.
    pub is_strict: bool,
    _root: TempDir,
}

impl S3Server {
    pub async fn start() -> Self {
        let root = tempfile::tempdir().unwrap();
        if let Ok(url) = std::env::var("VENTRIFORM_TEST_S3") {
            return Self {
                url,
                is_strict: false,
                _root: root,
            };
        }
        std::fs::create_dir(root.path().join(BUCKET_NAME)).unwrap();
        let mut builder = S3ServiceBuilder::new(FileSystem::new(root.path()).unwrap());
        builder.set_auth(SimpleAuth::from_single(ACCESS_KEY, SECRET_KEY));
        let service = builder.build();
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        tokio::spawn(async move {
            while let Ok((socket, _)) = listener.accept().await {
                let service = service.clone();
                tokio::spawn(async move {
                    let http = hyper::server::conn::http1::Builder::new();
                    let _ = http.serve_connection(TokioIo::new(socket), service).await;
                });
            }
        });
        Self {
            url,
            is_strict: true,
            _root: root,
        }
    }

    /// The bucket's part with that prefix, reached at `url`.
    pub fn location_at(url: &str, prefix: &str) -> S3Location {
        S3Location {
            bucket: BUCKET_NAME.into(),
            prefix: prefix.into(),
            variables: variables(url, SECRET_KEY),
        }
    }

    /// The bucket's part with that prefix.
    pub fn location(&self, prefix: &str) -> S3Location {
        Self::location_at(&self.url, prefix)
    }

    /// The keys below a prefix.
    pub async fn keys(&self, prefix: &str) -> Vec<String> {
        let store = client(&self.location(""));
        let listed = store.list(Some(&Key::from(prefix)));
        let found: Vec<_> = listed.try_collect().await.unwrap();
        found
            .into_iter()
            .map(|file| file.location.to_string())
            .collect()
    }

    /// Copies every key below a prefix to below another one.
    pub async fn copy_all(&self, from: &str, to: &str) {
        let store = client(&self.location(""));
        for key in self.keys(from).await {
            let below = key.strip_prefix(from).unwrap();
            let content = store.get(&Key::from(key.as_str())).await.unwrap();
            let content = content.bytes().await.unwrap();
            let target = Key::from(format!("{to}{below}"));
            store.put(&target, content.into()).await.unwrap();
        }
    }

    /// Writes to a key.
    pub async fn write(&self, key: &str, content: &'static [u8]) {
        let store = client(&self.location(""));
        store.put(&Key::from(key), content.into()).await.unwrap();
    }
}

/// A client that knows nothing of the service.
fn client(location: &S3Location) -> AmazonS3 {
    ventriform_http::install_cryptography();
    let mut builder = AmazonS3Builder::new().with_bucket_name(&location.bucket);
    for (name, value) in &location.variables {
        let key = name.to_lowercase().parse().unwrap();
        builder = builder.with_config(key, value);
    }
    let http = ClientOptions::new().with_allow_http(true);
    builder.with_client_options(http).build().unwrap()
}

/// The proxy's treatment of requests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub enum Network {
    /// All is well.
    Whole,
    /// Half of the requests fail in one way or another.
    Failing,
    /// No request gets an answer other than 503.
    Away,
}

/// A proxy before a store.
#[derive(Clone)]
pub struct FaultProxy {
    pub url: String,
    state: Arc<ProxyState>,
}

struct ProxyState {
    upstream: String,
    network: AtomicUsize,
    requests: AtomicU64,
    faults: AtomicU64,
    client: reqwest::Client,
}

/// The fault of one request.
#[derive(Clone, Copy)]
enum Fault {
    Error(StatusCode),
    Slow,
    CutOffRequest,
    CutOffAnswer,
    LostAnswer,
}

impl ProxyState {
    /// The fate of the next request: the same sequence in each run of a test.
    fn fate(&self) -> Option<Fault> {
        let number = self.requests.fetch_add(1, Ordering::Relaxed);
        let network = self.network.load(Ordering::Relaxed);
        if network == Network::Whole as usize {
            return None;
        }
        self.faults.fetch_add(1, Ordering::Relaxed);
        if network == Network::Away as usize {
            return Some(Fault::Error(StatusCode::SERVICE_UNAVAILABLE));
        }
        let random = number.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 60;
        Some(match random {
            0 | 1 => Fault::Error(StatusCode::INTERNAL_SERVER_ERROR),
            2 => Fault::Error(StatusCode::SERVICE_UNAVAILABLE),
            3 => Fault::Slow,
            4 | 5 => Fault::CutOffRequest,
            6 => Fault::CutOffAnswer,
            7 => Fault::LostAnswer,
            _ => return None,
        })
    }
}

fn cut_off(content: &Bytes) -> Body {
    let half = content.slice(..content.len() / 2);
    let rest = stream::iter([Err(io::Error::from(io::ErrorKind::ConnectionReset))]);
    Body::from_stream(stream::iter([Ok(half)]).chain(rest))
}

async fn relay(State(state): State<Arc<ProxyState>>, request: Request) -> Response {
    let fault = state.fate();
    if let Some(Fault::Error(status)) = fault {
        return status.into_response();
    }
    if let Some(Fault::Slow) = fault {
        tokio::time::sleep(Duration::from_millis(300)).await;
    }
    let (head, body) = request.into_parts();
    let Ok(content) = axum::body::to_bytes(body, 64 << 20).await else {
        return StatusCode::BAD_REQUEST.into_response();
    };
    let path = head.uri.path_and_query().map_or("/", |path| path.as_str());
    let to = format!("{}{path}", state.upstream);
    let mut request = state.client.request(head.method, to).headers(head.headers);
    request = match fault {
        Some(Fault::CutOffRequest) => {
            let half = content.slice(..content.len() / 2);
            let broken = Err(io::Error::from(io::ErrorKind::ConnectionReset));
            let pieces = stream::iter([Ok(half), broken]);
            request.body(reqwest::Body::wrap_stream(pieces))
        }
        _ => request.body(content),
    };
    let Ok(answer) = request.send().await else {
        return StatusCode::BAD_GATEWAY.into_response();
    };
    let (status, headers): (_, HeaderMap) = (answer.status(), answer.headers().clone());
    let content = answer.bytes().await.unwrap_or_default();
    let body = match fault {
        Some(Fault::LostAnswer) => return StatusCode::BAD_GATEWAY.into_response(),
        Some(Fault::CutOffAnswer) if content.len() > 1 => cut_off(&content),
        _ => Body::from(content),
    };
    let mut response = (status, body).into_response();
    for (name, value) in headers
        .iter()
        .filter(|(name, _)| **name != header::TRANSFER_ENCODING)
    {
        response.headers_mut().insert(name, value.clone());
    }
    response
}

impl FaultProxy {
    /// A proxy that lets everything pass.
    pub async fn before(upstream: &str) -> Self {
        ventriform_http::install_cryptography();
        let state = Arc::new(ProxyState {
            upstream: upstream.to_owned(),
            network: AtomicUsize::new(Network::Whole as usize),
            requests: AtomicU64::new(0),
            faults: AtomicU64::new(0),
            client: reqwest::Client::new(),
        });
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let router = Router::new().fallback(relay).with_state(state.clone());
        tokio::spawn(async move { axum::serve(listener, router).await });
        Self { url, state }
    }

    /// From now on the network is like that.
    pub fn set(&self, network: Network) {
        let network = network as usize;
        self.state.network.store(network, Ordering::Relaxed);
    }

    /// Number of requests that were considered for a fault.
    pub fn considered(&self) -> u64 {
        self.state.faults.load(Ordering::Relaxed)
    }
}
