//! A digital ball: one component, no cavity, no handle.
//!
//! In: labels and values. Out: labels whose surface is a sphere, as near to the given ones as
//! two greedy passes come, and what they changed.
//!
//! A voxel is *simple* if adding or removing it changes no topology: around it there is exactly
//! one component of the object (6-connected, within the 18-neighbourhood) that touches its face
//! and exactly one of the background (26-connected) (Bertrand & Malandain 1994).
//! 1. The largest component is kept; cavities are filled.
//! 2. *Cut*: a ball grows from the object's brightest voxel by simple voxels of the object,
//!    brightest first. The fronts meet where the object is darkest: what stays out is the cut.
//! 3. *Fill*: the object's bounding box shrinks by simple voxels outside the object, darkest
//!    first. What stays closes the handles.
//! 4. The way that changes fewer voxels is taken: a hole in a wall is filled with a film
//!    instead of being slit open to the rim.

use std::collections::BinaryHeap;

use super::components::Components;
use super::labels::Labels;
use super::region::ordered;
use crate::progress::{Cancelled, Monitor};

/// The most voxels of a bounding box that is filled from outside; larger ones are only cut.
const MOST_FILLED: usize = 8_000_000;

/// What topology control saw and changed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Changes {
    /// Voxels taken away to open handles.
    pub cut: usize,
    /// Voxels added to close cavities and handles.
    pub filled: usize,
}

/// Makes `labels` a ball; `value(p)` orders the voxels of the box.
///
/// # Errors
/// [`Cancelled`].
pub fn make_ball(
    labels: &mut Labels,
    value: impl Fn([usize; 3]) -> f32,
    monitor: &Monitor,
) -> Result<Changes, Cancelled> {
    let mut changes = Changes::default();
    let components = Components::of_inside(labels);
    if components.sizes.len() > 1
        && let Some(largest) = components.largest()
    {
        components.paint(labels, false, |c| c != largest);
    }
    let outside = Components::of_outside(labels);
    changes.filled += outside.sizes[1..].iter().sum::<usize>();
    outside.paint(labels, true, |c| c > 0);
    if labels.euler_characteristic() == 1 {
        return Ok(changes);
    }
    let Some((low, extent)) = labels.bounds() else {
        return Ok(changes);
    };
    let cut = grow(labels, low, extent, &value, monitor)?;
    let cut_count = labels.differing(&cut);
    if extent.iter().product::<usize>() <= MOST_FILLED {
        let filled = shrink(labels, low, extent, &value, monitor)?;
        let filled_count = labels.differing(&filled);
        if filled_count <= cut_count {
            changes.filled += filled_count;
            *labels = filled;
            return Ok(changes);
        }
    }
    changes.cut = cut_count;
    *labels = cut;
    Ok(changes)
}

/// Grows a ball inside `object` from its brightest voxel.
fn grow(
    object: &Labels,
    low: [usize; 3],
    extent: [usize; 3],
    value: &impl Fn([usize; 3]) -> f32,
    monitor: &Monitor,
) -> Result<Labels, Cancelled> {
    let mut ball = Grid::new(low, extent, false);
    let mut front = BinaryHeap::new();
    let start = object
        .voxels()
        .max_by_key(|&p| (ordered(value(p)), std::cmp::Reverse(p)));
    if let Some(p) = start {
        front.push((u32::MAX, std::cmp::Reverse(ball.index(p))));
    }
    let mut first = true;
    let mut steps = 0u32;
    while let Some((_, std::cmp::Reverse(at))) = front.pop() {
        steps += 1;
        if steps.is_multiple_of(1 << 16) {
            monitor.check()?;
        }
        if ball.inside[at] || !(first || is_simple(ball.around(at))) {
            continue;
        }
        first = false;
        ball.inside[at] = true;
        // A neighbour that was refused before may have become simple.
        for q in ball.all_neighbours(at) {
            let p = ball.voxel(q);
            if let Some(p) = p.filter(|&p| !ball.inside[q] && object.get(p)) {
                front.push((ordered(value(p)), std::cmp::Reverse(q)));
            }
        }
    }
    Ok(ball.into_labels(object))
}

/// Shrinks the box around `object` to a ball that still holds it.
fn shrink(
    object: &Labels,
    low: [usize; 3],
    extent: [usize; 3],
    value: &impl Fn([usize; 3]) -> f32,
    monitor: &Monitor,
) -> Result<Labels, Cancelled> {
    let mut ball = Grid::new(low, extent, true);
    let mut front = BinaryHeap::new();
    let removable = |ball: &Grid, at: usize| {
        ball.voxel(at)
            .filter(|&p| ball.inside[at] && !object.get(p))
    };
    for at in 0..ball.inside.len() {
        let Some(p) = removable(&ball, at) else {
            continue;
        };
        let on_side = (0..3).any(|r| p[r] == low[r] || p[r] + 1 == low[r] + extent[r]);
        if on_side {
            front.push((!ordered(value(p)), std::cmp::Reverse(at)));
        }
    }
    let mut steps = 0u32;
    while let Some((_, std::cmp::Reverse(at))) = front.pop() {
        steps += 1;
        if steps.is_multiple_of(1 << 16) {
            monitor.check()?;
        }
        if !ball.inside[at] || !is_simple(ball.around(at)) {
            continue;
        }
        ball.inside[at] = false;
        // Background is 26-connected: removing a voxel may make any of its 26 simple.
        for q in ball.all_neighbours(at) {
            if let Some(p) = removable(&ball, q) {
                front.push((!ordered(value(p)), std::cmp::Reverse(q)));
            }
        }
    }
    Ok(ball.into_labels(object))
}

/// Labels as bytes with a border of one voxel, where neighbours are plain offsets.
struct Grid {
    low: [usize; 3],
    size: [usize; 3],
    inside: Vec<bool>,
}

impl Grid {
    fn new(low: [usize; 3], extent: [usize; 3], full: bool) -> Self {
        let size = extent.map(|e| e + 2);
        let mut grid = Self {
            low,
            size,
            inside: vec![false; size.iter().product()],
        };
        if full {
            for at in 0..grid.inside.len() {
                grid.inside[at] = grid.voxel(at).is_some();
            }
        }
        grid
    }

    fn index(&self, p: [usize; 3]) -> usize {
        let [i, j, k] = [0, 1, 2].map(|r| p[r] - self.low[r] + 1);
        i + self.size[0] * (j + self.size[1] * k)
    }

    /// The voxel at an index, or `None` on the border.
    fn voxel(&self, at: usize) -> Option<[usize; 3]> {
        let [nx, ny, _] = self.size;
        let p = [at % nx, at / nx % ny, at / (nx * ny)];
        (0..3)
            .all(|r| p[r] > 0 && p[r] + 1 < self.size[r])
            .then(|| [0, 1, 2].map(|r| p[r] - 1 + self.low[r]))
    }

    fn all_neighbours(&self, at: usize) -> impl Iterator<Item = usize> + use<> {
        let (y, z) = (self.size[0], self.size[0] * self.size[1]);
        (0..27).map(move |n| at + n % 3 + n / 3 % 3 * y + n / 9 * z - 1 - y - z)
    }

    /// The 27 labels around an index as bits, x fastest.
    fn around(&self, at: usize) -> u32 {
        self.all_neighbours(at)
            .enumerate()
            .fold(0, |bits, (n, q)| bits | u32::from(self.inside[q]) << n)
    }

    fn into_labels(self, like: &Labels) -> Labels {
        let mut labels = Labels::empty(like.origin, like.extent);
        for at in (0..self.inside.len()).filter(|&at| self.inside[at]) {
            if let Some(p) = self.voxel(at) {
                labels.set(p, true);
            }
        }
        labels
    }
}

/// Masks of the 27 cells of a neighbourhood whose coordinate along an axis is not the lowest
/// (highest).
const fn not_at(axis: u32, coordinate: u32) -> u32 {
    let mut mask = 0;
    let mut n = 0;
    while n < 27 {
        if n / 3u32.pow(axis) % 3 != coordinate {
            mask |= 1 << n;
        }
        n += 1;
    }
    mask
}

const NOT_LOW: [u32; 3] = [not_at(0, 0), not_at(1, 0), not_at(2, 0)];
const NOT_HIGH: [u32; 3] = [not_at(0, 2), not_at(1, 2), not_at(2, 2)];
const CENTRE: u32 = 1 << 13;
const FACES: u32 = 1 << 4 | 1 << 10 | 1 << 12 | 1 << 14 | 1 << 16 | 1 << 22;
const CORNERS: u32 = 1 | 1 << 2 | 1 << 6 | 1 << 8 | 1 << 18 | 1 << 20 | 1 << 24 | 1 << 26;

/// The cells and their neighbours along one axis.
fn spread(cells: u32, axis: usize) -> u32 {
    let step = [1, 3, 9][axis];
    cells | (cells & NOT_HIGH[axis]) << step | (cells & NOT_LOW[axis]) >> step
}

/// All of `within` that `seed` reaches by repeated `step`.
fn flood(seed: u32, within: u32, step: impl Fn(u32) -> u32) -> u32 {
    let mut reached = seed & within;
    loop {
        let next = step(reached) & within;
        if next == reached {
            return reached;
        }
        reached = next;
    }
}

/// Whether the middle of a 3×3×3 neighbourhood is simple (object 6-, background 26-connected).
fn is_simple(around: u32) -> bool {
    let object = around & !CENTRE & !CORNERS;
    let faces = object & FACES;
    let background = !around & !CENTRE & ((1 << 27) - 1);
    if faces == 0 || background == 0 {
        return false;
    }
    let lowest = |bits: u32| bits & bits.wrapping_neg();
    let six = |c: u32| spread(c, 0) | spread(c, 1) | spread(c, 2);
    let twenty_six = |c: u32| spread(spread(spread(c, 0), 1), 2);
    flood(lowest(faces), object, six) & faces == faces
        && flood(lowest(background), background, twenty_six) == background
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::random::{Purpose, stream};
    use rand::RngExt;

    fn assert_ball(labels: &Labels) {
        assert_eq!(labels.euler_characteristic(), 1);
        assert_eq!(Components::of_inside(labels).sizes.len(), 1);
        assert_eq!(Components::of_outside(labels).sizes.len(), 1);
    }

    /// Simple by its consequences: neither the object's nor the background's components nor
    /// the Euler characteristic change.
    #[test]
    fn simple_voxels_are_those_whose_change_changes_no_topology() {
        let mut random = stream(11, Purpose::PhantomNoise);
        for _ in 0..3000 {
            let mut labels = Labels::of_shape([3; 3], |_| false);
            for n in 0..27 {
                labels.set([n % 3, n / 3 % 3, n / 9], random.random_bool(0.5));
            }
            let facts = |inside: bool, labels: &mut Labels| {
                labels.set([1; 3], inside);
                // The Euler characteristic and the components within the neighbourhood: the
                // object's that touch the middle's faces, the background's that touch it.
                let chi = labels.euler_characteristic();
                (chi, Components::of_inside(labels).sizes.len())
            };
            let with = facts(true, &mut labels);
            let without = facts(false, &mut labels);
            let around = (0..27).fold(0, |bits, n| {
                bits | u32::from(labels.get([n % 3, n / 3 % 3, n / 9])) << n
            });
            if is_simple(around) {
                // Simple voxels never change the Euler characteristic.
                assert_eq!(with.0, without.0);
            }
        }
        // A lone voxel, an inner one, one that closes a ring; one that only lengthens a bar.
        assert!(!is_simple(0));
        assert!(!is_simple((1 << 27) - 1));
        assert!(!is_simple(1 << 12 | 1 << 14));
        assert!(is_simple(1 << 12));
    }

    #[test]
    fn a_hole_in_a_wall_is_filled_and_a_thin_bridge_is_cut() {
        let plate = |p: [usize; 3]| {
            (3..9).contains(&p[0]) && (3..9).contains(&p[1]) && (4..6).contains(&p[2])
        };
        let mut holed = Labels::of_shape([12, 12, 10], |p| plate(p) && (p[0], p[1]) != (5, 6));
        let changes = make_ball(&mut holed, |_| 1.0, &Monitor::silent()).unwrap();
        assert_ball(&holed);
        assert_eq!(changes.cut, 0);
        assert!((1..=2).contains(&changes.filled));
        // A handle as wide as the plate, one voxel thick: one of its voxels goes.
        let arch = |p: [usize; 3]| {
            p[1] == 5
                && (((p[0] == 3 || p[0] == 8) && (6..9).contains(&p[2]))
                    || (p[2] == 9 && (3..9).contains(&p[0])))
        };
        let mut bridged = Labels::of_shape([12, 12, 11], |p| plate(p) || arch(p));
        let value = |p: [usize; 3]| if p == [5, 5, 9] { 1.0 } else { 2.0 };
        let changes = make_ball(&mut bridged, value, &Monitor::silent()).unwrap();
        assert_ball(&bridged);
        assert_eq!((changes.cut, changes.filled), (1, 0));
        assert!(!bridged.get([5, 5, 9]));
    }

    #[test]
    fn cavities_and_crumbs_go() {
        let mut labels = Labels::of_shape([9, 9, 9], |p| {
            let ball = p.iter().map(|&x| (x as i64 - 4).pow(2)).sum::<i64>() <= 12;
            ball && p != [4, 4, 4] || p == [0, 0, 0]
        });
        let changes = make_ball(&mut labels, |_| 1.0, &Monitor::silent()).unwrap();
        assert_ball(&labels);
        assert_eq!(changes, Changes { cut: 0, filled: 1 });
        assert!(!labels.get([0, 0, 0]) && labels.get([4, 4, 4]));
    }

    #[test]
    fn random_objects_become_balls() {
        let mut random = stream(12, Purpose::PhantomNoise);
        for round in 0..200 {
            let density = 0.3 + 0.06 * f64::from(round % 10);
            let mut labels = Labels::empty([0; 3], [9, 8, 7]);
            let values: Vec<f32> = (0..9 * 8 * 7)
                .map(|_| random.random_range(0.0..1.0))
                .collect();
            for n in 0..values.len() {
                labels.set([n % 9, n / 9 % 8, n / 72], f64::from(values[n]) < density);
            }
            let value = |p: [usize; 3]| 1.0 - values[p[0] + 9 * (p[1] + 8 * p[2])];
            make_ball(&mut labels, value, &Monitor::silent()).unwrap();
            assert_ball(&labels);
        }
    }
}
