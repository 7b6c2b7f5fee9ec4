//! From a binary mask to grey values that a surface can be drawn through.
//!
//! A Gaussian takes the staircase off. Its sigma is a length, the same along every axis whatever the
//! voxels' shape, stated in voxels: those of a cube of a voxel's volume. The level is then set so
//! that the finished surface ([`surface_of`]: Marching Cubes, then Taubin's smoothing) encloses the
//! volume of the mask's voxels. A level that only keeps the count of voxel centres does not: what a
//! surface encloses between centres depends on its curvature, and 8 mm voxels of a 10 mm wall lost
//! 11 %, voxels of 2 x 10 x 2 mm 18 %.
//!
//! Walls thinner than the Gaussian would dissolve: where the smoothed object leaves more than a
//! tenth of the mask, or falls into another number of parts (crumbs of less than 1 % aside), sigma
//! is halved, down to the raw mask. Taubin's passes are as many as change the volume little: a
//! single voxel gets none.
//!
//! Coarse voxels of a thin wall may touch along edges or at corners only. Where parts of a mask do,
//! [`joined`] adds the voxels between them, which the level takes off elsewhere: thick slices of a curved
//! wall would lose the apex. Where such a surface has handles, closing them ([`topology_control`]) adds or
//! takes voxels; [`level_as_ball`] then searches the level once more, of the closed surface.

use super::marching_cubes::{MarchingCubesError, Samples, marching_cubes};
use super::{smoothing, topology_control};
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::blur::{Kernel, blur};
use crate::image::grid::components::Components;
use crate::image::grid::labels::Labels;
use crate::mesh::TriMesh;

/// Multiple of sigma at which the Gaussian is cut off.
const KERNEL_SIGMAS: f64 = 4.0;
/// Passes of Taubin's smoothing that are tried, most first.
const TAUBIN_PASSES: [usize; 4] = [10, 5, 2, 0];
/// Largest change of the volume by Taubin's smoothing, as a share.
const PASS_SLACK: f64 = 0.05;
/// Deviation of the surface's volume from the mask's at which the search for the level ends.
const VOLUME_SLACK: f64 = 2e-4;
/// Deviation at which a level is accepted though the search did not end.
const VOLUME_ERROR_WARNING: f64 = 5e-3;
/// Most surfaces made in the search for one level.
const MOST_TRIALS: usize = 24;

/// A mask made grey, in a box around it.
#[derive(Debug, Clone)]
pub struct Smoothed {
    /// Values 0..=1, i fastest.
    pub values: Vec<f32>,
    /// Number of values along i, j, k.
    pub shape: [usize; 3],
    /// First voxel of the box in the volume; negative where the margin leaves it.
    pub origin: [i64; 3],
    /// The level at which the surface encloses the mask's volume.
    pub level: f32,
    /// Passes of Taubin's smoothing for the surface.
    pub passes: usize,
    /// The sigma used, in voxels: those of a cube of a voxel's volume.
    pub sigma: f64,
}

/// Smooths `mask` with `sigma` or less, in lengths of a cube of a voxel's volume, for a surface that
/// encloses the volume of `count` voxels. `frame` is the volume's.
///
/// # Errors
/// [`MarchingCubesError`].
pub fn smooth(
    mask: &Labels,
    count: usize,
    sigma: f64,
    frame: &VoxelToPatient,
    monitor: &Monitor,
) -> Result<Smoothed, MarchingCubesError> {
    let wanted = parts(mask, monitor)?;
    let mut used = sigma;
    while used > 0.1 {
        let candidate = levelled(with_sigma(mask, used, frame), count, frame, monitor)?;
        let labels = at_level(&candidate, candidate.level);
        let margin = margin(mask, &candidate);
        let kept = mask
            .voxels()
            .filter(|p| labels.get([0, 1, 2].map(|r| p[r] + margin[r])))
            .count();
        if parts(&labels, monitor)? == wanted && 10 * kept >= 9 * mask.count() {
            return Ok(candidate);
        }
        used /= 2.0;
    }
    levelled(with_sigma(mask, 0.0, frame), count, frame, monitor)
}

/// `mask` with the voxels that join its 6-connected parts face to face where they touch along edges, and at
/// corners where they do only that; and the number of voxels added.
///
/// # Errors
/// [`Cancelled`].
pub fn joined(mask: &Labels, monitor: &Monitor) -> Result<(Labels, usize), Cancelled> {
    let mut joined = mask.clone();
    let mut axes = 2;
    while axes <= 3 {
        let parts = Components::of_inside(&joined, monitor)?;
        if parts.sizes.len() < 2 {
            break;
        }
        let mut added = Vec::new();
        for (p, part) in joined.voxels().zip(parts.of_voxels()) {
            monitor.check()?;
            for q in touching(p, axes, joined.extent) {
                if joined.get(q) && parts.containing(&joined, q) != Some(part) {
                    added.extend(path(&joined, p, q));
                }
            }
        }
        // What was added may touch a further part along an edge.
        axes = if added.is_empty() { axes + 1 } else { 2 };
        for p in added {
            joined.set(p, true);
        }
    }
    let added = joined.count() - mask.count();
    Ok((joined, added))
}

/// The voxels of a box of `extent` that differ from `p` by one step along each of exactly `axes` axes, after
/// `p` in array order.
fn touching(p: [usize; 3], axes: usize, extent: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (14..27).filter_map(move |n| {
        let step = [n % 3, n / 3 % 3, n / 9].map(|s| s as i64 - 1);
        if step.iter().filter(|s| **s != 0).count() != axes {
            return None;
        }
        let q = [0, 1, 2].map(|r| p[r] as i64 + step[r]);
        let within = (0..3).all(|r| (0..extent[r] as i64).contains(&q[r]));
        within.then(|| q.map(|x| x as usize))
    })
}

/// The voxels of a shortest path by faces from `p` to `q`, both left out: of the first steps the one
/// with most neighbours in `mask`.
fn path(mask: &Labels, p: [usize; 3], q: [usize; 3]) -> Vec<[usize; 3]> {
    let mut path = Vec::new();
    let mut here = p;
    loop {
        let steps = (0..3).filter(|&r| here[r] != q[r]).map(|r| {
            let mut next = here;
            next[r] = q[r];
            next
        });
        let best = steps.rev().max_by_key(|next| neighbours(mask, *next));
        match best {
            Some(next) if next != q => {
                path.push(next);
                here = next;
            }
            _ => return path,
        }
    }
}

/// Number of voxels of `mask` that share a face with `p`.
fn neighbours(mask: &Labels, p: [usize; 3]) -> usize {
    (0..3)
        .flat_map(|r| [(r, -1), (r, 1)])
        .filter(|&(r, step)| {
            let mut near = p.map(|x| x as i64);
            near[r] += step;
            let within = (0..mask.extent[r] as i64).contains(&near[r]);
            within && mask.get(near.map(|x| x as usize))
        })
        .count()
}

/// `mask` without the parts that smoothing leaves apart from the largest, and their number. What smoothing
/// joins to the largest part stays.
///
/// # Errors
/// [`Cancelled`].
pub fn largest_part(
    mask: &Labels,
    smoothed: &Smoothed,
    monitor: &Monitor,
) -> Result<Option<(Labels, usize)>, Cancelled> {
    let mut labels = at_level(smoothed, smoothed.level);
    let joined = Components::of_inside(&labels, monitor)?;
    let (2.., Some(largest)) = (joined.sizes.len(), joined.largest()) else {
        return Ok(None);
    };
    joined.paint(&mut labels, false, |c| c != largest, monitor)?;
    let own = Components::of_inside(mask, monitor)?;
    let margin = margin(mask, smoothed);
    let mut stays = vec![false; own.sizes.len()];
    for (p, part) in mask.voxels().zip(own.of_voxels()) {
        stays[part] |= labels.get([0, 1, 2].map(|r| p[r] + margin[r]));
    }
    let parts = stays.iter().filter(|stays| !**stays).count();
    let mut kept = mask.clone();
    own.paint(&mut kept, false, |part| !stays[part], monitor)?;
    Ok((parts > 0 && kept.count() > 0).then_some((kept, parts)))
}

/// The surface of `labels` at `level` of the values of a mask, with `passes` of Taubin's smoothing.
///
/// # Errors
/// [`MarchingCubesError`].
pub fn surface_of(
    labels: &Labels,
    values: &[f32],
    shape: [usize; 3],
    (level, passes): (f32, usize),
    frame: &VoxelToPatient,
    monitor: &Monitor,
) -> Result<TriMesh, MarchingCubesError> {
    let samples = Samples {
        values,
        shape,
        beyond: 0.0,
    };
    let mut mesh = marching_cubes(labels, &samples, level, frame, monitor)?;
    mesh.vertices = smoothing::taubin(&mesh.vertices, &mesh.triangles, passes, monitor)?;
    Ok(mesh)
}

/// The voxels of the box of `smoothed` that reach `level`.
pub fn at_level(smoothed: &Smoothed, level: f32) -> Labels {
    let shape = smoothed.shape;
    Labels::threshold(&smoothed.values, shape, [0; 3], shape, level)
}

/// From the box of `mask` to that of `smoothed`.
fn margin(mask: &Labels, smoothed: &Smoothed) -> [usize; 3] {
    [0, 1, 2].map(|r| (mask.origin[r] as i64 - smoothed.origin[r]) as usize)
}

/// Number of components that hold at least a hundredth of the voxels.
fn parts(labels: &Labels, monitor: &Monitor) -> Result<usize, Cancelled> {
    let sizes = Components::of_inside(labels, monitor)?.sizes;
    let all: usize = sizes.iter().sum();
    Ok(sizes.iter().filter(|&&size| 100 * size >= all).count())
}

fn with_sigma(mask: &Labels, sigma: f64, frame: &VoxelToPatient) -> Smoothed {
    let edge = frame.voxel_volume().cbrt();
    let sigmas = frame.spacing().map(|spacing| sigma * edge / spacing);
    let margin = sigmas.map(|sigma| (KERNEL_SIGMAS * sigma).ceil() as usize + 1);
    let shape = [0, 1, 2].map(|r| mask.extent[r] + 2 * margin[r]);
    let mut values = vec![0f32; shape.iter().product()];
    for p in mask.voxels() {
        let [i, j, k] = [0, 1, 2].map(|r| p[r] + margin[r]);
        values[i + shape[0] * (j + shape[1] * k)] = 1.0;
    }
    if sigma > 0.0 {
        // The margin is wider than the kernel: all values at the border of the box are 0.
        let kernels = sigmas.map(|sigma| Kernel::gaussian(sigma, KERNEL_SIGMAS));
        blur(&mut values, shape, &kernels, &Monitor::silent())
            .expect("a silent monitor is never cancelled");
    }
    Smoothed {
        level: keeping(&values, mask.count()),
        passes: 0,
        values,
        shape,
        origin: [0, 1, 2].map(|r| mask.origin[r] as i64 - margin[r] as i64),
        sigma,
    }
}

/// Sets level and passes of `smoothed` so that the surface encloses the volume of `count` voxels.
fn levelled(
    mut smoothed: Smoothed,
    count: usize,
    frame: &VoxelToPatient,
    monitor: &Monitor,
) -> Result<Smoothed, MarchingCubesError> {
    let wanted = count as f64 * frame.voxel_volume();
    if wanted == 0.0 {
        return Ok(smoothed);
    }
    let start = smoothed.level;
    let mut best = (f64::INFINITY, start, 0);
    for passes in TAUBIN_PASSES {
        let off = |level| {
            let volume = volume_at(&smoothed, level, passes, frame, monitor)?;
            Ok::<f64, MarchingCubesError>(volume / wanted - 1.0)
        };
        let (level, off) = level_of(start, top(&smoothed), off)?;
        let raw = volume_at(&smoothed, level, 0, frame, monitor)?;
        let smoothing = if passes == 0 {
            0.0
        } else {
            (wanted * (1.0 + off) / raw - 1.0).abs()
        };
        if off.abs() < best.0 && (smoothing <= PASS_SLACK || passes == 0) {
            best = (off.abs(), level, passes);
        }
        if best.0 <= VOLUME_ERROR_WARNING {
            break;
        }
    }
    (smoothed.level, smoothed.passes) = (best.1, best.2);
    Ok(smoothed)
}

/// The level, searched from `start` to `top`, at which `off` is least, and `off` there: the share by which
/// the surface's volume at a level differs from the one wanted.
///
/// The volume falls as the level rises. False position with halved weights (Illinois; Dowell and
/// Jarratt 1971) keeps both ends about the root.
fn level_of<E>(
    start: f32,
    top: f64,
    mut off_at: impl FnMut(f32) -> Result<f64, E>,
) -> Result<(f32, f64), E> {
    let mut off = |level: f64| off_at(level as f32);
    let first = f64::from(start);
    let at_first = off(first)?;
    let mut best = (first, at_first);
    if at_first.abs() <= VOLUME_SLACK {
        return Ok((start, at_first));
    }
    // Walks from the first level towards the root until the sign changes.
    let (mut near, mut far) = ((first, at_first), None);
    for step in 0..8 {
        let share = 0.1 * f64::from(1 << step);
        let level = if at_first > 0.0 {
            first + (top - first) * share.min(1.0)
        } else {
            first * (1.0 - share).max(1e-3)
        };
        let level = level.clamp(f64::from(f32::MIN_POSITIVE), top);
        let found = (level, off(level)?);
        if found.1.abs() < best.1.abs() {
            best = found;
        }
        if (found.1 > 0.0) != (at_first > 0.0) {
            far = Some(found);
            break;
        }
        near = found;
        if share >= 1.0 {
            break;
        }
    }
    let Some(mut far) = far else {
        return Ok((best.0 as f32, best.1));
    };
    let (mut weight_near, mut weight_far) = (near.1, far.1);
    for _ in 0..MOST_TRIALS {
        if best.1.abs() <= VOLUME_SLACK {
            break;
        }
        let level = (near.0 * weight_far - far.0 * weight_near) / (weight_far - weight_near);
        let found = (level, off(level)?);
        if found.1.abs() < best.1.abs() {
            best = found;
        }
        if (found.1 > 0.0) == (near.1 > 0.0) {
            near = found;
            weight_near = found.1;
            weight_far /= 2.0;
        } else {
            far = found;
            weight_far = found.1;
            weight_near /= 2.0;
        }
    }
    Ok((best.0 as f32, best.1))
}

/// The level at which the surface of the largest ball in `smoothed` ([`topology_control::make_ball`])
/// encloses the volume of `count` voxels. The volume of a closed surface jumps where a handle appears, so that the
/// nearest level found may be off by more than one of [`smooth`].
///
/// # Errors
/// [`MarchingCubesError`].
pub fn level_as_ball(
    smoothed: &Smoothed,
    count: usize,
    frame: &VoxelToPatient,
    monitor: &Monitor,
) -> Result<f32, MarchingCubesError> {
    let wanted = count as f64 * frame.voxel_volume();
    let (values, shape) = (&smoothed.values, smoothed.shape);
    let value = |[i, j, k]: [usize; 3]| values[i + shape[0] * (j + shape[1] * k)];
    let off = |level: f32| {
        let mut labels = at_level(smoothed, level);
        topology_control::make_ball(&mut labels, value, monitor)?;
        let how = (level, smoothed.passes);
        let mesh = surface_of(&labels, values, shape, how, frame, monitor)?;
        Ok::<f64, MarchingCubesError>(mesh.volume() / wanted - 1.0)
    };
    Ok(level_of(smoothed.level, top(smoothed), off)?.0)
}

fn top(smoothed: &Smoothed) -> f64 {
    f64::from(smoothed.values.iter().copied().fold(0.0, f32::max))
}

/// Volume that the surface at `level` encloses, mm³.
fn volume_at(
    smoothed: &Smoothed,
    level: f32,
    passes: usize,
    frame: &VoxelToPatient,
    monitor: &Monitor,
) -> Result<f64, MarchingCubesError> {
    let labels = at_level(smoothed, level);
    let (values, shape) = (&smoothed.values, smoothed.shape);
    let mesh = surface_of(&labels, values, shape, (level, passes), frame, monitor)?;
    Ok(mesh.volume())
}

/// The level that `count` of the values reach: half-way between neighbours in order, so that
/// no value stands on it.
fn keeping(values: &[f32], count: usize) -> f32 {
    if count == 0 || count >= values.len() {
        return 0.5;
    }
    let mut sorted = values.to_vec();
    let (lower, above, _) = sorted.select_nth_unstable_by(values.len() - count, f32::total_cmp);
    let below = lower.iter().copied().fold(0.0, f32::max);
    f32::midpoint(*above, below).max(f32::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use proptest::prelude::*;

    fn frame(spacing: [f64; 3]) -> VoxelToPatient {
        VoxelToPatient::centred([20; 3], spacing, Vec3::zeros()).unwrap()
    }

    /// Volumes of mask and surface, mm³, and the smoothed mask.
    fn volumes(mask: &Labels, sigma: f64, spacing: [f64; 3]) -> (f64, f64, Smoothed) {
        let (frame, silent) = (frame(spacing), Monitor::silent());
        let smoothed = smooth(mask, mask.count(), sigma, &frame, &silent).unwrap();
        let level = (smoothed.level, smoothed.passes);
        let labels = at_level(&smoothed, smoothed.level);
        let (values, shape) = (&smoothed.values, smoothed.shape);
        let mesh = surface_of(&labels, values, shape, level, &frame, &silent).unwrap();
        let voxel: f64 = spacing.iter().product();
        (mask.count() as f64 * voxel, mesh.volume(), smoothed)
    }

    /// The half-open wall of a cup, 10 mm thick, in voxels of `spacing`.
    fn cup(spacing: [f64; 3]) -> Labels {
        let extent = spacing.map(|s| (100.0 / s) as usize);
        Labels::of_shape(extent, |p| {
            let [x, y, z] = [0, 1, 2].map(|r| (p[r] as f64 + 0.37) * spacing[r] - 48.0);
            let within = |a: f64, c: f64| (x * x + y * y) / (a * a) + z * z / (c * c) < 1.0;
            within(30.0, 45.0) && !within(20.0, 35.0) && z < 25.0
        })
    }

    #[test]
    fn the_surface_of_a_wall_encloses_the_volume_of_its_voxels() {
        for spacing in [
            [3.0, 3.0, 3.0],
            [2.0, 2.0, 10.0],
            [2.0, 10.0, 2.0],
            [10.0, 2.0, 2.0],
            [8.0, 8.0, 8.0],
            [1.5, 1.5, 10.0],
        ] {
            for sigma in [0.0, 0.8, 2.0] {
                let (mask, surface, _) = volumes(&cup(spacing), sigma, spacing);
                let off = surface / mask - 1.0;
                assert!(off.abs() < 0.01, "{spacing:?} {sigma}: {off}");
            }
        }
    }

    #[test]
    fn small_and_thin_objects_keep_their_volume() {
        let all = |_: [usize; 3]| true;
        let objects = [
            Labels::of_shape([1; 3], all),
            Labels::of_shape([2, 1, 1], all),
            Labels::of_shape([30, 1, 1], all),
            Labels::of_shape([20, 20, 1], all),
            Labels::of_shape([1, 20, 20], all),
            Labels::of_shape([2; 3], all),
            Labels::of_shape([9; 3], |p| {
                p.iter().map(|x| x.abs_diff(4)).sum::<usize>() < 4
            }),
        ];
        for object in objects {
            for spacing in [[2.0; 3], [2.0, 2.0, 9.0], [0.01; 3], [300.0; 3]] {
                let (mask, surface, _) = volumes(&object, 0.8, spacing);
                let off = surface / mask - 1.0;
                assert!(off.abs() < 0.02, "{:?} {spacing:?}: {off}", object.extent);
            }
        }
    }

    #[test]
    fn a_scale_changes_nothing_but_the_scale() {
        let object = cup([4.0; 3]);
        let (mask, surface, one) = volumes(&object, 0.8, [1.0; 3]);
        for scale in [1e-3, 0.02, 300.0] {
            let (m, s, other) = volumes(&object, 0.8, [scale; 3]);
            assert_eq!((one.passes, one.sigma), (other.passes, other.sigma));
            assert!((one.level - other.level).abs() < 1e-5);
            assert!((s / m - surface / mask).abs() < 1e-5);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]

        /// Random unions of boxes from 300 voxels on, in voxels of any shape.
        #[test]
        fn the_volume_is_kept_from_300_voxels_on(
            boxes in prop::collection::vec((0usize..12, 0usize..12, 0usize..12, 2usize..8, 2usize..8, 2usize..8), 1..5),
            spacing in [1.0f64..10.0, 1.0..10.0, 1.0..10.0],
            sigma in 0.0f64..1.5,
        ) {
            let object = Labels::of_shape([20; 3], |p| boxes.iter().any(|&(i, j, k, a, b, c)| {
                (i..i + a).contains(&p[0]) && (j..j + b).contains(&p[1]) && (k..k + c).contains(&p[2])
            }));
            prop_assume!(object.count() >= 300);
            let (mask, surface, _) = volumes(&object, sigma, spacing);
            let off = surface / mask - 1.0;
            prop_assert!(off.abs() < 0.01, "{off}");
        }
    }

    /// Against the definition: after it no two parts touch along an edge or at a corner, and nothing is lost.
    fn is_joined(mask: &Labels) -> bool {
        let monitor = Monitor::silent();
        let (whole, added) = joined(mask, &monitor).unwrap();
        let parts = Components::of_inside(&whole, &monitor).unwrap();
        let mut apart = true;
        for (p, part) in whole.voxels().zip(parts.of_voxels()) {
            for axes in [2, 3] {
                for q in touching(p, axes, whole.extent) {
                    apart &= !whole.get(q) || parts.containing(&whole, q) == Some(part);
                }
            }
        }
        let of_mask = mask.voxels().filter(|p| whole.get(*p)).count();
        apart && of_mask == mask.count() && whole.count() == of_mask + added
    }

    proptest! {
        #[test]
        fn parts_that_touch_are_joined(bits in prop::collection::vec(prop::bool::weighted(0.2), 6 * 5 * 4)) {
            let mask = Labels::of_shape([6, 5, 4], |p| bits[p[0] + 6 * (p[1] + 5 * p[2])]);
            prop_assert!(is_joined(&mask));
        }
    }

    #[test]
    fn parts_that_do_not_touch_stay_apart() {
        let mask = Labels::of_shape([7, 3, 3], |p| p[0] < 3 || p[0] > 4);
        let (whole, added) = joined(&mask, &Monitor::silent()).unwrap();
        assert_eq!((whole, added), (mask, 0));
    }

    #[test]
    fn thin_sheets_and_rods_survive() {
        let rod = Labels::of_shape([30, 9, 9], |p| p[1] == 4 && p[2] == 4 || p[0] > 20);
        let sheet = Labels::of_shape([20, 20, 1], |_| true);
        for thin in [rod, sheet, Labels::of_shape([1; 3], |_| true)] {
            let smoothed = smooth(
                &thin,
                thin.count(),
                3.0,
                &frame([1.0; 3]),
                &Monitor::silent(),
            )
            .unwrap();
            let labels = at_level(&smoothed, smoothed.level);
            assert_eq!(labels.euler_characteristic(), thin.euler_characteristic());
            assert!(10 * labels.count() >= 9 * thin.count());
        }
    }

    #[test]
    fn the_largest_part_is_what_smoothing_leaves_together() {
        // A cube, a voxel that touches it along an edge, and a far crumb.
        let object = Labels::of_shape([20, 9, 9], |p| {
            p.iter().all(|&x| x < 7) || p == [7, 7, 3] || p[0] > 17 && p[1] < 2 && p[2] < 2
        });
        let smoothed = smooth(
            &object,
            object.count(),
            0.8,
            &frame([1.0; 3]),
            &Monitor::silent(),
        )
        .unwrap();
        let monitor = Monitor::silent();
        let found = largest_part(&object, &smoothed, &monitor).unwrap();
        let (kept, parts) = found.unwrap();
        assert!(parts >= 1, "{parts}");
        assert!(object.count() - kept.count() >= 8, "{}", kept.count());
        assert!(kept.get([3, 3, 3]) && !kept.get([18, 0, 0]));
    }
}
