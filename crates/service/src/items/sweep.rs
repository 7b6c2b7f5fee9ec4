//! Looking after stored files: setting aside files without a row, and verifying all files.
//!
//! Both run in the background, in small steps, so that the start does not wait for them however
//! much is stored.
//!
//! **Sweep**, at the start and then every hour: each folder whose item has no row is set aside in
//! the quarantine. A crash between publishing files and committing their row leaves such folders,
//! but so does a database that was lost or restored from an older copy, so they are not deleted:
//! the operator decides, or the time set for the quarantine does. Only the files of an item that
//! was erased are deleted, which its tombstone tells. No sweep takes place while the database is
//! damaged.
//!
//! **Scrub**, at the set rate and at most once a day: each file is read and compared with the hash
//! in its row. What is damaged is logged; readers of it are told already.

use super::Items;
use crate::base::records::{
    BlobError, ItemRecord, RecordPages, Resource, StoreError, StoreFault, StoreResult,
};
use std::sync::Arc;
use std::time::Duration;
use tokio_util::sync::CancellationToken;

/// Time between two sweeps.
const SWEEP_EVERY: Duration = Duration::from_secs(3600);
/// Items looked up at a time.
const BATCH_ITEMS: usize = 500;
/// Pause between two batches, for other users of disk and database.
const BATCH_PAUSE: Duration = Duration::from_millis(5);
/// Shortest time between the starts of two scrubs.
const SCRUB_EVERY: Duration = Duration::from_secs(86_400);

/// Looks after the files of a running service.
pub struct Custodian {
    /// The items to look after.
    pub items: Arc<Items>,
    /// Age at which quarantined items are deleted; `None` keeps them.
    pub quarantine_keep: Option<Duration>,
    /// Bytes read per second to verify files; 0 verifies none.
    pub scrub_rate: u64,
}

/// The outcome of a sweep.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Swept {
    /// Items that were set aside.
    pub set_aside: u64,
    /// Items whose erasure was completed.
    pub erased: u64,
}

impl Custodian {
    /// Sweeps and scrubs until `end` is cancelled.
    pub async fn run(self, end: CancellationToken) {
        tokio::select! {
            () = end.cancelled() => {}
            () = async { tokio::join!(self.sweep_for_ever(), self.scrub_for_ever()); } => {}
        }
    }

    async fn sweep_for_ever(&self) {
        let mut round = tokio::time::interval(SWEEP_EVERY);
        loop {
            round.tick().await;
            if let Err(error) = self.sweep().await {
                tracing::error!(%error, "the sweep of files failed; the next one tries again");
            }
        }
    }

    /// Runs one sweep, and empties the quarantine of what is too old.
    ///
    /// # Errors
    /// If the storage fails, or the database is damaged.
    pub async fn sweep(&self) -> StoreResult<Swept> {
        let items = &self.items;
        let defects = items.catalogue.defects().await?;
        if let Some(first) = defects.first() {
            return Err(StoreError::Database {
                cause: StoreFault::DamagedDatabase,
                message: format!("it is damaged, run `ventriform doctor`: {first}"),
            });
        }
        let mut swept = Swept::default();
        for kind in Resource::WITH_FILES {
            for batch in items.blobs.ids(kind).await?.chunks(BATCH_ITEMS) {
                let ids: Vec<String> = batch.iter().map(|item| item.id.clone()).collect();
                let known = items.catalogue.known(&ids).await?;
                for item in batch {
                    if !known.contains(&item.id) {
                        self.remove(&item.id, &mut swept).await?;
                    } else if item.places > 1 {
                        self.prune(&item.id).await?;
                    }
                }
                tokio::time::sleep(BATCH_PAUSE).await;
            }
        }
        let trusted = items.clock.trusted();
        let before = self.quarantine_keep.zip(trusted);
        let before = before.map(|(age, now)| now.older_than(age));
        items.blobs.tidy(before).await?;
        if let Some((peers, now)) = items.peers.as_ref().zip(trusted) {
            peers.tidy(now).await?;
        }
        if swept.set_aside > 0 {
            tracing::error!(
                items = swept.set_aside,
                "files without a record were moved to the folder `quarantine`; if they are \
                 missed, stop the service and run `ventriform doctor --repair`"
            );
        }
        Ok(swept)
    }

    /// Sets the files of an unknown item aside; deletes them if the item was erased.
    async fn remove(&self, id: &str, swept: &mut Swept) -> StoreResult<()> {
        let items = &self.items;
        let _lock = items.locks.lock(id).await;
        if items.catalogue.record(id).await?.is_some() {
            return Ok(());
        }
        if items.catalogue.was_erased(id).await? {
            items.blobs.delete(id, &[]).await?;
            swept.erased += 1;
        } else if items.blobs.set_aside(id, items.clock.now()).await? {
            swept.set_aside += 1;
        }
        Ok(())
    }

    /// Deletes the publications of an item that its row does not name.
    async fn prune(&self, id: &str) -> StoreResult<()> {
        let _lock = self.items.locks.lock(id).await;
        if let Some(record) = self.items.catalogue.record(id).await? {
            self.items.blobs.prune(id, &record.files()).await?;
        }
        Ok(())
    }

    async fn scrub_for_ever(&self) {
        if self.scrub_rate == 0 {
            return std::future::pending().await;
        }
        let mut round = tokio::time::interval(SCRUB_EVERY);
        loop {
            round.tick().await;
            match self.scrub().await {
                Ok(0) => {}
                Ok(damaged) => tracing::error!(damaged, "stored items are damaged or incomplete"),
                Err(error) => tracing::error!(%error, "the check of all files was broken off"),
            }
        }
    }

    /// Verifies every file once, at the set rate. Returns the number of damaged items.
    ///
    /// # Errors
    /// If the storage fails for another reason than a damaged file.
    pub async fn scrub(&self) -> StoreResult<u64> {
        let mut damaged = 0;
        // One by one: an item may be erased while those before it are read.
        let mut pages = RecordPages::new(&*self.items.catalogue, 1);
        while let Some(page) = pages.next().await? {
            for record in page {
                match self.scrub_item(record).await {
                    Ok(()) => {}
                    Err(StoreError::Files(error)) if error.cause == StoreFault::DamagedFile => {
                        tracing::error!(%error, "a stored file is damaged");
                        damaged += 1;
                    }
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(damaged)
    }

    async fn scrub_item(&self, record: ItemRecord) -> StoreResult<()> {
        let items = &self.items;
        let id = record.id().to_owned();
        for expected in record.files() {
            let file = match items.blobs.hash(&id, &expected).await {
                Err(error) if error.cause == StoreFault::DamagedFile => {
                    return self.unless_erased(&id, error).await;
                }
                other => other?,
            };
            let seconds = file.bytes as f64 / self.scrub_rate as f64;
            tokio::time::sleep(BATCH_PAUSE + Duration::from_secs_f64(seconds)).await;
            if file.sha256 != expected.sha256 {
                let how = format!("{id}/{}: its SHA-256 is another", file.name);
                return self
                    .unless_erased(&id, BlobError::new(StoreFault::DamagedFile, how))
                    .await;
            }
        }
        // An erasure that comes between would leave a description of nothing.
        let _lock = items.locks.lock(&id).await;
        if items.catalogue.record(&id).await?.is_none() {
            return Ok(());
        }
        items.blobs.describe(&record).await?;
        // So would one by another process, which does not know the lock.
        if items.is_shared() && items.catalogue.record(&id).await?.is_none() {
            items.blobs.delete(&id, &record.files()).await?;
        }
        Ok(())
    }

    /// The error, unless the item has been erased meanwhile.
    async fn unless_erased(&self, id: &str, error: BlobError) -> StoreResult<()> {
        match self.items.catalogue.record(id).await? {
            Some(_) => Err(error.into()),
            None => Ok(()),
        }
    }
}
