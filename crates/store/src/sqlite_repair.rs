//! Repairing and copying the database; for [`super::doctor`] and [`backup()`](super::backup()).
//!
//! A damaged database is copied table by table into a new one: each whole, or else row by row from both ends up to the
//! damage, and every row between by its number. Foreign keys and triggers are off meanwhile, so that no row is dropped
//! because another one is lost; what triggers would have kept is made anew. What is lost is told by the indexes, which
//! lie on other pages, and by the numbers that SQLite has given to rows.

use super::database::SqlStore;
use super::query::query;
use super::tables::{Holder, RECOUNT, append, repaired};
use crate::faults;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{AssertSqlSafe, ConnectOptions, Connection, SqliteConnection};
use std::collections::BTreeMap;
use std::path::Path;
use ventriform_service::base::records::{StoreResult, Tenant, Timestamp};
use ventriform_service::callers::AuditEvent;

/// Tables whose rows are never deleted: their greatest number is how many there were.
const NEVER_DELETED: &[&str] = &["api_keys", "erasures"];

/// Rows of a table without row numbers that are copied at a time.
const BATCH_ROWS: i64 = 500;

/// Most numbers between the readable ends of a damaged table that are tried one by one.
const MOST_TRIED: i64 = 2_000_000;

/// Numbers in a row that cannot be read, after which no more are tried: more than a page of rows has.
const MOST_FAILED: u32 = 20_000;

/// What is known of a table after it was copied.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Salvaged {
    /// Its name.
    pub table: String,
    /// Rows that were copied.
    pub kept: u64,
    /// Rows that are lost; `None` if some are, and nothing tells how many.
    pub lost: Option<u64>,
    /// The greatest number that a row ever had, if the table counts its rows.
    pub last: Option<i64>,
}

/// What is left of a damaged database.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Salvage {
    /// Its tables.
    pub tables: Vec<Salvaged>,
    /// Who had items, by an index of the table that says so, though the row is lost.
    pub holders: Vec<Holder>,
}

impl Salvage {
    /// Whether rows of a table are lost.
    pub fn lacks(&self, table: &str) -> bool {
        let found = self.tables.iter().find(|found| found.table == table);
        found.is_none_or(|found| found.lost != Some(0))
    }
}

impl SqlStore {
    /// The faults of the database's structure: `PRAGMA integrity_check` and
    /// `foreign_key_check`.
    pub(super) async fn all_defects(&self) -> StoreResult<Vec<String>> {
        let checked = query("PRAGMA integrity_check(20)");
        let mut defects = Vec::new();
        for row in checked.fetch_all(&self.readers).await? {
            let line: String = row.try_get(0)?;
            defects.extend(Some(line).filter(|line| line != "ok"));
        }
        let keys = query("PRAGMA foreign_key_check");
        for row in keys.fetch_all(&self.readers).await? {
            let table: String = row.try_get(0)?;
            defects.push(format!(
                "a row of `{table}` names another that does not exist"
            ));
        }
        Ok(defects)
    }

    /// Copies every row that can be read from the damaged database `old` into this new one; none, if it cannot even be
    /// opened.
    pub(super) async fn salvage(&self, old: &Path) -> StoreResult<Salvage> {
        let mut connection = self.file()?.connect().await?;
        let salvaged = salvage(&mut connection, old).await;
        let closed = connection.close().await;
        let salvaged = salvaged.map_err(faults::of_sqlite)?;
        closed.map_err(faults::of_sqlite)?;
        Ok(salvaged)
    }

    /// Removes rows that name an ownership which nobody has, with a row of the trail for each table. Returns how many
    /// of each.
    pub(super) async fn drop_orphans(
        &self,
        now: Timestamp,
    ) -> StoreResult<Vec<(&'static str, u64)>> {
        let mut dropped = Vec::new();
        for (table, orphans) in [
            (
                "sources",
                "DELETE FROM sources WHERE NOT EXISTS
                 (SELECT 1 FROM holdings h WHERE h.tenant = sources.tenant AND h.id = sources.id)",
            ),
            (
                "scans",
                "DELETE FROM scans WHERE NOT EXISTS
                 (SELECT 1 FROM holdings h WHERE h.tenant = scans.tenant AND h.id = scans.volume)",
            ),
            (
                "intake_objects",
                "DELETE FROM intake_objects WHERE NOT EXISTS
                 (SELECT 1 FROM intake_groups g WHERE g.id = intake_objects.group_id)",
            ),
        ] {
            let mut transaction = self.writer.begin().await?;
            let rows = query(orphans).execute(&mut transaction).await?;
            if rows > 0 {
                dropped.push((table, rows));
                let event = AuditEvent {
                    count: rows,
                    ..repaired(table, None, now)
                };
                append(&mut transaction, &[event]).await?;
            }
            transaction.commit().await?;
        }
        Ok(dropped)
    }

    /// Notes anew up to which row the trail was removed by age, as the last event about a removal says. Returns whether
    /// that was lost.
    pub(super) async fn restore_anchor(&self) -> StoreResult<bool> {
        let mut connection = self.file()?.connect().await?;
        let restored = restore_anchor(&mut connection).await;
        let closed = connection.close().await;
        let restored = restored.map_err(faults::of_sqlite)?;
        closed.map_err(faults::of_sqlite)?;
        Ok(restored)
    }

    /// Writes a copy of the database at `source`, as of one moment, to the new file `copy`.
    pub(super) async fn snapshot(source: &Path, copy: &Path) -> StoreResult<()> {
        let options = SqliteConnectOptions::new().filename(source);
        let mut connection = options.connect().await.map_err(faults::of_sqlite)?;
        sqlx::query("VACUUM INTO ?")
            .bind(copy.to_string_lossy())
            .execute(&mut connection)
            .await
            .map_err(faults::of_sqlite)?;
        connection.close().await.map_err(faults::of_sqlite)
    }
}

/// Runs statements without values.
async fn run(on: &mut SqliteConnection, text: impl Into<String>) -> Result<u64, sqlx::Error> {
    let text: String = text.into();
    let done = sqlx::raw_sql(AssertSqlSafe(text)).execute(on).await?;
    Ok(done.rows_affected())
}

/// The one value of a query, or `None` if it fails.
async fn number(on: &mut SqliteConnection, text: String) -> Option<i64> {
    let value: Result<Option<i64>, _> = sqlx::query_scalar(AssertSqlSafe(text)).fetch_one(on).await;
    value.ok().flatten()
}

async fn salvage(to: &mut SqliteConnection, old: &Path) -> Result<Salvage, sqlx::Error> {
    let tables: Vec<String> = sqlx::query_scalar(
        "SELECT name FROM sqlite_schema
         WHERE type = 'table' AND name NOT LIKE 'sqlite\\_%' ESCAPE '\\'
           AND name NOT IN ('_sqlx_migrations', 'probe', 'stored_bytes', 'stored_items', 'listed_scans')",
    )
    .fetch_all(&mut *to)
    .await?;
    run(to, "PRAGMA foreign_keys = OFF").await?;
    let attached = sqlx::query("ATTACH ? AS old")
        .bind(old.to_string_lossy())
        .execute(&mut *to)
        .await;
    if let Err(error) = attached {
        tracing::warn!(%error, "no row of the damaged database could be read");
        let lost = |table| Salvaged {
            table,
            kept: 0,
            lost: None,
            last: None,
        };
        return Ok(Salvage {
            tables: tables.into_iter().map(lost).collect(),
            holders: Vec::new(),
        });
    }
    let readable = names(to, "old").await;
    // No transaction: after a statement that met the damage, SQLite lets none write that its transaction has begun. The
    // new database takes its place as a whole, and is forced to disk before.
    run(to, "PRAGMA synchronous = OFF").await?;
    let triggers: Vec<(String, String)> =
        sqlx::query_as("SELECT name, sql FROM main.sqlite_schema WHERE type = 'trigger'")
            .fetch_all(&mut *to)
            .await?;
    for (name, _) in &triggers {
        run(to, format!("DROP TRIGGER main.{name}")).await?;
    }
    let mut salvaged = Vec::new();
    for table in tables {
        // A table that the old database never had lost nothing; one whose name cannot be read may have had rows.
        let known = readable.as_ref().map(|names| names.contains(&table));
        salvaged.push(match known {
            Some(false) => Salvaged {
                table,
                kept: 0,
                lost: Some(0),
                last: None,
            },
            _ => salvage_table(to, table).await?,
        });
    }
    go_on_counting(to).await?;
    let holders = lost_holders(to).await;
    // Triggers would have kept this.
    for from in [
        "SELECT tenant, holdings.kind, key, value, sequence FROM holdings, json_each(holdings.labels)",
        "SELECT tenant, 'job', key, value, sequence FROM jobs, json_each(jobs.labels)",
    ] {
        run(to, format!("INSERT OR IGNORE INTO main.label_index (tenant, kind, name, value, sequence) {from}")).await?;
    }
    for statement in RECOUNT {
        run(to, statement).await?;
    }
    run(
        to,
        "INSERT INTO main.listed_scans SELECT * FROM main.listed_scans_now",
    )
    .await?;
    salvaged.retain(|found: &Salvaged| found.table != "label_index");
    for (_, sql) in &triggers {
        run(to, sql.clone()).await?;
    }
    Ok(Salvage {
        tables: salvaged,
        holders,
    })
}

/// The tables of a database; `None` if that cannot be read.
async fn names(of: &mut SqliteConnection, schema: &str) -> Option<Vec<String>> {
    let names = format!("SELECT name FROM {schema}.sqlite_schema WHERE type = 'table'");
    let names: Result<Vec<String>, _> =
        sqlx::query_scalar(AssertSqlSafe(names)).fetch_all(of).await;
    names.ok().filter(|names| !names.is_empty())
}

/// Copies one table, and tells what is lost of it.
async fn salvage_table(to: &mut SqliteConnection, table: String) -> Result<Salvaged, sqlx::Error> {
    let last = number(
        to,
        format!("SELECT seq FROM old.sqlite_sequence WHERE name = '{table}'"),
    )
    .await;
    let columns = "SELECT new.name FROM pragma_table_info(?1) AS new
                   JOIN pragma_table_info(?1, 'old') AS old ON old.name = new.name";
    let columns: Vec<String> = sqlx::query_scalar(columns)
        .bind(&table)
        .fetch_all(&mut *to)
        .await
        .unwrap_or_default();
    let mut whole = false;
    if !columns.is_empty() {
        let columns = columns.join(", ");
        // The indexes are not asked for rows: one of them may be what is damaged.
        let copy = format!(
            "INSERT OR IGNORE INTO main.{table} ({columns}) SELECT {columns} FROM old.{table} NOT INDEXED"
        );
        whole = run(to, copy.clone()).await.is_ok();
        if !whole {
            let numbered = format!("SELECT count(rowid) FROM main.{table}");
            match number(to, numbered).await {
                Some(_) => by_number(to, &table, &copy).await,
                None => by_place(to, &table, &copy).await,
            }
        }
    }
    let kept = number(to, format!("SELECT count(*) FROM main.{table}")).await;
    let kept = kept.unwrap_or(0).unsigned_abs();
    let before = rows_before(to, &table, last).await;
    let lost = match before {
        Some(before) => Some(before.saturating_sub(kept)),
        None => whole.then_some(0),
    };
    Ok(Salvaged {
        lost,
        table,
        kept,
        last,
    })
}

/// Number of rows that a table of the old database had, by its indexes and the numbers given to rows; `None` if none of
/// them can be read.
async fn rows_before(of: &mut SqliteConnection, table: &str, last: Option<i64>) -> Option<u64> {
    let indexes =
        "SELECT name FROM pragma_index_list(?1, 'old') WHERE partial = 0 AND origin != 'pk'";
    let indexes: Vec<String> = sqlx::query_scalar(indexes)
        .bind(table)
        .fetch_all(&mut *of)
        .await
        .unwrap_or_default();
    let mut most = None;
    for index in indexes {
        let count = format!("SELECT count(*) FROM old.{table} INDEXED BY {index}");
        most = most.max(number(of, count).await);
    }
    if NEVER_DELETED.contains(&table) {
        most = most.max(last);
    }
    if table == "audit" {
        let pruned = "SELECT coalesce(max(sequence), 0) FROM old.audit_anchors".to_owned();
        let pruned = number(of, pruned).await;
        most = most.max(last.zip(pruned).map(|(last, pruned)| last - pruned));
    }
    most.map(i64::unsigned_abs)
}

/// Copies the rows of a table from both ends up to the damage, and then each number between.
async fn by_number(to: &mut SqliteConnection, table: &str, copy: &str) {
    let mut ends = [i64::MIN, i64::MAX];
    for (end, (beyond, order)) in [(">", "ASC"), ("<", "DESC")].into_iter().enumerate() {
        let next = format!(
            "SELECT rowid FROM old.{table} NOT INDEXED WHERE rowid {beyond} ? ORDER BY rowid {order} LIMIT 1"
        );
        loop {
            let row = sqlx::query_scalar(AssertSqlSafe(next.clone())).bind(ends[end]);
            let Ok(Some(rowid)) = row.fetch_optional(&mut *to).await else {
                break;
            };
            ends[end] = rowid;
            if !copy_one(to, copy, rowid).await {
                break;
            }
        }
    }
    let [first, last] = ends;
    if (first, last) == (i64::MIN, i64::MAX) {
        // Not even the root can be read.
        return;
    }
    let first = first.max(0);
    let last = last.min(first.saturating_add(MOST_TRIED));
    let mut failed = 0;
    for rowid in first.saturating_add(1)..last {
        if copy_one(to, copy, rowid).await {
            failed = 0;
        } else {
            failed += 1;
            if failed == MOST_FAILED {
                break;
            }
        }
    }
}

async fn copy_one(to: &mut SqliteConnection, copy: &str, rowid: i64) -> bool {
    let one = format!("{copy} WHERE rowid = ?");
    let copied = sqlx::query(AssertSqlSafe(one)).bind(rowid);
    copied.execute(to).await.is_ok()
}

/// Copies the rows of a table without row numbers from both ends up to the damage, in the order of its key.
async fn by_place(to: &mut SqliteConnection, table: &str, copy: &str) {
    let key = "SELECT name FROM pragma_table_info(?1) WHERE pk > 0 ORDER BY pk";
    let key: Vec<String> = sqlx::query_scalar(key)
        .bind(table)
        .fetch_all(&mut *to)
        .await
        .unwrap_or_default();
    for order in ["ASC", "DESC"] {
        let key: Vec<String> = key.iter().map(|name| format!("{name} {order}")).collect();
        let ordered = format!("{copy} ORDER BY {}", key.join(", "));
        let mut place = 0;
        let mut batch = BATCH_ROWS;
        loop {
            // `changes` leaves out what is there already; the end is where a page has no row.
            let here = format!("{ordered} LIMIT {batch} OFFSET {place}");
            match run(to, here).await {
                Ok(_) => {
                    let beyond = format!(
                        "SELECT count(*) FROM (SELECT 1 FROM old.{table} ORDER BY {} LIMIT 1 OFFSET {})",
                        key.join(", "),
                        place + batch
                    );
                    place += batch;
                    if number(to, beyond).await == Some(0) {
                        break;
                    }
                }
                Err(_) if batch > 1 => batch = 1,
                Err(_) => break,
            }
        }
    }
}

/// Numbers that the old database has given to rows are not given again.
async fn go_on_counting(to: &mut SqliteConnection) -> Result<(), sqlx::Error> {
    let counts: Result<Vec<(String, i64)>, _> =
        sqlx::query_as("SELECT name, seq FROM old.sqlite_sequence")
            .fetch_all(&mut *to)
            .await;
    let counts: BTreeMap<String, i64> = counts.unwrap_or_default().into_iter().collect();
    for (name, last) in counts {
        let known = sqlx::query("UPDATE main.sqlite_sequence SET seq = max(seq, ?) WHERE name = ?")
            .bind(last)
            .bind(&name)
            .execute(&mut *to)
            .await?;
        if known.rows_affected() == 0 {
            sqlx::query("INSERT INTO main.sqlite_sequence (name, seq) VALUES (?, ?)")
                .bind(&name)
                .bind(last)
                .execute(&mut *to)
                .await?;
        }
    }
    Ok(())
}

/// Who had items by the indexes of the old table, where the new one lacks the row.
async fn lost_holders(of: &mut SqliteConnection) -> Vec<Holder> {
    let mut holders = Vec::new();
    let index: Option<String> = sqlx::query_scalar(
        "SELECT l.name FROM pragma_index_list('holdings', 'old') AS l
         WHERE l.origin = 'u' AND l.partial = 0
           AND (SELECT group_concat(i.name) FROM pragma_index_info(l.name, 'old') AS i) = 'tenant,id'",
    )
    .fetch_optional(&mut *of)
    .await
    .unwrap_or_default();
    let Some(index) = index else { return holders };
    let lost = format!(
        "SELECT tenant, id FROM old.holdings AS lost INDEXED BY {index}
         WHERE NOT EXISTS (SELECT 1 FROM main.holdings AS kept
                           WHERE kept.tenant = lost.tenant AND kept.id = lost.id)"
    );
    let lost: Vec<(String, String)> = sqlx::query_as(AssertSqlSafe(lost))
        .fetch_all(of)
        .await
        .unwrap_or_default();
    for (tenant, id) in lost {
        holders.extend(Tenant::try_from(tenant).map(|tenant| Holder { tenant, id }));
    }
    holders
}

async fn restore_anchor(on: &mut SqliteConnection) -> Result<bool, sqlx::Error> {
    let last: Option<(String, i64)> = sqlx::query_as(
        "SELECT object, recorded FROM audit
         WHERE json_extract(event, '$.activity') = 'audit-pruned' AND object IS NOT NULL
         ORDER BY sequence DESC LIMIT 1",
    )
    .fetch_optional(&mut *on)
    .await?;
    let anchor = last.and_then(|(object, at)| Some((super::tables::anchor_of(&object)?, at)));
    let Some((anchor, at)) = anchor else {
        return Ok(false);
    };
    let known: i64 = sqlx::query_scalar("SELECT count(*) FROM audit_anchors WHERE sequence = ?")
        .bind(anchor.sequence)
        .fetch_one(&mut *on)
        .await?;
    if known > 0 {
        return Ok(false);
    }
    let trigger: Option<String> = sqlx::query_scalar(
        "SELECT sql FROM sqlite_schema WHERE type = 'trigger' AND name = 'audit_anchors_name_rows'",
    )
    .fetch_optional(&mut *on)
    .await?;
    run(on, "BEGIN IMMEDIATE").await?;
    if trigger.is_some() {
        run(on, "DROP TRIGGER audit_anchors_name_rows").await?;
    }
    sqlx::query("INSERT INTO audit_anchors (sequence, hash, pruned_at) VALUES (?, ?, ?)")
        .bind(anchor.sequence)
        .bind(&anchor.hash)
        .bind(at)
        .execute(&mut *on)
        .await?;
    if let Some(trigger) = trigger {
        run(on, trigger).await?;
    }
    run(on, "COMMIT").await?;
    Ok(true)
}
