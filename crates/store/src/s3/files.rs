//! The files of items in the bucket.

use super::bucket::{Bucket, Content, S3Location, says, text};
use super::shared::{PROBE_FILE, Shared, owner, publication};
use super::staged::StagedPublication;
use super::{ORPHAN_GRACE, S3Refusal};
use crate::blobs::{
    PROBE_BYTES, QUARANTINE_FOLDER, RECEIVED_FOLDER, RECORD_FILE, STAGING_FOLDER,
    is_of_shelf_before, shelf_name, shelf_path,
};
use crate::cache::{Found, LocalCache};
use crate::content::{self, Reading};
use crate::copied::Copied;
use crate::space::DiskGauge;
use async_trait::async_trait;
use bytes::Bytes;
use object_store::{Error, ObjectMeta};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use ventriform_service::base::records::{
    BlobError, BlobStore, BlobStream, Cutoff, DiskSpace, FileRecord, ItemRecord, LocalFile,
    Resource, Shelved, StagedFiles, StagedFor, StoreFault, Timestamp, random_id, volume_id,
};

/// The folder of local copies.
const CACHE_FOLDER: &str = "cache";

/// Longest time of a readiness check.
const CHECK_LIMIT: Duration = Duration::from_secs(4);

/// How long the start waits for a store that does not answer, and between two attempts.
const FIRST_REQUEST_TIMES: (Duration, Duration) = (Duration::from_secs(20), Duration::from_secs(1));

/// The outcome of a file that was sent.
enum Sent {
    /// The store has it.
    Whole(Content),
    /// It is not what was expected: how.
    Not(&'static str),
}

/// Files in a bucket.
pub struct S3Blobs {
    pub(super) shared: Arc<Shared>,
    pub(super) gauge: DiskGauge,
    folder: PathBuf,
    grace: Duration,
}

fn refusal(location: &S3Location, error: &Error) -> S3Refusal {
    let fix = if says(error, "NoSuchBucket") || matches!(error, Error::NotFound { .. }) {
        "Create the bucket, or correct `blobs` (or AWS_ENDPOINT_URL, or AWS_REGION)"
    } else if [
        "InvalidAccessKeyId",
        "SignatureDoesNotMatch",
        "InvalidToken",
        "ExpiredToken",
    ]
    .iter()
    .any(|word| says(error, word))
    {
        "Correct AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY"
    } else if matches!(
        error,
        Error::PermissionDenied { .. } | Error::Unauthenticated { .. }
    ) {
        "Allow these credentials s3:GetObject, s3:PutObject and s3:DeleteObject on the keys and \
         s3:ListBucket on the bucket"
    } else {
        "See whether the store runs, and whether AWS_ENDPOINT_URL, AWS_REGION and the credentials \
         are right"
    };
    S3Refusal {
        location: location.to_string(),
        reason: text(error),
        fix,
    }
}

/// Whether the store may answer otherwise in a while: it does not answer yet, or says 5xx.
fn may_pass(error: &Error) -> bool {
    matches!(error, Error::Generic { .. }) && !text(error).contains("status code: 4")
}

impl S3Blobs {
    /// Opens the bucket: writes, reads and lists in it. Waits a while for a store that does not
    /// answer. Staged files and at most `cache` bytes of copies lie in `folder`, on the disk of
    /// `gauge`; what an earlier process has staged is deleted.
    ///
    /// # Errors
    /// If the bucket cannot be used, or the folder cannot be written.
    pub async fn open(
        location: &S3Location,
        folder: &Path,
        gauge: DiskGauge,
        cache: u64,
    ) -> Result<Self, S3Refusal> {
        let unusable = |error: std::io::Error| S3Refusal {
            location: location.to_string(),
            reason: format!("{}: {error}", folder.display()),
            fix: "Give another `data_dir`",
        };
        let bucket = Bucket::new(location).map_err(|error| refusal(location, &error))?;
        let content = Bytes::from_static(PROBE_BYTES);
        let begun = tokio::time::Instant::now();
        loop {
            match bucket.probe(PROBE_FILE, content.clone()).await {
                Ok(_) => break,
                Err(error) if may_pass(&error) && begun.elapsed() < FIRST_REQUEST_TIMES.0 => {
                    tracing::warn!(error = text(&error), %location, "waiting for the S3 store");
                    tokio::time::sleep(FIRST_REQUEST_TIMES.1).await;
                }
                Err(error) => return Err(refusal(location, &error)),
            }
        }
        let staging = folder.join(STAGING_FOLDER);
        match fs::remove_dir_all(&staging) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(unusable(error));
            }
            _ => {}
        }
        fs::create_dir_all(&staging).map_err(unusable)?;
        let cache = LocalCache::open(&folder.join(CACHE_FOLDER), cache).map_err(unusable)?;
        Ok(Self {
            shared: Arc::new(Shared { bucket, cache }),
            gauge,
            folder: folder.to_owned(),
            grace: ORPHAN_GRACE,
        })
    }

    /// The same store, with another age after which a publication without a row was given up.
    #[must_use]
    pub fn with_grace(self, grace: Duration) -> Self {
        Self { grace, ..self }
    }

    /// Whether any item or received object has files.
    ///
    /// # Errors
    /// If the store fails.
    pub async fn has_items(&self) -> Result<bool, BlobError> {
        let shelves = Resource::WITH_FILES.map(Resource::plural);
        for shelf in shelves.into_iter().chain([RECEIVED_FOLDER]) {
            if self.shared.bucket.has_files(shelf).await? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// A new path under `staging/`.
    pub(super) fn new_staging_path(&self) -> PathBuf {
        self.folder.join(STAGING_FOLDER).join(random_id(""))
    }

    /// Place and path of a file of an item. Files that were stored in a folder have none.
    fn address(id: &str, file: &FileRecord) -> Option<(String, String)> {
        let place = file.place.as_deref()?;
        let path = format!("{}/{}", publication(id, place), file.name);
        Some((Shared::cached(id, place), path))
    }

    /// The length of a file of an item; `None` if it is missing or was stored in a folder.
    pub(crate) async fn size(&self, id: &str, file: &FileRecord) -> Result<Option<u64>, BlobError> {
        match Self::address(id, file) {
            Some((_, path)) => self.shared.bucket.size(&path).await,
            None => Ok(None),
        }
    }

    /// Whether the file of a received object is there.
    pub(crate) async fn has_received(&self, name: &str) -> Result<bool, BlobError> {
        let size = self
            .shared
            .bucket
            .size(&format!("{RECEIVED_FOLDER}/{name}"))
            .await?;
        Ok(size.is_some())
    }

    async fn copy(&self, id: &str, file: &FileRecord) -> Result<Option<Found>, BlobError> {
        let Some((place, path)) = Self::address(id, file) else {
            return Ok(None);
        };
        self.shared.copy(&place, file, &path).await
    }

    /// Takes in the files of an item, which lie in the folder `from`, at the place that `record` names. Each
    /// is hashed as it is sent and as the store gives it back; the record is written last.
    pub(crate) async fn take_in(
        &self,
        record: &ItemRecord,
        from: &Path,
    ) -> Result<Copied, BlobError> {
        let id = record.id();
        let place = record.files().into_iter().find_map(|file| file.place);
        let target = publication(id, &place.unwrap_or_default());
        let text = serde_json::to_vec_pretty(record)
            .map_err(|error| BlobError::new(StoreFault::Other, error.to_string()))?;
        let noted = format!("{target}/{RECORD_FILE}");
        if self.shared.bucket.read(&noted).await?.as_deref() == Some(&text) {
            return Ok(Copied::Before);
        }
        let mut found = Vec::new();
        for file in record.files() {
            let to = format!("{target}/{}", file.name);
            match self.send(&to, &from.join(&file.name), &file).await? {
                Sent::Whole(content) => found.push(FileRecord {
                    bytes: content.bytes,
                    sha256: content.sha256,
                    ..file
                }),
                Sent::Not(defect) => return Ok(Copied::Not(format!("{} {defect}", file.name))),
            }
        }
        if matches!(record, ItemRecord::Volume(_)) && volume_id(&found) != id {
            let defect = "the content is not what the id was made of";
            return Ok(Copied::Not(defect.into()));
        }
        self.shared.bucket.put(&noted, text.into()).await?;
        Ok(Copied::Now)
    }

    /// Takes in a received object.
    pub(crate) async fn take_in_received(
        &self,
        name: &str,
        sha256: &str,
        from: &Path,
    ) -> Result<Copied, BlobError> {
        let path = format!("{RECEIVED_FOLDER}/{name}");
        let there = self.shared.bucket.fetch(&path, None).await?;
        if there.is_some_and(|content| content.sha256 == sha256) {
            return Ok(Copied::Before);
        }
        let expected = FileRecord {
            name: name.to_owned(),
            bytes: fs::metadata(from).map_or(0, |file| file.len()),
            sha256: sha256.to_owned(),
            place: None,
        };
        Ok(match self.send(&path, from, &expected).await? {
            Sent::Whole(_) => Copied::Now,
            Sent::Not(defect) => Copied::Not(format!("it {defect}")),
        })
    }

    /// Sends one file and reads it back. What is not as expected is deleted again.
    async fn send(&self, to: &str, from: &Path, expected: &FileRecord) -> Result<Sent, BlobError> {
        if !from.exists() {
            return Ok(Sent::Not("is missing"));
        }
        let bucket = &self.shared.bucket;
        let content = bucket.put_file(to, from).await?;
        if (content.bytes, &content.sha256) != (expected.bytes, &expected.sha256) {
            bucket.delete([to.to_owned()]).await?;
            return Ok(Sent::Not("has another content than was stored"));
        }
        match bucket.fetch(to, None).await? {
            Some(back) if back == content => Ok(Sent::Whole(content)),
            _ => Err(content::damaged(to, "the store gives back another content")),
        }
    }

    /// Deletes the files of other items, and other received objects, than those in `kept`.
    pub(crate) async fn keep_only(&self, kept: &BTreeSet<String>) -> Result<(), BlobError> {
        for kind in Resource::WITH_FILES {
            for (id, places) in self.publications(kind).await? {
                if kept.contains(&id) {
                    continue;
                }
                for place in places {
                    self.shared.delete_publication(&id, &place).await?;
                }
            }
        }
        let received = self.shared.bucket.paths(RECEIVED_FOLDER).await?;
        let others = received.into_iter().filter(|path| {
            path.rsplit('/')
                .next()
                .is_none_or(|name| !kept.contains(name))
        });
        self.shared.bucket.delete(others).await
    }

    /// The places of every item of a kind.
    pub(crate) async fn publications(
        &self,
        kind: Resource,
    ) -> Result<BTreeMap<String, BTreeSet<String>>, BlobError> {
        let add = |items: &mut BTreeMap<String, BTreeSet<String>>, path: &str, _: &ObjectMeta| {
            if let Some((id, place)) = owner(path) {
                let places = items.entry(id.to_owned()).or_default();
                places.insert(place.to_owned());
            }
        };
        self.shared.bucket.each(kind.plural(), add).await
    }

    /// Moves a publication into the quarantine of the day.
    pub(super) async fn set_publication_aside(
        &self,
        id: &str,
        place: &str,
        shelf: &str,
    ) -> Result<(), BlobError> {
        for path in self.shared.bucket.paths(&publication(id, place)).await? {
            let to = format!("{QUARANTINE_FOLDER}/{shelf}/{path}");
            self.shared.bucket.shift(&path, &to).await?;
        }
        Ok(())
    }

    /// The publications of an item that were given up.
    async fn given_up(&self, id: &str) -> Result<Vec<String>, BlobError> {
        let places = self.shared.places(id).await?;
        if places.is_empty() {
            return Ok(Vec::new());
        }
        let limit = self.shared.before(self.grace).await?;
        let old = places.into_iter().filter(|(_, written)| *written <= limit);
        Ok(old.map(|(place, _)| place).collect())
    }
}

fn places_of(files: &[FileRecord]) -> BTreeSet<&str> {
    files.iter().filter_map(|f| f.place.as_deref()).collect()
}

#[async_trait]
impl BlobStore for S3Blobs {
    async fn stage(&self, _: StagedFor) -> Result<Box<dyn StagedFiles>, BlobError> {
        let folder = self.new_staging_path();
        tokio::fs::create_dir_all(&folder).await?;
        let shared = self.shared.clone();
        let staged = StagedPublication::new(shared, self.gauge.clone(), folder);
        Ok(Box::new(staged))
    }

    async fn read(
        &self,
        id: &str,
        file: &FileRecord,
        range: Range<u64>,
    ) -> Result<BlobStream, BlobError> {
        let path = format!("{}/{}", shelf_path(id), file.name);
        let Some(found) = self.copy(id, file).await? else {
            return Err(content::damaged(&path, "it is missing"));
        };
        let begun = tokio::task::spawn_blocking(move || {
            Reading::begin(found.file, found.stamp, path, range)
        });
        let begun = begun
            .await
            .map_err(|e| BlobError::new(StoreFault::Other, e.to_string()))?;
        Ok(content::stream(begun?))
    }

    async fn local(&self, id: &str, file: &FileRecord) -> Result<Option<LocalFile>, BlobError> {
        Ok(self.copy(id, file).await?.map(|found| found.local))
    }

    async fn delete(&self, id: &str, files: &[FileRecord]) -> Result<(), BlobError> {
        for place in places_of(files) {
            self.shared.delete_publication(id, place).await?;
        }
        for place in self.given_up(id).await? {
            self.shared.delete_publication(id, &place).await?;
        }
        let of_item = format!("/{}/", shelf_path(id));
        let add = |paths: &mut Vec<String>, path: &str, _: &ObjectMeta| {
            if path.contains(&of_item) {
                paths.push(path.to_owned());
            }
        };
        let aside = self.shared.bucket.each(QUARANTINE_FOLDER, add).await?;
        self.shared.bucket.delete(aside).await
    }

    async fn prune(&self, id: &str, files: &[FileRecord]) -> Result<(), BlobError> {
        let kept = places_of(files);
        for place in self.given_up(id).await? {
            if !kept.contains(place.as_str()) {
                tracing::info!(id, "a publication that no row names is deleted");
                self.shared.delete_publication(id, &place).await?;
            }
        }
        Ok(())
    }

    async fn ids(&self, kind: Resource) -> Result<Vec<Shelved>, BlobError> {
        let items = self.publications(kind).await?;
        // Another process may have erased what has a copy here.
        self.shared.cache.forget(|cached| {
            let Some((id, place)) = cached.split_once('.') else {
                return false;
            };
            let there = items.get(id).is_some_and(|places| places.contains(place));
            Resource::from_id(id) == Some(kind) && !there
        })?;
        let items = items.into_iter().map(|(id, places)| Shelved {
            id,
            places: places.len(),
        });
        Ok(items.collect())
    }

    fn copied(&self) -> BTreeSet<String> {
        let places = self.shared.cache.places();
        let ids = places.iter().filter_map(|cached| cached.split_once('.'));
        ids.map(|(id, _)| id.to_owned()).collect()
    }

    fn forget(&self, ids: &BTreeSet<String>) -> Result<(), BlobError> {
        let of_them = |cached: &str| {
            cached
                .split_once('.')
                .is_some_and(|(id, _)| ids.contains(id))
        };
        Ok(self.shared.cache.forget(of_them)?)
    }

    async fn set_aside(&self, id: &str, now: Timestamp) -> Result<bool, BlobError> {
        let given_up = self.given_up(id).await?;
        for place in &given_up {
            self.set_publication_aside(id, place, &shelf_name(now))
                .await?;
        }
        Ok(!given_up.is_empty())
    }

    async fn hash(&self, id: &str, file: &FileRecord) -> Result<FileRecord, BlobError> {
        let content = match Self::address(id, file) {
            Some((_, path)) => self.shared.bucket.fetch(&path, None).await?,
            None => None,
        };
        let content = content.ok_or_else(|| {
            let path = format!("{}/{}", shelf_path(id), file.name);
            content::damaged(&path, "it is missing")
        })?;
        Ok(FileRecord {
            name: file.name.clone(),
            bytes: content.bytes,
            sha256: content.sha256,
            place: file.place.clone(),
        })
    }

    async fn describe(&self, record: &ItemRecord) -> Result<(), BlobError> {
        let text = serde_json::to_vec_pretty(record)
            .map_err(|error| BlobError::new(StoreFault::Other, error.to_string()))?;
        for place in places_of(&record.files()) {
            let path = format!("{}/{RECORD_FILE}", publication(record.id(), place));
            self.shared
                .bucket
                .put_new(&path, text.clone().into())
                .await?;
        }
        Ok(())
    }

    async fn tidy(&self, set_aside_before: Option<Cutoff>) -> Result<(), BlobError> {
        let Some(first_kept) = set_aside_before.map(Cutoff::moment) else {
            return Ok(());
        };
        let old = |paths: &mut Vec<String>, path: &str, _: &ObjectMeta| {
            let shelf = path.split('/').nth(1).unwrap_or_default();
            if is_of_shelf_before(shelf, first_kept) {
                paths.push(path.to_owned());
            }
        };
        let old = self.shared.bucket.each(QUARANTINE_FOLDER, old).await?;
        self.shared.bucket.delete(old).await
    }

    async fn check(&self) -> Result<(), BlobError> {
        self.require_room(0)?;
        let content = Bytes::from_static(PROBE_BYTES);
        let probe = self.shared.bucket.probe(PROBE_FILE, content);
        match tokio::time::timeout(CHECK_LIMIT, probe).await {
            Ok(Ok(true)) => Ok(()),
            Ok(Ok(false)) => Err(BlobError::new(
                StoreFault::Away,
                "the S3 store gave back another content than it was given",
            )),
            Ok(Err(error)) => Err(self.shared.bucket.fault(PROBE_FILE, &error)),
            Err(_) => Err(BlobError::new(
                StoreFault::Away,
                "the S3 store did not answer in time",
            )),
        }
    }

    fn space(&self) -> Option<DiskSpace> {
        self.gauge.space()
    }
}
