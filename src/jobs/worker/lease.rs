//! Claiming a job and renewing its lease while it is computed.

use super::WorkerSettings;
use crate::jobs::{Job, Lease, Queue, StoreError, Timestamp, random_id};
use std::time::Duration;

/// What renewing a lease showed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Renewal {
    /// The job is still ours.
    Held,
    /// The job is still ours, and its cancellation was requested.
    CancelRequested,
    /// The lease expired and the job was claimed by another worker, or ended.
    Lost,
}

/// Time between two renewals: two may fail before the lease expires.
pub(super) fn renewal_interval(settings: &WorkerSettings) -> Duration {
    settings.lease / 3
}

/// Claims the next job, if there is one.
pub(super) async fn claim(
    queue: &Queue,
    settings: &WorkerSettings,
) -> Result<Option<(Job, Lease)>, StoreError> {
    let token = random_id("");
    let (now, until) = (queue.clock.now(), expiry(queue, settings));
    let claimed = queue
        .jobs
        .claim(&token, settings.attempt_limit, now, until)
        .await?;
    Ok(claimed.map(|job| {
        let lease = Lease {
            job: job.id.clone(),
            token,
        };
        (job, lease)
    }))
}

/// Extends the lease by its full length from now.
pub(super) async fn renew(queue: &Queue, settings: &WorkerSettings, lease: &Lease) -> Renewal {
    match queue.jobs.renew_lease(lease, expiry(queue, settings)).await {
        Ok(Some(false)) => Renewal::Held,
        Ok(Some(true)) => Renewal::CancelRequested,
        Ok(None) => Renewal::Lost,
        Err(error) => {
            // If the lease does expire, the commit finds out: it names the token.
            tracing::warn!(job = %lease.job, %error, "the lease could not be renewed");
            Renewal::Held
        }
    }
}

fn expiry(queue: &Queue, settings: &WorkerSettings) -> Timestamp {
    let lease = i64::try_from(settings.lease.as_millis()).unwrap_or(i64::MAX / 2);
    queue.clock.now().saturating_add(lease)
}
