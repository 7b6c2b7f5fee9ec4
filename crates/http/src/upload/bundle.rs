//! The received files of one volume, before they are published.

use crate::app::App;
use crate::guard::Counting;
use crate::memory::{HeldMemory, MemoryBudget};
use crate::problem::{Answer, Problem, body};
use crate::scans;
use axum::body::Bytes;
use futures::{Stream, StreamExt};
use sha2::{Digest, Sha256};
use std::sync::Arc;
use tokio::io::AsyncWriteExt;
use ventriform::progress::Monitor;
use ventriform_service::items::Pin;
use ventriform_service::records::{
    BlobError, BlobStore, BlobWriter, Failure, FileRecord, Held, StagedFiles, StagedFor,
    StoredVolume, Tags, Tenant, hex, volume_id,
};
use ventriform_service::work::INSPECTION_MEMORY;

/// Bytes gathered for one write: at most, for the first one, and where the client has no memory left.
/// Up to the first write an upload lies in memory alone: clients that send a few bytes and then wait cost neither
/// files nor turns of the disk.
const WRITE_BYTES: usize = 1 << 20;
const FIRST_WRITE: usize = 64 << 10;
const LEAST_WRITE: usize = 8 << 10;

/// Memory for a gathered byte: it lies here, and once more in the file's writer.
const MEMORY_PER_BYTE: u64 = 2;

/// The files of one volume, which are not published yet.
pub struct Bundle {
    blobs: Arc<dyn BlobStore>,
    memory: MemoryBudget,
    counting: Counting,
    /// Where the files lie; made for the first of them.
    staged: Option<Box<dyn StagedFiles>>,
    files: Vec<Received>,
}

/// A stored volume, which is not deleted while this exists.
pub struct Stored {
    /// Its record.
    pub volume: Held<StoredVolume>,
    /// Whether the tenant did not have it before.
    pub new: bool,
    /// Keeps it from being deleted.
    pub pin: Pin,
}

/// One received file.
pub struct Received {
    name: String,
    kind: &'static str,
    digest: [u8; 32],
    bytes: u64,
}

impl Received {
    /// Uses the extension of the client's name for the file where the content does not tell.
    pub fn known_as(&mut self, given: &str) {
        self.kind = kind_by_name(given).unwrap_or(self.kind);
    }
}

/// A file on its way to the disk.
struct Arriving<'a> {
    bundle: &'a mut Bundle,
    name: String,
    file: Option<BlobWriter>,
    waiting: Vec<u8>,
    /// Bytes that may wait, and the memory that is held for them.
    room: usize,
    held: HeldMemory,
}

impl Arriving<'_> {
    /// Lets `room` bytes wait, if the client's share of memory has them.
    fn extend(&mut self, room: usize) {
        let more = room.saturating_sub(self.room) as u64;
        if more > 0 && self.held.try_extend(MEMORY_PER_BYTE * more) {
            self.room = room;
        }
    }

    /// Takes the next piece: lets it wait, or writes it with what waits.
    async fn take(&mut self, piece: &[u8]) -> Answer<()> {
        if self.waiting.len() + piece.len() > self.room {
            self.extend(match self.file {
                None => FIRST_WRITE,
                Some(_) => WRITE_BYTES,
            });
        }
        if self.waiting.len() + piece.len() > self.room {
            self.flush().await?;
        }
        if piece.len() > self.room {
            return self.write(piece).await;
        }
        if self.waiting.is_empty() {
            self.waiting.reserve_exact(self.room);
        }
        self.waiting.extend_from_slice(piece);
        Ok(())
    }

    /// Writes the bytes that wait, and keeps no room for others: more may not come for a while.
    async fn flush(&mut self) -> Answer<()> {
        let waiting = std::mem::take(&mut self.waiting);
        self.write(&waiting).await
    }

    async fn write(&mut self, bytes: &[u8]) -> Answer<()> {
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(self.bundle.staged().await?.create(&self.name).await?),
        };
        file.write_all(bytes).await.map_err(BlobError::from)?;
        Ok(())
    }

    async fn end(mut self) -> Answer<()> {
        self.flush().await?;
        if let Some(mut file) = self.file {
            file.shutdown().await.map_err(BlobError::from)?;
        }
        Ok(())
    }
}

/// The extension that the first bytes of the content imply.
fn kind_by_content(head: &[u8]) -> &'static str {
    match head {
        [0x1f, 0x8b, ..] => "nii.gz",
        [b'P', b'K', 3, 4, ..] => "zip",
        _ if head.get(128..132) == Some(b"DICM") => "dcm",
        _ => "nii",
    }
}

/// `hdr` or `img`, which only the file's name can tell apart.
fn kind_by_name(name: &str) -> Option<&'static str> {
    ["hdr.gz", "img.gz", "hdr", "img"]
        .into_iter()
        .find(|kind| name.ends_with(&format!(".{kind}")))
}

impl Bundle {
    /// An empty bundle. What it receives counts against a quota.
    pub fn new(app: &App, counting: &Counting) -> Self {
        Self {
            blobs: app.queue.items().blobs().clone(),
            memory: app.memory.clone(),
            counting: counting.clone(),
            staged: None,
            files: Vec::new(),
        }
    }

    /// Where the files lie.
    async fn staged(&mut self) -> Answer<&mut Box<dyn StagedFiles>> {
        Ok(match &mut self.staged {
            Some(staged) => staged,
            none => none.insert(self.blobs.stage(StagedFor::Upload).await?),
        })
    }

    /// Whether nothing was received.
    pub fn is_empty(&self) -> bool {
        self.files.iter().all(|file| file.bytes == 0)
    }

    /// Adds a file: writes the stream to the disk and hashes it on the way. Publishing forces the
    /// file to the disk.
    ///
    /// # Errors
    /// The problem in the stream, 507 beyond the tenant's quota, or 500 if the file cannot be written.
    pub async fn write(
        &mut self,
        mut pieces: impl Stream<Item = Answer<Bytes>> + Unpin,
    ) -> Answer<&mut Received> {
        let name = self.files.len().to_string();
        let counting = self.counting.clone();
        let held = self.memory.hold();
        let mut arriving = Arriving {
            bundle: self,
            name: name.clone(),
            file: None,
            waiting: Vec::new(),
            room: 0,
            held,
        };
        arriving.extend(LEAST_WRITE);
        let mut hash = Sha256::new();
        let mut head = Vec::new();
        let mut bytes = 0;
        while let Some(piece) = pieces.next().await {
            let piece = piece?;
            hash.update(&piece);
            bytes += piece.len() as u64;
            counting.arrived(piece.len() as u64).await?;
            if head.len() < 132 {
                head.extend_from_slice(&piece[..piece.len().min(132 - head.len())]);
            }
            arriving.take(&piece).await?;
        }
        arriving.end().await?;
        self.files.push(Received {
            name,
            kind: kind_by_content(&head),
            digest: hash.finalize().into(),
            bytes,
        });
        let last = self.files.len() - 1;
        Ok(&mut self.files[last])
    }

    /// Bytes of all files.
    pub fn bytes(&self) -> u64 {
        self.files.iter().map(|file| file.bytes).sum()
    }

    /// Makes one of the last file and an earlier one with the same content.
    ///
    /// # Errors
    /// 500 if the file cannot be renamed.
    pub async fn join_repeated(&mut self) -> Answer<()> {
        let Some((last, before)) = self.files.split_last() else {
            return Ok(());
        };
        let twin = before.iter().find(|file| file.digest == last.digest);
        if let (Some(twin), Some(staged)) = (twin, &self.staged) {
            staged.rename(&last.name, &twin.name).await?;
            self.files.pop();
        }
        Ok(())
    }

    /// Checks and stores the volume. One that is stored already is not checked again; its age
    /// counts from now.
    ///
    /// # Errors
    /// 413 or 422 if the files are not a usable volume.
    pub async fn store(self, app: &App, tenant: &Tenant, tags: &Tags) -> Answer<Stored> {
        let counting = self.counting.clone();
        counting.settle().await?;
        let stored = self.store_uncounted(app, tenant, tags).await?;
        counting.stored();
        Ok(stored)
    }

    async fn store_uncounted(mut self, app: &App, tenant: &Tenant, tags: &Tags) -> Answer<Stored> {
        let id = self.volume_id();
        let records = self.records();
        let pin = app.queue.items().pin(&id).await?;
        if let Some(stored) = app.queue.items().intact_volume(&id).await? {
            let scan = scans::to_note(app, tenant, &id, &stored).await?;
            let renewed = app
                .queue
                .items()
                .renew_volume(tenant, &id, tags, scan.as_ref());
            if let Some((volume, new)) = renewed.await? {
                return Ok(Stored { volume, new, pin });
            }
        }
        let received = self.files;
        let staged = self.staged.ok_or_else(body::empty)?;
        let mut files = Vec::with_capacity(records.len());
        for (file, record) in received.iter().zip(&records) {
            staged.rename(&file.name, &record.name).await?;
            files.push(staged.local(&record.name).await?);
        }
        let reader = app.engine.reader.clone();
        let inspect = move |monitor: &Monitor<'_>| {
            let facts = reader.inspect(&files, monitor)?;
            Ok::<_, Failure>((facts, reader.scan(&files, monitor)?))
        };
        // The disk and the processor work at the same time.
        let bytes = received.iter().map(|file| file.bytes).sum();
        let decoding = app.decoding.run_on(bytes, INSPECTION_MEMORY, inspect);
        let inspected = async { Ok(decoding.await??) };
        let settled = async { Ok::<(), Problem>(staged.settle(&id).await?) };
        let ((facts, scan), ()) = tokio::try_join!(inspected, settled)?;
        let volume = StoredVolume {
            sequence: 0,
            created_at: app.queue.now(),
            bytes,
            files: records,
            facts: facts.to_json(),
            id,
        };
        let added = app
            .queue
            .items()
            .add_volume(volume, staged, tenant, tags, scan);
        let (volume, new) = added.await?;
        Ok(Stored { volume, new, pin })
    }

    /// The id of the volume of these files.
    pub fn volume_id(&mut self) -> String {
        // The order of the form's parts has no meaning, so it must not change the id.
        self.files
            .sort_by(|a, b| (a.kind, a.digest).cmp(&(b.kind, b.digest)));
        volume_id(&self.records())
    }

    /// The files under their final names: `volume` with its extension for one file or a pair, else
    /// numbers with extensions.
    fn records(&self) -> Vec<FileRecord> {
        let pair = self.files.len() == 2
            && self.files[0].kind.starts_with("hdr")
            && self.files[1].kind.starts_with("img");
        let name = |number: usize, kind| match (pair, self.files.len()) {
            (true, _) | (_, 1) => format!("volume.{kind}"),
            _ => format!("{number:04}.{kind}"),
        };
        let files = self.files.iter().enumerate();
        files
            .map(|(number, file)| FileRecord {
                name: name(number, file.kind),
                bytes: file.bytes,
                sha256: hex(&file.digest),
                place: None,
            })
            .collect()
    }
}
