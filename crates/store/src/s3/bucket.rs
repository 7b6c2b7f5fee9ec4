//! Requests to an S3 store: tried again within bounds, hashed on the way.
//!
//! - A request that fails for a reason that may pass (no answer, 5xx, a body cut off) is sent again,
//!   with growing pauses of random length, for a limited time. Every request is idempotent: keys are
//!   never written with two different contents, except that of the readiness check.
//! - Great files are sent and fetched in parts. A part that fails is sent or fetched again by itself.
//! - The store verifies what it gets by a SHA-256 in each request's head.

use bytes::Bytes;
use futures::stream::{self, FuturesUnordered};
use futures::{StreamExt, TryStreamExt};
use object_store::aws::{AmazonS3, AmazonS3Builder, AmazonS3ConfigKey, Checksum};
use object_store::multipart::MultipartStore;
use object_store::path::Path as Key;
use object_store::{
    ClientOptions, Error, GetOptions, GetRange, MultipartId, ObjectMeta, ObjectStore,
    ObjectStoreExt, PutMode, PutPayload, RetryConfig,
};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt;
use std::hash::{BuildHasher, RandomState};
use std::path::Path;
use std::time::Duration;
use tokio::fs::File;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::sync::Semaphore;
use tokio::time::Instant;
use ventriform_service::base::records::{BlobError, StoreFault, hex};

/// Bytes of one part.
const PART_BYTES: usize = 8 << 20;

/// Greatest file that is sent by one request: most scans are. Parts cost two requests more.
const WHOLE_FILE_BYTES: usize = 16 << 20;

/// Bytes of parts that are sent or fetched at the same time, in [`MEMORY_UNIT_BYTES`]s: they are held in memory.
const MEMORY_UNITS: u32 = 48;

/// Bytes that one permit of [`Bucket::memory`] stands for.
const MEMORY_UNIT_BYTES: usize = 1 << 20;

/// Parts of one file that are sent or fetched at the same time.
const PARALLEL_PARTS: usize = 2;

/// Longest time of one request.
const REQUEST_LIMIT: Duration = Duration::from_secs(60);

/// Longest time for a connection.
const CONNECT_LIMIT: Duration = Duration::from_secs(5);

/// First and longest pause before a request is sent again.
const RETRY_PAUSES: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(3));

/// After that time, a request that failed is not sent again.
const RETRY_TIME: Duration = Duration::from_secs(10);

/// Where the files are, and the variables of the environment that say how to get there.
#[derive(Clone, PartialEq, Eq)]
pub struct S3Location {
    /// The bucket.
    pub bucket: String,
    /// The beginning of the keys of all files; empty for the whole bucket.
    pub prefix: String,
    /// Names and values of variables as the AWS tools read them: `AWS_ACCESS_KEY_ID` ...
    pub variables: Vec<(String, String)>,
}

impl fmt::Display for S3Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "s3://{}", self.bucket)?;
        if !self.prefix.is_empty() {
            write!(f, "/{}", self.prefix)?;
        }
        Ok(())
    }
}

impl fmt::Debug for S3Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The variables are secret.
        fmt::Display::fmt(self, f)
    }
}

/// A part of a bucket.
pub(super) struct Bucket {
    store: AmazonS3,
    prefix: String,
    name: String,
    memory: Semaphore,
}

/// Length and SHA-256 of a content.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Content {
    pub bytes: u64,
    pub sha256: String,
}

/// An error that the same request would meet again.
fn is_final(error: &Error) -> bool {
    matches!(
        error,
        Error::NotFound { .. }
            | Error::AlreadyExists { .. }
            | Error::Precondition { .. }
            | Error::PermissionDenied { .. }
            | Error::Unauthenticated { .. }
            | Error::NotImplemented { .. }
            | Error::NotSupported { .. }
            | Error::InvalidPath { .. }
    )
}

/// Whether the file is not there. A bucket that is not there is another error.
fn is_missing(error: &Error) -> bool {
    matches!(error, Error::NotFound { .. }) && !is_about_bucket(error)
}

fn is_about_bucket(error: &Error) -> bool {
    says(error, "NoSuchBucket")
}

/// Whether the store's answer contains that word.
pub(super) fn says(error: &Error, word: &str) -> bool {
    format!("{error:?}").contains(word)
}

/// A pause of random length around `pause`.
fn about(pause: Duration) -> Duration {
    let random = RandomState::new().hash_one(0) % 1000;
    pause.mul_f64(0.5 + random as f64 / 1000.0)
}

impl Bucket {
    /// The client for a location.
    ///
    /// # Errors
    /// If a variable cannot be understood.
    pub fn new(location: &S3Location) -> Result<Self, Error> {
        let mut builder = AmazonS3Builder::new();
        for (name, value) in &location.variables {
            if let Ok(key) = name.to_ascii_lowercase().parse::<AmazonS3ConfigKey>() {
                builder = builder.with_config(key, value);
            }
        }
        let insecure = location
            .variables
            .iter()
            .any(|(name, url)| name.starts_with("AWS_ENDPOINT_URL") && url.starts_with("http:"));
        let client = ClientOptions::new()
            .with_timeout(REQUEST_LIMIT)
            .with_connect_timeout(CONNECT_LIMIT)
            .with_allow_http(insecure);
        let once = RetryConfig {
            max_retries: 0,
            ..RetryConfig::default()
        };
        let store = builder
            .with_bucket_name(&location.bucket)
            .with_client_options(client)
            .with_checksum_algorithm(Checksum::SHA256)
            .with_retry(once)
            .build()?;
        Ok(Self {
            store,
            prefix: location.prefix.clone(),
            name: location.to_string(),
            memory: Semaphore::new(MEMORY_UNITS as usize),
        })
    }

    /// Bucket and prefix, as the settings name them.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The key of a path below the prefix.
    fn key(&self, path: &str) -> Key {
        match self.prefix.as_str() {
            "" => Key::from(path),
            prefix => Key::from(format!("{prefix}/{path}")),
        }
    }

    /// The path below the prefix of a key.
    fn path<'a>(&self, key: &'a Key) -> &'a str {
        let key = key.as_ref();
        let below = key.strip_prefix(self.prefix.as_str()).unwrap_or(key);
        below.trim_start_matches('/')
    }

    /// The error as the queue knows it.
    pub fn fault(&self, path: &str, error: &Error) -> BlobError {
        BlobError::new(
            StoreFault::Away,
            format!("{}/{path}: {}", self.name, text(error)),
        )
    }

    /// Does something until it succeeds, or fails for good, or too much time has passed.
    async fn insist<T, F: Future<Output = Result<T, Error>>>(
        &self,
        request: impl Fn() -> F,
    ) -> Result<T, Error> {
        let begun = Instant::now();
        let mut pause = RETRY_PAUSES.0;
        loop {
            match request().await {
                Err(error) if !is_final(&error) && begun.elapsed() < RETRY_TIME => {
                    tracing::warn!(
                        error = text(&error),
                        "a request to the S3 store is sent again"
                    );
                    tokio::time::sleep(about(pause)).await;
                    pause = (2 * pause).min(RETRY_PAUSES.1);
                }
                ended => return ended,
            }
        }
    }

    /// Waits until that many bytes more may be held in memory.
    async fn room(&self, bytes: usize) -> tokio::sync::SemaphorePermit<'_> {
        let units = u32::try_from(bytes.div_ceil(MEMORY_UNIT_BYTES)).unwrap_or(MEMORY_UNITS);
        let room = self.memory.acquire_many(units.clamp(1, MEMORY_UNITS)).await;
        room.expect("the semaphore is never closed")
    }

    /// Writes a small file.
    pub async fn put(&self, path: &str, content: Bytes) -> Result<(), BlobError> {
        let key = self.key(path);
        let put = self.insist(|| self.store.put(&key, content.clone().into()));
        put.await.map_err(|error| self.fault(path, &error))?;
        Ok(())
    }

    /// Writes a small file, unless there is one.
    pub async fn put_new(&self, path: &str, content: Bytes) -> Result<(), BlobError> {
        let key = self.key(path);
        let put = self.insist(|| {
            let payload = PutPayload::from(content.clone());
            self.store.put_opts(&key, payload, PutMode::Create.into())
        });
        match put.await {
            Ok(_) | Err(Error::AlreadyExists { .. }) => Ok(()),
            Err(error) => Err(self.fault(path, &error)),
        }
    }

    /// Writes a file with the content of one on the local disk.
    pub async fn put_file(&self, path: &str, from: &Path) -> Result<Content, BlobError> {
        let key = self.key(path);
        let mut file = File::open(from).await?;
        let length = file.metadata().await?.len();
        if length <= WHOLE_FILE_BYTES as u64 {
            let _room = self.room(length as usize).await;
            let part = read_part(&mut file, WHOLE_FILE_BYTES).await?;
            let content = Content {
                bytes: part.len() as u64,
                sha256: hex(&Sha256::digest(&part)),
            };
            self.put(path, part).await?;
            return Ok(content);
        }
        let begun = self.insist(|| self.store.create_multipart(&key)).await;
        let upload = begun.map_err(|error| self.fault(path, &error))?;
        match self.put_parts(&key, &upload, &mut file).await {
            Ok(content) => Ok(content),
            Err(error) => {
                // What cannot be ended now is ended by a rule of the bucket.
                let _ = self.store.abort_multipart(&key, &upload).await;
                Err(match error {
                    PartError::Disk(error) => error.into(),
                    PartError::Store(error) => self.fault(path, &error),
                })
            }
        }
    }

    async fn put_parts(
        &self,
        key: &Key,
        upload: &MultipartId,
        file: &mut File,
    ) -> Result<Content, PartError> {
        let mut hash = Sha256::new();
        let (mut bytes, mut number) = (0, 0);
        let mut sent = FuturesUnordered::new();
        let mut ids = BTreeMap::new();
        loop {
            // The parts under way go on while the next one waits for room, which they may hold.
            let room = loop {
                tokio::select! {
                    Some(done) = sent.next() => ids.extend([done?]),
                    room = self.room(PART_BYTES), if sent.len() < PARALLEL_PARTS => break room,
                }
            };
            let part = read_part(file, PART_BYTES).await?;
            if part.is_empty() {
                break;
            }
            hash.update(&part);
            bytes += part.len() as u64;
            sent.push(async move {
                let put = || {
                    self.store
                        .put_part(key, upload, number, part.clone().into())
                };
                let done = self.insist(put).await;
                drop(room);
                Ok::<_, Error>((number, done?))
            });
            number += 1;
        }
        while let Some(done) = sent.try_next().await? {
            ids.extend([done]);
        }
        let ids: Vec<_> = ids.into_values().collect();
        let complete = || self.store.complete_multipart(key, upload, ids.clone());
        if let Err(error) = self.insist(complete).await {
            // It may have been done, and the answer lost: nobody else writes to this key.
            match self.store.head(key).await {
                Ok(found) if found.size == bytes => {}
                _ => return Err(error.into()),
            }
        }
        Ok(Content {
            bytes,
            sha256: hex(&hash.finalize()),
        })
    }

    /// Fetches a file, and writes it to the local disk if a file for it is given. `None` if there is
    /// none.
    pub async fn fetch(
        &self,
        path: &str,
        mut to: Option<&mut File>,
    ) -> Result<Option<Content>, BlobError> {
        let key = self.key(path);
        let mut hash = Sha256::new();
        let first = {
            let _room = self.room(PART_BYTES).await;
            match self.insist(|| self.first_part(&key)).await {
                Err(error) if is_missing(&error) => return Ok(None),
                Err(error) => return Err(self.fault(path, &error)),
                Ok((part, size)) => {
                    hash.update(&part);
                    if let Some(file) = &mut to {
                        file.write_all(&part).await?;
                    }
                    size
                }
            }
        };
        let starts = (PART_BYTES as u64..first).step_by(PART_BYTES);
        let fetched = starts.map(|start| {
            let range = start..first.min(start + PART_BYTES as u64);
            let key = &key;
            async move {
                let room = self.room(PART_BYTES).await;
                let part = self.insist(|| self.store.get_range(key, range.clone()));
                Ok::<_, Error>((part.await?, room))
            }
        });
        let mut fetched = stream::iter(fetched).buffered(PARALLEL_PARTS);
        while let Some(part) = fetched.next().await {
            let (part, _room) = part.map_err(|error| self.fault(path, &error))?;
            hash.update(&part);
            if let Some(file) = &mut to {
                file.write_all(&part).await?;
            }
        }
        if let Some(file) = to {
            file.flush().await?;
        }
        Ok(Some(Content {
            bytes: first,
            sha256: hex(&hash.finalize()),
        }))
    }

    /// The content of a small file; `None` if there is none.
    pub async fn read(&self, path: &str) -> Result<Option<Bytes>, BlobError> {
        let key = self.key(path);
        let read = self.insist(|| async { self.store.get(&key).await?.bytes().await });
        match read.await {
            Ok(content) => Ok(Some(content)),
            Err(error) if is_missing(&error) => Ok(None),
            Err(error) => Err(self.fault(path, &error)),
        }
    }

    /// The first part of a file, and the length of all of it.
    async fn first_part(&self, key: &Key) -> Result<(Bytes, u64), Error> {
        let options = GetOptions {
            range: Some(GetRange::Bounded(0..PART_BYTES as u64)),
            ..GetOptions::default()
        };
        match self.store.get_opts(key, options).await {
            Ok(found) => {
                let size = found.meta.size;
                Ok((found.bytes().await?, size))
            }
            // An empty file has no range.
            Err(error) if says(&error, "InvalidRange") || says(&error, "416") => {
                match self.store.head(key).await?.size {
                    0 => Ok((Bytes::new(), 0)),
                    _ => Err(error),
                }
            }
            Err(error) => Err(error),
        }
    }

    /// Goes over every file in a folder: `take` gets the path and the facts of each, and what came of
    /// those before. Begins anew if the list breaks off.
    pub async fn each<T: Default>(
        &self,
        folder: &str,
        take: impl Fn(&mut T, &str, &ObjectMeta) + Sync,
    ) -> Result<T, BlobError> {
        let prefix = self.key(folder);
        let all = self.insist(|| async {
            let mut all = T::default();
            let mut listed = self.store.list(Some(&prefix));
            while let Some(found) = listed.try_next().await? {
                take(&mut all, self.path(&found.location), &found);
            }
            Ok(all)
        });
        all.await.map_err(|error| self.fault(folder, &error))
    }

    /// Whether a folder has a file.
    pub async fn has_files(&self, folder: &str) -> Result<bool, BlobError> {
        let prefix = self.key(folder);
        let first = self.insist(|| async {
            let mut listed = self.store.list(Some(&prefix));
            Ok(listed.try_next().await?.is_some())
        });
        first.await.map_err(|error| self.fault(folder, &error))
    }

    /// The paths of every file in a folder.
    pub async fn paths(&self, folder: &str) -> Result<Vec<String>, BlobError> {
        let add = |paths: &mut Vec<String>, path: &str, _: &ObjectMeta| paths.push(path.to_owned());
        self.each(folder, add).await
    }

    /// The length of a file; `None` if there is none.
    pub async fn size(&self, path: &str) -> Result<Option<u64>, BlobError> {
        let key = self.key(path);
        match self.insist(|| self.store.head(&key)).await {
            Ok(found) => Ok(Some(found.size)),
            Err(error) if is_missing(&error) => Ok(None),
            Err(error) => Err(self.fault(path, &error)),
        }
    }

    /// Deletes files; those that do not exist are none.
    pub async fn delete(&self, paths: impl IntoIterator<Item = String>) -> Result<(), BlobError> {
        for path in paths {
            let key = self.key(&path);
            match self.insist(|| self.store.delete(&key)).await {
                Err(error) if !is_missing(&error) => return Err(self.fault(&path, &error)),
                _ => {}
            }
        }
        Ok(())
    }

    /// Moves a file: copies it, then deletes it.
    pub async fn shift(&self, from: &str, to: &str) -> Result<(), BlobError> {
        let keys = (self.key(from), self.key(to));
        match self.insist(|| self.store.copy(&keys.0, &keys.1)).await {
            Err(error) if is_missing(&error) => return Ok(()),
            Err(error) => return Err(self.fault(from, &error)),
            Ok(()) => {}
        }
        self.delete([from.to_owned()]).await
    }

    /// Writes and reads a small file once, and lists one. For the start, which explains errors.
    ///
    /// # Errors
    /// As the store gives them.
    pub async fn probe(&self, path: &str, content: Bytes) -> Result<bool, Error> {
        let key = self.key(path);
        // First, since some stores make the bucket that a file is put into.
        self.store.list(Some(&key)).next().await.transpose()?;
        self.store.put(&key, content.clone().into()).await?;
        let read = self.store.get(&key).await?.bytes().await?;
        Ok(read == content)
    }

    /// The store's time, milliseconds since 1970: when it wrote a small file just now.
    pub async fn now(&self, path: &str, content: Bytes) -> Result<i64, BlobError> {
        self.put(path, content).await?;
        let key = self.key(path);
        let facts = self.insist(|| self.store.head(&key)).await;
        let facts = facts.map_err(|error| self.fault(path, &error))?;
        // A head states whole seconds, a list may state parts of them.
        Ok(facts.last_modified.timestamp_millis() + 999)
    }
}

/// An error and its causes in one line.
pub(super) fn text(error: &Error) -> String {
    let mut text = error.to_string();
    let mut cause = std::error::Error::source(error);
    while let Some(why) = cause {
        let why_text = why.to_string();
        if !text.contains(&why_text) {
            text = format!("{text}: {why_text}");
        }
        cause = why.source();
    }
    text
}

/// Why a part could not be sent.
#[derive(Debug, thiserror::Error)]
enum PartError {
    #[error(transparent)]
    Disk(#[from] std::io::Error),
    #[error(transparent)]
    Store(#[from] Error),
}

/// The next bytes of a file; fewer than `limit` at its end.
async fn read_part(file: &mut File, limit: usize) -> std::io::Result<Bytes> {
    let mut part = Vec::new();
    file.take(limit as u64).read_to_end(&mut part).await?;
    Ok(part.into())
}
