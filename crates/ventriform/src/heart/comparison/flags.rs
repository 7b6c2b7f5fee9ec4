//! Reasons to look closer at a comparison.

use serde::{Deserialize, Serialize};
use std::fmt;

/// One of the two scans.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "lowercase")]
pub enum WhichScan {
    /// That at stress.
    Stress,
    /// That at rest.
    Rest,
}

impl WhichScan {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Stress, Self::Rest];

    /// `stress` or `rest`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Stress => "stress",
            Self::Rest => "rest",
        }
    }
}

impl fmt::Display for WhichScan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

/// A reason to look closer at a comparison.
#[derive(Debug, Clone, PartialEq)]
pub enum ComparisonFlag {
    /// The scans were not made alike, or are not those that they were given as.
    NotComparable(Reason),
    /// A large reversible defect changes the apparent cavity by itself.
    TidUncertain {
        /// Share of the wall that is reversible, per cent.
        reversible_percent: f64,
    },
    /// A file does not say whose scan it is and how it was made.
    OriginNotStated {
        /// Which scan; `None`: neither file says so.
        scan: Option<WhichScan>,
    },
    /// A header does not say whether the scan is at rest or at stress.
    RoleNotStated {
        /// Which scan.
        scan: WhichScan,
    },
    /// A header does not say what the other one says.
    NotStated {
        /// The scan whose header is silent.
        scan: WhichScan,
        /// The thing that is not stated.
        field: &'static str,
        /// The other header's statement.
        other: String,
    },
    /// The scans were made in different ways that change uptake a little.
    MadeOtherwise {
        /// The difference.
        field: &'static str,
        /// At stress.
        stress: String,
        /// At rest.
        rest: String,
    },
    /// Noise hides large losses.
    FewCounts {
        /// The least loss of a territory that shows in nine of ten scans, per cent.
        detectable_percent: f64,
    },
    /// The scale between the scans stands on little of the wall.
    ScaleUncertain {
        /// Share of the wall by which stress was scaled, per cent.
        percent: f64,
    },
    /// The stress map was turned against the rest map.
    Turned {
        /// By how much, degrees.
        degrees: f64,
    },
    /// A reason to doubt the comparison with normal limits.
    OfLimits {
        /// Of which scan; `None`: of both.
        scan: Option<WhichScan>,
        /// The flag's name.
        code: &'static str,
        /// The finding.
        reason: String,
    },
    /// A reason to doubt one of the fits.
    OfScan {
        /// Which scan.
        scan: WhichScan,
        /// The flag's name.
        code: &'static str,
        /// The finding.
        reason: String,
    },
}

/// Why two scans are not comparable.
#[derive(Debug, Clone, PartialEq)]
pub enum Reason {
    /// Attenuation was corrected in one of them.
    AttenuationCorrection {
        /// In which.
        corrected: WhichScan,
    },
    /// One is more blurred.
    Resolution {
        /// Full width at half maximum at stress, mm.
        stress_mm: f64,
        /// The same at rest, mm.
        rest_mm: f64,
    },
    /// A header says that the scan is the other one.
    Role {
        /// The scan, as it was given.
        scan: WhichScan,
        /// The scan that the header names.
        stated: WhichScan,
    },
    /// Other tracers.
    Tracer {
        /// At stress.
        stress: String,
        /// At rest.
        rest: String,
    },
    /// The muscle of one heart does not change by so much.
    Muscle {
        /// Of the wall at stress, ml.
        stress_ml: f64,
        /// Of the wall at rest, ml.
        rest_ml: f64,
    },
    /// The headers name two patients, and the caller says that they are one.
    Patient(Vec<&'static str>),
}

impl ComparisonFlag {
    /// Its stable name.
    pub fn code(&self) -> &'static str {
        match self {
            Self::NotComparable(_) => "not_comparable",
            Self::TidUncertain { .. } => "tid_uncertain",
            Self::OriginNotStated { .. } => "origin_not_stated",
            Self::RoleNotStated { .. } => "role_not_stated",
            Self::NotStated { .. } => "not_stated",
            Self::MadeOtherwise { .. } => "made_otherwise",
            Self::FewCounts { .. } => "few_counts",
            Self::ScaleUncertain { .. } => "scale_uncertain",
            Self::Turned { .. } => "turned",
            Self::OfScan { code, .. } | Self::OfLimits { code, .. } => code,
        }
    }
}

impl fmt::Display for ComparisonFlag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotComparable(reason) => write!(f, "the scans are not comparable: {reason}"),
            Self::TidUncertain { reversible_percent } => write!(
                f,
                "{reversible_percent:.0} % of the wall is reversible: a wall that lacks uptake looks thinner, so the \
                 ratio of the cavities is too large by an unknown part"
            ),
            Self::OriginNotStated { scan: None } => write!(
                f,
                "neither file names a patient, tracer or attenuation correction: make sure that those of both scans \
                 are the same"
            ),
            Self::OriginNotStated { scan: Some(scan) } => write!(
                f,
                "the {scan} scan's file names no patient, tracer or attenuation correction: make sure that they are \
                 those of the other scan"
            ),
            Self::RoleNotStated { scan } => write!(
                f,
                "the {scan} scan's header does not say that it was made at {scan}"
            ),
            Self::MadeOtherwise {
                field,
                stress,
                rest,
            } => write!(f, "{field} differs: {stress} at stress, {rest} at rest"),
            Self::FewCounts { detectable_percent } => write!(
                f,
                "noise hides losses: a territory has to lose {detectable_percent:.0} % of its uptake to be found nine \
                 times in ten"
            ),
            Self::ScaleUncertain { percent } => write!(
                f,
                "only {percent:.0} % of the wall is unchanged, and stress was scaled by that part: all differences \
                 share its error"
            ),
            Self::Turned { degrees } => write!(
                f,
                "the stress map was turned by {degrees:.0} degrees about the long axis, where both maps agree \
                 significantly better"
            ),
            Self::NotStated { scan, field, other } => write!(
                f,
                "the {scan} scan's header does not state the {field}, and that of the other scan says: {other}; make \
                 sure that they are alike"
            ),
            Self::OfLimits {
                scan: None, reason, ..
            } => f.write_str(reason),
            Self::OfScan { scan, reason, .. }
            | Self::OfLimits {
                scan: Some(scan),
                reason,
                ..
            } => write!(f, "{scan}: {reason}"),
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AttenuationCorrection { corrected } => {
                write!(f, "attenuation was corrected at {corrected} only")
            }
            Self::Resolution { stress_mm, rest_mm } => write!(
                f,
                "the image's resolution is {stress_mm:.1} mm at stress and {rest_mm:.1} mm at rest"
            ),
            Self::Role { scan, stated } => write!(
                f,
                "the scan given as {scan} says of itself that it was made at {stated}"
            ),
            Self::Tracer { stress, rest } => {
                write!(f, "the tracer is {stress} at stress and {rest} at rest")
            }
            Self::Muscle { stress_ml, rest_ml } => write!(
                f,
                "the wall has {stress_ml:.0} ml at stress and {rest_ml:.0} ml at rest; that of one heart hardly changes"
            ),
            Self::Patient(fields) => write!(
                f,
                "their headers name two patients, by {}",
                fields.join(", ")
            ),
        }
    }
}
