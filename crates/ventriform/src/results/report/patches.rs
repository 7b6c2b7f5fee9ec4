//! Upper bounds of the distance of small triangles to a surface, by the surface's triangles above and below them.
//!
//! In: a surface, and a cell: a triangle about as small as the surface's own. Out: whether connected triangles of the
//! surface, projected onto the cell's plane, cover all of the cell, each within a distance of that plane ([`Patches::cover`]).
//! Then every point of the cell has a point of the surface straight above or below it that is no farther.
//!
//! 1. Starting from one triangle, each is cut by the planes that stand on the cell's sides.
//! 2. What is left adds its projected area; its corners, where it lies farthest from the plane, are compared with the
//!    distance.
//! 3. Its neighbours follow, until the cell's area is covered.
//!
//! Guaranteed: where the answer is yes, no point of the cell is farther from the surface than the distance, up to rounding.
//! All triangles that count face as the cell does and are connected, so they overlap only where the surface folds
//! back, which a triangle that does not face so ends.

use crate::base::geometry::{Vec3, triangle};
use crate::mesh::TriMesh;

/// Most triangles that are looked at for one cell.
const MOST_TRIANGLES: usize = 32;
/// Longest side of a cell for which patches are tried, in sides of the surface's mean triangle.
const LONGEST_SIDE: f64 = 2.0;
/// Share of a cell's area that rounding may miss.
const AREA_ROUNDING: f64 = 1e-9;
/// Corners of a triangle that was cut by three planes, at most; a corner more for each.
const MOST_CORNERS: usize = 6;

/// The triangles of a surface with their neighbours.
pub(super) struct Patches<'a> {
    surface: &'a TriMesh,
    /// The triangle across each side, which begins at the corner of its number; none at a border.
    across: Vec<[Option<u32>; 3]>,
    longest_mm: f64,
}

impl<'a> Patches<'a> {
    /// The neighbours of all triangles of `surface`.
    pub(super) fn new(surface: &'a TriMesh) -> Self {
        let count = surface.triangles.len();
        let mut sides: Vec<([u32; 2], u32, usize)> = Vec::with_capacity(3 * count);
        for (t, corners) in (0u32..).zip(&surface.triangles) {
            for side in 0..3 {
                let (a, b) = (corners[side], corners[(side + 1) % 3]);
                sides.push(([a.min(b), a.max(b)], t, side));
            }
        }
        sides.sort_unstable();
        let mut across = vec![[None; 3]; count];
        for shared in sides.chunk_by(|a, b| a.0 == b.0) {
            if let [(_, s, of_s), (_, t, of_t)] = shared {
                across[*s as usize][*of_s] = Some(*t);
                across[*t as usize][*of_t] = Some(*s);
            }
        }
        // The side of an equilateral triangle of the mean area.
        let side_mm = (4.0 / 3f64.sqrt() * surface.area() / count.max(1) as f64).sqrt();
        Self {
            surface,
            across,
            longest_mm: LONGEST_SIDE * side_mm,
        }
    }

    /// Whether triangles connected with `start` lie over or under all of the cell, none farther from its plane than `limit`.
    pub(super) fn cover(&self, cell: &[Vec3; 3], start: u32, limit: f64) -> bool {
        let sides = [0, 1, 2].map(|k| cell[(k + 1) % 3] - cell[k]);
        if sides.iter().any(|side| side.norm() > self.longest_mm) {
            return false;
        }
        let doubled = sides[0].cross(&sides[1]);
        let Some(normal) = doubled.try_normalize(0.0) else {
            return false;
        };
        let inward = sides.map(|side| normal.cross(&side));
        let wanted = doubled.norm() * (1.0 - AREA_ROUNDING);
        let mut patch = Vec::with_capacity(MOST_TRIANGLES);
        patch.push(start);
        let (mut next, mut covered) = (0, 0.0);
        while let Some(&t) = patch.get(next) {
            next += 1;
            let corners = self.surface.corners(t as usize);
            let [a, b, c] = &corners;
            if triangle::area_normal(a, b, c).dot(&normal) <= 0.0 {
                return false;
            }
            let left = Polygon::of(&corners).cut(cell, &inward);
            let left = left.corners();
            // The nearest triangle may lie beside the cell: its neighbours need not.
            if left.len() < 3 && t != start {
                continue;
            }
            if !left
                .iter()
                .all(|p| normal.dot(&(p - cell[0])).abs() <= limit)
            {
                return false;
            }
            covered += (2..left.len())
                .map(|k| {
                    (left[k - 1] - left[0])
                        .cross(&(left[k] - left[0]))
                        .dot(&normal)
                })
                .sum::<f64>();
            if covered >= wanted {
                return true;
            }
            for other in self.across[t as usize].into_iter().flatten() {
                if !patch.contains(&other) {
                    if patch.len() == MOST_TRIANGLES {
                        return false;
                    }
                    patch.push(other);
                }
            }
        }
        false
    }
}

/// A convex polygon, what is left of a triangle.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [Vec3; MOST_CORNERS],
    count: usize,
}

impl Polygon {
    const NONE: Self = Self {
        corners: [Vec3::new(0.0, 0.0, 0.0); MOST_CORNERS],
        count: 0,
    };

    fn of(corners: &[Vec3; 3]) -> Self {
        let mut own = Self::NONE;
        corners.iter().for_each(|corner| own.push(*corner));
        own
    }

    fn push(&mut self, corner: Vec3) {
        // Rounding makes no polygon of more corners than planes and sides together.
        if self.count < MOST_CORNERS {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }

    fn corners(&self) -> &[Vec3] {
        &self.corners[..self.count]
    }

    /// What lies inward of the planes through the cell's corners with these normals (Sutherland and Hodgman 1974).
    fn cut(mut self, cell: &[Vec3; 3], inward: &[Vec3; 3]) -> Self {
        for (corner, normal) in cell.iter().zip(inward) {
            let height = |p: &Vec3| normal.dot(&(p - corner));
            let mut left = Self::NONE;
            for k in 0..self.count {
                let (p, q) = (self.corners[k], self.corners[(k + 1) % self.count]);
                let (here, there) = (height(&p), height(&q));
                if here >= 0.0 {
                    left.push(p);
                }
                if (here > 0.0 && there < 0.0) || (here < 0.0 && there > 0.0) {
                    left.push(p + (q - p) * (here / (here - there)));
                }
            }
            self = left;
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::bvh::Bvh;
    use crate::mesh::shapes;

    /// Where patches cover a cell within a distance, no point of the cell is farther: by samples.
    #[test]
    fn a_covered_cell_is_nowhere_farther_than_the_limit() {
        let surface = shapes::icosphere(20.0, 3);
        let tree = Bvh::new(&surface.vertices, &surface.triangles);
        let patches = Patches::new(&surface);
        let mut model = shapes::icosphere(20.2, 3);
        for (n, p) in model.vertices.iter_mut().enumerate() {
            *p *= 1.0 + 0.01 * (n as f64 * 1.7).sin();
        }
        let mut answers = [0, 0];
        for limit in [0.2, 0.35, 0.5, 0.8] {
            for t in 0..model.triangles.len() {
                let cell = model.corners(t);
                let start = tree.closest(&cell[0]).unwrap().triangle;
                let covered = patches.cover(&cell, start, limit);
                answers[usize::from(covered)] += 1;
                let samples = (0..=8).flat_map(|i| (0..=8 - i).map(move |j| (i, j)));
                let farthest = samples
                    .map(|(i, j)| {
                        let [u, v] = [i, j].map(|n| f64::from(n) / 8.0);
                        let p = cell[0] * (1.0 - u - v) + cell[1] * u + cell[2] * v;
                        tree.closest(&p).unwrap().squared_distance.sqrt()
                    })
                    .fold(0.0, f64::max);
                assert!(!covered || farthest <= limit + 1e-9, "{farthest} {limit}");
            }
        }
        assert!(answers.iter().all(|count| *count > 300), "{answers:?}");
    }

    #[test]
    fn a_cell_that_hangs_over_a_border_is_not_covered() {
        let mut surface = shapes::icosphere(20.0, 3);
        surface.triangles.truncate(200);
        let tree = Bvh::new(&surface.vertices, &surface.triangles);
        let patches = Patches::new(&surface);
        let away = surface
            .vertices
            .iter()
            .map(|p| p * 1.001)
            .collect::<Vec<_>>();
        for triangle in &shapes::icosphere(20.0, 3).triangles[200..] {
            let cell = triangle.map(|v| away[v as usize]);
            let start = tree.closest(&cell[0]).unwrap().triangle;
            assert!(!patches.cover(&cell, start, 1.0));
        }
    }
}
