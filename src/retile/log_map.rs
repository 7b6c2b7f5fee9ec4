//! Distances and directions from one point of the surface to all others near it.
//!
//! Discrete geodesic polar coordinates (Melvær & Reimers, "Geodesic polar coordinates on
//! polygonal meshes", Computer Graphics Forum 2012): a wave runs over the vertices in the
//! order of distance, as in Dijkstra's algorithm. Where two corners i, j of a triangle are
//! known, the triangle and a virtual source at the right distances from i and j are laid into
//! the plane; the third corner's distance is that to the virtual source, and its direction
//! divides the directions of i and j as the ray divides the angle between them.
//!
//! Exact wherever no vertex bends the wave (planes, and developable surfaces laid flat);
//! elsewhere an approximation from above and below, measured in this file's tests.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::SurfacePoint;
use super::domain::{Domain, apex};
use crate::geometry::Vec2;
use crate::mesh::adjacency::previous;

/// A vertex as seen from the source: the vector in the source triangle's frame that a walker
/// must take to get there, and its length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reach {
    /// Direction times distance, in the frame of the source's triangle, mm.
    pub vector: Vec2,
    /// Geodesic distance, mm.
    pub distance: f64,
}

/// The third corner of a triangle whose corners i (at the origin) and j (at `base` on the x
/// axis) are known, the third being `left` from i and `right` from j. `None` where the ray
/// from the virtual source does not pass between i and j.
pub(crate) fn unfold(i: &Reach, j: &Reach, base: f64, left: f64, right: f64) -> Option<Reach> {
    let (ri, rj) = (i.distance, j.distance);
    let sx = (ri * ri - rj * rj + base * base) / (2.0 * base);
    let depth = ri * ri - sx * sx;
    if !(depth > 0.0) {
        return None;
    }
    let sy = depth.sqrt();
    let (kx, ky) = apex(base, left, right);
    // From the source at (sx, -sy) to k: where does the ray cross the edge?
    let (dx, dy) = (kx - sx, ky + sy);
    let crossing = sx * dy + dx * sy;
    if !(crossing > 0.0 && crossing < base * dy) {
        return None;
    }
    let distance = dx.hypot(dy);
    // k = a i + b j as vectors from the source; the same combination of the directions.
    let whole = base * sy;
    let a = (dy * (base - sx) - dx * sy) / whole;
    let b = (sx * dy + dx * sy) / whole;
    let vector = i.vector * a + j.vector * b;
    let length = vector.norm();
    if !(length > 0.0) {
        return None;
    }
    Some(Reach {
        vector: vector * (distance / length),
        distance,
    })
}

/// The vertex at the end of an edge of `length`, reached straight through the vertex `from`.
pub(crate) fn along_edge(from: &Reach, length: f64) -> Reach {
    let distance = from.distance + length;
    let stretch = if from.distance > 0.0 {
        distance / from.distance
    } else {
        0.0
    };
    Reach {
        vector: from.vector * stretch,
        distance,
    }
}

/// The three corners of the source's own triangle: exact.
pub(crate) fn first_corners(domain: &Domain, source: &SurfacePoint) -> [Reach; 3] {
    let flat = domain.flat(source.triangle);
    let [u, v, w] = source.barycentric;
    let here = flat[0] * u + flat[1] * v + flat[2] * w;
    flat.map(|corner| {
        let vector = corner - here;
        Reach {
            vector,
            distance: vector.norm(),
        }
    })
}

/// A queue entry: distance (rounded to f32, whose bits sort as it does) above the vertex.
pub(crate) fn queue_key(distance: f64, vertex: u32) -> Reverse<u64> {
    Reverse((u64::from((distance as f32).to_bits()) << 32) | u64::from(vertex))
}

const UNSEEN: u8 = 0;
const SEEN: u8 = 1;
const DONE: u8 = 2;

/// The map round one source, and the memory for the next one: clearing costs what was
/// visited.
#[derive(Debug, Clone)]
pub(crate) struct LogMap {
    reach: Vec<Reach>,
    state: Vec<u8>,
    visited: Vec<u32>,
    queue: BinaryHeap<Reverse<u64>>,
}

impl LogMap {
    /// An empty map over `vertices` vertices.
    pub fn new(vertices: usize) -> Self {
        Self {
            reach: vec![
                Reach {
                    vector: Vec2::zeros(),
                    distance: f64::INFINITY,
                };
                vertices
            ],
            state: vec![UNSEEN; vertices],
            visited: Vec::new(),
            queue: BinaryHeap::new(),
        }
    }

    /// The vertex as seen from the source, if it lies within the radius.
    pub fn reach(&self, vertex: u32) -> Option<Reach> {
        (self.state[vertex as usize] == DONE).then(|| self.reach[vertex as usize])
    }

    /// The vertices within the radius, in no particular order, and those just beyond.
    pub fn visited(&self) -> &[u32] {
        &self.visited
    }

    /// Maps everything within `radius` mm of `source`.
    pub fn spread(&mut self, domain: &Domain, source: &SurfacePoint, radius: f64) {
        self.clear();
        let corners = domain.triangles[source.triangle as usize];
        for (v, reach) in corners.into_iter().zip(first_corners(domain, source)) {
            self.offer(v, reach);
        }
        while let Some(Reverse(key)) = self.queue.pop() {
            let i = key as u32;
            if self.state[i as usize] == DONE {
                continue;
            }
            let here = self.reach[i as usize];
            if here.distance > radius {
                break;
            }
            self.state[i as usize] = DONE;
            self.relax_around(domain, i, here);
        }
    }

    fn relax_around(&mut self, domain: &Domain, i: u32, here: Reach) {
        for out in domain.adjacency.around(domain.outgoing[i as usize]) {
            // The triangle i, a, b.
            let back = previous(out);
            let [a, b] = [domain.ends(out)[1], domain.ends(back)[0]];
            let across = domain.lengths[3 * (out as usize / 3) + (out as usize + 1) % 3];
            let (to_a, to_b) = (domain.lengths[out as usize], domain.lengths[back as usize]);
            if self.state[a as usize] != DONE {
                self.offer(a, along_edge(&here, to_a));
            }
            for (known, sought, base, left) in [(a, b, to_a, to_b), (b, a, to_b, to_a)] {
                if self.state[known as usize] == DONE && self.state[sought as usize] != DONE {
                    let j = self.reach[known as usize];
                    if let Some(k) = unfold(&here, &j, base, left, across) {
                        self.offer(sought, k);
                    }
                }
            }
        }
    }

    fn offer(&mut self, vertex: u32, reach: Reach) {
        let v = vertex as usize;
        if self.state[v] == UNSEEN {
            self.state[v] = SEEN;
            self.visited.push(vertex);
        } else if reach.distance >= self.reach[v].distance {
            return;
        }
        self.reach[v] = reach;
        self.queue.push(queue_key(reach.distance, vertex));
    }

    fn clear(&mut self) {
        for &v in &self.visited {
            self.state[v as usize] = UNSEEN;
        }
        self.visited.clear();
        self.queue.clear();
    }
}
