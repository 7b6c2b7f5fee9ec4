//! The discrete Fourier transform of lines whose length is a power of two (Cooley and Tukey 1965).

use nalgebra::Complex;
use std::f64::consts::TAU;

/// A complex number.
pub type Wave = Complex<f32>;

/// The transform of lines of one length.
pub struct Fft {
    /// exp(-2 pi i k / length), for the first half of k.
    turns: Vec<Wave>,
    /// Where each number goes first: its index with the bits reversed.
    order: Vec<usize>,
}

impl Fft {
    /// The transform of lines of `length`, a power of two.
    pub fn new(length: usize) -> Self {
        assert!(length.is_power_of_two(), "{length} is no power of two");
        let turn = |k: usize| {
            let (sin, cos) = (TAU * k as f64 / length as f64).sin_cos();
            Complex::new(cos as f32, -sin as f32)
        };
        let bits = length.trailing_zeros();
        let order = (0..length)
            .map(|k| {
                k.reverse_bits()
                    .checked_shr(usize::BITS - bits)
                    .unwrap_or(0)
            })
            .collect();
        Self {
            turns: (0..length / 2).map(turn).collect(),
            order,
        }
    }

    /// Transforms every line of `lines`. Twice, with `inverse` once, multiplies by the length.
    pub fn process(&self, lines: &mut [Wave], inverse: bool) {
        for line in lines.chunks_exact_mut(self.order.len()) {
            self.one(line, inverse);
        }
    }

    fn one(&self, line: &mut [Wave], inverse: bool) {
        for (at, to) in self.order.iter().enumerate() {
            if at < *to {
                line.swap(at, *to);
            }
        }
        let mut half = 1;
        while half < line.len() {
            let stride = self.turns.len() / half;
            for block in line.chunks_exact_mut(2 * half) {
                let (low, high) = block.split_at_mut(half);
                for (k, (a, b)) in low.iter_mut().zip(high).enumerate() {
                    let turn = self.turns[k * stride];
                    let turned = *b * if inverse { turn.conj() } else { turn };
                    (*a, *b) = (*a + turned, *a - turned);
                }
            }
            half *= 2;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transform_is_the_sum_of_its_formula_and_its_inverse_goes_back() {
        for length in [1, 2, 8, 64] {
            let line: Vec<Wave> = (0..length)
                .map(|k| Complex::new((k * k % 7) as f32, (k % 3) as f32))
                .collect();
            let fft = Fft::new(length);
            let mut made = line.clone();
            fft.process(&mut made, false);
            for (frequency, made) in made.iter().enumerate() {
                let sum: Complex<f64> = (line.iter().enumerate())
                    .map(|(k, v)| {
                        let angle = -TAU * (k * frequency) as f64 / length as f64;
                        Complex::new(f64::from(v.re), f64::from(v.im)) * Complex::cis(angle)
                    })
                    .sum();
                let off = sum - Complex::new(f64::from(made.re), f64::from(made.im));
                assert!(off.norm() < 1e-3, "{length} {frequency}");
            }
            fft.process(&mut made, true);
            for (back, first) in made.iter().zip(&line) {
                assert!((back / length as f32 - first).norm() < 1e-4);
            }
        }
    }
}
