//! The numbers that describe a ray through a ventricle's wall, and functions of them.
//!
//! In: numbers, or coefficients of them, by name. Out: their products' sum. The calibrated coefficients are in
//! [`calibration`](super::calibration).

/// A number for each property of a ray: its value, or the coefficient of a linear function of the values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayTerms {
    /// 1.
    pub constant: f64,
    /// Thickness of the wall (median) less 15 mm.
    pub thickness: f64,
    /// Logarithm of the wall's inner radius (median of the rays across the axis and near them) over 15 mm.
    pub ln_radius: f64,
    /// Its square.
    pub ln_radius_squared: f64,
    /// Thickness at the ray less the median, mm.
    pub thickness_here: f64,
    /// exp(-inner radius at the ray / 12 mm).
    pub narrowness_here: f64,
    /// The missing share of uptake.
    pub missing_uptake: f64,
    /// Its square.
    pub missing_uptake_squared: f64,
    /// The way from apex to base, less a half.
    pub way: f64,
    /// Its square.
    pub way_squared: f64,
    /// exp(-way / 0.12).
    pub nearness_to_apex: f64,
}

impl RayTerms {
    /// The numbers in the order of the fields.
    pub fn values(&self) -> [f64; 11] {
        [
            self.constant,
            self.thickness,
            self.ln_radius,
            self.ln_radius_squared,
            self.thickness_here,
            self.narrowness_here,
            self.missing_uptake,
            self.missing_uptake_squared,
            self.way,
            self.way_squared,
            self.nearness_to_apex,
        ]
    }

    /// The linear function with these coefficients of the values `ray`.
    pub fn dot(&self, ray: &Self) -> f64 {
        let terms = self.values().into_iter().zip(ray.values());
        terms.map(|(coefficient, value)| coefficient * value).sum()
    }
}

/// A distance that depends on the size of the cavity.
#[derive(Debug)]
pub struct SizeShift {
    /// Size of the cavity at which it is 0, ml.
    pub cavity_ml: f64,
    /// Its change with the logarithm of the size, mm.
    pub per_log_mm: f64,
}

/// Distances that depend on the smoothness of the image.
#[derive(Debug)]
pub struct SmoothnessShift {
    /// The smoothness at which they are 0, mm.
    pub usual_mm: f64,
    /// Change of the inner surface's distance with the logarithm of the smoothness, mm.
    pub inner_per_log_mm: f64,
    /// Change of the outer surface's distance with the logarithm of the smoothness, mm.
    pub outer_per_log_mm: f64,
    /// Least and greatest smoothness that were calibrated, mm.
    pub range_mm: [f64; 2],
}
