//! One line in the log per request, its id in the answer, its count in the metrics.
//!
//! What is logged of a path is its pattern, never the path: ids lead to patients.

use super::app::App;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, HeaderValue};
use axum::middleware::Next;
use axum::response::Response;
use std::sync::atomic::Ordering;
use std::time::Instant;
use tracing::Instrument;

const REQUEST_ID: &str = "x-request-id";
const TRACE_PARENT: &str = "traceparent";
const LONGEST_ID: usize = 128;

/// Wraps every request.
pub async fn observe(State(app): State<App>, request: Request, next: Next) -> Response {
    let started = Instant::now();
    let id = request_id(request.headers());
    let trace = trace_parent(request.headers());
    let method = request.method().clone();
    let path = request
        .extensions()
        .get::<MatchedPath>()
        .map_or("-", MatchedPath::as_str)
        .to_owned();
    let trace_id = trace.as_deref().map_or("", |parent| &parent[3..35]);
    let span = tracing::info_span!("request", id, trace = trace_id);
    let mut response = next.run(request).instrument(span.clone()).await;
    let status = response.status().as_u16();
    let ms = started.elapsed().as_millis() as u64;
    span.in_scope(|| tracing::debug!(%method, path, status, ms, "answered"));
    if let Some(class) = app.answers.get(usize::from(status / 100).wrapping_sub(1)) {
        class.fetch_add(1, Ordering::Relaxed);
    }
    for (name, value) in [(REQUEST_ID, Some(id)), (TRACE_PARENT, trace)] {
        if let Some(value) = value.and_then(|text| HeaderValue::from_str(&text).ok()) {
            response.headers_mut().insert(name, value);
        }
    }
    response
}

/// The client's id where it is harmless, else a new one.
fn request_id(headers: &HeaderMap) -> String {
    headers
        .get(REQUEST_ID)
        .and_then(|value| value.to_str().ok())
        .filter(|id| !id.is_empty() && id.len() <= LONGEST_ID && !id.contains(' '))
        .map_or_else(|| uuid::Uuid::now_v7().to_string(), str::to_owned)
}

/// W3C trace context: the caller's trace, our own span.
fn trace_parent(headers: &HeaderMap) -> Option<String> {
    let text = headers.get(TRACE_PARENT)?.to_str().ok()?;
    let [version, trace, parent, flags] = text.split('-').collect::<Vec<_>>()[..] else {
        return None;
    };
    let hex = |text: &str, length: usize| {
        text.len() == length
            && text
                .bytes()
                .all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b))
    };
    let sound = version == "00"
        && hex(trace, 32)
        && hex(parent, 16)
        && hex(flags, 2)
        && trace.bytes().any(|b| b != b'0');
    let span = uuid::Uuid::new_v4().simple().to_string();
    sound.then(|| format!("00-{trace}-{}-{flags}", &span[..16]))
}
