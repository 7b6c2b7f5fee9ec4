//! Whether the storage works: one check for all probes.

use crate::jobs::{Queue, StoreError, StoreFault};
use std::time::{Duration, Instant};
use tokio::sync::Mutex;

/// Whether the storage works, checked at most once in [`CHECK_EVERY`] however many probes ask.
#[derive(Default)]
pub struct Readiness(Mutex<Option<(Instant, Result<(), &'static str>)>>);

/// How long the outcome of a check is given to other probes.
const CHECK_EVERY: Duration = Duration::from_secs(1);

/// A check that takes longer counts as failed.
const CHECK_LIMIT: Duration = Duration::from_secs(5);

impl Readiness {
    /// Checks the storage, or returns the outcome of the last check if that is recent. A probe
    /// that comes while another one checks waits for its outcome.
    ///
    /// # Errors
    /// Why the storage does not work, as a sentence.
    pub async fn check(&self, queue: &Queue) -> Result<(), &'static str> {
        let mut last = self.0.lock().await;
        if let Some((at, outcome)) = *last
            && at.elapsed() < CHECK_EVERY
        {
            return outcome;
        }
        let outcome = match tokio::time::timeout(CHECK_LIMIT, check_storage(queue)).await {
            Ok(outcome) => outcome.map_err(|error| {
                tracing::error!(%error, "not ready");
                why_unready(&error)
            }),
            Err(_) => Err("The disk does not answer."),
        };
        *last = Some((Instant::now(), outcome));
        outcome
    }
}

async fn check_storage(queue: &Queue) -> Result<(), StoreError> {
    queue.blobs.check().await?;
    queue.jobs.check().await
}

fn why_unready(error: &StoreError) -> &'static str {
    match (error.cause(), error) {
        (StoreFault::Full, _) => "The disk is full, or nearly so.",
        (StoreFault::Busy, _) => {
            "The database was not free in time: the machine is overloaded, or another program holds it."
        }
        (StoreFault::Away, StoreError::Files(_)) => {
            "The S3 store of the files does not answer, or refuses."
        }
        (StoreFault::Away, StoreError::Database { .. }) => {
            "The database server (PostgreSQL) cannot be reached, or does not accept writes."
        }
        (StoreFault::DamagedDatabase, _) => "The database is damaged.",
        (_, StoreError::Files(_)) => "Files cannot be written.",
        (_, StoreError::Database { .. }) => "The database does not answer.",
    }
}
