//! `/v1/jobs`: jobs are filed, followed, cancelled and erased.

pub mod archives;
pub mod events;
pub mod filing;

mod body;
mod order;
mod priority;

pub use body::{JobBody, ObjectDeliveryBody, describe, describe_all};
pub use priority::PriorityQuery;

use crate::app::App;
use crate::edge::caller::Caller;
use crate::edge::observe;
use crate::edge::quota::reserve_job;
use crate::openapi::{self, FileProblems, ListProblems, LookupProblems};
use crate::resources::scans::{self, ScanQuery};
use crate::resources::tags::{self, TagQuery};
use crate::wire::fields::FieldReader;
use crate::wire::job_fields::{JobFields, OrderFields, SendFields};
use crate::wire::pagination::{PageQuery, next_cursor};
use crate::wire::problem::not_found::missing;
use crate::wire::problem::{Answer, Problem, ProblemBody};
use crate::wire::query::{Moment, NoQuery, Query};
use crate::wire::request::PathSegments;
use crate::wire::validators::ValidatedJson;
use crate::wire::webhook_request::job_webhook;
use crate::wire::words::{JobStateName, PriorityName};
use axum::Json;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::IntoResponse;
use futures::{FutureExt, TryFutureExt};
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
use utoipa::{IntoParams, ToSchema};
use ventriform_service::base::records::{
    Deleted, Interrupted, Job, JobFilter, Resource, SeriesSource, Tenant,
};

/// A page of jobs.
#[derive(Serialize, ToSchema)]
pub struct JobList {
    /// The jobs, newest first.
    jobs: Vec<JobBody>,
    /// `cursor` of the next page; absent on the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    next_cursor: Option<String>,
}

/// File a job
///
/// The job is stored on disk before the service answers. With an `Idempotency-Key`, repeating the
/// request returns the same job.
#[utoipa::path(post, path = "/v1/jobs", tag = "jobs",
    request_body(content = openapi::JobRequest, content_type = "application/json"),
    params(openapi::IdempotencyHeader),
    responses(
        (status = 202, description = "Accepted", body = JobBody, headers(
            ("Location" = String, description = "The job's path"),
            ("Retry-After" = u64, description = "Seconds to wait before asking for its state"))),
        FileProblems,
    ))]
pub async fn create_job(
    State(app): State<App>,
    caller: Caller,
    _: NoQuery,
    request: Request,
) -> Answer {
    let headers = request.headers().clone();
    let counting = reserve_job(&app, &caller, &headers).await?;
    let trace_parent = observe::trace_parent(&request);
    let mut body = FieldReader::read(&app, request).await?;
    let (order, send): (OrderFields, SendFields) = (body.take()?, body.take()?);
    let job: JobFields = body.all()?;
    let (mut order, webhook) = order.order(&app, &caller, &headers, trace_parent)?;
    let kind = job.kind.as_deref().unwrap_or("model");
    if kind == Resource::Reading.noun() {
        let elsewhere = "A reading is signed, not filed as any other job.";
        return Err(Problem::invalid_field("kind", elsewhere).fix("Send it to POST /v1/readings."));
    }
    let work = app.service.work_of(kind)?;
    if let Some(source) = job.source {
        order.source = Some(source.checked(&app, &order.tenant).await?);
    }
    order.send = send.order(&app, &order.tenant, kind, order.source.as_ref())?;
    require_input(job.volume.as_deref(), order.source.as_ref())?;
    let parameters = work.parameters_from_json(&job.parameters)?;
    if let Some(webhook) = webhook {
        order.webhook = Some(job_webhook(&app, webhook).await?);
    }
    let filed = app
        .service
        .file_job(work, job.volume, parameters, order, &counting);
    filing::accepted(&app, filed.await?).await
}

/// Refuses a job that has neither a volume nor a source, or both.
fn require_input(volume: Option<&str>, source: Option<&SeriesSource>) -> Answer<()> {
    match (volume, source) {
        (None, None) => Err(Problem::invalid_field("volume", "`volume` is missing.")
            .fix("Give the id of a stored volume, or in `source` a series of an archive.")),
        (Some(_), Some(_)) => {
            let both = "A job has a `volume` or a `source`, not both.";
            Err(Problem::invalid_field("source", both).fix("Leave one of them out."))
        }
        _ => Ok(()),
    }
}

/// A search for jobs.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct JobQuery {
    /// Only jobs in this state
    state: Option<JobStateName>,
    /// Only jobs of this kind: model, segmentation, beat, comparison, normals
    kind: Option<String>,
    /// Only jobs of this priority
    priority: Option<PriorityName>,
    /// Only jobs on this volume
    volume: Option<String>,
    /// Only jobs filed after this moment (RFC 3339)
    #[param(value_type = Option<String>, format = DateTime)]
    created_after: Option<Moment>,
}

/// List jobs
#[utoipa::path(get, path = "/v1/jobs", tag = "jobs",
    params(PageQuery, TagQuery, ScanQuery, JobQuery),
    responses((status = 200, description = "A page, newest first", body = JobList), ListProblems))]
pub async fn list_jobs(
    State(app): State<App>,
    caller: Caller,
    Query((page, tags, scan, search)): Query<(PageQuery, TagQuery, ScanQuery, JobQuery)>,
) -> Answer<Json<JobList>> {
    let filter = JobFilter {
        tenant: caller.tenant,
        state: search.state.map(|word| word.0),
        kind: search.kind,
        priority: search.priority.map(|word| word.0),
        volume: search.volume,
        tags: tags.filter(&app)?,
        scan: scan.into(),
        created_after: search.created_after.map(|moment| moment.0),
    };
    let page = page.charged().await?;
    let page = app.service.jobs(&filter, page).await?;
    let next_cursor = next_cursor(&page);
    let jobs = describe_all(&app, caller.scope, page.items).await?;
    Ok(Json(JobList { jobs, next_cursor }))
}

/// Show a job
///
/// A job that has ended has a validator in `ETag`. For one that has not, `Retry-After` says when to
/// ask again.
#[utoipa::path(get, path = "/v1/jobs/{id}", tag = "jobs",
    params(("id" = String, Path, description = "The job's id"), openapi::CachedHeaders),
    responses((status = 200, description = "The job", body = JobBody),
        openapi::UnchangedAnswer, LookupProblems))]
pub async fn get_job(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
    headers: HeaderMap,
) -> Answer {
    let read = async || {
        let job = find(&app, &caller.tenant, &id).await?;
        let ended = job.state.is_final();
        let body = describe(&app, caller.scope, job).await?;
        Ok(if ended {
            ControlFlow::Continue(ValidatedJson::from_body(&body)?)
        } else {
            let ask_again = [
                (header::CACHE_CONTROL, "no-store"),
                (header::RETRY_AFTER, "1"),
            ];
            ControlFlow::Break((ask_again, Json(body)).into_response())
        })
    };
    let asker = (&caller.tenant, scans::sees_patients(caller.scope));
    let kept = app
        .answers
        .get(&app.service, asker, Resource::Job, &id, read);
    Ok(match kept.await? {
        ControlFlow::Continue(answer) => answer.answer(&headers),
        ControlFlow::Break(answer) => answer,
    })
}

/// Change a job's names
///
/// A JSON merge patch (RFC 7396) of `external_id` and `labels`: what is `null` is removed, what is
/// absent stays.
#[utoipa::path(patch, path = "/v1/jobs/{id}", tag = "jobs", operation_id = "update_job",
    params(("id" = String, Path, description = "The job's id")),
    request_body(content(
        (openapi::TagsPatch = "application/merge-patch+json"),
        (openapi::TagsPatch = "application/json"))),
    responses((status = 200, description = "The job", body = JobBody),
        openapi::PatchProblems, LookupProblems))]
pub async fn update_job(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
    request: Request,
) -> Answer<Json<JobBody>> {
    let tags_of = || {
        find(&app, &caller.tenant, &id)
            .map_ok(|job| job.tags)
            .boxed()
    };
    tags::change(&app, &caller, &id, request, tags_of).await?;
    let job = find(&app, &caller.tenant, &id).await?;
    Ok(Json(describe(&app, caller.scope, job).await?))
}

/// Whether a job is erased.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct EraseQuery {
    /// Whether to erase a job that was cancelled
    erase: Option<bool>,
}

/// Cancel or erase a job
///
/// A waiting job is cancelled at once; a running job is asked to stop and does so within 100 ms.
/// Repeating the request changes nothing more: a job that a client has cancelled is shown, not
/// erased, so a client that lost the answer can ask again. Any other finished job is erased, but
/// its result stays. With `erase=true`, a finished job is erased however it ended, and an
/// unfinished one is refused.
#[utoipa::path(delete, path = "/v1/jobs/{id}", tag = "jobs",
    params(("id" = String, Path, description = "The job's id"),
        EraseQuery),
    responses(
        (status = 200, description = "It is cancelled, or ended before it could be", body = JobBody),
        (status = 202, description = "It is running and was asked to stop", body = JobBody),
        (status = 204, description = "It was finished and is erased"),
        (status = 409, description = "It is not finished, so it cannot be erased",
            body = ProblemBody, content_type = "application/problem+json"),
        LookupProblems))]
pub async fn delete_job(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    Query(query): Query<EraseQuery>,
) -> Answer {
    let erase = query.erase.unwrap_or(false);
    let tenant = &caller.tenant;
    let job = find(&app, tenant, &id).await?;
    if erase && !job.state.is_final() {
        return Err(Problem::new(
            StatusCode::CONFLICT,
            "not-finished",
            "The job is not finished, so it cannot be erased.",
        )
        .fix("DELETE it without `erase` to cancel it, wait for its end, then erase it."));
    }
    let (status, job) = match app.service.interrupt_job(&caller.by, &id).await? {
        Interrupted::Cancelled(job) => (StatusCode::OK, job),
        Interrupted::Asked(job) => (StatusCode::ACCEPTED, job),
        Interrupted::Unknown => {
            return Err(missing(&app, tenant, Resource::Job, &id).await);
        }
        Interrupted::Finished(job) if job.cancel_requested && !erase => (StatusCode::OK, job),
        Interrupted::Finished(_) => {
            return match app.service.delete_job(&caller.by, &id).await? {
                Deleted::Done => Ok(StatusCode::NO_CONTENT.into_response()),
                _ => Err(missing(&app, tenant, Resource::Job, &id).await),
            };
        }
    };
    Ok((status, Json(describe(&app, caller.scope, job).await?)).into_response())
}

/// The tenant's job of that id, for which the request is charged, or the 404 or 410 that says why there is none.
pub async fn find(app: &App, tenant: &Tenant, id: &str) -> Answer<Job> {
    match app.service.job(tenant, id).await? {
        Some(job) => Ok(job),
        None => Err(missing(app, tenant, Resource::Job, id).await),
    }
}
