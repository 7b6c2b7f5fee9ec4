//! The file store in a bucket of an S3 store.
//!
//! ```text
//! s3://BUCKET/PREFIX/
//!   volumes/vol_.../PLACE/          one publication: the files of a volume, and record.json
//!   models/mdl_.../PLACE/           likewise segmentations/, beats/, comparisons/, heart/normals/, templates/, readers/
//!   received/                       objects that are not volumes yet
//!   quarantine/DAY/volumes/...      what was found without a row
//!   kept.json                       the note about the database ([`crate::note`])
//!   ready                           written and read by readiness checks
//! ```
//!
//! S3 has no rename, and nothing that changes several files at once. So every publication writes new
//! keys, under a place of its own: a random word. The item's row names the place, so the commit of
//! the row makes all files visible, and no other publication of the same item, by another process
//! or by one that was thought dead, can change them or be harmed by their deletion.
//!
//! The content of a publication is staged on the local disk, where it is inspected, and then sent to the
//! bucket in parts; its SHA-256 is compared with that in the record. Reading goes through a cache on the
//! local disk ([`super::cache`]), whose copies are verified. Nothing on the local disk is needed again:
//! all of it can be deleted.
//!
//! A publication whose row was not committed is an orphan. While it is younger than [`ORPHAN_GRACE`] by the
//! store's clock, it may still be going on. Older ones are set aside by the sweep, or deleted if the
//! item was erased or has another publication.

mod bucket;
mod doctor;
mod files;
mod note;
mod received;
mod shared;
mod staged;

pub use bucket::S3Location;
pub(super) use doctor::BucketDoctor;
pub use files::S3Blobs;

use std::time::Duration;

/// Age after which a publication without a row was given up.
pub const ORPHAN_GRACE: Duration = Duration::from_secs(3600);

/// Why the bucket cannot be used, and what to do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{location} cannot be used: {reason}. {fix}")]
pub struct S3Refusal {
    /// Bucket and prefix.
    pub location: String,
    /// The message of the store or the client.
    pub reason: String,
    /// Advice.
    pub fix: &'static str,
}
