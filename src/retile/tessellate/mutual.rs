//! Step one: the mutual tessellation of old vertices and points.
//!
//! In: the surface and the points. Out: triangles over both. Every triangle that contains points
//! is triangulated in its own plane with its three sides as constraints. No side is split, so
//! neighbours still match and the surface stays the same set; only its triangles are smaller.

use rayon::prelude::*;

use super::TessellateError;
use super::planar::{PlanarError, constrained_delaunay};
use crate::geometry::{Vec2, Vec3};
use crate::mesh::FaceId;
use crate::retile::SurfacePoint;

/// Smallest barycentric coordinate of a point in its triangle's plane. It keeps points off the
/// sides, beyond which rounding could put them.
const SMALLEST_SHARE: f64 = 1e-6;

/// Height over longest side below which a triangle is triangulated as if it were equilateral; in
/// its own frame the result would depend on rounding.
const FLATTEST: f64 = 1e-6;

/// The triangles over the points, which are numbered first, and the old vertices, numbered after
/// them.
pub(super) fn mutual_tessellation(
    vertices: &[Vec3],
    triangles: &[[u32; 3]],
    points: &[SurfacePoint],
) -> Result<Vec<[u32; 3]>, TessellateError> {
    let mut contained: Vec<(FaceId, u32)> =
        (0..).zip(points).map(|(i, p)| (p.triangle, i)).collect();
    contained.sort_unstable();
    let old_vertex = |v: u32| v + points.len() as u32;
    let mut has_points = vec![false; triangles.len()];
    for (t, _) in &contained {
        has_points[t.index()] = true;
    }
    let plain = (0..triangles.len()).filter(|&t| !has_points[t]);
    let mut all: Vec<[u32; 3]> = plain.map(|t| triangles[t].map(old_vertex)).collect();
    let groups: Vec<&[(FaceId, u32)]> = contained.chunk_by(|p, q| p.0 == q.0).collect();
    let split: Vec<Result<Vec<[u32; 3]>, TessellateError>> = groups
        .into_par_iter()
        .map(|group| {
            let triangle = triangles[group[0].0.index()];
            let corners = triangle.map(|v| vertices[v as usize]);
            let ids: Vec<u32> = group.iter().map(|p| p.1).collect();
            split_triangle(&corners, &ids, points).map(|parts| {
                let id = |number: u32| match number {
                    0..3 => old_vertex(triangle[number as usize]),
                    _ => ids[number as usize - 3],
                };
                parts.into_iter().map(|part| part.map(id)).collect()
            })
        })
        .collect();
    for parts in split {
        all.extend(parts?);
    }
    Ok(all)
}

/// The parts of one triangle. Vertices 0, 1, 2 are its corners, those from 3 on the points `ids`.
fn split_triangle(
    corners: &[Vec3; 3],
    ids: &[u32],
    points: &[SurfacePoint],
) -> Result<Vec<[u32; 3]>, TessellateError> {
    let attempt = |frame: [Vec2; 3]| {
        let mut places = frame.to_vec();
        places.extend(ids.iter().map(|&id| {
            let shares = points[id as usize]
                .barycentric
                .map(|x| x.max(SMALLEST_SHARE));
            let [u, v, w] = shares.map(|x| x / shares.iter().sum::<f64>());
            frame[0] * u + frame[1] * v + frame[2] * w
        }));
        constrained_delaunay(&places, 3)
    };
    let own = own_frame(corners).map(attempt);
    match own.unwrap_or(Err(PlanarError::NotSimple)) {
        Err(PlanarError::NotSimple) => attempt(equilateral()),
        done => done,
    }
    .map_err(|error| match error {
        PlanarError::Coincident([i, j]) if i >= 3 => TessellateError::CoincidentPoints {
            points: [ids[i as usize - 3], ids[j as usize - 3]],
        },
        // Cannot happen in the equilateral frame, where every point lies well inside.
        _ => TessellateError::UnusablePoint { point: ids[0] },
    })
}

/// The triangle in its own plane, with its longest side scaled to 1; `None` if it is too flat.
fn own_frame([a, b, c]: &[Vec3; 3]) -> Option<[Vec2; 3]> {
    let (ab, ac) = (b - a, c - a);
    let longest = ab.norm().max(ac.norm()).max((c - b).norm());
    let base = ab.norm();
    let doubled_area = ab.cross(&ac).norm();
    if !(doubled_area > FLATTEST * longest * longest) || !(base > FLATTEST * longest) {
        return None;
    }
    let along = ab.dot(&ac) / base;
    Some([
        Vec2::zeros(),
        Vec2::new(base / longest, 0.0),
        Vec2::new(along / longest, doubled_area / base / longest),
    ])
}

fn equilateral() -> [Vec2; 3] {
    [[0.0, 0.0], [1.0, 0.0], [0.5, 3f64.sqrt() / 2.0]].map(Vec2::from)
}

#[cfg(test)]
mod tests {
    use super::super::test_surfaces::scattered;
    use super::*;
    use crate::mesh::{TriMesh, shapes, topology};

    #[test]
    fn the_own_frame_is_the_triangle_with_its_longest_side_scaled_to_one() {
        let corners = [
            Vec3::new(1.0, 2.0, 3.0),
            Vec3::new(6.0, 1.0, 4.0),
            Vec3::new(2.0, 9.0, -1.0),
        ];
        for turn in 0..3 {
            let corners = [0, 1, 2].map(|k| corners[(k + turn) % 3]);
            let frame = own_frame(&corners).unwrap();
            let sides = [(0, 1), (1, 2), (2, 0)];
            let lengths = sides.map(|(k, m)| (corners[k] - corners[m]).norm());
            let longest = lengths.into_iter().fold(0.0, f64::max);
            for ((k, m), length) in sides.into_iter().zip(lengths) {
                assert!(((frame[k] - frame[m]).norm() - length / longest).abs() < 1e-12);
            }
            // Counter-clockwise, with the first corner at the origin and the second one on the x axis.
            assert_eq!((frame[0], frame[1].y), (Vec2::zeros(), 0.0));
            assert!(frame[1].perp(&frame[2]) > 0.0);
        }
        assert!(own_frame(&[corners[0], corners[1], corners[1]]).is_none());
    }

    #[test]
    fn keeps_the_surface_and_its_topology() {
        for (mesh, n) in [
            (shapes::icosphere(10.0, 0), 500),
            (shapes::torus(9.0, 3.0, 20, 10), 100),
            (shapes::cup(60.0, 30.0, 8.0, 24), 40),
        ] {
            let before = topology::check(&mesh).unwrap();
            let points = scattered(&mesh, n, 7);
            let triangles = mutual_tessellation(&mesh.vertices, &mesh.triangles, &points).unwrap();
            let mut vertices: Vec<Vec3> = points
                .iter()
                .map(|p| p.position(&mesh.vertices, &mesh.triangles))
                .collect();
            vertices.extend(&mesh.vertices);
            let finer = TriMesh {
                vertices,
                triangles,
            };
            let after = topology::check(&finer).unwrap();
            assert_eq!(after.euler_characteristic, before.euler_characteristic);
            assert_eq!(after.vertices, before.vertices + n);
            assert!((finer.area() / mesh.area() - 1.0).abs() < 1e-12);
            assert!((finer.volume() / mesh.volume() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn points_with_the_same_position_are_reported() {
        let mesh = shapes::tetrahedron(1.0);
        let point = |w: f64| SurfacePoint {
            triangle: FaceId(2),
            barycentric: [0.5, 0.5 - w, w],
        };
        let points = [point(0.1), point(0.3), point(0.2), point(0.3)];
        assert_eq!(
            mutual_tessellation(&mesh.vertices, &mesh.triangles, &points),
            Err(TessellateError::CoincidentPoints { points: [1, 3] })
        );
    }

    #[test]
    fn slivers_and_points_on_sides_are_triangulated() {
        let vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.0, 0.0]].map(Vec3::from);
        let points =
            [[0.0, 0.5, 0.5], [1.0, 0.0, 0.0], [0.2, 0.3, 0.5]].map(|barycentric| SurfacePoint {
                triangle: FaceId(0),
                barycentric,
            });
        let parts = mutual_tessellation(&vertices, &[[0, 1, 2]], &points).unwrap();
        assert_eq!(parts.len(), 7);
    }
}
