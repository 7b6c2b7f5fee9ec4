//! The interface to the records of volumes and products.

use super::{ListPage, ListRequest, Product, StoreError, StoredVolume};
use crate::jobs::{Resource, Timestamp};
use async_trait::async_trait;

type Result<T> = std::result::Result<T, StoreError>;

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
pub trait Catalogue: Send + Sync + 'static {
    /// Adds a volume. `false` if it exists already.
    async fn add_volume(&self, volume: &StoredVolume) -> Result<bool>;

    /// The volume with that id.
    async fn volume(&self, id: &str) -> Result<Option<StoredVolume>>;

    /// Volumes, newest first.
    async fn volumes(&self, page: ListRequest) -> Result<ListPage<StoredVolume>>;

    /// Deletes a volume that no unfinished job needs.
    async fn delete_volume(&self, id: &str, now: Timestamp) -> Result<Deleted>;

    /// Adds a product that was not made by a job. `false` if it exists already.
    async fn add_product(&self, product: &Product) -> Result<bool>;

    /// The product with that id.
    async fn product(&self, id: &str) -> Result<Option<Product>>;

    /// Products of one kind, newest first.
    async fn products(&self, kind: Resource, page: ListRequest) -> Result<ListPage<Product>>;

    /// Deletes a product that no unfinished job needs.
    async fn delete_product(&self, id: &str, now: Timestamp) -> Result<Deleted>;

    /// When the item with that id was deleted; `None` if it never existed.
    async fn erased_at(&self, id: &str) -> Result<Option<Timestamp>>;

    /// Ids of the finished jobs, volumes, models and segmentations older than `before`.
    /// Templates are not listed, as they are kept.
    async fn older_than(&self, before: Timestamp) -> Result<Vec<String>>;
}
