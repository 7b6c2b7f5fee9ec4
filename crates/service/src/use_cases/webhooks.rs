//! Webhooks that a tenant registers or gives with a job, its signing secret, and deliveries that are sent again.
//!
//! In: a [`GivenWebhook`], none of which is checked. Out: a receiver that may be told, and its signing secret. What is
//! sent, and when, is decided in [`crate::network::hooks`].

use crate::base::error::{ServiceResult, invalid_field as invalid, shorten};
use crate::base::records::{Failure, Fault, JobWebhook, Tenant, Timestamp, random_id};
use crate::callers::Agent;
use crate::network::archive::ObjectDelivery;
use crate::network::hooks::{Delivery, HookEndpoint, HookEvent, SigningSecret};
use crate::use_cases::service::Service;
use std::time::Duration;

/// The time for which the former signing secret signs too.
const SECRET_OVERLAP: Duration = Duration::from_secs(24 * 3600);

/// Most deliveries of a job that are listed.
const MOST_DELIVERIES: u32 = 100;

/// The beginning of ids of deliveries to archives.
const OBJECT_PREFIX: &str = "snd_";

/// A webhook as it was given.
#[derive(Debug, Clone, Default)]
pub struct GivenWebhook {
    /// The receiver.
    pub url: Option<String>,
    /// The names of the events that it is told; the ends of jobs if absent.
    pub events: Option<Vec<String>>,
    /// The secret that signs its deliveries.
    pub secret: Option<String>,
}

/// A webhook that may be used.
struct CheckedWebhook {
    url: String,
    /// Scheme, host and port of the URL.
    destination: String,
    events: Vec<HookEvent>,
    secret: Option<SigningSecret>,
}

/// A delivery that is sent again.
pub enum Redelivered {
    /// A message to a webhook.
    Message(Delivery),
    /// A DICOM object to an archive.
    Object(ObjectDelivery),
}

impl Service {
    /// The webhook of a job.
    ///
    /// # Errors
    /// `invalid-field` that names the part of it which cannot be used.
    pub async fn job_webhook(&self, given: GivenWebhook) -> Result<JobWebhook, Failure> {
        let checked = self.checked(given).await?;
        let names = checked.events.iter().map(|event| event.as_str().to_owned());
        Ok(JobWebhook {
            events: names.collect(),
            url: checked.url,
            destination: checked.destination,
            secret: checked.secret.map(|secret| secret.reveal()),
        })
    }

    /// Registers a receiver that is told about every job of the tenant. Returns it with the secret that signs its
    /// deliveries.
    ///
    /// # Errors
    /// As [`Service::job_webhook`], and `too-many-webhooks`.
    pub async fn register_webhook(
        &self,
        by: &Agent,
        given: GivenWebhook,
    ) -> ServiceResult<(HookEndpoint, SigningSecret)> {
        let checked = self.checked(given).await?;
        let secret = checked.secret.unwrap_or_else(SigningSecret::random);
        let endpoint = HookEndpoint {
            id: random_id("whk_"),
            tenant: by.tenant().clone(),
            created_at: self.now(),
            url: checked.url,
            destination: checked.destination,
            events: checked.events,
            gone_at: None,
        };
        let limit = self.settings.webhook_endpoint_limit;
        let store = self.hooks.store.clone();
        let (made, signed) = (endpoint.clone(), secret.clone());
        let add = async move { store.add_endpoint(&made, &signed, limit).await };
        if by.change(add).await? {
            return Ok((endpoint, secret));
        }
        let detail = format!("There are {limit} webhooks already.");
        let fix = "Remove one first, or ask the operator to raise `webhook_endpoint_limit`.";
        let failure = Failure::new(Fault::Request, "too-many-webhooks", detail);
        Err(failure.fix(fix).into())
    }

    /// The receivers of a tenant, the oldest first.
    pub async fn webhooks(&self, tenant: &Tenant) -> ServiceResult<Vec<HookEndpoint>> {
        Ok(self.hooks.store.endpoints(tenant).await?)
    }

    /// Removes a receiver, and gives up what it has not been told. `false` if the tenant has none with that id.
    pub async fn remove_webhook(&self, by: &Agent, id: &str) -> ServiceResult<bool> {
        let (store, now) = (self.hooks.store.clone(), self.now());
        let (tenant, id) = (by.tenant().clone(), id.to_owned());
        let remove = async move { store.remove_endpoint(&tenant, &id, now).await };
        Ok(by.change(remove).await?)
    }

    /// Makes a new signing secret for the tenant. Returns it, and until when the one before signs too.
    pub async fn renew_signing_secret(
        &self,
        by: &Agent,
    ) -> ServiceResult<(SigningSecret, Timestamp)> {
        let secret = SigningSecret::random();
        let until = self.now() + SECRET_OVERLAP.as_millis() as i64;
        let store = self.hooks.store.clone();
        let (tenant, new) = (by.tenant().clone(), secret.clone());
        by.change(async move { store.replace_secret(&tenant, &new, until).await })
            .await?;
        Ok((secret, until))
    }

    /// The messages about a tenant's job, the newest first, at most 100.
    pub async fn deliveries(&self, tenant: &Tenant, job: &str) -> ServiceResult<Vec<Delivery>> {
        let found = self.hooks.store.deliveries(tenant, job, MOST_DELIVERIES);
        Ok(found.await?)
    }

    /// Sends a delivery of a job that has ended again, at once. `None` if the tenant's job has none with that id.
    pub async fn redeliver(
        &self,
        by: &Agent,
        job: &str,
        id: &str,
    ) -> ServiceResult<Option<Redelivered>> {
        let now = self.now();
        let is_object = is_object_delivery(id);
        let (tenant, job, id) = (by.tenant().clone(), job.to_owned(), id.to_owned());
        if is_object {
            let store = self.archives.store.clone();
            let again = async move { store.redeliver_object(&tenant, &job, &id, now).await };
            let found = by.change(again).await?;
            self.archives.woken.notify_one();
            return Ok(found.map(Redelivered::Object));
        }
        let store = self.hooks.store.clone();
        let again = async move { store.redeliver(&tenant, &job, &id, now).await };
        let found = by.change(again).await?;
        self.hooks.dispatcher.wake();
        Ok(found.map(Redelivered::Message))
    }

    /// Checks the URL, the events and the secret.
    async fn checked(&self, given: GivenWebhook) -> Result<CheckedWebhook, Failure> {
        let url = given.url.ok_or_else(no_url)?;
        let destination = self.hooks.guard.check(&url).await.map_err(|refusal| {
            let fix = "Give an https:// URL of a public host, or ask the operator to add the host to \
                       `webhook_allow`.";
            invalid("url", format!("The webhook cannot be used. {refusal}")).fix(fix)
        })?;
        let events = match given.events {
            None => HookEvent::ENDS.to_vec(),
            Some(names) => events_of(&names)?,
        };
        let secret = given.secret.map(|text| {
            text.parse::<SigningSecret>().map_err(|error| {
                let fix = "Leave it out, or give `whsec_` and the base64 of 32 random bytes.";
                invalid("secret", format!("The webhook cannot be used: {error}.")).fix(fix)
            })
        });
        Ok(CheckedWebhook {
            url,
            destination,
            events,
            secret: secret.transpose()?,
        })
    }
}

/// Whether that is the id of a DICOM object on its way to an archive, and not of a message to a webhook.
pub fn is_object_delivery(id: &str) -> bool {
    id.starts_with(OBJECT_PREFIX)
}

/// The refusal of a webhook without a URL.
pub fn no_url() -> Failure {
    invalid("url", "The webhook has no URL.").fix("Give the receiver's URL.")
}

/// What to give as the events of a webhook.
pub fn events_fix() -> String {
    let names = HookEvent::ALL.map(HookEvent::as_str);
    format!("Give some of {}.", names.join(", "))
}

fn events_of(names: &[String]) -> Result<Vec<HookEvent>, Failure> {
    let mut events = Vec::new();
    for name in names {
        let event = HookEvent::parse(name.trim()).ok_or_else(|| {
            let detail = format!("There is no event `{}`.", shorten(name));
            invalid("events", detail).fix(events_fix())
        })?;
        if !events.contains(&event) {
            events.push(event);
        }
    }
    if events.is_empty() {
        return Err(invalid(
            "events",
            "`events` is empty: the webhook would get no request.",
        )
        .fix(events_fix()));
    }
    Ok(events)
}
