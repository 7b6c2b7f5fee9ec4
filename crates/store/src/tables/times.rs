//! The times that outlive a process.

use crate::database::SqlStore;
use crate::query::query;
use async_trait::async_trait;
use ventriform_service::base::records::{StoreResult, TimeStore, Timestamp, TrustedNow};

#[async_trait]
impl TimeStore for SqlStore {
    async fn server_time(&self) -> StoreResult<Option<Timestamp>> {
        if !self.on_server() {
            return Ok(None);
        }
        let row = query("SELECT database_now()").fetch_one(&self.readers);
        row.await?.try_get(0)
    }

    async fn last_trusted(&self) -> StoreResult<Option<Timestamp>> {
        let noted = query("SELECT at FROM trusted_time")
            .fetch_optional(&self.readers)
            .await?;
        if let Some(row) = noted {
            return row.try_get(0);
        }
        // Nothing is noted: the newest stamp of a row stands for it.
        let row = query(
            "SELECT max(at) FROM (
                 SELECT (SELECT created_at FROM jobs ORDER BY sequence DESC LIMIT 1) AS at
                 UNION ALL SELECT (SELECT max(finished_at) FROM jobs WHERE finished_at IS NOT NULL)
                 UNION ALL SELECT (SELECT max(renewed_at) FROM holdings)
                 UNION ALL SELECT (SELECT max(changed_at) FROM intake_groups)
                 UNION ALL SELECT (SELECT max(changed_at) FROM workitems)
                 UNION ALL SELECT (SELECT recorded FROM audit ORDER BY sequence DESC LIMIT 1)
             ) AS moments",
        )
        .fetch_one(&self.readers)
        .await?;
        row.try_get(0)
    }

    async fn note_trusted(&self, now: TrustedNow) -> StoreResult<()> {
        query(
            "INSERT INTO trusted_time (id, at) VALUES (1, $1)
             ON CONFLICT (id) DO UPDATE SET at = excluded.at RETURNING id",
        )
        .bind(now.moment())
        .write_beside(&self.writer)
        .await?;
        Ok(())
    }
}
