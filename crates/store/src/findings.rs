//! Findings of a check of the storage, and their repair.

use serde::Serialize;

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
