//! The tables of volumes and products in SQLite.

use super::rows::{self, to_json};
use super::sqlite::SqliteStore;
use super::writer::Write;
use crate::jobs::{
    Catalogue, Deleted, ListPage, ListRequest, Product, Resource, StoreResult, StoredVolume,
    Timestamp,
};
use async_trait::async_trait;
use sqlx::{Row, SqliteConnection};

#[async_trait]
impl Catalogue for SqliteStore {
    async fn add_volume(&self, volume: &StoredVolume) -> StoreResult<bool> {
        let mut transaction = self.writer.begin().await?;
        let done = sqlx::query(
            "INSERT INTO volumes (id, created_at, used_at, bytes, files, facts)
             VALUES (?1, ?2, ?2, ?3, ?4, ?5) ON CONFLICT (id) DO NOTHING",
        )
        .bind(&volume.id)
        .bind(volume.created_at)
        .bind(i64::try_from(volume.bytes).unwrap_or(i64::MAX))
        .bind(to_json(&volume.files)?)
        .bind(to_json(&volume.facts)?)
        .execute(&mut *transaction)
        .await?;
        forget_deletion(&mut transaction, &volume.id).await?;
        transaction.commit().await?;
        Ok(done.rows_affected() == 1)
    }

    async fn renew_volume(&self, id: &str, now: Timestamp) -> StoreResult<Option<StoredVolume>> {
        let row =
            sqlx::query("UPDATE volumes SET used_at = max(used_at, ?) WHERE id = ? RETURNING *")
                .bind(now)
                .bind(id)
                .write_optional(&self.writer)
                .await?;
        row.map(rows::volume).transpose()
    }

    async fn volume(&self, id: &str) -> StoreResult<Option<StoredVolume>> {
        let row = sqlx::query("SELECT * FROM volumes WHERE id = ?")
            .bind(id)
            .fetch_optional(&self.readers)
            .await?;
        row.map(rows::volume).transpose()
    }

    async fn volumes(&self, page: ListRequest) -> StoreResult<ListPage<StoredVolume>> {
        let rows = sqlx::query(
            "SELECT * FROM volumes WHERE ?1 IS NULL OR sequence < ?1
             ORDER BY sequence DESC LIMIT ?2",
        )
        .bind(page.before)
        .bind(i64::from(page.limit) + 1)
        .fetch_all(&self.readers)
        .await?;
        rows::page(rows, page, rows::volume, |v| v.sequence)
    }

    async fn delete_volume(&self, id: &str, now: Timestamp) -> StoreResult<Deleted> {
        self.delete_unneeded("volumes", id, now).await
    }

    async fn add_product(&self, product: &Product) -> StoreResult<bool> {
        let mut transaction = self.writer.begin().await?;
        let new = insert_product(&mut transaction, product).await?;
        transaction.commit().await?;
        Ok(new)
    }

    async fn product(&self, id: &str) -> StoreResult<Option<Product>> {
        let row = sqlx::query("SELECT * FROM products WHERE id = ?")
            .bind(id)
            .fetch_optional(&self.readers)
            .await?;
        row.map(rows::product).transpose()
    }

    async fn products(&self, kind: Resource, page: ListRequest) -> StoreResult<ListPage<Product>> {
        let rows = sqlx::query(
            "SELECT * FROM products WHERE kind = ?1 AND (?2 IS NULL OR sequence < ?2)
             ORDER BY sequence DESC LIMIT ?3",
        )
        .bind(kind.noun())
        .bind(page.before)
        .bind(i64::from(page.limit) + 1)
        .fetch_all(&self.readers)
        .await?;
        rows::page(rows, page, rows::product, |p| p.sequence)
    }

    async fn delete_product(&self, id: &str, now: Timestamp) -> StoreResult<Deleted> {
        self.delete_unneeded("products", id, now).await
    }

    async fn erased_at(&self, id: &str) -> StoreResult<Option<Timestamp>> {
        let row = sqlx::query("SELECT erased_at FROM erased WHERE tenant = 'default' AND id = ?")
            .bind(id)
            .fetch_optional(&self.readers)
            .await?;
        Ok(row.map(|row| row.get(0)))
    }

    async fn older_than(&self, before: Timestamp) -> StoreResult<Vec<String>> {
        let rows = sqlx::query(
            "SELECT id FROM jobs WHERE finished_at < ?1
             UNION ALL SELECT id FROM products WHERE created_at < ?1 AND kind != 'template'
             UNION ALL SELECT id FROM volumes WHERE used_at < ?1",
        )
        .bind(before)
        .fetch_all(&self.readers)
        .await?;
        Ok(rows.into_iter().map(|row| row.get(0)).collect())
    }
}

impl SqliteStore {
    /// Deletes a row of `table`, unless a job that has not ended needs it.
    async fn delete_unneeded(
        &self,
        table: &'static str,
        id: &str,
        now: Timestamp,
    ) -> StoreResult<Deleted> {
        let mut transaction = self.writer.begin().await?;
        let delete = format!(
            "DELETE FROM {table} WHERE id = ?1
               AND NOT EXISTS (SELECT 1 FROM jobs
                   WHERE volume = ?1 AND state IN ('queued', 'running'))
               AND NOT EXISTS (SELECT 1 FROM jobs
                   WHERE needs != '{{}}' AND state IN ('queued', 'running')
                     AND EXISTS (SELECT 1 FROM json_each(jobs.needs) WHERE value = ?1))"
        );
        let done = sqlx::query(sqlx::AssertSqlSafe(delete))
            .bind(id)
            .execute(&mut *transaction)
            .await?;
        if done.rows_affected() == 0 {
            let count = format!("SELECT count(*) FROM {table} WHERE id = ?");
            let left: i64 = sqlx::query_scalar(sqlx::AssertSqlSafe(count))
                .bind(id)
                .fetch_one(&mut *transaction)
                .await?;
            return Ok(match left {
                0 => Deleted::Unknown,
                _ => Deleted::InUse,
            });
        }
        record_deletion(&mut transaction, id, now).await?;
        transaction.commit().await?;
        Ok(Deleted::Done)
    }
}

/// Adds a product within a transaction, unless its id exists already. Returns whether it was
/// added.
pub(super) async fn insert_product(
    to: &mut SqliteConnection,
    product: &Product,
) -> StoreResult<bool> {
    let done = sqlx::query(
        "INSERT INTO products
             (id, kind, created_at, volume, parameters, summary, software, files)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (id) DO NOTHING",
    )
    .bind(&product.id)
    .bind(product.resource().noun())
    .bind(product.created_at)
    .bind(&product.volume)
    .bind(to_json(&product.parameters)?)
    .bind(to_json(&product.summary)?)
    .bind(&product.software)
    .bind(to_json(&product.files)?)
    .execute(&mut *to)
    .await?;
    forget_deletion(to, &product.id).await?;
    Ok(done.rows_affected() == 1)
}

/// Records that the item with that id was deleted.
pub(super) async fn record_deletion(
    to: &mut SqliteConnection,
    id: &str,
    now: Timestamp,
) -> StoreResult<()> {
    sqlx::query("INSERT OR REPLACE INTO erased (tenant, id, erased_at) VALUES ('default', ?, ?)")
        .bind(id)
        .bind(now)
        .execute(to)
        .await?;
    Ok(())
}

/// Removes the record of a deletion: the item exists again.
async fn forget_deletion(to: &mut SqliteConnection, id: &str) -> StoreResult<()> {
    sqlx::query("DELETE FROM erased WHERE tenant = 'default' AND id = ?")
        .bind(id)
        .execute(to)
        .await?;
    Ok(())
}
