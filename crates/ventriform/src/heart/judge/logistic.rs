//! Logistic models: chances from weighted sums of figures.

/// Standardised figures are kept within this many standard deviations: nothing is known beyond.
const MAX_DEVIATIONS: f64 = 4.0;

/// One term of a weighted sum.
#[derive(Debug)]
pub struct Term {
    /// The figure, as `scripts/measure/calibrate.py` names it.
    pub name: &'static str,
    /// Mean of the figure over the calibration set; 0 for a figure that enters as it is.
    pub mean: f64,
    /// Its standard deviation there; 1 for a figure that enters as it is.
    pub sd: f64,
    /// Weight of the standardised figure in the logarithm of the odds.
    pub weight: f64,
}

impl Term {
    /// A term from its four fields.
    pub const fn new(name: &'static str, mean: f64, sd: f64, weight: f64) -> Self {
        Self {
            name,
            mean,
            sd,
            weight,
        }
    }

    fn standardised(&self, value: f64) -> f64 {
        (value - self.mean) / self.sd
    }
}

/// A logistic model.
#[derive(Debug)]
pub struct Logistic {
    /// Logarithm of the odds where every standardised figure is 0.
    pub intercept: f64,
    /// The terms, in the order in which the figures are given.
    pub terms: &'static [Term],
}

impl Logistic {
    /// The chance, 0..=1, by these figures, one for each term, standardised and kept within
    /// [`MAX_DEVIATIONS`].
    pub fn probability<const N: usize>(&self, values: &[f64; N]) -> f64 {
        let sum: f64 = self
            .terms
            .iter()
            .zip(values)
            .map(|(term, value)| {
                term.weight
                    * term
                        .standardised(*value)
                        .clamp(-MAX_DEVIATIONS, MAX_DEVIATIONS)
            })
            .sum();
        1.0 / (1.0 + (-self.intercept - sum).exp())
    }

    /// The chance, 0..=1, by these figures, one for each term, however far they lie from the calibration set:
    /// for figures that are logarithms of odds.
    pub fn unlimited_probability<const N: usize>(&self, values: &[f64; N]) -> f64 {
        let log_odds = self
            .terms
            .iter()
            .zip(values)
            .fold(self.intercept, |sum, (term, value)| {
                sum + term.weight * term.standardised(*value)
            });
        1.0 / (1.0 + (-log_odds).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO_TERM_MODEL: Logistic = Logistic {
        intercept: -1.0,
        terms: &[
            Term::new("first", 2.0, 0.5, 1.5),
            Term::new("second", 0.0, 1.0, -0.3),
        ],
    };

    #[test]
    fn the_chance_is_the_logistic_function_of_the_weighted_sum() {
        let chance = |log_odds: f64| 1.0 / (1.0 + (-log_odds).exp());
        assert!((TWO_TERM_MODEL.probability(&[2.0, 0.0]) - chance(-1.0)).abs() < 1e-12);
        assert!((TWO_TERM_MODEL.probability(&[2.5, 1.0]) - chance(0.2)).abs() < 1e-12);
        assert!((TWO_TERM_MODEL.probability(&[99.0, 0.0]) - chance(5.0)).abs() < 1e-12);
        assert!((TWO_TERM_MODEL.unlimited_probability(&[2.0, 10.0]) - chance(-4.0)).abs() < 1e-12);
        assert!((TWO_TERM_MODEL.unlimited_probability(&[5.0, 0.0]) - chance(8.0)).abs() < 1e-12);
    }
}
