//! Numbers on a regular grid in three directions, z fastest, and the filters that the simulator needs.

use rayon::prelude::*;

/// Width of a kernel, in standard deviations to each side.
const KERNEL_SDS: f64 = 4.0;

/// Full width at half maximum of a normal distribution over its standard deviation.
pub const FWHM_PER_SD: f64 = 2.354_820_045;

/// Values at (x, y, z), at index `(x * shape[1] + y) * shape[2] + z`.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Points along x, y, z.
    pub shape: [usize; 3],
    /// The values.
    pub values: Vec<f32>,
}

impl Grid {
    /// A grid of zeros.
    pub fn zeros(shape: [usize; 3]) -> Self {
        let values = vec![0.0; shape.iter().product()];
        Self { shape, values }
    }

    /// The value of `value` at every place.
    pub fn from_fn(shape: [usize; 3], value: impl Fn([usize; 3]) -> f32 + Sync) -> Self {
        let mut grid = Self::zeros(shape);
        let [_, ny, nz] = shape;
        let planes = grid.values.par_chunks_mut(ny * nz).enumerate();
        planes.for_each(|(x, plane)| {
            for (at, v) in plane.iter_mut().enumerate() {
                *v = value([x, at / nz, at % nz]);
            }
        });
        grid
    }

    /// Four numbers of every place, as four grids.
    pub fn from_samples(
        shape: [usize; 3],
        sample: impl Fn([usize; 3]) -> [f32; 4] + Sync,
    ) -> [Self; 4] {
        let sample = &sample;
        Self::from_columns(shape, |x, y| Some(move |z: usize| sample([x, y, z])))
    }

    /// Four numbers of every place, as four grids; zero in columns for which there is no function of z.
    pub fn from_columns<F: Fn(usize) -> [f32; 4]>(
        shape: [usize; 3],
        column: impl Fn(usize, usize) -> Option<F> + Sync,
    ) -> [Self; 4] {
        let [_, ny, nz] = shape;
        let mut grids = [0, 1, 2, 3].map(|_| Self::zeros(shape));
        let [a, b, c, d] = &mut grids;
        let planes = (a.values.par_chunks_mut(ny * nz))
            .zip(b.values.par_chunks_mut(ny * nz))
            .zip(c.values.par_chunks_mut(ny * nz))
            .zip(d.values.par_chunks_mut(ny * nz))
            .enumerate();
        planes.for_each(|(x, (((a, b), c), d))| {
            for y in 0..ny {
                let Some(numbers) = column(x, y) else {
                    continue;
                };
                for z in 0..nz {
                    let at = y * nz + z;
                    [a[at], b[at], c[at], d[at]] = numbers(z);
                }
            }
        });
        grids
    }

    /// The index of a place.
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (x * self.shape[1] + y) * self.shape[2] + z
    }

    /// The value at a place.
    pub fn at(&self, place: [usize; 3]) -> f32 {
        self.values[self.index(place)]
    }

    /// The values along z at (x, y).
    pub fn column(&self, x: usize, y: usize) -> &[f32] {
        let start = self.index([x, y, 0]);
        &self.values[start..start + self.shape[2]]
    }

    /// The sum of all values.
    pub fn sum(&self) -> f64 {
        self.values.iter().map(|v| f64::from(*v)).sum()
    }

    /// The largest value; 0 of an empty grid.
    pub fn max(&self) -> f32 {
        self.values.iter().copied().fold(0.0, f32::max)
    }

    /// The mean of blocks of `factor` places in each direction, each axis a multiple of it.
    pub fn binned(&self, factor: usize) -> Self {
        let shape = self.shape.map(|n| n / factor);
        let scale = 1.0 / (factor.pow(3) as f32);
        Self::from_fn(shape, |[x, y, z]| {
            let mut sum = 0.0;
            for i in 0..factor {
                for j in 0..factor {
                    let column = self.column(x * factor + i, y * factor + j);
                    sum += column[z * factor..(z + 1) * factor].iter().sum::<f32>();
                }
            }
            sum * scale
        })
    }

    /// The values at z from `start` to before `end`.
    pub fn slices(&self, start: usize, end: usize) -> Self {
        let [nx, ny, _] = self.shape;
        let mut values = Vec::with_capacity(nx * ny * (end - start));
        for x in 0..nx {
            for y in 0..ny {
                values.extend_from_slice(&self.column(x, y)[start..end]);
            }
        }
        Self {
            shape: [nx, ny, end - start],
            values,
        }
    }

    /// A copy with the values of `part` from `corner` on.
    pub fn with_part(&self, corner: [usize; 3], part: &Grid) -> Self {
        let mut whole = self.clone();
        whole.put(corner, part);
        whole
    }

    /// Writes the values of `part` from `corner` on.
    pub fn put(&mut self, corner: [usize; 3], part: &Grid) {
        for x in 0..part.shape[0] {
            for y in 0..part.shape[1] {
                let start = self.index([corner[0] + x, corner[1] + y, corner[2]]);
                self.values[start..start + part.shape[2]].copy_from_slice(part.column(x, y));
            }
        }
    }

    /// The part of `shape` from `corner` on.
    pub fn part(&self, corner: [usize; 3], shape: [usize; 3]) -> Self {
        Self::from_fn(shape, |[x, y, z]| {
            self.at([corner[0] + x, corner[1] + y, corner[2] + z])
        })
    }

    /// The value between places by linear interpolation; beyond the grid that of its nearest place.
    pub fn between(&self, at: [f64; 3]) -> f32 {
        let mut low = [0; 3];
        let mut share = [0.0_f32; 3];
        for axis in 0..3 {
            let x = at[axis].clamp(0.0, (self.shape[axis] - 1) as f64);
            low[axis] = (x as usize).min(self.shape[axis].saturating_sub(2));
            share[axis] = (x - low[axis] as f64) as f32;
        }
        let high = [0, 1, 2].map(|axis| (low[axis] + 1).min(self.shape[axis] - 1));
        let along_z = |x: usize, y: usize| {
            let column = self.column(x, y);
            column[low[2]] + share[2] * (column[high[2]] - column[low[2]])
        };
        let along_y = |x: usize| {
            let [a, b] = [along_z(x, low[1]), along_z(x, high[1])];
            a + share[1] * (b - a)
        };
        let [a, b] = [along_y(low[0]), along_y(high[0])];
        a + share[0] * (b - a)
    }

    /// Blurs by normal distributions of these standard deviations, in places; beyond the grid lie its border's values.
    pub fn blur(&mut self, sd: [f64; 3]) {
        for (axis, sd) in sd.into_iter().enumerate() {
            if sd > 0.0 {
                self.convolve(axis, &gaussian(sd), Beyond::Border);
            }
        }
    }

    /// Convolves along an axis by a kernel of odd length.
    pub fn convolve(&mut self, axis: usize, kernel: &[f32], beyond: Beyond) {
        let source = self.clone();
        let [nx, ny, nz] = self.shape;
        let reach = (kernel.len() / 2) as isize;
        let inside = |at: isize, count: usize| match beyond {
            Beyond::Border => Some(at.clamp(0, count as isize - 1) as usize),
            Beyond::Zero => usize::try_from(at).ok().filter(|at| *at < count),
        };
        let columns = self.values.par_chunks_mut(nz).enumerate();
        columns.for_each(|(column, out)| {
            let (x, y) = (column / ny, column % ny);
            out.fill(0.0);
            for (k, weight) in (-reach..=reach).zip(kernel) {
                let from = match axis {
                    0 => inside(x as isize + k, nx).map(|x| source.column(x, y)),
                    1 => inside(y as isize + k, ny).map(|y| source.column(x, y)),
                    _ => {
                        let own = source.column(x, y);
                        for (z, out) in out.iter_mut().enumerate() {
                            if let Some(from) = inside(z as isize - k, nz) {
                                *out += weight * own[from];
                            }
                        }
                        None
                    }
                };
                if let Some(from) = from {
                    for (out, from) in out.iter_mut().zip(from) {
                        *out += weight * from;
                    }
                }
            }
        });
    }
}

/// What lies beyond a grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beyond {
    /// The value at its border.
    Border,
    /// Zero.
    Zero,
}

/// The kernel of a normal distribution; its sum is 1.
pub fn gaussian(sd: f64) -> Vec<f32> {
    let reach = (KERNEL_SDS * sd).ceil() as i32;
    let weight = |k: i32| (-0.5 * (f64::from(k) / sd).powi(2)).exp();
    let sum: f64 = (-reach..=reach).map(weight).sum();
    (-reach..=reach).map(|k| (weight(k) / sum) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blur_keeps_the_sum_and_has_its_width() {
        let mut grid = Grid::zeros([41, 41, 41]);
        let middle = grid.index([20, 20, 20]);
        grid.values[middle] = 1.0;
        grid.blur([1.5, 2.0, 3.0]);
        assert!((grid.sum() - 1.0).abs() < 1e-4);
        for (axis, sd) in [1.5, 2.0, 3.0].into_iter().enumerate() {
            let mut variance = 0.0;
            for x in 0..41 {
                for y in 0..41 {
                    for z in 0..41 {
                        let off = [x, y, z][axis] as f64 - 20.0;
                        variance += off * off * f64::from(grid.at([x, y, z]));
                    }
                }
            }
            assert!(
                (variance.sqrt() - sd).abs() < 0.01 * sd,
                "{axis} {variance}"
            );
        }
    }

    #[test]
    fn binning_keeps_the_mean() {
        let grid = Grid::from_fn([8, 6, 4], |[x, y, z]| (x * 31 + y * 7 + z * 3) as f32);
        let binned = grid.binned(2);
        let mean = |g: &Grid| g.sum() / g.values.len() as f64;
        assert!((mean(&grid) - mean(&binned)).abs() < 1e-4);
    }
}
