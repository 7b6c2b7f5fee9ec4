//! The tables of received objects.

use super::access::{append, record, stored_bytes};
use super::erasure::{What, write_receipt};
use super::owners::repaired;
use super::pages::push_page;
use super::rows::{self, to_json};
use crate::database::{SqlStore, Transaction};
use crate::query::{DbRow, QueryBuilder, query};
use async_trait::async_trait;
use std::collections::BTreeSet;
use ventriform_service::base::records::{
    Cutoff, ErasedFile, ErasedItem, ErasureAgent, ErasureReason, Failure, ListPage, ListRequest,
    Receipt, Receiving, StoreError, StoreResult, Tenant, Timestamp, random_id,
};
use ventriform_service::callers::Activity;
use ventriform_service::network::intake::{
    Added, GROUP_PREFIX, GroupState, IntakeGroup, IntakeRoom, IntakeStore, NewObject, Origin,
    Protocol, ReceivedObject,
};

/// The columns of a group, with what is counted of its objects.
const SELECT_GROUPS: &str = "SELECT g.*,
    (SELECT count(*) FROM intake_objects WHERE group_id = g.id) AS objects,
    CAST((SELECT coalesce(sum(bytes), 0) FROM intake_objects
     WHERE group_id = g.id AND file IS NOT NULL) AS BIGINT) AS waiting_bytes
    FROM intake_groups AS g";

#[async_trait]
impl IntakeStore for SqlStore {
    async fn add(
        &self,
        object: &NewObject,
        room: IntakeRoom,
        now: Timestamp,
    ) -> StoreResult<Added> {
        let mut transaction = self.writer.begin().await?;
        let (header, tenant) = (&object.header, object.origin.tenant.as_str());
        let obsolete = match earlier(&mut transaction, object).await? {
            Some((group, true, _)) => {
                reopen_failed(&mut transaction, &group, now).await?;
                record_first(&mut transaction, object, &group).await?;
                transaction.commit().await?;
                return Ok(Added::Known(group));
            }
            Some((_, false, None)) => return roll_back(transaction, Added::Conflict).await,
            Some((_, false, Some(file))) => {
                query("DELETE FROM intake_objects WHERE tenant = $1 AND sop_instance = $2")
                    .bind(tenant)
                    .bind(&header.sop_instance)
                    .execute(&mut transaction)
                    .await?;
                Some(file)
            }
            None => None,
        };
        if !has_room(&mut transaction, object, room).await? {
            return roll_back(transaction, Added::NoRoom).await;
        }
        let group = open_group(&mut transaction, object, now).await?;
        query(
            "INSERT INTO intake_objects (tenant, sop_instance, group_id, data_sha256, file_sha256,
                                         file, bytes, received_at, series)
             VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)",
        )
        .bind(tenant)
        .bind(&header.sop_instance)
        .bind(&group)
        .bind(&object.data_sha256)
        .bind(&object.file_sha256)
        .bind(&object.file)
        .bind(i64::try_from(object.bytes).unwrap_or(i64::MAX))
        .bind(now)
        .bind(header.gates.as_ref().map(|_| &header.series))
        .execute(&mut transaction)
        .await?;
        record_first(&mut transaction, object, &group).await?;
        transaction.commit().await?;
        Ok(Added::New(group, obsolete))
    }

    async fn unfinished(&self) -> StoreResult<Vec<IntakeGroup>> {
        let mut query = QueryBuilder::new(SELECT_GROUPS);
        query.push(" WHERE state IN ('gathering', 'filing') ORDER BY sequence");
        let rows = query.build().fetch_all(&self.readers).await?;
        rows::all(rows, group)
    }

    async fn group(&self, id: &str) -> StoreResult<Option<IntakeGroup>> {
        let mut query = QueryBuilder::new(SELECT_GROUPS);
        query.push(" WHERE g.id = ").push_bind(id);
        let row = query.build().fetch_optional(&self.readers).await?;
        row.map(group).transpose()
    }

    async fn objects(&self, group: &str) -> StoreResult<Vec<ReceivedObject>> {
        let rows = query(
            "SELECT file_sha256, file FROM intake_objects WHERE group_id = $1 ORDER BY sop_instance",
        )
        .bind(group)
        .fetch_all(&self.readers)
        .await?;
        rows::all(rows, |row| {
            Ok(ReceivedObject {
                file_sha256: row.try_get(0)?,
                file: row.try_get(1)?,
            })
        })
    }

    async fn made(
        &self,
        group: &str,
        revision: i64,
        volume: &str,
        now: Timestamp,
    ) -> StoreResult<()> {
        query(
            "UPDATE intake_groups SET volume = $1, changed_at = $2, failure = NULL,
                    state = CASE revision WHEN $3 THEN 'filing' ELSE state END
             WHERE id = $4",
        )
        .bind(volume)
        .bind(now)
        .bind(revision)
        .bind(group)
        .write(&self.writer)
        .await?;
        Ok(())
    }

    async fn filed(
        &self,
        group: &str,
        job: Option<&str>,
        failure: Option<&Failure>,
        now: Timestamp,
    ) -> StoreResult<Vec<String>> {
        let mut transaction = self.writer.begin().await?;
        let stored = query(
            "UPDATE intake_groups SET job = $1, failure = $2, state = 'stored', changed_at = $3
             WHERE id = $4 AND state = 'filing'",
        )
        .bind(job)
        .bind(failure.map(to_json).transpose()?)
        .bind(now)
        .bind(group)
        .execute(&mut transaction)
        .await?;
        let files = match stored {
            0 => Vec::new(),
            _ => files_of(&mut transaction, group).await?,
        };
        transaction.commit().await?;
        Ok(files)
    }

    async fn failed(
        &self,
        group: &str,
        revision: i64,
        failure: &Failure,
        now: Timestamp,
    ) -> StoreResult<()> {
        query(
            "UPDATE intake_groups SET state = 'failed', failure = $1, changed_at = $2
             WHERE id = $3 AND revision = $4 AND state = 'gathering'",
        )
        .bind(to_json(failure)?)
        .bind(now)
        .bind(group)
        .bind(revision)
        .write(&self.writer)
        .await?;
        Ok(())
    }

    async fn released(&self, files: &[String]) -> StoreResult<()> {
        let mut transaction = self.writer.begin().await?;
        for file in files {
            query(
                "UPDATE intake_objects SET file = NULL WHERE file = $1 AND EXISTS
                     (SELECT 1 FROM intake_groups WHERE id = group_id AND state = 'stored')",
            )
            .bind(file)
            .execute(&mut transaction)
            .await?;
        }
        transaction.commit().await
    }

    async fn releasable(&self) -> StoreResult<Vec<String>> {
        let rows = query(
            "SELECT file FROM intake_objects WHERE file IS NOT NULL AND EXISTS
                 (SELECT 1 FROM intake_groups WHERE id = group_id AND state = 'stored')",
        )
        .fetch_all(&self.readers)
        .await?;
        rows::all(rows, |row| row.try_get(0))
    }

    async fn groups(
        &self,
        tenant: &Tenant,
        state: Option<GroupState>,
        page: ListRequest,
    ) -> StoreResult<ListPage<IntakeGroup>> {
        let query = listed(tenant, state, page).build();
        let rows = query.fetch_all(&self.readers).await?;
        rows::page(rows, page, group, |group| group.sequence)
    }

    async fn receiving(&self, tenant: &Tenant) -> StoreResult<Receiving> {
        let row = query(
            "SELECT count(DISTINCT g.id), count(o.sop_instance), CAST(coalesce(sum(o.bytes), 0) AS BIGINT)
             FROM intake_groups AS g
             LEFT JOIN intake_objects AS o ON o.group_id = g.id AND o.file IS NOT NULL
             WHERE g.tenant = $1 AND g.state IN ('gathering', 'filing')",
        )
        .bind(tenant.as_str())
        .fetch_one(&self.readers)
        .await?;
        let count = |column: usize| row.try_get(column).map(rows::unsigned);
        Ok(Receiving {
            groups: count(0)?,
            objects: count(1)?,
            bytes: count(2)?,
        })
    }

    async fn remove(
        &self,
        tenant: &Tenant,
        id: &str,
        by: &ErasureAgent,
        reason: ErasureReason,
        now: Timestamp,
    ) -> StoreResult<Option<(Vec<String>, Receipt)>> {
        let what = What {
            tenant,
            id,
            by,
            reason,
        };
        self.making_room(|| self.remove_once(what, now)).await
    }

    async fn failed_before(&self, before: Cutoff) -> StoreResult<Vec<(Tenant, String)>> {
        let rows = query(
            "SELECT tenant, id FROM intake_groups WHERE state = 'failed' AND changed_at < $1",
        )
        .bind(before.moment())
        .fetch_all(&self.readers)
        .await?;
        rows::all(rows, |row| Ok((rows::tenant(&row)?, row.try_get("id")?)))
    }

    async fn files(&self) -> StoreResult<BTreeSet<String>> {
        let rows = query("SELECT file FROM intake_objects WHERE file IS NOT NULL")
            .fetch_all(&self.readers)
            .await?;
        rows.into_iter().map(|row| row.try_get(0)).collect()
    }

    async fn waiting(&self) -> StoreResult<(u64, u64)> {
        let row = query(
            "SELECT count(*), CAST(coalesce(sum(bytes), 0) AS BIGINT) FROM intake_objects
             WHERE file IS NOT NULL",
        )
        .fetch_one(&self.readers)
        .await?;
        Ok((
            rows::unsigned(row.try_get(0)?),
            rows::unsigned(row.try_get(1)?),
        ))
    }
}

impl SqlStore {
    /// Tries the erasure of the method without `_once`.
    async fn remove_once(
        &self,
        what: What<'_>,
        now: Timestamp,
    ) -> StoreResult<Option<(Vec<String>, Receipt)>> {
        let id = what.id;
        let mut transaction = self.writer.begin().await?;
        let known = query("SELECT 1 FROM intake_groups WHERE id = $1 AND tenant = $2")
            .bind(id)
            .bind(what.tenant.as_str())
            .fetch_optional(&mut transaction)
            .await?;
        if known.is_none() {
            return roll_back(transaction, None).await;
        }
        let files = files_of(&mut transaction, id).await?;
        let item = ErasedItem {
            id: id.to_owned(),
            files_erased: true,
            files: waiting_of(&mut transaction, id).await?,
        };
        query("DELETE FROM intake_groups WHERE id = $1")
            .bind(id)
            .execute(&mut transaction)
            .await?;
        let receipt = write_receipt(&mut transaction, what, (vec![item], Vec::new()), now).await?;
        transaction.commit().await?;
        Ok(Some((files, receipt)))
    }
}

impl SqlStore {
    /// Name and SHA-256 of every file of an object that waits.
    pub(crate) async fn waiting_files(&self) -> StoreResult<Vec<(String, String)>> {
        let rows = query(
            "SELECT file, file_sha256 FROM intake_objects WHERE file IS NOT NULL ORDER BY file",
        )
        .fetch_all(&self.readers)
        .await?;
        rows::all(rows, |row| Ok((row.try_get(0)?, row.try_get(1)?)))
    }

    /// Removes the object that has this file, with a row of the trail at that time; with `None` there is no such row, as in a
    /// copy, whose trail stays that of the original.
    pub(crate) async fn forget_received(
        &self,
        file: &str,
        now: Option<Timestamp>,
    ) -> StoreResult<()> {
        let mut transaction = self.writer.begin().await?;
        let removed =
            query("DELETE FROM intake_objects WHERE file = $1 RETURNING tenant, group_id")
                .bind(file)
                .fetch_optional(&mut transaction)
                .await?;
        if let (Some(row), Some(now)) = (removed, now) {
            let (tenant, group) = (rows::tenant(&row)?, row.try_get("group_id")?);
            append(&mut transaction, &[repaired(group, Some(&tenant), now)]).await?;
        }
        transaction.commit().await
    }
}

/// The files of a group's objects that wait, for the receipt of their erasure.
async fn waiting_of(from: &mut Transaction<'_>, group: &str) -> StoreResult<Vec<ErasedFile>> {
    let rows = query(
        "SELECT file, bytes, file_sha256 FROM intake_objects
         WHERE group_id = $1 AND file IS NOT NULL ORDER BY file",
    )
    .bind(group)
    .fetch_all(from)
    .await?;
    rows::all(rows, |row| {
        Ok(ErasedFile {
            name: row.try_get(0)?,
            bytes: rows::unsigned(row.try_get(1)?),
            sha256: row.try_get(2)?,
        })
    })
}

/// Records that a session brings objects of `group`, with the first of them.
async fn record_first(
    to: &mut Transaction<'_>,
    object: &NewObject,
    group: &str,
) -> StoreResult<()> {
    if object.recorded.contains(group) {
        return Ok(());
    }
    record(to, Activity::Create, group).await
}

/// Ends a transaction that has changed nothing.
async fn roll_back<T>(transaction: Transaction<'_>, answer: T) -> StoreResult<T> {
    // A commit keeps the connection; there is nothing to undo.
    transaction.commit().await?;
    Ok(answer)
}

/// A page of a tenant's groups.
pub(super) fn listed(
    tenant: &Tenant,
    state: Option<GroupState>,
    page: ListRequest,
) -> QueryBuilder {
    let mut query = QueryBuilder::new(SELECT_GROUPS);
    query.push(" WHERE tenant = ").push_bind(tenant.as_str());
    if let Some(state) = state {
        query.push(" AND state = ").push_bind(state.as_str());
    }
    push_page(&mut query, "sequence", page);
    query
}

/// The group of an object with the same SOP Instance UID, whether it is the same object, and, if it
/// may be replaced because its group failed, its file.
async fn earlier(
    to: &mut Transaction<'_>,
    object: &NewObject,
) -> StoreResult<Option<(String, bool, Option<String>)>> {
    let row = query(
        "SELECT group_id, data_sha256 = $1 AND study = $2 AND coalesce(o.series, g.series) = $3, file,
                state = 'failed'
         FROM intake_objects AS o JOIN intake_groups AS g ON g.id = o.group_id
         WHERE o.tenant = $4 AND sop_instance = $5",
    )
    .bind(&object.data_sha256)
    .bind(&object.header.study)
    .bind(&object.header.series)
    .bind(object.origin.tenant.as_str())
    .bind(&object.header.sop_instance)
    .fetch_optional(to)
    .await?;
    let Some(row) = row else { return Ok(None) };
    let file: Option<String> = row.try_get(2)?;
    let failed: bool = row.try_get(3)?;
    Ok(Some((
        row.try_get(0)?,
        row.try_get(1)?,
        file.filter(|_| failed),
    )))
}

/// A group that could not be read is read again when its objects are sent again.
async fn reopen_failed(to: &mut Transaction<'_>, group: &str, now: Timestamp) -> StoreResult<()> {
    query(
        "UPDATE intake_groups SET state = 'gathering', failure = NULL, revision = revision + 1,
                changed_at = $1 WHERE id = $2 AND state = 'failed'",
    )
    .bind(now)
    .bind(group)
    .execute(to)
    .await?;
    Ok(())
}

async fn has_room(
    to: &mut Transaction<'_>,
    object: &NewObject,
    room: IntakeRoom,
) -> StoreResult<bool> {
    // Of all tenants, what may still become a volume; of this one, all that takes room.
    let row = query(
        "SELECT count(*) FILTER (WHERE state != 'failed'),
                CAST(coalesce(sum(bytes) FILTER (WHERE state != 'failed'), 0) AS BIGINT),
                count(*) FILTER (WHERE o.tenant = $1),
                CAST(coalesce(sum(bytes) FILTER (WHERE o.tenant = $1), 0) AS BIGINT),
                count(DISTINCT o.tenant) FILTER (WHERE o.tenant != $1 AND state != 'failed')
         FROM intake_objects AS o JOIN intake_groups AS g ON g.id = o.group_id
         WHERE file IS NOT NULL",
    )
    .bind(object.origin.tenant.as_str())
    .fetch_one(&mut *to)
    .await?;
    let mut counted = [0; 5];
    for (column, count) in counted.iter_mut().enumerate() {
        *count = rows::unsigned(row.try_get(column)?);
    }
    let [objects, bytes, own_objects, own_bytes, others] = counted;
    let shared = |used: u64, own: u64, added: u64, limit: u64| {
        let own = own.saturating_add(added);
        // A tenant that has less than its equal share has room also where others have taken all.
        own <= limit
            && (used.saturating_add(added) <= limit || own.saturating_mul(others + 1) <= limit)
    };
    if !shared(objects, own_objects, 1, room.objects)
        || !shared(bytes, own_bytes, object.bytes, room.bytes)
    {
        return Ok(false);
    }
    let Some(limit) = room.tenant_bytes else {
        return Ok(true);
    };
    let stored = stored_bytes(to, &object.origin.tenant).await?;
    Ok(stored.saturating_add(object.bytes) <= limit)
}

/// Finds or makes the group of an object, and opens it. Returns its id.
async fn open_group(
    to: &mut Transaction<'_>,
    object: &NewObject,
    now: Timestamp,
) -> StoreResult<String> {
    let (header, origin) = (&object.header, &object.origin);
    let instance = if header.is_part {
        ""
    } else {
        header.sop_instance.as_str()
    };
    if let Some(known) = group_of_gates(to, object).await? {
        let row = query(
            "UPDATE intake_groups SET protocol = $1, sender = $2, address = $3, state = 'gathering',
                    revision = revision + 1, failure = NULL, changed_at = $4
             WHERE id = $5 RETURNING id",
        )
        .bind(origin.protocol.as_str())
        .bind(&origin.sender)
        .bind(&origin.address)
        .bind(now)
        .bind(known)
        .fetch_one(to)
        .await?;
        return row.try_get(0);
    }
    let statement = match header.gates {
        Some(_) => OPEN_GATES,
        None => OPEN_GROUP,
    };
    let row = query(statement)
        .bind(random_id(GROUP_PREFIX))
        .bind(origin.tenant.as_str())
        .bind(&header.study)
        .bind(&header.series)
        .bind(instance)
        .bind(&header.modality)
        .bind(rows::to_json(&header.image_type)?)
        .bind(&header.study_description)
        .bind(origin.protocol.as_str())
        .bind(&origin.sender)
        .bind(&origin.address)
        .bind(now)
        .bind(&header.gates)
        .fetch_one(to)
        .await?;
    row.try_get(0)
}

/// Makes the group of an object that has none, or opens it; a group is known by these columns.
macro_rules! open_by {
    ($columns:literal) => {
        concat!(
            "INSERT INTO intake_groups (id, tenant, study, series, instance, modality, image_type,
                 study_description, protocol, sender, address, state, revision, created_at, changed_at, gates)
             VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, 'gathering', 1, $12, $12, $13)
             ON CONFLICT (",
            $columns,
            ") DO UPDATE SET
                 protocol = excluded.protocol, sender = excluded.sender, address = excluded.address,
                 state = 'gathering', revision = intake_groups.revision + 1, failure = NULL,
                 changed_at = excluded.changed_at
             RETURNING id"
        )
    };
}
const OPEN_GROUP: &str = open_by!("tenant, study, series, instance");
const OPEN_GATES: &str = open_by!("tenant, study, gates");

/// The group of an earlier object of the same series, if the object is one of one gate: a series stays together, whatever differs
/// between its objects.
async fn group_of_gates(
    to: &mut Transaction<'_>,
    object: &NewObject,
) -> StoreResult<Option<String>> {
    let header = &object.header;
    if header.gates.is_none() {
        return Ok(None);
    }
    let row = query(
        "SELECT id FROM intake_groups WHERE tenant = $1 AND study = $2 AND series = $3 AND instance = ''
         UNION ALL
         SELECT g.id FROM intake_groups AS g JOIN intake_objects AS o ON o.group_id = g.id
         WHERE g.tenant = $1 AND g.study = $2 AND o.series = $3
         LIMIT 1",
    )
    .bind(object.origin.tenant.as_str())
    .bind(&header.study)
    .bind(&header.series)
    .fetch_optional(to)
    .await?;
    row.map(|row| row.try_get(0)).transpose()
}

async fn files_of(to: &mut Transaction<'_>, group: &str) -> StoreResult<Vec<String>> {
    let rows = query("SELECT file FROM intake_objects WHERE group_id = $1 AND file IS NOT NULL")
        .bind(group)
        .fetch_all(to)
        .await?;
    rows::all(rows, |row| row.try_get(0))
}

fn group(row: DbRow) -> StoreResult<IntakeGroup> {
    let damaged = |what: &str| StoreError::database(format!("damaged row: {what}"));
    let instance: String = row.try_get("instance")?;
    Ok(IntakeGroup {
        id: row.try_get("id")?,
        sequence: row.try_get("sequence")?,
        origin: Origin {
            tenant: rows::tenant(&row)?,
            protocol: Protocol::parse(row.try_get("protocol")?)
                .ok_or_else(|| damaged("protocol"))?,
            sender: row.try_get("sender")?,
            address: row
                .try_get::<Option<String>, _>("address")?
                .unwrap_or_default(),
        },
        study: row.try_get("study")?,
        series: row.try_get("series")?,
        instance: Some(instance).filter(|instance| !instance.is_empty()),
        modality: row.try_get("modality")?,
        image_type: rows::json(&row, "image_type")?,
        study_description: row.try_get("study_description")?,
        state: GroupState::parse(row.try_get("state")?).ok_or_else(|| damaged("state"))?,
        revision: row.try_get("revision")?,
        volume: row.try_get("volume")?,
        job: row.try_get("job")?,
        failure: rows::optional_json(&row, "failure")?,
        objects: rows::unsigned(row.try_get("objects")?),
        waiting_bytes: rows::unsigned(row.try_get("waiting_bytes")?),
        created_at: row.try_get("created_at")?,
        changed_at: row.try_get("changed_at")?,
    })
}
