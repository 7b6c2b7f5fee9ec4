//! `Idempotency-Key` (draft-ietf-httpapi-idempotency-key-header-07).

use super::problem::{Answer, Problem};
use crate::jobs::{Idempotency, JobWebhook, Tags, content_id};
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
    tags: &Tags,
    webhook: Option<&JobWebhook>,
) -> Option<Idempotency> {
    let parameters = Value::Object(parameters.clone()).to_string();
    // What a request does not give is not hashed, so that its fingerprint stays as older versions
    // stored it. A webhook is a JSON object, names are a JSON array: no request is like another.
    let webhook = webhook.map(|webhook| json!(webhook).to_string());
    let names = (*tags != Tags::default()).then(|| json!([tags.external_id, tags.labels]));
    let names = names.map(|names| names.to_string());
    let parts = [kind, volume, &parameters].into_iter();
    let parts = parts.chain(webhook.as_deref()).chain(names.as_deref());
    Some(Idempotency {
        key: key?,
        fingerprint: content_id("", parts.map(str::as_bytes)),
    })
}
