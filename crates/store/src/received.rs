//! The files of received objects: `received/NAME`, each written under `staging/`, forced to disk and
//! moved to its place.

use super::blobs::{FileBlobs, RECEIVED_FOLDER, UploadFile, is_absent, quarantine_shelf, sync};
use super::space::DiskGauge;
use async_trait::async_trait;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use ventriform_service::base::records::{
    BlobError, BlobWriter, LocalFile, Timestamp, TrustedNow, random_id,
};
use ventriform_service::limits::places::Places;
use ventriform_service::network::intake::{IncomingFile, ReceivedFiles};

/// A file on the local disk into which an object is received; deleted on drop.
pub(super) struct Receiving {
    pub path: PathBuf,
    pub writer: BlobWriter,
}

impl Receiving {
    /// A new file at `path`, on the disk of `gauge`.
    ///
    /// # Errors
    /// If there is no room, or the file cannot be made.
    pub async fn begin(path: PathBuf, gauge: &DiskGauge) -> Result<Self, BlobError> {
        if let Some(space) = gauge.space() {
            space.require_room(0)?;
        }
        let file = tokio::fs::File::create(&path).await?;
        let writer = Box::pin(UploadFile::new(file, gauge.clone()));
        Ok(Self { path, writer })
    }
}

impl Drop for Receiving {
    fn drop(&mut self) {
        // Fails after it was moved to its place.
        let _ = fs::remove_file(&self.path);
    }
}

/// A file under `staging/`.
struct Incoming {
    file: Receiving,
    root: PathBuf,
    syncs: Arc<Places>,
}

#[async_trait]
impl IncomingFile for Incoming {
    fn writer(&mut self) -> &mut BlobWriter {
        &mut self.file.writer
    }

    fn local(&self) -> LocalFile {
        LocalFile::in_place(&self.file.path)
    }

    async fn keep(self: Box<Self>, name: &str) -> Result<(), BlobError> {
        let place = self.root.join(RECEIVED_FOLDER).join(name);
        let syncs = self.syncs.clone();
        let _turn = syncs.take().await;
        let kept = tokio::task::spawn_blocking(move || {
            sync(&self.file.path)?;
            fs::rename(&self.file.path, &place)?;
            sync(&self.root.join(RECEIVED_FOLDER))
        });
        Ok(kept.await.map_err(io::Error::other)??)
    }
}

#[async_trait]
impl ReceivedFiles for FileBlobs {
    async fn begin(&self) -> Result<Box<dyn IncomingFile>, BlobError> {
        Ok(Box::new(Incoming {
            file: Receiving::begin(self.new_staging_folder(), &self.gauge).await?,
            root: self.folder.clone(),
            syncs: self.syncs.clone(),
        }))
    }

    async fn received(&self, name: &str, _sha256: &str) -> Result<Option<LocalFile>, BlobError> {
        let path = self.folder.join(RECEIVED_FOLDER).join(name);
        let there = tokio::fs::try_exists(&path).await?;
        Ok(there.then(|| LocalFile::in_place(path)))
    }

    async fn discard(&self, names: &[String]) -> Result<(), BlobError> {
        for name in names {
            match tokio::fs::remove_file(self.folder.join(RECEIVED_FOLDER).join(name)).await {
                Err(error) if !is_absent(&error) => return Err(error.into()),
                _ => {}
            }
        }
        Ok(())
    }

    async fn kept(&self, age: Duration, _: TrustedNow) -> Result<Vec<String>, BlobError> {
        let folder = self.folder.join(RECEIVED_FOLDER);
        let listed = tokio::task::spawn_blocking(move || {
            let mut names = Vec::new();
            for entry in fs::read_dir(folder)? {
                let entry = entry?;
                let written = match entry.metadata() {
                    Ok(file) => file.modified()?,
                    Err(error) if is_absent(&error) => continue,
                    Err(error) => return Err(error),
                };
                // A time in the future counts as now.
                if written.elapsed().unwrap_or_default() >= age {
                    names.extend(entry.file_name().into_string());
                }
            }
            Ok(names)
        });
        Ok(listed.await.map_err(io::Error::other)??)
    }

    async fn quarantine(&self, name: &str, now: Timestamp) -> Result<(), BlobError> {
        let (root, name) = (self.folder.clone(), name.to_owned());
        let moved = tokio::task::spawn_blocking(move || set_aside(&root, &name, now));
        Ok(moved.await.map_err(io::Error::other)??)
    }
}

/// Moves a received file into a folder of its own in the quarantine of the day.
pub(super) fn set_aside(root: &Path, name: &str, now: Timestamp) -> io::Result<()> {
    let place = quarantine_shelf(root, now)?.join(random_id("received."));
    fs::create_dir(&place)?;
    match fs::rename(root.join(RECEIVED_FOLDER).join(name), place.join(name)) {
        Err(error) if is_absent(&error) => fs::remove_dir(&place),
        other => {
            other?;
            sync(&place)
        }
    }
}
