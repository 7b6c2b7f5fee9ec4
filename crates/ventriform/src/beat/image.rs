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
    #[inline]
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

    /// The wall at every voxel.
    pub fn samples(&self, layout: &Layout, state: &WallState, activity: &Activity) -> Vec<Sample> {
        let fields = side_by_side(state, activity);
        let sample = |voxel: &Voxel| {
            let arc = voxel.arc(self.cap_arc, state.stretch);
            let nodes = Nodes::at(layout.rows, arc, voxel.column);
            let [mid, thick, uptake, outside] = nodes.values(&fields);
            let beyond = voxel.distance - mid;
            Sample {
                nodes,
                uptake,
                outside,
                blood: activity.blood,
                inner: Ramp::new(beyond + thick / 2.0),
                outer: Ramp::new(thick / 2.0 - beyond),
                apical: Ramp::new(nodes.rim(&activity.rim) - arc),
            }
        };
        self.voxels.iter().map(sample).collect()
    }

    /// The activity of every voxel.
    pub fn paint(samples: &[Sample]) -> Vec<f32> {
        samples.iter().map(|sample| sample.value() as f32).collect()
    }

    /// Adds the gradients by the wall and by the activity of something whose gradient by the painted voxels is
    /// `by_voxel`.
    pub fn gradient(
        &self,
        samples: &[Sample],
        state: &WallState,
        activity: &Activity,
        by_voxel: &[f32],
        by_state: &mut StateGradient,
        by_activity: &mut ActivityGradient,
    ) {
        let fields = side_by_side(state, activity);
        let mut by_fields = vec![[0.0; 4]; fields.len()];
        for ((voxel, sample), by) in self.voxels.iter().zip(samples).zip(by_voxel) {
            let by = f64::from(*by);
            if by == 0.0 {
                continue;
            }
            let nodes = &sample.nodes;
            let change = sample.change();
            nodes.add(&mut by_fields, change.fields().map(|change| by * change));
            nodes.add_to_rim(&mut by_activity.rim, by * change.rim);
            by_activity.blood += by * change.blood;
            by_state.stretch += by * stretch_change(voxel, sample, &change, state, &fields);
        }
        for (node, by) in by_fields.into_iter().enumerate() {
            by_state.mid_wall[node] += by[0];
            by_state.thickness[node] += by[1];
            by_activity.uptake[node] += by[2];
            by_activity.outside[node] += by[3];
        }
    }

    /// Calls `add` for every voxel with its index, the nodes about it, the change of its activity by each part of the
    /// wall, and that by the stretch of the long axis.
    pub fn changes(
        &self,
        samples: &[Sample],
        state: &WallState,
        activity: &Activity,
        mut add: impl FnMut(usize, &Nodes, &Change, f64),
    ) {
        let fields = side_by_side(state, activity);
        for (index, (voxel, sample)) in self.voxels.iter().zip(samples).enumerate() {
            let change = sample.change();
            let by_stretch = stretch_change(voxel, sample, &change, state, &fields);
            add(index, &sample.nodes, &change, by_stretch);
        }
    }
}

/// Distance, thickness, uptake and activity outside of the wall, side by side at every node.
fn side_by_side(state: &WallState, activity: &Activity) -> Vec<[f64; 4]> {
    let of_node = |node: usize| {
        [
            state.mid_wall[node],
            state.thickness[node],
            activity.uptake[node],
            activity.outside[node],
        ]
    };
    (0..state.mid_wall.len()).map(of_node).collect()
}

/// The change of a voxel's activity by the stretch of the long axis: the arc at the voxel shrinks.
#[inline]
fn stretch_change(
    voxel: &Voxel,
    sample: &Sample,
    change: &Change,
    state: &WallState,
    fields: &[[f64; 4]],
) -> f64 {
    if voxel.cap {
        return 0.0;
    }
    let arc_by_stretch = voxel.along / (state.stretch * state.stretch);
    let slopes = sample.nodes.slopes(fields).into_iter();
    let by_fields: f64 = slopes.zip(change.fields()).map(|(s, c)| s * c).sum();
    (by_fields - change.rim) * arc_by_stretch
}

/// The change of a voxel's activity by a unit of each value of the wall at the voxel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Change {
    pub mid_wall: f64,
    pub thickness: f64,
    pub uptake: f64,
    pub outside: f64,
    pub rim: f64,
    pub blood: f64,
}

impl Change {
    /// Those by the fields, in the order of [`side_by_side`].
    #[inline]
    fn fields(&self) -> [f64; 4] {
        [self.mid_wall, self.thickness, self.uptake, self.outside]
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
    #[inline]
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

/// The wall at a voxel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    nodes: Nodes,
    uptake: f64,
    outside: f64,
    blood: f64,
    inner: Ramp,
    outer: Ramp,
    apical: Ramp,
}

impl Sample {
    #[inline]
    fn value(&self) -> f64 {
        let [oi, oo, ob] = [self.inner, self.outer, self.apical].map(|ramp| ramp.share);
        self.uptake * oi * oo * ob
            + self.blood * (1.0 - oi)
            + self.outside * ((1.0 - oo) + oi * oo * (1.0 - ob))
    }

    #[inline]
    fn change(&self) -> Change {
        let [oi, oo, ob] = [self.inner, self.outer, self.apical].map(|ramp| ramp.share);
        let (u, b) = (self.uptake, self.outside);
        let by_inner = (u * oo * ob - self.blood + b * oo * (1.0 - ob)) * self.inner.slope;
        let by_outer = (u * oi * ob - b + b * oi * (1.0 - ob)) * self.outer.slope;
        Change {
            mid_wall: by_outer - by_inner,
            thickness: (by_inner + by_outer) / 2.0,
            uptake: oi * oo * ob,
            outside: (1.0 - oo) + oi * oo * (1.0 - ob),
            rim: (u - b) * oi * oo * self.apical.slope,
            blood: 1.0 - oi,
        }
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

    /// The first voxel along `axis` that the blurred voxel `at` takes from, and the weights from there on.
    pub fn weights(&self, axis: usize, at: usize) -> (usize, &[f32]) {
        let (first, weights) = &self.rows[axis][at];
        (*first, weights)
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
