//! The file store in a folder: one folder per id, made visible by a rename.
//!
//! The files of an id are written into a folder under `staging/`, together with `record.json`, a
//! copy of the item's row. Each file and the folder are forced to disk; then the folder is moved to
//! its place by a rename, which succeeds as a whole or not at all, and that is forced to disk too.
//! Content is verified when it is read; see [`super::content`].
//!
//! Nothing that has no row is deleted: it is set aside under `quarantine/`, in a folder named by
//! the day.

use super::content::{self, Reading, Stamp, Verified};
use super::space::DiskGauge;
use async_trait::async_trait;
use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll};
use time::format_description::StaticFormatDescription;
use time::macros::format_description;
use time::{Date, OffsetDateTime};
use tokio::io::AsyncWrite;
use ventriform_service::base::records::{
    BlobError, BlobStore, BlobStream, BlobWriter, Cutoff, DiskSpace, FileRecord, ItemRecord,
    LocalFile, Resource, Shelved, StagedFiles, StagedFor, StoreFault, Timestamp, random_id,
};
use ventriform_service::limits::places::Places;

/// The name of the copy of an item's row.
pub(super) const RECORD_FILE: &str = "record.json";

/// Files that are not published yet.
pub(super) const STAGING_FOLDER: &str = "staging";
/// Received objects, which are not volumes yet.
pub(super) const RECEIVED_FOLDER: &str = "received";
/// The folder of files that are to be deleted.
pub(super) const DISCARDED_FOLDER: &str = "discarded";
/// The folder of files without a row, by day.
pub(super) const QUARANTINE_FOLDER: &str = "quarantine";

const DAY_FORMAT: StaticFormatDescription = format_description!("[year]-[month]-[day]");

/// Content that [`BlobStore::check`] writes: more than the free rest of a block.
pub(super) const PROBE_BYTES: &[u8] = &[b'v'; 8192];

/// Uploads and received objects that are forced to disk at the same time, in turn: the disk is slow, and the threads
/// for it are few.
const SYNCS_AT_ONCE: usize = 32;

/// Files below one folder.
pub struct FileBlobs {
    pub(super) folder: PathBuf,
    pub(super) gauge: DiskGauge,
    /// Places for forcing files to disk.
    pub(super) syncs: Arc<Places>,
    verified: Arc<Verified>,
}

impl FileBlobs {
    /// Makes the folders that do not exist yet, and discards what an earlier process left in the
    /// staging folder; [`BlobStore::tidy`] deletes it. Uploads are refused if the disk of `gauge`
    /// is nearly full.
    ///
    /// # Errors
    /// If the folder cannot be written.
    pub fn open(folder: &Path, gauge: DiskGauge) -> io::Result<Self> {
        fs::create_dir_all(folder.join(DISCARDED_FOLDER))?;
        match fs::rename(
            folder.join(STAGING_FOLDER),
            folder.join(DISCARDED_FOLDER).join(random_id("")),
        ) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        for name in kept_folders().chain([STAGING_FOLDER, QUARANTINE_FOLDER]) {
            fs::create_dir_all(folder.join(name))?;
        }
        sync(folder)?;
        Ok(Self {
            folder: folder.to_owned(),
            gauge,
            syncs: Places::new(SYNCS_AT_ONCE),
            verified: Arc::default(),
        })
    }

    /// A new path under `staging/`.
    pub(super) fn new_staging_folder(&self) -> PathBuf {
        self.folder.join(STAGING_FOLDER).join(random_id(""))
    }

    /// Runs `work` on a thread that may block.
    async fn blocking<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Path, &Verified) -> Result<T, BlobError> + Send + 'static,
    ) -> Result<T, BlobError> {
        let (folder, verified) = (self.folder.clone(), self.verified.clone());
        tokio::task::spawn_blocking(move || work(&folder, &verified))
            .await
            .map_err(|error| BlobError::new(StoreFault::Other, error.to_string()))?
    }
}

/// The folders of what is kept.
fn kept_folders() -> impl Iterator<Item = &'static str> {
    let kinds = Resource::WITH_FILES.map(Resource::plural);
    kinds.into_iter().chain([RECEIVED_FOLDER])
}

/// Checks that a folder exists and that its entries can be changed.
fn check_writable(folder: &Path) -> io::Result<()> {
    if !fs::metadata(folder)?.is_dir() {
        return Err(io::Error::from_raw_os_error(NOT_A_FOLDER));
    }
    #[cfg(unix)]
    {
        use rustix::fs::{Access, access};
        let rights = Access::READ_OK | Access::WRITE_OK | Access::EXEC_OK;
        access(folder, rights)?;
    }
    Ok(())
}

/// `ENOTDIR`.
const NOT_A_FOLDER: i32 = 20;

/// The path of an item below the data folder.
pub(super) fn shelf_path(id: &str) -> String {
    let kind = Resource::from_id(id).unwrap_or(Resource::Volume);
    format!("{}/{id}", kind.plural())
}

/// Whether `id` is a name that cannot leave its folder.
pub(super) fn is_plain(id: &str) -> bool {
    Resource::from_id(id).is_some() && id.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Forces a folder's entries, or a file's content, to disk.
pub(super) fn sync(path: &Path) -> io::Result<()> {
    File::open(path)?.sync_all()
}

/// Opens a file of an item and verifies it. `None` if it does not exist.
fn open_verified(
    folder: &Path,
    verified: &Verified,
    id: &str,
    record: &FileRecord,
) -> Result<Option<(File, Stamp)>, BlobError> {
    let path = format!("{}/{}", shelf_path(id), record.name);
    let file = match File::open(folder.join(&path)) {
        Ok(file) => file,
        Err(error) if is_absent(&error) => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    let stamp = verified.check(&path, &file, record)?;
    Ok(Some((file, stamp)))
}

pub(super) fn is_absent(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory)
}

/// Bytes of an upload between two looks at the free space.
const ROOM_CHECKED_EVERY: u64 = 4 << 20;

/// A file of an upload, which ends with an error when the disk is nearly full.
pub(super) struct UploadFile {
    file: tokio::fs::File,
    gauge: DiskGauge,
    unchecked: u64,
}

impl UploadFile {
    /// An empty file on the disk of `gauge`.
    pub(super) fn new(file: tokio::fs::File, gauge: DiskGauge) -> Self {
        Self {
            file,
            gauge,
            unchecked: 0,
        }
    }
}

impl AsyncWrite for UploadFile {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        if self.unchecked >= ROOM_CHECKED_EVERY {
            self.unchecked = 0;
            let room = self.gauge.space().map(|space| space.require_room(0));
            if let Some(Err(_)) = room {
                return Poll::Ready(Err(ErrorKind::StorageFull.into()));
            }
        }
        let written = Pin::new(&mut self.file).poll_write(context, bytes);
        if let Poll::Ready(Ok(bytes)) = written {
            self.unchecked += bytes as u64;
        }
        written
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.file).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.file).poll_shutdown(context)
    }
}

/// A folder under `staging/`.
struct StagingFolder {
    /// For uploads: the disk on which room is to be left.
    gauge: Option<DiskGauge>,
    /// The folder; deleted on drop.
    folder: PathBuf,
    /// The root of the store.
    root: PathBuf,
    syncs: Arc<Places>,
    verified: Arc<Verified>,
    /// Whether everything in the folder has been forced to disk.
    settled: AtomicBool,
}

impl Drop for StagingFolder {
    fn drop(&mut self) {
        // Fails after publishing, when the folder has been moved. If the folder was exchanged with
        // that of a damaged item, this deletes the damaged files.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Forces the files of a folder, and its entries, to disk.
fn sync_all(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        sync(&entry?.path())?;
    }
    sync(folder)
}

impl StagingFolder {
    fn publish_blocking(&self, record: &ItemRecord) -> Result<(), BlobError> {
        let text = serde_json::to_vec_pretty(record)
            .map_err(|error| BlobError::new(StoreFault::Other, error.to_string()))?;
        fs::write(self.folder.join(RECORD_FILE), text)?;
        if self.settled.load(Ordering::Acquire) {
            sync(&self.folder.join(RECORD_FILE))?;
            sync(&self.folder)?;
        } else {
            sync_all(&self.folder)?;
        }
        let shelf = shelf_path(record.id());
        let mut stamps = Vec::new();
        for file in record.files() {
            let stamp = Stamp::from_file(&fs::metadata(self.folder.join(&file.name))?);
            stamps.push((format!("{shelf}/{}", file.name), stamp, file.sha256));
        }
        let place = self.root.join(shelf);
        self.move_to(&place)?;
        if let Err(error) = sync(place.parent().unwrap_or(&place)) {
            // The move may not last, so it is not to be seen either.
            let _ = fs::rename(&place, &self.folder);
            return Err(error.into());
        }
        for (path, stamp, sha256) in stamps {
            self.verified.remember(path, stamp, sha256);
        }
        Ok(())
    }

    /// Moves the folder to its place, from which it removes the files that lie there.
    fn move_to(&self, place: &Path) -> io::Result<()> {
        match fs::rename(&self.folder, place) {
            Err(error)
                if matches!(
                    error.kind(),
                    ErrorKind::DirectoryNotEmpty | ErrorKind::AlreadyExists
                ) =>
            {
                let discarded = self.root.join(DISCARDED_FOLDER).join(random_id(""));
                fs::rename(place, &discarded)?;
                fs::rename(&self.folder, place)?;
                // What is left of it is deleted by the next `tidy`.
                let _ = fs::remove_dir_all(&discarded);
                Ok(())
            }
            other => other,
        }
    }
}

#[async_trait]
impl StagedFiles for StagingFolder {
    async fn create(&self, name: &str) -> Result<BlobWriter, BlobError> {
        self.settled.store(false, Ordering::Release);
        let file = tokio::fs::File::create(self.folder.join(name)).await?;
        Ok(match &self.gauge {
            Some(gauge) => Box::pin(UploadFile::new(file, gauge.clone())),
            None => Box::pin(file),
        })
    }

    async fn rename(&self, from: &str, to: &str) -> Result<(), BlobError> {
        self.settled.store(false, Ordering::Release);
        tokio::fs::rename(self.folder.join(from), self.folder.join(to)).await?;
        Ok(())
    }

    async fn local(&self, name: &str) -> Result<LocalFile, BlobError> {
        Ok(LocalFile::in_place(self.folder.join(name)))
    }

    async fn settle(&self, _id: &str) -> Result<(), BlobError> {
        let _turn = self.syncs.take().await;
        let folder = self.folder.clone();
        tokio::task::spawn_blocking(move || sync_all(&folder))
            .await
            .map_err(|e| BlobError::new(StoreFault::Other, e.to_string()))??;
        self.settled.store(true, Ordering::Release);
        Ok(())
    }

    async fn publish(self: Box<Self>, record: &ItemRecord) -> Result<(), BlobError> {
        let _turn = self.syncs.take().await;
        let record = record.clone();
        tokio::task::spawn_blocking(move || self.publish_blocking(&record))
            .await
            .map_err(|e| BlobError::new(StoreFault::Other, e.to_string()))?
    }
}

#[async_trait]
impl BlobStore for FileBlobs {
    async fn stage(&self, purpose: StagedFor) -> Result<Box<dyn StagedFiles>, BlobError> {
        let folder = self.new_staging_folder();
        tokio::fs::create_dir(&folder).await?;
        Ok(Box::new(StagingFolder {
            gauge: (purpose == StagedFor::Upload).then(|| self.gauge.clone()),
            folder,
            root: self.folder.clone(),
            syncs: self.syncs.clone(),
            verified: self.verified.clone(),
            settled: AtomicBool::new(false),
        }))
    }

    async fn read(
        &self,
        id: &str,
        file: &FileRecord,
        range: Range<u64>,
    ) -> Result<BlobStream, BlobError> {
        let (id, file) = (id.to_owned(), file.clone());
        let first = self.blocking(move |folder, verified| {
            let path = format!("{}/{}", shelf_path(&id), file.name);
            let Some((file, stamp)) = open_verified(folder, verified, &id, &file)? else {
                return Err(content::damaged(&path, "it is missing"));
            };
            Reading::begin(file, stamp, path, range)
        });
        Ok(content::stream(first.await?))
    }

    async fn local(&self, id: &str, file: &FileRecord) -> Result<Option<LocalFile>, BlobError> {
        let (owner, record) = (id.to_owned(), file.clone());
        let found = self.blocking(move |folder, verified| {
            let found = open_verified(folder, verified, &owner, &record)?;
            let path = folder.join(shelf_path(&owner)).join(&record.name);
            Ok(found.map(|_| LocalFile::in_place(path)))
        });
        found.await
    }

    async fn delete(&self, id: &str, _files: &[FileRecord]) -> Result<(), BlobError> {
        let id = id.to_owned();
        let deleted = self.blocking(move |folder, _| {
            let mut places = set_aside_of(folder, &id)?;
            places.push(folder.join(shelf_path(&id)));
            for place in places {
                // Renamed first, so that half the files are never seen as all of them.
                let doomed = folder.join(DISCARDED_FOLDER).join(random_id(""));
                match fs::rename(place, &doomed) {
                    Err(error) if is_absent(&error) => continue,
                    other => other?,
                }
                fs::remove_dir_all(&doomed)?;
            }
            Ok(())
        });
        deleted.await
    }

    async fn set_aside(&self, id: &str, now: Timestamp) -> Result<bool, BlobError> {
        let id = id.to_owned();
        let moved = self.blocking(move |folder, _| Ok(set_aside(folder, &id, now)?));
        moved.await
    }

    async fn ids(&self, kind: Resource) -> Result<Vec<Shelved>, BlobError> {
        let listed = self.blocking(move |folder, _| {
            let mut ids = Vec::new();
            for entry in fs::read_dir(folder.join(kind.plural()))? {
                let name = entry?.file_name().into_string();
                ids.extend(name.map(|id| Shelved { id, places: 1 }));
            }
            Ok(ids)
        });
        listed.await
    }

    async fn describe(&self, record: &ItemRecord) -> Result<(), BlobError> {
        let record = record.clone();
        let written = self.blocking(move |folder, _| {
            let place = folder.join(shelf_path(record.id()));
            if fs::exists(place.join(RECORD_FILE))? {
                return Ok(());
            }
            let text = serde_json::to_vec_pretty(&record)
                .map_err(|error| BlobError::new(StoreFault::Other, error.to_string()))?;
            let draft = place.join(format!("{RECORD_FILE}.new"));
            fs::write(&draft, text)?;
            sync(&draft)?;
            Ok(fs::rename(&draft, place.join(RECORD_FILE))?)
        });
        written.await
    }

    async fn hash(&self, id: &str, file: &FileRecord) -> Result<FileRecord, BlobError> {
        let (id, name) = (id.to_owned(), file.name.clone());
        let hashed = self.blocking(move |folder, _| {
            let path = format!("{}/{name}", shelf_path(&id));
            let file = match File::open(folder.join(&path)) {
                Err(error) if is_absent(&error) => {
                    return Err(content::damaged(&path, "it is missing"));
                }
                other => other?,
            };
            Ok(FileRecord {
                bytes: file.metadata()?.len(),
                sha256: content::hash(&file)?,
                name,
                place: None,
            })
        });
        hashed.await
    }

    async fn tidy(&self, set_aside_before: Option<Cutoff>) -> Result<(), BlobError> {
        let tidied = self.blocking(move |folder, _| {
            for entry in fs::read_dir(folder.join(DISCARDED_FOLDER))? {
                fs::remove_dir_all(entry?.path())?;
            }
            let Some(first_kept) = set_aside_before.map(Cutoff::moment) else {
                return Ok(());
            };
            for entry in fs::read_dir(folder.join(QUARANTINE_FOLDER))? {
                let entry = entry?;
                let name = entry.file_name();
                if name
                    .to_str()
                    .is_some_and(|name| is_of_shelf_before(name, first_kept))
                {
                    fs::remove_dir_all(entry.path())?;
                }
            }
            Ok(())
        });
        tidied.await
    }

    async fn check(&self) -> Result<(), BlobError> {
        self.require_room(0)?;
        let path = self.new_staging_folder();
        let checked = self.blocking(move |folder, _| {
            fs::write(&path, PROBE_BYTES)?;
            let read = fs::read(&path);
            fs::remove_file(&path)?;
            // What is accepted is moved there. Nothing is written there, where it would be taken for an item.
            for name in kept_folders() {
                check_writable(&folder.join(name))?;
            }
            if read? == PROBE_BYTES {
                Ok(())
            } else {
                Err(BlobError::new(
                    StoreFault::Disk,
                    "a file was read back with another content",
                ))
            }
        });
        checked.await
    }

    fn space(&self) -> Option<DiskSpace> {
        self.gauge.space()
    }
}

fn day(at: Timestamp) -> Option<Date> {
    let time = OffsetDateTime::from_unix_timestamp(at.div_euclid(1000)).ok()?;
    Some(time.date())
}

/// The folders in the quarantine that hold files of an item.
fn set_aside_of(folder: &Path, id: &str) -> io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for shelf in fs::read_dir(folder.join(QUARANTINE_FOLDER))? {
        let shelf = shelf?;
        if !shelf.file_type()?.is_dir() {
            continue;
        }
        for entry in fs::read_dir(shelf.path())? {
            let entry = entry?;
            let name = entry.file_name();
            let rest = name.to_str().and_then(|name| name.strip_prefix(id));
            if rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.')) {
                found.push(entry.path());
            }
        }
    }
    Ok(found)
}

/// The name of the quarantine of the day.
pub(super) fn shelf_name(now: Timestamp) -> String {
    let day = day(now).and_then(|day| day.format(&DAY_FORMAT).ok());
    day.unwrap_or_else(|| "unknown".into())
}

/// Whether a folder in the quarantine is of an earlier day.
pub(super) fn is_of_shelf_before(name: &str, first_kept: Timestamp) -> bool {
    let of = Date::parse(name, &DAY_FORMAT).ok();
    of.zip(day(first_kept)).is_some_and(|(of, kept)| of < kept)
}

/// The quarantine of the day, which is made if it does not exist.
pub(super) fn quarantine_shelf(folder: &Path, now: Timestamp) -> io::Result<PathBuf> {
    let shelf = folder.join(QUARANTINE_FOLDER).join(shelf_name(now));
    fs::create_dir_all(&shelf)?;
    Ok(shelf)
}

/// The file beside a damaged item's files that says who had it.
pub(super) const HOLDERS_FILE: &str = "holders.json";

/// The folder in the quarantine for items of which nobody knows whose they are. It is not emptied by age: one of them
/// may be on legal hold.
pub(super) const UNOWNED_SHELF: &str = "unowned";

/// Moves the folder of an item into the quarantine of the day. Returns whether there was one.
pub(super) fn set_aside(folder: &Path, id: &str, now: Timestamp) -> io::Result<bool> {
    set_aside_in(folder, id, &quarantine_shelf(folder, now)?)
}

/// Moves the folder of an item whose holder is unknown into the quarantine. Returns whether there was one.
pub(super) fn set_aside_unowned(folder: &Path, id: &str) -> io::Result<bool> {
    let shelf = folder.join(QUARANTINE_FOLDER).join(UNOWNED_SHELF);
    fs::create_dir_all(&shelf)?;
    set_aside_in(folder, id, &shelf)
}

fn set_aside_in(folder: &Path, id: &str, shelf: &Path) -> io::Result<bool> {
    let mut place = shelf.join(id);
    if fs::exists(&place)? {
        place = shelf.join(random_id(&format!("{id}.")));
    }
    match fs::rename(folder.join(shelf_path(id)), &place) {
        Err(error) if is_absent(&error) => Ok(false),
        other => {
            other?;
            sync(shelf)?;
            Ok(true)
        }
    }
}
