//! The gates of one study: every volume of a file, or one file for each gate.
//!
//! In: a file whose volumes are the gates, or the files of the gates in their order. Out: all gates on one grid, and
//! what the file says of the beats. Of several R-R intervals, that with the most counts is taken; the others are
//! named in a warning.

use super::dicom::one_scan::{Reach, ScanStatement, contradiction};
use super::facts::VolumeFacts;
use super::gate_timing::GateTiming;
use super::left_out::LeftOut;
use super::nifti::grid::StatedGrid;
use super::open::Reading;
use super::provenance::Provenance;
use super::{Volume, VolumeError};
pub use crate::image::grid::gates::GATE_COUNTS;

/// The gates of a study and the facts of its files.
#[derive(Debug, Clone)]
pub struct GatedReading {
    /// The gates, in their order.
    pub gates: Vec<Volume>,
    /// For each gate the volume of the file, or the file, that it is, counted from 0.
    pub frames: Vec<usize>,
    /// Gates that tell nothing of the beat, counted from 0: those that repeat another, or have far too many counts.
    pub lost: Vec<usize>,
    /// The timing that the file states of the beats that were taken.
    pub timing: GateTiming,
    /// Facts about the file, or that of the first gate, with warnings of all.
    pub facts: VolumeFacts,
    /// For every gate whose scan it is and which images or frames it was read from; empty unless the files are DICOM.
    pub scans: Vec<Provenance>,
    /// The place of the grid as the file states it; `None` unless it is NIfTI.
    pub stated_grid: Option<StatedGrid>,
}

/// The first gate, counted from 1, that is of another scan than those before it, and how that shows. `said` has what
/// the file of each gate says, where each is a file of its own.
fn other_scan(said: &[ScanStatement]) -> Option<(usize, String)> {
    let said: Vec<&ScanStatement> = said.iter().collect();
    (2..=said.len()).find_map(|gates| {
        let reason = contradiction(&said[..gates], Reach::Gates)?;
        Some((
            gates,
            format!("is of another scan than those before it: {reason}"),
        ))
    })
}

impl GatedReading {
    /// Whose scan it is; `None` unless the files are DICOM.
    pub fn provenance(&self) -> Option<&Provenance> {
        self.scans.first()
    }

    /// The gates that were read one by one from the volumes `frames` of which those in `lost` tell nothing, what their
    /// file says of the beats of each R-R interval and, where each is a file of its own, what it says of the scan.
    ///
    /// # Errors
    /// [`VolumeError::OtherGate`] if their headers are of several scans.
    pub(super) fn new(
        readings: Vec<Reading>,
        mut frames: Vec<usize>,
        left_out: &LeftOut,
        timings: &[GateTiming],
        said: &[ScanStatement],
    ) -> Result<Self, VolumeError> {
        if let Some((gate, difference)) = other_scan(said) {
            return Err(VolumeError::OtherGate { gate, difference });
        }
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
            let first_frame = main * each;
            frames = frames.split_off(first_frame);
            frames.truncate(each);
            gates = gates.split_off(first_frame);
            gates.truncate(each);
            scans = scans.split_off(first_frame);
            scans.truncate(each);
            timing = timings.get(main).cloned().unwrap_or_default();
        }
        facts.warnings.extend(timing.warnings(gates.len()));
        let lost = (frames.iter().enumerate()).filter(|(_, frame)| left_out.lost.contains(frame));
        Ok(Self {
            lost: lost.map(|(gate, _)| gate).collect(),
            gates,
            frames,
            timing,
            facts,
            scans: scans.into_iter().collect::<Option<_>>().unwrap_or_default(),
            stated_grid: first.stated_grid,
        })
    }
}
