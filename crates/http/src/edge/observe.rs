//! The trace of a request for operators: its id and trace, one line in the log, and the count of
//! answers. The functions here are called by the layers that [`crate::router`] lists.
//!
//! The log shows the pattern of a path and never the path itself, because ids lead to patients.

use crate::app::App;
use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, Response, StatusCode};
use axum::middleware::Next;
use axum::response::Response as AxumResponse;
use hyper::body::{Frame, SizeHint};
use prometheus::IntCounter;
use std::cell::Cell;
use std::hash::{BuildHasher, RandomState};
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tower_http::request_id::{MakeRequestId, RequestId};
use tower_http::trace::{MakeSpan, OnResponse};
use tracing::Span;
use ventriform_service::telemetry::RequestMetrics;

/// The header with the id of a request, and of its answer.
pub const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// The header of W3C trace contexts.
const TRACE_PARENT: HeaderName = HeaderName::from_static("traceparent");

/// Longest request id that is taken over from a client.
const LONGEST_ID: usize = 128;

/// Removes a client's request id if it is empty, long, or not plain text without spaces.
pub fn drop_unusable_id<B>(mut request: axum::http::Request<B>) -> axum::http::Request<B> {
    let usable = |id: &str| (1..=LONGEST_ID).contains(&id.len()) && !id.contains(' ');
    let id = request.headers().get(REQUEST_ID);
    if !id.is_some_and(|value| value.to_str().is_ok_and(usable)) {
        request.headers_mut().remove(REQUEST_ID);
    }
    request
}

/// Makes request ids that sort by time, to a millisecond. They tell requests apart and are no secrets: what they have
/// of chance comes from a key that each thread draws once, where `Uuid::now_v7` asks the system twice for each.
#[derive(Debug, Clone, Copy)]
pub struct TimeOrderedId;

impl MakeRequestId for TimeOrderedId {
    fn make_request_id<B>(&mut self, _: &axum::http::Request<B>) -> Option<RequestId> {
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        let milliseconds = since.unwrap_or_default().as_millis() as u64;
        let id = uuid::Builder::from_unix_timestamp_millis(milliseconds, &by_chance()).into_uuid();
        let mut text = uuid::Uuid::encode_buffer();
        let text = id.as_hyphenated().encode_lower(&mut text);
        HeaderValue::from_str(text).ok().map(RequestId::new)
    }
}

/// Ten bytes that no other call gives, but by chance.
fn by_chance() -> [u8; 10] {
    thread_local! {
        /// A key of this thread, and the number of bytes drawn by it.
        static KEY: (RandomState, Cell<u64>) = (RandomState::new(), Cell::new(0));
    }
    KEY.with(|(key, drawn)| {
        let first = drawn.get();
        drawn.set(first.wrapping_add(2));
        let halves = [first, first.wrapping_add(1)].map(|n| key.hash_one(n).to_le_bytes());
        std::array::from_fn(|n| halves.as_flattened()[n])
    })
}

/// Continues the client's trace with a span of our own, and names both in the answer. If spans are
/// sent to a collector, a request without a trace begins one.
async fn continue_trace(app: &App, mut request: Request, next: Next) -> AxumResponse {
    let given = Trace::from_headers(request.headers());
    let route = request.extensions().get::<MatchedPath>();
    let span = app.service.spans().request(
        method_of(&request),
        route.map_or(NO_ROUTE, MatchedPath::as_str),
        given
            .as_ref()
            .map(|_| request.headers())
            .and_then(|headers| {
                let parent = headers.get(TRACE_PARENT)?;
                parent.to_str().ok()
            }),
    );
    let trace = match &span {
        Some(span) => Trace::continued_by(&span.trace_parent()),
        None => given,
    };
    let Some(trace) = trace else {
        return next.run(request).await;
    };
    let parent = HeaderValue::try_from(&trace.parent);
    request.extensions_mut().insert(trace);
    let mut response = next.run(request).await;
    if let Some(span) = span {
        span.end(response.status().as_u16());
    }
    if let Ok(parent) = parent {
        response.headers_mut().insert(TRACE_PARENT, parent);
    }
    response
}

/// A W3C trace context of version 00.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Trace {
    /// The trace's id: 32 hexadecimal digits.
    id: String,
    /// The header by which our answer continues the trace.
    parent: String,
}

impl Trace {
    /// The trace that a span of ours belongs to.
    fn continued_by(parent: &str) -> Option<Self> {
        let id = parent.split('-').nth(1)?;
        Some(Self {
            id: id.to_owned(),
            parent: parent.to_owned(),
        })
    }

    /// The client's trace, if the header is valid.
    fn from_headers(headers: &HeaderMap) -> Option<Self> {
        let text = headers.get(TRACE_PARENT)?.to_str().ok()?;
        let [version, id, parent, flags] = text.split('-').collect::<Vec<_>>()[..] else {
            return None;
        };
        let hex = |text: &str, length: usize| {
            let digit = |b: u8| b.is_ascii_digit() || (b'a'..=b'f').contains(&b);
            text.len() == length && text.bytes().all(digit)
        };
        let valid = version == "00"
            && hex(id, 32)
            && hex(parent, 16)
            && hex(flags, 2)
            && id.bytes().any(|b| b != b'0');
        let span = uuid::Uuid::new_v4().simple().to_string();
        valid.then(|| Self {
            id: id.to_owned(),
            parent: format!("00-{id}-{}-{flags}", &span[..16]),
        })
    }
}

/// The trace context that continues in what the request starts.
pub fn trace_parent(request: &Request) -> Option<String> {
    let trace = request.extensions().get::<Trace>();
    trace.map(|trace| trace.parent.clone())
}

/// The span of a request in the log.
#[derive(Debug, Clone, Copy)]
pub struct RequestSpan;

impl<B> MakeSpan<B> for RequestSpan {
    fn make_span(&mut self, request: &axum::http::Request<B>) -> Span {
        let extensions = request.extensions();
        let id = extensions.get::<RequestId>();
        let id = id.and_then(|id| id.header_value().to_str().ok());
        let trace = extensions.get::<Trace>().map(|trace| trace.id.as_str());
        let path = extensions.get::<MatchedPath>().map(MatchedPath::as_str);
        tracing::info_span!(
            "request",
            id,
            trace,
            method = %request.method(),
            path = path.unwrap_or("-"),
        )
    }
}

/// Logs every answer.
#[derive(Debug, Clone, Copy)]
pub struct Answered;

impl<B> OnResponse<B> for Answered {
    fn on_response(self, response: &Response<B>, latency: Duration, _: &Span) {
        let status = response.status();
        let ms = latency.as_millis() as u64;
        tracing::info!(status = status.as_u16(), ms, "answered");
    }
}

/// The route of requests to paths that do not exist.
const NO_ROUTE: &str = "none";

/// The method in metrics: a client may send any word.
fn method_of(request: &Request) -> &'static str {
    match *request.method() {
        Method::GET => "GET",
        Method::HEAD => "HEAD",
        Method::POST => "POST",
        Method::PUT => "PUT",
        Method::PATCH => "PATCH",
        Method::DELETE => "DELETE",
        Method::OPTIONS => "OPTIONS",
        _ => "other",
    }
}

/// The layer that counts a request, its answer and their bodies, and times the answer; in it, the client's trace is
/// continued.
pub async fn measure(State(app): State<App>, request: Request, next: Next) -> AxumResponse {
    let method = method_of(&request);
    let metrics = app.service.request_metrics();
    let waiting = Waiting {
        metrics: metrics.clone(),
        since: Instant::now(),
        answered: false,
        id: request.extensions().get::<RequestId>().cloned(),
        method,
        route: request.extensions().get::<MatchedPath>().cloned(),
    };
    metrics.in_flight.inc();
    let request = request.map(|body| CountedBody::around(body, &metrics.received));
    let response = continue_trace(&app, request, next).await;
    waiting.end(response.status());
    response.map(|body| CountedBody::around(body, &metrics.sent))
}

/// A request without an answer. Dropping it means that the client went away.
struct Waiting {
    metrics: RequestMetrics,
    since: Instant,
    answered: bool,
    id: Option<RequestId>,
    method: &'static str,
    route: Option<MatchedPath>,
}

impl Waiting {
    fn route(&self) -> &str {
        self.route.as_ref().map_or(NO_ROUTE, MatchedPath::as_str)
    }

    fn end(mut self, status: StatusCode) {
        self.answered = true;
        let (method, route) = (self.method, self.route());
        let answers = &self.metrics.answers;
        answers
            .with_label_values(&[method, route, status.as_str()])
            .inc();
        let class = match status.as_u16() / 100 {
            1 => "1xx",
            2 => "2xx",
            3 => "3xx",
            4 => "4xx",
            _ => "5xx",
        };
        let durations = &self.metrics.durations;
        durations
            .with_label_values(&[method, route, class])
            .observe(self.since.elapsed().as_secs_f64());
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        self.metrics.in_flight.dec();
        if !self.answered {
            self.metrics.abandoned.inc();
            let id = self.id.as_ref();
            let id = id.and_then(|id| id.header_value().to_str().ok());
            let (method, path) = (self.method, self.route());
            let ms = self.since.elapsed().as_millis() as u64;
            tracing::info!(
                id,
                method,
                path,
                ms,
                "the client went away before the answer"
            );
        }
    }
}

/// A body whose bytes are counted as they pass.
struct CountedBody {
    body: Body,
    count: IntCounter,
}

impl CountedBody {
    fn around(body: Body, count: &IntCounter) -> Body {
        if body.is_end_stream() {
            return body;
        }
        let count = count.clone();
        Body::new(Self { body, count })
    }
}

impl HttpBody for CountedBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let polled = Pin::new(&mut self.body).poll_frame(context);
        if let Poll::Ready(Some(Ok(frame))) = &polled
            && let Some(data) = frame.data_ref()
        {
            self.count.inc_by(data.len() as u64);
        }
        polled
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn ids_of_requests_differ_on_all_threads_and_sort_by_time() {
        let id = || {
            let made = TimeOrderedId.make_request_id(&Request::new(Body::empty()));
            let text = made.unwrap().header_value().to_str().unwrap().to_owned();
            uuid::Uuid::parse_str(&text).unwrap()
        };
        let thread = || std::thread::spawn(move || (0..2000).map(|_| id()).collect::<Vec<_>>());
        let made: Vec<_> = (0..4).map(|_| thread()).collect();
        let made: Vec<_> = made.into_iter().flat_map(|t| t.join().unwrap()).collect();
        let different: BTreeSet<_> = made.iter().collect();
        assert_eq!(different.len(), made.len());
        assert!(made.iter().all(|id| id.get_version_num() == 7));
        std::thread::sleep(Duration::from_millis(2));
        let last = id();
        assert!(made.iter().all(|id| *id < last));
    }
}
