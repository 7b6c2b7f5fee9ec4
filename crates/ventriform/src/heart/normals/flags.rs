//! Reasons to look closer at a comparison with normal limits.

use super::sizes::FEW_CASES;
use std::fmt;

/// The stable name of [`NormalsFlag::KindNotStated`].
pub(crate) const KIND_NOT_STATED: &str = "normals_kind_not_stated";

/// A reason to look closer at a comparison with normal limits.
#[derive(Debug, Clone, PartialEq)]
pub enum NormalsFlag {
    /// The limits are of simulated people.
    Simulated,
    /// The limits are of few people.
    FewCases {
        /// Number of people.
        cases: usize,
    },
    /// The limits are of men and women together.
    MixedSex,
    /// Part of the scan's kind is not known, and was not compared with that of the limits.
    KindNotStated {
        /// The names of what is not known.
        fields: Vec<&'static str>,
    },
    /// The limits were built by fits with other parameters.
    OtherParameters {
        /// The names of the parameters.
        names: Vec<String>,
    },
    /// The limits were built by another version of the program, whose fits may differ.
    OtherVersion {
        /// That version.
        built: String,
    },
    /// Much of the base is masked in this scan.
    MaskedBase {
        /// Share of the basal segments' area without limits or muscle, per cent.
        percent: f64,
    },
    /// Most of the wall lies beyond the limit, so that the scale hangs on little.
    FewMatched {
        /// Share of the compared wall by which the scan was scaled, per cent.
        percent: f64,
    },
}

impl NormalsFlag {
    /// Its stable name.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Simulated => "normals_simulated",
            Self::FewCases { .. } => "normals_few_cases",
            Self::MixedSex => "normals_mixed_sex",
            Self::KindNotStated { .. } => KIND_NOT_STATED,
            Self::OtherParameters { .. } => "normals_other_parameters",
            Self::OtherVersion { .. } => "normals_other_version",
            Self::MaskedBase { .. } => "normals_base_masked",
            Self::FewMatched { .. } => "normals_scale_uncertain",
        }
    }
}

impl fmt::Display for NormalsFlag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Simulated => write!(
                f,
                "the normal limits are of simulated people, not of patients: they are for tests only"
            ),
            Self::FewCases { cases } => write!(
                f,
                "the normal limits are of {cases} people; {FEW_CASES} or more give steady limits"
            ),
            Self::MixedSex => write!(f, "the normal limits are of men and women together"),
            Self::KindNotStated { fields } => write!(
                f,
                "not known of this scan, and not compared with the normal limits: {}",
                fields.join(", ")
            ),
            Self::OtherParameters { names } => write!(
                f,
                "the normal limits were built with other parameters: {}",
                names.join(", ")
            ),
            Self::OtherVersion { built } => write!(
                f,
                "the normal limits were built by version {built} of this program: build them again, or make sure that \
                 its fits are those of this version"
            ),
            Self::MaskedBase { percent } => write!(
                f,
                "{percent:.0} % of the basal segments' wall has no limits or lies beyond the muscle's end: their \
                 scores stand on the rest"
            ),
            Self::FewMatched { percent } => write!(
                f,
                "only {percent:.0} % of the wall looks normal, and the scan was scaled by that part: all deficits \
                 share its error"
            ),
        }
    }
}
