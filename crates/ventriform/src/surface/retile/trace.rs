//! Straight paths on the surface.
//!
//! In: a point of the surface and a step in the frame of its triangle. Out: the point at the end
//! of the straightest geodesic in that direction (Polthier and Schmies 1998): at each edge the
//! path continues as if the next triangle were unfolded into the plane of the last one.
//! Crossings are kept slightly away from the ends of the edge, so a path never meets a vertex,
//! where "straight" is not unique.

use super::SurfacePoint;
use super::domain::Domain;
use crate::base::geometry::Vec2;

/// Smallest distance of a crossing from the ends of the edge, as a fraction of its length.
const END_MARGIN: f64 = 1e-7;

/// Largest number of edges that one path crosses; no path on a regular surface comes near it.
const MAX_CROSSINGS: usize = 10_000;

/// Shift of points near an edge of their triangle towards its centroid, as a fraction of
/// the way.
pub(crate) const EDGE_INSET: f64 = 2e-3;

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
    if scaled.iter().all(|x| *x >= EDGE_INSET / 3.0) {
        return scaled;
    }
    scaled.map(|x| x * (1.0 - EDGE_INSET) + EDGE_INSET / 3.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::mesh::{FaceId, shapes};
    use crate::surface::retile::surface_samples::WeightedSamples;

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

    /// Over many triangles of one flat side: the end and the heading are those of the straight line in space.
    #[test]
    fn paths_on_a_flat_side_are_straight_in_space() {
        let coarse = shapes::tetrahedron(64.0);
        let fine = WeightedSamples::new(&coarse.vertices, &coarse.vertices, &coarse.triangles, 500);
        let domain = Domain::new(fine.working, fine.triangles).unwrap();
        let normal = coarse.area_normal(0).normalize();
        let corners = coarse.corners(0);
        let middle: Vec3 = corners.iter().sum::<Vec3>() / 3.0;
        let triangles = domain.half_edges.triangles();
        let axes = |p: &SurfacePoint| {
            let [a, b, _] = triangles[p.triangle.index()];
            let along = (domain.vertices[b as usize] - domain.vertices[a as usize]).normalize();
            [along, normal.cross(&along)]
        };
        let place = |p: &SurfacePoint| p.position(&domain.vertices, triangles);
        let mut walked = 0;
        for t in 0..triangles.len() {
            let start = SurfacePoint {
                triangle: FaceId::from_index(t),
                barycentric: [0.3, 0.5, 0.2],
            };
            // The incircle of the side has a radius of 18.5 mm.
            if (place(&start) - middle).norm() > 8.0 {
                continue;
            }
            for k in 0..16 {
                let angle = 0.1 + std::f64::consts::TAU * f64::from(k) / 16.0;
                let step = Vec2::new(angle.cos(), angle.sin()) * (0.2 + 0.6 * f64::from(k));
                let (end, heading) = walk(&domain, &start, step);
                let [x, y] = axes(&start);
                let expected = place(&start) + x * step.x + y * step.y;
                // The end is moved away from edges by at most a thousandth of a triangle.
                assert!((place(&end) - expected).norm() < 0.01);
                let [u, v] = axes(&end);
                let turned = u * heading.x + v * heading.y;
                assert!((turned - (x * step.x + y * step.y).normalize()).norm() < 1e-9);
                assert!((end.barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                walked += 1;
            }
        }
        assert!(walked > 100, "{walked}");
        let start = SurfacePoint {
            triangle: FaceId(5),
            barycentric: [0.3, 0.5, 0.2],
        };
        assert_eq!(walk(&domain, &start, Vec2::zeros()).0, start);
    }

    /// A prism over a square, unrolled: all its sides together are a strip.
    #[test]
    fn a_path_around_a_prism_is_straight_once_unrolled() {
        let mut mesh = crate::mesh::TriMesh::default();
        for z in [0.0, 100.0] {
            for (x, y) in [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)] {
                mesh.vertices.push(Vec3::new(x, y, z));
            }
        }
        for k in 0..4 {
            let l = (k + 1) % 4;
            mesh.triangles.extend([[k, l, l + 4], [k, l + 4, k + 4]]);
        }
        mesh.triangles
            .extend([[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]);
        let domain = domain(mesh);
        // Triangle 0 has its frame along the first side of the square.
        let start = SurfacePoint {
            triangle: FaceId(0),
            barycentric: [0.5, 0.3, 0.2],
        };
        for (around, up) in [
            (7.0, 3.0),
            (23.0, 30.0),
            (-36.0, 20.0),
            (55.0, -5.0),
            (81.0, 40.0),
        ] {
            let (end, _) = walk(&domain, &start, Vec2::new(around, up));
            let p = end.position(&domain.vertices, domain.half_edges.triangles());
            // Barycentric coordinates 0.5, 0.3, 0.2 are 5 mm along and 20 mm up.
            let (s, z) = ((5.0 + around + 200.0) % 40.0, 20.0 + up);
            let (x, y) = match (s / 10.0) as usize {
                0 => (s, 0.0),
                1 => (10.0, s - 10.0),
                2 => (30.0 - s, 10.0),
                _ => (0.0, 40.0 - s),
            };
            assert!((p - Vec3::new(x, y, z)).norm() < 0.3, "{around} {up}: {p}");
        }
    }

    #[test]
    fn barycentric_coordinates_give_the_point_back() {
        let corners = [[1.0, 2.0], [7.0, 3.0], [2.0, 9.0]].map(Vec2::from);
        for p in [[3.0, 4.0], [1.0, 2.0], [6.0, 4.0], [20.0, -5.0]].map(Vec2::from) {
            let [u, v, w] = barycentric(&corners, &p);
            assert!((u + v + w - 1.0).abs() < 1e-12);
            assert!((corners[0] * u + corners[1] * v + corners[2] * w - p).norm() < 1e-12);
        }
        for flat in [
            [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]],
            [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]],
        ] {
            let coordinates = barycentric(&flat.map(Vec2::from), &Vec2::new(0.3, 0.1));
            assert_eq!(coordinates, [1.0 / 3.0; 3]);
        }
    }

    #[test]
    fn points_near_an_edge_are_moved_inside_and_others_are_not() {
        let inside = [0.2, 0.5, 0.3];
        assert!((0..3).all(|k| (inset(inside)[k] - inside[k]).abs() < 1e-15));
        for x in [0.0, 1e-9, 0.5 * EDGE_INSET / 3.0, -0.01] {
            for k in 0..3 {
                let mut near = [0.6 - x, 0.4, x];
                near.rotate_left(k);
                let moved = inset(near);
                assert!((moved.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                assert!(moved.iter().all(|x| *x >= EDGE_INSET / 3.0));
                // Towards the centroid, by a small share of the way.
                let clipped = near.map(|x| x.max(0.0));
                let sum: f64 = clipped.iter().sum();
                for m in 0..3 {
                    let from = clipped[m] / sum;
                    assert!((moved[m] - from - EDGE_INSET * (1.0 / 3.0 - from)).abs() < 1e-12);
                }
            }
        }
        let limit = EDGE_INSET / 3.0;
        let just = [1.0 - 2.0 * 1.01 * limit, 1.01 * limit, 1.01 * limit];
        assert!((inset(just)[1] - 1.01 * limit).abs() < 1e-12);
    }

    /// A ray leaves by the side that it meets first, at the place where it does.
    #[test]
    fn a_ray_leaves_through_the_first_side_ahead() {
        let corners = [[0.0, 0.0], [8.0, 0.0], [3.0, 6.0]].map(Vec2::from);
        let here = Vec2::new(3.5, 2.0);
        for k in 0..40 {
            let angle = 0.03 + std::f64::consts::TAU * f64::from(k) / 40.0;
            let direction = Vec2::new(angle.cos(), angle.sin());
            let (edge, distance, share) = exit(&corners, here, direction, None).unwrap();
            let (a, b) = (corners[edge], corners[(edge + 1) % 3]);
            let end = here + direction * distance;
            assert!((a + (b - a) * share - end).norm() < 1e-9);
            // It is the boundary: a little further is outside, a little less inside.
            let is_inside = |p: Vec2| barycentric(&corners, &p).iter().all(|x| *x > 0.0);
            assert!(is_inside(here + direction * (distance - 1e-6)));
            assert!(!is_inside(here + direction * (distance + 1e-6)));
            // From the side just crossed there is another way out, or none.
            let other = exit(&corners, here, direction, Some(edge));
            assert!(other.is_none_or(|(next, further, _)| next != edge && further >= distance));
        }
        // Through a corner: the crossing stays off the ends of the side.
        let (_, _, share) = exit(&corners, here, (corners[2] - here).normalize(), None).unwrap();
        assert!((END_MARGIN..=1.0 - END_MARGIN).contains(&share));
    }
}
