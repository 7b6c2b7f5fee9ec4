//! `/healthz`, `/readyz` and `/metrics`, for operators.

use super::app::App;
use super::metrics::MetricReadings;
use super::openapi::ListProblems;
use super::problem::{Answer, Problem};
use super::request::{query_pairs, refuse_unknown};
use axum::Json;
use axum::extract::{RawQuery, State};
use axum::http::{StatusCode, header};
use axum::response::IntoResponse;
use serde::Serialize;
use utoipa::ToSchema;

/// The state of the service.
#[derive(Serialize, ToSchema)]
pub struct Health {
    /// Always `ok`.
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

/// Check that the process runs
#[utoipa::path(get, path = "/healthz", tag = "operations",
    responses((status = 200, description = "It runs", body = Health), ListProblems))]
pub async fn alive(RawQuery(query): RawQuery) -> Answer<Json<Health>> {
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    Ok(Json(healthy()))
}

/// Check that the service can accept work
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
    app.readiness.check(&app.queue).await.map_err(unready)?;
    Ok(Json(healthy()))
}

/// Read the metrics
#[utoipa::path(get, path = "/metrics", tag = "operations",
    responses((status = 200, description = "The metrics in the text format of Prometheus", body = String,
        content_type = "text/plain"), ListProblems))]
pub async fn metrics(State(app): State<App>, RawQuery(query): RawQuery) -> Answer {
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    let reading = MetricReadings {
        load: app.queue.jobs.load().await?,
        figures: app.figures.queue_figures().await?,
        received: app.intake.store.waiting().await?,
        backlog: app.hooks.store.backlog().await?,
        sent: app.hooks.dispatcher.counts(),
        archives: app.archives.read().await?,
        ready: app.readiness.check(&app.queue).await.is_ok(),
        space: app.queue.blobs.space(),
        settings: &app.settings,
        now: app.queue.clock.now(),
    };
    let text = app.metrics.text(&reading);
    let media_type = format!("{}; charset=utf-8", prometheus::TEXT_FORMAT);
    Ok(([(header::CONTENT_TYPE, media_type)], text).into_response())
}
