//! Copying the files of items, and of received objects.

use super::source::{PAGE_ROWS, Source};
use super::{MigrateError, Migrated, Progress};
use crate::backup;
use crate::blobs::{RECEIVED_FOLDER, STAGING_FOLDER, shelf_path};
use crate::copied::Copied;
use crate::s3::S3Blobs;
use futures::{StreamExt, TryStreamExt, stream};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use ventriform_service::base::records::{ItemRecord, RecordPages, Resource};

/// Items that are sent to a bucket at the same time.
const PARALLEL_COPIES: usize = 8;

/// Findings on the way.
struct Copying<'a> {
    done: &'a mut Migrated,
    of: u64,
    kept: BTreeSet<String>,
    damaged: Vec<String>,
}

impl<'a> Copying<'a> {
    async fn begin(source: &Source, done: &'a mut Migrated) -> Result<Self, MigrateError> {
        Ok(Self {
            of: source.items().await?,
            done,
            kept: BTreeSet::new(),
            damaged: Vec::new(),
        })
    }

    fn note(&mut self, id: &str, copied: Copied, tell: &impl Fn(Progress)) {
        match copied {
            Copied::Not(defect) => return self.damaged.push(format!("{id}: {defect}")),
            Copied::Now => self.done.copied += 1,
            Copied::Before => {}
        }
        self.done.items += 1;
        self.kept.insert(id.to_owned());
        let (done, of) = (self.done.items, self.of);
        tell(Progress::Items { done, of });
    }

    fn note_received(&mut self, name: String, copied: Copied) {
        match copied {
            Copied::Not(defect) => self
                .damaged
                .push(format!("{RECEIVED_FOLDER}/{name}: {defect}")),
            _ => {
                self.done.received += 1;
                self.kept.insert(name);
            }
        }
    }

    /// The names that the target is to have.
    fn end(self) -> Result<BTreeSet<String>, MigrateError> {
        if self.damaged.is_empty() {
            Ok(self.kept)
        } else {
            Err(MigrateError::Damaged(self.damaged))
        }
    }
}

/// Copies all files to a bucket.
pub(super) async fn to_bucket(
    source: &Source,
    bucket: &S3Blobs,
    done: &mut Migrated,
    tell: &(impl Fn(Progress) + Sync),
) -> Result<(), MigrateError> {
    let mut copying = Copying::begin(source, done).await?;
    let mut pages = RecordPages::new(&source.rows, PAGE_ROWS);
    while let Some(page) = pages.next().await? {
        let sent = page.into_iter().map(|record: ItemRecord| async move {
            let from = source.folder.join(shelf_path(record.id()));
            let copied = bucket.take_in(&record, &from).await?;
            Ok::<_, MigrateError>((record, copied))
        });
        let mut sent = stream::iter(sent).buffer_unordered(PARALLEL_COPIES);
        while let Some((record, copied)) = sent.try_next().await? {
            copying.note(record.id(), copied, tell);
        }
    }
    for (name, sha256) in source.rows.waiting_files().await? {
        let from = source.folder.join(RECEIVED_FOLDER).join(&name);
        let copied = bucket.take_in_received(&name, &sha256, &from).await?;
        copying.note_received(name, copied);
    }
    // What an earlier attempt has copied and was erased since.
    Ok(bucket.keep_only(&copying.end()?).await?)
}

/// Copies all files to the folder `to`.
pub(super) async fn to_folder(
    source: &Source,
    to: &Path,
    done: &mut Migrated,
    tell: &(impl Fn(Progress) + Sync),
) -> Result<(), MigrateError> {
    for shelf in shelves().chain([STAGING_FOLDER]) {
        fs::create_dir_all(to.join(shelf))?;
    }
    let mut copying = Copying::begin(source, done).await?;
    let mut pages = RecordPages::new(&source.rows, PAGE_ROWS);
    while let Some(page) = pages.next().await? {
        for record in page {
            let copied = backup::copy_item(&source.folder, to, &record)?;
            copying.note(record.id(), copied, tell);
        }
    }
    for (name, sha256) in source.rows.waiting_files().await? {
        let copied = backup::copy_object(&source.folder, to, &name, &sha256)?;
        copying.note_received(name, copied);
    }
    let kept = copying.end()?;
    backup::keep_only(to, |name| kept.contains(name))?;
    for shelf in shelves() {
        crate::blobs::sync(&to.join(shelf))?;
    }
    Ok(())
}

fn shelves() -> impl Iterator<Item = &'static str> {
    let shelves = Resource::WITH_FILES.map(Resource::plural);
    shelves.into_iter().chain([RECEIVED_FOLDER])
}
