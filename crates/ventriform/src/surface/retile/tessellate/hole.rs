//! Closes the hole that a removed vertex leaves.
//!
//! In: the mesh, the star of the vertex and the demands on new triangles. Out: the triangles that
//! close the hole, or what prevents it.
//!
//! 1. As in the paper, the ring of neighbours is triangulated in the plane perpendicular to the
//!    star's mean normal (constrained Delaunay), if its projection is a simple polygon.
//! 2. At rims and thin walls it is not, and a triangulation in the plane may need an edge that
//!    exists already. Then dynamic programming over the ring finds the best of all
//!    triangulations in space (after Barequet and Sharir 1995) without forbidden chords and
//!    triangles. Triangles that turn out to intersect others are forbidden and it is repeated.

use std::collections::{BTreeMap, BTreeSet};

use super::patchwork::{Patchwork, Star};
use super::planar::constrained_delaunay;
use crate::base::geometry::{Vec2, Vec3, triangle};
use crate::mesh::intersections::triangles_intersect;
use crate::mesh::{FaceId, VertexId};

/// Conditions of a new triangle, besides intersecting no others and keeping the topology.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Demand {
    /// It faces as the old star did, and its dihedral angles are at most 120°.
    Smooth,
    /// Nothing else.
    Embedded,
}

/// Smallest cosine between the normals of a new triangle and of the old star.
const MIN_FACING: f64 = 0.05;

/// Cosine of the largest dihedral angle between a new triangle and one outside the hole.
const MIN_DIHEDRAL_COSINE: f64 = -0.5;

/// Longest ring for the dynamic programming, which takes its third power.
const LONGEST_RING: usize = 32;

/// Most repetitions of the dynamic programming.
const MAX_RETRIES: usize = 24;

/// A triangle of a hole: places k < l < m in the ring.
type RingTriangle = [u32; 3];

/// Why a hole could not be closed. Another attempt fails as well as long as neither its ring nor
/// these triangles change.
#[derive(Debug)]
pub(super) struct Blocked {
    /// For each proposed triangle that intersected others, one of these.
    pub(super) by: Vec<FaceId>,
}

/// The triangles that close the hole of `star` under `demand`.
pub(super) fn close(
    mesh: &Patchwork,
    star: &Star,
    demand: Demand,
) -> Result<Vec<[VertexId; 3]>, Blocked> {
    let hole = Hole::new(mesh, star, demand);
    if let Some(flat) = hole.flat_triangulation()
        && hole.admits_all(&flat)
        && hole.intersecting(&flat, &mut BTreeMap::new()).is_empty()
    {
        return Ok(hole.vertices_of(&flat));
    }
    hole.best_triangulation()
}

struct Hole<'a> {
    mesh: &'a Patchwork,
    star: &'a Star,
    demand: Demand,
    /// Positions of the ring, mm.
    corners: Vec<Vec3>,
    /// Unit mean normal of the star.
    normal: Vec3,
    /// Unit normal of the triangle outside ring edge k, k + 1.
    outer: Vec<Vec3>,
}

impl<'a> Hole<'a> {
    fn new(mesh: &'a Patchwork, star: &'a Star, demand: Demand) -> Self {
        let unit = |n: Vec3| n.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
        let area_normal = |t: FaceId| {
            let [a, b, c] = mesh.corners(mesh.triangle(t));
            triangle::area_normal(&a, &b, &c)
        };
        let k = star.ring.len();
        Self {
            mesh,
            star,
            demand,
            corners: star.ring.iter().map(|&v| mesh.position(v)).collect(),
            normal: unit(star.triangles.iter().map(|&t| area_normal(t)).sum()),
            outer: (0..k)
                .map(|i| {
                    mesh.triangle_along(star.ring[(i + 1) % k], star.ring[i])
                        .map_or_else(Vec3::zeros, |(t, _)| unit(area_normal(t)))
                })
                .collect(),
        }
    }

    /// The vertices of triangles that are given by places in the ring.
    fn vertices_of(&self, triangles: &[RingTriangle]) -> Vec<[VertexId; 3]> {
        let vertices = |t: &RingTriangle| t.map(|k| self.star.ring[k as usize]);
        triangles.iter().map(vertices).collect()
    }

    /// The triangulation in the plane, if the ring's projection is a simple polygon.
    fn flat_triangulation(&self) -> Option<Vec<RingTriangle>> {
        let n = &self.normal;
        let across = Vec3::ith(n.iamin(), 1.0).cross(n).try_normalize(0.0)?;
        let along = n.cross(&across);
        let centre = self.corners[0];
        let scale = self
            .corners
            .iter()
            .map(|p| (p - centre).norm())
            .fold(0.0, f64::max);
        let flat: Vec<Vec2> = self
            .corners
            .iter()
            .map(|p| Vec2::new(across.dot(&(p - centre)), along.dot(&(p - centre))) / scale)
            .collect();
        constrained_delaunay(&flat, flat.len()).ok()
    }

    /// Whether all chords and triangles are allowed, apart from intersections.
    fn admits_all(&self, triangles: &[RingTriangle]) -> bool {
        triangles.iter().all(|t| {
            let mut sorted = t.map(|k| k as usize);
            sorted.sort_unstable();
            let [i, k, j] = sorted;
            self.admits_chord(i, k)
                && self.admits_chord(k, j)
                && self.admits_chord(i, j)
                && self.cost(i, k, j, Demand::Smooth).is_some()
        })
    }

    /// Whether i, j (i < j) is a side of the hole or an edge that the mesh does not have yet.
    fn admits_chord(&self, i: usize, j: usize) -> bool {
        let k = self.star.ring.len();
        j == i + 1
            || (i == 0 && j == k - 1)
            || !self.mesh.has_edge(self.star.ring[i], self.star.ring[j])
    }

    /// The cost of the triangle i < k < j: its shape, and the angles between its normal and those
    /// of the star and of the triangles outside. `None` if `demand` forbids it.
    fn cost(&self, i: usize, k: usize, j: usize, demand: Demand) -> Option<f64> {
        let [a, b, c] = [i, k, j].map(|m| self.corners[m]);
        let n = triangle::area_normal(&a, &b, &c);
        let size = n.norm();
        if !(size > 0.0) {
            return None;
        }
        let n = n / size;
        let facing = n.dot(&self.normal);
        let last = self.corners.len() - 1;
        let sides = [
            (k == i + 1).then_some(i),
            (j == k + 1).then_some(k),
            (i == 0 && j == last).then_some(last),
        ];
        let mut turned = 2.0 * (1.0 - facing);
        let mut sharpest = 1.0f64;
        for side in sides.into_iter().flatten() {
            let cosine = n.dot(&self.outer[side]);
            sharpest = sharpest.min(cosine);
            turned += 1.0 - cosine;
        }
        if demand == Demand::Smooth && (facing < MIN_FACING || sharpest < MIN_DIHEDRAL_COSINE) {
            return None;
        }
        Some(1.0 / triangle::radius_ratio(&a, &b, &c).max(0.05) + 2.0 * turned)
    }

    /// The proposed triangles that intersect the mesh or an earlier one of the proposal. `known`
    /// keeps, for every triangle tested, the triangle of the mesh that it intersects.
    fn intersecting(
        &self,
        triangles: &[RingTriangle],
        known: &mut BTreeMap<RingTriangle, Option<FaceId>>,
    ) -> Vec<RingTriangle> {
        let proposed = self.vertices_of(triangles);
        if self.closes_a_tetrahedron(&proposed) {
            return triangles.to_vec();
        }
        let intersects_earlier = |k: usize| {
            let corners = self.mesh.corners(proposed[k]);
            proposed[..k].iter().any(|other| {
                triangles_intersect(proposed[k], &corners, *other, &self.mesh.corners(*other))
            })
        };
        let first_in_mesh = |k: usize| {
            self.mesh
                .first_intersecting(proposed[k], &self.star.triangles)
        };
        (0..proposed.len())
            .filter(|&k| {
                let in_mesh = known
                    .entry(triangles[k])
                    .or_insert_with(|| first_in_mesh(k));
                in_mesh.is_some() || intersects_earlier(k)
            })
            .map(|k| triangles[k])
            .collect()
    }

    /// Whether the vertex, its three neighbours and the triangles between them are the whole
    /// component. Closing the hole would leave two triangles with the same vertices.
    fn closes_a_tetrahedron(&self, proposed: &[[VertexId; 3]]) -> bool {
        let [[a, b, c]] = *proposed else { return false };
        self.mesh
            .triangle_along(b, a)
            .is_some_and(|(_, third)| third == c)
    }

    /// The cheapest triangulation in space without intersections.
    fn best_triangulation(&self) -> Result<Vec<[VertexId; 3]>, Blocked> {
        if self.corners.len() > LONGEST_RING {
            return Err(Blocked { by: Vec::new() });
        }
        let (mut forbidden, mut known) = (BTreeSet::new(), BTreeMap::new());
        let table = self.cost_table();
        for _ in 0..MAX_RETRIES {
            let cheapest = cheapest(self.corners.len(), |i, k, j| {
                let t = [i, k, j].map(|m| m as u32);
                table[self.place(i, k, j)].filter(|_| !forbidden.contains(&t))
            });
            let Some(triangles) = cheapest else { break };
            let intersecting = self.intersecting(&triangles, &mut known);
            if intersecting.is_empty() {
                return Ok(self.vertices_of(&triangles));
            }
            forbidden.extend(intersecting);
        }
        let mut by: Vec<FaceId> = known.into_values().flatten().collect();
        by.sort_unstable();
        by.dedup();
        Err(Blocked { by })
    }

    fn place(&self, i: usize, k: usize, j: usize) -> usize {
        (i * self.corners.len() + k) * self.corners.len() + j
    }

    /// The cost of every triangle i < k < j; `None` if forbidden.
    fn cost_table(&self) -> Vec<Option<f64>> {
        let m = self.corners.len();
        let mut chord = vec![true; m * m];
        for i in 0..m {
            for j in i + 2..m {
                chord[i * m + j] = self.admits_chord(i, j);
            }
        }
        let mut table = vec![None; m * m * m];
        for i in 0..m {
            for k in i + 1..m {
                for j in k + 1..m {
                    if chord[i * m + k] && chord[k * m + j] && chord[i * m + j] {
                        table[self.place(i, k, j)] = self.cost(i, k, j, self.demand);
                    }
                }
            }
        }
        table
    }
}

/// The cheapest triangulation of a ring of `m` corners; `cost` is that of the triangle i < k < j,
/// or `None` if it is forbidden. Takes O(m³).
fn cheapest(
    m: usize,
    cost: impl Fn(usize, usize, usize) -> Option<f64>,
) -> Option<Vec<RingTriangle>> {
    let mut least = vec![0.0f64; m * m];
    let mut through = vec![0usize; m * m];
    for span in 2..m {
        for i in 0..m - span {
            let j = i + span;
            let mut best = (f64::INFINITY, 0);
            for k in i + 1..j {
                let parts = least[i * m + k] + least[k * m + j];
                if parts < best.0
                    && let Some(price) = cost(i, k, j)
                    && parts + price < best.0
                {
                    best = (parts + price, k);
                }
            }
            (least[i * m + j], through[i * m + j]) = best;
        }
    }
    if !least[m - 1].is_finite() {
        return None;
    }
    let mut triangles = Vec::with_capacity(m - 2);
    let mut open = vec![(0, m - 1)];
    while let Some((i, j)) = open.pop() {
        if j > i + 1 {
            let k = through[i * m + j];
            triangles.push([i, k, j].map(|m| m as u32));
            open.extend([(i, k), (k, j)]);
        }
    }
    Some(triangles)
}

#[cfg(test)]
mod tests;
