//! Erasing: on request or by age, one item or everything made of a volume.
//!
//! The records go first, in one transaction that also writes the receipt; then the files; then the
//! database's log is moved into the database, whose freed pages are overwritten. A crash in between
//! leaves files without a record, which the next start deletes. All of it runs in a task of its own,
//! which goes on if the caller goes away.

use super::Queue;
use super::publish::to_its_end;
use crate::jobs::{
    Deleted, Erased, ErasureAgent, ErasureOrder, ErasureReason, Resource, StoreError, Tenant,
    Timestamp,
};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// The name under which the upkeep erases.
const BY_RETENTION: &str = "retention";

/// What is beyond its age is erased in pages of so many.
const PAGE: u32 = 500;

/// Ages at which things are erased. `None` keeps them until somebody erases them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RetentionAges {
    /// Of volumes, counted from their last upload or use.
    pub volumes: Option<Duration>,
    /// Of models and segmentations, counted from when they were last computed.
    pub results: Option<Duration>,
    /// Of the records of finished jobs, counted from their end.
    pub jobs: Option<Duration>,
}

impl RetentionAges {
    /// When an item of that kind will be erased that was renewed at the moment `renewed`; `None`
    /// if it is kept.
    pub fn expires_at(&self, kind: Resource, renewed: Timestamp) -> Option<Timestamp> {
        let age = self.of(kind);
        age.map(|age| renewed.saturating_add(milliseconds(age)))
    }

    /// The age at which what is of that kind is erased.
    fn of(&self, kind: Resource) -> Option<Duration> {
        match kind {
            Resource::Volume => self.volumes,
            Resource::Model | Resource::Segmentation => self.results,
            Resource::Job => self.jobs,
            Resource::Template | Resource::Reader => None,
        }
    }
}

fn milliseconds(age: Duration) -> i64 {
    i64::try_from(age.as_millis()).unwrap_or(i64::MAX)
}

impl Queue {
    /// Erases an item that no unfinished job needs and no legal hold keeps.
    ///
    /// # Errors
    /// If the database fails. Files that could not be deleted are deleted by the upkeep, or by the
    /// next start.
    pub async fn erase(self: &Arc<Self>, order: ErasureOrder) -> Result<Erased, StoreError> {
        let queue = self.clone();
        to_its_end(async move {
            let erased = queue.erase_item(&order).await?;
            queue.overwrite_if_due().await?;
            Ok(erased)
        })
        .await
    }

    /// Deletes the record of a job that has ended.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn delete_job(&self, id: &str) -> Result<Deleted, StoreError> {
        self.overwrite_due.store(true, Ordering::Relaxed);
        self.jobs.delete_job(id, self.clock.now()).await
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
        let (queue, tenant, volume) = (self.clone(), tenant.clone(), volume.to_owned());
        to_its_end(async move {
            let now = queue.clock.now();
            let erased = queue.catalogue.erase_scan(&tenant, &volume, now).await?;
            queue.overwrite_due.store(true, Ordering::Relaxed);
            queue.overwrite_if_due().await?;
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
        self.wait_for_holds(&ids).await?;
        let mut locks = Vec::with_capacity(ids.len());
        for id in &ids {
            locks.push(self.items.lock(id).await);
        }
        if ids.iter().any(|id| self.items.is_held(id)) {
            return Ok(Erased::InUse);
        }
        // Unless erased and settled below, the upkeep looks at them.
        let mut doomed = BTreeMap::new();
        for id in &ids {
            let record = self.catalogue.record(id).await?;
            let files = record.map_or_else(Vec::new, |record| record.files());
            self.items.doom(id, files.clone());
            doomed.insert(id.clone(), files);
        }
        let erased = self.catalogue.erase(order, &ids, self.clock.now()).await?;
        if let Erased::Done(receipt) = &erased {
            self.overwrite_due.store(true, Ordering::Relaxed);
            for item in &receipt.items {
                let files = doomed.get(&item.id).map_or(&[][..], Vec::as_slice);
                if item.files_erased
                    && let Err(error) = self.blobs.delete(&item.id, files).await
                {
                    let id = &item.id;
                    tracing::warn!(id, %error, "files could not be deleted; the upkeep tries again");
                    continue;
                }
                self.items.settle(&item.id);
            }
        }
        Ok(erased)
    }

    /// Erases what is too old, page by page.
    pub(super) async fn erase_expired(&self, ages: &RetentionAges) -> Result<(), StoreError> {
        let now = self.clock.now();
        for kind in [
            Resource::Job,
            Resource::Volume,
            Resource::Model,
            Resource::Segmentation,
        ] {
            let Some(age) = ages.of(kind) else {
                continue;
            };
            let before = now.saturating_sub(milliseconds(age));
            let mut last = None;
            loop {
                let page = self.catalogue.expired(kind, before, last.as_ref(), PAGE);
                let page = page.await?;
                for found in &page {
                    let (tenant, id) = (found.tenant.clone(), found.id.clone());
                    match kind {
                        Resource::Job => {
                            self.delete_job(&id).await?;
                        }
                        _ => {
                            let order = by_retention(tenant, id, Some(before));
                            self.erase_item(&order).await?;
                        }
                    }
                }
                // What cannot be erased now is looked at again in the next round.
                let full = page.len() >= PAGE as usize;
                last = page.into_iter().next_back();
                if !full {
                    break;
                }
            }
        }
        Ok(())
    }

    /// Overwrites what was deleted from the database since the last time.
    pub(super) async fn overwrite_if_due(&self) -> Result<(), StoreError> {
        if self.overwrite_due.swap(false, Ordering::Relaxed)
            && !self.catalogue.overwrite_erased().await?
        {
            self.overwrite_due.store(true, Ordering::Relaxed);
        }
        Ok(())
    }
}

fn by_retention(tenant: Tenant, id: String, before: Option<Timestamp>) -> ErasureOrder {
    ErasureOrder {
        tenant,
        id,
        cascade: false,
        renewed_before: before,
        by: ErasureAgent {
            name: BY_RETENTION.into(),
            ..ErasureAgent::default()
        },
        reason: ErasureReason::Retention,
    }
}
