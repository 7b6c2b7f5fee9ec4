//! Exact distances and directions from one point of the surface to all near it.
//!
//! In: a closed triangle surface, a source (a triangle and barycentric coordinates; edges and
//! vertices allowed) and a radius. Out: the length and the first direction of a shortest path
//! to every vertex and every point within the radius.
//!
//! A shortest path is straight across edges, once their triangles are laid into one plane,
//! and bends at most at *saddle* vertices, whose angles exceed 2π (Mitchell, Mount &
//! Papadimitriou, "The discrete geodesic problem", SIAM J. Comput. 1987; made practical by
//! Surazhsky et al., SIGGRAPH 2005). So windows travel over the surface: the part of an edge
//! that the source, or a saddle in its stead (a *pseudo-source*), sees straight through a
//! strip of triangles.
//!
//! 1. The triangles that hold the source open a window on each of their far edges.
//! 2. The nearest window or vertex is taken from a queue. A window looks through its triangle
//!    at two further edges. Both get a window only if it reaches the vertex between them
//!    sooner than all before it through that edge; else only the one that it may still serve
//!    ("one angle, one split": Chen & Han, SoCG 1990).
//! 3. A window is dropped where a corner of the triangle behind it, at its known distance,
//!    offers every ray something shorter (Xin & Wang, "Improving Chen and Han's algorithm on
//!    the discrete geodesic problem", ACM Trans. Graph. 2009).
//! 4. A saddle opens windows where a path through it makes no angle below π on either side.
//! 5. It ends when the queue's nearest lies beyond the radius.
//!
//! **Exact** up to rounding (checked in this folder against a search through all strips, and
//! by `scripts/check_geodesics.py` against another implementation). Where several shortest
//! paths exist, one of them gives the direction. No bound better than O(n² log n) is known;
//! with the filters it behaves like the area within the radius.

#[cfg(test)]
mod brute_force;
#[cfg(test)]
mod tests;
mod window;

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::{PI, TAU};

use super::SurfacePoint;
use super::domain::{Domain, apex};
use super::geodesics::{GeodesicMap, Reach};
use crate::geometry::Vec2;
use crate::mesh::adjacency::{next, previous};
use window::{Apex, Window, in_frame, turned};

/// Barycentric coordinates up to this are 0: the source lies on an edge or a vertex.
const ON_EDGE: f64 = 1e-12;

/// Angle, rad, by which a vertex must exceed 2π to count as a saddle; less bends no path by
/// more than windows overlap.
const SADDLE: f64 = 1e-10;

/// Angle, rad, by which the windows of a saddle overlap those that pass it.
const FAN_OVERLAP: f64 = 1e-9;

/// Share by which a distance must be longer to be dropped for another: beyond rounding.
const LONGER: f64 = 1.0 + 1e-12;

const NONE: u32 = u32::MAX;

/// What the queue holds, by distance; vertices first where distances are equal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Event {
    Vertex(u32),
    Window(u32),
}

/// How the shortest path known comes to a vertex: `angle` rad counter-clockwise from
/// `half_edge`, which leaves the vertex, one looks back along it.
#[derive(Debug, Clone, Copy)]
struct Arrival {
    half_edge: u32,
    angle: f64,
}

/// The source or a saddle that stands for it.
#[derive(Debug, Clone, Copy)]
struct Root {
    /// Distance from the source, mm.
    distance: f64,
    /// First direction of the path to it; `None` for the source itself.
    direction: Option<Vec2>,
}

/// A triangle that holds the source: where, in the triangle's frame, and how that frame is
/// turned against that of the source's triangle.
#[derive(Debug, Clone, Copy)]
struct Home {
    triangle: u32,
    at: Vec2,
    turn: Vec2,
}

/// The nearest window so far that saw the vertex opposite a half-edge.
#[derive(Debug, Clone, Copy)]
struct Split {
    distance: f64,
    crossing: f64,
}

/// Exact geodesics round one source.
#[derive(Debug, Clone)]
pub(crate) struct ExactMap {
    reach: Vec<Reach>,
    arrival: Vec<Arrival>,
    done: Vec<bool>,
    visited: Vec<u32>,
    roots: Vec<Root>,
    homes: Vec<Home>,
    /// All windows of this source, each with the one before it on its half-edge.
    windows: Vec<(Window, u32)>,
    /// The last window that looked through each half-edge.
    last: Vec<u32>,
    split: Vec<Split>,
    queue: BinaryHeap<Reverse<(u64, Event)>>,
    radius: f64,
}

impl GeodesicMap for ExactMap {
    fn over(domain: &Domain) -> Self {
        let (vertices, half_edges) = (domain.vertices.len(), domain.lengths.len());
        let nowhere = Arrival {
            half_edge: NONE,
            angle: 0.0,
        };
        Self {
            reach: vec![Reach::UNKNOWN; vertices],
            arrival: vec![nowhere; vertices],
            done: vec![false; vertices],
            visited: Vec::new(),
            roots: Vec::new(),
            homes: Vec::new(),
            windows: Vec::new(),
            last: vec![NONE; half_edges],
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
                Event::Vertex(v) if !self.done[v as usize] => {
                    self.done[v as usize] = true;
                    self.leave_vertex(domain, v);
                }
                Event::Vertex(_) => {}
                Event::Window(w) => self.look_through(domain, w),
            }
        }
    }

    fn reach(&self, vertex: u32) -> Option<Reach> {
        self.done[vertex as usize].then(|| self.reach[vertex as usize])
    }

    fn visited(&self) -> &[u32] {
        &self.visited
    }

    fn reach_point(&self, domain: &Domain, point: &SurfacePoint) -> Option<Reach> {
        let t = point.triangle;
        let flat = domain.flat(t);
        let here = place(&flat, point.barycentric);
        if let Some(home) = self.homes.iter().find(|h| h.triangle == t) {
            return Some(straight(turned(home.turn, here - home.at)));
        }
        let mut best = Reach::UNKNOWN;
        for k in 0..3 {
            if let Some(corner) = self.reach(domain.triangles[t as usize][k]) {
                let distance = corner.distance + (here - flat[k]).norm();
                if distance < best.distance {
                    let unit = corner.vector.try_normalize(0.0);
                    best = Reach {
                        vector: unit.unwrap_or_else(Vec2::zeros) * distance,
                        distance,
                    };
                }
            }
            let axis = (flat[(k + 1) % 3] - flat[k]) / domain.lengths[3 * t as usize + k];
            let seen_from_edge = in_frame(axis, here - flat[k]);
            let mut w = self.last[3 * t as usize + k];
            while w != NONE {
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
    /// Step 1: the triangles that hold the source, their corners and far edges.
    fn leave_source(&mut self, domain: &Domain, source: &SurfacePoint) {
        let corners = domain.triangles[source.triangle as usize];
        let weights = source
            .barycentric
            .map(|x| if x > ON_EDGE { x } else { 0.0 });
        let weight_of = |v: u32| {
            let k = corners.iter().position(|c| *c == v);
            k.map_or(0.0, |k| weights[k])
        };
        for (triangle, turn) in triangles_round(domain, source.triangle, weights) {
            let flat = domain.flat(triangle);
            let ids = domain.triangles[triangle as usize];
            let shares = ids.map(weight_of);
            let at = place(&flat, shares);
            self.homes.push(Home { triangle, at, turn });
            for k in 0..3 {
                let (here, ahead) = (flat[k], flat[(k + 1) % 3]);
                let back = at - here;
                let arrival = Arrival {
                    half_edge: 3 * triangle + k as u32,
                    angle: (ahead - here).perp(&back).atan2((ahead - here).dot(&back)),
                };
                self.offer(ids[k], straight(turned(turn, here - at)), arrival);
                if shares[(k + 2) % 3] > 0.0 {
                    let half_edge = domain.adjacency.twin(3 * triangle + k as u32);
                    let length = domain.lengths[half_edge as usize];
                    let axis = (here - ahead) / length;
                    let unfolded = in_frame(axis, at - ahead);
                    self.enqueue(
                        domain,
                        Window {
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
    fn look_through(&mut self, domain: &Domain, w: u32) {
        let window = self.windows[w as usize].0;
        if self.is_useless(domain, &window) {
            return;
        }
        let h = window.half_edge;
        self.windows[w as usize].1 = self.last[h as usize];
        self.last[h as usize] = w;
        let apex = window.apex(domain);
        let [mut left, mut right] = [true, true];
        if apex.seen {
            let distance = self.roots[window.root as usize].distance + apex.distance;
            let best = self.split[h as usize];
            if distance > best.distance * LONGER {
                left = apex.crossing <= best.crossing;
                right = apex.crossing >= best.crossing;
            } else if distance < best.distance {
                self.split[h as usize] = Split {
                    distance,
                    crossing: apex.crossing,
                };
            }
            self.arrive(domain, &window, &apex, distance);
        }
        let root = self.roots[window.root as usize].distance;
        // Rays to the left edge come past the half-edge's end, which lies beyond them.
        if left && let Some((child, end)) = window.left(domain, &apex) {
            let v = domain.ends(h)[1];
            if !self.is_beaten(&child, root, v, end, child.interval[0]) {
                self.enqueue(domain, child);
            }
        }
        if right && let Some((child, origin)) = window.right(domain, &apex) {
            let v = domain.ends(h)[0];
            if !self.is_beaten(&child, root, v, origin, child.interval[1]) {
                self.enqueue(domain, child);
            }
        }
    }

    /// Offers the window's apex its distance.
    fn arrive(&mut self, domain: &Domain, window: &Window, apex: &Apex, distance: f64) {
        let leaving = previous(window.half_edge);
        let back = window.source - apex.at;
        let arrival = Arrival {
            half_edge: leaving,
            angle: (-apex.at).perp(&back).atan2((-apex.at).dot(&back)),
        };
        let reach = self.reach_by(window, apex.at - window.source, distance);
        self.offer(domain.ends(leaving)[0], reach, arrival);
    }

    /// Step 4, and the upper bounds along edges that make step 3 bite.
    fn leave_vertex(&mut self, domain: &Domain, v: u32) {
        let reach = self.reach[v as usize];
        if !(reach.distance > 0.0) {
            return; // The source itself.
        }
        let unit = reach.vector.try_normalize(0.0);
        let direction = unit.unwrap_or_else(Vec2::zeros);
        let arrival = self.arrival[v as usize];
        let corners: Vec<(u32, f64)> = (domain.adjacency.around(arrival.half_edge))
            .map(|h| (h, corner_angle(domain, h)))
            .collect();
        for &(h, _) in &corners {
            let distance = reach.distance + domain.lengths[h as usize];
            let along = Reach {
                vector: direction * distance,
                distance,
            };
            let back = Arrival {
                half_edge: domain.adjacency.twin(h),
                angle: 0.0,
            };
            self.offer(domain.ends(h)[1], along, back);
        }
        let whole: f64 = corners.iter().map(|c| c.1).sum();
        if whole <= TAU + SADDLE {
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

    /// Whether an end of the window's edge offers all its rays something shorter.
    fn is_useless(&self, domain: &Domain, window: &Window) -> bool {
        let root = self.roots[window.root as usize].distance;
        let [from, to] = domain.ends(window.half_edge);
        let length = domain.lengths[window.half_edge as usize];
        self.is_beaten(window, root, from, Vec2::zeros(), window.interval[1])
            || self.is_beaten(window, root, to, Vec2::new(length, 0.0), window.interval[0])
    }

    /// Whether vertex `v` at `place` of the window's frame is nearer to place `x` of the edge
    /// than the source is, through the window.
    fn is_beaten(&self, window: &Window, root: f64, v: u32, place: Vec2, x: f64) -> bool {
        let detour = self.reach[v as usize].distance + (place.x - x).hypot(place.y);
        root + window.distance_at(x) > detour * LONGER
    }

    fn enqueue(&mut self, domain: &Domain, window: Window) {
        let root = self.roots[window.root as usize].distance;
        if !(window.interval[0] < window.interval[1]) {
            return;
        }
        let nearest = root + window.nearest();
        if !(nearest <= self.radius) || self.is_useless(domain, &window) {
            return;
        }
        let id = self.windows.len() as u32;
        self.windows.push((window, NONE));
        self.queue
            .push(Reverse((nearest.to_bits(), Event::Window(id))));
    }

    fn offer(&mut self, v: u32, reach: Reach, arrival: Arrival) {
        let known = &mut self.reach[v as usize];
        if self.done[v as usize] || reach.distance >= known.distance {
            return;
        }
        if known.distance == f64::INFINITY {
            self.visited.push(v);
        }
        *known = reach;
        self.arrival[v as usize] = arrival;
        self.queue
            .push(Reverse((reach.distance.to_bits(), Event::Vertex(v))));
    }

    /// What a window sees, as seen from the first source.
    fn reach_by(&self, window: &Window, sight: Vec2, distance: f64) -> Reach {
        let vector = match self.roots[window.root as usize].direction {
            Some(direction) => direction * distance,
            None => turned(window.turn, sight),
        };
        Reach { vector, distance }
    }

    fn clear(&mut self) {
        for v in self.visited.drain(..) {
            self.reach[v as usize] = Reach::UNKNOWN;
            self.done[v as usize] = false;
        }
        for (window, _) in self.windows.drain(..) {
            self.last[window.half_edge as usize] = NONE;
            self.split[window.half_edge as usize] = Split::UNSEEN;
        }
        self.roots.clear();
        self.homes.clear();
        self.queue.clear();
    }
}

impl Split {
    const UNSEEN: Self = Self {
        distance: f64::INFINITY,
        crossing: 0.0,
    };
}

/// The triangles that hold a point of triangle `t`, and how each one's frame is turned against
/// that of `t`: one, two about an edge, or all round a vertex (counter-clockwise from `t`).
fn triangles_round(domain: &Domain, t: u32, weights: [f64; 3]) -> Vec<(u32, Vec2)> {
    let mut found = vec![(t, Vec2::x())];
    let on = |k: usize| weights[k] > 0.0;
    match (0..3).filter(|&k| on(k)).count() {
        2 => {
            // The edge's half-edge is the one before the corner without weight.
            let k = (0..3).find(|&k| !on(k)).unwrap_or(0);
            let edge = next(3 * t + k as u32);
            found.push((
                domain.adjacency.twin(edge) / 3,
                turn_across(domain, edge, Vec2::x()),
            ));
        }
        1 => {
            let k = (0..3).find(|&k| on(k)).unwrap_or(0);
            let mut turn = Vec2::x();
            let mut h = previous(3 * t + k as u32);
            while domain.adjacency.twin(h) / 3 != t {
                turn = turn_across(domain, h, turn);
                let across = domain.adjacency.twin(h);
                found.push((across / 3, turn));
                h = previous(across);
            }
        }
        _ => {}
    }
    found
}

/// The turn of the frame of the triangle across half-edge `h`, given that of its own.
fn turn_across(domain: &Domain, h: u32, turn: Vec2) -> Vec2 {
    let direction = |h: u32| {
        let flat = domain.flat(h / 3);
        let k = h as usize % 3;
        (flat[(k + 1) % 3] - flat[k]) / domain.lengths[h as usize]
    };
    let there = -direction(domain.adjacency.twin(h));
    turned(turned(turn, direction(h)), Vec2::new(there.x, -there.y))
}

/// The angle of the corner that half-edge `h` leaves, rad.
fn corner_angle(domain: &Domain, h: u32) -> f64 {
    let length = |h: u32| domain.lengths[h as usize];
    let (x, y) = apex(length(h), length(previous(h)), length(next(h)));
    y.atan2(x)
}

/// What the origin of `h`, a corner of `angle`, sees of the opposite edge between two angles
/// counter-clockwise from `h`.
fn fan_window(domain: &Domain, h: u32, angle: f64, fan: [f64; 2], root: u32) -> Window {
    let opposite = next(h);
    let half_edge = domain.adjacency.twin(opposite);
    let length = |h: u32| domain.lengths[h as usize];
    let (base, left, right) = (length(opposite), length(h), length(previous(h)));
    let (x, y) = apex(base, left, right);
    // A ray at angle p cuts the edge in the ratio of the two triangles' areas.
    let cut = |p: f64| {
        let (one, other) = (left * p.sin(), right * (angle - p).sin());
        base * (other / (one + other)).clamp(0.0, 1.0)
    };
    let first = if fan[1] < angle { cut(fan[1]) } else { 0.0 };
    let last = if fan[0] > 0.0 { cut(fan[0]) } else { base };
    Window {
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
