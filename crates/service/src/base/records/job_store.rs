//! The interface to the jobs table.

use super::{
    Bounded, Deleted, ErasureAgent, ListPage, ListRequest, PagePlan, Product, ScanFilter,
    StoreResult, TagFilter,
};
use super::{Failure, Filed, Job, JobState, NewJob, Priority, Tenant, Timestamp};
use async_trait::async_trait;
use std::collections::BTreeMap;
use std::time::Duration;

/// A worker's temporary claim on a job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lease {
    /// Id of the job.
    pub job: String,
    /// Known to the holder only; every write to the job must name it.
    pub token: String,
}

/// A worker that asks for a job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Claimant {
    /// See [`Lease::token`].
    pub token: String,
    /// The run of the service that the worker belongs to. A lease of a run that lives does not
    /// expire for workers of the same run, which know that its holder is alive.
    pub run: String,
    /// Duration of the lease for workers of other runs unless it is renewed.
    pub lease: Duration,
}

/// When a job is failed because of what happened to the processes that computed it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeathLimit {
    /// Number of deaths after which the job is failed.
    pub deaths: u32,
    /// Why it is failed then.
    pub reason: Failure,
}

/// The end of a claimed job.
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

/// The load of the queue.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct QueueLoad {
    /// Number of waiting jobs.
    pub queued: u64,
    /// Number of running jobs.
    pub running: u64,
    /// Mean computing time of the last succeeded jobs, ms; `None` before the first.
    pub mean_duration_ms: Option<f64>,
}

/// Which jobs to list.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct JobFilter {
    /// The tenant whose jobs they are.
    pub tenant: Tenant,
    /// Only those in this state.
    pub state: Option<JobState>,
    /// Only those of this kind of work.
    pub kind: Option<String>,
    /// Only those of this priority.
    pub priority: Option<Priority>,
    /// Only those on this volume.
    pub volume: Option<String>,
    /// Only those with these tags.
    pub tags: TagFilter,
    /// Only those on these scans.
    pub scan: ScanFilter,
    /// Only those filed after this moment.
    pub created_after: Option<Timestamp>,
}

/// The jobs table. Every method is one transaction and fails only if the database does.
#[async_trait]
pub trait JobStore: Send + Sync + 'static {
    /// Accepts a job and writes it to disk, unless the queue [has no room](Self::has_room), the volume or
    /// another needed item does not exist, or the idempotency key was used before.
    async fn file(&self, job: &NewJob, queue_limit: usize, now: Timestamp) -> StoreResult<Filed>;

    /// Bytes of the texts that are stored with a job, beside its record: as the table counts them.
    fn text_bytes(&self, job: &NewJob) -> StoreResult<u64>;

    /// Whether the queue has room for one more job of that tenant: fewer than `queue_limit` jobs wait, or the
    /// tenant has less than its equal share of them.
    async fn has_room(&self, tenant: &Tenant, queue_limit: usize) -> StoreResult<bool>;

    /// The job with that id.
    async fn job(&self, id: &str) -> StoreResult<Option<Job>>;

    /// The job with that id, if its record has no more than so many bytes.
    async fn job_within(&self, id: &str, bytes: u64) -> StoreResult<Bounded<Job>>;

    /// The memory that such a page of jobs takes, so that it can be charged before it is read.
    async fn plan_jobs(&self, filter: &JobFilter, page: ListRequest) -> StoreResult<PagePlan>;

    /// A tenant's jobs, newest first.
    async fn jobs(&self, filter: &JobFilter, page: ListRequest) -> StoreResult<ListPage<Job>>;

    /// The job filed earlier under that idempotency key of a tenant, whatever the request was, with
    /// the fingerprint of that request.
    async fn filed_under(&self, tenant: &Tenant, key: &str) -> StoreResult<Option<(Job, String)>>;

    /// For each of these jobs, by its place in the order of filing, the number of jobs that will start
    /// before it.
    async fn ahead_of(&self, sequences: &[i64]) -> StoreResult<BTreeMap<i64, u64>>;

    /// The load of the queue.
    async fn load(&self) -> StoreResult<QueueLoad>;

    /// Claims the next waiting job: counts the attempt and sets a lease. Tenants take turns; jobs of one
    /// tenant start in the order of their filing.
    ///
    /// `now` is the time of this process, by which only the stamps of the job are set. A store that
    /// several machines share must let leases expire by the clock of its database.
    async fn claim(&self, by: &Claimant, now: Timestamp) -> StoreResult<Option<Job>>;

    /// Extends a lease by `length` from now. Returns whether cancellation was requested, or `None`
    /// if the lease was lost.
    async fn renew_lease(
        &self,
        lease: &Lease,
        length: Duration,
        now: Timestamp,
    ) -> StoreResult<Option<bool>>;

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

    /// Returns a claimed job to the queue without counting the attempt, or cancels it if that was
    /// requested. `None` if the lease was lost.
    async fn hand_back(&self, lease: &Lease, now: Timestamp) -> StoreResult<Option<Job>>;

    /// Returns the job that was claimed with this token, if one was, to the queue as it was before.
    async fn abandon(&self, token: &str) -> StoreResult<Option<Job>>;

    /// The job's own process died: counts that, and returns the job to the queue, cancels it if
    /// that was requested, or fails it at the limit. `None` if the lease was lost.
    async fn crashed(
        &self,
        lease: &Lease,
        limit: &DeathLimit,
        now: Timestamp,
    ) -> StoreResult<Option<Job>>;

    /// Returns the jobs of dead runs to the queue, or cancels those for which that was requested,
    /// and counts the interruption. With a `limit`, fails those that were interrupted that often.
    /// Returns the jobs as they are now.
    ///
    /// At start, the only process on this store says that no `run` lives. Later the dead runs are
    /// those other than `run` whose leases have expired.
    async fn release_dead(
        &self,
        run: Option<&str>,
        limit: Option<&DeathLimit>,
        now: Timestamp,
    ) -> StoreResult<Vec<Job>>;

    /// Cancels a waiting job; marks a running one for cancellation.
    async fn interrupt(&self, id: &str, now: Timestamp) -> StoreResult<Interrupted>;

    /// Whether other processes may use the store too.
    fn is_shared(&self) -> bool;

    /// Checks, for readiness, that the database answers and can be written. Takes no longer than
    /// a write may wait.
    async fn check(&self) -> StoreResult<()>;

    /// Deletes a job that has ended. [`Deleted::InUse`] if it has not. With `by`, a row of the audit trail says so, in
    /// the same transaction.
    async fn delete_job(
        &self,
        id: &str,
        by: Option<&ErasureAgent>,
        now: Timestamp,
    ) -> StoreResult<Deleted>;
}
