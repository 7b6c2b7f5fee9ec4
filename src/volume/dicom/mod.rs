//! Reconstructed slices in DICOM: the multi-frame Nuclear Medicine Image, not compressed.
//!
//! After DICOM PS3.3 C.8.4 (the NM modules) and C.8.4.15 (where the slices lie):
//!
//! 1. `scan`: one pass over the data set keeps the few attributes that matter and finds where
//!    the pixels stand. It never goes deeper than 32 sequences and believes no length that the
//!    file cannot hold.
//! 2. `frames`: which stored frame is which slice of which gate, by the frame increment
//!    pointer's vectors, never by their order in the file.
//! 3. `geometry`: the affine, with the sign of Spacing Between Slices.
//! 4. the voxels are decoded as those of other formats are.
//!
//! Only RECON TOMO and RECON GATED TOMO show slices; projections and planar pictures are refused
//! with the reason. So are compressed and deflated transfer syntaxes, by their names.

mod frames;
mod geometry;
mod pixels;
mod scan;
mod syntax;

#[cfg(test)]
mod tests;

pub(super) use syntax::is_dicom;

use self::frames::FrameOrder;
use self::geometry::{Placement, place};
use self::pixels::Pixels;
use super::decode::VoxelReader;
use super::facts::{Format, LengthUnit};
use super::read::choose_frame;
use super::source::{Source, VolumeFile};
use super::summary::{Tally, judge};
use super::{IntensitySummary, ReadLimits, ReadOptions, Reading, Volume, VolumeError, VolumeFacts};
use crate::progress::{Monitor, Stage};

/// Reads the gate that `options` name, or the only volume.
pub(super) fn read(
    file: &VolumeFile,
    options: &ReadOptions,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Reading, VolumeError> {
    let mut opened = Opened::open(file, limits, monitor)?;
    let gate = choose_frame(options.frame, opened.order.gates())?;
    let (voxels, tally, warnings) = opened.read_gate(gate, monitor)?;
    let shape = opened.pixels.shape;
    let intensity = tally.with_labels(&voxels, shape[0]);
    let integral = intensity.integral;
    let facts = opened.facts(Some(gate), intensity, warnings)?;
    let volume = Volume {
        shape,
        voxels,
        frame: opened.placement.frame,
        integral,
    };
    Ok(Reading { volume, facts })
}

/// Decodes every frame of the file and keeps the facts.
pub(super) fn inspect(
    file: &VolumeFile,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<VolumeFacts, VolumeError> {
    let mut opened = Opened::open(file, limits, monitor)?;
    let gates = opened.order.gates();
    if gates == 1 {
        return Ok(read(file, &ReadOptions::default(), limits, monitor)?.facts);
    }
    let pixels = &opened.pixels;
    let mut voxels = Vec::new();
    let mut reader = VoxelReader::new(pixels.format.clone(), &mut opened.source);
    let count = pixels.frame_voxels() * pixels.shape[2];
    for part in 0..gates {
        // As many frames as a gate has, whichever gates they belong to.
        voxels.clear();
        let begin = pixels.frame_begin(part * pixels.shape[2]);
        reader.append(begin, count, &mut voxels, &mut |done| {
            monitor.report(Stage::Read, (part as f64 + done) / gates as f64)
        })?;
    }
    let (tally, warnings) = (reader.tally(), reader.warnings());
    opened.facts(None, tally.summary(None), warnings)
}

/// A file whose attributes were read and checked, open where its pixels are.
struct Opened {
    order: FrameOrder,
    placement: Placement,
    pixels: Pixels,
    source: Source,
    warnings: Vec<String>,
}

impl Opened {
    fn open(
        file: &VolumeFile,
        limits: &ReadLimits,
        monitor: &Monitor,
    ) -> Result<Self, VolumeError> {
        let syntax = syntax::find(file, limits)?;
        let mut source = Source::open(file, limits.unpacked_bytes)?;
        source.skip_to(syntax.data_set)?;
        let scan = scan::scan(&mut source, &syntax, monitor)?;
        let mut warnings = Vec::new();
        let gated = frames::check_kind(&scan.attributes)?;
        let order = FrameOrder::of(&scan.attributes, gated, &mut warnings)?;
        let pixels = Pixels::of(&scan, order.slices(), order.gates(), limits, &source)?;
        let placement = place(&scan.attributes, pixels.shape)?;
        Ok(Self {
            order,
            placement,
            pixels,
            source,
            warnings,
        })
    }

    /// The slices of `gate`, stacked, their figures and what is to be said about their values.
    fn read_gate(
        &mut self,
        gate: usize,
        monitor: &Monitor,
    ) -> Result<(Vec<f32>, Tally, Vec<String>), VolumeError> {
        let slices = self.order.slices_of(gate);
        let pixels = &self.pixels;
        let frame_voxels = pixels.frame_voxels();
        let mut stored = slices.to_vec();
        stored.sort_unstable();
        let mut voxels = Vec::new();
        let mut reader = VoxelReader::new(pixels.format.clone(), &mut self.source);
        let mut done = 0;
        for run in stored.chunk_by(|a, b| a + 1 == *b) {
            let begin = pixels.frame_begin(run[0]);
            reader.append(begin, run.len() * frame_voxels, &mut voxels, &mut |share| {
                let frames = done as f64 + share * run.len() as f64;
                monitor.report(Stage::Read, frames / slices.len() as f64)
            })?;
            done += run.len();
        }
        let (tally, warnings) = (reader.tally(), reader.warnings());
        if stored == slices {
            return Ok((voxels, tally, warnings));
        }
        let mut ordered = Vec::with_capacity(voxels.len());
        for frame in slices {
            let at = stored.partition_point(|s| s < frame) * frame_voxels;
            ordered.extend_from_slice(&voxels[at..at + frame_voxels]);
        }
        Ok((ordered, tally, warnings))
    }

    fn facts(
        &self,
        frame: Option<usize>,
        intensity: IntensitySummary,
        voxel_warnings: Vec<String>,
    ) -> Result<VolumeFacts, VolumeError> {
        let format = &self.pixels.format;
        let mut warnings = self.warnings.clone();
        warnings.extend(self.placement.warnings.iter().cloned());
        warnings.extend(voxel_warnings);
        warnings.extend(judge(&intensity, &format.file)?);
        let gates = self.order.gates();
        let mut file_shape = self.pixels.shape.to_vec();
        file_shape.extend((gates > 1).then_some(gates));
        Ok(VolumeFacts {
            format: Format::DicomNm,
            byte_order: format.byte_order,
            compressed: self.source.is_gzip(),
            data_type: format.data_type.name(),
            scaling: format.scaling,
            file_shape,
            frames: gates,
            frame,
            shape: self.pixels.shape,
            spacing_mm: self.placement.frame.spacing(),
            // Added to 0, a negative zero loses its sign.
            affine_lps: self.placement.frame.matrix().add_scalar(0.0),
            affine_ras: self.placement.frame.to_ras().add_scalar(0.0),
            affine_source: self.placement.source,
            unit: LengthUnit::Millimetre,
            intensity,
            warnings,
        })
    }
}
