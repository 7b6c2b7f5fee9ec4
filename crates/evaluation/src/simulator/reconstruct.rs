//! From counts to an image: OSEM or filtered back projection, slice by slice, and a filter.
//!
//! In: projections (views x bins across x slices). Out: an image on voxels as large as the bins. Slices are
//! reconstructed in packs of [`LANES`], each for itself, so that the result does not depend on the number of threads.
//!
//! OSEM without a model of the resolution (Hudson and Larkin 1994); attenuation and scatter are in the model if they
//! are given. The filter multiplies the image's spectrum; before FBP it multiplies that of the projections, with the
//! ramp of Kak and Slaney, whose mean is right.

use super::camera::View;
use super::fft::{Fft, Wave};
use super::grid::Grid;
use super::parameters::{Filter, Method, Reconstruction};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Slices that are reconstructed at once.
const LANES: usize = 16;

/// The values of a pack of slices at one place.
type Lanes = [f32; LANES];

/// What a reconstruction knows besides the counts.
#[derive(Debug, Clone, Copy, Default)]
pub struct Knowledge<'a> {
    /// Attenuation of the voxels, per mm.
    pub attenuation: Option<&'a Grid>,
    /// Scattered counts.
    pub scatter: Option<&'a Grid>,
}

/// The image of projections; nothing below 0.
pub fn reconstruct(
    projections: &Grid,
    views: &[View],
    voxel_mm: f64,
    how: &Reconstruction,
    known: &Knowledge,
) -> Grid {
    let mut image = match how.method {
        Method::Fbp => fbp(projections, views, voxel_mm, &how.filter),
        Method::Osem => {
            let raw = osem(projections, views, voxel_mm, how, known);
            filtered(&raw, voxel_mm, &how.filter)
        }
    };
    image.values.iter_mut().for_each(|v| *v = v.max(0.0));
    image
}

/// The places of a pack of slices that views see.
struct Scanner<'a> {
    views: &'a [View],
    count: usize,
    middle: f64,
}

impl Scanner<'_> {
    /// Adds an image's sums along rays, weighted by `transmission` at each (plane, bin), into `out`, one for each bin.
    fn forward(
        &self,
        view: usize,
        image: &[Lanes],
        transmission: Option<&[Lanes]>,
        out: &mut [Lanes],
    ) {
        let (n, middle, view) = (self.count, self.middle, &self.views[view]);
        out.fill([0.0; LANES]);
        for plane in 0..n {
            let toward = middle - plane as f64;
            for (across, out) in out.iter_mut().enumerate() {
                let Some((at, weights)) = self.corner(view, toward, across) else {
                    continue;
                };
                let [a, b] = [&image[at], &image[at + 1]];
                let [c, d] = [&image[at + n], &image[at + n + 1]];
                let [w0, w1, w2, w3] = weights;
                match transmission {
                    None => {
                        for k in 0..LANES {
                            out[k] += w0 * a[k] + w1 * b[k] + w2 * c[k] + w3 * d[k];
                        }
                    }
                    Some(transmission) => {
                        let left = &transmission[plane * n + across];
                        for k in 0..LANES {
                            out[k] += left[k] * (w0 * a[k] + w1 * b[k] + w2 * c[k] + w3 * d[k]);
                        }
                    }
                }
            }
        }
    }

    /// The first of the four voxels about a point of a ray, and their weights; `None` outside.
    fn corner(&self, view: &View, toward: f64, across: usize) -> Option<(usize, [f32; 4])> {
        let u = across as f64 - self.middle;
        let x = view.cos * toward - view.sin * u + self.middle;
        let y = view.sin * toward + view.cos * u + self.middle;
        if x < 0.0 || y < 0.0 {
            return None;
        }
        let (i, j) = (x as usize, y as usize);
        if i + 1 >= self.count || j + 1 >= self.count {
            return None;
        }
        let (f, g) = ((x - i as f64) as f32, (y - j as f64) as f32);
        let weights = [(1.0 - f) * (1.0 - g), (1.0 - f) * g, f * (1.0 - g), f * g];
        Some((i * self.count + j, weights))
    }

    /// Adds the bins of a view to the voxels that they see.
    fn back(
        &self,
        view: usize,
        bins: &[Lanes],
        transmission: Option<&[Lanes]>,
        image: &mut [Lanes],
    ) {
        let (n, middle, view) = (self.count, self.middle, &self.views[view]);
        for x in 0..n {
            let dx = x as f64 - middle;
            for y in 0..n {
                let dy = y as f64 - middle;
                let u = view.cos * dy - view.sin * dx + middle;
                let plane = middle - (view.cos * dx + view.sin * dy);
                if u < 0.0 || plane < 0.0 {
                    continue;
                }
                let (i, j) = (u as usize, plane as usize);
                if i + 1 >= n || (transmission.is_some() && j + 1 >= n) {
                    continue;
                }
                let f = (u - i as f64) as f32;
                let [a, b] = [&bins[i], &bins[i + 1]];
                let out = &mut image[x * n + y];
                match transmission {
                    None => {
                        for k in 0..LANES {
                            out[k] += (1.0 - f) * a[k] + f * b[k];
                        }
                    }
                    Some(transmission) => {
                        let g = (plane - j as f64) as f32;
                        let (near, far) = (j * n + i, (j + 1) * n + i);
                        let [p, q] = [&transmission[near], &transmission[near + 1]];
                        let [r, s] = [&transmission[far], &transmission[far + 1]];
                        for k in 0..LANES {
                            out[k] += (1.0 - f) * a[k] * ((1.0 - g) * p[k] + g * r[k])
                                + f * b[k] * ((1.0 - g) * q[k] + g * s[k]);
                        }
                    }
                }
            }
        }
    }

    /// The share of each place's rays that reaches the detector of a view, at each (plane, bin).
    fn transmission(&self, view: usize, attenuation: &[Lanes], voxel_mm: f32) -> Vec<Lanes> {
        let (n, middle, view) = (self.count, self.middle, &self.views[view]);
        let mut left = vec![[1.0_f32; LANES]; n];
        let mut all = Vec::with_capacity(n * n);
        for plane in 0..n {
            let toward = middle - plane as f64;
            for (across, left) in left.iter_mut().enumerate() {
                let mut here = *left;
                if let Some((at, [w0, w1, w2, w3])) = self.corner(view, toward, across) {
                    let [a, b] = [&attenuation[at], &attenuation[at + 1]];
                    let [c, d] = [&attenuation[at + n], &attenuation[at + n + 1]];
                    for k in 0..LANES {
                        let sum = w0 * a[k] + w1 * b[k] + w2 * c[k] + w3 * d[k];
                        let loss = voxel_mm * sum;
                        here[k] = left[k] * (1.0 - 0.5 * loss + 0.125 * loss * loss);
                        let square = loss * loss;
                        left[k] *= 1.0 - loss + 0.5 * square - square * loss / 6.0;
                    }
                }
                all.push(here);
            }
        }
        all
    }
}

/// The first view of each subset, far ones after one another.
fn subset_order(subsets: usize) -> Vec<usize> {
    let bits = subsets.next_power_of_two().trailing_zeros().max(1);
    let reversed = |k: usize| (k.reverse_bits() >> (usize::BITS - bits)) % (1 << bits);
    (0..1 << bits)
        .map(reversed)
        .filter(|first| *first < subsets)
        .collect()
}

fn osem(
    projections: &Grid,
    views: &[View],
    voxel_mm: f64,
    how: &Reconstruction,
    known: &Knowledge,
) -> Grid {
    let scanner = scanner(projections, views);
    in_packs(projections, scanner.count, |start| {
        let n = scanner.count;
        let counts = pack(projections, start);
        let scatter = known.scatter.map(|grid| pack(grid, start));
        let attenuation = known.attenuation.map(|grid| pack(grid, start));
        let transmission: Option<Vec<Vec<Lanes>>> = attenuation.map(|attenuation| {
            let each = 0..views.len();
            each.map(|v| scanner.transmission(v, &attenuation, voxel_mm as f32))
                .collect()
        });
        let passed = |view: usize| transmission.as_ref().map(|all| &all[view][..]);
        let subsets: Vec<Vec<usize>> = (subset_order(how.subsets).into_iter())
            .map(|first| (first..views.len()).step_by(how.subsets).collect())
            .collect();
        let ones = vec![[1.0; LANES]; n];
        let seen: Vec<Vec<Lanes>> = (subsets.iter())
            .map(|subset| {
                let mut sum = vec![[0.0; LANES]; n * n];
                for view in subset {
                    scanner.back(*view, &ones, passed(*view), &mut sum);
                }
                sum
            })
            .collect();
        let mut image = scanner.disc();
        let mut estimate = vec![[0.0; LANES]; n];
        let mut change = vec![[0.0; LANES]; n * n];
        for _ in 0..how.iterations {
            for (subset, seen) in subsets.iter().zip(&seen) {
                change.fill([0.0; LANES]);
                for view in subset {
                    scanner.forward(*view, &image, passed(*view), &mut estimate);
                    for (across, estimate) in estimate.iter_mut().enumerate() {
                        let counts = &counts[view * n + across];
                        for k in 0..LANES {
                            let more = scatter.as_ref().map_or(0.0, |s| s[view * n + across][k]);
                            let expected = estimate[k] + more;
                            let quotient = counts[k] / expected.max(1e-6);
                            estimate[k] = if expected > 1e-6 { quotient } else { 0.0 };
                        }
                    }
                    scanner.back(*view, &estimate, passed(*view), &mut change);
                }
                for ((image, change), seen) in image.iter_mut().zip(&change).zip(seen) {
                    for k in 0..LANES {
                        let factor = change[k] / seen[k].max(1e-4);
                        image[k] *= if seen[k] > 1e-4 { factor } else { 0.0 };
                    }
                }
            }
        }
        image
    })
}

impl Scanner<'_> {
    /// 1 in the disc that every view sees, 0 outside.
    fn disc(&self) -> Vec<Lanes> {
        let n = self.count;
        let off = |at: usize| (at as f64 - self.middle).powi(2);
        let inside = |at: usize| off(at / n) + off(at % n) < (self.middle - 0.5).powi(2);
        (0..n * n)
            .map(|at| [if inside(at) { 1.0 } else { 0.0 }; LANES])
            .collect()
    }
}

fn scanner<'a>(projections: &Grid, views: &'a [View]) -> Scanner<'a> {
    let count = projections.shape[1];
    Scanner {
        views,
        count,
        middle: 0.5 * (count - 1) as f64,
    }
}

/// The slices from `start` on of every column of a grid; 0 beyond the last.
fn pack(grid: &Grid, start: usize) -> Vec<Lanes> {
    let count = LANES.min(grid.shape[2] - start);
    let columns = grid.values.chunks_exact(grid.shape[2]);
    columns
        .map(|column| {
            let mut lanes = [0.0; LANES];
            lanes[..count].copy_from_slice(&column[start..start + count]);
            lanes
        })
        .collect()
}

/// The image whose packs of slices `make` makes; packs without counts stay 0.
fn in_packs(projections: &Grid, voxels: usize, make: impl Fn(usize) -> Vec<Lanes> + Sync) -> Grid {
    let slices = projections.shape[2];
    let [views, across, _] = projections.shape;
    let starts: Vec<usize> = (0..slices).step_by(LANES).collect();
    let packs: Vec<Option<Vec<Lanes>>> = (starts.par_iter())
        .map(|start| {
            let end = (start + LANES).min(slices);
            let filled = (0..views * across).any(|row| {
                let column = projections.column(row / across, row % across);
                column[*start..end].iter().any(|v| *v != 0.0)
            });
            filled.then(|| make(*start))
        })
        .collect();
    let mut image = Grid::zeros([voxels, voxels, slices]);
    for (start, made) in starts.iter().zip(packs) {
        let end = (start + LANES).min(slices);
        for (column, lanes) in made.into_iter().flatten().enumerate() {
            let at = column * slices;
            image.values[at + start..at + end].copy_from_slice(&lanes[..end - start]);
        }
    }
    image
}

fn fbp(projections: &Grid, views: &[View], voxel_mm: f64, filter: &Filter) -> Grid {
    let [count, across, along] = projections.shape;
    let padded = (2 * across).next_power_of_two();
    let ramp = ramp(padded);
    let gain = |u: usize, z: usize| {
        let [fu, fz] = [
            frequency(u, padded, voxel_mm),
            frequency(z, along, voxel_mm),
        ];
        ramp[u] * filter.gain(fu.hypot(fz)) as f32
    };
    let filtered: Vec<Vec<f32>> = (0..count)
        .into_par_iter()
        .map(|view| {
            let mut plane = Spectrum::zeros([1, padded, along]);
            for u in 0..across {
                let row = projections.column(view, u);
                for (z, value) in row.iter().enumerate() {
                    plane.values[u * along + z] = Wave::new(*value, 0.0);
                }
            }
            plane.filter(|[_, u, z]| gain(u, z));
            plane.values[..across * along]
                .iter()
                .map(|v| v.re)
                .collect()
        })
        .collect();
    let filtered = Grid {
        shape: projections.shape,
        values: filtered.concat(),
    };
    let scanner = scanner(projections, views);
    // The integral over half a turn, whatever arc the views cover.
    let share = (PI / count as f64) as f32;
    in_packs(&filtered, across, |start| {
        let rows = pack(&filtered, start);
        let mut image = vec![[0.0; LANES]; across * across];
        for view in 0..count {
            scanner.back(
                view,
                &rows[view * across..(view + 1) * across],
                None,
                &mut image,
            );
        }
        image.iter_mut().flatten().for_each(|v| *v *= share);
        image
    })
}

/// The spectrum of the ramp of a band-limited signal, from its values in space (Kak and Slaney 1988, eq. 3.61).
fn ramp(count: usize) -> Vec<f32> {
    let value = |n: usize| {
        let off = n.min(count - n) as f64;
        match n {
            0 => 0.25,
            n if n % 2 == 1 => -1.0 / (PI * off).powi(2),
            _ => 0.0,
        }
    };
    let mut line: Vec<Wave> = (0..count)
        .map(|n| Wave::new(value(n) as f32, 0.0))
        .collect();
    Fft::new(count).process(&mut line, false);
    line.iter().map(|v| v.re).collect()
}

/// The image with the filter's share of each frequency.
pub fn filtered(image: &Grid, voxel_mm: f64, filter: &Filter) -> Grid {
    let shape = image.shape;
    let values = image.values.iter().map(|v| Wave::new(*v, 0.0)).collect();
    let mut spectrum = Spectrum { shape, values };
    spectrum.filter(|at| {
        let f = [0, 1, 2].map(|i| frequency(at[i], shape[i], voxel_mm));
        filter.gain((f[0] * f[0] + f[1] * f[1] + f[2] * f[2]).sqrt()) as f32
    });
    Grid {
        shape,
        values: spectrum.values.iter().map(|v| v.re).collect(),
    }
}

/// The frequency of a place of a spectrum, per cm.
fn frequency(at: usize, count: usize, voxel_mm: f64) -> f64 {
    let turns = if 2 * at > count { count - at } else { at };
    turns as f64 / count as f64 / (voxel_mm / 10.0)
}

/// Complex numbers on a grid, z fastest. Each axis has a power of two of them.
struct Spectrum {
    shape: [usize; 3],
    values: Vec<Wave>,
}

impl Spectrum {
    fn zeros(shape: [usize; 3]) -> Self {
        Self {
            shape,
            values: vec![Wave::default(); shape.iter().product()],
        }
    }

    /// Multiplies the spectrum by a gain.
    fn filter(&mut self, gain: impl Fn([usize; 3]) -> f32) {
        self.transform(false);
        let [_, ny, nz] = self.shape;
        let scale = 1.0 / self.values.len() as f32;
        for (at, value) in self.values.iter_mut().enumerate() {
            *value *= scale * gain([at / (ny * nz), at / nz % ny, at % nz]);
        }
        self.transform(true);
    }

    fn transform(&mut self, inverse: bool) {
        for axis in [2, 1, 0] {
            let count = self.shape[axis];
            if count == 1 {
                continue;
            }
            let fft = Fft::new(count);
            if axis == 2 {
                fft.process(&mut self.values, inverse);
                continue;
            }
            // Planes of rows become columns: the axis is made the fastest, and put back.
            let inner: usize = self.shape[axis + 1..].iter().product();
            let mut lines = vec![Wave::default(); count * inner];
            for block in self.values.chunks_exact_mut(count * inner) {
                for (at, value) in block.iter().enumerate() {
                    lines[at % inner * count + at / inner] = *value;
                }
                fft.process(&mut lines, inverse);
                for (at, value) in block.iter_mut().enumerate() {
                    *value = lines[at % inner * count + at / inner];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
