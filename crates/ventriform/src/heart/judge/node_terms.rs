//! The numbers behind the uncertainty of a node, and functions of them.
//!
//! In: numbers, or coefficients of them, by name. Out: their products' sum. The calibrated coefficients are in
//! [`uncertainty_calibration`](super::uncertainty_calibration).

/// A number for each property of a node: its value, or the coefficient of a linear function of the values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodeTerms {
    /// 1.
    pub constant: f64,
    /// Mean weight of the sensors about the node.
    pub seen: f64,
    /// Logarithm of the distance from the other fits / mm + 0.3.
    pub ln_spread: f64,
    /// Logarithm of the odds of a good fit.
    pub log_odds: f64,
    /// The way from apex to rim, less a half.
    pub way: f64,
    /// Its square.
    pub way_squared: f64,
}

impl NodeTerms {
    fn values(&self) -> [f64; 6] {
        [
            self.constant,
            self.seen,
            self.ln_spread,
            self.log_odds,
            self.way,
            self.way_squared,
        ]
    }

    /// The linear function with these coefficients of the values `node`.
    pub fn dot(&self, node: &Self) -> f64 {
        let terms = self.values().into_iter().zip(node.values());
        terms.map(|(coefficient, value)| coefficient * value).sum()
    }
}
