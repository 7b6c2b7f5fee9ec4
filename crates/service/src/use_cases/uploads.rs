//! Uploads: the files of one volume on their way into the store, whoever sends them.
//!
//! In: files as streams of bytes. Out: a stored volume, pinned until the caller has done with it.
//!
//! 1. [`VolumeUpload::write`] streams each file to the disk and hashes it on the way; nothing but a few pieces is held
//!    in memory.
//! 2. [`Service::store_volume`] tells the volume by its content, reads it if it is new, and adds it.
//!
//! Guaranteed: what arrives counts against the tenant's quota as it comes. Not guaranteed: that a refused upload has
//! not been written to the disk; its files are deleted.

use crate::base::error::ServiceError;
use crate::base::memory::{HeldMemory, MemoryBudget};
use crate::base::records::{
    BlobError, BlobStore, BlobWriter, Failure, Fault, FileRecord, Owned, StagedFiles, StagedFor,
    StoredVolume, Tags, Tenant, hex, volume_id,
};
use crate::callers::Agent;
use crate::items::Pin;
use crate::limits::quotas::Counting;
use crate::use_cases::service::Service;
use crate::work::INSPECTION_MEMORY;
use bytes::Bytes;
use futures::{Stream, StreamExt};
use sha2::{Digest, Sha256};
use std::sync::Arc;
use tokio::io::AsyncWriteExt;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::gates::GATE_COUNTS;
use ventriform::image::volume::{NamesSay, order_by_numbers, said_by_names};

/// Bytes gathered for one write: at most, for the first one, and where the client has no memory left.
/// Up to the first write an upload lies in memory alone: clients that send a few bytes and then wait cost neither
/// files nor turns of the disk.
const WRITE_BYTES: usize = 1 << 20;
const FIRST_WRITE: usize = 64 << 10;
const LEAST_WRITE: usize = 8 << 10;

/// Memory for a gathered byte: it lies here, and once more in the file's writer.
const MEMORY_PER_BYTE: u64 = 2;

/// The files of one volume, which are not stored yet.
pub struct VolumeUpload {
    blobs: Arc<dyn BlobStore>,
    memory: MemoryBudget,
    counting: Counting,
    /// Where the files lie; made for the first of them.
    staged: Option<Box<dyn StagedFiles>>,
    files: Vec<ReceivedFile>,
}

/// A stored volume, which is not deleted while this exists.
pub struct Stored {
    /// Its record.
    pub volume: Owned<StoredVolume>,
    /// Whether the tenant did not have it before.
    pub new: bool,
    /// Keeps it from being deleted.
    pub pin: Pin,
}

/// One received file.
pub struct ReceivedFile {
    name: String,
    /// The client's name for it, which is not stored.
    given: String,
    kind: &'static str,
    /// Whether its first bytes are those of a NIfTI file that may hold a gate.
    may_be_gate: bool,
    digest: [u8; 32],
    bytes: u64,
}

impl ReceivedFile {
    /// Keeps the client's name for the file, by which gates are ordered; uses its extension where the content does
    /// not tell.
    pub fn known_as(&mut self, given: &str) {
        self.kind = kind_by_name(given).unwrap_or(self.kind);
        self.given = given.to_owned();
    }
}

/// A file on its way to the disk.
struct Arriving<'a> {
    upload: &'a mut VolumeUpload,
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
    async fn take(&mut self, piece: &[u8]) -> Result<(), ServiceError> {
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
    async fn flush(&mut self) -> Result<(), ServiceError> {
        let waiting = std::mem::take(&mut self.waiting);
        self.write(&waiting).await
    }

    async fn write(&mut self, bytes: &[u8]) -> Result<(), ServiceError> {
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(self.upload.staged().await?.create(&self.name).await?),
        };
        file.write_all(bytes).await.map_err(BlobError::from)?;
        Ok(())
    }

    async fn end(mut self) -> Result<(), ServiceError> {
        self.flush().await?;
        if let Some(mut file) = self.file {
            file.shutdown().await.map_err(BlobError::from)?;
        }
        Ok(())
    }
}

/// The extension of a gzipped file.
const GZIPPED_EXTENSION: &str = "nii.gz";

/// The extension that the first bytes of the content imply.
fn kind_by_content(head: &[u8]) -> &'static str {
    match head {
        [0x1f, 0x8b, ..] => GZIPPED_EXTENSION,
        [b'P', b'K', 3, 4, ..] => "zip",
        _ if head.get(128..132) == Some(b"DICM") => "dcm",
        _ => "nii",
    }
}

/// Whether a file that begins so is gzipped, or a NIfTI file: it begins with the length of its header.
fn may_be_nifti(head: &[u8]) -> bool {
    /// Length of a header of NIfTI-1 and of NIfTI-2, bytes.
    const HEADER_BYTES: [u32; 2] = [348, 540];
    let length = head
        .first_chunk()
        .map(|bytes| [u32::from_le_bytes(*bytes), u32::from_be_bytes(*bytes)]);
    let stated = length.is_some_and(|both| both.iter().any(|length| HEADER_BYTES.contains(length)));
    stated || kind_by_content(head) == GZIPPED_EXTENSION
}

/// `hdr` or `img`, which only the file's name can tell apart.
fn kind_by_name(name: &str) -> Option<&'static str> {
    ["hdr.gz", "img.gz", "hdr", "img"]
        .into_iter()
        .find(|kind| name.ends_with(&format!(".{kind}")))
}

impl Service {
    /// Refuses an upload of that announced length for which the disk has no room.
    ///
    /// # Errors
    /// If there is none.
    pub fn require_disk_room(&self, bytes: u64) -> Result<(), ServiceError> {
        Ok(self.items().blobs().require_room(bytes)?)
    }
}

impl VolumeUpload {
    /// An empty upload. What it receives counts against a quota.
    pub fn new(service: &Service, counting: &Counting) -> Self {
        Self {
            blobs: service.items().blobs().clone(),
            memory: service.memory.clone(),
            counting: counting.clone(),
            staged: None,
            files: Vec::new(),
        }
    }

    /// Where the files lie.
    async fn staged(&mut self) -> Result<&mut Box<dyn StagedFiles>, ServiceError> {
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
    /// The error in the stream, `storage-quota` beyond the tenant's quota, or the storage's error.
    pub async fn write<E: From<ServiceError>>(
        &mut self,
        mut pieces: impl Stream<Item = Result<Bytes, E>> + Unpin,
    ) -> Result<&mut ReceivedFile, E> {
        let name = self.files.len().to_string();
        let counting = self.counting.clone();
        let held = self.memory.hold();
        let mut arriving = Arriving {
            upload: self,
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
        self.files.push(ReceivedFile {
            name,
            given: String::new(),
            kind: kind_by_content(&head),
            may_be_gate: may_be_nifti(&head),
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
    /// If the file cannot be renamed.
    pub async fn join_repeated(&mut self) -> Result<(), ServiceError> {
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

    /// The id of the volume of these files.
    pub fn volume_id(&mut self) -> String {
        if !self.may_be_gates() {
            // The order of the form's parts has no meaning, so it must not change the id.
            self.files
                .sort_by(|a, b| (a.kind, a.digest).cmp(&(b.kind, b.digest)));
            return volume_id(&self.records());
        }
        let names: Vec<&str> = self.files.iter().map(|file| file.given.as_str()).collect();
        if let Some(order) = order_by_numbers(&names) {
            let mut files: Vec<Option<ReceivedFile>> = self.files.drain(..).map(Some).collect();
            let in_order = order.into_iter().filter_map(|at| files[at].take());
            self.files = in_order.collect();
        }
        volume_id(&self.records())
    }

    /// Whether the files may be one gate each, so that their order has a meaning. Only reading them tells.
    fn may_be_gates(&self) -> bool {
        GATE_COUNTS.contains(&self.files.len()) && self.files.iter().all(|file| file.may_be_gate)
    }

    /// What the client's names say of files of one volume each, as a word in the names of the stored files, by which
    /// they are read. It is no part of the volume's id.
    fn word(&self) -> &'static str {
        if !self.may_be_gates() {
            return "";
        }
        let names: Vec<&str> = self.files.iter().map(|file| file.given.as_str()).collect();
        match said_by_names(&names) {
            NamesSay::Gates => "gate-",
            NamesSay::Others(_) => "case-",
            NamesSay::Nothing => "",
        }
    }

    /// The files under their final names: `volume` with its extension for one file or a pair, else
    /// numbers with extensions.
    fn records(&self) -> Vec<FileRecord> {
        let word = self.word();
        let pair = self.files.len() == 2
            && self.files[0].kind.starts_with("hdr")
            && self.files[1].kind.starts_with("img");
        let name = |number: usize, kind| match (pair, self.files.len()) {
            (true, _) | (_, 1) => format!("volume.{kind}"),
            _ => format!("{word}{number:04}.{kind}"),
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

impl Service {
    /// Checks and stores the volume of an upload for `by`. One that is stored already is not checked again; its age
    /// counts from now.
    ///
    /// # Errors
    /// If the files are no usable volume, the tenant's quota has no room for them, or the storage fails.
    pub async fn store_volume(
        &self,
        by: &Agent,
        tenant: &Tenant,
        upload: VolumeUpload,
        tags: &Tags,
    ) -> Result<Stored, ServiceError> {
        let counting = upload.counting.clone();
        counting.settle().await?;
        let stored = self.store_counted(by, tenant, upload, tags).await?;
        counting.stored();
        Ok(stored)
    }

    async fn store_counted(
        &self,
        by: &Agent,
        tenant: &Tenant,
        mut upload: VolumeUpload,
        tags: &Tags,
    ) -> Result<Stored, ServiceError> {
        let (id, records) = (upload.volume_id(), upload.records());
        let items = self.items();
        let pin = items.pin(&id).await?;
        if let Some(stored) = items.intact_volume(&id).await? {
            let scan = self.scan_to_note(tenant, &id, &stored).await?;
            let renewed = {
                let (items, tenant, tags) = (items.clone(), tenant.clone(), tags.clone());
                let id = id.clone();
                async move {
                    let renewed = items.renew_volume(&tenant, &id, &tags, scan.as_ref());
                    renewed.await
                }
            };
            if let Some((volume, new)) = by.change(renewed).await? {
                return Ok(Stored { volume, new, pin });
            }
        }
        let received = upload.files;
        let staged = upload.staged.ok_or_else(empty)?;
        let mut files = Vec::with_capacity(records.len());
        for (file, record) in received.iter().zip(&records) {
            staged.rename(&file.name, &record.name).await?;
            files.push(staged.local(&record.name).await?);
        }
        let reader = self.engine.reader.clone();
        let inspect = move |monitor: &Monitor<'_>| {
            let facts = reader.inspect(&files, monitor)?;
            Ok::<_, Failure>((facts, reader.scan(&files, monitor)?))
        };
        // The disk and the processor work at the same time.
        let bytes = received.iter().map(|file| file.bytes).sum();
        let decoding = self.decoding.run_on(bytes, INSPECTION_MEMORY, inspect);
        let inspected = async { Ok(decoding.await??) };
        let settled = async { Ok::<(), ServiceError>(staged.settle(&id).await?) };
        let ((facts, scan), ()) = tokio::try_join!(inspected, settled)?;
        let volume = StoredVolume {
            sequence: 0,
            created_at: items.now(),
            bytes,
            files: records,
            facts: facts.to_json(),
            id,
        };
        let (items, tenant, tags) = (items.clone(), tenant.clone(), tags.clone());
        let add = async move {
            let added = items.add_volume(volume, staged, &tenant, &tags, scan);
            added.await
        };
        let (volume, new) = by.change(add).await?;
        Ok(Stored { volume, new, pin })
    }
}

/// An upload of no file.
fn empty() -> ServiceError {
    Failure::new(Fault::Request, "empty-body", "The body holds no volume.")
        .fix("Send the volume as the body: curl --data-binary @volume.nii.gz ...")
        .into()
}
