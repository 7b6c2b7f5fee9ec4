//! Delivering objects of results.
//!
//! Nothing is stored twice: an object has the same UID and bytes in every attempt, and the archive
//! is asked whether it has the object before it is sent. An archive that cannot be asked recognises the
//! UID itself. An attempt is counted before it is made, so that one which ends the process is not repeated without end.
//! The end of a delivery and its row of the audit trail are one transaction: if it fails, the attempt is made again.

use super::end::{ExchangeCounts, ExchangeEnd};
use super::exchange::{Exchange, means};
use super::web::Stored;
use super::{DueSend, SendSettlement, dimse};
use crate::base::error::AttemptError;
use crate::base::records::{Job, JobState, StoreResult, Timestamp};
use crate::callers::Agent;
use crate::network::hooks::{AttemptEnd, DeliveryState, Errands, Lane, Rounds};
use async_trait::async_trait;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;

/// Delivers objects of results.
pub struct Deliverer {
    exchange: Arc<Exchange>,
    counts: Arc<ExchangeCounts>,
}

impl Deliverer {
    /// A deliverer that counts its attempts there.
    pub fn new(exchange: Arc<Exchange>, counts: Arc<ExchangeCounts>) -> Self {
        Self { exchange, counts }
    }

    /// Delivers what is due until `end`, at once when it is `woken`; after the end, attempts on the way
    /// get `grace`.
    pub async fn run(self, woken: Arc<Notify>, end: CancellationToken, grace: Duration) {
        let exchange = self.exchange.clone();
        let rounds = Rounds {
            clock: exchange.clock().clone(),
            lanes: exchange.lanes(),
            woken,
            errands: Arc::new(self),
        };
        rounds.run(exchange.queue.changes(), end, grace).await;
    }

    async fn send(&self, due: &DueSend) -> Result<Stored, AttemptError> {
        let exchange = &self.exchange;
        let archive = exchange.archive(&due.to, &due.tenant)?;
        let host = &exchange.host;
        let object = host.object(&due.tenant, &due.result, &due.name).await?;
        let web = match archive.dicomweb {
            Some(_) => Some(exchange.web.client(archive, exchange.clock().now()).await?),
            None => None,
        };
        if let Some(web) = &web
            && web.has(&object.study, &object.instance).await? == Some(true)
        {
            return Ok(Stored::Before);
        }
        match (&archive.dicom, web) {
            (Some(peer), _) => {
                let (peer, timeout) = (peer.clone(), exchange.settings.timeout);
                let store = move || dimse::store(&peer, &object, timeout);
                let stored = tokio::task::spawn_blocking(store).await;
                stored.unwrap_or_else(|_| Err(AttemptError::retry("The sending was broken off.")))
            }
            (None, Some(web)) => web.store(&object.bytes).await,
            (None, None) => Err(AttemptError::retry("The archive has no address any more.")),
        }
    }

    fn settlement(
        &self,
        due: &DueSend,
        attempts: u32,
        sent: Result<Stored, AttemptError>,
    ) -> (SendSettlement, ExchangeEnd, AttemptEnd) {
        let done = |outcome, end| {
            let settlement = SendSettlement {
                state: DeliveryState::Delivered,
                outcome,
                error: None,
                again_at: None,
                counts: true,
            };
            (settlement, end, AttemptEnd::Fine)
        };
        let trouble = match sent {
            Ok(Stored::Now) => return done("stored", ExchangeEnd::Done),
            Ok(Stored::Before) => return done("present", ExchangeEnd::Present),
            Err(trouble) => trouble,
        };
        let meaning = means(&trouble);
        let again_after = |asked| self.exchange.again(attempts, due.since, asked);
        let again = match &trouble {
            AttemptError::Retry { asked, .. } => again_after(*asked),
            // The operator may correct the credentials.
            AttemptError::Permanent(failure) if failure.code == "archive-credentials" => {
                again_after(None)
            }
            AttemptError::Permanent(_) => None,
        };
        let (state, end) = match again {
            Some(_) => (DeliveryState::Pending, ExchangeEnd::Failed),
            None => (DeliveryState::Dead, ExchangeEnd::GivenUp),
        };
        let settlement = SendSettlement {
            state,
            outcome: match trouble {
                AttemptError::Retry { .. } => "failed",
                AttemptError::Permanent(_) => "refused",
            },
            error: Some(trouble.why().to_owned()),
            again_at: again.map(|again| again.at),
            counts: again.is_none_or(|again| again.counts),
        };
        (settlement, end, meaning)
    }
}

#[async_trait]
impl Errands for Deliverer {
    type Due = DueSend;

    async fn lanes(&self) -> StoreResult<Vec<(Lane, Timestamp)>> {
        self.exchange.store.send_lanes().await
    }

    async fn due(&self, lane: &Lane, now: Timestamp, limit: usize) -> StoreResult<Vec<DueSend>> {
        let store = &self.exchange.store;
        store.due_sends(lane, now, limit).await
    }

    fn id(due: &DueSend) -> &str {
        &due.id
    }

    async fn attempt(&self, due: DueSend) -> AttemptEnd {
        let exchange = &self.exchange;
        let mut attempts = due.attempts;
        let sent = if attempts >= exchange.settings.retries.attempts {
            // The process ended during the last one.
            Err(AttemptError::retry(
                "How the last attempt ended was not written down.",
            ))
        } else {
            let now = exchange.clock().now();
            if let Err(error) = exchange.store.send_begun(&due.id, now).await {
                tracing::error!(delivery = %due.id, %error, "a delivery was not written down");
                return AttemptEnd::NotWritten;
            }
            attempts += 1;
            exchange.in_time(self.send(&due)).await
        };
        let (settlement, end, meaning) = self.settlement(&due, attempts, sent);
        if let Some(error) = &settlement.error {
            tracing::info!(delivery = %due.id, job = %due.job, error, "an object was not delivered");
        }
        self.counts.add(end);
        let now = self.exchange.clock().now();
        let written = self.exchange.store.settle_send(&due, &settlement, now);
        let agent = self.exchange.host.agent(&due.tenant);
        match Agent::scope(Some(agent), written).await {
            Ok(()) => meaning,
            Err(error) => {
                tracing::error!(delivery = %due.id, %error, "a delivery was not written down");
                AttemptEnd::NotWritten
            }
        }
    }

    async fn recall(&self, now: Timestamp) -> StoreResult<u64> {
        self.exchange.store.recall_sends(now).await
    }

    async fn expire(&self) {}

    fn concerns(&self, job: &Job) -> bool {
        job.state == JobState::Succeeded && job.send.is_some()
    }
}
