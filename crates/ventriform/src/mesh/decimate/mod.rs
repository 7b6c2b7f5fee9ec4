//! Decimation by quadric error: makes the reference models of the evaluation.
//!
//! In: a closed surface and a number of points. Out: a closed surface with exactly that many
//! vertices. After Garland and Heckbert, *Surface simplification using quadric error metrics*,
//! SIGGRAPH 1997.
//!
//! The paper compares its models with an older one of 67 points that is neither smooth nor
//! regular and that is not available outside its group. A decimated Marching Cubes surface takes
//! its place: before re-tiling it was the usual way to a coarse mesh, close to the surface, with
//! triangles of any size and shape.
//!
//! 1. Every vertex gets a [`quadric::Quadric`], the area-weighted sum of squared distances to the
//!    planes of its triangles.
//! 2. The edge whose collapse causes the smallest error is collapsed, repeatedly, to the point of
//!    smallest error.
//! 3. A collapse that is not allowed is postponed until no other is left.
//!
//! Guaranteed:
//! - exactly the requested number of points;
//! - a closed manifold with the surface's Euler characteristic (link condition);
//! - no new self-intersection (exact tests);
//! - no normal turns by more than [`MAX_TURN`] in one collapse;
//! - the same result for any number of threads.
//!
//! Not guaranteed: evenly distributed points or good triangles, in which the reference should
//! differ from re-tiling. If no collapse is allowed before the number is reached, that is an
//! error.

mod collapse;
mod quadric;

use crate::base::progress::{Cancelled, Monitor};
use crate::mesh::TriMesh;
use crate::mesh::topology::{self, MeshDefect};
use collapse::Collapses;

/// Largest angle, degrees, by which a triangle's normal may turn in one collapse: that at which a
/// triangle turns over, less a margin.
pub const MAX_TURN: f64 = 78.0;

/// Why a surface could not be decimated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DecimateError {
    /// The surface is not a closed manifold.
    #[error("the surface to decimate is not a closed manifold: {0}")]
    NotClosed(#[from] MeshDefect),
    /// Fewer points than a closed surface needs, or more than the surface has.
    #[error(
        "{points} points were requested; 4 to {vertices}, the number of the surface, are possible"
    )]
    Points {
        /// The requested number of points.
        points: usize,
        /// Number of vertices of the surface.
        vertices: usize,
    },
    /// No remaining edge can be collapsed.
    #[error("at {reached} points no edge can be collapsed any more")]
    Stuck {
        /// Number of vertices left.
        reached: usize,
    },
    /// Cancelled by the caller.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Decimates `surface` (LPS mm) to exactly `points` vertices.
///
/// # Errors
/// [`DecimateError`].
pub fn decimate(
    surface: &TriMesh,
    points: usize,
    monitor: &Monitor,
) -> Result<TriMesh, DecimateError> {
    topology::check(surface)?;
    let vertices = surface.vertices.len();
    if !(4..=vertices).contains(&points) {
        return Err(DecimateError::Points { points, vertices });
    }
    let mut collapses = Collapses::new(surface);
    while collapses.vertices_left() > points {
        monitor.check()?;
        if !collapses.collapse_cheapest() {
            return Err(DecimateError::Stuck {
                reached: collapses.vertices_left(),
            });
        }
    }
    Ok(collapses.into_mesh())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::bvh::Bvh;
    use crate::mesh::intersections::self_intersections;
    use crate::mesh::shapes;

    fn decimated(surface: &TriMesh, points: usize) -> TriMesh {
        decimate(surface, points, &Monitor::silent()).unwrap()
    }

    #[test]
    fn the_number_of_points_is_exact_and_the_topology_kept() {
        let surfaces = [
            shapes::icosphere(30.0, 4),
            shapes::torus(30.0, 10.0, 60, 30),
            shapes::cup(70.0, 30.0, 11.0, 48),
            shapes::cup(70.0, 30.0, 2.0, 48),
        ];
        for surface in surfaces {
            let before = topology::check(&surface).unwrap();
            for points in [67, 300] {
                let mesh = decimated(&surface, points);
                let census = topology::check(&mesh).unwrap();
                assert_eq!(census.vertices, points);
                assert_eq!(census.euler_characteristic, before.euler_characteristic);
                assert!(self_intersections(&mesh).is_empty());
                assert!((mesh.volume() / surface.volume() - 1.0).abs() < 0.1);
            }
        }
    }

    #[test]
    fn flat_faces_cost_nothing() {
        // A cube of 6 x 2 x 8² triangles needs only its 8 corners.
        let cube = grid_cube(8);
        let mesh = decimated(&cube, 8);
        let tree = Bvh::new(&mesh.vertices, &mesh.triangles);
        for p in &cube.vertices {
            let distance = tree.closest(p).unwrap().squared_distance.sqrt();
            assert!(distance < 1e-6, "{p} is {distance} away");
        }
    }

    #[test]
    fn a_sphere_stays_round() {
        let sphere = shapes::icosphere(30.0, 4);
        let mesh = decimated(&sphere, 150);
        let tree = Bvh::new(&mesh.vertices, &mesh.triangles);
        let worst = sphere
            .vertices
            .iter()
            .map(|p| tree.closest(p).unwrap().squared_distance.sqrt())
            .fold(0.0, f64::max);
        // With 296 triangles an edge is 9.4 mm long and its sagitta 0.37 mm. Vertices at the mean
        // of their tangent planes are half a sagitta away, twice that for uneven triangles.
        assert!(worst < 0.8, "{worst}");
        assert!((mesh.volume() / sphere.volume() - 1.0).abs() < 0.03);
    }

    #[test]
    fn impossible_numbers_are_refused() {
        let sphere = shapes::icosphere(1.0, 1);
        let vertices = sphere.vertices.len();
        for points in [3, vertices + 1] {
            assert_eq!(
                decimate(&sphere, points, &Monitor::silent()).unwrap_err(),
                DecimateError::Points { points, vertices }
            );
        }
        assert_eq!(decimated(&sphere, 4).triangles.len(), 4);
        let torus = shapes::torus(3.0, 1.0, 12, 8);
        assert!(matches!(
            decimate(&torus, 5, &Monitor::silent()).unwrap_err(),
            // A torus needs 7.
            DecimateError::Stuck { reached } if reached >= 7
        ));
    }

    /// A cube of edge 10 whose faces are grids of `n`² squares cut in two.
    fn grid_cube(n: u32) -> TriMesh {
        use crate::base::geometry::Vec3;
        let mut mesh = TriMesh {
            vertices: Vec::new(),
            triangles: Vec::new(),
        };
        let mut id = std::collections::BTreeMap::new();
        let mut vertex = |mesh: &mut TriMesh, p: [u32; 3]| {
            *id.entry(p).or_insert_with(|| {
                let place = Vec3::from(p.map(|x| 10.0 * f64::from(x) / f64::from(n)));
                mesh.vertices.push(place);
                mesh.vertices.len() as u32 - 1
            })
        };
        for axis in 0..3 {
            for side in [0, n] {
                for u in 0..n {
                    for v in 0..n {
                        let corners = [[u, v], [u + 1, v], [u + 1, v + 1], [u, v + 1]];
                        let ids = corners.map(|[u, v]| {
                            let mut p = [0; 3];
                            p[axis] = side;
                            p[(axis + 1) % 3] = u;
                            p[(axis + 2) % 3] = v;
                            vertex(&mut mesh, p)
                        });
                        let [a, b, c, d] = ids;
                        if side == n {
                            mesh.triangles.extend([[a, b, c], [a, c, d]]);
                        } else {
                            mesh.triangles.extend([[a, c, b], [a, d, c]]);
                        }
                    }
                }
            }
        }
        mesh
    }
}
