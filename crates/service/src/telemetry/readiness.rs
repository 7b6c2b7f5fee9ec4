//! Readiness: one check of everything that the service depends on, for all probes.
//!
//! | check | what is tried |
//! |---|---|
//! | `database` | it is read and can be written, and no statement since has told that it is damaged or cannot be read |
//! | `audit` | a row can be appended to the audit trail |
//! | `files` | a small file is written, read and deleted in every folder, or in the bucket |
//! | `disk` | there is room |
//! | `workers` | processes that compute jobs live |
//! | `clock` | ages count by the time of day |
//!
//! A check that cannot be made counts as failed, and is required: what is not known to work does not count as working.

use crate::base::records::{StoreError, StoreFault};
use crate::callers::AccessStore;
use crate::jobs::Queue;
use std::time::{Duration, Instant};
use tokio::sync::Mutex;

/// Whether each dependency works, checked at most once in [`CHECK_EVERY`] however many probes ask.
#[derive(Default)]
pub struct Readiness(Mutex<Outcomes>);

#[derive(Default)]
struct Outcomes {
    last: Option<(Instant, Vec<Check>)>,
    /// When a row could be appended to the audit trail last.
    trail: Option<Instant>,
}

/// What is checked.
#[derive(Clone, Copy)]
pub struct Dependencies<'a> {
    /// The jobs, with the items and their files.
    pub queue: &'a Queue,
    /// The audit trail.
    pub access: &'a dyn AccessStore,
}

/// Time for which the outcome of a check is given to other probes.
const CHECK_EVERY: Duration = Duration::from_secs(1);

/// Time for which the outcome of appending to the audit trail counts, if it succeeded: it writes to the disk.
const TRAIL_EVERY: Duration = Duration::from_secs(5);

/// A check that takes longer counts as failed.
const CHECK_LIMIT: Duration = Duration::from_secs(5);

/// The state of one dependency.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Check {
    /// `database`, `audit`, `files`, `disk`, `workers` or `clock`.
    pub name: &'static str,
    /// Whether no work can be accepted without it.
    pub required: bool,
    /// The faults of it, as a sentence that names no address.
    pub fault: Option<&'static str>,
}

impl Readiness {
    /// Checks each dependency, or returns the outcome of the last check if that is recent. A probe
    /// that comes while another one checks waits for its outcome.
    pub async fn check(&self, on: Dependencies<'_>) -> Vec<Check> {
        let mut known = self.0.lock().await;
        if let Some((at, checks)) = &known.last
            && at.elapsed() < CHECK_EVERY
        {
            return checks.clone();
        }
        let (checks, trail) = check_all(on, known.trail).await;
        *known = Outcomes {
            last: Some((Instant::now(), checks.clone())),
            trail,
        };
        checks
    }

    /// Whether everything that is required works.
    pub async fn is_ready(&self, on: Dependencies<'_>) -> bool {
        why_unready(&self.check(on).await).is_none()
    }
}

/// The faults of the first dependency that is required and does not work.
pub fn why_unready(checks: &[Check]) -> Option<&'static str> {
    checks
        .iter()
        .filter(|check| check.required)
        .find_map(|check| check.fault)
}

/// Checks each dependency. `trail` is when a row could be appended to the audit trail last; it is returned as it is
/// now.
async fn check_all(on: Dependencies<'_>, trail: Option<Instant>) -> (Vec<Check>, Option<Instant>) {
    let queue = on.queue;
    let trail = trail.filter(|at| at.elapsed() < TRAIL_EVERY);
    let append = async {
        match trail {
            Some(at) => Ok(at),
            None => {
                on.access.check_trail(queue.now()).await?;
                Ok(Instant::now())
            }
        }
    };
    let (database, audit, files, workers) = tokio::join!(
        limited(queue.table().check(), "The database does not answer."),
        limited(append, "The database does not answer."),
        limited(
            async { Ok(queue.items().blobs().check().await?) },
            "The place of the files does not answer.",
        ),
        limited(queue.workers(), "The database does not answer."),
    );
    // A statement that was made beside the check of the database may have told of a defect.
    let database = match database {
        Ok(()) if audit.is_err() || workers.is_err() => {
            limited(queue.table().check(), "The database does not answer.").await
        }
        known => known,
    };
    // A full disk is its own finding; the check of the files stops there.
    let full = queue.items().blobs().require_room(0).is_err();
    let check = |name, required, fault| Check {
        name,
        required,
        fault,
    };
    let checks = vec![
        check("database", true, database.err()),
        check("audit", true, audit.err().map(trail_fault)),
        check("files", true, files.err().filter(|_| !full)),
        check("disk", true, full.then_some(DISK_FULL)),
        check(
            "workers",
            workers.is_err(),
            match workers {
                Ok(0) => Some("No process that computes jobs runs; jobs wait."),
                Ok(_) => None,
                Err(fault) => Some(fault),
            },
        ),
        check(
            "clock",
            false,
            (!queue.clock().is_trusted()).then_some(CLOCK_IN_DOUBT),
        ),
    ];
    (checks, audit.ok())
}

/// What a fault of the database means for the audit trail.
fn trail_fault(fault: &'static str) -> &'static str {
    if fault == UNKNOWN_FAULT {
        "The audit trail cannot be written."
    } else {
        fault
    }
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

const CLOCK_IN_DOUBT: &str = "The time of day is in doubt: no ages count until the clock has run for an hour \
    without a step, or is back at the expected time.";

const UNKNOWN_FAULT: &str = "The database reports an unexpected error; see the log.";

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
        (StoreFault::DamagedDatabase, _) => {
            "The database is damaged; `ventriform doctor` tells where, and mends it."
        }
        (StoreFault::Disk, StoreError::Database { .. }) => {
            "The disk of the database does not read or write."
        }
        (_, StoreError::Files(_)) => "Files cannot be written.",
        (_, StoreError::Database { .. }) => UNKNOWN_FAULT,
    }
}
