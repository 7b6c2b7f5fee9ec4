//! JSON answers with a strong validator: the SHA-256 of their bytes (RFC 9110, sections 8.8.3 and
//! 13.1.2).

use super::files::not_modified;
use super::problem::{Answer, Problem};
use crate::jobs::hex;
use axum::http::{HeaderMap, header};
use axum::response::IntoResponse;
use serde::Serialize;
use sha2::{Digest, Sha256};

/// Only the client that asked may keep it, and asks each time whether it is still current.
const CACHE_CONTROL: &str = "private, no-cache";

/// 200 with the JSON of `body`, or 304 if `If-None-Match` names it.
///
/// # Errors
/// 500 if it cannot be written as JSON.
pub fn json(headers: &HeaderMap, body: &impl Serialize) -> Answer {
    let bytes = serde_json::to_vec(body).map_err(Problem::internal)?;
    let etag = format!("\"{}\"", hex(&Sha256::digest(&bytes)));
    if let Some(unchanged) = not_modified(headers, &etag, CACHE_CONTROL) {
        return Ok(unchanged);
    }
    let answer = [
        (header::CONTENT_TYPE, "application/json".to_owned()),
        (header::ETAG, etag),
        (header::CACHE_CONTROL, CACHE_CONTROL.to_owned()),
    ];
    Ok((answer, bytes).into_response())
}
