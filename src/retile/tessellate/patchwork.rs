//! A closed triangle mesh that loses vertices and flips edges.

use crate::geometry::Vec3;
use crate::mesh::intersections::IntersectionIndex;

/// Stands for a triangle that is no more.
const DEAD: [u32; 3] = [u32::MAX; 3];

/// The mesh while it changes: triangles, the triangles at every vertex, and where they lie.
/// Always a closed, oriented 2-manifold.
pub(super) struct Patchwork {
    pub(super) positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    /// Triangles at each vertex, in no order.
    incident: Vec<Vec<u32>>,
    index: IntersectionIndex,
    /// Number of changes so far; the last one at each vertex and of each triangle.
    clock: u64,
    changed: Vec<u64>,
    replaced: Vec<u64>,
}

/// The triangles around a vertex.
pub(super) struct Star {
    /// The neighbours, counter-clockwise, beginning with the lowest id.
    pub(super) ring: Vec<u32>,
    /// Triangle k lies between neighbours k and k + 1.
    pub(super) triangles: Vec<u32>,
}

impl Patchwork {
    /// `triangles` must be a closed manifold; `cell` is the grid's spacing (mm).
    pub(super) fn new(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>, cell: f64) -> Self {
        let mut incident = vec![Vec::with_capacity(8); positions.len()];
        for (t, triangle) in (0u32..).zip(&triangles) {
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
            triangles,
            incident,
            index,
        }
    }

    pub(super) fn position(&self, v: u32) -> Vec3 {
        self.positions[v as usize]
    }

    pub(super) fn corners(&self, triangle: [u32; 3]) -> [Vec3; 3] {
        triangle.map(|v| self.position(v))
    }

    /// Number of neighbours.
    pub(super) fn valence(&self, v: u32) -> usize {
        self.incident[v as usize].len()
    }

    pub(super) fn triangle(&self, t: u32) -> [u32; 3] {
        self.triangles[t as usize]
    }

    /// Number of changes so far.
    pub(super) fn clock(&self) -> u64 {
        self.clock
    }

    /// The number of the last change at `v`.
    pub(super) fn changed(&self, v: u32) -> u64 {
        self.changed[v as usize]
    }

    /// The number of the last change of triangle `t`.
    pub(super) fn replaced(&self, t: u32) -> u64 {
        self.replaced[t as usize]
    }

    /// The triangles that there are.
    pub(super) fn live_triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        self.triangles.iter().copied().filter(|t| *t != DEAD)
    }

    pub(super) fn has_edge(&self, a: u32, b: u32) -> bool {
        let at = |v: u32| &self.incident[v as usize];
        let (fewer, other) = if at(a).len() <= at(b).len() {
            (a, b)
        } else {
            (b, a)
        };
        at(fewer)
            .iter()
            .any(|t| self.triangles[*t as usize].contains(&other))
    }

    /// The triangle that runs from `a` to `b`, and its third vertex.
    pub(super) fn triangle_along(&self, a: u32, b: u32) -> Option<(u32, u32)> {
        self.incident[a as usize].iter().find_map(|&t| {
            let corners = self.triangles[t as usize];
            let k = (0..3).find(|&k| corners[k] == a && corners[(k + 1) % 3] == b)?;
            Some((t, corners[(k + 2) % 3]))
        })
    }

    /// The star of `v`.
    pub(super) fn star(&self, v: u32) -> Star {
        // Neighbour, the one after it, the triangle between.
        let mut spokes: Vec<(u32, u32, u32)> = self.incident[v as usize]
            .iter()
            .map(|&t| {
                let corners = self.triangles[t as usize];
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

    /// A triangle, not of `except`, that this one would meet beyond shared corners and sides.
    pub(super) fn first_pierced(&self, triangle: [u32; 3], except: &[u32]) -> Option<u32> {
        self.index
            .first_pierced(triangle, &self.corners(triangle), except)
    }

    /// Whether there is one.
    pub(super) fn pierces(&self, triangle: [u32; 3], except: &[u32]) -> bool {
        self.first_pierced(triangle, except).is_some()
    }

    /// Puts `new` in the place of the triangles `old`; both cover the same hole. Not more new
    /// ones than old ones.
    pub(super) fn replace(&mut self, old: &[u32], new: &[[u32; 3]]) {
        debug_assert!(new.len() <= old.len());
        self.clock += 1;
        for &t in old {
            for v in self.triangles[t as usize] {
                self.changed[v as usize] = self.clock;
                self.incident[v as usize].retain(|other| *other != t);
            }
        }
        for (k, &t) in old.iter().enumerate() {
            self.replaced[t as usize] = self.clock;
            if let Some(&triangle) = new.get(k) {
                self.triangles[t as usize] = triangle;
                for v in triangle {
                    self.incident[v as usize].push(t);
                }
                self.index.set(t, triangle, self.corners(triangle));
            } else {
                self.triangles[t as usize] = DEAD;
                self.index.remove(t);
            }
        }
    }
}
