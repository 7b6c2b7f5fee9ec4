//! `/v1/jobs`: what was asked for and how far it is.

pub mod order;
mod wire;

pub use wire::{Job, describe};

use super::app::App;
use super::idempotency;
use super::openapi::{ListProblems, LookupProblems};
use super::pagination::{list_query, next_cursor};
use super::problem::{Answer, Problem, shorten};
use super::request::{self, Path, query_pairs, refuse_unknown, unknown};
use super::wire::missing;
use crate::jobs::{self, Deleted, Interrupted, JobState, NewJob, Resource};
use axum::Json;
use axum::extract::{RawQuery, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::IntoResponse;
use order::wrong;
use serde::Serialize;
use serde_json::{Map, Value};
use utoipa::ToSchema;
use wire::JobStateName;

/// A page of jobs.
#[derive(Serialize, ToSchema)]
pub struct JobList {
    /// The jobs, newest first.
    jobs: Vec<Job>,
    /// `cursor` of the next page; absent on the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    next_cursor: Option<String>,
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
    let job = order::file(&app, &job).await?;
    order::accepted(&app, job).await
}

const FIELDS: [&str; 3] = ["kind", "volume", "parameters"];

fn read_job(app: &App, object: &Map<String, Value>, key: Option<String>) -> Answer<NewJob> {
    if let Some(name) = object.keys().find(|name| !FIELDS.contains(&name.as_str())) {
        return Err(unknown("field", name, &FIELDS));
    }
    let kind = text(object, "kind")?.unwrap_or("model");
    let Some(work) = app.engine.work(kind) else {
        let kinds: Vec<_> = app.engine.works.iter().map(|w| w.makes().noun()).collect();
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
    Ok(order::new_job(&**work, volume.to_owned(), parameters, key))
}

fn text<'a>(object: &'a Map<String, Value>, name: &str) -> Answer<Option<&'a str>> {
    match object.get(name) {
        None => Ok(None),
        Some(Value::String(text)) => Ok(Some(text)),
        Some(_) => Err(wrong(name, format!("`{name}` is no text.")).fix("Give a string.")),
    }
}

/// List jobs
#[utoipa::path(get, path = "/v1/jobs", tag = "jobs",
    params(super::openapi::PageParameters,
        ("state" = Option<JobStateName>, Query, description = "Only jobs of this state")),
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
/// 100 ms; one that has ended is erased, what it made stays.
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
        Interrupted::Unknown => {
            return Err(missing(&*app.queue.catalogue, Resource::Job, &id).await);
        }
        Interrupted::Finished(_) => {
            return match app.queue.erase(&id).await? {
                Deleted::Done => Ok(StatusCode::NO_CONTENT.into_response()),
                _ => Err(missing(&*app.queue.catalogue, Resource::Job, &id).await),
            };
        }
    };
    Ok((status, Json(describe(&app, job).await?)).into_response())
}

/// The job of that id, or why there is none.
pub async fn find(app: &App, id: &str) -> Answer<jobs::Job> {
    match app.queue.jobs.job(id).await? {
        Some(job) => Ok(job),
        None => Err(missing(&*app.queue.catalogue, Resource::Job, id).await),
    }
}
