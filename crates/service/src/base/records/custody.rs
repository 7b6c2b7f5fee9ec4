//! The interface for looking after what is stored: which items have a row, and what their rows
//! say of their files.

use super::Resource;
use super::{ItemRecord, StoreResult};
use async_trait::async_trait;
use std::collections::BTreeSet;

/// The rows of all items with files, page by page: volumes first, each kind from the oldest on. Rows
/// may be removed meanwhile.
pub struct RecordPages<'a, C: ?Sized> {
    rows: &'a C,
    limit: u32,
    /// The kinds that are not at their end; [`Resource::Model`] stands for all products.
    kinds: &'static [Resource],
    after: i64,
}

impl<'a, C: Custody + ?Sized> RecordPages<'a, C> {
    /// Pages of at most `limit` rows.
    pub fn new(rows: &'a C, limit: u32) -> Self {
        Self {
            rows,
            limit,
            kinds: &[Resource::Volume, Resource::Model],
            after: 0,
        }
    }

    /// The next page; `None` after the last.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn next(&mut self) -> StoreResult<Option<Vec<ItemRecord>>> {
        while let [kind, rest @ ..] = self.kinds {
            let page = self.rows.records(*kind, self.after, self.limit).await?;
            if let Some(last) = page.last() {
                self.after = last.sequence();
                return Ok(Some(page));
            }
            (self.kinds, self.after) = (rest, 0);
        }
        Ok(None)
    }
}

/// Rows of items of every kind. Every method fails only if the database does.
#[async_trait]
pub trait Custody: Send + Sync + 'static {
    /// The row of that id.
    async fn record(&self, id: &str) -> StoreResult<Option<ItemRecord>>;

    /// Those of `ids` that have a row.
    async fn known(&self, ids: &[String]) -> StoreResult<BTreeSet<String>>;

    /// At most `limit` rows of volumes (or of products) after position `after`, oldest first.
    async fn records(&self, kind: Resource, after: i64, limit: u32)
    -> StoreResult<Vec<ItemRecord>>;

    /// Replaces what the row says of the item's files and content, after the files were replaced.
    async fn amend(&self, record: &ItemRecord) -> StoreResult<()>;

    /// Whether anybody erased the item of that id.
    async fn was_erased(&self, id: &str) -> StoreResult<bool>;

    /// The faults of the database's own structure; empty if nothing is.
    async fn defects(&self) -> StoreResult<Vec<String>>;

    /// Reads the whole database again if a statement has told that it is damaged or cannot be read, so that a mended
    /// one is used again. Takes as long as that takes; does nothing if the last time was a moment ago.
    async fn recheck(&self);
}
