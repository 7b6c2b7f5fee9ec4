//! The interface to the jobs table.

use super::{Deleted, ListPage, ListRequest, Product, StoreResult};
use crate::jobs::{Failure, Filed, Job, JobState, NewJob, Timestamp};
use async_trait::async_trait;

/// A worker's temporary claim on a job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lease {
    /// Id of the job.
    pub job: String,
    /// Known to the holder only; every write to the job must name it.
    pub token: String,
}

/// How a claimed job ended.
#[derive(Debug, Clone)]
pub enum JobOutcome {
    /// With this product.
    Succeeded(Box<Product>),
    /// For this reason.
    Failed(Failure),
    /// On request.
    Cancelled,
}

/// The result of a request to cancel a job.
#[derive(Debug, Clone)]
pub enum Interrupted {
    /// It was waiting and is cancelled now.
    Cancelled(Job),
    /// It is running; its worker was asked to stop.
    Asked(Job),
    /// It had already ended.
    Finished(Job),
    /// There is no such job.
    Unknown,
}

/// How busy the queue is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct QueueLoad {
    /// Number of waiting jobs.
    pub queued: u64,
    /// Number of running jobs.
    pub running: u64,
    /// Mean computing time of the last succeeded jobs, ms; `None` before the first.
    pub mean_duration_ms: Option<f64>,
}

/// The jobs table. Every method is one transaction and fails only if the database does.
#[async_trait]
pub trait JobStore: Send + Sync + 'static {
    /// Accepts a job and writes it to disk, unless `queue_limit` jobs are waiting, the volume or
    /// another needed item does not exist, or the idempotency key was used before.
    async fn file(&self, job: &NewJob, queue_limit: usize, now: Timestamp) -> StoreResult<Filed>;

    /// The job with that id.
    async fn job(&self, id: &str) -> StoreResult<Option<Job>>;

    /// Jobs, newest first: all, or those in `state`.
    async fn jobs(&self, state: Option<JobState>, page: ListRequest) -> StoreResult<ListPage<Job>>;

    /// The number of jobs that wait ahead of `job`.
    async fn ahead_of(&self, job: &Job) -> StoreResult<u64>;

    /// How busy the queue is.
    async fn load(&self) -> StoreResult<QueueLoad>;

    /// Claims the oldest job that is waiting or whose lease has expired: counts the attempt and
    /// sets a lease until `until`. Skips jobs that have had `attempt_limit` attempts.
    async fn claim(
        &self,
        token: &str,
        attempt_limit: u32,
        now: Timestamp,
        until: Timestamp,
    ) -> StoreResult<Option<Job>>;

    /// Extends a lease until `until`. Returns whether cancellation was requested, or `None` if
    /// the lease was lost.
    async fn renew_lease(&self, lease: &Lease, until: Timestamp) -> StoreResult<Option<bool>>;

    /// Stores the current stage and the completed fraction. `None` if the lease was lost.
    async fn progress(&self, lease: &Lease, stage: &str, progress: f64)
    -> StoreResult<Option<Job>>;

    /// Ends a claimed job and, in the same transaction, adds its product. `None` if the lease was
    /// lost; then nothing was written.
    async fn finish(
        &self,
        lease: &Lease,
        outcome: &JobOutcome,
        now: Timestamp,
    ) -> StoreResult<Option<Job>>;

    /// Returns a claimed job to the queue without counting the attempt. `None` if the lease was
    /// lost.
    async fn hand_back(&self, lease: &Lease) -> StoreResult<Option<Job>>;

    /// Returns every running job to the queue, and how many there were. To be called at start by
    /// the only process on this store: their workers died with the process before it.
    async fn release_all(&self) -> StoreResult<u64>;

    /// Ends the jobs that no worker will claim any more: fails, with `reason`, those that have had
    /// `attempt_limit` attempts, and cancels those whose cancellation was requested.
    async fn end_unclaimable(
        &self,
        attempt_limit: u32,
        reason: &Failure,
        now: Timestamp,
    ) -> StoreResult<Vec<Job>>;

    /// Cancels a waiting job; marks a running one for cancellation.
    async fn interrupt(&self, id: &str, now: Timestamp) -> StoreResult<Interrupted>;

    /// Deletes a job that has ended. [`Deleted::InUse`] if it has not.
    async fn delete_job(&self, id: &str, now: Timestamp) -> StoreResult<Deleted>;
}
