//! Figures for operators, from the database. None is counted row by row, except what waits.

use super::rows;
use crate::database::SqlStore;
use crate::query::query;
use async_trait::async_trait;
use ventriform_service::base::records::{FigureStore, QueueFigures, Resource, StoreResult};

#[async_trait]
impl FigureStore for SqlStore {
    async fn queue_figures(&self) -> StoreResult<QueueFigures> {
        let oldest =
            query("SELECT created_at FROM jobs WHERE state = 'queued' ORDER BY sequence LIMIT 1")
                .fetch_optional(&self.readers)
                .await?;
        let found = query("SELECT kind, items FROM stored_items")
            .fetch_all(&self.readers)
            .await?;
        let counts: Vec<(String, u64)> = rows::all(found, |row| {
            Ok((row.try_get(0)?, rows::unsigned(row.try_get(1)?)))
        })?;
        let counted = |resource: Resource| {
            let row = counts.iter().find(|(kind, _)| kind == resource.noun());
            (resource, row.map_or(0, |(_, count)| *count))
        };
        let database_bytes = if self.on_server() {
            let size = query("SELECT pg_database_size(current_database())");
            let row = size.fetch_one(&self.readers).await?;
            Some(rows::unsigned(row.try_get(0)?))
        } else {
            None
        };
        Ok(QueueFigures {
            database_bytes,
            oldest_queued_at: oldest.map(|row| row.try_get(0)).transpose()?,
            items: Resource::WITH_FILES.map(counted).to_vec(),
        })
    }
}
