//! What operators see of a request: its id and trace, one line in the log, and the count of
//! answers. The functions here are called by the layers that [`super::router`] lists.
//!
//! The log shows the pattern of a path and never the path itself, because ids lead to patients.

use super::app::App;
use axum::extract::{MatchedPath, Request};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Response};
use axum::middleware::Next;
use std::time::Duration;
use tower_http::request_id::{MakeRequestId, RequestId};
use tower_http::trace::{MakeSpan, OnResponse};
use tracing::Span;

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

/// Makes request ids that sort by time.
#[derive(Debug, Clone, Copy)]
pub struct TimeOrderedId;

impl MakeRequestId for TimeOrderedId {
    fn make_request_id<B>(&mut self, _: &axum::http::Request<B>) -> Option<RequestId> {
        let id = uuid::Uuid::now_v7().to_string();
        HeaderValue::try_from(id).ok().map(RequestId::new)
    }
}

/// Continues the client's trace with a span of our own, and names both in the answer.
pub async fn continue_trace(mut request: Request, next: Next) -> axum::response::Response {
    let Some(trace) = Trace::of(request.headers()) else {
        return next.run(request).await;
    };
    let parent = HeaderValue::try_from(&trace.parent);
    request.extensions_mut().insert(trace);
    let mut response = next.run(request).await;
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
    /// The client's trace, if the header is valid.
    fn of(headers: &HeaderMap) -> Option<Self> {
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

/// Logs and counts every answer.
#[derive(Clone)]
pub struct Answered(pub App);

impl<B> OnResponse<B> for Answered {
    fn on_response(self, response: &Response<B>, latency: Duration, _: &Span) {
        let status = response.status();
        let ms = latency.as_millis() as u64;
        tracing::debug!(status = status.as_u16(), ms, "answered");
        self.0.metrics.count_answer(status);
    }
}
