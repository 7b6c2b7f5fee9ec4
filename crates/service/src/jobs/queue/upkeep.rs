//! Periodic upkeep: recovery after a crash, failing jobs that never end, deleting old items.

use super::{Queue, RetentionAges};
use crate::jobs::{DeathLimit, StoreError, Timestamp};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio_util::sync::CancellationToken;

/// Makes the table consistent after the previous process ended at any moment: returns its running
/// jobs to the queue. To be called before the first worker starts. If other processes may use the store,
/// only jobs whose leases have expired are returned. With a `limit`, jobs that were running when that many processes died are failed; a
/// program that can compute them in a process of their own needs none. Files without a record are
/// left to [`Custodian`](super::Custodian).
///
/// # Errors
/// If the storage fails.
pub async fn recover_after_crash(
    queue: &Queue,
    limit: Option<&DeathLimit>,
) -> Result<(), StoreError> {
    let now = queue.clock.now();
    let alive = Some(queue.run.as_str()).filter(|_| queue.jobs.is_shared());
    let released = queue.jobs.release_dead(alive, limit, now).await?;
    if !released.is_empty() {
        tracing::warn!(
            released = released.len(),
            "recovered after the previous process did not stop in order"
        );
    }
    Ok(())
}

async fn has_record(queue: &Queue, id: &str) -> Result<bool, StoreError> {
    Ok(queue.catalogue.record(id).await?.is_some())
}

/// Deletes the files of items that were added or deleted by halves because the storage failed.
/// Nobody was told that they are stored, or somebody was told that they are deleted.
async fn settle_items(queue: &Queue) -> Result<(), StoreError> {
    for (id, files) in queue.items.unsettled() {
        let _lock = queue.items.lock(&id).await;
        if !queue.items.is_unsettled(&id) {
            continue;
        }
        if !has_record(queue, &id).await? {
            queue.blobs.delete(&id, &files).await?;
            tracing::info!(id, "deleted files that have no record");
        }
        queue.items.settle(&id);
    }
    Ok(())
}

/// Returns the jobs of other runs that died to the queue.
async fn release_dead(queue: &Queue) -> Result<(), StoreError> {
    let run = Some(queue.run.as_str());
    let released = queue.jobs.release_dead(run, None, queue.clock.now());
    for job in released.await? {
        tracing::warn!(job = %job.id, "the lease of another run of the service has expired");
        queue.announce(&job);
    }
    Ok(())
}

const HOUR_MS: Timestamp = 3_600_000;

/// How long nothing is erased by age after a start at a doubtful time.
const DOUBT: Duration = Duration::from_secs(3600);

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
            let trusted = !doubtful || started.elapsed() >= DOUBT;
            if let Err(error) = self.run_round(trusted).await {
                tracing::error!(%error, "upkeep failed; the next round tries again");
            }
        }
    }

    /// Whether the time since the last change of the store is so long, or so negative, that a
    /// machine that has started with a wrong clock is likely.
    async fn time_is_doubtful(&self) -> bool {
        let last = match self.queue.jobs.last_change().await {
            Ok(Some(last)) if self.retention != RetentionAges::default() => last,
            _ => return false,
        };
        let age = self.queue.clock.now().saturating_sub(last);
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
        release_dead(&self.queue).await?;
        settle_items(&self.queue).await?;
        if time_is_trusted {
            self.queue.erase_expired(&self.retention).await?;
        }
        self.queue.overwrite_if_due().await?;
        Ok(())
    }
}
