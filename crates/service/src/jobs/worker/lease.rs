//! Claiming a job and renewing its lease while it is computed and committed.
//!
//! A lease names the run of the service. No worker of the same run takes the job, whatever the
//! clocks say and however long the process stood still: the holder is alive, or the whole run is
//! dead. The expiry is for other runs on the same store.

use super::WorkerSettings;
use crate::base::records::{Claimant, Lease, random_id};
use crate::jobs::Queue;
use std::time::Duration;

/// The outcome of renewing a lease.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Renewal {
    /// The job is still ours.
    Owned,
    /// The job is still ours, and its cancellation was requested.
    CancelRequested,
    /// The lease expired and another run of the service took the job.
    Lost,
}

/// Time between two renewals: two may fail before the lease expires.
pub(super) fn renewal_interval(settings: &WorkerSettings) -> Duration {
    settings.lease / 3
}

/// A worker of this run that asks for a job, with a new token.
pub(super) fn claimant(queue: &Queue, settings: &WorkerSettings) -> Claimant {
    Claimant {
        token: random_id(""),
        run: queue.run.clone(),
        lease: settings.lease,
    }
}

/// Extends the lease by its full length from now.
pub(super) async fn renew(queue: &Queue, settings: &WorkerSettings, lease: &Lease) -> Renewal {
    let now = queue.now();
    match queue.table().renew_lease(lease, settings.lease, now).await {
        Ok(Some(false)) => Renewal::Owned,
        Ok(Some(true)) => Renewal::CancelRequested,
        Ok(None) => Renewal::Lost,
        Err(error) => {
            // If the lease does expire, the commit finds out: it names the token.
            tracing::warn!(job = %lease.job, %error, "the lease could not be renewed");
            Renewal::Owned
        }
    }
}
