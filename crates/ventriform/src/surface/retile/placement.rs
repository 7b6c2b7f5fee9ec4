//! Random points on the surface: the first step of the paper's method.
//!
//! In: the surface, the wanted relative spacing and the number of points. Out: that many points.
//! A triangle is drawn with a probability proportional to its area times the wanted density, a
//! position in it uniformly. Every component gets its share of the points ([`quotas`]).

use rand::RngExt;

use super::domain::Domain;
use super::trace::inset;
use super::{SurfacePoint, quotas};
use crate::base::geometry::random::{self, Purpose};
use crate::base::geometry::triangle::area_normal;
use crate::mesh::FaceId;
use crate::mesh::TriMesh;
use crate::mesh::topology::{component_count, components};

/// Draws exactly `count` points with a density that corresponds to the relative `spacing` at
/// every vertex. `count` must be at least the sum of [`quotas::least_of`] of `mesh`, which has the same
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
    let least = quotas::least_of(&mesh.triangles, &component_of);
    let mut random = random::stream(seed, Purpose::Placement);
    let mut points = Vec::with_capacity(count);
    for (list, n) in running.iter().zip(quotas::share(&least, &load, count)) {
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
    use crate::base::geometry::Vec3;
    use crate::mesh::shapes;
    use crate::surface::retile::tessellate::test_surfaces::{moved, together};

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

    /// On the upper half the points are wanted half as far apart: four times as many lie there.
    #[test]
    fn points_are_as_dense_as_the_spacing_asks_for() {
        let mesh = shapes::icosphere(10.0, 3);
        let domain = Domain::new(mesh.vertices.clone(), mesh.triangles.clone()).unwrap();
        let spacing: Vec<f64> = (mesh.vertices.iter())
            .map(|p| if p.z > 0.0 { 1.0 } else { 2.0 })
            .collect();
        let points = place(&mesh, &domain, &spacing, 4000, 3);
        let corners =
            |p: &SurfacePoint| mesh.triangles[p.triangle.index()].map(|v| spacing[v as usize]);
        let dense = points.iter().filter(|p| corners(p) == [1.0; 3]).count();
        let sparse = points.iter().filter(|p| corners(p) == [2.0; 3]).count();
        let area = |h: f64| -> f64 {
            let own = (0..mesh.triangles.len())
                .filter(|t| mesh.triangles[*t].iter().all(|v| spacing[*v as usize] == h));
            own.map(|t| mesh.area_normal(t).norm()).sum()
        };
        let ratio = dense as f64 / sparse as f64 * area(2.0) / area(1.0);
        // Its relative standard deviation is 4 %.
        assert!((ratio / 4.0 - 1.0).abs() < 0.15, "{ratio}");
    }

    /// Uniform points in a triangle have coordinates of mean 1/3 and mean square 1/6.
    #[test]
    fn points_are_uniform_within_their_triangles() {
        let mesh = shapes::tetrahedron(10.0);
        let domain = Domain::new(mesh.vertices.clone(), mesh.triangles.clone()).unwrap();
        let points = place(&mesh, &domain, &[1.0; 4], 6000, 5);
        for k in 0..3 {
            let mean = |f: &dyn Fn(&[f64; 3]) -> f64| {
                points.iter().map(|p| f(&p.barycentric)).sum::<f64>() / points.len() as f64
            };
            assert!((mean(&|b| b[k]) - 1.0 / 3.0).abs() < 0.015);
            assert!((mean(&|b| b[k] * b[k]) - 1.0 / 6.0).abs() < 0.015);
            assert!((mean(&|b| b[k] * b[(k + 1) % 3]) - 1.0 / 12.0).abs() < 0.01);
        }
        let on = |t: usize| points.iter().filter(|p| p.triangle.index() == t).count();
        assert!((0..4).all(|t| on(t).abs_diff(1500) < 140));
    }

    #[test]
    fn every_component_gets_points_by_its_area() {
        let small = moved(shapes::icosphere(5.0, 2), Vec3::repeat(30.0));
        let mesh = together(&[shapes::icosphere(10.0, 2), small]);
        let domain = Domain::new(mesh.vertices.clone(), mesh.triangles.clone()).unwrap();
        let points = place(&mesh, &domain, &vec![1.0; mesh.vertices.len()], 200, 2);
        assert_eq!(points.len(), 200);
        let on_small = points.iter().filter(|p| p.triangle.index() >= 320).count();
        assert_eq!(on_small, 40);
    }
}
