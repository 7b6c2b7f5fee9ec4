//! The calibrated model of a ventricle's rim: the shape that rims have, and how much of a distance from it is taken back.
//!
//! In: angles about the long axis, and a distance of the rim from its shape. Out: heights and the distance by which
//! the rim moves. The constants are in [`calibration`](super::calibration).

/// Harmonics of the rim's shape: the cosines and sines of one to three times the angle.
pub const RIM_HARMONICS: usize = 3;
/// Coefficients of the rim's shape.
pub const RIM_TERMS: usize = 2 * RIM_HARMONICS;

/// Coefficients of one harmonic of the rim's height towards the apex, shares of the heart's length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RimHarmonic {
    /// Of the cosine of a multiple of the angle from lateral over anterior.
    pub cosine: f64,
    /// Of its sine.
    pub sine: f64,
}

/// The shape of the rims of hearts.
#[derive(Debug)]
pub struct RimShape {
    /// Mean coefficients, of one to three times the angle.
    pub mean: [RimHarmonic; RIM_HARMONICS],
    /// Inverse of the coefficients' covariance, in the order of [`RimShape::mean_terms`].
    pub precision: [[f64; RIM_TERMS]; RIM_TERMS],
}

impl RimShape {
    /// Mean coefficients: cosine and sine of each harmonic in turn.
    pub fn mean_terms(&self) -> [f64; RIM_TERMS] {
        let [first, second, third] = self.mean;
        [
            first.cosine,
            first.sine,
            second.cosine,
            second.sine,
            third.cosine,
            third.sine,
        ]
    }
}

/// The distance by which a rim moves towards the base, a piecewise linear function of the distance by which it lies
/// nearer to the apex than its shape.
#[derive(Debug)]
pub struct RimCorrection {
    /// Result at distance 0, mm.
    pub intercept_mm: f64,
    /// Slope.
    pub slope: f64,
    /// Size of the distance from which the slope changes, mm.
    pub bend_mm: f64,
    /// Addition to the slope beyond the bend, where the wall is short.
    pub short_slope: f64,
    /// Reduction of the slope beyond the bend, where the wall is long.
    pub long_slope: f64,
    /// Range of the result, mm.
    pub range_mm: [f64; 2],
}

impl RimCorrection {
    /// Distance towards the base by which a rim is moved that lies `distance` mm too near to the apex, mm.
    pub fn of(&self, distance: f64) -> f64 {
        let beyond = (distance - self.bend_mm).max(0.0) * self.short_slope
            + (-distance - self.bend_mm).max(0.0) * self.long_slope;
        let [least, greatest] = self.range_mm;
        (self.intercept_mm + self.slope * distance + beyond).clamp(least, greatest)
    }
}
