//! The data folder that is moved: locked, and read from a snapshot of its database.

use crate::blobs::STAGING_FOLDER;
use crate::database::SqlStore;
use crate::note::{Beside, Note};
use crate::query::query;
use crate::tables::to_json;
use crate::{
    CLOSED_MARK, DATABASE_FILE, DiskGauge, FolderLock, OpenError, StoreSettings, check_place,
    require_file, sqlite, unusable,
};
use sha2::{Digest, Sha256};
use std::fs;
use std::path::{Path, PathBuf};
use ventriform_service::base::records::{ItemRecord, RecordPages, StoreResult, hex, random_id};

/// Rows read at a time.
pub(super) const PAGE_ROWS: u32 = 200;

/// A data folder with its records in a file and its files beside it, which no service uses.
pub(super) struct Source {
    pub folder: PathBuf,
    /// For what is needed only while the folder is moved; below `staging/`, which every start empties.
    pub scratch: PathBuf,
    /// The snapshot.
    pub rows: SqlStore,
    /// The note about the database that the target gets; `None` if none was ever made.
    pub note: Option<Note>,
    _lock: FolderLock,
}

impl Source {
    /// Locks the folder and takes the snapshot.
    ///
    /// # Errors
    /// If a service uses the folder, or its records or files are elsewhere.
    pub async fn open(folder: &Path) -> Result<Self, OpenError> {
        let database = folder.join(DATABASE_FILE);
        if !database.exists() {
            require_file(folder)?;
            return Err(unusable(&database, &"there is no database to move"));
        }
        check_place(folder, None)?;
        require_file(folder)?;
        let mut lock = FolderLock::wait_for(|| FolderLock::take(folder)).await?;
        if lock.log_is_missing(folder) {
            return Err(OpenError::LogMissing(folder.to_owned()));
        }
        // As no service runs, closing the database moves its log into it.
        lock.mark(CLOSED_MARK).map_err(|e| unusable(folder, &e))?;
        let scratch = folder.join(STAGING_FOLDER).join(random_id("migrate-"));
        fs::create_dir_all(&scratch).map_err(|e| unusable(&scratch, &e))?;
        let snapshot = scratch.join(DATABASE_FILE);
        if !sqlite::has_tables(&database).await {
            return Err(unusable(&database, &"there is no database to move"));
        }
        let taken = SqlStore::snapshot(&database, &snapshot).await;
        taken.map_err(|e| unusable(&database, &e))?;
        let wait = StoreSettings::default().write_wait;
        let rows = SqlStore::open(&snapshot, wait, DiskGauge::new(folder, Some(0))).await;
        let rows = rows.map_err(|e| unusable(&snapshot, &e))?;
        let note = note_of(folder, &rows).await;
        Ok(Self {
            folder: folder.to_owned(),
            note: note.map_err(|e| unusable(&snapshot, &e))?,
            rows,
            scratch,
            _lock: lock,
        })
    }

    /// The file of the snapshot.
    pub fn snapshot(&self) -> PathBuf {
        self.scratch.join(DATABASE_FILE)
    }

    /// Notes in the snapshot where the files of each item will be in a bucket: the same place in each attempt.
    pub async fn note_places(&self) -> StoreResult<()> {
        let mut transaction = self.rows.writer.begin().await?;
        let mut pages = RecordPages::new(&self.rows, PAGE_ROWS);
        while let Some(page) = pages.next().await? {
            for mut record in page {
                record.put_at(Some(&place_of(record.id())));
                let (update, files) = match &record {
                    ItemRecord::Volume(volume) => (
                        "UPDATE volumes SET files = $1 WHERE id = $2",
                        to_json(&volume.files)?,
                    ),
                    ItemRecord::Product(product) => (
                        "UPDATE products SET files = $1 WHERE id = $2",
                        to_json(&product.files)?,
                    ),
                };
                let update = query(update).bind(files).bind(record.id());
                update.execute(&mut transaction).await?;
            }
        }
        transaction.commit().await
    }

    /// Number of items with files.
    pub async fn items(&self) -> StoreResult<u64> {
        let row = query("SELECT (SELECT count(*) FROM volumes) + (SELECT count(*) FROM products)")
            .fetch_one(&self.rows.readers)
            .await?;
        let items: i64 = row.try_get(0)?;
        Ok(items.unsigned_abs())
    }

    /// Closes and deletes the snapshot.
    pub async fn close(&self) {
        self.rows.close().await;
        if let Err(error) = fs::remove_dir_all(&self.scratch) {
            tracing::warn!(%error, "the snapshot is deleted by the next start on the folder");
        }
    }
}

/// Marks the snapshot as the folder and its note say, so that the target stays closed or in doubt, and makes the note
/// for it.
async fn note_of(folder: &Path, rows: &SqlStore) -> StoreResult<Option<Note>> {
    let judged = rows.judge(&Beside::folder(folder), false).await?;
    if rows.marks().await?.store.is_none() {
        // No service ever ran on it; the first one on the target finds out.
        return Ok(None);
    }
    rows.mark(&judged.marks).await?;
    rows.note_of(&judged.marks).await.map(Some)
}

fn place_of(id: &str) -> String {
    hex(&Sha256::digest(format!("moved {id}"))[..16])
}
