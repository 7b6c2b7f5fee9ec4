//! Sends webhooks that are due, and writes down how that ended.

use super::rounds::random_share;
use super::{
    AttemptEnd, AttemptOutcome, DeliveryLimits, DeliveryStore, DueDelivery, Errands, Lane, Lanes,
    RetrySchedule, Rounds, Sender, Settlement, SigningSecret, UrlGuard,
};
use crate::base::http_client::ClientFactory;
use crate::base::records::{Clock, Job, JobState, StoreResult, Timestamp};
use async_trait::async_trait;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use tokio::sync::{Notify, broadcast};
use tokio_util::sync::CancellationToken;

/// The settings of webhooks.
#[derive(Debug, Clone)]
pub struct HookSettings {
    /// When failed deliveries are tried again.
    pub retries: RetrySchedule,
    /// Longest attempt.
    pub attempt_limit: Duration,
    /// Most deliveries on the way.
    pub places: usize,
    /// Most of them to one destination.
    pub per_destination: usize,
    /// Most pending deliveries of one destination.
    pub backlog: u32,
    /// Time for which ended deliveries are kept.
    pub history: Duration,
    /// The beginning of the paths in messages.
    pub base_path: String,
}

/// Counts since the start, for operators.
#[derive(Debug, Default)]
pub struct DeliveryCounts {
    attempts: [AtomicU64; AttemptOutcome::OUTCOME_NAMES.len()],
    given_up: AtomicU64,
}

impl DeliveryCounts {
    /// The attempts by how they ended.
    pub fn attempts(&self) -> impl Iterator<Item = (&'static str, u64)> {
        let counts = self
            .attempts
            .iter()
            .map(|count| count.load(Ordering::Relaxed));
        AttemptOutcome::OUTCOME_NAMES.into_iter().zip(counts)
    }

    /// The deliveries that were given up.
    pub fn given_up(&self) -> u64 {
        self.given_up.load(Ordering::Relaxed)
    }
}

/// Sends what is due, until it is told to end.
pub struct Dispatcher {
    store: Arc<dyn DeliveryStore>,
    clock: Arc<dyn Clock>,
    sender: Sender,
    settings: HookSettings,
    counts: DeliveryCounts,
    woken: Arc<Notify>,
}

impl Dispatcher {
    /// A dispatcher on that table.
    pub fn new(
        store: Arc<dyn DeliveryStore>,
        clock: Arc<dyn Clock>,
        clients: Arc<dyn ClientFactory>,
        guard: UrlGuard,
        settings: HookSettings,
    ) -> Self {
        Self {
            store,
            clock,
            sender: Sender::new(
                clients,
                guard,
                settings.attempt_limit,
                settings.base_path.clone(),
            ),
            settings,
            counts: DeliveryCounts::default(),
            woken: Arc::default(),
        }
    }

    /// Counts since the start.
    pub fn counts(&self) -> &DeliveryCounts {
        &self.counts
    }

    /// Looks for due deliveries now.
    pub fn wake(&self) {
        self.woken.notify_one();
    }

    /// Sends what is due until `end`; then attempts on the way get `grace`.
    pub async fn run(
        self: Arc<Self>,
        changes: broadcast::Receiver<Arc<Job>>,
        end: CancellationToken,
        grace: Duration,
    ) {
        let settings = &self.settings;
        let lanes = Lanes::new(settings.places, settings.per_destination, settings.retries);
        let rounds = Rounds {
            clock: self.clock.clone(),
            woken: self.woken.clone(),
            errands: self,
            lanes,
        };
        rounds.run(changes, end, grace).await;
    }

    async fn send(
        &self,
        delivery: &DueDelivery,
    ) -> StoreResult<(AttemptOutcome, Option<Duration>)> {
        let own;
        let secrets = match delivery.secrets.as_slice() {
            [] => {
                own = [self.secret_of(delivery).await?];
                &own[..]
            }
            secrets => secrets,
        };
        let mut attempts = delivery.attempts;
        let (outcome, asked) = if attempts >= self.settings.retries.attempts {
            // The process ended during the last one.
            (AttemptOutcome::Interrupted, None)
        } else {
            let now = self.clock.now();
            self.store.begun(&delivery.id, now).await?;
            attempts += 1;
            self.sender.attempt(delivery, secrets, now).await
        };
        self.counts.attempts[outcome.index()].fetch_add(1, Ordering::Relaxed);
        let now = self.clock.now();
        let again = match outcome {
            AttemptOutcome::Delivered(_) | AttemptOutcome::Gone => None,
            _ => {
                let time = (now, self.clock.trusted());
                let retries = self.settings.retries;
                retries.next(attempts, delivery.since, time, asked, random_share())
            }
        };
        tracing::debug!(
            delivery = %delivery.id, job = %delivery.job, attempts,
            outcome = outcome.as_str(), status = outcome.status(), "webhook sent"
        );
        let delivered = matches!(outcome, AttemptOutcome::Delivered(_));
        if again.is_none() && !delivered {
            self.counts.given_up.fetch_add(1, Ordering::Relaxed);
            tracing::warn!(
                delivery = %delivery.id, job = %delivery.job, attempts,
                outcome = outcome.as_str(), "webhook given up"
            );
        }
        let settled = Settlement {
            outcome,
            again_at: again.map(|again| again.at),
            counts: again.is_none_or(|again| again.counts),
        };
        self.store.settle(&delivery.id, settled, now).await?;
        Ok((outcome, asked))
    }

    /// The signing secret of a tenant that has had none.
    async fn secret_of(&self, delivery: &DueDelivery) -> StoreResult<SigningSecret> {
        let fresh = SigningSecret::random();
        self.store.signing_secret(&delivery.tenant, &fresh).await
    }
}

#[async_trait]
impl Errands for Dispatcher {
    type Due = DueDelivery;

    async fn lanes(&self) -> StoreResult<Vec<(Lane, Timestamp)>> {
        self.store.delivery_lanes().await
    }

    async fn due(
        &self,
        lane: &Lane,
        now: Timestamp,
        limit: usize,
    ) -> StoreResult<Vec<DueDelivery>> {
        self.store.due_deliveries(lane, now, limit).await
    }

    fn id(due: &DueDelivery) -> &str {
        &due.id
    }

    async fn attempt(&self, delivery: DueDelivery) -> AttemptEnd {
        match self.send(&delivery).await {
            Ok((AttemptOutcome::Delivered(_) | AttemptOutcome::Gone, _)) => AttemptEnd::Fine,
            Ok((_, asked)) => AttemptEnd::Failing(asked),
            Err(error) => {
                tracing::error!(delivery = %delivery.id, %error, "a webhook was not written down");
                AttemptEnd::NotWritten
            }
        }
    }

    async fn recall(&self, now: Timestamp) -> StoreResult<u64> {
        self.store.recall_deliveries(now).await
    }

    async fn expire(&self) {
        let (now, trusted) = (self.clock.now(), self.clock.trusted());
        let older_than = |age| trusted.map(|now| now.older_than(age));
        let limits = DeliveryLimits {
            pending_since: older_than(self.settings.retries.age),
            ended_since: older_than(self.settings.history),
            backlog: self.settings.backlog,
        };
        match self.store.expire(limits, now).await {
            Ok(0) => {}
            Ok(given_up) => {
                self.counts.given_up.fetch_add(given_up, Ordering::Relaxed);
                tracing::warn!(
                    given_up,
                    "webhooks given up: too old, or too many for one receiver"
                );
            }
            Err(error) => tracing::error!(%error, "old webhooks could not be deleted"),
        }
    }

    /// Every end of a job, and every start.
    fn concerns(&self, job: &Job) -> bool {
        job.state.is_final() || (job.state == JobState::Running && job.stage.is_none())
    }
}
