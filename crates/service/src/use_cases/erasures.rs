//! Erasing what is no item: received objects, work items.
//!
//! As an item's ([`crate::items`]): the rows go in one transaction that also writes the row of the audit trail and the
//! receipt; then the files; then what the database's files still hold of the rows is overwritten. All of it runs in a
//! task of its own, which goes on if the caller goes away.

use crate::base::error::ServiceError;
use crate::base::records::{Erased, ErasureReason, Receipt, StoreError, Tenant};
use crate::callers::Agent;
use crate::use_cases::service::Service;

impl Service {
    /// Erases the objects of a group that are not part of a volume, and what is known of those that are. `None` if the
    /// tenant has no such group.
    ///
    /// # Errors
    /// If the storage fails.
    pub async fn forget_received(
        &self,
        by: &Agent,
        tenant: &Tenant,
        group: &str,
    ) -> Result<Option<Receipt>, ServiceError> {
        let (store, files) = (self.intake.store.clone(), self.intake.files.clone());
        let (items, now) = (self.items().clone(), self.now());
        let (tenant, group, agent) = (tenant.clone(), group.to_owned(), by.of_erasure());
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
    ///
    /// # Errors
    /// If the database fails.
    pub async fn erase_workitem(
        &self,
        by: &Agent,
        tenant: &Tenant,
        uid: &str,
    ) -> Result<Erased, ServiceError> {
        let (worklist, items, now) = (self.worklist.clone(), self.items().clone(), self.now());
        let (tenant, uid, agent) = (tenant.clone(), uid.to_owned(), by.of_erasure());
        let erase = async move {
            let erased = worklist.erase_workitem(&tenant, &uid, &agent, now).await?;
            items.overwrite_erased().await;
            Ok(erased)
        };
        by.change(erase).await
    }
}
