//! NIfTI-1 and NIfTI-2, in one file or two, in either byte order.
//!
//! After the NIfTI-1.1 header file `nifti1.h` (NIfTI DFWG 2004) and `nifti2.h` (2011), whose
//! field names are used throughout. `header` reads and checks the fields, `place` makes the
//! affine of them, [`mod@write`] is the way back.
//!
//! Colours and complex numbers are refused: there is no telling which of their parts is the
//! uptake. So are CIFTI files, which hold matrices in a NIfTI-2 coat.

mod header;
mod place;
pub mod write;

#[cfg(test)]
mod tests;

pub use write::{MaskError, StoredType, TooLong, write, write_mask};

use self::header::Header;
use self::place::{Placement, place};
use super::decode::VoxelReader;
use super::read::choose_frame;
use super::source::{Source, VolumeFile};
use super::summary::judge;
use super::{IntensitySummary, ReadLimits, ReadOptions, Reading, Volume, VolumeError, VolumeFacts};
use crate::progress::{Monitor, Stage};

/// Reads the volume that `options` name. `header_file` and `voxel_file` may be the same.
pub(super) fn read(
    header_file: &VolumeFile,
    voxel_file: &VolumeFile,
    options: &ReadOptions,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Reading, VolumeError> {
    let mut file = Opened::open(header_file, voxel_file, limits)?;
    let frame = choose_frame(options.frame, file.header.frames)?;
    let header = &file.header;
    let mut voxels = Vec::new();
    let mut reader = VoxelReader::new(header.voxel_format(), &mut file.source);
    let begin = header.frame_begin(frame);
    reader.append(begin, header.voxels(), &mut voxels, &mut |done| {
        monitor.report(Stage::Read, done)
    })?;
    let tally = reader.tally();
    let mut warnings = reader.warnings();
    if frame + 1 == header.frames {
        warnings.extend(reader.finish()?);
    }
    let shape = file.header.shape;
    let intensity = tally.with_labels(&voxels, shape[0]);
    let integral = intensity.integral;
    let facts = file.facts(Some(frame), intensity, warnings)?;
    let volume = Volume {
        shape,
        voxels,
        frame: file.placement.frame,
        integral,
    };
    Ok(Reading { volume, facts })
}

/// Decodes every volume of the file, one after the other, and keeps the facts.
pub(super) fn inspect(
    header_file: &VolumeFile,
    voxel_file: &VolumeFile,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<VolumeFacts, VolumeError> {
    let mut file = Opened::open(header_file, voxel_file, limits)?;
    let frames = file.header.frames;
    if frames == 1 {
        let only = ReadOptions { frame: Some(0) };
        return Ok(read(header_file, voxel_file, &only, limits, monitor)?.facts);
    }
    let header = &file.header;
    let mut voxels = Vec::new();
    let mut reader = VoxelReader::new(header.voxel_format(), &mut file.source);
    for frame in 0..frames {
        voxels.clear();
        let begin = header.frame_begin(frame);
        reader.append(begin, header.voxels(), &mut voxels, &mut |done| {
            monitor.report(Stage::Read, (frame as f64 + done) / frames as f64)
        })?;
    }
    let tally = reader.tally();
    let mut warnings = reader.warnings();
    warnings.extend(reader.finish()?);
    file.facts(None, tally.summary(None), warnings)
}

/// Checks a header whose voxels are not at hand.
pub(super) fn check_header(file: &VolumeFile, limits: &ReadLimits) -> Result<(), VolumeError> {
    let header = Header::read(&mut Source::open(file, limits.unpacked_bytes)?)?;
    place(&header)?;
    Ok(())
}

/// A file whose header was read and checked, open where its voxels are.
struct Opened {
    header: Header,
    placement: Placement,
    compressed: bool,
    source: Source,
}

impl Opened {
    fn open(
        header_file: &VolumeFile,
        voxel_file: &VolumeFile,
        limits: &ReadLimits,
    ) -> Result<Self, VolumeError> {
        let mut start = Source::open(header_file, limits.unpacked_bytes)?;
        let header = Header::read(&mut start)?;
        let placement = place(&header)?;
        let mut source = match header.pair {
            true => Source::open(voxel_file, limits.unpacked_bytes)?,
            false => start,
        };
        header.check_size(&mut source, limits)?;
        Ok(Self {
            compressed: source.is_gzip(),
            header,
            placement,
            source,
        })
    }

    fn facts(
        &self,
        frame: Option<usize>,
        intensity: IntensitySummary,
        voxel_warnings: Vec<String>,
    ) -> Result<VolumeFacts, VolumeError> {
        let mut warnings = self.header.warnings.clone();
        warnings.extend(self.placement.warnings.iter().cloned());
        warnings.extend(voxel_warnings);
        warnings.extend(judge(&intensity, &self.header.file)?);
        Ok(VolumeFacts {
            format: self.header.format(),
            byte_order: self.header.byte_order,
            compressed: self.compressed,
            data_type: self.header.data_type.name(),
            scaling: self.header.scaling,
            file_shape: self.header.dim.clone(),
            frames: self.header.frames,
            frame,
            shape: self.header.shape,
            spacing_mm: self.placement.frame.spacing(),
            // Added to 0, a negative zero loses its sign.
            affine_lps: self.placement.frame.matrix().add_scalar(0.0),
            affine_ras: self.placement.frame.to_ras().add_scalar(0.0),
            affine_source: self.placement.source,
            unit: self.header.unit,
            intensity,
            warnings,
        })
    }
}
