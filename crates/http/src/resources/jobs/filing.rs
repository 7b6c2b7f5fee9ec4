//! Filing a job: the row is on disk before the client reads 202.
//!
//! `POST /v1/jobs` names a stored volume; [`file_upload`] takes a request that carries the volume
//! itself, [`JsonOrder`] one that names what is stored. Both may wait for the result (`Prefer: wait`).

use super::describe;
use super::priority::PriorityQuery;
use crate::app::App;
use crate::edge::caller::Caller;
use crate::edge::observe;
use crate::edge::quota::{reserve_job, reserve_upload};
use crate::resources::products::{self, Offer};
use crate::resources::tags::TagQuery;
use crate::wire::fields::FieldReader;
use crate::wire::idempotency;
use crate::wire::job_fields::{OrderFields, SendFields};
use crate::wire::links::path_of;
use crate::wire::negotiate;
use crate::wire::problem::{Answer, Problem};
use crate::wire::query::QueryReader;
use crate::wire::upload::{self, Upload};
use crate::wire::webhook_request::{WebhookRequest, job_webhook, webhook_of_upload};
use axum::Json;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Map, Value};
use std::time::Duration;
use ventriform_service::base::error::ServiceError;
use ventriform_service::base::records::{Job, JobState, Priority, Resource, Tags};
use ventriform_service::callers::Scope;
use ventriform_service::jobs::Work;
use ventriform_service::limits::quotas::Counting;
use ventriform_service::use_cases::filing::JobOrder;

/// Least and greatest `Retry-After`, seconds.
const RETRY_AFTER_S: (f64, f64) = (1.0, 60.0);

/// A job on a volume that comes with the request.
pub struct UploadJob {
    /// The kind of its result.
    pub makes: Resource,
    /// Names of a form's files that are volumes of their own. Their ids become the parameters of
    /// the same names.
    pub apart: &'static [&'static str],
    /// The answers that a client which waits may ask for.
    pub offers: Vec<Offer>,
}

/// Stores the volume of the request, files a job, and answers 202. With `Prefer: wait`, waits for
/// the job to end and answers with the offer that `Accept` rates highest.
pub async fn file_upload(
    app: &App,
    caller: &Caller,
    job: UploadJob,
    mut query: QueryReader,
    request: Request,
) -> Answer {
    let (service, tenant) = (&app.service, &caller.tenant);
    let headers = request.headers().clone();
    // Ends with the answer: a request that waits for its job counts as a waiting job.
    let counting = reserve_upload(app, caller, &headers, 1).await?;
    let patience = negotiate::preferred_wait(&headers);
    if patience.is_some() {
        products::choose(&headers, &job.offers)?;
    }
    let key = idempotency::key(&headers)?;
    let work = service.work_of(job.makes.noun())?;
    // Whatever can be refused without the body is refused before the body is read.
    let webhook = webhook_of_upload(app, query.take()?, &headers).await?;
    let mut given = query.rest();
    let mut stated = Stated::from_pairs(app, given.clone())?;
    let mut order = JobOrder {
        tags: stated.tags,
        priority: stated.priority,
        key,
        webhook,
        trace_parent: observe::trace_parent(&request),
        ..JobOrder::new(caller.by.clone(), tenant.clone(), caller.quota)
    };
    let mut parameters = work.parameters_from_text(&stated.parameters)?;
    // A repeated request gets its job, whatever has become of the queue and of what it names.
    if !service.is_filed(tenant, order.key.as_deref()).await? {
        let needs = work.needs(&parameters).items;
        service.require_fileable(tenant, &needs).await?;
    }
    let mut upload = upload::receive(app, counting.clone(), request, job.apart).await?;
    let fields = !upload.fields.is_empty();
    if fields {
        given.append(&mut upload.fields);
        stated = Stated::from_pairs(app, given)?;
        (order.tags, order.priority) = (stated.tags, stated.priority);
    }
    let mut pairs = stated.parameters;
    if let Some(filed) = filed_earlier(app, work, &pairs, &mut upload, &order).await? {
        return answer(app, caller, filed, patience, &headers, &job.offers).await;
    }
    // Pinned until the job is filed: from then on the job keeps them.
    let mut pins = Vec::new();
    for (name, files) in upload.others {
        let stored = service.store_volume(&caller.by, tenant, files, &order.tags);
        let stored = stored.await.map_err(|error| error.for_sender().at(name))?;
        pairs.push((name.to_owned(), stored.volume.id.clone()));
        pins.push(stored.pin);
    }
    if fields || !pins.is_empty() {
        parameters = work.parameters_from_text(&pairs)?;
    }
    let stored = service
        .store_volume(&caller.by, tenant, upload.volume, &order.tags)
        .await
        .map_err(ServiceError::for_sender)?;
    pins.push(stored.pin);
    let volume = Some(stored.volume.item.id);
    let filed = service
        .file_job(work, volume, parameters, order, &counting)
        .await?;
    drop(pins);
    answer(app, caller, filed, patience, &headers, &job.offers).await
}

/// A request in JSON for a job that may be waited for.
pub struct JsonOrder<'a> {
    app: &'a App,
    caller: &'a Caller,
    makes: Resource,
    offers: Vec<Offer>,
    headers: HeaderMap,
    trace_parent: Option<String>,
    /// Ends with the answer: a request that waits for its job counts as a waiting job.
    counting: Counting,
    patience: Option<Duration>,
    fields: OrderFields,
    send: SendFields,
}

impl<'a> JsonOrder<'a> {
    /// Reads the request for a job that makes a result of that kind, as which a client which waits may ask for one of
    /// `offers`. Returns it beside the fields of the body that not every job has.
    ///
    /// # Errors
    /// If there is no room for the job, none of the offers is acceptable, or the body cannot be used.
    pub async fn read(
        app: &'a App,
        caller: &'a Caller,
        makes: Resource,
        offers: Vec<Offer>,
        request: Request,
    ) -> Answer<(Self, FieldReader)> {
        let headers = request.headers().clone();
        let counting = reserve_job(app, caller, &headers).await?;
        let patience = negotiate::preferred_wait(&headers);
        if patience.is_some() {
            products::choose(&headers, &offers)?;
        }
        let trace_parent = observe::trace_parent(&request);
        let mut body = FieldReader::read(app, request).await?;
        let (fields, send) = (body.take()?, body.take()?);
        let order = Self {
            app,
            caller,
            makes,
            offers,
            headers,
            trace_parent,
            counting,
            patience,
            fields,
            send,
        };
        Ok((order, body))
    }

    /// Checks the fields that every job has.
    ///
    /// # Errors
    /// Those of [`OrderFields::order`] and [`SendFields::order`].
    pub fn checked(self) -> Answer<CheckedOrder<'a>> {
        let Self { app, caller, .. } = self;
        let work = app.service.work_of(self.makes.noun())?;
        let order = (self.fields).order(app, caller, &self.headers, self.trace_parent)?;
        let (mut order, webhook) = order;
        order.send = self
            .send
            .order(app, &order.tenant, self.makes.noun(), None)?;
        Ok(CheckedOrder {
            app,
            caller,
            work,
            offers: self.offers,
            headers: self.headers,
            counting: self.counting,
            patience: self.patience,
            order,
            webhook,
        })
    }
}

/// A [`JsonOrder`] whose fields can be used.
pub struct CheckedOrder<'a> {
    app: &'a App,
    caller: &'a Caller,
    /// The work of the job.
    pub work: &'a dyn Work,
    offers: Vec<Offer>,
    headers: HeaderMap,
    counting: Counting,
    patience: Option<Duration>,
    order: JobOrder,
    webhook: Option<WebhookRequest>,
}

impl CheckedOrder<'_> {
    /// Files the job on that volume, and answers as [`answer`] does. `named` are the fields of the job's inputs, each with
    /// the name that the request has for it.
    ///
    /// # Errors
    /// If the webhook cannot be used, or the job cannot be filed.
    pub async fn file(
        mut self,
        volume: String,
        parameters: Map<String, Value>,
        named: &[(String, String)],
    ) -> Answer {
        let Self { app, caller, .. } = self;
        if let Some(webhook) = self.webhook {
            self.order.webhook = Some(job_webhook(app, webhook).await?);
        }
        let filed = app.service.file_job(
            self.work,
            Some(volume),
            parameters,
            self.order,
            &self.counting,
        );
        let renamed = |error: ServiceError| {
            let named = named.iter();
            named.fold(error, |error, (inner, sent)| error.naming(inner, sent))
        };
        let filed = filed.await.map_err(renamed)?;
        answer(
            app,
            caller,
            filed,
            self.patience,
            &self.headers,
            &self.offers,
        )
        .await
    }
}

/// The statements of an upload about its job, in the query or the form.
struct Stated {
    priority: Priority,
    tags: Tags,
    parameters: Vec<(String, String)>,
}

impl Stated {
    fn from_pairs(app: &App, pairs: Vec<(String, String)>) -> Answer<Self> {
        let mut reader = QueryReader::of_pairs(pairs);
        Ok(Self {
            priority: reader.take::<PriorityQuery>()?.priority()?,
            tags: reader.take::<TagQuery>()?.tags(app)?,
            parameters: reader.rest(),
        })
    }
}

/// The job that an earlier request of the same upload got under the same key.
async fn filed_earlier(
    app: &App,
    work: &dyn Work,
    pairs: &[(String, String)],
    upload: &mut Upload,
    order: &JobOrder,
) -> Answer<Option<Job>> {
    if order.key.is_none() {
        return Ok(None);
    }
    let mut pairs = pairs.to_vec();
    for (name, files) in &mut upload.others {
        pairs.push(((*name).to_owned(), files.volume_id()));
    }
    let parameters = work.parameters_from_text(&pairs)?;
    let volume = Some(upload.volume.volume_id());
    let earlier = app
        .service
        .filed_earlier(work, volume, parameters, order.clone());
    Ok(earlier.await?)
}

/// The answer about a filed job, after waiting for its end if the client prefers that.
pub async fn answer(
    app: &App,
    caller: &Caller,
    filed: Job,
    patience: Option<Duration>,
    headers: &HeaderMap,
    offers: &[Offer],
) -> Answer {
    match patience {
        Some(patience) => wait(app, caller, filed, patience, headers, offers).await,
        None => accepted(app, filed).await,
    }
}

async fn wait(
    app: &App,
    caller: &Caller,
    job: Job,
    patience: Duration,
    headers: &HeaderMap,
    offers: &[Offer],
) -> Answer {
    let patience = patience.min(app.service.settings().wait_limit.0);
    let waited = tokio::select! {
        job = app.service.queue().wait(&job.id, patience) => job?,
        () = app.service.closing().cancelled() => None,
        // The job was filed with valid credentials. What has become of it is not for those who have them no more.
        () = caller.watch.ended() => None,
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

fn retry_after(seconds: f64) -> String {
    (seconds.clamp(RETRY_AFTER_S.0, RETRY_AFTER_S.1).ceil() as u64).to_string()
}

/// 202 with the job.
pub async fn accepted(app: &App, job: Job) -> Answer {
    let starts_in_ms = match job.state {
        JobState::Queued => {
            let positions = app
                .service
                .queue()
                .positions(std::slice::from_ref(&job))
                .await?;
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
    let body = Json(describe(app, Scope::Submit, job).await?);
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
