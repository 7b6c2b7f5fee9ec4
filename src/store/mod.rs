//! Where jobs, volumes and products are kept: SQLite for the rows, a folder for the files.
//!
//! ```text
//! DATA_DIR/
//!   lock              held by the one process that works here
//!   ventriform.db     rows (WAL, synchronous=FULL)
//!   staging/          what nobody can see yet; emptied at every start
//!   volumes/vol_.../  files of a volume
//!   models/mdl_.../   files of a model; likewise segmentations/, templates/
//! ```
//!
//! Files are published before their row is committed, and erased after it: at any moment a
//! row's files are whole. What a crash leaves without a row is swept at the next start.

mod blobs;
mod rows;
mod sqlite;
mod sqlite_catalogue;
mod sqlite_jobs;

pub use blobs::FileBlobs;
pub use sqlite::SqliteStore;

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The stores of one data folder, and the lock on it.
pub struct Store {
    /// The rows.
    pub rows: Arc<SqliteStore>,
    /// The files.
    pub blobs: Arc<FileBlobs>,
    _lock: File,
}

/// Why a data folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Another process holds it.
    #[error("{0} is in use by another ventriform process; stop it or give another --data-dir")]
    InUse(PathBuf),
    /// It cannot be made, read or written.
    #[error("{path}: {reason}")]
    Unusable {
        /// The folder or file.
        path: PathBuf,
        /// What the system said.
        reason: String,
    },
}

impl Store {
    /// Opens or makes the data folder.
    ///
    /// # Errors
    /// If another process holds it or it cannot be written.
    pub async fn open(folder: &Path) -> Result<Self, OpenError> {
        let unusable = |path: &Path, reason: String| OpenError::Unusable {
            path: path.to_owned(),
            reason,
        };
        std::fs::create_dir_all(folder).map_err(|e| unusable(folder, e.to_string()))?;
        let lock = hold(folder)?;
        let database = folder.join("ventriform.db");
        let rows = SqliteStore::open(&database)
            .await
            .map_err(|e| unusable(&database, e.to_string()))?;
        let blobs = FileBlobs::open(folder).map_err(|e| unusable(folder, e.to_string()))?;
        Ok(Self {
            rows: Arc::new(rows),
            blobs: Arc::new(blobs),
            _lock: lock,
        })
    }
}

fn hold(folder: &Path) -> Result<File, OpenError> {
    let path = folder.join("lock");
    let unusable = |reason: String| OpenError::Unusable {
        path: path.clone(),
        reason,
    };
    let file = File::create(&path).map_err(|e| unusable(e.to_string()))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(OpenError::InUse(folder.to_owned())),
        Err(TryLockError::Error(e)) => Err(unusable(e.to_string())),
    }
}
