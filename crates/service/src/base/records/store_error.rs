//! Failures of the database and of the file store.

use std::io::ErrorKind;

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
        /// The message of the database.
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

/// A file could not be written or read.
#[derive(Debug, Clone, thiserror::Error)]
#[error("the file store: {message}")]
pub struct BlobError {
    /// The kind of failure.
    pub cause: StoreFault,
    /// The failure.
    pub message: String,
}

impl BlobError {
    /// A failure of that kind.
    pub fn new(cause: StoreFault, message: impl Into<String>) -> Self {
        Self {
            cause,
            message: message.into(),
        }
    }
}

impl From<std::io::Error> for BlobError {
    fn from(error: std::io::Error) -> Self {
        let cause = match error.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => StoreFault::Full,
            _ if error.raw_os_error().is_some() => StoreFault::Disk,
            _ => StoreFault::Other,
        };
        Self::new(cause, error.to_string())
    }
}
