//! What a list of scans is searched and filtered by, and its order.

use super::Timestamp;
use std::fmt;
pub use ventriform::heart::comparison::WhichScan;

/// The order of a list of scans.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum ScanOrder {
    /// By arrival, the last first.
    #[default]
    Newest,
    /// By Study Date, the latest first; those without come last.
    StudyDate,
    /// By Patient's Name, else Patient ID; those without come last.
    Patient,
    /// By what the tenant calls them: `external_id`, else the label `name`, else their ids.
    Name,
    /// By size, the largest first.
    Largest,
}

impl ScanOrder {
    /// Every order.
    pub const ALL: [Self; 5] = [
        Self::Newest,
        Self::StudyDate,
        Self::Patient,
        Self::Name,
        Self::Largest,
    ];

    /// Its name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Newest => "newest",
            Self::StudyDate => "study_date",
            Self::Patient => "patient",
            Self::Name => "name",
            Self::Largest => "largest",
        }
    }

    /// Whether it tells whose scans these are, or what people call them.
    pub fn is_personal(self) -> bool {
        matches!(self, Self::StudyDate | Self::Patient | Self::Name)
    }
}

/// What was made of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MadeOfScan {
    /// A model.
    Model,
    /// A segmentation.
    Segmentation,
    /// A beat.
    Beat,
    /// A comparison in which it takes part, at stress or at rest.
    Comparison,
    /// None of these.
    Nothing,
}

impl MadeOfScan {
    /// Every value.
    pub const ALL: [Self; 5] = [
        Self::Model,
        Self::Segmentation,
        Self::Beat,
        Self::Comparison,
        Self::Nothing,
    ];

    /// Its name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Model => "model",
            Self::Segmentation => "segmentation",
            Self::Beat => "beat",
            Self::Comparison => "comparison",
            Self::Nothing => "nothing",
        }
    }
}

/// A job on a scan by which it is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JobOnScan {
    /// One that waits or runs.
    Unfinished,
    /// One that has failed.
    Failed,
}

impl JobOnScan {
    /// Every value.
    pub const ALL: [Self; 2] = [Self::Unfinished, Self::Failed];

    /// Its name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Unfinished => "unfinished",
            Self::Failed => "failed",
        }
    }
}

/// Words that are looked for. They may be names of patients: `Debug` shows none of them.
#[derive(Clone, PartialEq, Eq)]
pub struct SearchedWords {
    /// Every one of them must be part of a text about the scan. Small and capital letters are alike from A to Z; other
    /// letters are found as they are given, in small letters, in capitals, and with the first one a capital.
    pub words: Vec<String>,
    /// Whether texts are searched that tell whose scan it is, or that people wrote of it; else ids, format, modality,
    /// tracer, and rest or stress.
    pub personal: bool,
}

impl fmt::Debug for SearchedWords {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SearchedWords")
            .field("personal", &self.personal)
            .finish_non_exhaustive()
    }
}

/// Which scans to list, beside what every list is filtered by, and in which order.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ScanSearch {
    /// Only those about which these words are found.
    pub words: Option<SearchedWords>,
    /// The order.
    pub order: ScanOrder,
    /// Only those of which this was made.
    pub made: Option<MadeOfScan>,
    /// Only those with such a job.
    pub job: Option<JobOnScan>,
    /// Only those of this modality, as headers write it.
    pub modality: Option<String>,
    /// Only those made at rest, or at stress.
    pub rest_or_stress: Option<WhichScan>,
    /// Only those with this Patient ID.
    pub patient: Option<String>,
    /// Only those with a Study Date from this one on, `YYYYMMDD`.
    pub study_date_from: Option<String>,
    /// Only those with a Study Date up to this one, `YYYYMMDD`.
    pub study_date_to: Option<String>,
    /// Only those stored after this moment.
    pub created_after: Option<Timestamp>,
    /// Only those stored before this moment.
    pub created_before: Option<Timestamp>,
}
