//! A closed triangle mesh from which vertices are removed and in which edges are flipped.
//!
//! A half-edge structure is of no use here, since a removal replaces a whole star of triangles at
//! once. The mesh stores the triangles at every vertex instead, a spatial index to test new
//! triangles against, and a count of changes, from which a failed removal can tell whether
//! another attempt is worthwhile.

use crate::base::geometry::Vec3;
use crate::mesh::ids::typed;
use crate::mesh::intersections::IntersectionIndex;
use crate::mesh::{FaceId, VertexId};

/// The mesh between two changes: always a closed, oriented 2-manifold.
pub(super) struct Patchwork {
    pub(super) positions: Vec<Vec3>,
    /// `None` for removed triangles.
    triangles: Vec<Option<[VertexId; 3]>>,
    /// Triangles at each vertex, in no order.
    incident: Vec<Vec<FaceId>>,
    index: IntersectionIndex,
    /// Number of changes so far.
    clock: u64,
    /// The number of the last change at each vertex.
    changed: Vec<u64>,
    /// The number of the last change of each triangle.
    replaced: Vec<u64>,
}

/// The triangles around a vertex.
pub(super) struct Star {
    /// The neighbours, counter-clockwise, beginning with the lowest.
    pub(super) ring: Vec<VertexId>,
    /// Triangle k is that between neighbours k and k + 1.
    pub(super) triangles: Vec<FaceId>,
}

impl Patchwork {
    /// `triangles` must be a closed manifold; `cell` is the spacing of the index's grid, mm.
    pub(super) fn new(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>, cell: f64) -> Self {
        let mut incident = vec![Vec::with_capacity(8); positions.len()];
        for (t, triangle) in FaceId::first(triangles.len()).zip(&triangles) {
            for &v in triangle {
                incident[v as usize].push(t);
            }
        }
        let index = IntersectionIndex::new(&positions, &triangles, cell);
        Self {
            changed: vec![0; positions.len()],
            replaced: vec![0; triangles.len()],
            clock: 0,
            positions,
            triangles: triangles.into_iter().map(|t| Some(typed(t))).collect(),
            incident,
            index,
        }
    }

    pub(super) fn position(&self, v: VertexId) -> Vec3 {
        self.positions[v.index()]
    }

    /// The positions of three vertices.
    pub(super) fn corners(&self, triangle: [VertexId; 3]) -> [Vec3; 3] {
        triangle.map(|v| self.position(v))
    }

    /// The number of neighbours of `v`.
    pub(super) fn valence(&self, v: VertexId) -> usize {
        self.incident[v.index()].len()
    }

    /// The corners of triangle `t`, which must not have been removed.
    pub(super) fn triangle(&self, t: FaceId) -> [VertexId; 3] {
        self.triangles[t.index()].expect("only triangles that still exist are asked for")
    }

    /// Number of changes so far.
    pub(super) fn clock(&self) -> u64 {
        self.clock
    }

    /// The number of the last change at `v`.
    pub(super) fn changed(&self, v: VertexId) -> u64 {
        self.changed[v.index()]
    }

    /// The number of the last change of triangle `t`.
    pub(super) fn replaced(&self, t: FaceId) -> u64 {
        self.replaced[t.index()]
    }

    /// The triangles that have not been removed.
    pub(super) fn live_triangles(&self) -> impl Iterator<Item = [VertexId; 3]> {
        self.triangles.iter().copied().flatten()
    }

    /// Whether an edge joins `a` and `b`.
    pub(super) fn has_edge(&self, a: VertexId, b: VertexId) -> bool {
        let at = |v: VertexId| &self.incident[v.index()];
        let (fewer, other) = if at(a).len() <= at(b).len() {
            (a, b)
        } else {
            (b, a)
        };
        at(fewer).iter().any(|t| self.triangle(*t).contains(&other))
    }

    /// The triangle with the directed edge from `a` to `b`, and its third vertex.
    pub(super) fn triangle_along(&self, a: VertexId, b: VertexId) -> Option<(FaceId, VertexId)> {
        self.incident[a.index()].iter().find_map(|&t| {
            let corners = self.triangle(t);
            let k = (0..3).find(|&k| corners[k] == a && corners[(k + 1) % 3] == b)?;
            Some((t, corners[(k + 2) % 3]))
        })
    }

    /// The star of `v`.
    pub(super) fn star(&self, v: VertexId) -> Star {
        // A neighbour, the next one, and the triangle between them.
        let mut spokes: Vec<(VertexId, VertexId, FaceId)> = self.incident[v.index()]
            .iter()
            .map(|&t| {
                let corners = self.triangle(t);
                let k = (0..3).find(|&k| corners[k] == v).unwrap_or(0);
                (corners[(k + 1) % 3], corners[(k + 2) % 3], t)
            })
            .collect();
        spokes.sort_unstable();
        let mut star = Star {
            ring: Vec::with_capacity(spokes.len()),
            triangles: Vec::with_capacity(spokes.len()),
        };
        let mut current = 0;
        for _ in 0..spokes.len() {
            let (neighbour, following, t) = spokes[current];
            star.ring.push(neighbour);
            star.triangles.push(t);
            current = spokes
                .binary_search_by_key(&following, |s| s.0)
                .unwrap_or(0);
        }
        star
    }

    /// A triangle, not one of `except`, that a new one would intersect in more than shared
    /// corners and sides.
    pub(super) fn first_intersecting(
        &self,
        triangle: [VertexId; 3],
        except: &[FaceId],
    ) -> Option<FaceId> {
        self.index
            .first_intersecting(triangle, &self.corners(triangle), except)
    }

    /// Whether there is such a triangle.
    pub(super) fn intersects(&self, triangle: [VertexId; 3], except: &[FaceId]) -> bool {
        self.first_intersecting(triangle, except).is_some()
    }

    /// Replaces the triangles `old` by `new`, which cover the same hole and are not more.
    pub(super) fn replace(&mut self, old: &[FaceId], new: &[[VertexId; 3]]) {
        debug_assert!(new.len() <= old.len());
        self.clock += 1;
        for &t in old {
            for v in self.triangle(t) {
                self.changed[v.index()] = self.clock;
                self.incident[v.index()].retain(|other| *other != t);
            }
        }
        for (k, &t) in old.iter().enumerate() {
            let replacement = new.get(k).copied();
            self.replaced[t.index()] = self.clock;
            self.triangles[t.index()] = replacement;
            if let Some(triangle) = replacement {
                for v in triangle {
                    self.incident[v.index()].push(t);
                }
                self.index.set(t, triangle, self.corners(triangle));
            } else {
                self.index.remove(t);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::hole::{self, Demand};
    use super::super::test_surfaces::{jittered, stacked};
    use super::*;
    use crate::mesh::intersections::triangles_intersect;
    use crate::mesh::shapes;

    /// The mesh's account of its vertices, edges and intersections against a list of its triangles.
    fn compare_with_list(mesh: &Patchwork) {
        let live: Vec<[VertexId; 3]> = mesh.live_triangles().collect();
        let vertices = VertexId::first(mesh.positions.len());
        for v in vertices.clone() {
            let around: Vec<_> = live.iter().filter(|t| t.contains(&v)).collect();
            assert_eq!(mesh.valence(v), around.len());
            let star = mesh.star(v);
            assert_eq!(star.ring.iter().min(), star.ring.first());
            let m = star.ring.len();
            assert_eq!((m, star.triangles.len()), (around.len(), around.len()));
            for k in 0..m {
                let mut expected = [v, star.ring[k], star.ring[(k + 1) % m]];
                let found = mesh.triangle(star.triangles[k]);
                let turn = (0..3).find(|&turn| {
                    expected.rotate_left(usize::from(turn > 0));
                    expected == found
                });
                assert!(turn.is_some(), "{found:?}");
            }
            for w in vertices.clone().filter(|w| *w != v) {
                let joined = live.iter().any(|t| t.contains(&v) && t.contains(&w));
                assert_eq!(mesh.has_edge(v, w), joined);
                let directed =
                    |t: &&[VertexId; 3]| (0..3).any(|k| t[k] == v && t[(k + 1) % 3] == w);
                match (mesh.triangle_along(v, w), live.iter().find(directed)) {
                    (None, None) => {}
                    (Some((t, third)), Some(expected)) => {
                        assert_eq!(mesh.triangle(t), *expected);
                        assert!(expected.contains(&third) && third != v && third != w);
                    }
                    other => panic!("{other:?}"),
                }
            }
        }
    }

    /// While vertices are removed: the triangles and their index against the list, and the numbers of the last
    /// changes against what was replaced.
    #[test]
    fn removals_keep_the_tables_and_number_the_changes() {
        for (seed, surface) in [
            (0, jittered(&shapes::icosphere(30.0, 1), 3.0, 1)),
            (1, stacked(20, 2)),
        ] {
            let mut mesh = Patchwork::new(surface.vertices.clone(), surface.triangles, 7.0);
            let count = mesh.positions.len();
            let faces = FaceId::first(mesh.triangles.len());
            let (mut changed, mut replaced) = (vec![0; count], vec![0; faces.len()]);
            let mut changes = 0;
            compare_with_list(&mesh);
            for v in VertexId::first(count).map(|v| VertexId((v.0 * 5 + seed) % count as u32)) {
                let star = mesh.star(v);
                let Ok(new) = hole::close(&mesh, &star, Demand::Embedded) else {
                    continue;
                };
                mesh.replace(&star.triangles, &new);
                changes += 1;
                changed[v.index()] = changes;
                star.ring.iter().for_each(|w| changed[w.index()] = changes);
                star.triangles
                    .iter()
                    .for_each(|t| replaced[t.index()] = changes);
                assert_eq!(mesh.clock(), changes);
                let numbers: Vec<u64> = VertexId::first(count).map(|w| mesh.changed(w)).collect();
                assert_eq!(numbers, changed);
                let numbers: Vec<u64> = faces.clone().map(|t| mesh.replaced(t)).collect();
                assert_eq!(numbers, replaced);
                assert_eq!(mesh.valence(v), 0);
            }
            assert!(changes > 12, "{changes}");
            compare_with_list(&mesh);
            // Any triangle over the vertices against those that are left.
            let mut seen = [0; 2];
            for a in 0..count as u32 {
                let triangle = [a, (a * 7 + 3) % count as u32, (a * 11 + 5) % count as u32];
                let triangle = triangle.map(VertexId);
                if triangle[0] == triangle[1]
                    || triangle[1] == triangle[2]
                    || triangle[2] == triangle[0]
                {
                    continue;
                }
                for skipped in 0..2 {
                    let live = || {
                        faces
                            .clone()
                            .filter(|t| mesh.triangles[t.index()].is_some())
                    };
                    let mut meeting = live().filter(|t| {
                        let other = mesh.triangle(*t);
                        triangles_intersect(
                            triangle,
                            &mesh.corners(triangle),
                            other,
                            &mesh.corners(other),
                        )
                    });
                    let except: Vec<FaceId> = meeting.by_ref().take(skipped).collect();
                    let first = meeting.next();
                    assert_eq!(mesh.first_intersecting(triangle, &except), first);
                    assert_eq!(mesh.intersects(triangle, &except), first.is_some());
                    seen[usize::from(first.is_some())] += 1;
                }
            }
            assert!(seen.iter().all(|n| *n > 0), "{seen:?}");
        }
    }
}
