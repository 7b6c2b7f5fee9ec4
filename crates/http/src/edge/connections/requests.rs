//! The requests of one connection: who sent them, and what the connection waits for meanwhile.

use super::registry::{OpenConnection, Phase};
use super::tls::ClientCertificate;
use crate::wire::client::client_of;
use crate::wire::held_body::HeldBody;
use crate::wire::problem::Problem;
use crate::wire::public_base::{ProxyPolicy, PublicBase};
use axum::Router;
use axum::body::{Body, Bytes, HttpBody};
use axum::http::{HeaderValue, Method, Request, Response, StatusCode, Uri, header};
use axum::response::IntoResponse;
use hyper::body::{Frame, Incoming, SizeHint};
use hyper::service::Service;
use std::cell::RefCell;
use std::convert::Infallible;
use std::net::IpAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::{SystemTime, UNIX_EPOCH};

/// The paths that are answered on every connection.
const FOR_OPERATORS: [&str; 2] = ["/healthz", "/readyz"];

/// The value of `Connection` in the last answer on a connection.
const CLOSE: HeaderValue = HeaderValue::from_static("close");

/// Answers the requests of one connection.
pub struct RequestService {
    /// The routes.
    pub router: Router,
    /// The connection.
    pub connection: Arc<OpenConnection>,
    /// Whether it belongs to the reserve.
    pub reserve: bool,
    /// The address of its other end.
    pub peer: IpAddr,
    /// The proxies whose word is taken, and the path under which they show the service.
    pub proxies: Arc<ProxyPolicy>,
    /// The client's verified certificate.
    pub certificate: Option<Arc<ClientCertificate>>,
    /// Whether a certificate is demanded and the client has none.
    pub lacks_certificate: bool,
}

impl Service<Request<Incoming>> for RequestService {
    type Response = Response<HeldBody<Answering>>;
    type Error = Infallible;
    type Future = Pin<Box<dyn Future<Output = Result<Self::Response, Infallible>> + Send>>;

    fn call(&self, mut request: Request<Incoming>) -> Self::Future {
        let answering = Answering(self.connection.clone());
        self.connection.begin(request.body().is_end_stream());
        let trusted = &self.proxies.trusted;
        let client = client_of(self.peer, request.headers(), trusted);
        let base = PublicBase::from_request(self.peer, request.headers(), &self.proxies);
        if let Some(rest) = self.proxies.base_path.rest_of(request.uri().path()) {
            let rest = with_path(request.uri(), rest);
            *request.uri_mut() = rest;
        }
        if request.method() != Method::GET {
            // Ranges are defined for GET alone (RFC 9110, section 14.2).
            request.headers_mut().remove(header::RANGE);
        }
        if let Some(problem) = self.refusal(request.uri().path()) {
            answering.0.enter(Phase::Answer);
            let mut response = problem.into_response();
            let status = response.status().as_u16();
            tracing::info!(%client, status, "a request was refused before it was routed");
            response.headers_mut().insert(header::CONNECTION, CLOSE);
            return Box::pin(async move {
                Ok(dated(response).map(|body| HeldBody::new(body, answering)))
            });
        }
        let mut request = request.map(|body| {
            let body = ReceivedBody {
                body,
                connection: self.connection.clone(),
            };
            self.connection.enter(if body.is_end_stream() {
                Phase::Answer
            } else {
                Phase::Body
            });
            Body::new(body)
        });
        let extensions = request.extensions_mut();
        extensions.insert(client);
        extensions.insert(base.clone());
        if let Some(certificate) = &self.certificate {
            extensions.insert(certificate.clone());
        }
        let mut router = self.router.clone();
        let answer = tower::Service::call(&mut router, request);
        Box::pin(async move {
            let mut response = base.scope(client.scope(answer)).await?;
            if !answering.0.is_whole() {
                // hyper closes a connection of which a body is unread, and says so to nobody: a client would lose the
                // answer to the request that it sends on it next.
                response.headers_mut().insert(header::CONNECTION, CLOSE);
            }
            Ok(dated(response).map(|body| HeldBody::new(body, answering)))
        })
    }
}

/// The target of a request with another path, which is a part of its own.
fn with_path(target: &Uri, path: &str) -> Uri {
    let path_and_query = match target.query() {
        Some(query) => format!("{path}?{query}"),
        None => path.to_owned(),
    };
    let mut parts = target.clone().into_parts();
    parts.path_and_query = path_and_query.parse().ok();
    Uri::from_parts(parts).unwrap_or_else(|_| target.clone())
}

/// The answer with the time of the system's clock in `Date`. Left to itself, hyper keeps a date until
/// its time is over: after the clock has been set back, for as long as it was ahead.
fn dated(mut response: Response<Body>) -> Response<Body> {
    thread_local! {
        /// The last second in which this thread has answered, since 1970, and its date.
        static LAST_DATE: RefCell<Option<(u64, HeaderValue)>> = const { RefCell::new(None) };
    }
    let now = SystemTime::now();
    let second = now
        .duration_since(UNIX_EPOCH)
        .map_or(0, |age| age.as_secs());
    LAST_DATE.with_borrow_mut(|last| {
        if last.as_ref().is_none_or(|(of, _)| *of != second) {
            let date = HeaderValue::try_from(httpdate::fmt_http_date(now)).ok();
            *last = date.map(|date| (second, date));
        }
        if let Some((_, date)) = last {
            response.headers_mut().insert(header::DATE, date.clone());
        }
    });
    response
}

impl RequestService {
    /// Why a request for `path` is not even routed.
    fn refusal(&self, path: &str) -> Option<Problem> {
        if FOR_OPERATORS.contains(&path) {
            return None;
        }
        if self.reserve {
            let full = Problem::new(
                StatusCode::SERVICE_UNAVAILABLE,
                "too-many-connections",
                "The service has as many connections as it may have, in all or of one client.",
            );
            return Some(full.header(header::RETRY_AFTER, "1").fix(
                "Use fewer connections at the same time, or ask the operator to raise \
                 connection_limit or client_connection_limit.",
            ));
        }
        self.lacks_certificate.then(|| {
            Problem::new(
                StatusCode::FORBIDDEN,
                "client-certificate-required",
                "The connection has no client certificate.",
            )
            .fix("Connect with a certificate of an authority that the operator has named.")
        })
    }
}

/// While this exists, the connection's request is not answered completely.
pub struct Answering(Arc<OpenConnection>);

impl Drop for Answering {
    fn drop(&mut self) {
        self.0.answered();
    }
}

/// The body of a request. When it has been received, or nobody wants the rest, the connection
/// waits for the answer.
struct ReceivedBody {
    body: Incoming,
    connection: Arc<OpenConnection>,
}

impl HttpBody for ReceivedBody {
    type Data = Bytes;
    type Error = hyper::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, hyper::Error>>> {
        let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
        if self.body.is_end_stream() || frame.is_none() {
            self.connection.received_whole();
        }
        if self.body.is_end_stream() || !matches!(frame, Some(Ok(_))) {
            self.connection.leave(Phase::Body, Phase::Answer);
        }
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

impl Drop for ReceivedBody {
    fn drop(&mut self) {
        self.connection.leave(Phase::Body, Phase::Answer);
    }
}
