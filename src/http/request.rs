//! Taking requests apart: paths, query strings and JSON bodies, strictly.

use super::app::App;
use super::problem::{Answer, Problem, shorten};
use crate::parameters::nearest;
use axum::body::Bytes;
use axum::extract::{FromRequestParts, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, StatusCode, header};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// Parts of the path. Like axum's own, but for refusing with a problem object.
pub struct Path<T>(pub T);

impl<S, T> FromRequestParts<S> for Path<T>
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
            .fix("Take paths from `links`, as they are.")),
        }
    }
}

/// The pairs of a query string, decoded, in order.
pub fn query_pairs(query: Option<&str>) -> Vec<(String, String)> {
    form_urlencoded::parse(query.unwrap_or_default().as_bytes())
        .into_owned()
        .collect()
}

/// Refuses names outside `known` and names given twice.
pub fn refuse_unknown(pairs: &[(String, String)], known: &[&str]) -> Answer<()> {
    for (index, (name, _)) in pairs.iter().enumerate() {
        if !known.contains(&name.as_str()) {
            return Err(unknown("query parameter", name, known));
        }
        if pairs[..index].iter().any(|(earlier, _)| earlier == name) {
            return Err(Problem::bad_request(
                "repeated-parameter",
                format!("`{name}` is given more than once."),
            )
            .at(name)
            .fix("Give it once."));
        }
    }
    Ok(())
}

/// A refusal of a name that means nothing, with the nearest one that does.
pub fn unknown(what: &str, name: &str, known: &[&str]) -> Problem {
    let fix = match nearest(name, known.iter().copied()) {
        Some(near) => format!("Did you mean `{near}`?"),
        None if known.is_empty() => format!("Leave it out: no {what} is taken here."),
        None => format!("Known here: {}.", known.join(", ")),
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

/// The refusal of a body of the type `found`.
pub fn unsupported_type(found: &str) -> Problem {
    Problem::new(
        StatusCode::UNSUPPORTED_MEDIA_TYPE,
        "unsupported-media-type",
        format!(
            "A body of type `{}` is not understood here.",
            shorten(found)
        ),
    )
    .at("Content-Type")
}

/// Refuses a compressed transfer: a limit on what arrives would not be one on what it becomes.
pub fn refuse_content_encoding(headers: &HeaderMap) -> Answer<()> {
    match headers.get(header::CONTENT_ENCODING) {
        Some(encoding) if encoding != "identity" => Err(Problem::new(
            StatusCode::UNSUPPORTED_MEDIA_TYPE,
            "unsupported-content-encoding",
            "Content-Encoding is not supported.",
        )
        .at("Content-Encoding")
        .fix("Send the file as it is; a .nii.gz is taken without Content-Encoding.")),
        _ => Ok(()),
    }
}

/// A body that is JSON, at most `limit` bytes of it, not parsed yet.
pub async fn json_bytes(app: &App, request: Request, limit: usize) -> Answer<Bytes> {
    refuse_content_encoding(request.headers())?;
    match media_type(request.headers()).as_deref() {
        None | Some("application/json") => {}
        Some(other) => return Err(unsupported_type(other).fix("Send application/json.")),
    }
    let bytes = axum::body::to_bytes(request.into_body(), limit);
    tokio::time::timeout(app.settings.body_timeout.0, bytes)
        .await
        .map_err(|_| {
            Problem::new(
                StatusCode::REQUEST_TIMEOUT,
                "body-too-slow",
                "The body did not arrive in time.",
            )
        })?
        .map_err(|_| {
            Problem::new(
                StatusCode::PAYLOAD_TOO_LARGE,
                "body-too-large",
                format!("The body is larger than {limit} bytes, or it broke off."),
            )
        })
}

/// The JSON object in a request's body.
pub async fn json_object(app: &App, request: Request) -> Answer<Map<String, Value>> {
    let bytes = json_bytes(app, request, app.settings.json_limit.as_usize()).await?;
    let not_json = |error: serde_json::Error| {
        Problem::bad_request("malformed-json", format!("The body is not JSON: {error}."))
            .fix("Send one JSON object.")
    };
    match serde_json::from_slice(&bytes).map_err(not_json)? {
        Value::Object(object) => Ok(object),
        _ => Err(
            Problem::bad_request("malformed-json", "The body is not a JSON object.")
                .fix("Send one JSON object."),
        ),
    }
}
