//! The job queue: durable jobs, leases, workers.
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
//! **Time.** [`ServiceClock`](crate::base::records::ServiceClock) does not follow a step of the system's clock until it has
//! lasted, and no lease of the living run depends on any clock.
//!
//! Guaranteed:
//! - a job is on disk before [`Queue::file`] returns;
//! - after a crash at any moment, every accepted job is computed again, and its result is
//!   committed once;
//! - a job that ends its own process is failed after a set number of times, and harms no other;
//! - a panic in the computation fails that job only;
//! - cancelling raises the [`CancelToken`](ventriform::base::progress::CancelToken) of the computation;
//! - what a request stores is stored to the end although its client hangs up.
//!
//! Not guaranteed: that a job is computed only once. It is computed at least once.

mod isolation;
mod observer;
mod queue;
mod work;
mod worker;

pub use isolation::Isolation;
pub use observer::JobObserver;
pub use queue::{Queue, QueuePosition, QueueSettings};
pub use work::{GivenParameters, Needs, Work, WorkError, WorkInput, Works};
pub use worker::{WorkerSettings, Workers, serve_isolated};
