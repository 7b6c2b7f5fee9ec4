//! The jobs table in SQLite. Every change is a single statement, or a transaction that begins
//! with a write: SQLite would not let two transactions that began by reading both write.

use super::rows::{self, to_json};
use super::sqlite::SqliteStore;
use crate::jobs::{
    Deleted, Failure, Filed, Idempotency, Interrupted, Job, JobOutcome, JobState, JobStore, Lease,
    ListPage, ListRequest, NewJob, QueueLoad, Resource, StoreResult, Tenant, Timestamp, random_id,
};
use async_trait::async_trait;
use sqlx::Row;

/// Number of last succeeded jobs whose durations are averaged.
const JOBS_AVERAGED: i64 = 20;

#[async_trait]
impl JobStore for SqliteStore {
    async fn file(&self, job: &NewJob, queue_limit: usize, now: Timestamp) -> StoreResult<Filed> {
        if let Some(earlier) = self.earlier(job).await? {
            return Ok(earlier);
        }
        let id = random_id(Resource::Job.prefix());
        let key = job.idempotency.as_ref();
        let inserted = sqlx::query(
            "INSERT INTO jobs (id, kind, volume, parameters, created_at, idempotency_key,
                               fingerprint, needs, tenant, webhook, trace_parent)
             SELECT ?1, ?2, ?3, ?4, ?5, ?6, ?7, ?9, ?10, ?11, ?12
             WHERE (SELECT count(*) FROM jobs WHERE state = 'queued') < ?8
               AND EXISTS (SELECT 1 FROM volumes WHERE id = ?3)
               AND NOT EXISTS
                   (SELECT 1 FROM json_each(?9) AS need
                    WHERE NOT EXISTS (SELECT 1 FROM volumes WHERE id = need.value)
                      AND NOT EXISTS (SELECT 1 FROM products WHERE id = need.value))
             ON CONFLICT (idempotency_key) DO NOTHING
             RETURNING *",
        )
        .bind(&id)
        .bind(&job.kind)
        .bind(&job.volume)
        .bind(to_json(&job.parameters)?)
        .bind(now)
        .bind(key.map(|k| stored_key(&job.tenant, k)))
        .bind(key.map(|k| &k.fingerprint))
        .bind(i64::try_from(queue_limit).unwrap_or(i64::MAX))
        .bind(to_json(&job.needs)?)
        .bind(job.tenant.as_str())
        .bind(job.webhook.as_ref().map(to_json).transpose()?)
        .bind(&job.trace_parent)
        .fetch_optional(&self.writer)
        .await?;
        if let Some(row) = inserted {
            return Ok(Filed::New(rows::job(row)?));
        }
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

    async fn jobs(&self, state: Option<JobState>, page: ListRequest) -> StoreResult<ListPage<Job>> {
        let rows = sqlx::query(
            "SELECT * FROM jobs
             WHERE (?1 IS NULL OR state = ?1) AND (?2 IS NULL OR sequence < ?2)
             ORDER BY sequence DESC LIMIT ?3",
        )
        .bind(state.map(JobState::as_str))
        .bind(page.before)
        .bind(i64::from(page.limit) + 1)
        .fetch_all(&self.readers)
        .await?;
        rows::page(rows, page, rows::job, |job| job.sequence)
    }

    async fn ahead_of(&self, job: &Job) -> StoreResult<u64> {
        let row = sqlx::query("SELECT count(*) FROM jobs WHERE state = 'queued' AND sequence < ?")
            .bind(job.sequence)
            .fetch_one(&self.readers)
            .await?;
        Ok(u64::try_from(row.get::<i64, _>(0)).unwrap_or(0))
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

    async fn claim(
        &self,
        token: &str,
        attempt_limit: u32,
        now: Timestamp,
        until: Timestamp,
    ) -> StoreResult<Option<Job>> {
        let row = sqlx::query(
            "UPDATE jobs SET state = 'running', attempts = attempts + 1, lease_token = ?1,
                    lease_expires_at = ?2, started_at = ?3, stage = NULL, progress = 0,
                    revision = revision + 1
             WHERE sequence = (
                 SELECT sequence FROM jobs
                 WHERE (state = 'queued' OR (state = 'running' AND lease_expires_at <= ?3))
                   AND attempts < ?4 AND NOT cancel_requested
                 ORDER BY sequence LIMIT 1)
             RETURNING *",
        )
        .bind(token)
        .bind(until)
        .bind(now)
        .bind(attempt_limit)
        .fetch_optional(&self.writer)
        .await?;
        row.map(rows::job).transpose()
    }

    async fn renew_lease(&self, lease: &Lease, until: Timestamp) -> StoreResult<Option<bool>> {
        let row = sqlx::query(
            "UPDATE jobs SET lease_expires_at = ?
             WHERE id = ? AND lease_token = ? AND state = 'running'
             RETURNING cancel_requested",
        )
        .bind(until)
        .bind(&lease.job)
        .bind(&lease.token)
        .fetch_optional(&self.writer)
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
        .fetch_optional(&self.writer)
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
                    lease_token = NULL, lease_expires_at = NULL, revision = revision + 1
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
            return Ok(None);
        };
        if let Some(product) = product {
            super::sqlite_catalogue::insert_product(&mut transaction, product).await?;
        }
        transaction.commit().await?;
        Ok(Some(rows::job(row)?))
    }

    async fn hand_back(&self, lease: &Lease) -> StoreResult<Option<Job>> {
        let row = sqlx::query(
            "UPDATE jobs SET state = 'queued', attempts = attempts - 1, stage = NULL,
                    progress = 0, started_at = NULL, lease_token = NULL,
                    lease_expires_at = NULL, revision = revision + 1
             WHERE id = ? AND lease_token = ? AND state = 'running'
             RETURNING *",
        )
        .bind(&lease.job)
        .bind(&lease.token)
        .fetch_optional(&self.writer)
        .await?;
        row.map(rows::job).transpose()
    }

    async fn release_all(&self) -> StoreResult<u64> {
        let done = sqlx::query(
            "UPDATE jobs SET state = 'queued', stage = NULL, progress = 0, lease_token = NULL,
                    lease_expires_at = NULL, revision = revision + 1
             WHERE state = 'running'",
        )
        .execute(&self.writer)
        .await?;
        Ok(done.rows_affected())
    }

    async fn end_unclaimable(
        &self,
        attempt_limit: u32,
        reason: &Failure,
        now: Timestamp,
    ) -> StoreResult<Vec<Job>> {
        let rows = sqlx::query(
            "UPDATE jobs SET
                    state = CASE WHEN cancel_requested THEN 'cancelled' ELSE 'failed' END,
                    failure = CASE WHEN cancel_requested THEN NULL ELSE ?1 END,
                    finished_at = ?2, lease_token = NULL, lease_expires_at = NULL,
                    revision = revision + 1
             WHERE (state = 'queued' OR (state = 'running' AND lease_expires_at <= ?2))
               AND (attempts >= ?3 OR cancel_requested)
             RETURNING *",
        )
        .bind(to_json(reason)?)
        .bind(now)
        .bind(attempt_limit)
        .fetch_all(&self.writer)
        .await?;
        rows::all(rows, rows::job)
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
        .fetch_optional(&self.writer)
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

    async fn delete_job(&self, id: &str, now: Timestamp) -> StoreResult<Deleted> {
        let mut transaction = self.writer.begin().await?;
        let done =
            sqlx::query("DELETE FROM jobs WHERE id = ? AND state NOT IN ('queued', 'running')")
                .bind(id)
                .execute(&mut *transaction)
                .await?;
        if done.rows_affected() == 0 {
            drop(transaction);
            return Ok(match self.job(id).await? {
                Some(_) => Deleted::InUse,
                None => Deleted::Unknown,
            });
        }
        super::sqlite_catalogue::record_deletion(&mut transaction, id, now).await?;
        transaction.commit().await?;
        Ok(Deleted::Done)
    }
}

impl SqliteStore {
    /// The first item the job needs that does not exist.
    async fn missing(&self, job: &NewJob) -> StoreResult<Option<Filed>> {
        let volume = ("volume", &job.volume);
        let others = job.needs.iter().map(|(field, id)| (field.as_str(), id));
        for (field, id) in std::iter::once(volume).chain(others) {
            let found = sqlx::query(
                "SELECT 1 FROM volumes WHERE id = ?1 UNION ALL
                 SELECT 1 FROM products WHERE id = ?1 AND ?2 != 'volume'",
            )
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
        let Some(key) = &job.idempotency else {
            return Ok(None);
        };
        let row = sqlx::query("SELECT * FROM jobs WHERE idempotency_key = ?")
            .bind(stored_key(&job.tenant, key))
            .fetch_optional(&self.readers)
            .await?;
        row.map(|row| {
            Ok(
                if row.try_get::<Option<&str>, _>("fingerprint")? == Some(key.fingerprint.as_str())
                {
                    Filed::Same(rows::job(row)?)
                } else {
                    Filed::KeyReused
                },
            )
        })
        .transpose()
    }
}

/// A key as the table holds it: unique among all tenants, as no tenant's name contains a slash.
fn stored_key(tenant: &Tenant, promise: &Idempotency) -> String {
    format!("{tenant}/{}", promise.key)
}
