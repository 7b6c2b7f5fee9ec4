//! Received objects in the bucket: `received/NAME`.

use super::files::S3Blobs;
use super::shared::Shared;
use crate::blobs::{QUARANTINE_FOLDER, RECEIVED_FOLDER, shelf_name};
use crate::received::Receiving;
use async_trait::async_trait;
use object_store::ObjectMeta;
use std::sync::Arc;
use std::time::Duration;
use ventriform_service::base::records::{
    BlobError, BlobWriter, FileRecord, LocalFile, Timestamp, TrustedNow,
};
use ventriform_service::network::intake::{IncomingFile, ReceivedFiles};

/// A file on its way to the bucket.
struct Incoming {
    file: Receiving,
    shared: Arc<Shared>,
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
        let path = format!("{RECEIVED_FOLDER}/{name}");
        self.shared.bucket.put_file(&path, &self.file.path).await?;
        Ok(())
    }
}

#[async_trait]
impl ReceivedFiles for S3Blobs {
    async fn begin(&self) -> Result<Box<dyn IncomingFile>, BlobError> {
        Ok(Box::new(Incoming {
            file: Receiving::begin(self.new_staging_path(), &self.gauge).await?,
            shared: self.shared.clone(),
        }))
    }

    async fn received(&self, name: &str, sha256: &str) -> Result<Option<LocalFile>, BlobError> {
        let path = format!("{RECEIVED_FOLDER}/{name}");
        let Some(bytes) = self.shared.bucket.size(&path).await? else {
            return Ok(None);
        };
        let file = FileRecord {
            name: name.to_owned(),
            bytes,
            sha256: sha256.to_owned(),
            place: None,
        };
        let place = format!("{RECEIVED_FOLDER}.{name}");
        let found = self.shared.copy(&place, &file, &path).await?;
        Ok(found.map(|found| found.local))
    }

    async fn discard(&self, names: &[String]) -> Result<(), BlobError> {
        let paths: Vec<_> = names
            .iter()
            .map(|n| format!("{RECEIVED_FOLDER}/{n}"))
            .collect();
        self.shared.bucket.delete(paths).await?;
        for name in names {
            let place = format!("{RECEIVED_FOLDER}.{name}");
            self.shared.cache.forget(|other| *other == place)?;
        }
        Ok(())
    }

    async fn kept(&self, age: Duration, _: TrustedNow) -> Result<Vec<String>, BlobError> {
        let first_kept = self.shared.before(age).await?;
        let old = |names: &mut Vec<String>, path: &str, facts: &ObjectMeta| {
            if facts.last_modified.timestamp_millis() <= first_kept {
                names.extend(path.rsplit('/').next().map(str::to_owned));
            }
        };
        self.shared.bucket.each(RECEIVED_FOLDER, old).await
    }

    async fn quarantine(&self, name: &str, now: Timestamp) -> Result<(), BlobError> {
        let from = format!("{RECEIVED_FOLDER}/{name}");
        let to = format!("{QUARANTINE_FOLDER}/{}/{from}", shelf_name(now));
        self.shared.bucket.shift(&from, &to).await
    }
}
