//! Looking after the rows of items in SQLite.

use super::rows::{self, to_json};
use super::sqlite::SqliteStore;
use super::writer::Write;
use crate::jobs::{Custody, ItemRecord, Resource, StoreResult};
use async_trait::async_trait;
use sqlx::Row;
use std::collections::BTreeSet;
use std::sync::atomic::Ordering;

/// Defects named at most.
const DEFECTS: &str = "PRAGMA quick_check(20)";

#[async_trait]
impl Custody for SqliteStore {
    async fn record(&self, id: &str) -> StoreResult<Option<ItemRecord>> {
        let volume = Resource::of(id) == Some(Resource::Volume);
        let row = sqlx::query(match volume {
            true => "SELECT * FROM volumes WHERE id = ?",
            false => "SELECT * FROM products WHERE id = ?",
        })
        .bind(id)
        .fetch_optional(&self.readers)
        .await?;
        row.map(|row| match volume {
            true => rows::volume(row).map(ItemRecord::Volume),
            false => rows::product(row).map(ItemRecord::Product),
        })
        .transpose()
    }

    async fn known(&self, ids: &[String]) -> StoreResult<BTreeSet<String>> {
        let rows = sqlx::query(
            "SELECT id FROM volumes WHERE id IN (SELECT value FROM json_each(?1))
             UNION ALL SELECT id FROM products WHERE id IN (SELECT value FROM json_each(?1))",
        )
        .bind(to_json(&ids)?)
        .fetch_all(&self.readers)
        .await?;
        Ok(rows.into_iter().map(|row| row.get(0)).collect())
    }

    async fn records(
        &self,
        kind: Resource,
        after: i64,
        limit: u32,
    ) -> StoreResult<Vec<ItemRecord>> {
        let rows = sqlx::query(match kind {
            Resource::Volume => {
                "SELECT * FROM volumes WHERE sequence > ? ORDER BY sequence LIMIT ?"
            }
            _ => "SELECT * FROM products WHERE sequence > ? ORDER BY sequence LIMIT ?",
        })
        .bind(after)
        .bind(limit)
        .fetch_all(&self.readers)
        .await?;
        rows::all(
            rows,
            match kind {
                Resource::Volume => |row| rows::volume(row).map(ItemRecord::Volume),
                _ => |row| rows::product(row).map(ItemRecord::Product),
            },
        )
    }

    async fn amend(&self, record: &ItemRecord) -> StoreResult<()> {
        match record {
            ItemRecord::Volume(volume) => {
                sqlx::query("UPDATE volumes SET files = ?, facts = ? WHERE id = ?")
                    .bind(to_json(&volume.files)?)
                    .bind(to_json(&volume.facts)?)
                    .bind(&volume.id)
                    .write(&self.writer)
                    .await?
            }
            ItemRecord::Product(product) => {
                sqlx::query("UPDATE products SET files = ?, summary = ?, software = ? WHERE id = ?")
                    .bind(to_json(&product.files)?)
                    .bind(to_json(&product.summary)?)
                    .bind(&product.software)
                    .bind(&product.id)
                    .write(&self.writer)
                    .await?
            }
        };
        Ok(())
    }

    async fn was_erased(&self, id: &str) -> StoreResult<bool> {
        let found = sqlx::query("SELECT 1 FROM erased WHERE id = ? LIMIT 1")
            .bind(id)
            .fetch_optional(&self.readers)
            .await?;
        Ok(found.is_some())
    }

    async fn defects(&self) -> StoreResult<Vec<String>> {
        let found = sqlx::query(DEFECTS).fetch_all(&self.readers).await?;
        let lines = found.into_iter().map(|row| row.get::<String, _>(0));
        let defects: Vec<String> = lines.filter(|line| line != "ok").collect();
        self.damaged.store(!defects.is_empty(), Ordering::Relaxed);
        Ok(defects)
    }
}
