//! Copying rows from SQLite to PostgreSQL.
//!
//! Tables and columns are those of the two schemas, not a list kept here: a column of SQLite that PostgreSQL
//! lacks is an error. Triggers are switched off meanwhile, since what they would write is among the rows.

use super::{MigrateError, Progress};
use crate::database::{Readers, SqlStore};
use crate::faults::{of_postgres, of_sqlite};
use crate::postgres;
use crate::query::Value;
use futures::TryStreamExt;
use sha2::{Digest, Sha256};
use sqlx::postgres::{PgArguments, PgRow};
use sqlx::query::Query;
use sqlx::sqlite::{SqlitePool, SqliteRow};
use sqlx::{AssertSqlSafe, Connection, PgConnection, Postgres, Row};
use ventriform_service::base::records::{StoreError, StoreResult};
use ventriform_service::config::PostgresSettings;

/// Rows sent at a time.
const BATCH_ROWS: usize = 200;

/// The tables to copy; first those that others refer to.
const SELECT_TABLES: &str = "SELECT name FROM sqlite_schema
    WHERE type = 'table' AND name NOT LIKE 'sqlite\\_%' ESCAPE '\\'
      AND name NOT IN ('_sqlx_migrations', 'probe')
    ORDER BY name NOT IN ('holdings', 'intake_groups'), name";

/// The columns of a table of SQLite that are not computed.
const SELECT_STORED_COLUMNS: &str =
    "SELECT name FROM pragma_table_xinfo($1) WHERE hidden = 0 ORDER BY cid";

/// Name, type, and whether it counts by itself, of the columns of a table of PostgreSQL.
const SELECT_COLUMNS: &str = "SELECT column_name::text, data_type::text, is_identity = 'YES'
    FROM information_schema.columns
    WHERE table_schema = current_schema() AND table_name = $1 AND is_generated = 'NEVER'";

/// A table with its number of rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TableCount {
    /// Its name.
    pub name: String,
    /// Number of rows.
    pub rows: u64,
}

/// The type of a column of PostgreSQL.
#[derive(Debug, Clone, Copy)]
enum Type {
    Text,
    Integer,
    Real,
    Boolean,
    Bytes,
}

struct Column {
    name: String,
    kind: Type,
}

struct Table {
    name: String,
    columns: Vec<Column>,
    /// The column that counts by itself.
    counter: Option<String>,
}

/// Number of rows, and the sum of the hashes of their values, which does not depend on their order.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
struct Tally {
    rows: u64,
    sum: u128,
}

/// Copies every row of `from` in one transaction, in which they are read back and compared, and notes that the
/// files of the records are at `place`.
pub(super) async fn copy(
    from: &SqlStore,
    to: &PostgresSettings,
    place: &str,
    tell: &impl Fn(Progress),
) -> Result<Vec<TableCount>, MigrateError> {
    let from = file_of(from)?;
    let mut to = postgres::connect_unlimited(to).await.map_err(of_postgres)?;
    run(&mut to, postgres::BEGIN_WRITING).await?;
    let mut copied = Vec::new();
    let mut sent = 0;
    for table in tables(from, &mut to).await? {
        let name = &table.name;
        run(&mut to, &format!("ALTER TABLE {name} DISABLE TRIGGER USER")).await?;
        let tally = copy_table(from, &mut to, &table, |rows| {
            sent += rows;
            tell(Progress::Rows { done: sent });
        })
        .await?;
        if read_back(&mut to, &table).await? != tally {
            return Err(MigrateError::Differs(table.name));
        }
        go_on_counting(from, &mut to, &table).await?;
        run(&mut to, &format!("ALTER TABLE {name} ENABLE TRIGGER USER")).await?;
        copied.push(TableCount {
            name: table.name,
            rows: tally.rows,
        });
    }
    let greatest = last_number(from, "audit").await?;
    let ends = sqlx::query("UPDATE audit_greatest SET sequence = $1").bind(greatest);
    ends.execute(&mut to).await.map_err(of_postgres)?;
    let placed = sqlx::query("UPDATE store_place SET place = $1").bind(place);
    placed.execute(&mut to).await.map_err(of_postgres)?;
    run(&mut to, "COMMIT").await?;
    let _ = to.close().await;
    Ok(copied)
}

/// A table of `to` that holds a row, of those that rows would be copied to.
pub(super) async fn any(
    from: &SqlStore,
    to: &PostgresSettings,
) -> Result<Option<String>, MigrateError> {
    let from = file_of(from)?;
    let mut to = postgres::connect_unlimited(to).await.map_err(of_postgres)?;
    for table in tables(from, &mut to).await? {
        let exists = format!("SELECT EXISTS (SELECT 1 FROM {})", table.name);
        let exists = sqlx::query_scalar(AssertSqlSafe(exists)).fetch_one(&mut to);
        if exists.await.map_err(of_postgres)? {
            return Ok(Some(table.name));
        }
    }
    Ok(None)
}

/// The tables, if both databases hold the same rows.
pub(super) async fn same(
    from: &SqlStore,
    to: &PostgresSettings,
) -> Result<Option<Vec<TableCount>>, MigrateError> {
    let from = file_of(from)?;
    let mut to = postgres::connect_unlimited(to).await.map_err(of_postgres)?;
    let mut found = Vec::new();
    for table in tables(from, &mut to).await? {
        let own = tally_of(from, &table).await?;
        if read_back(&mut to, &table).await? != own {
            return Ok(None);
        }
        found.push(TableCount {
            name: table.name,
            rows: own.rows,
        });
    }
    Ok(Some(found))
}

/// The tables of a file of SQLite.
pub(super) async fn count(of: &SqlStore) -> Result<Vec<TableCount>, MigrateError> {
    let of = file_of(of)?;
    let names: Vec<String> = sqlx::query_scalar(SELECT_TABLES)
        .fetch_all(of)
        .await
        .map_err(of_sqlite)?;
    let mut counted = Vec::new();
    for name in names {
        let count = sqlx::query_scalar(AssertSqlSafe(format!("SELECT count(*) FROM {name}")));
        let rows: i64 = count.fetch_one(of).await.map_err(of_sqlite)?;
        let rows = rows.unsigned_abs();
        counted.push(TableCount { name, rows });
    }
    Ok(counted)
}

fn file_of(store: &SqlStore) -> StoreResult<&SqlitePool> {
    match &store.readers {
        Readers::Sqlite(shared) => Ok(&shared.pool),
        Readers::Postgres(_) => Err(StoreError::database("rows are copied from SQLite only")),
    }
}

async fn run(on: &mut PgConnection, statement: &str) -> StoreResult<()> {
    let statement = sqlx::raw_sql(AssertSqlSafe(statement.to_owned()));
    statement.execute(on).await.map_err(of_postgres)?;
    Ok(())
}

async fn tables(from: &SqlitePool, to: &mut PgConnection) -> StoreResult<Vec<Table>> {
    let names: Vec<String> = sqlx::query_scalar(SELECT_TABLES)
        .fetch_all(from)
        .await
        .map_err(of_sqlite)?;
    let mut tables = Vec::new();
    for name in names {
        let stored = sqlx::query_scalar(SELECT_STORED_COLUMNS).bind(&name);
        let stored: Vec<String> = stored.fetch_all(from).await.map_err(of_sqlite)?;
        let known: Vec<(String, String, bool)> = sqlx::query_as(SELECT_COLUMNS)
            .bind(&name)
            .fetch_all(&mut *to)
            .await
            .map_err(of_postgres)?;
        let columns = stored.into_iter().map(|column| {
            let found = known.iter().find(|(name, _, _)| *name == column);
            let kind = found.and_then(|(_, kind, _)| Type::named(kind));
            match kind {
                Some(kind) => Ok(Column { name: column, kind }),
                None => Err(StoreError::database(format!(
                    "PostgreSQL has no place for {name}.{column}"
                ))),
            }
        });
        let columns = columns.collect::<StoreResult<_>>()?;
        let counter = known.into_iter().find(|(_, _, counts)| *counts);
        tables.push(Table {
            name,
            columns,
            counter: counter.map(|(name, _, _)| name),
        });
    }
    Ok(tables)
}

async fn copy_table(
    from: &SqlitePool,
    to: &mut PgConnection,
    table: &Table,
    mut sent: impl FnMut(u64),
) -> StoreResult<Tally> {
    let (select, insert) = (table.select(), table.insert());
    let mut rows = sqlx::query(AssertSqlSafe(select))
        .fetch(from)
        .try_chunks(BATCH_ROWS);
    let mut tally = Tally::default();
    while let Some(chunk) = rows.try_next().await.map_err(|error| of_sqlite(error.1))? {
        let batch: Vec<Vec<Value>> = chunk
            .iter()
            .map(|row| table.of_sqlite(row))
            .collect::<Result<_, _>>()
            .map_err(of_sqlite)?;
        batch.iter().for_each(|row| tally.add(row));
        let statement = sqlx::query(AssertSqlSafe(insert.clone()));
        let statement = (0..table.columns.len()).fold(statement, |statement, place| {
            table.columns[place].bind(statement, &batch, place)
        });
        statement.execute(&mut *to).await.map_err(of_postgres)?;
        sent(batch.len() as u64);
    }
    Ok(tally)
}

async fn tally_of(from: &SqlitePool, table: &Table) -> StoreResult<Tally> {
    let mut rows = sqlx::query(AssertSqlSafe(table.select())).fetch(from);
    let mut tally = Tally::default();
    while let Some(row) = rows.try_next().await.map_err(of_sqlite)? {
        tally.add(&table.of_sqlite(&row).map_err(of_sqlite)?);
    }
    Ok(tally)
}

async fn read_back(to: &mut PgConnection, table: &Table) -> StoreResult<Tally> {
    let mut rows = sqlx::query(AssertSqlSafe(table.select())).fetch(to);
    let mut tally = Tally::default();
    while let Some(row) = rows.try_next().await.map_err(of_postgres)? {
        tally.add(&table.of_postgres(&row).map_err(of_postgres)?);
    }
    Ok(tally)
}

/// The greatest number that SQLite ever gave to a row of the table.
async fn last_number(of: &SqlitePool, table: &str) -> StoreResult<i64> {
    let last = sqlx::query_scalar("SELECT seq FROM sqlite_sequence WHERE name = $1").bind(table);
    let last: Option<i64> = last.fetch_optional(of).await.map_err(of_sqlite)?;
    Ok(last.unwrap_or(0))
}

/// The next row gets a greater number than any before it.
async fn go_on_counting(
    from: &SqlitePool,
    to: &mut PgConnection,
    table: &Table,
) -> StoreResult<()> {
    let last = last_number(from, &table.name).await?;
    let Some(counter) = table.counter.as_ref().filter(|_| last > 0) else {
        return Ok(());
    };
    sqlx::query("SELECT setval(pg_get_serial_sequence($1, $2), $3)")
        .bind(&table.name)
        .bind(counter)
        .bind(last)
        .execute(to)
        .await
        .map_err(of_postgres)?;
    Ok(())
}

impl Table {
    fn columns(&self) -> String {
        let names: Vec<&str> = self
            .columns
            .iter()
            .map(|column| column.name.as_str())
            .collect();
        names.join(", ")
    }

    fn select(&self) -> String {
        format!("SELECT {} FROM {}", self.columns(), self.name)
    }

    fn insert(&self) -> String {
        let arrays: Vec<String> = (1..)
            .zip(&self.columns)
            .map(|(number, column)| format!("${number}::{}[]", column.kind.name()))
            .collect();
        format!(
            "INSERT INTO {} ({}) SELECT * FROM unnest({})",
            self.name,
            self.columns(),
            arrays.join(", ")
        )
    }

    fn of_sqlite(&self, row: &SqliteRow) -> Result<Vec<Value>, sqlx::Error> {
        let values = (0..).zip(&self.columns).map(|(place, column)| {
            Ok(match column.kind {
                // PostgreSQL has no NUL in a text; the service writes it there in the same way.
                Type::Text => {
                    let text: Option<String> = row.try_get(place)?;
                    Value::Text(text.map(|text| text.replace('\0', "\u{fffd}")))
                }
                Type::Integer => Value::Integer(row.try_get(place)?),
                Type::Real => Value::Real(row.try_get(place)?),
                Type::Boolean => {
                    let flag: Option<i64> = row.try_get(place)?;
                    Value::Boolean(flag.map(|flag| flag != 0))
                }
                Type::Bytes => Value::Bytes(row.try_get(place)?),
            })
        });
        values.collect()
    }

    fn of_postgres(&self, row: &PgRow) -> Result<Vec<Value>, sqlx::Error> {
        let values = (0..).zip(&self.columns).map(|(place, column)| {
            Ok(match column.kind {
                Type::Text => Value::Text(row.try_get(place)?),
                Type::Integer => Value::Integer(row.try_get(place)?),
                Type::Real => Value::Real(row.try_get(place)?),
                Type::Boolean => Value::Boolean(row.try_get(place)?),
                Type::Bytes => Value::Bytes(row.try_get(place)?),
            })
        });
        values.collect()
    }
}

impl Type {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "text" => Self::Text,
            "bigint" => Self::Integer,
            "double precision" => Self::Real,
            "boolean" => Self::Boolean,
            "bytea" => Self::Bytes,
            _ => return None,
        })
    }

    fn name(self) -> &'static str {
        match self {
            Self::Text => "text",
            Self::Integer => "bigint",
            Self::Real => "double precision",
            Self::Boolean => "boolean",
            Self::Bytes => "bytea",
        }
    }
}

impl Column {
    /// Adds the values of this column, the one at `place` of each row, as an array.
    fn bind<'q>(
        &self,
        to: Query<'q, Postgres, PgArguments>,
        rows: &[Vec<Value>],
        place: usize,
    ) -> Query<'q, Postgres, PgArguments> {
        macro_rules! array {
            ($kind:ident) => {{
                let values = rows.iter().map(|row| match &row[place] {
                    Value::$kind(value) => value.clone(),
                    _ => None,
                });
                to.bind(values.collect::<Vec<_>>())
            }};
        }
        match self.kind {
            Type::Text => array!(Text),
            Type::Integer => array!(Integer),
            Type::Real => array!(Real),
            Type::Boolean => array!(Boolean),
            Type::Bytes => array!(Bytes),
        }
    }
}

impl Tally {
    fn add(&mut self, row: &[Value]) {
        let mut hash = Sha256::new();
        for value in row {
            let bytes: Option<&[u8]> = match value {
                Value::Text(text) => text.as_ref().map(String::as_bytes),
                Value::Bytes(bytes) => bytes.as_deref(),
                Value::Integer(number) => number.as_ref().map(bytemuck::bytes_of),
                Value::Real(number) => number.as_ref().map(bytemuck::bytes_of),
                Value::Boolean(flag) => flag.map(|flag| if flag { &[1u8][..] } else { &[0u8][..] }),
            };
            // A length that no value has stands for NULL.
            let length = bytes.map_or(u64::MAX, |bytes| bytes.len() as u64);
            hash.update(length.to_le_bytes());
            hash.update(bytes.unwrap_or_default());
        }
        let half: [u8; 16] = hash.finalize()[..16].try_into().unwrap_or_default();
        self.sum = self.sum.wrapping_add(u128::from_le_bytes(half));
        self.rows += 1;
    }
}
