//! The paper's mutual tessellation: joins points on a surface to a mesh.
//!
//! In: a closed surface and points on its triangles. Out: a closed mesh whose vertices are
//! exactly the points, in their order. After Turk, "Re-Tiling Polygonal Surfaces", SIGGRAPH
//! 1992 (doi:10.1145/133994.134008), section 4:
//!
//! 1. [`mutual`]: every triangle that contains points is triangulated with them (constrained
//!    Delaunay triangulation, sides fixed). The surface stays the same; its vertices are now the
//!    old ones and the points.
//! 2. [`removal`]: the old vertices are removed one by one, lowest valence first, and the
//!    [`hole`] that each leaves is triangulated.
//!
//! Beyond the paper: holes whose boundary has no simple projection are closed in space; every
//! new triangle is tested exactly against all others, so an embedded surface stays embedded; at
//! vertices that cannot be removed, edges are flipped.
//!
//! Guaranteed for the result: exactly N vertices in their order; closed, edge- and
//! vertex-manifold; the components, genus and orientation of the surface; no self-intersection;
//! determined by the input alone.
//!
//! Not guaranteed: that there is a result. If a handle or a thin wall has too few points, the
//! error names what is stuck. Nor are the triangles well-shaped; flips improve that later.
//!
//! Takes O(n log n) in the number of triangles and points.

mod hole;
mod mutual;
mod patchwork;
mod planar;
mod removal;
#[cfg(test)]
pub(in crate::surface::retile) mod test_surfaces;

use crate::base::geometry::{Vec3, triangle};
use crate::base::progress::{Cancelled, Monitor};
use crate::mesh::ids::stored;
use crate::mesh::intersections::self_intersections;
use crate::mesh::topology::{self, Census, MeshDefect};
use crate::mesh::{FaceId, TriMesh, VertexId};
use crate::surface::retile::{SurfacePoint, orientation, quotas};

use patchwork::Patchwork;

/// Why the points could not be joined to a mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TessellateError {
    /// The surface is not a closed manifold.
    #[error("the surface is not a closed manifold: {0}")]
    OpenSurface(#[from] MeshDefect),
    /// The point's triangle does not exist, or its barycentric coordinates are invalid.
    #[error("point {point} does not lie on the surface")]
    UnusablePoint {
        /// Index of the point.
        point: u32,
    },
    /// Two points have the same position.
    #[error("points {} and {} have the same position", points[0], points[1])]
    CoincidentPoints {
        /// Indices of the points.
        points: [u32; 2],
    },
    /// A component of the surface has fewer points than any mesh of its genus.
    #[error(
        "component {component} of the surface (genus {genus}) has {points} points; a mesh of its \
         topology has at least {needed}"
    )]
    TooFewPoints {
        /// Number of the component, as in [`topology::components`].
        component: u32,
        /// Number of its handles.
        genus: i64,
        /// Number of points on it.
        points: usize,
        /// The smallest number of vertices of any mesh of this genus.
        needed: usize,
    },
    /// Vertices of the surface could not be removed without changing its topology.
    #[error("{} vertices of the surface cannot be removed without changing its topology", vertices.len())]
    Stuck {
        /// The vertices, ascending.
        vertices: Vec<VertexId>,
    },
    /// The mesh has another topology than the surface. The method cannot cause that; the check
    /// guards against mistakes in its implementation.
    #[error("the mesh has another topology than the surface: {after:?} instead of {before:?}")]
    TopologyChanged {
        /// The surface.
        before: Census,
        /// The mesh.
        after: Census,
    },
    /// A component has the opposite orientation than on the surface: it has too few points for
    /// its shape.
    #[error("the triangles at {} points have the wrong orientation", points.len())]
    InsideOut {
        /// Indices of the component's points, ascending.
        points: Vec<u32>,
    },
    /// Triangles intersect that did so on the surface already; removal adds no intersections.
    #[error("{} pairs of triangles intersect", pairs.len())]
    SelfIntersecting {
        /// Pairs of triangles of `mesh`.
        pairs: Vec<[FaceId; 2]>,
        /// The mesh, which meets all other guarantees.
        mesh: Box<TriMesh>,
    },
    /// Cancelled by the caller.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Joins `points` on the closed surface `vertices` (mm), `triangles` to a mesh with the
/// orientation of the surface.
///
/// # Errors
/// See [`TessellateError`].
pub fn tessellate(
    vertices: &[Vec3],
    triangles: &[[u32; 3]],
    points: &[SurfacePoint],
    monitor: &Monitor,
) -> Result<TriMesh, TessellateError> {
    let census = topology::check_triangles(vertices.len(), triangles)?;
    check_points(triangles, points)?;
    check_counts(vertices.len(), triangles, points)?;
    monitor.check()?;
    let all = mutual::mutual_tessellation(vertices, triangles, points)?;
    monitor.check()?;
    let positions: Vec<Vec3> = points
        .iter()
        .map(|p| p.position(vertices, triangles))
        .chain(vertices.iter().copied())
        .collect();
    let cell = grid_spacing(&positions, &all, points.len());
    let mut mesh = Patchwork::new(positions, all, cell);
    let stuck = removal::remove_old_vertices(&mut mesh, points.len(), monitor)?;
    if !stuck.is_empty() {
        let original = |v: VertexId| VertexId::from_index(v.index() - points.len());
        let vertices = stuck.into_iter().map(original).collect();
        return Err(TessellateError::Stuck { vertices });
    }
    let mut mesh = verify(finished(mesh, points.len()), &census)?;
    let component = topology::components(vertices.len(), triangles);
    let surface = TriMesh {
        vertices: vertices.to_vec(),
        triangles: triangles.to_vec(),
    };
    let of_point = |p: &SurfacePoint| component[triangles[p.triangle.index()][0] as usize];
    let of_points: Vec<u32> = points.iter().map(of_point).collect();
    let volumes = topology::component_volumes(&surface.vertices, &surface.triangles, &component);
    orientation::face_alike(&mut mesh, &of_points, &volumes)
        .map_err(|points| TessellateError::InsideOut { points })?;
    Ok(mesh)
}

fn check_points(triangles: &[[u32; 3]], points: &[SurfacePoint]) -> Result<(), TessellateError> {
    let usable = |p: &SurfacePoint| {
        let sum: f64 = p.barycentric.iter().sum();
        p.triangle.index() < triangles.len()
            && p.barycentric.iter().all(|x| *x >= 0.0)
            && (sum - 1.0).abs() < 1e-6
    };
    match points.iter().position(|p| !usable(p)) {
        Some(point) => Err(TessellateError::UnusablePoint {
            point: point as u32,
        }),
        None => Ok(()),
    }
}

/// Checks that every component has as many points as its genus needs.
fn check_counts(
    vertices: usize,
    triangles: &[[u32; 3]],
    points: &[SurfacePoint],
) -> Result<(), TessellateError> {
    let component_of = topology::components(vertices, triangles);
    let characteristics = topology::component_characteristics(triangles, &component_of);
    let mut counts = vec![0usize; characteristics.len()];
    for p in points {
        counts[component_of[triangles[p.triangle.index()][0] as usize] as usize] += 1;
    }
    for (component, (euler, points)) in (0u32..).zip(characteristics.into_iter().zip(counts)) {
        let needed = quotas::least_vertices(euler);
        if points < needed {
            return Err(TessellateError::TooFewPoints {
                component,
                genus: 1 - euler / 2,
                points,
                needed,
            });
        }
    }
    Ok(())
}

/// The geometric mean of the edge lengths before and after the removal of the old vertices, mm.
fn grid_spacing(positions: &[Vec3], triangles: &[[u32; 3]], points: usize) -> f64 {
    let area: f64 = triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            triangle::area_normal(&a, &b, &c).norm() / 2.0
        })
        .sum();
    let edge = |count: usize| (4.0 / 3f64.sqrt() * area / count.max(1) as f64).sqrt();
    (edge(triangles.len()) * edge(2 * points)).sqrt()
}

/// The mesh of the remaining triangles in a canonical order: each begins with its lowest vertex,
/// and the list is sorted.
fn finished(mesh: Patchwork, points: usize) -> TriMesh {
    let mut triangles: Vec<[u32; 3]> = mesh
        .live_triangles()
        .map(|t| {
            let mut t = stored(t);
            let lowest = (0..3).min_by_key(|&k| t[k]).unwrap_or(0);
            t.rotate_left(lowest);
            t
        })
        .collect();
    triangles.sort_unstable();
    let mut vertices = mesh.positions;
    vertices.truncate(points);
    TriMesh {
        vertices,
        triangles,
    }
}

/// Checks topology and self-intersections of the finished mesh.
fn verify(mesh: TriMesh, surface: &Census) -> Result<TriMesh, TessellateError> {
    let census = topology::check(&mesh)?;
    let kind = |c: &Census| (c.euler_characteristic, c.components);
    if kind(&census) != kind(surface) {
        return Err(TessellateError::TopologyChanged {
            before: *surface,
            after: census,
        });
    }
    let pairs = self_intersections(&mesh);
    if pairs.is_empty() {
        return Ok(mesh);
    }
    Err(TessellateError::SelfIntersecting {
        pairs,
        mesh: Box::new(mesh),
    })
}

#[cfg(test)]
mod tests {
    use super::test_surfaces::{double_torus, jittered, scattered, squeezed, together};
    use super::*;
    use crate::base::geometry::random::{Purpose, stream};
    use crate::base::progress::{CancelToken, Silent};
    use crate::mesh::shapes;
    use rand::RngExt;

    fn tile(surface: &TriMesh, n: usize, seed: u64) -> Result<TriMesh, TessellateError> {
        let points = scattered(surface, n, seed);
        tessellate(
            &surface.vertices,
            &surface.triangles,
            &points,
            &Monitor::silent(),
        )
    }

    fn check_guarantees(surface: &TriMesh, n: usize, seed: u64, mesh: &TriMesh) {
        let expected: Vec<Vec3> = scattered(surface, n, seed)
            .iter()
            .map(|p| p.position(&surface.vertices, &surface.triangles))
            .collect();
        assert_eq!(mesh.vertices, expected);
        let (before, after) = (
            topology::check(surface).unwrap(),
            topology::check(mesh).unwrap(),
        );
        assert_eq!(after.euler_characteristic, before.euler_characteristic);
        assert_eq!(after.components, before.components);
        assert_eq!(mesh.volume() > 0.0, surface.volume() > 0.0);
        assert_eq!(self_intersections(mesh), Vec::<[FaceId; 2]>::new());
    }

    /// Tiles a surface and checks every guarantee.
    fn check(surface: &TriMesh, n: usize, seed: u64) -> TriMesh {
        let mesh = tile(surface, n, seed).unwrap();
        check_guarantees(surface, n, seed, &mesh);
        mesh
    }

    #[test]
    fn spheres_and_cups_are_tiled_with_any_number_of_points() {
        let sphere = shapes::icosphere(30.0, 3);
        let cup = shapes::cup(70.0, 33.0, 10.0, 48);
        for seed in 0..12 {
            check(&sphere, 12 + 5 * seed as usize, seed);
            check(
                &cup,
                [67, 110, 150, 200, 300, 1000][seed as usize % 6],
                seed,
            );
        }
    }

    #[test]
    fn handles_and_components_are_kept() {
        let ring = shapes::torus(30.0, 12.0, 40, 24);
        let two = double_torus();
        let spheres = together(&[
            shapes::icosphere(20.0, 2),
            TriMesh {
                vertices: shapes::icosphere(9.0, 2)
                    .vertices
                    .iter()
                    .map(|v| v + Vec3::new(40.0, 0.0, 0.0))
                    .collect(),
                ..shapes::icosphere(9.0, 2)
            },
        ]);
        for seed in 0..8 {
            check(&ring, 150, seed);
            check(&two, 300, seed);
            check(&spheres, 200, seed);
        }
    }

    #[test]
    fn rough_and_stretched_surfaces_are_tiled() {
        for seed in 0..6 {
            check(&jittered(&shapes::icosphere(30.0, 3), 0.8, seed), 150, seed);
            check(
                &squeezed(&shapes::icosphere(30.0, 3), [1.0, 0.3, 2.0]),
                120,
                seed,
            );
            check(
                &squeezed(&shapes::torus(9.0, 3.0, 60, 8), [1.0, 1.0, 3.0]),
                200,
                seed,
            );
        }
    }

    #[test]
    fn hundreds_of_random_surfaces_keep_every_guarantee() {
        let mut rng = stream(1, Purpose::PhantomShape);
        let mut refused = 0;
        for seed in 0..240 {
            let base = match seed % 4 {
                0 => shapes::icosphere(30.0, 2),
                1 => shapes::torus(30.0, rng.random_range(6.0..20.0), 24, 12),
                2 => shapes::cup(70.0, 33.0, rng.random_range(3.0..15.0), 20),
                _ => together(&[
                    shapes::torus(30.0, 9.0, 18, 9),
                    shapes::icosphere(rng.random_range(3.0..18.0), 1),
                ]),
            };
            let scales = [(); 3].map(|()| rng.random_range(0.4..1.6));
            let surface = jittered(&squeezed(&base, scales), 0.3, seed);
            if !self_intersections(&surface).is_empty() {
                continue;
            }
            let n = rng.random_range(40..160);
            match tile(&surface, n, seed) {
                Ok(mesh) => check_guarantees(&surface, n, seed, &mesh),
                // The points are scattered at random: the small sphere may get too few.
                Err(TessellateError::TooFewPoints { .. }) => {}
                Err(TessellateError::Stuck { .. } | TessellateError::InsideOut { .. }) => {
                    refused += 1;
                }
                Err(other) => panic!("seed {seed}: {other}"),
            }
        }
        // Nor do thin walls and narrow tubes always get enough points.
        assert!(refused < 30, "{refused}");
    }

    #[test]
    fn many_points_on_few_triangles_and_the_reverse() {
        check(&shapes::icosphere(30.0, 0), 3000, 1);
        check(&shapes::tetrahedron(30.0), 500, 2);
        check(&shapes::icosphere(30.0, 5), 12, 3);
    }

    #[test]
    fn the_mesh_follows_the_surface() {
        // With 300 points on a sphere, chords of about 0.2 radii lose two percent of the volume.
        let sphere = shapes::icosphere(30.0, 4);
        let mesh = check(&sphere, 300, 1);
        let lost = 1.0 - mesh.volume() / sphere.volume();
        assert!((0.0..0.05).contains(&lost), "{lost}");
    }

    #[test]
    fn too_few_points_are_refused_with_the_least_number() {
        let two = double_torus();
        assert!(matches!(
            tile(&two, 8, 1),
            Err(TessellateError::TooFewPoints {
                genus: 2,
                points: 8,
                needed: 10,
                ..
            })
        ));
        let least_of_genus = |genus: i64| quotas::least_vertices(2 - 2 * genus);
        assert_eq!([0, 1, 2, 3].map(least_of_genus), [4, 7, 10, 10]);
    }

    #[test]
    fn sparse_points_give_a_mesh_or_an_error() {
        let (two, sheet) = (double_torus(), shapes::cup(70.0, 33.0, 0.5, 32));
        for seed in 0..20 {
            for outcome in [tile(&two, 14, seed), tile(&sheet, 40, seed)] {
                match outcome {
                    Ok(mesh) => assert!(topology::check(&mesh).is_ok()),
                    Err(TessellateError::Stuck { vertices }) => assert!(!vertices.is_empty()),
                    Err(TessellateError::InsideOut { points }) => assert!(!points.is_empty()),
                    Err(other) => panic!("{other}"),
                }
            }
        }
    }

    /// Few points repair such a surface, since none of its triangles is left. Many points lie on
    /// intersecting triangles, or old vertices between them cannot be removed.
    #[test]
    fn a_self_intersecting_surface_is_repaired_or_refused() {
        let surface = jittered(&shapes::icosphere(30.0, 2), 5.0, 1);
        assert!(!self_intersections(&surface).is_empty());
        let repaired = tile(&surface, 150, 1).unwrap();
        assert_eq!(self_intersections(&repaired), Vec::<[FaceId; 2]>::new());
        let refused = tile(&surface, 5000, 1);
        assert!(matches!(
            refused,
            Err(TessellateError::SelfIntersecting { .. } | TessellateError::Stuck { .. })
        ));
    }

    /// An icosahedron with edges of 10 mm, of which as many points make triangles of a quarter of the area.
    #[test]
    fn the_grid_is_as_fine_as_the_edges_before_and_after() {
        let unit = shapes::icosphere(1.0, 0);
        let [a, b, _] = unit.corners(0);
        let ball = shapes::icosphere(10.0 / (a - b).norm(), 0);
        let spacing = |points| grid_spacing(&ball.vertices, &ball.triangles, points);
        assert!((spacing(10) - 10.0).abs() < 1e-9);
        assert!((spacing(40) - (10.0f64 * 5.0).sqrt()).abs() < 1e-9);
        assert!(spacing(0).is_finite());
    }

    #[test]
    fn a_finished_mesh_is_checked_again() {
        let ball = shapes::icosphere(10.0, 1);
        let census = topology::check(&ball).unwrap();
        assert_eq!(verify(ball.clone(), &census), Ok(ball.clone()));
        let two = together(&[ball.clone(), squeezed(&ball, [0.5; 3])]);
        let ring = shapes::torus(9.0, 3.0, 12, 6);
        for other in [&two, &ring] {
            let outcome = verify(other.clone(), &census);
            assert!(matches!(
                outcome,
                Err(TessellateError::TopologyChanged { .. })
            ));
        }
        let mut open = ball.clone();
        open.triangles.pop();
        assert!(matches!(
            verify(open, &census),
            Err(TessellateError::OpenSurface(_))
        ));
        let mut folded = ball;
        folded.vertices[0] *= -1.1;
        let Err(TessellateError::SelfIntersecting { pairs, mesh }) =
            verify(folded.clone(), &census)
        else {
            panic!("a vertex was pulled through the ball");
        };
        assert_eq!((pairs, *mesh), (self_intersections(&folded), folded));
    }

    /// The error names the first component that lacks points, its handles and how many it needs.
    #[test]
    fn a_component_with_too_few_points_is_named() {
        let mut far = shapes::torus(9.0, 3.0, 12, 6);
        far.vertices.iter_mut().for_each(|v| v.x += 100.0);
        let surface = together(&[shapes::icosphere(10.0, 0), far]);
        let on = |triangle: u32, n: usize| {
            let point = SurfacePoint {
                triangle: FaceId(triangle),
                barycentric: [0.2, 0.3, 0.5],
            };
            vec![point; n]
        };
        let check = |ball: usize, ring: usize| {
            let points = [on(3, ball), on(25, ring)].concat();
            check_counts(surface.vertices.len(), &surface.triangles, &points)
        };
        assert_eq!(check(4, 7), Ok(()));
        for (ball, ring, component, genus, points, needed) in
            [(3, 9, 0, 0, 3, 4), (5, 6, 1, 1, 6, 7), (4, 0, 1, 1, 0, 7)]
        {
            let expected = TessellateError::TooFewPoints {
                component,
                genus,
                points,
                needed,
            };
            assert_eq!(check(ball, ring), Err(expected));
        }
    }

    /// The vertices that removal leaves lie at the positions of those that the error names.
    #[test]
    fn stuck_vertices_are_named_by_their_numbers_on_the_surface() {
        let surface = double_torus();
        let mut seen = 0;
        for seed in 0..2 {
            let points = scattered(&surface, 14, seed);
            let Err(TessellateError::Stuck { vertices }) = tile(&surface, 14, seed) else {
                continue;
            };
            let all = mutual::mutual_tessellation(&surface.vertices, &surface.triangles, &points);
            let mut positions = vec![Vec3::zeros(); 14];
            positions.extend(&surface.vertices);
            points.iter().zip(&mut positions).for_each(|(p, place)| {
                *place = p.position(&surface.vertices, &surface.triangles);
            });
            let mut mesh = Patchwork::new(positions, all.unwrap(), 5.0);
            let left = removal::remove_old_vertices(&mut mesh, 14, &Monitor::silent()).unwrap();
            let left: Vec<Vec3> = left.iter().map(|v| mesh.position(*v)).collect();
            let named: Vec<Vec3> = vertices
                .iter()
                .map(|v| surface.vertices[v.index()])
                .collect();
            assert_eq!(named, left);
            seen += 1;
        }
        assert!(seen > 0);
    }

    #[test]
    fn triangles_begin_with_their_lowest_vertex_and_are_sorted() {
        let mesh = check(&shapes::icosphere(30.0, 2), 60, 3);
        assert!(mesh.triangles.iter().all(|[a, b, c]| a < b && a < c));
        assert!(mesh.triangles.is_sorted());
    }

    #[test]
    fn invalid_points_are_reported() {
        let sphere = shapes::icosphere(1.0, 1);
        for (triangle, x) in [(80, 0.2), (3, f64::NAN), (3, -0.1), (3, 0.9)] {
            let mut points = scattered(&sphere, 20, 1);
            points[5] = SurfacePoint {
                triangle: FaceId(triangle),
                barycentric: [x, 0.3, 0.5],
            };
            let outcome = tessellate(
                &sphere.vertices,
                &sphere.triangles,
                &points,
                &Monitor::silent(),
            );
            assert_eq!(outcome, Err(TessellateError::UnusablePoint { point: 5 }));
        }
    }

    #[test]
    fn cancelling_ends_the_tessellation() {
        let sphere = shapes::icosphere(1.0, 2);
        let token = CancelToken::new();
        token.cancel();
        let outcome = tessellate(
            &sphere.vertices,
            &sphere.triangles,
            &scattered(&sphere, 20, 1),
            &Monitor::new(&Silent, token),
        );
        assert_eq!(outcome, Err(TessellateError::Cancelled(Cancelled)));
    }

    #[test]
    fn the_mesh_does_not_depend_on_the_number_of_threads() {
        let cup = shapes::cup(70.0, 33.0, 10.0, 32);
        let one = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .unwrap();
        assert_eq!(one.install(|| tile(&cup, 150, 4)), tile(&cup, 150, 4));
    }
}
