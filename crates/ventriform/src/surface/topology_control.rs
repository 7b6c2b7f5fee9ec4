//! A digital ball: one component, no cavity, no handle.
//!
//! In: labels and values. Out: labels whose surface is a sphere, close to the given ones (two
//! greedy passes), and the number of voxels changed.
//!
//! A voxel is *simple* if adding or removing it changes no topology: around it there is exactly
//! one component of the object (6-connected, within the 18-neighbourhood) that touches its face
//! and exactly one of the background (26-connected) (Bertrand & Malandain 1994).
//! 1. The largest component is kept; cavities are filled.
//! 2. *Cut*: a ball grows from the object's brightest voxel by simple voxels of the object,
//!    brightest first. Its fronts meet where the object is darkest: the voxels left out are the cut.
//! 3. *Fill*: the object's bounding box shrinks by simple voxels outside the object, darkest
//!    first. The voxels that remain close the handles.
//! 4. The result that changes fewer voxels is kept: a hole in a wall is filled with a thin film
//!    rather than slit open to the rim.

use std::collections::BinaryHeap;

use super::region::ordered;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::components::Components;
use crate::image::grid::labels::Labels;

/// The most voxels of a bounding box that is filled from outside; larger ones are only cut.
const MOST_FILLED: usize = 8_000_000;

/// Changes by topology control.
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
    let components = Components::of_inside(labels, monitor)?;
    if components.sizes.len() > 1
        && let Some(largest) = components.largest()
    {
        components.paint(labels, false, |c| c != largest, monitor)?;
    }
    let outside = Components::of_outside(labels, monitor)?;
    changes.filled += outside.sizes[1..].iter().sum::<usize>();
    outside.paint(labels, true, |c| c > 0, monitor)?;
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
    let mut ball = Grid::new(object, low, extent, monitor)?;
    let mut start = None;
    for p in object.voxels() {
        monitor.check()?;
        start = start.max(Some((ordered(value(p)), std::cmp::Reverse(p))));
    }
    let mut front = Front::default();
    if let Some((_, std::cmp::Reverse(p))) = start {
        // The first voxel is no neighbour of anything, hence not simple.
        let at = ball.index(p);
        ball.cells[at] |= INSIDE_BALL;
        ball.push_around(
            at,
            &mut front,
            |cell| cell & (INSIDE_BALL | INSIDE_OBJECT) == INSIDE_OBJECT,
            |p| ordered(value(p)),
        );
    }
    while let Some(at) = front.pop(&mut ball) {
        monitor.check()?;
        if ball.cells[at] & INSIDE_BALL != 0 || !is_simple(ball.around(at)) {
            continue;
        }
        ball.cells[at] |= INSIDE_BALL;
        // A neighbour that was not simple before may have become so.
        ball.push_around(
            at,
            &mut front,
            |cell| cell & (INSIDE_BALL | INSIDE_OBJECT) == INSIDE_OBJECT,
            |p| ordered(value(p)),
        );
    }
    ball.into_labels(object, monitor)
}

/// Shrinks the box around `object` to a ball that still holds it.
fn shrink(
    object: &Labels,
    low: [usize; 3],
    extent: [usize; 3],
    value: &impl Fn([usize; 3]) -> f32,
    monitor: &Monitor,
) -> Result<Labels, Cancelled> {
    let mut ball = Grid::new(object, low, extent, monitor)?;
    let mut front = Front::default();
    for at in 0..ball.cells.len() {
        monitor.check()?;
        let Some(p) = ball.voxel(at) else {
            continue;
        };
        ball.cells[at] |= INSIDE_BALL;
        let on_side = (0..3).any(|r| p[r] == low[r] || p[r] + 1 == low[r] + extent[r]);
        if on_side && ball.cells[at] & INSIDE_OBJECT == 0 {
            front.push(&mut ball, at, !ordered(value(p)));
        }
    }
    while let Some(at) = front.pop(&mut ball) {
        monitor.check()?;
        if ball.cells[at] & INSIDE_BALL == 0 || !is_simple(ball.around(at)) {
            continue;
        }
        ball.cells[at] &= !INSIDE_BALL;
        // Background is 26-connected: removing a voxel may make any of its 26 simple.
        ball.push_around(
            at,
            &mut front,
            |cell| cell & (INSIDE_BALL | INSIDE_OBJECT) == INSIDE_BALL,
            |p| !ordered(value(p)),
        );
    }
    ball.into_labels(object, monitor)
}

/// Queue of voxels by falling key, of equals the first in array order. A voxel is queued once: a
/// second test without a change in between would give the same result.
#[derive(Default)]
struct Front(BinaryHeap<(u32, std::cmp::Reverse<usize>)>);

impl Front {
    fn push(&mut self, grid: &mut Grid, at: usize, key: u32) {
        grid.cells[at] |= IN_QUEUE;
        self.0.push((key, std::cmp::Reverse(at)));
    }

    fn pop(&mut self, grid: &mut Grid) -> Option<usize> {
        let (_, std::cmp::Reverse(at)) = self.0.pop()?;
        grid.cells[at] &= !IN_QUEUE;
        Some(at)
    }
}

/// The voxel belongs to the ball.
const INSIDE_BALL: u8 = 1;
/// The voxel belongs to the given object.
const INSIDE_OBJECT: u8 = 2;
/// The voxel is in the queue.
const IN_QUEUE: u8 = 4;

/// A box of voxels as bytes with a border of one voxel, where neighbours are plain offsets.
struct Grid {
    low: [usize; 3],
    size: [usize; 3],
    cells: Vec<u8>,
}

impl Grid {
    /// The box with the object in it and an empty ball.
    fn new(
        object: &Labels,
        low: [usize; 3],
        extent: [usize; 3],
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let size = extent.map(|e| e + 2);
        let mut grid = Self {
            low,
            size,
            cells: vec![0; size.iter().product()],
        };
        for p in object.voxels() {
            monitor.check()?;
            let at = grid.index(p);
            grid.cells[at] = INSIDE_OBJECT;
        }
        Ok(grid)
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

    /// First indices of the nine rows of three around an index.
    fn rows_around(&self, at: usize) -> [usize; 9] {
        let (y, z) = (self.size[0], self.size[0] * self.size[1]);
        std::array::from_fn(|n| at + n % 3 * y + n / 3 * z - 1 - y - z)
    }

    /// The 27 labels around an index as bits, x fastest.
    fn around(&self, at: usize) -> u32 {
        let mut bits = 0;
        for (n, row) in self.rows_around(at).into_iter().enumerate() {
            for (k, cell) in self.cells[row..row + 3].iter().enumerate() {
                bits |= u32::from(cell & INSIDE_BALL) << (3 * n + k);
            }
        }
        bits
    }

    /// Queues the neighbours whose flags are `wanted`, unless they are queued already.
    fn push_around(
        &mut self,
        at: usize,
        front: &mut Front,
        wanted: impl Fn(u8) -> bool,
        key: impl Fn([usize; 3]) -> u32,
    ) {
        for row in self.rows_around(at) {
            for q in row..row + 3 {
                let cell = self.cells[q];
                if cell & IN_QUEUE == 0
                    && wanted(cell)
                    && let Some(p) = self.voxel(q)
                {
                    front.push(self, q, key(p));
                }
            }
        }
    }

    fn into_labels(self, like: &Labels, monitor: &Monitor) -> Result<Labels, Cancelled> {
        let mut labels = Labels::empty(like.origin, like.extent);
        for at in (0..self.cells.len()).filter(|&at| self.cells[at] & INSIDE_BALL != 0) {
            monitor.check()?;
            if let Some(p) = self.voxel(at) {
                labels.set(p, true);
            }
        }
        Ok(labels)
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
const CENTRE_BIT: u32 = 1 << 13;
const FACE_BITS: u32 = 1 << 4 | 1 << 10 | 1 << 12 | 1 << 14 | 1 << 16 | 1 << 22;
const CORNER_BITS: u32 = 1 | 1 << 2 | 1 << 6 | 1 << 8 | 1 << 18 | 1 << 20 | 1 << 24 | 1 << 26;

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
    let object = around & !CENTRE_BIT & !CORNER_BITS;
    let faces = object & FACE_BITS;
    let background = !around & !CENTRE_BIT & ((1 << 27) - 1);
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
    use crate::base::geometry::random::{Purpose, stream};
    use rand::RngExt;

    fn assert_ball(labels: &Labels) {
        assert_eq!(labels.euler_characteristic(), 1);
        let monitor = Monitor::silent();
        let inside = Components::of_inside(labels, &monitor).unwrap();
        assert_eq!(inside.sizes.len(), 1);
        let outside = Components::of_outside(labels, &monitor).unwrap();
        assert_eq!(outside.sizes.len(), 1);
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
                let inside = Components::of_inside(labels, &Monitor::silent()).unwrap();
                (chi, inside.sizes.len())
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

    /// The oracle: shrinking that tests a voxel again after every change of a neighbour.
    fn shrink_plainly(object: &Labels, value: impl Fn([usize; 3]) -> f32) -> Labels {
        let monitor = Monitor::silent();
        let mut ball = Grid::new(object, [0; 3], object.extent, &monitor).unwrap();
        let mut front = BinaryHeap::new();
        for at in 0..ball.cells.len() {
            if let Some(p) = ball.voxel(at) {
                ball.cells[at] |= INSIDE_BALL;
                front.push((!ordered(value(p)), std::cmp::Reverse(at)));
            }
        }
        while let Some((_, std::cmp::Reverse(at))) = front.pop() {
            if ball.cells[at] == INSIDE_BALL && is_simple(ball.around(at)) {
                ball.cells[at] = 0;
                for q in ball
                    .rows_around(at)
                    .into_iter()
                    .flat_map(|row| row..row + 3)
                {
                    if let Some(p) = ball.voxel(q) {
                        front.push((!ordered(value(p)), std::cmp::Reverse(q)));
                    }
                }
            }
        }
        ball.into_labels(object, &monitor).unwrap()
    }

    #[test]
    fn waiting_once_changes_no_outcome() {
        let mut random = stream(13, Purpose::PhantomNoise);
        for _ in 0..40 {
            let extent = [10, 9, 8];
            let values: Vec<f32> = (0..720).map(|_| random.random_range(0.0..1.0)).collect();
            let value = |p: [usize; 3]| values[p[0] + 10 * (p[1] + 9 * p[2])];
            let object = Labels::of_shape(extent, |p| value(p) > 0.7);
            let found = shrink(&object, [0; 3], extent, &value, &Monitor::silent()).unwrap();
            assert_eq!(found, shrink_plainly(&object, value));
        }
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
