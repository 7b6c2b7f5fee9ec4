//! Keeps the clock of the service: asks the server of the database for its time where there is one, and notes the time
//! that is trusted for the next start.

use crate::base::records::{Clock, ServiceClock, TimeStore};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio_util::sync::CancellationToken;

/// How often the server of the database is asked for its time.
const ASK_EVERY: Duration = Duration::from_secs(10);

/// An answer that takes longer says too little about the time.
const LONGEST_ANSWER: Duration = Duration::from_secs(1);

/// Every so many rounds the trusted time is noted.
const NOTE_ROUNDS: u32 = 3;

/// The time of day of a running service.
pub struct TimeOfDay {
    /// Its clock.
    pub clock: Arc<ServiceClock>,
    /// What outlives it.
    pub store: Arc<dyn TimeStore>,
}

impl TimeOfDay {
    /// Begins: a start at another time than expected is found out here.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn begin(&self) -> crate::base::records::StoreResult<()> {
        if let Some(now) = self.store.server_time().await? {
            self.clock.follow(now);
        }
        self.clock.begin(self.store.last_trusted().await?);
        Ok(())
    }

    /// Keeps it until `end` is cancelled.
    pub async fn run(self: Arc<Self>, end: CancellationToken) {
        let mut round = tokio::time::interval(ASK_EVERY);
        for number in (0..NOTE_ROUNDS).cycle() {
            if end.run_until_cancelled(round.tick()).await.is_none() {
                break;
            }
            self.ask().await;
            if number == 0 {
                self.note().await;
            }
        }
        self.note().await;
    }

    /// Asks the server for its time. While it does not answer, time goes on by the monotonic clock.
    async fn ask(&self) {
        let asked = Instant::now();
        match self.store.server_time().await {
            Ok(Some(now)) if asked.elapsed() <= LONGEST_ANSWER => self.clock.follow(now),
            Ok(_) => {}
            Err(error) => tracing::warn!(%error, "the time of the database could not be read"),
        }
    }

    async fn note(&self) {
        let clock: &dyn Clock = &*self.clock;
        if let Some(now) = clock.trusted()
            && let Err(error) = self.store.note_trusted(now).await
        {
            tracing::warn!(%error, "the time of day could not be noted for the next start");
        }
    }
}
