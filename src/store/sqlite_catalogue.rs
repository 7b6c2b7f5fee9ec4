//! The tables of volumes and models in SQLite.

use super::rows::{self, ModelRow, VolumeRow, to_json};
use super::sqlite::SqliteStore;
use crate::jobs::{Catalogue, Deleted, Model, Page, PageRequest, StoreError, Timestamp, Volume};
use async_trait::async_trait;
use sqlx::{Row, SqliteConnection};

type Result<T> = std::result::Result<T, StoreError>;

#[async_trait]
impl Catalogue for SqliteStore {
    async fn add_volume(&self, volume: &Volume) -> Result<bool> {
        let mut transaction = self.writer.begin().await?;
        let done = sqlx::query(
            "INSERT INTO volumes (id, created_at, bytes, files, facts) VALUES (?, ?, ?, ?, ?)
             ON CONFLICT (id) DO NOTHING",
        )
        .bind(&volume.id)
        .bind(volume.created_at)
        .bind(i64::try_from(volume.bytes).unwrap_or(i64::MAX))
        .bind(to_json(&volume.files)?)
        .bind(to_json(&volume.facts)?)
        .execute(&mut *transaction)
        .await?;
        unbury(&mut transaction, &volume.id).await?;
        transaction.commit().await?;
        Ok(done.rows_affected() == 1)
    }

    async fn volume(&self, id: &str) -> Result<Option<Volume>> {
        let row: Option<VolumeRow> = sqlx::query_as("SELECT * FROM volumes WHERE id = ?")
            .bind(id)
            .fetch_optional(&self.readers)
            .await?;
        row.map(Volume::try_from).transpose()
    }

    async fn volumes(&self, page: PageRequest) -> Result<Page<Volume>> {
        let rows: Vec<VolumeRow> = sqlx::query_as(
            "SELECT * FROM volumes WHERE ?1 IS NULL OR sequence < ?1
             ORDER BY sequence DESC LIMIT ?2",
        )
        .bind(page.before)
        .bind(i64::from(page.limit) + 1)
        .fetch_all(&self.readers)
        .await?;
        Ok(Page::cut(rows::all(rows)?, page.limit, |v: &Volume| {
            v.sequence
        }))
    }

    async fn delete_volume(&self, id: &str, now: Timestamp) -> Result<Deleted> {
        let mut transaction = self.writer.begin().await?;
        let done = sqlx::query(
            "DELETE FROM volumes WHERE id = ?1 AND NOT EXISTS
                (SELECT 1 FROM jobs WHERE volume = ?1 AND state IN ('queued', 'running'))",
        )
        .bind(id)
        .execute(&mut *transaction)
        .await?;
        if done.rows_affected() == 0 {
            drop(transaction);
            return Ok(match self.volume(id).await? {
                Some(_) => Deleted::InUse,
                None => Deleted::Unknown,
            });
        }
        bury(&mut transaction, id, now).await?;
        transaction.commit().await?;
        Ok(Deleted::Done)
    }

    async fn model(&self, id: &str) -> Result<Option<Model>> {
        let row: Option<ModelRow> = sqlx::query_as("SELECT * FROM models WHERE id = ?")
            .bind(id)
            .fetch_optional(&self.readers)
            .await?;
        row.map(Model::try_from).transpose()
    }

    async fn models(&self, page: PageRequest) -> Result<Page<Model>> {
        let rows: Vec<ModelRow> = sqlx::query_as(
            "SELECT * FROM models WHERE ?1 IS NULL OR sequence < ?1
             ORDER BY sequence DESC LIMIT ?2",
        )
        .bind(page.before)
        .bind(i64::from(page.limit) + 1)
        .fetch_all(&self.readers)
        .await?;
        Ok(Page::cut(rows::all(rows)?, page.limit, |m: &Model| {
            m.sequence
        }))
    }

    async fn delete_model(&self, id: &str, now: Timestamp) -> Result<Deleted> {
        let mut transaction = self.writer.begin().await?;
        let done = sqlx::query("DELETE FROM models WHERE id = ?")
            .bind(id)
            .execute(&mut *transaction)
            .await?;
        if done.rows_affected() == 0 {
            return Ok(Deleted::Unknown);
        }
        bury(&mut transaction, id, now).await?;
        transaction.commit().await?;
        Ok(Deleted::Done)
    }

    async fn erased_at(&self, id: &str) -> Result<Option<Timestamp>> {
        let row = sqlx::query("SELECT erased_at FROM tombstones WHERE id = ?")
            .bind(id)
            .fetch_optional(&self.readers)
            .await?;
        Ok(row.map(|row| row.get(0)))
    }

    async fn older_than(&self, before: Timestamp) -> Result<Vec<String>> {
        let rows = sqlx::query(
            "SELECT id FROM jobs WHERE finished_at < ?1
             UNION ALL SELECT id FROM models WHERE created_at < ?1
             UNION ALL SELECT id FROM volumes WHERE created_at < ?1",
        )
        .bind(before)
        .fetch_all(&self.readers)
        .await?;
        Ok(rows.into_iter().map(|row| row.get(0)).collect())
    }
}

/// Adds a model within a transaction; the one that is there already stays.
pub(super) async fn insert_model(to: &mut SqliteConnection, model: &Model) -> Result<()> {
    sqlx::query(
        "INSERT INTO models (id, created_at, volume, parameters, summary, software, files)
         VALUES (?, ?, ?, ?, ?, ?, ?) ON CONFLICT (id) DO NOTHING",
    )
    .bind(&model.id)
    .bind(model.created_at)
    .bind(&model.volume)
    .bind(to_json(&model.parameters)?)
    .bind(to_json(&model.summary)?)
    .bind(&model.software)
    .bind(to_json(&model.files)?)
    .execute(&mut *to)
    .await?;
    unbury(to, &model.id).await
}

/// Remembers that something was here.
pub(super) async fn bury(to: &mut SqliteConnection, id: &str, now: Timestamp) -> Result<()> {
    sqlx::query("INSERT OR REPLACE INTO tombstones (id, erased_at) VALUES (?, ?)")
        .bind(id)
        .bind(now)
        .execute(to)
        .await?;
    Ok(())
}

async fn unbury(to: &mut SqliteConnection, id: &str) -> Result<()> {
    sqlx::query("DELETE FROM tombstones WHERE id = ?")
        .bind(id)
        .execute(to)
        .await?;
    Ok(())
}
