//! Who has an item, when a repair finds that rows about it are lost.
//!
//! A repair gives an item to nobody who is not known to have had it: to those whom other rows name, else to the heir
//! that the operator names, else to nobody. Whether a volume of theirs was on legal hold is not known any more, so it
//! is: such a hold is lifted as any other, by name.

use super::access::append;
use super::catalogue::{insert_content, volumes_of};
use super::rows::{self, to_json};
use crate::database::{SqlStore, Transaction};
use crate::query::query;
use serde::{Deserialize, Serialize};
use ventriform_service::base::records::{
    ItemRecord, Product, Resource, StoreResult, StoredVolume, Tenant, Timestamp,
};
use ventriform_service::callers::{Activity, AuditEvent};

/// The reason of a legal hold in doubt.
const HOLD_IN_DOUBT: &str = "In doubt: a repair of the storage lost the record of who has this volume, and whether it \
     was on legal hold. Lift the hold if it was not.";

/// Who sets it.
pub(crate) const REPAIRER: &str = "ventriform doctor";

/// That a tenant had an item.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Holder {
    /// The tenant.
    pub tenant: Tenant,
    /// The item.
    pub id: String,
}

/// How a tenant had an item that was set aside: what is written beside its files, to give it back.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Holding {
    tenant: Tenant,
    created_at: Timestamp,
    renewed_at: Timestamp,
    external_id: Option<String>,
    labels: String,
    hold_reason: Option<String>,
    held_at: Option<Timestamp>,
    held_by: Option<String>,
    library: bool,
}

impl Holding {
    /// Whether a legal hold keeps the item.
    pub fn is_on_hold(&self) -> bool {
        self.held_at.is_some()
    }
}

impl SqlStore {
    /// How tenants have an item.
    pub(crate) async fn holdings(&self, id: &str) -> StoreResult<Vec<Holding>> {
        let rows = query(
            "SELECT tenant, created_at, renewed_at, external_id, labels, hold_reason, held_at, held_by, library
             FROM holdings WHERE id = $1 ORDER BY sequence",
        )
        .bind(id)
        .fetch_all(&self.readers)
        .await?;
        rows::all(rows, |row| {
            Ok(Holding {
                tenant: rows::tenant(&row)?,
                created_at: row.try_get("created_at")?,
                renewed_at: row.try_get("renewed_at")?,
                external_id: row.try_get("external_id")?,
                labels: row.try_get("labels")?,
                hold_reason: row.try_get("hold_reason")?,
                held_at: row.try_get("held_at")?,
                held_by: row.try_get("held_by")?,
                library: row.try_get("library")?,
            })
        })
    }

    /// Removes the row of an item, and every ownership of it, with a row of the trail for each tenant at that time.
    /// With `None` there is no such row: in a copy, whose trail stays that of the original. Does not record an erasure.
    pub(crate) async fn forget(&self, id: &str, now: Option<Timestamp>) -> StoreResult<()> {
        let mut transaction = self.writer.begin().await?;
        let mut removed = 0;
        for statement in [
            "DELETE FROM volumes WHERE id = $1",
            "DELETE FROM products WHERE id = $1",
            "DELETE FROM sources WHERE id = $1",
            "DELETE FROM scans WHERE volume = $1",
        ] {
            removed += query(statement).bind(id).execute(&mut transaction).await?;
        }
        let holders = query("DELETE FROM holdings WHERE id = $1 RETURNING tenant")
            .bind(id)
            .fetch_all(&mut transaction)
            .await?;
        if let Some(now) = now {
            let holders = rows::all(holders, |row| rows::tenant(&row))?;
            let mut events: Vec<AuditEvent> = holders
                .iter()
                .map(|tenant| repaired(id, Some(tenant), now))
                .collect();
            if events.is_empty() && removed > 0 {
                events.push(repaired(id, None, now));
            }
            append(&mut transaction, &events).await?;
        }
        transaction.commit().await
    }

    /// Makes the row of an item anew, with a row of the trail. It belongs to those who had it when it was set aside;
    /// unless somebody has the item, `heir` does from now on, with a legal hold in doubt. Does nothing and returns
    /// `false` if nobody has it and there is no heir.
    pub(crate) async fn restore(
        &self,
        record: &ItemRecord,
        (held, heir): (&[Holding], Option<&Tenant>),
        now: Timestamp,
    ) -> StoreResult<bool> {
        let id = record.id();
        let mut transaction = self.writer.begin().await?;
        give_held(&mut transaction, id, held).await?;
        if !is_held(&mut transaction, id).await? {
            let Some(heir) = heir else {
                transaction.commit().await?;
                return Ok(false);
            };
            let holder = Holder {
                tenant: heir.clone(),
                id: id.to_owned(),
            };
            give(&mut transaction, &holder, now).await?;
        }
        match record {
            ItemRecord::Volume(volume) => insert_volume(&mut transaction, volume).await?,
            ItemRecord::Product(product) => {
                insert_content(&mut transaction, product).await?;
                note_sources(&mut transaction, product).await?;
            }
        }
        append(&mut transaction, &[repaired(id, heir, now)]).await?;
        transaction.commit().await?;
        Ok(true)
    }

    /// Whether anybody has the item.
    pub(crate) async fn has_holder(&self, id: &str) -> StoreResult<bool> {
        let row = query("SELECT 1 FROM holdings WHERE id = $1 LIMIT 1")
            .bind(id)
            .fetch_optional(&self.readers)
            .await?;
        Ok(row.is_some())
    }

    /// Notes again what a product was made of, for everybody who has it.
    pub(crate) async fn restore_sources(&self, product: &Product) -> StoreResult<()> {
        let mut transaction = self.writer.begin().await?;
        note_sources(&mut transaction, product).await?;
        transaction.commit().await
    }

    /// Gives items to those who had them, with a legal hold in doubt on volumes and a row of the trail for each.
    pub(crate) async fn give_back(&self, holders: &[Holder], now: Timestamp) -> StoreResult<()> {
        let mut transaction = self.writer.begin().await?;
        for holder in holders {
            give(&mut transaction, holder, now).await?;
            let event = repaired(&holder.id, Some(&holder.tenant), now);
            append(&mut transaction, &[event]).await?;
        }
        transaction.commit().await
    }

    /// Items with a row that nobody has.
    pub(crate) async fn unowned(&self) -> StoreResult<Vec<String>> {
        let rows = query(
            "SELECT id FROM volumes
             WHERE NOT EXISTS (SELECT 1 FROM holdings WHERE holdings.id = volumes.id)
             UNION ALL SELECT id FROM products
             WHERE NOT EXISTS (SELECT 1 FROM holdings WHERE holdings.id = products.id)",
        )
        .fetch_all(&self.readers)
        .await?;
        rows::all(rows, |row| row.try_get(0))
    }

    /// Who has an item that has no row.
    pub(crate) async fn without_item(&self) -> StoreResult<Vec<Holder>> {
        let rows = query(
            "SELECT tenant, id FROM holdings
             WHERE NOT EXISTS (SELECT 1 FROM volumes WHERE volumes.id = holdings.id)
               AND NOT EXISTS (SELECT 1 FROM products WHERE products.id = holdings.id)
             ORDER BY sequence",
        )
        .fetch_all(&self.readers)
        .await?;
        rows::all(rows, holder)
    }

    /// Who had items, as rows tell that go with the ownership: whose scan a volume is, and what a product was made of.
    pub(crate) async fn traces_of_holders(&self) -> StoreResult<Vec<Holder>> {
        let rows = query(
            "SELECT tenant, id FROM (
                 SELECT tenant, volume AS id FROM scans UNION SELECT tenant, id FROM sources) AS named
             WHERE NOT EXISTS (SELECT 1 FROM holdings
                               WHERE holdings.tenant = named.tenant AND holdings.id = named.id)",
        )
        .fetch_all(&self.readers)
        .await?;
        rows::all(rows, holder)
    }

    /// Records again what receipts say was erased, unless its tenant has it again. Returns how many records were lost.
    pub(crate) async fn restore_tombstones(&self) -> StoreResult<u64> {
        let receipts = query("SELECT receipt, sequence FROM erasures ORDER BY sequence")
            .fetch_all(&self.readers)
            .await?;
        let mut transaction = self.writer.begin().await?;
        let mut made = 0;
        for (receipt, _) in rows::all(receipts, rows::receipt)? {
            let items = receipt.items.into_iter().map(|item| item.id);
            for id in items.chain(receipt.jobs) {
                made += query(
                    "INSERT INTO erased (tenant, id, erased_at)
                     SELECT CAST($1 AS TEXT), CAST($2 AS TEXT), CAST($3 AS BIGINT)
                     WHERE NOT EXISTS (SELECT 1 FROM holdings WHERE tenant = $1 AND id = $2)
                     ON CONFLICT DO NOTHING",
                )
                .bind(receipt.tenant.as_str())
                .bind(&id)
                .bind(receipt.erased_at)
                .execute(&mut transaction)
                .await?;
            }
        }
        transaction.commit().await?;
        Ok(made)
    }
}

/// The event about the repair of an item.
pub(crate) fn repaired(id: &str, tenant: Option<&Tenant>, now: Timestamp) -> AuditEvent {
    let tenant = tenant.cloned().unwrap_or_default();
    AuditEvent::new(now, Activity::Repaired, tenant, REPAIRER.into()).on(id)
}

/// Gives an item that was set aside back to those who had it.
async fn give_held(to: &mut Transaction<'_>, id: &str, holdings: &[Holding]) -> StoreResult<()> {
    let kind = Resource::from_id(id).unwrap_or(Resource::Volume);
    for held in holdings {
        query(
            "INSERT INTO holdings (tenant, id, kind, created_at, renewed_at, external_id, labels, hold_reason,
                                   held_at, held_by, library)
             VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11) ON CONFLICT DO NOTHING",
        )
        .bind(held.tenant.as_str())
        .bind(id)
        .bind(kind.noun())
        .bind(held.created_at)
        .bind(held.renewed_at)
        .bind(&held.external_id)
        .bind(&held.labels)
        .bind(&held.hold_reason)
        .bind(held.held_at)
        .bind(&held.held_by)
        .bind(held.library)
        .execute(&mut *to)
        .await?;
    }
    Ok(())
}

fn holder(row: crate::query::DbRow) -> StoreResult<Holder> {
    Ok(Holder {
        tenant: rows::tenant(&row)?,
        id: row.try_get("id")?,
    })
}

async fn is_held(from: &mut Transaction<'_>, id: &str) -> StoreResult<bool> {
    let row = query("SELECT 1 FROM holdings WHERE id = $1 LIMIT 1")
        .bind(id)
        .fetch_optional(from)
        .await?;
    Ok(row.is_some())
}

async fn give(to: &mut Transaction<'_>, holder: &Holder, now: Timestamp) -> StoreResult<()> {
    let kind = Resource::from_id(&holder.id).unwrap_or(Resource::Volume);
    let on_hold = kind == Resource::Volume;
    query(
        "INSERT INTO holdings (tenant, id, kind, created_at, renewed_at, hold_reason, held_at, held_by)
         VALUES ($1, $2, $3, $4, $4, $5, $6, $7) ON CONFLICT DO NOTHING",
    )
    .bind(holder.tenant.as_str())
    .bind(&holder.id)
    .bind(kind.noun())
    .bind(now)
    .bind(on_hold.then_some(HOLD_IN_DOUBT))
    .bind(on_hold.then_some(now))
    .bind(on_hold.then_some(REPAIRER))
    .execute(to)
    .await?;
    Ok(())
}

async fn insert_volume(to: &mut Transaction<'_>, volume: &StoredVolume) -> StoreResult<()> {
    query(
        "INSERT INTO volumes (id, created_at, bytes, files, facts) VALUES ($1, $2, $3, $4, $5)
         ON CONFLICT (id) DO UPDATE SET files = excluded.files, facts = excluded.facts",
    )
    .bind(&volume.id)
    .bind(volume.created_at)
    .bind(rows::bytes_bound(volume.bytes))
    .bind(to_json(&volume.files)?)
    .bind(to_json(&volume.facts)?)
    .execute(to)
    .await?;
    Ok(())
}

/// Notes what a product was made of, for everybody who has it.
async fn note_sources(to: &mut Transaction<'_>, product: &Product) -> StoreResult<()> {
    for volume in volumes_of(product) {
        query(
            "INSERT INTO sources (tenant, id, volume)
             SELECT tenant, id, CAST($2 AS TEXT) FROM holdings WHERE id = $1 ON CONFLICT DO NOTHING",
        )
        .bind(&product.id)
        .bind(volume)
        .execute(&mut *to)
        .await?;
    }
    Ok(())
}
