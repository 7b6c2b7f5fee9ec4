//! Moving a data folder to PostgreSQL, to an S3 store, or to both.
//!
//! 1. The folder is locked against a service, and `VACUUM INTO` takes a snapshot of its database, whose
//!    tables are brought to this version. The folder itself stays as it is.
//! 2. The target must be empty. A note in it says that a migration from this folder has begun; until it is
//!    replaced, no service starts on the target, and only a migration from the same folder goes on.
//! 3. Files are copied, item by item. Each is hashed on its way and again as the target gives it back; the
//!    copy of the item's row is written last, so an item that has one is not copied again.
//! 4. The note about the database ([`super::kept`]) is written: what was closed, or in doubt, is so in the target.
//! 5. Rows are copied in one transaction, read back, and compared with the source before it commits. The same
//!    transaction replaces the note. A new file of SQLite gets its place in the same way, by a rename.
//!
//! So whenever it is killed, the target has all rows or none, and doing it again ends the same. A damaged
//! item is named, and nothing is finished until the folder is repaired.

mod files;
mod moved;
mod rows;
mod source;

use super::content;
use super::database::SqlStore;
use super::note::Beside;
use super::s3::{S3Blobs, S3Location};
use super::{
    DATABASE_FILE, DiskGauge, FolderLock, MARKER_FILE, MIGRATION_MARK, OpenError, StoreSettings,
    UNFINISHED_MIGRATION_FILE, blobs, name_of, note_place, unusable,
};
use source::Source;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use ventriform_service::base::records::{StoreError, random_id};
use ventriform_service::config::PostgresSettings;

pub use moved::{MovedFiles, note_moved_files};
pub use rows::TableCount;

/// Where a data folder is moved.
#[derive(Debug, Clone, Default)]
pub struct Destination {
    /// The database on a server; `None` makes a file of SQLite in the folder.
    pub database: Option<PostgresSettings>,
    /// The bucket; `None` keeps the files in the folder.
    pub s3: Option<S3Location>,
    /// The new data folder, unless database and bucket are given.
    pub folder: Option<PathBuf>,
}

/// The progress of the copying.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// Files are copied.
    Items {
        /// Items that the target has.
        done: u64,
        /// All items.
        of: u64,
    },
    /// Rows are copied.
    Rows {
        /// Rows that were sent.
        done: u64,
    },
}

/// The content of the target.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Migrated {
    /// Number of volumes and products with their files.
    pub items: u64,
    /// Of these, the number that were copied now; an earlier attempt had copied the others.
    pub copied: u64,
    /// Number of received objects that are not volumes yet.
    pub received: u64,
    /// The tables, with their numbers of rows.
    pub tables: Vec<TableCount>,
    /// Whether all of it had been moved before.
    pub was_done: bool,
}

/// Why a data folder is not moved.
#[derive(Debug, thiserror::Error)]
pub enum MigrateError {
    /// The combination of targets means nothing.
    #[error("{0}")]
    Destination(&'static str),
    /// The folder or the target cannot be used.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// A database or the store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A file or folder could not be read or written.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// The target holds something else.
    #[error("{target} is not empty: it holds {found}. Nothing was written")]
    Occupied {
        /// The target.
        target: String,
        /// Its content.
        found: String,
    },
    /// Items of the folder are damaged.
    #[error(
        "these are damaged in the data folder, and were not copied:\n{}\nThe target stays unfinished, and no \
         service starts on it",
        .0.join("\n")
    )]
    Damaged(Vec<String>),
    /// Files are not where they were said to be.
    #[error(
        "{place} lacks {of} files of the records, or has them in another length:\n{}\nNothing was noted. Copy \
         them there, or give the place that has them",
        .missing.join("\n")
    )]
    FilesMissing {
        /// The bucket or folder.
        place: String,
        /// The first of the missing files.
        missing: Vec<String>,
        /// Number of all missing files.
        of: usize,
    },
    /// The folder is that of another database.
    #[error(
        "{folder} holds the files of the records in {url}. Nothing was noted. Give the folder with the files of \
         this database; if it does not belong to {url} any more, delete {marker}",
        folder = .folder.display(), marker = .folder.join(MARKER_FILE).display(),
    )]
    OtherStore {
        /// The folder.
        folder: PathBuf,
        /// The database to which it belongs.
        url: String,
    },
    /// The database knows no place of files.
    #[error(
        "no files of the records in {0} are known: start the service on it, which notes their place"
    )]
    NoPlace(String),
    /// Services use the database.
    #[error("services are running on {0}: stop all of them, or wait a minute if they were killed")]
    Running(String),
    /// The target gave back other rows than it was given.
    #[error(
        "the rows of the table {0} were read back differently than they were written; nothing was committed"
    )]
    Differs(String),
}

impl From<ventriform_service::base::records::BlobError> for MigrateError {
    fn from(error: ventriform_service::base::records::BlobError) -> Self {
        Self::Store(error.into())
    }
}

impl Destination {
    /// Checks that the targets make up a store.
    fn check(&self) -> Result<(), MigrateError> {
        let fault = match (&self.database, &self.s3, &self.folder) {
            (Some(_), Some(_), Some(_)) => {
                "with a database on a server and a bucket, no folder is needed: leave it out"
            }
            (Some(_), None, None) => {
                "name the new data folder for the files too (postgres://...,DIR), or a bucket"
            }
            (None, Some(_), None) => {
                "name the new data folder for the database too (s3://...,DIR), or a PostgreSQL database"
            }
            (None, None, _) => {
                "give a database (postgres://...), a bucket (s3://...) or both; `ventriform backup` copies \
                 a folder to another one"
            }
            _ => return Ok(()),
        };
        Err(MigrateError::Destination(fault))
    }

    /// The target's name in errors.
    fn name(&self) -> String {
        let database = self.database.as_ref().map(|server| server.url.to_string());
        let bucket = self.s3.as_ref().map(S3Location::to_string);
        let folder = self.folder.as_ref().map(|path| path.display().to_string());
        let parts: Vec<String> = [database, bucket, folder].into_iter().flatten().collect();
        parts.join(",")
    }
}

/// Copies the data folder `from`, which no service uses, to `to`. `tell` is called now and then.
///
/// # Errors
/// Why the target is not finished, and what to do. What was copied stays there, for the next attempt.
pub async fn migrate(
    from: &Path,
    to: &Destination,
    tell: impl Fn(Progress) + Sync,
) -> Result<Migrated, MigrateError> {
    to.check()?;
    let source = Source::open(from).await?;
    let moved = Move {
        note: format!("{MIGRATION_MARK}{}", from.canonicalize()?.display()),
        source: &source,
        to,
    };
    let ended = moved.run(&tell).await;
    source.close().await;
    ended
}

struct Move<'a> {
    source: &'a Source,
    to: &'a Destination,
    /// The note in the target while it is unfinished.
    note: String,
}

impl Move<'_> {
    async fn run(&self, tell: &(impl Fn(Progress) + Sync)) -> Result<Migrated, MigrateError> {
        let _lock = self.to.folder.as_deref().map(lock_target).transpose()?;
        let target = self.target_rows().await?;
        let bucket = self.bucket().await?;
        if bucket.is_some() {
            self.source.note_places().await?;
        }
        if let Some(place) = self.begun(target.as_ref()).await? {
            return self.was_done_before(place).await;
        }
        if let (None, Some(bucket)) = (self.noted(target.as_ref()).await?, &bucket)
            && bucket.has_items().await?
        {
            return Err(self.occupied("files of items"));
        }
        self.begin_folder()?;
        if let Some(target) = &target {
            target.note_place(&self.note).await?;
            target.close().await;
        }
        let mut done = Migrated::default();
        match (&bucket, &self.to.folder) {
            (Some(bucket), _) => files::to_bucket(self.source, bucket, &mut done, tell).await?,
            (None, Some(folder)) => files::to_folder(self.source, folder, &mut done, tell).await?,
            (None, None) => {}
        }
        self.place_note(bucket.as_ref()).await?;
        done.tables = self.place_rows(tell).await?;
        self.end_folder()?;
        Ok(done)
    }

    /// The note of the target about itself.
    async fn noted(&self, target: Option<&SqlStore>) -> Result<Option<String>, MigrateError> {
        match (target, &self.to.folder) {
            (Some(target), _) => Ok(target.place().await?),
            (None, Some(folder)) => {
                match fs::read_to_string(folder.join(UNFINISHED_MIGRATION_FILE)) {
                    Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
                    read => Ok(Some(read?)),
                }
            }
            (None, None) => Ok(None),
        }
    }

    /// Checks that nothing was stored in the database on a server. Returns where the files of its records are if
    /// that is known.
    async fn begun(&self, target: Option<&SqlStore>) -> Result<Option<String>, MigrateError> {
        let (Some(server), Some(target)) = (&self.to.database, target) else {
            return Ok(None);
        };
        let place = target.place().await?;
        if place.is_none()
            && let Some(table) = rows::any(&self.source.rows, server).await?
        {
            return Err(self.occupied(&format!("rows in the table {table}")));
        }
        Ok(place.filter(|place| *place != self.note))
    }

    async fn target_rows(&self) -> Result<Option<SqlStore>, MigrateError> {
        let Some(server) = &self.to.database else {
            return Ok(None);
        };
        let wait = StoreSettings::default().write_wait;
        let gauge = DiskGauge::new(&self.source.folder, Some(0));
        let connected = SqlStore::connect(server, wait, gauge).await;
        Ok(Some(connected.map_err(OpenError::from)?))
    }

    async fn bucket(&self) -> Result<Option<S3Blobs>, MigrateError> {
        let Some(location) = &self.to.s3 else {
            return Ok(None);
        };
        let gauge = DiskGauge::new(&self.source.folder, Some(0));
        let opened = S3Blobs::open(location, &self.source.scratch, gauge, 0).await;
        Ok(Some(opened.map_err(OpenError::from)?))
    }

    fn occupied(&self, found: &str) -> MigrateError {
        MigrateError::Occupied {
            target: self.to.name(),
            found: found.to_owned(),
        }
    }

    /// The target's records say that their files are at `place`: a migration has ended before, if they are
    /// those of the source.
    async fn was_done_before(&self, place: String) -> Result<Migrated, MigrateError> {
        let ends_here = self.final_place().is_ok_and(|own| own == place);
        if let (Some(server), true) = (&self.to.database, ends_here)
            && let Some(tables) = rows::same(&self.source.rows, server).await?
        {
            self.end_folder()?;
            return Ok(Migrated {
                tables,
                was_done: true,
                ..Migrated::default()
            });
        }
        Err(self.occupied(&if place.starts_with(MIGRATION_MARK) {
            format!("an unfinished {place}")
        } else {
            format!("the records of files in {place}")
        }))
    }

    /// Where the target's files will be, as its database knows it.
    fn final_place(&self) -> Result<String, MigrateError> {
        match (&self.to.s3, &self.to.folder) {
            (Some(bucket), _) => Ok(bucket.to_string()),
            (None, Some(folder)) => name_of(&folder.join(MARKER_FILE))
                .ok_or_else(|| io::Error::from(ErrorKind::NotFound).into()),
            (None, None) => Ok(String::new()),
        }
    }

    /// Makes the new data folder, or finds it as an earlier attempt has left it.
    fn begin_folder(&self) -> Result<(), MigrateError> {
        let Some(folder) = &self.to.folder else {
            return Ok(());
        };
        let noted = folder.join(UNFINISHED_MIGRATION_FILE);
        match fs::read_to_string(&noted) {
            Ok(text) if text == self.note => return Ok(()),
            Ok(other) => return Err(self.occupied(&format!("an unfinished {other}"))),
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(error.into()),
        }
        for entry in fs::read_dir(folder)? {
            let name = entry?.file_name();
            if name != "lock" {
                return Err(self.occupied(&name.to_string_lossy()));
            }
        }
        if let Some(server) = &self.to.database {
            let text = format!("{}\n{}\n", server.url, random_id("folder "));
            write(&folder.join(MARKER_FILE), &text)?;
        }
        Ok(write(&noted, &self.note)?)
    }

    /// Copies the rows, or counts those of the snapshot and puts it into its place.
    async fn place_rows(&self, tell: &impl Fn(Progress)) -> Result<Vec<TableCount>, MigrateError> {
        let rows = &self.source.rows;
        if let Some(server) = &self.to.database {
            return rows::copy(rows, server, &self.final_place()?, tell).await;
        }
        let counted = rows::count(rows).await?;
        self.place_database().await?;
        Ok(counted)
    }

    /// Notes about the database where the target's service looks for them.
    async fn place_note(&self, bucket: Option<&S3Blobs>) -> Result<(), MigrateError> {
        let Some(note) = &self.source.note else {
            return Ok(());
        };
        let beside = Beside {
            folder: self.to.folder.clone(),
            bucket: bucket.map(S3Blobs::note),
        };
        Ok(beside.write(note).await?)
    }

    /// Puts the snapshot into its place in the new data folder.
    async fn place_database(&self) -> Result<(), MigrateError> {
        let (Some(folder), Some(bucket)) = (&self.to.folder, &self.to.s3) else {
            return Ok(());
        };
        note_place(folder, bucket)?;
        self.source.rows.close().await;
        let draft = folder.join(format!("{DATABASE_FILE}.new"));
        fs::copy(self.source.snapshot(), &draft)?;
        blobs::sync(&draft)?;
        let (read, written) = (
            fs::File::open(self.source.snapshot())?,
            fs::File::open(&draft)?,
        );
        if content::hash(&read)? != content::hash(&written)? {
            return Err(MigrateError::Differs("all".into()));
        }
        fs::rename(&draft, folder.join(DATABASE_FILE))?;
        Ok(blobs::sync(folder)?)
    }

    /// From now on a service can use the new data folder.
    fn end_folder(&self) -> Result<(), MigrateError> {
        let Some(folder) = &self.to.folder else {
            return Ok(());
        };
        match fs::remove_file(folder.join(UNFINISHED_MIGRATION_FILE)) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(error.into()),
            _ => Ok(blobs::sync(folder)?),
        }
    }
}

/// Makes the folder if it does not exist, and locks it.
fn lock_target(folder: &Path) -> Result<FolderLock, MigrateError> {
    fs::create_dir_all(folder).map_err(|error| unusable(folder, &error))?;
    Ok(FolderLock::take(folder)?)
}

/// Writes a small file durably.
fn write(path: &Path, text: &str) -> io::Result<()> {
    fs::write(path, text)?;
    blobs::sync(path)?;
    blobs::sync(path.parent().unwrap_or(path))
}
