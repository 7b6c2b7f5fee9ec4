//! The files of a volume, as they are named on the command line.

use anyhow::{Result, anyhow};
use std::path::PathBuf;
use ventriform::image::volume::{ReadLimits, VolumeFile};
use ventriform::runs::advice::Explain;

/// The files that `paths` name; a folder stands for the files in it.
///
/// # Errors
/// If a folder cannot be read, or holds no or too many files.
pub(super) fn volume_files(paths: &[PathBuf], limits: &ReadLimits) -> Result<Vec<VolumeFile>> {
    VolumeFile::given(paths, limits).map_err(|error| anyhow!(error.with_advice()))
}
