//! One window: the part of an edge that a source sees through a strip of unfolded triangles.
//!
//! A window lies on a half-edge of the triangle it looks *into*. That triangle is laid into
//! the plane with the half-edge's origin at 0, its end on the x axis, the apex above; the
//! source, unfolded into the same plane, lies below.

use crate::geometry::Vec2;
use crate::mesh::adjacency::{next, previous};
use crate::retile::domain::{Domain, apex};

/// How far beyond its ends, as a share of the edge, a window still sees: neighbouring windows
/// must not leave a gap where a ray meets a vertex.
const OVERLAP: f64 = 1e-9;

/// Windows narrower than this share of their edge are dropped; far less than [`OVERLAP`].
const NARROWEST: f64 = 1e-14;

/// See the module's page.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    /// Half-edge of the triangle that the window looks into.
    pub half_edge: u32,
    /// First and last place that is seen, from the half-edge's origin, mm.
    pub interval: [f64; 2],
    /// The (pseudo-)source, unfolded.
    pub source: Vec2,
    /// The window's x axis in the frame of the first source's triangle, as cosine and sine.
    pub turn: Vec2,
    /// Which (pseudo-)source sees.
    pub root: u32,
}

/// The third corner of a window's triangle.
pub(super) struct Apex {
    /// Where it lies.
    pub at: Vec2,
    /// Its distance from the unfolded source, mm.
    pub distance: f64,
    /// Where on the edge the ray to it passes, mm from the origin.
    pub crossing: f64,
    /// Whether that is inside the window.
    pub seen: bool,
}

/// Complex product: `b` turned by `a`.
pub(super) fn turned(a: Vec2, b: Vec2) -> Vec2 {
    Vec2::new(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x)
}

/// Coordinates of `p` along and across the unit vector `axis`.
pub(super) fn in_frame(axis: Vec2, p: Vec2) -> Vec2 {
    Vec2::new(axis.dot(&p), axis.perp(&p))
}

impl Window {
    /// Where on the x axis the ray from the source to `p` (above the axis) passes.
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
        crossing >= first - OVERLAP * edge && crossing <= last + OVERLAP * edge
    }

    /// The distance from the source to the nearest place of the window, mm.
    pub fn nearest(&self) -> f64 {
        let [first, last] = self.interval;
        let x = self.source.x.clamp(first, last);
        (self.source.x - x).hypot(self.source.y)
    }

    /// The source's distance from place `x` of the edge, mm.
    pub fn distance_at(&self, x: f64) -> f64 {
        (self.source.x - x).hypot(self.source.y)
    }

    /// The third corner of the triangle.
    pub fn apex(&self, domain: &Domain) -> Apex {
        let h = self.half_edge;
        let length = |h: u32| domain.lengths[h as usize];
        let (x, y) = apex(length(h), length(previous(h)), length(next(h)));
        let at = Vec2::new(x, y);
        let crossing = self.crossing(at);
        Apex {
            at,
            distance: (at - self.source).norm(),
            crossing,
            seen: self.sees(crossing, length(h)),
        }
    }

    /// The vector from the source to `p` of the triangle, if `p` is seen.
    pub fn sight(&self, domain: &Domain, p: Vec2) -> Option<Vec2> {
        let edge = domain.lengths[self.half_edge as usize];
        (self.sees(self.crossing(p), edge)).then(|| p - self.source)
    }

    /// What is seen of the edge from the half-edge's origin to the apex, and where the
    /// half-edge's end lies in that window's frame.
    pub fn left(&self, domain: &Domain, apex: &Apex) -> Option<(Self, Vec2)> {
        let [first, last] = self.interval;
        let seen = [first, last.min(apex.crossing)];
        let across = domain.adjacency.twin(previous(self.half_edge));
        let end = Vec2::new(domain.lengths[self.half_edge as usize], 0.0);
        self.through(domain, across, Vec2::zeros(), apex.at, seen, end)
    }

    /// What is seen of the edge from the apex to the half-edge's end, and where the
    /// half-edge's origin lies in that window's frame.
    pub fn right(&self, domain: &Domain, apex: &Apex) -> Option<(Self, Vec2)> {
        let [first, last] = self.interval;
        let seen = [first.max(apex.crossing), last];
        let across = domain.adjacency.twin(next(self.half_edge));
        let end = Vec2::new(domain.lengths[self.half_edge as usize], 0.0);
        self.through(domain, across, apex.at, end, seen, Vec2::zeros())
    }

    /// The window on the edge `from` - `to`, through the places `seen` of this one; the third
    /// corner comes along into the new frame.
    fn through(
        &self,
        domain: &Domain,
        half_edge: u32,
        from: Vec2,
        to: Vec2,
        seen: [f64; 2],
        third: Vec2,
    ) -> Option<(Self, Vec2)> {
        if !(seen[1] > seen[0]) {
            return None;
        }
        let length = domain.lengths[half_edge as usize];
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
        let wide = interval[1] - interval[0] > NARROWEST * length;
        wide.then(|| (window, in_frame(axis, third - from)))
    }
}
