//! The image of a wall: activity on a grid about the heart, blurred as the camera and the filter do.
//!
//! In: a [`WallState`] with uptake, rim and activity beside the wall. Out: the activity of every voxel before the blur
//! ([`HeartGrid::paint`]), and back from a gradient by these voxels to one by the unknowns
//! ([`HeartGrid::gradient`]). A border that crosses a voxel fills it by a linear ramp one voxel wide.

use std::f64::consts::{FRAC_PI_2, TAU};

use super::fields::{COLUMNS, Layout, Nodes, StateGradient, WallState};
use crate::base::geometry::Vec3;
use crate::heart::model::wall::RayCoordinates;
use crate::image::grid::blur::FWHM_PER_SIGMA;

/// Distance of the voxels of the grid about the heart, mm.
pub(super) const GRID_STEP_MM: f64 = 4.0;

/// Voxels about the heart, along its axis (slowest) and across.
#[derive(Debug, Clone)]
pub(super) struct HeartGrid {
    pub shape: [usize; 3],
    /// Centres, LPS mm.
    pub points: Vec<Vec3>,
    voxels: Vec<Voxel>,
    cap_arc: f32,
}

/// A voxel in the coordinates of the rays.
#[derive(Debug, Clone, Copy)]
pub(super) struct Voxel {
    /// Distance from the start of the ray through it, mm.
    pub distance: f32,
    /// Apical of the focus its arc; basal of it minus how far basal, mm.
    along: f32,
    column: f32,
    cap: bool,
}

impl Voxel {
    /// Arc of the voxel with the long axis stretched by `stretch`, mm.
    #[inline]
    pub fn arc(&self, cap_arc: f32, stretch: f32) -> f32 {
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
            cap_arc: (FRAC_PI_2 * coordinates.cap_radius) as f32,
        }
    }

    /// Arc, column and distance of every voxel, the axis not stretched.
    pub fn positions(&self) -> impl Iterator<Item = [f64; 3]> {
        let cap_arc = self.cap_arc;
        (self.voxels.iter()).map(move |voxel| {
            [voxel.arc(cap_arc, 1.0), voxel.column, voxel.distance].map(f64::from)
        })
    }

    /// The wall at every voxel.
    pub fn samples(&self, layout: &Layout, state: &WallState, activity: &Activity) -> Vec<Sample> {
        let fields = side_by_side(state, activity);
        let (stretch, blood) = (state.stretch as f32, activity.blood as f32);
        let sample = |voxel: &Voxel| {
            let arc = voxel.arc(self.cap_arc, stretch);
            let nodes = Nodes::at_voxel(layout.rows, arc, voxel.column);
            let [mid, thick, uptake, outside] = nodes.values(&fields);
            let beyond = voxel.distance - mid;
            Sample {
                nodes,
                uptake,
                outside,
                blood,
                inner: Ramp::new(beyond + thick / 2.0),
                outer: Ramp::new(thick / 2.0 - beyond),
                apical: Ramp::new(nodes.rim(&activity.rim) as f32 - arc),
            }
        };
        self.voxels.iter().map(sample).collect()
    }

    /// The activity of every voxel.
    pub fn paint(samples: &[Sample]) -> Vec<f32> {
        samples.iter().map(Sample::value).collect()
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
        let stretch = state.stretch as f32;
        for ((voxel, sample), by) in self.voxels.iter().zip(samples).zip(by_voxel) {
            let by = *by;
            if by == 0.0 {
                continue;
            }
            let nodes = &sample.nodes;
            let change = sample.change();
            nodes.add(&mut by_fields, change.fields().map(|change| by * change));
            if change.rim != 0.0 {
                nodes.add_to_rim(&mut by_activity.rim, by * change.rim);
            }
            by_activity.blood += f64::from(by * change.blood);
            let by_stretch = stretch_change(voxel, sample, &change, stretch, &fields);
            by_state.stretch += f64::from(by * by_stretch);
        }
        for (node, by) in by_fields.into_iter().enumerate() {
            let by = by.map(f64::from);
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
        mut add: impl FnMut(usize, &Nodes, &Change, f32),
    ) {
        let fields = side_by_side(state, activity);
        let stretch = state.stretch as f32;
        for (index, (voxel, sample)) in self.voxels.iter().zip(samples).enumerate() {
            let change = sample.change();
            let by_stretch = stretch_change(voxel, sample, &change, stretch, &fields);
            add(index, &sample.nodes, &change, by_stretch);
        }
    }
}

/// Distance, thickness, uptake and activity outside of the wall, side by side at every node.
fn side_by_side(state: &WallState, activity: &Activity) -> Vec<[f32; 4]> {
    let of_node = |node: usize| {
        [
            state.mid_wall[node],
            state.thickness[node],
            activity.uptake[node],
            activity.outside[node],
        ]
        .map(|value| value as f32)
    };
    (0..state.mid_wall.len()).map(of_node).collect()
}

/// The change of a voxel's activity by the stretch of the long axis: the arc at the voxel shrinks.
#[inline]
fn stretch_change(
    voxel: &Voxel,
    sample: &Sample,
    change: &Change,
    stretch: f32,
    fields: &[[f32; 4]],
) -> f32 {
    if voxel.cap {
        return 0.0;
    }
    let arc_by_stretch = voxel.along / (stretch * stretch);
    let slopes = sample.nodes.slopes(fields).into_iter();
    let by_fields: f32 = slopes.zip(change.fields()).map(|(s, c)| s * c).sum();
    (by_fields - change.rim) * arc_by_stretch
}

/// The change of a voxel's activity by a unit of each value of the wall at the voxel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Change {
    pub mid_wall: f32,
    pub thickness: f32,
    pub uptake: f32,
    pub outside: f32,
    pub rim: f32,
    pub blood: f32,
}

impl Change {
    /// Those by the fields, in the order of [`side_by_side`].
    #[inline]
    fn fields(&self) -> [f32; 4] {
        [self.mid_wall, self.thickness, self.uptake, self.outside]
    }
}

fn voxel(coordinates: &RayCoordinates, [s, x, y]: [f64; 3]) -> Voxel {
    let across = x.hypot(y);
    let cap = s > 0.0;
    let turn = y.atan2(x).rem_euclid(TAU) / TAU;
    let distance = if cap { s.hypot(across) } else { across };
    let along = if cap {
        coordinates.cap_radius * across.atan2(s)
    } else {
        s
    };
    Voxel {
        distance: distance as f32,
        along: along as f32,
        column: (turn * COLUMNS as f64) as f32 % COLUMNS as f32,
        cap,
    }
}

/// A border through a voxel: the share of the voxel on its inside.
#[derive(Debug, Clone, Copy)]
struct Ramp(f32);

impl Ramp {
    /// Of a voxel whose centre lies `depth` mm inside.
    #[inline]
    fn new(depth: f32) -> Self {
        Self((depth / GRID_STEP_MM as f32 + 0.5).clamp(0.0, 1.0))
    }

    /// The change of the share by a millimetre of depth.
    #[inline]
    fn slope(self) -> f32 {
        if self.0 > 0.0 && self.0 < 1.0 {
            1.0 / GRID_STEP_MM as f32
        } else {
            0.0
        }
    }
}

/// The wall at a voxel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    nodes: Nodes,
    uptake: f32,
    outside: f32,
    blood: f32,
    inner: Ramp,
    outer: Ramp,
    apical: Ramp,
}

impl Sample {
    #[inline]
    fn value(&self) -> f32 {
        let [oi, oo, ob] = [self.inner, self.outer, self.apical].map(|ramp| ramp.0);
        self.uptake * oi * oo * ob
            + self.blood * (1.0 - oi)
            + self.outside * ((1.0 - oo) + oi * oo * (1.0 - ob))
    }

    #[inline]
    fn change(&self) -> Change {
        let [oi, oo, ob] = [self.inner, self.outer, self.apical].map(|ramp| ramp.0);
        let (u, b) = (self.uptake, self.outside);
        let by_inner = (u * oo * ob - self.blood + b * oo * (1.0 - ob)) * self.inner.slope();
        let by_outer = (u * oi * ob - b + b * oi * (1.0 - ob)) * self.outer.slope();
        Change {
            mid_wall: by_outer - by_inner,
            thickness: (by_inner + by_outer) / 2.0,
            uptake: oi * oo * ob,
            outside: (1.0 - oo) + oi * oo * (1.0 - ob),
            rim: (u - b) * oi * oo * self.apical.slope(),
            blood: 1.0 - oi,
        }
    }
}

/// The blur of a grid by a Gaussian along each axis: every blurred value is a weighted mean of values within the grid.
#[derive(Debug, Clone)]
pub(super) struct Blur {
    shape: [usize; 3],
    /// Weights of voxels 0, 1, 2, ... away along an axis.
    kernel: Vec<f32>,
    /// For every place along an axis, the factor by which the weights within the grid add up to 1.
    norms: [Vec<f32>; 3],
}

impl Blur {
    /// Of a point's full width at half maximum, mm.
    pub fn new(shape: [usize; 3], width: f64) -> Self {
        let sigma = width / FWHM_PER_SIGMA / GRID_STEP_MM;
        let reach = (4.0 * sigma).ceil() as usize;
        let weight = |away: usize| (-0.5 * (away as f64 / sigma).powi(2)).exp();
        let norms = shape.map(|count| {
            let norm = |at: usize| {
                let within = at.saturating_sub(reach)..(at + reach + 1).min(count);
                let sum: f64 = within.map(|from| weight(from.abs_diff(at))).sum();
                (1.0 / sum) as f32
            };
            (0..count).map(norm).collect()
        });
        Self {
            shape,
            kernel: (0..=reach).map(|away| weight(away) as f32).collect(),
            norms,
        }
    }

    /// Blurs `values`.
    pub fn apply(&self, mut values: Vec<f32>) -> Vec<f32> {
        self.spread(&mut values);
        self.normalise(&mut values);
        values
    }

    /// The transposed blur, for gradients.
    pub fn transposed(&self, mut values: Vec<f32>) -> Vec<f32> {
        self.normalise(&mut values);
        self.spread(&mut values);
        values
    }

    /// The voxels along `axis` that the blurred voxel `at` takes from, and the weight of each.
    pub fn weights(&self, axis: usize, at: usize) -> impl Iterator<Item = (usize, f32)> {
        let reach = self.kernel.len() - 1;
        let within = at.saturating_sub(reach)..(at + reach + 1).min(self.shape[axis]);
        let norm = self.norms[axis][at];
        within.map(move |from| (from, norm * self.kernel[from.abs_diff(at)]))
    }

    fn normalise(&self, values: &mut [f32]) {
        let [of_s, of_x, of_y] = &self.norms;
        let lines = of_s.iter().flat_map(|s| of_x.iter().map(move |x| s * x));
        for (line, norm) in values.chunks_mut(of_y.len()).zip(lines) {
            let of_line = line.iter_mut().zip(of_y);
            of_line.for_each(|(value, y)| *value *= norm * y);
        }
    }

    /// The sums of values times the kernel, along every axis.
    fn spread(&self, values: &mut Vec<f32>) {
        let [ns, nx, ny] = self.shape;
        let mut summed = vec![0.0; values.len()];
        let reach = self.kernel.len() - 1;
        let mut padded = vec![0.0; ny + 2 * reach];
        for (line, to) in values.chunks(ny).zip(summed.chunks_mut(ny)) {
            padded[reach..reach + ny].copy_from_slice(line);
            for (away, weight) in self.kernel.iter().enumerate() {
                let (before, after) = (&padded[reach - away..][..ny], &padded[reach + away..]);
                add_pair(to, (away > 0).then_some(before), Some(after), *weight);
            }
        }
        std::mem::swap(values, &mut summed);
        for (from, to) in (values.chunks(nx * ny)).zip(summed.chunks_mut(nx * ny)) {
            self.spread_lines(from, to, [nx, ny]);
        }
        std::mem::swap(values, &mut summed);
        self.spread_lines(values, &mut summed, [ns, nx * ny]);
        std::mem::swap(values, &mut summed);
    }

    /// Along the slower axis of `count` lines of `length` values.
    fn spread_lines(&self, from: &[f32], to: &mut [f32], [count, length]: [usize; 2]) {
        for (at, to) in to.chunks_mut(length).enumerate() {
            to.fill(0.0);
            let line = |at: usize| (at < count).then(|| &from[at * length..]);
            for (away, weight) in self.kernel.iter().enumerate() {
                let before = at.checked_sub(away).filter(|_| away > 0).and_then(line);
                add_pair(to, before, line(at + away), *weight);
            }
        }
    }
}

/// Adds `weight` times the values of up to two lines.
#[inline]
fn add_pair(to: &mut [f32], before: Option<&[f32]>, after: Option<&[f32]>, weight: f32) {
    match (before, after) {
        (Some(before), Some(after)) => {
            let values = before.iter().zip(after);
            (to.iter_mut().zip(values)).for_each(|(to, (b, a))| *to += weight * (b + a));
        }
        (Some(line), None) | (None, Some(line)) => {
            (to.iter_mut().zip(line)).for_each(|(to, value)| *to += weight * value);
        }
        (None, None) => {}
    }
}
