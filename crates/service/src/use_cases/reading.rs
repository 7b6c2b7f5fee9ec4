//! The rows that a tenant asks for: items, jobs, receipts, what was received.
//!
//! A request is charged for what it reads before that is read ([`crate::base::memory`]): for a single row as
//! [`read_row`] says, for a page by the bytes that the database plans for it. `None` is a row that the tenant does not
//! have; [`Service::erased_at`] tells whether it had it.

use crate::base::error::{ServiceResult, invalid_field};
use crate::base::memory::{charge_plan, read_row};
use crate::base::records::{
    ItemFilter, Job, JobFilter, JobState, ListPage, ListRequest, Owned, PagePlan, Product, Receipt,
    Receiving, Resource, ScanIdentity, ScanSearch, StoreResult, StoredVolume, Tenant, Timestamp,
};
use crate::jobs::QueuePosition;
use crate::network::archive::{ObjectDelivery, Pull};
use crate::network::intake::{GroupState, IntakeGroup};
use crate::use_cases::service::Service;
use std::collections::BTreeMap;

/// Facts about jobs beside their rows.
pub struct JobFacts {
    /// The places of those that wait, by their order of filing.
    pub positions: BTreeMap<i64, QueuePosition>,
    /// The fetches of those with a source, by their ids.
    pub pulls: BTreeMap<String, Pull>,
    /// The deliveries of those whose result is sent, by their ids.
    pub deliveries: BTreeMap<String, Vec<ObjectDelivery>>,
    /// The time now.
    pub now: Timestamp,
}

impl Service {
    /// The tenant's volume of that id.
    pub async fn volume(
        &self,
        tenant: &Tenant,
        id: &str,
    ) -> ServiceResult<Option<Owned<StoredVolume>>> {
        let catalogue = self.items().catalogue();
        read_row(|bytes| catalogue.volume_within(tenant, id, bytes)).await
    }

    /// The tenant's product of that id.
    pub async fn product(
        &self,
        tenant: &Tenant,
        id: &str,
    ) -> ServiceResult<Option<Owned<Product>>> {
        let catalogue = self.items().catalogue();
        read_row(|bytes| catalogue.product_within(tenant, id, bytes)).await
    }

    /// The tenant's job of that id.
    pub async fn job(&self, tenant: &Tenant, id: &str) -> ServiceResult<Option<Job>> {
        let job = read_row(|bytes| self.queue.table().job_within(id, bytes)).await?;
        Ok(job.filter(|job| job.tenant == *tenant))
    }

    /// The job of that id as it is now, whoever it belongs to, for which nothing is charged: the caller holds its row.
    pub async fn followed_job(&self, id: &str) -> StoreResult<Option<Job>> {
        self.queue.table().job(id).await
    }

    /// A page of the tenant's volumes, in the order of the search.
    ///
    /// # Errors
    /// `invalid-field` at `cursor` if the row at which the page before ended is no longer there; if the database fails.
    pub async fn volumes(
        &self,
        tenant: &Tenant,
        filter: &ItemFilter,
        page: ListRequest,
    ) -> ServiceResult<ListPage<Owned<StoredVolume>>> {
        let catalogue = self.items().catalogue();
        if filter.search != ScanSearch::default() {
            let found = catalogue.find_scans(tenant, filter, page).await?;
            let found = found.ok_or_else(|| {
                let gone = "The scan at which the page before ended is no longer stored.";
                invalid_field("cursor", gone).fix("List from the first page on.")
            })?;
            let bytes = found.bytes;
            charge_plan(page, PagePlan { page, bytes }).await?;
            return Ok(ListPage {
                items: catalogue.volumes_at(tenant, &found.sequences).await?,
                next: found.next,
            });
        }
        let plan = catalogue.plan_items(tenant, Resource::Volume, filter, page);
        let page = charge_plan(page, plan.await?).await?;
        Ok(catalogue.volumes(tenant, filter, page).await?)
    }

    /// A page of the tenant's products of that kind, newest first.
    pub async fn products(
        &self,
        tenant: &Tenant,
        kind: Resource,
        filter: &ItemFilter,
        page: ListRequest,
    ) -> ServiceResult<ListPage<Owned<Product>>> {
        let catalogue = self.items().catalogue();
        let plan = catalogue.plan_items(tenant, kind, filter, page);
        let page = charge_plan(page, plan.await?).await?;
        Ok(catalogue.products(tenant, kind, filter, page).await?)
    }

    /// A page of a tenant's jobs, newest first.
    pub async fn jobs(
        &self,
        filter: &JobFilter,
        page: ListRequest,
    ) -> ServiceResult<ListPage<Job>> {
        let table = self.queue.table();
        let page = charge_plan(page, table.plan_jobs(filter, page).await?).await?;
        Ok(table.jobs(filter, page).await?)
    }

    /// What is known of these jobs beside their rows.
    pub async fn job_facts(&self, jobs: &[Job]) -> ServiceResult<JobFacts> {
        let ids = |with: fn(&Job) -> bool| -> Vec<&str> {
            let those = jobs.iter().filter(|job| with(job));
            those.map(|job| job.id.as_str()).collect()
        };
        let sourced = ids(|job| job.source.is_some());
        let sent = ids(|job| job.send.is_some() && job.state == JobState::Succeeded);
        let archives = &self.archives.store;
        Ok(JobFacts {
            positions: self.queue.positions(jobs).await?,
            pulls: match sourced.is_empty() {
                true => BTreeMap::new(),
                false => archives.pulls(&sourced).await?,
            },
            deliveries: match sent.is_empty() {
                true => BTreeMap::new(),
                false => archives.sends(&sent).await?,
            },
            now: self.now(),
        })
    }

    /// The tenant's receipt of that id.
    pub async fn receipt(&self, tenant: &Tenant, id: &str) -> ServiceResult<Option<Receipt>> {
        let catalogue = self.items().catalogue();
        read_row(|bytes| catalogue.receipt_within(tenant, id, bytes)).await
    }

    /// A page of the tenant's receipts, newest first: all, or those of one item.
    pub async fn receipts(
        &self,
        tenant: &Tenant,
        item: Option<&str>,
        page: ListRequest,
    ) -> ServiceResult<ListPage<Receipt>> {
        let catalogue = self.items().catalogue();
        let plan = catalogue.plan_receipts(tenant, item, page).await?;
        let page = charge_plan(page, plan).await?;
        Ok(catalogue.receipts(tenant, item, page).await?)
    }

    /// A page of what other systems have sent to the tenant, newest first.
    pub async fn received(
        &self,
        tenant: &Tenant,
        state: Option<GroupState>,
        page: ListRequest,
    ) -> ServiceResult<ListPage<IntakeGroup>> {
        Ok(self.intake.store.groups(tenant, state, page).await?)
    }

    /// What the tenant is receiving from other systems.
    pub async fn receiving(&self, tenant: &Tenant) -> ServiceResult<Receiving> {
        Ok(self.intake.store.receiving(tenant).await?)
    }

    /// Whose scan a volume of the tenant is; `None` if that was never known.
    pub async fn scan(&self, tenant: &Tenant, volume: &str) -> ServiceResult<Option<ScanIdentity>> {
        Ok(self.items().catalogue().scan(tenant, volume).await?)
    }

    /// When the tenant's item or job with that id was erased; `None` if the tenant never had it.
    pub async fn erased_at(&self, tenant: &Tenant, id: &str) -> ServiceResult<Option<Timestamp>> {
        Ok(self.items().catalogue().erased_at(tenant, id).await?)
    }

    /// A number that every write of this process changes; `None` while there may be a write under way. What was read
    /// between two equal answers is current until the answer changes.
    pub fn version(&self) -> Option<u64> {
        self.items().catalogue().version()
    }
}
