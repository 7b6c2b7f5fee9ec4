//! Checking a data folder, and repairing it from what lies on disk.
//!
//! Steps, in this order:
//!
//! 1. The database: is it there, with its write-ahead log, and is its structure whole? Repair moves
//!    a damaged one into the quarantine, makes a new one, and copies every row that can still be
//!    read.
//! 2. Every row of a volume or product: are its files there, with the right length and SHA-256?
//!    Repair moves a broken item into the quarantine and removes its row.
//! 3. Every folder of an item: does it have a row? Repair makes the row from the `record.json`
//!    beside the files if these are what it says, else moves the folder into the quarantine.
//! 4. Every received object that is not part of a volume yet: is its file there, with the right
//!    SHA-256? Repair removes the rows of damaged ones, which can be sent again.
//! 5. Every item in the quarantine: repair brings back those that are whole, have a record, and
//!    were not erased by anybody.
//! 6. Leftovers of writes and deletions: repair deletes them.
//!
//! If the files are in a bucket, steps 2 to 5 are done there ([`super::s3`]).
//!
//! Repair deletes no content that was ever published and not replaced. Rows that it makes anew belong to the tenant
//! that the caller names, unless the database still says who holds the item: the record beside the
//! files does not name tenants. Jobs, keys and receipts live in the database only.

use super::blobs::{
    self, DISCARDED_FOLDER, QUARANTINE_FOLDER, RECEIVED_FOLDER, RECORD_FILE, STAGING_FOLDER,
};
use super::content;
use super::database::SqlStore;
use super::findings::Examination;
use super::received;
use super::s3::{BucketDoctor, S3Blobs, S3Location};
use super::sqlite;
use super::{
    CLOSED_MARK, DATABASE_FILE, DiskGauge, FolderLock, IfNone, OpenError, StoreSettings,
    check_place, require_file, require_store,
};
use crate::faults;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use ventriform_service::records::{
    Clock, Custody, FileRecord, ItemRecord, RecordPages, Resource, StoreError, SystemClock, Tenant,
    random_id, volume_id,
};

/// Rows read at a time.
const PAGE_ROWS: u32 = 200;

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

/// Checks the data folder, and the bucket if its files are in one. With `heirs`, also repairs it: rows
/// of items whose holder is unknown go to that tenant.
///
/// # Errors
/// If a service uses the folder, or the folder cannot be read (or written, for a repair).
pub async fn examine(
    folder: &Path,
    s3: Option<&S3Location>,
    heirs: Option<&Tenant>,
) -> Result<Examination, DoctorError> {
    // An empty one may have lost all, or is to have rows of what is in a bucket.
    require_store(folder, IfNone::Make)?;
    check_place(folder, s3)?;
    require_file(folder)?;
    let mut lock = FolderLock::wait_for(|| FolderLock::take(folder)).await?;
    let bucket = match s3 {
        Some(location) => {
            let gauge = DiskGauge::new(folder, Some(0));
            let cache = StoreSettings::default().cache;
            let opened = S3Blobs::open(location, folder, gauge, cache).await;
            Some(opened.map_err(OpenError::from)?)
        }
        None => None,
    };
    let mut doctor = Doctor {
        folder,
        bucket,
        heirs,
        found: Examination::default(),
    };
    let rows = doctor.database(&mut lock).await?;
    let Some(rows) = rows else {
        doctor.shelves_without_rows().await?;
        return Ok(doctor.found);
    };
    let examined = doctor.items(&rows).await;
    rows.close().await;
    examined?;
    if heirs.is_some() {
        lock.mark(CLOSED_MARK)?;
    }
    Ok(doctor.found)
}

struct Doctor<'a> {
    folder: &'a Path,
    bucket: Option<S3Blobs>,
    heirs: Option<&'a Tenant>,
    found: Examination,
}

impl Doctor<'_> {
    fn if_repairing(&self, what: &'static str) -> Option<&'static str> {
        self.heirs.is_some().then_some(what)
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
                Ok(defects) if defects.is_empty() => return Ok(Some(rows)),
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
        let settings = StoreSettings::default();
        let gauge = DiskGauge::new(self.folder, Some(0));
        SqlStore::open(&self.folder.join(DATABASE_FILE), settings.write_wait, gauge).await
    }

    /// Makes a new database, with the rows of the old one that can be read.
    async fn new_database(&self, old: Option<PathBuf>) -> Result<Option<SqlStore>, DoctorError> {
        if self.heirs.is_none() {
            return Ok(None);
        }
        let aside = self
            .folder
            .join(QUARANTINE_FOLDER)
            .join(random_id("database-"));
        fs::create_dir_all(&aside)?;
        for end in ["", "-wal", "-shm"] {
            let name = format!("{DATABASE_FILE}{end}");
            match fs::rename(self.folder.join(&name), aside.join(&name)) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error.into()),
                _ => {}
            }
        }
        let rows = self.open_database().await.map_err(faults::of_sqlite)?;
        if old.is_some() {
            rows.salvage(&aside.join(DATABASE_FILE)).await?;
        }
        Ok(Some(rows))
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

    async fn items(&mut self, rows: &SqlStore) -> Result<(), DoctorError> {
        if let Some(blobs) = &self.bucket {
            let doctor = BucketDoctor {
                blobs,
                rows,
                heirs: self.heirs,
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
                self.row(rows, &record).await?;
                known.insert(record.id().to_owned());
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
                if self.heirs.is_some() {
                    received::set_aside(self.folder, &name, SystemClock.now())?;
                    rows.forget_received(&name).await?;
                }
                let repair = "its row was removed; the object can be sent again";
                let repair = self.if_repairing(repair);
                self.found.note("damaged-object", &name, wrong, repair);
            }
            known.insert(name);
        }
        for name in names(&shelf)? {
            if !known.contains(&name) {
                if self.heirs.is_some() {
                    received::set_aside(self.folder, &name, SystemClock.now())?;
                }
                let repair = self.if_repairing("it was moved into the quarantine");
                let detail = "It was received and not acknowledged.";
                self.found.remark("unknown-object", &name, detail, repair);
            }
        }
        Ok(())
    }

    async fn row(&mut self, rows: &SqlStore, record: &ItemRecord) -> Result<(), DoctorError> {
        self.found.items += 1;
        let id = record.id();
        let place = self.folder.join(blobs::shelf_path(id));
        let wrong = self.wrong_files(&place, record)?;
        if wrong.is_empty() {
            if self.heirs.is_some() && !place.join(RECORD_FILE).exists() {
                write_record(&place, record)?;
            }
            return Ok(());
        }
        if self.heirs.is_some() {
            blobs::set_aside(self.folder, id, SystemClock.now())?;
            rows.forget(id).await?;
        }
        self.found.note(
            "damaged-item",
            id,
            wrong.join("; "),
            self.if_repairing("its row was removed and its files moved into the quarantine"),
        );
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
            if bytes != expected.bytes && !expected.sha256.is_empty() {
                wrong.push(format!("{name} has {bytes} bytes, not {}", expected.bytes));
            } else if !sha256.starts_with(&expected.sha256) {
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
            let repair = match (self.heirs, record) {
                (None, _) => None,
                (Some(heirs), Some(record)) if !erased => {
                    rows.restore(&record, heirs).await?;
                    Some("its row was made from the record beside the files")
                }
                (Some(_), _) => {
                    blobs::set_aside(self.folder, &id, SystemClock.now())?;
                    Some("its files were moved into the quarantine")
                }
            };
            self.found
                .note("unknown-item", id, "It has files but no row.", repair);
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
                if let (Some(heirs), Some(record), false) = (self.heirs, wanted, erased) {
                    fs::rename(&place, &shelved)?;
                    blobs::sync(shelved.parent().unwrap_or(&shelved))?;
                    rows.restore(&record, heirs).await?;
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
                if self.heirs.is_some() {
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
