//! Constants of the intervals about the figures of a beat. Written by `scripts/measure/calibrate_intervals.py`: do not edit.
//!
//! In: figures of fits to simulated gated studies, and the true ones. Out: mean and deviation of the error.

use crate::base::numeric::error_terms::ErrorTerms;

/// Error of the ejection fraction, points.
pub(super) const EF_ERROR: ErrorTerms = ErrorTerms {
    bias: 0.965,
    usual: 3.34,
    dark: 59.016,
    small: 0.0,
    thickness: 0.139,
};

/// Error of the end-diastolic volume, as a share of it.
pub(super) const EDV_ERROR: ErrorTerms = ErrorTerms {
    bias: -0.021,
    usual: 0.0,
    dark: 0.0,
    small: 0.0,
    thickness: 0.439,
};

/// Error of the end-systolic volume, as a share of it.
pub(super) const ESV_ERROR: ErrorTerms = ErrorTerms {
    bias: -0.033,
    usual: 0.0,
    dark: 0.0,
    small: 0.0,
    thickness: 0.4,
};
