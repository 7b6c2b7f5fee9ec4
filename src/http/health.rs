//! `/healthz`, `/readyz` and `/metrics`, for operators.

use super::app::App;
use super::metrics::MetricReadings;
use super::openapi::ListProblems;
use super::problem::{Answer, Problem};
use super::request::{query_pairs, refuse_unknown};
use crate::jobs::{Queue, StoreError, StoreFault};
use axum::Json;
use axum::extract::{RawQuery, State};
use axum::http::{StatusCode, header};
use axum::response::IntoResponse;
use serde::Serialize;
use std::time::{Duration, Instant};
use tokio::sync::Mutex;
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

/// Whether the storage works, checked at most once in [`CHECK_EVERY`] however many probes ask.
#[derive(Default)]
pub struct Readiness(Mutex<Option<(Instant, Result<(), &'static str>)>>);

/// How long the outcome of a check is given to other probes.
const CHECK_EVERY: Duration = Duration::from_secs(1);

/// A check that takes longer counts as failed.
const CHECK_LIMIT: Duration = Duration::from_secs(5);

impl Readiness {
    /// Checks the storage, or returns the outcome of the last check if that is recent. A probe
    /// that comes while another one checks waits for its outcome.
    async fn check(&self, queue: &Queue) -> Result<(), &'static str> {
        let mut last = self.0.lock().await;
        if let Some((at, outcome)) = *last
            && at.elapsed() < CHECK_EVERY
        {
            return outcome;
        }
        let outcome = match tokio::time::timeout(CHECK_LIMIT, check_storage(queue)).await {
            Ok(outcome) => outcome.map_err(|error| {
                tracing::error!(%error, "not ready");
                why_unready(&error)
            }),
            Err(_) => Err("The disk does not answer."),
        };
        *last = Some((Instant::now(), outcome));
        outcome
    }
}

async fn check_storage(queue: &Queue) -> Result<(), StoreError> {
    queue.blobs.check().await?;
    queue.jobs.check().await
}

fn why_unready(error: &StoreError) -> &'static str {
    match (error.cause(), error) {
        (StoreFault::Full, _) => "The disk is full, or nearly so.",
        (StoreFault::Busy, _) => "Another program holds the database's lock.",
        (StoreFault::DamagedDatabase, _) => "The database is damaged.",
        (_, StoreError::Files(_)) => "Files cannot be written.",
        (_, StoreError::Database { .. }) => "The database does not answer.",
    }
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
        backlog: app.hooks.store.backlog().await?,
        sent: app.hooks.dispatcher.counts(),
        ready: app.queue.blobs.check().await.is_ok(),
        settings: &app.settings,
        now: app.queue.clock.now(),
    };
    let text = app.metrics.text(&reading);
    let media_type = format!("{}; charset=utf-8", prometheus::TEXT_FORMAT);
    Ok(([(header::CONTENT_TYPE, media_type)], text).into_response())
}
