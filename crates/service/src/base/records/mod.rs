//! Records, their owners, and the traits of a store: the vocabulary of the whole service.
//!
//! - **Identity.** A [`Tenant`] owns items and jobs. The id of an item is a hash of its content ([`volume_id`],
//!   [`content_id`]), that of a job is random ([`random_id`]); its prefix tells the [`Resource`].
//! - **Items.** A [`StoredVolume`] is an upload, a [`Product`] what was made of one or added to a library.
//!   Several tenants may own the same item; the [`Ownership`] says since when, under which names, and whether a
//!   legal hold keeps it.
//! - **Jobs.** A [`Job`] is one row of the jobs table, which is also the queue.
//! - **Erasures.** What is erased leaves a [`Receipt`].
//! - **Time.** A [`Clock`] gives the time of day; ages count by a trusted one only ([`TrustedNow`], [`Cutoff`]). The
//!   clock of a service is the [`ServiceClock`].
//! - **Errors.** A [`Failure`] is a reason with advice, a [`StoreError`] a failure of the database or the files.
//!
//! [`JobStore`] keeps jobs, [`Catalogue`] items and whose they are, [`BlobStore`] their files, [`Scans`] whose scans
//! the volumes are, [`ScanLists`] the list of them; [`Custody`] looks after all of them, [`Peers`] tells processes on one store of each other. The
//! crate `ventriform-store` implements them.
//!
//! Guaranteed by every implementation: each method is one transaction. Not guaranteed: that a method called again
//! after an error had no effect the first time.

mod blobs;
mod catalogue;
mod clock;
mod custody;
mod erasure;
mod figures;
mod ids;
mod item_record;
mod job;
mod job_store;
mod listing;
mod ownership;
mod peers;
mod priority;
mod product;
mod resource;
mod scan;
mod scan_erasure;
mod scan_lists;
mod scan_search;
mod service_clock;
mod store_error;
mod tenant;
mod time_store;
mod volume;

pub use blobs::{
    BlobStore, BlobStream, BlobWriter, DiskSpace, LocalFile, Shelved, StagedFiles, StagedFor,
};
pub use catalogue::{AddedProduct, Catalogue, Deleted, ProductRoom};
pub(crate) use clock::milliseconds;
pub use clock::{Clock, Cutoff, SystemClock, Timestamp, TrustedNow, parse_rfc3339, rfc3339};
pub use custody::{Custody, RecordPages};
pub use erasure::{
    AuditMark, Erased, ErasedFile, ErasedItem, ErasureAgent, ErasureOrder, ErasureReason, Expired,
    Receipt,
};
pub use figures::{FigureStore, QueueFigures};
pub use ids::{content_id, hex, random_id, random_key, volume_id};
pub use item_record::ItemRecord;
pub use job::{Filed, Idempotency, Job, JobState, JobWebhook, NewJob, SendOrder, SeriesSource};
pub use job_store::{
    Claimant, DeathLimit, Interrupted, JobFilter, JobOutcome, JobStore, Lease, QueueLoad,
};
pub use listing::{Bounded, ListPage, ListRequest, PAGE_BYTES, PagePlan};
pub use ownership::{ItemFilter, LegalHold, Owned, Ownership, TagFilter, Tags};
pub use peers::{News, NewsFeed, Peers};
pub use priority::Priority;
pub use product::{Product, ProductFile};
pub use resource::Resource;
pub use scan::{ScanFields, ScanFilter, ScanIdentity, Scans, UnreadScan};
pub use scan_erasure::{
    SELECTED_VOLUMES, ScanErasureOrder, ScanErasurePlan, ScanErasures, ScanSelection, ScansErased,
};
pub use scan_lists::{FoundScans, Receiving, ScanLists};
pub use scan_search::{JobOnScan, MadeOfScan, ScanOrder, ScanSearch, SearchedWords, WhichScan};
pub use service_clock::{DOUBT_LASTS, ServiceClock};
pub use store_error::{BlobError, StoreError, StoreFault, StoreResult};
pub use tenant::{InvalidTenant, Tenant};
pub use time_store::TimeStore;
pub use ventriform::runs::advice::{Failure, Fault};
pub use volume::{FileRecord, StoredVolume};
