//! Filing a job: the row is on disk before the client reads 202.
//!
//! `POST /v1/jobs` names a stored volume; [`file_upload`] takes a request that carries the volume
//! itself, and may wait for the result (`Prefer: wait`).

use super::{describe, priority};
use crate::app::App;
use crate::caller::Caller;
use crate::given_webhook::GivenWebhook;
use crate::problem::not_found::field_names_nothing;
use crate::problem::{Answer, Problem};
use crate::products::{self, Offer};
use crate::request::query_pairs;
use crate::upload::{self, Upload};
use crate::wire::path_of;
use crate::{idempotency, negotiate, observe, tags};
use axum::Json;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::time::Duration;
use ventriform_service::jobs::Work;
use ventriform_service::records::{
    Filed, Job, JobState, JobWebhook, NewJob, Priority, Resource, SendOrder, SeriesSource, Tags,
    Tenant,
};

/// Least and greatest `Retry-After`, seconds.
const RETRY_AFTER: (f64, f64) = (1.0, 60.0);

/// A job on a volume that comes with the request.
pub struct UploadJob {
    /// What the job makes.
    pub makes: Resource,
    /// Names of a form's files that are volumes of their own. Their ids become the parameters of
    /// the same names.
    pub apart: &'static [&'static str],
    /// What a client that waits may ask for.
    pub offers: Vec<Offer>,
}

/// Stores the volume of the request, files a job, and answers 202. With `Prefer: wait`, waits for
/// the job to end and answers with the offer that `Accept` rates highest.
pub async fn file_upload(
    app: &App,
    caller: &Caller,
    job: UploadJob,
    query: Option<&str>,
    request: Request,
) -> Answer {
    let headers = request.headers().clone();
    let patience = negotiate::preferred_wait(&headers);
    if patience.is_some() {
        products::choose(&headers, &job.offers)?;
    }
    let key = idempotency::key(&headers)?;
    let kind = job.makes.noun();
    let Some(work) = app.engine.work(kind) else {
        return Err(Problem::internal(format!("no work of kind `{kind}`")));
    };
    // Whatever can be refused without the body is refused before the body is read.
    let mut pairs = query_pairs(query);
    let webhook = match GivenWebhook::take_from(&mut pairs, &headers)? {
        Some(given) => Some(given.of_job(app).await?),
        None => None,
    };
    let mut given = pairs.clone();
    let priority = priority::take(&mut pairs)?;
    let (tags, mut pairs) = tags::take(app, pairs)?;
    let tenant = &caller.tenant;
    let mut filing = Filing {
        tenant: tenant.clone(),
        tags,
        priority,
        key,
        webhook,
        source: None,
        send: None,
        trace_parent: observe::trace_parent(&request),
        storage_limit: caller.quota.bytes,
    };
    let mut parameters = work.parameters_from_text(&pairs)?;
    // A repeated request gets its job, whatever has become of the queue and of what it names.
    if !key_was_used(app, tenant, filing.key.as_deref()).await? {
        require(app, tenant, &work.needs(&parameters).items).await?;
        if app.queue.is_full(tenant).await? {
            return Err(queue_full(app).await);
        }
    }
    let mut upload = upload::receive(app, request, job.apart).await?;
    let fields = !upload.fields.is_empty();
    if fields {
        given.append(&mut upload.fields);
        filing.priority = priority::take(&mut given)?;
        (filing.tags, pairs) = tags::take(app, given)?;
    }
    if let Some(filed) = filed_earlier(app, &**work, &pairs, &mut upload, &filing).await? {
        let filed = accept(app, tenant, filed).await?;
        return answer(app, filed, patience, &headers, &job.offers).await;
    }
    // Held until the job is filed: from then on the job keeps them.
    let mut pins = Vec::new();
    for (name, files) in upload.others {
        let stored = files
            .store(app, tenant, &filing.tags)
            .await
            .map_err(|p| p.at(name))?;
        pairs.push((name.to_owned(), stored.volume.id.clone()));
        pins.push(stored.pin);
    }
    if fields || !pins.is_empty() {
        parameters = work.parameters_from_text(&pairs)?;
    }
    let stored = upload.volume.store(app, tenant, &filing.tags).await?;
    pins.push(stored.pin);
    let volume = Some(stored.volume.item.id);
    let filed = file(app, &new_job(&**work, volume, parameters, filing)).await?;
    drop(pins);
    answer(app, filed, patience, &headers, &job.offers).await
}

/// The answer about a filed job, after waiting for its end if the client prefers that.
async fn answer(
    app: &App,
    filed: Job,
    patience: Option<Duration>,
    headers: &HeaderMap,
    offers: &[Offer],
) -> Answer {
    match patience {
        Some(patience) => wait(app, filed, patience, headers, offers).await,
        None => accepted(app, filed).await,
    }
}

/// What a request says about a job besides its work.
#[derive(Clone)]
pub struct Filing {
    /// Whose job it is.
    pub tenant: Tenant,
    /// The tenant's names for the job.
    pub tags: Tags,
    /// How urgent it is.
    pub priority: Priority,
    /// Its idempotency key.
    pub key: Option<String>,
    /// Where the job is told about.
    pub webhook: Option<JobWebhook>,
    /// Where its volume comes from, unless it is stored.
    pub source: Option<SeriesSource>,
    /// What of its result is sent to an archive.
    pub send: Option<SendOrder>,
    /// The request's trace context.
    pub trace_parent: Option<String>,
    /// Bytes that the tenant may store in all once the result is added.
    pub storage_limit: Option<u64>,
}

/// Whether an earlier request of the tenant was accepted under that key.
async fn key_was_used(app: &App, tenant: &Tenant, key: Option<&str>) -> Answer<bool> {
    let Some(key) = key else {
        return Ok(false);
    };
    Ok(app.queue.table().filed_under(tenant, key).await?.is_some())
}

/// What became of the key of this upload, if it was used before: ids are hashes, so the request can
/// be compared without storing anything again.
async fn filed_earlier(
    app: &App,
    work: &dyn Work,
    pairs: &[(String, String)],
    upload: &mut Upload,
    filing: &Filing,
) -> Answer<Option<Filed>> {
    if filing.key.is_none() {
        return Ok(None);
    }
    let mut pairs = pairs.to_vec();
    for (name, files) in &mut upload.others {
        pairs.push(((*name).to_owned(), files.volume_id()));
    }
    let parameters = work.parameters_from_text(&pairs)?;
    let volume = Some(upload.volume.volume_id());
    let job = new_job(work, volume, parameters, filing.clone());
    let Some(promise) = job.idempotency else {
        return Ok(None);
    };
    let earlier = app
        .queue
        .table()
        .filed_under(&job.tenant, &promise.key)
        .await?;
    Ok(earlier.map(|(job, fingerprint)| promise.judge(job, &fingerprint)))
}

/// A job on a stored volume or on the series of its source, for [`file()`].
pub fn new_job(
    work: &dyn Work,
    volume: Option<String>,
    parameters: Map<String, Value>,
    filing: Filing,
) -> NewJob {
    let kind = work.makes().noun();
    let others = [
        filing.webhook.as_ref().map(|webhook| json!(webhook)),
        filing.source.as_ref().map(|source| json!(source)),
        filing.send.as_ref().map(|send| json!(send)),
        (filing.priority != Priority::default())
            .then(|| json!({priority::FIELD: filing.priority.as_str()})),
    ];
    let others: Vec<Value> = others.into_iter().flatten().collect();
    NewJob {
        tenant: filing.tenant,
        kind: kind.into(),
        priority: filing.priority,
        idempotency: idempotency::promise(
            filing.key,
            kind,
            volume.as_deref(),
            &parameters,
            &filing.tags,
            &others,
        ),
        tags: filing.tags,
        needs: work.needs(&parameters).items,
        volume,
        parameters,
        webhook: filing.webhook,
        source: filing.source,
        send: filing.send,
        trace_parent: filing.trace_parent,
        storage_limit: filing.storage_limit,
    }
}

async fn wait(
    app: &App,
    job: Job,
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
            let product = products::find_any(app, &job.tenant, id).await?;
            let offer = products::choose(headers, offers)?;
            let asker = products::Asker::filer(&job.tenant);
            // The conditional headers of this request concern the upload, not the result.
            let mut response =
                products::send(app, asker, &product, offer, &HeaderMap::new()).await?;
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

/// Refuses a parameter that names something that does not exist.
async fn require(app: &App, tenant: &Tenant, needs: &BTreeMap<String, String>) -> Answer<()> {
    for (field, id) in needs {
        let there = match Resource::of(id) {
            Some(Resource::Volume) => app
                .queue
                .items()
                .catalogue()
                .volume(tenant, id)
                .await?
                .is_some(),
            _ => app
                .queue
                .items()
                .catalogue()
                .product(tenant, id)
                .await?
                .is_some(),
        };
        if !there {
            return Err(
                field_names_nothing(app.queue.items().catalogue(), tenant, field, id).await?,
            );
        }
    }
    Ok(())
}

/// Files a job. The same request under the same idempotency key returns the first job.
///
/// # Errors
/// 422 if something it needs does not exist or the key was used for another request, 429 if the
/// queue is full.
pub async fn file(app: &App, job: &NewJob) -> Answer<Job> {
    let filed = app.queue.file(job).await?;
    accept(app, &job.tenant, filed).await
}

async fn accept(app: &App, tenant: &Tenant, filed: Filed) -> Answer<Job> {
    match filed {
        Filed::New(job) | Filed::Same(job) => Ok(job),
        Filed::QueueFull => Err(queue_full(app).await),
        Filed::KeyReused => Err(Problem::new(
            StatusCode::UNPROCESSABLE_ENTITY,
            "idempotency-key-reused",
            "This key was already used for another request.",
        )
        .at("Idempotency-Key")
        .fix("Use a new key for each new request.")),
        Filed::Missing { field, id } => {
            Err(field_names_nothing(app.queue.items().catalogue(), tenant, &field, &id).await?)
        }
    }
}

/// 429 of a full queue.
async fn queue_full(app: &App) -> Problem {
    let seconds = match app.queue.table().load().await {
        Ok(load) => load.mean_duration_ms.unwrap_or_default() / 1000.0,
        Err(_) => RETRY_AFTER.1,
    };
    Problem::new(
        StatusCode::TOO_MANY_REQUESTS,
        "queue-full",
        format!(
            "{} jobs are already waiting, so this request was not accepted.",
            app.settings.queue_limit
        ),
    )
    .fix("Try again after the number of seconds in Retry-After.")
    .header(header::RETRY_AFTER, retry_after(seconds))
}

fn retry_after(seconds: f64) -> String {
    (seconds.clamp(RETRY_AFTER.0, RETRY_AFTER.1).ceil() as u64).to_string()
}

/// 202 with the job.
pub async fn accepted(app: &App, job: Job) -> Answer {
    let starts_in_ms = match job.state {
        JobState::Queued => {
            let positions = app.queue.positions(std::slice::from_ref(&job)).await?;
            positions.get(&job.sequence).and_then(|p| p.starts_in_ms)
        }
        _ => None,
    };
    let headers = [
        (header::LOCATION, path_of(&job.id)),
        (
            header::RETRY_AFTER,
            retry_after(starts_in_ms.unwrap_or_default() / 1000.0),
        ),
    ];
    let body = Json(describe(app, job).await?);
    Ok((StatusCode::ACCEPTED, headers, body).into_response())
}

/// The problem of a job that did not succeed, for the client that waited for it.
fn failed(job: &Job) -> Response {
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
