//! What nobody asks for: recovery after a crash, giving up on jobs that never end, erasing
//! what is old.

use super::{Catalogue, Deleted, Failure, Fault, Queue, Resource, StoreError};
use std::sync::Arc;
use std::time::Duration;
use tokio_util::sync::CancellationToken;

/// Brings table and files in order after the process before this one died at any moment.
/// Call before the first worker starts, as the only process on the store.
///
/// # Errors
/// If database or files cannot be read.
pub async fn settle_after_a_crash(queue: &Queue, attempt_limit: u32) -> Result<(), StoreError> {
    let released = queue.jobs.release_all().await?;
    bury(queue, attempt_limit).await?;
    let orphans = erase_orphans(queue).await?;
    if released + orphans > 0 {
        tracing::warn!(released, orphans, "recovered from an unclean end");
    }
    Ok(())
}

/// Files whose row was never committed, or whose row was erased before they were.
async fn erase_orphans(queue: &Queue) -> Result<u64, StoreError> {
    let failed = |e: super::BlobError| StoreError(e.to_string());
    let mut orphans = 0;
    for id in queue.blobs.ids().await.map_err(failed)? {
        let known = match Resource::of(&id) {
            Some(Resource::Volume) => queue.catalogue.volume(&id).await?.is_some(),
            _ => queue.catalogue.product(&id).await?.is_some(),
        };
        if !known {
            queue.blobs.delete(&id).await.map_err(failed)?;
            orphans += 1;
        }
    }
    Ok(orphans)
}

async fn bury(queue: &Queue, attempt_limit: u32) -> Result<(), StoreError> {
    let reason = Failure::new(
        Fault::Service,
        "attempt-limit",
        format!("The job was started {attempt_limit} times and never came to an end."),
    )
    .fix("Please report it with the job's id; other parameters may get through.");
    let now = queue.clock.now();
    for job in queue.jobs.bury(attempt_limit, &reason, now).await? {
        tracing::error!(job = %job.id, attempts = job.attempts, "job given up");
        queue.announce(&job);
    }
    Ok(())
}

/// The housekeeper.
pub struct Upkeep {
    /// What it looks after.
    pub queue: Arc<Queue>,
    /// Starts of one job before it is given up.
    pub attempt_limit: u32,
    /// Age at which finished jobs, volumes, models and segmentations are erased.
    pub retention: Option<Duration>,
    /// How often it looks.
    pub every: Duration,
}

impl Upkeep {
    /// Looks after the queue until `end`.
    pub async fn run(self, end: CancellationToken) {
        let mut turn = tokio::time::interval(self.every);
        loop {
            tokio::select! {
                _ = turn.tick() => {}
                () = end.cancelled() => return,
            }
            if let Err(error) = self.look().await {
                tracing::error!(%error, "upkeep failed; it will be tried again");
            }
        }
    }

    /// One round.
    ///
    /// # Errors
    /// If the database cannot.
    pub async fn look(&self) -> Result<(), StoreError> {
        bury(&self.queue, self.attempt_limit).await?;
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
    /// Erases a finished job, or a thing that no unfinished job needs, files included.
    ///
    /// # Errors
    /// If the database cannot. Files that could not be erased are orphans: the next start
    /// erases them.
    pub async fn erase(&self, id: &str) -> Result<Deleted, StoreError> {
        let now = self.clock.now();
        let catalogue: &dyn Catalogue = &*self.catalogue;
        let _shelving = self.shelving.lock().await;
        let deleted = match Resource::of(id) {
            Some(Resource::Job) => return self.jobs.delete_job(id, now).await,
            Some(Resource::Volume) => catalogue.delete_volume(id, now).await?,
            Some(_) => catalogue.delete_product(id, now).await?,
            None => Deleted::Unknown,
        };
        if deleted == Deleted::Done
            && let Err(error) = self.blobs.delete(id).await
        {
            tracing::warn!(id, %error, "files are left behind until the next start");
        }
        Ok(deleted)
    }
}
