//! The interface to the tables of keys and of the audit trail.

use super::audit::{Anchor, AuditEvent, AuditFilter, AuditLink, AuditRecord, KeptRow};
use super::{ApiKey, Usage};
use crate::base::records::{Cutoff, ListPage, ListRequest, StoreResult, Tenant, Timestamp};
use async_trait::async_trait;

/// Keys and audit trail. Every method is one transaction and fails only if the database does.
/// Another process may use the same tables at the same time.
#[async_trait]
pub trait AccessStore: Send + Sync + 'static {
    /// Adds a key, and the event that says so.
    async fn add_key(&self, key: &ApiKey, event: &AuditEvent) -> StoreResult<()>;

    /// The key with that id.
    async fn key(&self, id: &str) -> StoreResult<Option<ApiKey>>;

    /// A page of keys, newest first; of one tenant, or of all.
    async fn keys(
        &self,
        tenant: Option<&Tenant>,
        page: ListRequest,
    ) -> StoreResult<ListPage<ApiKey>>;

    /// Whether callers without credentials are refused: there was a key or an issuer of tokens once, or that is not
    /// known for sure, and the operator has not opened the service since.
    async fn is_closed(&self) -> StoreResult<bool>;

    /// Notes that callers without credentials are refused from now on.
    async fn close_access(&self) -> StoreResult<()>;

    /// Admits callers without credentials again, and adds the event that says so. Does nothing and returns `false`
    /// while there is a key that has not ended.
    async fn open_access(&self, now: Timestamp, event: &AuditEvent) -> StoreResult<bool>;

    /// Revokes a key, and adds the event that says so unless it was revoked already. Returns
    /// whether there is such a key.
    async fn revoke_key(&self, id: &str, now: Timestamp, event: &AuditEvent) -> StoreResult<bool>;

    /// Revokes all keys of an owner, of one tenant or of all, with one `event` for each. Returns the ids of those that
    /// were not revoked before.
    async fn revoke_keys_of(
        &self,
        owner: &str,
        tenant: Option<&Tenant>,
        now: Timestamp,
        event: &AuditEvent,
    ) -> StoreResult<Vec<String>>;

    /// Use of the service by a tenant.
    async fn usage(&self, tenant: &Tenant) -> StoreResult<Usage>;

    /// Whether a job of this tenant was filed under this idempotency key.
    async fn is_filed(&self, tenant: &Tenant, key: &str) -> StoreResult<bool>;

    /// Appends events to the trail, in their order.
    async fn append(&self, events: &[AuditEvent]) -> StoreResult<()>;

    /// A page of the trail, newest first.
    async fn audit(
        &self,
        filter: &AuditFilter,
        page: ListRequest,
    ) -> StoreResult<ListPage<AuditRecord>>;

    /// The rows of the chain after a sequence number, oldest first.
    async fn links(&self, after: i64, limit: u32) -> StoreResult<Vec<AuditLink>>;

    /// The row up to which the trail was removed last.
    async fn anchor(&self) -> StoreResult<Option<Anchor>>;

    /// The greatest sequence number that was ever given to a row.
    async fn greatest_sequence(&self) -> StoreResult<i64>;

    /// Rows of the trail that another place names and the trail lacks, or has with another hash; the newest of each
    /// place. Receipts of erasures name rows, and so do the notes that a store keeps outside of the trail.
    async fn unconfirmed(&self) -> StoreResult<Vec<KeptRow>>;

    /// Checks, for readiness, that a row can be appended to the trail, without leaving one.
    async fn check_trail(&self, now: Timestamp) -> StoreResult<()>;

    /// Removes the rows that were recorded before a time, keeps their last hash as the anchor, and
    /// appends the event that says so. Returns how many were removed.
    async fn prune(&self, before: Cutoff, now: Timestamp) -> StoreResult<u64>;
}
