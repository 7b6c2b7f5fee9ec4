//! `GET /`: an HTML page for browsers, a few commands for curl.

use super::negotiate;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{Html, IntoResponse, Response};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use sha2::{Digest, Sha256};
use std::sync::LazyLock;

const PAGE: &str = include_str!("front_page.html");

/// What the page may do: run its own script and style, which are named by their hashes, and call
/// its own service. Nothing comes from elsewhere.
static CONTENT_SECURITY_POLICY: LazyLock<HeaderValue> = LazyLock::new(|| {
    let hash = |start: &str, end: &str| {
        let (_, rest) = PAGE.split_once(start).unwrap_or_default();
        let (text, _) = rest.split_once(end).unwrap_or_default();
        BASE64_STANDARD.encode(Sha256::digest(text.as_bytes()))
    };
    let policy = format!(
        "default-src 'none'; script-src 'sha256-{}'; style-src 'sha256-{}'; img-src 'self'; \
         connect-src 'self'; form-action 'none'; base-uri 'none'; frame-ancestors 'none'",
        hash("<script>", "</script>"),
        hash("<style>", "</style>"),
    );
    HeaderValue::try_from(policy).unwrap_or(HeaderValue::from_static("default-src 'none'"))
});

/// The page if the client prefers HTML, else text.
pub async fn welcome(headers: HeaderMap) -> Response {
    let mut response = match negotiate::best_offer(&headers, &["text/plain", "text/html"]) {
        Some(1) => Html(PAGE).into_response(),
        _ => commands(&base_url(&headers)).into_response(),
    };
    let headers = response.headers_mut();
    headers.insert(
        header::CONTENT_SECURITY_POLICY,
        CONTENT_SECURITY_POLICY.clone(),
    );
    headers.insert(header::VARY, HeaderValue::from_static("accept"));
    response
}

/// The address under which the client reached the service.
fn base_url(headers: &HeaderMap) -> String {
    let host = headers
        .get(header::HOST)
        .and_then(|value| value.to_str().ok())
        .filter(|host| {
            host.bytes()
                .all(|b| b.is_ascii_alphanumeric() || b"-.:[]_".contains(&b))
        })
        .unwrap_or("127.0.0.1:8080");
    format!("http://{host}")
}

fn commands(url: &str) -> String {
    format!(
        "ventriform {version}: surface models of the left ventricle from cardiac SPECT

A model of 150 points, as GLB:
  curl -fsS --data-binary @spect.nii.gz -H 'Prefer: wait=60' -H 'Accept: model/gltf-binary' '{url}/v1/models?points=150' -o lv.glb
The same in the background; the answer names the job:
  curl -fsS --data-binary @spect.nii.gz '{url}/v1/models?points=150'
The wall of the ventricle as mask.nii.gz, found with the best model of the library:
  curl -fsS --data-binary @spect.nii.gz -H 'Prefer: wait=60' '{url}/v1/segmentations?model=auto' -o mask.nii.gz
The jobs and their progress:
  curl -fsS '{url}/v1/jobs'
Stored models and segmentations:
  curl -fsS '{url}/v1/models'; curl -fsS '{url}/v1/segmentations'
The report on a model (or a segmentation) as an HTML page:
  curl -fsS '{url}/v1/models/ID/report.html' -o report.html

All paths: {url}/docs, {url}/openapi.json
",
        version = env!("CARGO_PKG_VERSION"),
    )
}
