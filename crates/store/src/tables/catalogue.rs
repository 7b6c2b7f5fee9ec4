//! The tables of volumes and products, and the table of holdings that says which tenant
//! has which of them.

use super::access::{record, stored_bytes};
use super::erasure::forget_deletion;
use super::pages::{push_page, push_tags};
use super::rows::{self, SCAN_COLUMNS, to_json};
use super::scans::{note_upload, push_scan};
use crate::database::{SqlStore, Transaction};
use crate::query::{Query, QueryBuilder, query};
use async_trait::async_trait;
use ventriform_service::base::records::{
    AddedProduct, Bounded, Catalogue, Cutoff, Erased, ErasureOrder, Expired, ItemFilter, LegalHold,
    ListPage, ListRequest, Owned, PagePlan, Product, ProductRoom, Receipt, Resource,
    SELECTED_VOLUMES, ScanFields, StoreResult, StoredVolume, Tags, Tenant, Timestamp,
};
use ventriform_service::callers::Activity;

/// A volume with the columns of its ownership. `sequence` and `created_at` are the ownership's.
pub(super) const HELD_VOLUME: Select = Select {
    columns: "v.bytes, v.files, v.facts",
    size: "octet_length(v.files) + octet_length(v.facts)",
    table: "volumes AS v ON v.id = h.id",
    volume: "h.id",
};

/// A product with the columns of its ownership, likewise.
const HELD_PRODUCT: Select = Select {
    columns: "p.volume, p.parameters, p.summary, p.software, p.files",
    size: "octet_length(p.parameters) + octet_length(p.summary) + octet_length(p.files)",
    table: "products AS p ON p.id = h.id",
    volume: "p.volume",
};

/// The columns of an item that a tenant has.
pub(super) struct Select {
    /// The columns of its content.
    columns: &'static str,
    /// The bytes of those that are of any size.
    size: &'static str,
    /// The table of its content.
    table: &'static str,
    /// The column with the volume whose scan it is of.
    volume: &'static str,
}

/// The columns that are read of the rows of a page.
#[derive(Debug, Clone, Copy)]
pub(super) enum Columns {
    /// Everything.
    All,
    /// The sequence number and the bytes.
    Size,
}

/// The bytes of what a tenant's row has of any size, beside those of the item.
const HELD_SIZE: &str = "octet_length(h.labels) + coalesce(octet_length(c.found), 0)
    + coalesce(octet_length(c.stated), 0)";

impl Select {
    fn for_kind(kind: Resource) -> &'static Self {
        match kind {
            Resource::Volume => &HELD_VOLUME,
            _ => &HELD_PRODUCT,
        }
    }

    /// The bytes of a row that are of any size.
    pub(super) fn bytes(&self) -> String {
        format!("CAST({} + {HELD_SIZE} AS BIGINT)", self.size)
    }

    pub(super) fn query(&self, columns: Columns) -> QueryBuilder {
        let Self { table, volume, .. } = self;
        let columns = match columns {
            Columns::All => format!(
                "h.*, {}, {SCAN_COLUMNS}, (SELECT count(*) FROM sources
                 JOIN holdings AS s ON s.tenant = sources.tenant AND s.id = sources.volume
                 WHERE sources.tenant = h.tenant AND sources.id = h.id AND s.held_at IS NOT NULL)
                     AS source_holds",
                self.columns
            ),
            Columns::Size => format!("h.sequence, {} AS bytes", self.bytes()),
        };
        QueryBuilder::new(format!(
            "SELECT {columns} FROM holdings AS h JOIN {table}
             LEFT JOIN scans AS c ON c.tenant = h.tenant AND c.volume = {volume}"
        ))
    }
}

#[async_trait]
impl Catalogue for SqlStore {
    async fn add_volume(
        &self,
        volume: &StoredVolume,
        tenant: &Tenant,
        tags: &Tags,
        scan: Option<&ScanFields>,
    ) -> StoreResult<bool> {
        let mut transaction = self.writer.begin().await?;
        query(
            "INSERT INTO volumes (id, created_at, bytes, files, facts)
             VALUES ($1, $2, $3, $4, $5) ON CONFLICT (id) DO NOTHING",
        )
        .bind(&volume.id)
        .bind(volume.created_at)
        .bind(i64::try_from(volume.bytes).unwrap_or(i64::MAX))
        .bind(to_json(&volume.files)?)
        .bind(to_json(&volume.facts)?)
        .execute(&mut transaction)
        .await?;
        let now = volume.created_at;
        let new = hold(&mut transaction, tenant, &volume.id, tags, now).await?;
        note_upload(&mut transaction, tenant, &volume.id, scan).await?;
        record(&mut transaction, Activity::of_added(new), &volume.id).await?;
        transaction.commit().await?;
        Ok(new)
    }

    async fn renew_volume(
        &self,
        tenant: &Tenant,
        id: &str,
        tags: &Tags,
        scan: Option<&ScanFields>,
        now: Timestamp,
    ) -> StoreResult<Option<(Owned<StoredVolume>, bool)>> {
        let mut transaction = self.writer.begin().await?;
        let stored = query("SELECT 1 FROM volumes WHERE id = $1").bind(id);
        if stored.fetch_optional(&mut transaction).await?.is_none() {
            transaction.commit().await?;
            return Ok(None);
        }
        let new = hold(&mut transaction, tenant, id, tags, now).await?;
        note_upload(&mut transaction, tenant, id, scan).await?;
        record(&mut transaction, Activity::of_added(new), id).await?;
        transaction.commit().await?;
        let held = self.volume(tenant, id).await?;
        Ok(held.map(|held| (held, new)))
    }

    async fn volume(&self, tenant: &Tenant, id: &str) -> StoreResult<Option<Owned<StoredVolume>>> {
        let row = one(&HELD_VOLUME, Columns::All, tenant, id)
            .build()
            .fetch_optional(&self.readers)
            .await?;
        row.map(|row| rows::held(row, rows::volume)).transpose()
    }

    async fn volume_within(
        &self,
        tenant: &Tenant,
        id: &str,
        bytes: u64,
    ) -> StoreResult<Bounded<Owned<StoredVolume>>> {
        let record = |row| rows::held(row, rows::volume);
        let (within, size) = one_within(&HELD_VOLUME, tenant, id, bytes);
        rows::bounded(self, within, size, record).await
    }

    async fn plan_items(
        &self,
        tenant: &Tenant,
        kind: Resource,
        filter: &ItemFilter,
        page: ListRequest,
    ) -> StoreResult<PagePlan> {
        let query = listed(Columns::Size, tenant, kind, filter, page).build();
        rows::plan(query.fetch_all(&self.readers).await?, page)
    }

    async fn plan_receipts(
        &self,
        tenant: &Tenant,
        item: Option<&str>,
        page: ListRequest,
    ) -> StoreResult<PagePlan> {
        let query = listed_receipts(Columns::Size, tenant, item, page).build();
        rows::plan(query.fetch_all(&self.readers).await?, page)
    }

    async fn volumes(
        &self,
        tenant: &Tenant,
        filter: &ItemFilter,
        page: ListRequest,
    ) -> StoreResult<ListPage<Owned<StoredVolume>>> {
        let rows = listed(Columns::All, tenant, Resource::Volume, filter, page)
            .build()
            .fetch_all(&self.readers)
            .await?;
        let record = |row| rows::held(row, rows::volume);
        rows::page(rows, page, record, |held| held.sequence)
    }

    async fn add_product(
        &self,
        product: &Product,
        tenant: &Tenant,
        source: Option<&str>,
        room: ProductRoom,
    ) -> StoreResult<AddedProduct> {
        let mut transaction = self.writer.begin().await?;
        if let Some(refused) = has_no_room(&mut transaction, product, tenant, room).await? {
            transaction.commit().await?;
            return Ok(refused);
        }
        let new = insert_product(&mut transaction, product, tenant).await?;
        if let Some(volume) = source {
            add_source(&mut transaction, tenant, &product.id, volume).await?;
        }
        record(&mut transaction, Activity::of_added(new), &product.id).await?;
        transaction.commit().await?;
        Ok(if new {
            AddedProduct::New
        } else {
            AddedProduct::Known
        })
    }

    async fn product(&self, tenant: &Tenant, id: &str) -> StoreResult<Option<Owned<Product>>> {
        let row = one(&HELD_PRODUCT, Columns::All, tenant, id)
            .build()
            .fetch_optional(&self.readers)
            .await?;
        row.map(|row| rows::held(row, rows::product)).transpose()
    }

    async fn product_within(
        &self,
        tenant: &Tenant,
        id: &str,
        bytes: u64,
    ) -> StoreResult<Bounded<Owned<Product>>> {
        let record = |row| rows::held(row, rows::product);
        let (within, size) = one_within(&HELD_PRODUCT, tenant, id, bytes);
        rows::bounded(self, within, size, record).await
    }

    async fn products(
        &self,
        tenant: &Tenant,
        kind: Resource,
        filter: &ItemFilter,
        page: ListRequest,
    ) -> StoreResult<ListPage<Owned<Product>>> {
        let rows = listed(Columns::All, tenant, kind, filter, page)
            .build()
            .fetch_all(&self.readers)
            .await?;
        let record = |row| rows::held(row, rows::product);
        rows::page(rows, page, record, |held| held.sequence)
    }

    async fn change_tags(
        &self,
        tenant: &Tenant,
        id: &str,
        before: &Tags,
        after: &Tags,
    ) -> StoreResult<bool> {
        let (table, revised) = match Resource::from_id(id) {
            Some(Resource::Job) => ("jobs", ", revision = revision + 1"),
            _ => ("holdings", ""),
        };
        let mut transaction = self.writer.begin().await?;
        let changed = query(format!(
            "UPDATE {table} SET external_id = $1, labels = $2{revised}
             WHERE tenant = $3 AND id = $4 AND external_id IS NOT DISTINCT FROM $5 AND labels = $6"
        ))
        .erasing()
        .bind(&after.external_id)
        .bind(to_json(&after.labels)?)
        .bind(tenant.as_str())
        .bind(id)
        .bind(&before.external_id)
        .bind(to_json(&before.labels)?)
        .execute(&mut transaction)
        .await?;
        if changed == 1 {
            record(&mut transaction, Activity::Update, id).await?;
        }
        transaction.commit().await?;
        Ok(changed == 1)
    }

    async fn set_library(&self, tenant: &Tenant, id: &str, library: bool) -> StoreResult<bool> {
        let mut transaction = self.writer.begin().await?;
        let changed = query(
            "UPDATE holdings SET library = $1 WHERE tenant = $2 AND id = $3 AND kind = 'template'",
        )
        .bind(library)
        .bind(tenant.as_str())
        .bind(id)
        .execute(&mut transaction)
        .await?;
        if changed == 1 {
            record(&mut transaction, Activity::Update, id).await?;
        }
        transaction.commit().await?;
        Ok(changed == 1)
    }

    async fn set_legal_hold(
        &self,
        tenant: &Tenant,
        id: &str,
        hold: Option<&LegalHold>,
    ) -> StoreResult<bool> {
        let mut transaction = self.writer.begin().await?;
        let changed = query(
            "UPDATE holdings SET hold_reason = $1, held_at = $2, held_by = $3
             WHERE tenant = $4 AND id = $5",
        )
        .erasing()
        .bind(hold.map(|hold| &hold.reason))
        .bind(hold.map(|hold| hold.since))
        .bind(hold.map(|hold| &hold.by))
        .bind(tenant.as_str())
        .bind(id)
        .execute(&mut transaction)
        .await?;
        if changed == 1 {
            record(&mut transaction, Activity::Update, id).await?;
        }
        transaction.commit().await?;
        Ok(changed == 1)
    }

    async fn made_of(&self, tenant: &Tenant, volume: &str) -> StoreResult<Vec<String>> {
        super::erasure::made_of(&self.readers, tenant, volume).await
    }

    async fn erase(
        &self,
        order: &ErasureOrder,
        expected: &[String],
        now: Timestamp,
    ) -> StoreResult<Erased> {
        self.making_room(|| self.erase_once(order, expected, now))
            .await
    }

    async fn erased_at(&self, tenant: &Tenant, id: &str) -> StoreResult<Option<Timestamp>> {
        let row = query("SELECT erased_at FROM erased WHERE tenant = $1 AND id = $2")
            .bind(tenant.as_str())
            .bind(id)
            .fetch_optional(&self.readers)
            .await?;
        row.map(|row| row.try_get(0)).transpose()
    }

    async fn receipt_within(
        &self,
        tenant: &Tenant,
        id: &str,
        bytes: u64,
    ) -> StoreResult<Bounded<Receipt>> {
        let one = |columns: &str, bounded: &str| {
            let text =
                format!("SELECT {columns} FROM erasures WHERE tenant = $1 AND id = $2{bounded}");
            query(text).bind(tenant.as_str()).bind(id)
        };
        let within = one("sequence, receipt", " AND octet_length(receipt) <= $3");
        let size = one("CAST(octet_length(receipt) AS BIGINT) AS bytes", "");
        let within = within.bind(rows::bytes_bound(bytes));
        rows::bounded(self, within, size, |row| Ok(rows::receipt(row)?.0)).await
    }

    async fn receipts(
        &self,
        tenant: &Tenant,
        item: Option<&str>,
        page: ListRequest,
    ) -> StoreResult<ListPage<Receipt>> {
        let query = listed_receipts(Columns::All, tenant, item, page).build();
        let rows = query.fetch_all(&self.readers).await?;
        let page = rows::page(rows, page, rows::receipt, |(_, sequence)| *sequence)?;
        Ok(ListPage {
            items: page.items.into_iter().map(|(receipt, _)| receipt).collect(),
            next: page.next,
        })
    }

    async fn expired(
        &self,
        kind: Resource,
        before: Cutoff,
        after: Option<&Expired>,
        limit: u32,
    ) -> StoreResult<Vec<Expired>> {
        let rows = expired(kind, before, after, limit)
            .build()
            .fetch_all(&self.readers)
            .await?;
        rows::all(rows, |row| {
            Ok(Expired {
                tenant: rows::tenant(&row)?,
                id: row.try_get("id")?,
                since: row.try_get("since")?,
                sequence: row.try_get("sequence")?,
            })
        })
    }

    fn version(&self) -> Option<u64> {
        self.writer.version()
    }

    async fn overwrite_erased(&self) -> StoreResult<bool> {
        self.overwrite().await
    }
}

impl SqlStore {
    /// Tries the erasure of the method without `_once`.
    async fn erase_once(
        &self,
        order: &ErasureOrder,
        expected: &[String],
        now: Timestamp,
    ) -> StoreResult<Erased> {
        let mut transaction = self.writer.begin().await?;
        let erased = if self.is_held_elsewhere(&mut transaction, expected).await? {
            Erased::InUse
        } else {
            super::erasure::erase(&mut transaction, order, expected, now).await?
        };
        // Committed also if nothing was erased, which keeps the connection.
        transaction.commit().await?;
        Ok(erased)
    }
}

/// An item that a tenant has.
fn one(select: &Select, columns: Columns, tenant: &Tenant, id: &str) -> QueryBuilder {
    let mut query = select.query(columns);
    query
        .push(" WHERE h.tenant = ")
        .push_bind(tenant.to_string());
    query.push(" AND h.id = ").push_bind(id.to_owned());
    query
}

/// The same if it has no more than so many bytes, and its bytes.
fn one_within(select: &Select, tenant: &Tenant, id: &str, bytes: u64) -> (Query, Query) {
    let mut within = one(select, Columns::All, tenant, id);
    within.push(" AND ").push(&select.bytes()).push(" <= ");
    within.push_bind(rows::bytes_bound(bytes));
    (
        within.build(),
        one(select, Columns::Size, tenant, id).build(),
    )
}

/// A page of the items of one kind that a tenant has.
pub(super) fn listed(
    columns: Columns,
    tenant: &Tenant,
    kind: Resource,
    filter: &ItemFilter,
    page: ListRequest,
) -> QueryBuilder {
    let mut query = Select::for_kind(kind).query(columns);
    query
        .push(" WHERE h.tenant = ")
        .push_bind(tenant.to_string());
    query.push(" AND h.kind = ").push_bind(kind.noun());
    push_tags(&mut query, "h.", tenant, kind, &filter.tags);
    let of_scan = match kind {
        Resource::Volume => "holdings AS x WHERE x.tenant = c.tenant AND x.id = c.volume",
        _ => {
            "sources AS s CROSS JOIN holdings AS x WHERE s.tenant = c.tenant AND s.volume = c.volume
             AND x.tenant = s.tenant AND x.id = s.id"
        }
    };
    push_scan(&mut query, ("h.", of_scan), tenant, &filter.scan);
    push_page(&mut query, "h.sequence", page);
    query
}

/// A page of a tenant's receipts.
pub(super) fn listed_receipts(
    columns: Columns,
    tenant: &Tenant,
    item: Option<&str>,
    page: ListRequest,
) -> QueryBuilder {
    let columns = match columns {
        Columns::All => "sequence, receipt",
        Columns::Size => "sequence, CAST(octet_length(receipt) AS BIGINT)",
    };
    let mut query = QueryBuilder::new(format!("SELECT {columns} FROM erasures"));
    if item.is_some() {
        // In the order of the list, SQLite would read all receipts of the tenant.
        query.push_sqlite(" INDEXED BY erasures_by_item");
    }
    query.push(" WHERE tenant = ").push_bind(tenant.to_string());
    if let Some(item) = item {
        query.push(" AND item IN (").push_bind(item.to_owned());
        query.push(", ").push_bind(SELECTED_VOLUMES);
        query.push(") AND (item = ").push_bind(item.to_owned());
        // A receipt for many volumes names them in its document only. Both engines have `replace`, and it knows no
        // wildcards.
        let named = format!("{{\"id\":{}", serde_json::Value::from(item));
        query.push(" OR replace(receipt, ").push_bind(named);
        query.push(", '') != receipt)");
    }
    push_page(&mut query, "sequence", page);
    query
}

/// A page of what is older than `before`, see [`Catalogue::expired`]. A page is read from an index by age,
/// however much is beyond it.
pub(super) fn expired(
    kind: Resource,
    before: Cutoff,
    after: Option<&Expired>,
    limit: u32,
) -> QueryBuilder {
    // The column of the age, and the legal holds that keep an item.
    let (table, since, kept) = match kind {
        Resource::Job => (
            "jobs",
            "x.finished_at",
            "SELECT 1 FROM holdings AS v WHERE v.tenant = x.tenant AND v.id = x.volume
             AND v.held_at IS NOT NULL",
        ),
        _ => (
            "holdings",
            "x.renewed_at",
            "SELECT 1 FROM sources JOIN holdings AS s
                 ON s.tenant = sources.tenant AND s.id = sources.volume
             WHERE sources.tenant = x.tenant AND sources.id = x.id AND s.held_at IS NOT NULL",
        ),
    };
    let mut query = QueryBuilder::new(format!(
        "SELECT x.tenant, x.id, {since} AS since, x.sequence FROM {table} AS x WHERE {since} < "
    ));
    query.push_bind(before.moment());
    if let Some(after) = after {
        query.push(" AND (").push(since).push(", x.sequence) > (");
        query.push_bind(after.since).push(", ");
        query.push_bind(after.sequence).push(")");
    }
    if kind != Resource::Job {
        query.push(" AND x.kind = ").push_bind(kind.noun());
        query.push(" AND x.held_at IS NULL");
    }
    query.push(" AND NOT EXISTS (").push(kept).push(")");
    query
        .push(" ORDER BY ")
        .push(since)
        .push(", x.sequence LIMIT ");
    query.push_bind(limit);
    query
}

/// Why a tenant that does not have a product yet cannot have it.
async fn has_no_room(
    to: &mut Transaction<'_>,
    product: &Product,
    tenant: &Tenant,
    room: ProductRoom,
) -> StoreResult<Option<AddedProduct>> {
    let row = query(
        "SELECT (SELECT count(*) FROM holdings WHERE tenant = $1 AND id = $2),
                (SELECT count(*) FROM holdings WHERE tenant = $1 AND kind = $3)",
    )
    .bind(tenant.as_str())
    .bind(&product.id)
    .bind(product.resource().noun())
    .fetch_one(&mut *to)
    .await?;
    let [held, count] = [0, 1].map(|column| row.try_get::<i64, _>(column));
    if held? > 0 {
        return Ok(None);
    }
    if count? >= i64::from(room.count) {
        return Ok(Some(AddedProduct::TooMany));
    }
    let Some(limit) = room.bytes else {
        return Ok(None);
    };
    let stored = stored_bytes(to, tenant).await?;
    let size: u64 = product.files.iter().map(|file| file.bytes).sum();
    let fits = stored.saturating_add(size) <= limit;
    Ok((!fits).then_some(AddedProduct::TooLarge { stored }))
}

/// Gives an item to a tenant, or renews its ownership. Returns whether it is new for the tenant.
async fn hold(
    to: &mut Transaction<'_>,
    tenant: &Tenant,
    id: &str,
    tags: &Tags,
    now: Timestamp,
) -> StoreResult<bool> {
    let kind = Resource::from_id(id).unwrap_or(Resource::Volume);
    let known = query("SELECT 1 FROM holdings WHERE tenant = $1 AND id = $2")
        .bind(tenant.as_str())
        .bind(id)
        .fetch_optional(&mut *to)
        .await?;
    query(
        "INSERT INTO holdings (tenant, id, kind, created_at, renewed_at, external_id, labels)
         VALUES ($1, $2, $3, $4, $4, $5, $6)
         ON CONFLICT (tenant, id) DO UPDATE SET
             renewed_at = CASE WHEN holdings.renewed_at > excluded.renewed_at
                          THEN holdings.renewed_at ELSE excluded.renewed_at END,
             external_id = coalesce(excluded.external_id, holdings.external_id),
             labels = CASE excluded.labels WHEN '{}' THEN holdings.labels
                      ELSE excluded.labels END",
    )
    .bind(tenant.as_str())
    .bind(id)
    .bind(kind.noun())
    .bind(now)
    .bind(&tags.external_id)
    .bind(to_json(&tags.labels)?)
    .execute(&mut *to)
    .await?;
    forget_deletion(to, tenant, id).await?;
    Ok(known.is_none())
}

/// Adds the record of a product's content, unless it is stored already.
pub(crate) async fn insert_content(to: &mut Transaction<'_>, product: &Product) -> StoreResult<()> {
    query(
        "INSERT INTO products
             (id, kind, created_at, volume, parameters, summary, software, files)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8) ON CONFLICT (id) DO NOTHING",
    )
    .bind(&product.id)
    .bind(product.resource().noun())
    .bind(product.created_at)
    .bind(&product.volume)
    .bind(to_json(&product.parameters)?)
    .bind(to_json(&product.summary)?)
    .bind(&product.software)
    .bind(to_json(&product.files)?)
    .execute(to)
    .await?;
    Ok(())
}

/// The parameters that name further volumes which a product is made of, one or several separated by commas.
const OTHER_VOLUMES: [&str; 3] = ["expert", "rest", "others"];

/// The volumes that a product is made of.
pub(super) fn volumes_of(product: &Product) -> impl Iterator<Item = &str> {
    let others = OTHER_VOLUMES.map(|name| product.parameters.get(name)?.as_str());
    let others = others.into_iter().flatten().flat_map(|ids| ids.split(','));
    let others = others.filter(|id| Resource::from_id(id) == Some(Resource::Volume));
    product.volume.as_deref().into_iter().chain(others)
}

/// Adds a product within a transaction, unless it is stored already, and gives it to a tenant.
/// Returns whether it is new for the tenant.
pub(super) async fn insert_product(
    to: &mut Transaction<'_>,
    product: &Product,
    tenant: &Tenant,
) -> StoreResult<bool> {
    insert_content(to, product).await?;
    let tags = Tags::default();
    let new = hold(to, tenant, &product.id, &tags, product.created_at).await?;
    for volume in volumes_of(product) {
        add_source(to, tenant, &product.id, volume).await?;
    }
    Ok(new)
}

/// Notes that an item was made of a volume.
async fn add_source(
    to: &mut Transaction<'_>,
    tenant: &Tenant,
    id: &str,
    volume: &str,
) -> StoreResult<()> {
    query("INSERT INTO sources (tenant, id, volume) VALUES ($1, $2, $3) ON CONFLICT DO NOTHING")
        .bind(tenant.as_str())
        .bind(id)
        .bind(volume)
        .execute(to)
        .await?;
    Ok(())
}
