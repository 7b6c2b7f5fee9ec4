//! The normal distribution.

use std::f64::consts::SQRT_2;

/// The error function within 1.5e-7 (Abramowitz and Stegun 1964, 7.1.26).
pub fn erf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let series = [
        1.061_405_429,
        -1.453_152_027,
        1.421_413_741,
        -0.284_496_736,
        0.254_829_592,
    ];
    let sum = series.iter().fold(0.0, |sum, a| (sum + a) * t);
    (1.0 - sum * (-x * x).exp()).copysign(x)
}

/// The share of a normal distribution of mean 0 and deviation 1 that lies below `x`.
pub fn share_below(x: f64) -> f64 {
    0.5 * (1.0 + erf(x / SQRT_2))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of Abramowitz and Stegun's table 7.1.
    #[test]
    fn the_error_function_is_that_of_the_tables() {
        for (x, value) in [
            (0.0, 0.0),
            (0.2, 0.222_702_589),
            (0.5, 0.520_499_878),
            (1.0, 0.842_700_793),
            (1.5, 0.966_105_146),
            (2.0, 0.995_322_265),
        ] {
            assert!((erf(x) - value).abs() < 2e-7 && (erf(-x) + value).abs() < 2e-7);
        }
    }

    /// Quantiles of the usual tables.
    #[test]
    fn shares_are_those_of_the_tables() {
        for (x, share) in [
            (0.0, 0.5),
            (1.0, 0.841_345),
            (1.644_854, 0.95),
            (-1.959_964, 0.025),
        ] {
            assert!((share_below(x) - share).abs() < 1e-6, "{x}");
        }
    }
}
