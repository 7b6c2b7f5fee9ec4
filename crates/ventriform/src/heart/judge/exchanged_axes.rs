//! Whether two axes of the image were exchanged, as in an array in z, y, x order that was given the affine of its
//! image.
//!
//! Such a heart is mirrored, and may still point to the left, to the front and down. But its surroundings do not: the
//! camera cuts the body off above and below, while it ends in air at the sides, and what is hot beside a heart, liver
//! and gut, lies below it and to its right. In: the volume, the heart's centre, the wall's uptake, in a frame whose
//! axes are nearly the patient's. Out: for each pair of axes of which one runs along the body, by how much both speak
//! against an exchange: a *score*, above zero for images as they are, the same below zero for those with these two axes
//! exchanged.
//!
//! 1. Ends: the mean area of the body's outermost slices along an axis, of those that hold [`END_SHARE`] of it, against
//!    its largest slice. The logarithm of that along the body over that along the other axis.
//! 2. Side: of the bright activity around the heart, the share on the side of liver and gut less that on the
//!    other side of the plane on which an exchange leaves everything in its place.
//! 3. The score is their sum ([`AxisPair::flag_score`]).
//!
//! A cut-out about the heart has no ends, and a scan without activity beside the heart no sides; with neither, nothing
//! is told. Not told: an exchange of both axes across the body, which turns the apex to the right or back, or mirrors a
//! heart that points as far to the left as to the front.

use crate::base::geometry::Vec3;
use crate::image::grid::Volume;

/// Share of the wall's uptake from which on a voxel is part of the body.
const BODY_SHARE: f64 = 0.04;
/// Share of the body's voxels in the slices at either end.
const END_SHARE: f64 = 0.03;
/// Voxels of a slice, as a share of those of the largest, from which on it is part of the body.
const EMPTY_SLICE_SHARE: f64 = 0.002;
/// Share of the wall's uptake from which on activity is bright.
const BRIGHT_SHARE: f64 = 0.35;
/// Distances from the heart's centre between which bright activity counts, mm.
const AROUND_MM: [f64; 2] = [60.0, 180.0];
/// Least volume of bright activity that tells a side, ml.
const LEAST_BRIGHT_ML: f64 = 50.0;
/// Greatest angle between the axes of the grid and the patient's, degrees: slices across a heart are cut out about it.
const MAX_OBLIQUE_DEG: f64 = 20.0;

/// A pair of axes of the patient, of which the second runs along the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AxisPair {
    /// From side to side, and from feet to head.
    SidesAndLength,
    /// From front to back, and from feet to head.
    DepthAndLength,
}

impl AxisPair {
    /// Both.
    pub const ALL: [Self; 2] = [Self::SidesAndLength, Self::DepthAndLength];

    /// The score below which these axes count as exchanged. `scripts/measure/calibrate_axes.py` estimates it, .1 below
    /// the lowest of 280 images that are right or cut out about the heart (.01, -.18). Held out, it tells 69 of 69
    /// exchanged ones and none of 276 right ones, for either pair; the highest score of an exchanged one of the
    /// estimate is -.32, -.34.
    pub fn flag_score(self) -> f64 {
        match self {
            AxisPair::SidesAndLength => -0.15,
            AxisPair::DepthAndLength => -0.28,
        }
    }

    /// The patient's axis (LPS) that is exchanged with that along the body.
    fn across(self) -> usize {
        match self {
            AxisPair::SidesAndLength => 0,
            AxisPair::DepthAndLength => 1,
        }
    }

    /// How far `from`, a place relative to the heart, lies on the side of liver and gut: below, and to the right or the
    /// back. An exchange changes its sign.
    fn side(self, from: &Vec3) -> f64 {
        match self {
            AxisPair::SidesAndLength => -from.x - from.z,
            AxisPair::DepthAndLength => from.y - from.z,
        }
    }
}

/// What speaks for or against an exchange.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// Logarithm of the areas of the body's ends, along it over across it.
    pub ends: f64,
    /// Balance of bright activity, -1..=1; 0 where there is too little.
    pub side: f64,
}

impl Score {
    /// The sum.
    pub fn total(&self) -> f64 {
        self.ends + self.side
    }
}

/// The scores of both pairs of axes for a heart at `centre` (LPS mm) with this uptake of its wall in `volume`; `None`
/// where the grid is oblique, or no body is seen.
pub fn scores(volume: &Volume, centre: &Vec3, uptake: f64) -> Option<[Score; 2]> {
    let of_patient = patient_axes(volume)?;
    if !(uptake > 0.0) {
        return None;
    }
    let ends = ends(volume, (BODY_SHARE * uptake) as f32)?;
    let sides = sides(volume, centre, uptake);
    let along = |axis: usize| {
        of_patient
            .iter()
            .position(|of| *of == axis)
            .map(|grid| ends[grid])
    };
    let length = along(2)?;
    let mut scores = [Score {
        ends: 0.0,
        side: 0.0,
    }; 2];
    for (number, pair) in AxisPair::ALL.into_iter().enumerate() {
        scores[number] = Score {
            ends: (length / along(pair.across())?).ln(),
            side: sides[number],
        };
    }
    Some(scores)
}

/// The axis of the patient along which each axis of the grid runs; `None` where one of them is oblique.
fn patient_axes(volume: &Volume) -> Option<[usize; 3]> {
    let linear = volume.frame.linear();
    let mut axes = [0; 3];
    for (grid, axis) in axes.iter_mut().enumerate() {
        let direction = linear.column(grid).normalize();
        *axis = direction.iamax();
        if direction[*axis].abs() < MAX_OBLIQUE_DEG.to_radians().cos() {
            return None;
        }
    }
    let mut sorted = axes;
    sorted.sort_unstable();
    (sorted == [0, 1, 2]).then_some(axes)
}

/// For each axis of the grid, the mean area of the body's end slices over that of its largest; `None` without a body.
fn ends(volume: &Volume, level: f32) -> Option<[f64; 3]> {
    let [nx, ny, nz] = volume.shape;
    let mut areas = [vec![0_usize; nx], vec![0; ny], vec![0; nz]];
    for k in 0..nz {
        for j in 0..ny {
            let row = nx * (j + ny * k);
            for i in 0..nx {
                if volume.voxels[row + i] > level {
                    areas[0][i] += 1;
                    areas[1][j] += 1;
                    areas[2][k] += 1;
                }
            }
        }
    }
    let mut ends = [0.0; 3];
    for (end, areas) in ends.iter_mut().zip(&areas) {
        let largest = *areas.iter().max()? as f64;
        if largest == 0.0 {
            return None;
        }
        let backward: Vec<usize> = areas.iter().rev().copied().collect();
        *end = f64::midpoint(first_end(areas), first_end(&backward)) / largest;
    }
    Some(ends)
}

/// The mean area of the first slices, which hold [`END_SHARE`] of all.
fn first_end(areas: &[usize]) -> f64 {
    let all: usize = areas.iter().sum();
    let largest = areas.iter().copied().max().unwrap_or(0) as f64;
    let (mut slices, mut sum) = (0, 0);
    for area in areas {
        if slices == 0 && *area as f64 <= EMPTY_SLICE_SHARE * largest {
            continue;
        }
        slices += 1;
        sum += area;
        if sum as f64 >= END_SHARE * all as f64 {
            break;
        }
    }
    sum as f64 / f64::from(slices.max(1))
}

/// The balance of bright activity for each pair of axes.
fn sides(volume: &Volume, centre: &Vec3, uptake: f64) -> [f64; 2] {
    let [nx, ny, nz] = volume.shape;
    let [nearest, farthest] = AROUND_MM;
    let (mut balance, mut weights, mut voxels) = ([0.0; 2], 0.0, 0_usize);
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let share = f64::from(volume.voxels[i + nx * (j + ny * k)]) / uptake;
                // False for missing values too.
                let bright = share > BRIGHT_SHARE && share < f64::INFINITY;
                if !bright {
                    continue;
                }
                let index = Vec3::new(i as f64, j as f64, k as f64);
                let from = volume.frame.to_patient(&index) - centre;
                let distance = from.norm();
                if distance <= nearest || distance >= farthest {
                    continue;
                }
                // Border artefacts of single voxels outshine all.
                let weight = share.min(1.0);
                for (sum, pair) in balance.iter_mut().zip(AxisPair::ALL) {
                    let side = pair.side(&from);
                    *sum += weight * if side == 0.0 { 0.0 } else { side.signum() };
                }
                weights += weight;
                voxels += 1;
            }
        }
    }
    let voxel_ml = volume.frame.linear().determinant().abs() / 1000.0;
    if voxels as f64 * voxel_ml < LEAST_BRIGHT_ML {
        return [0.0; 2];
    }
    balance.map(|sum| sum / weights)
}

/// The pair of axes that counts as exchanged: of those whose score is below [`AxisPair::flag_score`], that with the
/// lowest.
pub(super) fn exchanged(volume: &Volume, centre: &Vec3, uptake: f64) -> Option<(AxisPair, Score)> {
    let scores = scores(volume, centre, uptake)?;
    let both = AxisPair::ALL.into_iter().zip(scores);
    both.filter(|(pair, score)| score.total() < pair.flag_score())
        .min_by(|(_, a), (_, b)| a.total().total_cmp(&b.total()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::base::progress::Monitor;
    use crate::image::volume::phantom::{PhantomParameters, phantom};
    use nalgebra::Matrix3;

    /// `volume` with its axes in another order, in the same frame.
    fn reordered(volume: &Volume, order: [usize; 3]) -> Volume {
        let from = volume.shape;
        let shape = order.map(|axis| from[axis]);
        let mut voxels = Vec::with_capacity(volume.voxels.len());
        for k in 0..shape[2] {
            for j in 0..shape[1] {
                for i in 0..shape[0] {
                    let mut at = [0; 3];
                    for (axis, n) in order.into_iter().zip([i, j, k]) {
                        at[axis] = n;
                    }
                    voxels.push(volume.voxels[at[0] + from[0] * (at[1] + from[1] * at[2])]);
                }
            }
        }
        Volume {
            voxels,
            shape,
            ..volume.clone()
        }
    }

    /// The same image in the same place, stored from left to right and from back to front.
    fn stored_ras(volume: &Volume) -> Volume {
        let [nx, ny, _] = volume.shape;
        let mut voxels = volume.voxels.clone();
        for plane in voxels.chunks_mut(nx * ny) {
            plane.reverse();
        }
        let last = Vec3::new(nx as f64 - 1.0, ny as f64 - 1.0, 0.0);
        let backward = Matrix3::from_diagonal(&Vec3::new(-1.0, -1.0, 1.0));
        let linear = volume.frame.linear() * backward;
        Volume {
            frame: VoxelToPatient::new(linear, volume.frame.to_patient(&last)).unwrap(),
            voxels,
            ..volume.clone()
        }
    }

    #[test]
    fn exchanged_axes_are_told_whatever_the_storage() {
        let monitor = Monitor::silent();
        for (seed, liver) in [(1, 0.5), (2, 0.0), (3, 1.2)] {
            let parameters = PhantomParameters {
                shape: [56, 56, 48],
                spacing_mm: [6.4; 3],
                liver,
                seed,
                ..PhantomParameters::default()
            };
            let made = phantom(&parameters, &monitor).unwrap();
            let centre = (made.pose.apex + made.pose.base) / 2.0;
            let lps = made.volume;
            let ras = stored_ras(&lps);
            let uptake = parameters.wall_value;
            for (volume, order, pair) in [
                (&ras, [2, 1, 0], AxisPair::SidesAndLength),
                (&lps, [0, 2, 1], AxisPair::DepthAndLength),
            ] {
                let [sides, depth] = scores(volume, &centre, uptake).unwrap();
                assert!(
                    sides.total() > 0.3 && depth.total() > 0.3,
                    "{sides:?} {depth:?}"
                );
                assert_eq!(exchanged(volume, &centre, uptake), None);
                let index = volume.frame.to_voxel(&centre);
                let moved = Vec3::from(order.map(|axis: usize| index[axis]));
                let there = volume.frame.to_patient(&moved);
                let (found, score) = exchanged(&reordered(volume, order), &there, uptake).unwrap();
                assert_eq!(found, pair, "seed {seed}");
                assert!(score.ends < 0.0 && score.side <= 0.0, "{score:?}");
            }
        }
    }

    #[test]
    fn a_cut_out_without_anything_bright_tells_nothing() {
        let shape = [24; 3];
        let frame = VoxelToPatient::centred(shape, [6.0; 3], Vec3::zeros()).unwrap();
        let heart = |p: &Vec3| {
            if (25.0..40.0).contains(&p.norm()) {
                100.0
            } else {
                10.0
            }
        };
        let volume = Volume::sampled(shape, frame, heart);
        assert_eq!(exchanged(&volume, &Vec3::zeros(), 100.0), None);
        assert_eq!(scores(&volume, &Vec3::zeros(), 0.0), None);
        let blank = Volume::sampled(shape, volume.frame.clone(), |_| f64::NAN);
        assert_eq!(scores(&blank, &Vec3::zeros(), 1.0), None);
    }
}
