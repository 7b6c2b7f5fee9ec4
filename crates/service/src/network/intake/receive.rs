//! One object: from bytes to a row.
//!
//! 1. The bytes are written to a file as they come ([`Incoming::write`]).
//! 2. The header is read and the content hashed, within the bounds of a [`HeaderTurns`].
//! 3. The file is forced to the disk; then its row is committed; then that of the audit trail. From here on it goes on
//!    if the caller goes away.

use super::observer::IntakeObserver;
use super::record::{
    Added, IncomingFile, IntakeRoom, IntakeStore, NewObject, Origin, Protocol, ReceivedFiles,
};
use super::session::{RecordedGroups, Session};
use crate::base::error::ServiceError;
use crate::base::memory::Requester;
use crate::base::records::{BlobError, Clock, Fault, StoreError, StoreFault, hex, random_id};
use crate::callers::{Activity, Agent};
use async_trait::async_trait;
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::Arc;
use tokio::io::AsyncWriteExt;
use tokio::sync::oneshot;
use tracing::Instrument;
use ventriform::base::progress::{Monitor, Stage};
use ventriform::image::volume::dicom::{DicomHeader, read_header};
use ventriform::image::volume::{ReadLimits, VolumeError, VolumeFile};

/// Memory of reading a header, bytes: a hostile one takes as much.
const HEADER_MEMORY: u64 = 16 << 20;

/// Bytes that are gathered for one write.
const WRITE_BYTES: usize = 64 << 10;

/// Bytes hashed at a time.
const HASHED_BYTES: usize = 128 << 10;

/// Why an object was not stored.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ReceiveError {
    /// The disk, what waits, or what the tenant stores is full; or the object is too large.
    NoRoom(&'static str),
    /// It is no whole DICOM object, or one that is not read.
    NotUnderstood(String),
    /// It is not what the sender said it would be.
    Mismatch(&'static str),
    /// Another object with the same SOP Instance UID is stored.
    Duplicate,
    /// The storage failed.
    Storage(String),
}

impl ReceiveError {
    /// The status of C-STORE (PS3.4 B.2.3, PS3.7 C) and the failure reason of STOW-RS (PS3.18 I.2).
    pub fn status(&self) -> u16 {
        match self {
            Self::NoRoom(_) | Self::Storage(_) => 0xA700,
            Self::Mismatch(_) => 0xA900,
            Self::NotUnderstood(_) => 0xC000,
            Self::Duplicate => 0x0111,
        }
    }

    /// The reason as an Error Comment, for people who look at the sender: no value of the object.
    pub fn comment(&self) -> &'static str {
        match self {
            Self::NoRoom(what) | Self::Mismatch(what) => what,
            Self::NotUnderstood(_) => "not a whole DICOM object that can be read",
            Self::Duplicate => "another object with this SOP Instance UID is stored",
            Self::Storage(_) => "the storage failed",
        }
    }

    /// Its name in metrics.
    pub fn code(&self) -> &'static str {
        match self {
            Self::NoRoom(_) => "no-room",
            Self::NotUnderstood(_) => "not-understood",
            Self::Mismatch(_) => "mismatch",
            Self::Duplicate => "duplicate",
            Self::Storage(_) => "storage",
        }
    }
}

/// An object was not stored.
#[derive(Debug, Clone)]
pub struct Refused {
    /// Why.
    pub error: ReceiveError,
    /// Its own header, if that could be read.
    pub header: Option<DicomHeader>,
}

impl<E: Into<ReceiveError>> From<E> for Refused {
    fn from(error: E) -> Self {
        Self {
            error: error.into(),
            header: None,
        }
    }
}

impl From<BlobError> for ReceiveError {
    fn from(error: BlobError) -> Self {
        match error.cause {
            StoreFault::Full => Self::NoRoom("the disk is full"),
            _ => Self::Storage(error.to_string()),
        }
    }
}

impl From<ServiceError> for ReceiveError {
    fn from(error: ServiceError) -> Self {
        if error.may_pass() {
            Self::NoRoom("too many objects are being read; send it again later")
        } else if matches!(error.failure.fault, Fault::Content) {
            Self::NotUnderstood(error.to_string())
        } else {
            Self::Storage(error.to_string())
        }
    }
}

impl From<StoreError> for ReceiveError {
    fn from(error: StoreError) -> Self {
        match error.cause() {
            StoreFault::Full => Self::NoRoom("the disk is full"),
            _ => Self::Storage(error.to_string()),
        }
    }
}

/// Statements of a sender about an object beside the object itself.
#[derive(Debug, Clone, Copy, Default)]
pub struct Stated<'a> {
    /// Its SOP Class and SOP Instance UID.
    pub object: Option<(&'a str, &'a str)>,
    /// Its study.
    pub study: Option<&'a str>,
}

impl Stated<'_> {
    /// The statement that the object contradicts.
    fn contradiction(&self, header: &DicomHeader) -> Option<&'static str> {
        let (class, instance) = self.object.unzip();
        let differs = |stated: Option<&str>, own: &str| stated.is_some_and(|text| text != own);
        if differs(class, &header.sop_class) {
            Some("the data set has another SOP Class UID")
        } else if differs(instance, &header.sop_instance) {
            Some("the data set has another SOP Instance UID")
        } else if differs(self.study, &header.study) {
            Some("the object is of another study")
        } else {
            None
        }
    }
}

/// Limits on what is received.
#[derive(Debug, Clone, Copy)]
pub struct ReceiverSettings {
    /// Bounds on what waits.
    pub room: IntakeRoom,
    /// Bytes of one object.
    pub object_bytes: u64,
    /// Limits on reading it.
    pub limits: ReadLimits,
}

/// The reading of a header, which ends early once its monitor is cancelled.
pub type HeaderWork = Box<dyn FnOnce(&Monitor<'_>) + Send>;

/// Where headers of received objects are read: within bounds on time and memory, in turn with other work.
#[async_trait]
pub trait HeaderTurns: Send + Sync {
    /// Does `work`, which reads a file of `bytes` bytes and needs at most `memory` bytes. Dropping the future
    /// cancels it.
    ///
    /// # Errors
    /// If too much waits, or the work takes too long or panics.
    async fn run(&self, bytes: u64, memory: u64, work: HeaderWork) -> Result<(), ReceiveError>;
}

/// Takes objects.
pub struct Receiver {
    store: Arc<dyn IntakeStore>,
    files: Arc<dyn ReceivedFiles>,
    clock: Arc<dyn Clock>,
    observer: Arc<dyn IntakeObserver>,
    settings: ReceiverSettings,
    turns: Arc<dyn HeaderTurns>,
}

/// An object on its way to the disk. Dropping it deletes it.
pub struct Incoming {
    file: Box<dyn IncomingFile>,
    waiting: Vec<u8>,
    bytes: u64,
    limit: u64,
}

impl Incoming {
    /// Writes the next bytes of the file.
    ///
    /// # Errors
    /// [`ReceiveError::NoRoom`] if it gets too large or the disk is full, and
    /// [`ReceiveError::Storage`].
    pub async fn write(&mut self, bytes: &[u8]) -> Result<(), ReceiveError> {
        self.bytes += bytes.len() as u64;
        if self.bytes > self.limit {
            return Err(ReceiveError::NoRoom("the object is larger than allowed"));
        }
        self.waiting.extend_from_slice(bytes);
        if self.waiting.len() >= WRITE_BYTES {
            self.flush().await?;
        }
        Ok(())
    }

    async fn flush(&mut self) -> Result<(), ReceiveError> {
        let written = self.file.writer().write_all(&self.waiting).await;
        written.map_err(BlobError::from)?;
        self.waiting.clear();
        Ok(())
    }
}

/// The findings in an object's file.
struct Examined {
    header: DicomHeader,
    data_sha256: String,
    file_sha256: String,
}

impl Receiver {
    /// A receiver of objects.
    pub fn new(
        store: Arc<dyn IntakeStore>,
        files: Arc<dyn ReceivedFiles>,
        clock: Arc<dyn Clock>,
        observer: Arc<dyn IntakeObserver>,
        turns: Arc<dyn HeaderTurns>,
        settings: ReceiverSettings,
    ) -> Self {
        Self {
            store,
            files,
            clock,
            observer,
            settings,
            turns,
        }
    }

    /// Begins an object, whose file is written in the form of PS3.10.
    ///
    /// # Errors
    /// If the disk is full or fails.
    pub async fn begin(&self) -> Result<Incoming, ReceiveError> {
        Ok(Incoming {
            file: self.files.begin().await?,
            waiting: Vec::new(),
            bytes: 0,
            limit: self.settings.object_bytes,
        })
    }

    /// Stores an object whose bytes have all been written, for `by`. When this returns, it is on disk, and so is the
    /// row of the audit trail which says that the session brings objects of this group. Returns its group, and its
    /// header.
    ///
    /// # Errors
    /// Why it was not stored; nothing is left of it, unless the audit trail could not be written.
    pub async fn store(
        &self,
        by: &Agent,
        incoming: Incoming,
        stated: Stated<'_>,
        origin: &Origin,
        session: &mut Session,
    ) -> Result<(String, DicomHeader), Refused> {
        let bytes = incoming.bytes;
        let stored = self
            .store_uncounted(by, incoming, stated, origin, session)
            .await;
        let outcome = stored
            .as_ref()
            .map(|_| ())
            .map_err(|refused| &refused.error);
        self.note(origin.protocol, &outcome, bytes);
        stored
    }

    /// Counts an object that was refused before it was stored.
    pub fn note(&self, protocol: Protocol, outcome: &Result<(), &ReceiveError>, bytes: u64) {
        let outcome = match outcome {
            Ok(()) => "stored",
            Err(error) => {
                if let ReceiveError::Storage(reason) = error {
                    tracing::error!(%reason, "a received object could not be stored");
                }
                error.code()
            }
        };
        self.observer.object(protocol, outcome, bytes);
    }

    async fn store_uncounted(
        &self,
        by: &Agent,
        mut incoming: Incoming,
        stated: Stated<'_>,
        origin: &Origin,
        session: &mut Session,
    ) -> Result<(String, DicomHeader), Refused> {
        incoming.flush().await?;
        let closed = incoming.file.writer().shutdown().await;
        closed.map_err(BlobError::from)?;
        let local = incoming.file.local();
        let limits = self.settings.limits;
        let (tell, told) = oneshot::channel();
        let work: HeaderWork = Box::new(move |monitor| {
            let _ = tell.send(examine(&local, &limits, monitor));
        });
        self.turns.run(incoming.bytes, HEADER_MEMORY, work).await?;
        let examined = told.await;
        let examined = examined.map_err(|error| ReceiveError::Storage(error.to_string()))??;
        let header = examined.header.clone();
        let kept = match stated.contradiction(&header) {
            Some(what) => Err(ReceiveError::Mismatch(what)),
            None => {
                let keeping = Keeping {
                    store: self.store.clone(),
                    files: self.files.clone(),
                    clock: self.clock.clone(),
                    room: self.settings.room,
                    by: by.clone(),
                    recorded: session.recorded(),
                };
                let kept = keeping.keep(incoming, examined, origin.clone());
                let kept = Requester::current().scope(kept);
                let kept = tokio::spawn(kept.in_current_span()).await;
                kept.unwrap_or_else(|error| Err(ReceiveError::Storage(error.to_string())))
            }
        };
        match kept {
            Ok(group) => {
                session.brought(&group, !header.is_part);
                Ok((group, header))
            }
            Err(error) => Err(Refused {
                error,
                header: Some(header),
            }),
        }
    }
}

/// The last step of an object.
struct Keeping {
    store: Arc<dyn IntakeStore>,
    files: Arc<dyn ReceivedFiles>,
    clock: Arc<dyn Clock>,
    room: IntakeRoom,
    by: Agent,
    recorded: RecordedGroups,
}

impl Keeping {
    /// Forces an object to the disk, commits its row with that of the audit trail. Returns its group.
    async fn keep(
        self,
        incoming: Incoming,
        examined: Examined,
        origin: Origin,
    ) -> Result<String, ReceiveError> {
        let group = self.store(incoming, examined, origin).await?;
        // The row of the first object of a group was written with it; further ones of the session are counted each
        // second.
        if self.recorded.contains(&group) {
            self.by.note(Activity::Create, group.clone()).await;
        } else {
            self.recorded.insert(&group);
        }
        Ok(group)
    }

    async fn store(
        &self,
        incoming: Incoming,
        examined: Examined,
        origin: Origin,
    ) -> Result<String, ReceiveError> {
        let name = format!("{}.dcm", random_id("obj_"));
        incoming.file.keep(&name).await?;
        let object = NewObject {
            origin,
            header: examined.header,
            data_sha256: examined.data_sha256,
            file_sha256: examined.file_sha256,
            file: name.clone(),
            bytes: incoming.bytes,
            recorded: self.recorded.clone(),
        };
        let now = self.clock.now();
        let adding = self.store.add(&object, self.room, now);
        let added = Agent::scope(Some(self.by.clone()), adding).await;
        let (group, useless) = match added {
            Ok(Added::New(group, obsolete)) => (Ok(group), obsolete),
            Ok(Added::Known(group)) => (Ok(group), Some(name)),
            Ok(Added::Conflict) => (Err(ReceiveError::Duplicate), Some(name)),
            Ok(Added::NoRoom) => {
                let full = ReceiveError::NoRoom("too many objects wait, or the quota is used up");
                (Err(full), Some(name))
            }
            // The row may have been committed. If not, the sweep finds the file.
            Err(error) => (Err(error.into()), None),
        };
        if let Some(useless) = useless
            && let Err(error) = self.files.discard(&[useless]).await
        {
            tracing::warn!(%error, "a file that is not needed could not be deleted");
        }
        group
    }
}

/// Reads the header of an object and hashes its data set and its whole file.
fn examine(
    path: &Path,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<Examined, ReceiveError> {
    let not_understood = |error: VolumeError| ReceiveError::NotUnderstood(error.to_string());
    let mut opened = File::open(path).map_err(BlobError::from)?;
    // Before anything is unpacked: a packed file is none.
    if !is_file_of_ps310(&mut opened).map_err(BlobError::from)? {
        let reason = "it is not a DICOM file (PS3.10)".to_owned();
        return Err(ReceiveError::NotUnderstood(reason));
    }
    let file = VolumeFile::named("the object", path);
    let header = read_header(&file, limits, monitor).map_err(not_understood)?;
    let hashed = hashes(opened, header.data_set, monitor).map_err(BlobError::from)?;
    let (data_sha256, file_sha256) = hashed;
    Ok(Examined {
        header,
        data_sha256,
        file_sha256,
    })
}

/// Whether the file begins as PS3.10 says.
fn is_file_of_ps310(file: &mut File) -> io::Result<bool> {
    let mut start = [0; 132];
    match file.read_exact(&mut start) {
        Ok(()) => Ok(start[128..] == *b"DICM"),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}

/// The hashes of the file from byte `data_set` on, and of all of it.
fn hashes(mut file: File, data_set: u64, monitor: &Monitor<'_>) -> io::Result<(String, String)> {
    file.seek(SeekFrom::Start(0))?;
    let (mut data, mut whole) = (Sha256::new(), Sha256::new());
    let mut head = vec![0; usize::try_from(data_set).unwrap_or(0)];
    file.read_exact(&mut head)?;
    whole.update(&head);
    let mut portion = vec![0; HASHED_BYTES];
    loop {
        monitor
            .report(Stage::Read, 0.0)
            .map_err(|_| io::Error::other("the reading was cancelled"))?;
        let read = file.read(&mut portion)?;
        if read == 0 {
            let [data, whole] = [data, whole].map(|hash| hex(&hash.finalize()));
            return Ok((data, whole));
        }
        data.update(&portion[..read]);
        whole.update(&portion[..read]);
    }
}
