//! `Idempotency-Key` (draft-ietf-httpapi-idempotency-key-header-07).

use super::problem::{Answer, Problem};
use crate::jobs::{Idempotency, JobWebhook, content_id};
use axum::http::{HeaderMap, HeaderName};
use serde_json::{Map, Value, json};

/// The header's name.
pub const HEADER: HeaderName = HeaderName::from_static("idempotency-key");

const LONGEST: usize = 255;

/// The key of a request, if it has one. The draft's quoted form and a bare token are equal.
pub fn key(headers: &HeaderMap) -> Answer<Option<String>> {
    let Some(value) = headers.get(HEADER) else {
        return Ok(None);
    };
    let key = value.to_str().unwrap_or_default().trim().trim_matches('"');
    if key.is_empty() || key.len() > LONGEST {
        return Err(Problem::bad_request(
            "invalid-idempotency-key",
            format!("The key must have 1 to {LONGEST} visible ASCII characters."),
        )
        .at("Idempotency-Key")
        .fix("Send a random UUID as the key."));
    }
    Ok(Some(key.to_owned()))
}

/// The key with a fingerprint of the request that it stands for.
pub fn promise(
    key: Option<String>,
    kind: &str,
    volume: &str,
    parameters: &Map<String, Value>,
    webhook: Option<&JobWebhook>,
) -> Option<Idempotency> {
    let parameters = Value::Object(parameters.clone()).to_string();
    let webhook = webhook.map(|webhook| json!(webhook).to_string());
    let parts = [kind, volume, &parameters];
    let parts = parts.into_iter().chain(webhook.as_deref());
    Some(Idempotency {
        key: key?,
        fingerprint: content_id("", parts.map(str::as_bytes)),
    })
}
