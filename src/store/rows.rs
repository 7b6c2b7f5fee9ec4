//! Rows as SQLite gives them, and the records they stand for.

use crate::jobs::{Job, Product, State, StoreError, Volume};
use serde::Serialize;
use serde::de::DeserializeOwned;
use sqlx::FromRow;

#[derive(FromRow)]
pub(super) struct JobRow {
    id: String,
    sequence: i64,
    kind: String,
    volume: String,
    parameters: String,
    state: String,
    stage: Option<String>,
    progress: f64,
    attempts: i64,
    revision: i64,
    cancel_requested: bool,
    created_at: i64,
    started_at: Option<i64>,
    finished_at: Option<i64>,
    failure: Option<String>,
    result: Option<String>,
    pub(super) fingerprint: Option<String>,
}

impl TryFrom<JobRow> for Job {
    type Error = StoreError;

    fn try_from(row: JobRow) -> Result<Self, StoreError> {
        Ok(Job {
            parameters: from_json(&row.parameters)?,
            state: State::parse(&row.state)
                .ok_or_else(|| StoreError(format!("unknown state `{}`", row.state)))?,
            failure: row.failure.as_deref().map(from_json).transpose()?,
            id: row.id,
            sequence: row.sequence,
            kind: row.kind,
            volume: row.volume,
            stage: row.stage,
            progress: row.progress,
            attempts: u32::try_from(row.attempts).unwrap_or(u32::MAX),
            revision: row.revision,
            cancel_requested: row.cancel_requested,
            created_at: row.created_at,
            started_at: row.started_at,
            finished_at: row.finished_at,
            result: row.result,
        })
    }
}

#[derive(FromRow)]
pub(super) struct VolumeRow {
    id: String,
    sequence: i64,
    created_at: i64,
    bytes: i64,
    files: String,
    facts: String,
}

impl TryFrom<VolumeRow> for Volume {
    type Error = StoreError;

    fn try_from(row: VolumeRow) -> Result<Self, StoreError> {
        Ok(Volume {
            files: from_json(&row.files)?,
            facts: from_json(&row.facts)?,
            id: row.id,
            sequence: row.sequence,
            created_at: row.created_at,
            bytes: u64::try_from(row.bytes).unwrap_or(0),
        })
    }
}

#[derive(FromRow)]
pub(super) struct ProductRow {
    id: String,
    sequence: i64,
    created_at: i64,
    volume: Option<String>,
    parameters: String,
    summary: String,
    software: String,
    files: String,
}

impl TryFrom<ProductRow> for Product {
    type Error = StoreError;

    fn try_from(row: ProductRow) -> Result<Self, StoreError> {
        Ok(Product {
            parameters: from_json(&row.parameters)?,
            summary: from_json(&row.summary)?,
            files: from_json(&row.files)?,
            id: row.id,
            sequence: row.sequence,
            created_at: row.created_at,
            volume: row.volume,
            software: row.software,
        })
    }
}

/// Converts the rows of a list.
pub(super) fn all<R, T: TryFrom<R, Error = StoreError>>(
    rows: Vec<R>,
) -> Result<Vec<T>, StoreError> {
    rows.into_iter().map(T::try_from).collect()
}

pub(super) fn to_json(value: &impl Serialize) -> Result<String, StoreError> {
    serde_json::to_string(value).map_err(|e| StoreError(e.to_string()))
}

fn from_json<T: DeserializeOwned>(text: &str) -> Result<T, StoreError> {
    serde_json::from_str(text).map_err(|e| StoreError(format!("a damaged row: {e}")))
}

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        StoreError(error.to_string())
    }
}
