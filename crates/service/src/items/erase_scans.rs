//! Erasing all volumes of a patient, a study, a series or an accession: [`ScanErasures`](crate::base::records::ScanErasures).
//!
//! As [`super::erase`], with the locks of all that goes: the records in one transaction with one receipt, then the
//! files, then the freed pages of the database. What is stored while the order is at work is planned anew, so that
//! after [`ScansErased::Done`] nothing is left that was selected when the records went.

use super::{Items, to_its_end};
use crate::base::records::{ScanErasureOrder, ScanErasurePlan, ScansErased, StoreError};
use std::sync::Arc;

/// Plans that are made before others that add or pin things are given way.
const PLAN_TRIES: usize = 10;

impl Items {
    /// What an order would erase, and what stands in its way. Changes nothing.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn plan_scan_erasure(
        &self,
        order: &ScanErasureOrder,
    ) -> Result<ScanErasurePlan, StoreError> {
        let mut plan = self.catalogue.plan_scan_erasure(order).await?;
        plan.pinned = self.pinned(&plan).await?;
        Ok(plan)
    }

    /// Erases what an order selects: all, or nothing if something stands in the way.
    ///
    /// # Errors
    /// If the database fails. Files that could not be deleted are deleted by the upkeep, or by the next start.
    pub async fn erase_scans(
        self: &Arc<Self>,
        order: ScanErasureOrder,
    ) -> Result<ScansErased, StoreError> {
        let items = self.clone();
        to_its_end(async move {
            let mut erased = ScansErased::Changed;
            for _ in 0..PLAN_TRIES {
                erased = items.erase_planned(&order).await?;
                if erased != ScansErased::Changed {
                    break;
                }
            }
            items.overwrite_if_due().await?;
            Ok(erased)
        })
        .await
    }

    async fn erase_planned(&self, order: &ScanErasureOrder) -> Result<ScansErased, StoreError> {
        let plan = self.catalogue.plan_scan_erasure(order).await?;
        if plan.volumes.is_empty() || plan.is_too_large || !plan.is_free() {
            let pinned = self.pinned(&plan).await?;
            return Ok(ScansErased::Kept(Box::new(ScanErasurePlan {
                pinned,
                ..plan
            })));
        }
        let mut ids: Vec<String> = plan.items.iter().map(|item| item.id.clone()).collect();
        // Whoever takes several locks takes them in the order of ids.
        ids.sort();
        self.wait_for_pins(&ids).await?;
        let mut locks = Vec::with_capacity(ids.len());
        for id in &ids {
            locks.push(self.locks.lock(id).await);
        }
        let pinned = self.pinned(&plan).await?;
        if !pinned.is_empty() {
            return Ok(ScansErased::Kept(Box::new(ScanErasurePlan {
                pinned,
                ..plan
            })));
        }
        let doomed = self.doom(&ids).await?;
        let erased = self
            .catalogue
            .erase_scans(order, &ids, self.clock.now())
            .await?;
        if let ScansErased::Done(receipt) = &erased {
            self.delete_files(receipt, &doomed).await;
        }
        Ok(erased)
    }

    /// The items of a plan that requests need, of this process and of others.
    async fn pinned(&self, plan: &ScanErasurePlan) -> Result<Vec<String>, StoreError> {
        let ids: Vec<String> = plan.items.iter().map(|item| item.id.clone()).collect();
        let elsewhere = match &self.peers {
            Some(peers) => peers.pinned_by_others(&ids).await?,
            None => false,
        };
        let mut pinned = Vec::new();
        for id in ids {
            let by_others = async |id: &String| match &self.peers {
                Some(peers) if elsewhere => peers.pinned_by_others(std::slice::from_ref(id)).await,
                _ => Ok(false),
            };
            if self.locks.is_pinned(&id) || by_others(&id).await? {
                pinned.push(id);
            }
        }
        Ok(pinned)
    }
}
