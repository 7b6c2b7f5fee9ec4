//! Erasing the volumes of a patient, a study, a series or an accession within one transaction.
//!
//! 1. Find the tenant's volumes for which all given values hold; with `cascade` also what was made of them.
//! 2. Note what stands in the way: legal holds and jobs that have not ended.
//! 3. If nothing does, delete all as a single erasure does ([`super::erasure`]), append a row to the audit trail for
//!    each volume, and store one receipt, which names the last of these rows.
//!
//! Receipt and trail hold no value of the order: they stay when the patient is gone.

use super::access::append;
use super::erasure::{
    RECEIPT_PREFIX, delete_jobs, erasure_event, files_of, legal_hold, made_of, release,
    store_receipt,
};
use super::rows;
use crate::database::{SqlStore, Transaction};
use crate::query::query;
use async_trait::async_trait;
use std::collections::BTreeSet;
use ventriform_service::base::records::{
    AuditMark, ErasedItem, ErasureReason, Receipt, SELECTED_VOLUMES, ScanErasureOrder,
    ScanErasurePlan, ScanErasures, ScanSelection, ScansErased, StoreResult, Tenant, Timestamp,
    random_id,
};

#[async_trait]
impl ScanErasures for SqlStore {
    async fn plan_scan_erasure(&self, order: &ScanErasureOrder) -> StoreResult<ScanErasurePlan> {
        let mut transaction = self.writer.begin().await?;
        let plan = plan(&mut transaction, order).await?;
        transaction.commit().await?;
        Ok(plan)
    }

    async fn erase_scans(
        &self,
        order: &ScanErasureOrder,
        expected: &[String],
        now: Timestamp,
    ) -> StoreResult<ScansErased> {
        let mut transaction = self.writer.begin().await?;
        let erased = if self.is_held_elsewhere(&mut transaction, expected).await? {
            ScansErased::Changed
        } else {
            erase(&mut transaction, order, expected, now).await?
        };
        // Committed also if nothing was erased, which keeps the connection.
        transaction.commit().await?;
        Ok(erased)
    }
}

/// Erases what an order selects. Changes nothing unless it returns [`ScansErased::Done`].
async fn erase(
    to: &mut Transaction<'_>,
    order: &ScanErasureOrder,
    expected: &[String],
    now: Timestamp,
) -> StoreResult<ScansErased> {
    let tenant = &order.tenant;
    let plan = plan(to, order).await?;
    if plan.volumes.is_empty() || plan.is_too_large || !plan.is_free() {
        return Ok(ScansErased::Kept(Box::new(plan)));
    }
    if order
        .only_plan
        .as_ref()
        .is_some_and(|tag| *tag != plan.tag())
    {
        return Ok(ScansErased::Differs(Box::new(plan)));
    }
    if plan.items.iter().any(|item| !expected.contains(&item.id)) {
        return Ok(ScansErased::Changed);
    }
    let mut items = Vec::with_capacity(plan.items.len());
    // What was made of an item goes before the item.
    for item in plan.items.iter().rev() {
        items.insert(0, release(to, tenant, &item.id, now).await?);
    }
    let mut jobs = Vec::new();
    if order.cascade {
        for volume in &plan.volumes {
            jobs.extend(delete_jobs(to, tenant, volume, now).await?);
        }
    }
    jobs.sort();
    let volumes = plan.volumes.iter();
    let events = volumes.map(|volume| erasure_event(&order.by, tenant, volume, now));
    let recorded = append(to, &events.collect::<Vec<_>>()).await?;
    let given = order.selection.given();
    let receipt = Receipt {
        id: random_id(RECEIPT_PREFIX),
        tenant: tenant.clone(),
        item: SELECTED_VOLUMES.into(),
        selected_by: given.map(|(name, _)| name.to_owned()).collect(),
        erased_at: now,
        erased_by: order.by.name.clone(),
        audit: AuditMark {
            sequence: recorded.sequence,
            hash: recorded.hash,
        },
        reason: ErasureReason::Request,
        items,
        jobs,
    };
    store_receipt(to, &receipt).await?;
    Ok(ScansErased::Done(Box::new(receipt)))
}

async fn plan(
    from: &mut Transaction<'_>,
    order: &ScanErasureOrder,
) -> StoreResult<ScanErasurePlan> {
    let tenant = &order.tenant;
    let mut plan = ScanErasurePlan {
        volumes: selected(from, tenant, &order.selection).await?,
        unread: unread(from, tenant).await?,
        ..ScanErasurePlan::default()
    };
    if plan.volumes.len() > ScanErasurePlan::VOLUMES_LIMIT {
        plan.volumes.truncate(ScanErasurePlan::VOLUMES_LIMIT);
        plan.is_too_large = true;
        return Ok(plan);
    }
    let mut ids = plan.volumes.clone();
    let mut made = BTreeSet::new();
    for volume in &plan.volumes {
        made.extend(made_of(&mut *from, tenant, volume).await?);
    }
    if order.cascade {
        ids.extend(made);
    } else {
        plan.stays = made.into_iter().collect();
    }
    let (mut holds, mut unfinished, mut files) = (BTreeSet::new(), BTreeSet::new(), 0);
    for id in ids {
        let item = ErasedItem {
            files_erased: false,
            files: files_of(from, &id).await?,
            id,
        };
        files += item.files.len();
        if files > ScanErasurePlan::FILES_LIMIT {
            plan.is_too_large = true;
            return Ok(plan);
        }
        holds.extend(legal_hold(from, tenant, &item.id).await?);
        unfinished.extend(jobs_of(from, tenant, &item.id, Stage::Unfinished).await?);
        plan.items.push(item);
    }
    if order.cascade {
        let mut jobs = BTreeSet::new();
        for volume in &plan.volumes {
            jobs.extend(jobs_of(from, tenant, volume, Stage::Ended).await?);
        }
        plan.jobs = jobs.into_iter().collect();
    }
    plan.holds = holds.into_iter().collect();
    plan.unfinished_jobs = unfinished.into_iter().collect();
    Ok(plan)
}

/// The tenant's volumes that are selected, in the order of their ids; of more than one order may have, one too many.
async fn selected(
    from: &mut Transaction<'_>,
    tenant: &Tenant,
    selection: &ScanSelection,
) -> StoreResult<Vec<String>> {
    if selection.is_empty() {
        return Ok(Vec::new());
    }
    let [sqlite, postgres] = [patient_on_sqlite, patient_on_postgres].map(|patient: fn() -> _| {
        let mut text = "SELECT c.volume FROM scans AS c
             JOIN holdings AS h ON h.tenant = c.tenant AND h.id = c.volume
             WHERE c.tenant = $1"
            .to_owned();
        for (place, (name, _)) in selection.given().enumerate() {
            let column = match name {
                "study" => "c.study_uid".to_owned(),
                "series" => "c.series_uid".to_owned(),
                "accession" => "c.accession_number".to_owned(),
                _ => patient(),
            };
            text += &format!(" AND {column} = ${}", place + 2);
        }
        let limit = ScanErasurePlan::VOLUMES_LIMIT + 1;
        text + &format!(" ORDER BY c.volume LIMIT {limit}")
    });
    let mut statement = query(sqlite).on_postgres(postgres).bind(tenant.as_str());
    for (_, value) in selection.given() {
        statement = statement.bind(value);
    }
    let rows = statement.fetch_all(from).await?;
    rows::all(rows, |row| row.try_get(0))
}

/// The Patient ID, as the file says or else as the tenant states.
fn patient_on_sqlite() -> String {
    "coalesce(json_extract(c.found, '$.patient_id'), json_extract(c.stated, '$.patient_id'))".into()
}

fn patient_on_postgres() -> String {
    "coalesce(json_field(c.found, 'patient_id'), json_field(c.stated, 'patient_id'))".into()
}

/// The number of the tenant's volumes whose scan a repair has lost and that were not read again yet.
async fn unread(from: &mut Transaction<'_>, tenant: &Tenant) -> StoreResult<u64> {
    let row = query(
        "SELECT count(*) FROM holdings AS h
         LEFT JOIN scans AS c ON c.tenant = h.tenant AND c.volume = h.id
         WHERE h.tenant = $1 AND h.kind = 'volume' AND c.volume IS NULL",
    )
    .bind(tenant.as_str())
    .fetch_one(from)
    .await?;
    let count: i64 = row.try_get(0)?;
    Ok(count.unsigned_abs())
}

/// Whether jobs have ended.
#[derive(Debug, Clone, Copy)]
enum Stage {
    Unfinished,
    Ended,
}

/// The jobs on an item, or that need it.
async fn jobs_of(
    from: &mut Transaction<'_>,
    tenant: &Tenant,
    id: &str,
    stage: Stage,
) -> StoreResult<Vec<String>> {
    let states = match stage {
        Stage::Unfinished => "'queued', 'running'",
        Stage::Ended => "'succeeded', 'failed', 'cancelled'",
    };
    let rows = query(format!(
        "SELECT id FROM jobs WHERE tenant = $1 AND volume = $2 AND state IN ({states})
         UNION
         SELECT id FROM jobs WHERE needs != '{{}}' AND state IN ({states})
             AND tenant = $1 AND EXISTS (SELECT 1 FROM json_each(jobs.needs) WHERE value = $2)"
    ))
    .bind(tenant.as_str())
    .bind(id)
    .fetch_all(from)
    .await?;
    rows::all(rows, |row| row.try_get(0))
}
