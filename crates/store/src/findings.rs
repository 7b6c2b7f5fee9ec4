//! Findings of a check of the storage, and their repair.

use serde::Serialize;
use ventriform_service::base::records::Tenant;

/// How to repair what is found.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Repair {
    /// Who gets the items whose holder is unknown. With `None` they go to the quarantine.
    pub heir: Option<Tenant>,
}

/// The finding about files without a row.
pub(super) const NO_ROW: &str = "It has files but no row.";
/// The finding about an item without a holder.
pub(super) const NO_HOLDER: &str =
    "No tenant has it: the record of who does is lost, and with it whether it is on legal hold.";
/// The repair of an item without a holder, if an heir is named.
pub(super) const GIVEN_TO_HEIR: &str = "it was given to the tenant that --tenant names; a volume is on legal hold \
    until that is lifted";
/// The same if none is named.
pub(super) const UNOWNED_SET_ASIDE: &str = "it was moved into the quarantine, where it stays: `--repair --tenant NAME` \
    gives it to that tenant";

/// The repair of a damaged item.
const DAMAGED_SET_ASIDE: &str = "its row was removed and its files moved into the quarantine";
/// The same for one on legal hold.
const HELD_SET_ASIDE: &str = "its row was removed and its files moved into the quarantine, where they stay: it is on \
    legal hold";

/// Something that is not as it should be.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// A stable word for programs: `database-missing`, `damaged-item` ...
    pub kind: &'static str,
    /// The id or file concerned.
    pub subject: String,
    /// The finding, as a sentence.
    pub detail: String,
    /// Whether the service works without a repair.
    pub harmless: bool,
    /// The repair.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub repair: Option<&'static str>,
}

/// The outcome of [`super::examine`].
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Examination {
    /// Number of volumes and products with a row.
    pub items: u64,
    /// Number of files that were read and verified.
    pub files: u64,
    /// The finding.
    pub findings: Vec<Finding>,
}

impl Examination {
    /// Whether nothing is wrong, or everything was repaired.
    pub fn is_healthy(&self) -> bool {
        self.findings
            .iter()
            .all(|finding| finding.harmless || finding.repair.is_some())
    }

    pub(super) fn note(
        &mut self,
        kind: &'static str,
        subject: impl Into<String>,
        detail: impl Into<String>,
        repair: Option<&'static str>,
    ) {
        self.findings.push(Finding {
            kind,
            subject: subject.into(),
            detail: detail.into(),
            harmless: false,
            repair,
        });
    }

    /// Notes an item whose files are `wrong`, and what a repair did with it.
    pub(super) fn note_damaged(
        &mut self,
        id: &str,
        wrong: &[String],
        (repairing, on_hold): (bool, bool),
    ) {
        let repair = match (repairing, on_hold) {
            (false, _) => None,
            (true, true) => Some(HELD_SET_ASIDE),
            (true, false) => Some(DAMAGED_SET_ASIDE),
        };
        self.note("damaged-item", id, wrong.join("; "), repair);
    }

    pub(super) fn remark(
        &mut self,
        kind: &'static str,
        subject: impl Into<String>,
        detail: impl Into<String>,
        repair: Option<&'static str>,
    ) {
        self.note(kind, subject, detail, repair);
        if let Some(last) = self.findings.last_mut() {
            last.harmless = true;
        }
    }
}
