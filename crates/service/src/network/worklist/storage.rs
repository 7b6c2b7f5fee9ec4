//! The interface to the table of work items.

use super::{Workitem, WorkitemState};
use crate::base::records::{Bounded, Cutoff, Erased, ErasureAgent, StoreResult, Tenant, Timestamp};
use async_trait::async_trait;

/// Bytes of work items that are read at a time.
pub const BATCH_BYTES: u64 = 512 << 10;

/// The result of adding a work item.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AddedWorkitem {
    /// It is stored.
    Done,
    /// The tenant has an item of that UID.
    Exists,
    /// The tenant has too many items.
    Full,
}

/// The table of work items. Every method is one transaction and fails only if the database does.
#[async_trait]
pub trait Worklist: Send + Sync + 'static {
    /// Adds an item, unless there is one with its UID, or the tenant has `limit` items.
    async fn add_workitem(&self, item: &Workitem, limit: u64) -> StoreResult<AddedWorkitem>;

    /// A tenant's item of that UID.
    async fn workitem(&self, tenant: &Tenant, uid: &str) -> StoreResult<Option<Workitem>>;

    /// A tenant's item of that UID, if its attributes have no more than so many bytes.
    async fn workitem_within(
        &self,
        tenant: &Tenant,
        uid: &str,
        bytes: u64,
    ) -> StoreResult<Bounded<Workitem>>;

    /// Stores a changed item, unless another change came between: the stored revision is no longer
    /// that of `item`. Returns whether it was stored.
    async fn change_workitem(&self, item: &Workitem) -> StoreResult<bool>;

    /// At most `limit` items of a tenant after position `after`, oldest first, in that state or in
    /// any; fewer where they are larger than [`BATCH_BYTES`] together, and at least one if there is one.
    async fn workitems(
        &self,
        tenant: &Tenant,
        state: Option<WorkitemState>,
        after: i64,
        limit: u32,
    ) -> StoreResult<Vec<Workitem>>;

    /// At most `limit` scheduled items of all tenants after position `after`, oldest first, and as few as of
    /// [`Worklist::workitems`].
    async fn scheduled_workitems(&self, after: i64, limit: u32) -> StoreResult<Vec<Workitem>>;

    /// The items that this service has claimed and not ended, likewise.
    async fn performed_workitems(&self, after: i64, limit: u32) -> StoreResult<Vec<Workitem>>;

    /// Erases a tenant's item, with a receipt; not one that this service performs.
    async fn erase_workitem(
        &self,
        tenant: &Tenant,
        uid: &str,
        by: &ErasureAgent,
        now: Timestamp,
    ) -> StoreResult<Erased>;

    /// Deletes the items that ended before that moment; each leaves a row of the audit trail. Returns how many.
    async fn delete_ended_workitems(&self, before: Cutoff, now: Timestamp) -> StoreResult<u64>;
}
