//! The two entry points: a volume to compute with, or only the facts about a file.

use super::limits::{ReadLimits, ReadOptions};
use super::open::{self, OpenVolume, Reading};
use super::recognise::{Recognised, recognise};
use super::source::VolumeFile;
use super::{VolumeError, VolumeFacts, dicom, nifti};
use crate::draw::Image;
use crate::progress::Monitor;

/// Reads one volume from `files`: a single file, or a `.hdr` file and its `.img` file in any order.
///
/// # Errors
/// [`VolumeError`]; in particular [`VolumeError::FrameNeeded`] if the file holds several volumes
/// and `options` name none.
pub fn read(
    files: &[VolumeFile],
    options: &ReadOptions,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Reading, VolumeError> {
    open::read(&mut *open(files, limits, monitor)?, *options, monitor)
}

/// Returns the facts about `files`. For several volumes the intensities are taken over all of them.
///
/// Every voxel is decoded, so that a file that passes here can also be read. The voxels are not kept,
/// so this needs less memory than [`read()`].
///
/// # Errors
/// [`VolumeError`].
pub fn inspect(
    files: &[VolumeFile],
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<VolumeFacts, VolumeError> {
    open::inspect(|| open(files, limits, monitor), monitor)
}

/// Draws the three middle slices of the first volume in `files`; see [`mod@super::preview`]. The
/// volume is decoded in portions and not held in memory.
///
/// # Errors
/// [`VolumeError`].
pub fn preview_files(
    files: &[VolumeFile],
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Image<1>, VolumeError> {
    open::preview(&mut *open(files, limits, monitor)?, monitor)
}

/// Recognises the format of `files` and checks the header.
fn open(
    files: &[VolumeFile],
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Box<dyn OpenVolume>, VolumeError> {
    Ok(match recognise(files, limits)? {
        Recognised::Nifti { header, voxels } => {
            Box::new(nifti::NiftiFile::open(header, voxels, limits)?)
        }
        Recognised::Dicom(file) => Box::new(dicom::DicomFile::open(file, limits, monitor)?),
    })
}
