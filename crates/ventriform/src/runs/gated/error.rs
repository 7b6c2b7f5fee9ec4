//! Why there is no beat of a study.

use crate::base::progress::Cancelled;
use crate::heart::beat::BeatError;
use crate::image::volume::VolumeError;
use crate::runs::segmentation::{SegmentationError, SegmentationFilesError};

/// Why there is no beat of a study: one variant for each step that can fail, with that step's error.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GatedError {
    /// The files hold no gates.
    #[error(transparent)]
    Volume(VolumeError),
    /// The gates' sum cannot be segmented.
    #[error(transparent)]
    Segmentation(SegmentationError),
    /// The gates give no beat.
    #[error(transparent)]
    Beat(BeatError),
    /// A file cannot be written.
    #[error(transparent)]
    Files(SegmentationFilesError),
    /// A parameter lies outside of its range.
    #[error("`{name}` is {value}; it must be {least} to {greatest}")]
    Parameter {
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The least value.
        least: f64,
        /// The greatest value.
        greatest: f64,
    },
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<VolumeError> for GatedError {
    fn from(error: VolumeError) -> Self {
        match error {
            VolumeError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            error => Self::Volume(error),
        }
    }
}

impl From<SegmentationError> for GatedError {
    fn from(error: SegmentationError) -> Self {
        match error {
            SegmentationError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            error => Self::Segmentation(error),
        }
    }
}

impl From<BeatError> for GatedError {
    fn from(error: BeatError) -> Self {
        match error {
            BeatError::Cancelled => Self::Cancelled(Cancelled),
            error => Self::Beat(error),
        }
    }
}
