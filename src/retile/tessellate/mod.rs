//! The paper's mutual tessellation: from points on a surface to a mesh of exactly them.
//!
//! In: a closed surface and points on its triangles. Out: a closed mesh whose vertices are
//! exactly the points, in their order. After Turk, "Re-Tiling Polygonal Surfaces", SIGGRAPH
//! 1992 (doi:10.1145/133994.134008), section 4:
//!
//! 1. [`mutual`]: every triangle that carries points is triangulated with them (constrained
//!    Delaunay, sides fixed). Same surface, old vertices and points together.
//! 2. [`removal`]: the old vertices go one by one, lowest valence first; the [`hole`] that each
//!    leaves is triangulated anew.
//!
//! Beyond the paper: holes whose ring has no simple projection are closed in space; every new
//! triangle is tested exactly against all others, so that an embedded surface stays embedded;
//! stuck vertices lose edges by flips.
//!
//! **Guaranteed** for what is returned: exactly N vertices in order, closed, edge- and
//! vertex-manifold, components, genus and orientation of the surface, no self-intersection.
//! **Not** guaranteed: that there is an answer. Too few points for a handle or a thin wall
//! end in an error that names them. Nothing is said about the shape of the triangles; flips
//! see to that afterwards.
//!
//! Deterministic: the answer depends on the input alone. O(n log n) in surface triangles and
//! points.

mod hole;
mod mutual;
mod patchwork;
mod planar;
mod removal;
#[cfg(test)]
mod samples;

use crate::geometry::Vec3;
use crate::mesh::TriMesh;
use crate::mesh::intersections::self_intersections;
use crate::mesh::topology::{self, Census, Defect};
use crate::progress::{Cancelled, Monitor};
use crate::retile::{SurfacePoint, orientation};

use patchwork::Patchwork;

/// Why the points cannot be joined to a mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TessellateError {
    /// Asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The surface is not a closed manifold.
    #[error("the surface is not a closed manifold: {0}")]
    OpenSurface(#[from] Defect),
    /// The point names no triangle of the surface, or its coordinates are not finite.
    #[error("point {point} does not lie on the surface")]
    UnusablePoint {
        /// Index of the point.
        point: u32,
    },
    /// Two points lie in the same place.
    #[error("points {points:?} lie in the same place")]
    CoincidentPoints {
        /// Indices of the points.
        points: [u32; 2],
    },
    /// A component of the surface has fewer points than any mesh of its genus needs.
    #[error(
        "component {component} of the surface (genus {genus}) carries {points} points; \
         {needed} are the least that can"
    )]
    TooFewPoints {
        /// Number of the component, as [`topology::components`] counts.
        component: u32,
        /// Its handles.
        genus: i64,
        /// The points on it.
        points: usize,
        /// The least that any mesh of this genus has.
        needed: usize,
    },
    /// Vertices of the surface stayed: without them the points would lose its topology.
    #[error("{} vertices of the surface cannot be removed without changing its topology", vertices.len())]
    Stuck {
        /// The vertices, ascending.
        vertices: Vec<u32>,
    },
    /// The mesh is not of the surface's kind. Step two cannot do that; were there a mistake in it,
    /// the mesh would end here.
    #[error("the mesh has another topology than the surface: {after:?} instead of {before:?}")]
    TopologyChanged {
        /// The surface.
        before: Census,
        /// The mesh.
        after: Census,
    },
    /// A component faces the other way than on the surface: too few points for its shape.
    #[error("the triangles of {} points face the wrong way", points.len())]
    InsideOut {
        /// The component's points, ascending.
        points: Vec<u32>,
    },
    /// Triangles pierce each other, as they did on the surface: removal adds none.
    #[error("{} pairs of triangles pierce each other", pairs.len())]
    SelfIntersecting {
        /// Pairs of triangles of `mesh`.
        pairs: Vec<[u32; 2]>,
        /// The mesh, right in all but this.
        mesh: Box<TriMesh>,
    },
}

/// Joins `points` on the closed surface `vertices`, `triangles` to a mesh. Positions are
/// millimetres; the result faces as the surface does.
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
    let kept = points.len() as u32;
    let stuck = removal::remove_old_vertices(&mut mesh, kept, monitor)?;
    if !stuck.is_empty() {
        let vertices = stuck.into_iter().map(|v| v - kept).collect();
        return Err(TessellateError::Stuck { vertices });
    }
    let mut mesh = verify(finished(mesh, points.len()), &census)?;
    let component = topology::components(vertices.len(), triangles);
    let surface = TriMesh {
        vertices: vertices.to_vec(),
        triangles: triangles.to_vec(),
    };
    let of_point = |p: &SurfacePoint| component[triangles[p.triangle as usize][0] as usize];
    let of_points: Vec<u32> = points.iter().map(of_point).collect();
    let volumes = topology::component_volumes(&surface.vertices, &surface.triangles, &component);
    orientation::face_alike(&mut mesh, &of_points, &volumes)
        .map_err(|points| TessellateError::InsideOut { points })?;
    Ok(mesh)
}

fn check_points(triangles: &[[u32; 3]], points: &[SurfacePoint]) -> Result<(), TessellateError> {
    let usable = |p: &SurfacePoint| {
        let sum: f64 = p.barycentric.iter().sum();
        (p.triangle as usize) < triangles.len()
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

/// Demands the least number of vertices that each component's genus needs.
fn check_counts(
    vertices: usize,
    triangles: &[[u32; 3]],
    points: &[SurfacePoint],
) -> Result<(), TessellateError> {
    let component_of = topology::components(vertices, triangles);
    let count = component_of.iter().max().map_or(0, |c| *c as usize + 1);
    let of_triangle = |t: usize| component_of[triangles[t][0] as usize] as usize;
    let mut characteristic = vec![0i64; count];
    for &c in &component_of {
        characteristic[c as usize] += 2;
    }
    // V - E + F with E = 3F/2, doubled.
    for t in 0..triangles.len() {
        characteristic[of_triangle(t)] -= 1;
    }
    let mut carried = vec![0usize; count];
    for p in points {
        carried[of_triangle(p.triangle as usize)] += 1;
    }
    for component in 0..count {
        let genus = 1 - characteristic[component] / 4;
        let needed = least_vertices(genus);
        if carried[component] < needed {
            return Err(TessellateError::TooFewPoints {
                component: component as u32,
                genus,
                points: carried[component],
                needed,
            });
        }
    }
    Ok(())
}

/// The fewest vertices of any triangulation of the closed orientable surface of `genus`
/// (Jungerman & Ringel 1980).
fn least_vertices(genus: i64) -> usize {
    let bound = f64::midpoint(7.0, (1.0 + 48.0 * genus as f64).sqrt()).ceil() as usize;
    if genus == 2 { bound + 1 } else { bound }
}

/// Between the triangles that there are and those that there will be.
fn grid_spacing(positions: &[Vec3], triangles: &[[u32; 3]], points: usize) -> f64 {
    let area: f64 = triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            crate::geometry::triangle::area_normal(&a, &b, &c).norm() / 2.0
        })
        .sum();
    let edge = |count: usize| (4.0 / 3f64.sqrt() * area / count.max(1) as f64).sqrt();
    (edge(triangles.len()) * edge(2 * points)).sqrt()
}

/// The triangles in a canonical order: each begins with its lowest vertex, the list is sorted.
fn finished(mesh: Patchwork, points: usize) -> TriMesh {
    let mut triangles: Vec<[u32; 3]> = mesh
        .live_triangles()
        .map(|mut t| {
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

/// Nothing leaves that has not been looked at as a whole.
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
    use super::samples::{double_torus, jittered, scattered, squeezed, together};
    use super::*;
    use crate::geometry::random::{Purpose, stream};
    use crate::mesh::shapes;
    use crate::progress::{CancelToken, Silent};
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

    fn demand_guarantees(surface: &TriMesh, n: usize, seed: u64, mesh: &TriMesh) {
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
        assert_eq!(self_intersections(mesh), Vec::<[u32; 2]>::new());
    }

    /// Tiles and demands every guarantee.
    fn check(surface: &TriMesh, n: usize, seed: u64) -> TriMesh {
        let mesh = tile(surface, n, seed).unwrap();
        demand_guarantees(surface, n, seed, &mesh);
        mesh
    }

    #[test]
    fn spheres_and_cups_carry_any_number_of_points() {
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
                Ok(mesh) => demand_guarantees(&surface, n, seed, &mesh),
                // Points are scattered blindly: the small sphere may go without.
                Err(TessellateError::TooFewPoints { .. }) => {}
                Err(TessellateError::Stuck { .. } | TessellateError::InsideOut { .. }) => {
                    refused += 1;
                }
                Err(other) => panic!("seed {seed}: {other}"),
            }
        }
        // Nor are there always points where walls are thin and tubes narrow.
        assert!(refused < 30, "{refused}");
    }

    #[test]
    fn many_points_on_few_triangles_and_the_reverse() {
        check(&shapes::icosphere(30.0, 0), 3000, 1);
        check(&shapes::tetrahedron(30.0), 500, 2);
        check(&shapes::icosphere(30.0, 5), 12, 3);
    }

    #[test]
    fn the_surface_is_followed() {
        // 300 points on a sphere: chords of about 0.2 radii cost two per cent of the volume.
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
        assert_eq!([0, 1, 2, 3].map(least_vertices), [4, 7, 10, 10]);
    }

    #[test]
    fn sparse_points_end_in_an_answer_or_a_reason() {
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

    /// Few points mend such a surface, for no triangle of it is left; many lie on triangles that
    /// pierce each other, or between which old vertices stay.
    #[test]
    fn a_surface_that_pierces_itself_is_mended_or_refused() {
        let surface = jittered(&shapes::icosphere(30.0, 2), 5.0, 1);
        assert!(!self_intersections(&surface).is_empty());
        let mended = tile(&surface, 150, 1).unwrap();
        assert_eq!(self_intersections(&mended), Vec::<[u32; 2]>::new());
        let refused = tile(&surface, 5000, 1);
        assert!(matches!(
            refused,
            Err(TessellateError::SelfIntersecting { .. } | TessellateError::Stuck { .. })
        ));
    }

    #[test]
    fn bad_points_are_named() {
        let sphere = shapes::icosphere(1.0, 1);
        for (triangle, x) in [(80, 0.2), (3, f64::NAN), (3, -0.1), (3, 0.9)] {
            let mut points = scattered(&sphere, 20, 1);
            points[5] = SurfacePoint {
                triangle,
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
    fn cancellation_ends_it() {
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
    fn same_input_same_mesh() {
        let cup = shapes::cup(70.0, 33.0, 10.0, 32);
        let one = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .unwrap();
        assert_eq!(one.install(|| tile(&cup, 150, 4)), tile(&cup, 150, 4));
    }
}
