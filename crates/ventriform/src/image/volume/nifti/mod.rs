//! NIfTI-1 and NIfTI-2, in one file or two, in either byte order.
//!
//! After the NIfTI-1.1 header file `nifti1.h` (NIfTI DFWG 2004) and `nifti2.h` (2011), whose field
//! names are used throughout. `stated` reads the fields of either version, NIfTI-1 through the
//! `nifti` crate; `header` checks them; `place` computes the affine; `gates` tells gates of a heart
//! beat from other volumes; [`mod@write`] writes files, and [`grid`] carries the place of a scan's grid
//! to the masks that are written of it.
//!
//! Colour and complex data types are rejected, because the uptake cannot be told from their parts.
//! CIFTI files, which store matrices in a NIfTI-2 file, are rejected too.

mod bare;
mod gates;
pub mod grid;
mod header;
mod place;
mod stated;
pub mod write;

#[cfg(test)]
mod tests;

pub use bare::is_bare;
pub use grid::StatedGrid;
pub use write::{
    LabelEntry, MaskError, StoredType, TooLong, write, write_gates, write_labels, write_mask,
};

use self::header::Header;
use self::place::place;
use super::VolumeError;
use super::decode::VoxelReader;
use super::gate_timing::GateTiming;
use super::limits::ReadLimits;
use super::open::{Decoded, HeaderFacts, OpenVolume, Placement};
use super::source::{Source, VolumeFile};
use super::summary::Tally;
use crate::base::progress::{Monitor, Stage};

/// Checks the header of a file whose voxels are missing.
pub(super) fn check_header(file: &VolumeFile, limits: &ReadLimits) -> Result<(), VolumeError> {
    let header = Header::read(&mut Source::open(file, limits.unpacked_bytes)?)?;
    place(&header)?;
    Ok(())
}

/// What a warning says of volumes that nothing calls gates.
pub(super) const TAKEN_FOR_GATES: &str = "they are taken for gates of one heart beat";

/// A NIfTI file whose header has been read and checked.
pub(super) struct NiftiFile {
    header: Header,
    placement: Placement,
    source: Source,
    /// Why several volumes cannot be gates of one heart beat.
    not_gates: Option<String>,
}

impl NiftiFile {
    /// Reads and checks the header. `header_file` and `voxel_file` may be the same file.
    pub(super) fn open(
        header_file: &VolumeFile,
        voxel_file: &VolumeFile,
        limits: &ReadLimits,
    ) -> Result<Self, VolumeError> {
        let mut start = Source::open(header_file, limits.unpacked_bytes)?;
        let mut header = Header::read(&mut start)?;
        let placement = place(&header)?;
        let not_gates = gates::contradiction(&header);
        if header.frames > 1 && not_gates.is_none() {
            header.warnings.push(format!(
                "Nothing in the header says what the {} volumes are: {TAKEN_FOR_GATES}.",
                header.frames
            ));
        }
        let mut source = if header.pair {
            Source::open(voxel_file, limits.unpacked_bytes)?
        } else {
            start
        };
        header.check_size(&mut source, limits)?;
        Ok(Self {
            header,
            placement,
            source,
            not_gates,
        })
    }

    /// Bytes of the unpacked file up to the last voxel.
    pub(super) fn end(&self) -> u64 {
        self.header.frame_begin(self.header.frames)
    }
}

impl OpenVolume for NiftiFile {
    fn gate_timings(&self) -> Vec<GateTiming> {
        gates::timing(&self.header).into_iter().collect()
    }

    fn stated_grid(&self) -> Option<StatedGrid> {
        Some(StatedGrid::from_header(&self.header))
    }

    fn header(&self) -> HeaderFacts<'_> {
        HeaderFacts {
            file: &self.header.file,
            format: self.header.format(),
            byte_order: self.header.byte_order,
            compressed: self.source.is_gzip(),
            data_type: self.header.data_type.name(),
            scaling: self.header.scaling,
            file_shape: self.header.dim.clone(),
            frames: self.header.frames,
            gated: self.header.frames > 1 && self.not_gates.is_none(),
            shape: self.header.shape,
            placement: &self.placement,
            unit: self.header.unit,
            warnings: &self.header.warnings,
        }
    }

    fn assumes_gates(&self) -> bool {
        self.header.frames > 1 && self.not_gates.is_none()
    }

    fn why_not_gated(&self) -> Option<&str> {
        self.not_gates.as_deref()
    }

    fn decode_frame(&mut self, frame: usize, monitor: &Monitor) -> Result<Decoded, VolumeError> {
        let header = &self.header;
        let mut voxels = Vec::new();
        let mut reader = VoxelReader::new(header.voxel_format(), &mut self.source);
        let begin = header.frame_begin(frame);
        reader.append(begin, header.voxels(), &mut voxels, &mut |done| {
            monitor.report(Stage::Read, done)
        })?;
        let tally = reader.tally();
        let mut warnings = reader.warnings();
        if frame + 1 == header.frames {
            warnings.extend(reader.finish()?);
        }
        Ok(Decoded {
            voxels,
            tally,
            warnings,
        })
    }

    fn stream_frame(
        &mut self,
        frame: usize,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(), VolumeError> {
        let header = &self.header;
        let mut reader = VoxelReader::new(header.voxel_format(), &mut self.source);
        let report = &mut |done| monitor.report(Stage::Read, done);
        reader.stream(header.frame_begin(frame), header.voxels(), take, report)
    }

    fn stream_labels(
        &mut self,
        frame: usize,
        take: &mut dyn FnMut(usize, &[i64]),
        monitor: &Monitor,
    ) -> Result<(), VolumeError> {
        let header = &self.header;
        let mut reader = VoxelReader::new(header.voxel_format(), &mut self.source);
        let report = &mut |done| monitor.report(Stage::Read, done);
        reader.stream_exact(header.frame_begin(frame), header.voxels(), take, report)
    }

    fn decode_all(
        &mut self,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(Tally, Vec<String>), VolumeError> {
        let header = &self.header;
        let mut reader = VoxelReader::new(header.voxel_format(), &mut self.source);
        let begin = header.frame_begin(0);
        reader.tally_all(begin, header.voxels(), header.frames, take, monitor)?;
        let tally = reader.tally();
        let mut warnings = reader.warnings();
        warnings.extend(reader.finish()?);
        Ok((tally, warnings))
    }
}
