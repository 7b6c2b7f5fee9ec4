//! The curvature of the function that a beat's fit minimises: by it a step in each unknown is as long as the image
//! and the priors let it be.
//!
//! In: an [`Objective`] and its unknowns. Out: the Gauss-Newton matrix (the image's changes by two unknowns,
//! multiplied and added up, and the priors' second derivatives) in blocks of unknowns that hang together: what stands
//! still through the beat, and each harmonic of the motion. Harmonics are orthogonal over the gates, so blocks hardly
//! act on each other. The image changes as that of the wall in the mean of the beat.
//!
//! Guaranteed: what [`Curvature::solve`] multiplies by is symmetric and positive definite. Not guaranteed: the
//! curvature far from the point it was taken at.

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use super::fields::{COLUMNS, Layout, Nodes, WallState};
use super::image::{Blur, Change, HeartGrid};
use super::objective::{Objective, VALUE_SCALE};
use crate::base::progress::{Cancelled, Monitor};

/// Share of the curvature at a typical step that is added: no unknown is left without.
const DAMPING_SHARE: f64 = 1e-3;
/// Curvature that every unknown has at least where nothing is added for the sake of steps.
const LEAST_CURVATURE: f64 = 1e-4;
/// Reach of the blur that is followed, voxels: 2.4 standard deviations of a width of 12 mm.
const BLUR_REACH_VOXELS: usize = 3;

/// The Gauss-Newton matrix in blocks, ready to be solved.
#[derive(Debug)]
pub(super) struct Curvature {
    blocks: Vec<Block>,
    /// The factors of the gates, and the curvature of each.
    gains: Vec<(usize, f64)>,
    /// The image's part of the curvature of the motion's first harmonic, and of the stretch of the long axis.
    motion: DMatrix<f64>,
}

#[derive(Debug)]
struct Block {
    unknowns: Vec<usize>,
    /// `None` only where a value is not finite: then steps are those of the gradient.
    factors: Option<Cholesky<f64, Dyn>>,
}

impl Curvature {
    /// At `unknowns`. `typical` is the size of a usual step of each of them.
    pub fn new(
        objective: &Objective,
        unknowns: &[f64],
        typical: &[f64],
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let layout = &objective.layout;
        let image = ImageChanges::new(objective, unknowns, monitor)?;
        let priors = Priors::from_objective(objective);
        let weights = &objective.observed.gate_weights;
        let all: f64 = weights.iter().sum();
        let mean_square = |index: usize| {
            let gates = objective.bases().iter().zip(weights);
            gates
                .map(|(basis, w)| w * basis[index].powi(2))
                .sum::<f64>()
                / all
        };
        let mut parts = vec![(still_unknowns(layout), &image.still, 1.0)];
        for index in 0..2 * layout.harmonics {
            let own = harmonic_unknowns(layout, index);
            parts.push((own, &image.motion, mean_square(index)));
        }
        let blocks = parts
            .into_par_iter()
            .map(|(unknowns, image, share)| {
                monitor.check()?;
                let mut matrix = image * share;
                priors.add(objective, &unknowns, &mut matrix);
                for (n, unknown) in unknowns.iter().enumerate() {
                    matrix[(n, n)] += DAMPING_SHARE * VALUE_SCALE / typical[*unknown].powi(2);
                }
                Ok(Block {
                    factors: Cholesky::new(matrix),
                    unknowns,
                })
            })
            .collect::<Result<Vec<Block>, Cancelled>>()?;
        // The factor of a gate changes the gate's whole image.
        let gain = 2.0 * VALUE_SCALE * image.mean_square / layout.gates as f64;
        let gains = (layout.gains()).map(|unknown| {
            let prior = priors.levels.column(objective, unknown)[unknown];
            (unknown, gain + prior)
        });
        Ok(Self {
            gains: gains.collect(),
            blocks,
            motion: image.motion * mean_square(0),
        })
    }

    /// Variance of the motion's first harmonic at each node, mm², in a minimum of `objective` where the image has noise
    /// of density 1: its sum over `n` voxels has the variance `n`.
    pub fn motion_variances(&self, objective: &Objective) -> Vec<f64> {
        let layout = &objective.layout;
        let unknowns = harmonic_unknowns(layout, 0);
        let mut matrix = self.motion.clone();
        Priors::from_objective(objective).add(objective, &unknowns, &mut matrix);
        for n in 0..unknowns.len() {
            matrix[(n, n)] += LEAST_CURVATURE;
        }
        let Some(factors) = Cholesky::new(matrix) else {
            return vec![f64::INFINITY; layout.nodes()];
        };
        // The gradient's covariance is the image's part of the curvature, by the weight of a voxel in the function.
        let moved = factors.solve(&self.motion);
        let covariance = factors.solve(&moved.transpose()) * (2.0 * objective.voxel_weight());
        covariance
            .diagonal()
            .iter()
            .take(layout.nodes())
            .copied()
            .collect()
    }

    /// Multiplies by the inverse.
    pub fn solve(&self, vector: &mut [f64]) {
        for block in &self.blocks {
            let Some(factors) = &block.factors else {
                continue;
            };
            let own = block.unknowns.iter().map(|n| vector[*n]);
            let solved = factors.solve(&DVector::from_iterator(block.unknowns.len(), own));
            for (n, value) in block.unknowns.iter().zip(solved.iter()) {
                vector[*n] = *value;
            }
        }
        for (unknown, curvature) in &self.gains {
            vector[*unknown] /= curvature;
        }
    }
}

/// The unknowns that do not change over the beat.
fn still_unknowns(layout: &Layout) -> Vec<usize> {
    let fields = layout.mid_wall().start..layout.outside().end;
    fields.chain(layout.rim()).chain([layout.blood()]).collect()
}

/// The motion by one harmonic, and the stretch of the long axis by it.
fn harmonic_unknowns(layout: &Layout, index: usize) -> Vec<usize> {
    let stretch = layout.stretch().start + index;
    layout.motion(index).chain([stretch]).collect()
}

/// Second derivatives of the roughness of one field.
fn roughness(objective: &Objective) -> DMatrix<f64> {
    let count = objective.layout.nodes();
    let mut matrix = DMatrix::zeros(count, count);
    let mut unit = vec![0.0; count];
    for node in 0..count {
        unit[node] = 1.0;
        let mut column = matrix.column_mut(node);
        objective.roughness(&unit, 1.0, column.as_mut_slice());
        unit[node] = 0.0;
    }
    matrix
}

/// Second derivatives of what is known before the image is looked at.
struct Priors {
    roughness: DMatrix<f64>,
    levels: Levels,
}

impl Priors {
    fn from_objective(objective: &Objective) -> Self {
        Self {
            roughness: roughness(objective),
            levels: Levels::from_objective(objective),
        }
    }

    /// Adds those of `unknowns` to their block.
    fn add(&self, objective: &Objective, unknowns: &[usize], block: &mut DMatrix<f64>) {
        for (range, weight) in objective.smooth_fields() {
            let Some(first) = unknowns.iter().position(|n| *n == range.start) else {
                continue;
            };
            let count = range.len();
            let mut own = block.view_mut((first, first), (count, count));
            own += &self.roughness * weight;
        }
        self.levels.add(objective, unknowns, block);
    }
}

/// Second derivatives of the priors of levels: their gradient is linear.
struct Levels {
    at_zero: Vec<f64>,
}

impl Levels {
    fn from_objective(objective: &Objective) -> Self {
        let count = objective.layout.len();
        let mut at_zero = vec![0.0; count];
        objective.add_levels(&vec![0.0; count], &mut at_zero);
        Self { at_zero }
    }

    fn column(&self, objective: &Objective, unknown: usize) -> Vec<f64> {
        let mut unit = vec![0.0; self.at_zero.len()];
        unit[unknown] = 1.0;
        let mut column = vec![0.0; unit.len()];
        objective.add_levels(&unit, &mut column);
        column
            .iter_mut()
            .zip(&self.at_zero)
            .for_each(|(c, z)| *c -= z);
        column
    }

    fn add(&self, objective: &Objective, unknowns: &[usize], matrix: &mut DMatrix<f64>) {
        for (n, unknown) in unknowns.iter().enumerate() {
            let column = self.column(objective, *unknown);
            for (m, other) in unknowns.iter().enumerate() {
                matrix[(m, n)] += column[*other];
            }
        }
    }
}

/// Products of the image's changes by the unknowns of a block, in the mean over gates.
struct ImageChanges {
    still: DMatrix<f64>,
    /// Of a harmonic that has its whole size in every gate.
    motion: DMatrix<f64>,
    /// Mean square of the image.
    mean_square: f64,
}

impl ImageChanges {
    fn new(objective: &Objective, unknowns: &[f64], monitor: &Monitor) -> Result<Self, Cancelled> {
        let layout = &objective.layout;
        let nodes = layout.nodes();
        let still = vec![0.0; 2 * layout.harmonics];
        let state = objective.conservation.state(layout, unknowns, &still);
        let activity = objective.activity(unknowns);
        let thinning = Thinning::new(objective, &state);
        let mut painted: Vec<Vec<(usize, f32)>> = vec![Vec::new(); 4 * nodes + COLUMNS + 1];
        let mut moved: Vec<Vec<(usize, f32)>> = vec![Vec::new(); nodes + 1];
        let mut add = |voxel: usize, about: &Nodes, change: &Change, by_stretch: f32| {
            let put = |list: &mut Vec<(usize, f32)>, value: f32| {
                if value != 0.0 {
                    list.push((voxel, value));
                }
            };
            for (node, share) in about.shares() {
                put(&mut painted[node], share * change.mid_wall);
                put(&mut painted[nodes + node], share * change.thickness);
                put(
                    &mut painted[2 * nodes + node],
                    share * change.uptake * activity.uptake[node] as f32,
                );
                put(
                    &mut painted[3 * nodes + node],
                    share * change.outside * activity.outside[node] as f32,
                );
                let thinner = thinning.by_motion[node] as f32;
                let by_motion = change.mid_wall + thinner * change.thickness;
                put(&mut moved[node], share * by_motion);
            }
            for (column, share) in about.rim_shares() {
                put(&mut painted[4 * nodes + column], share * change.rim);
            }
            put(
                &mut painted[4 * nodes + COLUMNS],
                change.blood * activity.blood as f32,
            );
            let thinner = about.value(&thinning.by_stretch) as f32;
            let by_stretch = by_stretch + thinner * change.thickness;
            put(&mut moved[nodes], by_stretch);
        };
        let samples = objective.grid.samples(layout, &state, &activity);
        objective
            .grid
            .changes(&samples, &state, &activity, &mut add);
        let seen = objective.blur.apply(HeartGrid::paint(&samples));
        let weights = &objective.observed.weights;
        let total: f64 = weights.iter().map(|w| f64::from(*w)).sum();
        let mean_square = (seen.iter().zip(weights))
            .map(|(s, w)| f64::from(w * s * s))
            .sum::<f64>()
            / total;
        let products_of = |painted: Vec<Vec<(usize, f32)>>| {
            let blurred = |entries: &Vec<(usize, f32)>| {
                monitor.check()?;
                Ok(Blurred::new(
                    entries,
                    objective.grid.shape,
                    &objective.blur,
                    weights,
                ))
            };
            let columns = painted
                .par_iter()
                .map(blurred)
                .collect::<Result<Vec<_>, Cancelled>>()?;
            Ok(products(&columns, 2.0 * VALUE_SCALE / total))
        };
        Ok(Self {
            still: products_of(painted)?,
            motion: products_of(moved)?,
            mean_square,
        })
    }
}

/// Change of the thickness where the wall moves outward and where the long axis stretches, at every node.
struct Thinning {
    by_motion: Vec<f64>,
    by_stretch: Vec<f64>,
}

impl Thinning {
    fn new(objective: &Objective, state: &WallState) -> Self {
        let conservation = &objective.conservation;
        let walls = state.mid_wall.iter().zip(&state.thickness).enumerate();
        let by_node = walls.map(|(node, (mid, thick))| {
            let row = node / COLUMNS;
            (
                -conservation.distance[row] * thick / mid,
                -conservation.stretch[row] * thick,
            )
        });
        let (by_motion, by_stretch) = by_node.unzip();
        Self {
            by_motion,
            by_stretch,
        }
    }
}

/// A blurred image within the box where it is not 0, times the square roots of the voxels' weights.
struct Blurred {
    ranges: [Range<usize>; 3],
    values: Vec<f32>,
}

impl Blurred {
    fn new(entries: &[(usize, f32)], shape: [usize; 3], blur: &Blur, weights: &[f32]) -> Self {
        let index = |voxel: usize| {
            let [_, nx, ny] = shape;
            [voxel / (nx * ny), voxel / ny % nx, voxel % ny]
        };
        let mut ranges = shape.map(|count| count..0);
        for (voxel, _) in entries {
            for (range, at) in ranges.iter_mut().zip(index(*voxel)) {
                range.start = range.start.min(at.saturating_sub(BLUR_REACH_VOXELS));
                range.end = range.end.max(at + BLUR_REACH_VOXELS + 1);
            }
        }
        for (range, count) in ranges.iter_mut().zip(shape) {
            range.end = range.end.min(count);
            range.start = range.start.min(range.end);
        }
        let sizes = ranges.clone().map(|range| range.len());
        if entries.is_empty() {
            return Self {
                ranges,
                values: Vec::new(),
            };
        }
        let mut values = vec![0.0; sizes.iter().product()];
        for (voxel, value) in entries {
            let at = index(*voxel);
            let [s, x, y] = [0, 1, 2].map(|axis| at[axis] - ranges[axis].start);
            values[(s * sizes[1] + x) * sizes[2] + y] += value;
        }
        for axis in 0..3 {
            values = along(axis, &values, sizes, &ranges[axis], blur);
        }
        let mut values = values.into_iter();
        let mut weighted = Vec::with_capacity(sizes.iter().product());
        for s in ranges[0].clone() {
            for x in ranges[1].clone() {
                let row = (s * shape[1] + x) * shape[2];
                let weights = &weights[row + ranges[2].start..row + ranges[2].end];
                weighted.extend(weights.iter().zip(&mut values).map(|(w, v)| w.sqrt() * v));
            }
        }
        Self {
            ranges,
            values: weighted,
        }
    }

    fn dot(&self, other: &Self) -> f64 {
        let both = [0, 1, 2].map(|axis| {
            let (a, b) = (&self.ranges[axis], &other.ranges[axis]);
            a.start.max(b.start)..a.end.min(b.end)
        });
        if both.iter().any(Range::is_empty) {
            return 0.0;
        }
        let row = |of: &'_ Self, s: usize, x: usize| {
            let [rs, rx, ry] = &of.ranges;
            ((s - rs.start) * rx.len() + x - rx.start) * ry.len() + both[2].start - ry.start
        };
        let count = both[2].len();
        let mut sum = 0.0;
        for s in both[0].clone() {
            for x in both[1].clone() {
                let (a, b) = (row(self, s, x), row(other, s, x));
                let line: f32 = (self.values[a..a + count].iter())
                    .zip(&other.values[b..b + count])
                    .map(|(a, b)| a * b)
                    .sum();
                sum += f64::from(line);
            }
        }
        sum
    }
}

/// Blurs a box of values along one axis.
fn along(
    axis: usize,
    values: &[f32],
    sizes: [usize; 3],
    range: &Range<usize>,
    blur: &Blur,
) -> Vec<f32> {
    let stride: usize = sizes[axis + 1..].iter().product();
    let mut blurred = vec![0.0; values.len()];
    for (start, from) in values.chunks(stride * sizes[axis]).enumerate() {
        let to = &mut blurred[start * stride * sizes[axis]..][..from.len()];
        for (at, to) in to.chunks_mut(stride).enumerate() {
            for (source, weight) in blur.weights(axis, range.start + at) {
                if let Some(source) = source.checked_sub(range.start)
                    && source < sizes[axis]
                {
                    let from = &from[source * stride..][..stride];
                    to.iter_mut().zip(from).for_each(|(t, f)| *t += weight * f);
                }
            }
        }
    }
    blurred
}

/// Products of every two columns, times `scale`.
fn products(columns: &[Blurred], scale: f64) -> DMatrix<f64> {
    let count = columns.len();
    let rows: Vec<Vec<f64>> = (0..count)
        .into_par_iter()
        .map(|n| {
            let own = &columns[n];
            columns[..=n]
                .iter()
                .map(|other| scale * own.dot(other))
                .collect()
        })
        .collect();
    DMatrix::from_fn(count, count, |a, b| rows[a.max(b)][a.min(b)])
}

#[cfg(test)]
mod tests {
    use super::super::objective::tests::scene;
    use super::*;

    /// Where the image is met, the function's second derivatives are the Gauss-Newton matrix: differences of its
    /// gradient along a direction, of all unknowns of a block.
    #[test]
    fn blocks_are_the_second_derivatives_where_the_image_is_met() {
        let (objective, mut unknowns) = scene();
        let layout = objective.layout;
        let moving = layout.motion(0).start..layout.motion(3).end;
        for unknown in moving.chain(layout.stretch()).chain(layout.gains()) {
            unknowns[unknown] = 0.0;
        }
        let monitor = Monitor::silent();
        let objective = objective.met_by(&unknowns);
        // Large steps: hardly any damping.
        let typical = vec![1e4; unknowns.len()];
        let curvature = Curvature::new(&objective, &unknowns, &typical, &monitor).unwrap();
        for block in &curvature.blocks {
            let count = block.unknowns.len();
            let direction = DVector::from_fn(count, |n, _| (n as f64 * 0.7).sin());
            let factors = block.factors.as_ref().unwrap();
            let found = factors.l() * (factors.l().transpose() * &direction);
            const PROBE_STEP: f64 = 2e-3;
            let gradient = |by: f64| {
                let mut moved = unknowns.clone();
                for (n, unknown) in block.unknowns.iter().enumerate() {
                    moved[*unknown] += by * direction[n];
                }
                let mut gradient = vec![0.0; moved.len()];
                objective.evaluate(&moved, &mut gradient, &monitor).unwrap();
                DVector::from_fn(count, |n, _| gradient[block.unknowns[n]])
            };
            let expected = (gradient(PROBE_STEP) - gradient(-PROBE_STEP)) / (2.0 * PROBE_STEP);
            let off = (&found - &expected).norm() / expected.norm();
            assert!(off < 0.1, "{off} of a block of {count}");
        }
    }
}
