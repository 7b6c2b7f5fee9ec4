//! What the exchange with archives needs of the service: storing volumes, making objects, the audit
//! trail.

use super::app::App;
use super::guard::Counting;
use super::problem::Problem;
use super::upload::Bundle;
use async_trait::async_trait;
use futures::StreamExt;
use std::sync::Arc;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use ventriform::progress::Monitor;
use ventriform_service::access::{Activity, AuditEvent, Outcome, Usage};
use ventriform_service::archive::{
    ArchiveObject, Deliverer, DuePull, DueSend, Exchange, ExchangeEnd, ExchangeHost,
    ExchangeSettings, Puller, SeriesParts, StoredSeries, Trouble,
};
use ventriform_service::hooks::RetrySchedule;
use ventriform_service::records::{Fault, Resource, StoreError, Tags, Tenant};
use ventriform_service::work::{UploadFacts, dicom};

/// The agent of the audit trail that fetches and delivers.
const AGENT: &str = "archive exchange";

/// Fetches and delivers until `end`.
pub async fn run(app: App, end: CancellationToken) {
    let settings = &app.settings;
    let exchange = Arc::new(Exchange::new(
        app.archives.store.clone(),
        Arc::new(app.clone()),
        app.queue.clone(),
        app.archives.guard.clone(),
        ExchangeSettings {
            archives: settings.archives.clone(),
            retries: RetrySchedule {
                first: settings.archive_backoff.0,
                attempts: settings.archive_attempts,
                age: settings.archive_age.0,
            },
            timeout: settings.archive_timeout.0,
            time_limit: settings.archive_time_limit.0,
            places: settings.archive_concurrency,
            bytes: settings.body_limit.0,
            parts: settings.parts_limit,
        },
    ));
    let grace = settings.shutdown_grace.0;
    let puller = Puller::new(exchange.clone(), app.archives.pulls.clone());
    let deliverer = Deliverer::new(exchange, app.archives.sends.clone());
    let woken = app.archives.woken.clone();
    let mut both = JoinSet::new();
    both.spawn(puller.run(end.clone(), grace));
    both.spawn(deliverer.run(woken, end, grace));
    while both.join_next().await.is_some() {}
}

/// A problem of an upload, as the trouble of a fetch.
fn trouble(problem: Problem) -> Trouble {
    match problem.into_failure() {
        Ok(failure) => Trouble::Final(failure),
        Err(passing) => Trouble::passing(passing),
    }
}

#[async_trait]
impl ExchangeHost for App {
    async fn store(
        &self,
        tenant: &Tenant,
        mut parts: SeriesParts,
    ) -> Result<StoredSeries, Trouble> {
        let blobs = self.queue.items().blobs();
        blobs.require_room(0).map_err(StoreError::from)?;
        let mut bundle = Bundle::new(self, &Counting::default());
        while let Some(part) = parts.next().await? {
            let mut broken = None;
            let pieces = part.map(|piece| {
                piece.map_err(|why| {
                    broken = Some(why);
                    // Replaced by the trouble itself below.
                    Problem::bad_request("broken-body", "The answer broke off.")
                })
            });
            let written = bundle.write(pieces).await.map(|_| ());
            if let Some(broken) = broken {
                return Err(broken);
            }
            written.map_err(trouble)?;
            bundle.join_repeated().await.map_err(trouble)?;
        }
        // Counted first, so that fetches and uploads that come together cannot exceed the quota together.
        let amount = Usage {
            bytes: bundle.bytes(),
            jobs: 0,
        };
        let (_reservation, reserved) = self.guard.reservations.add(tenant, amount);
        if let Some(quota) = self.guard.quota.bytes
            && let used = self.access.usage(tenant).await?.bytes
            && used.saturating_add(reserved.bytes) > quota
        {
            return Err(Trouble::lasting(
                Fault::TooLarge,
                "storage-quota",
                format!("The series does not fit: this tenant may store {quota} bytes."),
                "DELETE volumes that are no longer needed, or ask the operator for more.",
            ));
        }
        let stored = bundle.store(self, tenant, &Tags::default()).await;
        let stored = stored.map_err(trouble)?;
        Ok(StoredSeries {
            volume: stored.volume.item.id,
            pin: stored.pin,
        })
    }

    async fn held(&self, tenant: &Tenant, volume: &str) -> Result<Option<StoredSeries>, Trouble> {
        let pin = self.queue.items().pin(volume).await?;
        let intact = self.queue.items().intact_volume(volume).await?.is_some();
        let held = intact
            && self
                .queue
                .items()
                .catalogue()
                .volume(tenant, volume)
                .await?
                .is_some();
        Ok(held.then(|| StoredSeries {
            volume: volume.to_owned(),
            pin,
        }))
    }

    async fn object(
        &self,
        tenant: &Tenant,
        result: &str,
        name: &str,
    ) -> Result<ArchiveObject, Trouble> {
        let gone = |what: &str| {
            Trouble::lasting(
                Fault::Content,
                "erased",
                what,
                "Start the job again with a stored volume.",
            )
        };
        let kind = Resource::of(result).unwrap_or(Resource::Model);
        let object = dicom::object_named(kind, name);
        let object = object.ok_or_else(|| gone("This version makes no such object."))?;
        let result = self
            .queue
            .items()
            .result(tenant, result, dicom::FILES)
            .await?;
        let result = result.ok_or_else(|| gone("The result or its volume was erased."))?;
        let shape = UploadFacts::of(&result.volume)?.shape;
        let limits = self.engine.limits;
        let make = move |_: &Monitor<'_>| dicom::object(&result, object, None, &limits);
        let made = self.decoding.run(dicom::object_memory(shape), make).await;
        let made = made.map_err(trouble)?.map_err(Trouble::Final)?;
        let made = made.ok_or_else(|| gone("The result has no such object."))?;
        ArchiveObject::of(made.bytes).ok_or_else(|| {
            Trouble::lasting(
                Fault::Service,
                "internal",
                "The object lacks an identifier.",
                "Report it with the job's id.",
            )
        })
    }

    async fn fetched(&self, pull: &DuePull, end: ExchangeEnd) {
        self.recorded(&pull.tenant, Activity::Create, &pull.job, end)
            .await;
    }

    async fn delivered(&self, send: &DueSend, end: ExchangeEnd) {
        self.recorded(&send.tenant, Activity::Read, &send.result, end)
            .await;
    }
}

impl App {
    /// Notes in the audit trail what left or entered the service without a request. Attempts that
    /// will be repeated are not noted.
    async fn recorded(&self, tenant: &Tenant, activity: Activity, object: &str, end: ExchangeEnd) {
        let outcome = match end {
            ExchangeEnd::Failed => return,
            ExchangeEnd::Done | ExchangeEnd::Present => Outcome::Success,
            ExchangeEnd::GivenUp => Outcome::Refused,
        };
        let now = self.queue.now();
        let event = AuditEvent {
            outcome,
            ..AuditEvent::new(now, activity, tenant.clone(), AGENT.into()).on(object)
        };
        self.guard.recorder.note(event).await;
    }
}
