//! The list of a tenant's scans, over all of them, page by page.
//!
//! A page begins after the row at which the one before ended, in the order of the list; so what is added or erased
//! meanwhile neither repeats nor hides another row.

use super::{ItemFilter, ListRequest, Owned, StoreResult, StoredVolume, Tenant};
use async_trait::async_trait;

/// The rows of a page of scans.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoundScans {
    /// Their sequence numbers, in the order of the list.
    pub sequences: Vec<i64>,
    /// Their stored bytes.
    pub bytes: u64,
    /// [`ListRequest::before`] for the next page; `None` on the last page.
    pub next: Option<i64>,
}

/// What is being received from other systems.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Receiving {
    /// Series, and objects that are volumes of their own, of which objects still arrive or are being read.
    pub groups: u64,
    /// Objects of these.
    pub objects: u64,
    /// Size of these, bytes.
    pub bytes: u64,
}

/// The list of scans. Every method is one transaction and fails only if the database does.
#[async_trait]
pub trait ScanLists: Send + Sync + 'static {
    /// The rows of the page of a tenant's scans that `filter` lets through, after the row with the sequence number
    /// `page.before`: as many as [`ListRequest::planned`] would take. `None` if the order of the list is another than
    /// the newest first, and that row is no longer there to tell where the page begins.
    async fn find_scans(
        &self,
        tenant: &Tenant,
        filter: &ItemFilter,
        page: ListRequest,
    ) -> StoreResult<Option<FoundScans>>;

    /// The volumes with these sequence numbers that a tenant has, in that order.
    async fn volumes_at(
        &self,
        tenant: &Tenant,
        sequences: &[i64],
    ) -> StoreResult<Vec<Owned<StoredVolume>>>;
}
