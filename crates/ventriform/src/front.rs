//! The library in a call each: no limits, files or monitors to set up.
//!
//! In: a path, or voxels in memory. Out: a [`Scan`], and of that a model, a segmentation, or the agreement of two
//! masks. Every function calls the one of its module with [`ReadLimits::default`] and a silent monitor. Programs that
//! show progress, cancel, or take files from strangers call those: [`pipeline::generate`],
//! [`segmentation::from_files`], [`read_mask`].

use crate::base::progress::Monitor;
use crate::image::grid::Volume;
use crate::image::grid::agreement::Agreement;
use crate::image::volume::given_mask::{
    GivenMask, GivenMaskError, MaskAgreementError, MaskChoice, read_mask,
};
use crate::image::volume::{self, ReadLimits, VolumeError, VolumeFacts, VolumeFile};
use crate::parameters::{FitParameters, ModelParameters};
use crate::runs::pipeline::{self, Model, PipelineError};
use crate::runs::segmentation::{self, SegmentationError, SegmentationOrder, SegmentedVolume};
use std::path::Path;

/// A volume, or the gates of a study, that can be read: files whose every voxel was decoded once, or arrays.
#[derive(Debug, Clone)]
pub struct Scan {
    files: Vec<VolumeFile>,
    facts: VolumeFacts,
}

impl Scan {
    /// The scan in `files`, as [`volume::read`] takes them. They are read again when the scan is used.
    ///
    /// # Errors
    /// [`VolumeError`].
    pub fn new(files: Vec<VolumeFile>) -> Result<Self, VolumeError> {
        let facts = volume::inspect(&files, &ReadLimits::default(), &Monitor::silent())?;
        Ok(Self { files, facts })
    }

    /// Its files.
    pub fn files(&self) -> &[VolumeFile] {
        &self.files
    }

    /// Format, shape, place, values and warnings.
    pub fn facts(&self) -> &VolumeFacts {
        &self.facts
    }
}

impl TryFrom<Volume> for Scan {
    type Error = VolumeError;

    /// The volume in memory as a scan.
    ///
    /// # Errors
    /// [`VolumeError::NoFiniteVoxel`].
    fn try_from(volume: Volume) -> Result<Self, VolumeError> {
        Self::new(vec![VolumeFile::of_arrays("the array", [volume])])
    }
}

/// The scan at `path`: NIfTI or DICOM, a folder or a zip archive of one series.
///
/// # Errors
/// [`VolumeError`].
pub fn open(path: impl AsRef<Path>) -> Result<Scan, VolumeError> {
    Scan::new(VolumeFile::given(&[path], &ReadLimits::default())?)
}

/// A model of `scan`.
///
/// # Errors
/// [`PipelineError`].
pub fn generate(scan: &Scan, parameters: &ModelParameters) -> Result<Model, PipelineError> {
    let limits = ReadLimits::default();
    pipeline::generate(&scan.files, parameters, &limits, &Monitor::silent())
}

/// The left ventricle of `scan`, by the built-in hearts.
///
/// # Errors
/// [`SegmentationError`].
pub fn segment(
    scan: &Scan,
    parameters: &FitParameters,
) -> Result<SegmentedVolume, SegmentationError> {
    let order = SegmentationOrder::of_built_in_hearts(&scan.files, parameters);
    segmentation::from_files(&order, &ReadLimits::default(), &Monitor::silent())
}

/// The mask at `path`: a volume with one structure, a DICOM Segmentation, or a closed surface.
///
/// # Errors
/// [`GivenMaskError`].
pub fn open_mask(path: impl AsRef<Path>) -> Result<GivenMask, GivenMaskError> {
    let limits = ReadLimits::default();
    let files = VolumeFile::given(&[path], &limits).map_err(GivenMaskError::File)?;
    read_mask(&files, &MaskChoice::default(), &limits, &Monitor::silent())
}

/// The agreement of `mask` with `reference`; both on one lattice of voxels, however they are stored.
///
/// # Errors
/// [`MaskAgreementError`].
pub fn measure(mask: GivenMask, reference: GivenMask) -> Result<Agreement, MaskAgreementError> {
    let made = mask.agreement(reference, false, &Monitor::silent())?;
    Ok(made.agreement)
}
