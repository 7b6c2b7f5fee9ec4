//! Archives, for handlers and operators.

use std::sync::Arc;
use tokio::sync::Notify;
use ventriform_service::archive::{ArchiveBacklog, ArchiveStore, ExchangeCounts};
use ventriform_service::config::Settings;
use ventriform_service::hooks::UrlGuard;
use ventriform_service::records::StoreResult;

/// Archives, for handlers.
pub struct ArchiveDesk {
    /// The tables.
    pub store: Arc<dyn ArchiveStore>,
    /// Which DICOMweb services jobs may name beside the configured archives.
    pub guard: UrlGuard,
    /// Told when a delivery is due at once.
    pub woken: Arc<Notify>,
    /// Attempts to fetch.
    pub pulls: Arc<ExchangeCounts>,
    /// Attempts to deliver.
    pub sends: Arc<ExchangeCounts>,
}

/// What operators see of archives.
pub struct ArchiveReadings<'a> {
    /// What waits.
    pub backlog: ArchiveBacklog,
    /// Attempts to fetch.
    pub pulls: &'a ExchangeCounts,
    /// Attempts to deliver.
    pub sends: &'a ExchangeCounts,
}

impl ArchiveDesk {
    /// The desk of a service that starts now.
    pub fn new(settings: &Settings, store: Arc<dyn ArchiveStore>) -> Self {
        Self {
            store,
            guard: UrlGuard::of_listed(settings.dicomweb_allow.clone()),
            woken: Arc::default(),
            pulls: Arc::default(),
            sends: Arc::default(),
        }
    }

    /// What operators see.
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
