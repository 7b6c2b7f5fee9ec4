//! A surface thinned out by quadric error: the evaluation's reference model.
//!
//! The paper compares its models with an older one of 67 points that is neither smooth nor
//! regular and that nobody outside its group has. Marching Cubes thinned out by quadric error
//! (Garland and Heckbert, *Surface simplification using quadric error metrics*, SIGGRAPH 1997)
//! stands in for it: the usual way to a coarse mesh before there was re-tiling, close to the
//! surface, with triangles of any size and shape.
//!
//! A closed surface and a number of points go in; a closed surface of exactly that many
//! vertices comes out.
//!
//! 1. Every vertex gets a [`quadric::Quadric`]: the area-weighted squared distances to the
//!    planes of its triangles.
//! 2. The edge whose ends can be drawn together at the least error is collapsed, again and
//!    again, to the point of least error. Errors that have changed since are skipped.
//! 3. A collapse that would break a promise is put off until no other is left.
//!
//! Guaranteed: exactly the number of points asked for, a closed manifold of the surface's
//! Euler characteristic (link condition), no self-intersection that was not there before
//! (exact tests), no triangle turned by more than [`MOST_TURN`] in one collapse, the same
//! result for any number of threads. Not guaranteed: even points or good triangles; that is
//! the reference's point. Where no collapse is left before the number is reached, that is an
//! error.

mod collapse;
mod quadric;

use crate::mesh::TriMesh;
use crate::mesh::topology::{self, Defect};
use crate::progress::{Cancelled, Monitor};
use collapse::Collapses;

/// A triangle's normal may turn by at most this much in one collapse, degrees: as much as a
/// folding triangle turns before it shows its back, less a margin.
pub const MOST_TURN: f64 = 78.0;

/// Why there is no thinned surface.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DecimateError {
    /// The surface is no closed manifold.
    #[error("the surface to thin out is not a closed manifold: {0}")]
    NotClosed(#[from] Defect),
    /// Fewer points than a closed surface needs, or more than there are.
    #[error("{points} points were asked for; 4 to the surface's own {vertices} are possible")]
    Points {
        /// What was asked for.
        points: usize,
        /// Vertices of the surface.
        vertices: usize,
    },
    /// Every edge left would break a promise if it were collapsed.
    #[error("no edge can be collapsed any more at {reached} points")]
    Stuck {
        /// Vertices left.
        reached: usize,
    },
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Thins `surface` out to exactly `points` vertices.
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
    while collapses.vertices() > points {
        monitor.check()?;
        if !collapses.cheapest() {
            return Err(DecimateError::Stuck {
                reached: collapses.vertices(),
            });
        }
    }
    Ok(collapses.into_mesh())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::bvh::Bvh;
    use crate::mesh::intersections::self_intersections;
    use crate::mesh::shapes;

    fn thinned(surface: &TriMesh, points: usize) -> TriMesh {
        decimate(surface, points, &Monitor::silent()).unwrap()
    }

    #[test]
    fn the_number_is_exact_and_the_topology_kept() {
        let surfaces = [
            shapes::icosphere(30.0, 4),
            shapes::torus(30.0, 10.0, 60, 30),
            shapes::cup(70.0, 30.0, 11.0, 48),
            shapes::cup(70.0, 30.0, 2.0, 48),
        ];
        for surface in surfaces {
            let before = topology::check(&surface).unwrap();
            for points in [67, 300] {
                let mesh = thinned(&surface, points);
                let census = topology::check(&mesh).unwrap();
                assert_eq!(census.vertices, points);
                assert_eq!(census.euler_characteristic, before.euler_characteristic);
                assert_eq!(self_intersections(&mesh), Vec::<[u32; 2]>::new());
                assert!((mesh.volume() / surface.volume() - 1.0).abs() < 0.1);
            }
        }
    }

    #[test]
    fn flat_faces_cost_nothing() {
        // A cube of 6 x 2 x 8² triangles needs its 8 corners only.
        let cube = grid_cube(8);
        let mesh = thinned(&cube, 8);
        let tree = Bvh::new(&mesh.vertices, &mesh.triangles);
        for p in &cube.vertices {
            let distance = tree.closest(p).unwrap().squared_distance.sqrt();
            assert!(distance < 1e-6, "{p} is {distance} away");
        }
    }

    #[test]
    fn a_sphere_stays_round() {
        let sphere = shapes::icosphere(30.0, 4);
        let mesh = thinned(&sphere, 150);
        let tree = Bvh::new(&mesh.vertices, &mesh.triangles);
        let worst = sphere
            .vertices
            .iter()
            .map(|p| tree.closest(p).unwrap().squared_distance.sqrt())
            .fold(0.0, f64::max);
        // Points that lie in the mean of their tangent planes: half a sagitta, twice for
        // uneven triangles. With 296 triangles an edge is 9.4 mm, its sagitta 0.37 mm.
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
        assert_eq!(thinned(&sphere, 4).triangles.len(), 4);
        let torus = shapes::torus(3.0, 1.0, 12, 8);
        assert!(matches!(
            decimate(&torus, 5, &Monitor::silent()).unwrap_err(),
            // A torus needs 7.
            DecimateError::Stuck { reached } if reached >= 7
        ));
    }

    /// A cube of edge 10 whose faces are grids of `n`² squares cut in two.
    fn grid_cube(n: u32) -> TriMesh {
        use crate::geometry::Vec3;
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
