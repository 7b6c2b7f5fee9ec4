//! Volumes of projections, reconstructed as the caller says. The readers of this room reconstruct projections too, with
//! the defaults.

use super::gate_timing::GateTiming;
use super::limits::{ReadLimits, ReadOptions};
use super::open;
use super::read::{Told, open_as};
use super::source::VolumeFile;
use super::{FileFormat, Provenance, Volume, VolumeError, VolumeFacts};
use crate::base::progress::Monitor;
use crate::image::reconstruct::Reconstruction;

/// What was reconstructed of the projections in a file.
#[derive(Debug, Clone)]
pub struct Reconstructed {
    /// One volume, or those of all gates: time slots of all R-R intervals, those of the first interval first.
    pub volumes: Vec<Volume>,
    /// The length of a gate, ms; `None` if there is one volume, or the file does not say.
    pub gate_ms: Option<f64>,
    /// Facts about the file, with warnings of all volumes.
    pub facts: VolumeFacts,
    /// Whose scan it is.
    pub provenance: Option<Provenance>,
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
    let told = Told {
        how: *how,
        ..Told::default()
    };
    let mut opened = open_as(files, &told, limits, monitor)?;
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
    let chosen: Vec<Option<usize>> = match one {
        true => vec![None],
        false => (0..frames).map(Some).collect(),
    };
    let mut volumes = Vec::with_capacity(chosen.len());
    let mut first: Option<(VolumeFacts, Option<Provenance>)> = None;
    for (done, frame) in chosen.iter().enumerate() {
        let part = monitor.part(done, chosen.len());
        let options = ReadOptions { frame: *frame };
        let reading = open::read(&mut *opened.file, options, &part);
        let reading = reading.map_err(|error| error.with_path(files))?;
        volumes.push(reading.volume);
        match &mut first {
            None => first = Some((reading.facts, reading.provenance)),
            Some((facts, _)) => {
                let known = |warning: &String| !facts.warnings.contains(warning);
                let new: Vec<String> = reading.facts.warnings.into_iter().filter(known).collect();
                facts.warnings.extend(new);
            }
        }
    }
    let (mut facts, provenance) = first.ok_or(VolumeError::NoFile)?;
    facts.warnings.append(&mut opened.notes);
    Ok(Reconstructed {
        gate_ms: match one {
            true => None,
            false => gate_ms(opened.file.gate_timings(), frames),
        },
        volumes,
        facts,
        provenance,
    })
}

/// The length of a gate of the first R-R interval, ms.
fn gate_ms(timings: Vec<GateTiming>, frames: usize) -> Option<f64> {
    let timing = timings.into_iter().next()?;
    let gates = timing.gates_of_interval(frames) as f64;
    timing.frame_time_ms.or(timing.rr_ms.map(|ms| ms / gates))
}
