//! Figures for operators, counted in SQLite.

use super::sqlite::SqliteStore;
use crate::jobs::{FigureStore, QueueFigures, Resource, StoreResult};
use async_trait::async_trait;
use sqlx::Row;

#[async_trait]
impl FigureStore for SqliteStore {
    async fn queue_figures(&self) -> StoreResult<QueueFigures> {
        let oldest = sqlx::query(
            "SELECT created_at FROM jobs WHERE state = 'queued' ORDER BY sequence LIMIT 1",
        )
        .fetch_optional(&self.readers)
        .await?;
        let rows = sqlx::query(
            "SELECT 'volume', count(*) FROM volumes
             UNION ALL SELECT kind, count(*) FROM products GROUP BY kind",
        )
        .fetch_all(&self.readers)
        .await?;
        let counted = |resource: Resource| {
            let row = rows
                .iter()
                .find(|row| row.get::<&str, _>(0) == resource.noun());
            let count = row.map_or(0, |row| row.get::<i64, _>(1));
            (resource, u64::try_from(count).unwrap_or(0))
        };
        Ok(QueueFigures {
            oldest_queued_at: oldest.map(|row| row.try_get(0)).transpose()?,
            items: Resource::WITH_FILES.map(counted).to_vec(),
        })
    }
}
