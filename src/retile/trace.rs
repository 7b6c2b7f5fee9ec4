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

/// Barycentric coordinates that are positive, sum to 1 and keep off the triangle's edges:
/// those that come too near are pulled towards the centroid.
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
    use crate::mesh::shapes;

    fn domain(mesh: crate::mesh::TriMesh) -> Domain {
        Domain::new(mesh.vertices, mesh.triangles).unwrap()
    }

    #[test]
    fn walking_back_returns_to_the_start() {
        let domain = domain(shapes::torus(9.0, 3.0, 40, 17));
        for (n, angle) in [0.1, 0.9, 2.2, 3.3, 4.9, 6.0].into_iter().enumerate() {
            let start = SurfacePoint {
                triangle: 100 * n as u32,
                barycentric: [0.2, 0.5, 0.3],
            };
            let step = Vec2::new(f64::cos(angle), f64::sin(angle)) * 7.0;
            let (end, heading) = walk(&domain, &start, step);
            let (back, heading) = walk(&domain, &end, -heading * 7.0);
            // The far end may have been moved off an edge by a fraction of its triangle.
            let position = |p: &SurfacePoint| p.position(&domain.vertices, &domain.triangles);
            assert!((position(&back) - position(&start)).norm() < 5e-3, "{n}");
            assert!((heading + step / 7.0).norm() < 5e-3 || back.triangle != start.triangle);
        }
    }

    #[test]
    fn every_geodesic_of_a_tetrahedron_closes() {
        // A regular tetrahedron unrolls to the triangular lattice: going 2 edges along a
        // side's direction leads back to the same place.
        let domain = domain(shapes::tetrahedron(10.0));
        let start = SurfacePoint {
            triangle: 0,
            barycentric: [0.5, 0.3, 0.2],
        };
        let (end, heading) = walk(&domain, &start, Vec2::new(20.0, 0.0));
        assert_eq!(end.triangle, 0);
        for k in 0..3 {
            assert!((end.barycentric[k] - start.barycentric[k]).abs() < 1e-9);
        }
        assert!((heading - Vec2::x()).norm() < 1e-9);
    }
}
