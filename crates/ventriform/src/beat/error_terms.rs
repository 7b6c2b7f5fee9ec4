//! The error of a figure of a beat: its mean, and how its deviation grows in dark walls and small hearts.

/// Standard deviations from the mean to the ends of an interval: the 95th percentile of the normal distribution.
const HALF_WIDTH_SDS: f64 = 1.645;

/// The error of a figure. Its variance is the sum of the squares of three deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ErrorTerms {
    /// Mean of the error.
    pub bias: f64,
    /// Deviation in a bright heart of usual size.
    pub usual: f64,
    /// Deviation for a wall that is dark all over.
    pub dark: f64,
    /// Deviation for an end-diastolic volume of [`ErrorTerms::SMALL_EDV_ML`]; it falls as the volume grows.
    pub small: f64,
}

impl ErrorTerms {
    /// End-diastolic volume of a small heart, ml.
    pub const SMALL_EDV_ML: f64 = 60.0;

    fn deviation(&self, edv_ml: f64, dark_share: f64) -> f64 {
        let small = self.small * Self::SMALL_EDV_ML / edv_ml.max(1.0);
        (self.usual.powi(2) + (self.dark * dark_share).powi(2) + small.powi(2)).sqrt()
    }

    /// Least and greatest error.
    pub fn ends(&self, edv_ml: f64, dark_share: f64) -> [f64; 2] {
        let half = HALF_WIDTH_SDS * self.deviation(edv_ml, dark_share);
        [self.bias - half, self.bias + half]
    }
}
