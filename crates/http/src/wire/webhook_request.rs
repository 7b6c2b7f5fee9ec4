//! Reading a webhook from a request: from a JSON object, or from the query and headers of an upload.

use crate::app::App;
use crate::wire::problem::{Answer, Problem};
use crate::wire::request::{text, unknown};
use axum::http::{HeaderMap, HeaderName};
use serde::Deserialize;
use serde_json::{Map, Value};
use utoipa::IntoParams;
use ventriform_service::base::records::JobWebhook;
use ventriform_service::use_cases::webhooks::{GivenWebhook, events_fix, no_url};

/// The header with the signing secret of a job's webhook.
pub const SECRET_HEADER: HeaderName = HeaderName::from_static("webhook-secret");

/// The webhook of a job that is filed with an upload.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct WebhookQuery {
    /// URL to be told when the job has ended
    webhook: Option<String>,
    /// What to tell, separated by commas: `started`, `succeeded`, `failed`, `cancelled`
    webhook_events: Option<String>,
}

/// The fields of a webhook.
const WEBHOOK_FIELDS: [&str; 3] = ["url", "events", "secret"];

/// The webhook in a JSON object.
///
/// # Errors
/// 400 for an unknown field, 422 for one of another type.
pub fn given_webhook(object: &Map<String, Value>) -> Answer<GivenWebhook> {
    if let Some(name) = object
        .keys()
        .find(|n| !WEBHOOK_FIELDS.contains(&n.as_str()))
    {
        return Err(unknown("field", name, &WEBHOOK_FIELDS));
    }
    let events = match object.get("events") {
        None => None,
        Some(events) => Some(serde_json::from_value(events.clone()).map_err(|_| {
            Problem::invalid_field("events", "`events` must be a list of strings.")
                .fix(events_fix())
        })?),
    };
    Ok(GivenWebhook {
        url: text(object, "url")?.map(str::to_owned),
        events,
        secret: text(object, "secret")?.map(str::to_owned),
    })
}

/// The webhook of an upload, with the secret in the header `Webhook-Secret`.
///
/// # Errors
/// 422 if there is no URL, or another part cannot be used.
pub async fn webhook_of_upload(
    app: &App,
    query: WebhookQuery,
    headers: &HeaderMap,
) -> Answer<Option<JobWebhook>> {
    let (url, events) = (query.webhook, query.webhook_events);
    let secret = headers.get(SECRET_HEADER).map(|value| {
        let text = value.to_str().unwrap_or_default();
        text.to_owned()
    });
    if url.is_none() {
        return match events.is_some() || secret.is_some() {
            true => Err(no_url().at("webhook").into()),
            false => Ok(None),
        };
    }
    let events = events.map(|list| list.split(',').map(str::to_owned).collect());
    let given = GivenWebhook {
        url,
        events,
        secret,
    };
    job_webhook(app, given).await.map(Some)
}

async fn job_webhook(app: &App, given: GivenWebhook) -> Answer<JobWebhook> {
    let checked = app.service.job_webhook(given).await;
    Ok(checked.map_err(|failure| failure.within("webhook"))?)
}

/// The webhook in the field `webhook` of a job.
pub async fn webhook_of(app: &App, object: &Map<String, Value>) -> Answer<Option<JobWebhook>> {
    let given = match object.get("webhook") {
        None => return Ok(None),
        Some(Value::Object(given)) => given_webhook(given),
        Some(_) => {
            return Err(
                Problem::invalid_field("webhook", "`webhook` must be a JSON object.")
                    .fix("Give an object such as {\"url\": \"https://example.org/hook\"}."),
            );
        }
    };
    let given = given.map_err(|problem| problem.within("webhook"))?;
    job_webhook(app, given).await.map(Some)
}
