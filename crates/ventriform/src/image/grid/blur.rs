//! Separable Gaussian blur of a grid.
//!
//! In: values with i fastest, and a kernel for each axis; out: the blurred values in place. Beyond the
//! border the value of the outermost voxel continues. Rows and slices are blurred in parallel; each
//! value is summed in a fixed order, so the result does not depend on the number of threads.

use crate::base::progress::{Cancelled, Monitor};
use rayon::prelude::*;
use std::borrow::Cow;

/// Full width at half maximum of a Gaussian over its standard deviation.
pub const FWHM_PER_SIGMA: f64 = 2.354_820_045;

/// Farthest offset of a kernel, voxels. A wider Gaussian has nearly one weight for all voxels of any axis.
const MAX_REACH_VOXELS: usize = 1 << 16;

/// Half of a symmetric kernel: the weights of the offsets 0, 1, 2, ... They add up to 1 over both
/// sides.
#[derive(Debug, Clone)]
pub struct Kernel(Vec<f32>);

impl Kernel {
    /// Leaves values unchanged.
    pub fn identity() -> Self {
        Self(vec![1.0])
    }

    /// A Gaussian of `sigma` voxels, at least 0, cut off beyond `cut` times sigma.
    pub fn gaussian(sigma: f64, cut: f64) -> Self {
        let reach = ((cut * sigma).ceil() as usize).min(MAX_REACH_VOXELS);
        let weight = |n: usize| match n {
            // 0 / 0 for a sigma of 0.
            0 => 1.0,
            n => (-0.5 * (n as f64 / sigma).powi(2)).exp(),
        };
        let sum = weight(0) + 2.0 * (1..=reach).map(weight).sum::<f64>();
        Self((0..=reach).map(|n| (weight(n) / sum) as f32).collect())
    }

    /// Variance of uncorrelated noise of variance 1 after the blur along one axis.
    pub fn noise_gain(&self) -> f64 {
        let square = |w: &f32| f64::from(*w).powi(2);
        2.0 * self.0.iter().map(square).sum::<f64>() - square(&self.0[0])
    }

    /// The same blur of an axis of `count` voxels: all offsets that lead beyond the border, where the outermost value
    /// continues, are one.
    fn on_axis(&self, count: usize) -> Cow<'_, Self> {
        if self.0.len() <= count {
            return Cow::Borrowed(self);
        }
        let (within, beyond) = self.0.split_at(count - 1);
        let rest = beyond.iter().sum();
        Cow::Owned(Self(within.iter().copied().chain([rest]).collect()))
    }

    fn is_identity(&self) -> bool {
        self.0.len() == 1
    }
}

/// Convolves `values` of shape `[nx, ny, nz]` with one kernel along each axis, in the order i, j, k.
///
/// # Errors
/// [`Cancelled`]; the values are then blurred in part.
pub fn blur(
    values: &mut Vec<f32>,
    [nx, ny, nz]: [usize; 3],
    [along_i, along_j, along_k]: &[Kernel; 3],
    monitor: &Monitor,
) -> Result<(), Cancelled> {
    let [along_i, along_j, along_k] = [
        along_i.on_axis(nx),
        along_j.on_axis(ny),
        along_k.on_axis(nz),
    ];
    if !along_i.is_identity() {
        let rows = values.par_chunks_mut(nx);
        rows.try_for_each_init(Vec::new, |before, row| {
            monitor.check()?;
            before.clear();
            before.extend_from_slice(row);
            blur_row(before, &along_i, row);
            Ok(())
        })?;
    }
    if !along_j.is_identity() {
        let slices = values.par_chunks_mut(nx * ny);
        slices.try_for_each_init(Vec::new, |before, slice| {
            monitor.check()?;
            before.clear();
            before.extend_from_slice(slice);
            for (j, row) in slice.chunks_mut(nx).enumerate() {
                blur_line(before, nx, ny, j, &along_j, row);
            }
            Ok(())
        })?;
    }
    if !along_k.is_identity() {
        let before = std::mem::replace(values, vec![0.0; nx * ny * nz]);
        let slices = values.par_chunks_mut(nx * ny).enumerate();
        slices.try_for_each(|(k, slice)| {
            monitor.check()?;
            blur_line(&before, nx * ny, nz, k, &along_k, slice);
            Ok(())
        })?;
    }
    Ok(())
}

/// Blurs `before` along itself into `row`.
fn blur_row(before: &[f32], Kernel(weights): &Kernel, row: &mut [f32]) {
    let last = before.len() - 1;
    for (i, out) in row.iter_mut().enumerate() {
        let mut sum = weights[0] * before[i];
        for (n, w) in weights.iter().enumerate().skip(1) {
            sum += w * (before[i.saturating_sub(n)] + before[(i + n).min(last)]);
        }
        *out = sum;
    }
}

/// Blurs line number `at` of the `count` lines in `before` across the lines into `out`. A line has
/// `length` values: a row for j, a slice for k.
fn blur_line(
    before: &[f32],
    length: usize,
    count: usize,
    at: usize,
    Kernel(weights): &Kernel,
    out: &mut [f32],
) {
    let line = |n: usize| &before[n * length..(n + 1) * length];
    for (o, v) in out.iter_mut().zip(line(at)) {
        *o = weights[0] * v;
    }
    for (n, w) in weights.iter().enumerate().skip(1) {
        let below = line(at.saturating_sub(n));
        let above = line((at + n).min(count - 1));
        for ((o, b), a) in out.iter_mut().zip(below).zip(above) {
            *o += w * (b + a);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A kernel longer than the axis, folded at its end, against the whole one value by value; and one that would not
    /// fit into memory.
    #[test]
    fn kernels_beyond_the_axis_are_folded() {
        let row: Vec<f32> = (0..7).map(|n| (n as f32 * 1.3).sin()).collect();
        let wide = Kernel::gaussian(9.0, 3.0);
        let mut found = row.clone();
        let (one, silent) = (Kernel::identity(), Monitor::silent());
        let kernels = [wide.clone(), one.clone(), one.clone()];
        blur(&mut found, [7, 1, 1], &kernels, &silent).unwrap();
        let mut expected = row.clone();
        blur_row(&row, &wide, &mut expected);
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
        let huge = [Kernel::gaussian(1e12, 3.0), one.clone(), one];
        let mut flat = row;
        blur(&mut flat, [7, 1, 1], &huge, &silent).unwrap();
        assert!(flat.iter().all(|value| value.is_finite()));
    }

    #[test]
    fn mass_and_variance_are_those_of_the_gaussian() {
        let shape = [41, 37, 33];
        let mut voxels = vec![0.0; 41 * 37 * 33];
        let centre = 20 + 41 * (18 + 37 * 16);
        voxels[centre] = 1.0;
        let (fwhm, spacing) = (9.0, [2.0, 2.5, 3.0]);
        let silent = Monitor::silent();
        let kernels = spacing.map(|s| Kernel::gaussian(fwhm / 2.354_82 / s, 4.0));
        blur(&mut voxels, shape, &kernels, &silent).unwrap();
        let at = |n: usize| [n % 41, n / 41 % 37, n / 41 / 37].map(|x| x as f64);
        let mass: f64 = voxels.iter().map(|&v| f64::from(v)).sum();
        assert!((mass - 1.0).abs() < 1e-5);
        for axis in 0..3 {
            let middle = at(centre)[axis];
            let second = |(n, v): (usize, &f32)| f64::from(*v) * (at(n)[axis] - middle).powi(2);
            let variance: f64 = voxels.iter().enumerate().map(second).sum();
            let sigma_mm = variance.sqrt() * spacing[axis];
            assert!((sigma_mm * 2.354_82 - fwhm).abs() < 0.02, "{sigma_mm}");
        }
    }

    #[test]
    fn a_constant_stays_and_no_width_changes_nothing() {
        let mut constant = vec![3.0; 16 * 16 * 16];
        let silent = Monitor::silent();
        let kernels = [(); 3].map(|()| Kernel::gaussian(4.25, 4.0));
        blur(&mut constant, [16; 3], &kernels, &silent).unwrap();
        assert!(constant.iter().all(|v| (v - 3.0).abs() < 1e-5));
        let mut any: Vec<f32> = (0..64).map(|n| n as f32).collect();
        let before = any.clone();
        let kernels = [(); 3].map(|()| Kernel::gaussian(0.0, 4.0));
        blur(&mut any, [4; 3], &kernels, &silent).unwrap();
        assert_eq!(any, before);
    }
}
