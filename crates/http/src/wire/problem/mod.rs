//! Errors as a client sees them: problem objects (RFC 9457).
//!
//! `type` is `urn:ventriform:problem:` followed by a word whose meaning never changes; programs
//! decide by it. `detail` says what happened, `field` names the parameter, JSON field or header
//! concerned, and `fix` says what to do. The cause of an internal error goes to the log and never
//! to the client.
//!
//! | file | what it words |
//! |---|---|
//! | [`not_found`] | 404 and 410: unknown ids, files and paths; 422 for a field that names one |
//! | [`body`] | 400, 408, 413 and 415: bodies that are empty, slow, large or of another type |
//! | [`failure`] | errors of the domain and of the store |

pub mod body;
pub mod not_found;

mod failure;

pub use failure::from_panic;
pub use ventriform_service::base::error::shorten;

use crate::wire::public_base::public_path;
use axum::Json;
use axum::http::{HeaderName, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;
use ventriform_service::base::error::ServiceError;

/// The media type of problem objects.
pub const MEDIA_TYPE: &str = "application/problem+json";

const TYPE_PREFIX: &str = "urn:ventriform:problem:";

/// Why a request was not fulfilled (RFC 9457).
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[schema(as = Problem)]
pub struct ProblemBody {
    /// Stable identifier of the kind of problem.
    #[serde(rename = "type")]
    #[schema(example = "urn:ventriform:problem:unknown-parameter")]
    pub kind: String,
    /// The kind of problem in words.
    pub title: String,
    /// The HTTP status.
    #[schema(minimum = 400, maximum = 599)]
    pub status: u16,
    /// What happened this time.
    pub detail: String,
    /// The parameter, JSON field or header concerned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// What to do about it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fix: Option<String>,
    /// The job that failed, if there was one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub job: Option<String>,
}

impl ProblemBody {
    /// The word that tells the kind of problem.
    pub fn code(&self) -> &str {
        self.kind.strip_prefix(TYPE_PREFIX).unwrap_or_default()
    }
}

/// A problem object together with the headers of its answer.
#[derive(Debug, Clone)]
pub struct Problem {
    body: Box<ProblemBody>,
    headers: Vec<(HeaderName, HeaderValue)>,
}

/// The result of a handler.
pub type Answer<T = Response> = Result<T, Problem>;

impl Problem {
    /// A problem whose `type` ends in `code`.
    pub fn new(status: StatusCode, code: &str, detail: impl Into<String>) -> Self {
        Self {
            body: Box::new(ProblemBody {
                kind: format!("{TYPE_PREFIX}{code}"),
                title: title(code),
                status: status.as_u16(),
                detail: detail.into(),
                field: None,
                fix: None,
                job: None,
            }),
            headers: Vec::new(),
        }
    }

    /// 400: the request cannot be read.
    pub fn bad_request(code: &str, detail: impl Into<String>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, code, detail)
    }

    /// 422: the value of `field` cannot be used.
    pub fn invalid_field(field: &str, detail: impl Into<String>) -> Self {
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, "invalid-field", detail).at(field)
    }

    /// 500. The cause goes to the log only.
    pub fn internal(cause: impl std::fmt::Display) -> Self {
        ServiceError::internal(cause).into()
    }

    /// Names the field concerned.
    #[must_use]
    pub fn at(mut self, field: impl Into<String>) -> Self {
        self.body.field = Some(field.into());
        self
    }

    /// Says that the field concerned is inside of the field `outer`.
    #[must_use]
    pub fn within(mut self, outer: &str) -> Self {
        self.body.field = self.body.field.map(|field| format!("{outer}.{field}"));
        self
    }

    /// Makes a 422 about a field a 400 about a parameter of a search.
    #[must_use]
    pub fn of_search(mut self) -> Self {
        if self.body.status == StatusCode::UNPROCESSABLE_ENTITY.as_u16() {
            let code = "invalid-parameter";
            self.body.status = StatusCode::BAD_REQUEST.as_u16();
            self.body.kind = format!("{TYPE_PREFIX}{code}");
            self.body.title = title(code);
        }
        self
    }

    /// Says what to do about it.
    #[must_use]
    pub fn fix(mut self, fix: impl Into<String>) -> Self {
        self.body.fix = Some(fix.into());
        self
    }

    /// Names the job that failed, in the body and as `Location`.
    #[must_use]
    pub fn of_job(mut self, id: &str) -> Self {
        self.body.job = Some(id.to_owned());
        self.header(header::LOCATION, public_path(&format!("/v1/jobs/{id}")))
    }

    /// Adds a header to the answer.
    #[must_use]
    pub fn header(mut self, name: HeaderName, value: impl AsRef<str>) -> Self {
        if let Ok(value) = HeaderValue::from_str(value.as_ref()) {
            self.headers.push((name, value));
        }
        self
    }

    /// The body alone, to be embedded into a job.
    pub fn into_body(self) -> ProblemBody {
        *self.body
    }
}

/// 405, for paths that exist but do not take the method.
pub async fn method_not_allowed(method: Method) -> Problem {
    Problem::new(
        StatusCode::METHOD_NOT_ALLOWED,
        "method-not-allowed",
        format!("This path does not support {method}."),
    )
    .fix("Use one of the methods in the Allow header.")
}

/// `unknown-parameter` -> `Unknown parameter`.
fn title(code: &str) -> String {
    let words = code.replace('-', " ");
    let mut letters = words.chars();
    letters
        .next()
        .map(|first| first.to_uppercase().chain(letters).collect())
        .unwrap_or_default()
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status =
            StatusCode::from_u16(self.body.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let mut response = (status, Json(*self.body)).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(MEDIA_TYPE));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        headers.extend(self.headers);
        response
    }
}
