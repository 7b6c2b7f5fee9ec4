//! The running totals of what is stored: `migrations/0002_totals.sql`. Triggers keep them; here they are compared with
//! the sums that they stand for, and made anew.

use super::rows;
use crate::database::SqlStore;
use crate::query::query;
use ventriform_service::base::records::StoreResult;

/// Makes the totals anew from the rows that they are about.
pub(crate) const RECOUNT: [&str; 4] = [
    "DELETE FROM stored_bytes",
    "INSERT INTO stored_bytes (tenant, bytes) SELECT tenant, sum(bytes) FROM stored GROUP BY tenant",
    "DELETE FROM stored_items",
    "INSERT INTO stored_items (kind, items)
         SELECT 'volume', count(*) FROM volumes UNION ALL SELECT kind, count(*) FROM products GROUP BY kind",
];

/// The totals that are not the sums. A row that is missing says 0.
const WRONG_TOTALS: &str = "
    SELECT 'the bytes of tenant ' || subject AS what, CAST(sum(kept) AS BIGINT) AS kept,
           CAST(sum(counted) AS BIGINT) AS counted
    FROM (SELECT tenant AS subject, bytes AS kept, 0 AS counted FROM stored_bytes
          UNION ALL SELECT tenant, 0, bytes FROM stored) AS of_tenants
    GROUP BY subject HAVING sum(kept) != sum(counted)
    UNION ALL
    SELECT 'the items of kind ' || subject, CAST(sum(kept) AS BIGINT), CAST(sum(counted) AS BIGINT)
    FROM (SELECT kind AS subject, items AS kept, 0 AS counted FROM stored_items
          UNION ALL SELECT 'volume', 0, 1 FROM volumes
          UNION ALL SELECT kind, 0, 1 FROM products) AS of_kinds
    GROUP BY subject HAVING sum(kept) != sum(counted)
    ORDER BY what";

impl SqlStore {
    /// The running totals that differ from what they stand for, each as a sentence. Empty in a sound database.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn wrong_totals(&self) -> StoreResult<Vec<String>> {
        let found = query(WRONG_TOTALS).fetch_all(&self.readers).await?;
        rows::all(found, |row| {
            let what: String = row.try_get("what")?;
            let (kept, counted): (i64, i64) = (row.try_get("kept")?, row.try_get("counted")?);
            Ok(format!(
                "The total says {kept} for {what}, and there are {counted}."
            ))
        })
    }

    /// Makes the running totals anew.
    pub(crate) async fn recount(&self) -> StoreResult<()> {
        let mut transaction = self.writer.begin().await?;
        for statement in RECOUNT {
            query(statement).execute(&mut transaction).await?;
        }
        transaction.commit().await
    }
}
