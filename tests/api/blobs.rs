//! The queue on a file store that is not a folder: files are kept in memory and copied to the
//! disk only for work that reads them.

use crate::helpers::{fake_engine, volume};
use async_trait::async_trait;
use bytes::Bytes;
use futures::{StreamExt, TryStreamExt};
use serde_json::json;
use std::collections::BTreeMap;
use std::io;
use std::ops::Range;
use std::pin::Pin;
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncWrite, AsyncWriteExt};
use ventriform_service::base::records::{
    BlobError, BlobStore, BlobStream, BlobWriter, Catalogue, Cutoff, Erased, ErasureAgent,
    ErasureOrder, ErasureReason, FileRecord, Filed, ItemRecord, JobState, LocalFile, NewJob,
    Resource, Shelved, StagedFiles, StagedFor, StoredVolume, SystemClock, Tags, Tenant, Timestamp,
};
use ventriform_service::items::{Custodian, Items};
use ventriform_service::jobs::{Queue, QueueSettings, WorkerSettings, Workers};
use ventriform_store::Store;

/// Files of one item by name.
type ItemFiles = BTreeMap<String, Vec<u8>>;

type Files = Arc<Mutex<ItemFiles>>;

#[derive(Clone, Default)]
struct MemoryBlobs {
    items: Arc<Mutex<BTreeMap<String, ItemFiles>>>,
    /// Erases the item whose file is verified, as soon as it has been read.
    erasing: Arc<Mutex<Option<Arc<Items>>>>,
    /// The items that were described.
    described: Arc<Mutex<Vec<String>>>,
}

/// A copy in a temporary folder that is deleted with the last clone of the result.
fn copy_to_disk(name: &str, bytes: &[u8]) -> Result<LocalFile, BlobError> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join(name);
    std::fs::write(&path, bytes)?;
    Ok(LocalFile::copied(path, folder))
}

struct MemoryStaging {
    store: MemoryBlobs,
    files: Files,
}

struct MemoryWriter {
    name: String,
    content: Vec<u8>,
    files: Files,
}

impl AsyncWrite for MemoryWriter {
    fn poll_write(
        mut self: Pin<&mut Self>,
        _: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        self.content.extend_from_slice(bytes);
        Poll::Ready(Ok(bytes.len()))
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        let content = std::mem::take(&mut self.content);
        self.files
            .lock()
            .unwrap()
            .insert(self.name.clone(), content);
        Poll::Ready(Ok(()))
    }
}

#[async_trait]
impl StagedFiles for MemoryStaging {
    async fn create(&self, name: &str) -> Result<BlobWriter, BlobError> {
        Ok(Box::pin(MemoryWriter {
            name: name.to_owned(),
            content: Vec::new(),
            files: self.files.clone(),
        }))
    }

    async fn rename(&self, from: &str, to: &str) -> Result<(), BlobError> {
        let mut files = self.files.lock().unwrap();
        let content = files.remove(from).unwrap();
        files.insert(to.to_owned(), content);
        Ok(())
    }

    async fn local(&self, name: &str) -> Result<LocalFile, BlobError> {
        copy_to_disk(name, &self.files.lock().unwrap()[name])
    }

    async fn settle(&self, _: &str) -> Result<(), BlobError> {
        Ok(())
    }

    async fn publish(self: Box<Self>, record: &ItemRecord) -> Result<(), BlobError> {
        let files = std::mem::take(&mut *self.files.lock().unwrap());
        let mut items = self.store.items.lock().unwrap();
        items.insert(record.id().to_owned(), files);
        Ok(())
    }
}

#[async_trait]
impl BlobStore for MemoryBlobs {
    async fn stage(&self, _: StagedFor) -> Result<Box<dyn StagedFiles>, BlobError> {
        Ok(Box::new(MemoryStaging {
            store: self.clone(),
            files: Files::default(),
        }))
    }

    async fn read(
        &self,
        id: &str,
        file: &FileRecord,
        range: Range<u64>,
    ) -> Result<BlobStream, BlobError> {
        let items = self.items.lock().unwrap();
        let part = &items[id][&file.name][range.start as usize..range.end as usize];
        let chunk = Ok(Bytes::copy_from_slice(part));
        Ok(futures::stream::iter([chunk]).boxed())
    }

    async fn local(&self, id: &str, file: &FileRecord) -> Result<Option<LocalFile>, BlobError> {
        let items = self.items.lock().unwrap();
        let content = items.get(id).and_then(|files| files.get(&file.name));
        let copy = |bytes: &Vec<u8>| copy_to_disk(&file.name, bytes);
        content.map(copy).transpose()
    }

    async fn delete(&self, id: &str, _: &[FileRecord]) -> Result<(), BlobError> {
        self.items.lock().unwrap().remove(id);
        Ok(())
    }

    async fn ids(&self, kind: Resource) -> Result<Vec<Shelved>, BlobError> {
        let items = self.items.lock().unwrap();
        let of_kind = |id: &&String| Resource::from_id(id) == Some(kind);
        let ids = items.keys().filter(of_kind).cloned();
        Ok(ids.map(|id| Shelved { id, places: 1 }).collect())
    }

    async fn set_aside(&self, id: &str, _: Timestamp) -> Result<bool, BlobError> {
        Ok(self.items.lock().unwrap().remove(id).is_some())
    }

    async fn hash(&self, id: &str, file: &FileRecord) -> Result<FileRecord, BlobError> {
        let erasing = self.erasing.lock().unwrap().take();
        let items = erasing.expect("nobody verifies files but the test that erases meanwhile");
        let order = ErasureOrder {
            tenant: Tenant::default(),
            id: id.to_owned(),
            cascade: false,
            renewed_before: None,
            by: ErasureAgent::default(),
            reason: ErasureReason::Request,
        };
        assert!(matches!(items.erase(order).await, Ok(Erased::Done(_))));
        Ok(file.clone())
    }

    async fn describe(&self, record: &ItemRecord) -> Result<(), BlobError> {
        self.described.lock().unwrap().push(record.id().to_owned());
        Ok(())
    }

    async fn tidy(&self, _: Option<Cutoff>) -> Result<(), BlobError> {
        Ok(())
    }

    async fn check(&self) -> Result<(), BlobError> {
        Ok(())
    }
}

#[tokio::test]
async fn jobs_run_on_a_file_store_without_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let blobs = MemoryBlobs::default();
    let items = Items::new(
        store.rows.clone(),
        Arc::new(blobs.clone()),
        Arc::new(SystemClock),
        None,
    );
    let queue = Arc::new(Queue::new(
        store.rows.clone(),
        Arc::new(items),
        Arc::new(SystemClock),
        QueueSettings {
            limit: 10,
            workers: 1,
        },
    ));
    let staged = blobs.stage(StagedFor::Upload).await.unwrap();
    let mut writer = staged.create("0").await.unwrap();
    writer.write_all(&volume("sphere")).await.unwrap();
    writer.shutdown().await.unwrap();
    staged.rename("0", "volume.nii").await.unwrap();
    let record = StoredVolume {
        id: "vol_1".into(),
        sequence: 0,
        created_at: 0,
        bytes: 13,
        files: vec![FileRecord {
            name: "volume.nii".into(),
            bytes: 13,
            sha256: String::new(),
            place: None,
        }],
        facts: json!({}),
    };
    let (tenant, tags) = (Tenant::default(), Tags::default());
    let added = queue
        .items()
        .add_volume(record, staged, &tenant, &tags, None)
        .await;
    let (_, new) = added.unwrap();
    assert!(new);

    let engine = fake_engine();
    let settings = WorkerSettings {
        workers: 1,
        threads: 1,
        lease: Duration::from_secs(30),
        attempt_limit: 1,
        time_limit: Duration::from_secs(30),
    };
    let workers = Workers::start(&queue, &engine.works, settings).unwrap();
    let work = engine.work("model").unwrap();
    let job = NewJob {
        tenant: tenant.clone(),
        tags,
        kind: "model".into(),
        volume: Some("vol_1".into()),
        needs: BTreeMap::new(),
        parameters: work.parameters_from_text(&[]).unwrap(),
        idempotency: None,
        ..NewJob::default()
    };
    let Filed::New(job) = queue.file(&job).await.unwrap() else {
        panic!("the job was rejected");
    };
    let job = queue.wait(&job.id, Duration::from_secs(20)).await.unwrap();
    let job = job.unwrap();
    assert_eq!(job.state, JobState::Succeeded, "{:?}", job.failure);

    let model = store.rows.product(&tenant, &job.result.unwrap()).await;
    let model = model.unwrap().unwrap().item;
    let report = model.file("report.json").unwrap();
    let content = blobs
        .read(&model.id, &report.record(), 0..report.bytes)
        .await
        .unwrap();
    let content: Vec<Bytes> = content.try_collect().await.unwrap();
    assert_eq!(content.concat().len() as u64, report.bytes);

    let stored = queue
        .items()
        .with_files(model, work.page_files())
        .await
        .unwrap();
    assert!(work.page(&stored, &[]).unwrap().contains("<title>"));
    let path = stored.files[0].to_path_buf();
    assert!(path.exists());
    drop(stored);
    assert!(!path.exists(), "the copy is deleted after use");
    workers.stop(Duration::from_secs(5)).await;
}

/// An item that is erased while its files are verified is not described: the description would stay as a file
/// without an item.
#[tokio::test]
async fn what_is_erased_while_it_is_verified_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let blobs = MemoryBlobs::default();
    let clock = Arc::new(SystemClock);
    let items = Items::new(store.rows.clone(), Arc::new(blobs.clone()), clock, None);
    let items = Arc::new(items);
    let staged = blobs.stage(StagedFor::Upload).await.unwrap();
    let mut writer = staged.create("volume.nii").await.unwrap();
    writer.write_all(&volume("sphere")).await.unwrap();
    writer.shutdown().await.unwrap();
    let record = StoredVolume {
        id: "vol_1".into(),
        sequence: 0,
        created_at: 0,
        bytes: 13,
        files: vec![FileRecord {
            name: "volume.nii".into(),
            bytes: 13,
            sha256: "a".repeat(64),
            place: None,
        }],
        facts: json!({}),
    };
    let (tenant, tags) = (Tenant::default(), Tags::default());
    let added = items.add_volume(record, staged, &tenant, &tags, None).await;
    added.unwrap();
    *blobs.erasing.lock().unwrap() = Some(items.clone());
    let custodian = Custodian {
        items,
        quarantine_keep: None,
        scrub_rate: 1 << 20,
    };
    assert_eq!(custodian.scrub().await.unwrap(), 0);
    assert_eq!(*blobs.described.lock().unwrap(), Vec::<String>::new());
}
