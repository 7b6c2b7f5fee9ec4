//! What protects a single item while its files and its record change: locks, holds, and the list
//! of items whose files and record may disagree.
//!
//! - A **lock** is kept while the files and the record of one item are added or deleted, so that
//!   the two always agree. Items with different ids do not wait for each other.
//! - A **hold** is kept by a request from the moment it finds or stores an item until it has filed
//!   the job that needs it. An item on hold is not deleted. A hold is taken under the lock, so that
//!   a deletion that has begun is over before the item is looked for.
//! - An item is **unsettled** from before its first file is written until its record is committed,
//!   and from before its record is deleted until its files are. What stays in that list after the
//!   lock is free was left by a failure; the upkeep deletes its files if it has no record.
//!
//! All of this lives in memory. What a crash leaves behind is found by the next start, by comparing files
//! and records. Where several processes share a store, its files lie in places of their own, so that
//! - a lock is needed within a process only: each publication has other files, and no row can name files
//!   that were erased meanwhile (the database refuses it, and the publication is done again);
//! - a hold is also a row of the database, which an erasure by another process reads;
//! - what one process leaves unsettled are its own files.

use crate::jobs::{FileRecord, Peers, StoreError, random_id};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Duration;
use tokio::sync::OwnedMutexGuard;

/// Locks, holds and unsettled items, by id.
#[derive(Default)]
pub(super) struct Items {
    locks: Mutex<BTreeMap<String, Weak<tokio::sync::Mutex<()>>>>,
    holds: Arc<Mutex<BTreeMap<String, usize>>>,
    /// With the files that are to be deleted with the item.
    unsettled: Mutex<BTreeMap<String, Vec<FileRecord>>>,
}

/// Keeps an item from being deleted until this is dropped.
#[must_use = "the item may be deleted as soon as the hold is dropped"]
pub struct Hold {
    id: String,
    holds: Arc<Mutex<BTreeMap<String, usize>>>,
    /// The other processes, and the token by which they see the hold.
    elsewhere: Option<(Arc<dyn Peers>, String)>,
}

/// Pause before the release of a hold is tried again.
const RELEASE_AGAIN: Duration = Duration::from_secs(5);

impl Hold {
    /// The same, which the other processes see too.
    pub(super) async fn among(mut self, peers: &Arc<dyn Peers>) -> Result<Self, StoreError> {
        let token = random_id("");
        // Released also if it is not known whether it was written.
        self.elsewhere = Some((peers.clone(), token.clone()));
        peers.hold(&token, &self.id).await?;
        Ok(self)
    }
}

async fn release(peers: Arc<dyn Peers>, token: String) {
    while let Err(error) = peers.release(&token).await {
        tracing::warn!(%error, "other processes still see a hold; tried again");
        tokio::time::sleep(RELEASE_AGAIN).await;
    }
}

impl Drop for Hold {
    fn drop(&mut self) {
        let mut holds = entered(&self.holds);
        if let Some(count) = holds.get_mut(&self.id) {
            *count -= 1;
            if *count == 0 {
                holds.remove(&self.id);
            }
        }
        drop(holds);
        if let Some((peers, token)) = self.elsewhere.take()
            && let Ok(runtime) = tokio::runtime::Handle::try_current()
        {
            runtime.spawn(release(peers, token));
        }
    }
}

/// A panic cannot leave the collections half changed: each change is a single call.
fn entered<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Items {
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

    /// Holds an item, which need not exist yet.
    pub async fn hold(&self, id: &str) -> Hold {
        let _lock = self.lock(id).await;
        *entered(&self.holds).entry(id.to_owned()).or_default() += 1;
        Hold {
            id: id.to_owned(),
            holds: self.holds.clone(),
            elsewhere: None,
        }
    }

    /// Whether somebody holds the item.
    pub fn is_held(&self, id: &str) -> bool {
        entered(&self.holds).contains_key(id)
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
        let items = Items::default();
        let first = items.lock("a").await;
        assert!(items.lock("b").now_or_never().is_some());
        assert!(items.lock("a").now_or_never().is_none());
        drop(first);
        assert!(items.lock("a").now_or_never().is_some());
    }

    #[tokio::test]
    async fn an_item_is_held_until_its_last_hold_is_dropped() {
        let items = Items::default();
        let (first, second) = (items.hold("a").await, items.hold("a").await);
        assert!(items.is_held("a") && !items.is_held("b"));
        drop(first);
        assert!(items.is_held("a"));
        drop(second);
        assert!(!items.is_held("a"));
        assert!(entered(&items.holds).is_empty());
    }
}
