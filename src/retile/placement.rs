//! Random points on the surface: the first step of the paper's method.
//!
//! In: the surface, the wanted relative spacing and the number of points. Out: that many points.
//! A triangle is drawn with a probability proportional to its area times the wanted density, a
//! position in it uniformly. Every component gets its share of the points ([`quotas`]).

use rand::RngExt;

use super::domain::Domain;
use super::trace::inset;
use super::{SurfacePoint, quotas};
use crate::geometry::random::{self, Purpose};
use crate::geometry::triangle::area_normal;
use crate::mesh::FaceId;
use crate::mesh::TriMesh;
use crate::mesh::topology::{component_count, components};

/// Draws exactly `count` points with a density that corresponds to the relative `spacing` at
/// every vertex. `count` must be at least [`quotas::least_points`] of `mesh`, which has the same
/// connectivity as `domain`.
pub(crate) fn place(
    mesh: &TriMesh,
    domain: &Domain,
    spacing: &[f64],
    count: usize,
    seed: u64,
) -> Vec<SurfacePoint> {
    let component_of = components(mesh.vertices.len(), &mesh.triangles);
    // Triangles of each component with the running sum of area / h².
    let mut running: Vec<Vec<(f64, FaceId)>> = vec![Vec::new(); component_count(&component_of)];
    for (t, corners) in FaceId::first(mesh.triangles.len()).zip(&mesh.triangles) {
        let list = &mut running[component_of[corners[0] as usize] as usize];
        let before = list.last().map_or(0.0, |l| l.0);
        let [a, b, c] = corners.map(|v| domain.vertices[v as usize]);
        let h = corners.iter().map(|v| spacing[*v as usize]).sum::<f64>() / 3.0;
        list.push((before + area_normal(&a, &b, &c).norm() / (h * h), t));
    }
    let load: Vec<f64> = (running.iter())
        .map(|list| list.last().map_or(0.0, |l| l.0))
        .collect();
    let mut random = random::stream(seed, Purpose::Placement);
    let mut points = Vec::with_capacity(count);
    for (list, n) in running.iter().zip(quotas::share(mesh, &load, count)) {
        let total = list.last().map_or(0.0, |l| l.0);
        for _ in 0..n {
            let drawn = random.random::<f64>() * total;
            let slot = list.partition_point(|l| l.0 <= drawn).min(list.len() - 1);
            let root = random.random::<f64>().sqrt();
            let along = random.random::<f64>();
            points.push(SurfacePoint {
                triangle: list[slot].1,
                barycentric: inset([1.0 - root, root * (1.0 - along), root * along]),
            });
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn points_fall_evenly_and_never_on_edges() {
        let mesh = shapes::icosphere(10.0, 3);
        let domain = Domain::new(mesh.vertices.clone(), mesh.triangles.clone()).unwrap();
        let even = vec![1.0; mesh.vertices.len()];
        let draw = |seed| place(&mesh, &domain, &even, 4000, seed);
        let points = draw(7);
        assert_eq!(points.len(), 4000);
        let mut octants = [0usize; 8];
        for p in &points {
            assert!(p.barycentric.iter().all(|b| *b > 1e-4));
            assert!((p.barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let x = p.position(&mesh.vertices, &mesh.triangles);
            let bit = |v: f64| usize::from(v > 0.0);
            octants[bit(x.x) + 2 * bit(x.y) + 4 * bit(x.z)] += 1;
        }
        // Binomial: 500 expected, standard deviation 21.
        assert!(
            octants.iter().all(|n| (400..600).contains(n)),
            "{octants:?}"
        );
        assert_eq!(points, draw(7));
        assert_ne!(points, draw(8));
    }
}
