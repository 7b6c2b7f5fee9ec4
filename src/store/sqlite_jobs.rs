//! The jobs table in SQLite. Every change is a single statement, or a transaction that begins
//! with a write: SQLite would not let two transactions that began by reading both write.

use super::erasure::record_deletion;
use super::rows::{self, to_json};
use super::sqlite::SqliteStore;
use super::sqlite_catalogue::{insert_product, push_page, push_tags};
use super::sqlite_scans::push_scan;
use super::writer::Write;
use crate::jobs::{
    Claimant, DeathLimit, Deleted, Filed, Interrupted, Job, JobFilter, JobOutcome, JobState,
    JobStore, Lease, ListPage, ListRequest, NewJob, QueueLoad, Resource, StoreResult, Tenant,
    Timestamp, random_id,
};
use async_trait::async_trait;
use sqlx::{QueryBuilder, Row, SqliteConnection};
use std::time::Duration;

/// Number of last succeeded jobs whose durations are averaged.
const JOBS_AVERAGED: i64 = 20;

/// What every statement sets by which a job leaves its worker without an outcome: `?1` is now, `?2`
/// the reason for failing it, or null to return it to the queue.
const LEFT_BY_WORKER: &str = "
    state = CASE WHEN cancel_requested THEN 'cancelled'
                 WHEN ?2 IS NOT NULL THEN 'failed' ELSE 'queued' END,
    failure = CASE WHEN cancel_requested THEN NULL ELSE ?2 END,
    finished_at = CASE WHEN cancel_requested OR ?2 IS NOT NULL THEN ?1 END,
    stage = NULL, progress = 0, lease_token = NULL, lease_run = NULL, lease_expires_at = NULL,
    revision = revision + 1";

fn expiry(now: Timestamp, length: Duration) -> Timestamp {
    now.saturating_add(i64::try_from(length.as_millis()).unwrap_or(i64::MAX / 2))
}

/// The age of the volumes that a job works on counts from now, for the tenant of the job.
pub(super) async fn renew_volumes(
    to: &mut SqliteConnection,
    job: &Job,
    now: Timestamp,
) -> StoreResult<()> {
    sqlx::query(
        "UPDATE holdings SET renewed_at = max(renewed_at, ?1)
         WHERE tenant = ?2 AND kind = 'volume' AND id IN (
             SELECT ?3 UNION ALL
             SELECT value FROM jobs, json_each(jobs.needs) WHERE jobs.id = ?4)",
    )
    .bind(now)
    .bind(job.tenant.as_str())
    .bind(&job.volume)
    .bind(&job.id)
    .execute(to)
    .await?;
    Ok(())
}

#[async_trait]
impl JobStore for SqliteStore {
    async fn file(&self, job: &NewJob, queue_limit: usize, now: Timestamp) -> StoreResult<Filed> {
        if let Some(earlier) = self.earlier(job).await? {
            return Ok(earlier);
        }
        self.require_room()?;
        let id = random_id(Resource::Job.prefix());
        let key = job.idempotency.as_ref();
        let mut transaction = self.writer.begin().await?;
        let inserted = sqlx::query(
            "INSERT INTO jobs (id, kind, volume, parameters, created_at, idempotency_key,
                               fingerprint, needs, tenant, external_id, labels, webhook,
                               trace_parent, source, send)
             SELECT ?1, ?2, ?3, ?4, ?5, ?6, ?7, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16
             WHERE (SELECT count(*) FROM jobs WHERE state = 'queued') < ?8
               AND (?15 IS NOT NULL
                    OR EXISTS (SELECT 1 FROM holdings
                               WHERE tenant = ?10 AND id = ?3 AND kind = 'volume'))
               AND NOT EXISTS
                   (SELECT 1 FROM json_each(?9) AS need WHERE NOT EXISTS
                        (SELECT 1 FROM holdings WHERE tenant = ?10 AND id = need.value))
             ON CONFLICT (idempotency_key) DO NOTHING
             RETURNING *",
        )
        .bind(&id)
        .bind(&job.kind)
        .bind(job.volume.as_deref().unwrap_or_default())
        .bind(to_json(&job.parameters)?)
        .bind(now)
        .bind(key.map(|k| stored_key(&job.tenant, &k.key)))
        .bind(key.map(|k| &k.fingerprint))
        .bind(i64::try_from(queue_limit).unwrap_or(i64::MAX))
        .bind(to_json(&job.needs)?)
        .bind(job.tenant.as_str())
        .bind(&job.tags.external_id)
        .bind(to_json(&job.tags.labels)?)
        .bind(job.webhook.as_ref().map(to_json).transpose()?)
        .bind(&job.trace_parent)
        .bind(job.source.as_ref().map(to_json).transpose()?)
        .bind(job.send.as_ref().map(to_json).transpose()?)
        .fetch_optional(&mut *transaction)
        .await?;
        if let Some(row) = inserted {
            let job = rows::job(row)?;
            renew_volumes(&mut transaction, &job, now).await?;
            transaction.commit().await?;
            return Ok(Filed::New(job));
        }
        transaction.commit().await?;
        // Another request with the same key may have been filed in the meantime.
        if let Some(earlier) = self.earlier(job).await? {
            return Ok(earlier);
        }
        Ok(self.missing(job).await?.unwrap_or(Filed::QueueFull))
    }

    async fn job(&self, id: &str) -> StoreResult<Option<Job>> {
        let row = sqlx::query("SELECT * FROM jobs WHERE id = ?")
            .bind(id)
            .fetch_optional(&self.readers)
            .await?;
        row.map(rows::job).transpose()
    }

    async fn jobs(&self, filter: &JobFilter, page: ListRequest) -> StoreResult<ListPage<Job>> {
        let mut query = QueryBuilder::new("SELECT * FROM jobs WHERE tenant = ");
        query.push_bind(filter.tenant.to_string());
        if let Some(state) = filter.state {
            query.push(" AND state = ").push_bind(state.as_str());
        }
        for (column, value) in [("volume", &filter.volume), ("kind", &filter.kind)] {
            if let Some(value) = value {
                query.push(" AND ").push(column).push(" = ");
                query.push_bind(value.clone());
            }
        }
        if let Some(moment) = filter.created_after {
            query.push(" AND created_at > ").push_bind(moment);
        }
        push_tags(&mut query, "", &filter.tenant, Resource::Job, &filter.tags);
        let of_scan = "JOIN jobs AS x ON x.tenant = c.tenant AND x.volume = c.volume";
        push_scan(&mut query, ("", of_scan), &filter.tenant, &filter.scan);
        push_page(&mut query, "sequence", page);
        let rows = query.build().fetch_all(&self.readers).await?;
        rows::page(rows, page, rows::job, |job| job.sequence)
    }

    async fn filed_under(&self, tenant: &Tenant, key: &str) -> StoreResult<Option<(Job, String)>> {
        let row = sqlx::query("SELECT * FROM jobs WHERE idempotency_key = ?")
            .bind(stored_key(tenant, key))
            .fetch_optional(&self.readers)
            .await?;
        row.map(|row| {
            let fingerprint: Option<String> = row.try_get("fingerprint")?;
            Ok((rows::job(row)?, fingerprint.unwrap_or_default()))
        })
        .transpose()
    }

    async fn ahead_of(&self, sequences: &[i64]) -> StoreResult<Vec<u64>> {
        // Each part of the queue is counted once, however many jobs are asked for.
        let rows = sqlx::query(
            "WITH asked AS
                 (SELECT value AS upto, lag(value, 1, 0) OVER (ORDER BY value) AS since
                  FROM json_each(?))
             SELECT sum((SELECT count(*) FROM jobs WHERE state = 'queued'
                         AND sequence >= since AND sequence < upto)) OVER (ORDER BY upto)
             FROM asked ORDER BY upto",
        )
        .bind(to_json(&sequences)?)
        .fetch_all(&self.readers)
        .await?;
        let count = |row: sqlx::sqlite::SqliteRow| u64::try_from(row.get::<i64, _>(0)).unwrap_or(0);
        Ok(rows.into_iter().map(count).collect())
    }

    async fn last_change(&self) -> StoreResult<Option<Timestamp>> {
        let row = sqlx::query(
            "SELECT max(at) FROM (
                 SELECT (SELECT created_at FROM jobs ORDER BY sequence DESC LIMIT 1) AS at
                 UNION ALL SELECT (SELECT max(finished_at) FROM jobs WHERE finished_at IS NOT NULL)
                 UNION ALL SELECT (SELECT max(renewed_at) FROM holdings WHERE kind = 'volume'))",
        )
        .fetch_one(&self.readers)
        .await?;
        Ok(row.get(0))
    }

    async fn load(&self) -> StoreResult<QueueLoad> {
        let row = sqlx::query(
            "SELECT (SELECT count(*) FROM jobs WHERE state = 'queued'),
                    (SELECT count(*) FROM jobs WHERE state = 'running'),
                    (SELECT avg(finished_at - started_at) FROM
                        (SELECT finished_at, started_at FROM jobs WHERE state = 'succeeded'
                         ORDER BY sequence DESC LIMIT ?))",
        )
        .bind(JOBS_AVERAGED)
        .fetch_one(&self.readers)
        .await?;
        let count = |column: usize| u64::try_from(row.get::<i64, _>(column)).unwrap_or(0);
        Ok(QueueLoad {
            queued: count(0),
            running: count(1),
            mean_duration_ms: row.get(2),
        })
    }

    async fn claim(&self, by: &Claimant, now: Timestamp) -> StoreResult<Option<Job>> {
        let row = sqlx::query(
            "UPDATE jobs SET state = 'running', attempts = attempts + 1, lease_token = ?1,
                    lease_run = ?2, lease_expires_at = ?3, started_at = ?4, stage = NULL,
                    progress = 0, revision = revision + 1
             WHERE sequence = (
                 SELECT sequence FROM jobs WHERE state = 'queued' AND volume != ''
                 ORDER BY sequence LIMIT 1)
             RETURNING *",
        )
        .bind(&by.token)
        .bind(&by.run)
        .bind(expiry(now, by.lease))
        .bind(now)
        .write_optional(&self.writer)
        .await?;
        row.map(rows::job).transpose()
    }

    async fn renew_lease(
        &self,
        lease: &Lease,
        length: Duration,
        now: Timestamp,
    ) -> StoreResult<Option<bool>> {
        let row = sqlx::query(
            "UPDATE jobs SET lease_expires_at = ?
             WHERE id = ? AND lease_token = ? AND state = 'running'
             RETURNING cancel_requested",
        )
        .bind(expiry(now, length))
        .bind(&lease.job)
        .bind(&lease.token)
        .write_optional(&self.writer)
        .await?;
        Ok(row.map(|row| row.get(0)))
    }

    async fn progress(
        &self,
        lease: &Lease,
        stage: &str,
        progress: f64,
    ) -> StoreResult<Option<Job>> {
        let row = sqlx::query(
            "UPDATE jobs SET stage = ?, progress = max(progress, ?), revision = revision + 1
             WHERE id = ? AND lease_token = ? AND state = 'running'
             RETURNING *",
        )
        .bind(stage)
        .bind(progress)
        .bind(&lease.job)
        .bind(&lease.token)
        .write_optional(&self.writer)
        .await?;
        row.map(rows::job).transpose()
    }

    async fn finish(
        &self,
        lease: &Lease,
        outcome: &JobOutcome,
        now: Timestamp,
    ) -> StoreResult<Option<Job>> {
        let (state, failure, product) = match outcome {
            JobOutcome::Succeeded(product) => (JobState::Succeeded, None, Some(product)),
            JobOutcome::Failed(failure) => (JobState::Failed, Some(to_json(failure)?), None),
            JobOutcome::Cancelled => (JobState::Cancelled, None, None),
        };
        let mut transaction = self.writer.begin().await?;
        let row = sqlx::query(
            "UPDATE jobs SET state = ?1, failure = ?2, result = ?3, finished_at = ?4,
                    progress = CASE ?1 WHEN 'succeeded' THEN 1 ELSE progress END,
                    lease_token = NULL, lease_run = NULL, lease_expires_at = NULL,
                    revision = revision + 1
             WHERE id = ?5 AND lease_token = ?6 AND state = 'running'
             RETURNING *",
        )
        .bind(state.as_str())
        .bind(failure)
        .bind(product.map(|p| &p.id))
        .bind(now)
        .bind(&lease.job)
        .bind(&lease.token)
        .fetch_optional(&mut *transaction)
        .await?;
        let Some(row) = row else {
            transaction.commit().await?;
            return Ok(None);
        };
        let job = rows::job(row)?;
        renew_volumes(&mut transaction, &job, now).await?;
        if let Some(product) = product {
            insert_product(&mut transaction, product, &job.tenant).await?;
        }
        transaction.commit().await?;
        Ok(Some(job))
    }

    async fn hand_back(&self, lease: &Lease, now: Timestamp) -> StoreResult<Option<Job>> {
        let given_back = format!(
            "UPDATE jobs SET attempts = attempts - 1, started_at = NULL, {LEFT_BY_WORKER}
             WHERE id = ?3 AND lease_token = ?4 AND state = 'running' RETURNING *"
        );
        let row = sqlx::query(sqlx::AssertSqlSafe(given_back))
            .bind(now)
            .bind(None::<String>)
            .bind(&lease.job)
            .bind(&lease.token)
            .write_optional(&self.writer)
            .await?;
        row.map(rows::job).transpose()
    }

    async fn abandon(&self, token: &str) -> StoreResult<Option<Job>> {
        let row = sqlx::query(
            "UPDATE jobs SET state = 'queued', attempts = attempts - 1, started_at = NULL,
                    lease_token = NULL, lease_run = NULL, lease_expires_at = NULL,
                    revision = revision + 1
             WHERE state = 'running' AND lease_token = ? RETURNING *",
        )
        .bind(token)
        .write_optional(&self.writer)
        .await?;
        row.map(rows::job).transpose()
    }

    async fn crashed(
        &self,
        lease: &Lease,
        limit: &DeathLimit,
        now: Timestamp,
    ) -> StoreResult<Option<Job>> {
        // `?2` is the failure, if this death is the last one allowed.
        let counted = format!(
            "UPDATE jobs SET crashes = crashes + 1, {LEFT_BY_WORKER}
             WHERE id = ?3 AND lease_token = ?4 AND state = 'running' AND (crashes + 1 >= ?5) = ?6
             RETURNING *"
        );
        let reason = to_json(&limit.reason)?;
        for at_limit in [false, true] {
            let row = sqlx::query(sqlx::AssertSqlSafe(counted.clone()))
                .bind(now)
                .bind(at_limit.then_some(&reason))
                .bind(&lease.job)
                .bind(&lease.token)
                .bind(limit.deaths)
                .bind(at_limit)
                .write_optional(&self.writer)
                .await?;
            if let Some(row) = row {
                return rows::job(row).map(Some);
            }
        }
        Ok(None)
    }

    async fn release_dead(
        &self,
        run: Option<&str>,
        limit: Option<&DeathLimit>,
        now: Timestamp,
    ) -> StoreResult<Vec<Job>> {
        let released = format!(
            "UPDATE jobs SET interruptions = interruptions + 1, {LEFT_BY_WORKER}
             WHERE state = 'running' AND (interruptions + 1 >= ?3) = ?4
               AND (?5 IS NULL OR (lease_run IS NOT ?5 AND lease_expires_at <= ?1))
             RETURNING *"
        );
        let reason = limit.map(|limit| to_json(&limit.reason)).transpose()?;
        let deaths = limit.map_or(i64::MAX, |limit| i64::from(limit.deaths));
        let mut jobs = Vec::new();
        for at_limit in [false, true] {
            let rows = sqlx::query(sqlx::AssertSqlSafe(released.clone()))
                .bind(now)
                .bind(reason.as_ref().filter(|_| at_limit))
                .bind(deaths)
                .bind(at_limit)
                .bind(run)
                .write_all(&self.writer)
                .await?;
            jobs.extend(rows::all(rows, rows::job)?);
        }
        Ok(jobs)
    }

    async fn interrupt(&self, id: &str, now: Timestamp) -> StoreResult<Interrupted> {
        let row = sqlx::query(
            "UPDATE jobs SET cancel_requested = 1, revision = revision + 1,
                    finished_at = CASE state WHEN 'queued' THEN ?1 ELSE finished_at END,
                    state = CASE state WHEN 'queued' THEN 'cancelled' ELSE state END
             WHERE id = ?2 AND state IN ('queued', 'running')
             RETURNING *",
        )
        .bind(now)
        .bind(id)
        .write_optional(&self.writer)
        .await?;
        if let Some(row) = row {
            let job = rows::job(row)?;
            return Ok(match job.state {
                JobState::Cancelled => Interrupted::Cancelled(job),
                _ => Interrupted::Asked(job),
            });
        }
        Ok(self
            .job(id)
            .await?
            .map_or(Interrupted::Unknown, Interrupted::Finished))
    }

    async fn check(&self) -> StoreResult<()> {
        self.probe().await
    }

    async fn delete_job(&self, id: &str, now: Timestamp) -> StoreResult<Deleted> {
        let mut transaction = self.writer.begin().await?;
        let row = sqlx::query(
            "DELETE FROM jobs WHERE id = ? AND state NOT IN ('queued', 'running')
             RETURNING tenant",
        )
        .bind(id)
        .fetch_optional(&mut *transaction)
        .await?;
        let Some(row) = row else {
            drop(transaction);
            return Ok(match self.job(id).await? {
                Some(_) => Deleted::InUse,
                None => Deleted::Unknown,
            });
        };
        record_deletion(&mut transaction, &rows::tenant(&row)?, id, now).await?;
        transaction.commit().await?;
        Ok(Deleted::Done)
    }
}

impl SqliteStore {
    /// The first item the job needs that does not exist.
    async fn missing(&self, job: &NewJob) -> StoreResult<Option<Filed>> {
        let volume = job.volume.iter().map(|id| ("volume", id));
        let others = job.needs.iter().map(|(field, id)| (field.as_str(), id));
        for (field, id) in volume.chain(others) {
            let found = sqlx::query(
                "SELECT 1 FROM holdings WHERE tenant = ?1 AND id = ?2
                     AND (kind = 'volume' OR ?3 != 'volume')",
            )
            .bind(job.tenant.as_str())
            .bind(id)
            .bind(field)
            .fetch_optional(&self.readers)
            .await?;
            if found.is_none() {
                let (field, id) = (field.to_owned(), id.clone());
                return Ok(Some(Filed::Missing { field, id }));
            }
        }
        Ok(None)
    }

    /// The job filed earlier under this job's idempotency key.
    async fn earlier(&self, job: &NewJob) -> StoreResult<Option<Filed>> {
        let Some(promise) = &job.idempotency else {
            return Ok(None);
        };
        let earlier = self.filed_under(&job.tenant, &promise.key).await?;
        Ok(earlier.map(|(job, fingerprint)| promise.judge(job, &fingerprint)))
    }
}

/// A key as the table holds it: unique among all tenants, as no tenant's name contains a slash.
fn stored_key(tenant: &Tenant, key: &str) -> String {
    format!("{tenant}/{key}")
}
