//! The interfaces to storage: a database for jobs and records, a file store for contents.
//!
//! [`JobStore`] holds the queue's table, [`Catalogue`] the records of volumes and products, and
//! [`BlobStore`] their files. The module `store` implements them with SQLite and a folder.

mod blobs;
mod catalogue;
mod figures;
mod job_store;
mod listing;
mod product;
mod volume;

pub use blobs::{BlobError, BlobStore, BlobStream, BlobWriter, LocalFile, StagedFiles};
pub use catalogue::{Catalogue, Deleted};
pub use figures::{FigureStore, QueueFigures};
pub use job_store::{Claimant, DeathLimit, Interrupted, JobOutcome, JobStore, Lease, QueueLoad};
pub use listing::{ListPage, ListRequest};
pub use product::{Product, ProductFile};
pub use volume::StoredVolume;

/// The result of an operation on the database.
pub type StoreResult<T> = Result<T, StoreError>;

/// The storage failed.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The database failed: full, locked, unreachable, damaged.
    #[error("the database: {0}")]
    Database(String),
    /// The file store failed.
    #[error(transparent)]
    Files(#[from] BlobError),
}
