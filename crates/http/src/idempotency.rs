//! `Idempotency-Key` (draft-ietf-httpapi-idempotency-key-header-07).

use super::problem::{Answer, Problem};
use axum::http::{HeaderMap, HeaderName};
use serde_json::{Map, Value, json};
use ventriform_service::records::{Idempotency, Tags, content_id};

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

/// The key with a fingerprint of the request that it stands for. `others` are the objects that
/// the request gives besides.
pub fn promise(
    key: Option<String>,
    kind: &str,
    volume: Option<&str>,
    parameters: &Map<String, Value>,
    tags: &Tags,
    others: &[Value],
) -> Option<Idempotency> {
    let parameters = Value::Object(parameters.clone()).to_string();
    // What a request does not give is not hashed, so that its fingerprint stays as older versions
    // stored it. The others are JSON objects with different fields, names are a JSON array: no
    // request is like another.
    let others: Vec<String> = others.iter().map(Value::to_string).collect();
    let names = (*tags != Tags::default()).then(|| json!([tags.external_id, tags.labels]));
    let names = names.map(|names| names.to_string());
    let parts = [kind, volume.unwrap_or_default(), &parameters].into_iter();
    let parts = parts.chain(others.iter().map(String::as_str));
    let parts = parts.chain(names.as_deref());
    Some(Idempotency {
        key: key?,
        fingerprint: content_id("", parts.map(str::as_bytes)),
    })
}
