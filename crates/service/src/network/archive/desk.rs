//! The archives of a service, for those who order exchanges and those who watch them.

use super::{ArchiveBacklog, ArchiveStore, ExchangeCounts};
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
