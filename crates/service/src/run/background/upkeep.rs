//! Periodic upkeep: recovery after a crash, failing jobs that never end, deleting old items.

use crate::base::records::StoreError;
use crate::items::RetentionAges;
use crate::jobs::Queue;
use std::sync::Arc;
use std::time::Duration;
use tokio_util::sync::CancellationToken;

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
        let items = self.queue.items();
        items.catalogue().recheck().await;
        self.queue.release_dead().await?;
        items.settle_unsettled().await?;
        if let Some(age) = self.retention.jobs {
            self.queue.delete_expired(age).await?;
        }
        items.erase_expired(&self.retention).await?;
        items.overwrite_if_due().await
    }
}
