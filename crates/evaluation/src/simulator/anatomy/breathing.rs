//! How breathing blurs: the share of time at each shift from head to foot.

use std::f64::consts::PI;

/// Samples of a breath.
const SAMPLES: usize = 400;

/// The kernel along z of a movement of `reach_mm` from end to end, on points `step_mm` apart: the position is
/// reach cos^4, longest at the end of expiration, with the mean at 0. A single 1 without movement.
pub fn kernel(reach_mm: f64, step_mm: f64) -> Vec<f32> {
    if reach_mm <= 0.0 {
        return vec![1.0];
    }
    let place = |n: usize| reach_mm * (PI * (n as f64 + 0.5) / SAMPLES as f64).cos().powi(4);
    let mean = (0..SAMPLES).map(place).sum::<f64>() / SAMPLES as f64;
    let far = (0..SAMPLES)
        .map(|n| (place(n) - mean).abs())
        .fold(0.0, f64::max);
    let reach = (far / step_mm).ceil() as usize + 1;
    let mut kernel = vec![0.0_f64; 2 * reach + 1];
    for n in 0..SAMPLES {
        let at = (place(n) - mean) / step_mm + reach as f64;
        let low = at.floor();
        kernel[low as usize] += 1.0 - (at - low);
        kernel[low as usize + 1] += at - low;
    }
    kernel.iter().map(|w| (w / SAMPLES as f64) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_breath_moves_nothing_in_the_mean() {
        let kernel = kernel(14.0, 2.0);
        let middle = (kernel.len() / 2) as f32;
        let sum: f32 = kernel.iter().sum();
        let mean: f32 = kernel
            .iter()
            .enumerate()
            .map(|(k, w)| w * (k as f32 - middle))
            .sum();
        assert!(
            (sum - 1.0).abs() < 1e-5 && mean.abs() < 1e-4,
            "{sum} {mean}"
        );
    }
}
