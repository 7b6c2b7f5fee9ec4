//! Fetching the series of waiting jobs.

use super::end::{ExchangeCounts, ExchangeEnd};
use super::exchange::{Exchange, means};
use super::host::StoredSeries;
use super::parts::PartLimits;
use super::web::DicomWeb;
use super::{DuePull, HeldSeries, SeriesKey};
use crate::base::error::AttemptError;
use crate::base::records::{Failure, Fault, Job, StoreResult, Timestamp, content_id};
use crate::callers::Agent;
use crate::network::hooks::{AttemptEnd, Errands, Lane, Rounds};
use async_trait::async_trait;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::broadcast::{Receiver, error::RecvError};
use tokio_util::sync::CancellationToken;

/// Fetches the series of waiting jobs.
pub struct Puller {
    exchange: Arc<Exchange>,
    counts: Arc<ExchangeCounts>,
}

impl Puller {
    /// A puller that counts its attempts there.
    pub fn new(exchange: Arc<Exchange>, counts: Arc<ExchangeCounts>) -> Self {
        Self { exchange, counts }
    }

    /// Fetches what is due until `end`; then attempts on the way get `grace`.
    pub async fn run(self, end: CancellationToken, grace: Duration) {
        let exchange = self.exchange.clone();
        let rounds = Rounds {
            clock: exchange.clock().clone(),
            lanes: exchange.lanes(),
            woken: exchange.queue.sourced(),
            errands: Arc::new(self),
        };
        rounds.run(exchange.queue.changes(), end, grace).await;
    }

    /// Fetches a series, or finds that it is held already.
    async fn fetch(&self, due: &DuePull) -> Result<(StoredSeries, ExchangeEnd), AttemptError> {
        let exchange = &self.exchange;
        let now = exchange.clock().now();
        let source = &due.source;
        let web = match (&source.archive, &source.dicomweb) {
            (Some(name), _) => {
                let archive = exchange.archive(name, &due.tenant)?;
                exchange.web.client(archive, now).await?
            }
            (None, url) => {
                let url = url.as_deref().unwrap_or_default();
                exchange.web.at(url, now).await?
            }
        };
        let key = SeriesKey {
            tenant: &due.tenant,
            base: web.base(),
            study: &source.study,
            series: &source.series,
        };
        let instances = instances(&web, key).await?;
        if let Some(instances) = &instances
            && let Some(held) = exchange.store.held_series(key).await?
            && held.instances == *instances
            && let Some(stored) = exchange.host.held(&due.tenant, &held.volume).await?
        {
            return Ok((stored, ExchangeEnd::Present));
        }
        let limits = PartLimits {
            bytes: exchange.settings.bytes,
            parts: exchange.settings.parts,
        };
        let parts = web.series(key.study, key.series, limits).await?;
        let stored = exchange.host.store(&due.tenant, parts).await?;
        if let Some(instances) = instances {
            let held = HeldSeries {
                instances,
                volume: stored.volume.clone(),
            };
            exchange.store.note_series(key, &held).await?;
        }
        Ok((stored, ExchangeEnd::Done))
    }

    /// Writes down how the last of so many attempts ended.
    async fn settle(
        &self,
        due: &DuePull,
        attempts: u32,
        fetched: Result<(StoredSeries, ExchangeEnd), AttemptError>,
    ) -> StoreResult<(ExchangeEnd, AttemptEnd)> {
        let (exchange, store) = (&self.exchange, &self.exchange.store);
        let now = exchange.clock().now();
        let trouble = match fetched {
            Ok((stored, end)) => {
                // The volume is held until the job has it.
                let pulled = store.pulled(&due.job, &stored.volume, now);
                let job = Agent::scope(self.agent(due), pulled).await?;
                drop(stored.pin);
                if let Some(job) = job {
                    exchange.queue.supplied(&job);
                }
                return Ok((end, AttemptEnd::Fine));
            }
            Err(trouble) => trouble,
        };
        let meaning = means(&trouble);
        tracing::info!(job = %due.job, error = trouble.why(), "a series was not fetched");
        let failure = match trouble {
            AttemptError::Retry { why, asked } => {
                match exchange.again(attempts, due.since, asked) {
                    Some(again) => {
                        store.pull_failed(&due.job, &why, again, now).await?;
                        return Ok((ExchangeEnd::Failed, meaning));
                    }
                    None => unavailable(attempts, &why),
                }
            }
            AttemptError::Permanent(failure) => failure,
        };
        let given_up = store.pull_given_up(&due.job, &failure, now);
        if let Some(job) = Agent::scope(self.agent(due), given_up).await? {
            exchange.queue.supplied(&job);
        }
        Ok((ExchangeEnd::GivenUp, meaning))
    }

    /// Who fetches, by the audit trail.
    fn agent(&self, due: &DuePull) -> Option<Agent> {
        Some(self.exchange.host.agent(&due.tenant))
    }

    /// Waits until the job is cancelled.
    async fn until_ended(&self, mut changes: Receiver<Arc<Job>>, id: &str) {
        loop {
            match changes.recv().await {
                Ok(job) if job.id == id && job.state.is_final() => return,
                Ok(_) => {}
                Err(RecvError::Closed) => std::future::pending().await,
                Err(RecvError::Lagged(_)) => {
                    let job = self.exchange.queue.table().job(id).await;
                    if job.is_ok_and(|job| job.is_none_or(|job| job.state.is_final())) {
                        return;
                    }
                }
            }
        }
    }
}

/// A hash of the SOP Instance UIDs of a series; `None` if the archive does not list them.
async fn instances(web: &DicomWeb, key: SeriesKey<'_>) -> Result<Option<String>, AttemptError> {
    let listed = web.instances(key.study, key.series).await?;
    Ok(listed.filter(|uids| !uids.is_empty()).map(|mut uids| {
        uids.sort_unstable();
        content_id("", uids.iter().map(String::as_bytes))
    }))
}

fn unavailable(attempts: u32, what: &str) -> Failure {
    let detail = format!("The series could not be fetched in {attempts} attempts. {what}");
    Failure::new(Fault::Service, "archive-unavailable", detail)
        .fix("Ask the operator to look after the archive, then start the job again.")
}

#[async_trait]
impl Errands for Puller {
    type Due = DuePull;

    async fn lanes(&self) -> StoreResult<Vec<(Lane, Timestamp)>> {
        self.exchange.store.pull_lanes().await
    }

    async fn due(&self, lane: &Lane, now: Timestamp, limit: usize) -> StoreResult<Vec<DuePull>> {
        let store = &self.exchange.store;
        store.due_pulls(lane, now, limit).await
    }

    fn id(due: &DuePull) -> &str {
        &due.job
    }

    async fn attempt(&self, due: DuePull) -> AttemptEnd {
        let exchange = &self.exchange;
        let changes = exchange.queue.changes();
        let mut attempts = due.attempts;
        let fetched = if attempts >= exchange.settings.retries.attempts {
            // The process ended during the last one.
            Err(AttemptError::retry(
                "How the last one ended was not written down.",
            ))
        } else {
            let now = exchange.clock().now();
            if let Err(error) = exchange.store.pull_begun(&due.job, now).await {
                tracing::error!(job = %due.job, %error, "a fetch was not written down");
                return AttemptEnd::NotWritten;
            }
            attempts += 1;
            tokio::select! {
                fetched = exchange.in_time(self.fetch(&due)) => fetched,
                () = self.until_ended(changes, &due.job) => return AttemptEnd::Fine,
            }
        };
        match self.settle(&due, attempts, fetched).await {
            Ok((end, meaning)) => {
                self.counts.add(end);
                meaning
            }
            Err(error) => {
                tracing::error!(job = %due.job, %error, "a fetch was not written down");
                AttemptEnd::NotWritten
            }
        }
    }

    async fn recall(&self, now: Timestamp) -> StoreResult<u64> {
        self.exchange.store.recall_pulls(now).await
    }

    async fn expire(&self) {}

    fn concerns(&self, _: &Job) -> bool {
        false
    }
}
