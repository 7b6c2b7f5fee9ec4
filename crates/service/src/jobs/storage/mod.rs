//! The interfaces to storage: a database for jobs and records, a file store for contents.
//!
//! [`JobStore`] holds the queue's table, [`Catalogue`] the records of volumes and products, and
//! [`BlobStore`] their files, and [`Scans`] whose scans the volumes are; [`Custody`] is what is needed to look
//! after them, and [`Peers`] what processes on one store know of each other. The module `store` implements them with SQLite or PostgreSQL, and a folder.

mod blobs;
mod catalogue;
mod custody;
mod erasure;
mod figures;
mod holding;
mod job_store;
mod listing;
mod peers;
mod product;
mod record;
mod scan;
mod volume;

pub use blobs::{
    BlobError, BlobStore, BlobStream, BlobWriter, DiskSpace, LocalFile, Shelved, StagedFiles,
    StagedFor,
};
pub use catalogue::{AddedProduct, Catalogue, Deleted, ProductRoom};
pub use custody::{Custody, RecordPages};
pub use erasure::{
    AuditMark, Erased, ErasedFile, ErasedItem, ErasureAgent, ErasureOrder, ErasureReason, Expired,
    Receipt,
};
pub use figures::{FigureStore, QueueFigures};
pub use holding::{Held, Holding, ItemFilter, LegalHold, TagFilter, Tags};
pub use job_store::{
    Claimant, DeathLimit, Interrupted, JobFilter, JobOutcome, JobStore, Lease, QueueLoad,
};
pub use listing::{ListPage, ListRequest};
pub use peers::{News, NewsFeed, Peers};
pub use product::{Product, ProductFile};
pub use record::ItemRecord;
pub use scan::{ScanFields, ScanFilter, ScanIdentity, Scans, UnreadScan};
pub use volume::{FileRecord, StoredVolume};

/// The result of an operation on the database.
pub type StoreResult<T> = Result<T, StoreError>;

/// The storage failed.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The database failed.
    #[error("the database: {message}")]
    Database {
        /// The kind of failure.
        cause: StoreFault,
        /// What the database said.
        message: String,
    },
    /// The file store failed.
    #[error(transparent)]
    Files(#[from] BlobError),
}

impl StoreError {
    /// A failure of the database for another reason than those of [`StoreFault`].
    pub fn database(message: impl Into<String>) -> Self {
        Self::Database {
            cause: StoreFault::Other,
            message: message.into(),
        }
    }

    /// The kind of failure.
    pub fn cause(&self) -> StoreFault {
        match self {
            StoreError::Database { cause, .. } => *cause,
            StoreError::Files(error) => error.cause,
        }
    }
}

/// The kinds of failures of the storage, by what can be done about them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoreFault {
    /// The disk or a quota is full, or less than the operator's reserve is free. It works again
    /// once there is room.
    Full,
    /// Another process holds the database for too long. It works again when that process is done.
    Busy,
    /// The disk does not read or write.
    Disk,
    /// A server, of the database or of the files, is not reached, or refuses. It works again when the
    /// server does.
    Away,
    /// The content of a file is not what was stored, or the file is gone. The same upload repairs
    /// it.
    DamagedFile,
    /// The item was erased while it was read.
    Erased,
    /// The database file is damaged.
    DamagedDatabase,
    /// Anything else, such as a defect of this program.
    Other,
}

impl StoreFault {
    /// Whether the same operation can succeed later.
    pub fn may_pass(self) -> bool {
        matches!(self, Self::Full | Self::Busy | Self::Disk | Self::Away)
    }
}
