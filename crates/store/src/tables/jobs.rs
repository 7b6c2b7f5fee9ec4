//! The jobs table. Every change is a single statement, or a transaction that writes beside no other.
//!
//! **Priorities.** Every waiting job of a higher priority starts before any of a lower one. Each priority is a
//! queue of its own.
//!
//! **Turns.** Waiting jobs of one priority start in the order of their turns, and within a turn in that in which
//! they were filed. A job gets the turn that is current, that of the next job of its priority to start, or the one
//! after the last turn in which its tenant has an unfinished job of that priority, whichever is later. So each
//! tenant has one job in each turn: however many jobs one tenant has filed, at most one of them starts between
//! the filing of another tenant's only job of the same priority and its start.
//!
//! Leases on SQLite, which one process uses, expire by the clock of that process. On PostgreSQL they
//! expire by the clock of the server: clocks of several machines differ. A row has the token of its lease
//! while its job runs and at no other time, so the token alone shows that the job runs under that lease.
//!
//! **Names and states.** A statement that names one job does not also say `state = 'running'`. PostgreSQL would
//! take an index of unfinished jobs, which looks small to it, for as good as the job's key; after a busy
//! minute that index is full of entries of ended versions, and each of them is read.

use super::access::{append, record, stored_bytes};
use super::catalogue::insert_product;
use super::erasure::{erasure_event, record_deletion};
use super::pages::{Times, push_page, push_tags, push_times};
use super::rows::{self, to_json};
use super::scans::push_scan;
use crate::database::{SqlStore, Transaction};
use crate::query::{QueryBuilder, query};
use async_trait::async_trait;
use std::collections::BTreeMap;
use std::time::Duration;
use ventriform_service::base::records::{
    Bounded, Claimant, DeathLimit, Deleted, ErasureAgent, Failure, Fault, Filed, Interrupted, Job,
    JobFilter, JobOutcome, JobState, JobStore, Lease, ListPage, ListRequest, NewJob, PagePlan,
    Priority, Product, QueueLoad, Resource, ScanFilter, StoreResult, TagFilter, Tenant, Timestamp,
    random_id,
};
use ventriform_service::callers::Activity;

/// Number of last succeeded jobs whose durations are averaged.
const JOBS_AVERAGED: i64 = 20;

/// The turn of a job of priority `$17` that tenant `$10` files now.
const TURN_EXPRESSION: &str = "(SELECT CASE WHEN here > own THEN here ELSE own END FROM (SELECT
    coalesce((SELECT min(turn) FROM jobs WHERE state = 'queued' AND volume != '' AND priority = $17),
             (SELECT max(turn) + 1 FROM jobs WHERE state = 'running' AND priority = $17), 0) AS here,
    coalesce((SELECT max(turn) + 1 FROM jobs
              WHERE tenant = $10 AND priority = $17 AND state IN ('queued', 'running')), 0) AS own) AS turns)";

/// Whether a queue of `$8` waiting jobs has room for one more of tenant `$10`. A tenant that has less than its
/// equal share has room also where others have filled the queue.
const HAS_ROOM: &str = "((SELECT count(*) FROM jobs WHERE state = 'queued') < $8
    OR (SELECT count(*) FROM jobs WHERE tenant = $10 AND state = 'queued')
       * (1 + (SELECT count(DISTINCT tenant) FROM jobs WHERE state = 'queued' AND tenant != $10)) < $8)";

/// The number of waiting jobs before each of the jobs `$1`. Each part of the queue is counted once, however
/// many jobs are asked for: within a priority from one of them to the next, and all higher priorities at
/// the first of each.
///
/// SQLite bounds a pair of columns by the first alone, so a part is counted in three: the whole turns from
/// that of the job before on, the asked job's own turn up to the asked job, and less what the first turn
/// has before the job before.
const QUEUE_POSITIONS: &str = "
    WITH asked AS
        (SELECT sequence, priority, turn, lag(turn, 1, -1) OVER place AS turn_before,
                lag(sequence, 1, -1) OVER place AS sequence_before
         FROM jobs
         WHERE sequence IN (SELECT CAST(value AS BIGINT) FROM json_each($1))
         WINDOW place AS (PARTITION BY priority ORDER BY turn, sequence))
    SELECT sequence,
           CAST(sum((SELECT count(*) FROM jobs AS turns
                     WHERE turns.state = 'queued' AND turns.volume != ''
                       AND turns.priority = asked.priority
                       AND turns.turn >= turn_before AND turns.turn < asked.turn)
                    + (SELECT count(*) FROM jobs AS own
                       WHERE own.state = 'queued' AND own.volume != ''
                         AND own.priority = asked.priority AND own.turn = asked.turn
                         AND own.sequence < asked.sequence
                         AND own.sequence >= CASE WHEN turn_before = asked.turn
                                             THEN sequence_before ELSE -1 END)
                    - CASE WHEN turn_before = asked.turn THEN 0
                      ELSE (SELECT count(*) FROM jobs AS earlier
                            WHERE earlier.state = 'queued' AND earlier.volume != ''
                              AND earlier.priority = asked.priority AND earlier.turn = turn_before
                              AND earlier.sequence < sequence_before) END
                    + CASE WHEN sequence_before < 0
                      THEN (SELECT count(*) FROM jobs AS higher
                            WHERE higher.state = 'queued' AND higher.volume != ''
                              AND higher.priority < asked.priority)
                      ELSE 0 END)
                OVER (PARTITION BY priority ORDER BY turn, sequence) AS BIGINT)
    FROM asked";

/// The assignments of every statement by which a job leaves its worker without an outcome: `$1` is now, `$2`
/// the reason for failing it, or null to return it to the queue.
const LEFT_BY_WORKER: &str = "
    state = CASE WHEN cancel_requested THEN 'cancelled'
                 WHEN $2 IS NOT NULL THEN 'failed' ELSE 'queued' END,
    failure = CASE WHEN cancel_requested THEN NULL ELSE $2 END,
    finished_at = CASE WHEN cancel_requested OR $2 IS NOT NULL THEN $1 END,
    stage = NULL, progress = 0, lease_token = NULL, lease_run = NULL, lease_expires_at = NULL,
    revision = revision + 1";

/// The time by which leases expire where several machines share the database; see `database_now` of the schema.
const SERVER_CLOCK: &str = "database_now()";

/// A length that can be added to any time.
fn milliseconds(length: Duration) -> i64 {
    i64::try_from(length.as_millis()).map_or(i64::MAX / 2, |length| length.min(i64::MAX / 2))
}

/// The statement of [`renew_volumes`]. Each engine would read all volumes of the tenant: SQLite prefers the index of
/// kinds to the key unless it cannot use it; PostgreSQL takes the needs of a job for a thousand, and an array for ten.
fn renewal(kind: &str, [before, after]: [&str; 2]) -> String {
    format!(
        "UPDATE holdings SET renewed_at = CASE WHEN renewed_at > $1 THEN renewed_at ELSE $1 END
         WHERE tenant = $2 AND {kind} = 'volume' AND id {before} (
             SELECT $3 UNION ALL
             SELECT value FROM jobs, json_each(jobs.needs) WHERE jobs.id = $4){after}"
    )
}

/// [`renewal`] on SQLite.
fn renewal_on_sqlite() -> String {
    renewal("+kind", ["IN", ""])
}

/// The age of the volumes that a job works on counts from now, for the tenant of the job.
pub(super) async fn renew_volumes(
    to: &mut Transaction<'_>,
    job: &Job,
    now: Timestamp,
) -> StoreResult<()> {
    query(renewal_on_sqlite())
        .on_postgres(renewal("kind", ["= ANY (ARRAY", ")"]))
        .bind(now)
        .bind(job.tenant.as_str())
        .bind(&job.volume)
        .bind(&job.id)
        .execute(to)
        .await?;
    Ok(())
}

/// The JSON that is stored with a new job. The column `bytes` counts it, and the external id.
struct JobTexts {
    parameters: String,
    needs: String,
    labels: String,
    webhook: Option<String>,
    source: Option<String>,
    send: Option<String>,
}

impl JobTexts {
    fn from_job(job: &NewJob) -> StoreResult<Self> {
        Ok(Self {
            parameters: to_json(&job.parameters)?,
            needs: to_json(&job.needs)?,
            labels: to_json(&job.tags.labels)?,
            webhook: job.webhook.as_ref().map(to_json).transpose()?,
            source: job.source.as_ref().map(to_json).transpose()?,
            send: job.send.as_ref().map(to_json).transpose()?,
        })
    }

    fn bytes(&self) -> usize {
        let given = [&self.webhook, &self.source, &self.send];
        let given = given.into_iter().flatten();
        let all = given.chain([&self.parameters, &self.needs, &self.labels]);
        all.map(String::len).sum()
    }
}

#[async_trait]
impl JobStore for SqlStore {
    async fn file(&self, job: &NewJob, queue_limit: usize, now: Timestamp) -> StoreResult<Filed> {
        if let Some(earlier) = self.earlier(job).await? {
            return Ok(earlier);
        }
        self.require_room()?;
        let id = random_id(Resource::Job.prefix());
        let texts = JobTexts::from_job(job)?;
        let key = job.idempotency.as_ref();
        let mut transaction = self.writer.begin().await?;
        let inserted = query(format!(
            "INSERT INTO jobs (id, kind, volume, parameters, created_at, idempotency_key,
                               fingerprint, needs, tenant, external_id, labels, webhook,
                               trace_parent, source, send, priority, storage_limit, turn)
             SELECT $1, $2, $3, $4, $5, $6, $7, $9, $10, $11, $12, $13, $14, $15, $16, $17, $18, {TURN_EXPRESSION}
             WHERE {HAS_ROOM}
               AND ($15 IS NOT NULL
                    OR EXISTS (SELECT 1 FROM holdings
                               WHERE tenant = $10 AND id = $3 AND kind = 'volume'))
               AND NOT EXISTS
                   (SELECT 1 FROM json_each($9) AS need WHERE NOT EXISTS
                        (SELECT 1 FROM holdings WHERE tenant = $10 AND id = need.value))
             ON CONFLICT (idempotency_key) DO NOTHING
             RETURNING *",
        ))
        .bind(&id)
        .bind(&job.kind)
        .bind(job.volume.as_deref().unwrap_or_default())
        .bind(&texts.parameters)
        .bind(now)
        .bind(key.map(|k| stored_key(&job.tenant, &k.key)))
        .bind(key.map(|k| &k.fingerprint))
        .bind(i64::try_from(queue_limit).unwrap_or(i64::MAX))
        .bind(&texts.needs)
        .bind(job.tenant.as_str())
        .bind(&job.tags.external_id)
        .bind(&texts.labels)
        .bind(&texts.webhook)
        .bind(&job.trace_parent)
        .bind(&texts.source)
        .bind(&texts.send)
        .bind(job.priority.rank())
        .bind(job.storage_limit.map(|limit| i64::try_from(limit).unwrap_or(i64::MAX)))
        .fetch_optional(&mut transaction)
        .await?;
        if let Some(row) = inserted {
            let job = rows::job(row)?;
            renew_volumes(&mut transaction, &job, now).await?;
            record(&mut transaction, Activity::Execute, &job.id).await?;
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

    fn text_bytes(&self, job: &NewJob) -> StoreResult<u64> {
        let external_id = job.tags.external_id.as_ref().map_or(0, String::len);
        Ok((JobTexts::from_job(job)?.bytes() + external_id) as u64)
    }

    async fn has_room(&self, tenant: &Tenant, queue_limit: usize) -> StoreResult<bool> {
        let has_room = HAS_ROOM.replace("$10", "$1").replace("$8", "$2");
        let row = query(format!("SELECT {has_room}"))
            .bind(tenant.as_str())
            .bind(i64::try_from(queue_limit).unwrap_or(i64::MAX))
            .fetch_one(&self.readers)
            .await?;
        row.try_get(0)
    }

    async fn job(&self, id: &str) -> StoreResult<Option<Job>> {
        let row = query("SELECT * FROM jobs WHERE id = $1")
            .bind(id)
            .fetch_optional(&self.readers)
            .await?;
        row.map(rows::job).transpose()
    }

    async fn job_within(&self, id: &str, bytes: u64) -> StoreResult<Bounded<Job>> {
        let within = query("SELECT * FROM jobs WHERE id = $1 AND bytes <= $2")
            .bind(id)
            .bind(rows::bytes_bound(bytes));
        let size = query("SELECT bytes FROM jobs WHERE id = $1").bind(id);
        rows::bounded(self, within, size, rows::job).await
    }

    async fn plan_jobs(&self, filter: &JobFilter, page: ListRequest) -> StoreResult<PagePlan> {
        let query = listed("sequence, bytes", filter, page).build();
        rows::plan(query.fetch_all(&self.readers).await?, page)
    }

    async fn jobs(&self, filter: &JobFilter, page: ListRequest) -> StoreResult<ListPage<Job>> {
        let query = listed("*", filter, page).build();
        let rows = query.fetch_all(&self.readers).await?;
        rows::page(rows, page, rows::job, |job| job.sequence)
    }

    async fn filed_under(&self, tenant: &Tenant, key: &str) -> StoreResult<Option<(Job, String)>> {
        let row = query("SELECT * FROM jobs WHERE idempotency_key = $1")
            .bind(stored_key(tenant, key))
            .fetch_optional(&self.readers)
            .await?;
        row.map(|row| {
            let fingerprint: Option<String> = row.try_get("fingerprint")?;
            Ok((rows::job(row)?, fingerprint.unwrap_or_default()))
        })
        .transpose()
    }

    async fn ahead_of(&self, sequences: &[i64]) -> StoreResult<BTreeMap<i64, u64>> {
        let rows = query(QUEUE_POSITIONS)
            .bind(to_json(&sequences)?)
            .fetch_all(&self.readers)
            .await?;
        let ahead = rows::all(rows, |row| {
            Ok((row.try_get(0)?, rows::unsigned(row.try_get(1)?)))
        })?;
        Ok(ahead.into_iter().collect())
    }

    async fn load(&self) -> StoreResult<QueueLoad> {
        let row = query(
            "SELECT (SELECT count(*) FROM jobs WHERE state = 'queued'),
                    (SELECT count(*) FROM jobs WHERE state = 'running'),
                    (SELECT CAST(avg(finished_at - started_at) AS DOUBLE PRECISION) FROM
                        (SELECT finished_at, started_at FROM jobs WHERE state = 'succeeded'
                         ORDER BY sequence DESC LIMIT $1) AS last)",
        )
        .bind(JOBS_AVERAGED)
        .fetch_one(&self.readers)
        .await?;
        Ok(QueueLoad {
            queued: rows::unsigned(row.try_get(0)?),
            running: rows::unsigned(row.try_get(1)?),
            mean_duration_ms: row.try_get(2)?,
        })
    }

    async fn claim(&self, by: &Claimant, now: Timestamp) -> StoreResult<Option<Job>> {
        let claim = |clock: &str, lock: &str| {
            format!(
                "UPDATE jobs SET state = 'running', attempts = attempts + 1, lease_token = $1,
                        lease_run = $2, lease_expires_at = {clock} + $3, started_at = $4,
                        stage = NULL, progress = 0, revision = revision + 1
                 WHERE state = 'queued' AND sequence = (
                     SELECT sequence FROM jobs WHERE state = 'queued' AND volume != ''
                     ORDER BY priority, turn, sequence LIMIT 1 {lock})
                 RETURNING *"
            )
        };
        let row = query(claim("$4", ""))
            .on_postgres(claim(SERVER_CLOCK, "FOR UPDATE SKIP LOCKED"))
            .bind(&by.token)
            .bind(&by.run)
            .bind(milliseconds(by.lease))
            .bind(now)
            .write_beside(&self.writer)
            .await?;
        row.map(rows::job).transpose()
    }

    async fn renew_lease(
        &self,
        lease: &Lease,
        length: Duration,
        now: Timestamp,
    ) -> StoreResult<Option<bool>> {
        let renew = |clock: &str| {
            format!(
                "UPDATE jobs SET lease_expires_at = {clock} + $2
                 WHERE id = $3 AND lease_token = $4
                 RETURNING cancel_requested"
            )
        };
        // PostgreSQL wants to be told the type of a placeholder that is not used.
        let row = query(renew("$1"))
            .on_postgres(format!("{} AND $1 IS NOT NULL", renew(SERVER_CLOCK)))
            .bind(now)
            .bind(milliseconds(length))
            .bind(&lease.job)
            .bind(&lease.token)
            .write_beside(&self.writer)
            .await?;
        row.map(|row| row.try_get(0)).transpose()
    }

    async fn progress(
        &self,
        lease: &Lease,
        stage: &str,
        progress: f64,
    ) -> StoreResult<Option<Job>> {
        let row = query(
            "UPDATE jobs SET stage = $1, progress = CASE WHEN progress > $2 THEN progress ELSE $2 END,
                     revision = revision + 1
             WHERE id = $3 AND lease_token = $4
             RETURNING *",
        )
        .bind(stage)
        .bind(progress)
        .bind(&lease.job)
        .bind(&lease.token)
        .write_beside(&self.writer)
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
        let row = query(
            "UPDATE jobs SET state = $1, failure = $2, result = $3, finished_at = $4,
                    progress = CASE $1 WHEN 'succeeded' THEN 1 ELSE progress END,
                    lease_token = NULL, lease_run = NULL, lease_expires_at = NULL,
                    revision = revision + 1
             WHERE id = $5 AND lease_token = $6
             RETURNING *",
        )
        .bind(state.as_str())
        .bind(failure)
        .bind(product.map(|p| &p.id))
        .bind(now)
        .bind(&lease.job)
        .bind(&lease.token)
        .fetch_optional(&mut transaction)
        .await?;
        let Some(row) = row else {
            transaction.commit().await?;
            return Ok(None);
        };
        let limit: Option<i64> = row.try_get("storage_limit")?;
        let mut job = rows::job(row)?;
        renew_volumes(&mut transaction, &job, now).await?;
        if let Some(product) = product {
            match has_no_room(&mut transaction, &job.tenant, product, limit).await? {
                None => {
                    insert_product(&mut transaction, product, &job.tenant).await?;
                }
                Some(failure) => job = fail(&mut transaction, &job.id, &failure).await?,
            }
        }
        transaction.commit().await?;
        Ok(Some(job))
    }

    async fn hand_back(&self, lease: &Lease, now: Timestamp) -> StoreResult<Option<Job>> {
        let given_back = format!(
            "UPDATE jobs SET attempts = attempts - 1, started_at = NULL, {LEFT_BY_WORKER}
             WHERE id = $3 AND lease_token = $4 RETURNING *"
        );
        let row = query(given_back)
            .bind(now)
            .bind(None::<String>)
            .bind(&lease.job)
            .bind(&lease.token)
            .write_optional(&self.writer)
            .await?;
        row.map(rows::job).transpose()
    }

    async fn abandon(&self, token: &str) -> StoreResult<Option<Job>> {
        let abandon = |running: &str| {
            format!(
                "UPDATE jobs SET state = 'queued', attempts = attempts - 1, started_at = NULL,
                        lease_token = NULL, lease_run = NULL, lease_expires_at = NULL,
                        revision = revision + 1
                 WHERE lease_token = $1 {running} RETURNING *"
            )
        };
        // PostgreSQL has an index of leases.
        let row = query(abandon("AND state = 'running'"))
            .on_postgres(abandon(""))
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
        // `$2` is the failure, if this death is the last one allowed.
        let counted = format!(
            "UPDATE jobs SET crashes = crashes + 1, {LEFT_BY_WORKER}
             WHERE id = $3 AND lease_token = $4 AND (crashes + 1 >= $5) = $6
             RETURNING *"
        );
        let reason = to_json(&limit.reason)?;
        for at_limit in [false, true] {
            let row = query(counted.clone())
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
        let released = |clock: &str| {
            format!(
                "UPDATE jobs SET interruptions = interruptions + 1, {LEFT_BY_WORKER}
                 WHERE state = 'running' AND (interruptions + 1 >= $3) = $4
                   AND ($5 IS NULL
                        OR (lease_run IS DISTINCT FROM $5 AND lease_expires_at <= {clock}))
                 RETURNING *"
            )
        };
        let reason = limit.map(|limit| to_json(&limit.reason)).transpose()?;
        let deaths = limit.map_or(i64::MAX, |limit| i64::from(limit.deaths));
        let mut jobs = Vec::new();
        for at_limit in [false, true] {
            let rows = query(released("$1"))
                .on_postgres(released(SERVER_CLOCK))
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
        let mut transaction = self.writer.begin().await?;
        let row = query(
            "UPDATE jobs SET cancel_requested = TRUE, revision = revision + 1,
                    finished_at = CASE state WHEN 'queued' THEN $1 ELSE finished_at END,
                    state = CASE state WHEN 'queued' THEN 'cancelled' ELSE state END
             WHERE id = $2 AND state NOT IN ('succeeded', 'failed', 'cancelled')
             RETURNING *",
        )
        .bind(now)
        .bind(id)
        .fetch_optional(&mut transaction)
        .await?;
        let job = row.map(rows::job).transpose()?;
        if let Some(job) = &job {
            record(&mut transaction, Activity::Delete, &job.id).await?;
        }
        transaction.commit().await?;
        if let Some(job) = job {
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

    fn is_shared(&self) -> bool {
        self.on_server()
    }

    async fn check(&self) -> StoreResult<()> {
        self.probe().await
    }

    async fn delete_job(
        &self,
        id: &str,
        by: Option<&ErasureAgent>,
        now: Timestamp,
    ) -> StoreResult<Deleted> {
        self.making_room(|| self.delete_job_once(id, by, now)).await
    }
}

impl SqlStore {
    /// Tries the erasure of the method without `_once`.
    async fn delete_job_once(
        &self,
        id: &str,
        by: Option<&ErasureAgent>,
        now: Timestamp,
    ) -> StoreResult<Deleted> {
        let mut transaction = self.writer.begin().await?;
        let row = query(
            "DELETE FROM jobs WHERE id = $1 AND state NOT IN ('queued', 'running')
             RETURNING tenant",
        )
        .bind(id)
        .fetch_optional(&mut transaction)
        .await?;
        let Some(row) = row else {
            drop(transaction);
            return Ok(match self.job(id).await? {
                Some(_) => Deleted::InUse,
                None => Deleted::Unknown,
            });
        };
        let tenant = rows::tenant(&row)?;
        record_deletion(&mut transaction, &tenant, id, now).await?;
        match by {
            Some(by) => {
                append(&mut transaction, &[erasure_event(by, &tenant, id, now)]).await?;
            }
            None => record(&mut transaction, Activity::Delete, id).await?,
        }
        transaction.commit().await?;
        Ok(Deleted::Done)
    }
}

impl SqlStore {
    /// The first item the job needs that does not exist.
    async fn missing(&self, job: &NewJob) -> StoreResult<Option<Filed>> {
        let volume = job.volume.iter().map(|id| ("volume", id));
        let others = job.needs.iter().map(|(field, id)| (field.as_str(), id));
        for (field, id) in volume.chain(others) {
            let found = query(
                "SELECT 1 FROM holdings WHERE tenant = $1 AND id = $2
                     AND (kind = 'volume' OR $3 != 'volume')",
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

/// These columns of a page of a tenant's jobs.
pub(super) fn listed(columns: &str, filter: &JobFilter, page: ListRequest) -> QueryBuilder {
    let mut query = QueryBuilder::new(format!("SELECT {columns} FROM jobs WHERE tenant = "));
    query.push_bind(filter.tenant.to_string());
    if let Some(volume) = &filter.volume {
        query.push(" AND volume = ").push_bind(volume.clone());
    }
    // The jobs are found by a filter that lets few through, else by the one of the others that usually lets the
    // fewest through.
    let narrow = filter.volume.is_some()
        || filter.tags != TagFilter::default()
        || filter.scan != ScanFilter::default();
    let mut finds = !narrow;
    let mut compare = |query: &mut QueryBuilder, column: &str| {
        query.push(" AND ");
        if std::mem::take(&mut finds) {
            query.push(column)
        } else {
            query.push_unindexed(column)
        };
        query.push(" = ");
    };
    for rare in [true, false] {
        let is_rare = |state: &JobState| *state != JobState::Succeeded;
        if let Some(state) = filter.state.filter(|state| is_rare(state) == rare) {
            compare(&mut query, "state");
            query.push_bind(state.as_str());
        }
        let is_rare = |priority: &Priority| *priority != Priority::Routine;
        if let Some(priority) = filter.priority.filter(|p| is_rare(p) == rare) {
            compare(&mut query, "priority");
            query.push_bind(priority.rank());
        }
        if let Some(kind) = filter.kind.as_ref().filter(|_| rare) {
            compare(&mut query, "kind");
            query.push_bind(kind.clone());
        }
    }
    if let Some(moment) = filter.created_after {
        if narrow {
            query.push(" AND ").push_unindexed("created_at");
            query.push(" > ").push_bind(moment);
        } else {
            let times = Times {
                table: "jobs",
                column: "created_at",
                bounds: &[(">", moment)],
            };
            push_times(&mut query, &times, &filter.tenant);
        }
    }
    push_tags(&mut query, "", &filter.tenant, Resource::Job, &filter.tags);
    let of_scan = "jobs AS x WHERE x.tenant = c.tenant AND x.volume = c.volume";
    push_scan(&mut query, ("", of_scan), &filter.tenant, &filter.scan);
    push_page(&mut query, "sequence", page);
    query
}

/// Why a product cannot be added, if the tenant may store no more than `limit` bytes.
async fn has_no_room(
    to: &mut Transaction<'_>,
    tenant: &Tenant,
    product: &Product,
    limit: Option<i64>,
) -> StoreResult<Option<Failure>> {
    let Some(limit) = limit.map(rows::unsigned) else {
        return Ok(None);
    };
    let held = query("SELECT 1 FROM holdings WHERE tenant = $1 AND id = $2")
        .bind(tenant.as_str())
        .bind(&product.id)
        .fetch_optional(&mut *to)
        .await?;
    let stored = stored_bytes(to, tenant).await?;
    let size: u64 = product.files.iter().map(|file| file.bytes).sum();
    if held.is_some() || stored.saturating_add(size) <= limit {
        return Ok(None);
    }
    let detail = format!(
        "The result has {size} bytes; the tenant stores {stored} of the {limit} bytes that it may store."
    );
    let failure = Failure::new(Fault::Request, "storage-quota", detail);
    Ok(Some(failure.fix(
        "DELETE items that are no longer needed, or ask the operator for more, then file the job again.",
    )))
}

/// Fails a job instead of the success that was just noted.
async fn fail(to: &mut Transaction<'_>, id: &str, failure: &Failure) -> StoreResult<Job> {
    let row = query(
        "UPDATE jobs SET state = 'failed', failure = $1, result = NULL WHERE id = $2 RETURNING *",
    )
    .bind(to_json(failure)?)
    .bind(id)
    .fetch_one(to)
    .await?;
    rows::job(row)
}

/// A key as the table holds it: unique among all tenants, as no tenant's name contains a slash.
fn stored_key(tenant: &Tenant, key: &str) -> String {
    format!("{tenant}/{key}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::DiskGauge;

    /// The steps of SQLite's plan for a statement.
    async fn plan(store: &SqlStore, statement: &str) -> Vec<String> {
        let rows = query(format!("EXPLAIN QUERY PLAN {statement}"))
            .fetch_all(&store.readers)
            .await
            .unwrap();
        rows::all(rows, |row| row.try_get("detail")).unwrap()
    }

    async fn open(folder: &tempfile::TempDir) -> SqlStore {
        let gauge = DiskGauge::new(folder.path(), None);
        let path = folder.path().join("jobs.db");
        let store = SqlStore::open(&path, Duration::from_secs(1), gauge).await;
        store.unwrap()
    }

    #[tokio::test]
    async fn the_volumes_of_a_job_are_found_by_their_key() {
        let folder = tempfile::tempdir().unwrap();
        let store = open(&folder).await;
        let found = plan(&store, &renewal_on_sqlite()).await;
        let by_key = "SEARCH holdings USING INDEX sqlite_autoindex_holdings_1 (tenant=? AND id=?)";
        assert_eq!(found[0], by_key, "{found:#?}");
        store.close().await;
    }

    #[tokio::test]
    async fn places_and_turns_are_read_from_an_index_alone() {
        let folder = tempfile::tempdir().unwrap();
        let store = open(&folder).await;
        let places = plan(&store, QUEUE_POSITIONS).await;
        for step in [
            "SEARCH turns USING COVERING INDEX jobs_ready (state=? AND priority=? AND turn>? AND turn<?)",
            "SEARCH own USING COVERING INDEX jobs_ready (state=? AND priority=? AND turn=? AND sequence>? AND \
             sequence<?)",
            "SEARCH earlier USING COVERING INDEX jobs_ready (state=? AND priority=? AND turn=? AND sequence<?)",
            "SEARCH higher USING COVERING INDEX jobs_ready (state=? AND priority<?)",
        ] {
            assert!(places.iter().any(|found| found == step), "{places:#?}");
        }
        let turn = plan(&store, &format!("SELECT {TURN_EXPRESSION}")).await;
        for step in [
            "SEARCH jobs USING COVERING INDEX jobs_ready (state=? AND priority=?)",
            "SEARCH jobs USING INDEX jobs_in_turn (tenant=? AND priority=?)",
        ] {
            assert!(turn.iter().any(|found| found == step), "{turn:#?}");
        }
        store.close().await;
    }
}
