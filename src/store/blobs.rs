//! The file store in a folder: one folder per id, made visible by a rename.
//!
//! The files of an id are written into a folder under `staging/`, forced to disk, and then moved
//! to their place by renaming the folder, which succeeds as a whole or not at all. Files are read in
//! large pieces (`object_store` reads 8 KiB at a time, each on another thread); listing goes through
//! `object_store`.

use crate::jobs::{
    BlobError, BlobStore, BlobStream, BlobWriter, LocalFile, Resource, StagedFiles, random_id,
};
use async_trait::async_trait;
use bytes::Bytes;
use futures::StreamExt;
use object_store::local::LocalFileSystem;
use object_store::path::Path as Key;
use object_store::{ObjectStore, ObjectStoreExt, PutPayload};
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

const STAGING: &str = "staging";

/// Files below one folder.
pub struct FileBlobs {
    folder: PathBuf,
    files: LocalFileSystem,
}

impl FileBlobs {
    /// Makes the folders that do not exist yet, and deletes what an earlier process left in the
    /// staging folder.
    ///
    /// # Errors
    /// If the folder cannot be written.
    pub fn open(folder: &Path) -> std::io::Result<Self> {
        match std::fs::remove_dir_all(folder.join(STAGING)) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        let kinds = Resource::WITH_FILES.map(Resource::plural);
        for name in kinds.into_iter().chain([STAGING]) {
            std::fs::create_dir_all(folder.join(name))?;
        }
        sync(folder)?;
        let files = LocalFileSystem::new_with_prefix(folder)
            .map_err(std::io::Error::other)?
            .with_fsync(true);
        Ok(Self {
            folder: folder.to_owned(),
            files,
        })
    }

    fn place(&self, id: &str) -> PathBuf {
        self.folder.join(kind_folder(id)).join(id)
    }

    fn new_staging_folder(&self) -> PathBuf {
        self.folder.join(STAGING).join(random_id(""))
    }
}

/// The folder for items of the kind of `id`.
fn kind_folder(id: &str) -> &'static str {
    Resource::of(id).unwrap_or(Resource::Volume).plural()
}

/// Forces a folder's entries, or a file's content, to disk.
fn sync(path: &Path) -> std::io::Result<()> {
    File::open(path)?.sync_all()
}

/// Runs blocking `work` on a thread for it.
async fn on_a_thread<T: Send + 'static>(
    work: impl FnOnce() -> std::io::Result<T> + Send + 'static,
) -> Result<T, BlobError> {
    let done = tokio::task::spawn_blocking(work).await;
    Ok(done.map_err(|error| BlobError(error.to_string()))??)
}

/// Largest piece of a file that is read at a time, bytes. Each piece is handed from a blocking
/// thread to the connection, which costs as much as reading tens of kibibytes.
const PIECE: u64 = 256 << 10;

/// The part of a file that is still to be read.
struct OpenPart {
    file: File,
    left: u64,
}

impl OpenPart {
    fn open(path: &Path, range: Range<u64>) -> std::io::Result<Self> {
        let mut file = File::open(path)?;
        file.seek(SeekFrom::Start(range.start))?;
        let left = range.end - range.start;
        Ok(Self { file, left })
    }

    /// The next piece and what is left after it.
    fn next_piece(mut self) -> std::io::Result<(Bytes, Self)> {
        let mut piece = vec![0; self.left.min(PIECE) as usize];
        self.file.read_exact(&mut piece)?;
        self.left -= piece.len() as u64;
        Ok((piece.into(), self))
    }
}

/// A folder under `staging/`.
struct StagingFolder {
    /// The folder; deleted on drop.
    folder: PathBuf,
    /// The root of the store.
    root: PathBuf,
    /// Whether everything in the folder has been forced to disk.
    settled: AtomicBool,
}

impl Drop for StagingFolder {
    fn drop(&mut self) {
        // Fails after publishing, when the folder has been moved.
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// Forces the files of a folder, and its entries, to disk.
fn sync_all(folder: &Path) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        sync(&entry?.path())?;
    }
    sync(folder)
}

impl StagingFolder {
    fn publish_blocking(&self, place: &Path) -> std::io::Result<()> {
        if !self.settled.load(Ordering::Acquire) {
            sync_all(&self.folder)?;
        }
        match std::fs::rename(&self.folder, place) {
            // The id has its files already.
            Err(error)
                if matches!(
                    error.kind(),
                    ErrorKind::DirectoryNotEmpty | ErrorKind::AlreadyExists
                ) =>
            {
                return Ok(());
            }
            other => other?,
        }
        sync(place.parent().unwrap_or(place))
    }
}

#[async_trait]
impl StagedFiles for StagingFolder {
    async fn create(&self, name: &str) -> Result<BlobWriter, BlobError> {
        self.settled.store(false, Ordering::Release);
        let file = tokio::fs::File::create(self.folder.join(name)).await?;
        Ok(Box::pin(file))
    }

    async fn rename(&self, from: &str, to: &str) -> Result<(), BlobError> {
        self.settled.store(false, Ordering::Release);
        tokio::fs::rename(self.folder.join(from), self.folder.join(to)).await?;
        Ok(())
    }

    async fn local(&self, name: &str) -> Result<LocalFile, BlobError> {
        Ok(LocalFile::in_place(self.folder.join(name)))
    }

    async fn settle(&self) -> Result<(), BlobError> {
        let folder = self.folder.clone();
        on_a_thread(move || sync_all(&folder)).await?;
        self.settled.store(true, Ordering::Release);
        Ok(())
    }

    async fn publish(self: Box<Self>, id: &str) -> Result<(), BlobError> {
        let place = self.root.join(kind_folder(id)).join(id);
        on_a_thread(move || self.publish_blocking(&place)).await
    }
}

#[async_trait]
impl BlobStore for FileBlobs {
    async fn stage(&self) -> Result<Box<dyn StagedFiles>, BlobError> {
        let folder = self.new_staging_folder();
        tokio::fs::create_dir(&folder).await?;
        Ok(Box::new(StagingFolder {
            folder,
            root: self.folder.clone(),
            settled: AtomicBool::new(false),
        }))
    }

    async fn read(&self, id: &str, name: &str, range: Range<u64>) -> Result<BlobStream, BlobError> {
        if range.is_empty() {
            return Ok(futures::stream::empty().boxed());
        }
        let path = self.place(id).join(name);
        // Reading the first piece here reports a missing file before the stream begins.
        let (first, rest) = on_a_thread(move || OpenPart::open(&path, range)?.next_piece()).await?;
        let rest = futures::stream::try_unfold(rest, |part: OpenPart| async move {
            match part.left {
                0 => Ok(None),
                _ => on_a_thread(move || part.next_piece()).await.map(Some),
            }
        });
        Ok(futures::stream::once(async move { Ok(first) })
            .chain(rest)
            .boxed())
    }

    async fn local(&self, id: &str, name: &str) -> Result<Option<LocalFile>, BlobError> {
        let path = self.place(id).join(name);
        let exists = tokio::fs::try_exists(&path).await?;
        Ok(exists.then(|| LocalFile::in_place(path)))
    }

    async fn delete(&self, id: &str) -> Result<(), BlobError> {
        // Renamed first, so that half the files are never seen as all of them.
        let doomed = self.new_staging_folder();
        match tokio::fs::rename(self.place(id), &doomed).await {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
            other => other?,
        }
        tokio::fs::remove_dir_all(&doomed).await?;
        Ok(())
    }

    async fn ids(&self) -> Result<Vec<String>, BlobError> {
        let mut ids = Vec::new();
        for kind in Resource::WITH_FILES.map(Resource::plural) {
            let listed = self
                .files
                .list_with_delimiter(Some(&Key::from(kind)))
                .await
                .map_err(failed)?;
            let names = listed.common_prefixes.iter();
            ids.extend(names.filter_map(|key| key.filename()).map(str::to_owned));
        }
        Ok(ids)
    }

    async fn check(&self) -> Result<(), BlobError> {
        let key = Key::from_iter([STAGING, "writable"]);
        let payload = PutPayload::from(Bytes::from_static(b"yes"));
        self.files.put(&key, payload).await.map_err(failed)?;
        self.files.delete(&key).await.map_err(failed)
    }
}

fn failed(error: object_store::Error) -> BlobError {
    BlobError(error.to_string())
}
