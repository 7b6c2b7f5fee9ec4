//! Checking the bucket of a data folder against its database, and repairing it.
//!
//! The steps are those of [`crate::examine`]: every row has its files, every publication has a
//! row, every received object has its file, and what is whole in the quarantine is brought back. No
//! service must use the database; then no publication is going on, whatever its age.

use super::bucket::Bucket;
use super::files::S3Blobs;
use super::shared::publication;
use crate::blobs::{
    HOLDERS_FILE, QUARANTINE_FOLDER, RECEIVED_FOLDER, RECORD_FILE, UNOWNED_SHELF, is_plain,
    shelf_name, shelf_path,
};
use crate::database::SqlStore;
use crate::findings::{Examination, GIVEN_TO_HEIR, NO_HOLDER, NO_ROW, Repair, UNOWNED_SET_ASIDE};
use crate::tables::{Holding, to_json};
use std::collections::{BTreeMap, BTreeSet};
use ventriform_service::base::records::{
    BlobStore, Clock, Custody, FileRecord, ItemRecord, RecordPages, Resource, StoreResult,
    SystemClock,
};
use ventriform_service::network::intake::ReceivedFiles;

/// Rows read at a time.
const PAGE_ROWS: u32 = 200;

/// The records that a bucket is checked against.
pub(crate) struct BucketDoctor<'a> {
    pub blobs: &'a S3Blobs,
    pub rows: &'a SqlStore,
    /// How to repair; `None` repairs nothing.
    pub repair: Option<&'a Repair>,
    /// Items with a row that nobody has.
    pub unowned: &'a BTreeSet<String>,
    pub found: &'a mut Examination,
}

impl BucketDoctor<'_> {
    /// Runs all steps.
    ///
    /// # Errors
    /// If the database or the bucket fails.
    pub async fn examine(mut self) -> StoreResult<()> {
        let known = self.rows().await?;
        self.publications(&known).await?;
        self.received().await?;
        self.quarantine().await
    }

    fn bucket(&self) -> &Bucket {
        &self.blobs.shared.bucket
    }

    fn if_repairing(&self, what: &'static str) -> Option<&'static str> {
        self.repair.is_some().then_some(what)
    }

    /// Checks the files of every row. Returns the places that rows name, by item.
    async fn rows(&mut self) -> StoreResult<BTreeMap<String, BTreeSet<String>>> {
        let mut known = BTreeMap::new();
        let mut pages = RecordPages::new(self.rows, PAGE_ROWS);
        while let Some(page) = pages.next().await? {
            for record in page {
                let id = record.id();
                self.found.items += 1;
                let places = record.files().into_iter().filter_map(|file| file.place);
                let places: BTreeSet<String> = places.collect();
                let wrong = self.wrong_files(&record, &shelf_path(id)).await?;
                if wrong.is_empty() {
                    if self.repair.is_some() {
                        self.blobs.describe(&record).await?;
                    }
                    if self.unowned.contains(id) && !self.unowned(&record, &places).await? {
                        continue;
                    }
                    known.insert(id.to_owned(), places);
                    continue;
                }
                let holdings = self.rows.holdings(id).await?;
                let on_hold = holdings.iter().any(Holding::is_on_hold);
                if self.repair.is_some() {
                    let shelf = if on_hold {
                        UNOWNED_SHELF.to_owned()
                    } else {
                        shelf_name(SystemClock.now())
                    };
                    let text = to_json(&holdings)?;
                    for place in &places {
                        let path = format!("{}/{HOLDERS_FILE}", publication(id, place));
                        self.bucket().put(&path, text.clone().into()).await?;
                        self.blobs.set_publication_aside(id, place, &shelf).await?;
                    }
                    self.rows.forget(id, Some(SystemClock.now())).await?;
                }
                let repairing = self.repair.is_some();
                self.found.note_damaged(id, &wrong, (repairing, on_hold));
            }
        }
        Ok(known)
    }

    /// The faults of the files of an item whose publications lie in the folder `shelf`.
    async fn wrong_files(&mut self, record: &ItemRecord, shelf: &str) -> StoreResult<Vec<String>> {
        let mut wrong = Vec::new();
        for file in record.files() {
            let name = &file.name;
            let Some(place) = &file.place else {
                wrong.push(format!("{name} was stored in a folder"));
                continue;
            };
            let path = format!("{shelf}/{place}/{name}");
            let Some(content) = self.bucket().fetch(&path, None).await? else {
                wrong.push(format!("{name} is missing"));
                continue;
            };
            self.found.files += 1;
            if content.bytes != file.bytes {
                let (found, stored) = (content.bytes, file.bytes);
                wrong.push(format!("{name} has {found} bytes, not {stored}"));
            } else if content.sha256 != file.sha256 {
                wrong.push(format!("{name} has another content than was stored"));
            }
        }
        Ok(wrong)
    }

    /// The record beside the files of a publication in the folder `shelf`, if it is that of `id` and
    /// the files are what it says.
    async fn whole_record(
        &mut self,
        shelf: &str,
        id: &str,
        place: &str,
    ) -> StoreResult<Option<ItemRecord>> {
        let text = self
            .bucket()
            .read(&format!("{shelf}/{place}/{RECORD_FILE}"))
            .await?;
        let record: Option<ItemRecord> = text.and_then(|text| serde_json::from_slice(&text).ok());
        let Some(record) = record.filter(|record| record.id() == id && is_plain(id)) else {
            return Ok(None);
        };
        let here = |file: &FileRecord| file.place.as_deref() == Some(place);
        if !record.files().iter().all(here) {
            return Ok(None);
        }
        let whole = self.wrong_files(&record, shelf).await?.is_empty();
        Ok(whole.then_some(record))
    }

    /// Checks that every publication has a row.
    async fn publications(
        &mut self,
        known: &BTreeMap<String, BTreeSet<String>>,
    ) -> StoreResult<()> {
        for kind in Resource::WITH_FILES {
            for (id, places) in self.blobs.publications(kind).await? {
                let mut restored = false;
                for place in places {
                    match known.get(&id) {
                        Some(named) if named.contains(&place) => continue,
                        Some(_) => self.superseded(&id, &place).await?,
                        None => restored |= self.orphan(&id, &place, restored).await?,
                    }
                }
            }
        }
        Ok(())
    }

    async fn superseded(&mut self, id: &str, place: &str) -> StoreResult<()> {
        if self.repair.is_some() {
            self.blobs.shared.delete_publication(id, place).await?;
        }
        let detail = "It is left over from a write that did not end, or was replaced.";
        let repair = self.if_repairing("it was deleted");
        let subject = publication(id, place);
        self.found.remark("leftover", subject, detail, repair);
        Ok(())
    }

    /// A publication of an item without a row, which may have been restored from another one. Returns
    /// whether it was now.
    async fn orphan(&mut self, id: &str, place: &str, restored: bool) -> StoreResult<bool> {
        let record = self.whole_record(&shelf_path(id), id, place).await?;
        let erased = self.rows.was_erased(id).await?;
        let record = record.filter(|_| !erased && !restored);
        let Some(repair) = self.repair else {
            self.found.note("unknown-item", id, NO_ROW, None);
            return Ok(false);
        };
        let (now, heir) = (SystemClock.now(), repair.heir.as_ref());
        let mut made = false;
        let done = match &record {
            Some(record) if self.rows.restore(record, (&[], heir), now).await? => {
                made = true;
                "its row was made from the record beside the files"
            }
            Some(_) => {
                let shelf = UNOWNED_SHELF;
                self.blobs.set_publication_aside(id, place, shelf).await?;
                UNOWNED_SET_ASIDE
            }
            None => {
                let shelf = shelf_name(now);
                self.blobs.set_publication_aside(id, place, &shelf).await?;
                "its files were moved into the quarantine"
            }
        };
        self.found.note("unknown-item", id, NO_ROW, Some(done));
        Ok(made)
    }

    /// An item that is whole and that nobody has. Returns whether it keeps its row.
    async fn unowned(
        &mut self,
        record: &ItemRecord,
        places: &BTreeSet<String>,
    ) -> StoreResult<bool> {
        let id = record.id();
        let Some(repair) = self.repair else {
            self.found.note("unowned-item", id, NO_HOLDER, None);
            return Ok(true);
        };
        let (now, heir) = (SystemClock.now(), repair.heir.as_ref());
        let given = self.rows.restore(record, (&[], heir), now).await?;
        if !given {
            for place in places {
                let shelf = UNOWNED_SHELF;
                self.blobs.set_publication_aside(id, place, shelf).await?;
            }
            self.rows.forget(id, Some(now)).await?;
        }
        let done = if given {
            GIVEN_TO_HEIR
        } else {
            UNOWNED_SET_ASIDE
        };
        self.found.note("unowned-item", id, NO_HOLDER, Some(done));
        Ok(given)
    }

    /// Checks the files of received objects against their rows.
    async fn received(&mut self) -> StoreResult<()> {
        let mut known = BTreeSet::new();
        for (name, sha256) in self.rows.waiting_files().await? {
            let path = format!("{RECEIVED_FOLDER}/{name}");
            let wrong = match self.bucket().fetch(&path, None).await? {
                Some(content) => {
                    self.found.files += 1;
                    let other = content.sha256 != sha256;
                    other.then_some("It has another content than was received.")
                }
                None => Some("It is missing."),
            };
            if let Some(wrong) = wrong {
                if self.repair.is_some() {
                    self.blobs.quarantine(&name, SystemClock.now()).await?;
                    let now = Some(SystemClock.now());
                    self.rows.forget_received(&name, now).await?;
                }
                let repair = "its row was removed; the object can be sent again";
                let repair = self.if_repairing(repair);
                self.found.note("damaged-object", &name, wrong, repair);
            }
            known.insert(path);
        }
        for path in self.bucket().paths(RECEIVED_FOLDER).await? {
            if known.contains(&path) {
                continue;
            }
            let name = path.rsplit('/').next().unwrap_or(&path).to_owned();
            if self.repair.is_some() {
                self.blobs.quarantine(&name, SystemClock.now()).await?;
            }
            let repair = self.if_repairing("it was moved into the quarantine");
            let detail = "It was received and not acknowledged.";
            self.found.remark("unknown-object", name, detail, repair);
        }
        Ok(())
    }

    /// Brings back what was set aside and is whole.
    async fn quarantine(&mut self) -> StoreResult<()> {
        let mut publications: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for path in self.bucket().paths(QUARANTINE_FOLDER).await? {
            if let Some((folder, _)) = path.rsplit_once('/') {
                publications
                    .entry(folder.to_owned())
                    .or_default()
                    .push(path);
            }
        }
        for (folder, paths) in publications {
            // quarantine/DAY/SHELF/ID/PLACE; received objects have no place.
            let parts: Vec<&str> = folder.split('/').collect();
            let [_, day, _, id, place] = parts[..] else {
                continue;
            };
            let shelf = format!("{QUARANTINE_FOLDER}/{day}/{}", shelf_path(id));
            let record = self.whole_record(&shelf, id, place).await?;
            let wanted = !self.rows.was_erased(id).await? && self.rows.record(id).await?.is_none();
            let mut repair = None;
            if let (Some(given), Some(record), true) = (self.repair, record, wanted) {
                let (now, heir) = (SystemClock.now(), given.heir.as_ref());
                let beside = format!("{folder}/{HOLDERS_FILE}");
                let text = self.bucket().read(&beside).await?.unwrap_or_default();
                let holdings: Vec<Holding> = serde_json::from_slice(&text).unwrap_or_default();
                if heir.is_some() || !holdings.is_empty() || self.rows.has_holder(id).await? {
                    for path in paths.iter().filter(|path| **path != beside) {
                        let back = path.splitn(3, '/').last().unwrap_or(path);
                        self.bucket().shift(path, back).await?;
                    }
                    self.bucket().delete([beside]).await?;
                    self.rows.restore(&record, (&holdings, heir), now).await?;
                    repair = Some("it was brought back");
                }
            }
            let detail = "It was set aside, because it had no row or was damaged.";
            self.found
                .remark("quarantined-item", folder, detail, repair);
        }
        Ok(())
    }
}
