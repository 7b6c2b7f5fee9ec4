//! `/v1/jobs`: what was asked for and how far it is.

use super::app::App;
use super::openapi::{ListProblems, LookupProblems};
use super::pagination::{list_query, next_cursor};
use super::problem::{Answer, Problem, ProblemBody, shorten};
use super::request::{self, Path, query_pairs, refuse_unknown, unknown};
use super::wire::{missing, rfc3339};
use super::{idempotency, problem};
use crate::jobs::{self, Deleted, Filed, Interrupted, NewJob, State as JobState};
use axum::Json;
use axum::extract::{RawQuery, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde_json::{Map, Value};
use utoipa::ToSchema;

/// Seconds after which to look at a job again, at least and at most.
const RETRY_AFTER: (f64, f64) = (1.0, 60.0);

/// Work that was accepted.
#[derive(Serialize, ToSchema)]
pub struct Job {
    /// The job's id.
    #[schema(example = "job_019a8f4e7c2b7c3e9d5f6a7b8c9d0e1f")]
    id: String,
    /// What kind of work it is.
    #[schema(example = "model")]
    kind: String,
    /// The volume it works on.
    volume: String,
    /// The parameters, every default written out.
    #[schema(value_type = Object)]
    parameters: Map<String, Value>,
    /// Where it is in its life.
    state: State_,
    /// The stage of the work, once one was reached.
    #[schema(example = "retile")]
    stage: Option<String>,
    /// How much is done.
    #[schema(minimum = 0, maximum = 1)]
    progress: f64,
    /// Place in the queue, the next being 1; only while it waits.
    queue_position: Option<u64>,
    /// When it will probably start (RFC 3339); only while it waits and where past jobs tell.
    #[schema(format = DateTime)]
    estimated_start: Option<String>,
    /// How often a worker took it.
    attempts: u32,
    /// Whether its end was asked for.
    cancel_requested: bool,
    /// Grows with every change; the id of its events.
    revision: i64,
    /// When it was accepted (RFC 3339).
    #[schema(format = DateTime)]
    created_at: String,
    /// When a worker last took it (RFC 3339).
    #[schema(format = DateTime)]
    started_at: Option<String>,
    /// When it ended (RFC 3339).
    #[schema(format = DateTime)]
    finished_at: Option<String>,
    /// Why it failed.
    error: Option<ProblemBody>,
    /// The model it made.
    model: Option<String>,
    /// Where to go from here.
    links: JobLinks,
}

/// Where a job is in its life.
#[derive(Serialize, ToSchema)]
#[schema(as = JobState)]
#[serde(rename_all = "snake_case")]
enum State_ {
    /// Waits for a worker.
    Queued,
    /// Is being computed.
    Running,
    /// Its result is there.
    Succeeded,
    /// See `error`.
    Failed,
    /// Somebody ended it.
    Cancelled,
}

/// Paths of one job and of its results.
#[derive(Serialize, ToSchema)]
struct JobLinks {
    /// This job.
    #[serde(rename = "self")]
    itself: String,
    /// Its changes as server-sent events.
    events: String,
    /// Its volume.
    volume: String,
    /// The model it made.
    #[serde(skip_serializing_if = "Option::is_none")]
    model: Option<String>,
    /// The model's mesh.
    #[serde(skip_serializing_if = "Option::is_none")]
    mesh: Option<String>,
    /// The model's quality report.
    #[serde(skip_serializing_if = "Option::is_none")]
    report: Option<String>,
}

/// A page of jobs.
#[derive(Serialize, ToSchema)]
pub struct JobList {
    /// The jobs, newest first.
    jobs: Vec<Job>,
    /// `cursor` of the next page; absent on the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    next_cursor: Option<String>,
}

impl From<JobState> for State_ {
    fn from(state: JobState) -> Self {
        match state {
            JobState::Queued => State_::Queued,
            JobState::Running => State_::Running,
            JobState::Succeeded => State_::Succeeded,
            JobState::Failed => State_::Failed,
            JobState::Cancelled => State_::Cancelled,
        }
    }
}

/// A job as a client sees it.
pub async fn describe(app: &App, job: jobs::Job) -> Answer<Job> {
    let standing = match job.state {
        JobState::Queued => Some(app.queue.standing(&job).await?),
        _ => None,
    };
    let now = app.queue.clock.now();
    let model = job.result.as_ref().map(|id| format!("/v1/models/{id}"));
    let itself = format!("/v1/jobs/{}", job.id);
    Ok(Job {
        state: job.state.into(),
        queue_position: standing.map(|s| s.position),
        estimated_start: standing
            .and_then(|s| s.starts_in_ms)
            .map(|ms| rfc3339(now.saturating_add(ms as i64))),
        error: job.failure.map(|f| Problem::from(f).into_body()),
        created_at: rfc3339(job.created_at),
        started_at: job.started_at.map(rfc3339),
        finished_at: job.finished_at.map(rfc3339),
        links: JobLinks {
            events: format!("{itself}/events"),
            itself,
            volume: format!("/v1/volumes/{}", job.volume),
            mesh: model.as_ref().map(|path| format!("{path}/mesh")),
            report: model.as_ref().map(|path| format!("{path}/report")),
            model,
        },
        id: job.id,
        kind: job.kind,
        volume: job.volume,
        parameters: job.parameters,
        stage: job.stage,
        progress: job.progress,
        attempts: job.attempts,
        cancel_requested: job.cancel_requested,
        revision: job.revision,
        model: job.result,
    })
}

/// File a job
///
/// The job is on the disk before the answer is on its way. With an `Idempotency-Key`, the same
/// request again gives the same job.
#[utoipa::path(post, path = "/v1/jobs", tag = "jobs",
    request_body(content = super::openapi::JobRequest, content_type = "application/json"),
    params(super::openapi::IdempotencyHeader),
    responses(
        (status = 202, description = "Accepted", body = Job, headers(
            ("Location" = String, description = "The job's path"),
            ("Retry-After" = u64, description = "Seconds after which to look again"))),
        super::openapi::FileProblems,
    ))]
pub async fn create_job(
    State(app): State<App>,
    RawQuery(query): RawQuery,
    request: Request,
) -> Answer {
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    let key = idempotency::key(request.headers())?;
    let object = request::json_object(&app, request).await?;
    let job = read_job(&app, &object, key)?;
    let job = file(&app, &job).await?;
    accepted(&app, job).await
}

const FIELDS: [&str; 3] = ["kind", "volume", "parameters"];

fn read_job(app: &App, object: &Map<String, Value>, key: Option<String>) -> Answer<NewJob> {
    if let Some(name) = object.keys().find(|name| !FIELDS.contains(&name.as_str())) {
        return Err(unknown("field", name, &FIELDS));
    }
    let kind = text(object, "kind")?.unwrap_or("model");
    let Some(work) = app.engine.work(kind) else {
        let kinds: Vec<_> = app.engine.works.iter().map(|w| w.kind()).collect();
        return Err(wrong(
            "kind",
            format!("There is no kind of job `{}`.", shorten(kind)),
        )
        .fix(format!("Known kinds: {}.", kinds.join(", "))));
    };
    let volume = text(object, "volume")?
        .ok_or_else(|| wrong("volume", "`volume` is missing.").fix("Give the id of a volume."))?;
    let empty = Map::new();
    let parameters = match object.get("parameters") {
        None => &empty,
        Some(Value::Object(parameters)) => parameters,
        Some(_) => {
            return Err(wrong("parameters", "`parameters` is no object.")
                .fix("Give an object such as {\"points\": 150}."));
        }
    };
    let parameters = work.parameters_from_json(parameters)?;
    Ok(NewJob {
        kind: kind.to_owned(),
        volume: volume.to_owned(),
        idempotency: idempotency::promise(key, kind, volume, &parameters),
        parameters,
    })
}

fn text<'a>(object: &'a Map<String, Value>, name: &str) -> Answer<Option<&'a str>> {
    match object.get(name) {
        None => Ok(None),
        Some(Value::String(text)) => Ok(Some(text)),
        Some(_) => Err(wrong(name, format!("`{name}` is no text.")).fix("Give a string.")),
    }
}

fn wrong(field: &str, detail: impl Into<String>) -> Problem {
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
        Filed::NoVolume => Err(wrong(
            "volume",
            format!("There is no volume `{}`.", shorten(&job.volume)),
        )
        .fix("POST the file to /v1/volumes first.")),
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
        JobState::Queued => app.queue.standing(&job).await?.starts_in_ms,
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

/// List jobs
#[utoipa::path(get, path = "/v1/jobs", tag = "jobs",
    params(super::openapi::PageParameters,
        ("state" = Option<State_>, Query, description = "Only jobs of this state")),
    responses((status = 200, description = "A page, newest first", body = JobList), ListProblems))]
pub async fn list_jobs(State(app): State<App>, RawQuery(query): RawQuery) -> Answer<Json<JobList>> {
    let (page, [state]) = list_query(query.as_deref(), ["state"])?;
    let state = state.map(|name| parse_state(&name)).transpose()?;
    let page = app.queue.jobs.jobs(state, page).await?;
    let next_cursor = next_cursor(&page);
    let mut jobs = Vec::with_capacity(page.items.len());
    for job in page.items {
        jobs.push(describe(&app, job).await?);
    }
    Ok(Json(JobList { jobs, next_cursor }))
}

fn parse_state(name: &str) -> Answer<JobState> {
    JobState::parse(name).ok_or_else(|| {
        Problem::bad_request(
            "invalid-parameter",
            format!("There is no state `{}`.", shorten(name)),
        )
        .at("state")
        .fix(format!(
            "Give one of {}.",
            JobState::ALL.map(JobState::as_str).join(", ")
        ))
    })
}

/// State of a job
#[utoipa::path(get, path = "/v1/jobs/{id}", tag = "jobs",
    params(("id" = String, Path, description = "The job's id")),
    responses((status = 200, description = "The job", body = Job), LookupProblems))]
pub async fn get_job(
    State(app): State<App>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
) -> Answer {
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    let job = find(&app, &id).await?;
    let mut headers = HeaderMap::new();
    headers.insert(
        header::CACHE_CONTROL,
        header::HeaderValue::from_static("no-store"),
    );
    if !job.state.is_final() {
        headers.insert(header::RETRY_AFTER, header::HeaderValue::from_static("1"));
    }
    Ok((headers, Json(describe(&app, job).await?)).into_response())
}

/// End or erase a job
///
/// A job that waits is cancelled at once; one that runs is asked to stop and does so within
/// 100 ms; one that has ended is erased, its model stays.
#[utoipa::path(delete, path = "/v1/jobs/{id}", tag = "jobs",
    params(("id" = String, Path, description = "The job's id")),
    responses(
        (status = 200, description = "It waited and is cancelled", body = Job),
        (status = 202, description = "It runs and is asked to stop", body = Job),
        (status = 204, description = "It had ended and is erased"),
        LookupProblems))]
pub async fn delete_job(
    State(app): State<App>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
) -> Answer {
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    let (status, job) = match app.queue.interrupt(&id).await? {
        Interrupted::Cancelled(job) => (StatusCode::OK, job),
        Interrupted::Asked(job) => (StatusCode::ACCEPTED, job),
        Interrupted::Unknown => return Err(missing(&*app.queue.catalogue, "job", &id).await),
        Interrupted::Finished(_) => {
            return match app.queue.erase(&id).await? {
                Deleted::Done => Ok(StatusCode::NO_CONTENT.into_response()),
                _ => Err(missing(&*app.queue.catalogue, "job", &id).await),
            };
        }
    };
    Ok((status, Json(describe(&app, job).await?)).into_response())
}

/// The job of that id, or why there is none.
pub async fn find(app: &App, id: &str) -> Answer<jobs::Job> {
    match app.queue.jobs.job(id).await? {
        Some(job) => Ok(job),
        None => Err(missing(&*app.queue.catalogue, "job", id).await),
    }
}

/// The problem of a job that did not succeed, as the answer to whoever waited for it.
pub fn failed(job: &jobs::Job) -> Response {
    let problem: Problem = match &job.failure {
        Some(failure) => failure.clone().into(),
        None => problem::Problem::new(
            StatusCode::CONFLICT,
            "cancelled",
            "The job was cancelled while this request waited for it.",
        ),
    };
    problem.of_job(&job.id).into_response()
}
