//! What the queue and the catalogue need of a database, by intent.

use super::{
    Failure, Filed, Job, NewJob, Page, PageRequest, Product, Resource, State, Timestamp, Volume,
};
use async_trait::async_trait;

/// The database could not do its part: full, locked, gone, damaged.
#[derive(Debug, thiserror::Error)]
#[error("the database: {0}")]
pub struct StoreError(pub String);

type Result<T> = std::result::Result<T, StoreError>;

/// A worker's hold on a job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lease {
    /// The job.
    pub job: String,
    /// Known to the holder only; whoever writes must name it.
    pub token: String,
}

/// How a claimed job ended.
#[derive(Debug, Clone)]
pub enum Outcome {
    /// With this product.
    Succeeded(Box<Product>),
    /// With this reason.
    Failed(Failure),
    /// Because somebody asked.
    Cancelled,
}

/// What became of a request to end a job.
#[derive(Debug, Clone)]
pub enum Interrupted {
    /// It waited and is cancelled.
    Cancelled(Job),
    /// It runs; its worker is asked to stop.
    Asked(Job),
    /// It had ended already.
    Finished(Job),
    /// No such job.
    Unknown,
}

/// What became of a request to erase something.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deleted {
    /// It is gone.
    Done,
    /// Jobs that have not ended need it.
    InUse,
    /// No such thing.
    Unknown,
}

/// How busy the queue is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Load {
    /// Jobs that wait.
    pub queued: u64,
    /// Jobs that run.
    pub running: u64,
    /// Mean computing time of the last jobs, ms; absent before the first has ended.
    pub mean_duration_ms: Option<f64>,
}

/// The queue's table. Every method is one transaction.
#[async_trait]
pub trait JobStore: Send + Sync + 'static {
    /// Accepts a job, unless `queue_limit` jobs wait, its volume or another of its
    /// needs is unknown, or its key says
    /// that it was accepted before. Durable on return.
    async fn file(&self, job: &NewJob, queue_limit: usize, now: Timestamp) -> Result<Filed>;

    /// The job of that id.
    async fn job(&self, id: &str) -> Result<Option<Job>>;

    /// Jobs, newest first, all or of one state.
    async fn jobs(&self, state: Option<State>, page: PageRequest) -> Result<Page<Job>>;

    /// How many wait ahead of a job.
    async fn ahead_of(&self, job: &Job) -> Result<u64>;

    /// How busy the queue is.
    async fn load(&self) -> Result<Load>;

    /// Takes the oldest job that waits or whose lease has run out, counts the attempt, and
    /// holds it until `until`. Jobs with `attempt_limit` attempts are left alone.
    async fn claim(
        &self,
        token: &str,
        attempt_limit: u32,
        now: Timestamp,
        until: Timestamp,
    ) -> Result<Option<Job>>;

    /// Prolongs a lease. Says whether the job's end was asked for; `None` if the lease is
    /// lost.
    async fn heartbeat(&self, lease: &Lease, until: Timestamp) -> Result<Option<bool>>;

    /// Notes where the work is. `None` if the lease is lost.
    async fn progress(&self, lease: &Lease, stage: &str, progress: f64) -> Result<Option<Job>>;

    /// Ends a claimed job, with its product where there is one, in one transaction. `None` if
    /// the lease is lost; then nothing was written.
    async fn finish(&self, lease: &Lease, outcome: &Outcome, now: Timestamp)
    -> Result<Option<Job>>;

    /// Gives a claimed job back to the queue; the attempt does not count. `None` if the lease
    /// is lost.
    async fn hand_back(&self, lease: &Lease) -> Result<Option<Job>>;

    /// Puts every running job back into the queue: for the start of the only process on this
    /// store, whose earlier self died. Returns how many.
    async fn release_all(&self) -> Result<u64>;

    /// Fails, with `reason`, jobs that nobody holds and that have had `attempt_limit`
    /// attempts; cancels those whose end was asked for.
    async fn bury(&self, attempt_limit: u32, reason: &Failure, now: Timestamp) -> Result<Vec<Job>>;

    /// Ends a waiting job, asks a running one to end.
    async fn interrupt(&self, id: &str, now: Timestamp) -> Result<Interrupted>;

    /// Erases a job that has ended. [`Deleted::InUse`] if it has not.
    async fn delete_job(&self, id: &str, now: Timestamp) -> Result<Deleted>;
}

/// The tables of volumes and of what was made.
#[async_trait]
pub trait Catalogue: Send + Sync + 'static {
    /// Adds a volume. `false` if it was there.
    async fn add_volume(&self, volume: &Volume) -> Result<bool>;

    /// The volume of that id.
    async fn volume(&self, id: &str) -> Result<Option<Volume>>;

    /// Volumes, newest first.
    async fn volumes(&self, page: PageRequest) -> Result<Page<Volume>>;

    /// Erases a volume that no unfinished job needs.
    async fn delete_volume(&self, id: &str, now: Timestamp) -> Result<Deleted>;

    /// Adds a product that no job made. `false` if it was there.
    async fn add_product(&self, product: &Product) -> Result<bool>;

    /// The product of that id.
    async fn product(&self, id: &str) -> Result<Option<Product>>;

    /// Products of one kind, newest first.
    async fn products(&self, kind: Resource, page: PageRequest) -> Result<Page<Product>>;

    /// Erases a product that no unfinished job needs.
    async fn delete_product(&self, id: &str, now: Timestamp) -> Result<Deleted>;

    /// When the thing of that id was erased, if it ever was here.
    async fn erased_at(&self, id: &str) -> Result<Option<Timestamp>>;

    /// Ids of finished jobs, volumes, models and segmentations that are older than `before`.
    /// Templates are kept.
    async fn older_than(&self, before: Timestamp) -> Result<Vec<String>>;
}
