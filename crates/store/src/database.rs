//! The database, whichever engine it is: reading, and writing one transaction after the other.
//!
//! SQLite has one writer at a time. PostgreSQL has many, but every transaction here that reads before
//! it writes first takes one advisory lock, [`super::postgres`]: so what a transaction has read holds
//! until it commits on either engine, and one body of statements keeps the same promises on both.
//! Beside that lock run single statements on one job that name its lease, or skip locked rows
//! ([`Query::write_beside`]): claims, renewals of leases and progress.

use super::health::Health;
use super::note::Beside;
use super::postgres::{self, PgTransaction, PgWriter};
use super::query::{DbRow, Query, Target, query};
use super::reserve::Reserve;
use super::shared::Shared;
use super::space::DiskGauge;
use super::sqlite;
use super::writer::{Write, WriteTransaction, Writer};
use sqlx::postgres::PgPool;
use sqlx::sqlite::SqlitePool;
use std::path::Path;

use std::sync::OnceLock;
use std::time::{Duration, Instant};
use ventriform_service::config::PostgresSettings;

use ventriform_service::base::records::{StoreError, StoreFault, StoreResult, random_id};

/// Connections for reading.
pub(super) enum Readers {
    /// To the file.
    Sqlite(Shared<SqlitePool>),
    /// To the server.
    Postgres(Shared<PgPool>),
}

impl<'a> From<&'a Readers> for Target<'a> {
    fn from(readers: &'a Readers) -> Self {
        match readers {
            Readers::Sqlite(pool) => Target::SqlitePool(pool),
            Readers::Postgres(pool) => Target::PgPool(pool),
        }
    }
}

/// The connection that writes.
pub(super) enum Writing {
    /// The one connection that writes to the file.
    Sqlite(Box<Writer>),
    /// A connection to the server that holds the lock for writing.
    Postgres(PgWriter),
}

/// A transaction that writes. Dropping it without [`Transaction::commit`] rolls it back.
pub(super) enum Transaction<'a> {
    /// On the file.
    Sqlite(WriteTransaction<'a>),
    /// On the server.
    Postgres(PgTransaction),
}

impl<'a> From<&'a mut Transaction<'_>> for Target<'a> {
    fn from(transaction: &'a mut Transaction<'_>) -> Self {
        match transaction {
            Transaction::Sqlite(transaction) => {
                let (connection, writer) = transaction.parts();
                Target::Sqlite(connection, writer)
            }
            Transaction::Postgres(transaction) => {
                let (connection, health) = transaction.parts();
                Target::Postgres(connection, health)
            }
        }
    }
}

impl Transaction<'_> {
    /// Makes the changes durable.
    ///
    /// # Errors
    /// If they may not be.
    pub async fn commit(self) -> StoreResult<()> {
        match self {
            Transaction::Sqlite(transaction) => transaction.commit().await,
            Transaction::Postgres(transaction) => transaction.commit().await,
        }
    }
}

impl Writing {
    /// Starts a transaction beside which no other one writes.
    pub async fn begin(&self) -> StoreResult<Transaction<'_>> {
        match self {
            Writing::Sqlite(writer) => writer.begin().await.map(Transaction::Sqlite),
            Writing::Postgres(writer) => writer.begin().await.map(Transaction::Postgres),
        }
    }

    /// A number that every write changes; `None` while there may be one under way, and always if other
    /// processes write too.
    pub fn version(&self) -> Option<u64> {
        match self {
            Writing::Sqlite(writer) => writer.version(),
            Writing::Postgres(_) => None,
        }
    }

    /// Overwrites what was deleted since the last time, as far as that is this program's business: PostgreSQL does so
    /// by itself in time. `false` if a reader was in the way.
    pub async fn overwrite_deleted(&self) -> StoreResult<bool> {
        match self {
            Writing::Sqlite(writer) => writer.overwrite_erased().await,
            Writing::Postgres(_) => Ok(true),
        }
    }
}

impl Query {
    /// Runs it as a transaction of its own; returns the rows of its `RETURNING`.
    pub async fn write_all(self, writing: &Writing) -> StoreResult<Vec<DbRow>> {
        let mut transaction = match writing {
            Writing::Sqlite(writer) => {
                self.mark(&writer.erased);
                let rows = self.sqlite().write_all(writer).await?;
                return Ok(rows.into_iter().map(DbRow::Sqlite).collect());
            }
            Writing::Postgres(_) => writing.begin().await?,
        };
        let rows = self.fetch_all(&mut transaction).await?;
        transaction.commit().await?;
        Ok(rows)
    }

    /// Runs it as a transaction of its own; returns the first row of its `RETURNING`.
    pub async fn write_optional(self, writing: &Writing) -> StoreResult<Option<DbRow>> {
        Ok(self.write_all(writing).await?.into_iter().next())
    }

    /// Runs it as a transaction of its own; returns the number of rows it changed.
    pub async fn write(self, writing: &Writing) -> StoreResult<u64> {
        let mut transaction = match writing {
            Writing::Sqlite(writer) => {
                self.mark(&writer.erased);
                return self.sqlite().write(writer).await;
            }
            Writing::Postgres(_) => writing.begin().await?,
        };
        let changed = self.execute(&mut transaction).await?;
        transaction.commit().await?;
        Ok(changed)
    }

    /// Runs it as a transaction of its own, on PostgreSQL beside others: for a statement that is right
    /// whatever others write meanwhile. Returns the first row of its `RETURNING`.
    pub async fn write_beside(self, writing: &Writing) -> StoreResult<Option<DbRow>> {
        match writing {
            Writing::Sqlite(_) => self.write_optional(writing).await,
            Writing::Postgres(writer) => {
                let mut connection = writer.acquire().await?;
                let rows = self.fetch_alone(&mut connection, writer.health()).await?;
                Ok(rows.into_iter().next())
            }
        }
    }
}

/// The prefix of the names of runs.
const RUN_PREFIX: &str = "run_";

/// The database. Implements [`ventriform_service::base::records::JobStore`] and [`ventriform_service::base::records::Catalogue`],
/// and the traits of `access`, `hooks`, `archive`, `intake` and `worklist`.
pub struct SqlStore {
    pub(super) writer: Writing,
    pub(super) readers: Readers,
    /// Names this process among those on the same database.
    pub(super) run: String,
    gauge: DiskGauge,
    /// Where notes about this database are kept.
    beside: OnceLock<Beside>,
    /// Space for erasures on a full disk.
    pub(super) reserve: Reserve,
}

impl SqlStore {
    /// Opens the file of SQLite, or creates it, and migrates its tables to the current version. `wait`
    /// is the longest time that a write waits for its turn; jobs are refused if the disk of `gauge`
    /// is nearly full.
    ///
    /// # Errors
    /// If the file cannot be used, or was migrated by a newer version of the program.
    pub async fn open(path: &Path, wait: Duration, gauge: DiskGauge) -> Result<Self, sqlx::Error> {
        let (writer, readers) = sqlite::open(path, wait).await?;
        Ok(Self {
            writer: Writing::Sqlite(Box::new(writer)),
            readers: Readers::Sqlite(readers),
            run: random_id(RUN_PREFIX),
            gauge,
            beside: OnceLock::new(),
            reserve: Reserve::default(),
        })
    }

    /// Connects to PostgreSQL and migrates the tables to the current version. See [`SqlStore::open`].
    ///
    /// # Errors
    /// Why it cannot be used, and what to do.
    pub async fn connect(
        settings: &PostgresSettings,
        wait: Duration,
        gauge: DiskGauge,
    ) -> Result<Self, postgres::PostgresError> {
        let run = random_id(RUN_PREFIX);
        let (writer, readers) = postgres::open(settings, wait, &run).await?;
        Ok(Self {
            writer: Writing::Postgres(writer),
            readers: Readers::Postgres(readers),
            run,
            gauge,
            beside: OnceLock::new(),
            reserve: Reserve::default(),
        })
    }

    /// Where notes about this database are kept, if that is known.
    pub(super) fn beside(&self) -> Option<&Beside> {
        self.beside.get()
    }

    /// Keeps notes about this database there from now on.
    pub(super) fn keep_beside(&self, beside: Beside) {
        // Whoever was first has the same places.
        let _ = self.beside.set(beside);
    }

    /// What statements have told of the state of the database.
    pub(super) fn health(&self) -> &Health {
        match &self.readers {
            Readers::Sqlite(shared) => &shared.health,
            Readers::Postgres(shared) => &shared.health,
        }
    }

    /// Reads the whole database once more if a statement has told of a defect, so that a mended database is used
    /// again.
    pub(super) async fn read_again(&self) {
        let Some(told) = self.health().check_due() else {
            return;
        };
        let begun = Instant::now();
        let outcome = self.read_all().await;
        self.health().checked(told, begun.elapsed(), outcome);
    }

    /// Whether the database is on a server, which other processes may use too.
    pub(super) fn on_server(&self) -> bool {
        matches!(self.writer, Writing::Postgres(_))
    }

    /// The connection that writes to the file.
    ///
    /// # Errors
    /// If the database is no file.
    pub(super) fn file(&self) -> StoreResult<&Writer> {
        match &self.writer {
            Writing::Sqlite(writer) => Ok(writer),
            Writing::Postgres(_) => Err(StoreError::database("this needs a database of SQLite")),
        }
    }

    /// Whether nothing was ever stored, and no process has ever noted here where its files are: the files of
    /// a first upload lie there before their row does. To be asked of a database on a server.
    pub(super) async fn is_new(&self) -> StoreResult<bool> {
        let row = query(
            "SELECT EXISTS (SELECT 1 FROM holdings) OR EXISTS (SELECT 1 FROM erased)
                 OR EXISTS (SELECT 1 FROM jobs) OR EXISTS (SELECT 1 FROM intake_groups)
                 OR EXISTS (SELECT 1 FROM store_place)",
        )
        .fetch_one(&self.readers)
        .await?;
        Ok(!row.try_get::<bool, _>(0)?)
    }

    /// Runs an erasure; again with the space that is kept for it if the disk is full. An erasure that fails has changed
    /// nothing.
    pub(super) async fn making_room<T, F>(&self, erase: impl Fn() -> F + Send) -> StoreResult<T>
    where
        T: Send,
        F: Future<Output = StoreResult<T>> + Send,
    {
        match erase().await {
            Err(error) if error.cause() == StoreFault::Full && self.reserve.release() => {
                erase().await
            }
            done => done,
        }
    }

    /// Overwrites what was deleted, and takes the space that an erasure needs again where there is room.
    pub(super) async fn overwrite(&self) -> StoreResult<bool> {
        let overwritten = self.writer.overwrite_deleted().await;
        self.reserve
            .refill(self.gauge.space().map(|space| space.free));
        overwritten
    }

    /// Checks that there is room for another job.
    pub(super) fn require_room(&self) -> StoreResult<()> {
        match self.gauge.space() {
            Some(space) => Ok(space.require_room(0)?),
            None => Ok(()),
        }
    }

    /// Checks that the database answers and can be written. If the last write to a file succeeded,
    /// taking the write lock is enough; else something is written.
    pub(super) async fn probe(&self) -> StoreResult<()> {
        query("SELECT count(*) FROM probe")
            .fetch_one(&self.readers)
            .await?;
        self.health().sound()?;
        let suspect = match &self.writer {
            Writing::Sqlite(writer) => writer.is_suspect(),
            Writing::Postgres(writer) => return writer.check().await,
        };
        let mut transaction = self.writer.begin().await?;
        if suspect {
            query("UPDATE probe SET count = count + 1")
                .execute(&mut transaction)
                .await?;
        }
        transaction.commit().await
    }

    /// Closes every connection; of a file, this moves the write-ahead log into the database.
    pub async fn close(&self) {
        match &self.readers {
            Readers::Sqlite(shared) => shared.pool.close().await,
            Readers::Postgres(shared) => shared.pool.close().await,
        }
        if let Writing::Sqlite(writer) = &self.writer {
            writer.close().await;
        }
    }
}
