//! The scatter of a wall's phases by the noise of the gates alone.
//!
//! In: the function that the fit minimised, its unknowns at the minimum and its curvature there. Out: degrees. The
//! steps:
//!
//! 1. The noise's density: the mean square of what the fit leaves of a gate, added up over blocks of [`BLOCK_VOXELS`],
//!    by the block's voxels. A block is wider than the filters of reconstructions, so neighbours that noise moves
//!    together count together.
//! 2. Each node's first harmonic of motion has the deviation that noise of this density gives to the minimum: the
//!    curvature turns changes of the image into changes of the unknowns ([`Curvature::motion_variances`]).
//! 3. A phase is off by the angle whose tangent is that deviation over the harmonic's amplitude. The mean square over
//!    the wall, weighted as in [`super::phase`].
//!
//! Not guaranteed: noise that all gates share, and what is wrong with the model. docs/log/beat.md compares the result
//! with the errors of phases in simulated hearts.

use super::curvature::Curvature;
use super::objective::Objective;
use super::phase::least_amplitude;

/// Edge of a block, voxels of the grid about the heart: 16 mm.
const BLOCK_VOXELS: usize = 4;

/// Root mean square error of the phases by the noise of the gates, degrees.
pub(super) fn phase_noise_degrees(
    objective: &Objective,
    unknowns: &[f64],
    curvature: &Curvature,
) -> f64 {
    let density = density(objective, unknowns);
    let variances = curvature.motion_variances(objective);
    let layout = &objective.layout;
    let [cosines, sines] = [0, layout.harmonics].map(|index| &unknowns[layout.motion(index)]);
    let amplitudes: Vec<f64> = cosines
        .iter()
        .zip(sines)
        .map(|(c, s)| c.hypot(*s))
        .collect();
    let areas = objective.areas();
    let least = least_amplitude(&amplitudes, areas);
    let (mut sum, mut whole) = (0.0, 0.0);
    for ((amplitude, area), variance) in amplitudes.iter().zip(areas).zip(variances) {
        if *amplitude > least {
            let weight = area * amplitude;
            let error = (density * variance).sqrt().atan2(*amplitude).to_degrees();
            sum += weight * error * error;
            whole += weight;
        }
    }
    (sum / f64::max(whole, f64::MIN_POSITIVE)).sqrt()
}

/// Mean square of the sums over blocks of what is left of the gates, by a block's voxels. Blocks that leave the wall's
/// surroundings are left out.
fn density(objective: &Objective, unknowns: &[f64]) -> f64 {
    let observed = &objective.observed;
    let [across, down, deep] = objective.grid.shape;
    let starts = |count: usize| (0..(count + 1).saturating_sub(BLOCK_VOXELS)).step_by(BLOCK_VOXELS);
    let index = |s: usize, x: usize, y: usize| (s * down + x) * deep + y;
    let of_block = |n: usize| {
        let [s, x, y] = [
            n / BLOCK_VOXELS.pow(2),
            n / BLOCK_VOXELS % BLOCK_VOXELS,
            n % BLOCK_VOXELS,
        ];
        index(s, x, y)
    };
    let mut blocks: Vec<Vec<usize>> = Vec::new();
    for s in starts(across) {
        for x in starts(down) {
            for y in starts(deep) {
                let first = index(s, x, y);
                let voxels = (0..BLOCK_VOXELS.pow(3)).map(|n| first + of_block(n));
                let voxels: Vec<usize> = voxels.collect();
                if voxels.iter().all(|voxel| observed.weights[*voxel] > 0.0) {
                    blocks.push(voxels);
                }
            }
        }
    }
    let gates = objective.seen(unknowns);
    let (mut squares, mut count) = (0.0, 0.0);
    for ((seen, image), weight) in gates
        .iter()
        .zip(&observed.images)
        .zip(&observed.gate_weights)
    {
        if *weight > 0.0 {
            let left = |voxel: &usize| f64::from(seen[*voxel] - image[*voxel]);
            let sums = blocks
                .iter()
                .map(|block| block.iter().map(left).sum::<f64>());
            squares += sums.map(|sum| sum * sum).sum::<f64>();
            count += blocks.len() as f64;
        }
    }
    squares / f64::max(count, 1.0) / BLOCK_VOXELS.pow(3) as f64
}
