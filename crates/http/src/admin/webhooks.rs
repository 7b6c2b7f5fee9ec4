//! Webhooks over HTTP: the endpoints and the signing secret of a tenant, and what became of
//! deliveries.
//!
//! A secret is shown in the one answer to the request that made it, and never again.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::openapi::{FileProblems, ListProblems, LookupProblems};
use crate::resources::jobs::{self, ObjectDeliveryBody};
use crate::wire::fields::FieldReader;
use crate::wire::links::rfc3339;
use crate::wire::problem::{Answer, Problem, shorten};
use crate::wire::public_base::public_path;
use crate::wire::query::NoQuery;
use crate::wire::request::PathSegments;
use crate::wire::webhook_request::WebhookRequest;
use axum::Json;
use axum::extract::{Request, State};
use axum::http::{StatusCode, header};
use axum::response::IntoResponse;
use serde::Serialize;
use utoipa::ToSchema;
use ventriform_service::network::hooks::{Delivery, HookEndpoint};
use ventriform_service::use_cases::webhooks::{Redelivered, is_object_delivery};

/// A registered receiver.
#[derive(Serialize, ToSchema)]
#[schema(as = Webhook)]
pub struct WebhookBody {
    /// Its id.
    #[schema(example = "whk_019a8f4e7c2b7c3e9d5f6a7b8c9d0e1f")]
    id: String,
    /// Where it is.
    #[schema(example = "https://ris.example.org/hooks/ventriform")]
    url: String,
    /// The events that it is told.
    events: Vec<String>,
    /// When it was registered (RFC 3339).
    #[schema(format = DateTime)]
    created_at: String,
    /// Since when it answers 410 and is told nothing (RFC 3339).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(format = DateTime)]
    gone_at: Option<String>,
    /// What signs its deliveries; shown only when it is registered.
    #[serde(skip_serializing_if = "Option::is_none")]
    secret: Option<String>,
}

impl WebhookBody {
    fn new(endpoint: HookEndpoint, secret: Option<String>) -> Self {
        let events = endpoint
            .events
            .iter()
            .map(|event| event.as_str().to_owned());
        Self {
            events: events.collect(),
            created_at: rfc3339(endpoint.created_at),
            gone_at: endpoint.gone_at.map(rfc3339),
            id: endpoint.id,
            url: endpoint.url,
            secret,
        }
    }
}

/// The registered receivers.
#[derive(Serialize, ToSchema)]
pub struct WebhookList {
    /// The oldest first.
    webhooks: Vec<WebhookBody>,
}

/// A signing secret.
#[derive(Serialize, ToSchema)]
pub struct WebhookSecret {
    /// `whsec_` and base64, as the libraries of Standard Webhooks take it.
    #[schema(example = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw")]
    secret: String,
    /// Until when the secret before signs too (RFC 3339).
    #[schema(format = DateTime)]
    former_until: String,
}

/// Register a webhook
///
/// The receiver is told about every job of the caller's tenant, in requests signed after Standard
/// Webhooks. The answer shows the signing secret; no later answer does.
#[utoipa::path(post, path = "/v1/webhooks", tag = "webhooks",
    request_body(content = WebhookRequest, content_type = "application/json"),
    responses(
        (status = 201, description = "Registered", body = WebhookBody,
            headers(("Location" = String, description = "The webhook's path"))),
        FileProblems,
    ))]
pub async fn create_webhook(
    State(app): State<App>,
    caller: Caller,
    _: NoQuery,
    request: Request,
) -> Answer {
    let given: WebhookRequest = FieldReader::read(&app, request).await?.all()?;
    let registered = app.service.register_webhook(&caller.by, given.into());
    let (endpoint, secret) = registered.await?;
    let location = public_path(&format!("/v1/webhooks/{}", endpoint.id));
    let body = WebhookBody::new(endpoint, Some(secret.reveal()));
    let headers = [
        (header::LOCATION, location),
        (header::CACHE_CONTROL, "no-store".to_owned()),
    ];
    Ok((StatusCode::CREATED, headers, Json(body)).into_response())
}

/// List webhooks
#[utoipa::path(get, path = "/v1/webhooks", tag = "webhooks",
    responses((status = 200, description = "All, the oldest first", body = WebhookList), ListProblems))]
pub async fn list_webhooks(
    State(app): State<App>,
    caller: Caller,
    _: NoQuery,
) -> Answer<Json<WebhookList>> {
    let endpoints = app.service.webhooks(&caller.tenant).await?;
    let webhooks = endpoints.into_iter().map(|e| WebhookBody::new(e, None));
    Ok(Json(WebhookList {
        webhooks: webhooks.collect(),
    }))
}

/// Remove a webhook
///
/// What it has not been told yet is given up.
#[utoipa::path(delete, path = "/v1/webhooks/{id}", tag = "webhooks",
    params(("id" = String, Path, description = "The webhook's id")),
    responses((status = 204, description = "Removed"), LookupProblems))]
pub async fn delete_webhook(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
) -> Answer<StatusCode> {
    if app.service.remove_webhook(&caller.by, &id).await? {
        Ok(StatusCode::NO_CONTENT)
    } else {
        Err(nothing_here("webhook", &id, "GET /v1/webhooks"))
    }
}

/// Make a new signing secret
///
/// It signs deliveries that have no secret of their own. The secret before signs them too for a
/// day, so that receivers can change over. No later answer shows it.
#[utoipa::path(post, path = "/v1/webhooks/secret", tag = "webhooks",
    responses((status = 200, description = "The new secret", body = WebhookSecret), ListProblems))]
pub async fn create_webhook_secret(State(app): State<App>, caller: Caller, _: NoQuery) -> Answer {
    let renewed = app.service.renew_signing_secret(&caller.by);
    let (secret, until) = renewed.await?;
    let body = WebhookSecret {
        secret: secret.reveal(),
        former_until: rfc3339(until),
    };
    let headers = [(header::CACHE_CONTROL, "no-store")];
    Ok((headers, Json(body)).into_response())
}

/// A message about a job to one receiver.
#[derive(Serialize, ToSchema)]
#[schema(as = Delivery)]
pub struct DeliveryBody {
    /// Its id; the header `webhook-id` of every attempt.
    #[schema(example = "msg_2c26b46b68ffc68ff99b453c1d304134")]
    id: String,
    /// The registered webhook; absent for the job's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    webhook: Option<String>,
    /// Where it goes.
    url: String,
    /// The event that it tells.
    #[schema(example = "succeeded")]
    event: String,
    /// `pending`, `delivered`, or `dead` if it was given up.
    #[schema(example = "delivered")]
    state: String,
    /// Number of attempts.
    attempts: u32,
    /// When the event happened (RFC 3339).
    #[schema(format = DateTime)]
    occurred_at: String,
    /// When it is tried next (RFC 3339).
    #[schema(format = DateTime)]
    next_attempt_at: Option<String>,
    /// When it was tried last (RFC 3339).
    #[schema(format = DateTime)]
    last_attempt_at: Option<String>,
    /// The status of the receiver's last answer.
    last_status: Option<u16>,
    /// How it last ended: `delivered`, `gone` (410), `rejected` (another status), `timed-out`,
    /// `unreachable`, `refused` (by this service, for its address), `too-old`, `too-many`,
    /// `endpoint-removed`, `interrupted` (the service ended during the last attempt).
    last_outcome: Option<String>,
}

impl From<Delivery> for DeliveryBody {
    fn from(delivery: Delivery) -> Self {
        Self {
            id: delivery.id,
            webhook: delivery.endpoint,
            url: delivery.url,
            event: delivery.event.as_str().into(),
            state: delivery.state.as_str().into(),
            attempts: delivery.attempts,
            occurred_at: rfc3339(delivery.occurred_at),
            next_attempt_at: delivery.next_attempt_at.map(rfc3339),
            last_attempt_at: delivery.last_attempt_at.map(rfc3339),
            last_status: delivery.last_status,
            last_outcome: delivery.last_outcome,
        }
    }
}

/// The messages about a job.
#[derive(Serialize, ToSchema)]
pub struct DeliveryList {
    /// The newest first, at most 100.
    deliveries: Vec<DeliveryBody>,
}

/// List the webhook deliveries of a job
#[utoipa::path(get, path = "/v1/jobs/{id}/deliveries", tag = "webhooks",
    params(("id" = String, Path, description = "The job's id")),
    responses((status = 200, description = "The deliveries, newest first", body = DeliveryList),
        LookupProblems))]
pub async fn list_deliveries(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
) -> Answer<Json<DeliveryList>> {
    let found = app.service.deliveries(&caller.tenant, &id).await?;
    if found.is_empty() {
        jobs::find(&app, &caller.tenant, &id).await?;
    }
    let deliveries = found.into_iter().map(DeliveryBody::from).collect();
    Ok(Json(DeliveryList { deliveries }))
}

/// A delivery that is tried again.
#[derive(Serialize, ToSchema)]
#[schema(as = Redelivered)]
#[serde(untagged)]
pub enum RedeliveredBody {
    /// A message.
    Message(DeliveryBody),
    /// A DICOM object.
    Object(ObjectDeliveryBody),
}

/// Deliver again
///
/// A delivery that has ended is tried again at once, with the same id and content. One that is
/// pending stays as it is. Takes the id of a webhook delivery (`msg_...`), or of a DICOM object on
/// its way to an archive (`snd_...`, in the job's `deliveries`).
#[utoipa::path(post, path = "/v1/jobs/{id}/deliveries/{delivery}/redeliver", tag = "webhooks",
    params(("id" = String, Path, description = "The job's id"),
        ("delivery" = String, Path, description = "The delivery's id")),
    responses((status = 202, description = "It will be tried", body = RedeliveredBody),
        LookupProblems))]
pub async fn redeliver(
    State(app): State<App>,
    caller: Caller,
    PathSegments((id, delivery)): PathSegments<(String, String)>,
    _: NoQuery,
) -> Answer {
    let found = app.service.redeliver(&caller.by, &id, &delivery);
    let body = match found.await? {
        Some(Redelivered::Message(message)) => RedeliveredBody::Message(message.into()),
        Some(Redelivered::Object(object)) => RedeliveredBody::Object(object.into()),
        None => {
            let job = format!("GET /v1/jobs/{}", shorten(&id));
            let list = match is_object_delivery(&delivery) {
                true => job,
                false => format!("{job}/deliveries"),
            };
            return Err(nothing_here("delivery", &delivery, &list));
        }
    };
    Ok((StatusCode::ACCEPTED, Json(body)).into_response())
}

fn nothing_here(noun: &str, id: &str, list: &str) -> Problem {
    let detail = format!("There is no {noun} `{}`.", shorten(id));
    Problem::new(StatusCode::NOT_FOUND, "not-found", detail)
        .fix(format!("Take an id from the list at {list}."))
}
