//! Erasing all volumes of a patient, a study, a series or an accession at once.
//!
//! A [`ScanErasureOrder`] names scans by what their headers or their tenant say. Its [`ScanErasurePlan`] says what
//! would go and what stands in the way, and changes nothing. The erasure is one transaction with one receipt: all goes
//! that the plan of that moment has, or nothing.

use super::{ErasedItem, ErasureAgent, Receipt, StoreResult, Tenant, Timestamp, content_id};
use async_trait::async_trait;

/// The `item` of a receipt for volumes that were found by a [`ScanSelection`].
pub const SELECTED_VOLUMES: &str = "volumes";

/// Which scans to erase: those for which all values that are given hold.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct ScanSelection {
    /// Patient ID.
    pub patient: Option<String>,
    /// Study Instance UID.
    pub study: Option<String>,
    /// Series Instance UID.
    pub series: Option<String>,
    /// Accession Number.
    pub accession: Option<String>,
}

impl ScanSelection {
    /// Names and values of what is given.
    pub fn given(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let all = [
            ("patient", &self.patient),
            ("study", &self.study),
            ("series", &self.series),
            ("accession", &self.accession),
        ];
        all.into_iter()
            .filter_map(|(name, value)| Some((name, value.as_deref()?)))
    }

    /// Whether nothing is given, which selects nothing.
    pub fn is_empty(&self) -> bool {
        self.given().next().is_none()
    }
}

/// Personal data: only the names of what is given are shown.
impl std::fmt::Debug for ScanSelection {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_set()
            .entries(self.given().map(|(name, _)| name))
            .finish()
    }
}

/// Scans to be erased.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScanErasureOrder {
    /// Whose volumes.
    pub tenant: Tenant,
    /// Which of them.
    pub selection: ScanSelection,
    /// Whether to erase also what was made of them, and the jobs that worked on them.
    pub cascade: bool,
    /// Nothing is erased unless the plan has this [`ScanErasurePlan::tag`].
    pub only_plan: Option<String>,
    /// Who asks.
    pub by: ErasureAgent,
}

/// What an order would erase, and what stands in its way.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ScanErasurePlan {
    /// The volumes, in the order of their ids.
    pub volumes: Vec<String>,
    /// The volumes and what would go with them, with their files. Whether these go is known after the erasure only.
    pub items: Vec<ErasedItem>,
    /// The ended jobs whose records would go.
    pub jobs: Vec<String>,
    /// What was made of the volumes and would stay, as the order leaves it out.
    pub stays: Vec<String>,
    /// Items on legal hold: selected, or a further source of something that would go.
    pub holds: Vec<String>,
    /// Jobs that have not ended and need one of the items.
    pub unfinished_jobs: Vec<String>,
    /// Items that a request needs at this moment.
    pub pinned: Vec<String>,
    /// Volumes of the tenant whose scan a repair has lost and nobody has read again yet, so that they may be meant too.
    pub unread: u64,
    /// Whether there is more than one receipt may hold. The lists are not complete then.
    pub is_too_large: bool,
}

impl ScanErasurePlan {
    /// Largest number of volumes of one order.
    pub const VOLUMES_LIMIT: usize = 1000;
    /// Largest number of files of one order: a receipt of 3 MB, which a request has memory to read.
    pub const FILES_LIMIT: usize = 20_000;

    /// A name for exactly these items and jobs.
    pub fn tag(&self) -> String {
        let items = self.items.iter().map(|item| item.id.as_bytes());
        let jobs = self.jobs.iter().map(String::as_bytes);
        content_id("", items.chain(jobs))
    }

    /// Whether nothing stands in the way of the items.
    pub fn is_free(&self) -> bool {
        self.holds.is_empty() && self.unfinished_jobs.is_empty() && self.pinned.is_empty()
    }
}

/// The result of an order to erase scans.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ScansErased {
    /// They are erased. The files of the items of the receipt that no tenant has any more are yet to be deleted.
    Done(Box<Receipt>),
    /// No volume is selected, or more than one receipt may hold, or something stands in the way: nothing was erased.
    Kept(Box<ScanErasurePlan>),
    /// The plan has another tag: nothing was erased.
    Differs(Box<ScanErasurePlan>),
    /// Something would go that was not expected, or another process has pinned something.
    Changed,
}

/// The statements that erase scans. Every method is one transaction and fails only if the database does.
#[async_trait]
pub trait ScanErasures: Send + Sync + 'static {
    /// What an order would erase, without what requests need at this moment.
    async fn plan_scan_erasure(&self, order: &ScanErasureOrder) -> StoreResult<ScanErasurePlan>;

    /// Erases what an order selects, unless something would go with it that is not among `expected`.
    async fn erase_scans(
        &self,
        order: &ScanErasureOrder,
        expected: &[String],
        now: Timestamp,
    ) -> StoreResult<ScansErased>;
}
