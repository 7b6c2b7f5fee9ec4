//! The common columns of the tables of errands. An errand is work towards a destination on the network
//! (fetch a series, deliver an object, call a webhook) that waits in a table until it succeeds, is
//! given up or is taken back. Triggers of the jobs table write the rows; see `migrations/0001_schema.sql`.

use super::access::record;
use super::rows;
use crate::database::SqlStore;
use crate::query::{DbRow, query};
use ventriform_service::base::records::{StoreResult, Tenant, Timestamp};
use ventriform_service::callers::Activity;
use ventriform_service::network::hooks::{Backlog, DeliveryState, Lane};

/// A stamp may be so far ahead of the clock that reads it, ms: processes on one database ask for its time in turn.
const CLOCK_NOISE_MS: i64 = 60_000;

/// A table of errands.
#[derive(Debug, Clone, Copy)]
pub(super) enum Errands {
    /// Series to fetch from archives.
    Pulls,
    /// Objects to deliver to archives.
    Sends,
    /// Webhooks to call.
    Deliveries,
}

impl Errands {
    fn table(self) -> &'static str {
        match self {
            Self::Pulls => "pulls",
            Self::Sends => "sends",
            Self::Deliveries => "deliveries",
        }
    }
}

impl SqlStore {
    /// The lanes of waiting errands, each with the time when its first one is due.
    pub(super) async fn lanes_of(&self, errands: Errands) -> StoreResult<Vec<(Lane, Timestamp)>> {
        let table = errands.table();
        // Jumps through the index from destination to destination, and at each from tenant to tenant.
        let rows = query(format!(
            "WITH RECURSIVE place (name) AS (
                 SELECT min(destination) FROM {table} WHERE state = 'pending'
                 UNION ALL
                 SELECT (SELECT min(e.destination) FROM {table} AS e
                         WHERE e.state = 'pending' AND e.destination > place.name)
                 FROM place WHERE place.name IS NOT NULL),
             found (destination, tenant) AS (
                 SELECT place.name, (SELECT min(e.tenant) FROM {table} AS e
                                     WHERE e.state = 'pending' AND e.destination = place.name)
                 FROM place WHERE place.name IS NOT NULL
                 UNION ALL
                 SELECT found.destination, (SELECT min(e.tenant) FROM {table} AS e
                                            WHERE e.state = 'pending'
                                                AND e.destination = found.destination
                                                AND e.tenant > found.tenant)
                 FROM found WHERE found.tenant IS NOT NULL)
             SELECT found.destination, found.tenant,
                    (SELECT min(e.next_attempt_at) FROM {table} AS e
                     WHERE e.state = 'pending' AND e.destination = found.destination
                         AND e.tenant = found.tenant)
             FROM found WHERE found.tenant IS NOT NULL
             ORDER BY found.destination, found.tenant",
        ))
        .fetch_all(&self.readers)
        .await?;
        rows.iter()
            .map(|row| {
                let lane = Lane {
                    destination: row.try_get(0)?,
                    tenant: rows::tenant(row)?,
                };
                Ok((lane, row.try_get(2)?))
            })
            .collect()
    }

    /// How many errands wait, since when, and how many were given up. Not for pulls, which have no index of
    /// states.
    pub(super) async fn backlog_of(&self, errands: Errands) -> StoreResult<Backlog> {
        let table = errands.table();
        let row = query(format!(
            "SELECT (SELECT count(*) FROM {table} WHERE state = 'pending'),
                    (SELECT min(since) FROM {table} WHERE state = 'pending'),
                    (SELECT count(*) FROM {table} WHERE state = 'dead')",
        ))
        .fetch_one(&self.readers)
        .await?;
        let count = |column: usize| row.try_get(column).map(rows::unsigned);
        Ok(Backlog {
            pending: count(0)?,
            oldest: row.try_get(1)?,
            dead: count(2)?,
        })
    }

    /// Counts an attempt that is about to be made.
    pub(super) async fn errand_begun(
        &self,
        errands: Errands,
        id: &str,
        now: Timestamp,
    ) -> StoreResult<()> {
        let table = errands.table();
        query(format!(
            "UPDATE {table} SET attempts = attempts + 1, last_attempt_at = $1
             WHERE id = $2 AND state = 'pending' RETURNING id",
        ))
        .bind(now)
        .bind(id)
        .write_optional(&self.writer)
        .await?;
        Ok(())
    }

    /// Makes the waiting errands due whose pause was set by a clock that was ahead: they were tried last, or began,
    /// later than `now`. Returns how many these are.
    pub(super) async fn recall(&self, errands: Errands, now: Timestamp) -> StoreResult<u64> {
        let table = errands.table();
        let put_off = "state = 'pending' AND next_attempt_at > $1
                 AND (since > $2 OR (last_attempt_at IS NOT NULL AND last_attempt_at > $2))";
        let latest = now.saturating_add(CLOCK_NOISE_MS);
        let found = query(format!("SELECT 1 FROM {table} WHERE {put_off} LIMIT 1"))
            .bind(now)
            .bind(latest);
        if found.fetch_optional(&self.readers).await?.is_none() {
            return Ok(0);
        }
        query(format!(
            "UPDATE {table} SET next_attempt_at = $1,
                    since = CASE WHEN since > $1 THEN $1 ELSE since END,
                    last_attempt_at = CASE WHEN last_attempt_at > $1 THEN $1 ELSE last_attempt_at END
             WHERE {put_off}"
        ))
        .bind(now)
        .bind(latest)
        .write(&self.writer)
        .await
    }

    /// Lets an ended errand of a job wait again, unless what it would deliver was erased. Returns its row as
    /// it is then, or nothing if the job has no such errand.
    pub(super) async fn run_again(
        &self,
        errands: Errands,
        (tenant, job, id): (&Tenant, &str, &str),
        now: Timestamp,
    ) -> StoreResult<Option<DbRow>> {
        let table = errands.table();
        let mut transaction = self.writer.begin().await?;
        query(format!(
            "UPDATE {table} SET state = 'pending', attempts = 0, since = $1, next_attempt_at = $1,
                    ended_at = NULL
             WHERE id = $2 AND job = $3 AND tenant = $4 AND state != 'pending'
               AND last_outcome IS DISTINCT FROM 'erased'",
        ))
        .bind(now)
        .bind(id)
        .bind(job)
        .bind(tenant.as_str())
        .execute(&mut transaction)
        .await?;
        let found = format!("SELECT * FROM {table} WHERE id = $1 AND job = $2 AND tenant = $3");
        let row = query(found)
            .bind(id)
            .bind(job)
            .bind(tenant.as_str())
            .fetch_optional(&mut transaction)
            .await?;
        if row.is_some() {
            record(&mut transaction, Activity::Update, job).await?;
        }
        transaction.commit().await?;
        Ok(row)
    }
}

/// How many attempts are taken back of those that were counted.
pub(super) fn taken_back(counts: bool) -> i64 {
    i64::from(!counts)
}

/// The state of an errand's row.
pub(super) fn state(row: &DbRow) -> StoreResult<DeliveryState> {
    Ok(DeliveryState::parse(row.try_get("state")?).unwrap_or(DeliveryState::Dead))
}

/// When an errand's row in that state is tried next.
pub(super) fn next_attempt(row: &DbRow, state: DeliveryState) -> StoreResult<Option<Timestamp>> {
    let at: Timestamp = row.try_get("next_attempt_at")?;
    Ok((state == DeliveryState::Pending).then_some(at))
}
