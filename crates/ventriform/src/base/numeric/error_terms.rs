//! The error of a volume, or of a figure made of volumes: its mean, and how its deviation grows in dark walls and small
//! hearts.

/// Standard deviations from the mean to the ends of an interval: the 95th percentile of the normal distribution.
const HALF_WIDTH_SDS: f64 = 1.645;
/// Smallest sum of 1, bias and deviation that a relative error may leave.
const MIN_RATIO: f64 = 0.2;

/// The error of a figure. Its variance is the sum of the squares of three deviations.
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
}

impl ErrorTerms {
    /// Cavity of a small heart, ml.
    pub const SMALL_CAVITY_ML: f64 = 60.0;

    fn deviation(&self, cavity_ml: f64, dark_share: f64) -> f64 {
        let small = self.small * Self::SMALL_CAVITY_ML / cavity_ml.max(1.0);
        (self.usual.powi(2) + (self.dark * dark_share).powi(2) + small.powi(2)).sqrt()
    }

    /// Least and greatest error of nine of ten hearts with such a cavity, ml, and such a share of dark wall, 0 to 1.
    pub fn ends(&self, cavity_ml: f64, dark_share: f64) -> [f64; 2] {
        let half = HALF_WIDTH_SDS * self.deviation(cavity_ml, dark_share);
        [self.bias - half, self.bias + half]
    }

    /// The interval about `found` that holds the true figure of nine of ten hearts, where the error is a share of the
    /// true figure.
    pub fn interval(&self, found: f64, cavity_ml: f64, dark_share: f64) -> [f64; 2] {
        let [least, greatest] = self.ends(cavity_ml, dark_share);
        [greatest, least].map(|error| found / (1.0 + error).max(MIN_RATIO))
    }
}
