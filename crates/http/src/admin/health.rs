//! `/healthz`, `/readyz` and `/metrics`, for operators.

use crate::app::App;
use crate::openapi::ListProblems;
use crate::wire::problem::{Answer, MEDIA_TYPE, Problem, ProblemBody};
use crate::wire::query::NoQuery;
use axum::Json;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;
use ventriform_service::telemetry::Check;

/// The state of the service.
#[derive(Serialize, ToSchema)]
pub struct Health {
    /// Always `ok`.
    #[schema(example = "ok")]
    status: String,
    /// The program's version.
    version: String,
}

/// Whether the service can accept work.
#[derive(Serialize, ToSchema)]
pub struct Ready {
    /// Always `ok`.
    #[schema(example = "ok")]
    status: String,
    /// The program's version.
    version: String,
    /// Parts that the service depends on.
    checks: Vec<Dependency>,
}

/// Why the service cannot accept work.
#[derive(Serialize, ToSchema)]
pub struct NotReady {
    /// The problem.
    #[serde(flatten)]
    problem: ProblemBody,
    /// A part that the service depends on.
    checks: Vec<Dependency>,
}

/// Something that the service depends on.
#[derive(Serialize, ToSchema)]
pub struct Dependency {
    /// `database`, `audit` (the audit trail), `files`, `disk`, `workers` (processes that compute jobs), or `clock`
    /// (whether ages count by the time of day).
    #[schema(example = "database")]
    name: &'static str,
    /// `ok` or `failing`.
    #[schema(example = "ok")]
    status: &'static str,
    /// Whether no work can be accepted without it.
    required: bool,
    /// The reason why it does not work.
    #[serde(skip_serializing_if = "Option::is_none")]
    detail: Option<&'static str>,
}

impl From<&Check> for Dependency {
    fn from(check: &Check) -> Self {
        Self {
            name: check.name,
            status: match check.fault {
                None => "ok",
                Some(_) => "failing",
            },
            required: check.required,
            detail: check.fault,
        }
    }
}

fn healthy() -> Health {
    Health {
        status: "ok".into(),
        version: env!("CARGO_PKG_VERSION").into(),
    }
}

/// Check that the process runs
#[utoipa::path(get, path = "/healthz", tag = "operations",
    responses((status = 200, description = "It runs", body = Health), ListProblems))]
pub async fn alive(_: NoQuery) -> Answer<Json<Health>> {
    Ok(Json(healthy()))
}

/// Check that the service can accept work
///
/// Names everything that the service depends on, with its own status. 503 if something is failing without which
/// no work can be accepted, or if a check cannot be made; jobs are accepted while no worker runs, and while the time
/// of day is in doubt.
#[utoipa::path(get, path = "/readyz", tag = "operations",
    responses((status = 200, description = "It can", body = Ready),
        (status = 503, description = "It cannot", body = NotReady,
            content_type = "application/problem+json"),
        ListProblems))]
pub async fn ready(State(app): State<App>, _: NoQuery) -> Answer {
    let (found, why) = app.service.readiness().await;
    let checks = found.iter().map(Dependency::from).collect();
    if let Some(why) = why {
        return Ok(unready(why, checks));
    }
    let Health { status, version } = healthy();
    let ready = Ready {
        status,
        version,
        checks,
    };
    Ok(Json(ready).into_response())
}

fn unready(why: &str, checks: Vec<Dependency>) -> Response {
    let problem = Problem::new(StatusCode::SERVICE_UNAVAILABLE, "not-ready", why).into_body();
    let headers = [
        (header::CONTENT_TYPE, MEDIA_TYPE),
        (header::RETRY_AFTER, "5"),
    ];
    let body = Json(NotReady { problem, checks });
    (StatusCode::SERVICE_UNAVAILABLE, headers, body).into_response()
}

/// Read the metrics
#[utoipa::path(get, path = "/metrics", tag = "operations",
    responses((status = 200, description = "The metrics in the text format of Prometheus", body = String,
        content_type = "text/plain"), ListProblems))]
pub async fn metrics(State(app): State<App>, _: NoQuery) -> Answer {
    let text = app.service.metrics_text().await?;
    let media_type = format!("{}; charset=utf-8", prometheus::TEXT_FORMAT);
    Ok(([(header::CONTENT_TYPE, media_type)], text).into_response())
}
