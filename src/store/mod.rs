//! Storage of the service: SQLite for records, a folder for files.
//!
//! ```text
//! DATA_DIR/
//!   lock              held by the process that uses this folder
//!   ventriform.db     jobs, volumes, products (WAL, synchronous=FULL)
//!   staging/          files not yet published; emptied at every start
//!   volumes/vol_.../  files of a volume
//!   models/mdl_.../   files of a model; likewise segmentations/, templates/
//! ```
//!
//! Files are published before their record is committed, and deleted after it, so the files of a
//! record are always complete. Files without a record, which a crash can leave behind, are
//! deleted at the next start.

mod blobs;
mod rows;
mod sqlite;
mod sqlite_access;
mod sqlite_catalogue;
mod sqlite_figures;
mod sqlite_hooks;
mod sqlite_jobs;

pub use blobs::FileBlobs;
pub use sqlite::SqliteStore;

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The database and the files of one data folder, which is locked while this exists.
pub struct Store {
    /// The database.
    pub rows: Arc<SqliteStore>,
    /// The files.
    pub blobs: Arc<FileBlobs>,
    _lock: File,
}

/// Why a data folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Another process uses it.
    #[error(
        "{0} is in use by another ventriform process; stop that process or choose another data folder"
    )]
    InUse(PathBuf),
    /// It cannot be created, read or written.
    #[error("{path}: {reason}")]
    Unusable {
        /// The folder or file.
        path: PathBuf,
        /// The system's error message.
        reason: String,
    },
}

impl Store {
    /// Opens the data folder, or creates it.
    ///
    /// # Errors
    /// If another process uses the folder, or it cannot be written.
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

/// The database of a data folder, for commands beside a service that may be running on it. Creates
/// folder and database if they are missing.
///
/// # Errors
/// If the folder cannot be used, or a service of another version runs on it.
pub async fn open_rows(folder: &Path) -> Result<Arc<SqliteStore>, OpenError> {
    match Store::open(folder).await {
        Ok(store) => Ok(store.rows),
        Err(OpenError::InUse(_)) => {
            let database = folder.join("ventriform.db");
            let unusable = |reason: String| OpenError::Unusable {
                path: database.clone(),
                reason,
            };
            if !is_migrated(&database)
                .await
                .map_err(|e| unusable(e.to_string()))?
            {
                return Err(unusable(
                    "the service that runs on it has another version than this command".into(),
                ));
            }
            let rows = SqliteStore::open(&database).await;
            rows.map(Arc::new).map_err(|e| unusable(e.to_string()))
        }
        Err(error) => Err(error),
    }
}

/// Whether the tables have the version of this program. A service must not find them changed.
async fn is_migrated(database: &Path) -> Result<bool, sqlx::Error> {
    use sqlx::{ConnectOptions, Connection};
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(database);
    let mut connection = options.read_only(true).connect().await?;
    let done: i64 = sqlx::query_scalar("SELECT count(*) FROM _sqlx_migrations WHERE success")
        .fetch_one(&mut connection)
        .await?;
    connection.close().await?;
    Ok(usize::try_from(done) == Ok(sqlx::migrate!("src/store/migrations").iter().count()))
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

/// Free and total bytes of the disk that holds `folder`; `None` if the system does not tell.
#[cfg(unix)]
pub fn disk_space(folder: &Path) -> Option<(u64, u64)> {
    let found = rustix::fs::statvfs(folder).ok()?;
    let bytes = |blocks: u64| blocks.saturating_mul(found.f_frsize);
    Some((bytes(found.f_bavail), bytes(found.f_blocks)))
}

/// Free and total bytes of the disk that holds `folder`; `None` if the system does not tell.
#[cfg(not(unix))]
pub fn disk_space(_folder: &Path) -> Option<(u64, u64)> {
    None
}
