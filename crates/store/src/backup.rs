//! A copy of a data folder, while the service runs or not.
//!
//! 1. `VACUUM INTO` takes a snapshot of the database in one read transaction.
//! 2. The files of each row of the snapshot (received objects first) are copied and hashed on the way. Files never
//!    change once published, so those that an earlier backup into the same folder has copied are kept.
//! 3. A row whose item was erased meanwhile is removed from the snapshot.
//! 4. The snapshot replaces the target's database; items that it does not name are deleted.
//!
//! So at every moment the target is a whole backup: the last one until step 4, the new one after.
//! To restore, copy the target to the data folder, or start the service on it.

use super::blobs::{self, RECEIVED_FOLDER, RECORD_FILE, STAGING_FOLDER};
use super::content;
use super::copied::Copied;
use super::database::SqlStore;
use super::doctor::{DoctorError, names};
use super::sqlite;
use super::{
    CLOSED_MARK, DATABASE_FILE, DiskGauge, FolderLock, IfNone, OpenError, StoreSettings,
    check_place, require_file, require_store,
};
use crate::faults;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io;
use std::path::Path;
use ventriform_service::base::records::{ItemRecord, RecordPages, Resource};

/// Rows read at a time.
const PAGE_ROWS: u32 = 200;

/// The content of a backup.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Backup {
    /// Number of volumes and products.
    pub items: u64,
    /// Of these, the number that were copied now; the others were there already.
    pub copied: u64,
    /// Items that are damaged in the data folder, and so not in the backup: id and defect.
    pub damaged: Vec<String>,
}

/// Copies the data folder to `target`, an empty folder or one that holds an earlier backup.
///
/// # Errors
/// If there is no database in `folder`, a service uses `target`, or the disk fails.
pub async fn backup(folder: &Path, target: &Path) -> Result<Backup, DoctorError> {
    require_store(folder, IfNone::Refuse)?;
    check_place(folder, None)?;
    require_file(folder)?;
    // If no service runs, closing the database moves its log into it.
    match FolderLock::take(folder) {
        Ok(lock) if lock.log_is_missing(folder) => {
            return Err(OpenError::LogMissing(folder.to_owned()).into());
        }
        Ok(mut lock) => lock.mark(CLOSED_MARK)?,
        Err(OpenError::InUse(_)) => {}
        Err(error) => return Err(error.into()),
    }
    let source = folder.join(DATABASE_FILE);
    if !sqlite::has_tables(&source).await {
        return Err(OpenError::Unusable {
            path: source,
            reason: "there is no database to copy".into(),
        }
        .into());
    }
    fs::create_dir_all(target)?;
    let _lock = FolderLock::take(target)?;
    let shelves = Resource::WITH_FILES.map(Resource::plural);
    for shelf in shelves.into_iter().chain([RECEIVED_FOLDER]) {
        fs::create_dir_all(target.join(shelf))?;
    }
    let _ = fs::remove_dir_all(target.join(STAGING_FOLDER));
    fs::create_dir_all(target.join(STAGING_FOLDER))?;

    let snapshot = target.join(STAGING_FOLDER).join(DATABASE_FILE);
    SqlStore::snapshot(&source, &snapshot).await?;
    let gauge = DiskGauge::new(target, Some(0));
    let rows = SqlStore::open(&snapshot, StoreSettings::default().write_wait, gauge)
        .await
        .map_err(faults::of_sqlite)?;
    let received = copy_received(folder, target, &rows).await;
    let copied = copy_items(folder, target, &rows).await;
    rows.close().await;
    let (received, (done, kept)) = (received?, copied?);

    blobs::sync(&snapshot)?;
    for end in ["-wal", "-shm"] {
        let _ = fs::remove_file(target.join(format!("{DATABASE_FILE}{end}")));
    }
    fs::rename(&snapshot, target.join(DATABASE_FILE))?;
    blobs::sync(target)?;
    keep_only(target, |name| {
        kept.contains(name) || received.contains(name)
    })?;
    Ok(done)
}

/// Deletes the files of other items, and other received objects, than those to be kept.
pub(super) fn keep_only(target: &Path, is_kept: impl Fn(&str) -> bool) -> io::Result<()> {
    for kind in Resource::WITH_FILES {
        for id in names(&target.join(kind.plural()))? {
            if !is_kept(&id) {
                fs::remove_dir_all(target.join(kind.plural()).join(id))?;
            }
        }
    }
    for name in names(&target.join(RECEIVED_FOLDER))? {
        if !is_kept(&name) {
            fs::remove_file(target.join(RECEIVED_FOLDER).join(name))?;
        }
    }
    Ok(())
}

/// Copies the files of every row. Returns the ids of the items that the target has.
async fn copy_items(
    folder: &Path,
    target: &Path,
    rows: &SqlStore,
) -> Result<(Backup, BTreeSet<String>), DoctorError> {
    let (mut done, mut kept) = (Backup::default(), BTreeSet::new());
    let mut pages = RecordPages::new(rows, PAGE_ROWS);
    while let Some(page) = pages.next().await? {
        for record in page {
            let id = record.id();
            match copy_item(folder, target, &record)? {
                Copied::Now => done.copied += 1,
                Copied::Before => {}
                Copied::Not(defect) => {
                    rows.forget(id, None).await?;
                    if folder.join(blobs::shelf_path(id)).exists() {
                        done.damaged.push(format!("{id}: {defect}"));
                    }
                    continue;
                }
            }
            done.items += 1;
            kept.insert(id.to_owned());
        }
    }
    for shelf in Resource::WITH_FILES.map(Resource::plural) {
        blobs::sync(&target.join(shelf))?;
    }
    Ok((done, kept))
}

/// Copies the files of received objects. Returns the names of those that the target has.
async fn copy_received(
    folder: &Path,
    target: &Path,
    rows: &SqlStore,
) -> Result<BTreeSet<String>, DoctorError> {
    let mut kept = BTreeSet::new();
    for (name, sha256) in rows.waiting_files().await? {
        match copy_object(folder, target, &name, &sha256)? {
            // It became part of a volume meanwhile, or is damaged.
            Copied::Not(_) => rows.forget_received(&name, None).await?,
            Copied::Now | Copied::Before => {
                kept.insert(name);
            }
        }
    }
    blobs::sync(&target.join(RECEIVED_FOLDER))?;
    Ok(kept)
}

/// Copies a received object, unless the target has it.
pub(super) fn copy_object(
    folder: &Path,
    target: &Path,
    name: &str,
    sha256: &str,
) -> io::Result<Copied> {
    let is_whole = |place: &Path| {
        let hash = File::open(place).and_then(|file| content::hash(&file));
        hash.is_ok_and(|hash| hash == sha256)
    };
    let place = target.join(RECEIVED_FOLDER).join(name);
    if is_whole(&place) {
        return Ok(Copied::Before);
    }
    let draft = target.join(STAGING_FOLDER).join(name);
    match fs::copy(folder.join(RECEIVED_FOLDER).join(name), &draft) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Ok(Copied::Not("it is missing".into()));
        }
        other => other?,
    };
    if !is_whole(&draft) {
        return Ok(Copied::Not(
            "it has another content than was received".into(),
        ));
    }
    blobs::sync(&draft)?;
    fs::rename(&draft, &place)?;
    Ok(Copied::Now)
}

/// Copies the files of an item, unless the target has them.
pub(super) fn copy_item(folder: &Path, target: &Path, record: &ItemRecord) -> io::Result<Copied> {
    let shelf = blobs::shelf_path(record.id());
    let (from, to) = (folder.join(&shelf), target.join(&shelf));
    if is_whole(&to, record) {
        return Ok(Copied::Before);
    }
    let draft = target.join(STAGING_FOLDER).join(record.id());
    fs::create_dir_all(&draft)?;
    for file in record.files() {
        let copy = draft.join(&file.name);
        match fs::copy(from.join(&file.name), &copy) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                return Ok(Copied::Not(format!("{} is missing", file.name)));
            }
            other => other?,
        };
        if content::hash(&File::open(&copy)?)? != file.sha256 {
            let how = format!("{} has another content than was stored", file.name);
            return Ok(Copied::Not(how));
        }
        blobs::sync(&copy)?;
    }
    let text = serde_json::to_vec_pretty(record)?;
    fs::write(draft.join(RECORD_FILE), text)?;
    blobs::sync(&draft.join(RECORD_FILE))?;
    blobs::sync(&draft)?;
    if to.exists() {
        fs::remove_dir_all(&to)?;
    }
    fs::rename(&draft, &to)?;
    Ok(Copied::Now)
}

/// Whether an earlier backup has the item: its files are there, with the right content.
fn is_whole(place: &Path, record: &ItemRecord) -> bool {
    record.files().iter().all(|file| {
        let open = File::open(place.join(&file.name));
        let hash = open.and_then(|open| content::hash(&open));
        hash.is_ok_and(|hash| hash == file.sha256)
    })
}
