//! Separable Gaussian blur; beyond the border the outermost voxel goes on.

use rayon::prelude::*;

use crate::progress::{Cancelled, Monitor};

/// Standard deviations after which the kernel is cut off (6e-5 of its mass lies beyond).
const CUT: f64 = 4.0;

/// A Gaussian of a given width in millimetres on a given grid.
pub(super) struct Gaussian {
    /// Half kernels along i, j, k: weights of offsets 0, 1, 2 ...
    kernels: [Vec<f32>; 3],
}

impl Gaussian {
    /// `fwhm_mm` is the full width at half maximum; 0 leaves everything as it is.
    pub(super) fn new(fwhm_mm: f64, spacing_mm: [f64; 3]) -> Self {
        let sigma_mm = fwhm_mm / (8.0 * 2_f64.ln()).sqrt();
        Self {
            kernels: spacing_mm.map(|spacing| half_kernel(sigma_mm / spacing)),
        }
    }

    /// Variance that uncorrelated noise of variance 1 has afterwards.
    pub(super) fn noise_gain(&self) -> f64 {
        let squares = |half: &Vec<f32>| -> f64 {
            let square = |w: &f32| f64::from(*w).powi(2);
            2.0 * half.iter().map(square).sum::<f64>() - square(&half[0])
        };
        self.kernels.iter().map(squares).product()
    }

    /// Blurs `voxels` in place.
    ///
    /// # Errors
    /// [`Cancelled`]; the values are then blurred in part.
    pub(super) fn apply(
        &self,
        voxels: &mut Vec<f32>,
        [nx, ny, nz]: [usize; 3],
        monitor: &Monitor,
    ) -> Result<(), Cancelled> {
        let [ki, kj, kk] = &self.kernels;
        if ki.len() > 1 {
            let rows = voxels.par_chunks_mut(nx);
            rows.try_for_each_init(Vec::new, |line, row| {
                monitor.check()?;
                line.clear();
                line.extend_from_slice(row);
                blur_row(line, ki, row);
                Ok(())
            })?;
        }
        if kj.len() > 1 {
            let slices = voxels.par_chunks_mut(nx * ny);
            slices.try_for_each_init(Vec::new, |before, slice| {
                monitor.check()?;
                before.clear();
                before.extend_from_slice(slice);
                for (j, row) in slice.chunks_mut(nx).enumerate() {
                    add_lines(before, nx, ny, j, kj, row);
                }
                Ok(())
            })?;
        }
        if kk.len() > 1 {
            let before = std::mem::replace(voxels, vec![0.0; nx * ny * nz]);
            let slices = voxels.par_chunks_mut(nx * ny).enumerate();
            slices.try_for_each(|(k, slice)| {
                monitor.check()?;
                add_lines(&before, nx * ny, nz, k, kk, slice);
                Ok(())
            })?;
        }
        Ok(())
    }
}

/// Weights of offsets 0, 1, 2 ... that add up to 1 over both sides.
fn half_kernel(sigma: f64) -> Vec<f32> {
    let radius = (CUT * sigma).ceil() as usize;
    let weight = |n: usize| match n {
        0 => 1.0,
        n => (-0.5 * (n as f64 / sigma).powi(2)).exp(),
    };
    let weights: Vec<f64> = (0..=radius).map(weight).collect();
    let total = 2.0 * weights.iter().sum::<f64>() - 1.0;
    weights.iter().map(|w| (w / total) as f32).collect()
}

fn blur_row(line: &[f32], kernel: &[f32], row: &mut [f32]) {
    let last = line.len() - 1;
    for (i, out) in row.iter_mut().enumerate() {
        let mut sum = kernel[0] * line[i];
        for (n, w) in kernel.iter().enumerate().skip(1) {
            sum += w * (line[i.saturating_sub(n)] + line[(i + n).min(last)]);
        }
        *out = sum;
    }
}

/// `out` becomes line `at` of `lines` (`count` of them, `length` long), blurred across them.
fn add_lines(
    lines: &[f32],
    length: usize,
    count: usize,
    at: usize,
    kernel: &[f32],
    out: &mut [f32],
) {
    let line = |n: usize| &lines[n * length..(n + 1) * length];
    for (o, v) in out.iter_mut().zip(line(at)) {
        *o = kernel[0] * v;
    }
    for (n, w) in kernel.iter().enumerate().skip(1) {
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

    #[test]
    fn mass_and_variance_are_those_of_the_gaussian() {
        let shape = [41, 37, 33];
        let mut voxels = vec![0.0; 41 * 37 * 33];
        let centre = 20 + 41 * (18 + 37 * 16);
        voxels[centre] = 1.0;
        let (fwhm, spacing) = (9.0, [2.0, 2.5, 3.0]);
        let silent = Monitor::silent();
        Gaussian::new(fwhm, spacing)
            .apply(&mut voxels, shape, &silent)
            .unwrap();
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
        Gaussian::new(20.0, [2.0; 3])
            .apply(&mut constant, [16; 3], &silent)
            .unwrap();
        assert!(constant.iter().all(|v| (v - 3.0).abs() < 1e-5));
        let mut any: Vec<f32> = (0..64).map(|n| n as f32).collect();
        let before = any.clone();
        Gaussian::new(0.0, [2.0; 3])
            .apply(&mut any, [4; 3], &silent)
            .unwrap();
        assert_eq!(any, before);
    }
}
