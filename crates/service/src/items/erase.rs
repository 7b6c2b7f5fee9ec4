//! Erasing: on request or by age, one item or everything made of a volume.
//!
//! The records go first, in one transaction that also writes the receipt; then the files; then the
//! database's log is moved into the database, whose freed pages are overwritten. A crash in between
//! leaves files without a record, which the next start deletes. All of it runs in a task of its own,
//! which goes on if the caller goes away.

use super::{Items, to_its_end};
use crate::base::records::{
    Catalogue, Cutoff, Erased, ErasureAgent, ErasureOrder, ErasureReason, Expired, FileRecord,
    Receipt, Resource, StoreError, Tenant, Timestamp, milliseconds,
};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Items beyond their age that are read at a time.
const PAGE_ITEMS: u32 = 500;

/// Longest time that an erasure waits for pins of other processes, and the time between two looks. They unpin an item
/// a moment after they have answered.
const PINS_WAIT: Duration = Duration::from_secs(2);
const PINS_POLL: Duration = Duration::from_millis(50);

/// Local copies looked up at a time.
const COPIES_BATCH: usize = 500;

/// Items with the files that go with them.
pub(super) type Doomed = BTreeMap<String, Vec<FileRecord>>;

/// Ages at which things are erased. `None` keeps them until somebody erases them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RetentionAges {
    /// Of volumes, counted from their last upload or use.
    pub volumes: Option<Duration>,
    /// Of models, segmentations, beats, comparisons, serial comparisons and readings, counted from when they were last computed.
    pub results: Option<Duration>,
    /// Of the records of finished jobs, counted from their end.
    pub jobs: Option<Duration>,
}

impl RetentionAges {
    /// When an item of that kind will be erased that was renewed at the moment `renewed`; `None`
    /// if it is kept.
    pub fn expires_at(&self, kind: Resource, renewed: Timestamp) -> Option<Timestamp> {
        let age = self.age(kind);
        age.map(|age| renewed.saturating_add(milliseconds(age)))
    }

    /// The age at which what is of that kind is erased.
    pub(crate) fn age(&self, kind: Resource) -> Option<Duration> {
        match kind {
            Resource::Volume => self.volumes,
            Resource::Model
            | Resource::Segmentation
            | Resource::Beat
            | Resource::Comparison
            | Resource::Serial
            | Resource::Reading => self.results,
            Resource::Job => self.jobs,
            Resource::Template | Resource::Reader | Resource::Normals => None,
        }
    }
}

impl Items {
    /// Erases an item that no unfinished job needs and no legal hold keeps.
    ///
    /// # Errors
    /// If the database fails. Files that could not be deleted are deleted by the upkeep, or by the
    /// next start.
    pub async fn erase(self: &Arc<Self>, order: ErasureOrder) -> Result<Erased, StoreError> {
        let items = self.clone();
        to_its_end(async move {
            let erased = items.erase_item(&order).await?;
            items.overwrite_erased().await;
            Ok(erased)
        })
        .await
    }

    /// Waits a while for other processes that have pinned one of the items.
    pub(super) async fn wait_for_pins(&self, items: &[String]) -> Result<(), StoreError> {
        let Some(peers) = &self.peers else {
            return Ok(());
        };
        let begun = Instant::now();
        while peers.pinned_by_others(items).await? && begun.elapsed() < PINS_WAIT {
            tokio::time::sleep(PINS_POLL).await;
        }
        Ok(())
    }

    /// Deletes the local copies of files whose items are gone.
    pub(crate) async fn forget_erased(&self) -> Result<(), StoreError> {
        let copied: Vec<String> = self.blobs.copied().into_iter().collect();
        for batch in copied.chunks(COPIES_BATCH) {
            let known = self.catalogue.known(batch).await?;
            let gone = batch.iter().filter(|id| !known.contains(*id));
            let gone: BTreeSet<String> = gone.cloned().collect();
            if !gone.is_empty() {
                self.blobs.forget(&gone)?;
            }
        }
        Ok(())
    }

    /// Deletes the files of items that were added or deleted by halves because the storage failed.
    /// Nobody was told that they are stored, or somebody was told that they are deleted.
    ///
    /// # Errors
    /// If the storage fails.
    pub async fn settle_unsettled(&self) -> Result<(), StoreError> {
        for (id, files) in self.locks.unsettled() {
            let _lock = self.locks.lock(&id).await;
            if !self.locks.is_unsettled(&id) {
                continue;
            }
            if self.catalogue.record(&id).await?.is_none() {
                self.blobs.delete(&id, &files).await?;
                tracing::info!(id, "deleted files that have no record");
            }
            self.locks.settle(&id);
        }
        Ok(())
    }

    /// Erases whose scan a volume is; the volume stays. `false` if there is no such volume, or it is
    /// on legal hold.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn erase_scan(
        self: &Arc<Self>,
        tenant: &Tenant,
        volume: &str,
    ) -> Result<bool, StoreError> {
        let (items, tenant, volume) = (self.clone(), tenant.clone(), volume.to_owned());
        to_its_end(async move {
            let now = items.clock.now();
            let erased = items.catalogue.erase_scan(&tenant, &volume, now).await?;
            items.overwrite_erased().await;
            Ok(erased)
        })
        .await
    }

    async fn erase_item(&self, order: &ErasureOrder) -> Result<Erased, StoreError> {
        let mut ids = vec![order.id.clone()];
        if order.cascade {
            ids.extend(self.catalogue.made_of(&order.tenant, &order.id).await?);
        }
        // Whoever takes several locks takes them in the order of ids.
        ids.sort();
        ids.dedup();
        self.wait_for_pins(&ids).await?;
        let mut locks = Vec::with_capacity(ids.len());
        for id in &ids {
            locks.push(self.locks.lock(id).await);
        }
        if ids.iter().any(|id| self.locks.is_pinned(id)) {
            return Ok(Erased::InUse);
        }
        let doomed = self.doom(&ids).await?;
        let erased = self.catalogue.erase(order, &ids, self.clock.now()).await?;
        if let Erased::Done(receipt) = &erased {
            self.delete_files(receipt, &doomed).await;
        }
        Ok(erased)
    }

    /// Notes that files and records of items may disagree from now on, and returns their files. Unless they are erased
    /// and settled, the upkeep looks at them.
    pub(super) async fn doom(&self, ids: &[String]) -> Result<Doomed, StoreError> {
        let mut doomed = Doomed::new();
        for id in ids {
            let record = self.catalogue.record(id).await?;
            let files = record.map_or_else(Vec::new, |record| record.files());
            self.locks.doom(id, files.clone());
            doomed.insert(id.clone(), files);
        }
        Ok(doomed)
    }

    /// Deletes the files of what a receipt names, where no tenant has it any more.
    pub(super) async fn delete_files(&self, receipt: &Receipt, doomed: &Doomed) {
        for item in &receipt.items {
            let files = doomed.get(&item.id).map_or(&[][..], Vec::as_slice);
            if item.files_erased
                && let Err(error) = self.blobs.delete(&item.id, files).await
            {
                let id = &item.id;
                tracing::warn!(id, %error, "files could not be deleted; the upkeep tries again");
                continue;
            }
            self.locks.settle(&item.id);
        }
    }

    /// Erases items that are too old, page by page; none while no ages count.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn erase_expired(&self, ages: &RetentionAges) -> Result<(), StoreError> {
        for kind in Resource::WITH_FILES {
            let Some((age, now)) = ages.age(kind).zip(self.clock.trusted()) else {
                continue;
            };
            let before = now.older_than(age);
            let mut pages = ExpiredPages::new(kind, before);
            while let Some(page) = pages.next(self.catalogue()).await? {
                for found in page {
                    let order = by_retention(found.tenant, found.id, Some(before));
                    self.erase_item(&order).await?;
                }
            }
        }
        Ok(())
    }

    /// Overwrites what was deleted from the database since the last time, whoever did it.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn overwrite_if_due(&self) -> Result<(), StoreError> {
        self.catalogue.overwrite_erased().await.map(|_| ())
    }

    /// The last step of an erasure, which is done whether it succeeds or not: the upkeep tries again.
    pub(crate) async fn overwrite_erased(&self) {
        if let Err(error) = self.overwrite_if_due().await {
            tracing::warn!(%error, "erased rows are not overwritten yet; the upkeep tries again");
        }
    }
}

/// Pages of the items or jobs of one kind that are beyond their age. Those that cannot be erased now are seen again
/// in the next round only.
pub(crate) struct ExpiredPages {
    kind: Resource,
    before: Cutoff,
    last: Option<Expired>,
    ended: bool,
}

impl ExpiredPages {
    /// Those last renewed before `before`.
    pub fn new(kind: Resource, before: Cutoff) -> Self {
        Self {
            kind,
            before,
            last: None,
            ended: false,
        }
    }

    /// The next page; `None` after the last one.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn next(
        &mut self,
        catalogue: &dyn Catalogue,
    ) -> Result<Option<Vec<Expired>>, StoreError> {
        if self.ended {
            return Ok(None);
        }
        let page = catalogue
            .expired(self.kind, self.before, self.last.as_ref(), PAGE_ITEMS)
            .await?;
        self.ended = page.len() < PAGE_ITEMS as usize;
        self.last = page.last().cloned();
        Ok(Some(page))
    }
}

fn by_retention(tenant: Tenant, id: String, before: Option<Cutoff>) -> ErasureOrder {
    ErasureOrder {
        tenant,
        id,
        cascade: false,
        renewed_before: before,
        by: ErasureAgent::retention(),
        reason: ErasureReason::Retention,
    }
}
