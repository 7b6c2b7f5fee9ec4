//! Protection of a single item while its files and its record change: locks, pins, and the list
//! of items whose files and record may disagree.
//!
//! - A **lock** is kept while the files and the record of one item are added or deleted, so that
//!   the two always agree. Items with different ids do not wait for each other.
//! - A **pin** is kept by a request from the moment it finds or stores an item until it has filed
//!   the job that needs it. A pinned item is not deleted. A pin is set under the lock, so that
//!   a deletion that has begun is over before the item is looked for.
//! - An item is **unsettled** from before its first file is written until its record is committed,
//!   and from before its record is deleted until its files are. What stays in that list after the
//!   lock is free was left by a failure; the upkeep deletes its files if it has no record.
//!
//! All of this lives in memory. What a crash leaves behind is found by the next start, by comparing files
//! and records. Where several processes share a store, its files lie in places of their own, so that
//! - a lock is needed within a process only: each publication has other files, and no row can name files
//!   that were erased meanwhile (the database refuses it, and the publication is done again);
//! - a pin is also a row of the database, which an erasure by another process reads;
//! - what one process leaves unsettled are its own files.

use crate::base::records::{FileRecord, Peers, StoreError, random_id};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Duration;
use tokio::sync::OwnedMutexGuard;

/// Locks, pins and unsettled items, by id.
#[derive(Default)]
pub(super) struct ItemLocks {
    locks: Mutex<BTreeMap<String, Weak<tokio::sync::Mutex<()>>>>,
    pins: Arc<Mutex<BTreeMap<String, usize>>>,
    /// With the files that are to be deleted with the item.
    unsettled: Mutex<BTreeMap<String, Vec<FileRecord>>>,
}

/// Keeps an item from being deleted until this is dropped.
#[must_use = "the item may be deleted as soon as the pin is dropped"]
pub struct Pin {
    id: String,
    pins: Arc<Mutex<BTreeMap<String, usize>>>,
    /// The other processes, and the token by which they see the pin.
    elsewhere: Option<(Arc<dyn Peers>, String)>,
}

/// Pause before the release of a pin is tried again.
const UNPIN_RETRY: Duration = Duration::from_secs(5);

impl Pin {
    /// The same, which the other processes see too.
    pub(super) async fn among(mut self, peers: &Arc<dyn Peers>) -> Result<Self, StoreError> {
        let token = random_id("");
        // Released also if it is not known whether it was written.
        self.elsewhere = Some((peers.clone(), token.clone()));
        peers.pin(&token, &self.id).await?;
        Ok(self)
    }
}

async fn unpin(peers: Arc<dyn Peers>, token: String) {
    while let Err(error) = peers.unpin(&token).await {
        tracing::warn!(%error, "other processes still see a pin; tried again");
        tokio::time::sleep(UNPIN_RETRY).await;
    }
}

impl Drop for Pin {
    fn drop(&mut self) {
        let mut pins = entered(&self.pins);
        if let Some(count) = pins.get_mut(&self.id) {
            *count -= 1;
            if *count == 0 {
                pins.remove(&self.id);
            }
        }
        drop(pins);
        if let Some((peers, token)) = self.elsewhere.take()
            && let Ok(runtime) = tokio::runtime::Handle::try_current()
        {
            runtime.spawn(unpin(peers, token));
        }
    }
}

/// A panic cannot leave the collections half changed: each change is a single call.
fn entered<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl ItemLocks {
    /// Waits for the lock of an item.
    pub async fn lock(&self, id: &str) -> OwnedMutexGuard<()> {
        let lock = {
            let mut locks = entered(&self.locks);
            locks.retain(|_, lock| lock.strong_count() > 0);
            match locks.get(id).and_then(Weak::upgrade) {
                Some(lock) => lock,
                None => {
                    let lock = Arc::default();
                    locks.insert(id.to_owned(), Arc::downgrade(&lock));
                    lock
                }
            }
        };
        lock.lock_owned().await
    }

    /// Pins an item, which need not exist yet.
    pub async fn pin(&self, id: &str) -> Pin {
        let _lock = self.lock(id).await;
        *entered(&self.pins).entry(id.to_owned()).or_default() += 1;
        Pin {
            id: id.to_owned(),
            pins: self.pins.clone(),
            elsewhere: None,
        }
    }

    /// Whether somebody pins the item.
    pub fn is_pinned(&self, id: &str) -> bool {
        entered(&self.pins).contains_key(id)
    }

    /// Notes that the item's files and record may disagree from now on.
    pub fn unsettle(&self, id: &str) {
        self.doom(id, Vec::new());
    }

    /// The same, of an item that has those files as far as is known.
    pub fn doom(&self, id: &str, files: Vec<FileRecord>) {
        entered(&self.unsettled).insert(id.to_owned(), files);
    }

    /// Notes that they agree again.
    pub fn settle(&self, id: &str) {
        entered(&self.unsettled).remove(id);
    }

    /// Whether the item's files and record may disagree.
    pub fn is_unsettled(&self, id: &str) -> bool {
        entered(&self.unsettled).contains_key(id)
    }

    /// Every item whose files and record may disagree, with the files that are to be deleted.
    pub fn unsettled(&self) -> Vec<(String, Vec<FileRecord>)> {
        let unsettled = entered(&self.unsettled);
        let items = unsettled.iter();
        items
            .map(|(id, files)| (id.clone(), files.clone()))
            .collect()
    }
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;
    use futures::FutureExt;

    #[tokio::test]
    async fn a_lock_keeps_out_the_same_id_only() {
        let items = ItemLocks::default();
        let first = items.lock("a").await;
        assert!(items.lock("b").now_or_never().is_some());
        assert!(items.lock("a").now_or_never().is_none());
        drop(first);
        assert!(items.lock("a").now_or_never().is_some());
    }

    #[tokio::test]
    async fn an_item_is_pinned_until_its_last_pin_is_dropped() {
        let items = ItemLocks::default();
        let (first, second) = (items.pin("a").await, items.pin("a").await);
        assert!(items.is_pinned("a") && !items.is_pinned("b"));
        drop(first);
        assert!(items.is_pinned("a"));
        drop(second);
        assert!(!items.is_pinned("a"));
        assert!(entered(&items.pins).is_empty());
    }
}
