//! Closing the hole that a vertex leaves.
//!
//! The paper triangulates the ring of neighbours in a plane: constrained Delaunay in the plane
//! across the star's mean normal, wherever the ring's projection is simple. On rims and thin
//! walls it is not; and a flat triangulation may ask for an edge that exists already. There a
//! dynamic programme over the ring takes the best of all triangulations in space (after
//! Barequet & Sharir 1995), with the forbidden chords and triangles left out.

use std::collections::{BTreeMap, BTreeSet};

use super::patchwork::{Patchwork, Star};
use super::planar::constrained_delaunay;
use crate::geometry::{Vec2, Vec3, triangle};
use crate::mesh::intersections::triangles_intersect;

/// What a new triangle must satisfy besides piercing nothing and keeping the mesh a manifold of
/// its kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Demand {
    /// It faces as the surface did and folds nowhere by more than 120°.
    Smooth,
    /// Nothing more.
    Embedded,
}

/// Cosine under which a new triangle has turned away from the old star.
const LEAST_FACING: f64 = 0.05;

/// Cosine of the sharpest fold against a triangle outside of the hole.
const SHARPEST_FOLD: f64 = -0.5;

/// Longest ring for the dynamic programme, which takes the third power of it.
const LONGEST_RING: usize = 32;

/// Most times that the programme is run again without the triangles that pierced something.
const MOST_RETRIES: usize = 24;

/// Why a hole stays open: nothing around it, and these triangles. As long as neither changes,
/// another try fails as well.
#[derive(Debug)]
pub(super) struct Blocked {
    /// One triangle that each pierced proposal met.
    pub(super) by: Vec<u32>,
}

/// The triangles that close the hole of `star` under `demand`.
pub(super) fn close(
    mesh: &Patchwork,
    star: &Star,
    demand: Demand,
) -> Result<Vec<[u32; 3]>, Blocked> {
    let hole = Hole::new(mesh, star, demand);
    if let Some(flat) = hole.flat_triangulation()
        && hole.admits_all(&flat)
        && hole.offenders(&flat, &mut BTreeMap::new()).is_empty()
    {
        return Ok(hole.named(&flat));
    }
    hole.best_triangulation()
}

struct Hole<'a> {
    mesh: &'a Patchwork,
    star: &'a Star,
    demand: Demand,
    corners: Vec<Vec3>,
    /// Unit mean normal of the star.
    normal: Vec3,
    /// Unit normal of the triangle outside of ring edge k, k + 1.
    outer: Vec<Vec3>,
}

impl<'a> Hole<'a> {
    fn new(mesh: &'a Patchwork, star: &'a Star, demand: Demand) -> Self {
        let unit = |n: Vec3| n.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
        let area_normal = |t: u32| {
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

    fn named(&self, triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
        let name = |t: &[u32; 3]| t.map(|k| self.star.ring[k as usize]);
        triangles.iter().map(name).collect()
    }

    /// The paper's way, where it works.
    fn flat_triangulation(&self) -> Option<Vec<[u32; 3]>> {
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

    fn admits_all(&self, triangles: &[[u32; 3]]) -> bool {
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

    /// Whether i, j (i < j) is a side of the hole, or an edge that the mesh has not yet.
    fn admits_chord(&self, i: usize, j: usize) -> bool {
        let k = self.star.ring.len();
        j == i + 1
            || (i == 0 && j == k - 1)
            || !self.mesh.has_edge(self.star.ring[i], self.star.ring[j])
    }

    /// What the triangle i < k < j costs: shape, and how far it turns from the star and the
    /// triangles outside. `None` where the demand forbids it.
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
            let fold = n.dot(&self.outer[side]);
            sharpest = sharpest.min(fold);
            turned += 1.0 - fold;
        }
        if demand == Demand::Smooth && (facing < LEAST_FACING || sharpest < SHARPEST_FOLD) {
            return None;
        }
        Some(1.0 / triangle::radius_ratio(&a, &b, &c).max(0.05) + 2.0 * turned)
    }

    /// The triangles of the proposal that pierce the mesh or an earlier one of the proposal.
    /// `pierced` remembers what the mesh answered.
    fn offenders(
        &self,
        triangles: &[[u32; 3]],
        pierced: &mut BTreeMap<[u32; 3], Option<u32>>,
    ) -> Vec<[u32; 3]> {
        let named = self.named(triangles);
        if self.closes_a_tetrahedron(&named) {
            return triangles.to_vec();
        }
        let meets_earlier = |k: usize| {
            let corners = self.mesh.corners(named[k]);
            named[..k].iter().any(|other| {
                triangles_intersect(named[k], &corners, *other, &self.mesh.corners(*other))
            })
        };
        (0..named.len())
            .filter(|&k| {
                pierced
                    .entry(triangles[k])
                    .or_insert_with(|| self.mesh.first_pierced(named[k], &self.star.triangles))
                    .is_some()
                    || meets_earlier(k)
            })
            .map(|k| triangles[k])
            .collect()
    }

    /// Three neighbours and one vertex more, and that is the whole component: closing the hole
    /// would glue two triangles back to back.
    fn closes_a_tetrahedron(&self, named: &[[u32; 3]]) -> bool {
        let [[a, b, c]] = *named else { return false };
        self.mesh
            .triangle_along(b, a)
            .is_some_and(|(_, third)| third == c)
    }

    /// The cheapest triangulation in space that pierces nothing.
    fn best_triangulation(&self) -> Result<Vec<[u32; 3]>, Blocked> {
        if self.corners.len() > LONGEST_RING {
            return Err(Blocked { by: Vec::new() });
        }
        let (mut forbidden, mut pierced) = (BTreeSet::new(), BTreeMap::new());
        let table = self.cost_table();
        for _ in 0..MOST_RETRIES {
            let cheapest = cheapest(self.corners.len(), |i, k, j| {
                let t = [i, k, j].map(|m| m as u32);
                table[self.place(i, k, j)].filter(|_| !forbidden.contains(&t))
            });
            let Some(triangles) = cheapest else { break };
            let offenders = self.offenders(&triangles, &mut pierced);
            if offenders.is_empty() {
                return Ok(self.named(&triangles));
            }
            forbidden.extend(offenders);
        }
        let mut by: Vec<u32> = pierced.into_values().flatten().collect();
        by.sort_unstable();
        by.dedup();
        Err(Blocked { by })
    }

    fn place(&self, i: usize, k: usize, j: usize) -> usize {
        (i * self.corners.len() + k) * self.corners.len() + j
    }

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

/// The cheapest triangulation of a ring of `m` corners, where `cost` prices the triangle
/// i < k < j or forbids it. O(m³).
fn cheapest(m: usize, cost: impl Fn(usize, usize, usize) -> Option<f64>) -> Option<Vec<[u32; 3]>> {
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
mod tests {
    use super::*;

    /// All triangulations of a convex polygon, by brute force.
    fn brute_force(i: usize, j: usize, cost: &dyn Fn(usize, usize, usize) -> Option<f64>) -> f64 {
        if j < i + 2 {
            return 0.0;
        }
        (i + 1..j)
            .filter_map(|k| {
                Some(cost(i, k, j)? + brute_force(i, k, cost) + brute_force(k, j, cost))
            })
            .fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn the_programme_finds_the_cheapest_triangulation() {
        for seed in 0..40usize {
            let m = 3 + seed % 7;
            let cost = move |i: usize, k: usize, j: usize| {
                let mixed = (i * 7919 + k * 104_729 + j * 1_299_709 + seed * 15_485_863) % 97;
                (mixed > 15).then_some(mixed as f64)
            };
            let expected = brute_force(0, m - 1, &cost);
            match cheapest(m, cost) {
                None => assert!(expected.is_infinite()),
                Some(triangles) => {
                    assert_eq!(triangles.len(), m - 2);
                    let sum: f64 = triangles
                        .iter()
                        .map(|t| {
                            let [i, k, j] = t.map(|v| v as usize);
                            cost(i, k, j).unwrap()
                        })
                        .sum();
                    assert_eq!(sum, expected);
                }
            }
        }
    }
}
