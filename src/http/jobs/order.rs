//! Filing jobs: over JSON, or by the one line that carries the volume itself.

use super::describe;
use crate::http::app::App;
use crate::http::problem::{Answer, Problem, shorten};
use crate::http::products::{self, Offer};
use crate::http::request::query_pairs;
use crate::http::wire::{path_of, rfc3339};
use crate::http::{idempotency, negotiate, upload};
use crate::jobs::{self, Filed, JobState, NewJob, Resource, Work};
use axum::Json;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::time::Duration;

/// Seconds after which to look at a job again, at least and at most.
const RETRY_AFTER: (f64, f64) = (1.0, 60.0);

/// Takes a volume in, files a job of the kind that makes `resource`, and answers 202; with
/// `Prefer: wait`, waits for the end and answers with the offer that `Accept` likes best.
/// File parts of a form named in `parts` are volumes of their own, whose ids go into the
/// parameters of the same names.
pub async fn one_line(
    app: &App,
    resource: Resource,
    query: Option<&str>,
    request: Request,
    parts: &[&'static str],
    offers: &[Offer],
) -> Answer {
    let headers = request.headers().clone();
    let patience = negotiate::preferred_wait(&headers);
    if patience.is_some() {
        products::choose(&headers, offers)?;
    }
    let key = idempotency::key(&headers)?;
    let kind = resource.noun();
    let Some(work) = app.engine.work(kind) else {
        return Err(Problem::internal(format!("no work of kind `{kind}`")));
    };
    // What can be refused without the body is refused before it is read.
    let mut pairs = query_pairs(query);
    let mut parameters = work.parameters_from_text(&pairs)?;
    require(app, &work.needs(&parameters).items).await?;
    if app.queue.is_full().await? {
        return Err(queue_full(app).await);
    }
    let upload = upload::receive(app, request, parts).await?;
    let given = pairs.len();
    pairs.extend(upload.fields);
    for (name, files) in upload.others {
        let (volume, _) = files.store(app).await.map_err(|p| p.at(name))?;
        pairs.push((name.to_owned(), volume.id));
    }
    if pairs.len() > given {
        parameters = work.parameters_from_text(&pairs)?;
    }
    let (volume, _) = upload.volume.store(app).await?;
    let job = new_job(&**work, volume.id, parameters, key);
    let job = file(app, &job).await?;
    match patience {
        Some(patience) => wait(app, job, patience, &headers, offers).await,
        None => accepted(app, job).await,
    }
}

/// A job to be filed.
pub fn new_job(
    work: &dyn Work,
    volume: String,
    parameters: Map<String, Value>,
    key: Option<String>,
) -> NewJob {
    let kind = work.makes().noun();
    NewJob {
        kind: kind.into(),
        idempotency: idempotency::promise(key, kind, &volume, &parameters),
        needs: work.needs(&parameters).items,
        volume,
        parameters,
    }
}

async fn wait(
    app: &App,
    job: jobs::Job,
    patience: Duration,
    headers: &HeaderMap,
    offers: &[Offer],
) -> Answer {
    let patience = patience.min(app.settings.wait_limit.0);
    let waited = tokio::select! {
        job = app.queue.wait(&job.id, patience) => job?,
        () = app.closing.cancelled() => None,
    };
    let job = waited.unwrap_or(job);
    let applied = HeaderValue::from_str(&format!("wait={}", patience.as_secs()))
        .unwrap_or(HeaderValue::from_static("wait"));
    let mut response = match (job.state, &job.result) {
        (JobState::Succeeded, Some(id)) => {
            let product = products::find(app, id).await?;
            let offer = products::choose(headers, offers)?;
            // The headers of this request are about the upload, not about a part of the file.
            let mut response = products::send(app, &product, offer, &HeaderMap::new()).await?;
            if let Ok(location) = HeaderValue::from_str(&path_of(id)) {
                response.headers_mut().insert(header::LOCATION, location);
            }
            response
        }
        (state, _) if state.is_final() => failed(&job),
        _ => accepted(app, job).await?,
    };
    response.headers_mut().insert("preference-applied", applied);
    Ok(response)
}

/// Refuses needs that are not there.
async fn require(app: &App, needs: &BTreeMap<String, String>) -> Answer<()> {
    for (field, id) in needs {
        let there = match Resource::of(id) {
            Some(Resource::Volume) => app.queue.catalogue.volume(id).await?.is_some(),
            _ => app.queue.catalogue.product(id).await?.is_some(),
        };
        if !there {
            return Err(absent(app, field, id).await?);
        }
    }
    Ok(())
}

/// The problem of a field that names what is not there, or not any more.
pub async fn absent(app: &App, field: &str, id: &str) -> Answer<Problem> {
    let resource = Resource::of(id).unwrap_or(match field {
        "model" => Resource::Model,
        _ => Resource::Volume,
    });
    let noun = resource.noun();
    let detail = match app.queue.catalogue.erased_at(id).await? {
        Some(at) => format!(
            "The {noun} `{}` was erased at {}.",
            shorten(id),
            rfc3339(at)
        ),
        None => format!("There is no {noun} `{}`.", shorten(id)),
    };
    let fix = match resource {
        Resource::Volume => "POST the file to /v1/volumes first.".to_owned(),
        _ => format!(
            "GET /v1/{} lists what there is; auto takes what is at hand.",
            resource.plural()
        ),
    };
    Ok(wrong(field, detail).fix(fix))
}

/// 422 for a field.
pub fn wrong(field: &str, detail: impl Into<String>) -> Problem {
    Problem::new(StatusCode::UNPROCESSABLE_ENTITY, "invalid-field", detail).at(field)
}

/// Files a job, or says why not.
pub async fn file(app: &App, job: &NewJob) -> Answer<jobs::Job> {
    match app.queue.file(job).await? {
        Filed::New(job) | Filed::Same(job) => Ok(job),
        Filed::QueueFull => Err(queue_full(app).await),
        Filed::KeyReused => Err(Problem::new(
            StatusCode::UNPROCESSABLE_ENTITY,
            "idempotency-key-reused",
            "This key came with another request before.",
        )
        .at("Idempotency-Key")
        .fix("Use a new key for a new request.")),
        Filed::Missing { field, id } => Err(absent(app, &field, &id).await?),
    }
}

/// The refusal of a full queue.
pub async fn queue_full(app: &App) -> Problem {
    let seconds = match app.queue.jobs.load().await {
        Ok(load) => load.mean_duration_ms.unwrap_or_default() / 1000.0,
        Err(_) => RETRY_AFTER.1,
    };
    Problem::new(
        StatusCode::TOO_MANY_REQUESTS,
        "queue-full",
        format!(
            "{} jobs wait already; nothing was accepted.",
            app.settings.queue_limit
        ),
    )
    .fix("Try again after the time in Retry-After.")
    .header(header::RETRY_AFTER, retry_after(seconds))
}

fn retry_after(seconds: f64) -> String {
    (seconds.clamp(RETRY_AFTER.0, RETRY_AFTER.1).ceil() as u64).to_string()
}

/// 202 with the job.
pub async fn accepted(app: &App, job: jobs::Job) -> Answer {
    let starts_in_ms = match job.state {
        JobState::Queued => app.queue.position(&job).await?.starts_in_ms,
        _ => None,
    };
    let headers = [
        (header::LOCATION, format!("/v1/jobs/{}", job.id)),
        (
            header::RETRY_AFTER,
            retry_after(starts_in_ms.unwrap_or_default() / 1000.0),
        ),
    ];
    let body = Json(describe(app, job).await?);
    Ok((StatusCode::ACCEPTED, headers, body).into_response())
}

/// The problem of a job that did not succeed, as the answer to whoever waited for it.
pub fn failed(job: &jobs::Job) -> Response {
    let problem: Problem = match &job.failure {
        Some(failure) => failure.clone().into(),
        None => Problem::new(
            StatusCode::CONFLICT,
            "cancelled",
            "The job was cancelled while this request waited for it.",
        ),
    };
    problem.of_job(&job.id).into_response()
}
