//! The processes on one database: their rows, holds and duties, and what they tell each other. On
//! PostgreSQL only.

use super::rows::{self, to_json};
use crate::database::{Readers, SqlStore, Transaction};
use crate::news::PgNews;
use crate::query::{Query, query};
use async_trait::async_trait;
use sqlx::postgres::PgPool;
use std::sync::Arc;
use std::time::Duration;
use ventriform_service::base::records::{NewsFeed, Peers, StoreResult, TrustedNow};

/// How long is remembered which places of files were given up: longer than any process may stand still
/// between writing files and their row.
const DEAD_PEER_TTL: Duration = Duration::from_secs(7 * 86_400);

fn milliseconds(length: Duration) -> i64 {
    i64::try_from(length.as_millis()).unwrap_or(i64::MAX / 2)
}

/// The processes on a database of PostgreSQL.
struct PgPeers {
    store: Arc<SqlStore>,
    pool: PgPool,
}

/// Finds a row if a process other than `run` that lives holds one of the items.
fn holds_of_others(run: &str, items: &[String]) -> StoreResult<Query> {
    Ok(query(
        "SELECT 1 FROM holds JOIN runs ON runs.id = holds.run
         WHERE holds.run != $1 AND runs.expires_at > database_now()
           AND holds.item IN (SELECT value FROM json_each($2)) LIMIT 1",
    )
    .bind(run)
    .bind(to_json(&items)?))
}

#[async_trait]
impl Peers for PgPeers {
    fn run(&self) -> &str {
        &self.store.run
    }

    async fn heartbeat(&self, workers: usize, length: Duration) -> StoreResult<()> {
        query(
            "INSERT INTO runs (id, workers, expires_at) VALUES ($1, $2, database_now() + $3)
             ON CONFLICT (id) DO UPDATE
             SET workers = excluded.workers, expires_at = excluded.expires_at",
        )
        .bind(&self.store.run)
        .bind(i64::try_from(workers).unwrap_or(i64::MAX))
        .bind(milliseconds(length))
        .write_beside(&self.store.writer)
        .await?;
        Ok(())
    }

    async fn leave(&self) -> StoreResult<()> {
        let mut transaction = self.store.writer.begin().await?;
        for end in [
            "DELETE FROM duties WHERE run = $1",
            "DELETE FROM holds WHERE run = $1",
            "DELETE FROM runs WHERE id = $1",
        ] {
            query(end)
                .bind(&self.store.run)
                .execute(&mut transaction)
                .await?;
        }
        transaction.commit().await
    }

    async fn workers(&self) -> StoreResult<u64> {
        let row = query(
            "SELECT CAST(coalesce(sum(workers), 0) AS BIGINT) FROM runs
             WHERE expires_at > database_now()",
        )
        .fetch_one(&self.store.readers)
        .await?;
        Ok(rows::unsigned(row.try_get(0)?))
    }

    async fn pin(&self, token: &str, item: &str) -> StoreResult<()> {
        // Not beside other writers: an erasure looks for holds before it deletes.
        query("INSERT INTO holds (token, run, item) VALUES ($1, $2, $3)")
            .bind(token)
            .bind(&self.store.run)
            .bind(item)
            .write(&self.store.writer)
            .await?;
        Ok(())
    }

    async fn unpin(&self, token: &str) -> StoreResult<()> {
        query("DELETE FROM holds WHERE token = $1")
            .bind(token)
            .write_beside(&self.store.writer)
            .await?;
        Ok(())
    }

    async fn pinned_by_others(&self, items: &[String]) -> StoreResult<bool> {
        let held = holds_of_others(&self.store.run, items)?;
        Ok(held.fetch_optional(&self.store.readers).await?.is_some())
    }

    async fn lead(&self, duty: &str, length: Duration) -> StoreResult<bool> {
        let taken = query(
            "INSERT INTO duties (name, run, expires_at) VALUES ($1, $2, database_now() + $3)
             ON CONFLICT (name) DO UPDATE SET run = excluded.run, expires_at = excluded.expires_at
             WHERE duties.run = excluded.run OR duties.expires_at <= database_now()
             RETURNING name",
        )
        .bind(duty)
        .bind(&self.store.run)
        .bind(milliseconds(length))
        .write_beside(&self.store.writer)
        .await?;
        Ok(taken.is_some())
    }

    async fn tidy(&self, _: TrustedNow) -> StoreResult<()> {
        let mut transaction = self.store.writer.begin().await?;
        query("DELETE FROM runs WHERE expires_at < database_now()")
            .execute(&mut transaction)
            .await?;
        query("DELETE FROM holds WHERE NOT EXISTS (SELECT 1 FROM runs WHERE id = holds.run)")
            .execute(&mut transaction)
            .await?;
        query("DELETE FROM given_up_places WHERE given_up_at < database_now() - $1")
            .bind(milliseconds(DEAD_PEER_TTL))
            .execute(&mut transaction)
            .await?;
        transaction.commit().await
    }

    fn news(&self) -> Box<dyn NewsFeed> {
        Box::new(PgNews::new(&self.pool, &self.store.run))
    }
}

impl SqlStore {
    /// The processes on this database, if it is one that several can share.
    pub(crate) fn peers(self: &Arc<Self>) -> Option<Arc<dyn Peers>> {
        match &self.readers {
            Readers::Sqlite(_) => None,
            Readers::Postgres(shared) => Some(Arc::new(PgPeers {
                store: self.clone(),
                pool: shared.pool.clone(),
            })),
        }
    }

    /// Within an erasure: whether another process holds one of the items.
    pub(super) async fn is_held_elsewhere(
        &self,
        transaction: &mut Transaction<'_>,
        items: &[String],
    ) -> StoreResult<bool> {
        if !self.on_server() {
            return Ok(false);
        }
        let held = holds_of_others(&self.run, items)?;
        let row = held.fetch_optional(transaction).await?;
        Ok(row.is_some())
    }

    /// Where the files of the records are, if that was noted.
    pub(crate) async fn place(&self) -> StoreResult<Option<String>> {
        let row = query("SELECT place FROM store_place")
            .fetch_optional(&self.readers)
            .await?;
        row.map(|row| row.try_get(0)).transpose()
    }

    /// Notes that the files of the records are at `place` now.
    pub(crate) async fn change_place(&self, place: &str) -> StoreResult<()> {
        let change = query("UPDATE store_place SET place = $1").bind(place);
        change.write(&self.writer).await?;
        Ok(())
    }

    /// Whether a process lives that uses this database and a bucket.
    pub(crate) async fn has_processes(&self) -> StoreResult<bool> {
        let row = query("SELECT EXISTS (SELECT 1 FROM runs WHERE expires_at > database_now())")
            .fetch_one(&self.readers)
            .await?;
        row.try_get(0)
    }

    /// Where the files of the records are: `place`, unless another place was noted before.
    pub(crate) async fn note_place(&self, place: &str) -> StoreResult<String> {
        let mut transaction = self.writer.begin().await?;
        query("INSERT INTO store_place (id, place) VALUES (1, $1) ON CONFLICT DO NOTHING")
            .bind(place)
            .execute(&mut transaction)
            .await?;
        let row = query("SELECT place FROM store_place")
            .fetch_one(&mut transaction)
            .await?;
        transaction.commit().await?;
        row.try_get(0)
    }
}
