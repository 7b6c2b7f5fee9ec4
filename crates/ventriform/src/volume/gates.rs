//! The gates of one study: every volume of a file, or one file for each gate.
//!
//! In: a file whose volumes are the gates, or the files of the gates in their order. Out: all gates on one grid, and
//! what the file says of the beats. Of several R-R intervals, that with the most counts is taken; the others are
//! named in a warning.

use super::facts::VolumeFacts;
use super::gate_timing::GateTiming;
use super::nifti::grid::StatedGrid;
use super::open::Reading;
use super::provenance::Provenance;
use super::{Volume, VolumeError};
pub use crate::grid::gates::GATE_COUNTS;

/// The gates of a study and the facts of its files.
#[derive(Debug, Clone)]
pub struct GatedReading {
    /// The gates, in their order.
    pub gates: Vec<Volume>,
    /// The volume of the file that is the first gate, or the file, counted from 0: the others follow it.
    pub first_frame: usize,
    /// The timing that the file states of the beats that were taken.
    pub timing: GateTiming,
    /// Facts about the file, or that of the first gate, with warnings of all.
    pub facts: VolumeFacts,
    /// For every gate whose scan it is and which images or frames it was read from; empty unless the files are DICOM.
    pub scans: Vec<Provenance>,
    /// The place of the grid as the file states it; `None` unless it is NIfTI.
    pub stated_grid: Option<StatedGrid>,
}

/// The difference in patient or study between a gate's header and that of gate 1; `None` if there is none.
fn other_scan(first: Option<&Provenance>, scan: Option<&Provenance>) -> Option<String> {
    let (first, scan) = (first?, scan?);
    let fields = [
        (
            "Patient ID (0010,0020)",
            &first.patient_id,
            &scan.patient_id,
        ),
        (
            "Study Instance UID (0020,000D)",
            &first.study_uid,
            &scan.study_uid,
        ),
    ];
    fields.into_iter().find_map(|(name, wanted, found)| {
        let (wanted, found) = (wanted.as_deref()?.trim(), found.as_deref()?.trim());
        (wanted != found).then(|| format!("has another {name} than gate 1"))
    })
}

impl GatedReading {
    /// Whose scan it is; `None` unless the files are DICOM.
    pub fn provenance(&self) -> Option<&Provenance> {
        self.scans.first()
    }

    /// The gates that were read one by one, and what their file says of the beats of each R-R interval.
    ///
    /// # Errors
    /// [`VolumeError::OtherGate`] if their headers name several patients or studies.
    pub(super) fn of(readings: Vec<Reading>, timings: &[GateTiming]) -> Result<Self, VolumeError> {
        let mut readings = readings.into_iter();
        let first = readings.next().ok_or(VolumeError::NoFile)?.usable()?;
        let mut facts = first.facts;
        let mut gates = vec![first.volume];
        let mut scans = vec![first.provenance];
        for reading in readings {
            for warning in reading.facts.warnings {
                if !facts.warnings.contains(&warning) {
                    facts.warnings.push(warning);
                }
            }
            gates.push(reading.volume);
            scans.push(reading.provenance);
        }
        for (index, scan) in scans.iter().enumerate() {
            if let Some(difference) = other_scan(scans[0].as_ref(), scan.as_ref()) {
                let gate = index + 1;
                return Err(VolumeError::OtherGate { gate, difference });
            }
        }
        let mut first_frame = 0;
        let mut timing = timings.first().cloned().unwrap_or_default();
        let each = timing.gates_of_interval(gates.len());
        if each < gates.len() {
            let counts: Vec<f64> = (gates.chunks(each))
                .map(|gates| gates.iter().map(Volume::counts).sum())
                .collect();
            let main = (1..counts.len()).fold(0, |m, n| if counts[n] > counts[m] { n } else { m });
            let others = (0..counts.len()).filter(|n| *n != main);
            let others: Vec<String> = others
                .map(|n| {
                    format!(
                        "interval {} has {:.0} %",
                        n + 1,
                        100.0 * counts[n] / counts[main]
                    )
                })
                .collect();
            facts.warnings.push(format!(
                "The file has {} R-R intervals of {each} gates: interval {} has the most counts and was taken. Of its \
                 counts, {}.",
                counts.len(),
                main + 1,
                others.join(", ")
            ));
            first_frame = main * each;
            gates = gates.split_off(first_frame);
            gates.truncate(each);
            scans = scans.split_off(first_frame);
            scans.truncate(each);
            timing = timings.get(main).cloned().unwrap_or_default();
        }
        facts.warnings.extend(timing.warnings(gates.len()));
        Ok(Self {
            gates,
            first_frame,
            timing,
            facts,
            scans: scans.into_iter().collect::<Option<_>>().unwrap_or_default(),
            stated_grid: first.stated_grid,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gates_of_other_patients_and_studies_are_named() {
        let text = |text: &str| Some(text.to_owned());
        let first = Provenance {
            patient_id: text("17"),
            study_uid: text("1.2.3"),
            ..Provenance::default()
        };
        let told = |change: &dyn Fn(&mut Provenance)| {
            let mut other = first.clone();
            change(&mut other);
            other_scan(Some(&first), Some(&other)).unwrap_or_default()
        };
        assert!(told(&|other| other.patient_id = text("18")).contains("Patient ID"));
        assert!(told(&|other| other.study_uid = text("1.2.4")).contains("Study Instance UID"));
        assert_eq!(told(&|other| other.patient_id = text("17 ")), "");
        assert_eq!(told(&|other| other.patient_id = None), "");
        assert_eq!(other_scan(Some(&first), None), None);
    }
}
