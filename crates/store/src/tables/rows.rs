//! From rows of the database to the records of `jobs`, and JSON columns both ways.

use crate::database::SqlStore;
use crate::query::{DbRow, Query};
use serde::Serialize;
use serde::de::DeserializeOwned;
use ventriform_service::base::records::{
    Bounded, Job, JobState, LegalHold, ListPage, ListRequest, Owned, Ownership, PagePlan, Priority,
    Product, Receipt, ScanFields, ScanIdentity, StoreError, StoreResult, StoredVolume, Tags,
    Tenant, Timestamp,
};

pub(super) fn job(row: DbRow) -> StoreResult<Job> {
    let state: &str = row.try_get("state")?;
    Ok(Job {
        id: row.try_get("id")?,
        tenant: tenant(&row)?,
        tags: tags(&row)?,
        sequence: row.try_get("sequence")?,
        kind: row.try_get("kind")?,
        priority: priority(&row)?,
        volume: Some(row.try_get("volume")?).filter(|volume: &String| !volume.is_empty()),
        source: optional_json(&row, "source")?,
        send: optional_json(&row, "send")?,
        parameters: json(&row, "parameters")?,
        state: JobState::parse(state)
            .ok_or_else(|| StoreError::database(format!("unknown job state `{state}`")))?,
        stage: row.try_get("stage")?,
        progress: row.try_get("progress")?,
        attempts: count(&row, "attempts")?,
        interruptions: count(&row, "interruptions")?,
        crashes: count(&row, "crashes")?,
        revision: row.try_get("revision")?,
        cancel_requested: row.try_get("cancel_requested")?,
        created_at: row.try_get("created_at")?,
        started_at: row.try_get("started_at")?,
        finished_at: row.try_get("finished_at")?,
        failure: optional_json(&row, "failure")?,
        result: row.try_get("result")?,
        trace_parent: row.try_get("trace_parent")?,
    })
}

fn priority(row: &DbRow) -> StoreResult<Priority> {
    let rank = row.try_get("priority")?;
    Priority::of_rank(rank)
        .ok_or_else(|| StoreError::database(format!("unknown priority {rank} of a job")))
}

/// A number that is never negative, as the database holds it.
pub(super) fn unsigned(number: i64) -> u64 {
    u64::try_from(number).unwrap_or(0)
}

/// A count of a row.
pub(super) fn count(row: &DbRow, column: &str) -> StoreResult<u32> {
    Ok(u32::try_from(row.try_get::<i64, _>(column)?).unwrap_or(u32::MAX))
}

pub(super) fn volume(row: DbRow) -> StoreResult<StoredVolume> {
    Ok(StoredVolume {
        id: row.try_get("id")?,
        sequence: row.try_get("sequence")?,
        created_at: row.try_get("created_at")?,
        bytes: unsigned(row.try_get("bytes")?),
        files: json(&row, "files")?,
        facts: json(&row, "facts")?,
    })
}

pub(super) fn product(row: DbRow) -> StoreResult<Product> {
    Ok(Product {
        id: row.try_get("id")?,
        sequence: row.try_get("sequence")?,
        created_at: row.try_get("created_at")?,
        volume: row.try_get("volume")?,
        parameters: json(&row, "parameters")?,
        summary: json(&row, "summary")?,
        software: row.try_get("software")?,
        files: json(&row, "files")?,
    })
}

/// An item as a tenant has it, from a row of the item's columns and its ownership's.
pub(super) fn held<T>(row: DbRow, record: fn(DbRow) -> StoreResult<T>) -> StoreResult<Owned<T>> {
    let since: Option<Timestamp> = row.try_get("held_at")?;
    let legal_hold = match since {
        Some(since) => Some(LegalHold {
            reason: row.try_get("hold_reason")?,
            since,
            by: row.try_get("held_by")?,
        }),
        None => None,
    };
    let ownership = Ownership {
        tenant: tenant(&row)?,
        created_at: row.try_get("created_at")?,
        renewed_at: row.try_get("renewed_at")?,
        tags: tags(&row)?,
        legal_hold,
        source_on_hold: row.try_get::<i64, _>("source_holds")? > 0,
        scan: scan(&row)?,
        library: row.try_get("library")?,
    };
    Ok(Owned {
        item: record(row)?,
        ownership,
    })
}

/// The columns that [`scan`] reads, of the table `scans` joined as `c`.
pub(super) const SCAN_COLUMNS: &str =
    "c.found AS scan_found, c.stated AS scan_stated, c.erased_at AS scan_erased_at";

/// The identity in a row with [`SCAN_COLUMNS`].
pub(super) fn scan(row: &DbRow) -> StoreResult<ScanIdentity> {
    let fields = |column: &str| -> StoreResult<Option<ScanFields>> {
        let text: Option<&str> = row.try_get(column)?;
        match text {
            Some(_) => Ok(Some(ScanFields(json(row, column)?))),
            None => Ok(None),
        }
    };
    Ok(ScanIdentity {
        found: fields("scan_found")?,
        stated: fields("scan_stated")?,
        erased_at: row.try_get("scan_erased_at")?,
    })
}

/// A receipt and its sequence number.
pub(super) fn receipt(row: DbRow) -> StoreResult<(Receipt, i64)> {
    Ok((json(&row, "receipt")?, row.try_get("sequence")?))
}

fn tags(row: &DbRow) -> StoreResult<Tags> {
    Ok(Tags {
        external_id: row.try_get("external_id")?,
        labels: json(row, "labels")?,
    })
}

/// A number of bytes as a value of a statement.
pub(super) fn bytes_bound(bytes: u64) -> i64 {
    i64::try_from(bytes).unwrap_or(i64::MAX)
}

/// The row of one statement, or else its bytes by another, of which they are the column `bytes`.
pub(super) async fn bounded<T>(
    store: &SqlStore,
    within: Query,
    size: Query,
    record: impl Fn(DbRow) -> StoreResult<T>,
) -> StoreResult<Bounded<T>> {
    if let Some(row) = within.fetch_optional(&store.readers).await? {
        return record(row).map(Bounded::Read);
    }
    Ok(match size.fetch_optional(&store.readers).await? {
        Some(row) => Bounded::Larger(unsigned(row.try_get("bytes")?)),
        None => Bounded::Missing,
    })
}

/// The tenant of a row.
pub(super) fn tenant(row: &DbRow) -> StoreResult<Tenant> {
    let name: String = row.try_get("tenant")?;
    Tenant::try_from(name).map_err(|e| StoreError::database(format!("damaged row: {e}")))
}

/// Converts the rows of a list by `record`.
pub(super) fn all<T>(
    rows: Vec<DbRow>,
    record: impl Fn(DbRow) -> StoreResult<T>,
) -> StoreResult<Vec<T>> {
    rows.into_iter().map(record).collect()
}

/// The plan of a page, from rows of a sequence number and a size, queried with a limit of one more than requested.
pub(super) fn plan(rows: Vec<DbRow>, request: ListRequest) -> StoreResult<PagePlan> {
    let size = |row: DbRow| Ok((row.try_get(0)?, unsigned(row.try_get(1)?)));
    Ok(request.planned(all(rows, size)?))
}

/// A page of a list, from rows queried with a limit of one more than requested.
pub(super) fn page<T>(
    mut rows: Vec<DbRow>,
    request: ListRequest,
    record: impl Fn(DbRow) -> StoreResult<T>,
    sequence: fn(&T) -> i64,
) -> StoreResult<ListPage<T>> {
    // The extra row, which may be large, only tells that there is a next page.
    let more = rows.len() > request.limit as usize;
    rows.truncate(request.limit as usize);
    let items = all(rows, record)?;
    let next = items.last().filter(|_| more).map(sequence);
    Ok(ListPage { items, next })
}

pub(crate) fn to_json(value: &impl Serialize) -> StoreResult<String> {
    serde_json::to_string(value).map_err(|e| StoreError::database(e.to_string()))
}

/// The value of a JSON column.
pub(super) fn json<T: DeserializeOwned>(row: &DbRow, column: &str) -> StoreResult<T> {
    from_json(row.try_get(column)?)
}

/// The value of a JSON column that may be null.
pub(super) fn optional_json<T: DeserializeOwned>(
    row: &DbRow,
    column: &str,
) -> StoreResult<Option<T>> {
    let text: Option<&str> = row.try_get(column)?;
    text.map(from_json).transpose()
}

/// The value of a text column that has a parser of its own.
pub(super) fn parsed<T>(row: &DbRow, column: &str) -> StoreResult<T>
where
    T: std::str::FromStr<Err: std::fmt::Display>,
{
    let text: &str = row.try_get(column)?;
    text.parse()
        .map_err(|e| StoreError::database(format!("damaged row: {e}")))
}

fn from_json<T: DeserializeOwned>(text: &str) -> StoreResult<T> {
    serde_json::from_str(text).map_err(|e| StoreError::database(format!("damaged row: {e}")))
}
