//! Looking after the rows of items.

use super::rows::{self, to_json};
use crate::database::SqlStore;
use crate::query::query;
use async_trait::async_trait;
use std::collections::BTreeSet;
use ventriform_service::base::records::{
    Custody, ItemRecord, Resource, StoreError, StoreFault, StoreResult,
};

/// The tables that every database has.
const TABLES: [&str; 25] = [
    "api_keys",
    "audit",
    "audit_anchors",
    "deidentification_secrets",
    "deliveries",
    "erased",
    "erasures",
    "holdings",
    "intake_groups",
    "intake_objects",
    "jobs",
    "label_index",
    "listed_scans",
    "probe",
    "products",
    "pulled_series",
    "pulls",
    "scans",
    "sends",
    "sources",
    "stored_bytes",
    "stored_items",
    "trusted_time",
    "volumes",
    "workitems",
];

/// Defects named at most.
const QUICK_CHECK: &str = "PRAGMA quick_check(20)";

#[async_trait]
impl Custody for SqlStore {
    async fn record(&self, id: &str) -> StoreResult<Option<ItemRecord>> {
        let volume = Resource::from_id(id) == Some(Resource::Volume);
        let row = query(if volume {
            "SELECT * FROM volumes WHERE id = $1"
        } else {
            "SELECT * FROM products WHERE id = $1"
        })
        .bind(id)
        .fetch_optional(&self.readers)
        .await?;
        row.map(|row| {
            if volume {
                rows::volume(row).map(ItemRecord::Volume)
            } else {
                rows::product(row).map(ItemRecord::Product)
            }
        })
        .transpose()
    }

    async fn known(&self, ids: &[String]) -> StoreResult<BTreeSet<String>> {
        let rows = query(
            "SELECT id FROM volumes WHERE id IN (SELECT value FROM json_each($1))
             UNION ALL SELECT id FROM products WHERE id IN (SELECT value FROM json_each($1))",
        )
        .bind(to_json(&ids)?)
        .fetch_all(&self.readers)
        .await?;
        rows.into_iter().map(|row| row.try_get(0)).collect()
    }

    async fn records(
        &self,
        kind: Resource,
        after: i64,
        limit: u32,
    ) -> StoreResult<Vec<ItemRecord>> {
        let rows = query(match kind {
            Resource::Volume => {
                "SELECT * FROM volumes WHERE sequence > $1 ORDER BY sequence LIMIT $2"
            }
            _ => "SELECT * FROM products WHERE sequence > $1 ORDER BY sequence LIMIT $2",
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
                query("UPDATE volumes SET files = $1, facts = $2 WHERE id = $3")
                    .bind(to_json(&volume.files)?)
                    .bind(to_json(&volume.facts)?)
                    .bind(&volume.id)
                    .write(&self.writer)
                    .await?
            }
            ItemRecord::Product(product) => {
                query("UPDATE products SET files = $1, summary = $2, software = $3 WHERE id = $4")
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
        let found = query("SELECT 1 FROM erased WHERE id = $1 LIMIT 1")
            .bind(id)
            .fetch_optional(&self.readers)
            .await?;
        Ok(found.is_some())
    }

    async fn defects(&self) -> StoreResult<Vec<String>> {
        // The server looks after its own files.
        if self.on_server() {
            return Ok(Vec::new());
        }
        let found = query(QUICK_CHECK).fetch_all(&self.readers).await?;
        let lines: Vec<String> = rows::all(found, |row| row.try_get(0))?;
        let defects: Vec<String> = lines.into_iter().filter(|line| line != "ok").collect();
        if let Some(first) = defects.first() {
            let told = format!("a check of its structure found defects: {first}");
            self.health().note(StoreFault::DamagedDatabase, told);
        }
        Ok(defects)
    }

    async fn recheck(&self) {
        self.read_again().await;
    }
}

impl SqlStore {
    /// Reads the whole database: its structure, and on a server, which has no check of that for everybody, each row of
    /// each table.
    pub(crate) async fn read_all(&self) -> StoreResult<()> {
        for table in TABLES {
            let first = query(format!("SELECT 1 FROM {table} LIMIT 1"));
            first.fetch_optional(&self.readers).await?;
        }
        if !self.on_server() {
            let defects = self.defects().await?;
            return match defects.into_iter().next() {
                None => Ok(()),
                Some(message) => Err(StoreError::Database {
                    cause: StoreFault::DamagedDatabase,
                    message,
                }),
            };
        }
        let tables = query(
            "SELECT quote_ident(tablename) FROM pg_tables WHERE schemaname = current_schema()",
        )
        .fetch_all(&self.readers)
        .await?;
        for row in tables {
            let table: String = row.try_get(0)?;
            // A row is taken apart to be put into text, so values out of line are read too.
            let read = format!("SELECT CAST(count(one::text) AS BIGINT) FROM {table} AS one");
            query(read).fetch_one(&self.readers).await?;
        }
        Ok(())
    }
}
