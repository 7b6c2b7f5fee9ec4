//! Constants of the intervals about the figures of a beat. Written by `scripts/calibrate_beats.py`: do not edit.
//!
//! In: figures of fits to simulated gated studies, and the true ones. Out: mean and deviation of the error.

use super::intervals::ErrorTerms;

/// Error of the ejection fraction, points.
pub(super) const EF_ERROR: ErrorTerms = ErrorTerms {
    bias: 0.643,
    usual: 1.363,
    dark: 24.133,
    small: 6.294,
};

/// Error of the end-diastolic volume, as a share of it.
pub(super) const EDV_ERROR: ErrorTerms = ErrorTerms {
    bias: -0.025,
    usual: 0.019,
    dark: 0.21,
    small: 0.108,
};

/// Error of the end-systolic volume, as a share of it.
pub(super) const ESV_ERROR: ErrorTerms = ErrorTerms {
    bias: -0.029,
    usual: 0.002,
    dark: 0.0,
    small: 0.198,
};
