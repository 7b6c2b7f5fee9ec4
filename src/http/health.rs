//! `/healthz`, `/readyz`, `/metrics`: for operators.

use super::app::App;
use super::openapi::ListProblems;
use super::problem::{Answer, Problem};
use super::request::{query_pairs, refuse_unknown};
use axum::Json;
use axum::extract::{RawQuery, State};
use axum::http::{StatusCode, header};
use axum::response::IntoResponse;
use serde::Serialize;
use std::fmt::Write;
use std::sync::atomic::Ordering;
use utoipa::ToSchema;

/// How the service is.
#[derive(Serialize, ToSchema)]
pub struct Health {
    /// `ok`.
    #[schema(example = "ok")]
    status: String,
    /// The program's version.
    version: String,
}

fn healthy() -> Health {
    Health {
        status: "ok".into(),
        version: env!("CARGO_PKG_VERSION").into(),
    }
}

/// Whether the process lives
#[utoipa::path(get, path = "/healthz", tag = "operations",
    responses((status = 200, description = "It does", body = Health), ListProblems))]
pub async fn alive(RawQuery(query): RawQuery) -> Answer<Json<Health>> {
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    Ok(Json(healthy()))
}

/// Whether the service can accept work
#[utoipa::path(get, path = "/readyz", tag = "operations",
    responses((status = 200, description = "It can", body = Health),
        (status = 503, description = "It cannot", body = super::problem::ProblemBody,
            content_type = "application/problem+json"),
        ListProblems))]
pub async fn ready(State(app): State<App>, RawQuery(query): RawQuery) -> Answer<Json<Health>> {
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    let unready = |why: &str| {
        Problem::new(StatusCode::SERVICE_UNAVAILABLE, "not-ready", why)
            .header(header::RETRY_AFTER, "5")
    };
    if app.closing.is_cancelled() {
        return Err(unready("The service is shutting down."));
    }
    if let Err(error) = app.queue.jobs.load().await {
        tracing::error!(%error, "not ready");
        return Err(unready("The database does not answer."));
    }
    if let Err(error) = app.queue.blobs.check().await {
        tracing::error!(%error, "not ready");
        return Err(unready("Files cannot be written."));
    }
    Ok(Json(healthy()))
}

/// Figures for Prometheus
#[utoipa::path(get, path = "/metrics", tag = "operations",
    responses((status = 200, description = "Prometheus text format", body = String,
        content_type = "text/plain"), ListProblems))]
pub async fn metrics(State(app): State<App>, RawQuery(query): RawQuery) -> Answer {
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    let load = app.queue.jobs.load().await?;
    let mut text = String::new();
    let mut figure = |name: &str, kind: &str, help: &str, values: &[(String, f64)]| {
        let _ = writeln!(text, "# HELP {name} {help}\n# TYPE {name} {kind}");
        for (labels, value) in values {
            let _ = writeln!(text, "{name}{labels} {value}");
        }
    };
    let jobs = [
        ("{state=\"queued\"}".to_owned(), load.queued as f64),
        ("{state=\"running\"}".to_owned(), load.running as f64),
    ];
    figure(
        "ventriform_jobs",
        "gauge",
        "Jobs that have not ended.",
        &jobs,
    );
    let answers: Vec<_> = app
        .answers
        .iter()
        .enumerate()
        .map(|(index, count)| {
            let class = index + 1;
            let count = count.load(Ordering::Relaxed);
            (format!("{{class=\"{class}xx\"}}"), count as f64)
        })
        .collect();
    figure(
        "ventriform_http_answers_total",
        "counter",
        "Answers by class of status.",
        &answers,
    );
    let uptime = [(String::new(), app.started.elapsed().as_secs_f64())];
    figure(
        "ventriform_uptime_seconds",
        "gauge",
        "Time since the start.",
        &uptime,
    );
    let media_type = [(
        header::CONTENT_TYPE,
        "text/plain; version=0.0.4; charset=utf-8",
    )];
    Ok((media_type, text).into_response())
}
