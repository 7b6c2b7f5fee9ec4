//! Rounding of figures that are written.

/// Rounds to 4 decimals.
pub fn round(x: f64) -> f64 {
    (1e4 * x).round() / 1e4
}
