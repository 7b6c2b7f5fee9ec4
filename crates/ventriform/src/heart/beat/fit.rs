//! The fit of one wall to all gates.
//!
//! In: a [`GatedStudy`], the anatomical wall of its summed image with its thickness, the image's resolution. Out: a
//! [`BeatFit`]: the wall at every moment of the beat. The steps:
//!
//! 1. The gates are resampled (cubic convolution) to a grid along the heart's axis, and turned so that the one with the
//!    least energy about the wall is the first: the steps, which end before the value is at rest, are then the same
//!    wherever in the cycle the study begins.
//! 2. The motion has two harmonics where the gates are noisy, else three or four ([`spectrum`](super::spectrum)).
//! 3. The fit starts from the summed image's wall, which stands still, as thick in the mean as is known.
//! 4. [`lbfgs::minimise`] moves all unknowns at once: distance, motion, thickness, uptake, rim, the long axis's
//!    stretch, activity beside the wall, the gates' factors. Its steps are those of the [`Curvature`], without which
//!    the motion is a fifth too small after 60 steps, though the value has fallen by 95 per cent. It ends when EF is
//!    at rest.
//! 5. The summed image's resolution holds the blur by the motion. Once the motion is nearly found, its part is taken
//!    off.
//!
//! Guaranteed: the muscle of every column is the same at every moment; the same study gives the same figures on any
//! number of threads, and wherever in the cycle it begins.

use std::f64::consts::TAU;
use std::ops::Range;

use super::carried::CarriedNodes;
use super::curvature::Curvature;
use super::error::BeatError;
use super::fields::{COLUMNS, Layout, Nodes, ROW_SPACING_MM, WallState, gate_harmonics, harmonics};
use super::image::HeartGrid;
use super::moment::WallMoment;
use super::noise;
use super::objective::{Objective, Observed, Priors};
use super::order::share_as_smooth;
use super::spectrum::usual_harmonics;
use super::start::StillWall;
use super::study::GatedStudy;
use crate::base::geometry::Vec3;
use crate::base::numeric::lbfgs;
use crate::base::progress::{Cancelled, Monitor, Stage};
use crate::heart::deform::wall_thickness::WallThickness;
use crate::heart::model::wall::VentricleWall;
use crate::image::grid::Volume;
use crate::image::grid::field::Field;
use crate::mesh::TriMesh;
use rayon::prelude::*;

/// Grid beyond the apex, the base and the wall, mm.
const GRID_MARGIN_MM: f64 = 20.0;
/// Distance from the middle of the wall up to which voxels count, and from which they count half, mm.
const REACH_MM: [f64; 2] = [14.0, 10.0];
/// Arc beyond the rim up to which voxels count, mm.
const BEYOND_RIM_MM: f64 = 8.0;
/// Steps after which the curvature is taken anew, and the width of the gates with it: the motion is nearly found.
const STEPS_OF_ONE_CURVATURE: [usize; 2] = [15, 30];
/// Steps after which EF is looked at, and the change of EF between two looks that counts as rest. Rest counts only when
/// it lasts for two looks.
const STEPS_BETWEEN_LOOKS: usize = 10;
const EF_AT_REST: f64 = 0.002;
const LOOKS_AT_REST: usize = 2;
/// Fits until a known volume of muscle is met, and the deviation of the thickness in them, mm.
const MUSCLE_FITS: usize = 2;
const KNOWN_THICKNESS_SD_MM: f64 = 0.1;
/// Moments of the curve from which EF is taken.
const CURVE_MOMENTS: usize = 48;

/// Parameters of [`fit`].
#[derive(Debug, Clone, PartialEq)]
pub struct BeatParameters {
    /// Weights of what is known of walls.
    pub priors: Priors,
    /// Thickness of the wall, as far as the summed image tells it. Default: the mean thickness of [`Priors`].
    pub thickness: Option<WallThickness>,
    /// Harmonics of the motion; `None`: 3, 4 from 16 gates on, 2 where the gates are noisy or fewer than 8.
    pub harmonics: Option<usize>,
    /// Most steps, 1..=2000. Default 400.
    pub max_steps: usize,
    /// Volume of the muscle, ml, where it is known. Default: it follows from the thickness.
    pub muscle_ml: Option<f64>,
}

impl Default for BeatParameters {
    fn default() -> Self {
        Self {
            priors: Priors::default(),
            thickness: None,
            harmonics: None,
            max_steps: 400,
            muscle_ml: None,
        }
    }
}

/// A wall that was fitted to all gates.
#[derive(Debug)]
pub struct BeatFit {
    objective: Objective,
    unknowns: Vec<f64>,
    row_spacing: f64,
    still: StillWall,
    /// The gate of the study, counted from 0, with which the unknowns' cycle begins.
    first_gate: usize,
    /// Share of the orders of the gates that are as smooth as theirs ([`super::order`]).
    pub orders_as_smooth: f64,
    /// Share of the voxels about the wall that lie outside of the volume.
    pub share_outside: f64,
    /// The scatter of the wall's phases by noise alone, degrees ([`noise`]).
    pub phase_noise_degrees: f64,
    /// Standard deviation of the wall's mean thickness over the thickness; 0 where it was stated or is not known.
    pub thickness_share: f64,
    /// Steps made.
    pub steps: usize,
}

/// Volumes at a moment, ml.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Volumes {
    /// The cavity, up to the rim.
    pub cavity_ml: f64,
    /// The muscle.
    pub wall_ml: f64,
}

/// Fits the wall of the summed image to all gates of `study`. `resolution_mm` is the full width at half maximum of a
/// point in the gates.
///
/// # Errors
/// [`BeatError::Cancelled`].
pub fn fit(
    study: &GatedStudy,
    wall: &VentricleWall,
    resolution_mm: f64,
    parameters: &BeatParameters,
    monitor: &Monitor,
) -> Result<BeatFit, BeatError> {
    monitor.report(Stage::Beat, 0.0)?;
    let coordinates = wall.coordinates();
    let count = study.gates.len();
    let mut layout = Layout::new(&coordinates, 0, count);
    let still = StillWall::new(
        wall,
        &layout,
        &Field::cut_out(&study.sum, None, 0.0, monitor)?,
    );
    let outermost = still.walls.iter().map(|w| w[1]).fold(0.0, f64::max);
    let basal = coordinates.rim_arc - coordinates.cap_arc();
    let grid = HeartGrid::new(
        &coordinates,
        basal + GRID_MARGIN_MM,
        GRID_MARGIN_MM,
        outermost + GRID_MARGIN_MM,
    );
    let scale = bright(&still.peaks) / count as f64;
    let mut images = (study.gates.par_iter().zip(&study.factors))
        .map(|(gate, factor)| {
            monitor.check()?;
            let value = |p: &Vec3| (cubic(gate, p) * factor / scale) as f32;
            Ok(grid.points.iter().map(value).collect())
        })
        .collect::<Result<Vec<Vec<f32>>, Cancelled>>()?;
    let middle: Vec<f64> = (0..layout.nodes())
        .map(|node| still.mid_wall(node))
        .collect();
    let weights: Vec<f32> = (grid.positions())
        .map(|[arc, column, distance]| {
            let far = distance - Nodes::at(layout.rows, arc, column).value(&middle);
            if far >= REACH_MM[0] || arc >= coordinates.rim_arc + BEYOND_RIM_MM {
                0.0
            } else if far > REACH_MM[1] {
                0.5
            } else {
                1.0
            }
        })
        .collect();
    let usual = || usual_harmonics(&images, &weights);
    layout.harmonics = parameters.harmonics.unwrap_or_else(usual);
    let first_gate = least_energy(&images, &weights);
    images.rotate_left(first_gate);
    let mut gate_weights: Vec<f64> = (study.counted().iter())
        .map(|counted| f64::from(u8::from(*counted)))
        .collect();
    gate_weights.rotate_left(first_gate);
    let priors = parameters.priors.of_wall(parameters.thickness.as_ref());
    let relative: Vec<f64> = (still.peaks.iter())
        .map(|peak| peak / (scale * count as f64))
        .collect();
    let start = start_of(&layout, &still, &relative, resolution_mm, &priors);
    let observed = Observed {
        images,
        gate_weights,
        weights,
        bases: gate_harmonics(layout.harmonics, count),
        rim: still.rim.clone(),
        dark: dark_nodes(&layout, &still, &relative),
    };
    let orders_as_smooth = share_as_smooth(&observed.images, &observed.weights);
    let share_outside = share_outside(&study.sum, &grid.points, &observed.weights);
    let objective = Objective::new(layout, coordinates, grid, resolution_mm, observed, priors);
    let mut made = minimise(
        objective,
        start,
        resolution_mm,
        parameters.max_steps,
        monitor,
    )?;
    if let Some(muscle_ml) = parameters.muscle_ml {
        for _ in 0..MUSCLE_FITS {
            let Minimised {
                objective,
                unknowns,
                curvature,
                ..
            } = made;
            drop(curvature);
            let still = vec![0.0; 2 * objective.layout.harmonics];
            let found_ml = volumes(&objective, &unknowns, &still).wall_ml;
            let mean = objective.mean_thickness(&unknowns) * muscle_ml / found_ml;
            let objective = objective.with_mean_thickness(mean, KNOWN_THICKNESS_SD_MM);
            made = minimise(
                objective,
                unknowns,
                resolution_mm,
                parameters.max_steps,
                monitor,
            )?;
        }
    }
    let Minimised {
        objective,
        unknowns,
        curvature,
        steps,
    } = made;
    let phase_noise_degrees = curvature.map_or(0.0, |curvature| {
        noise::phase_noise_degrees(&objective, &unknowns, &curvature)
    });
    let thickness_share = match (parameters.muscle_ml, &parameters.thickness) {
        (None, Some(thickness)) => thickness.sd_share(),
        _ => 0.0,
    };
    Ok(BeatFit {
        objective,
        unknowns,
        phase_noise_degrees,
        row_spacing: wall.row_spacing,
        still,
        first_gate,
        orders_as_smooth,
        share_outside,
        thickness_share,
        steps,
    })
}

/// The image whose weighted sum of squares is the least.
fn least_energy(images: &[Vec<f32>], weights: &[f32]) -> usize {
    let energy = |image: &Vec<f32>| -> f64 {
        (image.iter().zip(weights))
            .map(|(value, weight)| f64::from(weight * value * value))
            .sum()
    };
    let energies: Vec<f64> = images.iter().map(energy).collect();
    (0..images.len())
        .min_by(|a, b| energies[*a].total_cmp(&energies[*b]))
        .unwrap_or(0)
}

/// Share of the weight of `points` that lies outside of the volume.
fn share_outside(volume: &Volume, points: &[Vec3], weights: &[f32]) -> f64 {
    let outside = |point: &Vec3| {
        let index = volume.frame.to_voxel(point);
        (0..3).any(|axis| index[axis] < -0.5 || index[axis] > volume.shape[axis] as f64 - 0.5)
    };
    let (mut whole, mut beyond) = (0.0, 0.0);
    for (point, weight) in points
        .iter()
        .zip(weights)
        .filter(|(_, weight)| **weight > 0.0)
    {
        whole += f64::from(*weight);
        beyond += if outside(point) {
            f64::from(*weight)
        } else {
            0.0
        };
    }
    beyond / f64::max(whole, 1.0)
}

/// The unknowns at the lowest value found.
struct Minimised {
    objective: Objective,
    unknowns: Vec<f64>,
    /// The curvature that the last stage went by.
    curvature: Option<Curvature>,
    steps: usize,
}

fn minimise(
    mut objective: Objective,
    start: Vec<f64>,
    resolution_mm: f64,
    max_steps: usize,
    monitor: &Monitor,
) -> Result<Minimised, BeatError> {
    let (typical, bounds) = steps_and_bounds(&objective.layout, &start);
    let (mut unknowns, mut steps) = (start, 0);
    let ef_at = |objective: &Objective, point: &[f64]| {
        ejection_fraction(&curve(objective, point, CURVE_MOMENTS, 0.0))
    };
    let mut last_curvature = None;
    let stages = STEPS_OF_ONE_CURVATURE.map(Some).into_iter().chain([None]);
    for stage_steps in stages {
        objective.take_motion_off(resolution_mm, &unknowns);
        let curvature = Curvature::new(&objective, &unknowns, &typical, monitor)?;
        let (mut last_ef, mut looks_at_rest) = (ef_at(&objective, &unknowns), 0);
        let found = lbfgs::minimise(
            unknowns,
            &bounds,
            |vector| curvature.solve(vector),
            |point, gradient| objective.evaluate(point, gradient, monitor),
            |point, stage| {
                monitor.report(Stage::Beat, (steps + stage) as f64 / max_steps as f64)?;
                if stage_steps.is_none() && stage % STEPS_BETWEEN_LOOKS == 0 {
                    let ef = ef_at(&objective, point);
                    let at_rest = (ef - last_ef).abs() < EF_AT_REST;
                    looks_at_rest = if at_rest { looks_at_rest + 1 } else { 0 };
                    last_ef = ef;
                }
                Ok(looks_at_rest == LOOKS_AT_REST
                    || Some(stage) == stage_steps
                    || steps + stage >= max_steps)
            },
        )?;
        unknowns = found.point;
        steps += found.steps;
        if stage_steps.is_none() {
            last_curvature = Some(curvature);
        }
    }
    monitor.report(Stage::Beat, 1.0)?;
    Ok(Minimised {
        unknowns,
        curvature: last_curvature,
        steps,
        objective,
    })
}

/// A value that a tenth of the wall exceeds.
fn bright(peaks: &[f64]) -> f64 {
    let mut sorted = peaks.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() * 9 / 10].max(1e-9)
}

/// Uptake of the wall where it is as thick as in the mean, from the largest value on the way through it: blur spreads
/// a wall thinner than the resolution.
fn start_of(
    layout: &Layout,
    still: &StillWall,
    relative: &[f64],
    resolution_mm: f64,
    priors: &Priors,
) -> Vec<f64> {
    /// Activity outside of the wall and in the cavity, as shares of the wall's.
    const OUTSIDE_ACTIVITY: f64 = 0.15;
    const BLOOD_ACTIVITY: f64 = 0.12;
    let thickness = priors.mean_thickness_mm;
    let recovered = (thickness / (0.95 * resolution_mm)).min(1.0);
    let mut unknowns = vec![0.0; layout.len()];
    for node in 0..layout.nodes() {
        unknowns[layout.mid_wall().start + node] = still.mid_wall(node);
        unknowns[layout.thickness().start + node] = thickness;
        let peak = relative[node].clamp(0.05, 1.5);
        unknowns[layout.uptake().start + node] = (peak / recovered).ln();
        unknowns[layout.outside().start + node] = OUTSIDE_ACTIVITY.ln();
    }
    unknowns[layout.rim()].copy_from_slice(&still.rim);
    unknowns[layout.blood()] = BLOOD_ACTIVITY.ln();
    unknowns
}

/// The share of each node in wall too dark to show its motion, 0..=1. The rim looks dark because it ends there.
fn dark_nodes(layout: &Layout, still: &StillWall, relative: &[f64]) -> Vec<f64> {
    const DARK_UPTAKE: f64 = 0.45;
    const DARK_BLEND: f64 = 0.1;
    const RIM_MARGIN_MM: f64 = 15.0;
    (0..layout.nodes())
        .map(|node| {
            let arc = (node / COLUMNS) as f64 * ROW_SPACING_MM;
            let from_rim = still.rim[node % COLUMNS] - RIM_MARGIN_MM - arc;
            let inside = (from_rim / ROW_SPACING_MM).clamp(0.0, 1.0);
            inside * ((DARK_UPTAKE - relative[node]) / DARK_BLEND).clamp(0.0, 1.0)
        })
        .collect()
}

/// Usual size of a change of each unknown, and its bounds.
fn steps_and_bounds(layout: &Layout, start: &[f64]) -> (Vec<f64>, Vec<[f64; 2]>) {
    let mut steps = vec![1.0; layout.len()];
    let mut bounds = vec![[f64::NEG_INFINITY, f64::INFINITY]; layout.len()];
    let mut set = |range: Range<usize>, step: f64, bound: [f64; 2]| {
        steps[range.clone()].fill(step);
        bounds[range].fill(bound);
    };
    let rim = start[layout.rim()].iter().sum::<f64>() / COLUMNS as f64;
    set(layout.mid_wall(), 1.0, [5.0, 60.0]);
    set(layout.thickness(), 1.0, [3.0, 18.0]);
    set(layout.uptake(), 0.15, [-4.0, 1.5]);
    set(layout.outside(), 0.3, [-5.0, 0.5]);
    for index in 0..2 * layout.harmonics {
        set(layout.motion(index), 1.0, [-8.0, 8.0]);
    }
    set(layout.rim(), 2.0, [rim - 15.0, rim + 15.0]);
    set(layout.stretch(), 0.03, [-0.2, 0.2]);
    set(layout.blood()..layout.blood() + 1, 0.3, [-4.0, -0.5]);
    set(layout.gains(), 0.02, [-0.2, 0.2]);
    (steps, bounds)
}

/// The share of the largest volume of a curve that is ejected.
pub(super) fn ejection_fraction(curve: &[Volumes]) -> f64 {
    let cavities = curve.iter().map(|volumes| volumes.cavity_ml);
    let (least, most) = cavities.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
    1.0 - least / most
}

/// Volumes at `moments` equal steps of the cycle, the first at `start_turns`.
fn curve(
    objective: &Objective,
    unknowns: &[f64],
    moments: usize,
    start_turns: f64,
) -> Vec<Volumes> {
    (0..moments)
        .map(|moment| {
            let turns = start_turns + moment as f64 / moments as f64;
            let basis = harmonics(objective.layout.harmonics, turns, 0.0);
            volumes(objective, unknowns, &basis)
        })
        .collect()
}

impl BeatFit {
    /// Volumes at `moments` equal steps of the beat, the first at the beginning of the study's first gate.
    pub fn curve(&self, moments: usize) -> Vec<Volumes> {
        curve(&self.objective, &self.unknowns, moments, self.start_turns())
    }

    /// The beginning of the study's first gate in the unknowns' cycle.
    fn start_turns(&self) -> f64 {
        -(self.first_gate as f64) / self.gate_count() as f64
    }

    /// The harmonics of each gate of the study, in its order.
    fn bases(&self) -> impl Iterator<Item = &Vec<f64>> {
        let (before, from_first) = {
            let bases = self.objective.bases();
            bases.split_at(bases.len() - self.first_gate)
        };
        from_first.iter().chain(before)
    }

    /// Volumes of each gate, in the mean over its width.
    pub fn gates(&self) -> Vec<Volumes> {
        self.bases()
            .map(|basis| volumes(&self.objective, &self.unknowns, basis))
            .collect()
    }

    /// The wall at `turns` of the beat, on the rays of the summed image's wall.
    pub fn moment(&self, turns: f64) -> WallMoment {
        let turns = self.start_turns() + turns;
        let basis = harmonics(self.objective.layout.harmonics, turns, 0.0);
        self.wall_of(&basis)
    }

    /// Number of gates.
    pub fn gate_count(&self) -> usize {
        self.objective.layout.gates
    }

    /// `mesh`, whose nodes lie in `wall`, the summed image's, in the mean over each gate.
    pub fn carried(&self, mesh: &TriMesh, wall: &VentricleWall) -> Vec<TriMesh> {
        let layout = &self.objective.layout;
        let nodes = CarriedNodes::new(&mesh.vertices, wall, &self.still, layout.rows);
        let rim = &self.unknowns[layout.rim()];
        let moved = |basis: &Vec<f64>| {
            let state = self
                .objective
                .conservation
                .state(layout, &self.unknowns, basis);
            TriMesh {
                vertices: nodes.at(&self.objective.coordinates, layout, &state, rim),
                ..mesh.clone()
            }
        };
        self.bases().map(moved).collect()
    }

    fn wall_of(&self, basis: &[f64]) -> WallMoment {
        let layout = &self.objective.layout;
        let state = self
            .objective
            .conservation
            .state(layout, &self.unknowns, basis);
        WallMoment::new(
            &self.objective.coordinates,
            layout,
            &state,
            &self.unknowns[layout.rim()],
            self.row_spacing,
        )
    }

    /// Share of the wall that is too dark to show its motion, 0..=1.
    pub fn dark_share(&self) -> f64 {
        self.objective.dark_share()
    }
}

fn volumes(objective: &Objective, unknowns: &[f64], basis: &[f64]) -> Volumes {
    /// Distance of the strips of wall that are added up, mm, and their pieces about the axis.
    const STRIP_MM: f64 = 1.0;
    const PIECES_PER_TURN: usize = 48;
    let layout = &objective.layout;
    let state: WallState = objective.conservation.state(layout, unknowns, basis);
    let rim = &unknowns[layout.rim()];
    let radius = objective.coordinates.cap_radius;
    let cap_arc = objective.coordinates.cap_arc();
    let angle = TAU / PIECES_PER_TURN as f64;
    let (mut cavity, mut wall) = (0.0, 0.0);
    let strips = ((layout.rows - 1) as f64 * ROW_SPACING_MM / STRIP_MM) as usize;
    for strip in 0..strips {
        let arc = (strip as f64 + 0.5) * STRIP_MM;
        let volume = |r: f64| {
            if arc < cap_arc {
                r.powi(3) / 3.0 * (arc / radius).sin() * STRIP_MM / radius * angle
            } else {
                r * r / 2.0 * angle * STRIP_MM * state.stretch
            }
        };
        for piece in 0..PIECES_PER_TURN {
            let column = piece as f64 / PIECES_PER_TURN as f64 * COLUMNS as f64;
            let nodes = Nodes::at(layout.rows, arc, column);
            let (mid, thick) = (nodes.value(&state.mid_wall), nodes.value(&state.thickness));
            let on = ((nodes.rim(rim) - arc) / STRIP_MM + 0.5).clamp(0.0, 1.0);
            let inner = volume((mid - thick / 2.0).max(0.0));
            cavity += on * inner;
            wall += on * (volume(mid + thick / 2.0) - inner);
        }
    }
    Volumes {
        cavity_ml: cavity / 1e3,
        wall_ml: wall / 1e3,
    }
}

/// The value of a volume at a point by cubic convolution (Keys, IEEE Transactions on Acoustics, Speech, and Signal
/// Processing 29, 1981, a = -1/2); beyond the border the value there continues. Values that are not finite count as 0.
fn cubic(volume: &Volume, point: &Vec3) -> f64 {
    let index = volume.frame.to_voxel(point);
    let taps = [0, 1, 2].map(|axis: usize| {
        let low = index[axis].floor();
        let t = index[axis] - low;
        let weights = [
            ((-0.5 * t + 1.0) * t - 0.5) * t,
            (1.5 * t - 2.5) * t * t + 1.0,
            ((-1.5 * t + 2.0) * t + 0.5) * t,
            (0.5 * t - 0.5) * t * t,
        ];
        let last = volume.shape[axis] as i64 - 1;
        let at = |n: usize| (low as i64 + n as i64 - 1).clamp(0, last) as usize;
        [0, 1, 2, 3].map(|n| (at(n), weights[n]))
    });
    let [nx, ny, _] = volume.shape;
    let mut sum = 0.0;
    for (k, of_slice) in taps[2] {
        for (j, of_row) in taps[1] {
            let row = nx * (j + ny * k);
            let line: f64 = (taps[0].iter())
                .map(|(i, w)| (volume.voxels[row + i], w))
                .filter(|(value, _)| value.is_finite())
                .map(|(value, w)| w * f64::from(value))
                .sum();
            sum += of_slice * of_row * line;
        }
    }
    sum
}
