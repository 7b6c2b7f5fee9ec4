//! The interface to the file store.
//!
//! Files are addressed by an item's id and a name. They are written as streams into a
//! [`StagedFiles`] set that is not visible yet, and published under an id all at once. They are
//! read as streams; code that needs a file on the local disk (the readers of volumes do) asks
//! for a [`LocalFile`]. No method takes or returns the path of a stored file, so that a store
//! may keep its files elsewhere than on a disk.

use async_trait::async_trait;
use bytes::Bytes;
use futures::stream::BoxStream;
use std::any::Any;
use std::fmt;
use std::ops::{Deref, Range};
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::sync::Arc;
use tokio::io::AsyncWrite;

/// A file could not be written or read.
#[derive(Debug, thiserror::Error)]
#[error("the file store: {0}")]
pub struct BlobError(pub String);

impl From<std::io::Error> for BlobError {
    fn from(error: std::io::Error) -> Self {
        Self(error.to_string())
    }
}

/// The content of a file, in chunks.
pub type BlobStream = BoxStream<'static, Result<Bytes, BlobError>>;

/// A file being written. It is complete once `shutdown` has returned.
pub type BlobWriter = Pin<Box<dyn AsyncWrite + Send>>;

/// A file on the local disk. It may be read for as long as this value exists; then the store may
/// delete it if it was a temporary copy.
///
/// The path ends in the file's name. The file can vanish at any time if its item is deleted.
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

    /// Forces the complete files to the disk. [`StagedFiles::publish`] does so for what is left;
    /// calling this before allows other work meanwhile.
    async fn settle(&self) -> Result<(), BlobError>;

    /// Makes the files visible under `id`, all at once and durably. If `id` already has files,
    /// these are kept and the new ones discarded.
    async fn publish(self: Box<Self>, id: &str) -> Result<(), BlobError>;
}

/// Files by item id and file name. The files of an id become visible all at once.
#[async_trait]
pub trait BlobStore: Send + Sync + 'static {
    /// Starts an empty set of files.
    ///
    /// # Errors
    /// [`BlobError`], as of every method here.
    async fn stage(&self) -> Result<Box<dyn StagedFiles>, BlobError>;

    /// A range of bytes of one file.
    async fn read(&self, id: &str, name: &str, range: Range<u64>) -> Result<BlobStream, BlobError>;

    /// One file on the local disk; `None` if it does not exist. A store on the local disk returns
    /// the file itself; other stores download it.
    async fn local(&self, id: &str, name: &str) -> Result<Option<LocalFile>, BlobError>;

    /// Deletes every file of `id`; succeeds if there is none.
    async fn delete(&self, id: &str) -> Result<(), BlobError>;

    /// Every id that has files.
    async fn ids(&self) -> Result<Vec<String>, BlobError>;

    /// Checks, for readiness, that a small file can be written and deleted.
    async fn check(&self) -> Result<(), BlobError>;
}
