//! Constants of comparisons. Written by `scripts/measure/calibrate_comparison.py`: do not edit.
//!
//! In: comparisons of simulated pairs of scans, and what truly changed. Out: how much unchanged hearts differ.

/// Standard deviation of the smoothed difference where nothing changed, per cent of the rest map's reference.
pub const DIFFERENCE_SD_POINTS: f64 = 4.9;

/// Share by which a turn must lower the mean squared difference.
pub(super) const SIGNIFICANT_TURN_GAIN: f64 = 0.21;

/// Quotient of the walls' volumes beyond which they are hardly of one heart.
pub const MOST_MUSCLE_QUOTIENT: f64 = 1.21;
