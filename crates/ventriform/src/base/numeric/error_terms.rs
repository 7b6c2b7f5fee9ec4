//! The error of a volume, or of a figure made of volumes: its mean, and how its deviation grows in dark walls, in small
//! hearts and where the thickness of the wall is not known.

use super::normal::share_below;

/// Standard deviations from the mean to the ends of an interval: the 95th percentile of the normal distribution.
const HALF_WIDTH_SDS: f64 = 1.645;
/// Smallest sum of 1, bias and deviation that a relative error may leave.
const MIN_RATIO: f64 = 0.2;

/// The error of a figure. Its variance is the sum of the squares of four deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorTerms {
    /// Mean of the error.
    pub bias: f64,
    /// Deviation in a bright heart of usual size.
    pub usual: f64,
    /// Deviation for a wall that is dark all over.
    pub dark: f64,
    /// Deviation for a cavity of [`ErrorTerms::SMALL_CAVITY_ML`]; it falls as the cavity grows.
    pub small: f64,
    /// Deviation for each that the thickness of the wall gives the figure ([`ErrorCauses::thickness`]).
    pub thickness: f64,
}

/// What makes a figure uncertain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorCauses {
    /// The cavity, ml.
    pub cavity_ml: f64,
    /// The share of the wall that is dark, 0 to 1.
    pub dark_share: f64,
    /// The error that one standard deviation of the wall's mean thickness gives the figure.
    pub thickness: f64,
}

impl ErrorTerms {
    /// Cavity of a small heart, ml.
    pub const SMALL_CAVITY_ML: f64 = 60.0;

    fn deviation(&self, causes: &ErrorCauses) -> f64 {
        let small = self.small * Self::SMALL_CAVITY_ML / causes.cavity_ml.max(1.0);
        let dark = self.dark * causes.dark_share;
        let thickness = self.thickness * causes.thickness;
        (self.usual.powi(2) + dark.powi(2) + small.powi(2) + thickness.powi(2)).sqrt()
    }

    /// Least and greatest error of nine of ten hearts like this.
    pub fn ends(&self, causes: &ErrorCauses) -> [f64; 2] {
        let half = HALF_WIDTH_SDS * self.deviation(causes);
        [self.bias - half, self.bias + half]
    }

    /// The share of hearts like this one whose true figure is at most `share` of the figure that was found away from it,
    /// where the error is a share of the true figure.
    pub fn share_within(&self, share: f64, causes: &ErrorCauses) -> f64 {
        let below = |error: f64| share_below((error - self.bias) / self.deviation(causes));
        below(1.0 / (1.0 - share) - 1.0) - below(1.0 / (1.0 + share) - 1.0)
    }

    /// The interval about `found` that holds the true figure of nine of ten hearts, where the error is a share of the
    /// true figure.
    pub fn interval(&self, found: f64, causes: &ErrorCauses) -> [f64; 2] {
        let [least, greatest] = self.ends(causes);
        [greatest, least].map(|error| found / (1.0 + error).max(MIN_RATIO))
    }
}
