//! The bucket with its local copies, and the paths in it.

use super::bucket::Bucket;
use crate::blobs::{PROBE_BYTES, shelf_path};
use crate::cache::{Found, LocalCache};
use bytes::Bytes;
use object_store::ObjectMeta;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Duration;
use ventriform_service::base::records::{BlobError, FileRecord, StoreFault, Timestamp};

/// The content that checks write.
pub(super) const PROBE_FILE: &str = "ready";

/// The bucket and its local copies.
pub(super) struct Shared {
    pub bucket: Bucket,
    pub cache: LocalCache,
}

/// The path of a publication of an item.
pub(super) fn publication(id: &str, place: &str) -> String {
    format!("{}/{place}", shelf_path(id))
}

/// Id and place that a path of a file names: `volumes/ID/PLACE/NAME`.
pub(super) fn owner(path: &str) -> Option<(&str, &str)> {
    let mut parts = path.split('/').skip(1);
    let (id, place) = (parts.next()?, parts.next()?);
    parts.next().map(|_| (id, place))
}

/// The places of an item, and when the last file of each was written.
pub(super) type Places = BTreeMap<String, Timestamp>;

impl Shared {
    /// The name of a publication's folder in the cache.
    pub fn cached(id: &str, place: &str) -> String {
        format!("{id}.{place}")
    }

    /// The local copy of the file at `path` in the bucket. A damaged download is repeated once.
    pub async fn copy(
        &self,
        place: &str,
        file: &FileRecord,
        path: &str,
    ) -> Result<Option<Found>, BlobError> {
        match self
            .cache
            .get(place, file, |to| self.download(path, to))
            .await
        {
            Err(error) if error.cause == StoreFault::DamagedFile => {
                let again = self.cache.get(place, file, |to| self.download(path, to));
                again.await
            }
            other => other,
        }
    }

    async fn download(&self, path: &str, to: PathBuf) -> Result<Option<(u64, String)>, BlobError> {
        let mut draft = tokio::fs::File::create(to).await?;
        let content = self.bucket.fetch(path, Some(&mut draft)).await?;
        Ok(content.map(|content| (content.bytes, content.sha256)))
    }

    /// The time `age` ago by the store's clock.
    pub async fn before(&self, age: Duration) -> Result<Timestamp, BlobError> {
        let now = self
            .bucket
            .now(PROBE_FILE, Bytes::from_static(PROBE_BYTES))
            .await?;
        let age = Timestamp::try_from(age.as_millis()).unwrap_or(Timestamp::MAX);
        Ok(now.saturating_sub(age))
    }

    /// Deletes one publication and its local copies.
    pub async fn delete_publication(&self, id: &str, place: &str) -> Result<(), BlobError> {
        let paths = self.bucket.paths(&publication(id, place)).await?;
        self.bucket.delete(paths).await?;
        let cached = Self::cached(id, place);
        Ok(self.cache.forget(|other| *other == cached)?)
    }

    /// The places of an item.
    pub async fn places(&self, id: &str) -> Result<Places, BlobError> {
        let add = |places: &mut Places, path: &str, facts: &ObjectMeta| {
            let Some((_, place)) = owner(path) else {
                return;
            };
            let written = facts.last_modified.timestamp_millis();
            let last = places.entry(place.to_owned()).or_insert(written);
            *last = written.max(*last);
        };
        self.bucket.each(&shelf_path(id), add).await
    }
}
