//! The interface to the file store.
//!
//! Files are addressed by an item's id and a name. They are written as streams into a
//! [`StagedFiles`] set that is not visible yet, and published under an id all at once. They are
//! read as streams; code that needs a file on the local disk (the readers of volumes do) asks
//! for a [`LocalFile`]. No method takes or returns the path of a stored file, so that a store
//! may keep its files elsewhere than on a disk.

use super::{BlobError, FileRecord, ItemRecord, StoreFault};
use super::{Cutoff, Resource, Timestamp};
use async_trait::async_trait;
use bytes::Bytes;
use futures::stream::BoxStream;
use std::any::Any;
use std::collections::BTreeSet;
use std::fmt;
use std::ops::{Deref, Range};
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::sync::Arc;
use tokio::io::AsyncWrite;

/// The purpose of staged files. A file store that keeps a reserve of free space gives it to results
/// only, so that the jobs it has accepted can end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StagedFor {
    /// An upload, which is refused if the disk is nearly full.
    Upload,
    /// The result of a job.
    Result,
}

/// The space of the disk that holds the files, in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DiskSpace {
    /// Free for this process.
    pub free: u64,
    /// All of it.
    pub total: u64,
    /// Kept free: with less than that, uploads and jobs are refused.
    pub reserve: u64,
}

impl DiskSpace {
    /// Checks that `bytes` more can be accepted without using the reserve.
    ///
    /// # Errors
    /// [`StoreFault::Full`].
    pub fn require_room(&self, bytes: u64) -> Result<(), BlobError> {
        if self.free >= self.reserve.saturating_add(bytes) {
            return Ok(());
        }
        Err(BlobError::new(
            StoreFault::Full,
            format!(
                "{} bytes are free, {} are to be kept free, and {bytes} more are needed",
                self.free, self.reserve
            ),
        ))
    }
}

/// The content of a file, in chunks.
pub type BlobStream = BoxStream<'static, Result<Bytes, BlobError>>;

/// A file being written. It is complete once `shutdown` has returned.
pub type BlobWriter = Pin<Box<dyn AsyncWrite + Send>>;

/// A file on the local disk. It may be read for as long as this value exists; then the store may
/// delete it if it was a temporary copy.
///
/// The path ends in the file's name. The file can vanish at any time if its item is deleted, or if
/// somebody deletes the store's temporary copies.
#[derive(Clone)]
pub struct LocalFile {
    path: PathBuf,
    _guard: Option<Arc<dyn Any + Send + Sync>>,
}

impl LocalFile {
    /// A file that needs no cleaning up.
    pub fn in_place(path: impl Into<PathBuf>) -> Self {
        Self {
            path: path.into(),
            _guard: None,
        }
    }

    /// A temporary copy; `guard` is dropped with the last clone and cleans up.
    pub fn copied(path: impl Into<PathBuf>, guard: impl Any + Send + Sync) -> Self {
        Self {
            path: path.into(),
            _guard: Some(Arc::new(guard)),
        }
    }
}

impl Deref for LocalFile {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.path
    }
}

impl AsRef<Path> for LocalFile {
    fn as_ref(&self) -> &Path {
        &self.path
    }
}

impl fmt::Debug for LocalFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("LocalFile").field(&self.path).finish()
    }
}

/// A set of files that is not visible yet. Dropping it discards the files.
#[async_trait]
pub trait StagedFiles: Send + Sync {
    /// Starts a new file.
    ///
    /// # Errors
    /// [`BlobError`], as of every method here.
    async fn create(&self, name: &str) -> Result<BlobWriter, BlobError>;

    /// Renames a complete file.
    async fn rename(&self, from: &str, to: &str) -> Result<(), BlobError>;

    /// A complete file on the local disk.
    async fn local(&self, name: &str) -> Result<LocalFile, BlobError>;

    /// Makes the complete files durable; they are to be published under `id`.
    /// [`StagedFiles::publish`] does so for what is left; calling this before allows other work
    /// meanwhile.
    async fn settle(&self, id: &str) -> Result<(), BlobError>;

    /// Where [`StagedFiles::publish`] will put the files, if the store keeps every publication of an
    /// item apart. Then the item's row must say so ([`FileRecord::place`]): the files are visible
    /// once the row is, and those of other publications are never seen, nor harmed by what is done
    /// to these.
    fn place(&self) -> Option<&str> {
        None
    }

    /// Publishes the files under the id of `record`, all at once and durably, with a copy of
    /// `record`. Files that lay in the same place are deleted.
    async fn publish(self: Box<Self>, record: &ItemRecord) -> Result<(), BlobError>;
}

/// An item that has files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shelved {
    /// Its id.
    pub id: String,
    /// Number of its publications; more than one if some were given up, or have been replaced.
    pub places: usize,
}

/// Files by item id and file name. The files of an id become visible all at once.
///
/// A store that keeps publications apart cannot tell one that is going on from one that was given up,
/// except by its age: with other files than those named, the methods that delete or move leave those
/// alone that may still get their row.
#[async_trait]
pub trait BlobStore: Send + Sync + 'static {
    /// Starts an empty set of files.
    ///
    /// # Errors
    /// [`BlobError`], as of every method here.
    async fn stage(&self, purpose: StagedFor) -> Result<Box<dyn StagedFiles>, BlobError>;

    /// A range of bytes of one file. Ends with [`StoreFault::DamagedFile`] if the file is missing
    /// or is not what `file` says.
    async fn read(
        &self,
        id: &str,
        file: &FileRecord,
        range: Range<u64>,
    ) -> Result<BlobStream, BlobError>;

    /// One file on the local disk; `None` if it does not exist. A store on the local disk returns
    /// the file itself; other stores download it. Fails with [`StoreFault::DamagedFile`] if the
    /// file is not what `file` says.
    async fn local(&self, id: &str, file: &FileRecord) -> Result<Option<LocalFile>, BlobError>;

    /// Deletes every file of `id`, of which `files` are known, also what was set aside; succeeds if
    /// there is none.
    async fn delete(&self, id: &str, files: &[FileRecord]) -> Result<(), BlobError>;

    /// Deletes the publications of `id` other than that of `files`.
    async fn prune(&self, _id: &str, _files: &[FileRecord]) -> Result<(), BlobError> {
        Ok(())
    }

    /// Every item of that kind that has files.
    async fn ids(&self, kind: Resource) -> Result<Vec<Shelved>, BlobError>;

    /// The items of whose files there are copies on the local disk, if they are stored elsewhere.
    fn copied(&self) -> BTreeSet<String> {
        BTreeSet::new()
    }

    /// Deletes the copies of the files of these items.
    fn forget(&self, _ids: &BTreeSet<String>) -> Result<(), BlobError> {
        Ok(())
    }

    /// Moves every file of `id` to where nobody sees it but the operator can restore it. Returns
    /// whether there was any.
    async fn set_aside(&self, id: &str, now: Timestamp) -> Result<bool, BlobError>;

    /// Reads one file from where it is stored, whatever is remembered of it. Fails with
    /// [`StoreFault::DamagedFile`] if it does not exist.
    async fn hash(&self, id: &str, file: &FileRecord) -> Result<FileRecord, BlobError>;

    /// Writes a copy of the item's row beside its files, if there is none.
    async fn describe(&self, record: &ItemRecord) -> Result<(), BlobError>;

    /// Deletes what was discarded, and what was set aside before `set_aside_before`; never what has
    /// a row.
    async fn tidy(&self, set_aside_before: Option<Cutoff>) -> Result<(), BlobError>;

    /// Checks, for readiness, that there is room and that a small file can be written, read and
    /// deleted.
    async fn check(&self) -> Result<(), BlobError>;

    /// The space of the disk; `None` where that is unknown or has no meaning.
    fn space(&self) -> Option<DiskSpace> {
        None
    }

    /// Checks that `bytes` more can be accepted without using the reserve.
    ///
    /// # Errors
    /// [`StoreFault::Full`].
    fn require_room(&self, bytes: u64) -> Result<(), BlobError> {
        self.space()
            .map_or(Ok(()), |space| space.require_room(bytes))
    }
}
