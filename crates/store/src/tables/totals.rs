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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::DiskGauge;
    use std::time::Duration;

    /// What a trigger reads is read again at every write, so none of it may be more the more is stored.
    #[tokio::test]
    async fn the_owners_of_what_is_counted_are_found_by_its_id() {
        let folder = tempfile::tempdir().unwrap();
        let gauge = DiskGauge::new(folder.path(), None);
        let path = folder.path().join("totals.db");
        let store = SqlStore::open(&path, Duration::from_secs(1), gauge).await;
        let store = store.unwrap();
        let triggers =
            "SELECT sql FROM sqlite_schema WHERE type = 'trigger' AND sql LIKE '%stored_bytes%'";
        let triggers = query(triggers).fetch_all(&store.readers).await.unwrap();
        let triggers: Vec<String> = rows::all(triggers, |row| row.try_get(0)).unwrap();
        let owners = |text: &str| -> Vec<String> {
            let found = text.split("SELECT tenant").skip(1);
            let found = found.filter_map(|rest| rest.split_once(" FROM holdings WHERE "));
            let ends = |c: char| c == ')' || c == '\n' || c == ';';
            let conditions = found.filter_map(|(_, rest)| rest.split(ends).next());
            conditions
                .map(|text| text.replace("NEW.id", "'x'").replace("OLD.id", "'x'"))
                .collect()
        };
        let conditions: Vec<String> = triggers.iter().flat_map(|text| owners(text)).collect();
        assert_eq!(conditions.len(), 6, "{conditions:#?}");
        for condition in conditions {
            let plan = format!("EXPLAIN QUERY PLAN SELECT tenant FROM holdings WHERE {condition}");
            let plan = query(plan).fetch_all(&store.readers).await.unwrap();
            let plan: Vec<String> = rows::all(plan, |row| row.try_get("detail")).unwrap();
            assert_eq!(
                plan,
                ["SEARCH holdings USING INDEX holdings_by_item (id=?)"],
                "{condition}"
            );
        }
        store.close().await;
    }
}
