//! Straight paths on the surface.
//!
//! In: a point of the surface and a step in the frame of its triangle. Out: the point at the end
//! of the straightest geodesic in that direction (Polthier and Schmies 1998): at each edge the
//! path continues as if the next triangle were unfolded into the plane of the last one.
//! Crossings are kept slightly away from the ends of the edge, so a path never meets a vertex,
//! where "straight" is not unique.

use super::SurfacePoint;
use super::domain::Domain;
use crate::geometry::Vec2;

/// Smallest distance of a crossing from the ends of the edge, as a fraction of its length.
const END_MARGIN: f64 = 1e-7;

/// Largest number of edges that one path crosses; no path on a regular surface comes near it.
const MAX_CROSSINGS: usize = 10_000;

/// How far points near an edge of their triangle are moved towards its centroid, as a fraction of
/// the way.
pub(crate) const INSET: f64 = 2e-3;

/// Follows the straight path of length and direction `step` (mm, in the frame of the start's
/// triangle). Returns its end and the unit direction there (in the frame of the last triangle).
pub(crate) fn walk(domain: &Domain, start: &SurfacePoint, step: Vec2) -> (SurfacePoint, Vec2) {
    let mut triangle = start.triangle;
    let mut corners = domain.flat(triangle);
    let [u, v, w] = start.barycentric;
    let mut here = corners[0] * u + corners[1] * v + corners[2] * w;
    let mut remaining = step.norm();
    if !(remaining > 0.0) {
        return (*start, Vec2::x());
    }
    let mut direction = step / remaining;
    let mut entry = None;
    for _ in 0..MAX_CROSSINGS {
        let Some((edge, distance, share)) = exit(&corners, here, direction, entry) else {
            break;
        };
        if distance >= remaining {
            here += direction * remaining;
            break;
        }
        remaining -= distance;
        let (a, b) = (corners[edge], corners[(edge + 1) % 3]);
        let along = (b - a).normalize();
        let turned = Vec2::new(direction.dot(&along), along.perp(&direction));
        let twin = domain.half_edges.twin(triangle.half_edge(edge));
        triangle = twin.face();
        let k = twin.corner();
        corners = domain.flat(triangle);
        // In the next triangle the edge runs in the opposite direction.
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

/// The edge through which the ray leaves the triangle, the distance to it and the position on it
/// as a fraction of its length.
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
        // Outside is to the right of the edge.
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

/// Barycentric coordinates that are positive, add up to 1 and are not too close to an edge:
/// points close to one are moved towards the centroid.
pub(crate) fn inset(barycentric: [f64; 3]) -> [f64; 3] {
    let clipped = barycentric.map(|x| x.max(0.0));
    let sum: f64 = clipped.iter().sum();
    let scaled = clipped.map(|x| x / sum);
    if scaled.iter().all(|x| *x >= INSET / 3.0) {
        return scaled;
    }
    scaled.map(|x| x * (1.0 - INSET) + INSET / 3.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{FaceId, shapes};

    fn domain(mesh: crate::mesh::TriMesh) -> Domain {
        Domain::new(mesh.vertices, mesh.triangles).unwrap()
    }

    #[test]
    fn walking_back_returns_to_the_start() {
        let domain = domain(shapes::torus(9.0, 3.0, 40, 17));
        for (n, angle) in [0.1, 0.9, 2.2, 3.3, 4.9, 6.0].into_iter().enumerate() {
            let start = SurfacePoint {
                triangle: FaceId(100 * n as u32),
                barycentric: [0.2, 0.5, 0.3],
            };
            let step = Vec2::new(f64::cos(angle), f64::sin(angle)) * 7.0;
            let (end, heading) = walk(&domain, &start, step);
            let (back, heading) = walk(&domain, &end, -heading * 7.0);
            // The far end may have been moved away from an edge.
            let position =
                |p: &SurfacePoint| p.position(&domain.vertices, domain.half_edges.triangles());
            assert!((position(&back) - position(&start)).norm() < 5e-3, "{n}");
            assert!((heading + step / 7.0).norm() < 5e-3 || back.triangle != start.triangle);
        }
    }

    #[test]
    fn every_geodesic_of_a_tetrahedron_closes() {
        // A regular tetrahedron unfolds to the triangular lattice: a path two edges long and
        // parallel to a side returns to its start.
        let domain = domain(shapes::tetrahedron(10.0));
        let start = SurfacePoint {
            triangle: FaceId(0),
            barycentric: [0.5, 0.3, 0.2],
        };
        let (end, heading) = walk(&domain, &start, Vec2::new(20.0, 0.0));
        assert_eq!(end.triangle, FaceId(0));
        for k in 0..3 {
            assert!((end.barycentric[k] - start.barycentric[k]).abs() < 1e-9);
        }
        assert!((heading - Vec2::x()).norm() < 1e-9);
    }
}
