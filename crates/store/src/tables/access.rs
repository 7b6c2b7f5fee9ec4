//! The tables of keys and of the audit trail.

use super::pages::{Times, push_page, push_times};
use super::rows::{self, to_json};
use crate::database::{SqlStore, Transaction};
use crate::query::{DbRow, QueryBuilder, query};
use async_trait::async_trait;
use ventriform_service::access::{
    AccessStore, Activity, Agent, Anchor, ApiKey, AuditEvent, AuditFilter, AuditLink, AuditRecord,
    Maker, NO_HASH, Outcome, Quota, Usage, chain_hash,
};
use ventriform_service::records::{ListPage, ListRequest, StoreResult, Tenant, Timestamp};

/// The bytes of everything that tenant `$1` stores: volumes, products (results, templates, readers), received
/// objects that are not part of a volume, work items, and the records of jobs.
pub(super) const STORED_BYTES: &str = "CAST(
    (SELECT coalesce(sum(v.bytes), 0) FROM holdings AS h JOIN volumes AS v ON v.id = h.id
     WHERE h.tenant = $1 AND h.kind = 'volume')
    + (SELECT coalesce(sum(p.bytes), 0) FROM holdings AS h JOIN products AS p ON p.id = h.id
       WHERE h.tenant = $1 AND h.kind != 'volume')
    + (SELECT coalesce(sum(bytes), 0) FROM intake_objects WHERE tenant = $1 AND file IS NOT NULL)
    + (SELECT coalesce(sum(bytes), 0) FROM workitems WHERE tenant = $1)
    + (SELECT coalesce(sum(bytes), 0) FROM jobs WHERE tenant = $1) AS BIGINT)";

/// The bytes of everything that a tenant stores.
pub(super) async fn stored_bytes(of: &mut Transaction<'_>, tenant: &Tenant) -> StoreResult<u64> {
    let row = query(format!("SELECT {STORED_BYTES}"))
        .bind(tenant.as_str())
        .fetch_one(&mut *of)
        .await?;
    Ok(rows::unsigned(row.try_get(0)?))
}

#[async_trait]
impl AccessStore for SqlStore {
    async fn add_key(&self, key: &ApiKey, event: &AuditEvent) -> StoreResult<()> {
        let mut transaction = self.writer.begin().await?;
        query(
            "INSERT INTO api_keys (id, name, tenant, scope, requests, bytes, jobs, created_at,
                                   expires_at, revoked_at, digest, maker)
             VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12)",
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
        .execute(&mut transaction)
        .await?;
        append(&mut transaction, std::slice::from_ref(event)).await?;
        transaction.commit().await?;
        Ok(())
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

    async fn any_key(&self) -> StoreResult<bool> {
        let row = query("SELECT EXISTS (SELECT 1 FROM api_keys)")
            .fetch_one(&self.readers)
            .await?;
        Ok(row.try_get(0)?)
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

    async fn prune(&self, before: Timestamp, now: Timestamp) -> StoreResult<u64> {
        let mut transaction = self.writer.begin().await?;
        // The event that records the removal remains, so the chain is never empty.
        let last = query(
            "SELECT sequence, hash FROM audit
             WHERE sequence < coalesce((SELECT min(sequence) FROM audit WHERE recorded >= $1),
                                       9223372036854775807)
             ORDER BY sequence DESC LIMIT 1",
        )
        .bind(before)
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
pub(super) async fn append(to: &mut Transaction<'_>, events: &[AuditEvent]) -> StoreResult<Anchor> {
    let head = query(
        "SELECT sequence, hash FROM (SELECT sequence, hash FROM audit
                                     UNION ALL SELECT sequence, hash FROM audit_anchors) AS ends
         ORDER BY sequence DESC LIMIT 1",
    )
    .fetch_optional(&mut *to)
    .await?;
    let (mut sequence, mut hash) = match head.map(read_anchor).transpose()? {
        Some(head) => (head.sequence, head.hash),
        None => (0, NO_HASH.to_owned()),
    };
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
