//! Strict reading of paths and JSON bodies: what is unknown is refused.

use crate::app::App;
use crate::wire::limits::BodyLimits;
use crate::wire::memory::charge;
use crate::wire::problem::{Answer, Problem, body, shorten};
use axum::body::Bytes;
use axum::extract::{FromRequestParts, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use futures::StreamExt;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use ventriform::base::progress::Monitor;
use ventriform::parameters::nearest;

/// Segments of the path, as [`axum::extract::Path`] reads them, but refused with a problem object.
pub struct PathSegments<T>(pub T);

impl<S, T> FromRequestParts<S> for PathSegments<T>
where
    S: Send + Sync,
    T: DeserializeOwned + Send,
{
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Answer<Self> {
        match axum::extract::Path::from_request_parts(parts, state).await {
            Ok(axum::extract::Path(path)) => Ok(Self(path)),
            Err(error) => Err(Problem::bad_request(
                "malformed-path",
                format!("{}.", error.body_text()),
            )
            .fix("Use the paths in `links` unchanged.")),
        }
    }
}

/// 400 for an unknown name, with the most similar known one.
pub fn unknown(what: &str, name: &str, known: &[&str]) -> Problem {
    let fix = match nearest(name, known.iter().copied()) {
        Some(near) => format!("Did you mean `{near}`?"),
        None if known.is_empty() => format!("Leave it out: this path takes no {what}."),
        None => format!("This path takes {}.", known.join(", ")),
    };
    Problem::bad_request(
        "unknown-parameter",
        format!("There is no {what} `{}`.", shorten(name)),
    )
    .at(shorten(name))
    .fix(fix)
}

/// The media type of a request's body, in lower case, without parameters.
pub fn media_type(headers: &HeaderMap) -> Option<String> {
    let value = headers.get(header::CONTENT_TYPE)?.to_str().unwrap_or("?");
    let essence = value.split(';').next().unwrap_or_default();
    Some(essence.trim().to_ascii_lowercase())
}

/// Refuses a body that is compressed for the transfer: the limit on its size would not limit what
/// it decompresses to.
pub fn refuse_content_encoding(headers: &HeaderMap) -> Answer<()> {
    match headers.get(header::CONTENT_ENCODING) {
        Some(encoding) if encoding != "identity" => Err(body::unsupported_encoding()),
        _ => Ok(()),
    }
}

/// The bytes of a JSON body, not parsed yet.
///
/// # Errors
/// 400 broken off, 408 too slow, 413 too large, 415 of another type or encoding.
pub async fn json_bytes(request: Request) -> Answer<Bytes> {
    bytes_of(request, &["application/json"]).await
}

/// The bytes of a body of one of these types, the first of which is recommended.
///
/// # Errors
/// As [`json_bytes`].
pub async fn bytes_of(request: Request, types: &[&str]) -> Answer<Bytes> {
    refuse_content_encoding(request.headers())?;
    match media_type(request.headers()).as_deref() {
        None => {}
        Some(known) if types.contains(&known) => {}
        Some(other) => return Err(body::unsupported_type(other, types[0])),
    }
    let limits = BodyLimits::from_request(&request)?;
    let mut pieces = request.into_body().into_data_stream();
    let (mut bytes, mut charged) = (Vec::new(), UNCHARGED_BYTES);
    while let Some(piece) = pieces.next().await {
        let piece = piece.map_err(|error| body::interrupted(&error, limits.size))?;
        if bytes.len() + piece.len() > limits.size.as_usize() {
            return Err(body::too_large(limits.size));
        }
        while bytes.len() + piece.len() > charged {
            // A vector that grows has up to twice as much.
            charge(2 * CHARGED_AT_ONCE as u64).await?;
            charged += CHARGED_AT_ONCE;
        }
        bytes.extend_from_slice(&piece);
    }
    Ok(bytes.into())
}

/// Bytes of a body in memory that are not charged, and that are charged at once beyond these.
const UNCHARGED_BYTES: usize = 8 << 10;
const CHARGED_AT_ONCE: usize = 64 << 10;

/// Memory for a byte of JSON that is parsed: `[0,0]` takes a value and its place for two.
const PARSED_MEMORY: u64 = 40;

/// Memory of decoding for a body that is parsed: its value is charged already, so this bounds only how many wait.
const PARSING_MEMORY: u64 = 1 << 20;

/// What `parse` makes of JSON. Charges for the value. What is longer than a request's head is parsed in turn with what
/// others decode, off the threads that serve.
///
/// # Errors
/// Those of `parse`, and 503 if there is no memory for the value or too much waits.
pub async fn parsed<T: Send + 'static>(
    app: &App,
    bytes: Bytes,
    parse: impl FnOnce(&[u8]) -> Answer<T> + Send + 'static,
) -> Answer<T> {
    if bytes.len() <= UNCHARGED_BYTES {
        return parse(&bytes);
    }
    let length = bytes.len() as u64;
    charge(PARSED_MEMORY * length).await?;
    let parse = move |_: &Monitor<'_>| parse(&bytes);
    let decoding = app.service.decoding();
    decoding.run_on(length, PARSING_MEMORY, parse).await?
}

/// The JSON object in a request's body.
///
/// # Errors
/// As [`json_bytes`], and 400 if the body is not one JSON object.
pub async fn json_object(app: &App, request: Request) -> Answer<Map<String, Value>> {
    let bytes = json_bytes(request).await?;
    parsed(app, bytes, object_of).await
}

/// The JSON object in these bytes.
///
/// # Errors
/// 400 if they are not one JSON object.
pub fn object_of(bytes: &[u8]) -> Answer<Map<String, Value>> {
    match serde_json::from_slice(bytes) {
        Ok(Value::Object(object)) => Ok(object),
        Ok(_) => Err(body::malformed_json("it is another JSON value")),
        Err(error) => Err(body::malformed_json(&error.to_string())),
    }
}
