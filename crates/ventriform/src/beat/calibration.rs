//! Constants of the intervals about the figures of a beat. Written by `scripts/calibrate_beats.py`: do not edit.
//!
//! In: figures of fits to simulated gated studies, and the true ones. Out: mean and deviation of the error.

use super::error_terms::ErrorTerms;

/// Error of the ejection fraction, points.
pub(super) const EF_ERROR: ErrorTerms = ErrorTerms {
    bias: 0.487,
    usual: 1.097,
    dark: 23.275,
    small: 6.72,
};

/// Error of the end-diastolic volume, as a share of it.
pub(super) const EDV_ERROR: ErrorTerms = ErrorTerms {
    bias: -0.025,
    usual: 0.02,
    dark: 0.216,
    small: 0.107,
};

/// Error of the end-systolic volume, as a share of it.
pub(super) const ESV_ERROR: ErrorTerms = ErrorTerms {
    bias: -0.026,
    usual: 0.0,
    dark: 0.0,
    small: 0.202,
};
