//! The database file: one connection for writing, a few for reading.
//!
//! SQLite allows one writer at a time. With a single writing connection, writers wait for it in
//! order instead of polling for the database lock.

use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use std::path::Path;
use std::time::Duration;

const READERS: u32 = 4;
const BUSY_TIMEOUT: Duration = Duration::from_secs(10);

/// The database. Implements [`crate::jobs::JobStore`] and [`crate::jobs::Catalogue`].
pub struct SqliteStore {
    pub(super) writer: SqlitePool,
    pub(super) readers: SqlitePool,
}

impl SqliteStore {
    /// Opens the file, or creates it, and migrates its tables to the current version.
    ///
    /// # Errors
    /// If the file cannot be used, or was migrated by a newer version of the program.
    pub async fn open(path: &Path) -> Result<Self, sqlx::Error> {
        let options = SqliteConnectOptions::new()
            .filename(path)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .busy_timeout(BUSY_TIMEOUT);
        let writer = SqlitePoolOptions::new()
            .max_connections(1)
            .test_before_acquire(false)
            .connect_with(options.clone())
            .await?;
        sqlx::migrate!("src/store/migrations").run(&writer).await?;
        let readers = SqlitePoolOptions::new()
            .max_connections(READERS)
            // A file does not hang up. Asking doubles the time of a small query.
            .test_before_acquire(false)
            .connect_with(options)
            .await?;
        Ok(Self { writer, readers })
    }
}
