//! Repairing and copying the database; for [`super::doctor`] and [`backup()`](super::backup()).

use super::database::SqlStore;
use super::query::query;
use super::tables::{insert_content, to_json};
use crate::faults;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{AssertSqlSafe, ConnectOptions, Connection, SqliteConnection};
use std::path::Path;
use ventriform_service::records::{ItemRecord, StoreResult, Tenant};

impl SqlStore {
    /// The faults of the database's structure: `PRAGMA integrity_check` and
    /// `foreign_key_check`.
    pub(super) async fn all_defects(&self) -> StoreResult<Vec<String>> {
        let checked = query("PRAGMA integrity_check(20)");
        let mut defects = Vec::new();
        for row in checked.fetch_all(&self.readers).await? {
            let line: String = row.try_get(0)?;
            defects.extend(Some(line).filter(|line| line != "ok"));
        }
        let keys = query("PRAGMA foreign_key_check");
        for row in keys.fetch_all(&self.readers).await? {
            let table: String = row.try_get(0)?;
            defects.push(format!(
                "a row of `{table}` names another that does not exist"
            ));
        }
        Ok(defects)
    }

    /// Removes the row of an item, and every ownership of it. Does not record an erasure.
    pub(super) async fn forget(&self, id: &str) -> StoreResult<()> {
        let mut transaction = self.writer.begin().await?;
        for statement in [
            "DELETE FROM volumes WHERE id = $1",
            "DELETE FROM products WHERE id = $1",
            "DELETE FROM sources WHERE id = $1",
            "DELETE FROM scans WHERE volume = $1",
            "DELETE FROM holdings WHERE id = $1",
        ] {
            query(statement).bind(id).execute(&mut transaction).await?;
        }
        transaction.commit().await
    }

    /// Makes the row of an item anew. Unless somebody holds the item, `heir` does from now on.
    pub(super) async fn restore(&self, record: &ItemRecord, heir: &Tenant) -> StoreResult<()> {
        let mut transaction = self.writer.begin().await?;
        let (id, kind, created_at) = match record {
            ItemRecord::Volume(volume) => {
                query(
                    "INSERT OR REPLACE INTO volumes (id, created_at, bytes, files, facts)
                     VALUES ($1, $2, $3, $4, $5)",
                )
                .bind(&volume.id)
                .bind(volume.created_at)
                .bind(i64::try_from(volume.bytes).unwrap_or(i64::MAX))
                .bind(to_json(&volume.files)?)
                .bind(to_json(&volume.facts)?)
                .execute(&mut transaction)
                .await?;
                (&volume.id, "volume", volume.created_at)
            }
            ItemRecord::Product(product) => {
                insert_content(&mut transaction, product).await?;
                (&product.id, product.resource().noun(), product.created_at)
            }
        };
        query(
            "INSERT INTO holdings (tenant, id, kind, created_at, renewed_at)
             SELECT $1, $2, $3, $4, $4
             WHERE NOT EXISTS (SELECT 1 FROM holdings WHERE id = $2)",
        )
        .bind(heir.as_str())
        .bind(id)
        .bind(kind)
        .bind(created_at)
        .execute(&mut transaction)
        .await?;
        if let ItemRecord::Product(product) = record
            && let Some(volume) = &product.volume
        {
            query(
                "INSERT OR IGNORE INTO sources (tenant, id, volume)
                 SELECT tenant, id, $2 FROM holdings WHERE id = $1",
            )
            .bind(id)
            .bind(volume)
            .execute(&mut transaction)
            .await?;
        }
        transaction.commit().await
    }

    /// Copies every row that can be read from the damaged database `old`; none, if it cannot even be
    /// opened.
    pub(super) async fn salvage(&self, old: &Path) -> StoreResult<()> {
        let tables = query(
            "SELECT name FROM sqlite_schema
             WHERE type = 'table' AND name NOT LIKE 'sqlite\\_%' ESCAPE '\\'
               AND name NOT IN ('_sqlx_migrations', 'probe')",
        )
        .fetch_all(&self.readers)
        .await?;
        let mut connection = self.file()?.connect().await?;
        let attached = sqlx::query("ATTACH ? AS old")
            .bind(old.to_string_lossy())
            .execute(&mut connection)
            .await;
        match attached {
            Ok(_) => {
                for row in tables {
                    let table: String = row.try_get(0)?;
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
            query(orphans).write(&self.writer).await?;
        }
        Ok(())
    }

    /// Writes a copy of the database at `source`, as of one moment, to the new file `copy`.
    pub(super) async fn snapshot(source: &Path, copy: &Path) -> StoreResult<()> {
        let options = SqliteConnectOptions::new().filename(source);
        let mut connection = options.connect().await.map_err(faults::of_sqlite)?;
        sqlx::query("VACUUM INTO ?")
            .bind(copy.to_string_lossy())
            .execute(&mut connection)
            .await
            .map_err(faults::of_sqlite)?;
        connection.close().await.map_err(faults::of_sqlite)
    }
}

/// Copies one table: all of it, or row by row from both ends up to the damage.
async fn salvage_table(to: &mut SqliteConnection, table: &str) -> StoreResult<()> {
    let columns = "SELECT new.name FROM pragma_table_info(?1) AS new
                   JOIN pragma_table_info(?1, 'old') AS old ON old.name = new.name";
    let columns: Vec<String> = sqlx::query_scalar(columns)
        .bind(table)
        .fetch_all(&mut *to)
        .await
        .map_err(faults::of_sqlite)?;
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
