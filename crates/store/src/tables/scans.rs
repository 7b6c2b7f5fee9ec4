//! The table of scans: whose scan each volume is.

use super::access::record;
use super::rows::{self, SCAN_COLUMNS, to_json};
use crate::database::{SqlStore, Transaction};
use crate::query::{QueryBuilder, query};
use async_trait::async_trait;
use ventriform_service::base::records::{
    ScanFields, ScanFilter, ScanIdentity, Scans, StoreResult, Tenant, Timestamp, UnreadScan,
    random_key,
};
use ventriform_service::callers::Activity;

#[async_trait]
impl Scans for SqlStore {
    async fn scan(&self, tenant: &Tenant, volume: &str) -> StoreResult<Option<ScanIdentity>> {
        let row = QueryBuilder::new("SELECT ")
            .push(SCAN_COLUMNS)
            .push(" FROM scans AS c WHERE c.tenant = ")
            .push_bind(tenant.to_string())
            .push(" AND c.volume = ")
            .push_bind(volume.to_owned())
            .build()
            .fetch_optional(&self.readers)
            .await?;
        row.map(|row| rows::scan(&row)).transpose()
    }

    async fn note_scan(
        &self,
        tenant: &Tenant,
        volume: &str,
        found: Option<&ScanFields>,
    ) -> StoreResult<()> {
        query(
            "INSERT INTO scans (tenant, volume, found)
             SELECT tenant, id, $3 FROM holdings WHERE tenant = $1 AND id = $2
             ON CONFLICT (tenant, volume) DO NOTHING",
        )
        .bind(tenant.as_str())
        .bind(volume)
        .bind(found.map(|found| to_json(&found.0)).transpose()?)
        .write(&self.writer)
        .await?;
        Ok(())
    }

    async fn state_scan(
        &self,
        tenant: &Tenant,
        volume: &str,
        stated: &ScanFields,
    ) -> StoreResult<bool> {
        let mut transaction = self.writer.begin().await?;
        let changed = query(
            "INSERT INTO scans (tenant, volume, stated)
             SELECT tenant, id, $3 FROM holdings
             WHERE tenant = $1 AND id = $2 AND kind = 'volume'
             ON CONFLICT (tenant, volume) DO UPDATE SET stated = excluded.stated",
        )
        .erasing()
        .bind(tenant.as_str())
        .bind(volume)
        .bind(to_json(&stated.0)?)
        .execute(&mut transaction)
        .await?;
        if changed == 1 {
            record(&mut transaction, Activity::Update, volume).await?;
        }
        transaction.commit().await?;
        Ok(changed == 1)
    }

    async fn erase_scan(&self, tenant: &Tenant, volume: &str, now: Timestamp) -> StoreResult<bool> {
        self.making_room(|| self.erase_scan_once(tenant, volume, now))
            .await
    }

    async fn unread_scans(&self, after: i64, limit: u32) -> StoreResult<Vec<UnreadScan>> {
        let rows = query(
            "SELECT h.sequence, h.tenant, h.id, v.files
             FROM holdings AS h JOIN volumes AS v ON v.id = h.id
             LEFT JOIN scans AS c ON c.tenant = h.tenant AND c.volume = h.id
             WHERE c.volume IS NULL AND h.sequence > $1 ORDER BY h.sequence LIMIT $2",
        )
        .bind(after)
        .bind(limit)
        .fetch_all(&self.readers)
        .await?;
        rows::all(rows, |row| {
            Ok(UnreadScan {
                sequence: row.try_get("sequence")?,
                tenant: rows::tenant(&row)?,
                volume: row.try_get("id")?,
                files: rows::json(&row, "files")?,
            })
        })
    }

    async fn deidentification_secret(&self, tenant: &Tenant) -> StoreResult<Vec<u8>> {
        let known = async || {
            let row = query("SELECT secret FROM deidentification_secrets WHERE tenant = $1")
                .bind(tenant.as_str())
                .fetch_optional(&self.readers)
                .await?;
            row.map(|row| row.try_get::<Vec<u8>, _>(0)).transpose()
        };
        if let Some(secret) = known().await? {
            return Ok(secret);
        }
        query(
            "INSERT INTO deidentification_secrets (tenant, secret) VALUES ($1, $2)
             ON CONFLICT DO NOTHING",
        )
        .bind(tenant.as_str())
        .bind(&random_key()[..])
        .write(&self.writer)
        .await?;
        Ok(known().await?.unwrap_or_default())
    }
}

impl SqlStore {
    /// Tries the erasure of the method without `_once`.
    async fn erase_scan_once(
        &self,
        tenant: &Tenant,
        volume: &str,
        now: Timestamp,
    ) -> StoreResult<bool> {
        let mut transaction = self.writer.begin().await?;
        let changed = query(
            "INSERT INTO scans (tenant, volume, erased_at)
             SELECT tenant, id, $3 FROM holdings
             WHERE tenant = $1 AND id = $2 AND kind = 'volume' AND held_at IS NULL
             ON CONFLICT (tenant, volume) DO UPDATE SET
                 found = NULL, stated = NULL, erased_at = coalesce(scans.erased_at, excluded.erased_at)",
        )
        .erasing()
        .bind(tenant.as_str())
        .bind(volume)
        .bind(now)
        .execute(&mut transaction)
        .await?;
        if changed == 1 {
            record(&mut transaction, Activity::Delete, volume).await?;
        }
        transaction.commit().await?;
        Ok(changed == 1)
    }
}

/// Notes what the file of a volume says that the tenant just uploaded: this ends an erasure.
pub(super) async fn note_upload(
    to: &mut Transaction<'_>,
    tenant: &Tenant,
    volume: &str,
    found: Option<&ScanFields>,
) -> StoreResult<()> {
    query(
        "INSERT INTO scans (tenant, volume, found) VALUES ($1, $2, $3)
         ON CONFLICT (tenant, volume) DO UPDATE SET found = excluded.found, erased_at = NULL
         WHERE scans.erased_at IS NOT NULL",
    )
    .bind(tenant.as_str())
    .bind(volume)
    .bind(found.map(|found| to_json(&found.0)).transpose()?)
    .execute(to)
    .await?;
    Ok(())
}

/// Adds the conditions of a filter to a query whose column `sequence` has that prefix. `listed` is the table that is
/// listed, as `x`, and how its rows belong to the scans `c`. The scans are few, and are looked up first: a join whose
/// order is left to SQLite may begin with all rows of the tenant.
pub(super) fn push_scan(
    query: &mut QueryBuilder,
    (prefix, listed): (&str, &str),
    tenant: &Tenant,
    filter: &ScanFilter,
) {
    if *filter == ScanFilter::default() {
        return;
    }
    let columns = [
        ("study_uid", "scans_by_study", &filter.study),
        ("series_uid", "scans_by_series", &filter.series),
        ("accession_number", "scans_by_accession", &filter.accession),
    ];
    let given = columns
        .iter()
        .filter_map(|(column, index, value)| Some((column, index, value.as_ref()?)));
    query.push(" AND ").push(prefix);
    query.push("sequence IN (SELECT x.sequence FROM scans AS c");
    // SQLite takes the key, of which the tenant alone is given, for as good as these indexes.
    if let Some((_, index, _)) = given.clone().next() {
        query.push_sqlite(" INDEXED BY ").push_sqlite(index);
    }
    query.push(" CROSS JOIN ").push(listed);
    query.push(" AND c.tenant = ").push_bind(tenant.to_string());
    for (column, _, value) in given {
        query.push(" AND c.").push(column).push(" = ");
        query.push_bind(value.clone());
    }
    query.push(")");
}
