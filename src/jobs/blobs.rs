//! What is needed of a place for files.

use async_trait::async_trait;
use bytes::Bytes;
use futures::stream::BoxStream;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A file could not be written or read.
#[derive(Debug, thiserror::Error)]
#[error("the file store: {0}")]
pub struct BlobError(pub String);

impl From<std::io::Error> for BlobError {
    fn from(error: std::io::Error) -> Self {
        Self(error.to_string())
    }
}

/// A file's content in pieces.
pub type BlobStream = BoxStream<'static, Result<Bytes, BlobError>>;

/// A folder of files that nobody can see yet. Dropping it erases it.
#[derive(Debug)]
pub struct Staged {
    folder: PathBuf,
}

impl Staged {
    /// Takes charge of `folder`, which exists and is empty.
    pub fn new(folder: PathBuf) -> Self {
        Self { folder }
    }

    /// Where the files lie until they are published.
    pub fn folder(&self) -> &Path {
        &self.folder
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        // Fails where the folder was published: it is not here any more.
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// Files by id and name. The files of an id appear all at once, or not at all.
#[async_trait]
pub trait BlobStore: Send + Sync + 'static {
    /// A fresh folder to write into, on the same file system as the published ones.
    async fn stage(&self) -> Result<Staged, BlobError>;

    /// Makes the staged files visible under `id`, durably. If `id` is there already, it
    /// stays as it is.
    async fn publish(&self, id: &str, staged: Staged) -> Result<(), BlobError>;

    /// A range of one file's content.
    async fn read(&self, id: &str, name: &str, range: Range<u64>) -> Result<BlobStream, BlobError>;

    /// Paths of the files `names`, for work that reads files.
    fn paths(&self, id: &str, names: &[String]) -> Vec<PathBuf>;

    /// Erases everything under `id`; well if there is nothing.
    async fn delete(&self, id: &str) -> Result<(), BlobError>;

    /// Every id that has files.
    async fn ids(&self) -> Result<Vec<String>, BlobError>;

    /// Room for `bytes` more, and whether writing works: for readiness.
    async fn check(&self) -> Result<(), BlobError>;
}
