//! The distance of a beating wall from the gates and from prior knowledge of walls: the function that the fit
//! minimises.
//!
//! Image: the mean over voxels and gates of the squared difference of the blurred activity and the gate, within
//! reach of the wall, in units of the wall's own uptake. Priors: neighbouring nodes differ little (second
//! differences of every field); the wall is as thick in the mean as the caller says; the rim stays near that of the
//! summed image; the gates' factors are near 1; where the wall is dark it moves little.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

use super::fields::{COLUMNS, Conservation, Layout, ROW_SPACING_MM, StateGradient, WallState};
use super::image::{Activity, ActivityGradient, Blur, HeartGrid, Sample};
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::deform::wall_thickness::WallThickness;
use crate::heart::model::wall::RayCoordinates;
use crate::image::grid::blur::FWHM_PER_SIGMA;
use rayon::prelude::*;

/// Value of the function where voxels are off by the wall's own uptake in the mean.
pub(super) const VALUE_SCALE: f64 = 1e4;

/// Prior knowledge of walls, independent of the image, as weights: each adds a square to the function, whose
/// unit is 1e-4 of the squared uptake in the mean over voxels.
#[derive(Debug, Clone, PartialEq)]
pub struct Priors {
    /// Weight of second differences of the wall's mean distance, 1/mm².
    pub mid_wall: f64,
    /// Of the motion's first harmonic, 1/mm²; that of harmonic k is k times as large.
    pub motion: f64,
    /// Of the thickness, 1/mm².
    pub thickness: f64,
    /// Of the logarithm of the uptake.
    pub uptake: f64,
    /// Of the logarithm of the activity outside of the wall.
    pub outside: f64,
    /// Mean thickness of the wall over beat and wall, mm: the gates do not tell it.
    pub mean_thickness_mm: f64,
    /// Its standard deviation, mm.
    pub mean_thickness_sd_mm: f64,
    /// Weight of the thickness's distance from its mean, 1/mm².
    pub thickness_near: f64,
    /// Weight of differences of the rim's shift between neighbouring columns, 1/mm².
    pub rim: f64,
    /// Weight of the rim's mean shift against the summed image's, 1/mm².
    pub rim_level: f64,
    /// Weight of the logarithm of the gates' factors.
    pub gain: f64,
    /// Weight of the logarithm of the long axis's stretch.
    pub stretch: f64,
    /// Weight of motion where the wall is dark, 1/mm².
    pub still: f64,
}

impl Default for Priors {
    fn default() -> Self {
        Self {
            mid_wall: 0.02,
            motion: 0.2,
            thickness: 2.0,
            uptake: 0.3,
            outside: 0.3,
            mean_thickness_mm: 10.0,
            mean_thickness_sd_mm: 1.0,
            thickness_near: 0.02,
            rim: 0.02,
            rim_level: 0.02,
            gain: 2e3,
            stretch: 30.0,
            still: 0.05,
        }
    }
}

impl Priors {
    /// These, about a wall whose thickness is known so far.
    pub(super) fn of_wall(&self, thickness: Option<&WallThickness>) -> Self {
        let mean_thickness_mm = thickness.map_or(self.mean_thickness_mm, |wall| wall.mean_mm);
        Self {
            mean_thickness_mm,
            ..self.clone()
        }
    }
}

/// The function to minimise.
#[derive(Debug)]
pub(super) struct Objective {
    pub layout: Layout,
    pub coordinates: RayCoordinates,
    pub conservation: Conservation,
    pub grid: HeartGrid,
    pub blur: Blur,
    pub observed: Observed,
    priors: Priors,
    /// Share of the wall's area at each node, apical of the rim.
    areas: Vec<f64>,
    /// Sum of the weights over voxels and gates.
    total_weight: f64,
}

/// The gates on the grid about the heart, and what is known of the wall from their sum.
#[derive(Debug)]
pub(super) struct Observed {
    /// The gates, in units of the wall's uptake.
    pub images: Vec<Vec<f32>>,
    /// Weight of every gate.
    pub gate_weights: Vec<f64>,
    /// Weight of every voxel.
    pub weights: Vec<f32>,
    /// The harmonics of every gate.
    pub bases: Vec<Vec<f64>>,
    /// Rim of the summed image's wall, mm of arc.
    pub rim: Vec<f64>,
    /// The darkness of the wall at every node, 0..=1.
    pub dark: Vec<f64>,
}

/// A gate as the unknowns describe it.
struct GateView {
    state: WallState,
    /// The wall's share of each voxel.
    samples: Vec<Sample>,
    /// The blurred image, without the gate's factor.
    seen: Vec<f32>,
    gain: f32,
}

impl Objective {
    pub fn new(
        layout: Layout,
        coordinates: RayCoordinates,
        grid: HeartGrid,
        resolution_mm: f64,
        observed: Observed,
        priors: Priors,
    ) -> Self {
        let mut areas: Vec<f64> = (0..layout.nodes())
            .map(|node| {
                let arc = (node / COLUMNS) as f64 * ROW_SPACING_MM;
                if arc < coordinates.rim_arc {
                    around(&coordinates, arc)
                } else {
                    0.0
                }
            })
            .collect();
        let sum: f64 = areas.iter().sum();
        areas.iter_mut().for_each(|a| *a /= sum);
        let voxels: f64 = observed.weights.iter().map(|w| f64::from(*w)).sum();
        Self {
            total_weight: voxels * observed.gate_weights.iter().sum::<f64>(),
            conservation: Conservation::new(&coordinates, &layout),
            blur: Blur::new(grid.shape, resolution_mm),
            layout,
            coordinates,
            grid,
            observed,
            priors,
            areas,
        }
    }

    /// The harmonics of every gate.
    pub fn bases(&self) -> &[Vec<f64>] {
        &self.observed.bases
    }

    /// Share of the wall's area at each node, apical of the rim.
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// Weight of a voxel of a gate, by which the square of what is left of it counts.
    pub fn voxel_weight(&self) -> f64 {
        VALUE_SCALE / self.total_weight
    }

    /// Share of the wall that is too dark to show its motion, 0..=1.
    pub fn dark_share(&self) -> f64 {
        let dark = self.areas.iter().zip(&self.observed.dark);
        dark.map(|(area, dark)| area * dark).sum()
    }

    /// The same function with another mean thickness, known to `sd` mm.
    pub fn with_mean_thickness(mut self, mean: f64, sd: f64) -> Self {
        self.priors.mean_thickness_mm = mean;
        self.priors.mean_thickness_sd_mm = sd;
        self
    }

    /// Takes the blur by the motion at `unknowns` off `resolution_mm`, the full width at half maximum of a point in the
    /// sum of the gates: a single gate has less of it.
    pub fn take_motion_off(&mut self, resolution_mm: f64, unknowns: &[f64]) {
        /// Least width, as a share of the sum's.
        const LEAST_SHARE: f64 = 0.75;
        let squares =
            resolution_mm.powi(2) - FWHM_PER_SIGMA.powi(2) * self.motion_variance(unknowns);
        let width = squares.max(0.0).sqrt().max(LEAST_SHARE * resolution_mm);
        self.blur = Blur::new(self.grid.shape, width);
    }

    /// Variance of the distance of the wall over the beat, in the mean over the wall, mm².
    fn motion_variance(&self, unknowns: &[f64]) -> f64 {
        let mut variance = 0.0;
        for index in 0..2 * self.layout.harmonics {
            let motion = &unknowns[self.layout.motion(index)];
            let squares = motion.iter().zip(&self.areas).map(|(a, area)| a * a * area);
            variance += squares.sum::<f64>() / 2.0;
        }
        variance
    }

    /// Mean thickness of the wall, mm.
    pub fn mean_thickness(&self, unknowns: &[f64]) -> f64 {
        let thickness = &unknowns[self.layout.thickness()];
        thickness.iter().zip(&self.areas).map(|(h, a)| h * a).sum()
    }

    /// The activity that the unknowns describe.
    pub fn activity(&self, unknowns: &[f64]) -> Activity {
        let layout = &self.layout;
        let exp = |range: std::ops::Range<usize>| unknowns[range].iter().map(|x| x.exp()).collect();
        Activity {
            uptake: exp(layout.uptake()),
            outside: exp(layout.outside()),
            rim: unknowns[layout.rim()].to_vec(),
            blood: unknowns[layout.blood()].exp(),
        }
    }

    /// The gates as the unknowns describe them, in units of the wall's uptake.
    pub fn seen(&self, unknowns: &[f64]) -> Vec<Vec<f32>> {
        let activity = self.activity(unknowns);
        let of = |gate: usize| {
            let mut view = self.view(gate, unknowns, &activity);
            view.seen.iter_mut().for_each(|value| *value *= view.gain);
            view.seen
        };
        (0..self.layout.gates).into_par_iter().map(of).collect()
    }

    fn view(&self, gate: usize, unknowns: &[f64], activity: &Activity) -> GateView {
        let layout = &self.layout;
        let basis = &self.observed.bases[gate];
        let state = self.conservation.state(layout, unknowns, basis);
        let samples = self.grid.samples(layout, &state, activity);
        GateView {
            seen: self.blur.apply(HeartGrid::paint(&samples)),
            gain: unknowns[layout.gains().start + gate].exp() as f32,
            state,
            samples,
        }
    }

    /// The value, and the gradient into `gradient`.
    pub fn evaluate(
        &self,
        unknowns: &[f64],
        gradient: &mut [f64],
        monitor: &Monitor,
    ) -> Result<f64, Cancelled> {
        gradient.fill(0.0);
        let layout = &self.layout;
        let activity = self.activity(unknowns);
        let observed = &self.observed;
        let gates: Vec<_> = (0..layout.gates)
            .into_par_iter()
            .map(|gate| {
                monitor.check()?;
                let scale = VALUE_SCALE * observed.gate_weights[gate] / self.total_weight;
                let GateView {
                    state,
                    samples,
                    seen,
                    gain,
                } = self.view(gate, unknowns, &activity);
                let (mut value, mut by_gain) = (0.0, 0.0);
                let by_seen = (0..seen.len())
                    .map(|v| {
                        let weight = observed.weights[v];
                        let off = gain * seen[v] - observed.images[gate][v];
                        value += f64::from(weight * off * off);
                        by_gain += f64::from(weight * off * gain * seen[v]);
                        2.0 * scale as f32 * weight * off * gain
                    })
                    .collect();
                let by_voxel = self.blur.transposed(by_seen);
                let mut by_state = StateGradient::zero(layout);
                let mut by_activity = ActivityGradient::zero(layout);
                self.grid.gradient(
                    &samples,
                    &state,
                    &activity,
                    &by_voxel,
                    &mut by_state,
                    &mut by_activity,
                );
                Ok((
                    value * scale,
                    2.0 * by_gain * scale,
                    state,
                    by_state,
                    by_activity,
                ))
            })
            .collect::<Result<_, Cancelled>>()?;
        let mut value = 0.0;
        for (gate, (part, by_gain, state, by_state, by_activity)) in gates.into_iter().enumerate() {
            value += part;
            gradient[layout.gains().start + gate] += by_gain;
            let basis = &observed.bases[gate];
            self.conservation
                .add_gradient(layout, unknowns, basis, &state, &by_state, gradient);
            for node in 0..layout.nodes() {
                gradient[layout.uptake().start + node] +=
                    by_activity.uptake[node] * activity.uptake[node];
                gradient[layout.outside().start + node] +=
                    by_activity.outside[node] * activity.outside[node];
            }
            for column in 0..COLUMNS {
                gradient[layout.rim().start + column] += by_activity.rim[column];
            }
            gradient[layout.blood()] += by_activity.blood * activity.blood;
        }
        for (range, weight) in self.smooth_fields() {
            let field = &unknowns[range.clone()];
            value += self.roughness(field, weight, &mut gradient[range]);
        }
        value += self.add_levels(unknowns, gradient);
        Ok(value)
    }

    /// The fields, and the weight of each one's roughness.
    pub fn smooth_fields(&self) -> Vec<(Range<usize>, f64)> {
        let (layout, priors) = (&self.layout, &self.priors);
        let motion = (0..2 * layout.harmonics).map(|index| {
            let order = (index % layout.harmonics + 1) as f64;
            (layout.motion(index), priors.motion * order)
        });
        let still = [
            (layout.mid_wall(), priors.mid_wall),
            (layout.thickness(), priors.thickness),
            (layout.uptake(), priors.uptake),
            (layout.outside(), priors.outside),
        ];
        still.into_iter().chain(motion).collect()
    }

    /// The priors of levels, not of smoothness; their gradient is added.
    pub fn add_levels(&self, unknowns: &[f64], gradient: &mut [f64]) -> f64 {
        let (layout, priors) = (&self.layout, &self.priors);
        let mut value = 0.0;
        for index in 0..2 * layout.harmonics {
            let range = layout.motion(index);
            for (node, dark) in self.observed.dark.iter().enumerate() {
                let a = unknowns[range.start + node];
                value += priors.still * dark * a * a;
                gradient[range.start + node] += 2.0 * priors.still * dark * a;
            }
        }
        let thickness = &unknowns[layout.thickness()];
        let mean = self.mean_thickness(unknowns);
        let off = (mean - priors.mean_thickness_mm) / priors.mean_thickness_sd_mm;
        value += off * off;
        let mut sum = 0.0;
        for (node, h) in thickness.iter().enumerate() {
            let near = h - mean;
            value += priors.thickness_near * near * near;
            sum += 2.0 * priors.thickness_near * near;
            gradient[layout.thickness().start + node] += 2.0 * priors.thickness_near * near;
        }
        for (node, area) in self.areas.iter().enumerate() {
            gradient[layout.thickness().start + node] +=
                area * (2.0 * off / priors.mean_thickness_sd_mm - sum);
        }
        let rim = &unknowns[layout.rim()];
        let mut level = 0.0;
        for column in 0..COLUMNS {
            let next = (column + 1) % COLUMNS;
            let off = rim[column] - self.observed.rim[column];
            let step = off - (rim[next] - self.observed.rim[next]);
            value += priors.rim * step * step;
            gradient[layout.rim().start + column] += 2.0 * priors.rim * step;
            gradient[layout.rim().start + next] -= 2.0 * priors.rim * step;
            level += off / COLUMNS as f64;
        }
        value += priors.rim_level * level * level;
        gradient[layout.rim()]
            .iter_mut()
            .for_each(|g| *g += 2.0 * priors.rim_level * level / COLUMNS as f64);
        let gains = layout.gains();
        let mean = unknowns[gains.clone()].iter().sum::<f64>() / layout.gates as f64;
        value += 20.0 * mean * mean;
        for gain in gains {
            let g = unknowns[gain];
            value += priors.gain * g * g;
            gradient[gain] += 40.0 * mean / layout.gates as f64 + 2.0 * priors.gain * g;
        }
        for index in layout.stretch() {
            let l = unknowns[index];
            value += priors.stretch * l * l;
            gradient[index] += 2.0 * priors.stretch * l;
        }
        value
    }

    /// `weight` times the squares of the second differences of a field, along columns and about the axis; the
    /// gradient is added.
    pub fn roughness(&self, field: &[f64], weight: f64, gradient: &mut [f64]) -> f64 {
        let rows = self.layout.rows;
        let mut value = 0.0;
        for row in 1..rows - 1 {
            for column in 0..COLUMNS {
                let node = row * COLUMNS + column;
                let [before, after] = [node - COLUMNS, node + COLUMNS];
                let d = field[before] - 2.0 * field[node] + field[after];
                value += d * d;
                gradient[before] += 2.0 * weight * d;
                gradient[node] -= 4.0 * weight * d;
                gradient[after] += 2.0 * weight * d;
            }
        }
        for row in 0..rows {
            let arc = row as f64 * ROW_SPACING_MM;
            let circle = around(&self.coordinates, arc).max(0.15);
            let spacing = TAU * self.coordinates.cap_radius / COLUMNS as f64 / ROW_SPACING_MM;
            let around = (1.0 / (circle * circle)).min(20.0) / (spacing * spacing);
            let start = row * COLUMNS;
            for column in 0..COLUMNS {
                let [before, node, after] =
                    [column + COLUMNS - 1, column, column + 1].map(|c| start + c % COLUMNS);
                let d = field[before] - 2.0 * field[node] + field[after];
                value += around * d * d;
                gradient[before] += 2.0 * weight * around * d;
                gradient[node] -= 4.0 * weight * around * d;
                gradient[after] += 2.0 * weight * around * d;
            }
            let together = 6.0 * (-(arc / 8.0).powi(2)).exp();
            let mean = field[start..start + COLUMNS].iter().sum::<f64>() / COLUMNS as f64;
            for node in start..start + COLUMNS {
                let d = field[node] - mean;
                value += together * d * d;
                gradient[node] += 2.0 * weight * together * d;
            }
        }
        weight * value
    }
}

/// Circumference of the wall at an arc, as a share of that of the cylinder.
fn around(coordinates: &RayCoordinates, arc: f64) -> f64 {
    (arc / coordinates.cap_radius).min(FRAC_PI_2).sin()
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::fields::gate_harmonics;
    use super::*;
    use crate::base::geometry::Vec3;

    /// Three gates of a small wall, and unknowns away from every border of a ramp's kink as far as chance goes.
    pub fn scene() -> (Objective, Vec<f64>) {
        let coordinates = RayCoordinates {
            focus: Vec3::zeros(),
            axis: Vec3::z(),
            lateral: Vec3::x(),
            anterior: Vec3::y(),
            cap_radius: 25.0,
            rim_arc: 60.0,
        };
        let layout = Layout::new(&coordinates, 2, 3);
        let grid = HeartGrid::new(&coordinates, 36.0, 16.0, 44.0);
        let wave = |n: usize, by: f64| 0.5 + 0.5 * (n as f64 * by).sin();
        let images = (0..3)
            .map(|gate| {
                (0..grid.points.len())
                    .map(|v| wave(v + 7 * gate, 0.37) as f32)
                    .collect()
            })
            .collect();
        let observed = Observed {
            images,
            gate_weights: vec![1.0, 0.5, 1.0],
            weights: (0..grid.points.len())
                .map(|v| wave(v, 0.11) as f32)
                .collect(),
            bases: gate_harmonics(2, 3),
            rim: vec![60.0; COLUMNS],
            dark: (0..layout.nodes()).map(|n| wave(n, 0.7)).collect(),
        };
        let mut unknowns = vec![0.0; layout.len()];
        for node in 0..layout.nodes() {
            unknowns[layout.mid_wall().start + node] = 22.0 + 3.0 * wave(node, 0.9);
            unknowns[layout.thickness().start + node] = 9.0 + 2.0 * wave(node, 0.4);
            unknowns[layout.uptake().start + node] = 0.4 * wave(node, 0.3) - 0.2;
            unknowns[layout.outside().start + node] = -2.0 + 0.3 * wave(node, 0.8);
            for index in 0..4 {
                unknowns[layout.motion(index).start + node] = 1.5 * wave(node + index, 0.5) - 0.7;
            }
        }
        for (column, rim) in layout.rim().enumerate() {
            unknowns[rim] = 57.0 + 4.0 * wave(column, 1.3);
        }
        for (index, stretch) in layout.stretch().enumerate() {
            unknowns[stretch] = 0.03 * wave(index, 2.1);
        }
        unknowns[layout.blood()] = -2.0;
        for (gate, gain) in layout.gains().enumerate() {
            unknowns[gain] = 0.02 * wave(gate, 1.7);
        }
        let objective =
            Objective::new(layout, coordinates, grid, 12.0, observed, Priors::default());
        (objective, unknowns)
    }

    impl Objective {
        /// The same function, but every gate is what `unknowns` describe.
        pub fn met_by(mut self, unknowns: &[f64]) -> Self {
            let activity = self.activity(unknowns);
            let seen = |gate| self.view(gate, unknowns, &activity).seen;
            self.observed.images = (0..self.layout.gates).map(seen).collect();
            self
        }
    }

    /// The gradient against differences of the value, for some unknowns of every kind.
    #[test]
    fn the_gradient_is_the_change_of_the_value() {
        let (objective, unknowns) = scene();
        let monitor = Monitor::silent();
        let mut gradient = vec![0.0; unknowns.len()];
        objective
            .evaluate(&unknowns, &mut gradient, &monitor)
            .unwrap();
        let value = |at: usize, by: f64| {
            let mut moved = unknowns.clone();
            moved[at] += by;
            let mut unused = vec![0.0; moved.len()];
            objective.evaluate(&moved, &mut unused, &monitor).unwrap()
        };
        let layout = &objective.layout;
        let mut kinds = vec![
            layout.mid_wall(),
            layout.thickness(),
            layout.uptake(),
            layout.outside(),
            layout.rim(),
            layout.stretch(),
            layout.blood()..layout.blood() + 1,
            layout.gains(),
        ];
        kinds.extend((0..4).map(|index| layout.motion(index)));
        for range in kinds {
            let step = (range.len() / 5).max(1);
            let sizes = gradient[range.clone()].iter().map(|g| g.abs());
            let largest = sizes.fold(0.0, f64::max);
            for at in range.clone().step_by(step) {
                const PROBE_STEP: f64 = 1e-3;
                let slope = (value(at, PROBE_STEP) - value(at, -PROBE_STEP)) / (2.0 * PROBE_STEP);
                let off = (slope - gradient[at]).abs();
                // Images are 32-bit floats, and a voxel may pass the kink of a ramp. Gates add up to unknowns that one
                // of them changes more.
                assert!(
                    off < 0.02 * largest + 0.02,
                    "{at} of {range:?}: {slope} {}",
                    gradient[at]
                );
            }
        }
    }
}
