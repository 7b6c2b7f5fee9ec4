//! The exchange with archives: series are fetched and stored as uploads are, objects of results are made and delivered.

use crate::base::error::{AttemptError, Refusal, ServiceError};
use crate::base::records::{Failure, Fault, Resource, StoreError, Tags, Tenant};
use crate::callers::Agent;
use crate::limits::quotas::Addition;
use crate::network::archive::{
    ArchiveObject, Deliverer, Exchange, ExchangeHost, ExchangeSettings, Puller, SeriesParts,
    StoredSeries,
};
use crate::network::hooks::RetrySchedule;
use crate::use_cases::service::Service;
use crate::use_cases::uploads::VolumeUpload;
use crate::work::{UploadFacts, dicom};
use async_trait::async_trait;
use futures::StreamExt;
use std::sync::Arc;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use ventriform::base::progress::Monitor;

/// The agent of the audit trail that fetches and delivers.
const AUDIT_AGENT: &str = "archive exchange";

/// Fetches and delivers until `end`.
pub async fn run(service: Arc<Service>, end: CancellationToken) {
    let settings = &service.settings;
    let exchange = Arc::new(Exchange::new(
        service.archives.store.clone(),
        service.clone(),
        service.queue.clone(),
        service.http_clients.clone(),
        service.archives.guard.clone(),
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
    let puller = Puller::new(exchange.clone(), service.archives.pulls.clone());
    let deliverer = Deliverer::new(exchange, service.archives.sends.clone());
    let woken = service.archives.woken.clone();
    let mut both = JoinSet::new();
    both.spawn(puller.run(end.clone(), grace));
    both.spawn(deliverer.run(woken, end, grace));
    while both.join_next().await.is_some() {}
}

/// A refused upload, as the trouble of a fetch. That the tenant's quota is full lasts until somebody erases something.
fn trouble(error: ServiceError) -> AttemptError {
    if error.refusal == Refusal::NoRoom && error.failure.code == "storage-quota" {
        return AttemptError::Permanent(*error.failure);
    }
    error.into()
}

#[async_trait]
impl ExchangeHost for Service {
    async fn store(
        &self,
        tenant: &Tenant,
        mut parts: SeriesParts,
    ) -> Result<StoredSeries, AttemptError> {
        let blobs = self.items().blobs();
        blobs.require_room(0).map_err(StoreError::from)?;
        let addition = Addition::bytes(0);
        let reserved = self
            .quotas
            .reserve(tenant, self.quotas.general, addition, None);
        let counting = reserved.await.map_err(trouble)?;
        let mut upload = VolumeUpload::new(self, &counting);
        while let Some(part) = parts.next().await? {
            let mut broken = None;
            let pieces = part.map(|piece| {
                piece.map_err(|why| {
                    broken = Some(why);
                    // Replaced by the trouble itself below.
                    ServiceError::from(broken_off())
                })
            });
            let written = upload.write(pieces).await.map(|_| ());
            if let Some(broken) = broken {
                return Err(broken);
            }
            written.map_err(trouble)?;
            upload.join_repeated().await.map_err(trouble)?;
        }
        let (by, tags) = (Service::agent(self, tenant, AUDIT_AGENT), Tags::default());
        let stored = self.store_volume(&by, tenant, upload, &tags);
        let stored = stored.await;
        let stored = stored.map_err(trouble)?;
        Ok(StoredSeries {
            volume: stored.volume.item.id,
            pin: stored.pin,
        })
    }

    async fn held(
        &self,
        tenant: &Tenant,
        volume: &str,
    ) -> Result<Option<StoredSeries>, AttemptError> {
        let pin = self.items().pin(volume).await?;
        let intact = self.items().intact_volume(volume).await?.is_some();
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
    ) -> Result<ArchiveObject, AttemptError> {
        let gone = |what: &str| {
            AttemptError::permanent(
                Fault::Content,
                "erased",
                what,
                "Start the job again with a stored volume.",
            )
        };
        let kind = Resource::from_id(result).unwrap_or(Resource::Model);
        let object = dicom::object_named(kind, name);
        let object = object.ok_or_else(|| gone("This version makes no such object."))?;
        let result = self
            .queue
            .items()
            .result(tenant, result, |product| object.source_files(product))
            .await?;
        let result = result.ok_or_else(|| gone("The result or its volume was erased."))?;
        let shape = UploadFacts::from_volume(&result.source.volume)?.shape;
        let bytes = result.bytes();
        let limits = self.engine.limits;
        let make = move |_: &Monitor<'_>| dicom::object(&result, object, None, &limits);
        let made = self
            .decoding
            .run_on(bytes, dicom::object_memory(shape), make);
        let made = made.await?.map_err(AttemptError::Permanent)?;
        let made = made.ok_or_else(|| gone("The result has no such object."))?;
        ArchiveObject::from_bytes(made.bytes).ok_or_else(|| {
            AttemptError::permanent(
                Fault::Service,
                "internal",
                "The object lacks an identifier.",
                "Report it with the job's id.",
            )
        })
    }

    fn agent(&self, tenant: &Tenant) -> Agent {
        Service::agent(self, tenant, AUDIT_AGENT)
    }
}

fn broken_off() -> Failure {
    Failure::new(Fault::Content, "broken-body", "The answer broke off.")
}
