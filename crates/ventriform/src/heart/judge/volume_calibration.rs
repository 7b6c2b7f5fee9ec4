//! Constants of the intervals about the volumes of a fit. Written by `scripts/measure/calibrate_intervals.py`: do not edit.
//!
//! In: volumes of fits to simulated hearts, and the true ones. Out: mean and deviation of the error.

use crate::base::numeric::error_terms::ErrorTerms;

/// Error of the volume of the anatomical wall, as a share of it.
pub(super) const WALL_ERROR: ErrorTerms = ErrorTerms {
    bias: -0.02,
    usual: 0.0,
    dark: 0.0,
    small: 0.108,
    thickness: 1.003,
};

/// Error of the volume of its cavity, as a share of it.
pub(super) const CAVITY_ERROR: ErrorTerms = ErrorTerms {
    bias: 0.032,
    usual: 0.0,
    dark: 0.0,
    small: 0.0,
    thickness: 0.581,
};
