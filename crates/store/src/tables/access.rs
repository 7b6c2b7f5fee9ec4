//! The tables of keys and of the audit trail.

use super::marks::{Access, kept_head, set_access};
use super::pages::{Times, push_page, push_times};
use super::rows::{self, to_json};
use crate::database::{SqlStore, Transaction};
use crate::query::{DbRow, QueryBuilder, query};
use async_trait::async_trait;
use ventriform_service::base::records::{
    Cutoff, ListPage, ListRequest, StoreResult, Tenant, Timestamp,
};
use ventriform_service::callers::{
    AccessStore, Activity, Agent, Anchor, ApiKey, AuditEvent, AuditFilter, AuditLink, AuditRecord,
    KeptRow, Maker, NO_HASH, Outcome, Quota, Usage, chain_hash,
};

/// The bytes of everything that tenant `$1` stores: volumes, products (results, templates, readers), received
/// objects that are not part of a volume, work items, and the records of jobs. Triggers keep the total, see
/// `migrations/0002_totals.sql`: it takes the same time however much is stored.
const STORED_BYTES: &str = "coalesce((SELECT bytes FROM stored_bytes WHERE tenant = $1), 0)";

/// The bytes of everything that a tenant stores.
pub(super) async fn stored_bytes(of: &mut Transaction<'_>, tenant: &Tenant) -> StoreResult<u64> {
    let row = query(format!("SELECT {STORED_BYTES}"))
        .bind(tenant.as_str())
        .fetch_one(&mut *of)
        .await?;
    Ok(rows::unsigned(row.try_get(0)?))
}

/// Whether there is a key that was made after the operator opened the service at `$1`, or had not ended then. Making a
/// key closes the service in the same transaction; a repaired database may have the key without that.
const KEYS_SINCE_OPENED: &str = "SELECT EXISTS (SELECT 1 FROM api_keys
    WHERE created_at > $1 OR (revoked_at IS NULL AND (expires_at IS NULL OR expires_at > $1)))";

/// The newest receipt that names a row of the trail which is not there, though no removal by age took it.
const UNCONFIRMED_RECEIPT: &str = "
    SELECT id, mark AS sequence, mark_hash AS hash FROM (
        SELECT id, sequence AS place, CAST(json_extract(receipt, '$.audit.sequence') AS INTEGER) AS mark,
               json_extract(receipt, '$.audit.hash') AS mark_hash FROM erasures) AS named
    WHERE mark > coalesce((SELECT max(sequence) FROM audit_anchors), 0)
      AND NOT EXISTS (SELECT 1 FROM audit WHERE audit.sequence = mark AND audit.hash = mark_hash)
    ORDER BY mark DESC, place DESC LIMIT 1";

/// The same for PostgreSQL.
const UNCONFIRMED_RECEIPT_ON_POSTGRES: &str = "
    SELECT id, mark AS sequence, mark_hash AS hash FROM (
        SELECT id, sequence AS place,
               CAST(json_field(json_field(receipt, 'audit'), 'sequence') AS BIGINT) AS mark,
               json_field(json_field(receipt, 'audit'), 'hash') AS mark_hash FROM erasures) AS named
    WHERE mark > coalesce((SELECT max(sequence) FROM audit_anchors), 0)
      AND NOT EXISTS (SELECT 1 FROM audit WHERE audit.sequence = mark AND audit.hash = mark_hash)
    ORDER BY mark DESC, place DESC LIMIT 1";

#[async_trait]
impl AccessStore for SqlStore {
    async fn add_key(&self, key: &ApiKey, event: &AuditEvent) -> StoreResult<()> {
        let mut transaction = self.writer.begin().await?;
        query(
            "INSERT INTO api_keys (id, name, tenant, scope, requests, bytes, jobs, created_at,
                                   expires_at, revoked_at, digest, maker, owner)
             VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13)",
        )
        .bind(&key.id)
        .bind(&key.name)
        .bind(key.tenant.as_str())
        .bind(key.scope.as_str())
        .bind(key.quota.requests.map(signed))
        .bind(key.quota.bytes.map(signed))
        .bind(key.quota.jobs.map(signed))
        .bind(key.created_at)
        .bind(key.expires_at)
        .bind(key.revoked_at)
        .bind(&key.digest)
        .bind(match &key.maker {
            Maker::Operator => None,
            Maker::Caller(key) => Some(key.as_deref().unwrap_or_default()),
        })
        .bind(&key.owner)
        .execute(&mut transaction)
        .await?;
        set_access(&mut transaction, Access::Closed).await?;
        append(&mut transaction, std::slice::from_ref(event)).await?;
        transaction.commit().await?;
        self.note_beside().await
    }

    async fn key(&self, id: &str) -> StoreResult<Option<ApiKey>> {
        let row = query("SELECT * FROM api_keys WHERE id = $1")
            .bind(id)
            .fetch_optional(&self.readers)
            .await?;
        row.map(read_key).transpose()
    }

    async fn keys(
        &self,
        tenant: Option<&Tenant>,
        page: ListRequest,
    ) -> StoreResult<ListPage<ApiKey>> {
        let query = listed_keys(tenant, page).build();
        let rows = query.fetch_all(&self.readers).await?;
        rows::page(rows, page, read_key, |key| key.sequence)
    }

    async fn is_closed(&self) -> StoreResult<bool> {
        let keys = match self.marks().await?.access {
            Some(Access::Closed) => return Ok(true),
            Some(Access::Opened(at)) => query(KEYS_SINCE_OPENED).bind(at),
            Some(Access::Open) | None => query("SELECT EXISTS (SELECT 1 FROM api_keys)"),
        };
        keys.fetch_one(&self.readers).await?.try_get(0)
    }

    async fn close_access(&self) -> StoreResult<()> {
        if self.marks().await?.access != Some(Access::Closed) {
            let mut transaction = self.writer.begin().await?;
            set_access(&mut transaction, Access::Closed).await?;
            transaction.commit().await?;
        }
        self.note_beside().await
    }

    async fn open_access(&self, now: Timestamp, event: &AuditEvent) -> StoreResult<bool> {
        let mut transaction = self.writer.begin().await?;
        let valid = "SELECT 1 FROM api_keys
                     WHERE revoked_at IS NULL AND (expires_at IS NULL OR expires_at > $1) LIMIT 1";
        let valid = query(valid).bind(now).fetch_optional(&mut transaction);
        if valid.await?.is_some() {
            return Ok(false);
        }
        set_access(&mut transaction, Access::Opened(now)).await?;
        append(&mut transaction, std::slice::from_ref(event)).await?;
        transaction.commit().await?;
        self.note_beside().await?;
        Ok(true)
    }

    async fn revoke_key(&self, id: &str, now: Timestamp, event: &AuditEvent) -> StoreResult<bool> {
        let mut transaction = self.writer.begin().await?;
        let done =
            query("UPDATE api_keys SET revoked_at = $1 WHERE id = $2 AND revoked_at IS NULL")
                .bind(now)
                .bind(id)
                .execute(&mut transaction)
                .await?;
        if done > 0 {
            append(&mut transaction, std::slice::from_ref(event)).await?;
        }
        transaction.commit().await?;
        Ok(done > 0 || self.key(id).await?.is_some())
    }

    async fn revoke_keys_of(
        &self,
        owner: &str,
        tenant: Option<&Tenant>,
        now: Timestamp,
        event: &AuditEvent,
    ) -> StoreResult<Vec<String>> {
        let mut transaction = self.writer.begin().await?;
        let rows = query(
            "UPDATE api_keys SET revoked_at = $1
             WHERE owner = $2 AND revoked_at IS NULL AND ($3 IS NULL OR tenant = $3)
             RETURNING id, tenant",
        )
        .on_postgres(
            "UPDATE api_keys SET revoked_at = $1
             WHERE owner = $2 AND revoked_at IS NULL AND ($3::text IS NULL OR tenant = $3)
             RETURNING id, tenant",
        )
        .bind(now)
        .bind(owner)
        .bind(tenant.map(Tenant::to_string))
        .fetch_all(&mut transaction)
        .await?;
        let mut revoked = Vec::with_capacity(rows.len());
        let mut events = Vec::with_capacity(rows.len());
        for row in rows {
            let id: String = row.try_get("id")?;
            let tenant = rows::tenant(&row)?;
            events.push(AuditEvent {
                tenant,
                ..event.clone().on(&id)
            });
            revoked.push(id);
        }
        append(&mut transaction, &events).await?;
        transaction.commit().await?;
        revoked.sort();
        Ok(revoked)
    }

    async fn usage(&self, tenant: &Tenant) -> StoreResult<Usage> {
        let row = query(format!(
            "SELECT {STORED_BYTES},
                    (SELECT count(*) FROM jobs WHERE tenant = $1 AND state = 'queued')"
        ))
        .bind(tenant.as_str())
        .fetch_one(&self.readers)
        .await?;
        Ok(Usage {
            bytes: rows::unsigned(row.try_get(0)?),
            jobs: rows::unsigned(row.try_get(1)?),
        })
    }

    async fn is_filed(&self, tenant: &Tenant, key: &str) -> StoreResult<bool> {
        let row = query("SELECT EXISTS (SELECT 1 FROM jobs WHERE idempotency_key = $1)")
            .bind(format!("{tenant}/{key}"))
            .fetch_one(&self.readers)
            .await?;
        Ok(row.try_get(0)?)
    }

    async fn append(&self, events: &[AuditEvent]) -> StoreResult<()> {
        let mut transaction = self.writer.begin().await?;
        append(&mut transaction, events).await?;
        transaction.commit().await?;
        Ok(())
    }

    async fn audit(
        &self,
        filter: &AuditFilter,
        page: ListRequest,
    ) -> StoreResult<ListPage<AuditRecord>> {
        let query = listed_events(filter, page).build();
        let rows = query.fetch_all(&self.readers).await?;
        rows::page(rows, page, read_record, |record| record.sequence)
    }

    async fn links(&self, after: i64, limit: u32) -> StoreResult<Vec<AuditLink>> {
        let rows = query(
            "SELECT sequence, event, hash FROM audit WHERE sequence > $1 ORDER BY sequence LIMIT $2",
        )
        .bind(after)
        .bind(i64::from(limit))
        .fetch_all(&self.readers)
        .await?;
        rows::all(rows, |row| {
            Ok(AuditLink {
                sequence: row.try_get("sequence")?,
                event: row.try_get("event")?,
                hash: row.try_get("hash")?,
            })
        })
    }

    async fn anchor(&self) -> StoreResult<Option<Anchor>> {
        let row = query("SELECT sequence, hash FROM audit_anchors ORDER BY sequence DESC LIMIT 1")
            .fetch_optional(&self.readers)
            .await?;
        row.map(read_anchor).transpose()
    }

    async fn greatest_sequence(&self) -> StoreResult<i64> {
        let row = query("SELECT seq FROM sqlite_sequence WHERE name = 'audit'")
            .on_postgres("SELECT sequence FROM audit_greatest")
            .fetch_optional(&self.readers)
            .await?;
        row.map_or(Ok(0), |row| row.try_get(0))
    }

    async fn unconfirmed(&self) -> StoreResult<Vec<KeptRow>> {
        let receipt = query(UNCONFIRMED_RECEIPT)
            .on_postgres(UNCONFIRMED_RECEIPT_ON_POSTGRES)
            .fetch_optional(&self.readers)
            .await?;
        let receipt = receipt.map(|row| -> StoreResult<KeptRow> {
            Ok(KeptRow {
                place: format!("receipt {}", row.try_get::<String, _>("id")?),
                sequence: row.try_get("sequence")?,
                hash: row.try_get("hash")?,
            })
        });
        let mut found: Vec<KeptRow> = receipt.transpose()?.into_iter().collect();
        for (place, head) in self.kept_heads().await? {
            if !self.confirms(&head).await? {
                found.push(KeptRow {
                    place,
                    sequence: head.sequence,
                    hash: head.hash,
                });
            }
        }
        found.sort_by_key(|row| std::cmp::Reverse(row.sequence));
        Ok(found)
    }

    async fn check_trail(&self, now: Timestamp) -> StoreResult<()> {
        let mut transaction = self.writer.begin().await?;
        query("SAVEPOINT trail").execute(&mut transaction).await?;
        let agent = "ventriform".to_owned();
        let event = AuditEvent::new(now, Activity::AuditRead, Tenant::default(), agent);
        append(&mut transaction, &[event]).await?;
        query("ROLLBACK TO trail").execute(&mut transaction).await?;
        transaction.commit().await
    }

    async fn prune(&self, before: Cutoff, now: Timestamp) -> StoreResult<u64> {
        let mut transaction = self.writer.begin().await?;
        // The event that records the removal remains, so the chain is never empty.
        let last = query(
            "SELECT sequence, hash FROM audit
             WHERE sequence < coalesce((SELECT min(sequence) FROM audit WHERE recorded >= $1),
                                       9223372036854775807)
             ORDER BY sequence DESC LIMIT 1",
        )
        .bind(before.moment())
        .fetch_optional(&mut transaction)
        .await?;
        let Some(last) = last.map(read_anchor).transpose()? else {
            transaction.commit().await?;
            return Ok(0);
        };
        query("INSERT INTO audit_anchors (sequence, hash, pruned_at) VALUES ($1, $2, $3)")
            .bind(last.sequence)
            .bind(&last.hash)
            .bind(now)
            .execute(&mut transaction)
            .await?;
        let done = query("DELETE FROM audit WHERE sequence <= $1")
            .bind(last.sequence)
            .execute(&mut transaction)
            .await?;
        let agent = "ventriform".to_owned();
        let event = AuditEvent {
            count: done,
            ..AuditEvent::new(now, Activity::AuditPruned, Tenant::default(), agent)
        };
        append(&mut transaction, &[event.on(last.name())]).await?;
        transaction.commit().await?;
        Ok(done)
    }
}

/// A page of the keys of one tenant, or of all.
pub(super) fn listed_keys(tenant: Option<&Tenant>, page: ListRequest) -> QueryBuilder {
    let mut query = QueryBuilder::new("SELECT * FROM api_keys WHERE TRUE");
    if let Some(tenant) = tenant {
        query.push(" AND tenant = ").push_bind(tenant.to_string());
    }
    push_page(&mut query, "sequence", page);
    query
}

/// A page of the audit trail.
pub(super) fn listed_events(filter: &AuditFilter, page: ListRequest) -> QueryBuilder {
    let mut query = QueryBuilder::new("SELECT sequence, event, hash FROM audit WHERE TRUE");
    let tenant = filter.tenant.as_ref();
    for (column, value) in [
        ("tenant", tenant.map(Tenant::to_string)),
        ("agent", filter.agent.clone()),
        ("object", filter.object.clone()),
    ] {
        if let Some(value) = value {
            query
                .push(" AND ")
                .push(column)
                .push(" = ")
                .push_bind(value);
        }
    }
    let since = filter.since.map(|moment| (">=", moment));
    let until = filter.until.map(|moment| ("<", moment));
    let bounds: Vec<(&str, Timestamp)> = since.into_iter().chain(until).collect();
    match tenant {
        Some(tenant) if !bounds.is_empty() => {
            let times = Times {
                table: "audit",
                column: "recorded",
                bounds: &bounds,
            };
            push_times(&mut query, &times, tenant);
        }
        _ => {
            for (than, moment) in bounds {
                query.push(" AND recorded ").push(than).push(" ");
                query.push_bind(moment);
            }
        }
    }
    push_page(&mut query, "sequence", page);
    query
}

/// Appends the row of an act to the chain, within the transaction that makes the change, if the change is made for
/// somebody ([`Agent::acting`]).
pub(super) async fn record(
    to: &mut Transaction<'_>,
    activity: Activity,
    object: &str,
) -> StoreResult<()> {
    record_outcome(to, activity, Outcome::Success, object).await
}

/// As [`record`], for an act that ended in that way.
pub(super) async fn record_outcome(
    to: &mut Transaction<'_>,
    activity: Activity,
    outcome: Outcome,
    object: &str,
) -> StoreResult<()> {
    if let Some(agent) = Agent::acting() {
        let event = AuditEvent {
            outcome,
            ..agent.acts(activity, object)
        };
        append(to, &[event]).await?;
    }
    Ok(())
}

/// Appends events to the chain, within a transaction that holds the database's write lock. Returns
/// the end of the chain.
pub(crate) async fn append(to: &mut Transaction<'_>, events: &[AuditEvent]) -> StoreResult<Anchor> {
    let Anchor {
        mut sequence,
        mut hash,
    } = end_of_trail(to).await?;
    for event in events {
        let event = to_json(event)?;
        sequence += 1;
        hash = chain_hash(&hash, sequence, &event);
        query("INSERT INTO audit (sequence, event, hash) VALUES ($1, $2, $3)")
            .bind(sequence)
            .bind(event)
            .bind(&hash)
            .execute(&mut *to)
            .await?;
    }
    Ok(Anchor { sequence, hash })
}

impl SqlStore {
    /// The newest row of the trail, or the last one that was removed because of its age.
    pub(crate) async fn trail_end(&self) -> StoreResult<Anchor> {
        let end = query(NEWEST_ROW).fetch_optional(&self.readers).await?;
        let end = end.map(read_anchor).transpose()?;
        Ok(end.unwrap_or_else(no_row))
    }

    /// Whether the trail has a row with that hash, has removed it because of its age, or says that the end of another
    /// trail was there.
    pub(crate) async fn confirms(&self, head: &Anchor) -> StoreResult<bool> {
        if head.sequence == 0 {
            return Ok(true);
        }
        let row = query(
            "SELECT EXISTS (SELECT 1 FROM audit WHERE sequence = $1 AND hash = $2)
                 OR EXISTS (SELECT 1 FROM audit_anchors WHERE sequence = $1 AND hash = $2)
                 OR $1 < coalesce((SELECT max(sequence) FROM audit_anchors), 0)
                 OR EXISTS (SELECT 1 FROM audit WHERE object = $3
                            AND json_extract(event, '$.activity') = 'trail-applied')",
        )
        .on_postgres(
            "SELECT EXISTS (SELECT 1 FROM audit WHERE sequence = $1 AND hash = $2)
                 OR EXISTS (SELECT 1 FROM audit_anchors WHERE sequence = $1 AND hash = $2)
                 OR $1 < coalesce((SELECT max(sequence) FROM audit_anchors), 0)
                 OR EXISTS (SELECT 1 FROM audit WHERE object = $3
                            AND json_field(event, 'activity') = 'trail-applied')",
        )
        .bind(head.sequence)
        .bind(&head.hash)
        .bind(head.name())
        .fetch_one(&self.readers)
        .await?;
        row.try_get(0)
    }
}

/// The newest row of the trail or of the removals by age.
const NEWEST_ROW: &str = "SELECT sequence, hash FROM (
        SELECT sequence, hash FROM audit UNION ALL SELECT sequence, hash FROM audit_anchors) AS ends
    ORDER BY sequence DESC LIMIT 1";

fn no_row() -> Anchor {
    Anchor {
        sequence: 0,
        hash: NO_HASH.to_owned(),
    }
}

/// The row that the next one follows. If the newest rows are lost, their numbers are not given again: the next row
/// follows the newest one that was ever written, with its hash if another place has kept that.
async fn end_of_trail(of: &mut Transaction<'_>) -> StoreResult<Anchor> {
    let ends = query(
        "SELECT sequence, hash, 0 AS rank FROM (
             SELECT sequence, hash FROM audit
             UNION ALL SELECT sequence, hash FROM audit_anchors ORDER BY sequence DESC LIMIT 1)
         UNION ALL SELECT seq, '', 1 FROM sqlite_sequence WHERE name = 'audit'
         ORDER BY rank",
    )
    .on_postgres(
        "SELECT sequence, hash, 0 AS rank FROM (
             SELECT sequence, hash FROM audit
             UNION ALL SELECT sequence, hash FROM audit_anchors ORDER BY sequence DESC LIMIT 1) AS ends
         UNION ALL SELECT sequence, '', 1 FROM audit_greatest
         ORDER BY rank",
    )
    .fetch_all(&mut *of)
    .await?;
    let mut end = no_row();
    for found in rows::all(ends, read_anchor)? {
        if !found.hash.is_empty() {
            end = found;
        } else if found.sequence > end.sequence {
            let kept = kept_head(&mut *of).await?;
            let kept = kept.filter(|kept| kept.sequence == found.sequence);
            end = Anchor {
                sequence: found.sequence,
                hash: kept.map_or(end.hash, |kept| kept.hash),
            };
        }
    }
    Ok(end)
}

fn read_key(row: DbRow) -> StoreResult<ApiKey> {
    let limit = |column: &str| -> StoreResult<Option<u64>> {
        Ok(row.try_get::<Option<i64>, _>(column)?.map(rows::unsigned))
    };
    Ok(ApiKey {
        quota: Quota {
            requests: limit("requests")?,
            bytes: limit("bytes")?,
            jobs: limit("jobs")?,
        },
        maker: match row.try_get::<Option<String>, _>("maker")? {
            None => Maker::Operator,
            Some(key) => Maker::Caller(Some(key).filter(|key| !key.is_empty())),
        },
        owner: row.try_get("owner")?,
        id: row.try_get("id")?,
        sequence: row.try_get("sequence")?,
        name: row.try_get("name")?,
        tenant: rows::parsed(&row, "tenant")?,
        scope: rows::parsed(&row, "scope")?,
        created_at: row.try_get("created_at")?,
        expires_at: row.try_get("expires_at")?,
        revoked_at: row.try_get("revoked_at")?,
        digest: row.try_get("digest")?,
    })
}

fn read_record(row: DbRow) -> StoreResult<AuditRecord> {
    Ok(AuditRecord {
        sequence: row.try_get("sequence")?,
        event: rows::json(&row, "event")?,
        hash: row.try_get("hash")?,
    })
}

fn read_anchor(row: DbRow) -> StoreResult<Anchor> {
    Ok(Anchor {
        sequence: row.try_get("sequence")?,
        hash: row.try_get("hash")?,
    })
}

fn signed(value: u64) -> i64 {
    i64::try_from(value).unwrap_or(i64::MAX)
}
