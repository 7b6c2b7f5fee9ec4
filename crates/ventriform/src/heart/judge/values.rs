//! Whether the values of a volume are those of a scan: counts, or what is proportional to them.
//!
//! Uptake in per cent needs a scale that begins at nothing and ends nowhere. A converter, an export for a screen or the
//! preparation for training may cut values off, shift them, or scale them about their mean; single damaged voxels may
//! outshine the rest. In: the fitted wall, the volume. Out: the figures of what is wrong.
//!
//! 1. Saturation ([`Saturation`]): many voxels of the wall have its greatest value, and far fewer a value just below. A
//!    blurred image has one or two there.
//! 2. Background ([`Background`]): the volume's lowest value is below zero and held by many voxels, or half of the
//!    voxels lie below zero; or hardly any voxel is near zero. Noise of filtered backprojection lies about zero, and no
//!    two of its voxels are alike.
//! 3. Hot voxels ([`HotVoxels`]): single voxels of the wall are far brighter than those about them.
//!
//! Each figure is relative to the wall, so that cut organs beside it, padding at zero and the border's artefacts say
//! nothing.

use crate::heart::model::wall::VentricleWall;
use crate::image::grid::Volume;
use std::collections::BTreeSet;

/// Relative difference of values that count as the greatest one.
const EQUAL_SHARE: f32 = 1e-3;
/// Share of the wall's voxels with its greatest value from which on it is cut off. In 31 simulated scans at most two
/// voxels of a thousand have it, in the real ones one or two voxels.
const SATURATED_SHARE: f64 = 0.02;
/// Least number of such voxels.
const LEAST_SATURATED: usize = 6;
/// How many times more there are of them than just below it. Of whole numbers of few counts each is held by many
/// voxels, the greatest by fewest.
const SATURATED_TIMES: usize = 2;
/// The range just below the greatest value, as a share of it; at least the step to the next value.
const BELOW_SHARE: f32 = 0.01;

/// Share of the volume's voxels with its lowest value from which on that is a background.
const BACKGROUND_SHARE: f64 = 0.02;
/// Distance of the background below zero, as a share of the wall's uptake, from which on it matters.
const BELOW_ZERO_SHARE: f64 = 0.01;
/// The same of the median of all voxels, which noise and streaks of filtered backprojection move a little.
const MEDIAN_BELOW_ZERO_SHARE: f64 = 0.02;
/// Part of the voxels that are darker than the level which stands for a volume without zero.
const DARKEST_SHARE: f64 = 0.02;
/// That level, as a share of the wall's uptake. Lungs, blood and air within any cut-out about a heart are darker.
const RAISED_SHARE: f64 = 0.4;

/// How many times brighter than the brightest of its neighbours a voxel of the wall is damaged.
const HOT_TIMES: f32 = 1.6;

/// A wall whose values were cut off above.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Saturation {
    /// The greatest value.
    pub value: f32,
    /// Share of the wall's voxels that have it, 0..=1.
    pub share: f64,
}

/// A background that is not at zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Background {
    /// Its value.
    pub value: f32,
    /// That as a share of the wall's uptake; negative below zero.
    pub of_uptake: f64,
    /// Share of the volume's voxels that are below zero, 0..=1.
    pub negative: f64,
}

/// Single voxels of the wall that outshine it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HotVoxels {
    /// Number of them.
    pub count: usize,
    /// Index of the brightest, from 0.
    pub index: [usize; 3],
    /// Its value.
    pub value: f32,
    /// The value of the brightest voxel about it.
    pub beside: f32,
}

/// The voxels of a wall: their numbers, in order.
pub(super) fn voxels_of(wall: &VentricleWall, volume: &Volume) -> Vec<usize> {
    let [nx, ny, nz] = volume.shape;
    let step = volume
        .frame
        .spacing()
        .into_iter()
        .fold(f64::INFINITY, f64::min)
        / 2.0;
    let mut numbers = BTreeSet::new();
    for ray in &wall.rays {
        let Some([enters, leaves]) = ray.wall else {
            continue;
        };
        let steps = ((leaves - enters) / step).floor().max(0.0) as usize;
        for n in 0..=steps {
            let point = ray.start + ray.direction * (enters + step * n as f64);
            let index = volume.frame.to_voxel(&point).map(f64::round);
            if (0..3).all(|a| (0.0..volume.shape[a] as f64).contains(&index[a])) {
                let [i, j, k] = [0, 1, 2].map(|a| index[a] as usize);
                debug_assert!(i < nx && j < ny && k < nz);
                numbers.insert(i + nx * (j + ny * k));
            }
        }
    }
    numbers.into_iter().collect()
}

/// Whether the values of the `wall`'s voxels (numbers of voxels) were cut off above.
pub(super) fn saturation(wall: &[usize], volume: &Volume) -> Option<Saturation> {
    let values = wall
        .iter()
        .map(|v| volume.voxels[*v])
        .filter(|v| v.is_finite());
    let values: Vec<f32> = values.collect();
    let greatest = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    if !(greatest > 0.0) {
        return None;
    }
    let equal = greatest * (1.0 - EQUAL_SHARE);
    let next = values
        .iter()
        .copied()
        .filter(|v| *v < equal)
        .fold(f32::NEG_INFINITY, f32::max);
    let range = (BELOW_SHARE * greatest).max(greatest - next);
    let saturated = values.iter().filter(|v| **v >= equal).count();
    let below = values
        .iter()
        .filter(|v| (greatest - range..equal).contains(*v))
        .count();
    let share = saturated as f64 / values.len() as f64;
    let many = saturated >= LEAST_SATURATED.max(SATURATED_TIMES * below);
    (many && share >= SATURATED_SHARE).then_some(Saturation {
        value: greatest,
        share,
    })
}

/// The background of `volume` if it is not at zero, measured by the wall's `uptake`.
pub(super) fn background(volume: &Volume, uptake: f64) -> Option<Background> {
    let mut values: Vec<f32> = volume
        .voxels
        .iter()
        .copied()
        .filter(|v| v.is_finite())
        .collect();
    if values.is_empty() {
        return None;
    }
    let all = values.len() as f64;
    let lowest = values.iter().copied().fold(f32::INFINITY, f32::min);
    let at_lowest = values.iter().filter(|v| **v == lowest).count() as f64 / all;
    let negative = values.iter().filter(|v| **v < 0.0).count() as f64 / all;
    let middle = values.len() / 2;
    let median = *values.select_nth_unstable_by(middle, f32::total_cmp).1;
    let darkest = (DARKEST_SHARE * all) as usize;
    let dark = *values.select_nth_unstable_by(darkest, f32::total_cmp).1;
    // A wall below zero is measured by nothing.
    let of_uptake = |value: f32| {
        if uptake > 0.0 {
            f64::from(value) / uptake
        } else {
            f64::from(value.signum())
        }
    };
    let found = |value: f32| {
        Some(Background {
            value,
            of_uptake: of_uptake(value),
            negative,
        })
    };
    if at_lowest >= BACKGROUND_SHARE && of_uptake(lowest) <= -BELOW_ZERO_SHARE {
        found(lowest)
    } else if of_uptake(median) <= -MEDIAN_BELOW_ZERO_SHARE {
        found(median)
    } else if of_uptake(dark) >= RAISED_SHARE {
        found(dark)
    } else {
        None
    }
}

/// Single voxels of the `wall` (numbers of voxels) that are far brighter than those about them.
pub(super) fn hot_voxels(wall: &[usize], volume: &Volume) -> Option<HotVoxels> {
    let [nx, ny, nz] = volume.shape;
    let mut found: Option<HotVoxels> = None;
    let mut count = 0;
    for number in wall {
        let value = volume.voxels[*number];
        let index = [number % nx, number / nx % ny, number / (nx * ny)];
        let about = |axis: usize, n: usize| {
            let last = [nx, ny, nz][axis] - 1;
            index[axis].saturating_sub(n)..=(index[axis] + n).min(last)
        };
        let mut beside = f32::NEG_INFINITY;
        // Those next to it may be damaged together with it: the voxels about them count.
        for k in about(2, 2) {
            for j in about(1, 2) {
                for i in about(0, 2) {
                    let apart = [
                        i.abs_diff(index[0]),
                        j.abs_diff(index[1]),
                        k.abs_diff(index[2]),
                    ];
                    let other = volume.voxels[i + nx * (j + ny * k)];
                    if apart.iter().any(|n| *n > 1) && other.is_finite() {
                        beside = beside.max(other);
                    }
                }
            }
        }
        if value.is_finite() && beside > 0.0 && value > HOT_TIMES * beside {
            count += 1;
            if found.is_none_or(|hottest| value > hottest.value) {
                found = Some(HotVoxels {
                    count,
                    index,
                    value,
                    beside,
                });
            }
        }
    }
    found.map(|hottest| HotVoxels { count, ..hottest })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::base::geometry::frame::VoxelToPatient;

    /// A blurred shell of uptake 100 with a dark side in a body of 10, with noise, in air; and the numbers of its
    /// wall's voxels.
    fn scan() -> (Volume, Vec<usize>) {
        let shape = [40; 3];
        let frame = VoxelToPatient::centred(shape, [5.0; 3], Vec3::zeros()).unwrap();
        let shell = |p: &Vec3| (-((p.norm() - 35.0) / 8.0).powi(2)).exp();
        let body = |p: &Vec3| if p.norm() < 85.0 { 10.0 } else { 0.0 };
        let mut volume = Volume::sampled(shape, frame, |p| {
            let side = 0.7 + 0.3 * p.x / p.norm().max(1.0);
            body(p) + 100.0 * side * shell(p)
        });
        let mut number = 0_u32;
        for voxel in volume.voxels.iter_mut().filter(|v| **v > 1.0) {
            number = number.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *voxel += (number >> 16) as f32 / f32::from(u16::MAX) - 0.5;
        }
        let wall = (0..volume.voxels.len()).filter(|v| {
            let index = [v % 40, v / 40 % 40, v / 1600].map(|n| n as f64);
            shell(&volume.frame.to_patient(&Vec3::from(index))) > 0.5
        });
        let wall = wall.collect();
        (volume, wall)
    }

    fn changed(change: impl Fn(f32) -> f32) -> (Volume, Vec<usize>) {
        let (mut volume, wall) = scan();
        volume.voxels.iter_mut().for_each(|v| *v = change(*v));
        (volume, wall)
    }

    #[test]
    fn values_that_were_cut_off_are_told_whatever_their_unit() {
        for unit in [1.0, 4095.0 / 110.0, 1e-4] {
            for limit in [95.0_f32, 80.0, 60.0] {
                let (volume, wall) = changed(|v| v.min(limit) * unit);
                let found = saturation(&wall, &volume).unwrap();
                assert!((found.value / (limit * unit) - 1.0).abs() < 1e-6);
                assert!(found.share > SATURATED_SHARE && found.share < 1.0);
            }
            let (volume, wall) = changed(|v| v * unit);
            assert_eq!(saturation(&wall, &volume), None);
        }
        // As whole numbers of few counts, and beside cut-off organs.
        for greatest in [1000.0, 255.0, 100.0, 30.0, 15.0] {
            let (volume, wall) = changed(|v| (v / 112.0 * greatest).round());
            assert_eq!(saturation(&wall, &volume), None, "{greatest}");
        }
        let (mut volume, wall) = scan();
        let inside: BTreeSet<usize> = wall.iter().copied().collect();
        for v in (0..4000).filter(|v| !inside.contains(v)) {
            volume.voxels[v] = 300.0;
        }
        assert_eq!(saturation(&wall, &volume), None);
        volume.voxels.fill(f32::NAN);
        assert_eq!(saturation(&wall, &volume), None);
        assert_eq!(saturation(&[], &volume), None);
    }

    #[test]
    fn a_background_below_zero_or_far_above_is_told() {
        let uptake = 95.0;
        let mean = {
            let (volume, _) = scan();
            volume.voxels.iter().sum::<f32>() / volume.voxels.len() as f32
        };
        let deviation = 20.0;
        for (name, change, wall) in [
            (
                "-1..1",
                &(|v: f32| v / 55.0 - 1.0) as &dyn Fn(f32) -> f32,
                95.0 / 55.0 - 1.0,
            ),
            (
                "z-scores",
                &|v| (v - mean) / deviation,
                f64::from((95.0 - mean) / deviation),
            ),
            ("an offset", &|v| v - 300.0, 95.0 - 300.0),
            ("a small offset", &|v| v - 3.0, 92.0),
            ("padding", &|v| if v < 1e-6 { -1024.0 } else { v }, 95.0),
        ] {
            let (volume, _) = changed(change);
            let found = background(&volume, wall).unwrap_or_else(|| panic!("{name}"));
            assert!(
                found.value < 0.0 && found.of_uptake < 0.0 && found.negative > 0.1,
                "{name}: {found:?}"
            );
        }
        for (name, change) in [
            ("counts", &(|v: f32| v) as &dyn Fn(f32) -> f32),
            ("another unit", &|v| v * 1e-4),
            ("a dim offset", &|v| v + 5.0),
            ("missing", &|v| if v < 1e-6 { f32::NAN } else { v }),
        ] {
            let (volume, _) = changed(change);
            let scale = if name == "another unit" { 1e-4 } else { 1.0 };
            assert_eq!(background(&volume, scale * uptake), None, "{name}");
        }
        let (raised, _) = changed(|v| v + 1024.0);
        let found = background(&raised, uptake + 1024.0).unwrap();
        assert!(found.value > 1000.0 && found.of_uptake > RAISED_SHARE && found.negative == 0.0);
        // Filtered backprojection: noise about zero in the air, and a few streaks below.
        let (mut volume, _) = scan();
        let mut number = 1_u32;
        for (n, v) in volume.voxels.iter_mut().enumerate() {
            number = number.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *v += 12.0 * (f32::from((number >> 16) as u16) / f32::from(u16::MAX) - 0.5);
            if n % 17 == 0 {
                *v -= 15.0;
            }
        }
        assert_eq!(background(&volume, uptake), None);
    }

    #[test]
    fn damaged_voxels_of_the_wall_are_named() {
        let (volume, wall) = scan();
        assert_eq!(hot_voxels(&wall, &volume), None);
        for times in [2.5, 1e6] {
            let mut damaged = volume.clone();
            let brightest = wall
                .iter()
                .copied()
                .max_by(|a, b| volume.voxels[*a].total_cmp(&volume.voxels[*b]))
                .unwrap();
            damaged.voxels[brightest] *= times;
            let found = hot_voxels(&wall, &damaged).unwrap();
            assert_eq!(found.count, 1);
            assert_eq!(
                found.index,
                [brightest % 40, brightest / 40 % 40, brightest / 1600]
            );
            assert_eq!(found.value, damaged.voxels[brightest]);
        }
    }
}
