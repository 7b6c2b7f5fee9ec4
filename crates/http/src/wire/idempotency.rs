//! `Idempotency-Key` (draft-ietf-httpapi-idempotency-key-header-07).

use crate::wire::problem::{Answer, Problem};
use axum::http::{HeaderMap, HeaderName};

/// The header's name.
pub const KEY_HEADER: HeaderName = HeaderName::from_static("idempotency-key");

const KEY_LENGTH: usize = 255;

/// The key of a request, if it has one. The draft's quoted form and a bare token are equal.
pub fn key(headers: &HeaderMap) -> Answer<Option<String>> {
    let Some(value) = headers.get(KEY_HEADER) else {
        return Ok(None);
    };
    let key = value.to_str().unwrap_or_default().trim().trim_matches('"');
    if key.is_empty() || key.len() > KEY_LENGTH {
        return Err(Problem::bad_request(
            "invalid-idempotency-key",
            format!("The key must have 1 to {KEY_LENGTH} visible ASCII characters."),
        )
        .at("Idempotency-Key")
        .fix("Send a random UUID as the key."));
    }
    Ok(Some(key.to_owned()))
}
