//! The tables of webhooks. Deliveries are written by a trigger of the jobs table; see the
//! migration.

use super::access::record;
use super::errands::{self, Errands};
use super::rows;
use crate::database::{SqlStore, Transaction};
use crate::query::{DbRow, query};
use async_trait::async_trait;
use ventriform_service::base::records::{StoreResult, Tenant, Timestamp};
use ventriform_service::callers::Activity;
use ventriform_service::network::hooks::{
    AttemptOutcome, Backlog, Delivery, DeliveryLimits, DeliveryState, DeliveryStore, DueDelivery,
    HookEndpoint, HookEvent, Lane, Settlement, SigningSecret,
};

/// `last_outcome` of deliveries that were given up without an attempt.
const TOO_OLD: &str = "too-old";
const TOO_MANY: &str = "too-many";
const ENDPOINT_REMOVED: &str = "endpoint-removed";

/// How the audit trail names the signing secret of a tenant.
const SECRET_OBJECT: &str = "webhooks/secret";

#[async_trait]
impl DeliveryStore for SqlStore {
    async fn delivery_lanes(&self) -> StoreResult<Vec<(Lane, Timestamp)>> {
        self.lanes_of(Errands::Deliveries).await
    }

    async fn due_deliveries(
        &self,
        lane: &Lane,
        now: Timestamp,
        limit: usize,
    ) -> StoreResult<Vec<DueDelivery>> {
        let rows = query(
            "SELECT d.*, e.secret AS endpoint_secret, s.secret AS tenant_secret,
                    CASE WHEN s.former_until > $2 THEN s.former END AS former_secret
             FROM deliveries AS d
             LEFT JOIN webhook_endpoints AS e ON e.id = d.endpoint
             LEFT JOIN webhook_secrets AS s ON s.tenant = d.tenant
             WHERE d.state = 'pending' AND d.destination = $1 AND d.next_attempt_at <= $2
                 AND d.tenant = $4
             ORDER BY d.next_attempt_at LIMIT $3",
        )
        .bind(&lane.destination)
        .bind(now)
        .bind(i64::try_from(limit).unwrap_or(i64::MAX))
        .bind(lane.tenant.as_str())
        .fetch_all(&self.readers)
        .await?;
        rows::all(rows, due_delivery)
    }

    async fn begun(&self, id: &str, now: Timestamp) -> StoreResult<()> {
        self.errand_begun(Errands::Deliveries, id, now).await
    }

    async fn settle(&self, id: &str, settled: Settlement, now: Timestamp) -> StoreResult<()> {
        let state = match (settled.outcome, settled.again_at) {
            (AttemptOutcome::Delivered(_), _) => DeliveryState::Delivered,
            (_, Some(_)) => DeliveryState::Pending,
            (_, None) => DeliveryState::Dead,
        };
        let ended = (state != DeliveryState::Pending).then_some(now);
        let mut transaction = self.writer.begin().await?;
        query(
            "UPDATE deliveries SET state = $1, last_attempt_at = $2, last_status = $3,
                    last_outcome = $4, ended_at = $5,
                    next_attempt_at = coalesce($6, next_attempt_at), attempts = attempts - $8
             WHERE id = $7 AND state = 'pending'",
        )
        .bind(state.as_str())
        .bind(now)
        .bind(settled.outcome.status())
        .bind(settled.outcome.as_str())
        .bind(ended)
        .bind(settled.again_at)
        .bind(id)
        .bind(errands::taken_back(settled.counts))
        .execute(&mut transaction)
        .await?;
        if settled.outcome == AttemptOutcome::Gone {
            let endpoint: Option<String> = query(
                "UPDATE webhook_endpoints SET gone_at = $1
                 WHERE id = (SELECT endpoint FROM deliveries WHERE id = $2) RETURNING id",
            )
            .bind(now)
            .bind(id)
            .fetch_optional(&mut transaction)
            .await?
            .map(|row| row.try_get(0))
            .transpose()?;
            if let Some(endpoint) = endpoint {
                give_up(&mut transaction, &endpoint, settled.outcome.as_str(), now).await?;
            }
        }
        transaction.commit().await?;
        Ok(())
    }

    async fn recall_deliveries(&self, now: Timestamp) -> StoreResult<u64> {
        self.recall(Errands::Deliveries, now).await
    }

    async fn expire(&self, limits: DeliveryLimits, now: Timestamp) -> StoreResult<u64> {
        let mut transaction = self.writer.begin().await?;
        let mut old = 0;
        if let Some(before) = limits.pending_since {
            old = query(
                "UPDATE deliveries SET state = 'dead', ended_at = $1,
                        last_outcome = coalesce(last_outcome, $2)
                 WHERE state = 'pending' AND since < $3",
            )
            .bind(now)
            .bind(TOO_OLD)
            .bind(before.moment())
            .execute(&mut transaction)
            .await?;
        }
        let many = query(
            "UPDATE deliveries SET state = 'dead', ended_at = $1,
                    last_outcome = coalesce(last_outcome, $2)
             WHERE sequence IN (
                 SELECT sequence FROM (
                     SELECT sequence, row_number() OVER
                         (PARTITION BY tenant, destination ORDER BY since DESC, sequence DESC) AS place
                     FROM deliveries WHERE state = 'pending') AS ranked
                 WHERE place > $3)",
        )
        .bind(now)
        .bind(TOO_MANY)
        .bind(limits.backlog)
        .execute(&mut transaction)
        .await?;
        if let Some(before) = limits.ended_since {
            query("DELETE FROM deliveries WHERE state != 'pending' AND ended_at < $1")
                .bind(before.moment())
                .execute(&mut transaction)
                .await?;
        }
        transaction.commit().await?;
        Ok(old + many)
    }

    async fn backlog(&self) -> StoreResult<Backlog> {
        self.backlog_of(Errands::Deliveries).await
    }

    async fn deliveries(
        &self,
        tenant: &Tenant,
        job: &str,
        limit: u32,
    ) -> StoreResult<Vec<Delivery>> {
        let rows = query(
            "SELECT * FROM deliveries WHERE job = $1 AND tenant = $2
             ORDER BY sequence DESC LIMIT $3",
        )
        .bind(job)
        .bind(tenant.as_str())
        .bind(limit)
        .fetch_all(&self.readers)
        .await?;
        rows::all(rows, delivery)
    }

    async fn redeliver(
        &self,
        tenant: &Tenant,
        job: &str,
        id: &str,
        now: Timestamp,
    ) -> StoreResult<Option<Delivery>> {
        let row = self
            .run_again(Errands::Deliveries, (tenant, job, id), now)
            .await?;
        row.map(delivery).transpose()
    }

    async fn add_endpoint(
        &self,
        endpoint: &HookEndpoint,
        secret: &SigningSecret,
        limit: u32,
    ) -> StoreResult<bool> {
        let events: Vec<&str> = endpoint.events.iter().map(|e| e.as_str()).collect();
        let mut transaction = self.writer.begin().await?;
        let done = query(
            "INSERT INTO webhook_endpoints (id, tenant, created_at, url, destination, events, secret)
             SELECT $1, $2, $3, $4, $5, $6, $7
             WHERE (SELECT count(*) FROM webhook_endpoints WHERE tenant = $2) < $8",
        )
        .bind(&endpoint.id)
        .bind(endpoint.tenant.as_str())
        .bind(endpoint.created_at)
        .bind(&endpoint.url)
        .bind(&endpoint.destination)
        .bind(rows::to_json(&events)?)
        .bind(secret.reveal())
        .bind(limit)
        .execute(&mut transaction)
        .await?;
        if done > 0 {
            record(&mut transaction, Activity::Create, &endpoint.id).await?;
        }
        transaction.commit().await?;
        Ok(done > 0)
    }

    async fn endpoints(&self, tenant: &Tenant) -> StoreResult<Vec<HookEndpoint>> {
        let rows = query("SELECT * FROM webhook_endpoints WHERE tenant = $1 ORDER BY sequence")
            .bind(tenant.as_str())
            .fetch_all(&self.readers)
            .await?;
        rows::all(rows, endpoint)
    }

    async fn remove_endpoint(
        &self,
        tenant: &Tenant,
        id: &str,
        now: Timestamp,
    ) -> StoreResult<bool> {
        let mut transaction = self.writer.begin().await?;
        let done = query("DELETE FROM webhook_endpoints WHERE id = $1 AND tenant = $2")
            .bind(id)
            .bind(tenant.as_str())
            .execute(&mut transaction)
            .await?;
        let removed = done > 0;
        if removed {
            give_up(&mut transaction, id, ENDPOINT_REMOVED, now).await?;
            record(&mut transaction, Activity::Delete, id).await?;
        }
        transaction.commit().await?;
        Ok(removed)
    }

    async fn signing_secret(
        &self,
        tenant: &Tenant,
        fresh: &SigningSecret,
    ) -> StoreResult<SigningSecret> {
        let mut transaction = self.writer.begin().await?;
        query(
            "INSERT INTO webhook_secrets (tenant, secret) VALUES ($1, $2)
             ON CONFLICT (tenant) DO NOTHING",
        )
        .bind(tenant.as_str())
        .bind(fresh.reveal())
        .execute(&mut transaction)
        .await?;
        let row = query("SELECT secret FROM webhook_secrets WHERE tenant = $1")
            .bind(tenant.as_str())
            .fetch_one(&mut transaction)
            .await?;
        transaction.commit().await?;
        let stored: &str = row.try_get(0)?;
        Ok(stored.parse().unwrap_or_else(|_| fresh.clone()))
    }

    async fn replace_secret(
        &self,
        tenant: &Tenant,
        fresh: &SigningSecret,
        former_until: Timestamp,
    ) -> StoreResult<()> {
        let mut transaction = self.writer.begin().await?;
        query(
            "INSERT INTO webhook_secrets (tenant, secret) VALUES ($1, $2)
             ON CONFLICT (tenant) DO UPDATE SET former = webhook_secrets.secret, former_until = $3, secret = $2",
        )
        .erasing()
        .bind(tenant.as_str())
        .bind(fresh.reveal())
        .bind(former_until)
        .execute(&mut transaction)
        .await?;
        record(&mut transaction, Activity::Update, SECRET_OBJECT).await?;
        transaction.commit().await?;
        Ok(())
    }
}

/// Gives up what an endpoint has not been told.
async fn give_up(
    connection: &mut Transaction<'_>,
    endpoint: &str,
    why: &str,
    now: Timestamp,
) -> StoreResult<()> {
    query(
        "UPDATE deliveries SET state = 'dead', ended_at = $1, last_outcome = $2
         WHERE endpoint = $3 AND state = 'pending'",
    )
    .bind(now)
    .bind(why)
    .bind(endpoint)
    .execute(connection)
    .await?;
    Ok(())
}

fn due_delivery(row: DbRow) -> StoreResult<DueDelivery> {
    let secret = |column: &str| -> StoreResult<Option<SigningSecret>> {
        let text: Option<&str> = row.try_get(column)?;
        Ok(text.and_then(|text| text.parse().ok()))
    };
    let own = secret("secret")?.or(secret("endpoint_secret")?);
    let secrets = match own {
        Some(own) => vec![own],
        None => [secret("tenant_secret")?, secret("former_secret")?]
            .into_iter()
            .flatten()
            .collect(),
    };
    Ok(DueDelivery {
        id: row.try_get("id")?,
        tenant: rows::tenant(&row)?,
        job: row.try_get("job")?,
        url: row.try_get("url")?,
        secrets,
        event: event(row.try_get("event")?),
        kind: row.try_get("kind")?,
        result: row.try_get("result")?,
        cause: row.try_get("cause")?,
        run: rows::count(&row, "run")?,
        occurred_at: row.try_get("occurred_at")?,
        attempts: rows::count(&row, "attempts")?,
        since: row.try_get("since")?,
    })
}

fn delivery(row: DbRow) -> StoreResult<Delivery> {
    let state = errands::state(&row)?;
    let last_status: Option<i64> = row.try_get("last_status")?;
    Ok(Delivery {
        id: row.try_get("id")?,
        job: row.try_get("job")?,
        endpoint: row.try_get("endpoint")?,
        url: row.try_get("url")?,
        event: event(row.try_get("event")?),
        state,
        attempts: rows::count(&row, "attempts")?,
        occurred_at: row.try_get("occurred_at")?,
        next_attempt_at: errands::next_attempt(&row, state)?,
        last_attempt_at: row.try_get("last_attempt_at")?,
        last_status: last_status.and_then(|status| u16::try_from(status).ok()),
        last_outcome: row.try_get("last_outcome")?,
    })
}

fn endpoint(row: DbRow) -> StoreResult<HookEndpoint> {
    let events: Vec<String> = rows::json(&row, "events")?;
    Ok(HookEndpoint {
        id: row.try_get("id")?,
        tenant: rows::tenant(&row)?,
        created_at: row.try_get("created_at")?,
        url: row.try_get("url")?,
        destination: row.try_get("destination")?,
        events: events.iter().filter_map(|e| HookEvent::parse(e)).collect(),
        gone_at: row.try_get("gone_at")?,
    })
}

/// The event of that name; the trigger writes no others.
fn event(name: &str) -> HookEvent {
    HookEvent::parse(name).unwrap_or(HookEvent::Failed)
}
