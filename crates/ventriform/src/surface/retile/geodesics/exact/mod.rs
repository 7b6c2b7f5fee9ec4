//! Exact distances and directions from one point of the surface.
//!
//! In: a closed triangle surface, a source (a triangle and barycentric coordinates; edges and
//! vertices allowed) and a radius. Out: the length and the initial direction of a shortest path
//! to every vertex and every point within the radius.
//!
//! A shortest path is straight across edges, once their triangles are unfolded into one plane,
//! and turns only at *saddle* vertices, whose angles exceed 2π (Mitchell, Mount and
//! Papadimitriou, "The discrete geodesic problem", SIAM J. Comput. 1987; a practical version is
//! Surazhsky et al., SIGGRAPH 2005). *Windows* are propagated over the surface: parts of edges
//! that are visible, through a strip of unfolded triangles, from the source or from a saddle
//! that acts as a *pseudo-source*.
//!
//! 1. The triangles that contain the source open a window on each of their far edges.
//! 2. The nearest window or vertex is taken from a queue. Through the triangle behind it a
//!    window reaches two further edges. Both get a window only if this one reaches the vertex
//!    between them sooner than all earlier ones through the same edge; otherwise only the edge
//!    to which it may still contribute ("one angle, one split": Chen and Han, SoCG 1990).
//! 3. A window is dropped if a path through a corner of its triangle, at the corner's known
//!    distance, is shorter for all its rays (Xin and Wang, "Improving Chen and Han's algorithm
//!    on the discrete geodesic problem", ACM Trans. Graph. 2009).
//! 4. A saddle opens windows where paths through it have angles of at least π on both sides.
//! 5. The search ends when the nearest entry of the queue lies beyond the radius.
//!
//! Guaranteed: exact up to rounding. This is tested against a search through all strips (in this
//! folder) and against another implementation (`scripts/check/geodesics.py`). If there are
//! several shortest paths, the direction is that of one of them. No bound better than
//! O(n² log n) is known; with the filters the time is about proportional to the area within the
//! radius.

#[cfg(test)]
mod brute_force;
#[cfg(test)]
mod tests;
mod window;

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::{PI, TAU};

use super::{GeodesicMap, Reach};
use crate::base::geometry::Vec2;
use crate::mesh::{FaceId, HalfEdgeId, VertexId};
use crate::surface::retile::SurfacePoint;
use crate::surface::retile::domain::Domain;
use window::{Apex, EdgeWindow, in_frame, turned};

/// Barycentric coordinates up to this count as 0: the source lies on an edge or a vertex.
const ON_EDGE: f64 = 1e-12;

/// Angle, rad, by which a vertex must exceed 2π to count as a saddle. Smaller excesses turn no
/// path by more than windows overlap.
const SADDLE_EXCESS_RAD: f64 = 1e-10;

/// Angle, rad, by which the windows of a saddle overlap those beside it.
const FAN_OVERLAP: f64 = 1e-9;

/// Factor by which a path must be longer than another to be dropped; exceeds rounding errors.
const DROPPED_PATH_FACTOR: f64 = 1.0 + 1e-12;

/// The end of a list of windows.
const LIST_END: u32 = u32::MAX;

/// An entry of the queue. At equal distances vertices come first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Event {
    Vertex(VertexId),
    /// Index of a window.
    Window(u32),
}

/// The direction from which the shortest known path arrives at a vertex: `angle` rad
/// counter-clockwise from `half_edge`, which leaves the vertex.
#[derive(Debug, Clone, Copy)]
struct Arrival {
    half_edge: HalfEdgeId,
    angle: f64,
}

/// The source or a pseudo-source.
#[derive(Debug, Clone, Copy)]
struct Root {
    /// Distance from the source, mm.
    distance: f64,
    /// Initial direction of the path to it; `None` for the source itself.
    direction: Option<Vec2>,
}

/// A triangle that contains the source.
#[derive(Debug, Clone, Copy)]
struct SourceTriangle {
    triangle: FaceId,
    /// The source in the triangle's frame, mm.
    at: Vec2,
    /// Rotation from the triangle's frame to that of the source's own triangle.
    turn: Vec2,
}

/// The nearest window so far through which the vertex opposite to a half-edge is visible.
#[derive(Debug, Clone, Copy)]
struct Split {
    distance: f64,
    crossing: f64,
}

/// The exact map around one source.
#[derive(Debug, Clone)]
pub(in crate::surface::retile) struct ExactMap {
    reach: Vec<Reach>,
    arrival: Vec<Arrival>,
    done: Vec<bool>,
    visited: Vec<VertexId>,
    roots: Vec<Root>,
    source_triangles: Vec<SourceTriangle>,
    /// All windows of this source, each with the index of the previous one on its half-edge.
    windows: Vec<(EdgeWindow, u32)>,
    /// The latest window that was propagated through each half-edge.
    last: Vec<u32>,
    split: Vec<Split>,
    queue: BinaryHeap<Reverse<(u64, Event)>>,
    radius: f64,
}

impl GeodesicMap for ExactMap {
    fn over(domain: &Domain) -> Self {
        let (vertices, half_edges) = (domain.vertices.len(), domain.lengths.len());
        let nowhere = Arrival {
            half_edge: HalfEdgeId(u32::MAX),
            angle: 0.0,
        };
        Self {
            reach: vec![Reach::UNKNOWN; vertices],
            arrival: vec![nowhere; vertices],
            done: vec![false; vertices],
            visited: Vec::new(),
            roots: Vec::new(),
            source_triangles: Vec::new(),
            windows: Vec::new(),
            last: vec![LIST_END; half_edges],
            split: vec![Split::UNSEEN; half_edges],
            queue: BinaryHeap::new(),
            radius: 0.0,
        }
    }

    fn spread(&mut self, domain: &Domain, source: &SurfacePoint, radius: f64) {
        self.clear();
        self.radius = radius;
        self.roots.push(Root {
            distance: 0.0,
            direction: None,
        });
        self.leave_source(domain, source);
        while let Some(Reverse((key, event))) = self.queue.pop() {
            if f64::from_bits(key) > radius {
                break;
            }
            match event {
                Event::Vertex(v) if !self.done[v.index()] => {
                    self.done[v.index()] = true;
                    self.leave_vertex(domain, v);
                }
                Event::Vertex(_) => {}
                Event::Window(w) => self.propagate(domain, w),
            }
        }
    }

    fn reach(&self, vertex: VertexId) -> Option<Reach> {
        self.done[vertex.index()].then(|| self.reach[vertex.index()])
    }

    fn visited(&self) -> &[VertexId] {
        &self.visited
    }

    fn reach_point(&self, domain: &Domain, point: &SurfacePoint) -> Option<Reach> {
        let t = point.triangle;
        let flat = domain.flat(t);
        let here = place(&flat, point.barycentric);
        if let Some(own) = self.source_triangles.iter().find(|s| s.triangle == t) {
            return Some(straight(turned(own.turn, here - own.at)));
        }
        let corners = domain.half_edges.corners(t);
        let mut best = Reach::UNKNOWN;
        for k in 0..3 {
            if let Some(corner) = self.reach(corners[k]) {
                let distance = corner.distance + (here - flat[k]).norm();
                if distance < best.distance {
                    let unit = corner.vector.try_normalize(0.0);
                    best = Reach {
                        vector: unit.unwrap_or_else(Vec2::zeros) * distance,
                        distance,
                    };
                }
            }
            let h = t.half_edge(k);
            let axis = (flat[(k + 1) % 3] - flat[k]) / domain.length(h);
            let seen_from_edge = in_frame(axis, here - flat[k]);
            let mut w = self.last[h.index()];
            while w != LIST_END {
                let (window, before) = &self.windows[w as usize];
                if let Some(sight) = window.sight(domain, seen_from_edge) {
                    let distance = self.roots[window.root as usize].distance + sight.norm();
                    if distance < best.distance {
                        best = self.reach_by(window, sight, distance);
                    }
                }
                w = *before;
            }
        }
        best.distance.is_finite().then_some(best)
    }
}

impl ExactMap {
    /// Step 1: the triangles that contain the source, their corners and far edges.
    fn leave_source(&mut self, domain: &Domain, source: &SurfacePoint) {
        let corners = domain.half_edges.corners(source.triangle);
        let weights = source
            .barycentric
            .map(|x| if x > ON_EDGE { x } else { 0.0 });
        let weight_of = |v: VertexId| {
            let k = corners.iter().position(|c| *c == v);
            k.map_or(0.0, |k| weights[k])
        };
        for (triangle, turn) in triangles_around(domain, source.triangle, weights) {
            let flat = domain.flat(triangle);
            let ids = domain.half_edges.corners(triangle);
            let shares = ids.map(weight_of);
            let at = place(&flat, shares);
            self.source_triangles
                .push(SourceTriangle { triangle, at, turn });
            for k in 0..3 {
                let leaving = triangle.half_edge(k);
                let (here, ahead) = (flat[k], flat[(k + 1) % 3]);
                let back = at - here;
                let arrival = Arrival {
                    half_edge: leaving,
                    angle: (ahead - here).perp(&back).atan2((ahead - here).dot(&back)),
                };
                self.offer(ids[k], straight(turned(turn, here - at)), arrival);
                if shares[(k + 2) % 3] > 0.0 {
                    let half_edge = domain.half_edges.twin(leaving);
                    let length = domain.length(half_edge);
                    let axis = (here - ahead) / length;
                    let unfolded = in_frame(axis, at - ahead);
                    self.enqueue(
                        domain,
                        EdgeWindow {
                            half_edge,
                            interval: [0.0, length],
                            source: Vec2::new(unfolded.x, unfolded.y.min(0.0)),
                            turn: turned(turn, axis),
                            root: 0,
                        },
                    );
                }
            }
        }
    }

    /// Steps 2 and 3 for one window.
    fn propagate(&mut self, domain: &Domain, w: u32) {
        let window = self.windows[w as usize].0;
        if self.is_useless(domain, &window) {
            return;
        }
        let h = window.half_edge;
        self.windows[w as usize].1 = self.last[h.index()];
        self.last[h.index()] = w;
        let apex = window.apex(domain);
        let [mut left, mut right] = [true, true];
        if apex.seen {
            let distance = self.roots[window.root as usize].distance + apex.distance;
            let best = self.split[h.index()];
            if distance > best.distance * DROPPED_PATH_FACTOR {
                left = apex.crossing <= best.crossing;
                right = apex.crossing >= best.crossing;
            } else if distance < best.distance {
                self.split[h.index()] = Split {
                    distance,
                    crossing: apex.crossing,
                };
            }
            self.arrive(domain, &window, &apex, distance);
        }
        let root = self.roots[window.root as usize].distance;
        // The rays to the left edge pass the half-edge's end, those to the right one its origin.
        let [start, target] = domain.half_edges.ends(h);
        if left && let Some((child, end)) = window.left(domain, &apex) {
            let v = target;
            if !self.is_beaten(&child, root, v, end, child.interval[0]) {
                self.enqueue(domain, child);
            }
        }
        if right && let Some((child, origin)) = window.right(domain, &apex) {
            let v = start;
            if !self.is_beaten(&child, root, v, origin, child.interval[1]) {
                self.enqueue(domain, child);
            }
        }
    }

    /// Offers the path through the window to its apex.
    fn arrive(&mut self, domain: &Domain, window: &EdgeWindow, apex: &Apex, distance: f64) {
        let leaving = window.half_edge.previous();
        let back = window.source - apex.at;
        let arrival = Arrival {
            half_edge: leaving,
            angle: (-apex.at).perp(&back).atan2((-apex.at).dot(&back)),
        };
        let reach = self.reach_by(window, apex.at - window.source, distance);
        self.offer(domain.half_edges.origin(leaving), reach, arrival);
    }

    /// Step 4, and upper bounds along edges, which make step 3 effective.
    fn leave_vertex(&mut self, domain: &Domain, v: VertexId) {
        let reach = self.reach[v.index()];
        if !(reach.distance > 0.0) {
            return; // The source itself.
        }
        let unit = reach.vector.try_normalize(0.0);
        let direction = unit.unwrap_or_else(Vec2::zeros);
        let arrival = self.arrival[v.index()];
        let around = domain.half_edges.around_from(arrival.half_edge);
        let corners: Vec<(HalfEdgeId, f64)> =
            around.map(|h| (h, corner_angle(domain, h))).collect();
        for &(h, _) in &corners {
            let distance = reach.distance + domain.length(h);
            let along = Reach {
                vector: direction * distance,
                distance,
            };
            let back = Arrival {
                half_edge: domain.half_edges.twin(h),
                angle: 0.0,
            };
            self.offer(domain.half_edges.target(h), along, back);
        }
        let whole: f64 = corners.iter().map(|c| c.1).sum();
        if whole <= TAU + SADDLE_EXCESS_RAD {
            return;
        }
        let root = self.roots.len() as u32;
        self.roots.push(Root {
            distance: reach.distance,
            direction: Some(direction),
        });
        let (low, high) = (PI - FAN_OVERLAP, whole - PI + FAN_OVERLAP);
        let mut start = -arrival.angle;
        for (h, angle) in corners {
            let fan = [(low - start).max(0.0), (high - start).min(angle)];
            if fan[0] < fan[1] {
                self.enqueue(domain, fan_window(domain, h, angle, fan, root));
            }
            start += angle;
        }
    }

    /// Whether a path through an end of the window's edge is shorter for all its rays.
    fn is_useless(&self, domain: &Domain, window: &EdgeWindow) -> bool {
        let root = self.roots[window.root as usize].distance;
        let [from, to] = domain.half_edges.ends(window.half_edge);
        let length = domain.length(window.half_edge);
        self.is_beaten(window, root, from, Vec2::zeros(), window.interval[1])
            || self.is_beaten(window, root, to, Vec2::new(length, 0.0), window.interval[0])
    }

    /// Whether the path through vertex `v`, at `place` in the window's frame, to place `x` of the
    /// edge is shorter than the straight one.
    fn is_beaten(&self, window: &EdgeWindow, root: f64, v: VertexId, place: Vec2, x: f64) -> bool {
        let detour = self.reach[v.index()].distance + (place.x - x).hypot(place.y);
        root + window.distance_at(x) > detour * DROPPED_PATH_FACTOR
    }

    /// Adds a window to the queue unless it is empty, useless or beyond the radius.
    fn enqueue(&mut self, domain: &Domain, window: EdgeWindow) {
        let root = self.roots[window.root as usize].distance;
        if !(window.interval[0] < window.interval[1]) {
            return;
        }
        let nearest = root + window.nearest();
        if !(nearest <= self.radius) || self.is_useless(domain, &window) {
            return;
        }
        let id = self.windows.len() as u32;
        self.windows.push((window, LIST_END));
        self.queue
            .push(Reverse((nearest.to_bits(), Event::Window(id))));
    }

    /// Stores a path to `v` if it is shorter than the one known.
    fn offer(&mut self, v: VertexId, reach: Reach, arrival: Arrival) {
        let known = &mut self.reach[v.index()];
        if self.done[v.index()] || reach.distance >= known.distance {
            return;
        }
        if known.distance == f64::INFINITY {
            self.visited.push(v);
        }
        *known = reach;
        self.arrival[v.index()] = arrival;
        self.queue
            .push(Reverse((reach.distance.to_bits(), Event::Vertex(v))));
    }

    /// The path from the source through a window along the vector `sight`.
    fn reach_by(&self, window: &EdgeWindow, sight: Vec2, distance: f64) -> Reach {
        let vector = match self.roots[window.root as usize].direction {
            Some(direction) => direction * distance,
            None => turned(window.turn, sight),
        };
        Reach { vector, distance }
    }

    fn clear(&mut self) {
        for v in self.visited.drain(..) {
            self.reach[v.index()] = Reach::UNKNOWN;
            self.done[v.index()] = false;
        }
        for (window, _) in self.windows.drain(..) {
            self.last[window.half_edge.index()] = LIST_END;
            self.split[window.half_edge.index()] = Split::UNSEEN;
        }
        self.roots.clear();
        self.source_triangles.clear();
        self.queue.clear();
    }
}

impl Split {
    const UNSEEN: Self = Self {
        distance: f64::INFINITY,
        crossing: 0.0,
    };
}

/// The triangles that contain a point of triangle `t`, each with the rotation from its frame to
/// that of `t`: one, two at an edge, or all around a vertex (counter-clockwise from `t`).
fn triangles_around(domain: &Domain, t: FaceId, weights: [f64; 3]) -> Vec<(FaceId, Vec2)> {
    let half_edges = &domain.half_edges;
    let mut found = vec![(t, Vec2::x())];
    let on = |k: usize| weights[k] > 0.0;
    match (0..3).filter(|&k| on(k)).count() {
        2 => {
            // The edge is opposite to the corner without weight.
            let k = (0..3).find(|&k| !on(k)).unwrap_or(0);
            let edge = t.half_edge(k).next();
            let turn = turn_across(domain, edge, Vec2::x());
            found.push((half_edges.twin(edge).face(), turn));
        }
        1 => {
            let k = (0..3).find(|&k| on(k)).unwrap_or(0);
            let mut turn = Vec2::x();
            let mut h = t.half_edge(k).previous();
            while half_edges.twin(h).face() != t {
                turn = turn_across(domain, h, turn);
                let across = half_edges.twin(h);
                found.push((across.face(), turn));
                h = across.previous();
            }
        }
        _ => {}
    }
    found
}

/// The rotation of the frame of the triangle across half-edge `h`, given that of its own.
fn turn_across(domain: &Domain, h: HalfEdgeId, turn: Vec2) -> Vec2 {
    let direction = |h: HalfEdgeId| {
        let flat = domain.flat(h.face());
        let k = h.corner();
        (flat[(k + 1) % 3] - flat[k]) / domain.length(h)
    };
    let there = -direction(domain.half_edges.twin(h));
    turned(turned(turn, direction(h)), Vec2::new(there.x, -there.y))
}

/// The angle of the corner that half-edge `h` leaves, rad.
fn corner_angle(domain: &Domain, h: HalfEdgeId) -> f64 {
    let (x, y) = domain.apex(h);
    y.atan2(x)
}

/// The window on the edge opposite to the origin of `h`, a corner of `angle` rad, between two
/// angles counter-clockwise from `h`.
fn fan_window(domain: &Domain, h: HalfEdgeId, angle: f64, fan: [f64; 2], root: u32) -> EdgeWindow {
    let opposite = h.next();
    let half_edge = domain.half_edges.twin(opposite);
    let [base, left, right] = [opposite, h, h.previous()].map(|h| domain.length(h));
    let (x, y) = domain.apex(opposite);
    // A ray at angle p divides the edge in the ratio of the areas on both sides.
    let cut = |p: f64| {
        let (one, other) = (left * p.sin(), right * (angle - p).sin());
        base * (other / (one + other)).clamp(0.0, 1.0)
    };
    let first = if fan[1] < angle { cut(fan[1]) } else { 0.0 };
    let last = if fan[0] > 0.0 { cut(fan[0]) } else { base };
    EdgeWindow {
        half_edge,
        interval: [first, last],
        source: Vec2::new(base - x, -y),
        turn: Vec2::x(),
        root,
    }
}

fn place(corners: &[Vec2; 3], [u, v, w]: [f64; 3]) -> Vec2 {
    corners[0] * u + corners[1] * v + corners[2] * w
}

fn straight(vector: Vec2) -> Reach {
    Reach {
        vector,
        distance: vector.norm(),
    }
}
