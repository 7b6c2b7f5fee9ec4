//! The geodesic Voronoi diagram of points, on the surface's vertices.
//!
//! The wave of [`super::log_map`] started from all points at once. Every vertex takes the
//! label of the wave front that reaches it first, from the vertex that passed it on, so every
//! cell is connected by construction; triangles are unfolded only between vertices of one
//! label. (Taking the least of separate maps instead leaves stray islands.)

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::SurfacePoint;
use super::domain::Domain;
use super::log_map::{Reach, along_edge, first_corners, queue_key, unfold};
use crate::geometry::Vec2;
use crate::mesh::adjacency::previous;

/// Label of a vertex that no wave has reached.
pub(crate) const UNLABELLED: u32 = u32::MAX;

/// For every vertex the nearest point and the way there.
#[derive(Debug, Clone)]
pub(crate) struct Voronoi {
    /// Index of the nearest point.
    pub label: Vec<u32>,
    /// The vertex seen from that point, in the frame of the point's triangle.
    pub reach: Vec<Reach>,
    done: Vec<bool>,
    queue: BinaryHeap<Reverse<u64>>,
}

impl Voronoi {
    /// Memory for diagrams on `vertices` vertices.
    pub fn new(vertices: usize) -> Self {
        Self {
            label: vec![UNLABELLED; vertices],
            reach: Vec::new(),
            done: Vec::new(),
            queue: BinaryHeap::new(),
        }
    }

    /// Spreads the diagram of `points` over the whole domain.
    pub fn spread(&mut self, domain: &Domain, points: &[SurfacePoint]) {
        let count = domain.vertices.len();
        let unseen = Reach {
            vector: Vec2::zeros(),
            distance: f64::INFINITY,
        };
        self.label.clear();
        self.label.resize(count, UNLABELLED);
        self.reach.clear();
        self.reach.resize(count, unseen);
        self.done.clear();
        self.done.resize(count, false);
        self.queue.clear();
        for (label, p) in points.iter().enumerate() {
            let corners = domain.triangles[p.triangle as usize];
            for (v, reach) in corners.into_iter().zip(first_corners(domain, p)) {
                self.offer(v, label as u32, reach);
            }
        }
        while let Some(Reverse(key)) = self.queue.pop() {
            let i = key as u32;
            if !self.done[i as usize] {
                self.done[i as usize] = true;
                self.relax_around(domain, i);
            }
        }
    }

    fn relax_around(&mut self, domain: &Domain, i: u32) {
        let (label, here) = (self.label[i as usize], self.reach[i as usize]);
        for out in domain.adjacency.around(domain.outgoing[i as usize]) {
            let back = previous(out);
            let [a, b] = [domain.ends(out)[1], domain.ends(back)[0]];
            let across = domain.lengths[3 * (out as usize / 3) + (out as usize + 1) % 3];
            let (to_a, to_b) = (domain.lengths[out as usize], domain.lengths[back as usize]);
            if !self.done[a as usize] {
                self.offer(a, label, along_edge(&here, to_a));
            }
            for (known, sought, base, left) in [(a, b, to_a, to_b), (b, a, to_b, to_a)] {
                let (known, same) = (known as usize, self.label[known as usize] == label);
                if same && self.done[known] && !self.done[sought as usize] {
                    if let Some(k) = unfold(&here, &self.reach[known], base, left, across) {
                        self.offer(sought, label, k);
                    }
                }
            }
        }
    }

    fn offer(&mut self, vertex: u32, label: u32, reach: Reach) {
        let v = vertex as usize;
        if reach.distance < self.reach[v].distance {
            self.label[v] = label;
            self.reach[v] = reach;
            self.queue.push(queue_key(reach.distance, vertex));
        }
    }
}
