//! Erasing on request: items, all volumes of somebody, received objects, work items.
//!
//! As those of an item ([`crate::items`]), the rows of all go in one transaction that also writes the row of the audit
//! trail and the receipt; then the files; then what the database's files still hold of the rows is overwritten. All of
//! it runs in a task of its own, which goes on if the caller goes away.

use crate::base::error::ServiceResult;
use crate::base::records::{Erased, ErasureOrder, ErasureReason, Receipt, Resource, StoreError};
use crate::callers::Agent;
use crate::use_cases::service::Service;

impl Service {
    /// Erases an item of that kind of a tenant; with `cascade`, what was made of it, too.
    pub async fn erase_item(
        &self,
        by: &Agent,
        kind: Resource,
        id: &str,
        cascade: bool,
    ) -> ServiceResult<Erased> {
        if Resource::from_id(id) != Some(kind) {
            return Ok(Erased::Unknown);
        }
        let order = ErasureOrder {
            renewed_before: None,
            tenant: by.tenant().clone(),
            id: id.to_owned(),
            cascade,
            by: by.of_erasure(),
            reason: ErasureReason::Request,
        };
        Ok(self.items().erase(order).await?)
    }

    /// Erases the objects of a group that are not part of a volume, and what is known of those that are. `None` if the
    /// tenant has no such group.
    pub async fn forget_received(&self, by: &Agent, group: &str) -> ServiceResult<Option<Receipt>> {
        let (store, files) = (self.intake.store.clone(), self.intake.files.clone());
        let (items, now) = (self.items().clone(), self.now());
        let (tenant, group, agent) = (by.tenant().clone(), group.to_owned(), by.of_erasure());
        let erase = async move {
            let reason = ErasureReason::Request;
            let removed = store.remove(&tenant, &group, &agent, reason, now).await?;
            let Some((received, receipt)) = removed else {
                return Ok(None);
            };
            files.discard(&received).await.map_err(StoreError::from)?;
            items.overwrite_erased().await;
            Ok(Some(receipt))
        };
        by.change(erase).await
    }

    /// Erases a work item of the tenant, unless this service performs it.
    pub async fn erase_workitem(&self, by: &Agent, uid: &str) -> ServiceResult<Erased> {
        let (worklist, items, now) = (self.worklist.clone(), self.items().clone(), self.now());
        let (tenant, uid, agent) = (by.tenant().clone(), uid.to_owned(), by.of_erasure());
        let erase = async move {
            let erased = worklist.erase_workitem(&tenant, &uid, &agent, now).await?;
            items.overwrite_erased().await;
            Ok(erased)
        };
        by.change(erase).await
    }
}
