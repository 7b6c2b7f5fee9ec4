//! Headers that tell browsers what a page of this service may do, and who may use the service from
//! another site.

use super::hosts::ANY_HOST;
use axum::http::{HeaderName, HeaderValue, Method, header};
use axum::response::Response;
use std::time::Duration;
use tower_http::cors::{AllowOrigin, CorsLayer};
use ventriform_service::config::{Settings, Words};

/// The policy of answers that have none of their own: they are data, so nothing in them may run.
const DATA_POLICY: &str =
    "default-src 'none'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

/// Reports carry a policy of their own, with the hashes of their style and script; they are files
/// that also work without the service. What a file cannot say of itself is who may frame it.
const REPORT_POLICY: &str = "frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

/// Pictures have styles and nothing else.
const PICTURE_POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'; \
    base-uri 'none'; form-action 'none'";

/// Instruction to browsers where TLS is spoken: for a year, ask by https only.
const STRICT_TRANSPORT: &str = "max-age=31536000";

/// The headers of requests that a page of another site may set: all that the service reads.
pub const ACCEPTED_HEADERS: [&str; 16] = [
    "accept",
    "authorization",
    "cache-control",
    "content-type",
    "idempotency-key",
    "if-match",
    "if-none-match",
    "if-range",
    "last-event-id",
    "prefer",
    "range",
    "traceparent",
    "tracestate",
    "transaction-uid",
    "webhook-secret",
    "x-request-id",
];

/// The headers of answers that such a page may read: all that the service sets for clients.
pub const EXPOSED_HEADERS: [&str; 19] = [
    "accept-ranges",
    "allow",
    "content-disposition",
    "content-encoding",
    "content-length",
    "content-location",
    "content-range",
    "date",
    "etag",
    "location",
    "preference-applied",
    "ratelimit",
    "ratelimit-policy",
    "retry-after",
    "traceparent",
    "upload-limit",
    "warning",
    "www-authenticate",
    "x-request-id",
];

/// Headers of an answer that the layers add: here, its limits, its date and its id.
const ADDED_HEADERS: usize = 12;

/// Time for which browsers may remember the answer to a preflight.
const PREFLIGHT_AGE: Duration = Duration::from_secs(600);

/// The answer with the headers; `tls` says whether the service speaks TLS.
pub fn protected(mut response: Response, tls: bool) -> Response {
    let headers = response.headers_mut();
    headers.reserve(ADDED_HEADERS);
    if !headers.contains_key(header::CONTENT_SECURITY_POLICY) {
        let media_type = headers.get(header::CONTENT_TYPE);
        let media_type = media_type.and_then(|value| value.to_str().ok());
        let policy = match media_type.unwrap_or_default() {
            kind if kind.starts_with("text/html") => REPORT_POLICY,
            kind if kind.starts_with("image/svg") => PICTURE_POLICY,
            _ => DATA_POLICY,
        };
        let policy = HeaderValue::from_static(policy);
        headers.insert(header::CONTENT_SECURITY_POLICY, policy);
    }
    let mut add = |name: HeaderName, value: &'static str| {
        headers
            .entry(name)
            .or_insert(HeaderValue::from_static(value));
    };
    add(header::X_CONTENT_TYPE_OPTIONS, "nosniff");
    add(header::X_FRAME_OPTIONS, "DENY");
    // A path may hold an id; it is of no concern to other sites.
    add(header::REFERRER_POLICY, "no-referrer");
    add(
        HeaderName::from_static("cross-origin-resource-policy"),
        "same-site",
    );
    add(
        HeaderName::from_static("permissions-policy"),
        "camera=(), geolocation=(), microphone=()",
    );
    if tls {
        add(header::STRICT_TRANSPORT_SECURITY, STRICT_TRANSPORT);
    }
    response
}

/// The layer that lets pages of other sites use the service; `None` if no site may.
pub fn cors(settings: &Settings) -> Option<CorsLayer> {
    let origins = allowed(&settings.cors_origins)?;
    Some(
        CorsLayer::new()
            .allow_origin(origins)
            .allow_methods([
                Method::GET,
                Method::HEAD,
                Method::POST,
                Method::PUT,
                Method::PATCH,
                Method::DELETE,
            ])
            .allow_headers(ACCEPTED_HEADERS.map(HeaderName::from_static))
            .expose_headers(EXPOSED_HEADERS.map(HeaderName::from_static))
            .max_age(PREFLIGHT_AGE),
    )
}

fn allowed(origins: &Words) -> Option<AllowOrigin> {
    if origins.iter().any(|origin| origin == ANY_HOST) {
        return Some(AllowOrigin::any());
    }
    let values: Vec<_> = origins
        .iter()
        .filter_map(|origin| HeaderValue::try_from(origin).ok())
        .collect();
    (!values.is_empty()).then(|| AllowOrigin::list(values))
}
