//! Sends what is due: reads the table, starts attempts within the limits, writes down how they
//! ended.
//!
//! The table is the queue, so nothing is lost with the process: what was on the way when it ended
//! is sent again under the same id. In memory there are only the deliveries on the way, whose
//! number is limited.

use super::schedule::milliseconds;
use super::{
    AttemptOutcome, DeliveryLimits, DeliveryStore, DueDelivery, Lanes, RetrySchedule, Sender,
    Settlement, SigningSecret, UrlGuard,
};
use crate::jobs::{Clock, Job, JobState, StoreResult};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use tokio::sync::Notify;
use tokio::sync::broadcast::{self, error::RecvError};
use tokio::task::JoinSet;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

/// The table is read at least this often.
const IDLE: Duration = Duration::from_secs(5);

/// How often what is too old is given up or deleted.
const EXPIRE_EVERY: Duration = Duration::from_secs(30);

/// How webhooks are sent.
#[derive(Debug, Clone, Copy)]
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
    /// How long ended deliveries are kept.
    pub history: Duration,
}

/// Counts since the start, for operators.
#[derive(Debug, Default)]
pub struct DeliveryCounts {
    attempts: [AtomicU64; AttemptOutcome::NAMES.len()],
    given_up: AtomicU64,
}

impl DeliveryCounts {
    /// The attempts by how they ended.
    pub fn attempts(&self) -> impl Iterator<Item = (&'static str, u64)> {
        let counts = self
            .attempts
            .iter()
            .map(|count| count.load(Ordering::Relaxed));
        AttemptOutcome::NAMES.into_iter().zip(counts)
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
    woken: Notify,
}

/// An attempt that has ended.
struct Ended {
    destination: String,
    id: String,
    /// `None` if the attempt could not be made or written down because the database failed.
    outcome: Option<(AttemptOutcome, Option<Duration>)>,
}

impl Dispatcher {
    /// A dispatcher on that table.
    pub fn new(
        store: Arc<dyn DeliveryStore>,
        clock: Arc<dyn Clock>,
        guard: UrlGuard,
        settings: HookSettings,
    ) -> Self {
        Self {
            store,
            clock,
            sender: Sender::new(guard, settings.attempt_limit),
            settings,
            counts: DeliveryCounts::default(),
            woken: Notify::new(),
        }
    }

    /// What was done since the start.
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
        mut changes: broadcast::Receiver<Arc<Job>>,
        end: CancellationToken,
        grace: Duration,
    ) {
        let mut on_the_way = JoinSet::new();
        let mut lanes = Lanes::new(
            self.settings.places,
            self.settings.per_destination,
            self.settings.retries,
        );
        let mut expiry = tokio::time::interval_at(Instant::now() + EXPIRE_EVERY, EXPIRE_EVERY);
        loop {
            let pause = match self.send_due(&mut lanes, &mut on_the_way).await {
                Ok(pause) => pause,
                Err(error) => {
                    tracing::error!(%error, "due webhooks could not be read; tried again");
                    IDLE
                }
            };
            let idle = tokio::time::sleep(pause);
            tokio::pin!(idle);
            loop {
                tokio::select! {
                    () = end.cancelled() => {
                        let drained = async { while on_the_way.join_next().await.is_some() {} };
                        // What is still on the way is sent again after the next start.
                        let _ = tokio::time::timeout(grace, drained).await;
                        return;
                    }
                    Some(ended) = on_the_way.join_next() => {
                        if let Ok(ended) = ended {
                            self.leave(&mut lanes, &ended);
                        }
                    }
                    change = changes.recv() => match change {
                        Ok(job) if !is_told(&job) => continue,
                        Ok(_) | Err(RecvError::Lagged(_)) => {}
                        Err(RecvError::Closed) => return,
                    },
                    _ = expiry.tick() => self.expire().await,
                    () = self.woken.notified() => {}
                    () = &mut idle => {}
                }
                break;
            }
        }
    }

    /// Starts the attempts that are due and have a place. Returns when to look again.
    async fn send_due(
        self: &Arc<Self>,
        lanes: &mut Lanes,
        on_the_way: &mut JoinSet<Ended>,
    ) -> StoreResult<Duration> {
        let pending = self.store.destinations().await?;
        lanes.keep(&pending);
        let now = self.clock.now();
        let mut next = now.saturating_add(milliseconds(IDLE));
        for (destination, due_at) in lanes.in_turn(pending) {
            let room = lanes.room(&destination, now);
            if due_at > now || room == 0 {
                let rest = lanes.rests_until(&destination);
                let when = due_at.max(rest);
                if when > now {
                    next = next.min(when);
                }
                continue;
            }
            let limit = room + lanes.busy(&destination);
            let mut started = 0;
            for delivery in self.store.due(&destination, now, limit).await? {
                if started < room && lanes.enter(&destination, &delivery.id) {
                    started += 1;
                    on_the_way.spawn(self.clone().deliver(destination.clone(), delivery));
                }
            }
        }
        let pause = u64::try_from(next - now).unwrap_or(0).max(1);
        Ok(Duration::from_millis(pause))
    }

    /// Makes one attempt and writes down how it ended.
    async fn deliver(self: Arc<Self>, destination: String, delivery: DueDelivery) -> Ended {
        let outcome = match self.attempt(&delivery).await {
            Ok(outcome) => Some(outcome),
            Err(error) => {
                tracing::error!(delivery = %delivery.id, %error, "a webhook was not written down");
                None
            }
        };
        Ended {
            destination,
            id: delivery.id,
            outcome,
        }
    }

    async fn attempt(
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
        let now = self.clock.now();
        let (outcome, asked) = self.sender.attempt(delivery, secrets, now).await;
        self.counts.attempts[outcome.index()].fetch_add(1, Ordering::Relaxed);
        let now = self.clock.now();
        let attempts = delivery.attempts.saturating_add(1);
        let again_at = match outcome {
            AttemptOutcome::Delivered(_) | AttemptOutcome::Gone => None,
            _ => {
                let retries = self.settings.retries;
                retries.next(attempts, delivery.since, now, asked, random_share())
            }
        };
        tracing::debug!(
            delivery = %delivery.id, job = %delivery.job, attempts,
            outcome = outcome.as_str(), status = outcome.status(), "webhook sent"
        );
        let delivered = matches!(outcome, AttemptOutcome::Delivered(_));
        if again_at.is_none() && !delivered {
            self.counts.given_up.fetch_add(1, Ordering::Relaxed);
            tracing::warn!(
                delivery = %delivery.id, job = %delivery.job, attempts,
                outcome = outcome.as_str(), "webhook given up"
            );
        }
        let settled = Settlement { outcome, again_at };
        self.store.settle(&delivery.id, settled, now).await?;
        Ok((outcome, asked))
    }

    /// The signing secret of a tenant that has had none.
    async fn secret_of(&self, delivery: &DueDelivery) -> StoreResult<SigningSecret> {
        let fresh = SigningSecret::random();
        self.store.signing_secret(&delivery.tenant, &fresh).await
    }

    fn leave(&self, lanes: &mut Lanes, ended: &Ended) {
        let failed = match ended.outcome {
            Some((AttemptOutcome::Delivered(_) | AttemptOutcome::Gone, _)) => None,
            Some((_, asked)) => Some(asked),
            None => Some(Some(IDLE)),
        };
        lanes.leave(&ended.destination, &ended.id, self.clock.now(), failed);
    }

    async fn expire(&self) {
        let now = self.clock.now();
        let limits = DeliveryLimits {
            pending_since: now.saturating_sub(milliseconds(self.settings.retries.age)),
            ended_since: now.saturating_sub(milliseconds(self.settings.history)),
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
}

/// Whether a change of a job may have made deliveries.
fn is_told(job: &Job) -> bool {
    job.state.is_final() || (job.state == JobState::Running && job.stage.is_none())
}

/// A random number from 0 to 1.
fn random_share() -> f64 {
    let bits = uuid::Uuid::new_v4().as_u128() as u32;
    f64::from(bits) / f64::from(u32::MAX)
}
