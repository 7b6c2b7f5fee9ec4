//! Constants of comparisons. Written by `scripts/measure/calibrate_comparison.py`: do not edit.
//!
//! In: comparisons of simulated pairs of scans and of halves of a real one, and what truly changed. Out: how much
//! unchanged hearts differ.

/// Standard deviation of the smoothed difference of a usual pair where nothing changed, per cent of the rest map's reference.
pub(super) const USUAL_NOISE_POINTS: f64 = 5.6;

/// Noise of the smoothed difference for one point of what smoothing takes away.
pub(super) const SMOOTH_PER_FINE_NOISE: f64 = 1.84;

/// Noise in the apical, the middle and the basal rows of a map, as shares of that of the wall.
pub(super) const ROW_NOISE_SHARES: [f64; 3] = [1.25, 0.96, 0.83];

/// Standard deviations of noise that the greatest difference of an unchanged heart exceeds in four of a hundred pairs.
pub(super) const LIMIT_SDS: f64 = 3.8;

/// Standard deviation of the share of the wall that is found to have changed, as a share of it.
pub(super) const BORDER_SD_SHARE: f64 = 0.17;

/// Standard deviation of the logarithm of TID without noise.
pub(super) const TID_SD: f64 = 0.057;

/// Standard deviation of the logarithm of TID for each point of noise.
pub(super) const TID_SD_PER_POINT: f64 = 0.0143;

/// Share by which a turn must lower the mean squared difference.
pub(super) const SIGNIFICANT_TURN_GAIN: f64 = 0.3;

/// Standard deviation of the logarithm of the quotient of the walls' volumes without noise.
pub(super) const MUSCLE_SD: f64 = 0.053;

/// Standard deviation of the logarithm of the quotient of the walls' volumes for each point of noise.
pub(super) const MUSCLE_SD_PER_POINT: f64 = 0.0133;
