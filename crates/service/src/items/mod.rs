//! Volumes and products with their files: added, read, pinned, erased, swept.
//!
//! An item is a row of the catalogue and files under its id. [`Items`] changes both so that they agree after a crash at
//! any moment:
//!
//! - **Added**: first the files, then the row that makes them visible ([`add`]).
//! - **Erased**: first the row, then the files ([`erase`]), on request or by age ([`RetentionAges`]).
//! - **Pinned** while a request needs it: an item with a [`Pin`] is not erased ([`pins`]).
//! - **Swept**: files without a row are set aside, damaged ones are found ([`Custodian`]).
//!
//! Both changes run in a task of their own, which goes on if the caller goes away.
//!
//! Guaranteed: an item whose addition returned is durable; an erasure that returned has deleted row and files, or the
//! upkeep deletes the files; no item of a job that has not ended is erased. Not guaranteed: that a file is intact when
//! it is read; every read verifies it.

mod add;
mod content;
mod erase;
mod erase_scans;
mod pins;
mod read;
mod sweep;

pub use add::{NotAdded, TemplateSource, check_name};
pub use content::{OutputFile, StoredItem, StoredResult, StoredSource, WorkOutput};
pub(crate) use erase::ExpiredPages;
pub use erase::RetentionAges;
pub use pins::Pin;
pub use sweep::{Custodian, Swept};

use crate::base::memory::Requester;
use crate::base::records::{BlobStore, Catalogue, Clock, Peers, StoreError, Timestamp};
use crate::callers::Agent;
use pins::ItemLocks;
use std::sync::Arc;
use tracing::Instrument;

/// The volumes and products of one service.
pub struct Items {
    catalogue: Arc<dyn Catalogue>,
    blobs: Arc<dyn BlobStore>,
    clock: Arc<dyn Clock>,
    locks: ItemLocks,
    /// The other processes on the store, if it can be shared.
    peers: Option<Arc<dyn Peers>>,
}

impl Items {
    /// The items of these stores. `peers` are the other processes on them, if there can be any.
    pub fn new(
        catalogue: Arc<dyn Catalogue>,
        blobs: Arc<dyn BlobStore>,
        clock: Arc<dyn Clock>,
        peers: Option<Arc<dyn Peers>>,
    ) -> Self {
        Self {
            catalogue,
            blobs,
            clock,
            locks: ItemLocks::default(),
            peers,
        }
    }

    /// The records of volumes and products.
    pub(crate) fn catalogue(&self) -> &dyn Catalogue {
        &*self.catalogue
    }

    /// The files of volumes and products.
    pub(crate) fn blobs(&self) -> &Arc<dyn BlobStore> {
        &self.blobs
    }

    /// The time of day.
    pub fn now(&self) -> Timestamp {
        self.clock.now()
    }

    /// The other processes on the store, if it can be shared.
    pub(crate) fn peers(&self) -> Option<&Arc<dyn Peers>> {
        self.peers.as_ref()
    }

    /// Keeps an item from being deleted, by request or by age, until the pin is dropped. The item
    /// need not exist yet. To be called before the item is looked for or added.
    ///
    /// # Errors
    /// If other processes share the store, and the database fails.
    pub async fn pin(&self, id: &str) -> Result<Pin, StoreError> {
        let pin = self.locks.pin(id).await;
        match &self.peers {
            Some(peers) => pin.among(peers).await,
            None => Ok(pin),
        }
    }

    /// Whether other processes may use the store.
    pub fn is_shared(&self) -> bool {
        self.peers.is_some()
    }
}

/// Runs a section to its end even if the caller is dropped meanwhile, for whoever the caller acts.
async fn to_its_end<T: Send + 'static>(
    section: impl Future<Output = Result<T, StoreError>> + Send + 'static,
) -> Result<T, StoreError> {
    let section = Agent::scope(Agent::acting(), section);
    let section = Requester::current().scope(section);
    tokio::spawn(section.in_current_span())
        .await
        .unwrap_or_else(|error| Err(StoreError::database(error.to_string())))
}
