//! Figures for operators that only the database knows.

use super::StoreResult;
use super::{Resource, Timestamp};
use async_trait::async_trait;

/// Numbers of stored items and waiting jobs.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct QueueFigures {
    /// When the oldest waiting job was filed.
    pub oldest_queued_at: Option<Timestamp>,
    /// The number of stored items of each kind that has files.
    pub items: Vec<(Resource, u64)>,
    /// Size of the database; `None` if it is a file, whose size everybody sees.
    pub database_bytes: Option<u64>,
}

/// Counts what is stored.
#[async_trait]
pub trait FigureStore: Send + Sync + 'static {
    /// The figures now.
    ///
    /// # Errors
    /// If the database fails.
    async fn queue_figures(&self) -> StoreResult<QueueFigures>;
}
