//! The received files of one volume, before they are published.

use crate::http::app::App;
use crate::http::problem::{Answer, Problem, body};
use crate::http::scans;
use crate::jobs::{
    BlobError, BlobStore, BlobWriter, Failure, FileRecord, Held, Hold, StagedFiles, StagedFor,
    StoredVolume, Tags, Tenant, hex, volume_id,
};
use crate::progress::Monitor;
use crate::work::INSPECTION_MEMORY;
use axum::body::Bytes;
use futures::{Stream, StreamExt};
use sha2::{Digest, Sha256};
use std::sync::Arc;
use tokio::io::AsyncWriteExt;

/// Bytes gathered for one write. Up to the first one an upload lies in memory alone: thousands of
/// clients that send a few bytes and then wait cost neither files nor turns of the disk.
const WRITE_BYTES: usize = 1 << 20;

/// The files of one volume, which are not published yet.
pub struct Bundle {
    blobs: Arc<dyn BlobStore>,
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
    pub hold: Hold,
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
}

impl Arriving<'_> {
    /// Writes the bytes that wait.
    async fn flush(&mut self) -> Answer<()> {
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(self.bundle.staged().await?.create(&self.name).await?),
        };
        file.write_all(&self.waiting)
            .await
            .map_err(BlobError::from)?;
        self.waiting.clear();
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
    /// An empty bundle.
    pub fn new(app: &App) -> Self {
        Self {
            blobs: app.queue.blobs.clone(),
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
    /// The problem in the stream, or 500 if the file cannot be written.
    pub async fn write(
        &mut self,
        mut pieces: impl Stream<Item = Answer<Bytes>> + Unpin,
    ) -> Answer<&mut Received> {
        let name = self.files.len().to_string();
        let mut arriving = Arriving {
            bundle: self,
            name: name.clone(),
            file: None,
            waiting: Vec::new(),
        };
        let mut hash = Sha256::new();
        let mut head = Vec::new();
        let mut bytes = 0;
        while let Some(piece) = pieces.next().await {
            let piece = piece?;
            hash.update(&piece);
            bytes += piece.len() as u64;
            if head.len() < 132 {
                head.extend_from_slice(&piece[..piece.len().min(132 - head.len())]);
            }
            arriving.waiting.extend_from_slice(&piece);
            if arriving.waiting.len() >= WRITE_BYTES {
                arriving.flush().await?;
            }
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
    pub async fn store(mut self, app: &App, tenant: &Tenant, tags: &Tags) -> Answer<Stored> {
        let id = self.volume_id();
        let records = self.records();
        let hold = app.queue.hold(&id).await?;
        if let Some(stored) = app.queue.intact_volume(&id).await? {
            let scan = scans::to_note(app, tenant, &id, &stored).await?;
            let renewed = app.queue.renew_volume(tenant, &id, tags, scan.as_ref());
            if let Some((volume, new)) = renewed.await? {
                return Ok(Stored { volume, new, hold });
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
            created_at: app.queue.clock.now(),
            bytes,
            files: records,
            facts: facts.to_json(),
            id,
        };
        let added = app.queue.add_volume(volume, staged, tenant, tags, scan);
        let (volume, new) = added.await?;
        Ok(Stored { volume, new, hold })
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
