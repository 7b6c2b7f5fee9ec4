//! The interface to the records of volumes and products.

use super::{Custody, ListPage, ListRequest, Product, StoreResult, StoredVolume};
use crate::jobs::{Resource, Timestamp};
use async_trait::async_trait;

/// The result of a request to delete an item.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deleted {
    /// It is deleted.
    Done,
    /// It is needed by jobs that have not ended.
    InUse,
    /// There is no such item.
    Unknown,
}

/// The tables of volumes and products. Every method fails only if the database does.
#[async_trait]
pub trait Catalogue: Custody {
    /// Adds a volume. `false` if it exists already.
    async fn add_volume(&self, volume: &StoredVolume) -> StoreResult<bool>;

    /// The volume with that id, whose age counts from `now` on; `None` if it does not exist.
    async fn renew_volume(&self, id: &str, now: Timestamp) -> StoreResult<Option<StoredVolume>>;

    /// The volume with that id.
    async fn volume(&self, id: &str) -> StoreResult<Option<StoredVolume>>;

    /// Volumes, newest first.
    async fn volumes(&self, page: ListRequest) -> StoreResult<ListPage<StoredVolume>>;

    /// Deletes a volume that no unfinished job needs.
    async fn delete_volume(&self, id: &str, now: Timestamp) -> StoreResult<Deleted>;

    /// Adds a product that was not made by a job. `false` if it exists already.
    async fn add_product(&self, product: &Product) -> StoreResult<bool>;

    /// The product with that id.
    async fn product(&self, id: &str) -> StoreResult<Option<Product>>;

    /// Products of one kind, newest first.
    async fn products(&self, kind: Resource, page: ListRequest) -> StoreResult<ListPage<Product>>;

    /// Deletes a product that no unfinished job needs.
    async fn delete_product(&self, id: &str, now: Timestamp) -> StoreResult<Deleted>;

    /// When the item with that id was deleted; `None` if it never existed.
    async fn erased_at(&self, id: &str) -> StoreResult<Option<Timestamp>>;

    /// Ids of the finished jobs, volumes, models and segmentations older than `before`. The age of
    /// a volume counts from its last upload, or from when a job on it was last filed or ended.
    /// Templates are not listed, as they are kept.
    async fn older_than(&self, before: Timestamp) -> StoreResult<Vec<String>>;
}
