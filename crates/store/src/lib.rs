//! Storage of the service: SQLite or PostgreSQL for records, a folder for files.
//!
//! ```text
//! DATA_DIR/
//!   lock              held by the process that uses this folder; says whether it was closed
//!   kept.json         what must not be lost with the database ([`kept`])
//!   ventriform.db     jobs, volumes, products (SQLite: WAL, synchronous=FULL)
//!   database          instead of it, where they are on a server (PostgreSQL)
//!   staging/          files not yet published; emptied at every start
//!   discarded/        files that are being deleted
//!   reserve           space for erasures on a full disk ([`reserve`])
//!   quarantine/DAY/   files that were found without a record
//!   received/         objects that came by C-STORE or STOW-RS and are not volumes yet
//!   volumes/vol_.../  files of a volume
//!   models/mdl_.../   files of a model; likewise segmentations/, beats/, comparisons/, heart/normals/, templates/
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
mod beside;
mod blobs;
mod cache;
mod content;
mod copied;
mod database;
mod doctor;
mod faults;
mod findings;
mod health;
mod kept;
mod migrate;
mod missed;
mod news;
mod note;
mod postgres;
mod query;
mod received;
mod reserve;
mod s3;
mod schema;
mod shared;
mod space;
mod sqlite;
mod sqlite_repair;
mod tables;
mod writer;

pub use backup::{Backup, backup};
pub use beside::{IfNone, open_beside, require_store};
pub use blobs::FileBlobs;
pub use database::SqlStore;
pub use doctor::{DoctorError, examine, examine_on_server};
pub use findings::{Examination, Finding, Repair};
pub use migrate::{
    Destination, MigrateError, Migrated, MovedFiles, Progress, TableCount, migrate,
    note_moved_files,
};
pub use missed::{Act, Missed, MissedError, NewerStore, apply, missed};
pub use postgres::PostgresError;
pub use s3::{S3Blobs, S3Location, S3Refusal};
pub use space::DiskGauge;

use note::Beside;
use std::fs::{File, TryLockError};
use std::io::{ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use ventriform_service::base::records::{BlobError, BlobStore, Peers, Resource, random_id};
use ventriform_service::config::stores::Stores;
use ventriform_service::config::{PostgresSettings, PostgresUrl};
use ventriform_service::network::intake::ReceivedFiles;

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
    /// The server of the database; `None` is a file in the data folder.
    pub database: Option<PostgresSettings>,
}

impl Default for StoreSettings {
    fn default() -> Self {
        Self {
            min_free: None,
            write_wait: Duration::from_secs(2),
            s3: None,
            cache: 2 << 30,
            database: None,
        }
    }
}

/// The database of one data folder, which is locked while this exists, and the files.
pub struct Store {
    /// The database.
    pub rows: Arc<SqlStore>,
    /// The files of items.
    pub blobs: Arc<dyn BlobStore>,
    /// The files of received objects.
    pub received: Arc<dyn ReceivedFiles>,
    /// The other processes on the database and the files, if there can be any.
    pub peers: Option<Arc<dyn Peers>>,
    lock: FolderLock,
}

/// Why a data folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Another process uses it.
    #[error("{0} is in use by another ventriform process")]
    InUse(PathBuf),
    /// It holds items, but its database is missing or empty.
    #[error(
        "{folder} holds stored items, but {database} is missing or empty",
        folder = .0.display(),
        database = .0.join(DATABASE_FILE).display(),
    )]
    DatabaseMissing(PathBuf),
    /// The last process did not end in order, and the changes it had not yet moved into the
    /// database are missing.
    #[error(
        "{folder}: the service did not stop in order, and {DATABASE_FILE}-wal, which holds the last \
         changes to the database, is missing",
        folder = .0.display(),
    )]
    LogMissing(PathBuf),
    /// Its files are in a bucket, and another place was given.
    #[error("the files of {folder} are in {blobs}", folder = .folder.display())]
    FilesElsewhere {
        /// The folder.
        folder: PathBuf,
        /// Where its files are.
        blobs: String,
    },
    /// It holds the files of items, and a bucket was given.
    #[error(
        "{folder} holds the files of stored items, so they cannot be in {blobs}",
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
        "{blobs} holds stored items, but {database} is missing or empty",
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
    /// It holds items, but the database on the server has never held any.
    #[error("{folder} holds stored items, but {url} is empty", folder = .folder.display())]
    DatabaseEmpty {
        /// The folder.
        folder: PathBuf,
        /// The database.
        url: PostgresUrl,
    },
    /// The files of the records in the database are elsewhere.
    #[error("the files of the records in {url} are in {place}, not in {own}")]
    OtherFiles {
        /// The database.
        url: PostgresUrl,
        /// Where they are.
        place: String,
        /// Where this process would keep them.
        own: String,
    },
    /// Its records are in a database on a server.
    #[error("the records of {folder} are kept in {url}", folder = .folder.display())]
    OnServer {
        /// The folder.
        folder: PathBuf,
        /// Where its records are.
        url: String,
        /// The file of the folder that says so.
        marker: PathBuf,
    },
    /// There is no store where one is to be found.
    #[error("{place} {reason}")]
    NoStore {
        /// The folder or the database.
        place: String,
        /// What it is instead.
        reason: &'static str,
    },
    /// A migration to it was begun and did not end.
    #[error("{place} is the target of a {note}, which has not ended")]
    Unfinished {
        /// The folder or the database.
        place: String,
        /// Where the migration comes from.
        note: String,
    },
    /// Its records are in a file.
    #[error("the records of {folder} are kept in its file {DATABASE_FILE}", folder = .0.display())]
    InFile(PathBuf),
    /// The database on the server cannot be used.
    #[error(transparent)]
    Server(#[from] PostgresError),
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
        let mut lock = FolderLock::wait_for(|| locked(folder)).await?;
        check_place(folder, settings.s3.as_ref())?;
        let gauge = DiskGauge::new(folder, settings.min_free);
        let mut beside = Beside::default();
        let (blobs, received, empty): (Arc<dyn BlobStore>, Arc<dyn ReceivedFiles>, bool) =
            match &settings.s3 {
                None => {
                    let empty = !has_items(folder).map_err(|e| unusable(folder, &e))?;
                    let blobs = FileBlobs::open(folder, gauge.clone());
                    let blobs = Arc::new(blobs.map_err(|e| unusable(folder, &e))?);
                    beside.folder = Some(folder.to_owned());
                    (blobs.clone(), blobs, empty)
                }
                Some(location) => {
                    let blobs =
                        S3Blobs::open(location, folder, gauge.clone(), settings.cache).await?;
                    let empty = !blobs.has_items().await?;
                    let database = folder.join(DATABASE_FILE);
                    let made = settings.database.is_some() || sqlite::has_tables(&database).await;
                    if !made && !empty {
                        let blobs = location.to_string();
                        return Err(OpenError::RowsMissing { blobs, database });
                    }
                    note_place(folder, location).map_err(|e| unusable(folder, &e))?;
                    let in_folder = settings.database.is_none();
                    beside.folder = in_folder.then(|| folder.to_owned());
                    beside.bucket = Some(blobs.note());
                    let blobs = Arc::new(blobs);
                    (blobs.clone(), blobs, empty)
                }
            };
        let wait = settings.write_wait;
        let rows = match &settings.database {
            Some(server) => {
                let bucket = settings.s3.as_ref();
                on_server(folder, (bucket, empty), server, wait, gauge).await?
            }
            None => {
                let rows = in_file(folder, &mut lock, wait, gauge).await?;
                rows.reserve.keep_in(folder);
                rows
            }
        };
        let rows = Arc::new(rows);
        let settled = rows.settle(beside, false).await;
        settled.map_err(|e| unusable(folder, &e))?;
        Ok(Self {
            // A folder is used by one process.
            peers: settings.s3.and_then(|_| rows.peers()),
            rows,
            blobs,
            received,
            lock,
        })
    }

    /// Closes the database in order. Every use of it must have ended.
    pub async fn close(&mut self) {
        if let Err(error) = self.rows.note_beside().await {
            tracing::warn!(%error, "the note beside the database could not be written");
        }
        self.lock.release();
        self.rows.close().await;
    }

    /// The stores of a service, which keep the folder locked until they are closed or dropped.
    pub fn into_stores(mut self) -> Stores {
        let rows = self.rows.clone();
        let keeping = tokio::spawn(kept::keep(Arc::downgrade(&rows))).abort_handle();
        Stores {
            jobs: rows.clone(),
            catalogue: rows.clone(),
            access: rows.clone(),
            worklist: rows.clone(),
            deliveries: rows.clone(),
            archives: rows.clone(),
            intake: rows.clone(),
            figures: rows.clone(),
            time: rows,
            blobs: self.blobs.clone(),
            received: self.received.clone(),
            peers: self.peers.clone(),
            close: Box::new(move || {
                Box::pin(async move {
                    keeping.abort();
                    self.close().await;
                })
            }),
        }
    }
}

/// Opens the database on a server for the files in a bucket, or in the folder; `empty` says whether
/// there are none.
async fn on_server(
    folder: &Path,
    (bucket, empty): (Option<&S3Location>, bool),
    server: &PostgresSettings,
    write_wait: Duration,
    gauge: DiskGauge,
) -> Result<SqlStore, OpenError> {
    let marker = folder.join(MARKER_FILE);
    require_finished(folder)?;
    if folder.join(DATABASE_FILE).exists() {
        return Err(OpenError::InFile(folder.to_owned()));
    }
    let rows = SqlStore::connect(server, write_wait, gauge).await?;
    if !empty && rows.is_new().await.map_err(|e| unusable(folder, &e))? {
        return Err(OpenError::DatabaseEmpty {
            folder: folder.to_owned(),
            url: server.url.clone(),
        });
    }
    let own = match bucket {
        Some(bucket) => bucket.to_string(),
        None => name_of(&marker).unwrap_or_else(|| random_id("folder ")),
    };
    let place = rows.note_place(&own).await;
    let place = place.map_err(|e| unusable(folder, &e))?;
    if place.starts_with(MIGRATION_MARK) {
        return Err(OpenError::Unfinished {
            place: server.url.to_string(),
            note: place,
        });
    }
    if place != own {
        return Err(OpenError::OtherFiles {
            url: server.url.clone(),
            place,
            own: match bucket {
                Some(_) => own,
                None => folder.display().to_string(),
            },
        });
    }
    let text = format!("{}\n{own}\n", server.url);
    std::fs::write(&marker, text).map_err(|e| unusable(&marker, &e))?;
    Ok(rows)
}

/// The name by which the database knows this folder, if the folder has one.
fn name_of(marker: &Path) -> Option<String> {
    let text = std::fs::read_to_string(marker).ok()?;
    let name = text.lines().nth(1)?;
    name.starts_with("folder ").then(|| name.to_owned())
}

/// Refuses a folder to which another one is being moved.
fn require_finished(folder: &Path) -> Result<(), OpenError> {
    match std::fs::read_to_string(folder.join(UNFINISHED_MIGRATION_FILE)) {
        Ok(note) => Err(OpenError::Unfinished {
            place: folder.display().to_string(),
            note,
        }),
        Err(_) => Ok(()),
    }
}

/// Refuses a folder whose records are on a server.
fn require_file(folder: &Path) -> Result<(), OpenError> {
    require_finished(folder)?;
    match std::fs::read_to_string(folder.join(MARKER_FILE)) {
        Ok(url) => Err(OpenError::OnServer {
            folder: folder.to_owned(),
            url: url.lines().next().unwrap_or_default().to_owned(),
            marker: folder.join(MARKER_FILE),
        }),
        Err(_) => Ok(()),
    }
}

/// The database of the settings, for commands beside a service that may be running on it. Creates a
/// folder and a file of SQLite if they are missing; [`open_beside`] does not.
///
/// # Errors
/// If it cannot be used, or a service of another version runs on it.
pub async fn open_database(
    folder: &Path,
    database: Option<&PostgresSettings>,
) -> Result<Arc<SqlStore>, OpenError> {
    match database {
        Some(server) => {
            let wait = StoreSettings::default().write_wait;
            let gauge = DiskGauge::new(folder, None);
            let rows = SqlStore::connect(server, wait, gauge).await?;
            if name_of(&folder.join(MARKER_FILE)).is_some() {
                rows.keep_beside(Beside::folder(folder));
            }
            Ok(Arc::new(rows))
        }
        None => open_rows(folder).await,
    }
}

/// How long a command beside the service waits for a service that starts to make the database.
const FIRST_START: Duration = Duration::from_secs(10);
/// How often it looks.
const LOOK_AGAIN: Duration = Duration::from_millis(50);

/// The database of a data folder, for commands beside a service that may be running on it. Creates
/// folder and database if they are missing.
///
/// # Errors
/// If the folder cannot be used, or a service of another version runs on it.
pub async fn open_rows(folder: &Path) -> Result<Arc<SqlStore>, OpenError> {
    let wait = StoreSettings::default().write_wait;
    let gauge = DiskGauge::new(folder, None);
    let deadline = Instant::now() + FIRST_START;
    let database = folder.join(DATABASE_FILE);
    loop {
        match locked(folder) {
            Ok(mut lock) => {
                let rows = in_file(folder, &mut lock, wait, gauge).await?;
                if noted_place(folder)?.is_none() {
                    let settled = rows.settle(Beside::folder(folder), false).await;
                    settled.map_err(|e| unusable(folder, &e))?;
                } else {
                    // Without the note in the bucket, a missing one here tells nothing.
                    rows.keep_beside(Beside::folder(folder));
                }
                return Ok(Arc::new(rows));
            }
            Err(OpenError::InUse(_)) => {}
            Err(error) => return Err(error),
        }
        // A service that starts has the lock before it has made or migrated the database.
        let migrated = is_migrated(&database).await;
        if matches!(migrated, Ok(true)) {
            let rows = SqlStore::open(&database, wait, gauge).await;
            let rows = rows.map_err(|e| unusable(&database, &e))?;
            rows.keep_beside(Beside::folder(folder));
            return Ok(Arc::new(rows));
        }
        if Instant::now() >= deadline {
            return Err(match migrated {
                Err(error) => unusable(&database, &error),
                Ok(_) => unusable(
                    &database,
                    &"the service that runs on it has another version than this command",
                ),
            });
        }
        tokio::time::sleep(LOOK_AGAIN).await;
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
    if lock.log_is_missing(folder) {
        Err(OpenError::LogMissing(folder.to_owned()))
    } else {
        Ok(lock)
    }
}

/// Opens the database in a folder, or makes it in a folder without items.
async fn in_file(
    folder: &Path,
    lock: &mut FolderLock,
    write_wait: Duration,
    gauge: DiskGauge,
) -> Result<SqlStore, OpenError> {
    let database = folder.join(DATABASE_FILE);
    require_file(folder)?;
    let empty = !has_items(folder).map_err(|e| unusable(folder, &e))?;
    if !empty && !sqlite::has_tables(&database).await {
        return Err(OpenError::DatabaseMissing(folder.to_owned()));
    }
    let rows = SqlStore::open(&database, write_wait, gauge).await;
    let rows = rows.map_err(|e| unusable(&database, &e))?;
    if log_of(folder).exists() {
        lock.mark(OPEN_MARK).map_err(|e| unusable(folder, &e))?;
    }
    Ok(rows)
}

/// The file of a data folder that says where its files are, if not in the folder.
const BLOB_PLACE_FILE: &str = "blobs";

/// Where the files of a data folder are, if not in the folder.
fn noted_place(folder: &Path) -> Result<Option<String>, OpenError> {
    match std::fs::read_to_string(folder.join(BLOB_PLACE_FILE)) {
        Ok(text) => Ok(Some(text.trim().to_owned())),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(unusable(&folder.join(BLOB_PLACE_FILE), &error)),
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
        (None, Some(blobs)) => {
            if has_items(&folder).map_err(|e| unusable(&folder, &e))? {
                Err(OpenError::FilesHere { folder, blobs })
            } else {
                Ok(())
            }
        }
        _ => Ok(()),
    }
}

/// Notes where the files of a data folder are.
fn note_place(folder: &Path, location: &S3Location) -> std::io::Result<()> {
    let path = folder.join(BLOB_PLACE_FILE);
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
    Ok(usize::try_from(done) == Ok(schema::sqlite().iter().count()))
}

/// Whether a folder for items or received objects holds anything.
fn has_items(folder: &Path) -> std::io::Result<bool> {
    let shelves = Resource::WITH_FILES.map(Resource::plural);
    for shelf in shelves.into_iter().chain([blobs::RECEIVED_FOLDER]) {
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
const DATABASE_FILE: &str = "ventriform.db";

/// The file that the process that uses a data folder has locked.
const LOCK_FILE: &str = "lock";

/// The file that says which database on a server holds the records of the folder.
const MARKER_FILE: &str = "database";

/// The file that says that another folder is being moved to this one, and which.
const UNFINISHED_MIGRATION_FILE: &str = "migration";

/// The beginning of the note of an unfinished migration.
const MIGRATION_MARK: &str = "migration from ";

/// The database's write-ahead log.
fn log_of(folder: &Path) -> PathBuf {
    folder.join(format!("{DATABASE_FILE}-wal"))
}

/// The content of the lock file while a process has the database open. If that process is killed, its
/// successor finds this, and knows that there must be a write-ahead log.
const OPEN_MARK: &[u8] = b"open\n";
/// The content of the lock file before the database is closed.
const CLOSED_MARK: &[u8] = b"closed\n";

/// The locked file `lock` of a data folder. Dropping it unlocks the folder.
struct FolderLock {
    file: File,
    /// Whether the last process did not close the database in order.
    was_open: bool,
    /// Whether this process has marked it as open.
    marked: bool,
}

/// How long the lock of a process that was just killed may outlast it: children that it was starting have
/// the file open until they run their own program. A command beside the service may have it as long, while it makes
/// the database.
const LOCK_WAIT: Duration = Duration::from_secs(3);

impl FolderLock {
    /// Tries to take the lock until no process that ended can hold it any more.
    async fn wait_for(take: impl Fn() -> Result<Self, OpenError>) -> Result<Self, OpenError> {
        let deadline = Instant::now() + LOCK_WAIT;
        loop {
            match take() {
                Err(OpenError::InUse(_)) if Instant::now() < deadline => {
                    tokio::time::sleep(LOCK_WAIT / 300).await;
                }
                taken => return taken,
            }
        }
    }

    fn take(folder: &Path) -> Result<Self, OpenError> {
        let path = folder.join(LOCK_FILE);
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
            was_open: said == OPEN_MARK,
            marked: false,
        })
    }

    /// Whether the write-ahead log is gone without the database having been closed in order.
    fn log_is_missing(&self, folder: &Path) -> bool {
        self.was_open && folder.join(DATABASE_FILE).exists() && !log_of(folder).exists()
    }

    fn mark(&mut self, state: &[u8]) -> std::io::Result<()> {
        self.marked = state == OPEN_MARK;
        self.file.set_len(0)?;
        self.file.rewind()?;
        self.file.write_all(state)?;
        self.file.sync_all()
    }

    /// To be called before the database is closed, which deletes the write-ahead log.
    fn release(&mut self) {
        if self.marked
            && let Err(error) = self.mark(CLOSED_MARK)
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

/// The examples of README.md, compiled as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

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

    #[tokio::test]
    async fn a_lock_that_a_starting_child_of_a_killed_process_holds_is_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().to_owned();
        let left_over = FolderLock::take(&path).unwrap();
        let waiting = tokio::spawn(async move { FolderLock::wait_for(|| locked(&path)).await });
        tokio::time::sleep(LOCK_WAIT / 10).await;
        assert!(!waiting.is_finished());
        drop(left_over);
        waiting.await.unwrap().unwrap();
    }
}
