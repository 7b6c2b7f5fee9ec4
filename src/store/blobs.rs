//! Files in folders: one folder per id, moved into sight whole.
//!
//! Everything of an id is written into a folder under `staging/`, forced to the disk, and
//! then renamed to its place; a rename happens entirely or not at all. Reading, listing and
//! erasing go through `object_store`, as they would for S3.

use crate::jobs::{BlobError, BlobStore, BlobStream, Resource, Staged, random_id};
use async_trait::async_trait;
use bytes::Bytes;
use futures::{StreamExt, TryStreamExt};
use object_store::local::LocalFileSystem;
use object_store::path::Path as Key;
use object_store::{GetOptions, GetRange, ObjectStore, ObjectStoreExt, PutPayload};
use std::fs::File;
use std::io::ErrorKind;
use std::ops::Range;
use std::path::{Path, PathBuf};

const STAGING: &str = "staging";

/// Files below one folder.
pub struct FileBlobs {
    folder: PathBuf,
    files: LocalFileSystem,
}

impl FileBlobs {
    /// Makes the folders where needed, and erases what an earlier process left in staging.
    ///
    /// # Errors
    /// If the folder cannot be written.
    pub fn open(folder: &Path) -> std::io::Result<Self> {
        match std::fs::remove_dir_all(folder.join(STAGING)) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        let shelves = Resource::SHELVED.map(Resource::plural);
        for name in shelves.into_iter().chain([STAGING]) {
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
        self.folder.join(shelf(id)).join(id)
    }
}

fn shelf(id: &str) -> &'static str {
    Resource::of(id).unwrap_or(Resource::Volume).plural()
}

/// Forces a folder's entries, or a file's content, to the disk.
fn sync(path: &Path) -> std::io::Result<()> {
    File::open(path)?.sync_all()
}

fn publish_blocking(staged: &Staged, place: &Path) -> std::io::Result<()> {
    for entry in std::fs::read_dir(staged.folder())? {
        sync(&entry?.path())?;
    }
    sync(staged.folder())?;
    match std::fs::rename(staged.folder(), place) {
        // The same content is there already, whole.
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

#[async_trait]
impl BlobStore for FileBlobs {
    async fn stage(&self) -> Result<Staged, BlobError> {
        let folder = self.folder.join(STAGING).join(random_id(""));
        tokio::fs::create_dir(&folder).await?;
        Ok(Staged::new(folder))
    }

    async fn publish(&self, id: &str, staged: Staged) -> Result<(), BlobError> {
        let place = self.place(id);
        tokio::task::spawn_blocking(move || publish_blocking(&staged, &place))
            .await
            .map_err(|e| BlobError(e.to_string()))??;
        Ok(())
    }

    async fn read(&self, id: &str, name: &str, range: Range<u64>) -> Result<BlobStream, BlobError> {
        let key = Key::from_iter([shelf(id), id, name]);
        if range.is_empty() {
            return Ok(futures::stream::empty().boxed());
        }
        let options = GetOptions {
            range: Some(GetRange::Bounded(range)),
            ..GetOptions::default()
        };
        let found = self.files.get_opts(&key, options).await.map_err(failed)?;
        Ok(found.into_stream().map_err(failed).boxed())
    }

    fn paths(&self, id: &str, names: &[String]) -> Vec<PathBuf> {
        let place = self.place(id);
        names.iter().map(|name| place.join(name)).collect()
    }

    async fn delete(&self, id: &str) -> Result<(), BlobError> {
        // A rename first: what is half erased must not be seen as whole.
        let grave = self.folder.join(STAGING).join(random_id(""));
        match tokio::fs::rename(self.place(id), &grave).await {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
            other => other?,
        }
        tokio::fs::remove_dir_all(&grave).await?;
        Ok(())
    }

    async fn ids(&self) -> Result<Vec<String>, BlobError> {
        let mut ids = Vec::new();
        for shelf in Resource::SHELVED.map(Resource::plural) {
            let listed = self
                .files
                .list_with_delimiter(Some(&Key::from(shelf)))
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
