//! Requests to other programs: the traits of an HTTP client, which whoever starts the service hands in.
//!
//! A [`ClientFactory`] makes an [`HttpClient`] for each purpose, by its [`ClientOptions`]: webhooks, archives, the
//! issuer of tokens, the collector of traces. Requests and responses are those of the crate `http`; the body of a
//! response is a stream, read as far as the reader's limit allows. The crate `ventriform-http-client` implements both
//! traits.
//!
//! Guaranteed by every implementation: connections follow the options, and proxies are those of these; with a
//! [`Resolver`], only the addresses that it gives are connected to; no `Referer` is sent; errors name no URL, which may
//! hold secrets.

use async_trait::async_trait;
use bytes::Bytes;
use futures::StreamExt;
use futures::stream::BoxStream;
use http::{Request, Response, Uri};
use std::fmt::Debug;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use url::Url;

/// The name of this program in requests that carry one.
pub const USER_AGENT: &str = concat!("ventriform/", env!("CARGO_PKG_VERSION"));

/// The body of a response, piece by piece as it comes.
pub type ByteStream = BoxStream<'static, Result<Bytes, SendError>>;

/// Why a request got no response, or no whole one. The texts name no URL.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SendError {
    /// A time limit of the [`ClientOptions`] has passed.
    #[error("it did not answer in time")]
    Timeout,
    /// There is no connection: the name has no address, nothing listens there, or TLS failed.
    #[error("it cannot be reached: {0}")]
    Connect(String),
    /// It redirects more often than allowed.
    #[error("it redirects too often")]
    Redirect,
    /// The connection broke off within a body.
    #[error("the connection broke off: {0}")]
    Body(String),
    /// The request cannot be sent as it is, or the other side does not speak HTTP.
    #[error("the request failed: {0}")]
    Request(String),
}

/// Why a client cannot be made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ClientError {
    /// [`ClientOptions::authorities`] are no certificates.
    #[error("the certificates cannot be read: {0}")]
    Authorities(String),
    /// The client's cryptography or the system's certificates cannot be used.
    #[error("{0}")]
    Client(String),
}

/// Sends requests.
#[async_trait]
pub trait HttpClient: Debug + Send + Sync {
    /// Sends a request, and returns the response when its headers have come, whatever its status is.
    ///
    /// # Errors
    /// If there is no response.
    async fn send(&self, request: Request<Bytes>) -> Result<Response<ByteStream>, SendError>;
}

/// Makes clients.
pub trait ClientFactory: Send + Sync {
    /// A client that connects as the options say. Reading the system's certificates takes time: see [`build_client`].
    ///
    /// # Errors
    /// If the certificates or the system's cryptography cannot be used.
    fn build(&self, options: ClientOptions) -> Result<Arc<dyn HttpClient>, ClientError>;
}

/// Names and the only addresses that a client may connect to. Addresses in URLs are connected to as they are.
pub trait Resolver: Debug + Send + Sync {
    /// The addresses of a host; `None` if it must not be connected to.
    fn resolve(&self, host: &str) -> Option<Vec<SocketAddr>>;
}

/// Which redirects a client follows. A response that is not followed is returned as it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Redirects {
    /// None.
    Never,
    /// So many at most, to the scheme, host and port of the request alone.
    WithinOrigin(usize),
    /// So many, to anywhere; one more is a [`SendError::Redirect`].
    Anywhere(usize),
}

/// The limits and rules of a client.
#[derive(Debug, Clone)]
pub struct ClientOptions {
    /// Certificates (PEM) of authorities that are trusted beside the system's.
    pub authorities: Option<Vec<u8>>,
    /// Longest time to connect.
    pub connect_timeout: Option<Duration>,
    /// Longest pause in a response.
    pub read_timeout: Option<Duration>,
    /// Longest time from the begin of a request to the end of the response's body.
    pub total_timeout: Option<Duration>,
    /// Which redirects are followed.
    pub redirects: Redirects,
    /// Time for which unused connections are kept open; zero keeps none.
    pub idle_timeout: Duration,
    /// Gives the addresses of hosts; `None` asks the system.
    pub resolver: Option<Arc<dyn Resolver>>,
    /// Whether the proxies of the environment (`HTTPS_PROXY` and others) are used.
    pub environment_proxies: bool,
    /// The value of `User-Agent`.
    pub user_agent: Option<&'static str>,
}

impl Default for ClientOptions {
    /// No limits, no redirects, no proxies; the system's names and authorities.
    fn default() -> Self {
        Self {
            authorities: None,
            connect_timeout: None,
            read_timeout: None,
            total_timeout: None,
            redirects: Redirects::Never,
            idle_timeout: Duration::from_secs(90),
            resolver: None,
            environment_proxies: false,
            user_agent: None,
        }
    }
}

/// Makes a client on a thread of its own, so that the runtime's threads do not wait for the system's certificates.
///
/// # Errors
/// If the certificates or the system's cryptography cannot be used.
pub async fn build_client(
    factory: Arc<dyn ClientFactory>,
    options: ClientOptions,
) -> Result<Arc<dyn HttpClient>, ClientError> {
    let built = tokio::task::spawn_blocking(move || factory.build(options)).await;
    built.map_err(|error| ClientError::Client(error.to_string()))?
}

/// The address of an absolute URL, written as RFC 3986 wants it: other characters are encoded, names are ASCII.
///
/// # Errors
/// If it is no absolute URL.
pub fn request_uri(url: &str) -> Result<Uri, SendError> {
    let url = Url::parse(url).map_err(|error| SendError::Request(error.to_string()))?;
    let uri = Uri::try_from(url.as_str());
    uri.map_err(|error| SendError::Request(error.to_string()))
}

/// The bytes of a body; `None` if it has more than `most`.
///
/// # Errors
/// If the connection breaks off or a time limit passes.
pub async fn bounded_body(mut body: ByteStream, most: usize) -> Result<Option<Vec<u8>>, SendError> {
    let mut bytes = Vec::new();
    while let Some(piece) = body.next().await {
        let piece = piece?;
        if bytes.len() + piece.len() > most {
            return Ok(None);
        }
        bytes.extend_from_slice(&piece);
    }
    Ok(Some(bytes))
}

/// A client for tests, which sends nothing.
#[cfg(test)]
pub mod fake {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A factory, and the only client that it makes.
    #[derive(Debug, Clone, Default)]
    pub struct FakeClient {
        /// The requests that were sent.
        pub requests: Arc<AtomicUsize>,
        /// Whether requests fail at once; else they wait for ever.
        pub unreachable: bool,
    }

    #[async_trait]
    impl HttpClient for FakeClient {
        async fn send(&self, _: Request<Bytes>) -> Result<Response<ByteStream>, SendError> {
            self.requests.fetch_add(1, Ordering::SeqCst);
            if !self.unreachable {
                futures::future::pending::<()>().await;
            }
            Err(SendError::Connect("nothing listens there".into()))
        }
    }

    impl ClientFactory for FakeClient {
        fn build(&self, _: ClientOptions) -> Result<Arc<dyn HttpClient>, ClientError> {
            Ok(Arc::new(self.clone()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::stream;

    #[test]
    fn addresses_are_written_as_requests_need_them() {
        for (url, uri) in [
            ("https://pacs.example", "https://pacs.example/"),
            (
                "http://Bücher.example/dicom web?a=ä",
                "http://xn--bcher-kva.example/dicom%20web?a=%C3%A4",
            ),
            ("https://[::1]:8443/a/../b", "https://[::1]:8443/b"),
            ("https://0x7f.1/", "https://127.0.0.1/"),
        ] {
            assert_eq!(request_uri(url).unwrap().to_string(), uri, "{url}");
        }
        for odd in ["", "/studies", "https://"] {
            let refused = request_uri(odd);
            assert!(matches!(refused, Err(SendError::Request(_))), "{odd}");
        }
    }

    #[tokio::test]
    async fn a_body_is_read_up_to_its_limit_and_to_its_first_error() {
        let body = |end: Option<SendError>| {
            let pieces = [Ok(Bytes::from("one")), Ok(Bytes::from("two"))];
            stream::iter(pieces.into_iter().chain(end.map(Err))).boxed()
        };
        let whole = bounded_body(body(None), 6).await.unwrap();
        assert_eq!(whole.as_deref(), Some(&b"onetwo"[..]));
        assert_eq!(bounded_body(body(None), 5).await, Ok(None));
        let broken = Some(SendError::Timeout);
        let read = bounded_body(body(broken), 6).await;
        assert_eq!(read, Err(SendError::Timeout));
    }
}
