//! The two entry points: a volume to compute with, or only the facts about a file.

use super::dicom::{DicomFile, Provenance};
use super::limits::{ReadLimits, ReadOptions};
use super::open::{self, OpenVolume, Reading};
use super::recognise::{Recognised, recognise, volumes_among};
use super::source::VolumeFile;
use super::{VolumeError, VolumeFacts, archive, nifti};
use crate::draw::Image;
use crate::progress::Monitor;

/// Reads one volume from `files`: a single file, a `.hdr` file and its `.img` file in any order, the
/// DICOM files of a series, or a zip archive of them.
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

/// Whose scan the volume in `files` is; `None` unless they are DICOM. Only headers are read.
/// Where gates are summed, frames and instances are those of the first gate.
///
/// # Errors
/// [`VolumeError`], as for [`read()`].
pub fn provenance(
    files: &[VolumeFile],
    options: &ReadOptions,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Option<Provenance>, VolumeError> {
    let file = open(files, limits, monitor)?;
    let header = file.header();
    let frame = options.choose(header.frames, header.gated)?;
    Ok(file.provenance(frame.unwrap_or(0)))
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
    if let [file] = files
        && let Some(packed) = archive::files_in(file, limits)?
    {
        let packed = volumes_among(packed, file.name(), limits)?;
        return open_unpacked(&packed, limits, monitor);
    }
    open_unpacked(files, limits, monitor)
}

fn open_unpacked(
    files: &[VolumeFile],
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Box<dyn OpenVolume>, VolumeError> {
    Ok(match recognise(files, limits)? {
        Recognised::Nifti { header, voxels } => {
            Box::new(nifti::NiftiFile::open(header, voxels, limits)?)
        }
        Recognised::Dicom(files) => Box::new(DicomFile::open(&files, limits, monitor)?),
    })
}
