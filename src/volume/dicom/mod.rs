//! Reconstructed slices in DICOM: the uncompressed multi-frame Nuclear Medicine Image.
//!
//! After DICOM PS3.3 C.8.4 (NM modules) and C.8.4.15 (position of the slices):
//!
//! 1. `syntax`: finds the data set and its encoding.
//! 2. `scan`: one pass over the data set collects the needed `attributes` and finds the pixels. It
//!    follows at most 32 nested sequences and rejects lengths beyond the size of the file.
//! 3. `frames`: assigns the stored frames to slices and gates by the vectors that the Frame
//!    Increment Pointer names, whatever the order of the frames in the file.
//! 4. `geometry`: the affine, including the sign of Spacing Between Slices.
//! 5. `pixels`: checks the pixel format; decoding is shared with the other formats.
//!
//! Only RECON TOMO and RECON GATED TOMO images contain slices; projections and planar images are
//! rejected, as are compressed and deflated transfer syntaxes. The error names the reason.

mod attributes;
mod frames;
mod geometry;
mod pixels;
mod provenance;
mod scan;
mod syntax;

#[cfg(test)]
mod tests;

pub use provenance::Provenance;
pub(super) use syntax::is_dicom;

use self::frames::FrameOrder;
use self::geometry::place;
use self::pixels::Pixels;
use super::VolumeError;
use super::decode::VoxelReader;
use super::facts::{FileFormat, LengthUnit};
use super::limits::ReadLimits;
use super::open::{Decoded, HeaderFacts, OpenVolume, Placement};
use super::source::{Source, VolumeFile};
use super::summary::Tally;
use crate::progress::{Monitor, Stage};

/// A DICOM file whose attributes have been read and checked.
pub(super) struct DicomFile {
    order: FrameOrder,
    placement: Placement,
    pixels: Pixels,
    source: Source,
    provenance: Provenance,
    warnings: Vec<String>,
}

impl DicomFile {
    /// Reads and checks the attributes of `file`.
    pub(super) fn open(
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
            provenance: Provenance::of(&scan.attributes),
            warnings,
        })
    }
}

impl OpenVolume for DicomFile {
    fn header(&self) -> HeaderFacts<'_> {
        let format = &self.pixels.format;
        let gates = self.order.gates();
        let mut file_shape = self.pixels.shape.to_vec();
        file_shape.extend((gates > 1).then_some(gates));
        HeaderFacts {
            file: &format.file,
            format: FileFormat::DicomNm,
            byte_order: format.byte_order,
            compressed: self.source.is_gzip(),
            data_type: format.data_type.name(),
            scaling: format.scaling,
            file_shape,
            frames: gates,
            shape: self.pixels.shape,
            placement: &self.placement,
            unit: LengthUnit::Millimetre,
            warnings: &self.warnings,
        }
    }

    fn provenance(&self, frame: usize) -> Option<Provenance> {
        let stored = self.order.slices_of(frame).iter();
        Some(Provenance {
            slice_frames: stored.map(|&frame| frame as u32 + 1).collect(),
            ..self.provenance.clone()
        })
    }

    /// Reads the slices of gate `frame` in stored order and then sorts them.
    fn decode_frame(&mut self, frame: usize, monitor: &Monitor) -> Result<Decoded, VolumeError> {
        let slices = self.order.slices_of(frame);
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
        if stored != slices {
            let mut sorted = Vec::with_capacity(voxels.len());
            for slice in slices {
                let at = stored.partition_point(|s| s < slice) * frame_voxels;
                sorted.extend_from_slice(&voxels[at..at + frame_voxels]);
            }
            voxels = sorted;
        }
        Ok(Decoded {
            voxels,
            tally,
            warnings,
        })
    }

    /// Reads the slices of gate `frame` one by one, as they lie in the file.
    fn stream_frame(
        &mut self,
        frame: usize,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(), VolumeError> {
        let pixels = &self.pixels;
        let voxels = pixels.frame_voxels();
        let mut stored: Vec<(usize, usize)> = self
            .order
            .slices_of(frame)
            .iter()
            .copied()
            .zip(0..)
            .collect();
        stored.sort_unstable();
        let mut reader = VoxelReader::new(pixels.format.clone(), &mut self.source);
        for (done, (at, slice)) in stored.iter().enumerate() {
            let begin = pixels.frame_begin(*at);
            let mut place = |first: usize, part: &[f32]| take(slice * voxels + first, part);
            reader.stream(begin, voxels, &mut place, &mut |share| {
                monitor.report(Stage::Read, (done as f64 + share) / stored.len() as f64)
            })?;
        }
        Ok(())
    }

    /// Decodes the frames in stored order, as many at a time as a gate has slices.
    fn decode_all(
        &mut self,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(Tally, Vec<String>), VolumeError> {
        let pixels = &self.pixels;
        let count = pixels.frame_voxels() * pixels.shape[2];
        let mut reader = VoxelReader::new(pixels.format.clone(), &mut self.source);
        reader.tally_all(
            pixels.frame_begin(0),
            count,
            self.order.gates(),
            take,
            monitor,
        )?;
        Ok((reader.tally(), reader.warnings()))
    }
}
