//! Received objects: groups of objects that become a volume each, and the interfaces to the database
//! and the files that keep them.

use super::session::RecordedGroups;
use crate::base::records::{
    BlobError, Failure, ListPage, ListRequest, LocalFile, StoreResult, Tenant,
};
use crate::base::records::{
    BlobWriter, Cutoff, ErasureAgent, ErasureReason, Receipt, Receiving, Timestamp, TrustedNow,
};
use async_trait::async_trait;
use std::collections::BTreeSet;
use std::fmt;
use std::time::Duration;

/// The prefix of a group's id.
pub const GROUP_PREFIX: &str = "rcv_";

/// The way an object came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Protocol {
    /// DIMSE C-STORE over an association.
    CStore,
    /// STOW-RS over HTTP.
    StowRs,
}

impl Protocol {
    /// Every protocol.
    pub const ALL: [Self; 2] = [Self::CStore, Self::StowRs];

    /// Its name in the database, over HTTP and in metrics.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::CStore => "c-store",
            Self::StowRs => "stow-rs",
        }
    }

    /// The protocol with that name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|protocol| protocol.as_str() == name)
    }
}

/// Who sends objects.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origin {
    /// Whose the objects are.
    pub tenant: Tenant,
    /// How they come.
    pub protocol: Protocol,
    /// The calling AE title, or the name of the key.
    pub sender: String,
    /// The network address.
    pub address: String,
}

/// The state of a group.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GroupState {
    /// Objects arrive, or wait to be read.
    Gathering,
    /// The volume is stored; the job that a rule asks for is to be filed.
    Filing,
    /// The volume is stored, and its job is filed if a rule asks for one.
    Stored,
    /// The objects make up no volume.
    Failed,
}

impl GroupState {
    /// Every state.
    pub const ALL: [Self; 4] = [Self::Gathering, Self::Filing, Self::Stored, Self::Failed];

    /// Its name in the database and over HTTP.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Gathering => "gathering",
            Self::Filing => "filing",
            Self::Stored => "stored",
            Self::Failed => "failed",
        }
    }

    /// The state with that name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.as_str() == name)
    }
}

/// Objects that make up one volume. This is personal data: `Debug` shows its id alone.
#[derive(Clone)]
pub struct IntakeGroup {
    /// `rcv_...`, random.
    pub id: String,
    /// Position in the order of arrival.
    pub sequence: i64,
    /// Who sent its last object.
    pub origin: Origin,
    /// Study Instance UID.
    pub study: String,
    /// Series Instance UID.
    pub series: String,
    /// SOP Instance UID of an object that is a volume of its own; `None` for a series.
    pub instance: Option<String>,
    /// Modality.
    pub modality: Option<String>,
    /// The values of Image Type.
    pub image_type: Vec<String>,
    /// Study Description.
    pub study_description: Option<String>,
    /// The state of it.
    pub state: GroupState,
    /// Grows with every object.
    pub revision: i64,
    /// The volume made of it.
    pub volume: Option<String>,
    /// The job that a rule started.
    pub job: Option<String>,
    /// Why it cannot be read, or why its job could not be filed.
    pub failure: Option<Failure>,
    /// Number of its objects.
    pub objects: u64,
    /// Size of its files that wait, bytes.
    pub waiting_bytes: u64,
    /// When its first object came.
    pub created_at: Timestamp,
    /// When it last changed.
    pub changed_at: Timestamp,
}

impl fmt::Debug for IntakeGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("IntakeGroup")
            .field("id", &self.id)
            .finish_non_exhaustive()
    }
}

/// A received object whose file is on disk.
pub struct NewObject {
    /// Who sent it.
    pub origin: Origin,
    /// Its own header.
    pub header: ventriform::image::volume::dicom::DicomHeader,
    /// SHA-256 of its data set, hexadecimal.
    pub data_sha256: String,
    /// SHA-256 of its whole file, hexadecimal.
    pub file_sha256: String,
    /// Its name among the received files.
    pub file: String,
    /// Its length, bytes.
    pub bytes: u64,
    /// The groups of which the audit trail has a row of the same session.
    pub recorded: RecordedGroups,
}

/// An object of a group.
#[derive(Clone)]
pub struct ReceivedObject {
    /// SHA-256 of its whole file, hexadecimal.
    pub file_sha256: String,
    /// Its name among the received files; `None` if it is part of the group's volume.
    pub file: Option<String>,
}

/// Bounds on what waits.
#[derive(Debug, Clone, Copy)]
pub struct IntakeRoom {
    /// Objects.
    pub objects: u64,
    /// Bytes of their files.
    pub bytes: u64,
    /// Bytes that the tenant may store in all, volumes included; `None` is no bound.
    pub tenant_bytes: Option<u64>,
}

/// The result of adding an object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Added {
    /// It is new; this is its group. The file named, if one is, is no longer needed.
    New(String, Option<String>),
    /// The same object was received before; this is its group.
    Known(String),
    /// Another object with the same SOP Instance UID was received before.
    Conflict,
    /// Too much waits, or the tenant stores too much.
    NoRoom,
}

/// The tables of received objects. Every method is one transaction and fails only if the database
/// does.
#[async_trait]
pub trait IntakeStore: Send + Sync + 'static {
    /// Adds an object, which opens its group again if that was stored or failed.
    async fn add(&self, object: &NewObject, room: IntakeRoom, now: Timestamp)
    -> StoreResult<Added>;

    /// The groups that are gathering or filing, oldest first.
    async fn unfinished(&self) -> StoreResult<Vec<IntakeGroup>>;

    /// The group with that id.
    async fn group(&self, id: &str) -> StoreResult<Option<IntakeGroup>>;

    /// The objects of a group in the order of their UIDs.
    async fn objects(&self, group: &str) -> StoreResult<Vec<ReceivedObject>>;

    /// Notes the volume made of a group as it was at `revision`. If more objects have come since, it
    /// goes on gathering; else its job is to be filed.
    async fn made(
        &self,
        group: &str,
        revision: i64,
        volume: &str,
        now: Timestamp,
    ) -> StoreResult<()>;

    /// Ends the filing of a group: with the job, with the reason why there is none, or with neither if
    /// no rule asks for a job. Returns the files that are no longer needed.
    async fn filed(
        &self,
        group: &str,
        job: Option<&str>,
        failure: Option<&Failure>,
        now: Timestamp,
    ) -> StoreResult<Vec<String>>;

    /// Notes why a group as it was at `revision` cannot be read. If more objects have come since, it
    /// goes on gathering.
    async fn failed(
        &self,
        group: &str,
        revision: i64,
        failure: &Failure,
        now: Timestamp,
    ) -> StoreResult<()>;

    /// Notes that these files of objects that are part of a volume are deleted.
    async fn released(&self, files: &[String]) -> StoreResult<()>;

    /// The files of objects that are part of a volume: a crash has kept them from being deleted.
    async fn releasable(&self) -> StoreResult<Vec<String>>;

    /// A tenant's groups, newest first.
    async fn groups(
        &self,
        tenant: &Tenant,
        state: Option<GroupState>,
        page: ListRequest,
    ) -> StoreResult<ListPage<IntakeGroup>>;

    /// What a tenant is receiving: its groups that are gathering or filing.
    async fn receiving(&self, tenant: &Tenant) -> StoreResult<Receiving>;

    /// Erases a tenant's group. Returns the files of its objects, which are yet to be deleted, and the receipt, which
    /// was written in the same transaction with the row of the audit trail; `None` if it has none with that id.
    async fn remove(
        &self,
        tenant: &Tenant,
        id: &str,
        by: &ErasureAgent,
        reason: ErasureReason,
        now: Timestamp,
    ) -> StoreResult<Option<(Vec<String>, Receipt)>>;

    /// The failed groups that have not changed since `before`.
    async fn failed_before(&self, before: Cutoff) -> StoreResult<Vec<(Tenant, String)>>;

    /// The names of all files that objects have.
    async fn files(&self) -> StoreResult<BTreeSet<String>>;

    /// Number and bytes of the files that wait.
    async fn waiting(&self) -> StoreResult<(u64, u64)>;
}

/// A file that is being received. Dropping it deletes it.
#[async_trait]
pub trait IncomingFile: Send {
    /// Writes to it; fails when the disk is nearly full.
    fn writer(&mut self) -> &mut BlobWriter;

    /// The file on the local disk, after it was shut down.
    fn local(&self) -> LocalFile;

    /// Forces it to the disk and keeps it under that name.
    ///
    /// # Errors
    /// If it may not be on the disk.
    async fn keep(self: Box<Self>, name: &str) -> Result<(), BlobError>;
}

/// The files of received objects.
#[async_trait]
pub trait ReceivedFiles: Send + Sync + 'static {
    /// Starts a file.
    ///
    /// # Errors
    /// [`BlobError`], as of every method here; [`StoreFault::Full`](crate::base::records::StoreFault::Full) if the
    /// disk is nearly full.
    async fn begin(&self) -> Result<Box<dyn IncomingFile>, BlobError>;

    /// A kept file on the local disk; `None` if it does not exist. A store that keeps its files
    /// elsewhere verifies its copy by the SHA-256.
    async fn received(&self, name: &str, sha256: &str) -> Result<Option<LocalFile>, BlobError>;

    /// Deletes kept files; those that do not exist are none.
    async fn discard(&self, names: &[String]) -> Result<(), BlobError>;

    /// The names of the files that were written at least `age` ago, by the clock that has stamped them. To be called
    /// while the time is trusted.
    async fn kept(&self, age: Duration, now: TrustedNow) -> Result<Vec<String>, BlobError>;

    /// Moves a kept file to where nobody sees it but the operator can restore it.
    async fn quarantine(&self, name: &str, now: Timestamp) -> Result<(), BlobError>;
}
