//! The job queue: durable jobs, leases, workers, and the interfaces to storage.
//!
//! ```text
//! client ──file──> Queue ──> JobStore      the row is on disk before the call returns
//!                    │ wakes
//!                 Workers ──claim──> Work::run ──> BlobStore, then one commit of the row
//! ```
//!
//! The queue does not know what its jobs compute. A job has an id, a kind, a lease, a state and
//! parameters as JSON; a [`Work`] is registered for each kind and computes it.
//!
//! The jobs table is both the API's record and the queue. A worker claims a job with one
//! statement, which counts the attempt and sets a lease: a secret token, the run of the service,
//! and an expiry time. Every later write of that worker names the token, so a worker that has lost
//! its lease cannot change the job any more. No worker takes a job from a worker of the same run;
//! the expiry is for other runs, and a start releases the jobs of the run before it.
//!
//! **Deaths.** A job that was running when the service died may have killed it, or a power cut did.
//! The job is suspected, not punished: from then on it is computed in a process of its own
//! ([`Isolation`]). If that process dies while the service lives, the job is to blame, and is
//! failed at the limit. If the service dies too, nothing is counted. So any number of power cuts
//! fail no job, and a job that kills its process kills the service once at most. A program that
//! cannot start such a process (`Works::isolation` is `None`) counts the deaths of the whole
//! service instead, and cannot tell the two apart.
//!
//! **Time.** [`SteadyClock`] does not follow a step of the system's clock until it has lasted, and
//! no lease of the living run depends on any clock.
//!
//! Guaranteed:
//! - a job is on disk before [`Queue::file`] returns;
//! - after a crash at any moment, every accepted job is computed again, and its result is
//!   committed once;
//! - a job that ends its own process is failed after a set number of times, and harms no other;
//! - a panic in the computation fails that job only;
//! - cancelling raises the [`CancelToken`](ventriform::progress::CancelToken) of the computation;
//! - what a request stores is stored to the end although its client hangs up.
//!
//! Not guaranteed: that a job is computed only once. It is computed at least once.
//!
//! | where | what |
//! |---|---|
//! | `job`, `resource`, `ids`, `failure`, `tenant` | a job and its states, kinds of ids, reasons for failing, owners |
//! | `work` | what a kind of job must provide, its input and its output |
//! | `queue` | filing, waiting for and cancelling jobs; publishing results; recovery, retention |
//! | `worker` | claiming jobs, renewing leases, reporting progress, committing |
//! | `storage` | the traits that a database and a file store implement |

mod clock;
mod failure;
mod ids;
mod isolation;
mod job;
mod observer;
mod priority;
mod queue;
mod resource;
mod storage;
mod tenant;
mod work;
mod worker;

pub use clock::{Clock, SteadyClock, SystemClock, Timestamp, parse_rfc3339, rfc3339};
pub use failure::{Failure, Fault};
pub use ids::hex;
pub use ids::{content_id, random_id, random_key, volume_id};
pub use isolation::Isolation;
pub use job::{Filed, Idempotency, Job, JobState, JobWebhook, NewJob, SendOrder, SeriesSource};
pub use observer::JobObserver;
pub use priority::Priority;
pub use queue::{
    Custodian, Hold, NotAdded, Queue, QueuePosition, QueueSettings, RetentionAges, Swept,
    TemplateSource, Upkeep, check_name, recover_after_crash,
};
pub use resource::Resource;
pub use storage::{
    AddedProduct, AuditMark, BlobError, BlobStore, BlobStream, BlobWriter, Catalogue, Claimant,
    Custody, DeathLimit, Deleted, DiskSpace, Erased, ErasedFile, ErasedItem, ErasureAgent,
    ErasureOrder, ErasureReason, Expired, FigureStore, FileRecord, Held, Holding, Interrupted,
    ItemFilter, ItemRecord, JobFilter, JobOutcome, JobStore, Lease, LegalHold, ListPage,
    ListRequest, LocalFile, News, NewsFeed, Peers, Product, ProductFile, ProductRoom, QueueFigures,
    QueueLoad, Receipt, RecordPages, ScanFields, ScanFilter, ScanIdentity, Scans, Shelved,
    StagedFiles, StagedFor, StoreError, StoreFault, StoreResult, StoredVolume, TagFilter, Tags,
    UnreadScan,
};
pub use tenant::{InvalidTenant, Tenant};
pub use work::{
    GivenParameters, Needs, OutputFile, StoredItem, StoredResult, Work, WorkError, WorkInput,
    WorkOutput, Works,
};
pub use worker::{WorkerSettings, Workers, serve_isolated};
