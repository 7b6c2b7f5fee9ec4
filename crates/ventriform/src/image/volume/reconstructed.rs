//! Volumes of projections, reconstructed as the caller says. The readers of this room reconstruct projections too, with
//! the defaults.

use super::gates::GatedReading;
use super::left_out::LeftOut;
use super::limits::{ReadLimits, ReadOptions};
use super::open::{self, Reading};
use super::read::{Told, open_as};
use super::source::VolumeFile;
use super::{FileFormat, Provenance, Volume, VolumeError, VolumeFacts};
use crate::base::progress::Monitor;
use crate::image::reconstruct::{Projections, Reconstruction};

/// What was reconstructed of the projections in a file.
#[derive(Debug, Clone)]
pub struct Reconstructed {
    /// One volume, or those of all gates; of several R-R intervals, of the one with the most counts.
    pub volumes: Vec<Volume>,
    /// The length of a gate, ms; `None` if there is one volume, or the file does not say.
    pub gate_ms: Option<f64>,
    /// Facts about the file, with warnings of all volumes.
    pub facts: VolumeFacts,
    /// Whose scan it is.
    pub provenance: Option<Provenance>,
}

/// The counts in `files` as the camera acquired them: of the volume `frame`, or of all gates together. `None` if the files
/// hold no projections.
///
/// # Errors
/// [`VolumeError`].
pub fn projections(
    files: &[VolumeFile],
    frame: Option<usize>,
    how: &Reconstruction,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Option<Projections>, VolumeError> {
    let opened = open_as(files, &Told::of(&(*how).into()), limits, monitor)?;
    let all: Vec<usize> = (0..opened.file.header().frames).collect();
    let frames = frame.map_or(all, |frame| vec![frame]);
    let counts = opened.file.projections(&frames, monitor).transpose();
    counts.map_err(|error| error.with_path(files))
}

/// Reconstructs the projections in `files` as `how` says: every gate, or one volume of the counts of all gates if
/// `summed`.
///
/// # Errors
/// [`VolumeError`]; [`VolumeError::NotSlices`] if the files hold no projections.
pub fn reconstructed(
    files: &[VolumeFile],
    how: &Reconstruction,
    summed: bool,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Reconstructed, VolumeError> {
    let mut opened = open_as(files, &Told::of(&(*how).into()), limits, monitor)?;
    let header = opened.file.header();
    if header.format != FileFormat::DicomProjections {
        return Err(VolumeError::NotSlices {
            file: header.file.to_owned(),
            image_type: header.format.as_str().to_owned(),
            reason: "it holds no projections, of which volumes are reconstructed",
            fix: "Give a DICOM Nuclear Medicine image of the Image Type TOMO or GATED TOMO.",
        });
    }
    let frames = header.frames;
    let voxels = header.shape.iter().product::<usize>() as u64 * frames as u64;
    let one = summed || frames == 1;
    if !one && voxels > limits.voxels {
        return Err(VolumeError::TooLarge {
            file: header.file.to_owned(),
            what: "voxels in its gates",
            asked: voxels,
            limit: limits.voxels,
        });
    }
    let mut read = |frame: Option<usize>, part: &Monitor| {
        let reading = open::read(&mut *opened.file, ReadOptions { frame }, part);
        reading.map_err(|error| error.with_path(files))
    };
    let mut made = if one {
        let Reading {
            volume,
            facts,
            provenance,
            ..
        } = read(None, monitor)?;
        Reconstructed {
            volumes: vec![volume],
            gate_ms: None,
            facts,
            provenance,
        }
    } else {
        let gates = (0..frames).map(|gate| read(Some(gate), &monitor.part(gate, frames)));
        let gates: Vec<Reading> = gates.collect::<Result<_, _>>()?;
        let (all, timings) = ((0..frames).collect(), opened.file.gate_timings());
        let gated = GatedReading::new(gates, all, &LeftOut::default(), &timings, &[])?;
        let number = gated.gates.len() as f64;
        let of_beat = gated.timing.rr_ms.map(|ms| ms / number);
        Reconstructed {
            gate_ms: gated.timing.frame_time_ms.or(of_beat),
            provenance: gated.provenance().cloned(),
            volumes: gated.gates,
            facts: gated.facts,
        }
    };
    made.facts.warnings.append(&mut opened.notes);
    Ok(made)
}
