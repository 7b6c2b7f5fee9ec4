//! Constants of the intervals about the figures of a beat. Written by `scripts/measure/calibrate_intervals.py`: do not edit.
//!
//! In: figures of fits to simulated gated studies, and the true ones. Out: mean and deviation of the error.

use crate::base::numeric::error_terms::ErrorTerms;

/// Error of the ejection fraction, points.
pub(super) const EF_ERROR: ErrorTerms = ErrorTerms {
    bias: 0.496,
    usual: 1.262,
    dark: 23.441,
    small: 6.357,
};

/// Error of the end-diastolic volume, as a share of it.
pub(super) const EDV_ERROR: ErrorTerms = ErrorTerms {
    bias: -0.025,
    usual: 0.024,
    dark: 0.225,
    small: 0.104,
};

/// Error of the end-systolic volume, as a share of it.
pub(super) const ESV_ERROR: ErrorTerms = ErrorTerms {
    bias: -0.026,
    usual: 0.007,
    dark: 0.0,
    small: 0.197,
};
