//! Periodic upkeep: recovery after a crash, failing jobs that never end, deleting old items.

use super::Queue;
use super::publish::to_its_end;
use crate::jobs::{Deleted, Failure, Fault, Resource, StoreError};
use std::sync::Arc;
use std::time::Duration;
use tokio_util::sync::CancellationToken;

/// Makes the table and the files consistent after the previous process ended at any moment:
/// returns its running jobs to the queue, and deletes files that have no record. To be called
/// before the first worker starts, by the only process on the store.
///
/// # Errors
/// If the storage fails.
pub async fn recover_after_crash(queue: &Queue, attempt_limit: u32) -> Result<(), StoreError> {
    let released = queue.jobs.release_all().await?;
    end_unclaimable(queue, attempt_limit).await?;
    let orphans = delete_orphans(queue).await?;
    if released + orphans > 0 {
        tracing::warn!(
            released,
            orphans,
            "recovered after the previous process did not stop in order"
        );
    }
    Ok(())
}

/// Deletes files whose record was never committed, or was deleted before them.
async fn delete_orphans(queue: &Queue) -> Result<u64, StoreError> {
    let mut orphans = 0;
    for id in queue.blobs.ids().await? {
        if !has_record(queue, &id).await? {
            queue.blobs.delete(&id).await?;
            orphans += 1;
        }
    }
    Ok(orphans)
}

async fn has_record(queue: &Queue, id: &str) -> Result<bool, StoreError> {
    Ok(match Resource::of(id) {
        Some(Resource::Volume) => queue.catalogue.volume(id).await?.is_some(),
        _ => queue.catalogue.product(id).await?.is_some(),
    })
}

/// Deletes the files of items that were added or deleted by halves because the storage failed.
/// Nobody was told that they are stored, or somebody was told that they are deleted.
async fn settle_items(queue: &Queue) -> Result<(), StoreError> {
    for id in queue.items.unsettled() {
        let _lock = queue.items.lock(&id).await;
        if !queue.items.is_unsettled(&id) {
            continue;
        }
        if !has_record(queue, &id).await? {
            queue.blobs.delete(&id).await?;
            tracing::info!(id, "deleted files that have no record");
        }
        queue.items.settle(&id);
    }
    Ok(())
}

async fn end_unclaimable(queue: &Queue, attempt_limit: u32) -> Result<(), StoreError> {
    let reason = Failure::new(
        Fault::Service,
        "attempt-limit",
        format!("The job was started {attempt_limit} times and never ended."),
    )
    .fix("Report it with the job's id. Other parameters may work.");
    let now = queue.clock.now();
    let ended = queue
        .jobs
        .end_unclaimable(attempt_limit, &reason, now)
        .await?;
    for job in ended {
        tracing::error!(job = %job.id, attempts = job.attempts, "job ended without a result");
        queue.announce(&job);
    }
    Ok(())
}

/// The periodic upkeep of a running service.
pub struct Upkeep {
    /// The queue to look after.
    pub queue: Arc<Queue>,
    /// Number of attempts after which a job is failed.
    pub attempt_limit: u32,
    /// Age at which finished jobs, volumes, models and segmentations are deleted; `None` keeps
    /// them.
    pub retention: Option<Duration>,
    /// Time between two rounds.
    pub every: Duration,
}

impl Upkeep {
    /// Runs one round every [`Upkeep::every`] until `end` is cancelled.
    pub async fn run(self, end: CancellationToken) {
        let mut round = tokio::time::interval(self.every);
        loop {
            tokio::select! {
                _ = round.tick() => {}
                () = end.cancelled() => return,
            }
            if let Err(error) = self.run_once().await {
                tracing::error!(%error, "upkeep failed; the next round tries again");
            }
        }
    }

    /// Runs one round.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn run_once(&self) -> Result<(), StoreError> {
        end_unclaimable(&self.queue, self.attempt_limit).await?;
        settle_items(&self.queue).await?;
        let Some(age) = self.retention else {
            return Ok(());
        };
        let age = i64::try_from(age.as_millis()).unwrap_or(i64::MAX);
        let before = self.queue.clock.now().saturating_sub(age);
        for id in self.queue.catalogue.older_than(before).await? {
            self.queue.erase(&id).await?;
        }
        Ok(())
    }
}

impl Queue {
    /// Deletes a job that has ended, or an item that no unfinished job needs, with its files.
    ///
    /// # Errors
    /// If the database fails. Files that could not be deleted are deleted by the upkeep, or by the
    /// next start.
    pub async fn erase(self: &Arc<Self>, id: &str) -> Result<Deleted, StoreError> {
        let (queue, id) = (self.clone(), id.to_owned());
        to_its_end(async move { queue.erase_to_the_end(&id).await }).await
    }

    async fn erase_to_the_end(&self, id: &str) -> Result<Deleted, StoreError> {
        let now = self.clock.now();
        let _lock = self.items.lock(id).await;
        if self.items.is_held(id) {
            return Ok(Deleted::InUse);
        }
        self.items.unsettle(id);
        let deleted = match Resource::of(id) {
            Some(Resource::Job) => self.jobs.delete_job(id, now).await?,
            Some(Resource::Volume) => self.catalogue.delete_volume(id, now).await?,
            Some(_) => self.catalogue.delete_product(id, now).await?,
            None => Deleted::Unknown,
        };
        if deleted == Deleted::Done
            && Resource::of(id) != Some(Resource::Job)
            && let Err(error) = self.blobs.delete(id).await
        {
            tracing::warn!(id, %error, "files could not be deleted; the upkeep tries again");
            return Ok(deleted);
        }
        self.items.settle(id);
        Ok(deleted)
    }
}
