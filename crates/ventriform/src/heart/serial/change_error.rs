//! How much a figure of two scans of one heart differs by itself.

/// The standard deviation of a change that is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChangeError {
    /// Without noise; of a share that of its logarithm.
    pub least: f64,
    /// More for each point of the pair's noise, added in squares.
    pub per_point: f64,
}

impl ChangeError {
    /// The deviation in a pair with this noise, points.
    pub fn of_noise(self, noise_points: f64) -> f64 {
        self.least.hypot(self.per_point * noise_points)
    }
}
