//! The kind of scan that limits were built from, or are compared with.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A patient's sex, as the scan's header has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub enum Sex {
    /// Female.
    F,
    /// Male.
    M,
}

/// The people of a group of normal limits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub enum GroupSex {
    /// Women.
    F,
    /// Men.
    M,
    /// Both, because whoever built the limits said so.
    #[serde(rename = "mixed")]
    Mixed,
}

/// The kind of a scan, as far as it is known.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct ScanKind {
    /// The patient's sex.
    pub sex: Option<Sex>,
    /// The protocol's name in the cohort's table: kind of stress or rest, camera, filter.
    pub protocol: Option<String>,
    /// The tracer's name in the cohort's table.
    pub tracer: Option<String>,
    /// Whether attenuation was corrected.
    pub attenuation_corrected: Option<bool>,
}

impl Sex {
    /// The sex of a header's or a table's text: `M`, `F`, or `male`, `female`, in either case.
    pub fn parse(text: &str) -> Option<Self> {
        match text.trim().to_ascii_lowercase().as_str() {
            "m" | "male" => Some(Self::M),
            "f" | "female" => Some(Self::F),
            _ => None,
        }
    }

    /// `M` or `F`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::F => "F",
            Self::M => "M",
        }
    }
}

impl GroupSex {
    /// `M`, `F` or `mixed`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::F => "F",
            Self::M => "M",
            Self::Mixed => "mixed",
        }
    }

    /// Whether people of this sex are of the group.
    pub fn holds(self, sex: Sex) -> bool {
        match self {
            Self::Mixed => true,
            Self::F => sex == Sex::F,
            Self::M => sex == Sex::M,
        }
    }
}

impl From<Sex> for GroupSex {
    fn from(sex: Sex) -> Self {
        match sex {
            Sex::F => Self::F,
            Sex::M => Self::M,
        }
    }
}

/// "sex M, protocol rest, tracer not stated, attenuation corrected no".
impl fmt::Display for ScanKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let stated = |text: Option<&str>| text.unwrap_or("not stated").to_owned();
        let corrected = self.attenuation_corrected.map(yes_or_no);
        write!(
            f,
            "sex {}, protocol {}, tracer {}, attenuation corrected {}",
            stated(self.sex.map(Sex::as_str)),
            stated(self.protocol.as_deref()),
            stated(self.tracer.as_deref()),
            stated(corrected)
        )
    }
}

/// `yes` or `no`.
pub fn yes_or_no(is: bool) -> &'static str {
    if is { "yes" } else { "no" }
}
