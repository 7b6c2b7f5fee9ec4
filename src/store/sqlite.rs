//! The database file: one connection for writing, a few for reading.

use super::space::DiskGauge;
use super::writer::Writer;
use crate::jobs::{StoreError, StoreFault, StoreResult};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{ConnectOptions, Connection};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const READERS: u32 = 4;

/// The database. Implements [`crate::jobs::JobStore`] and [`crate::jobs::Catalogue`].
pub struct SqliteStore {
    pub(super) writer: Writer,
    pub(super) readers: SqlitePool,
    gauge: DiskGauge,
    /// Whether the last check of the structure found defects.
    pub(super) damaged: AtomicBool,
}

impl SqliteStore {
    /// Opens the file, or creates it, and migrates its tables to the current version. `wait` is
    /// the longest time that a write waits for its turn; jobs are refused if the disk of `gauge`
    /// is nearly full.
    ///
    /// # Errors
    /// If the file cannot be used, or was migrated by a newer version of the program.
    pub async fn open(path: &Path, wait: Duration, gauge: DiskGauge) -> Result<Self, sqlx::Error> {
        let options = SqliteConnectOptions::new()
            .filename(path)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            // What is deleted is overwritten.
            .pragma("secure_delete", "ON")
            .busy_timeout(wait);
        let readers = SqlitePoolOptions::new()
            .max_connections(READERS)
            .acquire_timeout(wait)
            // A file does not hang up. Asking doubles the time of a small query.
            .test_before_acquire(false)
            .connect_with(options.clone())
            .await?;
        sqlx::migrate!("src/store/migrations").run(&readers).await?;
        Ok(Self {
            writer: Writer::new(&options, wait),
            readers,
            gauge,
            damaged: AtomicBool::new(false),
        })
    }

    /// Checks that there is room for another job.
    pub(super) fn require_room(&self) -> StoreResult<()> {
        match self.gauge.space() {
            Some(space) => Ok(space.require_room(0)?),
            None => Ok(()),
        }
    }

    /// Whether there is a database at `path` in which this program once made its tables. A file
    /// that is damaged counts as one, so that opening it tells what is wrong.
    pub(super) async fn has_tables(path: &Path) -> bool {
        if std::fs::metadata(path).map_or(0, |file| file.len()) == 0 {
            return false;
        }
        let tables = async {
            let mut connection = SqliteConnectOptions::new().filename(path).connect().await?;
            let made = "SELECT count(*) FROM sqlite_schema WHERE name = '_sqlx_migrations'";
            let made: i64 = sqlx::query_scalar(made).fetch_one(&mut connection).await?;
            connection.close().await?;
            Ok::<_, sqlx::Error>(made)
        };
        tables.await.map_or(true, |tables| tables > 0)
    }

    /// Checks that the database answers and can be written. If the last write succeeded, taking
    /// the write lock is enough; else something is written.
    pub(super) async fn probe(&self) -> StoreResult<()> {
        sqlx::query("SELECT count(*) FROM probe")
            .fetch_one(&self.readers)
            .await?;
        if self.damaged.load(Ordering::Relaxed) {
            return Err(StoreError::Database {
                cause: StoreFault::DamagedDatabase,
                message: "a check of its structure found defects".into(),
            });
        }
        let suspect = self.writer.is_suspect();
        let mut transaction = self.writer.begin().await?;
        if suspect {
            sqlx::query("UPDATE probe SET count = count + 1")
                .execute(&mut *transaction)
                .await?;
        }
        transaction.commit().await
    }

    /// Closes every connection, which moves the write-ahead log into the database.
    pub async fn close(&self) {
        self.readers.close().await;
        self.writer.close().await;
    }
}
