//! The tables of archives. Triggers of the jobs table write their rows; see `migrations/0001_schema.sql`.

use super::access::{record, record_outcome};
use super::errands::{self, Errands};
use super::jobs::renew_volumes;
use super::rows::{self, to_json};
use crate::database::SqlStore;
use crate::query::{DbRow, query};
use async_trait::async_trait;
use std::collections::BTreeMap;
use ventriform_service::base::records::{Failure, Job, StoreResult, Tenant, Timestamp};
use ventriform_service::callers::{Activity, Outcome};
use ventriform_service::network::archive::{
    ArchiveBacklog, ArchiveStore, DuePull, DueSend, HeldSeries, ObjectDelivery, Pull,
    SendSettlement, SeriesKey,
};
use ventriform_service::network::hooks::{DeliveryState, Lane, NextAttempt};

#[async_trait]
impl ArchiveStore for SqlStore {
    async fn pull_lanes(&self) -> StoreResult<Vec<(Lane, Timestamp)>> {
        self.lanes_of(Errands::Pulls).await
    }

    async fn due_pulls(
        &self,
        lane: &Lane,
        now: Timestamp,
        limit: usize,
    ) -> StoreResult<Vec<DuePull>> {
        let rows = query(
            "SELECT p.*, j.source FROM pulls AS p JOIN jobs AS j ON j.id = p.job
             WHERE p.state = 'pending' AND p.destination = $1 AND p.next_attempt_at <= $2
                 AND p.tenant = $4
             ORDER BY p.next_attempt_at, p.job LIMIT $3",
        )
        .bind(&lane.destination)
        .bind(now)
        .bind(i64::try_from(limit).unwrap_or(i64::MAX))
        .bind(lane.tenant.as_str())
        .fetch_all(&self.readers)
        .await?;
        rows::all(rows, |row| {
            Ok(DuePull {
                job: row.try_get("job")?,
                tenant: rows::tenant(&row)?,
                source: rows::json(&row, "source")?,
                attempts: rows::count(&row, "attempts")?,
                since: row.try_get("since")?,
            })
        })
    }

    async fn pull_begun(&self, job: &str, now: Timestamp) -> StoreResult<()> {
        query(
            "UPDATE pulls SET attempts = attempts + 1, last_attempt_at = $1
             WHERE job = $2 AND state = 'pending' RETURNING job",
        )
        .bind(now)
        .bind(job)
        .write_optional(&self.writer)
        .await?;
        Ok(())
    }

    async fn pulled(&self, pulled: &str, volume: &str, now: Timestamp) -> StoreResult<Option<Job>> {
        let mut transaction = self.writer.begin().await?;
        let row = query(
            "UPDATE jobs SET volume = $1, revision = revision + 1
             WHERE id = $2 AND state = 'queued' AND volume = '' RETURNING *",
        )
        .bind(volume)
        .bind(pulled)
        .fetch_optional(&mut transaction)
        .await?;
        let job = row.map(rows::job).transpose()?;
        if let Some(job) = &job {
            query(
                "UPDATE pulls SET state = 'done', last_attempt_at = $1, last_error = NULL
                 WHERE job = $2",
            )
            .bind(now)
            .bind(&job.id)
            .execute(&mut transaction)
            .await?;
            renew_volumes(&mut transaction, job, now).await?;
        }
        if job.is_some() {
            record(&mut transaction, Activity::Create, pulled).await?;
        }
        transaction.commit().await?;
        Ok(job)
    }

    async fn pull_failed(
        &self,
        job: &str,
        error: &str,
        again: NextAttempt,
        now: Timestamp,
    ) -> StoreResult<()> {
        query(
            "UPDATE pulls SET last_attempt_at = $1, last_error = $2, next_attempt_at = $3,
                    attempts = attempts - $5
             WHERE job = $4 AND state = 'pending' RETURNING job",
        )
        .bind(now)
        .bind(error)
        .bind(again.at)
        .bind(job)
        .bind(errands::taken_back(again.counts))
        .write_optional(&self.writer)
        .await?;
        Ok(())
    }

    async fn recall_pulls(&self, now: Timestamp) -> StoreResult<u64> {
        self.recall(Errands::Pulls, now).await
    }

    async fn pull_given_up(
        &self,
        job: &str,
        failure: &Failure,
        now: Timestamp,
    ) -> StoreResult<Option<Job>> {
        let mut transaction = self.writer.begin().await?;
        let row = query(
            "UPDATE jobs SET state = 'failed', failure = $1, finished_at = $2,
                    revision = revision + 1
             WHERE id = $3 AND state = 'queued' AND volume = '' RETURNING *",
        )
        .bind(to_json(failure)?)
        .bind(now)
        .bind(job)
        .fetch_optional(&mut transaction)
        .await?;
        query("UPDATE pulls SET last_attempt_at = $1, last_error = $2 WHERE job = $3")
            .bind(now)
            .bind(&failure.detail)
            .bind(job)
            .execute(&mut transaction)
            .await?;
        if row.is_some() {
            record_outcome(&mut transaction, Activity::Create, Outcome::Refused, job).await?;
        }
        transaction.commit().await?;
        row.map(rows::job).transpose()
    }

    async fn pulls(&self, jobs: &[&str]) -> StoreResult<BTreeMap<String, Pull>> {
        let rows = query("SELECT * FROM pulls WHERE job IN (SELECT value FROM json_each($1))")
            .bind(to_json(&jobs)?)
            .fetch_all(&self.readers)
            .await?;
        rows.iter()
            .map(|row| {
                let state = match row.try_get("state")? {
                    "pending" => DeliveryState::Pending,
                    "done" => DeliveryState::Delivered,
                    _ => DeliveryState::Dead,
                };
                let pull = Pull {
                    state,
                    attempts: rows::count(row, "attempts")?,
                    next_attempt_at: errands::next_attempt(row, state)?,
                    last_error: row.try_get("last_error")?,
                };
                Ok((row.try_get("job")?, pull))
            })
            .collect()
    }

    async fn held_series(&self, key: SeriesKey<'_>) -> StoreResult<Option<HeldSeries>> {
        let row = query(
            "SELECT instances, volume FROM pulled_series
             WHERE tenant = $1 AND base = $2 AND study = $3 AND series = $4",
        )
        .bind(key.tenant.as_str())
        .bind(key.base)
        .bind(key.study)
        .bind(key.series)
        .fetch_optional(&self.readers)
        .await?;
        row.map(|row| {
            Ok(HeldSeries {
                instances: row.try_get("instances")?,
                volume: row.try_get("volume")?,
            })
        })
        .transpose()
    }

    async fn note_series(&self, key: SeriesKey<'_>, held: &HeldSeries) -> StoreResult<()> {
        query(
            "INSERT INTO pulled_series (tenant, base, study, series, instances, volume)
             SELECT $1, $2, $3, $4, $5, $6
             WHERE EXISTS (SELECT 1 FROM holdings WHERE tenant = $1 AND id = $6)
             ON CONFLICT (tenant, base, study, series)
             DO UPDATE SET instances = $5, volume = $6 RETURNING volume",
        )
        .bind(key.tenant.as_str())
        .bind(key.base)
        .bind(key.study)
        .bind(key.series)
        .bind(&held.instances)
        .bind(&held.volume)
        .write_optional(&self.writer)
        .await?;
        Ok(())
    }

    async fn send_lanes(&self) -> StoreResult<Vec<(Lane, Timestamp)>> {
        self.lanes_of(Errands::Sends).await
    }

    async fn due_sends(
        &self,
        lane: &Lane,
        now: Timestamp,
        limit: usize,
    ) -> StoreResult<Vec<DueSend>> {
        let rows = query(
            "SELECT * FROM sends
             WHERE state = 'pending' AND destination = $1 AND next_attempt_at <= $2
                 AND tenant = $4
             ORDER BY next_attempt_at, sequence LIMIT $3",
        )
        .bind(&lane.destination)
        .bind(now)
        .bind(i64::try_from(limit).unwrap_or(i64::MAX))
        .bind(lane.tenant.as_str())
        .fetch_all(&self.readers)
        .await?;
        rows::all(rows, |row| {
            Ok(DueSend {
                id: row.try_get("id")?,
                tenant: rows::tenant(&row)?,
                job: row.try_get("job")?,
                result: row.try_get("result")?,
                name: row.try_get("name")?,
                to: row.try_get("destination")?,
                attempts: rows::count(&row, "attempts")?,
                since: row.try_get("since")?,
            })
        })
    }

    async fn send_begun(&self, id: &str, now: Timestamp) -> StoreResult<()> {
        self.errand_begun(Errands::Sends, id, now).await
    }

    async fn settle_send(
        &self,
        send: &DueSend,
        settled: &SendSettlement,
        now: Timestamp,
    ) -> StoreResult<()> {
        let ended = (settled.state != DeliveryState::Pending).then_some(now);
        let mut transaction = self.writer.begin().await?;
        query(
            "UPDATE sends SET state = $1, last_attempt_at = $2, last_outcome = $3,
                    last_error = $4, ended_at = $5,
                    next_attempt_at = coalesce($6, next_attempt_at), attempts = attempts - $8
             WHERE id = $7 AND state = 'pending'",
        )
        .bind(settled.state.as_str())
        .bind(now)
        .bind(settled.outcome)
        .bind(&settled.error)
        .bind(ended)
        .bind(settled.again_at)
        .bind(&send.id)
        .bind(errands::taken_back(settled.counts))
        .execute(&mut transaction)
        .await?;
        // Nobody can ask about the deliveries of a job that was erased.
        query(
            "DELETE FROM sends WHERE id = $1 AND state != 'pending'
                 AND NOT EXISTS (SELECT 1 FROM jobs WHERE jobs.id = sends.job)",
        )
        .bind(&send.id)
        .execute(&mut transaction)
        .await?;
        // Also if the delivery was taken back meanwhile: the object has left.
        let outcome = match settled.state {
            DeliveryState::Pending => None,
            DeliveryState::Delivered => Some(Outcome::Success),
            DeliveryState::Dead => Some(Outcome::Refused),
        };
        if let Some(outcome) = outcome {
            record_outcome(&mut transaction, Activity::Read, outcome, &send.result).await?;
        }
        transaction.commit().await
    }

    async fn recall_sends(&self, now: Timestamp) -> StoreResult<u64> {
        self.recall(Errands::Sends, now).await
    }

    async fn sends(&self, jobs: &[&str]) -> StoreResult<BTreeMap<String, Vec<ObjectDelivery>>> {
        let rows = query(
            "SELECT * FROM sends WHERE job IN (SELECT value FROM json_each($1))
             ORDER BY sequence",
        )
        .bind(to_json(&jobs)?)
        .fetch_all(&self.readers)
        .await?;
        let mut found: BTreeMap<String, Vec<ObjectDelivery>> = BTreeMap::new();
        for row in rows {
            found
                .entry(row.try_get("job")?)
                .or_default()
                .push(delivery(&row)?);
        }
        Ok(found)
    }

    async fn redeliver_object(
        &self,
        tenant: &Tenant,
        job: &str,
        id: &str,
        now: Timestamp,
    ) -> StoreResult<Option<ObjectDelivery>> {
        let row = self
            .run_again(Errands::Sends, (tenant, job, id), now)
            .await?;
        row.as_ref().map(delivery).transpose()
    }

    async fn archive_backlog(&self) -> StoreResult<ArchiveBacklog> {
        let pulls = query("SELECT count(*) FROM pulls WHERE state = 'pending'")
            .fetch_one(&self.readers)
            .await?;
        Ok(ArchiveBacklog {
            pulls: rows::unsigned(pulls.try_get(0)?),
            sends: self.backlog_of(Errands::Sends).await?,
        })
    }
}

fn delivery(row: &DbRow) -> StoreResult<ObjectDelivery> {
    let state = errands::state(row)?;
    Ok(ObjectDelivery {
        id: row.try_get("id")?,
        name: row.try_get("name")?,
        to: row.try_get("destination")?,
        state,
        attempts: rows::count(row, "attempts")?,
        next_attempt_at: errands::next_attempt(row, state)?,
        last_attempt_at: row.try_get("last_attempt_at")?,
        last_outcome: row.try_get("last_outcome")?,
        last_error: row.try_get("last_error")?,
    })
}
