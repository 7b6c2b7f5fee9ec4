//! Files on their way to the bucket.

use super::bucket::Bucket;
use super::shared::{Shared, publication};
use crate::blobs::{RECORD_FILE, UploadFile};
use crate::content;
use crate::space::DiskGauge;
use async_trait::async_trait;
use futures::{StreamExt, TryStreamExt, stream};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use ventriform_service::base::records::{
    BlobError, BlobWriter, ItemRecord, LocalFile, StagedFiles, StoreFault, random_id,
};

/// Files of one publication that are sent at the same time.
const PARALLEL_COPIES: usize = 8;

/// The files of one publication, in a folder on the local disk.
pub(super) struct StagedPublication {
    shared: Arc<Shared>,
    gauge: DiskGauge,
    /// Deleted on drop.
    folder: PathBuf,
    place: String,
    /// The item that the files are sent for, and the SHA-256 of those that were sent, by name.
    sent: Mutex<Sent>,
}

#[derive(Default)]
struct Sent {
    id: Option<String>,
    hashes: BTreeMap<String, String>,
    published: bool,
}

impl StagedPublication {
    pub fn new(shared: Arc<Shared>, gauge: DiskGauge, folder: PathBuf) -> Self {
        Self {
            shared,
            gauge,
            folder,
            place: random_id(""),
            sent: Mutex::default(),
        }
    }

    fn sent(&self) -> std::sync::MutexGuard<'_, Sent> {
        self.sent.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sends the files that were not sent yet.
    async fn send(&self, id: &str) -> Result<(), BlobError> {
        let mut names = Vec::new();
        let mut entries = tokio::fs::read_dir(&self.folder).await?;
        while let Some(entry) = entries.next_entry().await? {
            names.extend(entry.file_name().into_string());
        }
        {
            let mut sent = self.sent();
            sent.id = Some(id.to_owned());
            names.retain(|name| !sent.hashes.contains_key(name));
        }
        let target = publication(id, &self.place);
        let bucket: &Bucket = &self.shared.bucket;
        let sending = names.into_iter().map(|name| {
            let (from, to) = (self.folder.join(&name), format!("{target}/{name}"));
            async move {
                let content = bucket.put_file(&to, &from).await?;
                Ok::<_, BlobError>((name, content.sha256))
            }
        });
        let sent: Vec<_> = stream::iter(sending)
            .buffer_unordered(PARALLEL_COPIES)
            .try_collect()
            .await?;
        self.sent().hashes.extend(sent);
        Ok(())
    }
}

impl Drop for StagedPublication {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
        let sent = self.sent.get_mut().unwrap_or_else(PoisonError::into_inner);
        let (Some(id), false) = (sent.id.take(), sent.published) else {
            return;
        };
        // What is not deleted now is found by the sweep.
        if let Ok(runtime) = tokio::runtime::Handle::try_current() {
            let (shared, place) = (self.shared.clone(), self.place.clone());
            runtime.spawn(async move {
                if let Err(error) = shared.delete_publication(&id, &place).await {
                    tracing::warn!(%error, "files that are not needed could not be deleted");
                }
            });
        }
    }
}

#[async_trait]
impl StagedFiles for StagedPublication {
    async fn create(&self, name: &str) -> Result<BlobWriter, BlobError> {
        let file = tokio::fs::File::create(self.folder.join(name)).await?;
        Ok(Box::pin(UploadFile::new(file, self.gauge.clone())))
    }

    async fn rename(&self, from: &str, to: &str) -> Result<(), BlobError> {
        tokio::fs::rename(self.folder.join(from), self.folder.join(to)).await?;
        Ok(())
    }

    async fn local(&self, name: &str) -> Result<LocalFile, BlobError> {
        Ok(LocalFile::in_place(self.folder.join(name)))
    }

    async fn settle(&self, id: &str) -> Result<(), BlobError> {
        self.send(id).await
    }

    fn place(&self) -> Option<&str> {
        Some(&self.place)
    }

    async fn publish(self: Box<Self>, record: &ItemRecord) -> Result<(), BlobError> {
        let id = record.id();
        self.send(id).await?;
        let hashes = std::mem::take(&mut self.sent().hashes);
        for file in record.files() {
            let sent = hashes.get(&file.name);
            if sent != Some(&file.sha256) {
                let path = format!("{id}/{}", file.name);
                return Err(content::damaged(&path, "it changed before it was stored"));
            }
        }
        let text = serde_json::to_vec_pretty(record)
            .map_err(|error| BlobError::new(StoreFault::Other, error.to_string()))?;
        let path = format!("{}/{RECORD_FILE}", publication(id, &self.place));
        self.shared.bucket.put(&path, text.into()).await?;
        self.sent().published = true;
        for file in record.files() {
            let from = self.folder.join(&file.name);
            let place = Shared::cached(id, &self.place);
            // Without the copy, the file is downloaded when it is read.
            let _ = self
                .shared
                .cache
                .put(&place, &file, &from, file.sha256.clone());
        }
        Ok(())
    }
}
