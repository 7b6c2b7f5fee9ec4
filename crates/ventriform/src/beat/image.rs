//! The image of a wall: activity on a grid about the heart, blurred as the camera and the filter do.
//!
//! In: a [`WallState`] with uptake, rim and activity beside the wall. Out: the activity of every voxel before the blur
//! ([`HeartGrid::paint`]), and back from a gradient by these voxels to one by the unknowns
//! ([`HeartGrid::gradient`]). A border that crosses a voxel fills it by a linear ramp one voxel wide.

use std::f64::consts::{FRAC_PI_2, TAU};

use super::fields::{COLUMNS, Layout, Nodes, StateGradient, WallState};
use crate::geometry::Vec3;
use crate::grid::blur::FWHM_PER_SIGMA;
use crate::model::wall::RayCoordinates;

/// Distance of the voxels of the grid about the heart, mm.
pub(super) const GRID_STEP_MM: f64 = 4.0;

/// Voxels about the heart, along its axis (slowest) and across.
#[derive(Debug, Clone)]
pub(super) struct HeartGrid {
    pub shape: [usize; 3],
    /// Centres, LPS mm.
    pub points: Vec<Vec3>,
    voxels: Vec<Voxel>,
    cap_arc: f64,
}

/// A voxel in the coordinates of the rays.
#[derive(Debug, Clone, Copy)]
pub(super) struct Voxel {
    /// Distance from the start of the ray through it, mm.
    pub distance: f64,
    /// Apical of the focus its arc; basal of it minus how far basal, mm.
    along: f64,
    column: f64,
    cap: bool,
}

impl Voxel {
    /// Arc of the voxel with the long axis stretched by `stretch`, mm.
    pub fn arc(&self, cap_arc: f64, stretch: f64) -> f64 {
        if self.cap {
            self.along
        } else {
            cap_arc - self.along / stretch
        }
    }
}

/// Uptake and activity at the nodes of the wall, and what lies beside it.
#[derive(Debug, Clone)]
pub(super) struct Activity {
    pub uptake: Vec<f64>,
    pub outside: Vec<f64>,
    pub rim: Vec<f64>,
    pub blood: f64,
}

/// The gradient by the parts of an [`Activity`].
#[derive(Debug, Clone)]
pub(super) struct ActivityGradient {
    pub uptake: Vec<f64>,
    pub outside: Vec<f64>,
    pub rim: Vec<f64>,
    pub blood: f64,
}

impl ActivityGradient {
    pub fn zero(layout: &Layout) -> Self {
        Self {
            uptake: vec![0.0; layout.nodes()],
            outside: vec![0.0; layout.nodes()],
            rim: vec![0.0; COLUMNS],
            blood: 0.0,
        }
    }
}

impl HeartGrid {
    /// The grid from `basal` mm of arc beyond the cap to `apical` mm beyond the apex, out to `reach` mm from the axis.
    pub fn new(coordinates: &RayCoordinates, basal: f64, apical: f64, reach: f64) -> Self {
        let along = (-(basal / GRID_STEP_MM).ceil() as i64)
            ..=((coordinates.cap_radius + apical) / GRID_STEP_MM).ceil() as i64;
        let half = (reach / GRID_STEP_MM).ceil() as i64;
        let across = -half..=half;
        let shape = [
            along.clone().count(),
            across.clone().count(),
            across.clone().count(),
        ];
        let mut points = Vec::with_capacity(shape.iter().product());
        let mut voxels = Vec::with_capacity(points.capacity());
        for s in along {
            for x in across.clone() {
                for y in across.clone() {
                    let [s, x, y] = [s, x, y].map(|n| n as f64 * GRID_STEP_MM);
                    let point = coordinates.focus
                        + coordinates.axis * s
                        + coordinates.lateral * x
                        + coordinates.anterior * y;
                    points.push(point);
                    voxels.push(voxel(coordinates, [s, x, y]));
                }
            }
        }
        Self {
            shape,
            points,
            voxels,
            cap_arc: FRAC_PI_2 * coordinates.cap_radius,
        }
    }

    /// Arc, column and distance of every voxel, the axis not stretched.
    pub fn positions(&self) -> impl Iterator<Item = (f64, f64, f64)> {
        let cap_arc = self.cap_arc;
        (self.voxels.iter())
            .map(move |voxel| (voxel.arc(cap_arc, 1.0), voxel.column, voxel.distance))
    }

    /// The activity of every voxel.
    pub fn paint(&self, layout: &Layout, state: &WallState, activity: &Activity) -> Vec<f32> {
        let paint = |voxel: &Voxel| self.sample(layout, voxel, state, activity).value() as f32;
        self.voxels.iter().map(paint).collect()
    }

    fn sample(
        &self,
        layout: &Layout,
        voxel: &Voxel,
        state: &WallState,
        activity: &Activity,
    ) -> Sample {
        let arc = voxel.arc(self.cap_arc, state.stretch);
        let nodes = Nodes::at(layout.rows, arc, voxel.column);
        let [mid, thick, uptake, outside] = [
            &state.mid_wall,
            &state.thickness,
            &activity.uptake,
            &activity.outside,
        ]
        .map(|field| nodes.value(field));
        let rim = nodes.rim(&activity.rim);
        let beyond = voxel.distance - mid;
        Sample {
            nodes,
            uptake,
            outside,
            blood: activity.blood,
            inner: Ramp::new(beyond + thick / 2.0),
            outer: Ramp::new(thick / 2.0 - beyond),
            apical: Ramp::new(rim - arc),
        }
    }

    /// Adds the gradients by the wall and by the activity of something whose gradient by the painted voxels is
    /// `by_voxel`.
    pub fn gradient(
        &self,
        layout: &Layout,
        state: &WallState,
        activity: &Activity,
        by_voxel: &[f32],
        by_state: &mut StateGradient,
        by_activity: &mut ActivityGradient,
    ) {
        for (voxel, by) in self.voxels.iter().zip(by_voxel) {
            let by = f64::from(*by);
            if by == 0.0 {
                continue;
            }
            let sample = self.sample(layout, voxel, state, activity);
            let nodes = &sample.nodes;
            let [oi, oo, ob] = [sample.inner, sample.outer, sample.apical].map(|r| r.share);
            let (u, b) = (sample.uptake, sample.outside);
            let by_inner =
                by * (u * oo * ob - sample.blood + b * oo * (1.0 - ob)) * sample.inner.slope;
            let by_outer = by * (u * oi * ob - b + b * oi * (1.0 - ob)) * sample.outer.slope;
            let by_rim = by * (u - b) * oi * oo * sample.apical.slope;
            let by_mid = by_outer - by_inner;
            let by_thick = (by_inner + by_outer) / 2.0;
            let by_uptake = by * oi * oo * ob;
            let by_outside = by * ((1.0 - oo) + oi * oo * (1.0 - ob));
            by_activity.blood += by * (1.0 - oi);
            nodes.add(&mut by_state.mid_wall, by_mid);
            nodes.add(&mut by_state.thickness, by_thick);
            nodes.add(&mut by_activity.uptake, by_uptake);
            nodes.add(&mut by_activity.outside, by_outside);
            nodes.add_to_rim(&mut by_activity.rim, by_rim);
            if !voxel.cap {
                // The arc grows by this where the axis stretches.
                let arc_by_stretch = voxel.along / (state.stretch * state.stretch);
                let by_arc = nodes.slope(&state.mid_wall) * by_mid
                    + nodes.slope(&state.thickness) * by_thick
                    + nodes.slope(&activity.uptake) * by_uptake
                    + nodes.slope(&activity.outside) * by_outside
                    - by_rim;
                by_state.stretch += by_arc * arc_by_stretch;
            }
        }
    }
}

fn voxel(coordinates: &RayCoordinates, [s, x, y]: [f64; 3]) -> Voxel {
    let across = x.hypot(y);
    let cap = s > 0.0;
    let turn = y.atan2(x).rem_euclid(TAU) / TAU;
    Voxel {
        distance: if cap { s.hypot(across) } else { across },
        along: if cap {
            coordinates.cap_radius * across.atan2(s)
        } else {
            s
        },
        column: (turn * COLUMNS as f64) % COLUMNS as f64,
        cap,
    }
}

/// A border through a voxel: the share of the voxel on its inside, and the change of that by a millimetre.
#[derive(Debug, Clone, Copy)]
struct Ramp {
    share: f64,
    slope: f64,
}

impl Ramp {
    /// Of a voxel whose centre lies `depth` mm inside.
    fn new(depth: f64) -> Self {
        let share = depth / GRID_STEP_MM + 0.5;
        Self {
            share: share.clamp(0.0, 1.0),
            slope: if share > 0.0 && share < 1.0 {
                1.0 / GRID_STEP_MM
            } else {
                0.0
            },
        }
    }
}

struct Sample {
    nodes: Nodes,
    uptake: f64,
    outside: f64,
    blood: f64,
    inner: Ramp,
    outer: Ramp,
    apical: Ramp,
}

impl Sample {
    fn value(&self) -> f64 {
        let [oi, oo, ob] = [self.inner, self.outer, self.apical].map(|ramp| ramp.share);
        self.uptake * oi * oo * ob
            + self.blood * (1.0 - oi)
            + self.outside * ((1.0 - oo) + oi * oo * (1.0 - ob))
    }
}

/// The blur of a grid by a Gaussian, as one matrix along each axis; every row adds up to 1.
#[derive(Debug, Clone)]
pub(super) struct Blur {
    shape: [usize; 3],
    /// For every output along an axis the first input and the weights.
    rows: [Vec<(usize, Vec<f32>)>; 3],
    /// The same of the transposed matrices.
    columns: [Vec<(usize, Vec<f32>)>; 3],
}

impl Blur {
    /// Of a point's full width at half maximum, mm.
    pub fn new(shape: [usize; 3], width: f64) -> Self {
        let sigma = width / FWHM_PER_SIGMA / GRID_STEP_MM;
        let reach = (4.0 * sigma).ceil() as usize;
        let matrix = |count: usize| -> Vec<(usize, Vec<f32>)> {
            (0..count)
                .map(|i| {
                    let (from, to) = (i.saturating_sub(reach), (i + reach + 1).min(count));
                    let weight = |j: usize| (-0.5 * ((i as f64 - j as f64) / sigma).powi(2)).exp();
                    let sum: f64 = (from..to).map(weight).sum();
                    (from, (from..to).map(|j| (weight(j) / sum) as f32).collect())
                })
                .collect()
        };
        let rows = shape.map(matrix);
        let columns = [0, 1, 2].map(|axis| {
            let rows: &Vec<(usize, Vec<f32>)> = &rows[axis];
            (0..shape[axis])
                .map(|j| {
                    let (from, to) = (j.saturating_sub(reach), (j + reach + 1).min(shape[axis]));
                    let weights = (from..to).map(|i| rows[i].1[j - rows[i].0]).collect();
                    (from, weights)
                })
                .collect()
        });
        Self {
            shape,
            rows,
            columns,
        }
    }

    /// Blurs `values`.
    pub fn apply(&self, values: &[f32]) -> Vec<f32> {
        along_axes(values, self.shape, &self.rows)
    }

    /// The transposed blur, for gradients.
    pub fn transposed(&self, values: &[f32]) -> Vec<f32> {
        along_axes(values, self.shape, &self.columns)
    }
}

fn along_axes(
    values: &[f32],
    [ns, nx, ny]: [usize; 3],
    [s, x, y]: &[Vec<(usize, Vec<f32>)>; 3],
) -> Vec<f32> {
    let mut once = vec![0.0; values.len()];
    for (from, to) in values.chunks(ny).zip(once.chunks_mut(ny)) {
        for (to, (first, weights)) in to.iter_mut().zip(y) {
            *to = (from[*first..].iter().zip(weights))
                .map(|(v, w)| v * w)
                .sum();
        }
    }
    let mut twice = vec![0.0; values.len()];
    for slice in 0..ns {
        for (row, (first, weights)) in x.iter().enumerate() {
            let to = (slice * nx + row) * ny;
            for (n, weight) in weights.iter().enumerate() {
                let from = (slice * nx + first + n) * ny;
                add_scaled(&mut twice[to..to + ny], &once[from..from + ny], *weight);
            }
        }
    }
    let size = nx * ny;
    once.fill(0.0);
    for (slice, (first, weights)) in s.iter().enumerate() {
        for (n, weight) in weights.iter().enumerate() {
            let from = (first + n) * size;
            let to = &mut once[slice * size..(slice + 1) * size];
            add_scaled(to, &twice[from..from + size], *weight);
        }
    }
    once
}

fn add_scaled(to: &mut [f32], from: &[f32], weight: f32) {
    to.iter_mut()
        .zip(from)
        .for_each(|(to, from)| *to += weight * from);
}
