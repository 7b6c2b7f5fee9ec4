//! Why there is no serial comparison.

use super::order::SCAN_COUNTS;
use crate::base::progress::Cancelled;
use crate::image::volume::VolumeError;
use crate::runs::gated::GatedError;
use crate::runs::segmentation::{SegmentationError, SegmentationFilesError};

/// Why there is no serial comparison. Scans are counted from 1, as they were given.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SerialError {
    /// Too few scans, or too many.
    #[error("{found} scans were given; {} to {} are compared", SCAN_COUNTS.start(), SCAN_COUNTS.end())]
    ScanCount {
        /// How many.
        found: usize,
    },
    /// All scans together have more voxels than are held.
    #[error("the scans have {voxels} voxels together, more than {limit}")]
    TooManyVoxels {
        /// Voxels of the scans up to the one that was too many.
        voxels: u64,
        /// The most that are held.
        limit: u64,
    },
    /// The files of a scan hold no usable volume.
    #[error("scan {scan}: {error}")]
    Volume {
        /// Which scan.
        scan: usize,
        /// Why.
        error: VolumeError,
    },
    /// A scan cannot be segmented.
    #[error("scan {scan}: {error}")]
    Segmentation {
        /// Which scan.
        scan: usize,
        /// Why.
        error: SegmentationError,
    },
    /// A gated scan gives no beat.
    #[error("scan {scan}: {error}")]
    Gated {
        /// Which scan.
        scan: usize,
        /// Why.
        error: GatedError,
    },
    /// The fitted model is no left ventricle with a wall.
    #[error("scan {scan}: the fitted model has no wall that can be compared")]
    NoVentricle {
        /// Which scan.
        scan: usize,
    },
    /// Two scans are one.
    #[error("scans {} and {} are one: {reason}", .scans[0], .scans[1])]
    SameScan {
        /// Which.
        scans: [usize; 2],
        /// How that shows.
        reason: &'static str,
    },
    /// The headers name two patients. Their values are personal data and are not repeated.
    #[error("scans {} and {} are of two patients: their headers differ in {}", .scans[0], .scans[1], .fields.join(", "))]
    OtherPatient {
        /// Which.
        scans: [usize; 2],
        /// The fields that differ.
        fields: Vec<&'static str>,
    },
    /// One scan is at rest and one at stress, or tracers or corrections differ.
    #[error("{field} differs between scans {} and {}{}", .scans[0], .scans[1], said(.stated.as_ref()))]
    MixedKinds {
        /// Which.
        scans: [usize; 2],
        /// What differs.
        field: &'static str,
        /// What their headers say; `None` where that is not to be repeated.
        stated: Option<[String; 2]>,
    },
    /// No wall is seen in two scans, or one has no uptake.
    #[error("no part of the wall has uptake in both of scans {} and {}", .scans[0], .scans[1])]
    NothingInCommon {
        /// Which, in the order of their dates.
        scans: [usize; 2],
    },
    /// A file cannot be written.
    #[error(transparent)]
    Files(SegmentationFilesError),
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// What two headers say, as the end of a sentence.
fn said(stated: Option<&[String; 2]>) -> String {
    stated.map_or_else(String::new, |[first, other]| {
        format!(": {first} and {other}")
    })
}

impl SerialError {
    /// The error without text of the scans' headers.
    #[must_use]
    pub fn without_header_text(&self) -> Self {
        let mut told = self.clone();
        if let Self::MixedKinds { stated, .. } = &mut told {
            *stated = None;
        }
        told
    }

    pub(super) fn of_volume(scan: usize, error: VolumeError) -> Self {
        match error {
            VolumeError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            error => Self::Volume { scan, error },
        }
    }

    pub(super) fn of_segmentation(scan: usize, error: SegmentationError) -> Self {
        match error {
            SegmentationError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            SegmentationError::Volume(error) => Self::Volume { scan, error },
            error => Self::Segmentation { scan, error },
        }
    }

    pub(super) fn of_gated(scan: usize, error: GatedError) -> Self {
        match error {
            GatedError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            GatedError::Volume(error) => Self::of_volume(scan, error),
            GatedError::Segmentation(error) => Self::of_segmentation(scan, error),
            error => Self::Gated { scan, error },
        }
    }
}

impl From<SegmentationFilesError> for SerialError {
    fn from(error: SegmentationFilesError) -> Self {
        match error {
            SegmentationFilesError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            error => Self::Files(error),
        }
    }
}
