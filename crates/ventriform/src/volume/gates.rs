//! The gates of one study: every volume of a file, or one file for each gate.
//!
//! In: a file whose volumes are the gates, or the files of the gates in their order. Out: all gates on one grid, and
//! what the file says of the beats. Of several R-R intervals, that with the most counts is taken; the others are
//! named in a warning.

use super::facts::VolumeFacts;
use super::nifti::grid::StatedGrid;
use super::open::Reading;
use super::provenance::Provenance;
use super::{Volume, VolumeError};

/// What a file says of the beats that were gated. Parts that it leaves out are `None`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GateTiming {
    /// Length of a gate, ms: Frame Time (0018,1063).
    pub frame_time_ms: Option<f64>,
    /// The R-R interval, ms: Nominal Interval (0018,1062).
    pub rr_ms: Option<f64>,
    /// The shortest R-R interval accepted, ms: Low R-R Value (0018,1081).
    pub low_rr_ms: Option<f64>,
    /// The longest R-R interval accepted, ms: High R-R Value (0018,1082).
    pub high_rr_ms: Option<f64>,
    /// Beats accepted: Intervals Acquired (0018,1083).
    pub beats_accepted: Option<f64>,
    /// Beats rejected: Intervals Rejected (0018,1084).
    pub beats_rejected: Option<f64>,
    /// Gates of each R-R interval; `None` if the format does not say, and all volumes are of one.
    pub gates_per_interval: Option<usize>,
}

impl GateTiming {
    /// The R-R interval of `gates` gates, ms: as stated, or of the length of a gate.
    pub fn rr_of(&self, gates: usize) -> Option<f64> {
        let of_frames = || self.frame_time_ms.map(|ms| ms * gates as f64);
        self.rr_ms.or_else(of_frames)
    }

    /// Share of the beats that were rejected, 0..=1.
    pub fn rejected_share(&self) -> Option<f64> {
        let (accepted, rejected) = (self.beats_accepted?, self.beats_rejected?);
        (accepted + rejected > 0.0).then(|| rejected / (accepted + rejected))
    }
}

/// The gates of a study and the facts of its files.
#[derive(Debug, Clone)]
pub struct GatedReading {
    /// The gates, in their order.
    pub gates: Vec<Volume>,
    /// What the file says of the beats.
    pub timing: GateTiming,
    /// Facts about the file, or that of the first gate, with warnings of all.
    pub facts: VolumeFacts,
    /// Whose scan it is; `None` unless the files are DICOM.
    pub provenance: Option<Provenance>,
    /// The place of the grid as the file states it; `None` unless it is NIfTI.
    pub stated_grid: Option<StatedGrid>,
}

impl GatedReading {
    /// The gates that were read one by one.
    pub(super) fn of(readings: Vec<Reading>, mut timing: GateTiming) -> Result<Self, VolumeError> {
        let mut readings = readings.into_iter();
        let first = readings.next().ok_or(VolumeError::NoFile)?.usable()?;
        let mut facts = first.facts;
        let mut gates = vec![first.volume];
        for reading in readings {
            for warning in reading.facts.warnings {
                if !facts.warnings.contains(&warning) {
                    facts.warnings.push(warning);
                }
            }
            gates.push(reading.volume);
        }
        let each = timing.gates_per_interval.unwrap_or(gates.len());
        if each > 0 && each < gates.len() && gates.len().is_multiple_of(each) {
            let counts: Vec<f64> = gates.chunks(each).map(counts_of).collect();
            let main = (1..counts.len()).fold(0, |m, n| if counts[n] > counts[m] { n } else { m });
            facts.warnings.push(format!(
                "The file has {} R-R intervals of {each} gates: interval {} has the most counts and was taken.",
                counts.len(),
                main + 1
            ));
            gates = gates.split_off(main * each);
            gates.truncate(each);
            if main > 0 {
                // The sequence's first item, which was read, is that of the first interval.
                timing = GateTiming::default();
            }
        }
        Ok(Self {
            gates,
            timing,
            facts,
            provenance: first.provenance,
            stated_grid: first.stated_grid,
        })
    }
}

fn counts_of(gates: &[Volume]) -> f64 {
    let values = gates.iter().flat_map(|gate| &gate.voxels);
    values
        .filter(|v| v.is_finite())
        .map(|v| f64::from(*v))
        .sum()
}
