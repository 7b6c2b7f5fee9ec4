//! Why limits cannot be read, built or applied.

use super::kind::{ScanKind, Sex};
use super::sizes::{FEWEST_CASES, NORMALS_SCHEMA_VERSION};

/// Why limits cannot be read, built or applied.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NormalsError {
    /// It is no JSON, or has other fields.
    #[error("this is not a file of normal limits: {0}")]
    Syntax(String),
    /// It was written for another version of the format.
    #[error(
        "the normal limits have schema version {0}; this program reads version {NORMALS_SCHEMA_VERSION}"
    )]
    SchemaVersion(u64),
    /// The content is not what was written.
    #[error(
        "the normal limits were edited: their content has the SHA-256 {found}, and the file states {stated}"
    )]
    Edited {
        /// The SHA-256 that the file states.
        stated: String,
        /// That of its content.
        found: String,
    },
    /// A field holds something that no limits can hold.
    #[error("`{field}`: {reason}")]
    Field {
        /// The field.
        field: String,
        /// The problem.
        reason: String,
    },
    /// A group has too few people.
    #[error(
        "the group of {group} is too small: {FEWEST_CASES} cases are needed, {cases} can be used"
    )]
    TooFewCases {
        /// The group.
        group: String,
        /// Its people.
        cases: usize,
    },
    /// The file has no group of the scan's kind.
    #[error("the normal limits have no group for this scan ({scan}); they have: {}", .groups.join("; "))]
    OtherKind {
        /// The scan.
        scan: ScanKind,
        /// The groups.
        groups: Vec<String>,
    },
    /// The known facts of the scan do not tell which group it belongs to.
    #[error("several groups of the normal limits suit this scan ({scan}): {}", .groups.join("; "))]
    Ambiguous {
        /// The scan.
        scan: ScanKind,
        /// The groups that suit.
        groups: Vec<String>,
    },
    /// The scan's header states the other sex than the caller.
    #[error("the scan's header has the patient's sex {}, and {} was given", .header.as_str(), .stated.as_str())]
    OtherSex {
        /// The header's.
        header: Sex,
        /// The caller's.
        stated: Sex,
    },
    /// The sides of the wall are not known.
    #[error(
        "the orientation of the heart is unknown, so no place of it can be compared with normal limits"
    )]
    Unoriented,
    /// Too little of the wall has both muscle and limits.
    #[error(
        "only {percent:.0} % of the wall can be compared with the normal limits: the base is masked, or the wall has \
         no uptake"
    )]
    TooLittleWall {
        /// Share of the wall.
        percent: f64,
    },
}
