//! Constants of changes of the beat from rest to stress. Written by `scripts/measure/calibrate_comparison.py`: do not
//! edit.
//!
//! In: simulated gated pairs. Out: how much the figures of both beats differ beyond what truly changed.

use super::figure_change::ChangeError;

/// Ejection fraction, points.
pub(super) const EF: ChangeError = ChangeError {
    least: 3.24,
    per_point: 0.816,
};

/// Logarithm of the end-diastolic volume.
pub(super) const EDV: ChangeError = ChangeError {
    least: 0.0702,
    per_point: 0.0177,
};

/// Logarithm of the end-systolic volume.
pub(super) const ESV: ChangeError = ChangeError {
    least: 0.0576,
    per_point: 0.0145,
};

/// Inward motion of a segment, mm.
pub(super) const SEGMENT_MOTION: ChangeError = ChangeError {
    least: 0.96,
    per_point: 0.242,
};

/// Thickening of a segment, points.
pub(super) const SEGMENT_THICKENING: ChangeError = ChangeError {
    least: 7.19,
    per_point: 1.81,
};
