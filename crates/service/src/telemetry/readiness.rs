//! Readiness: one check of everything that the service depends on, for all probes.

use crate::jobs::Queue;
use crate::records::{StoreError, StoreFault};
use std::time::{Duration, Instant};
use tokio::sync::Mutex;

/// Whether each dependency works, checked at most once in [`CHECK_EVERY`] however many probes ask.
#[derive(Default)]
pub struct Readiness(Mutex<Option<(Instant, Vec<Check>)>>);

/// Time for which the outcome of a check is given to other probes.
const CHECK_EVERY: Duration = Duration::from_secs(1);

/// A check that takes longer counts as failed.
const CHECK_LIMIT: Duration = Duration::from_secs(5);

/// The state of one dependency.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Check {
    /// `database`, `files`, `disk` or `workers`.
    pub name: &'static str,
    /// Whether no work can be accepted without it.
    pub required: bool,
    /// The faults of it, as a sentence that names no address.
    pub fault: Option<&'static str>,
}

impl Readiness {
    /// Checks each dependency, or returns the outcome of the last check if that is recent. A probe
    /// that comes while another one checks waits for its outcome.
    pub async fn check(&self, queue: &Queue) -> Vec<Check> {
        let mut last = self.0.lock().await;
        if let Some((at, checks)) = &*last
            && at.elapsed() < CHECK_EVERY
        {
            return checks.clone();
        }
        let checks = check_all(queue).await;
        *last = Some((Instant::now(), checks.clone()));
        checks
    }

    /// Whether everything that is required works.
    pub async fn is_ready(&self, queue: &Queue) -> bool {
        why_unready(&self.check(queue).await).is_none()
    }
}

/// The faults of the first dependency that is required and does not work.
pub fn why_unready(checks: &[Check]) -> Option<&'static str> {
    checks
        .iter()
        .filter(|check| check.required)
        .find_map(|check| check.fault)
}

async fn check_all(queue: &Queue) -> Vec<Check> {
    let (database, files, workers) = tokio::join!(
        limited(queue.table().check(), "The database does not answer."),
        limited(
            async { Ok(queue.items().blobs().check().await?) },
            "The place of the files does not answer.",
        ),
        limited(queue.workers(), "The database does not answer."),
    );
    // A full disk is its own finding; the check of the files stops there.
    let full = queue.items().blobs().require_room(0).is_err();
    let check = |name, required, fault| Check {
        name,
        required,
        fault,
    };
    vec![
        check("database", true, database.err()),
        check("files", true, files.err().filter(|_| !full)),
        check("disk", true, full.then_some(DISK_FULL)),
        check(
            "workers",
            false,
            match workers {
                Ok(0) => Some("No process that computes jobs runs; jobs wait."),
                Ok(_) => None,
                Err(fault) => Some(fault),
            },
        ),
    ]
}

/// The outcome of a check in limited time; `late` says that it took longer.
async fn limited<T>(
    check: impl Future<Output = Result<T, StoreError>>,
    late: &'static str,
) -> Result<T, &'static str> {
    match tokio::time::timeout(CHECK_LIMIT, check).await {
        Ok(outcome) => outcome.map_err(|error| {
            tracing::error!(%error, "not ready");
            fault_of(&error)
        }),
        Err(_) => Err(late),
    }
}

const DISK_FULL: &str = "The disk is full, or nearly so.";

fn fault_of(error: &StoreError) -> &'static str {
    match (error.cause(), error) {
        (StoreFault::Full, _) => DISK_FULL,
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
