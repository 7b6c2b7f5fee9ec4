//! Constants of changes over the years. Written by `scripts/measure/calibrate_serial.py`: do not edit.
//!
//! In: simulated hearts, and halves of a real one, that were scanned again. Out: how much their figures differ beyond
//! what truly changed.

use crate::heart::comparison::ChangeError;

/// Ejection fraction, points.
pub(super) const EF: ChangeError = ChangeError {
    least: 2.62,
    per_point: 0.565,
};

/// Logarithm of the end-diastolic volume.
pub(super) const EDV: ChangeError = ChangeError {
    least: 0.0496,
    per_point: 0.0107,
};

/// Logarithm of the end-systolic volume.
pub(super) const ESV: ChangeError = ChangeError {
    least: 0.0655,
    per_point: 0.0141,
};

/// Logarithm of the cavity in the image of all gates.
pub(super) const CAVITY: ChangeError = ChangeError {
    least: 0.0352,
    per_point: 0.00758,
};

/// Logarithm of the muscle's mass, each scan's own.
pub(super) const MASS: ChangeError = ChangeError {
    least: 0.0511,
    per_point: 0.011,
};

/// Share of the wall below the threshold, points.
pub(super) const DARK: ChangeError = ChangeError {
    least: 2.05,
    per_point: 0.441,
};

/// Mean inward motion, mm.
pub(super) const MOTION: ChangeError = ChangeError {
    least: 0.461,
    per_point: 0.0993,
};

/// Mean thickening, points.
pub(super) const THICKENING: ChangeError = ChangeError {
    least: 2.7,
    per_point: 0.581,
};

/// Standard deviation of the phases, degrees.
pub(super) const PHASE_SD: ChangeError = ChangeError {
    least: 1.31,
    per_point: 0.281,
};

/// Bandwidth of the phases, degrees.
pub(super) const PHASE_BANDWIDTH: ChangeError = ChangeError {
    least: 5.32,
    per_point: 1.14,
};

/// Mean uptake of a segment, points.
pub(super) const SEGMENT_UPTAKE: ChangeError = ChangeError {
    least: 2.22,
    per_point: 0.477,
};
