//! Storage of the service: SQLite for records, a folder for files.
//!
//! ```text
//! DATA_DIR/
//!   lock              held by the process that uses this folder; says whether it was closed
//!   ventriform.db     jobs, volumes, products (WAL, synchronous=FULL)
//!   staging/          files not yet published; emptied at every start
//!   discarded/        files that are being deleted
//!   quarantine/DAY/   files that were found without a record
//!   received/         objects that came by C-STORE or STOW-RS and are not volumes yet
//!   volumes/vol_.../  files of a volume
//!   models/mdl_.../   files of a model; likewise segmentations/, templates/
//! ```
//!
//! Files are published before their record is committed, and deleted after it, so the files of a
//! record are always complete. Beside the files lies a copy of the record, `record.json`. Files
//! without a record, which a crash can leave behind, are moved into the quarantine.
//!
//! A new database is made only in a folder without items: with an empty database, all of them
//! would seem to be without a record.
//!
//! The files can be in a bucket of an S3 store instead ([`s3`]). Then the folder holds the database,
//! local copies (`cache/`) and a file `blobs` that says where the files are, so that nobody takes the
//! folder for one whose items are missing.

mod backup;
mod blobs;
mod cache;
mod content;
mod doctor;
mod erasure;
mod faults;
mod findings;
mod received;
mod rows;
mod s3;
mod space;
mod sqlite;
mod sqlite_access;
mod sqlite_archives;
mod sqlite_catalogue;
mod sqlite_custody;
mod sqlite_figures;
mod sqlite_hooks;
mod sqlite_intake;
mod sqlite_jobs;
mod sqlite_repair;
mod sqlite_scans;
mod sqlite_worklist;
mod writer;

pub use backup::{Backup, backup};
pub use blobs::FileBlobs;
pub use doctor::{DoctorError, examine};
pub use findings::{Examination, Finding};
pub use s3::{S3Blobs, S3Location, S3Refusal};
pub use space::DiskGauge;
pub use sqlite::SqliteStore;

use crate::intake::ReceivedFiles;
use crate::jobs::{BlobError, BlobStore, Resource};
use std::fs::{File, TryLockError};
use std::io::{ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Limits of a store.
#[derive(Debug, Clone)]
pub struct StoreSettings {
    /// Bytes of the disk to keep free; `None` is 256 MiB, or 5 % of a smaller disk.
    pub min_free: Option<u64>,
    /// Longest time that a write to the database waits for its turn.
    pub write_wait: Duration,
    /// The bucket for the files; `None` keeps them in the folder.
    pub s3: Option<S3Location>,
    /// Largest size of the local copies of files in a bucket, bytes.
    pub cache: u64,
}

impl Default for StoreSettings {
    fn default() -> Self {
        Self {
            min_free: None,
            write_wait: Duration::from_secs(2),
            s3: None,
            cache: 2 << 30,
        }
    }
}

/// The database of one data folder, which is locked while this exists, and the files.
pub struct Store {
    /// The database.
    pub rows: Arc<SqliteStore>,
    /// The files of items.
    pub blobs: Arc<dyn BlobStore>,
    /// The files of received objects.
    pub received: Arc<dyn ReceivedFiles>,
    lock: FolderLock,
}

/// Why a data folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Another process uses it.
    #[error(
        "{0} is in use by another ventriform process; stop that process or choose another data folder"
    )]
    InUse(PathBuf),
    /// It holds items, but its database is missing or empty.
    #[error(
        "{folder} holds stored items, but {database} is missing or empty. Restore it from a backup \
         together with its -wal file, or make a new one from what lies beside the files: \
         ventriform doctor --data-dir {folder} --repair",
        folder = .0.display(),
        database = .0.join(DATABASE).display(),
    )]
    DatabaseMissing(PathBuf),
    /// The last process did not end in order, and the changes it had not yet moved into the
    /// database are missing.
    #[error(
        "{folder}: the service did not stop in order, and {DATABASE}-wal, which holds the last \
         changes to the database, is missing. Restore it together with {DATABASE}; if it is \
         lost, accept that and check the rest: ventriform doctor --data-dir {folder} --repair",
        folder = .0.display(),
    )]
    LogMissing(PathBuf),
    /// Its files are in a bucket, and another place was given.
    #[error(
        "the files of {folder} are in {blobs}: start the service with `--blobs {blobs}`, or on another \
         folder. Commands that work on the files of a folder cannot be used on it",
        folder = .folder.display(),
    )]
    FilesElsewhere {
        /// The folder.
        folder: PathBuf,
        /// Where its files are.
        blobs: String,
    },
    /// It holds the files of items, and a bucket was given.
    #[error(
        "{folder} holds the files of stored items, so they cannot be in {blobs}: start the service \
         without `--blobs`, or on another folder",
        folder = .folder.display(),
    )]
    FilesHere {
        /// The folder.
        folder: PathBuf,
        /// The bucket that was given.
        blobs: String,
    },
    /// The bucket holds items, but the database is missing or empty.
    #[error(
        "{blobs} holds stored items, but {database} is missing or empty. Restore it from a backup, or \
         give another bucket or prefix",
        database = .database.display(),
    )]
    RowsMissing {
        /// The bucket.
        blobs: String,
        /// The database.
        database: PathBuf,
    },
    /// The bucket cannot be used.
    #[error(transparent)]
    S3(#[from] S3Refusal),
    /// The bucket cannot be read.
    #[error(transparent)]
    Blobs(#[from] BlobError),
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
    /// Opens the data folder, or creates it, with the default settings.
    ///
    /// # Errors
    /// As [`Store::open_with`].
    pub async fn open(folder: &Path) -> Result<Self, OpenError> {
        Self::open_with(folder, StoreSettings::default()).await
    }

    /// Opens the data folder, or creates it.
    ///
    /// # Errors
    /// If another process uses the folder, or it cannot be written, or the bucket cannot be used.
    pub async fn open_with(folder: &Path, settings: StoreSettings) -> Result<Self, OpenError> {
        let mut lock = locked(folder)?;
        check_place(folder, settings.s3.as_ref())?;
        let gauge = DiskGauge::new(folder, settings.min_free);
        let (blobs, received): (Arc<dyn BlobStore>, Arc<dyn ReceivedFiles>) = match &settings.s3 {
            None => {
                let blobs = FileBlobs::open(folder, gauge.clone());
                let blobs = Arc::new(blobs.map_err(|e| unusable(folder, &e))?);
                (blobs.clone(), blobs)
            }
            Some(location) => {
                let blobs = S3Blobs::open(location, folder, gauge.clone(), settings.cache).await?;
                let database = folder.join(DATABASE);
                if !SqliteStore::has_tables(&database).await && blobs.has_items().await? {
                    let blobs = location.to_string();
                    return Err(OpenError::RowsMissing { blobs, database });
                }
                note_place(folder, location).map_err(|e| unusable(folder, &e))?;
                let blobs = Arc::new(blobs);
                (blobs.clone(), blobs)
            }
        };
        let rows = open_database(folder, &mut lock, settings.write_wait, gauge).await?;
        Ok(Self {
            rows: Arc::new(rows),
            blobs,
            received,
            lock,
        })
    }

    /// Closes the database in order. Every use of it must have ended.
    pub async fn close(&mut self) {
        self.lock.release();
        self.rows.close().await;
    }
}

/// The database of a data folder, for commands beside a service that may be running on it. Creates
/// folder and database if they are missing.
///
/// # Errors
/// If the folder cannot be used, or a service of another version runs on it.
pub async fn open_rows(folder: &Path) -> Result<Arc<SqliteStore>, OpenError> {
    let wait = StoreSettings::default().write_wait;
    let gauge = DiskGauge::new(folder, None);
    match locked(folder) {
        Ok(mut lock) => {
            let rows = open_database(folder, &mut lock, wait, gauge).await?;
            Ok(Arc::new(rows))
        }
        Err(OpenError::InUse(_)) => {
            let database = folder.join(DATABASE);
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
            let rows = SqliteStore::open(&database, wait, gauge).await;
            rows.map(Arc::new).map_err(|e| unusable(e.to_string()))
        }
        Err(error) => Err(error),
    }
}

fn unusable(path: &Path, error: &dyn std::fmt::Display) -> OpenError {
    OpenError::Unusable {
        path: path.to_owned(),
        reason: error.to_string(),
    }
}

/// Makes the folder if it does not exist, and locks it.
fn locked(folder: &Path) -> Result<FolderLock, OpenError> {
    std::fs::create_dir_all(folder).map_err(|e| unusable(folder, &e))?;
    let lock = FolderLock::take(folder)?;
    match lock.log_is_missing(folder) {
        true => Err(OpenError::LogMissing(folder.to_owned())),
        false => Ok(lock),
    }
}

/// Opens the database, or makes it in a folder without items.
async fn open_database(
    folder: &Path,
    lock: &mut FolderLock,
    write_wait: Duration,
    gauge: DiskGauge,
) -> Result<SqliteStore, OpenError> {
    let database = folder.join(DATABASE);
    let empty = !has_items(folder).map_err(|e| unusable(folder, &e))?;
    if !empty && !SqliteStore::has_tables(&database).await {
        return Err(OpenError::DatabaseMissing(folder.to_owned()));
    }
    let rows = SqliteStore::open(&database, write_wait, gauge).await;
    let rows = rows.map_err(|e| unusable(&database, &e))?;
    if log_of(folder).exists() {
        lock.mark(OPEN).map_err(|e| unusable(folder, &e))?;
    }
    Ok(rows)
}

/// The file of a data folder that says where its files are, if not in the folder.
const PLACE: &str = "blobs";

/// Where the files of a data folder are, if not in the folder.
fn noted_place(folder: &Path) -> Result<Option<String>, OpenError> {
    match std::fs::read_to_string(folder.join(PLACE)) {
        Ok(text) => Ok(Some(text.trim().to_owned())),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(unusable(&folder.join(PLACE), &error)),
    }
}

/// Checks that the files of a data folder are where the settings say.
fn check_place(folder: &Path, location: Option<&S3Location>) -> Result<(), OpenError> {
    let folder = folder.to_owned();
    let given = location.map(S3Location::to_string);
    match (noted_place(&folder)?, given) {
        (Some(blobs), given) if given.as_ref() != Some(&blobs) => {
            Err(OpenError::FilesElsewhere { folder, blobs })
        }
        (None, Some(blobs)) => match has_items(&folder).map_err(|e| unusable(&folder, &e))? {
            true => Err(OpenError::FilesHere { folder, blobs }),
            false => Ok(()),
        },
        _ => Ok(()),
    }
}

/// Notes where the files of a data folder are.
fn note_place(folder: &Path, location: &S3Location) -> std::io::Result<()> {
    let path = folder.join(PLACE);
    if !path.exists() {
        std::fs::write(&path, format!("{location}\n"))?;
        blobs::sync(&path)?;
        blobs::sync(folder)?;
    }
    Ok(())
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

/// Whether a folder for items or received objects holds anything.
fn has_items(folder: &Path) -> std::io::Result<bool> {
    let shelves = Resource::WITH_FILES.map(Resource::plural);
    for shelf in shelves.into_iter().chain([blobs::RECEIVED]) {
        match std::fs::read_dir(folder.join(shelf)) {
            Ok(mut entries) => {
                if entries.next().is_some() {
                    return Ok(true);
                }
            }
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(error),
        }
    }
    Ok(false)
}

/// The name of the database.
const DATABASE: &str = "ventriform.db";

/// The database's write-ahead log.
fn log_of(folder: &Path) -> PathBuf {
    folder.join(format!("{DATABASE}-wal"))
}

/// What the lock file says while a process has the database open. If that process is killed, its
/// successor finds this, and knows that there must be a write-ahead log.
const OPEN: &[u8] = b"open\n";
/// What the lock file says before the database is closed.
const CLOSED: &[u8] = b"closed\n";

/// The locked file `lock` of a data folder. Dropping it unlocks the folder.
struct FolderLock {
    file: File,
    /// Whether the last process did not close the database in order.
    was_open: bool,
    /// Whether this process has marked it as open.
    marked: bool,
}

impl FolderLock {
    fn take(folder: &Path) -> Result<Self, OpenError> {
        let path = folder.join("lock");
        let unusable = |error: std::io::Error| OpenError::Unusable {
            path: path.clone(),
            reason: error.to_string(),
        };
        let mut options = File::options();
        options.create(true).truncate(false).read(true).write(true);
        let mut file = options.open(&path).map_err(unusable)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(OpenError::InUse(folder.to_owned())),
            Err(TryLockError::Error(e)) => return Err(unusable(e)),
        }
        let mut said = Vec::new();
        file.read_to_end(&mut said).map_err(unusable)?;
        Ok(Self {
            file,
            was_open: said == OPEN,
            marked: false,
        })
    }

    /// Whether the write-ahead log is gone without the database having been closed in order.
    fn log_is_missing(&self, folder: &Path) -> bool {
        self.was_open && folder.join(DATABASE).exists() && !log_of(folder).exists()
    }

    fn mark(&mut self, state: &[u8]) -> std::io::Result<()> {
        self.marked = state == OPEN;
        self.file.set_len(0)?;
        self.file.rewind()?;
        self.file.write_all(state)?;
        self.file.sync_all()
    }

    /// To be called before the database is closed, which deletes the write-ahead log.
    fn release(&mut self) {
        if self.marked
            && let Err(error) = self.mark(CLOSED)
        {
            tracing::warn!(%error, "the lock file could not be written");
        }
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        self.release();
        // Closing the file is not enough: a child process between fork and exec still has it open.
        if let Err(error) = self.file.unlock() {
            tracing::warn!(%error, "the data folder could not be unlocked");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dropped_lock_is_free_though_a_child_process_still_has_the_file_open() {
        let folder = tempfile::tempdir().unwrap();
        let lock = FolderLock::take(folder.path()).unwrap();
        let inherited = lock.file.try_clone().unwrap();
        assert!(matches!(
            FolderLock::take(folder.path()),
            Err(OpenError::InUse(_))
        ));
        drop(lock);
        FolderLock::take(folder.path()).unwrap();
        drop(inherited);
    }
}
