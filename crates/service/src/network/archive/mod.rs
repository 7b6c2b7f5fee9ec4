//! The way to and from the hospital's archive (PACS): scans are fetched from it, results are sent
//! back.
//!
//! In: the archives of the settings ([`Archive`]), and jobs that name one. Out: a stored volume for
//! each job with a source, and the objects of its result in the archive.
//!
//! 1. A job with a [`source`](crate::base::records::Job::source) waits without a volume, beside a row that says
//!    what is to be fetched. [`Puller`] asks the archive which instances the series has (QIDO-RS). If
//!    the tenant holds them already, the job gets that volume. Else the series is fetched (WADO-RS,
//!    [`SeriesParts`]), streamed to the disk, and stored as an upload is ([`ExchangeHost::store`]).
//!    Then a worker can take the job.
//! 2. When a job with a [`send`](crate::base::records::Job::send) succeeds, the same transaction writes a row
//!    for each object (the outbox). [`Deliverer`] makes the object from the stored result, asks the
//!    archive whether it has it, and sends it: by STOW-RS, or by C-STORE to an archive with `dicom`.
//! 3. What may pass ([`AttemptError::Retry`](crate::base::error::AttemptError::Retry)) is tried again later and later, across restarts; the rest
//!    fails the job, or ends the delivery, with its reason.
//!
//! Guaranteed: a result is delivered or its reason is shown, whatever is killed in between; an object
//! has the same UIDs and bytes in every attempt, so that an archive has it once; credentials come from
//! the environment and go to their archive alone; no answer of an archive takes more memory, disk or
//! time than set.
//!
//! Not guaranteed: that a series is complete when it is fetched. An archive may still be receiving it.
//!
//! | where | what |
//! |---|---|
//! | `description` | an archive as the operator describes it |
//! | `record` | fetches and deliveries, the trait that a database implements |
//! | `host` | the trait that the service around implements: storing volumes, making objects |
//! | `web`, `related`, `pieces`, `parts`, `dimse` | DICOMweb, its messages of several objects, C-STORE |
//! | `answer` | what is read of an answer in JSON |
//! | `trouble`, `end` | why an attempt failed, and whether that may pass; how attempts end |
//! | `exchange`, `pull`, `deliver` | what both have in common; fetching; delivering |

mod answer;
mod deliver;
mod description;
mod dimse;
mod end;
mod exchange;
mod host;
mod object;
mod parts;
mod pieces;
mod pull;
mod record;
mod related;
mod web;

pub use deliver::Deliverer;
pub use description::{Archive, ArchiveFault, Archives, Credentials, DicomPeer, DicomTls};
pub use end::{ExchangeCounts, ExchangeEnd};
pub use exchange::{Exchange, ExchangeSettings};
pub use host::{ExchangeHost, StoredSeries};
pub use object::ArchiveObject;
pub use parts::{PartLimits, SeriesPart, SeriesParts};
pub use pieces::{EndlessHeader, Unparsed};
pub use pull::Puller;
pub use record::{
    ArchiveBacklog, ArchiveStore, DuePull, DueSend, HeldSeries, ObjectDelivery, Pull,
    SendSettlement, SeriesKey,
};
pub use related::RelatedType;

use crate::base::records::StoreResult;
use crate::network::hooks::UrlGuard;
use std::sync::Arc;
use tokio::sync::Notify;

/// The archives of a service.
pub struct ArchiveDesk {
    /// The tables.
    pub(crate) store: Arc<dyn ArchiveStore>,
    /// Which DICOMweb services jobs may name beside the configured archives.
    pub(crate) guard: UrlGuard,
    /// Told when a delivery is due at once.
    pub(crate) woken: Arc<Notify>,
    /// Attempts to fetch.
    pub(crate) pulls: Arc<ExchangeCounts>,
    /// Attempts to deliver.
    pub(crate) sends: Arc<ExchangeCounts>,
}

/// Figures of archives for operators.
pub struct ArchiveReadings<'a> {
    /// The exchanges that wait.
    pub(crate) backlog: ArchiveBacklog,
    /// Attempts to fetch.
    pub(crate) pulls: &'a ExchangeCounts,
    /// Attempts to deliver.
    pub(crate) sends: &'a ExchangeCounts,
}

impl ArchiveDesk {
    /// The archives of a service that starts now. `guard` knows the DICOMweb services that jobs may name.
    pub fn new(store: Arc<dyn ArchiveStore>, guard: UrlGuard) -> Self {
        Self {
            store,
            guard,
            woken: Arc::default(),
            pulls: Arc::default(),
            sends: Arc::default(),
        }
    }

    /// Figures for operators.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn read(&self) -> StoreResult<ArchiveReadings<'_>> {
        Ok(ArchiveReadings {
            backlog: self.store.archive_backlog().await?,
            pulls: &self.pulls,
            sends: &self.sends,
        })
    }
}
