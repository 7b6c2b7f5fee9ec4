//! Edge collapses in the order of their quadric error.
//!
//! In: a closed surface. Each call of [`Collapses::collapse_cheapest`] removes one vertex. Edges
//! wait in a priority queue with the error and the place of their collapse. Entries are not
//! updated: every vertex has a version, and an entry whose ends have changed since is skipped.
//! Collapses that are not allowed are kept aside and tried again after something has changed.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::MAX_TURN;
use super::quadric::Quadric;
use crate::base::geometry::{Vec3, triangle};
use crate::mesh::intersections::{IntersectionIndex, triangles_intersect};
use crate::mesh::{FaceId, TriMesh, VertexId, ids};

/// Radius ratio 2r/R below which a triangle is a needle. Collapses that make one are not allowed,
/// since the normal of a needle is noise.
const NEEDLE_RADIUS_RATIO: f64 = 0.01;

/// The collapse of an edge into one vertex.
#[derive(Debug, Clone, Copy)]
struct CollapseCandidate {
    /// Quadric error at `place`, mm⁴.
    error: f64,
    /// The ends of the edge, the lower first.
    edge: [VertexId; 2],
    /// Sum of both ends' versions when the error was computed.
    version: u32,
    /// Position of the remaining vertex, mm.
    place: Vec3,
}

impl PartialEq for CollapseCandidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for CollapseCandidate {}

impl PartialOrd for CollapseCandidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for CollapseCandidate {
    /// The heap returns the greatest first, so the candidate with the smallest error is the
    /// greatest; ties are decided by the edge.
    fn cmp(&self, other: &Self) -> Ordering {
        let error = other.error.total_cmp(&self.error);
        let edge = || other.edge.cmp(&self.edge);
        let version = || other.version.cmp(&self.version);
        error.then_with(edge).then_with(version)
    }
}

/// A surface between two collapses.
pub struct Collapses {
    positions: Vec<Vec3>,
    /// `None` for removed triangles.
    triangles: Vec<Option<[VertexId; 3]>>,
    /// Triangles at each vertex; none at a removed one.
    fans: Vec<Vec<FaceId>>,
    quadrics: Vec<Quadric>,
    /// Incremented whenever something at the vertex changes.
    versions: Vec<u32>,
    /// Number of vertices that have not been removed.
    vertices_left: usize,
    queue: BinaryHeap<CollapseCandidate>,
    /// Candidates that were not allowed when their turn came.
    forbidden: Vec<CollapseCandidate>,
    /// Whether anything was collapsed since the forbidden ones were last tried.
    collapsed_since: bool,
    index: IntersectionIndex,
}

impl Collapses {
    /// Prepares `mesh`, which must be a closed manifold.
    pub fn new(mesh: &TriMesh) -> Self {
        let vertices = mesh.vertices.len();
        let mut fans = vec![Vec::new(); vertices];
        let mut quadrics = vec![Quadric::zero(); vertices];
        for t in FaceId::first(mesh.triangles.len()) {
            let corners = mesh.corner_ids(t).map(VertexId::index);
            let normal = mesh.area_normal(t.index());
            let plane = Quadric::of_plane(&normal, &mesh.vertices[corners[0]]);
            for v in corners {
                fans[v].push(t);
                quadrics[v] = quadrics[v].plus(&plane);
            }
        }
        // The last triangles are about ten times longer than the first ones.
        let edge = (mesh.area() / mesh.triangles.len().max(1) as f64).sqrt();
        let mut this = Self {
            positions: mesh.vertices.clone(),
            triangles: mesh
                .triangles
                .iter()
                .map(|t| Some(ids::typed(*t)))
                .collect(),
            fans,
            quadrics,
            versions: vec![0; vertices],
            vertices_left: vertices,
            queue: BinaryHeap::new(),
            forbidden: Vec::new(),
            collapsed_since: false,
            index: IntersectionIndex::new(&mesh.vertices, &mesh.triangles, 2.0 * edge),
        };
        for t in FaceId::first(mesh.triangles.len()) {
            let [a, b, c] = mesh.corner_ids(t);
            // Every edge occurs twice, once in each direction.
            for edge in [[a, b], [b, c], [c, a]].into_iter().filter(|[p, q]| p < q) {
                this.consider(edge);
            }
        }
        this
    }

    /// The number of vertices left.
    pub fn vertices_left(&self) -> usize {
        self.vertices_left
    }

    /// Performs the allowed collapse with the smallest error. Returns `false` if none is allowed.
    pub fn collapse_cheapest(&mut self) -> bool {
        loop {
            while let Some(candidate) = self.queue.pop() {
                if self.is_current(&candidate) {
                    if self.is_allowed(&candidate) {
                        self.collapse(&candidate);
                        self.collapsed_since = true;
                        return true;
                    }
                    self.forbidden.push(candidate);
                }
            }
            // Forbidden collapses may be allowed after others.
            if !std::mem::take(&mut self.collapsed_since) {
                return false;
            }
            self.queue.extend(self.forbidden.drain(..));
        }
    }

    /// Whether both ends are as they were when the candidate was computed.
    fn is_current(&self, candidate: &CollapseCandidate) -> bool {
        let [a, b] = candidate.edge.map(VertexId::index);
        candidate.version == self.versions[a] + self.versions[b]
            && !self.fans[a].is_empty()
            && !self.fans[b].is_empty()
    }

    /// The present surface; vertices keep their order.
    pub fn into_mesh(self) -> TriMesh {
        let mut number = vec![u32::MAX; self.positions.len()];
        let mut vertices = Vec::with_capacity(self.vertices_left);
        for (v, fan) in self.fans.iter().enumerate() {
            if !fan.is_empty() {
                number[v] = vertices.len() as u32;
                vertices.push(self.positions[v]);
            }
        }
        let triangles = self.triangles.into_iter().flatten();
        TriMesh {
            vertices,
            triangles: triangles.map(|t| t.map(|v| number[v.index()])).collect(),
        }
    }

    /// Adds the collapse of an edge to the queue.
    fn consider(&mut self, [a, b]: [VertexId; 2]) {
        let edge = [a.min(b), a.max(b)];
        let [i, j] = edge.map(VertexId::index);
        let quadric = self.quadrics[i].plus(&self.quadrics[j]);
        let (p, q) = (self.positions[i], self.positions[j]);
        let middle = (p + q) / 2.0;
        let best = quadric.best_near(&middle);
        // For a nearly flat fan the smallest error may be far away. Then only the ends and the
        // midpoint of the edge are considered.
        let near = (best - middle).norm() <= (q - p).norm();
        let (error, place) = [best, middle, p, q]
            .into_iter()
            .skip(usize::from(!near))
            .map(|x| (quadric.at(&x), x))
            .min_by(|x, y| x.0.total_cmp(&y.0))
            .expect("there are at least three places to choose from");
        self.queue.push(CollapseCandidate {
            error,
            edge,
            version: self.versions[i] + self.versions[j],
            place,
        });
    }

    /// The neighbours of `v`, ascending.
    fn neighbours(&self, v: VertexId) -> Vec<VertexId> {
        let mut found: Vec<VertexId> = self.fans[v.index()]
            .iter()
            .filter_map(|t| self.triangles[t.index()])
            .flatten()
            .filter(|w| *w != v)
            .collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Whether the collapse keeps topology and shape.
    fn is_allowed(&self, candidate: &CollapseCandidate) -> bool {
        let [a, b] = candidate.edge;
        self.keeps_topology(a, b) && self.keeps_shape(candidate)
    }

    /// The link condition: the ends have exactly two common neighbours, the third corners of the
    /// edge's triangles; and at least four vertices remain.
    fn keeps_topology(&self, a: VertexId, b: VertexId) -> bool {
        let (of_a, of_b) = (self.neighbours(a), self.neighbours(b));
        let common: Vec<VertexId> = of_a
            .iter()
            .filter(|v| of_b.binary_search(v).is_ok())
            .copied()
            .collect();
        // A common neighbour with three triangles would be left with two.
        let stays_closed = |v: &VertexId| self.fans[v.index()].len() > 3;
        common.len() == 2 && common.iter().all(stays_closed) && self.vertices_left > 4
    }

    /// Whether no triangle turns over, becomes a needle or comes to intersect another.
    fn keeps_shape(&self, candidate: &CollapseCandidate) -> bool {
        let [a, b] = candidate.edge;
        let least = MAX_TURN.to_radians().cos();
        let changed: Vec<FaceId> = [a, b]
            .iter()
            .flat_map(|v| self.fans[v.index()].iter().copied())
            .collect();
        let mut moved: Vec<([VertexId; 3], [Vec3; 3])> = Vec::new();
        for t in &changed {
            let Some(ids) = self.triangles[t.index()] else {
                continue;
            };
            if ids.contains(&a) && ids.contains(&b) {
                continue;
            }
            let old = ids.map(|v| self.positions[v.index()]);
            let new_ids = ids.map(|v| if v == b { a } else { v });
            let new = new_ids.map(|v| {
                if v == a {
                    candidate.place
                } else {
                    self.positions[v.index()]
                }
            });
            let before = triangle::area_normal(&old[0], &old[1], &old[2]);
            let after = triangle::area_normal(&new[0], &new[1], &new[2]);
            let turned = before.dot(&after) < least * before.norm() * after.norm();
            let needle = triangle::radius_ratio(&new[0], &new[1], &new[2])
                < NEEDLE_RADIUS_RATIO.min(triangle::radius_ratio(&old[0], &old[1], &old[2]));
            if turned || needle || self.index.intersects(new_ids, &new, &changed) {
                return false;
            }
            moved.push((new_ids, new));
        }
        moved.iter().enumerate().all(|(i, s)| {
            moved[i + 1..]
                .iter()
                .all(|t| !triangles_intersect(s.0, &s.1, t.0, &t.1))
        })
    }

    fn collapse(&mut self, candidate: &CollapseCandidate) {
        let [a, b] = candidate.edge;
        let (i, j) = (a.index(), b.index());
        self.positions[i] = candidate.place;
        self.quadrics[i] = self.quadrics[i].plus(&self.quadrics[j]);
        for t in std::mem::take(&mut self.fans[j]) {
            let Some(ids) = self.triangles[t.index()] else {
                continue;
            };
            if ids.contains(&a) {
                self.triangles[t.index()] = None;
                self.index.remove(t);
                for v in ids.map(VertexId::index) {
                    self.fans[v].retain(|other| *other != t);
                }
            } else {
                self.triangles[t.index()] = Some(ids.map(|v| if v == b { a } else { v }));
                self.fans[i].push(t);
            }
        }
        for t in self.fans[i].clone() {
            if let Some(ids) = self.triangles[t.index()] {
                let corners = ids.map(|v| self.positions[v.index()]);
                self.index.set(t, ids, corners);
            }
        }
        self.vertices_left -= 1;
        self.refresh(a);
    }

    /// Adds new candidates for all edges at `v`, which has changed.
    fn refresh(&mut self, v: VertexId) {
        self.versions[v.index()] += 1;
        for w in self.neighbours(v) {
            self.consider([v, w]);
        }
    }
}
