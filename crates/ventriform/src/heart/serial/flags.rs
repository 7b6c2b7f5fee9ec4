//! Reasons to look closer at scans over the years.

use std::fmt;

/// A reason to look closer. Scans are counted from 1 in their order.
#[derive(Debug, Clone, PartialEq)]
pub enum SerialFlag {
    /// Not every header states when the scan was made: the scans stand in the order in which they were given.
    DatesNotStated,
    /// Files do not say whose scans they are.
    PatientNotStated {
        /// Which scans.
        scans: Vec<usize>,
    },
    /// The headers name two patients, and the caller says that they are one.
    OtherPatient {
        /// Where they differ.
        fields: Vec<&'static str>,
    },
    /// A header does not say whether the scan is at rest or at stress, or how it was made.
    NotStated {
        /// Which scans.
        scans: Vec<usize>,
        /// What is not stated.
        field: &'static str,
    },
    /// A scan was made otherwise than the first one.
    MadeOtherwise {
        /// The scan.
        scan: usize,
        /// The difference.
        field: &'static str,
        /// In the first scan.
        first: String,
        /// In this one.
        own: String,
    },
    /// One scan is more blurred than another: no figure of the pair is comparable.
    OtherResolution {
        /// The scan.
        scan: usize,
        /// Full width at half maximum in the first scan, mm.
        first_mm: f64,
        /// The same in this one.
        own_mm: f64,
    },
    /// The heart beat at another rate, which alone changes its volumes.
    OtherHeartRate {
        /// The scan.
        scan: usize,
        /// Beats a minute in the first scan.
        first_per_minute: f64,
        /// The same in this one.
        own_per_minute: f64,
    },
    /// The images do not agree on where the heart lies.
    NotRegistered {
        /// The scan.
        scan: usize,
        /// Correlation with the first one about the wall.
        correlation: f64,
    },
    /// A scan that differs from both of its neighbours, which are alike.
    OddScan {
        /// The scan.
        scan: usize,
        /// The figure, as reports name it.
        figure: &'static str,
    },
    /// Noise hides large losses.
    FewCounts {
        /// The earlier and the later scan.
        pair: [usize; 2],
        /// The least loss of a territory that shows in nine of ten pairs, per cent.
        detectable_percent: f64,
    },
    /// The scale between two scans stands on little of the wall.
    ScaleUncertain {
        /// The earlier and the later scan.
        pair: [usize; 2],
        /// Share of the wall by which the later scan was scaled, per cent.
        percent: f64,
    },
    /// A reason to doubt the fit of a scan.
    OfScan {
        /// The scan.
        scan: usize,
        /// The flag's name.
        code: &'static str,
        /// The finding.
        reason: String,
    },
}

impl SerialFlag {
    /// Its stable name.
    pub fn code(&self) -> &'static str {
        match self {
            Self::DatesNotStated => "dates_not_stated",
            Self::PatientNotStated { .. } => "patient_not_stated",
            Self::OtherPatient { .. } => "other_patient",
            Self::NotStated { .. } => "not_stated",
            Self::MadeOtherwise { .. } => "made_otherwise",
            Self::OtherResolution { .. } => "not_comparable",
            Self::OtherHeartRate { .. } => "other_heart_rate",
            Self::NotRegistered { .. } => "not_registered",
            Self::OddScan { .. } => "odd_scan",
            Self::FewCounts { .. } => "few_counts",
            Self::ScaleUncertain { .. } => "scale_uncertain",
            Self::OfScan { code, .. } => code,
        }
    }
}

/// `scan 2`, or `scans 1, 2 and 4`.
fn named(scans: &[usize]) -> String {
    let numbers: Vec<String> = scans.iter().map(usize::to_string).collect();
    match numbers.split_last() {
        None => "no scan".to_owned(),
        Some((only, [])) => format!("scan {only}"),
        Some((last, others)) => format!("scans {} and {last}", others.join(", ")),
    }
}

impl fmt::Display for SerialFlag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::DatesNotStated => f.write_str(
                "not every header states when the scan was made: the scans stand in the order in which they were \
                 given",
            ),
            Self::PatientNotStated { scans } => write!(
                f,
                "{}: the files do not say whose scans they are; make sure that all are of one patient",
                named(scans)
            ),
            Self::OtherPatient { fields } => write!(
                f,
                "the headers differ in {}, and it was stated that the patient is the same",
                fields.join(", ")
            ),
            Self::NotStated { scans, field } => {
                write!(f, "{}: the header does not state {field}", named(scans))
            }
            Self::MadeOtherwise {
                scan,
                field,
                first,
                own,
            } => write!(f, "{field} differs: {first} in scan 1, {own} in scan {scan}"),
            Self::OtherResolution {
                scan,
                first_mm,
                own_mm,
            } => write!(
                f,
                "scan {scan} has a resolution of {own_mm:.1} mm, scan 1 of {first_mm:.1} mm: blur alone changes uptake \
                 and volumes"
            ),
            Self::OtherHeartRate {
                scan,
                first_per_minute,
                own_per_minute,
            } => write!(
                f,
                "the heart beat {own_per_minute:.0} times a minute in scan {scan}, {first_per_minute:.0} times in scan \
                 1: the rate alone changes volumes"
            ),
            Self::NotRegistered { scan, correlation } => write!(
                f,
                "scan {scan} and scan 1 correlate by only {correlation:.2} about the wall: the heart may not be the \
                 same place for place"
            ),
            Self::OddScan { scan, figure } => write!(
                f,
                "scan {scan} differs in {figure} from the scans before and after it, which agree: it may be the odd \
                 one"
            ),
            Self::FewCounts {
                pair: [from, to],
                detectable_percent,
            } => write!(
                f,
                "noise hides losses from scan {from} to scan {to}: a territory has to lose {detectable_percent:.0} % of \
                 its uptake to be found nine times in ten"
            ),
            Self::ScaleUncertain {
                pair: [from, to],
                percent,
            } => write!(
                f,
                "only {percent:.0} % of the wall is alike in scans {from} and {to}: the scale between them is uncertain"
            ),
            Self::OfScan { scan, reason, .. } => write!(f, "scan {scan}: {reason}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_are_named_as_people_do() {
        assert_eq!(named(&[2]), "scan 2");
        assert_eq!(named(&[1, 2, 4]), "scans 1, 2 and 4");
        let flag = SerialFlag::NotStated {
            scans: vec![1, 3],
            field: "the tracer",
        };
        assert_eq!(
            flag.to_string(),
            "scans 1 and 3: the header does not state the tracer"
        );
    }
}
