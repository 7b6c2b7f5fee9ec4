//! Erasing an item within one transaction: checked, deleted, remembered.
//!
//! 1. Collect what goes: the item; with `cascade` also what was made of a volume.
//! 2. Refuse if a job that has not ended needs one of them, or a legal hold keeps one.
//! 3. Delete the tenant's ownerships; with the last holding of an item, the record of its content;
//!    with `cascade`, the jobs on the volume.
//! 4. Remember each id (410 from then on), append a row to the audit trail, and store the receipt,
//!    which names that row.

use super::access::append;
use super::rows::{self, to_json};
use crate::database::Transaction;
use crate::query::{Target, query};
use ventriform_service::base::records::{
    AuditMark, Cutoff, Erased, ErasedFile, ErasedItem, ErasureAgent, ErasureOrder, ErasureReason,
    Receipt, Resource, StoreResult, Tenant, Timestamp, random_id,
};
use ventriform_service::callers::{Activity, AuditEvent};

/// The prefix of the ids of receipts.
pub(super) const RECEIPT_PREFIX: &str = "ers_";

/// The products of a volume.
pub(super) async fn made_of(
    from: impl Into<Target<'_>> + Send,
    tenant: &Tenant,
    volume: &str,
) -> StoreResult<Vec<String>> {
    let rows = query("SELECT id FROM sources WHERE tenant = $1 AND volume = $2 ORDER BY id")
        .bind(tenant.as_str())
        .bind(volume)
        .fetch_all(from)
        .await?;
    rows.into_iter().map(|row| row.try_get(0)).collect()
}

/// Erases what an order names. Changes nothing unless it returns [`Erased::Done`].
pub(super) async fn erase(
    to: &mut Transaction<'_>,
    order: &ErasureOrder,
    expected: &[String],
    now: Timestamp,
) -> StoreResult<Erased> {
    let tenant = &order.tenant;
    let mut ids = vec![order.id.clone()];
    if order.cascade {
        ids.extend(made_of(&mut *to, tenant, &order.id).await?);
    }
    if ids.iter().any(|id| !expected.contains(id)) {
        return Ok(Erased::InUse);
    }
    if !has(to, tenant, &order.id, order.renewed_before).await? {
        return Ok(Erased::Unknown);
    }
    for id in &ids {
        if let Some(id) = legal_hold(to, tenant, id).await? {
            return Ok(Erased::OnHold { id });
        }
        if is_needed(to, tenant, id).await? {
            return Ok(Erased::InUse);
        }
    }
    let mut items = Vec::with_capacity(ids.len());
    // What was made of an item goes before the item.
    for id in ids.iter().rev() {
        items.insert(0, release(to, tenant, id, now).await?);
    }
    let jobs = if order.cascade {
        delete_jobs(to, tenant, &order.id, now).await?
    } else {
        Vec::new()
    };
    let what = What {
        tenant,
        id: &order.id,
        by: &order.by,
        reason: order.reason,
    };
    let receipt = write_receipt(to, what, (items, jobs), now).await?;
    Ok(Erased::Done(Box::new(receipt)))
}

/// What was erased, by whom and why.
#[derive(Clone, Copy)]
pub(super) struct What<'a> {
    pub tenant: &'a Tenant,
    pub id: &'a str,
    pub by: &'a ErasureAgent,
    pub reason: ErasureReason,
}

/// Appends the row of an erasure to the audit trail, and stores the receipt, which names that row, the erased items and
/// the jobs that went with them.
pub(super) async fn write_receipt(
    to: &mut Transaction<'_>,
    what: What<'_>,
    (items, jobs): (Vec<ErasedItem>, Vec<String>),
    now: Timestamp,
) -> StoreResult<Receipt> {
    let event = erasure_event(what.by, what.tenant, what.id, now);
    let recorded = append(to, &[event]).await?;
    let receipt = Receipt {
        id: random_id(RECEIPT_PREFIX),
        tenant: what.tenant.clone(),
        item: what.id.to_owned(),
        selected_by: Vec::new(),
        erased_at: now,
        erased_by: what.by.name.clone(),
        audit: AuditMark {
            sequence: recorded.sequence,
            hash: recorded.hash,
        },
        reason: what.reason,
        items,
        jobs,
    };
    store_receipt(to, &receipt).await?;
    Ok(receipt)
}

/// Stores a receipt.
pub(super) async fn store_receipt(to: &mut Transaction<'_>, receipt: &Receipt) -> StoreResult<()> {
    query(
        "INSERT INTO erasures (id, tenant, item, erased_at, erased_by, receipt)
         VALUES ($1, $2, $3, $4, $5, $6)",
    )
    .bind(&receipt.id)
    .bind(receipt.tenant.as_str())
    .bind(&receipt.item)
    .bind(receipt.erased_at)
    .bind(&receipt.erased_by)
    .bind(to_json(receipt)?)
    .execute(to)
    .await?;
    Ok(())
}

/// The row of the audit trail about an erasure.
pub(super) fn erasure_event(
    by: &ErasureAgent,
    tenant: &Tenant,
    item: &str,
    now: Timestamp,
) -> AuditEvent {
    let by = by.clone();
    let event = AuditEvent {
        key: by.key,
        address: by.address,
        request: by.request,
        ..AuditEvent::new(now, Activity::Delete, tenant.clone(), by.name)
    };
    event.on(item)
}

async fn has(
    from: &mut Transaction<'_>,
    tenant: &Tenant,
    id: &str,
    renewed_before: Option<Cutoff>,
) -> StoreResult<bool> {
    let row = query("SELECT 1 FROM holdings WHERE tenant = $1 AND id = $2 AND renewed_at < $3")
        .bind(tenant.as_str())
        .bind(id)
        .bind(renewed_before.map_or(Timestamp::MAX, Cutoff::moment))
        .fetch_optional(from)
        .await?;
    Ok(row.is_some())
}

/// The item on legal hold that keeps this one: itself, or a volume that it was made of.
pub(super) async fn legal_hold(
    from: &mut Transaction<'_>,
    tenant: &Tenant,
    id: &str,
) -> StoreResult<Option<String>> {
    let row = query(
        "SELECT id FROM holdings WHERE tenant = $1 AND held_at IS NOT NULL AND id IN
             (SELECT $2 UNION ALL SELECT volume FROM sources WHERE tenant = $1 AND id = $2)",
    )
    .bind(tenant.as_str())
    .bind(id)
    .fetch_optional(from)
    .await?;
    row.map(|row| row.try_get(0)).transpose()
}

/// Whether a job that has not ended needs the item.
async fn is_needed(from: &mut Transaction<'_>, tenant: &Tenant, id: &str) -> StoreResult<bool> {
    let row = query(
        "SELECT 1 FROM jobs WHERE tenant = $1 AND volume = $2 AND state IN ('queued', 'running')
         UNION ALL
         SELECT 1 FROM jobs WHERE needs != '{}' AND state IN ('queued', 'running')
             AND tenant = $1 AND EXISTS (SELECT 1 FROM json_each(jobs.needs) WHERE value = $2)
         LIMIT 1",
    )
    .bind(tenant.as_str())
    .bind(id)
    .fetch_optional(from)
    .await?;
    Ok(row.is_some())
}

/// Deletes a tenant's ownership and, if it was the last one, the record of the content.
pub(super) async fn release(
    to: &mut Transaction<'_>,
    tenant: &Tenant,
    id: &str,
    now: Timestamp,
) -> StoreResult<ErasedItem> {
    let files = files_of(to, id).await?;
    query("DELETE FROM holdings WHERE tenant = $1 AND id = $2")
        .bind(tenant.as_str())
        .bind(id)
        .execute(&mut *to)
        .await?;
    let delete = match Resource::from_id(id) {
        Some(Resource::Volume) => {
            "DELETE FROM volumes WHERE id = $1
                 AND NOT EXISTS (SELECT 1 FROM holdings WHERE id = $1)"
        }
        _ => {
            "DELETE FROM products WHERE id = $1
                 AND NOT EXISTS (SELECT 1 FROM holdings WHERE id = $1)"
        }
    };
    let done = query(delete).bind(id).execute(&mut *to).await?;
    record_deletion(to, tenant, id, now).await?;
    Ok(ErasedItem {
        id: id.to_owned(),
        files_erased: done == 1,
        files,
    })
}

/// The files of an item as its record describes them.
pub(super) async fn files_of(from: &mut Transaction<'_>, id: &str) -> StoreResult<Vec<ErasedFile>> {
    let row = query(
        "SELECT files FROM volumes WHERE id = $1 UNION ALL SELECT files FROM products WHERE id = $1",
    )
    .bind(id)
    .fetch_optional(from)
    .await?;
    match row {
        Some(row) => rows::json(&row, "files"),
        None => Ok(Vec::new()),
    }
}

/// Deletes the records of the jobs on a volume, or that needed it.
pub(super) async fn delete_jobs(
    to: &mut Transaction<'_>,
    tenant: &Tenant,
    volume: &str,
    now: Timestamp,
) -> StoreResult<Vec<String>> {
    let rows = query(
        "DELETE FROM jobs WHERE state NOT IN ('queued', 'running') AND sequence IN (
             SELECT sequence FROM jobs WHERE tenant = $1 AND volume = $2
             UNION ALL
             SELECT sequence FROM jobs
             WHERE needs != '{}' AND state IN ('succeeded', 'failed', 'cancelled')
                 AND tenant = $1 AND EXISTS (SELECT 1 FROM json_each(jobs.needs) WHERE value = $2))
         RETURNING id",
    )
    .bind(tenant.as_str())
    .bind(volume)
    .fetch_all(&mut *to)
    .await?;
    let mut jobs: Vec<String> = rows::all(rows, |row| row.try_get(0))?;
    jobs.sort();
    for id in &jobs {
        record_deletion(to, tenant, id, now).await?;
    }
    Ok(jobs)
}

/// Records that the item or job with that id was erased.
pub(super) async fn record_deletion(
    to: &mut Transaction<'_>,
    tenant: &Tenant,
    id: &str,
    now: Timestamp,
) -> StoreResult<()> {
    query(
        "INSERT INTO erased (tenant, id, erased_at) VALUES ($1, $2, $3)
         ON CONFLICT (tenant, id) DO UPDATE SET erased_at = excluded.erased_at",
    )
    .bind(tenant.as_str())
    .bind(id)
    .bind(now)
    .execute(to)
    .await?;
    Ok(())
}

/// Forgets that the item with that id was erased: it exists again.
pub(super) async fn forget_deletion(
    to: &mut Transaction<'_>,
    tenant: &Tenant,
    id: &str,
) -> StoreResult<()> {
    query("DELETE FROM erased WHERE tenant = $1 AND id = $2")
        .bind(tenant.as_str())
        .bind(id)
        .execute(to)
        .await?;
    Ok(())
}
