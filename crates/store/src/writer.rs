//! The one connection that writes, and how a failed write ends.
//!
//! SQLite allows one writer at a time, so writers wait for one connection in turn, tenant by tenant and client by
//! client ([`ventriform_service::limits::places`]), instead of polling for the database's lock. Every write goes through
//! [`Writer::begin`] and [`WriteTransaction::commit`]:
//!
//! 1. wait for the connection, and for other processes that hold the database's lock, for at most
//!    the set time in all;
//! 2. run the statements within `BEGIN IMMEDIATE` and `COMMIT`;
//! 3. keep the connection only if the commit succeeded.
//!
//! A transaction that ends in any other way (a failed statement, a failed commit, a caller that
//! went away) closes the connection with it, and the next write opens a new one. So no write can
//! fall into the open transaction of an earlier one, which would report success for changes that
//! are never committed.
//!
//! Readers that keep what they read ask [`Writer::version`] before and after: what was read while the
//! version stayed the same is current until it changes.
//!
//! Single statements are wrapped too: when a statement that returns rows is reset, SQLite commits
//! it, and the driver ignores errors of that commit.

use crate::faults;
use crate::health::Health;
use sqlx::query::Query;
use sqlx::sqlite::{SqliteArguments, SqliteConnectOptions, SqliteRow};
use sqlx::{ConnectOptions, Row, Sqlite, SqliteConnection};
use std::ops::{Deref, DerefMut};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;
use tokio::sync::{Mutex, MutexGuard};
use tokio::time::{Instant, sleep, timeout_at};
use ventriform_service::base::records::{StoreError, StoreFault, StoreResult};
use ventriform_service::limits::places::{Place, Places};

/// How long SQLite itself waits for the database's lock before [`Writer::begin`] looks at the
/// time and asks again.
const LOCK_POLL: Duration = Duration::from_millis(100);

/// Pause before the database is opened again after it was locked, which SQLite may say at once.
const CONNECT_POLL: Duration = Duration::from_millis(10);

/// The connection that writes.
pub(super) struct Writer {
    options: SqliteConnectOptions,
    /// Whoever waits for the connection has the one place first.
    turn: Arc<Places>,
    /// `None` before the first write, and after one that failed.
    connection: Mutex<Option<SqliteConnection>>,
    wait: Duration,
    /// What its statements tell.
    health: Arc<Health>,
    /// Whether the last write did not end with a commit.
    suspect: AtomicBool,
    /// Even when nothing is being written. Odd from the beginning of a write to the end of its
    /// commit; without a commit, to the beginning of the next write, which waits for the lock of the
    /// one before: until then the changes of that one may still reach the disk.
    version: AtomicU64,
    /// Whether the log may still hold rows that were deleted. So it may after a start: the process before may have been
    /// killed.
    pub erased: AtomicBool,
}

impl Writer {
    /// Connects when the first write comes. `wait` is the longest time that a write waits for its
    /// turn.
    pub fn new(options: &SqliteConnectOptions, health: Arc<Health>, wait: Duration) -> Self {
        Self {
            options: options.clone().busy_timeout(LOCK_POLL.min(wait)),
            turn: Places::new(1),
            connection: Mutex::new(None),
            wait,
            health,
            suspect: AtomicBool::new(false),
            version: AtomicU64::new(0),
            erased: AtomicBool::new(true),
        }
    }

    /// A number that every write changes; `None` while there may be one under way.
    pub fn version(&self) -> Option<u64> {
        let version = self.version.load(Ordering::SeqCst);
        version.is_multiple_of(2).then_some(version)
    }

    /// Starts a transaction that holds the database's write lock.
    pub async fn begin(&self) -> StoreResult<WriteTransaction<'_>> {
        let deadline = Instant::now() + self.wait;
        let (turn, mut place) = self.connection_by(deadline).await?;
        loop {
            let mut connection = match place.take() {
                Some(connection) => connection,
                None => self.connected_by(deadline).await?,
            };
            match sqlx::query("BEGIN IMMEDIATE")
                .execute(&mut connection)
                .await
            {
                Ok(_) => {
                    self.suspect.store(true, Ordering::Relaxed);
                    let odd = |version: u64| Some(version + 1 + version % 2);
                    let _ = self
                        .version
                        .fetch_update(Ordering::SeqCst, Ordering::SeqCst, odd);
                    return Ok(WriteTransaction {
                        writer: self,
                        place,
                        connection,
                        _turn: turn,
                    });
                }
                Err(error) => {
                    let error = faults::of_sqlite(error);
                    if error.cause() != StoreFault::Busy {
                        self.suspect.store(true, Ordering::Relaxed);
                        return Err(self.noted(error));
                    }
                    // No transaction was begun, so the connection is as it was.
                    *place = Some(connection);
                    if Instant::now() >= deadline {
                        return Err(busy("another process holds the database's lock"));
                    }
                }
            }
        }
    }

    /// Notes what an error tells of the database. That it cannot be written shows at the next write; see
    /// [`Writer::is_suspect`].
    pub fn noted(&self, error: StoreError) -> StoreError {
        match error.cause() {
            StoreFault::DamagedDatabase => self.health.noted(error),
            _ => error,
        }
    }

    /// The place of the connection that writes, in turn.
    async fn connection_by(
        &self,
        deadline: Instant,
    ) -> StoreResult<(Place, MutexGuard<'_, Option<SqliteConnection>>)> {
        let in_turn = async {
            let turn = self.turn.take().await;
            (turn, self.connection.lock().await)
        };
        let late = |_| busy("other writes take too long");
        timeout_at(deadline, in_turn).await.map_err(late)
    }

    /// A connection of its own, beside the one that writes.
    pub async fn connect(&self) -> StoreResult<SqliteConnection> {
        self.connected_by(Instant::now() + self.wait).await
    }

    /// A new connection. Opening one reads the database, which nobody can while another connection, such as that of a
    /// failed write, is being closed: that is waited for until the `deadline`.
    async fn connected_by(&self, deadline: Instant) -> StoreResult<SqliteConnection> {
        loop {
            let error = match self.options.connect().await {
                Ok(connection) => return Ok(connection),
                Err(error) => faults::of_sqlite(error),
            };
            if error.cause() != StoreFault::Busy || Instant::now() >= deadline {
                return Err(error);
            }
            sleep(CONNECT_POLL).await;
        }
    }

    /// Overwrites the rows that were deleted since the last time: their pages in the database are overwritten as they
    /// are freed, and those in the log by moving it into the database. `false` if a reader was in the way; then the
    /// next call tries again.
    pub async fn overwrite_erased(&self) -> StoreResult<bool> {
        if !self.erased.swap(false, Ordering::Relaxed) {
            return Ok(true);
        }
        let emptied = self.truncate_log().await;
        if !matches!(emptied, Ok(true)) {
            self.erased.store(true, Ordering::Relaxed);
        }
        emptied
    }

    /// Moves the write-ahead log into the database and empties it. `false` if a reader was in the
    /// way.
    pub async fn truncate_log(&self) -> StoreResult<bool> {
        let deadline = Instant::now() + self.wait;
        let (_turn, mut place) = self.connection_by(deadline).await?;
        let mut connection = match place.take() {
            Some(connection) => connection,
            None => self.connected_by(deadline).await?,
        };
        let row = sqlx::query("PRAGMA wal_checkpoint(TRUNCATE)")
            .fetch_one(&mut connection)
            .await
            .map_err(|error| self.noted(faults::of_sqlite(error)))?;
        *place = Some(connection);
        Ok(row.try_get::<i64, _>(0).map_err(faults::of_sqlite)? == 0)
    }

    /// Whether the last write failed or was abandoned, so that only another write can tell
    /// whether the database can be written.
    pub fn is_suspect(&self) -> bool {
        self.suspect.load(Ordering::Relaxed)
    }

    /// Closes the connection; later writes fail to wait for it.
    pub async fn close(&self) {
        use sqlx::Connection;
        if let Some(connection) = self.connection.lock().await.take()
            && let Err(error) = connection.close().await
        {
            tracing::warn!(%error, "the database was not closed in order; the next start recovers it");
        }
    }
}

fn busy(what: &str) -> StoreError {
    StoreError::Database {
        cause: StoreFault::Busy,
        message: what.to_owned(),
    }
}

/// A transaction. Dropping it without [`WriteTransaction::commit`] rolls it back and closes the
/// connection.
pub(super) struct WriteTransaction<'a> {
    writer: &'a Writer,
    place: MutexGuard<'a, Option<SqliteConnection>>,
    connection: SqliteConnection,
    // Given up last, when the connection is back in its place.
    _turn: Place,
}

impl WriteTransaction<'_> {
    /// Makes the changes durable.
    ///
    /// # Errors
    /// If they may not be on disk.
    pub async fn commit(mut self) -> StoreResult<()> {
        sqlx::query("COMMIT")
            .execute(&mut self.connection)
            .await
            .map_err(|error| self.writer.noted(faults::of_sqlite(error)))?;
        self.writer.suspect.store(false, Ordering::Relaxed);
        self.writer.version.fetch_add(1, Ordering::SeqCst);
        *self.place = Some(self.connection);
        Ok(())
    }
}

impl<'a> WriteTransaction<'a> {
    /// Where its statements run, and the writer, which notes what they tell and what is to be overwritten.
    pub fn parts(&mut self) -> (&mut SqliteConnection, &'a Writer) {
        (&mut self.connection, self.writer)
    }
}

impl Deref for WriteTransaction<'_> {
    type Target = SqliteConnection;

    fn deref(&self) -> &SqliteConnection {
        &self.connection
    }
}

impl DerefMut for WriteTransaction<'_> {
    fn deref_mut(&mut self) -> &mut SqliteConnection {
        &mut self.connection
    }
}

/// A single statement as a transaction of its own.
pub(super) trait Write: Sized {
    /// Runs it; returns the rows of its `RETURNING`.
    async fn write_all(self, writer: &Writer) -> StoreResult<Vec<SqliteRow>>;

    /// Runs it; returns the number of rows it changed.
    async fn write(self, writer: &Writer) -> StoreResult<u64>;
}

impl Write for Query<'_, Sqlite, SqliteArguments> {
    async fn write_all(self, writer: &Writer) -> StoreResult<Vec<SqliteRow>> {
        let mut transaction = writer.begin().await?;
        let rows = self
            .fetch_all(&mut *transaction)
            .await
            .map_err(|error| writer.noted(faults::of_sqlite(error)))?;
        transaction.commit().await?;
        Ok(rows)
    }

    async fn write(self, writer: &Writer) -> StoreResult<u64> {
        let mut transaction = writer.begin().await?;
        let done = self
            .execute(&mut *transaction)
            .await
            .map_err(|error| writer.noted(faults::of_sqlite(error)))?;
        transaction.commit().await?;
        Ok(done.rows_affected())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sqlx::Row;
    use ventriform_service::base::memory::{Ledger, MemoryBudget};

    async fn writer(folder: &std::path::Path, wait: u64) -> Writer {
        let options = SqliteConnectOptions::new()
            .filename(folder.join("test.db"))
            .create_if_missing(true)
            .journal_mode(sqlx::sqlite::SqliteJournalMode::Wal);
        let writer = Writer::new(&options, Arc::default(), Duration::from_millis(wait));
        sqlx::query("CREATE TABLE IF NOT EXISTS t (x)")
            .write(&writer)
            .await
            .unwrap();
        writer
    }

    async fn seen_by_others(writer: &Writer) -> i64 {
        let mut other = writer.options.connect().await.unwrap();
        let row = sqlx::query("SELECT count(*) FROM t");
        row.fetch_one(&mut other).await.unwrap().get(0)
    }

    #[tokio::test]
    async fn writes_after_a_full_disk_are_seen_by_others() {
        let folder = tempfile::tempdir().unwrap();
        let writer = writer(folder.path(), 1000).await;
        for _ in 0..3 {
            let mut transaction = writer.begin().await.unwrap();
            // The connection takes the disk to be full.
            sqlx::query("PRAGMA max_page_count = 2")
                .execute(&mut *transaction)
                .await
                .unwrap();
            let error = sqlx::query("INSERT INTO t VALUES (zeroblob(100000))")
                .execute(&mut *transaction)
                .await
                .unwrap_err();
            assert_eq!(faults::of_sqlite(error).cause(), StoreFault::Full);
            drop(transaction);
            assert!(writer.is_suspect());
        }
        let done = sqlx::query("INSERT INTO t VALUES (1)").write(&writer).await;
        assert_eq!(done.unwrap(), 1);
        assert!(!writer.is_suspect());
        assert_eq!(seen_by_others(&writer).await, 1);
    }

    #[tokio::test]
    async fn a_database_that_nobody_can_open_is_waited_for() {
        use sqlx::Connection;
        let folder = tempfile::tempdir().unwrap();
        let seed = writer(folder.path(), 1000).await;
        seed.close().await;
        let options = seed.options.clone();
        let mut other = options
            .locking_mode(sqlx::sqlite::SqliteLockingMode::Exclusive)
            .connect()
            .await
            .unwrap();
        sqlx::query("INSERT INTO t VALUES (1)")
            .execute(&mut other)
            .await
            .unwrap();
        let impatient = Writer::new(&seed.options, Arc::default(), Duration::from_millis(300));
        let refused = impatient.begin().await.err().unwrap();
        assert_eq!(refused.cause(), StoreFault::Busy);
        let waiting = Writer::new(&seed.options, Arc::default(), Duration::from_secs(60));
        let write = sqlx::query("INSERT INTO t VALUES (2)").write(&waiting);
        let end = async {
            sleep(Duration::from_millis(500)).await;
            other.close().await.unwrap();
        };
        let (written, ()) = tokio::join!(write, end);
        assert_eq!(written.unwrap(), 1);
        assert_eq!(seen_by_others(&waiting).await, 2);
    }

    #[tokio::test]
    async fn a_transaction_whose_caller_went_away_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let writer = writer(folder.path(), 1000).await;
        let mut transaction = writer.begin().await.unwrap();
        sqlx::query("INSERT INTO t VALUES (1)")
            .execute(&mut *transaction)
            .await
            .unwrap();
        assert_eq!(writer.version(), None, "it is under way");
        drop(transaction);
        assert_eq!(writer.version(), None, "its end is not known");
        let row = sqlx::query("INSERT INTO t VALUES (2) RETURNING x")
            .write_all(&writer)
            .await
            .unwrap();
        assert_eq!(row[0].get::<i64, _>(0), 2);
        let version = writer.version();
        assert!(version.is_some());
        let done = sqlx::query("DELETE FROM t WHERE x = 3").write(&writer);
        assert_eq!(done.await.unwrap(), 0);
        assert!(writer.version().is_some());
        assert_ne!(writer.version(), version);
        assert_eq!(seen_by_others(&writer).await, 1);
    }

    #[tokio::test]
    async fn writes_give_up_together_when_another_process_holds_the_lock() {
        let folder = tempfile::tempdir().unwrap();
        let writer = writer(folder.path(), 1500).await;
        let mut other = writer.options.connect().await.unwrap();
        sqlx::query("BEGIN IMMEDIATE")
            .execute(&mut other)
            .await
            .unwrap();
        let started = std::time::Instant::now();
        let write = || sqlx::query("INSERT INTO t VALUES (1)").write(&writer);
        let outcomes = tokio::join!(write(), write(), write(), write());
        for outcome in [outcomes.0, outcomes.1, outcomes.2, outcomes.3] {
            assert_eq!(outcome.unwrap_err().cause(), StoreFault::Busy);
        }
        // One after the other, they would have waited 6 s.
        assert!(started.elapsed() < Duration::from_millis(4500));
        sqlx::query("ROLLBACK").execute(&mut other).await.unwrap();
        assert_eq!(write().await.unwrap(), 1);
    }

    #[tokio::test]
    async fn a_tenant_waits_for_one_write_of_another_that_has_many() {
        let folder = tempfile::tempdir().unwrap();
        let writer = writer(folder.path(), 60_000).await;
        let first = writer.begin().await.unwrap();
        let budget = MemoryBudget::new(1 << 20);
        let mut writes = Vec::new();
        for n in 0..41 {
            let tenant = if n < 40 { "a" } else { "b" };
            let ledger = Ledger::new(&budget, Some(&tenant.parse().unwrap()));
            let write = sqlx::query("INSERT INTO t VALUES (?)").bind(tenant);
            let mut write = Box::pin(ledger.scope(write.write(&writer)));
            // It asks before the next one does.
            assert!(futures::poll!(&mut write).is_pending());
            writes.push(write);
        }
        first.commit().await.unwrap();
        for written in futures::future::join_all(writes).await {
            assert_eq!(written.unwrap(), 1);
        }
        let mut other = writer.options.connect().await.unwrap();
        let rows = sqlx::query("SELECT x FROM t ORDER BY rowid").fetch_all(&mut other);
        let rows = rows.await.unwrap();
        let of_b = rows.iter().position(|row| row.get::<String, _>(0) == "b");
        assert_eq!((rows.len(), of_b), (41, Some(1)));
    }
}
