//! Edge collapses in the order of their error.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::MOST_TURN;
use super::quadric::Quadric;
use crate::geometry::{Vec3, triangle};
use crate::mesh::TriMesh;
use crate::mesh::intersections::{IntersectionIndex, triangles_intersect};

/// A triangle of this radius ratio 2r/R is a needle; collapses that make one are avoided as
/// those are that turn one over, since a needle's normal is noise.
const NEEDLE: f64 = 0.01;

/// An edge and what its collapse costs.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    error: f64,
    /// The lower vertex first.
    edge: [u32; 2],
    /// Sum of both vertices' versions when the error was computed.
    version: u32,
    place: Vec3,
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Candidate {
    /// The heap's greatest is the cheapest; ties go by the edge.
    fn cmp(&self, other: &Self) -> Ordering {
        let error = other.error.total_cmp(&self.error);
        let edge = || other.edge.cmp(&self.edge);
        let version = || other.version.cmp(&self.version);
        error.then_with(edge).then_with(version)
    }
}

/// A surface on its way to fewer vertices.
pub struct Collapses {
    positions: Vec<Vec3>,
    triangles: Vec<Option<[u32; 3]>>,
    /// Triangles at each vertex.
    fans: Vec<Vec<u32>>,
    quadrics: Vec<Quadric>,
    /// Raised whenever something at the vertex changes.
    versions: Vec<u32>,
    left: usize,
    queue: BinaryHeap<Candidate>,
    /// Candidates that would have broken a promise when their turn came.
    forbidden: Vec<Candidate>,
    /// Whether anything was collapsed since the forbidden ones were last tried.
    collapsed_since: bool,
    index: IntersectionIndex,
}

impl Collapses {
    /// `mesh` is closed and manifold.
    pub fn new(mesh: &TriMesh) -> Self {
        let vertices = mesh.vertices.len();
        let mut fans = vec![Vec::new(); vertices];
        let mut quadrics = vec![Quadric::zero(); vertices];
        for (t, triangle) in (0..).zip(&mesh.triangles) {
            let plane = Quadric::of_plane(
                &mesh.area_normal(t as usize),
                &mesh.vertices[triangle[0] as usize],
            );
            for v in triangle.map(|v| v as usize) {
                fans[v].push(t);
                quadrics[v] = quadrics[v].plus(&plane);
            }
        }
        // Near the end triangles are some ten times longer than those that come in.
        let edge = (mesh.area() / mesh.triangles.len().max(1) as f64).sqrt();
        let mut this = Self {
            positions: mesh.vertices.clone(),
            triangles: mesh.triangles.iter().copied().map(Some).collect(),
            fans,
            quadrics,
            versions: vec![0; vertices],
            left: vertices,
            queue: BinaryHeap::new(),
            forbidden: Vec::new(),
            collapsed_since: false,
            index: IntersectionIndex::new(&mesh.vertices, &mesh.triangles, 2.0 * edge),
        };
        for triangle in &mesh.triangles {
            for k in 0..3 {
                let edge = [triangle[k], triangle[(k + 1) % 3]];
                // Each edge is met from both sides.
                if edge[0] < edge[1] {
                    this.consider(edge);
                }
            }
        }
        this
    }

    /// Vertices left.
    pub fn vertices(&self) -> usize {
        self.left
    }

    /// Collapses the cheapest edge that may be; `false` where none may.
    pub fn cheapest(&mut self) -> bool {
        loop {
            while let Some(candidate) = self.queue.pop() {
                if self.is_current(&candidate) {
                    if self.may(&candidate) {
                        self.collapse(&candidate);
                        self.collapsed_since = true;
                        return true;
                    }
                    self.forbidden.push(candidate);
                }
            }
            // What was forbidden may be allowed after what has changed since.
            if !std::mem::take(&mut self.collapsed_since) {
                return false;
            }
            self.queue.extend(self.forbidden.drain(..));
        }
    }

    fn is_current(&self, candidate: &Candidate) -> bool {
        let [a, b] = candidate.edge.map(|v| v as usize);
        candidate.version == self.versions[a] + self.versions[b]
            && !self.fans[a].is_empty()
            && !self.fans[b].is_empty()
    }

    /// The surface as it is, vertices in their old order.
    pub fn into_mesh(self) -> TriMesh {
        let mut number = vec![u32::MAX; self.positions.len()];
        let mut vertices = Vec::with_capacity(self.left);
        for (v, fan) in self.fans.iter().enumerate() {
            if !fan.is_empty() {
                number[v] = vertices.len() as u32;
                vertices.push(self.positions[v]);
            }
        }
        let triangles = self.triangles.into_iter().flatten();
        TriMesh {
            vertices,
            triangles: triangles.map(|t| t.map(|v| number[v as usize])).collect(),
        }
    }

    fn consider(&mut self, [a, b]: [u32; 2]) {
        let edge = [a.min(b), a.max(b)];
        let [i, j] = edge.map(|v| v as usize);
        let quadric = self.quadrics[i].plus(&self.quadrics[j]);
        let (p, q) = (self.positions[i], self.positions[j]);
        let middle = (p + q) / 2.0;
        let best = quadric.best_near(&middle);
        // A nearly flat fan may put its least error far away: then the edge itself must do.
        let near = (best - middle).norm() <= (q - p).norm();
        let (error, place) = [best, middle, p, q]
            .into_iter()
            .skip(usize::from(!near))
            .map(|x| (quadric.at(&x), x))
            .min_by(|x, y| x.0.total_cmp(&y.0))
            .expect("there are at least three places to choose from");
        self.queue.push(Candidate {
            error,
            edge,
            version: self.versions[i] + self.versions[j],
            place,
        });
    }

    /// The vertices round `v`, sorted.
    fn neighbours(&self, v: u32) -> Vec<u32> {
        let mut found: Vec<u32> = self.fans[v as usize]
            .iter()
            .filter_map(|t| self.triangles[*t as usize])
            .flatten()
            .filter(|w| *w != v)
            .collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Whether the collapse keeps every promise.
    fn may(&self, candidate: &Candidate) -> bool {
        let [a, b] = candidate.edge;
        self.keeps_topology(a, b) && self.keeps_shape(candidate)
    }

    /// The link condition: the ends have just the two neighbours in common that the edge's
    /// triangles give them, and four vertices at least stay.
    fn keeps_topology(&self, a: u32, b: u32) -> bool {
        let (of_a, of_b) = (self.neighbours(a), self.neighbours(b));
        let common: Vec<u32> = of_a
            .iter()
            .filter(|v| of_b.binary_search(v).is_ok())
            .copied()
            .collect();
        // A corner of three triangles beside the edge would be left with two.
        let stays_closed = |v: &u32| self.fans[*v as usize].len() > 3;
        common.len() == 2 && common.iter().all(stays_closed) && self.left > 4
    }

    /// No triangle turns over, becomes a needle or pierces another.
    fn keeps_shape(&self, candidate: &Candidate) -> bool {
        let [a, b] = candidate.edge;
        let least = MOST_TURN.to_radians().cos();
        let gone_or_moved: Vec<u32> = [a, b]
            .iter()
            .flat_map(|v| self.fans[*v as usize].iter().copied())
            .collect();
        let mut moved: Vec<([u32; 3], [Vec3; 3])> = Vec::new();
        for t in &gone_or_moved {
            let Some(ids) = self.triangles[*t as usize] else {
                continue;
            };
            if ids.contains(&a) && ids.contains(&b) {
                continue;
            }
            let old = ids.map(|v| self.positions[v as usize]);
            let new_ids = ids.map(|v| if v == b { a } else { v });
            let new = new_ids.map(|v| {
                if v == a {
                    candidate.place
                } else {
                    self.positions[v as usize]
                }
            });
            let before = triangle::area_normal(&old[0], &old[1], &old[2]);
            let after = triangle::area_normal(&new[0], &new[1], &new[2]);
            let turned = before.dot(&after) < least * before.norm() * after.norm();
            let needle = triangle::radius_ratio(&new[0], &new[1], &new[2])
                < NEEDLE.min(triangle::radius_ratio(&old[0], &old[1], &old[2]));
            if turned || needle || self.index.pierces(new_ids, &new, &gone_or_moved) {
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

    fn collapse(&mut self, candidate: &Candidate) {
        let [a, b] = candidate.edge;
        let (i, j) = (a as usize, b as usize);
        self.positions[i] = candidate.place;
        self.quadrics[i] = self.quadrics[i].plus(&self.quadrics[j]);
        for t in std::mem::take(&mut self.fans[j]) {
            let Some(ids) = self.triangles[t as usize] else {
                continue;
            };
            if ids.contains(&a) {
                self.triangles[t as usize] = None;
                self.index.remove(t);
                for v in ids.map(|v| v as usize) {
                    self.fans[v].retain(|other| *other != t);
                }
            } else {
                self.triangles[t as usize] = Some(ids.map(|v| if v == b { a } else { v }));
                self.fans[i].push(t);
            }
        }
        for t in self.fans[i].clone() {
            if let Some(ids) = self.triangles[t as usize] {
                let corners = ids.map(|v| self.positions[v as usize]);
                self.index.set(t, ids, corners);
            }
        }
        self.left -= 1;
        self.refresh(a);
    }

    /// Looks anew at every edge of `v`.
    fn refresh(&mut self, v: u32) {
        self.versions[v as usize] += 1;
        for w in self.neighbours(v) {
            self.consider([v, w]);
        }
    }
}
