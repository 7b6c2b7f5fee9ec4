//! The interface that the exchange with archives needs of the service around it.

use super::ArchiveObject;
use super::parts::SeriesParts;
use crate::base::error::AttemptError;
use crate::base::records::Tenant;
use crate::callers::Agent;
use crate::items::Pin;
use async_trait::async_trait;

/// A stored volume, which is not deleted while this exists.
pub struct StoredSeries {
    /// Its id.
    pub volume: String,
    /// Keeps it from being deleted.
    pub pin: Pin,
}

/// Stores volumes, makes objects, names who acts.
#[async_trait]
pub trait ExchangeHost: Send + Sync + 'static {
    /// Stores the files of a series as a volume, as if the tenant had uploaded them.
    async fn store(
        &self,
        tenant: &Tenant,
        parts: SeriesParts,
    ) -> Result<StoredSeries, AttemptError>;

    /// The tenant's volume of that id, if it is complete.
    async fn held(
        &self,
        tenant: &Tenant,
        volume: &str,
    ) -> Result<Option<StoredSeries>, AttemptError>;

    /// An object of a result.
    async fn object(
        &self,
        tenant: &Tenant,
        result: &str,
        name: &str,
    ) -> Result<ArchiveObject, AttemptError>;

    /// Who fetches and delivers for `tenant`, by the audit trail.
    fn agent(&self, tenant: &Tenant) -> Agent;
}
