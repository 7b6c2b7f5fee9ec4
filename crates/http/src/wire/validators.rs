//! Validators: what `If-None-Match` names is not sent again (RFC 9110, sections 8.8.3 and 13.1.2).
//! That of a JSON answer is strong: the SHA-256 of its bytes.

use crate::wire::problem::{Answer, Problem};
use crate::wire::response_cache::Keep;
use axum::body::Bytes;
use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use sha2::{Digest, Sha256};
use ventriform_service::base::records::hex;

/// Only the client that asked may keep it, and asks each time whether it is still current.
const CACHE_CONTROL: &str = "private, no-cache";

/// JSON and its validator.
#[derive(Debug, Clone)]
pub struct ValidatedJson {
    etag: String,
    body: Bytes,
}

impl ValidatedJson {
    /// The JSON of `body`.
    ///
    /// # Errors
    /// 500 if it cannot be written as JSON.
    pub fn from_body(body: &impl Serialize) -> Answer<Self> {
        let bytes = serde_json::to_vec(body).map_err(Problem::internal)?;
        Ok(Self {
            etag: format!("\"{}\"", hex(&Sha256::digest(&bytes))),
            body: bytes.into(),
        })
    }

    /// 200 with the JSON, or 304 if `If-None-Match` names it.
    pub fn answer(&self, headers: &HeaderMap) -> Response {
        if let Some(unchanged) = not_modified(headers, &self.etag, CACHE_CONTROL) {
            return unchanged;
        }
        let answer = [
            (header::CONTENT_TYPE, "application/json"),
            (header::ETAG, &self.etag),
            (header::CACHE_CONTROL, CACHE_CONTROL),
        ];
        (answer, self.body.clone()).into_response()
    }
}

impl Keep for ValidatedJson {
    fn bytes(&self) -> usize {
        self.etag.len() + self.body.len()
    }
}

/// [`ValidatedJson`] at once.
///
/// # Errors
/// 500 if `body` cannot be written as JSON.
pub fn json(headers: &HeaderMap, body: &impl Serialize) -> Answer {
    Ok(ValidatedJson::from_body(body)?.answer(headers))
}

/// 304 if `If-None-Match` names that validator.
pub fn not_modified(headers: &HeaderMap, etag: &str, cache_control: &str) -> Option<Response> {
    matches_any(headers, &header::IF_NONE_MATCH, etag).then(|| {
        let answer = [
            (header::ETAG, etag.to_owned()),
            (header::CACHE_CONTROL, cache_control.to_owned()),
        ];
        (StatusCode::NOT_MODIFIED, answer).into_response()
    })
}

/// Whether a list of entity tags in the header `name` has `etag`, compared weakly.
pub fn matches_any(headers: &HeaderMap, name: &HeaderName, etag: &str) -> bool {
    headers
        .get_all(name)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
        .map(|tag| tag.trim())
        .any(|tag| tag == "*" || tag.strip_prefix("W/").unwrap_or(tag) == etag)
}
