//! Noting that the files of a store have been moved, by whatever tool.
//!
//! In: the database, and the bucket or folder that has the files now. Out: the database, and the note in a folder, name
//! that place; a service starts on it.
//!
//! Every file that a row names must be there in its full length, and the place must not be that of another store. The
//! contents are not read. Nothing is written before all is checked, and doing it again ends the same.

use super::source::PAGE_ROWS;
use super::{MigrateError, write};
use crate::blobs::{RECEIVED_FOLDER, STAGING_FOLDER, shelf_path};
use crate::database::SqlStore;
use crate::note::{Beside, NotePlace};
use crate::s3::{S3Blobs, S3Location};
use crate::{
    BLOB_PLACE_FILE, DATABASE_FILE, DiskGauge, FolderLock, MARKER_FILE, MIGRATION_MARK, OpenError,
    StoreSettings, check_place, has_items, in_file, locked, name_of, noted_place, require_file,
    require_finished, unusable,
};
use futures::{StreamExt, TryStreamExt, stream};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use ventriform_service::base::records::{BlobError, ItemRecord, RecordPages, random_id};
use ventriform_service::config::PostgresSettings;

/// Items that are looked for at the same time.
const PARALLEL_ITEMS: usize = 8;

/// Missing files that an error names.
const NAMED_FILES: usize = 10;

/// The files of a store after they were moved.
#[derive(Debug, Clone)]
pub enum MovedFiles {
    /// They are in a bucket.
    Bucket(S3Location),
    /// They are in a data folder, whose records are on a server.
    Folder(PathBuf),
}

/// Notes that the files of the records are at the place `files`. The records are in the database on a server, or
/// else in the data folder; no service runs on them. Returns the number of items.
///
/// # Errors
/// If the place lacks files or belongs to another store; nothing was noted then.
pub async fn note_moved_files(
    data_dir: &Path,
    database: Option<&PostgresSettings>,
    files: &MovedFiles,
) -> Result<u64, MigrateError> {
    let (folder, bucket) = match files {
        MovedFiles::Bucket(location) => (data_dir, Some(location)),
        MovedFiles::Folder(folder) => (folder.as_path(), None),
    };
    if database.is_none() && (bucket.is_none() || noted_place(folder)?.is_none()) {
        require_file(folder)?;
        return Err(MigrateError::Destination(
            "files beside `ventriform.db` belong to it wherever the whole folder is moved; only files in a bucket, or \
             beside records in PostgreSQL (--database), are moved alone",
        ));
    }
    if bucket.is_none() {
        // A folder that is made now has no files.
        fs::metadata(folder).map_err(|error| unusable(folder, &error))?;
    }
    let mut lock = FolderLock::wait_for(|| locked(folder)).await?;
    let rows = match database {
        Some(server) => {
            let gauge = DiskGauge::new(folder, Some(0));
            let wait = StoreSettings::default().write_wait;
            let rows = SqlStore::connect(server, wait, gauge).await;
            rows.map_err(OpenError::from)?
        }
        None => rows_of(folder, &mut lock).await?,
    };
    let noted = match bucket {
        Some(location) => note_bucket(&rows, database, folder, location).await,
        None => note_folder(&rows, database, folder).await,
    };
    lock.release();
    rows.close().await;
    noted
}

/// The records of a data folder whose files are in a bucket.
async fn rows_of(folder: &Path, lock: &mut FolderLock) -> Result<SqlStore, MigrateError> {
    let database = folder.join(DATABASE_FILE);
    if !database.exists() {
        return Err(unusable(&database, &"there is no such database").into());
    }
    let gauge = DiskGauge::new(folder, Some(0));
    Ok(in_file(folder, lock, StoreSettings::default().write_wait, gauge).await?)
}

async fn note_bucket(
    rows: &SqlStore,
    server: Option<&PostgresSettings>,
    folder: &Path,
    location: &S3Location,
) -> Result<u64, MigrateError> {
    require_placed(rows, server).await?;
    let scratch = folder.join(STAGING_FOLDER).join(random_id("moved-"));
    fs::create_dir_all(&scratch)?;
    let gauge = DiskGauge::new(folder, Some(0));
    let opened = S3Blobs::open(location, &scratch, gauge, 0).await;
    let checked = match opened {
        Ok(blobs) => {
            let found = require_files(rows, &Files::Bucket(&blobs), &location.to_string()).await;
            found.map(|items| (items, blobs.note()))
        }
        Err(refusal) => Err(OpenError::from(refusal).into()),
    };
    fs::remove_dir_all(&scratch)?;
    let (items, note) = checked?;
    beside(rows, server, folder, Some(note)).await?;
    if server.is_some() {
        rows.change_place(&location.to_string()).await?;
    }
    if noted_place(folder)?.is_some() {
        write(&folder.join(BLOB_PLACE_FILE), &format!("{location}\n"))?;
    }
    Ok(items)
}

async fn note_folder(
    rows: &SqlStore,
    server: Option<&PostgresSettings>,
    folder: &Path,
) -> Result<u64, MigrateError> {
    require_placed(rows, server).await?;
    require_finished(folder)?;
    check_place(folder, None)?;
    if folder.join(DATABASE_FILE).exists() {
        return Err(OpenError::InFile(folder.to_owned()).into());
    }
    let marker = folder.join(MARKER_FILE);
    let own = server.map(|server| server.url.to_string());
    let own = own.unwrap_or_default();
    match fs::read_to_string(&marker) {
        Ok(text) if text.lines().next() != Some(own.as_str()) => {
            return Err(MigrateError::OtherStore {
                folder: folder.to_owned(),
                url: text.lines().next().unwrap_or_default().to_owned(),
            });
        }
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(error.into()),
        _ => {}
    }
    let items = require_files(rows, &Files::Folder(folder), &folder.display().to_string()).await?;
    let name = name_of(&marker).unwrap_or_else(|| random_id("folder "));
    write(&marker, &format!("{own}\n{name}\n"))?;
    beside(rows, server, folder, None).await?;
    rows.change_place(&name).await?;
    Ok(items)
}

/// Compares the database with the note at the new place of the files, which is a copy at best: what was closed stays
/// so, and what is in doubt is closed.
async fn beside(
    rows: &SqlStore,
    server: Option<&PostgresSettings>,
    folder: &Path,
    bucket: Option<Arc<dyn NotePlace>>,
) -> Result<(), MigrateError> {
    let in_folder = server.is_none() || bucket.is_none();
    let beside = Beside {
        folder: in_folder.then(|| folder.to_owned()),
        bucket,
    };
    rows.settle(beside, false).await?;
    Ok(())
}

/// Refuses a database on a server that services use, or whose files have no place that could have changed.
async fn require_placed(
    rows: &SqlStore,
    server: Option<&PostgresSettings>,
) -> Result<(), MigrateError> {
    let Some(server) = server else { return Ok(()) };
    match rows.place().await? {
        None => Err(MigrateError::NoPlace(server.url.to_string())),
        Some(note) if note.starts_with(MIGRATION_MARK) => Err(OpenError::Unfinished {
            place: server.url.to_string(),
            note,
        }
        .into()),
        Some(_) if rows.has_processes().await? => {
            Err(MigrateError::Running(server.url.to_string()))
        }
        Some(_) => Ok(()),
    }
}

/// The place that is searched for files.
enum Files<'a> {
    Bucket(&'a S3Blobs),
    Folder(&'a Path),
}

impl Files<'_> {
    async fn is_empty(&self) -> Result<bool, MigrateError> {
        Ok(match self {
            Files::Bucket(blobs) => !blobs.has_items().await?,
            Files::Folder(folder) => !has_items(folder)?,
        })
    }

    /// The files of an item that are missing, or have another length than was stored.
    async fn lacks(&self, record: &ItemRecord) -> Result<Vec<String>, BlobError> {
        let mut missing = Vec::new();
        for file in record.files() {
            let size = match self {
                Files::Bucket(blobs) => blobs.size(record.id(), &file).await?,
                Files::Folder(folder) => {
                    length(&folder.join(shelf_path(record.id())).join(&file.name))
                }
            };
            if size != Some(file.bytes) {
                missing.push(format!("{}/{}", shelf_path(record.id()), file.name));
            }
        }
        Ok(missing)
    }

    async fn has_received(&self, name: &str) -> Result<bool, BlobError> {
        match self {
            Files::Bucket(blobs) => blobs.has_received(name).await,
            Files::Folder(folder) => Ok(length(&folder.join(RECEIVED_FOLDER).join(name)).is_some()),
        }
    }
}

fn length(path: &Path) -> Option<u64> {
    fs::metadata(path).ok().map(|found| found.len())
}

/// Checks that every file of the records is there. Returns the number of items.
async fn require_files(
    rows: &SqlStore,
    files: &Files<'_>,
    place: &str,
) -> Result<u64, MigrateError> {
    let (mut items, mut missing) = (0, Vec::new());
    let mut pages = RecordPages::new(rows, PAGE_ROWS);
    while let Some(page) = pages.next().await? {
        items += page.len() as u64;
        let looked = page.iter().map(|record| files.lacks(record));
        let mut looked = stream::iter(looked).buffered(PARALLEL_ITEMS);
        while let Some(lacking) = looked.try_next().await? {
            missing.extend(lacking);
        }
    }
    let received = rows.waiting_files().await?;
    for (name, _) in &received {
        if !files.has_received(name).await? {
            missing.push(format!("{RECEIVED_FOLDER}/{name}"));
        }
    }
    if !missing.is_empty() {
        let of = missing.len();
        missing.truncate(NAMED_FILES);
        return Err(MigrateError::FilesMissing {
            place: place.to_owned(),
            missing,
            of,
        });
    }
    if items == 0 && received.is_empty() && !files.is_empty().await? {
        return Err(MigrateError::Occupied {
            target: place.to_owned(),
            found: "files of another store".into(),
        });
    }
    Ok(items)
}
