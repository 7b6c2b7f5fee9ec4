//! A file of gates without the volumes that are none, or of volumes that are no gates although nothing in the header
//! says so.

use super::dicom::one_scan::ScanStatement;
use super::gate_files::FILES_TAKEN_FOR_GATES;
use super::gate_look::{GateLook, called_by, look};
use super::gate_timing::GateTiming;
use super::left_out::LeftOut;
use super::nifti::{StatedGrid, TAKEN_FOR_GATES};
use super::open::{Decoded, HeaderFacts, OpenVolume};
use super::summary::Tally;
use super::{Provenance, Segment, VolumeError};
use crate::base::progress::Monitor;

/// A file of several volumes that was looked at.
struct JudgedGates {
    file: Box<dyn OpenVolume>,
    look: GateLook,
    /// All warnings about the header.
    warnings: Vec<String>,
}

/// `file` as it is, or judged if its volumes are taken for gates. `again` opens it once more.
///
/// # Errors
/// [`VolumeError`] if a volume cannot be decoded.
pub(super) fn judged(
    mut file: Box<dyn OpenVolume>,
    again: impl FnOnce() -> Result<Box<dyn OpenVolume>, VolumeError>,
    monitor: &Monitor,
) -> Result<Box<dyn OpenVolume>, VolumeError> {
    let header = file.header();
    let assumed = file.assumes_gates();
    if header.frames < 2 || !(header.gated || assumed) {
        return Ok(file);
    }
    let called = called_by(&*file);
    let mut look = look(&mut *file, &called, monitor)?;
    if !file.reads_again() {
        file = again()?;
    }
    let mut warnings = file.header().warnings.to_vec();
    if let Some(why) = &mut look.refusal {
        let taken = |warning: &String| {
            warning.contains(TAKEN_FOR_GATES) || warning.contains(FILES_TAKEN_FOR_GATES)
        };
        warnings.retain(|warning| !taken(warning));
        let names = file.volume_names();
        if !names.is_empty() {
            let list = names.iter().enumerate();
            let list: Vec<String> = list.map(|(n, name)| format!("{n} {name}")).collect();
            why.push_str(&format!("; the volumes are {}", list.join(", ")));
        }
    }
    warnings.append(&mut look.warnings);
    Ok(Box::new(JudgedGates {
        file,
        look,
        warnings,
    }))
}

impl OpenVolume for JudgedGates {
    fn header(&self) -> HeaderFacts<'_> {
        let header = self.file.header();
        HeaderFacts {
            gated: header.gated && self.look.refusal.is_none(),
            warnings: &self.warnings,
            ..header
        }
    }

    fn why_not_gated(&self) -> Option<&str> {
        self.look.refusal.as_deref()
    }

    fn left_out(&self) -> LeftOut {
        self.look.left_out.clone()
    }

    fn provenance(&self, frame: usize) -> Option<Provenance> {
        self.file.provenance(frame)
    }

    fn scan_statement(&self) -> Option<&ScanStatement> {
        self.file.scan_statement()
    }

    fn stated_grid(&self) -> Option<StatedGrid> {
        self.file.stated_grid()
    }

    fn problem(&self) -> Option<VolumeError> {
        self.file.problem()
    }

    fn gate_timings(&self) -> Vec<GateTiming> {
        self.file.gate_timings()
    }

    fn segments(&self) -> &[Segment] {
        self.file.segments()
    }

    fn decode_frame(&mut self, frame: usize, monitor: &Monitor) -> Result<Decoded, VolumeError> {
        self.file.decode_frame(frame, monitor)
    }

    fn stream_frame(
        &mut self,
        frame: usize,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(), VolumeError> {
        self.file.stream_frame(frame, take, monitor)
    }

    fn stream_coarse(
        &mut self,
        frame: usize,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(), VolumeError> {
        self.file.stream_coarse(frame, take, monitor)
    }

    fn decode_sum(
        &mut self,
        frames: &[usize],
        monitor: &Monitor,
    ) -> Option<Result<Decoded, VolumeError>> {
        self.file.decode_sum(frames, monitor)
    }

    fn stream_labels(
        &mut self,
        frame: usize,
        take: &mut dyn FnMut(usize, &[i64]),
        monitor: &Monitor,
    ) -> Result<(), VolumeError> {
        self.file.stream_labels(frame, take, monitor)
    }

    fn decode_all(
        &mut self,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(Tally, Vec<String>), VolumeError> {
        self.file.decode_all(take, monitor)
    }
}
