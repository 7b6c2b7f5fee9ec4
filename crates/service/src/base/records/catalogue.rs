//! The interface to the records of volumes and products.
//!
//! Every method that takes a [`Tenant`] sees what this tenant has and nothing else.

use super::{
    Bounded, Custody, Erased, ErasureOrder, Expired, ItemFilter, LegalHold, ListPage, ListRequest,
    Owned, PagePlan, Product, Receipt, ScanErasures, ScanFields, ScanLists, Scans, StoreResult,
    StoredVolume, Tags,
};
use super::{Cutoff, Resource, Tenant, Timestamp};
use async_trait::async_trait;

/// The result of a request to delete a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deleted {
    /// It is deleted.
    Done,
    /// It has not ended.
    InUse,
    /// There is no such job.
    Unknown,
}

/// Bounds on what a tenant may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ProductRoom {
    /// Products of the kind.
    pub count: u32,
    /// Bytes of everything that it stores; `None` is no bound.
    pub bytes: Option<u64>,
}

/// The result of adding a product.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AddedProduct {
    /// It is new for the tenant.
    New,
    /// The tenant has it already.
    Known,
    /// The tenant has as many of the kind as it may have.
    TooMany,
    /// The tenant stores this many bytes, and the product does not fit.
    TooLarge {
        /// The bytes.
        stored: u64,
    },
}

/// The tables of volumes and products. Every method is one transaction and fails only if the
/// database does.
#[async_trait]
pub trait Catalogue: Custody + Scans + ScanErasures + ScanLists {
    /// Adds a volume, unless it is stored already, and gives it to a tenant; see
    /// [`Catalogue::renew_volume`]. `scan` is what its file says of the scan. Returns whether it is
    /// new for the tenant.
    async fn add_volume(
        &self,
        volume: &StoredVolume,
        tenant: &Tenant,
        tags: &Tags,
        scan: Option<&ScanFields>,
    ) -> StoreResult<bool>;

    /// Gives a stored volume to a tenant, or renews it: its age counts from `now` on, and the
    /// given tags replace those it has, and it is noted what its file says of the scan. Also returns
    /// whether it is new for the tenant. `None` if it is not stored.
    async fn renew_volume(
        &self,
        tenant: &Tenant,
        id: &str,
        tags: &Tags,
        scan: Option<&ScanFields>,
        now: Timestamp,
    ) -> StoreResult<Option<(Owned<StoredVolume>, bool)>>;

    /// The volume with that id.
    async fn volume(&self, tenant: &Tenant, id: &str) -> StoreResult<Option<Owned<StoredVolume>>>;

    /// The volume with that id, if its row and what the tenant has of it have no more than so many bytes.
    async fn volume_within(
        &self,
        tenant: &Tenant,
        id: &str,
        bytes: u64,
    ) -> StoreResult<Bounded<Owned<StoredVolume>>>;

    /// The memory that such a page of items of one kind takes, so that it can be charged before it is read.
    async fn plan_items(
        &self,
        tenant: &Tenant,
        kind: Resource,
        filter: &ItemFilter,
        page: ListRequest,
    ) -> StoreResult<PagePlan>;

    /// The memory that such a page of receipts takes, likewise.
    async fn plan_receipts(
        &self,
        tenant: &Tenant,
        item: Option<&str>,
        page: ListRequest,
    ) -> StoreResult<PagePlan>;

    /// Volumes, newest first.
    async fn volumes(
        &self,
        tenant: &Tenant,
        filter: &ItemFilter,
        page: ListRequest,
    ) -> StoreResult<ListPage<Owned<StoredVolume>>>;

    /// Adds a product that was not made by a job, unless it is stored already, and gives it to a
    /// tenant that has it already or has room for it. `source` is the volume it was made of.
    async fn add_product(
        &self,
        product: &Product,
        tenant: &Tenant,
        source: Option<&str>,
        room: ProductRoom,
    ) -> StoreResult<AddedProduct>;

    /// The product with that id.
    async fn product(&self, tenant: &Tenant, id: &str) -> StoreResult<Option<Owned<Product>>>;

    /// The product with that id, likewise.
    async fn product_within(
        &self,
        tenant: &Tenant,
        id: &str,
        bytes: u64,
    ) -> StoreResult<Bounded<Owned<Product>>>;

    /// Products of one kind, newest first.
    async fn products(
        &self,
        tenant: &Tenant,
        kind: Resource,
        filter: &ItemFilter,
        page: ListRequest,
    ) -> StoreResult<ListPage<Owned<Product>>>;

    /// Replaces the tags of an item or a job. `false` if there is none with that id, or its tags are not `before` any
    /// more.
    async fn change_tags(
        &self,
        tenant: &Tenant,
        id: &str,
        before: &Tags,
        after: &Tags,
    ) -> StoreResult<bool>;

    /// Sets whether every `model=auto` of the tenant fits a template. `false` if it has no such
    /// template.
    async fn set_library(&self, tenant: &Tenant, id: &str, library: bool) -> StoreResult<bool>;

    /// Sets or lifts a tenant's legal hold on an item. `false` if it has no such item.
    async fn set_legal_hold(
        &self,
        tenant: &Tenant,
        id: &str,
        hold: Option<&LegalHold>,
    ) -> StoreResult<bool>;

    /// The products of a volume: models, segmentations, beats, comparisons, templates.
    async fn made_of(&self, tenant: &Tenant, volume: &str) -> StoreResult<Vec<String>>;

    /// Erases an item that no unfinished job needs and no legal hold keeps. The record of its
    /// content is deleted with the last tenant's holding. Fails with [`Erased::InUse`] if
    /// something would go with it that is not among `expected`.
    async fn erase(
        &self,
        order: &ErasureOrder,
        expected: &[String],
        now: Timestamp,
    ) -> StoreResult<Erased>;

    /// When the item or job with that id was erased; `None` if the tenant never had it.
    async fn erased_at(&self, tenant: &Tenant, id: &str) -> StoreResult<Option<Timestamp>>;

    /// The receipt with that id, if it has no more than so many bytes.
    async fn receipt_within(
        &self,
        tenant: &Tenant,
        id: &str,
        bytes: u64,
    ) -> StoreResult<Bounded<Receipt>>;

    /// Receipts, newest first: all, or those of one item.
    async fn receipts(
        &self,
        tenant: &Tenant,
        item: Option<&str>,
        page: ListRequest,
    ) -> StoreResult<ListPage<Receipt>>;

    /// At most `limit` items of one kind (or finished jobs) whose age counts from before a moment and that no
    /// legal hold keeps, oldest first, after the place of `after`. The age of an item counts from its last
    /// upload or computation, that of a volume also from when a job on it was last filed or computed, that of
    /// a job from its end.
    async fn expired(
        &self,
        kind: Resource,
        before: Cutoff,
        after: Option<&Expired>,
        limit: u32,
    ) -> StoreResult<Vec<Expired>>;

    /// A number that every write of this process changes, also of jobs; `None` while there may be a
    /// write under way. What was read between two equal answers is current until the answer changes.
    fn version(&self) -> Option<u64>;

    /// Overwrites what was deleted from the database: moves the write-ahead log, which still holds
    /// it, into the database. `false` if readers were in the way; the next call tries again.
    async fn overwrite_erased(&self) -> StoreResult<bool>;
}
