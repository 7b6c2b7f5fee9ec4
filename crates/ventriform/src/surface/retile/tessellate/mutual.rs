//! Step one: the mutual tessellation of old vertices and points.
//!
//! In: the surface and the points. Out: triangles over both. Every triangle that contains points
//! is triangulated in its own plane with its three sides as constraints. No side is split, so
//! neighbours still match and the surface stays the same set; only its triangles are smaller.

use rayon::prelude::*;

use super::TessellateError;
use super::planar::{PlanarError, constrained_delaunay};
use crate::base::geometry::{Vec2, Vec3};
use crate::mesh::FaceId;
use crate::surface::retile::SurfacePoint;

/// Smallest barycentric coordinate of a point in its triangle's plane. It keeps points off the
/// sides, beyond which rounding could put them.
const SMALLEST_SHARE: f64 = 1e-6;

/// Height over longest side below which a triangle is triangulated as if it were equilateral; in
/// its own frame the result would depend on rounding.
const MIN_FLATNESS: f64 = 1e-6;

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
    // The height over any side is at most the longest one, so no side is shorter than the limit.
    if !(doubled_area > MIN_FLATNESS * longest * longest) {
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
    use std::collections::BTreeSet;

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
    fn a_triangle_has_an_own_frame_if_its_height_exceeds_the_limit_whatever_its_size() {
        for size in [1e-3, 1.0, 1e3] {
            for (height, own) in [(0.9, false), (1.1, true)] {
                let top = Vec3::new(0.3, 0.0, height * MIN_FLATNESS);
                let corners = [Vec3::zeros(), Vec3::x(), top].map(|p| p * size);
                for turn in 0..3 {
                    let corners = [0, 1, 2].map(|k| corners[(k + turn) % 3]);
                    assert_eq!(own_frame(&corners).is_some(), own, "{size} {height}");
                }
            }
        }
    }

    /// Points inside one triangle, as many as `n`.
    fn inside(n: usize, seed: u64) -> Vec<SurfacePoint> {
        let any = TriMesh {
            vertices: equilateral().map(|p| Vec3::new(p.x, p.y, 0.0)).to_vec(),
            triangles: vec![[0, 1, 2]],
        };
        scattered(&any, n, seed)
    }

    /// The circle through the corners of a part has no other point of the triangle inside, all parts face as the
    /// triangle does, and they cover it.
    #[test]
    fn the_parts_of_a_triangle_are_delaunay_in_its_plane() {
        let corners = [[1.0, 2.0, 3.0], [12.0, 1.0, 4.0], [2.0, 5.0, -1.0]].map(Vec3::from);
        for turn in 0..3 {
            let vertices = [0, 1, 2].map(|k| corners[(k + turn) % 3]);
            let points = inside(15, turn as u64);
            let parts = mutual_tessellation(&vertices, &[[0, 1, 2]], &points).unwrap();
            let place = |p: &SurfacePoint| p.position(&vertices, &[[0, 1, 2]]);
            let all: Vec<Vec3> = points.iter().map(place).chain(vertices).collect();
            let whole = (vertices[1] - vertices[0]).cross(&(vertices[2] - vertices[0]));
            let mut covered = 0.0;
            for part in parts {
                let [a, b, c] = part.map(|v| all[v as usize]);
                let (ab, ac) = (b - a, c - a);
                let normal = ab.cross(&ac);
                assert!(normal.dot(&whole) > 0.0);
                covered += normal.norm();
                let to_centre =
                    normal.cross(&ab) * ac.norm_squared() + ac.cross(&normal) * ab.norm_squared();
                let to_centre = to_centre / (2.0 * normal.norm_squared());
                for p in &all {
                    let distance = (p - a - to_centre).norm();
                    assert!(distance > to_centre.norm() * (1.0 - 1e-9));
                }
            }
            assert!((covered / whole.norm() - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_sliver_is_divided_as_an_equilateral_triangle_is() {
        let tall = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.75f64.sqrt(), 0.0]].map(Vec3::from);
        let flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.9, 1e-8, 0.0]].map(Vec3::from);
        for seed in 0..10 {
            let points = inside(8, seed);
            let parts = |vertices: &[Vec3; 3]| -> BTreeSet<[u32; 3]> {
                let parts = mutual_tessellation(vertices, &[[0, 1, 2]], &points).unwrap();
                let from_lowest = |mut part: [u32; 3]| {
                    let lowest = (0..3).min_by_key(|&k| part[k]).unwrap();
                    part.rotate_left(lowest);
                    part
                };
                parts.into_iter().map(from_lowest).collect()
            };
            assert_eq!(parts(&flat), parts(&tall));
        }
    }

    #[test]
    fn points_on_corners_and_sides_become_vertices_beside_them() {
        let vertices = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [1.0, 3.0, 0.0]].map(Vec3::from);
        let points = [
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.4, 0.6],
        ];
        let points = points.map(|barycentric| SurfacePoint {
            triangle: FaceId(0),
            barycentric,
        });
        let parts = mutual_tessellation(&vertices, &[[0, 1, 2]], &points).unwrap();
        // A point inside adds two triangles.
        assert_eq!(parts.len(), 9);
        for v in 0..7 {
            assert!(parts.iter().flatten().any(|c| *c == v), "{v}");
        }
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
        for (first, second) in [(1, 3), (0, 1), (2, 5), (4, 5)] {
            let mut points: Vec<_> = (0..6).map(|n| point(0.4 - 0.05 * f64::from(n))).collect();
            points[second] = points[first];
            assert_eq!(
                mutual_tessellation(&mesh.vertices, &mesh.triangles, &points),
                Err(TessellateError::CoincidentPoints {
                    points: [first as u32, second as u32]
                })
            );
        }
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
