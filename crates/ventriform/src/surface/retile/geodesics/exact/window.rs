//! A window: the part of an edge that is visible from a source through a strip of unfolded
//! triangles.
//!
//! A window lies on a half-edge and is followed into the triangle of that half-edge. In the
//! window's frame the half-edge runs from the origin along the x axis, the third corner (apex)
//! of the triangle lies above, and the unfolded source below.

use crate::base::geometry::Vec2;
use crate::mesh::HalfEdgeId;
use crate::surface::retile::domain::Domain;

/// Extent of a window beyond its ends, as a fraction of the edge. Otherwise neighbouring
/// windows could leave a gap where a ray meets a vertex.
const WINDOW_OVERLAP: f64 = 1e-9;

/// Width, as a fraction of the edge, below which windows are dropped; far less than [`WINDOW_OVERLAP`].
const MIN_WINDOW_WIDTH: f64 = 1e-14;

/// The visible part of an edge, in its own frame; see the module's documentation.
#[derive(Debug, Clone, Copy)]
pub(super) struct EdgeWindow {
    /// Half-edge of the triangle on the far side of the window.
    pub half_edge: HalfEdgeId,
    /// Start and end of the visible part, mm from the half-edge's origin.
    pub interval: [f64; 2],
    /// The source or pseudo-source, unfolded, mm.
    pub source: Vec2,
    /// The window's x axis in the frame of the source's triangle, as cosine and sine.
    pub turn: Vec2,
    /// Index of the source or pseudo-source.
    pub root: u32,
}

/// The third corner of a window's triangle.
pub(super) struct Apex {
    /// Position, mm.
    pub at: Vec2,
    /// Distance from the unfolded source, mm.
    pub distance: f64,
    /// Place at which the ray to it crosses the edge, mm from the origin.
    pub crossing: f64,
    /// Whether the ray passes through the window.
    pub seen: bool,
}

/// The complex product: `b` rotated by `a`.
pub(super) fn turned(a: Vec2, b: Vec2) -> Vec2 {
    Vec2::new(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x)
}

/// The coordinates of `p` along and across the unit vector `axis`.
pub(super) fn in_frame(axis: Vec2, p: Vec2) -> Vec2 {
    Vec2::new(axis.dot(&p), axis.perp(&p))
}

impl EdgeWindow {
    /// The place at which the ray from the source to `p` (above the x axis) crosses the x axis.
    fn crossing(&self, p: Vec2) -> f64 {
        let rise = p.y - self.source.y;
        if rise > 0.0 {
            self.source.x + (p.x - self.source.x) * (-self.source.y / rise)
        } else {
            p.x
        }
    }

    fn sees(&self, crossing: f64, edge: f64) -> bool {
        let [first, last] = self.interval;
        crossing >= first - WINDOW_OVERLAP * edge && crossing <= last + WINDOW_OVERLAP * edge
    }

    /// The smallest distance from the source to the window, mm.
    pub fn nearest(&self) -> f64 {
        let [first, last] = self.interval;
        let x = self.source.x.clamp(first, last);
        (self.source.x - x).hypot(self.source.y)
    }

    /// The distance from the source to place `x` on the edge, mm.
    pub fn distance_at(&self, x: f64) -> f64 {
        (self.source.x - x).hypot(self.source.y)
    }

    /// The third corner of the triangle.
    pub fn apex(&self, domain: &Domain) -> Apex {
        let h = self.half_edge;
        let (x, y) = domain.apex(h);
        let at = Vec2::new(x, y);
        let crossing = self.crossing(at);
        Apex {
            at,
            distance: (at - self.source).norm(),
            crossing,
            seen: self.sees(crossing, domain.length(h)),
        }
    }

    /// The vector from the source to `p`, a point of the triangle, if it passes through the window.
    pub fn sight(&self, domain: &Domain, p: Vec2) -> Option<Vec2> {
        let edge = domain.length(self.half_edge);
        (self.sees(self.crossing(p), edge)).then(|| p - self.source)
    }

    /// The window on the edge from the half-edge's origin to the apex, and the half-edge's end in
    /// that window's frame.
    pub fn left(&self, domain: &Domain, apex: &Apex) -> Option<(Self, Vec2)> {
        let [first, last] = self.interval;
        let seen = [first, last.min(apex.crossing)];
        let across = domain.half_edges.twin(self.half_edge.previous());
        let end = Vec2::new(domain.length(self.half_edge), 0.0);
        self.through(domain, across, Vec2::zeros(), apex.at, seen, end)
    }

    /// The window on the edge from the apex to the half-edge's end, and the half-edge's origin in
    /// that window's frame.
    pub fn right(&self, domain: &Domain, apex: &Apex) -> Option<(Self, Vec2)> {
        let [first, last] = self.interval;
        let seen = [first.max(apex.crossing), last];
        let across = domain.half_edges.twin(self.half_edge.next());
        let end = Vec2::new(domain.length(self.half_edge), 0.0);
        self.through(domain, across, apex.at, end, seen, Vec2::zeros())
    }

    /// The window on the edge from `from` to `to` that is visible through the part `seen` of this
    /// one, and `third` in that window's frame.
    fn through(
        &self,
        domain: &Domain,
        half_edge: HalfEdgeId,
        from: Vec2,
        to: Vec2,
        seen: [f64; 2],
        third: Vec2,
    ) -> Option<(Self, Vec2)> {
        if !(seen[1] > seen[0]) {
            return None;
        }
        let length = domain.length(half_edge);
        let axis = (to - from) / length;
        let mut source = in_frame(axis, self.source - from);
        source.y = source.y.min(0.0);
        let interval = seen.map(|x| {
            let gate = in_frame(axis, Vec2::new(x, 0.0) - from);
            let rise = gate.y - source.y;
            let hit = if rise > 0.0 {
                source.x + (gate.x - source.x) * (-source.y / rise)
            } else {
                gate.x
            };
            hit.clamp(0.0, length)
        });
        let window = Self {
            half_edge,
            interval,
            source,
            turn: turned(self.turn, axis),
            root: self.root,
        };
        let wide = interval[1] - interval[0] > MIN_WINDOW_WIDTH * length;
        wide.then(|| (window, in_frame(axis, third - from)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    fn length(v: Vec2) -> f64 {
        v.norm()
    }

    /// The place at which the line from `s` to `p` crosses the x axis.
    fn crossing(s: Vec2, p: Vec2) -> f64 {
        (s.x * p.y - p.x * s.y) / (p.y - s.y)
    }

    fn windows(domain: &Domain) -> Vec<EdgeWindow> {
        let mut windows = Vec::new();
        for (n, half_edge) in domain.half_edges.half_edges().enumerate() {
            let edge = domain.length(half_edge);
            let at = |share: f64| edge * share;
            for (k, source) in [[-0.4, -0.9], [0.3, -2.0], [0.8, -0.2], [1.5, -1.1]]
                .into_iter()
                .enumerate()
            {
                let interval = [[0.0, 1.0], [0.2, 0.5], [0.6, 0.95], [0.4, 0.45]][(n + k) % 4];
                let angle = n as f64 + 0.5;
                windows.push(EdgeWindow {
                    half_edge,
                    interval: interval.map(at),
                    source: Vec2::from(source.map(at)),
                    turn: Vec2::new(angle.cos(), angle.sin()),
                    root: k as u32,
                });
            }
        }
        windows
    }

    fn domain() -> Domain {
        let mut mesh = shapes::icosphere(10.0, 0);
        for (n, v) in mesh.vertices.iter_mut().enumerate() {
            *v *= 1.0 + 0.3 * (n as f64 * 1.3).sin();
        }
        Domain::new(mesh.vertices, mesh.triangles).expect("closed")
    }

    #[test]
    fn distances_through_a_window_are_straight() {
        let domain = domain();
        let mut seen = [0; 2];
        for window in windows(&domain) {
            let s = window.source;
            let (x, y) = domain.apex(window.half_edge);
            let apex = window.apex(&domain);
            assert_eq!(apex.at, Vec2::new(x, y));
            assert!((apex.distance - length(apex.at - s)).abs() < 1e-12);
            assert!((apex.crossing - crossing(s, apex.at)).abs() < 1e-9);
            let [first, last] = window.interval;
            let through = |p: Vec2| (first..=last).contains(&crossing(s, p));
            assert_eq!(apex.seen, through(apex.at));
            seen[usize::from(apex.seen)] += 1;
            for p in [
                apex.at * 0.3,
                apex.at * 0.9,
                Vec2::new(x * 0.5 + 1.0, y * 0.4),
            ] {
                let sight = window.sight(&domain, p);
                assert_eq!(sight, through(p).then(|| p - s));
            }
            // The nearest place of the window, among many.
            let places = (0..=1000).map(|k| first + (last - first) * f64::from(k) / 1000.0);
            let nearest = places
                .map(|x| length(s - Vec2::new(x, 0.0)))
                .fold(f64::INFINITY, f64::min);
            assert!(window.nearest() < nearest + 1e-9 && window.nearest() > nearest - 0.01);
            assert!((window.distance_at(first) - length(s - Vec2::new(first, 0.0))).abs() < 1e-12);
        }
        assert!(seen.iter().all(|n| *n > 20), "{seen:?}");
    }

    /// The two edges behind a window, each in its own frame: the source is as far from their ends as before, the
    /// visible part is what the rays through the window hit, and directions turn by the same angle.
    #[test]
    fn windows_are_unfolded_onto_the_next_edges() {
        let domain = domain();
        let mut made = [0; 2];
        for window in windows(&domain) {
            let h = window.half_edge;
            let apex = window.apex(&domain);
            let s = window.source;
            let end = Vec2::new(domain.length(h), 0.0);
            let [first, last] = window.interval;
            // The ends of the edge, the third corner, and the part of the window through which the edge is seen.
            let left = (
                Vec2::zeros(),
                apex.at,
                end,
                [first, last.min(apex.crossing)],
            );
            let right = (
                apex.at,
                end,
                Vec2::zeros(),
                [first.max(apex.crossing), last],
            );
            let children = [window.left(&domain, &apex), window.right(&domain, &apex)];
            for (side, ((from, to, third, gate), child)) in
                [left, right].into_iter().zip(children).enumerate()
            {
                let Some((child, third_there)) = child else {
                    assert!(gate[1] - gate[0] < 1e-9);
                    continue;
                };
                made[side] += 1;
                assert!(gate[1] > gate[0]);
                let across = length(to - from);
                let edge = if side == 0 { h.previous() } else { h.next() };
                assert_eq!(child.half_edge, domain.half_edges.twin(edge));
                assert!((domain.length(child.half_edge) - across).abs() < 1e-9);
                assert_eq!(child.root, window.root);
                for (here, there) in [(s, child.source), (third, third_there)] {
                    assert!((length(there) - length(here - from)).abs() < 1e-9);
                    let far = length(there - Vec2::new(across, 0.0));
                    assert!((far - length(here - to)).abs() < 1e-9);
                    assert!(there.y < 1e-12);
                }
                for k in 0..2 {
                    let hit = from + (to - from) * (child.interval[k] / across);
                    assert!((crossing(s, hit) - gate[k]).abs() < 1e-6 * end.x);
                }
                let axis = (to - from) / across;
                let turned_back = Vec2::new(
                    child.turn.dot(&window.turn),
                    window.turn.x * child.turn.y - window.turn.y * child.turn.x,
                );
                assert!(length(turned_back - axis) < 1e-9);
            }
        }
        assert!(made.iter().all(|n| *n > 100), "{made:?}");
    }
}
