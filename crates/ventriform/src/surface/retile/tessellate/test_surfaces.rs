//! Surfaces and points for the tests of the re-tiling.

use rand::RngExt;

use super::patchwork::Patchwork;
use crate::base::geometry::Vec3;
use crate::base::geometry::random::{Purpose, stream};
use crate::mesh::intersections::self_intersections;
use crate::mesh::{FaceId, TriMesh, shapes};
use crate::surface::retile::SurfacePoint;

/// `n` points distributed evenly by area, inside their triangles.
pub(super) fn scattered(mesh: &TriMesh, n: usize, seed: u64) -> Vec<SurfacePoint> {
    let mut rng = stream(seed, Purpose::Placement);
    let mut reached = 0.0;
    let sums: Vec<f64> = (0..mesh.triangles.len())
        .map(|t| {
            reached += mesh.area_normal(t).norm();
            reached
        })
        .collect();
    (0..n)
        .map(|_| {
            let at = rng.random_range(0.0..reached);
            let triangle = sums.partition_point(|s| *s <= at).min(sums.len() - 1);
            let (r, s): (f64, f64) = (rng.random::<f64>().sqrt(), rng.random());
            let inner = [1.0 - r, r * (1.0 - s), r * s];
            SurfacePoint {
                triangle: FaceId::from_index(triangle),
                // Moved slightly towards the centroid, never on a side.
                barycentric: inner.map(|x| 0.998 * x + 0.002 / 3.0),
            }
        })
        .collect()
}

/// The mesh, `by` mm away.
pub(in crate::surface::retile) fn moved(mut mesh: TriMesh, by: Vec3) -> TriMesh {
    mesh.vertices.iter_mut().for_each(|v| *v += by);
    mesh
}

/// Several meshes as one.
pub(in crate::surface::retile) fn together(parts: &[TriMesh]) -> TriMesh {
    let mut all = TriMesh::default();
    for part in parts {
        let first = all.vertices.len() as u32;
        all.vertices.extend(&part.vertices);
        all.triangles
            .extend(part.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    all
}

/// Genus 2: two tori side by side, joined by a triangular tube.
pub(super) fn double_torus() -> TriMesh {
    let (left, mut right) = (
        shapes::torus(20.0, 8.0, 36, 20),
        shapes::torus(20.0, 8.0, 36, 20),
    );
    for v in &mut right.vertices {
        v.x += 58.0;
    }
    let vertices_left = left.vertices.len() as u32;
    // The triangles of each that face the other torus: at angle 0, and at half a turn.
    let (end_left, end_right) = (0, 2 * 20 * 18);
    let a = left.triangles[end_left];
    let b = right.triangles[end_right].map(|v| v + vertices_left);
    let mut mesh = together(&[left.clone(), right]);
    mesh.triangles.remove(left.triangles.len() + end_right);
    mesh.triangles.remove(end_left);
    // The two triangles have opposite orientations; of the three ways to join them the least
    // twisted one is taken.
    let at = |v: u32| mesh.vertices[v as usize];
    let ways = [0, 1, 2].map(|turn| [0, 1, 2].map(|k| b[(turn + 3 - k) % 3]));
    let twist = |way: &[u32; 3]| -> f64 { (0..3).map(|k| (at(a[k]) - at(way[k])).norm()).sum() };
    let b = ways
        .into_iter()
        .min_by(|s, t| twist(s).total_cmp(&twist(t)))
        .unwrap();
    for k in 0..3 {
        let l = (k + 1) % 3;
        mesh.triangles
            .extend([[a[k], a[l], b[l]], [a[k], b[l], b[k]]]);
    }
    mesh
}

/// The mesh with every vertex moved by up to `reach` mm along each axis.
pub(super) fn jittered(mesh: &TriMesh, reach: f64, seed: u64) -> TriMesh {
    let mut rng = stream(seed, Purpose::PhantomShape);
    let mut moved = mesh.clone();
    for v in &mut moved.vertices {
        *v += Vec3::from_fn(|_, _| rng.random_range(-reach..reach));
    }
    moved
}

/// The mesh scaled along the axes.
pub(super) fn squeezed(mesh: &TriMesh, scales: [f64; 3]) -> TriMesh {
    let mut changed = mesh.clone();
    for v in &mut changed.vertices {
        v.component_mul_assign(&Vec3::from(scales));
    }
    changed
}

/// A tetrahedron in which `n` times a random triangle was replaced by a flat pyramid over it: a sphere with vertices
/// of valence 3 and with edges between vertices of one ring that lie outside its star.
pub(super) fn stacked(n: usize, seed: u64) -> TriMesh {
    let mut rng = stream(seed, Purpose::PhantomShape);
    let mut mesh = shapes::tetrahedron(30.0);
    for _ in 0..n {
        let t = rng.random_range(0..mesh.triangles.len());
        let [a, b, c] = mesh.triangles[t];
        let top = mesh.vertices.len() as u32;
        let corners = mesh.corners(t);
        let raised = mesh.area_normal(t) * 0.02 / mesh.area_normal(t).norm().sqrt();
        let middle: Vec3 = corners.iter().sum::<Vec3>() / 3.0;
        mesh.vertices.push(middle + raised);
        mesh.triangles[t] = [a, b, top];
        mesh.triangles.extend([[b, c, top], [c, a, top]]);
    }
    mesh
}

/// Rough, thin and pinched surfaces that do not intersect themselves: some holes in them can be closed in some ways
/// only, some flips are impossible, turn triangles over or cause intersections.
pub(super) fn awkward() -> Vec<TriMesh> {
    let ball = shapes::icosphere(30.0, 1);
    let mut all = vec![shapes::tetrahedron(30.0), shapes::torus(30.0, 12.0, 6, 3)];
    for seed in 0..2 {
        all.push(stacked(14, seed));
        all.push(jittered(&ball, 6.0, seed));
        all.push(jittered(&squeezed(&ball, [1.0, 1.0, 0.1]), 1.0, seed));
    }
    all.retain(|surface| self_intersections(surface).is_empty());
    assert!(all.len() > 5);
    all
}

/// The mesh as a patchwork, its index in cells of 10 mm.
pub(super) fn patchwork(surface: &TriMesh) -> Patchwork {
    Patchwork::new(surface.vertices.clone(), surface.triangles.clone(), 10.0)
}

#[test]
fn the_test_surfaces_have_the_properties_they_are_named_for() {
    use crate::mesh::topology;
    let census = topology::check(&double_torus()).unwrap();
    assert_eq!((census.genus(), census.components), (2, 1));
    assert!(self_intersections(&double_torus()).is_empty());
    let rough = jittered(&shapes::icosphere(30.0, 3), 0.8, 0);
    assert!(self_intersections(&rough).is_empty());
    for seed in 0..5 {
        let stacked = stacked(20, seed);
        assert_eq!(topology::check(&stacked).unwrap().genus(), 0);
        assert!(self_intersections(&stacked).is_empty());
    }
}
