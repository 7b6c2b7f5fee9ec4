//! Why there is no comparison.

use crate::base::progress::Cancelled;
use crate::heart::comparison::WhichScan;
use crate::image::volume::VolumeError;
use crate::runs::gated::GatedError;
use crate::runs::segmentation::{SegmentationError, SegmentationFilesError};

/// Why there is no comparison: one variant for each step that can fail, with that step's error.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ComparisonError {
    /// The files of a scan hold no usable volume.
    #[error("{scan}: {error}")]
    Volume {
        /// Which scan.
        scan: WhichScan,
        /// Why.
        error: VolumeError,
    },
    /// A scan cannot be segmented.
    #[error("{scan}: {error}")]
    Segmentation {
        /// Which scan.
        scan: WhichScan,
        /// Why.
        error: SegmentationError,
    },
    /// A gated scan gives no beat.
    #[error("{scan}: {error}")]
    Gated {
        /// Which scan.
        scan: WhichScan,
        /// Why.
        error: GatedError,
    },
    /// The fitted model is no left ventricle with a wall.
    #[error("{scan}: the fitted model has no wall whose uptake can be compared")]
    NoVentricle {
        /// Which scan.
        scan: WhichScan,
    },
    /// Both files hold the same voxels.
    #[error("stress and rest are one scan: {0}")]
    SameScan(&'static str),
    /// The headers name two patients. Their values are personal data and are not repeated.
    #[error("the scans are of two patients: their headers differ in {}", .0.join(", "))]
    OtherPatient(Vec<&'static str>),
    /// No wall is seen in both scans, or one has no uptake.
    #[error("no part of the wall has uptake in both scans")]
    NothingInCommon,
    /// A file cannot be written.
    #[error(transparent)]
    Files(SegmentationFilesError),
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl ComparisonError {
    pub(super) fn of_segmentation(scan: WhichScan, error: SegmentationError) -> Self {
        match error {
            SegmentationError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            SegmentationError::Volume(error) => Self::Volume { scan, error },
            error => Self::Segmentation { scan, error },
        }
    }

    pub(super) fn of_gated(scan: WhichScan, error: GatedError) -> Self {
        match error {
            GatedError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            GatedError::Volume(error) => Self::Volume { scan, error },
            GatedError::Segmentation(error) => Self::of_segmentation(scan, error),
            error => Self::Gated { scan, error },
        }
    }
}

impl From<SegmentationFilesError> for ComparisonError {
    fn from(error: SegmentationFilesError) -> Self {
        match error {
            SegmentationFilesError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            error => Self::Files(error),
        }
    }
}
