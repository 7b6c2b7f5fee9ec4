//! The webhook of a request: in a JSON object, or in the query and headers of an upload.

use crate::app::App;
use crate::wire::fields::given;
use crate::wire::problem::Answer;
use crate::wire::words::HookEventName;
use axum::http::{HeaderMap, HeaderName};
use serde::Deserialize;
use utoipa::{IntoParams, ToSchema};
use ventriform_service::base::records::JobWebhook;
use ventriform_service::use_cases::webhooks::{GivenWebhook, no_url};

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

/// A receiver to be told about jobs.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct WebhookRequest {
    /// Where to send deliveries: https, and a public host unless the operator allows it
    #[serde(default, deserialize_with = "given")]
    #[schema(
        required = true,
        nullable = false,
        format = "uri",
        max_length = 2048,
        examples("https://ris.example.org/hooks/ventriform")
    )]
    url: Option<String>,
    /// What to tell; the three ends of a job unless given
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = Vec<HookEventName>, required = false, min_items = 1)]
    events: Option<Vec<String>>,
    /// What signs the deliveries (Standard Webhooks): `whsec_` and base64. Made by the service unless given, and never
    /// shown again
    #[serde(default, deserialize_with = "given")]
    #[schema(
        nullable = false,
        pattern = "^whsec_[A-Za-z0-9+/]{32,88}={0,2}$",
        examples("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw")
    )]
    secret: Option<String>,
}

impl From<WebhookRequest> for GivenWebhook {
    fn from(request: WebhookRequest) -> Self {
        Self {
            url: request.url,
            events: request.events,
            secret: request.secret,
        }
    }
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

/// The webhook of a job.
///
/// # Errors
/// 422 that names the part of it which cannot be used.
pub async fn job_webhook(app: &App, given: impl Into<GivenWebhook>) -> Answer<JobWebhook> {
    let checked = app.service.job_webhook(given.into()).await;
    Ok(checked.map_err(|failure| failure.within("webhook"))?)
}
