//! Periodic upkeep: recovery after a crash, failing jobs that never end, deleting old items.

use crate::items::RetentionAges;
use crate::jobs::Queue;
use crate::records::{StoreError, Timestamp};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio_util::sync::CancellationToken;

const HOUR_MS: Timestamp = 3_600_000;

/// Time for which nothing is erased by age after a start at a doubtful time.
const CLOCK_GRACE: Duration = Duration::from_secs(3600);

/// The periodic upkeep of a running service.
pub struct Upkeep {
    /// The queue to look after.
    pub queue: Arc<Queue>,
    /// Ages at which things are erased.
    pub retention: RetentionAges,
    /// Time between two rounds.
    pub every: Duration,
}

impl Upkeep {
    /// Runs one round every [`Upkeep::every`] until `end` is cancelled.
    pub async fn run(self, end: CancellationToken) {
        let mut round = tokio::time::interval(self.every);
        let doubtful = self.time_is_doubtful().await;
        let started = Instant::now();
        loop {
            tokio::select! {
                _ = round.tick() => {}
                () = end.cancelled() => return,
            }
            let trusted = !doubtful || started.elapsed() >= CLOCK_GRACE;
            if let Err(error) = self.run_round(trusted).await {
                tracing::error!(%error, "upkeep failed; the next round tries again");
            }
        }
    }

    /// Whether the time since the last change of the store is so long, or so negative, that a
    /// machine that has started with a wrong clock is likely.
    async fn time_is_doubtful(&self) -> bool {
        let last = match self.queue.table().last_change().await {
            Ok(Some(last)) if self.retention != RetentionAges::default() => last,
            _ => return false,
        };
        let age = self.queue.now().saturating_sub(last);
        let doubtful = !(-HOUR_MS..=24 * HOUR_MS).contains(&age);
        if doubtful {
            tracing::warn!(
                hours = age / HOUR_MS,
                "the last change of the store is that long ago, or lies in the future: nothing is \
                 erased by age for an hour, so that a wrong clock can be set"
            );
        }
        doubtful
    }

    /// Runs one round.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn run_once(&self) -> Result<(), StoreError> {
        self.run_round(true).await
    }

    async fn run_round(&self, time_is_trusted: bool) -> Result<(), StoreError> {
        let items = self.queue.items();
        self.queue.release_dead().await?;
        items.settle_unsettled().await?;
        if time_is_trusted {
            if let Some(age) = self.retention.jobs {
                self.queue.delete_expired(age).await?;
            }
            items.erase_expired(&self.retention).await?;
        }
        items.overwrite_if_due().await
    }
}
