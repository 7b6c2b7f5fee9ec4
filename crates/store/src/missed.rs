//! What a newer trail says and an older copy of the store does not know: keys revoked, items and identities erased, and
//! legal holds set since the copy was made.
//!
//! In: the store, which no service uses, and the newer one: a data folder, whose database may be damaged, or a database
//! of PostgreSQL. The engines need not be the same, and nothing is written to the newer one. Out: a list; and if asked
//! for, the same done to the store.
//!
//! 1. Both are compared row by row, not by time: a revocation, a receipt or a hold of the newer store that this one
//!    lacks.
//! 2. The rows of the newer trail that this one lacks are taken over as they are, if they follow its rows; the chain of
//!    hashes shows it. Else, if rows were written here meanwhile, an event names the end of the newer trail.
//! 3. Keys are revoked, holds set, and then items erased, each with its row of the trail and a receipt.
//!
//! Not done: a hold that was lifted later stays, since what is in doubt holds. What a job that has not ended needs, or
//! what is on hold here, is named and stays.

use crate::Store;
use crate::database::{Readers, SqlStore};
use crate::query::{DbRow, query};
use crate::tables::REPAIRER;
use crate::{postgres, sqlite};
use std::collections::BTreeSet;
use std::fmt::{Display, Formatter};
use std::path::PathBuf;
use std::sync::Arc;
use ventriform_service::base::records::{
    Catalogue, Clock, Custody, Erased, ErasureAgent, ErasureOrder, LegalHold, Receipt, Scans,
    StoreError, StoreResult, SystemClock, Tenant, Timestamp,
};
use ventriform_service::callers::{
    AccessStore, Activity, Agent, Anchor, AuditEvent, AuditLink, NO_HASH, Recorder, chain_hash,
};
use ventriform_service::config::PostgresSettings;

/// Rows of a trail that are read at a time.
const BATCH_ROWS: u32 = 1000;

/// Something that the newer store knows and this one lacks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Act {
    /// A key was revoked.
    Revoked {
        /// The key's id.
        key: String,
    },
    /// An item was put on legal hold.
    Held {
        /// Whose it is.
        tenant: Tenant,
        /// The item.
        item: String,
        /// The hold.
        hold: LegalHold,
    },
    /// Whose scan a volume is was erased.
    IdentityErased {
        /// Whose it is.
        tenant: Tenant,
        /// The volume.
        item: String,
    },
    /// An item was erased.
    Erased {
        /// Whose it was.
        tenant: Tenant,
        /// The item.
        item: String,
        /// Whether what was made of it, and the jobs on it, went with it.
        cascade: bool,
    },
}

impl std::fmt::Display for Act {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Revoked { key } => write!(f, "key {key} was revoked"),
            Self::Held { tenant, item, .. } => {
                write!(f, "{item} of tenant {tenant} was put on legal hold")
            }
            Self::IdentityErased { tenant, item } => {
                write!(f, "whose scan {item} of tenant {tenant} is was erased")
            }
            Self::Erased { tenant, item, .. } => write!(f, "{item} of tenant {tenant} was erased"),
        }
    }
}

/// What a store missed.
#[derive(Debug, Clone, Default)]
pub struct Missed {
    /// What was done elsewhere, in the order in which it is done here.
    pub acts: Vec<Act>,
    /// Rows of the newer trail that follow those here.
    pub rows: Vec<AuditLink>,
    /// The newest row of the newer trail.
    pub end: Option<Anchor>,
    /// Tables of the newer store that could not be read, each with the reason.
    pub unread: Vec<String>,
}

/// Why it is not known what a store missed.
#[derive(Debug, thiserror::Error)]
pub enum MissedError {
    /// The newer store cannot be read at all.
    #[error("{store}: {reason}")]
    Newer {
        /// Its database.
        store: String,
        /// The reason.
        reason: String,
    },
    /// The newer trail does not know the newest row here.
    #[error(
        "row {sequence} of the audit trail here, with the hash {hash}, is not in the trail of {store}: it is not a \
         newer copy of this store"
    )]
    OtherTrail {
        /// The newer store's database.
        store: String,
        /// Position of the row here.
        sequence: i64,
        /// Its hash.
        hash: String,
    },
    /// A store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// Where the newer store is.
#[derive(Debug, Clone, PartialEq)]
pub enum NewerStore {
    /// A data folder, with a database of SQLite in it.
    Folder(PathBuf),
    /// A database of PostgreSQL.
    Server(PostgresSettings),
}

impl Display for NewerStore {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Folder(folder) => write!(f, "{}", folder.join(crate::DATABASE_FILE).display()),
            Self::Server(server) => write!(f, "{}", server.url),
        }
    }
}

/// A hold of the newer store, or the erasure of an identity there.
struct HeldRow {
    tenant: String,
    id: String,
    hold: LegalHold,
}

/// What [`missed`] reads of the newer store.
struct Newer<'a> {
    place: &'a NewerStore,
    readers: Readers,
    unread: Vec<String>,
}

impl<'a> Newer<'a> {
    /// Connects to the store as it is: its tables stay those of the program that has made them.
    async fn open(place: &'a NewerStore) -> Result<Self, MissedError> {
        let unreadable = |reason: String| MissedError::Newer {
            store: place.to_string(),
            reason,
        };
        let readers = match place {
            NewerStore::Folder(folder) => {
                let opened = sqlite::open_as_it_is(&folder.join(crate::DATABASE_FILE)).await;
                Readers::Sqlite(opened.map_err(|error| unreadable(error.to_string()))?)
            }
            NewerStore::Server(server) => {
                let opened = postgres::open_as_it_is(server).await;
                Readers::Postgres(opened.map_err(|error| unreadable(error.to_string()))?)
            }
        };
        let (place, unread) = (place, Vec::new());
        Ok(Self {
            place,
            readers,
            unread,
        })
    }

    /// The rows of a query on a table; none if it cannot be read, which is noted.
    async fn all<T>(
        &mut self,
        table: &str,
        text: &'static str,
        read: impl Fn(DbRow) -> StoreResult<T>,
    ) -> Vec<T> {
        let found = query(text).fetch_all(&self.readers).await;
        match found.and_then(|rows| rows.into_iter().map(read).collect()) {
            Ok(rows) => rows,
            Err(error) => {
                self.unread.push(format!("{table}: {error}"));
                Vec::new()
            }
        }
    }

    /// The rows of the trail after a number, as far as they can be read.
    async fn links(&mut self, after: i64) -> Vec<AuditLink> {
        let mut links: Vec<AuditLink> = Vec::new();
        loop {
            let last = links.last().map_or(after, |link| link.sequence);
            let page = query(
                "SELECT sequence, event, hash FROM audit WHERE sequence > $1 ORDER BY sequence LIMIT $2",
            )
            .bind(last)
            .bind(BATCH_ROWS)
            .fetch_all(&self.readers)
            .await;
            match page.and_then(|page| page.into_iter().map(link).collect::<StoreResult<Vec<_>>>())
            {
                Ok(page) if page.is_empty() => return links,
                Ok(page) => links.extend(page),
                Err(error) => {
                    self.unread.push(format!("audit: {error}"));
                    return links;
                }
            }
        }
    }

    /// Whether its trail has a row, or has removed it because of its age; `None` if that cannot be read.
    async fn knows(&mut self, row: &Anchor) -> Option<bool> {
        if row.sequence == 0 {
            return Some(true);
        }
        let known = query(
            "SELECT EXISTS (SELECT 1 FROM audit WHERE sequence = $1 AND hash = $2)
                 OR $1 <= coalesce((SELECT max(sequence) FROM audit_anchors), 0)",
        )
        .bind(row.sequence)
        .bind(&row.hash)
        .fetch_one(&self.readers)
        .await;
        known.and_then(|row| row.try_get(0)).ok()
    }

    async fn close(self) -> Vec<String> {
        match &self.readers {
            Readers::Sqlite(shared) => shared.pool.close().await,
            Readers::Postgres(shared) => shared.pool.close().await,
        }
        self.unread
    }
}

fn link(row: DbRow) -> StoreResult<AuditLink> {
    Ok(AuditLink {
        sequence: row.try_get(0)?,
        event: row.try_get(1)?,
        hash: row.try_get(2)?,
    })
}

/// Tenant, id, reason, time and name.
fn held(row: DbRow) -> StoreResult<HeldRow> {
    Ok(HeldRow {
        tenant: row.try_get(0)?,
        id: row.try_get(1)?,
        hold: LegalHold {
            reason: row.try_get(2)?,
            since: row.try_get(3)?,
            by: row.try_get(4)?,
        },
    })
}

/// What the store at `newer` knows of and `rows` lacks.
///
/// # Errors
/// If the newer store cannot be read, or is that of another trail.
pub async fn missed(rows: &SqlStore, newer: &NewerStore) -> Result<Missed, MissedError> {
    let mut newer = Newer::open(newer).await?;
    let common = common_end(rows, &mut newer).await?;
    let mut found = Missed::default();
    for key in newer
        .all(
            "api_keys",
            "SELECT id FROM api_keys WHERE revoked_at IS NOT NULL",
            |row| row.try_get::<String, _>(0),
        )
        .await
    {
        let here = rows.key(&key).await?;
        if here.is_some_and(|key| key.revoked_at.is_none()) {
            found.acts.push(Act::Revoked { key });
        }
    }
    let holds = "SELECT tenant, id, coalesce(hold_reason, ''), held_at, coalesce(held_by, '')
                 FROM holdings WHERE held_at IS NOT NULL ORDER BY sequence";
    for hold in newer.all("holdings", holds, held).await {
        found.acts.extend(held_later(rows, hold).await?);
    }
    let scans = "SELECT tenant, volume, '', erased_at, '' FROM scans WHERE erased_at IS NOT NULL
                 ORDER BY tenant, volume";
    for scan in newer.all("scans", scans, held).await {
        found.acts.extend(identity_erased_later(rows, scan).await?);
    }
    found.acts.extend(erased_later(rows, &mut newer).await?);
    let later = newer.links(common.sequence).await;
    found.end = later.last().map(|link| Anchor {
        sequence: link.sequence,
        hash: link.hash.clone(),
    });
    found.rows = following(rows, &common, later).await?;
    found.unread = newer.close().await;
    Ok(found)
}

/// The last row of the trail here before the first gap, or before the first row that the newer trail does not know.
///
/// # Errors
/// If it knows none of them.
async fn common_end(rows: &SqlStore, newer: &mut Newer<'_>) -> Result<Anchor, MissedError> {
    let anchor = rows.anchor().await?;
    let mut end = anchor.unwrap_or_else(|| Anchor {
        sequence: 0,
        hash: NO_HASH.to_owned(),
    });
    let (mut common, mut is_first) = (None, true);
    'walk: loop {
        let links = rows.links(end.sequence, BATCH_ROWS).await?;
        if links.is_empty() {
            break;
        }
        for link in links {
            if link.sequence != end.sequence + 1 {
                break 'walk;
            }
            let next = Anchor {
                sequence: link.sequence,
                hash: link.hash,
            };
            // From where rows differ, both stores went on for themselves.
            if newer.knows(&next).await == Some(false) {
                if is_first {
                    return Err(MissedError::OtherTrail {
                        store: newer.place.to_string(),
                        sequence: next.sequence,
                        hash: next.hash,
                    });
                }
                common = Some(end.clone());
                break 'walk;
            }
            (end, is_first) = (next, false);
        }
    }
    Ok(common.unwrap_or(end))
}

/// Those of the later rows that can be taken over: they follow the common end without a break, and the row here that
/// comes next follows them.
async fn following(
    rows: &SqlStore,
    common: &Anchor,
    later: Vec<AuditLink>,
) -> Result<Vec<AuditLink>, MissedError> {
    let next_here = rows.links(common.sequence, 1).await?.into_iter().next();
    let (mut sequence, mut hash) = (common.sequence, common.hash.clone());
    let mut taken = Vec::new();
    for link in later {
        let here = next_here.as_ref();
        if here.is_some_and(|here| here.sequence <= link.sequence) {
            break;
        }
        let follows = link.sequence == sequence + 1
            && link.hash == chain_hash(&hash, link.sequence, &link.event);
        if !follows {
            break;
        }
        (sequence, hash) = (link.sequence, link.hash.clone());
        taken.push(link);
    }
    if let Some(here) = next_here {
        let joins = here.sequence == sequence + 1
            && here.hash == chain_hash(&hash, here.sequence, &here.event);
        if !joins {
            taken.clear();
        }
    }
    Ok(taken)
}

/// The tenant of a row, if it has the item here.
async fn owner(rows: &SqlStore, tenant: String, item: &str) -> Result<Option<Tenant>, StoreError> {
    let Ok(tenant) = Tenant::try_from(tenant) else {
        return Ok(None);
    };
    let row = query("SELECT 1 FROM holdings WHERE tenant = $1 AND id = $2")
        .bind(tenant.as_str())
        .bind(item)
        .fetch_optional(&rows.readers)
        .await?;
    Ok(row.map(|_| tenant))
}

async fn held_later(rows: &SqlStore, held: HeldRow) -> Result<Option<Act>, StoreError> {
    let HeldRow { tenant, id, hold } = held;
    let Some(tenant) = owner(rows, tenant, &id).await? else {
        return Ok(None);
    };
    let row = query("SELECT 1 FROM holdings WHERE tenant = $1 AND id = $2 AND held_at IS NULL")
        .bind(tenant.as_str())
        .bind(&id)
        .fetch_optional(&rows.readers)
        .await?;
    Ok(row.map(|_| Act::Held {
        tenant,
        item: id,
        hold,
    }))
}

async fn identity_erased_later(rows: &SqlStore, scan: HeldRow) -> Result<Option<Act>, StoreError> {
    let HeldRow { tenant, id, .. } = scan;
    let Some(tenant) = owner(rows, tenant, &id).await? else {
        return Ok(None);
    };
    let row = query("SELECT 1 FROM scans WHERE tenant = $1 AND volume = $2 AND erased_at IS NULL")
        .bind(tenant.as_str())
        .bind(&id)
        .fetch_optional(&rows.readers)
        .await?;
    Ok(row.map(|_| Act::IdentityErased { tenant, item: id }))
}

/// Items here that receipts of the newer store name, unless their tenant has them there again.
async fn erased_later(rows: &SqlStore, newer: &mut Newer<'_>) -> Result<Vec<Act>, StoreError> {
    let receipts = "SELECT receipt FROM erasures ORDER BY sequence";
    let receipts: Vec<String> = newer.all("erasures", receipts, |row| row.try_get(0)).await;
    let there = "SELECT tenant, id FROM holdings";
    let there: Vec<(String, String)> = newer
        .all("holdings", there, |row| {
            Ok((row.try_get(0)?, row.try_get(1)?))
        })
        .await;
    let there: BTreeSet<(String, String)> = there.into_iter().collect();
    let (mut acts, mut named) = (Vec::new(), BTreeSet::new());
    for text in receipts {
        let Ok(receipt) = serde_json::from_str::<Receipt>(&text) else {
            newer.unread.push("erasures: a receipt is damaged".into());
            continue;
        };
        let cascade = receipt.items.len() > 1 || !receipt.jobs.is_empty();
        let items = receipt.items.into_iter().map(|item| item.id);
        for item in std::iter::once(receipt.item.clone()).chain(items) {
            let pair = (receipt.tenant.to_string(), item.clone());
            if there.contains(&pair) || !named.insert(pair.clone()) {
                continue;
            }
            if let Some(tenant) = owner(rows, pair.0, &item).await? {
                acts.push(Act::Erased {
                    cascade: cascade && item == receipt.item,
                    tenant,
                    item,
                });
            }
        }
    }
    Ok(acts)
}

/// Does here what was missed. Returns what could not be done, each with the reason.
///
/// # Errors
/// If the store fails; what was done so far stays done, and doing it again goes on.
pub async fn apply(store: &Store, missed: &Missed) -> Result<Vec<String>, MissedError> {
    let (rows, now) = (&*store.rows, SystemClock.now());
    let clock = Arc::new(SystemClock);
    let recorder = Arc::new(Recorder::start(store.rows.clone(), clock.clone()));
    let agent =
        |tenant: &Tenant| Agent::new(recorder.clone(), clock.clone(), tenant.clone(), REPAIRER);
    rows.take_over(&missed.rows).await?;
    let mut left = Vec::new();
    for act in &missed.acts {
        let done = match act {
            Act::Revoked { key } => {
                let event = event(Activity::KeyRevoked, Tenant::default(), now).on(key);
                rows.revoke_key(key, now, &event).await?;
                Ok(())
            }
            Act::Held { tenant, item, hold } => {
                let held = rows.set_legal_hold(tenant, item, Some(hold));
                Agent::scope(Some(agent(tenant)), held).await?;
                Ok(())
            }
            Act::IdentityErased { tenant, item } => {
                let erased = rows.erase_scan(tenant, item, now);
                if Agent::scope(Some(agent(tenant)), erased).await? {
                    Ok(())
                } else {
                    Err("it is on legal hold here".to_owned())
                }
            }
            Act::Erased {
                tenant,
                item,
                cascade,
            } => erase(store, tenant, item, *cascade).await?,
        };
        if let Err(reason) = done {
            left.push(format!("{act}: {reason}"));
        }
    }
    if left.is_empty()
        && missed.unread.is_empty()
        && let Some(end) = &missed.end
    {
        let applied = event(Activity::TrailApplied, Tenant::default(), now);
        let mut events = Vec::new();
        let kept = rows.marks().await?.kept_head;
        for end in kept.iter().chain([end]) {
            if !rows.confirms(end).await? {
                events.push(applied.clone().on(end.name()));
            }
        }
        if !events.is_empty() {
            rows.append(&events).await?;
        }
    }
    Ok(left)
}

/// Erases an item and its files. The reason if it stays.
async fn erase(
    store: &Store,
    tenant: &Tenant,
    item: &str,
    cascade: bool,
) -> Result<Result<(), String>, MissedError> {
    let rows = &*store.rows;
    let mut ids = vec![item.to_owned()];
    if cascade {
        ids.extend(rows.made_of(tenant, item).await?);
    }
    let mut files = Vec::new();
    for id in &ids {
        let record = rows.record(id).await?;
        files.push((
            id.clone(),
            record.map_or_else(Vec::new, |record| record.files()),
        ));
    }
    let order = ErasureOrder {
        tenant: tenant.clone(),
        id: item.to_owned(),
        cascade,
        renewed_before: None,
        by: ErasureAgent {
            name: REPAIRER.into(),
            ..ErasureAgent::default()
        },
        reason: ventriform_service::base::records::ErasureReason::Request,
    };
    let receipt = match Catalogue::erase(rows, &order, &ids, SystemClock.now()).await? {
        Erased::Done(receipt) => receipt,
        Erased::Unknown => return Ok(Ok(())),
        Erased::OnHold { id } => return Ok(Err(format!("{id} is on legal hold here"))),
        Erased::InUse => {
            return Ok(Err(
                "a job that has not ended needs it: cancel the job".into()
            ));
        }
    };
    for erased in receipt.items.iter().filter(|item| item.files_erased) {
        let known = files.iter().find(|(id, _)| *id == erased.id);
        let known = known.map_or(&[][..], |(_, files)| files.as_slice());
        let deleted = store.blobs.delete(&erased.id, known).await;
        deleted.map_err(StoreError::from)?;
    }
    Ok(Ok(()))
}

fn event(activity: Activity, tenant: Tenant, now: Timestamp) -> AuditEvent {
    AuditEvent::new(now, activity, tenant, REPAIRER.into())
}

impl SqlStore {
    /// Takes over rows of a newer copy of the trail, as they are.
    async fn take_over(&self, links: &[AuditLink]) -> Result<(), StoreError> {
        let mut transaction = self.writer.begin().await?;
        for link in links {
            query("INSERT INTO audit (sequence, event, hash) VALUES ($1, $2, $3)")
                .bind(link.sequence)
                .bind(&link.event)
                .bind(&link.hash)
                .execute(&mut transaction)
                .await?;
        }
        transaction.commit().await
    }
}
