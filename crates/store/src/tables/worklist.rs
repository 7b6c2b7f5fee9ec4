//! The table of work items.

use super::access::{append, record};
use super::erasure::{What, erasure_event, forget_deletion, record_deletion, write_receipt};
use super::rows::{self, to_json};
use crate::database::SqlStore;
use crate::query::{DbRow, query};
use async_trait::async_trait;
use ventriform_service::base::records::{
    Bounded, Cutoff, Erased, ErasedItem, ErasureAgent, ErasureReason, StoreError, StoreResult,
    Tenant, Timestamp,
};
use ventriform_service::callers::Activity;
use ventriform_service::network::worklist::{
    AddedWorkitem, BATCH_BYTES, DataSetJson, Performer, Workitem, WorkitemState, Worklist,
};

#[async_trait]
impl Worklist for SqlStore {
    async fn add_workitem(&self, item: &Workitem, limit: u64) -> StoreResult<AddedWorkitem> {
        self.require_room()?;
        let mut transaction = self.writer.begin().await?;
        let added = query(
            "INSERT INTO workitems (tenant, uid, state, attributes, changed_at)
             SELECT $1, $2, $3, $4, $5
             WHERE (SELECT count(*) FROM workitems WHERE tenant = $1) < $6
             ON CONFLICT (tenant, uid) DO NOTHING",
        )
        .bind(item.tenant.as_str())
        .bind(&item.uid)
        .bind(item.state.as_str())
        .bind(to_json(item.attributes.object())?)
        .bind(item.changed_at)
        .bind(i64::try_from(limit).unwrap_or(i64::MAX))
        .execute(&mut transaction)
        .await?;
        if added == 1 {
            forget_deletion(&mut transaction, &item.tenant, &item.uid).await?;
            record(&mut transaction, Activity::Create, &item.uid).await?;
        }
        transaction.commit().await?;
        if added == 1 {
            return Ok(AddedWorkitem::Done);
        }
        Ok(match self.workitem(&item.tenant, &item.uid).await? {
            Some(_) => AddedWorkitem::Exists,
            None => AddedWorkitem::Full,
        })
    }

    async fn workitem(&self, tenant: &Tenant, uid: &str) -> StoreResult<Option<Workitem>> {
        let row = query("SELECT * FROM workitems WHERE tenant = $1 AND uid = $2")
            .bind(tenant.as_str())
            .bind(uid)
            .fetch_optional(&self.readers)
            .await?;
        row.map(item_of).transpose()
    }

    async fn workitem_within(
        &self,
        tenant: &Tenant,
        uid: &str,
        bytes: u64,
    ) -> StoreResult<Bounded<Workitem>> {
        let one = |columns: &str, bounded: &str| {
            let text =
                format!("SELECT {columns} FROM workitems WHERE tenant = $1 AND uid = $2{bounded}");
            query(text).bind(tenant.as_str()).bind(uid)
        };
        let within = one("*", " AND bytes <= $3").bind(rows::bytes_bound(bytes));
        rows::bounded(self, within, one("bytes", ""), item_of).await
    }

    async fn change_workitem(&self, item: &Workitem) -> StoreResult<bool> {
        let mut transaction = self.writer.begin().await?;
        let changed = query(
            "UPDATE workitems SET state = $1, transaction_uid = $2, performer = $3, attributes = $4,
                 changed_at = $5, revision = revision + 1
             WHERE tenant = $6 AND uid = $7 AND revision = $8",
        )
        .erasing()
        .bind(item.state.as_str())
        .bind(&item.transaction)
        .bind(performer_column(&item.performer))
        .bind(to_json(item.attributes.object())?)
        .bind(item.changed_at)
        .bind(item.tenant.as_str())
        .bind(&item.uid)
        .bind(item.revision)
        .execute(&mut transaction)
        .await?;
        if changed == 1 {
            record(&mut transaction, Activity::Update, &item.uid).await?;
        }
        transaction.commit().await?;
        Ok(changed == 1)
    }

    async fn workitems(
        &self,
        tenant: &Tenant,
        state: Option<WorkitemState>,
        after: i64,
        limit: u32,
    ) -> StoreResult<Vec<Workitem>> {
        let state = state.map(WorkitemState::as_str);
        let items = match state {
            None => query(batch("tenant = $4")).bind(after).bind(limit),
            Some(_) => query(batch("tenant = $4 AND state = $5"))
                .bind(after)
                .bind(limit),
        };
        let items = items.bind(most_bytes()).bind(tenant.as_str());
        let items = match state {
            None => items,
            Some(state) => items.bind(state),
        };
        rows::all(items.fetch_all(&self.readers).await?, item_of)
    }

    async fn scheduled_workitems(&self, after: i64, limit: u32) -> StoreResult<Vec<Workitem>> {
        let items = query(batch("state = 'SCHEDULED'")).bind(after).bind(limit);
        let items = items.bind(most_bytes()).fetch_all(&self.readers);
        rows::all(items.await?, item_of)
    }

    async fn performed_workitems(&self, after: i64, limit: u32) -> StoreResult<Vec<Workitem>> {
        let which = "state = 'IN PROGRESS' AND performer IS NOT NULL";
        let items = query(batch(which)).bind(after).bind(limit);
        let items = items.bind(most_bytes()).fetch_all(&self.readers);
        rows::all(items.await?, item_of)
    }

    async fn delete_ended_workitems(&self, before: Cutoff, now: Timestamp) -> StoreResult<u64> {
        let by = ErasureAgent::retention();
        let mut deleted = 0;
        loop {
            let mut transaction = self.writer.begin().await?;
            let rows = query(
                "DELETE FROM workitems WHERE sequence IN (
                     SELECT sequence FROM workitems
                     WHERE state IN ('COMPLETED', 'CANCELED') AND changed_at < $1
                     ORDER BY changed_at LIMIT $2)
                 RETURNING tenant, uid",
            )
            .bind(before.moment())
            .bind(ERASED_ITEMS)
            .fetch_all(&mut transaction)
            .await?;
            let count = rows.len();
            for row in rows {
                let (tenant, uid) = (rows::tenant(&row)?, row.try_get::<String, _>("uid")?);
                record_deletion(&mut transaction, &tenant, &uid, now).await?;
                append(&mut transaction, &[erasure_event(&by, &tenant, &uid, now)]).await?;
            }
            transaction.commit().await?;
            deleted += count as u64;
            if count < ERASED_ITEMS as usize {
                return Ok(deleted);
            }
        }
    }

    async fn erase_workitem(
        &self,
        tenant: &Tenant,
        uid: &str,
        by: &ErasureAgent,
        now: Timestamp,
    ) -> StoreResult<Erased> {
        self.making_room(|| self.erase_workitem_once(tenant, uid, by, now))
            .await
    }
}

impl SqlStore {
    /// Tries the erasure of the method without `_once`.
    async fn erase_workitem_once(
        &self,
        tenant: &Tenant,
        uid: &str,
        by: &ErasureAgent,
        now: Timestamp,
    ) -> StoreResult<Erased> {
        let mut transaction = self.writer.begin().await?;
        let done = query(
            "DELETE FROM workitems WHERE tenant = $1 AND uid = $2
                 AND NOT (state = 'IN PROGRESS' AND performer IS NOT NULL)",
        )
        .bind(tenant.as_str())
        .bind(uid)
        .execute(&mut transaction)
        .await?;
        if done == 0 {
            transaction.commit().await?;
            let known = self.workitem(tenant, uid).await?;
            return Ok(known.map_or(Erased::Unknown, |_| Erased::InUse));
        }
        record_deletion(&mut transaction, tenant, uid, now).await?;
        let item = ErasedItem {
            id: uid.to_owned(),
            files_erased: true,
            files: Vec::new(),
        };
        let what = What {
            tenant,
            id: uid,
            by,
            reason: ErasureReason::Request,
        };
        let receipt = write_receipt(&mut transaction, what, (vec![item], Vec::new()), now).await?;
        transaction.commit().await?;
        Ok(Erased::Done(Box::new(receipt)))
    }
}

/// Ended items that are erased in one transaction.
const ERASED_ITEMS: u32 = 200;

/// A statement for the items for which `which` holds: at most `$2` after position `$1`, as long as those before each
/// have fewer than `$3` bytes together. Sizes are added up before any item is read.
fn batch(which: &str) -> String {
    format!(
        "SELECT * FROM workitems WHERE sequence IN (
             SELECT sequence FROM (
                 SELECT sequence, bytes, sum(bytes) OVER (ORDER BY sequence) AS total FROM (
                     SELECT sequence, bytes FROM workitems WHERE {which} AND sequence > $1
                     ORDER BY sequence LIMIT $2) AS next) AS added
             WHERE total - bytes < $3)
         ORDER BY sequence"
    )
}

fn most_bytes() -> i64 {
    i64::try_from(BATCH_BYTES).unwrap_or(i64::MAX)
}

fn item_of(row: DbRow) -> StoreResult<Workitem> {
    let damaged = |what: String| StoreError::database(format!("damaged row: {what}"));
    let state: &str = row.try_get("state")?;
    let attributes = DataSetJson::from_object(rows::json(&row, "attributes")?);
    Ok(Workitem {
        tenant: rows::tenant(&row)?,
        uid: row.try_get("uid")?,
        sequence: row.try_get("sequence")?,
        revision: row.try_get("revision")?,
        state: WorkitemState::parse(state).ok_or_else(|| damaged(state.to_owned()))?,
        transaction: row.try_get("transaction_uid")?,
        performer: performer_of(row.try_get("performer")?),
        attributes: attributes.map_err(|error| damaged(error.to_string()))?,
        changed_at: row.try_get("changed_at")?,
    })
}

/// The column of a performer: the id of its job, empty while the job is not filed.
fn performer_column(performer: &Performer) -> Option<&str> {
    match performer {
        Performer::None => None,
        Performer::Claimed => Some(""),
        Performer::Job(id) => Some(id),
    }
}

fn performer_of(column: Option<String>) -> Performer {
    match column {
        None => Performer::None,
        Some(id) if id.is_empty() => Performer::Claimed,
        Some(id) => Performer::Job(id),
    }
}
