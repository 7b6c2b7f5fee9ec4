//! Walking straight on the surface.
//!
//! A straightest geodesic (Polthier & Schmies 1998) crosses an edge as if the next triangle
//! were turned into the plane of the last one. The crossing is kept a hair away from the
//! edge's ends, so the walk never meets a vertex, where "straight" has no single meaning.

use super::SurfacePoint;
use super::domain::Domain;
use crate::geometry::Vec2;

/// How near, as a share of the edge, a crossing may come to its ends.
const END_MARGIN: f64 = 1e-7;

/// Most edges one walk may cross: far beyond any walk on a sane surface.
const MOST_CROSSINGS: usize = 10_000;

/// How far points are kept from their triangle's edges, as a share towards its centroid.
pub(crate) const INSET: f64 = 2e-3;

/// Walks `step` (mm, in the frame of the start's triangle) and returns where that ends and the
/// direction there (unit length, in the frame of the last triangle).
pub(crate) fn walk(domain: &Domain, start: &SurfacePoint, step: Vec2) -> (SurfacePoint, Vec2) {
    let mut triangle = start.triangle;
    let mut corners = domain.flat(triangle);
    let [u, v, w] = start.barycentric;
    let mut here = corners[0] * u + corners[1] * v + corners[2] * w;
    let mut left = step.norm();
    if !(left > 0.0) {
        return (*start, Vec2::x());
    }
    let mut direction = step / left;
    let mut entry = None;
    for _ in 0..MOST_CROSSINGS {
        let Some((edge, distance, share)) = exit(&corners, here, direction, entry) else {
            break;
        };
        if distance >= left {
            here += direction * left;
            break;
        }
        left -= distance;
        let (a, b) = (corners[edge], corners[(edge + 1) % 3]);
        let along = (b - a).normalize();
        let turned = Vec2::new(direction.dot(&along), along.perp(&direction));
        let twin = domain.adjacency.twin(3 * triangle + edge as u32);
        triangle = twin / 3;
        let k = twin as usize % 3;
        corners = domain.flat(triangle);
        // The same edge runs the other way in the next triangle.
        let (a, b) = (corners[(k + 1) % 3], corners[k]);
        let along = (b - a).normalize();
        here = a + (b - a) * share;
        direction = along * turned.x + Vec2::new(-along.y, along.x) * turned.y;
        entry = Some(k);
    }
    let point = SurfacePoint {
        triangle,
        barycentric: inset(barycentric(&corners, &here)),
    };
    (point, direction)
}

/// The edge by which the ray leaves the triangle, the way to it and where on it.
fn exit(
    corners: &[Vec2; 3],
    here: Vec2,
    direction: Vec2,
    entry: Option<usize>,
) -> Option<(usize, f64, f64)> {
    let mut best: Option<(usize, f64, f64)> = None;
    for k in 0..3 {
        if entry == Some(k) {
            continue;
        }
        let (a, edge) = (corners[k], corners[(k + 1) % 3] - corners[k]);
        // Outward means to the right of the edge.
        let speed = direction.perp(&edge);
        if !(speed > 0.0) {
            continue;
        }
        let distance = ((a - here).perp(&edge) / speed).max(0.0);
        if best.is_none_or(|(_, d, _)| distance < d) {
            let at = here + direction * distance;
            let share = (at - a).dot(&edge) / edge.norm_squared();
            best = Some((k, distance, share.clamp(END_MARGIN, 1.0 - END_MARGIN)));
        }
    }
    best
}

fn barycentric(corners: &[Vec2; 3], p: &Vec2) -> [f64; 3] {
    let [a, b, c] = corners;
    let whole = (b - a).perp(&(c - a));
    if !(whole > 0.0) {
        return [1.0 / 3.0; 3];
    }
    let v = (p - a).perp(&(c - a)) / whole;
    let w = (b - a).perp(&(p - a)) / whole;
    [1.0 - v - w, v, w]
}

/// Barycentric coordinates pulled off the triangle's edges; positive, sum 1.
pub(crate) fn inset(barycentric: [f64; 3]) -> [f64; 3] {
    let clipped = barycentric.map(|x| x.max(0.0));
    let sum: f64 = clipped.iter().sum();
    clipped.map(|x| x / sum * (1.0 - INSET) + INSET / 3.0)
}
