//! Checking a data folder, and repairing it from what lies on disk.
//!
//! Steps, in this order:
//!
//! 1. The database: is it there, with its write-ahead log, and is its structure whole? Repair makes a
//!    new one, copies every row that can still be read, names each table that lost rows, and moves the
//!    damaged one into the quarantine. What was closed stays closed ([`super::kept`]); new rows of the audit
//!    trail follow the last one that is known. A database on a server is looked after by the server.
//! 2. Every row of a volume or product: are its files there, with the right length and SHA-256?
//!    Repair moves a broken item into the quarantine and removes its row.
//! 3. Every folder of an item: does it have a row? Repair makes the row from the `record.json`
//!    beside the files if these are what it says, else moves the folder into the quarantine.
//! 4. Every received object that is not part of a volume yet: is its file there, with the right
//!    SHA-256? Repair removes the rows of damaged ones, which can be sent again.
//! 5. Every item in the quarantine: repair brings back those that are whole, have a record, and
//!    were not erased by anybody.
//! 6. Leftovers of writes and deletions: repair deletes them.
//! 7. The running totals by which quotas are judged: are they the sums of what is stored? Repair makes them anew.
//!
//! If the files are in a bucket, steps 2 to 5 are done there ([`super::s3`]).
//!
//! Repair deletes no content that was ever published and not replaced. An item whose ownership was lost goes back to
//! the tenants whom other rows or an index name, else to the heir that the caller names, else into a part of the
//! quarantine that is not emptied by age. A volume that is given back is on legal hold until that is lifted: nobody
//! knows whether it was. Each of these is a row of the audit trail. Jobs, keys and receipts live in the database only.

use super::blobs::{
    self, DISCARDED_FOLDER, HOLDERS_FILE, QUARANTINE_FOLDER, RECEIVED_FOLDER, RECORD_FILE,
    STAGING_FOLDER,
};
use super::content;
use super::database::SqlStore;
use super::findings::{Examination, GIVEN_TO_HEIR, NO_HOLDER, NO_ROW, Repair, UNOWNED_SET_ASIDE};
use super::kept::{Doubt, HOW_TO_OPEN};
use super::note::{Beside, NOTE_FILE};
use super::received;
use super::s3::{BucketDoctor, S3Blobs, S3Location};
use super::sqlite;
use super::sqlite_repair::{Salvage, Salvaged};
use super::tables::{Holder, Holding, Marks, REPAIRER};
use super::{
    CLOSED_MARK, DATABASE_FILE, DiskGauge, FolderLock, IfNone, MARKER_FILE, OpenError,
    StoreSettings, check_place, locked, name_of, require_file, require_store,
};
use crate::faults;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use ventriform_service::base::records::{
    Clock, Custody, FileRecord, ItemRecord, ListRequest, RecordPages, Resource, StoreError,
    SystemClock, Tenant, Timestamp, random_id, volume_id,
};
use ventriform_service::callers::{AccessStore, Activity, Anchor, AuditEvent, KeptRow, verify};
use ventriform_service::config::PostgresSettings;

/// Rows read at a time.
const PAGE_ROWS: u32 = 200;

/// A new database while it is filled.
const DRAFT_FILE: &str = "ventriform.db.repair";

/// The ends of the names of a database's files.
const ENDS: [&str; 3] = ["", "-wal", "-shm"];

/// Why a data folder cannot be examined.
#[derive(Debug, thiserror::Error)]
pub enum DoctorError {
    /// It is in use, or cannot be read.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The database failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A file or folder could not be read, written or moved.
    #[error("{0}")]
    Io(#[from] io::Error),
}

/// Checks the data folder, and the bucket if its files are in one; with `repair`, also repairs it.
///
/// # Errors
/// If a service uses the folder, or the folder cannot be read (or written, for a repair).
pub async fn examine(
    folder: &Path,
    s3: Option<&S3Location>,
    repair: Option<&Repair>,
) -> Result<Examination, DoctorError> {
    // An empty one may have lost all, or is to have rows of what is in a bucket.
    require_store(folder, IfNone::Make)?;
    check_place(folder, s3)?;
    require_file(folder)?;
    let mut lock = FolderLock::wait_for(|| FolderLock::take(folder)).await?;
    let mut doctor = Doctor::new(folder, s3, repair).await?;
    let rows = doctor.database(&mut lock).await?;
    let Some(rows) = rows else {
        doctor.shelves_without_rows().await?;
        return Ok(doctor.found);
    };
    let examined = doctor.all(&rows).await;
    rows.close().await;
    examined?;
    if repair.is_some() {
        lock.mark(CLOSED_MARK)?;
    }
    Ok(doctor.found)
}

/// The same for records in a database on a server, whose structure the server looks after itself.
///
/// # Errors
/// As [`examine`], or if services run on the database, or its files are elsewhere.
pub async fn examine_on_server(
    folder: &Path,
    server: &PostgresSettings,
    s3: Option<&S3Location>,
    repair: Option<&Repair>,
) -> Result<Examination, DoctorError> {
    if s3.is_none() {
        require_store(folder, IfNone::Make)?;
    }
    let _lock = FolderLock::wait_for(|| locked(folder)).await?;
    let wait = StoreSettings::default().write_wait;
    let rows = SqlStore::connect(server, wait, DiskGauge::new(folder, Some(0))).await;
    let rows = rows.map_err(OpenError::from)?;
    let examined: Result<Examination, DoctorError> = async {
        require_place(&rows, folder, server, s3).await?;
        let mut doctor = Doctor::new(folder, s3, repair).await?;
        doctor.notes(&rows, false).await?;
        doctor.all(&rows).await?;
        Ok(doctor.found)
    }
    .await;
    rows.close().await;
    examined
}

/// Refuses a database on a server that services use, or whose files are not at the place that is given.
async fn require_place(
    rows: &SqlStore,
    folder: &Path,
    server: &PostgresSettings,
    s3: Option<&S3Location>,
) -> Result<(), DoctorError> {
    if rows.has_processes().await? {
        return Err(OpenError::Unusable {
            path: PathBuf::from(server.url.to_string()),
            reason:
                "services are running on it: stop all of them, or wait a minute if they were killed"
                    .into(),
        }
        .into());
    }
    let own = match s3 {
        Some(location) => Some(location.to_string()),
        None => name_of(&folder.join(MARKER_FILE)),
    };
    let place = rows.place().await?;
    if own.is_some() && place == own {
        return Ok(());
    }
    Err(OpenError::OtherFiles {
        url: server.url.clone(),
        place: place.unwrap_or_else(|| "no place that is known".into()),
        own: own.unwrap_or_else(|| folder.display().to_string()),
    }
    .into())
}

struct Doctor<'a> {
    folder: &'a Path,
    bucket: Option<S3Blobs>,
    repair: Option<&'a Repair>,
    found: Examination,
    /// Items with a row that nobody has.
    unowned: BTreeSet<String>,
    /// Whether what products were made of has to be noted again.
    sources_lost: bool,
}

impl<'a> Doctor<'a> {
    async fn new(
        folder: &'a Path,
        s3: Option<&S3Location>,
        repair: Option<&'a Repair>,
    ) -> Result<Self, DoctorError> {
        let bucket = match s3 {
            Some(location) => {
                let gauge = DiskGauge::new(folder, Some(0));
                let cache = StoreSettings::default().cache;
                let opened = S3Blobs::open(location, folder, gauge, cache).await;
                Some(opened.map_err(OpenError::from)?)
            }
            None => None,
        };
        Ok(Self {
            folder,
            bucket,
            repair,
            found: Examination::default(),
            unowned: BTreeSet::new(),
            sources_lost: false,
        })
    }

    fn if_repairing(&self, what: &'static str) -> Option<&'static str> {
        self.repair.is_some().then_some(what)
    }

    fn heir(&self) -> Option<&'a Tenant> {
        self.repair.and_then(|repair| repair.heir.as_ref())
    }

    /// Checks the database. `None` if there is none that can be read and none may be made.
    async fn database(&mut self, lock: &mut FolderLock) -> Result<Option<SqlStore>, DoctorError> {
        let path = self.folder.join(DATABASE_FILE);
        // Opening and closing the database moves the log into it.
        let log_missing = lock.log_is_missing(self.folder);
        if !log_missing {
            lock.mark(CLOSED_MARK)?;
        }
        let made_anew = self.if_repairing("a new database was made");
        if !sqlite::has_tables(&path).await {
            self.found.note(
                "database-missing",
                DATABASE_FILE,
                "It is missing or empty.",
                made_anew,
            );
            return self.new_database(None).await;
        }

        if log_missing {
            self.found.note(
                "log-missing",
                format!("{DATABASE_FILE}-wal"),
                "The service did not stop in order, and the last changes to the database are \
                 missing.",
                self.if_repairing("accepted"),
            );
        }
        let defects = match self.open_database().await {
            Ok(rows) => match rows.all_defects().await {
                Ok(defects) if defects.is_empty() => {
                    self.notes(&rows, false).await?;
                    return Ok(Some(rows));
                }
                Ok(defects) => {
                    rows.close().await;
                    defects
                }
                Err(error) => vec![error.to_string()],
            },
            Err(error) => vec![error.to_string()],
        };
        self.found.note(
            "database-damaged",
            DATABASE_FILE,
            defects.join("; "),
            self.if_repairing("a new database was made of the rows that can be read"),
        );
        self.new_database(Some(path)).await
    }

    async fn open_database(&self) -> Result<SqlStore, sqlx::Error> {
        self.open_rows(DATABASE_FILE).await
    }

    async fn open_rows(&self, name: &str) -> Result<SqlStore, sqlx::Error> {
        let settings = StoreSettings::default();
        let gauge = DiskGauge::new(self.folder, Some(0));
        SqlStore::open(&self.folder.join(name), settings.write_wait, gauge).await
    }

    /// Makes a new database, with the rows of the old one that can be read. The old one stays in its place until the
    /// new one is finished.
    async fn new_database(
        &mut self,
        old: Option<PathBuf>,
    ) -> Result<Option<SqlStore>, DoctorError> {
        if self.repair.is_none() {
            return Ok(None);
        }
        for end in ENDS {
            remove(&self.folder.join(format!("{DRAFT_FILE}{end}")))?;
        }
        let draft = self
            .open_rows(DRAFT_FILE)
            .await
            .map_err(faults::of_sqlite)?;
        let salvage = match &old {
            Some(old) => draft.salvage(old).await,
            None => Ok(Salvage::default()),
        };
        let filled = match salvage {
            Ok(salvage) => self.after_salvage(&draft, &salvage, old.is_some()).await,
            Err(error) => Err(error.into()),
        };
        draft.close().await;
        filled?;
        blobs::sync(&self.folder.join(DRAFT_FILE))?;
        self.replace_database()?;
        let rows = self.open_database().await.map_err(faults::of_sqlite)?;
        rows.keep_beside(self.beside());
        Ok(Some(rows))
    }

    /// Moves the old database into the quarantine, and the draft into its place.
    fn replace_database(&self) -> Result<(), DoctorError> {
        let aside = self
            .folder
            .join(QUARANTINE_FOLDER)
            .join(random_id("database-"));
        fs::create_dir_all(&aside)?;
        for end in ENDS {
            let name = format!("{DATABASE_FILE}{end}");
            match fs::rename(self.folder.join(&name), aside.join(&name)) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error.into()),
                _ => {}
            }
        }
        blobs::sync(&aside)?;
        fs::rename(
            self.folder.join(DRAFT_FILE),
            self.folder.join(DATABASE_FILE),
        )?;
        Ok(blobs::sync(self.folder)?)
    }

    /// Names what is lost, keeps closed what was closed, and writes what happened into the trail.
    async fn after_salvage(
        &mut self,
        rows: &SqlStore,
        salvage: &Salvage,
        had_database: bool,
    ) -> Result<(), DoctorError> {
        let now = SystemClock.now();
        let lacks = |table| !had_database || salvage.lacks(table);
        self.sources_lost = lacks("sources") || lacks("holdings");
        self.notes(rows, lacks("store_marks") || lacks("api_keys"))
            .await?;
        if lacks("erased") {
            rows.restore_tombstones().await?;
        }
        if lacks("audit_anchors") {
            rows.restore_anchor().await?;
        }
        self.know_the_trail(rows).await?;
        let mut holders: BTreeSet<Holder> = salvage.holders.iter().cloned().collect();
        holders.extend(rows.traces_of_holders().await?);
        let holders: Vec<Holder> = holders.into_iter().collect();
        rows.give_back(&holders, now).await?;
        for holder in holders {
            let detail = format!(
                "The record that tenant {} has it was lost, with its tags and with whether it is on legal hold.",
                holder.tenant
            );
            let repair =
                "it was given back to that tenant; a volume is on legal hold until that is lifted";
            self.found
                .note("lost-holder", &holder.id, detail, Some(repair));
        }
        // The draft is in nobody's use yet: its rows and these are seen together.
        let mut events = Vec::new();
        for table in &salvage.tables {
            events.extend(self.lost_rows(rows, table, now).await?);
        }
        rows.append(&events).await?;
        Ok(())
    }

    /// New rows of the trail get greater numbers than any that is known.
    async fn know_the_trail(&self, rows: &SqlStore) -> Result<(), DoctorError> {
        if let Some(newest) = rows.unconfirmed().await?.into_iter().next() {
            let kept_head = Some(Anchor {
                sequence: newest.sequence,
                hash: newest.hash,
            });
            let marks = Marks {
                kept_head,
                ..Marks::default()
            };
            rows.mark(&marks).await?;
        }
        Ok(())
    }

    async fn lost_rows(
        &mut self,
        rows: &SqlStore,
        table: &Salvaged,
        now: Timestamp,
    ) -> Result<Option<AuditEvent>, DoctorError> {
        if table.lost == Some(0) {
            return Ok(None);
        }
        let name = &table.table;
        let how_many = match table.lost {
            Some(1) => "1 row is lost".to_owned(),
            Some(lost) => format!("{lost} rows are lost"),
            None => "rows are lost, and nothing tells how many".to_owned(),
        };
        let mut detail = format!("{how_many}, {} could be read", table.kept);
        let mut object = name.clone();
        let known = if name == "audit" {
            Some(last_known(rows).await?)
        } else {
            None
        };
        match (known, table.last) {
            (Some(row), _) => {
                detail += &format!(
                    "; the last that is known is {} with the hash {}, by {}",
                    row.sequence, row.hash, row.place
                );
                if let Some(last) = table.last {
                    detail += &format!("; the last that was written is {last}");
                }
                object = format!("{name}:{}:{}", row.sequence, row.hash);
            }
            (None, Some(last)) => detail += &format!("; the last had the number {last}"),
            (None, None) => {}
        }
        self.found
            .note("rows-lost", name, format!("{detail}."), None);
        let event = AuditEvent {
            count: table.lost.unwrap_or(1).max(1),
            ..AuditEvent::new(now, Activity::RowsLost, Tenant::default(), REPAIRER.into())
        };
        Ok(Some(event.on(object)))
    }

    /// The places of the notes about the database.
    fn beside(&self) -> Beside {
        Beside {
            folder: Some(self.folder.to_owned()),
            bucket: self.bucket.as_ref().map(S3Blobs::note),
        }
    }

    /// Compares the database with the notes about it. `lost` if nothing in it tells whether it was closed.
    async fn notes(&mut self, rows: &SqlStore, lost: bool) -> Result<(), DoctorError> {
        let mut beside = self.beside();
        if rows.on_server() && beside.bucket.is_some() {
            beside.folder = None;
        }
        let settled = if self.repair.is_some() {
            rows.settle(beside, lost).await?
        } else {
            let judged = rows.judge(&beside, lost).await?;
            rows.keep_beside(beside);
            judged.settled
        };
        if let Some(end) = &settled.restored {
            let detail = format!(
                "The database is a restored copy, which ends with row {} of the audit trail. What was revoked or \
                 erased since is as it was before: `ventriform audit missed --from NEWER` says what.",
                end.sequence
            );
            self.found
                .remark("restored-copy", DATABASE_FILE, detail, None);
        }
        if let Some(Doubt(why)) = &settled.doubt {
            let detail = format!(
                "Callers without credentials are refused, since {why}. To go on, {HOW_TO_OPEN}."
            );
            let repair = self.if_repairing("the service is closed");
            self.found
                .remark("access-in-doubt", NOTE_FILE, detail, repair);
        }
        Ok(())
    }

    /// Compares the running totals with what they stand for.
    async fn totals(&mut self, rows: &SqlStore) -> Result<(), DoctorError> {
        let wrong = rows.wrong_totals().await?;
        if wrong.is_empty() {
            return Ok(());
        }
        if self.repair.is_some() {
            rows.recount().await?;
        }
        let repair = self.if_repairing("the totals were made anew");
        self.found
            .note("wrong-totals", "totals", wrong.join(" "), repair);
        Ok(())
    }

    /// Without a database and without a repair: how many items wait for one.
    async fn shelves_without_rows(&mut self) -> Result<(), DoctorError> {
        let mut shelved = self.shelved()?;
        if let Some(bucket) = &self.bucket {
            for kind in Resource::WITH_FILES {
                let items = bucket.publications(kind).await.map_err(StoreError::from)?;
                shelved.extend(items.into_keys());
            }
        }
        for id in shelved {
            self.found
                .note("unknown-item", id, "It has files but no row.", None);
        }
        Ok(())
    }

    /// The ids of all folders of items.
    fn shelved(&self) -> io::Result<Vec<String>> {
        let mut ids = Vec::new();
        for kind in Resource::WITH_FILES {
            ids.extend(names(&self.folder.join(kind.plural()))?);
        }
        Ok(ids)
    }

    /// Checks what the database says against itself, and against the files.
    async fn all(&mut self, rows: &SqlStore) -> Result<(), DoctorError> {
        self.unowned = rows.unowned().await?.into_iter().collect();
        let examined = self.items(rows).await;
        if examined.is_ok() {
            self.without_item(rows).await?;
            if self.repair.is_some() && !rows.on_server() {
                for (table, dropped) in rows.drop_orphans(SystemClock.now()).await? {
                    let detail = format!("{dropped} rows refer to items that no longer exist.");
                    let repair = Some("they were removed");
                    self.found.note("orphaned-rows", table, detail, repair);
                }
            }
        }
        examined?;
        self.totals(rows).await?;
        self.access(rows).await?;
        self.trail(rows).await?;
        if self.repair.is_some() {
            rows.note_beside().await?;
        }
        Ok(())
    }

    /// What tenants have and the storage does not.
    async fn without_item(&mut self, rows: &SqlStore) -> Result<(), DoctorError> {
        let lost: BTreeSet<Holder> = rows.without_item().await?.into_iter().collect();
        for holder in lost {
            if self.repair.is_some() {
                rows.forget(&holder.id, Some(SystemClock.now())).await?;
            }
            let detail = format!(
                "Tenant {} owns it, but its row and files are missing.",
                holder.tenant
            );
            let repair = self.if_repairing("the record that the tenant has it was removed");
            self.found.note("lost-item", &holder.id, detail, repair);
        }
        Ok(())
    }

    /// Says if no key can open a closed service.
    async fn access(&mut self, rows: &SqlStore) -> Result<(), DoctorError> {
        let page = ListRequest {
            before: None,
            limit: 1,
        };
        let keys = rows.keys(None, page).await?;
        if keys.items.is_empty() && rows.is_closed().await? {
            let detail = format!(
                "The service needs credentials, and no key exists. Unless it has an issuer of tokens, \
                 {HOW_TO_OPEN}."
            );
            self.found.remark("keys-missing", "api_keys", detail, None);
        }
        Ok(())
    }

    /// Walks the audit trail.
    async fn trail(&mut self, rows: &SqlStore) -> Result<(), DoctorError> {
        let report = verify(rows).await?;
        if let Some(broken) = report.broken {
            let mut detail = format!("{broken}.");
            for row in report.unconfirmed {
                detail += &format!(
                    " {} names row {} with the hash {}.",
                    row.place, row.sequence, row.hash
                );
            }
            self.found.remark("trail-broken", "audit", detail, None);
        }
        Ok(())
    }

    async fn items(&mut self, rows: &SqlStore) -> Result<(), DoctorError> {
        if let Some(blobs) = &self.bucket {
            let doctor = BucketDoctor {
                blobs,
                rows,
                repair: self.repair,
                unowned: &self.unowned,
                found: &mut self.found,
            };
            return Ok(doctor.examine().await?);
        }
        let known = self.rows(rows).await?;
        self.folders(rows, &known).await?;
        self.received(rows).await?;
        self.quarantine(rows).await?;
        self.leftovers()
    }

    /// Checks the files of every row. Returns the ids that have a row.
    async fn rows(&mut self, rows: &SqlStore) -> Result<BTreeSet<String>, DoctorError> {
        let mut known = BTreeSet::new();
        let mut pages = RecordPages::new(rows, PAGE_ROWS);
        while let Some(page) = pages.next().await? {
            for record in page {
                if self.row(rows, &record).await? {
                    known.insert(record.id().to_owned());
                }
            }
        }
        Ok(known)
    }

    /// Checks the files of received objects against their rows.
    async fn received(&mut self, rows: &SqlStore) -> Result<(), DoctorError> {
        let shelf = self.folder.join(RECEIVED_FOLDER);
        let mut known = BTreeSet::new();
        for (name, sha256) in rows.waiting_files().await? {
            let wrong = match File::open(shelf.join(&name)) {
                Ok(file) => {
                    self.found.files += 1;
                    (content::hash(&file)? != sha256)
                        .then_some("It has another content than was received.")
                }
                Err(error) if error.kind() == io::ErrorKind::NotFound => Some("It is missing."),
                Err(error) => return Err(error.into()),
            };
            if let Some(wrong) = wrong {
                if self.repair.is_some() {
                    received::set_aside(self.folder, &name, SystemClock.now())?;
                    rows.forget_received(&name, Some(SystemClock.now())).await?;
                }
                let repair = "its row was removed; the object can be sent again";
                let repair = self.if_repairing(repair);
                self.found.note("damaged-object", &name, wrong, repair);
            }
            known.insert(name);
        }
        for name in names(&shelf)? {
            if !known.contains(&name) {
                if self.repair.is_some() {
                    received::set_aside(self.folder, &name, SystemClock.now())?;
                }
                let repair = self.if_repairing("it was moved into the quarantine");
                let detail = "It was received and not acknowledged.";
                self.found.remark("unknown-object", &name, detail, repair);
            }
        }
        Ok(())
    }

    /// Checks one item. Returns whether its folder has been dealt with.
    async fn row(&mut self, rows: &SqlStore, record: &ItemRecord) -> Result<bool, DoctorError> {
        self.found.items += 1;
        let id = record.id();
        let place = self.folder.join(blobs::shelf_path(id));
        let wrong = self.wrong_files(&place, record)?;
        if wrong.is_empty() {
            if self.repair.is_some() {
                if !place.join(RECORD_FILE).exists() {
                    write_record(&place, record)?;
                }
                if let (ItemRecord::Product(product), true) = (record, self.sources_lost) {
                    rows.restore_sources(product).await?;
                }
            }
            if self.unowned.contains(id) {
                self.unowned(rows, record).await?;
            }
            return Ok(true);
        }
        let holdings = rows.holdings(id).await?;
        let on_hold = holdings.iter().any(Holding::is_on_hold);
        if self.repair.is_some() {
            if place.is_dir() {
                let text = serde_json::to_vec_pretty(&holdings).map_err(io::Error::from)?;
                fs::write(place.join(HOLDERS_FILE), text)?;
            }
            if on_hold {
                blobs::set_aside_unowned(self.folder, id)?;
            } else {
                blobs::set_aside(self.folder, id, SystemClock.now())?;
            }
            rows.forget(id, Some(SystemClock.now())).await?;
        }
        let repairing = self.repair.is_some();
        self.found.note_damaged(id, &wrong, (repairing, on_hold));
        Ok(true)
    }

    /// An item that is whole and that nobody has.
    async fn unowned(&mut self, rows: &SqlStore, record: &ItemRecord) -> Result<(), DoctorError> {
        let (id, now, heir) = (record.id(), SystemClock.now(), self.heir());
        let mut done = None;
        if self.repair.is_some() {
            done = Some(if rows.restore(record, (&[], heir), now).await? {
                GIVEN_TO_HEIR
            } else {
                blobs::set_aside_unowned(self.folder, id)?;
                rows.forget(id, Some(now)).await?;
                UNOWNED_SET_ASIDE
            });
        }
        self.found.note("unowned-item", id, NO_HOLDER, done);
        Ok(())
    }

    /// The faults of the files of an item.
    fn wrong_files(&mut self, place: &Path, record: &ItemRecord) -> io::Result<Vec<String>> {
        let mut wrong = Vec::new();
        let mut found = Vec::new();
        for expected in record.files() {
            let name = &expected.name;
            let file = match File::open(place.join(name)) {
                Ok(file) => file,
                Err(error) if error.kind() == io::ErrorKind::NotFound => {
                    wrong.push(format!("{name} is missing"));
                    continue;
                }
                Err(error) => return Err(error),
            };
            self.found.files += 1;
            let bytes = file.metadata()?.len();
            let sha256 = content::hash(&file)?;
            if bytes != expected.bytes {
                wrong.push(format!("{name} has {bytes} bytes, not {}", expected.bytes));
            } else if sha256 != expected.sha256 {
                wrong.push(format!("{name} has another content than was stored"));
            }
            found.push(FileRecord {
                name: name.clone(),
                bytes,
                sha256,
                place: None,
            });
        }
        let is_volume = matches!(record, ItemRecord::Volume(_));
        if is_volume && wrong.is_empty() && volume_id(&found) != record.id() {
            wrong.push("the content is not what the id was made of".into());
        }
        Ok(wrong)
    }

    /// Checks that every folder of an item has a row.
    async fn folders(
        &mut self,
        rows: &SqlStore,
        known: &BTreeSet<String>,
    ) -> Result<(), DoctorError> {
        for id in self.shelved()? {
            if known.contains(&id) {
                continue;
            }
            let place = self.folder.join(blobs::shelf_path(&id));
            let record = self.whole_record(&place, &id)?;
            let erased = rows.was_erased(&id).await?;
            let (now, heir) = (SystemClock.now(), self.heir());
            let repair = match (self.repair, record) {
                (None, _) => None,
                (Some(_), Some(record)) if !erased => {
                    Some(if rows.restore(&record, (&[], heir), now).await? {
                        "its row was made from the record beside the files"
                    } else {
                        blobs::set_aside_unowned(self.folder, &id)?;
                        UNOWNED_SET_ASIDE
                    })
                }
                (Some(_), _) => {
                    blobs::set_aside(self.folder, &id, now)?;
                    Some("its files were moved into the quarantine")
                }
            };
            self.found.note("unknown-item", id, NO_ROW, repair);
        }
        Ok(())
    }

    /// The record beside the files at `place`, if it is that of `id` and the files are what it
    /// says.
    fn whole_record(&mut self, place: &Path, id: &str) -> io::Result<Option<ItemRecord>> {
        let text = match fs::read(place.join(RECORD_FILE)) {
            Ok(text) => text,
            Err(_) => return Ok(None),
        };
        let record: Option<ItemRecord> = serde_json::from_slice(&text).ok();
        let Some(record) = record.filter(|r| r.id() == id && blobs::is_plain(id)) else {
            return Ok(None);
        };
        let whole = self.wrong_files(place, &record)?.is_empty();
        Ok(whole.then_some(record))
    }

    /// Brings back what was set aside and is whole.
    async fn quarantine(&mut self, rows: &SqlStore) -> Result<(), DoctorError> {
        let shelf = self.folder.join(QUARANTINE_FOLDER);
        for day in names(&shelf)? {
            if day.starts_with("database-") {
                continue;
            }
            for name in names(&shelf.join(&day))? {
                let place = shelf.join(&day).join(&name);
                // A second item of that id has a random word after a point.
                let id = name.split('.').next().unwrap_or(&name).to_owned();
                let record = self.whole_record(&place, &id)?;
                let shelved = self.folder.join(blobs::shelf_path(&id));
                let wanted = record.filter(|_| !shelved.exists());
                let erased = rows.was_erased(&id).await?;
                let mut repair = None;
                let (now, heir) = (SystemClock.now(), self.heir());
                let holdings = holdings_of(&place);
                let owned = heir.is_some() || !holdings.is_empty() || rows.has_holder(&id).await?;
                if let (Some(_), Some(record), true) = (self.repair, wanted, owned && !erased) {
                    fs::rename(&place, &shelved)?;
                    blobs::sync(shelved.parent().unwrap_or(&shelved))?;
                    remove(&shelved.join(HOLDERS_FILE))?;
                    rows.restore(&record, (&holdings, heir), now).await?;
                    repair = Some("it was brought back");
                }
                let subject = format!("{QUARANTINE_FOLDER}/{day}/{name}");
                let detail = "It was set aside, because it had no row or was damaged.";
                self.found
                    .remark("quarantined-item", subject, detail, repair);
            }
        }
        Ok(())
    }

    /// Deletes what writes and deletions have left behind.
    fn leftovers(&mut self) -> Result<(), DoctorError> {
        for shelf in [STAGING_FOLDER, DISCARDED_FOLDER] {
            for name in names(&self.folder.join(shelf))? {
                let place = self.folder.join(shelf).join(&name);
                if self.repair.is_some() {
                    if place.is_dir() {
                        fs::remove_dir_all(&place)?
                    } else {
                        fs::remove_file(&place)?
                    }
                }
                let detail = "It is left over from a write or a deletion that did not end.";
                let repair = self.if_repairing("it was deleted");
                self.found
                    .remark("leftover", format!("{shelf}/{name}"), detail, repair);
            }
        }
        Ok(())
    }
}

fn write_record(place: &Path, record: &ItemRecord) -> io::Result<()> {
    let draft = place.join(format!("{RECORD_FILE}.new"));
    fs::write(&draft, serde_json::to_vec_pretty(record)?)?;
    blobs::sync(&draft)?;
    fs::rename(&draft, place.join(RECORD_FILE))
}

/// The newest row of the trail that is there or that another place names.
async fn last_known(rows: &SqlStore) -> Result<KeptRow, DoctorError> {
    let end = rows.trail_end().await?;
    let there = KeptRow {
        place: "the trail itself".into(),
        sequence: end.sequence,
        hash: end.hash,
    };
    let elsewhere = rows.unconfirmed().await?.into_iter().next();
    let elsewhere = elsewhere.filter(|row| row.sequence > there.sequence);
    Ok(elsewhere.unwrap_or(there))
}

/// Who had an item that was set aside, if that is written beside it.
fn holdings_of(place: &Path) -> Vec<Holding> {
    let text = fs::read(place.join(HOLDERS_FILE)).unwrap_or_default();
    serde_json::from_slice(&text).unwrap_or_default()
}

fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// The names in a folder, in order; none if it does not exist.
pub(super) fn names(folder: &Path) -> io::Result<Vec<String>> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(error),
    };
    let mut names = Vec::new();
    for entry in entries {
        names.extend(entry?.file_name().into_string());
    }
    names.sort();
    Ok(names)
}
