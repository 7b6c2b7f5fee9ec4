//! The note about the database in the bucket.

use super::files::S3Blobs;
use super::shared::Shared;
use crate::note::{NOTE_FILE, NotePlace};
use async_trait::async_trait;
use std::sync::Arc;
use ventriform_service::base::records::BlobError;

/// The object in the bucket that keeps what the database must not lose.
struct BucketNote(Arc<Shared>);

#[async_trait]
impl NotePlace for BucketNote {
    fn place(&self) -> String {
        self.0.bucket.name().to_owned()
    }

    async fn read_note(&self) -> Result<Option<Vec<u8>>, BlobError> {
        let text = self.0.bucket.read(NOTE_FILE).await?;
        Ok(text.map(Into::into))
    }

    async fn write_note(&self, text: Vec<u8>) -> Result<(), BlobError> {
        self.0.bucket.put(NOTE_FILE, text.into()).await
    }
}

impl S3Blobs {
    /// The note about the database that names these files.
    pub(crate) fn note(&self) -> Arc<dyn NotePlace> {
        Arc::new(BucketNote(self.shared.clone()))
    }
}
