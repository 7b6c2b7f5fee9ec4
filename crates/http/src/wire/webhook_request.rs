//! Reading a webhook from a request: from a JSON object, or from the query and headers of an upload.

use crate::app::App;
use crate::wire::problem::{Answer, Problem, shorten};
use crate::wire::request::{text, unknown};
use axum::http::{HeaderMap, HeaderName};
use serde::Deserialize;
use serde_json::{Map, Value};
use utoipa::IntoParams;
use ventriform_service::base::records::JobWebhook;
use ventriform_service::network::hooks::{HookEvent, SigningSecret, UrlGuard};

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

/// A webhook as it was given: none of it is checked.
#[derive(Default)]
pub struct GivenWebhook {
    url: Option<String>,
    events: Option<Vec<String>>,
    secret: Option<String>,
}

impl GivenWebhook {
    const WEBHOOK_FIELDS: [&'static str; 3] = ["url", "events", "secret"];

    /// The webhook in a JSON object.
    pub fn from_json(object: &Map<String, Value>) -> Answer<Self> {
        if let Some(name) = object
            .keys()
            .find(|n| !Self::WEBHOOK_FIELDS.contains(&n.as_str()))
        {
            return Err(unknown("field", name, &Self::WEBHOOK_FIELDS));
        }
        let events = match object.get("events") {
            None => None,
            Some(events) => Some(serde_json::from_value(events.clone()).map_err(|_| {
                Problem::invalid_field("events", "`events` must be a list of strings.")
                    .fix(events_fix())
            })?),
        };
        Ok(Self {
            url: text(object, "url")?.map(str::to_owned),
            events,
            secret: text(object, "secret")?.map(str::to_owned),
        })
    }

    /// The webhook of an upload, with the secret in the header `Webhook-Secret`.
    ///
    /// # Errors
    /// 422 if there is no URL.
    pub fn of_upload(query: WebhookQuery, headers: &HeaderMap) -> Answer<Option<Self>> {
        let (url, events) = (query.webhook, query.webhook_events);
        let secret = headers.get(SECRET_HEADER).map(|value| {
            let text = value.to_str().unwrap_or_default();
            text.to_owned()
        });
        if url.is_none() && (events.is_some() || secret.is_some()) {
            return Err(no_url().at("webhook"));
        }
        let events = events.map(|list| list.split(',').map(str::to_owned).collect());
        Ok(url.map(|url| Self {
            url: Some(url),
            events,
            secret,
        }))
    }

    /// Checks the URL, the events and the secret.
    ///
    /// # Errors
    /// 422 that names the part which cannot be used.
    pub async fn check(self, guard: &UrlGuard) -> Answer<CheckedWebhook> {
        let url = self.url.ok_or_else(no_url)?;
        let destination = guard.check(&url).await.map_err(|refusal| {
            Problem::invalid_field("url", format!("The webhook cannot be used. {refusal}")).fix(
                "Give an https:// URL of a public host, or ask the operator to add the host to \
                 `webhook_allow`.",
            )
        })?;
        let events = match self.events {
            None => HookEvent::ENDS.to_vec(),
            Some(names) => events_of(&names)?,
        };
        let secret = match self.secret {
            None => None,
            Some(text) => Some(text.parse::<SigningSecret>().map_err(|error| {
                Problem::invalid_field("secret", format!("The webhook cannot be used: {error}."))
                    .fix("Leave it out, or give `whsec_` and the base64 of 32 random bytes.")
            })?),
        };
        Ok(CheckedWebhook {
            url,
            destination,
            events,
            secret,
        })
    }

    /// Checks the webhook of a job.
    ///
    /// # Errors
    /// 422 that names the part of `webhook` which cannot be used.
    pub async fn of_job(self, app: &App) -> Answer<JobWebhook> {
        let checked = self.check(&app.service.hooks.guard).await;
        let checked = checked.map_err(|problem| problem.within("webhook"))?;
        let names = checked.events.iter().map(|event| event.as_str().to_owned());
        Ok(JobWebhook {
            url: checked.url,
            destination: checked.destination,
            events: names.collect(),
            secret: checked.secret.map(|secret| secret.reveal()),
        })
    }
}

/// A webhook that may be used.
pub struct CheckedWebhook {
    /// The receiver.
    pub url: String,
    /// Scheme, host and port of the URL.
    pub destination: String,
    /// The events that it is told.
    pub events: Vec<HookEvent>,
    /// The secret that signs the deliveries.
    pub secret: Option<SigningSecret>,
}

fn no_url() -> Problem {
    Problem::invalid_field("url", "The webhook has no URL.").fix("Give the receiver's URL.")
}

fn events_fix() -> String {
    let names = HookEvent::ALL.map(HookEvent::as_str);
    format!("Give some of {}.", names.join(", "))
}

fn events_of(names: &[String]) -> Answer<Vec<HookEvent>> {
    let wrong = |detail: String| Problem::invalid_field("events", detail).fix(events_fix());
    let mut events = Vec::new();
    for name in names {
        let event = HookEvent::parse(name.trim())
            .ok_or_else(|| wrong(format!("There is no event `{}`.", shorten(name))))?;
        if !events.contains(&event) {
            events.push(event);
        }
    }
    if events.is_empty() {
        Err(wrong("The webhook would be told nothing.".into()))
    } else {
        Ok(events)
    }
}

/// The webhook in the field `webhook` of a job.
pub async fn webhook_of(app: &App, object: &Map<String, Value>) -> Answer<Option<JobWebhook>> {
    let given = match object.get("webhook") {
        None => return Ok(None),
        Some(Value::Object(given)) => GivenWebhook::from_json(given),
        Some(_) => {
            return Err(
                Problem::invalid_field("webhook", "`webhook` must be a JSON object.")
                    .fix("Give an object such as {\"url\": \"https://example.org/hook\"}."),
            );
        }
    };
    let given = given.map_err(|problem| problem.within("webhook"))?;
    given.of_job(app).await.map(Some)
}
