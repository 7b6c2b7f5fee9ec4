//! Repairing and copying the database; for [`super::doctor`] and [`backup()`](super::backup()).

use super::rows::to_json;
use super::sqlite::SqliteStore;
use super::writer::Write;
use crate::jobs::{ItemRecord, StoreResult, Tenant};
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{AssertSqlSafe, ConnectOptions, Connection, Row, SqliteConnection};
use std::path::Path;

impl SqliteStore {
    /// What is wrong with the database's structure: `PRAGMA integrity_check` and
    /// `foreign_key_check`.
    pub(super) async fn all_defects(&self) -> StoreResult<Vec<String>> {
        let checked = sqlx::query("PRAGMA integrity_check(20)");
        let lines = checked.fetch_all(&self.readers).await?;
        let lines = lines.into_iter().map(|row| row.get::<String, _>(0));
        let mut defects: Vec<String> = lines.filter(|line| line != "ok").collect();
        let keys = sqlx::query("PRAGMA foreign_key_check");
        for row in keys.fetch_all(&self.readers).await? {
            let table: String = row.get(0);
            defects.push(format!(
                "a row of `{table}` names another that does not exist"
            ));
        }
        Ok(defects)
    }

    /// Removes the row of an item, and every holding of it. Does not record an erasure.
    pub(super) async fn forget(&self, id: &str) -> StoreResult<()> {
        let mut transaction = self.writer.begin().await?;
        for statement in [
            "DELETE FROM volumes WHERE id = ?",
            "DELETE FROM products WHERE id = ?",
            "DELETE FROM sources WHERE id = ?",
            "DELETE FROM scans WHERE volume = ?",
            "DELETE FROM holdings WHERE id = ?",
        ] {
            sqlx::query(statement)
                .bind(id)
                .execute(&mut *transaction)
                .await?;
        }
        transaction.commit().await
    }

    /// Makes the row of an item anew. Unless somebody holds the item, `heir` does from now on.
    pub(super) async fn restore(&self, record: &ItemRecord, heir: &Tenant) -> StoreResult<()> {
        let mut transaction = self.writer.begin().await?;
        let (id, kind, created_at) = match record {
            ItemRecord::Volume(volume) => {
                sqlx::query(
                    "INSERT OR REPLACE INTO volumes (id, created_at, bytes, files, facts)
                     VALUES (?, ?, ?, ?, ?)",
                )
                .bind(&volume.id)
                .bind(volume.created_at)
                .bind(i64::try_from(volume.bytes).unwrap_or(i64::MAX))
                .bind(to_json(&volume.files)?)
                .bind(to_json(&volume.facts)?)
                .execute(&mut *transaction)
                .await?;
                (&volume.id, "volume", volume.created_at)
            }
            ItemRecord::Product(product) => {
                super::sqlite_catalogue::insert_content(&mut transaction, product).await?;
                (&product.id, product.resource().noun(), product.created_at)
            }
        };
        sqlx::query(
            "INSERT INTO holdings (tenant, id, kind, created_at, renewed_at)
             SELECT ?1, ?2, ?3, ?4, ?4
             WHERE NOT EXISTS (SELECT 1 FROM holdings WHERE id = ?2)",
        )
        .bind(heir.as_str())
        .bind(id)
        .bind(kind)
        .bind(created_at)
        .execute(&mut *transaction)
        .await?;
        if let ItemRecord::Product(product) = record
            && let Some(volume) = &product.volume
        {
            sqlx::query(
                "INSERT OR IGNORE INTO sources (tenant, id, volume)
                 SELECT tenant, id, ?2 FROM holdings WHERE id = ?1",
            )
            .bind(id)
            .bind(volume)
            .execute(&mut *transaction)
            .await?;
        }
        transaction.commit().await
    }

    /// Copies every row that can be read from the damaged database `old`; none, if it cannot even be
    /// opened.
    pub(super) async fn salvage(&self, old: &Path) -> StoreResult<()> {
        let tables: Vec<String> = sqlx::query_scalar(
            "SELECT name FROM sqlite_schema
             WHERE type = 'table' AND name NOT LIKE 'sqlite\\_%' ESCAPE '\\'
               AND name NOT IN ('_sqlx_migrations', 'probe')",
        )
        .fetch_all(&self.readers)
        .await?;
        let mut connection = self.writer.connect().await?;
        let attached = sqlx::query("ATTACH ? AS old")
            .bind(old.to_string_lossy())
            .execute(&mut connection)
            .await;
        match attached {
            Ok(_) => {
                for table in tables {
                    if let Err(error) = salvage_table(&mut connection, &table).await {
                        tracing::warn!(table, %error, "no row of this table could be read");
                    }
                }
            }
            Err(error) => tracing::warn!(%error, "no row of the damaged database could be read"),
        }
        let _ = connection.close().await;
        for orphans in [
            "DELETE FROM sources WHERE NOT EXISTS
             (SELECT 1 FROM holdings h WHERE h.tenant = sources.tenant AND h.id = sources.id)",
            "DELETE FROM scans WHERE NOT EXISTS
             (SELECT 1 FROM holdings h WHERE h.tenant = scans.tenant AND h.id = scans.volume)",
        ] {
            sqlx::query(orphans).write(&self.writer).await?;
        }
        Ok(())
    }

    /// Writes a copy of the database at `source`, as of one moment, to the new file `copy`.
    pub(super) async fn snapshot(source: &Path, copy: &Path) -> StoreResult<()> {
        let options = SqliteConnectOptions::new().filename(source);
        let mut connection = options.connect().await?;
        sqlx::query("VACUUM INTO ?")
            .bind(copy.to_string_lossy())
            .execute(&mut connection)
            .await?;
        Ok(connection.close().await?)
    }
}

/// Copies one table: all of it, or row by row from both ends up to the damage.
async fn salvage_table(to: &mut SqliteConnection, table: &str) -> StoreResult<()> {
    let columns = "SELECT new.name FROM pragma_table_info(?1) AS new
                   JOIN pragma_table_info(?1, 'old') AS old ON old.name = new.name";
    let columns: Vec<String> = sqlx::query_scalar(columns)
        .bind(table)
        .fetch_all(&mut *to)
        .await?;
    let columns = columns.join(", ");
    let copy =
        format!("INSERT OR IGNORE INTO main.{table} ({columns}) SELECT {columns} FROM old.{table}");
    let whole = sqlx::query(AssertSqlSafe(copy.clone()))
        .execute(&mut *to)
        .await;
    if whole.is_ok() {
        return Ok(());
    }
    for (beyond, order, mut last) in [(">", "ASC", i64::MIN), ("<", "DESC", i64::MAX)] {
        let next = format!(
            "SELECT rowid FROM old.{table} WHERE rowid {beyond} ? ORDER BY rowid {order} LIMIT 1"
        );
        let one = format!("{copy} WHERE rowid = ?");
        loop {
            let row = sqlx::query_scalar(AssertSqlSafe(next.clone())).bind(last);
            let Ok(Some(rowid)) = row.fetch_optional(&mut *to).await else {
                break;
            };
            last = rowid;
            let copied = sqlx::query(AssertSqlSafe(one.clone())).bind(rowid);
            if copied.execute(&mut *to).await.is_err() {
                break;
            }
        }
    }
    Ok(())
}
