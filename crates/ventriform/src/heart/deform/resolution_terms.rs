//! How the resolution of an image follows from its noise and from the cavity.
//!
//! In: the length of the noise ([`noise_length`](crate::image::grid::noise_length)), which tells the filter, and the apparent
//! cavity: small hearts move more for their size. Out: mean and standard deviation of the full width of a point at half
//! its maximum, motion and filters included.

/// Factor on the deviation of a resolution that is not known, for the cameras that the simulator does not draw.
const UNKNOWN_SD_FACTOR: f64 = 1.3;

/// How the image's resolution follows from noise and cavity.
#[derive(Debug)]
pub struct ResolutionTerms {
    /// Of an image whose noise has the length [`ResolutionTerms::NOISE_LENGTH_MM`] about a cavity that looks like
    /// [`ResolutionTerms::CAVITY_ML`], mm.
    pub usual_mm: f64,
    /// Change with the square of the noise length, 1/mm.
    pub per_squared_noise_length: f64,
    /// Change with the logarithm of the apparent cavity, mm.
    pub per_log_cavity: f64,
    /// Standard deviation, mm.
    pub sd_mm: f64,
    /// Standard deviation where the noise length is not known, mm.
    pub sd_without_noise_mm: f64,
    /// Least and greatest noise length that were calibrated, mm.
    pub range_mm: [f64; 2],
}

impl ResolutionTerms {
    /// A usual noise length, mm.
    pub const NOISE_LENGTH_MM: f64 = 2.1;
    /// A usual apparent cavity, ml.
    pub const CAVITY_ML: f64 = 50.0;

    /// Mean and standard deviation of the resolution, mm.
    pub(super) fn of(&self, cavity_ml: f64, noise_length_mm: Option<f64>) -> [f64; 2] {
        let [least, greatest] = self.range_mm;
        let length = noise_length_mm.map(|length| length.clamp(least, greatest));
        let beyond = |length: f64| length.powi(2) - Self::NOISE_LENGTH_MM.powi(2);
        let noise = length.map_or(0.0, beyond);
        let mean =
            self.usual_mm + self.per_squared_noise_length * noise + self.of_cavity_mm(cavity_ml);
        let sd = length.map_or(self.sd_without_noise_mm, |_| self.sd_mm);
        [mean, UNKNOWN_SD_FACTOR * sd]
    }

    /// What the resolution about such a cavity has more than about a usual one, mm.
    pub(super) fn of_cavity_mm(&self, cavity_ml: f64) -> f64 {
        self.per_log_cavity * (cavity_ml.max(1.0) / Self::CAVITY_ML).ln()
    }
}
