//! A rotating gamma camera: from uptake and attenuation to counts.
//!
//! In: images of uptake and attenuation on points of half a bin. Out: projections, views x bins across the axis x bins
//! along it.
//!
//! 1. For each view the image is walked from the far side to the detector, plane by plane. What came from behind is
//!    attenuated by the plane, blurred by the growth of the collimator's response from this plane to the one before,
//!    and the plane's own uptake is added; so every plane reaches the detector with the width of its distance
//!    (McCarthy and Miller 1991; Zeng et al. 1991).
//! 2. Scatter is what the planes lost on their way, weakened by a lower attenuation, and spread widely.
//! 3. Motion shifts whole views; the sum is scaled to the stated counts; counts are Poisson numbers.
//!
//! Not modelled: scatter by the place where it happens, septal penetration by energy, dead time, truncation.

use super::anatomy::Place;
use super::grid::{Beyond, FWHM_PER_SD, Grid, gaussian};
use super::parameters::{Acquisition, Body, Collimator, Orbit};
use super::random::{Draws, Stream};
use rayon::prelude::*;

/// Points for a bin.
pub const POINTS_PER_BIN: usize = 2;
/// Half of the detector along the patient, mm.
const HALF_FIELD_Z_MM: f64 = 193.0;
/// Half of the detector across the patient, mm.
const HALF_FIELD_U_MM: f64 = 266.0;
/// What is computed beyond the field, mm.
const FIELD_MARGIN_MM: f64 = 25.0;
/// Thickness of a breast, mm.
const BREAST_MM: f64 = 18.0;
/// Least distance of the collimator, mm.
const LEAST_DISTANCE_MM: f64 = 5.0;
/// Attenuation of scattered over that of unscattered rays.
const SCATTER_ATTENUATION: f32 = 0.45;
/// Shares of the scatter and the deviations of its spread, mm.
const SCATTER_SPREAD: [(f32, f64); 2] = [(0.55, 22.0), (0.45, 55.0)];
/// Width of the side window over that of the main one.
const SIDE_WINDOW: f64 = 0.5;
/// Blur of the estimate of the scatter, deviation, mm.
const SCATTER_ESTIMATE_BLUR_MM: f64 = 12.0;

/// Where the detector stands in a view.
#[derive(Debug, Clone, Copy)]
pub struct View {
    /// Cosine of its angle.
    pub cos: f64,
    /// Sine of its angle.
    pub sin: f64,
    /// From the middle to the collimator, mm.
    pub radius_mm: f64,
}

/// A camera and its orbit.
#[derive(Debug, Clone)]
pub struct Camera {
    /// The views.
    pub views: Vec<View>,
    collimator: Collimator,
    /// Bins along an axis.
    bins: usize,
    /// Edge of a bin.
    bin_mm: f64,
}

/// Expected or measured numbers, views x bins across x bins along the axis.
#[derive(Debug, Clone)]
pub struct Rays {
    /// Unscattered.
    pub primary: Grid,
    /// Lost on the way and not spread yet.
    pub scatter: Grid,
}

impl Camera {
    /// The camera of an acquisition about a body.
    pub fn new(acquisition: &Acquisition, body: &Body, bin_mm: f64) -> Self {
        let count = acquisition.views;
        let [first, last] = acquisition.arc_deg;
        let angle = |view: usize| {
            (first + (view as f64 + 0.5) * (last - first) / count as f64).to_radians()
        };
        let extent = |angle: f64| {
            let (sin, cos) = angle.sin_cos();
            let trunk = (body.half_width_mm * cos).hypot(body.half_depth_mm * sin);
            let breast = if body.female {
                BREAST_MM * sin.clamp(0.0, 1.0)
            } else {
                0.0
            };
            let [dx, dy] = body.offset_mm;
            trunk + breast + (dx * cos + dy * sin).abs()
        };
        let near: Vec<f64> = (0..count)
            .map(|v| extent(angle(v)) + acquisition.gap_mm)
            .collect();
        let far = near.iter().copied().fold(0.0, f64::max);
        let views = (0..count)
            .map(|view| {
                let (sin, cos) = angle(view).sin_cos();
                let radius_mm = match acquisition.orbit {
                    Orbit::Contoured => near[view],
                    Orbit::Circular => far,
                };
                View {
                    cos,
                    sin,
                    radius_mm,
                }
            })
            .collect();
        let collimator = acquisition.collimator;
        Self {
            views,
            collimator,
            bins: acquisition.matrix,
            bin_mm,
        }
    }

    /// The place of the images that it projects.
    pub fn place(&self) -> Place {
        let points = POINTS_PER_BIN * self.bins;
        Place::cube(points, self.bin_mm / POINTS_PER_BIN as f64)
    }

    /// Projections of uptake, attenuated if an attenuation is given. Bins beyond the field of view stay 0.
    pub fn project(&self, uptake: &Grid, attenuation: Option<&Grid>) -> Rays {
        let support = support(uptake, attenuation);
        let along = self.slices_seen();
        let shape = [self.views.len(), self.bins, self.bins];
        let mut rays = Rays {
            primary: Grid::zeros(shape),
            scatter: Grid::zeros(shape),
        };
        let size = self.bins * self.bins;
        let views = (rays.primary.values.par_chunks_mut(size))
            .zip(rays.scatter.values.par_chunks_mut(size))
            .zip(&self.views);
        views.for_each(|((primary, scatter), view)| {
            let mut walk = Walk::new(self, view, along);
            walk.through(uptake, attenuation, &support);
            walk.bin(primary, &walk.direct);
            walk.bin(scatter, &walk.scattered());
        });
        rays
    }

    /// The points along z that the field and its margin hold.
    fn slices_seen(&self) -> [usize; 2] {
        let (points, step) = (
            POINTS_PER_BIN * self.bins,
            self.bin_mm / POINTS_PER_BIN as f64,
        );
        let half = (HALF_FIELD_Z_MM + FIELD_MARGIN_MM) / step;
        let middle = 0.5 * (points - 1) as f64;
        let first = (middle - half).max(0.0) as usize / POINTS_PER_BIN * POINTS_PER_BIN;
        let last = ((middle + half) as usize).min(points) / POINTS_PER_BIN * POINTS_PER_BIN;
        [first, last]
    }

    /// Variance of the response at a distance, mm^2.
    fn variance_mm2(&self, distance_mm: f64) -> f64 {
        let c = &self.collimator;
        let distance = distance_mm.max(LEAST_DISTANCE_MM);
        let geometric = c.hole_mm * (1.0 + (distance + c.back_mm) / c.leff_mm);
        (geometric.powi(2) + c.intrinsic_fwhm_mm.powi(2)) / FWHM_PER_SD.powi(2)
    }
}

/// Whether each column of points holds anything.
fn support(uptake: &Grid, attenuation: Option<&Grid>) -> Vec<bool> {
    let [nx, ny, _] = uptake.shape;
    let columns = (0..nx * ny).into_par_iter().map(|at| {
        let filled = |grid: &Grid| grid.column(at / ny, at % ny).iter().any(|v| *v > 0.0);
        filled(uptake) || attenuation.is_some_and(filled)
    });
    columns.collect()
}

/// The walk of one view from the far side to the detector. Its arrays have a row along the axis for each point across.
struct Walk<'a> {
    camera: &'a Camera,
    view: &'a View,
    first: usize,
    length: usize,
    /// What reaches the plane unscattered.
    direct: Vec<f32>,
    /// What would reach the detector if nothing but the lower attenuation of scattered rays took from it.
    weak: Vec<f32>,
    /// What would if both attenuations did.
    both: Vec<f32>,
    spare: Vec<f32>,
}

impl<'a> Walk<'a> {
    fn new(camera: &'a Camera, view: &'a View, [first, last]: [usize; 2]) -> Self {
        let length = last - first;
        let empty = || vec![0.0; POINTS_PER_BIN * camera.bins * length];
        let (direct, weak, both, spare) = (empty(), empty(), empty(), empty());
        Self {
            camera,
            view,
            first,
            length,
            direct,
            weak,
            both,
            spare,
        }
    }

    fn through(&mut self, uptake: &Grid, attenuation: Option<&Grid>, support: &[bool]) {
        let points = POINTS_PER_BIN * self.camera.bins;
        let step = self.camera.bin_mm / POINTS_PER_BIN as f64;
        let middle = 0.5 * (points - 1) as f64;
        let distance = |plane: usize| self.view.radius_mm - (plane as f64 - middle) * step;
        let per_step2 = 1.0 / (2.0 * step * step);
        let mut started = false;
        for plane in 0..points {
            if started {
                let wider = self.camera.variance_mm2(distance(plane - 1))
                    - self.camera.variance_mm2(distance(plane));
                self.spread((wider * per_step2) as f32);
            }
            let toward = plane as f64 - middle;
            for across in 0..points {
                let u = across as f64 - middle;
                let x = self.view.cos * toward - self.view.sin * u + middle;
                let y = self.view.sin * toward + self.view.cos * u + middle;
                if x < 0.0 || y < 0.0 {
                    continue;
                }
                let (i, j) = (x as usize, y as usize);
                if i + 1 >= points || j + 1 >= points {
                    continue;
                }
                let at = i * points + j;
                if [at, at + 1, at + points, at + points + 1]
                    .iter()
                    .all(|at| !support[*at])
                {
                    continue;
                }
                started = true;
                let (f, g) = ((x - i as f64) as f32, (y - j as f64) as f32);
                let weights = [(1.0 - f) * (1.0 - g), (1.0 - f) * g, f * (1.0 - g), f * g];
                let corners = [(i, j), (i, j + 1), (i + 1, j), (i + 1, j + 1)];
                self.pass(across, uptake, attenuation, &corners, &weights, step as f32);
            }
        }
        let last = self.camera.variance_mm2(distance(points - 1));
        self.blur(last.sqrt() / step);
    }

    /// One column of points: attenuates what comes from behind and adds its own uptake.
    #[inline]
    fn pass(
        &mut self,
        across: usize,
        uptake: &Grid,
        attenuation: Option<&Grid>,
        corners: &[(usize, usize); 4],
        weights: &[f32; 4],
        step: f32,
    ) {
        let (first, length) = (self.first, self.length);
        let row = across * length..(across + 1) * length;
        let direct = &mut self.direct[row.clone()];
        let [a0, a1, a2, a3] = columns_of(uptake, corners, first, length);
        let [w0, w1, w2, w3] = *weights;
        let Some(attenuation) = attenuation else {
            for k in 0..length {
                direct[k] += w0 * a0[k] + w1 * a1[k] + w2 * a2[k] + w3 * a3[k];
            }
            return;
        };
        let [m0, m1, m2, m3] = columns_of(attenuation, corners, first, length);
        let weak = &mut self.weak[row.clone()];
        let both = &mut self.both[row];
        for k in 0..length {
            let own = w0 * a0[k] + w1 * a1[k] + w2 * a2[k] + w3 * a3[k];
            let loss = step * (w0 * m0[k] + w1 * m1[k] + w2 * m2[k] + w3 * m3[k]);
            // Both exponentials to the second order; a step loses at most some six per cent.
            let passed = 1.0 - loss + 0.5 * loss * loss;
            let halfway = 1.0 - 0.5 * loss + 0.125 * loss * loss;
            let lower = SCATTER_ATTENUATION * loss;
            let scattered = 1.0 - lower + 0.5 * lower * lower;
            direct[k] = direct[k] * passed + own * halfway;
            weak[k] = weak[k] * scattered + own;
            both[k] = both[k] * (scattered * passed) + own;
        }
    }

    /// What was lost on its way and reaches the detector scattered.
    fn scattered(&self) -> Vec<f32> {
        self.weak
            .iter()
            .zip(&self.both)
            .map(|(weak, both)| weak - both)
            .collect()
    }

    /// Blurs by a kernel of three points whose variance is twice `share` squared steps, along both axes.
    fn spread(&mut self, share: f32) {
        let (length, keep) = (self.length, 1.0 - 2.0 * share);
        for (row, out) in self
            .direct
            .chunks_exact(length)
            .zip(self.spare.chunks_exact_mut(length))
        {
            out[0] = keep * row[0] + share * row[1];
            out[length - 1] = keep * row[length - 1] + share * row[length - 2];
            let inner = row.windows(3).zip(&mut out[1..length - 1]);
            inner.for_each(|(w, out)| *out = keep * w[1] + share * (w[0] + w[2]));
        }
        let rows = self.direct.len() / length;
        for across in 0..rows {
            let row = |at: usize| &self.spare[at * length..(at + 1) * length];
            let out = &mut self.direct[across * length..(across + 1) * length];
            let (before, after) = (across.checked_sub(1), across + 1);
            for (out, own) in out.iter_mut().zip(row(across)) {
                *out = keep * own;
            }
            let beside = before.into_iter().chain((after < rows).then_some(after));
            for near in beside {
                for (out, near) in out.iter_mut().zip(row(near)) {
                    *out += share * near;
                }
            }
        }
    }

    /// Blurs by a normal distribution, in steps, along both axes.
    fn blur(&mut self, sd: f64) {
        let rows = self.direct.len() / self.length;
        let values = std::mem::take(&mut self.direct);
        let mut grid = Grid {
            shape: [1, rows, self.length],
            values,
        };
        let kernel = gaussian(sd);
        grid.convolve(1, &kernel, Beyond::Zero);
        grid.convolve(2, &kernel, Beyond::Zero);
        self.direct = grid.values;
    }

    /// Adds the points of `rows` into bins.
    fn bin(&self, bins: &mut [f32], rows: &[f32]) {
        let count = self.camera.bins;
        for (across, row) in rows.chunks_exact(self.length).enumerate() {
            let out = &mut bins[across / POINTS_PER_BIN * count..][..count];
            let out = &mut out[self.first / POINTS_PER_BIN..];
            for (k, value) in row.iter().enumerate() {
                out[k / POINTS_PER_BIN] += value;
            }
        }
    }
}

/// The points along the axis of four columns.
fn columns_of<'g>(
    grid: &'g Grid,
    corners: &[(usize, usize); 4],
    first: usize,
    length: usize,
) -> [&'g [f32]; 4] {
    corners.map(|(x, y)| &grid.column(x, y)[first..first + length])
}

/// What a camera is expected to count, and what it counts.
#[derive(Debug, Clone)]
pub struct Counts {
    /// Counts.
    pub counts: Grid,
    /// What was expected.
    pub expected: Grid,
    /// The estimate of the scatter from a side window, if it is wanted.
    pub scatter: Option<Grid>,
}

/// Counts of rays.
///
/// `share` is the share of the acquisition's counts that these rays have, `gate` names the streams.
pub fn count(
    rays: &Rays,
    views_of: &[View],
    acquisition: &Acquisition,
    bin_mm: f64,
    exposure: &Exposure,
) -> Counts {
    let mut spread = Grid::zeros(rays.scatter.shape);
    for (part, sd_mm) in SCATTER_SPREAD {
        let mut wide = rays.scatter.clone();
        wide.blur([0.0, sd_mm / bin_mm, sd_mm / bin_mm]);
        spread
            .values
            .iter_mut()
            .zip(&wide.values)
            .for_each(|(s, w)| *s += part * w);
    }
    let scale = acquisition.scatter_to_primary * rays.primary.sum() / spread.sum().max(1e-9);
    let [views, across, along] = rays.primary.shape;
    let off = |at: usize, count: usize| (at as f64 - 0.5 * (count - 1) as f64).abs() * bin_mm;
    let seen =
        |[_, u, z]: [usize; 3]| off(z, along) < HALF_FIELD_Z_MM && off(u, across) < HALF_FIELD_U_MM;
    let in_field = |grid: &Grid, factor: f32| {
        Grid::from_fn(grid.shape, |at| {
            if seen(at) { factor * grid.at(at) } else { 0.0 }
        })
    };
    let mut scatter = in_field(&spread, scale as f32);
    let mut expected = in_field(&rays.primary, 1.0);
    expected
        .values
        .iter_mut()
        .zip(&scatter.values)
        .for_each(|(e, s)| *e += s);
    let factor = (acquisition.total_counts_m * 1e6 * exposure.share / expected.sum()) as f32;
    expected.values.iter_mut().for_each(|e| *e *= factor);
    scatter.values.iter_mut().for_each(|s| *s *= factor);
    if let Some(motion) = &acquisition.body_motion {
        for (view, place) in views_of.iter().enumerate() {
            let [dx, dy] = motion.across(view, views);
            let across = dy * place.cos - dx * place.sin;
            let shift_mm = [across, motion.at(view, views)];
            shift_view(&mut expected, view, shift_mm.map(|mm| mm / bin_mm));
        }
    }
    let draw = |grid: &Grid, factor: f64, stream: &(dyn Fn(usize) -> Stream + Sync)| {
        let mut drawn = Grid::zeros(grid.shape);
        let size = across * along;
        let views = drawn
            .values
            .par_chunks_mut(size)
            .zip(grid.values.par_chunks(size));
        views.enumerate().for_each(|(view, (out, mean))| {
            let mut draws = Draws::new(exposure.seed, stream(view));
            for (out, mean) in out.iter_mut().zip(mean) {
                *out = draws.poisson(factor * f64::from(*mean)) as f32;
            }
        });
        drawn
    };
    let gate = exposure.gate;
    let counts = draw(&expected, 1.0, &|view| Stream::Counts { gate, view });
    let scatter = exposure.side_window.then(|| {
        let mut beside = draw(&scatter, SIDE_WINDOW, &|view| Stream::SideWindow {
            gate,
            view,
        });
        beside
            .values
            .iter_mut()
            .for_each(|v| *v /= SIDE_WINDOW as f32);
        let sd = SCATTER_ESTIMATE_BLUR_MM / bin_mm;
        beside.blur([0.0, sd, sd]);
        beside
    });
    Counts {
        counts,
        expected,
        scatter,
    }
}

/// One exposure of a camera.
#[derive(Debug, Clone, Copy)]
pub struct Exposure {
    /// The seed of its counts.
    pub seed: u64,
    /// The gate.
    pub gate: usize,
    /// Its share of the acquisition's counts.
    pub share: f64,
    /// Whether a side window measures the scatter.
    pub side_window: bool,
}

/// Shifts a view by bins across the axis and along it, by linear interpolation.
fn shift_view(grid: &mut Grid, view: usize, [bins_across, bins_along]: [f64; 2]) {
    let [_, across, along] = grid.shape;
    let size = across * along;
    let own = &mut grid.values[view * size..(view + 1) * size];
    for u in 0..across {
        shift_line(&mut own[u * along..], [1, along], bins_along);
    }
    for z in 0..along {
        shift_line(&mut own[z..], [along, across], bins_across);
    }
}

/// Shifts a line of so many values, `step` apart.
fn shift_line(values: &mut [f32], [step, count]: [usize; 2], bins: f64) {
    if bins == 0.0 {
        return;
    }
    let line: Vec<f32> = (0..count).map(|n| values[n * step]).collect();
    for n in 0..count {
        let from = (n as f64 - bins).clamp(0.0, (count - 1) as f64);
        let low = (from as usize).min(count - 2);
        let share = (from - low as f64) as f32;
        values[n * step] = line[low] + share * (line[low + 1] - line[low]);
    }
}

#[cfg(test)]
mod tests;
