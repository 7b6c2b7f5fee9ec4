//! The two doors: a volume to compute with, or the facts alone.

use super::recognise::{Recognised, recognise};
use super::source::VolumeFile;
use super::{Volume, VolumeError, VolumeFacts, dicom, nifti};
use crate::progress::Monitor;

/// Which part of the file is wanted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// The volume's number, from 0, in a file that holds several: NIfTI's dimensions beyond the
    /// third, the fourth fastest; DICOM's gates, those of the first R-R interval first.
    /// Default: none, which suits files of one volume.
    pub frame: Option<usize>,
}

/// What a file may cost at most.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReadLimits {
    /// Voxels of one volume. Default 2^28: a gibibyte of `f32`, twice a 512^3 volume.
    pub voxels: u64,
    /// Bytes of the file after unpacking, up to the last voxel that is read. Default 4 GiB.
    pub unpacked_bytes: u64,
}

impl Default for ReadLimits {
    fn default() -> Self {
        Self {
            voxels: 1 << 28,
            unpacked_bytes: 4 << 30,
        }
    }
}

/// A volume and what was understood of its file.
#[derive(Debug, Clone)]
pub struct Reading {
    /// The voxels and their place.
    pub volume: Volume,
    /// The facts.
    pub facts: VolumeFacts,
}

/// Reads one volume from `files`: one file, or a `.hdr` and its `.img` in any
/// order.
///
/// # Errors
/// See [`VolumeError`]; in particular [`VolumeError::FrameNeeded`] where the file holds several
/// volumes and `options` names none.
pub fn read(
    files: &[VolumeFile],
    options: &ReadOptions,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Reading, VolumeError> {
    match recognise(files, limits)? {
        Recognised::Nifti { header, voxels } => {
            nifti::read(header, voxels, options, limits, monitor)
        }
        Recognised::Dicom(file) => dicom::read(file, options, limits, monitor),
    }
}

/// Says what `files` hold; of several volumes the intensities are taken together.
///
/// Every voxel is decoded once, so that a file which passes here can be read later.
///
/// # Errors
/// See [`VolumeError`].
pub fn inspect(
    files: &[VolumeFile],
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<VolumeFacts, VolumeError> {
    match recognise(files, limits)? {
        Recognised::Nifti { header, voxels } => nifti::inspect(header, voxels, limits, monitor),
        Recognised::Dicom(file) => dicom::inspect(file, limits, monitor),
    }
}

/// The frame asked for, or the only one.
pub(super) fn choose_frame(asked: Option<usize>, frames: usize) -> Result<usize, VolumeError> {
    match asked {
        None if frames == 1 => Ok(0),
        None => Err(VolumeError::FrameNeeded { frames }),
        Some(frame) if frame < frames => Ok(frame),
        Some(frame) => Err(VolumeError::FrameOutOfRange { frame, frames }),
    }
}
