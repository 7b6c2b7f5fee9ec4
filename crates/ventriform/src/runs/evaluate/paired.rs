//! Whether differences between pairs are more than chance.
//!
//! In go the differences, one for each patient; out come their mean, an interval for it and the chance
//! that as uneven a split of signs comes about by itself.
//!
//! - The interval is the bootstrap's: patients are drawn with replacement [`BOOTSTRAP_DRAWS`] times, and the
//!   middle 95 % of the means are kept. The draws follow from the number of patients alone, so that
//!   the same differences give the same interval.
//! - The sign test is exact and two-sided; differences of 0 are left out.

use crate::base::geometry::random::{Purpose, stream, uniform};

/// Draws of the bootstrap.
const BOOTSTRAP_DRAWS: usize = 4000;

/// The differences of a number of pairs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairedDifference {
    /// Number of pairs.
    pub count: usize,
    /// The mean.
    pub mean: f64,
    /// 95 % interval of the mean.
    pub interval: [f64; 2],
    /// Pairs that differ upwards, and downwards.
    pub signs: [usize; 2],
    /// The sign test's two-sided p.
    pub p: f64,
}

impl PairedDifference {
    /// The figures of `differences`; `None` without any.
    pub fn from_differences(differences: &[f64]) -> Option<Self> {
        let count = differences.len();
        let mean = super::rows::average(differences)?;
        let mut random = stream(count as u64, Purpose::Measure);
        let mut means: Vec<f64> = (0..BOOTSTRAP_DRAWS)
            .map(|_| {
                let drawn = (0..count).map(|_| {
                    let place = (uniform(&mut random) * count as f64) as usize;
                    differences[place.min(count - 1)]
                });
                drawn.sum::<f64>() / count as f64
            })
            .collect();
        means.sort_by(f64::total_cmp);
        let at = |share: f64| means[((BOOTSTRAP_DRAWS - 1) as f64 * share).round() as usize];
        let up = differences.iter().filter(|d| **d > 0.0).count();
        let down = differences.iter().filter(|d| **d < 0.0).count();
        Some(Self {
            count,
            mean,
            interval: [at(0.025), at(0.975)],
            signs: [up, down],
            p: sign_test(up, down),
        })
    }

    /// Whether the interval holds 0.
    pub fn may_be_none(&self) -> bool {
        self.interval[0] <= 0.0 && self.interval[1] >= 0.0
    }
}

/// The chance that fair coins fall as unevenly as `up` to `down` or more so.
fn sign_test(up: usize, down: usize) -> f64 {
    let n = up + down;
    // Logarithms, so that hundreds of pairs do not underflow.
    let mut logarithm = -(n as f64) * std::f64::consts::LN_2;
    let mut tail = 0.0;
    for k in 0..=up.min(down) {
        tail += logarithm.exp();
        logarithm += ((n - k) as f64 / (k + 1) as f64).ln();
    }
    (2.0 * tail).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sign_test_is_the_binomials() {
        assert_eq!(sign_test(0, 0), 1.0);
        assert!((sign_test(5, 0) - 2.0 / 32.0).abs() < 1e-12);
        assert!((sign_test(1, 9) - 2.0 * 11.0 / 1024.0).abs() < 1e-12);
        assert_eq!(sign_test(4, 4), 1.0);
        assert!(sign_test(900, 100) < 1e-100);
    }

    #[test]
    fn the_interval_holds_zero_where_signs_are_mixed_and_not_where_all_agree() {
        let mixed: Vec<f64> = (0..20).map(|n| f64::from(n % 2 * 2 - 1)).collect();
        let mixed = PairedDifference::from_differences(&mixed).unwrap();
        assert!(mixed.may_be_none() && mixed.signs == [10, 10], "{mixed:?}");
        let all: Vec<f64> = (1..=20).map(|n| 0.01 * f64::from(n)).collect();
        let found = PairedDifference::from_differences(&all).unwrap();
        assert!(!found.may_be_none() && found.p < 1e-5, "{found:?}");
        // Normal theory: 1.96 times the standard error.
        let (mean, half) = (0.105, 1.96 * 0.0577 / 20f64.sqrt());
        let off = [
            found.interval[0] - (mean - half),
            found.interval[1] - (mean + half),
        ];
        assert!(off.iter().all(|o| o.abs() < 0.004), "{found:?}");
        assert_eq!(PairedDifference::from_differences(&all), Some(found));
        assert_eq!(PairedDifference::from_differences(&[]), None);
    }
}
