//! The database file: one connection for writing, a few for reading.

use super::health::Health;
use super::schema;
use super::shared::Shared;
use super::writer::Writer;
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{ConnectOptions, Connection};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

const READ_CONNECTIONS: u32 = 4;
/// Longest wait for the only connection, which one task uses.
const ALONE_WAIT: Duration = Duration::from_secs(60);

/// Opens the file, or creates it, and migrates its tables to the current version. `wait` is the longest
/// time that a write waits for its turn.
///
/// # Errors
/// If the file cannot be used, or was migrated by a newer version of the program.
pub(super) async fn open(
    path: &Path,
    wait: Duration,
) -> Result<(Writer, Shared<SqlitePool>), sqlx::Error> {
    let options = SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        // What is deleted is overwritten.
        .pragma("secure_delete", "ON")
        .busy_timeout(wait);
    let readers = SqlitePoolOptions::new()
        .max_connections(READ_CONNECTIONS)
        .acquire_timeout(wait)
        // A file does not hang up. Asking doubles the time of a small query.
        .test_before_acquire(false)
        .connect_with(options.clone())
        .await?;
    schema::sqlite().run(&readers).await?;
    let places = READ_CONNECTIONS as usize;
    let health = Arc::new(Health::default());
    let readers = Shared::new(readers, health.clone(), places, wait);
    Ok((Writer::new(&options, health, wait), readers))
}

/// Opens a file that another program may have made, for reading: its tables stay as they are.
///
/// # Errors
/// If there is none, or it cannot be opened.
pub(super) async fn open_as_it_is(path: &Path) -> Result<Shared<SqlitePool>, sqlx::Error> {
    let options = SqliteConnectOptions::new()
        .filename(path)
        .pragma("query_only", "ON");
    let readers = SqlitePoolOptions::new()
        .max_connections(1)
        .test_before_acquire(false)
        .connect_with(options)
        .await?;
    Ok(Shared::new(readers, Arc::default(), 1, ALONE_WAIT))
}

/// Whether there is a database at `path` in which this program once made its tables. A file that is
/// damaged counts as one, so that opening it tells what is wrong.
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
