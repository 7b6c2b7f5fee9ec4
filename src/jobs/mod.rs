//! Jobs: what was asked for, who computes it, and what came of it.
//!
//! ```text
//! http ──file──> Queue ──JobStore──> rows, durable before the answer
//!                  │ wakes
//!                Worker ──claim──> Work::run ──publish──> blobs, then one commit
//! ```
//!
//! The jobs table is the API's truth *and* the queue. A worker claims a job with one
//! statement that counts the attempt and sets a lease: a token and an expiry. Whatever the
//! worker writes later names the token, so a worker that lost its lease changes nothing.
//!
//! Guaranteed: a job is durable before anybody hears of it; after a crash at any moment every
//! accepted job is computed again and committed once; a job that brings the process down is
//! given up after a set number of attempts, and says so. A panic in the work fails the job and
//! nothing else. Cancelling reaches the work through its token, as fast as the work looks.
//!
//! Not guaranteed: that a job is *computed* once. It is at least once; the commit is once.
//!
//! The traits that this needs of the outside are here: [`JobStore`], [`Catalogue`] and
//! [`BlobStore`] (implemented in `store`), [`Clock`], and [`Work`], which the pipeline
//! fulfils.

mod blobs;
mod checked;
mod clock;
mod failure;
mod generation;
mod ids;
mod input;
mod job;
mod page;
mod product;
mod progress;
mod publish;
mod queue;
mod reader;
mod resource;
mod runner;
mod segmentation;
mod store;
mod upkeep;
mod volume;
mod work;
mod worker;

pub use blobs::{BlobError, BlobStore, BlobStream, Staged};
pub use clock::{Clock, ManualClock, SystemClock, Timestamp};
pub use failure::{Failure, Fault};
pub use generation::Generation;
pub(crate) use ids::hex;
pub use ids::{content_id, random_id};
pub use job::{Filed, Idempotency, Job, NewJob, State};
pub use page::{Page, PageRequest};
pub use product::{Product, ProductFile};
pub use queue::{Queue, QueueSettings, Standing};
pub use reader::Reader;
pub use resource::Resource;
pub use segmentation::Fitting;
pub use store::{Catalogue, Deleted, Interrupted, JobStore, Lease, Load, Outcome, StoreError};
pub use upkeep::{Upkeep, settle_after_a_crash};
pub use volume::{Intensity, Volume, VolumeFacts};
pub use work::{Engine, Input, Needs, Output, OutputFile, Stored, VolumeReader, Work, WorkError};
pub use worker::{WorkerSettings, Workers};
