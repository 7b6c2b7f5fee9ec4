//! Simulated scans as DICOM files, for those who have no scan at hand.
//!
//! In: the parameters of a phantom, or one of the [`Example`]s. Out: a Nuclear Medicine Image of a patient whose name
//! says that the scan is simulated. Scans of one seed are of one patient and one study.
//!
//! Guaranteed: the same parameters give the same bytes.

use crate::base::geometry::Vec3;
use crate::base::geometry::frame::{SingularAffine, VoxelToPatient};
use crate::base::progress::Monitor;
use crate::image::volume::phantom::{
    PerfusionDefect, PhantomBeat, PhantomError, PhantomParameters, phantom, phantom_gates,
    phantom_projections,
};
use crate::image::volume::{Provenance, Volume};
use crate::results::export::dicom::{
    DicomError, Moment, SourceScan, derived_uid, nuclear_image, nuclear_projections,
};

/// What the files say of where they come from.
pub const SIMULATED_NOTE: &str = "simulated, not patients";

/// What the wall lacks at stress in a pair for which nothing else is said: the territory of the left anterior descending
/// artery.
pub const DEFECTS_OF_A_PAIR: [PerfusionDefect; 4] = [defect(7), defect(8), defect(13), defect(14)];

/// A defect that leaves two fifths of the uptake.
const fn defect(segment: u8) -> PerfusionDefect {
    PerfusionDefect {
        segment,
        severity: 0.6,
    }
}

/// A simulated scan that needs no parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Example {
    /// A scan without gates.
    Scan,
    /// A gated scan.
    Gated,
    /// A gated scan at stress, with a defect that the one at rest does not have.
    Stress,
    /// The same patient at rest.
    Rest,
}

/// Why there is no file.
#[derive(Debug, thiserror::Error)]
pub enum ExampleError {
    /// The phantom cannot be made.
    #[error(transparent)]
    Phantom(#[from] PhantomError),
    /// The grid cannot be made.
    #[error(transparent)]
    Frame(#[from] SingularAffine),
    /// The file cannot be written.
    #[error(transparent)]
    Dicom(#[from] DicomError),
}

impl Example {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Scan, Self::Gated, Self::Stress, Self::Rest];

    /// `scan`, `gated`, `stress` or `rest`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scan => "scan",
            Self::Gated => "gated",
            Self::Stress => "stress",
            Self::Rest => "rest",
        }
    }

    /// The name of its file.
    pub fn file_name(self) -> String {
        format!("{}.dcm", self.name())
    }

    /// The file.
    ///
    /// # Errors
    /// [`ExampleError`]; none is known for the parameters that these examples have.
    pub fn file(self, monitor: &Monitor) -> Result<Vec<u8>, ExampleError> {
        let usual = PhantomParameters {
            shape: [64, 64, 44],
            spacing_mm: [6.4; 3],
            ..PhantomParameters::default()
        };
        let beat = PhantomBeat::default();
        let (parameters, beat) = match self {
            Self::Scan => (
                PhantomParameters {
                    defects: [4, 10, 15].map(defect).to_vec(),
                    seed: 21,
                    ..usual
                },
                None,
            ),
            Self::Gated => (PhantomParameters { seed: 22, ..usual }, Some(beat)),
            Self::Stress => (
                PhantomParameters {
                    defects: DEFECTS_OF_A_PAIR.to_vec(),
                    seed: 23,
                    ..usual
                },
                Some(PhantomBeat {
                    ejection_fraction_percent: 52.0,
                    ..beat
                }),
            ),
            Self::Rest => (
                PhantomParameters {
                    seed: 23,
                    scan: 1,
                    ..usual
                },
                Some(beat),
            ),
        };
        let role = match self {
            Self::Stress | Self::Rest => Some(self.name()),
            Self::Scan | Self::Gated => None,
        };
        let (volumes, gate_ms) = match beat {
            None => (vec![phantom(&parameters, monitor)?.volume], None),
            Some(beat) => {
                let gates = phantom_gates(&parameters, &beat, monitor)?.gates;
                let volumes = gates.into_iter().map(|gate| gate.volume).collect();
                (volumes, Some(beat.gate_ms()))
            }
        };
        Ok(simulated_slices(&parameters, &volumes, gate_ms, role)?)
    }
}

/// The volumes of a phantom, of which there is at least one, or of its gates, each `gate_ms` long, as a file; `role` is
/// `stress` or `rest`.
///
/// # Errors
/// [`DicomError`].
pub fn simulated_slices(
    parameters: &PhantomParameters,
    volumes: &[Volume],
    gate_ms: Option<f64>,
    role: Option<&str>,
) -> Result<Vec<u8>, DicomError> {
    let first = &volumes[0];
    let gated = if volumes.len() > 1 { "gated " } else { "" };
    let role = role.map_or_else(String::new, |role| format!("{role} "));
    let description = format!("{role}{gated}SPECT, simulated");
    let scan = SourceScan::new(
        patient(parameters),
        first.frame.clone(),
        first.shape,
        false,
        moment(),
    );
    nuclear_image(&scan, volumes, gate_ms, &description, SIMULATED_NOTE)
}

/// What `heads` detectors of a gamma camera count of a phantom, so many millions in all, as a file.
///
/// # Errors
/// [`ExampleError`].
pub fn simulated_projections(
    parameters: &PhantomParameters,
    counts_m: f64,
    heads: usize,
    monitor: &Monitor,
) -> Result<Vec<u8>, ExampleError> {
    let projections = phantom_projections(parameters, counts_m, monitor)?;
    let shape = projections.shape();
    let frame = VoxelToPatient::centred(shape, [projections.pixel_mm; 3], Vec3::zeros())?;
    let scan = SourceScan::new(patient(parameters), frame, shape, false, moment());
    Ok(nuclear_projections(
        &scan,
        &projections,
        heads,
        SIMULATED_NOTE,
    )?)
}

/// Whose scan it is said to be.
fn patient(parameters: &PhantomParameters) -> Provenance {
    let id = format!("SIMULATED{}", parameters.seed);
    Provenance {
        patient_name: Some("Simulated^Example".into()),
        study_uid: Some(derived_uid(&[b"simulated", id.as_bytes()])),
        study_description: Some("Myocardial perfusion, simulated".into()),
        study_date: Some(moment().date),
        patient_id: Some(id),
        ..Provenance::default()
    }
}

/// When it is said to have been made.
fn moment() -> Moment {
    Moment {
        date: "20000101".into(),
        time: "000000".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::volume::{ReadLimits, ReadOptions, VolumeFile, read, read_gates};

    #[test]
    fn examples_are_read_as_what_they_are() {
        for example in Example::ALL {
            let bytes = example.file(&Monitor::silent()).unwrap();
            assert_eq!(bytes, example.file(&Monitor::silent()).unwrap());
            let files = [VolumeFile::in_memory(example.file_name(), bytes)];
            let (limits, silent) = (ReadLimits::default(), Monitor::silent());
            let whose = if example == Example::Scan {
                let read = read(&files, &ReadOptions::default(), &limits, &silent);
                read.unwrap().provenance.unwrap()
            } else {
                let gated = read_gates(&files, false, &limits, &silent).unwrap();
                assert_eq!(gated.gates.len(), 8);
                assert_eq!(gated.timing.rr_ms, Some(900.0));
                gated.scans[0].clone()
            };
            assert_eq!(whose.patient_name.as_deref(), Some("Simulated^Example"));
            let role = matches!(example, Example::Stress | Example::Rest).then(|| example.name());
            assert_eq!(whose.rest_or_stress.as_deref(), role);
        }
    }
}
