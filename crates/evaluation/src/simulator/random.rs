//! Random numbers of a seed and a stream, and the distributions that are drawn from.

use rand::Rng;
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// Expected number from which Poisson numbers come by transformed rejection.
const LARGE_MEAN: f64 = 30.0;

/// What a stream is for. Numbers drawn for one purpose do not change those of another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stream {
    /// What a kind of case is.
    Kind,
    /// The patient, the camera and the reconstruction.
    Patient,
    /// Irregular borders of defects.
    Borders,
    /// Places of organs.
    Organs,
    /// A reader who draws masks.
    Reader,
    /// Counts of a view, by gate.
    Counts {
        /// The gate.
        gate: usize,
        /// The view.
        view: usize,
    },
    /// Counts of the side window of a view, by gate.
    SideWindow {
        /// The gate.
        gate: usize,
        /// The view.
        view: usize,
    },
}

impl Stream {
    fn number(self) -> u128 {
        match self {
            Stream::Kind => 1,
            Stream::Patient => 2,
            Stream::Borders => 3,
            Stream::Organs => 4,
            Stream::Reader => 5,
            Stream::Counts { gate, view } => 1 << 32 | (gate as u128) << 16 | view as u128,
            Stream::SideWindow { gate, view } => 2 << 32 | (gate as u128) << 16 | view as u128,
        }
    }
}

/// A stream of random numbers (PCG-XSL-RR-128/64, O'Neill 2014).
#[derive(Debug, Clone)]
pub struct Draws(Pcg64);

impl Draws {
    /// The stream of this seed.
    pub fn new(seed: u64, stream: Stream) -> Self {
        Self(Pcg64::new(u128::from(seed), stream.number()))
    }

    /// A number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (-53_f64).exp2()
    }

    /// A number in [low, high).
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A number of a normal distribution (Box and Muller 1958).
    pub fn normal(&mut self, mean: f64, sd: f64) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        mean + sd * radius * (TAU * self.unit()).cos()
    }

    /// A number of a normal distribution, moved to the nearest end of a range.
    pub fn normal_within(&mut self, mean: f64, sd: f64, range: [f64; 2]) -> f64 {
        self.normal(mean, sd).clamp(range[0], range[1])
    }

    /// `true` with this chance.
    pub fn chance(&mut self, chance: f64) -> bool {
        self.unit() < chance
    }

    /// A whole number below `count`.
    pub fn index(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// A whole number.
    pub fn whole(&mut self) -> u64 {
        // As JSON numbers of other programs hold it.
        self.0.next_u64() >> 33
    }

    /// One of the values, each with the same chance.
    pub fn pick<'a, T>(&mut self, values: &'a [T]) -> &'a T {
        &values[self.index(values.len())]
    }

    /// The values in random order.
    pub fn shuffled<T: Clone>(&mut self, values: &[T]) -> Vec<T> {
        let mut values = values.to_vec();
        for last in (1..values.len()).rev() {
            values.swap(last, self.index(last + 1));
        }
        values
    }

    /// A Poisson number. Small means by adding waiting times in the product form, large ones by the transformed
    /// rejection PTRS (Hörmann 1993).
    pub fn poisson(&mut self, mean: f64) -> f64 {
        if !(mean > 0.0) {
            0.0
        } else if mean < LARGE_MEAN {
            self.small_poisson(mean)
        } else {
            self.large_poisson(mean)
        }
    }

    fn small_poisson(&mut self, mean: f64) -> f64 {
        let end = (-mean).exp();
        let (mut count, mut product) = (0.0, self.unit());
        while product > end {
            count += 1.0;
            product *= self.unit();
        }
        count
    }

    fn large_poisson(&mut self, mean: f64) -> f64 {
        let b = 0.931 + 2.53 * mean.sqrt();
        let a = -0.059 + 0.02483 * b;
        let inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
        let squeeze = 0.9277 - 3.6224 / (b - 2.0);
        loop {
            let u = self.unit() - 0.5;
            let v = 1.0 - self.unit();
            let near = 0.5 - u.abs();
            let count = ((2.0 * a / near + b) * u + mean + 0.43).floor();
            if near >= 0.07 && v <= squeeze {
                return count;
            }
            if count < 0.0 || (near < 0.013 && v > near) {
                continue;
            }
            let left = (v * inverse_alpha / (a / (near * near) + b)).ln();
            if left <= count * mean.ln() - mean - ln_factorial(count) {
                return count;
            }
        }
    }
}

/// ln n! by Stirling's series; below 10 by the product.
fn ln_factorial(n: f64) -> f64 {
    if n < 10.0 {
        return (2..=n as u32).map(|k| f64::from(k).ln()).sum();
    }
    let x = n + 1.0;
    (x - 0.5) * x.ln() - x + 0.5 * TAU.ln() + (1.0 - 1.0 / (30.0 * x * x)) / (12.0 * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poisson_numbers_have_their_mean_as_mean_and_variance() {
        let mut draws = Draws::new(7, Stream::Counts { gate: 0, view: 0 });
        let count = 100_000;
        for mean in [0.3, 4.0, 29.0, 31.0, 250.0, 4000.0] {
            let numbers: Vec<f64> = (0..count).map(|_| draws.poisson(mean)).collect();
            let average = numbers.iter().sum::<f64>() / f64::from(count);
            let squares = numbers.iter().map(|n| (n - average).powi(2)).sum::<f64>();
            let variance = squares / f64::from(count - 1);
            // Five standard errors of the mean, and of the variance.
            let error = (mean / f64::from(count)).sqrt();
            let of_variance = ((mean + 2.0 * mean * mean) / f64::from(count)).sqrt();
            assert!((average - mean).abs() < 5.0 * error, "{mean}: {average}");
            assert!(
                (variance - mean).abs() < 5.0 * of_variance,
                "{mean}: {variance}"
            );
        }
    }

    #[test]
    fn a_poisson_number_has_the_probability_of_its_formula() {
        let mut draws = Draws::new(3, Stream::Kind);
        let (mean, count) = (40.0_f64, 200_000);
        let mut found = [0.0; 80];
        for _ in 0..count {
            found[(draws.poisson(mean) as usize).min(79)] += 1.0;
        }
        for k in 25..56 {
            let chance = (k as f64 * mean.ln() - mean - ln_factorial(k as f64)).exp();
            let expected = chance * f64::from(count);
            assert!((found[k] - expected).abs() < 5.0 * expected.sqrt(), "{k}");
        }
    }

    #[test]
    fn streams_of_one_seed_differ() {
        let first = |stream| Draws::new(1, stream).unit();
        let all = [
            first(Stream::Kind),
            first(Stream::Patient),
            first(Stream::Counts { gate: 0, view: 1 }),
            first(Stream::Counts { gate: 1, view: 0 }),
            first(Stream::SideWindow { gate: 0, view: 1 }),
        ];
        for (index, one) in all.iter().enumerate() {
            assert!(all[..index].iter().all(|other| other != one));
        }
    }
}
