//! Statements and rows, for SQLite and PostgreSQL alike.
//!
//! One text serves both engines: placeholders are `$1`, `$2` ..., which both know, and only what both
//! understand in the same way is used. Where one engine needs other words, [`Query::on_postgres`]
//! gives them. The driver of the engine runs the statement and decodes its rows, so types are those
//! of the engine's own driver; `sqlx::Any`, which would do the same, guesses the types of computed
//! columns and knows neither the settings nor the error codes of an engine.

use super::faults;
use super::health::Health;
use super::shared::Shared;
use super::writer::Writer;
use sqlx::postgres::{PgArguments, PgConnection, PgPool, PgRow};
use sqlx::sqlite::{SqliteArguments, SqliteConnection, SqlitePool, SqliteRow};
use sqlx::{AssertSqlSafe, ColumnIndex, Decode, Postgres, Row, Sqlite, Type};
use std::borrow::Cow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use ventriform_service::base::records::StoreResult;

/// How often a read is tried again on another connection after its connection was lost.
const READ_RETRIES: u32 = 3;

/// A value of a placeholder; `None` is NULL of that type.
#[derive(Debug, Clone)]
pub(super) enum Value {
    Text(Option<String>),
    Integer(Option<i64>),
    Real(Option<f64>),
    Boolean(Option<bool>),
    Bytes(Option<Vec<u8>>),
}

/// Values that can be bound to a placeholder.
pub(super) trait Bound {
    /// NULL of the same type.
    const NULL: Value;
    /// The value.
    fn value(self) -> Value;
}

macro_rules! bound {
    ($($kind:ident: $($from:ty),+;)+) => {$($(
        impl Bound for $from {
            const NULL: Value = Value::$kind(None);
            fn value(self) -> Value {
                Value::$kind(Some(self.into()))
            }
        }
    )+)+};
}

bound! {
    Text: &str, &String, String, Cow<'_, str>;
    Integer: i64, u32, u16;
    Real: f64;
    Boolean: bool;
    Bytes: &[u8], Vec<u8>;
}

impl Bound for &Vec<u8> {
    const NULL: Value = Value::Bytes(None);
    fn value(self) -> Value {
        Value::Bytes(Some(self.clone()))
    }
}

impl<T: Bound> Bound for Option<T> {
    const NULL: Value = T::NULL;
    fn value(self) -> Value {
        self.map_or(T::NULL, T::value)
    }
}

impl<'a, T> Bound for &'a Option<T>
where
    &'a T: Bound,
{
    const NULL: Value = <&'a T>::NULL;
    fn value(self) -> Value {
        self.as_ref().value()
    }
}

/// Where a statement runs.
pub(super) enum Target<'a> {
    /// A pool of SQLite's readers, in turn.
    SqlitePool(&'a Shared<SqlitePool>),
    /// A transaction of SQLite, and who notes what its statements tell.
    Sqlite(&'a mut SqliteConnection, &'a Writer),
    /// A pool of connections to PostgreSQL; in turn, and for reading only, as it may be tried twice.
    PgPool(&'a Shared<PgPool>),
    /// A connection to PostgreSQL, and who notes what its statements tell.
    Postgres(&'a mut PgConnection, &'a Health),
}

/// A statement with its values.
#[derive(Debug, Clone)]
pub(super) struct Query {
    text: Cow<'static, str>,
    postgres: Option<Cow<'static, str>>,
    values: Vec<Value>,
    /// Whether PostgreSQL is to prepare it anew.
    anew: bool,
    /// Whether what was in the rows before may not be read in the database's files any more.
    erases: bool,
}

/// A statement of that text.
pub(super) fn query(text: impl Into<Cow<'static, str>>) -> Query {
    let text = text.into();
    Query {
        erases: text.trim_start().starts_with("DELETE"),
        text,
        postgres: None,
        values: Vec::new(),
        anew: false,
    }
}

impl Query {
    /// The text for PostgreSQL, where it differs. It has the same placeholders.
    pub fn on_postgres(mut self, text: impl Into<Cow<'static, str>>) -> Self {
        self.postgres = Some(text.into());
        self
    }

    /// It replaces or removes what people wrote or what a header says, which is to be overwritten in the database's files,
    /// as what a `DELETE` removes is.
    pub fn erasing(mut self) -> Self {
        self.erases = true;
        self
    }

    /// Marks that the rows before are to be overwritten, if they are.
    pub fn mark(&self, erased: &AtomicBool) {
        if self.erases {
            erased.store(true, Ordering::Relaxed);
        }
    }

    /// Sets the next placeholder.
    pub fn bind(mut self, value: impl Bound) -> Self {
        self.values.push(value.value());
        self
    }

    /// The statement for SQLite's driver.
    pub fn sqlite(self) -> sqlx::query::Query<'static, Sqlite, SqliteArguments> {
        let query = sqlx::query(AssertSqlSafe(self.text));
        self.values.into_iter().fold(query, |query, v| match v {
            Value::Text(value) => query.bind(value),
            Value::Integer(value) => query.bind(value),
            Value::Real(value) => query.bind(value),
            Value::Boolean(value) => query.bind(value),
            Value::Bytes(value) => query.bind(value),
        })
    }

    /// The statement for PostgreSQL's driver.
    pub fn postgres(self) -> sqlx::query::Query<'static, Postgres, PgArguments> {
        let mut text = self.postgres.unwrap_or(self.text);
        if self.anew {
            // The driver knows prepared statements by their text.
            text.to_mut().push(' ');
        }
        let query = sqlx::query(AssertSqlSafe(text)).persistent(!self.anew);
        self.values.into_iter().fold(query, |query, v| match v {
            // PostgreSQL has no NUL in a text.
            Value::Text(value) => query.bind(value.map(|text| {
                if text.contains('\0') {
                    text.replace('\0', "\u{fffd}")
                } else {
                    text
                }
            })),
            Value::Integer(value) => query.bind(value),
            Value::Real(value) => query.bind(value),
            Value::Boolean(value) => query.bind(value),
            Value::Bytes(value) => query.bind(value),
        })
    }

    /// Runs it; returns all rows.
    pub async fn fetch_all(self, target: impl Into<Target<'_>> + Send) -> StoreResult<Vec<DbRow>> {
        Ok(match target.into() {
            Target::SqlitePool(shared) => {
                let _turn = shared.turn().await?;
                let rows = self.sqlite().fetch_all(&shared.pool).await;
                sqlite_rows(rows.map_err(|error| shared.health.noted(faults::of_sqlite(error)))?)
            }
            Target::Sqlite(connection, writer) => {
                self.mark(&writer.erased);
                let rows = self.sqlite().fetch_all(connection).await;
                sqlite_rows(rows.map_err(|error| writer.noted(faults::of_sqlite(error)))?)
            }
            Target::PgPool(shared) => {
                let _turn = shared.turn().await?;
                let pool = &shared.pool;
                pg_rows(again(shared, self, |q| q.fetch_all(pool)).await?)
            }
            Target::Postgres(connection, health) => {
                let rows = self.postgres().fetch_all(connection).await;
                pg_rows(rows.map_err(|error| health.noted(faults::of_postgres(error)))?)
            }
        })
    }

    /// Runs it outside a transaction; returns all rows. Prepared anew if it has to be.
    pub async fn fetch_alone(
        mut self,
        connection: &mut PgConnection,
        health: &Health,
    ) -> StoreResult<Vec<DbRow>> {
        let mut rows = self.clone().postgres().fetch_all(&mut *connection).await;
        if rows.as_ref().is_err_and(faults::plan_is_stale) {
            self.anew = true;
            rows = self.postgres().fetch_all(connection).await;
        }
        Ok(pg_rows(rows.map_err(|error| {
            health.noted(faults::of_postgres(error))
        })?))
    }

    /// Runs it; returns the first row.
    pub async fn fetch_optional(
        self,
        target: impl Into<Target<'_>> + Send,
    ) -> StoreResult<Option<DbRow>> {
        Ok(match target.into() {
            Target::SqlitePool(shared) => {
                let _turn = shared.turn().await?;
                let row = self.sqlite().fetch_optional(&shared.pool).await;
                row.map_err(|error| shared.health.noted(faults::of_sqlite(error)))?
                    .map(DbRow::Sqlite)
            }
            Target::Sqlite(connection, writer) => {
                self.mark(&writer.erased);
                let row = self.sqlite().fetch_optional(connection).await;
                row.map_err(|error| writer.noted(faults::of_sqlite(error)))?
                    .map(DbRow::Sqlite)
            }
            Target::PgPool(shared) => {
                let _turn = shared.turn().await?;
                let pool = &shared.pool;
                let row = again(shared, self, |q| q.fetch_optional(pool)).await?;
                row.map(DbRow::Postgres)
            }
            Target::Postgres(connection, health) => {
                let row = self.postgres().fetch_optional(connection).await;
                row.map_err(|error| health.noted(faults::of_postgres(error)))?
                    .map(DbRow::Postgres)
            }
        })
    }

    /// Runs it; returns its one row.
    pub async fn fetch_one(self, target: impl Into<Target<'_>> + Send) -> StoreResult<DbRow> {
        let row = self.fetch_optional(target).await?;
        row.ok_or_else(|| faults::of_sqlite(sqlx::Error::RowNotFound))
    }

    /// Runs it; returns the number of rows that it changed.
    pub async fn execute(self, target: impl Into<Target<'_>> + Send) -> StoreResult<u64> {
        Ok(match target.into() {
            Target::SqlitePool(shared) => {
                let _turn = shared.turn().await?;
                let done = self.sqlite().execute(&shared.pool).await;
                done.map_err(|error| shared.health.noted(faults::of_sqlite(error)))?
                    .rows_affected()
            }
            Target::Sqlite(connection, writer) => {
                self.mark(&writer.erased);
                let done = self.sqlite().execute(connection).await;
                done.map_err(|error| writer.noted(faults::of_sqlite(error)))?
                    .rows_affected()
            }
            Target::PgPool(shared) => {
                let _turn = shared.turn().await?;
                let pool = &shared.pool;
                let done = self.postgres().execute(pool).await;
                let noted = |error| shared.health.noted(faults::of_pool(pool, error));
                done.map_err(noted)?.rows_affected()
            }
            Target::Postgres(connection, health) => {
                let done = self.postgres().execute(connection).await;
                done.map_err(|error| health.noted(faults::of_postgres(error)))?
                    .rows_affected()
            }
        })
    }
}

/// A statement for PostgreSQL's driver.
type PgQuery = sqlx::query::Query<'static, Postgres, PgArguments>;

/// Reads; again if the connection was lost, as all are when the server is started anew, or if the server has to
/// prepare the statement anew.
async fn again<T, F>(
    shared: &Shared<PgPool>,
    mut query: Query,
    read: impl Fn(PgQuery) -> F,
) -> StoreResult<T>
where
    F: Future<Output = Result<T, sqlx::Error>>,
{
    let mut tries = 0;
    loop {
        match read(query.clone().postgres()).await {
            Ok(read) => return Ok(read),
            Err(error) if !query.anew && faults::plan_is_stale(&error) => query.anew = true,
            Err(error) if tries < READ_RETRIES && faults::connection_was_lost(&error) => {
                tries += 1;
                tokio::time::sleep(jitter(Duration::from_millis(50) * tries)).await;
            }
            Err(error) => {
                return Err(shared.health.noted(faults::of_pool(&shared.pool, error)));
            }
        }
    }
}

/// Half to all of a pause, so that those who wait for the same thing do not come back together.
pub(super) fn jitter(pause: Duration) -> Duration {
    pause.mul_f64(0.5 + 0.5 * ventriform_service::network::hooks::random_share())
}

fn sqlite_rows(rows: Vec<SqliteRow>) -> Vec<DbRow> {
    rows.into_iter().map(DbRow::Sqlite).collect()
}

fn pg_rows(rows: Vec<PgRow>) -> Vec<DbRow> {
    rows.into_iter().map(DbRow::Postgres).collect()
}

/// A row of either engine.
pub(super) enum DbRow {
    /// Of SQLite.
    Sqlite(SqliteRow),
    /// Of PostgreSQL.
    Postgres(PgRow),
}

impl DbRow {
    /// The value of a column, by name or by place.
    pub fn try_get<'r, T, I>(&'r self, column: I) -> StoreResult<T>
    where
        T: Decode<'r, Sqlite> + Type<Sqlite> + Decode<'r, Postgres> + Type<Postgres>,
        I: ColumnIndex<SqliteRow> + ColumnIndex<PgRow>,
    {
        Ok(match self {
            DbRow::Sqlite(row) => row.try_get(column).map_err(faults::of_sqlite)?,
            DbRow::Postgres(row) => row.try_get(column).map_err(faults::of_postgres)?,
        })
    }
}

/// A statement that is put together piece by piece.
pub(super) struct QueryBuilder {
    text: String,
    /// The text for PostgreSQL, once it differs.
    postgres: Option<String>,
    values: Vec<Value>,
}

impl QueryBuilder {
    /// Begins with that text.
    pub fn new(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            postgres: None,
            values: Vec::new(),
        }
    }

    /// Adds text.
    pub fn push(&mut self, text: &str) -> &mut Self {
        self.text.push_str(text);
        if let Some(postgres) = &mut self.postgres {
            postgres.push_str(text);
        }
        self
    }

    /// Adds text for SQLite alone.
    pub fn push_sqlite(&mut self, text: &str) -> &mut Self {
        self.postgres.get_or_insert_with(|| self.text.clone());
        self.text.push_str(text);
        self
    }

    /// Adds a column whose indexes SQLite is not to use. SQLite keeps no statistics here and takes any of several
    /// indexes; PostgreSQL knows how many rows each of them finds.
    pub fn push_unindexed(&mut self, column: &str) -> &mut Self {
        self.push_sqlite("+").push(column)
    }

    /// Adds a placeholder with its value.
    pub fn push_bind(&mut self, value: impl Bound) -> &mut Self {
        self.values.push(value.value());
        let number = self.values.len();
        self.push(&format!("${number}"))
    }

    /// The text for SQLite.
    #[cfg(test)]
    pub fn text(&self) -> String {
        self.text.clone()
    }

    /// The statement.
    pub fn build(&mut self) -> Query {
        Query {
            postgres: self.postgres.take().map(Cow::from),
            values: std::mem::take(&mut self.values),
            ..query(std::mem::take(&mut self.text))
        }
    }
}
