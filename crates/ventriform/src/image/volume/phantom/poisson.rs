//! Exact draws from the Poisson distribution.
//!
//! Small means by multiplying uniform numbers (Knuth 1969), larger ones by transformed rejection,
//! algorithm PTRS of W. Hörmann, "The transformed rejection method for generating Poisson
//! random variables", Insurance: Mathematics and Economics 12 (1993) 39-45.

use crate::base::geometry::random::uniform;
use rand::Rng;

/// Smallest mean for which PTRS is valid.
const MIN_PTRS_MEAN: f64 = 10.0;

/// A Poisson-distributed whole number of the given mean; 0 for a mean of 0 or less.
pub(super) fn draw(mean: f64, random: &mut impl Rng) -> f64 {
    if !(mean > 0.0) {
        0.0
    } else if mean < MIN_PTRS_MEAN {
        by_multiplication(mean, random)
    } else {
        by_rejection(mean, random)
    }
}

fn by_multiplication(mean: f64, random: &mut impl Rng) -> f64 {
    let limit = (-mean).exp();
    let mut product = uniform(random);
    let mut n = 0.0;
    while product > limit {
        product *= uniform(random);
        n += 1.0;
    }
    n
}

/// PTRS; names and constants as in the paper.
fn by_rejection(mean: f64, random: &mut impl Rng) -> f64 {
    let b = 0.931 + 2.53 * mean.sqrt();
    let a = -0.059 + 0.024_83 * b;
    let inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
    let v_r = 0.9277 - 3.6224 / (b - 2.0);
    loop {
        let u = uniform(random) - 0.5;
        let v = uniform(random);
        let us = 0.5 - u.abs();
        let k = ((2.0 * a / us + b) * u + mean + 0.43).floor();
        if us >= 0.07 && v <= v_r {
            return k;
        }
        if k < 0.0 || (us < 0.013 && v > us) {
            continue;
        }
        let bound = k * mean.ln() - mean - ln_factorial(k);
        if (v * inverse_alpha / (a / (us * us) + b)).ln() <= bound {
            return k;
        }
    }
}

/// ln(k!); for k of 10 and more by Stirling's series, with an error below 1e-12.
fn ln_factorial(k: f64) -> f64 {
    if k < 10.0 {
        return (2..=k as u64).map(|n| n as f64).product::<f64>().ln();
    }
    let n = k + 1.0;
    let r = 1.0 / (n * n);
    let series = (1.0 / 12.0 - r * (1.0 / 360.0 - r * (1.0 / 1260.0 - r / 1680.0))) / n;
    (n - 0.5) * n.ln() - n + 0.5 * std::f64::consts::TAU.ln() + series
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::random::{Purpose, stream};

    #[test]
    fn factorials_are_exact() {
        let mut product = 1.0_f64;
        for k in 1..=30 {
            product *= f64::from(k);
            assert!((ln_factorial(f64::from(k)) - product.ln()).abs() < 1e-10);
        }
    }

    /// Pearson's chi-square against the distribution itself, over both algorithms.
    #[test]
    fn draws_follow_the_distribution() {
        let draws = 40_000;
        for mean in [0.3, 4.0, 9.9, 10.0, 37.5, 400.0] {
            let mut random = stream(11, Purpose::PhantomNoise);
            let mut seen = vec![0_u32; 700];
            for _ in 0..draws {
                seen[draw(mean, &mut random) as usize] += 1;
            }
            let expected = |k: usize| {
                let k = k as f64;
                f64::from(draws) * (k * mean.ln() - mean - ln_factorial(k)).exp()
            };
            let cells: Vec<usize> = (0..700).filter(|&k| expected(k) > 10.0).collect();
            let term = |&k: &usize| (f64::from(seen[k]) - expected(k)).powi(2) / expected(k);
            let chi: f64 = cells.iter().map(term).sum();
            let freedom = cells.len() as f64;
            assert!(
                chi < freedom + 5.0 * (2.0 * freedom).sqrt(),
                "{mean}: {chi} of {freedom}"
            );
        }
    }

    #[test]
    fn no_uptake_gives_no_counts() {
        let mut random = stream(1, Purpose::PhantomNoise);
        for mean in [0.0, -1.0, f64::NAN] {
            assert_eq!(draw(mean, &mut random), 0.0);
        }
    }
}
