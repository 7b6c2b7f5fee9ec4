//! Vertices whose triangles cannot intersect each other, seen without exact predicates.
//!
//! In: a mesh. Out: for every vertex whether the triangles around it are certain to have no more in
//! common than the vertices and edges that they share.
//!
//! The triangles around a vertex v are projected along the sum n of their normals. If every one keeps its
//! orientation there, the edges of the ring go round v the same way, and a ray from v crosses as many of
//! them as the ring has turns. With one crossing the projected triangles cover a star around v without
//! overlap, so the triangles themselves meet in their common edges and in v alone. On a smooth surface that
//! is so at nearly every vertex, and nearly all pairs of triangles with overlapping boxes share one.
//!
//! Guaranteed: rounding makes no vertex certain that is not: orientations count only if they are far beyond
//! it, and the number of turns is a whole number. Not guaranteed: that every such vertex is found.

use rayon::prelude::*;

use crate::base::geometry::Vec3;
use crate::mesh::TriMesh;

/// Smallest volume of the parallelepiped of two edges and n over the product of their lengths. Rounding
/// contributes less than 1e-14.
const MIN_RELATIVE_VOLUME: f64 = 1e-9;

/// Fewest vertices per parallel task.
const PER_TASK: usize = 1024;

/// Whether the triangles around each vertex are certain not to intersect each other.
pub fn embedded_fans(mesh: &TriMesh) -> Vec<bool> {
    let count = mesh.vertices.len();
    let mut first = vec![0u32; count + 1];
    for &v in mesh.triangles.iter().flatten() {
        first[v as usize + 1] += 1;
    }
    for v in 0..count {
        first[v + 1] += first[v];
    }
    // The edges opposite to each vertex, in the orientation of their triangles.
    let mut rings = vec![[0u32; 2]; 3 * mesh.triangles.len()];
    let mut next = first.clone();
    for &[a, b, c] in &mesh.triangles {
        for (v, edge) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
            let place = &mut next[v as usize];
            rings[*place as usize] = edge;
            *place += 1;
        }
    }
    (0..count)
        .into_par_iter()
        .with_min_len(PER_TASK)
        .map(|v| {
            let ring = &rings[first[v] as usize..first[v + 1] as usize];
            is_closed(ring) && is_embedded(&mesh.vertices, v, ring)
        })
        .collect()
}

/// Whether the edges lead from each of their vertices to another one of them, every vertex once.
fn is_closed(ring: &[[u32; 2]]) -> bool {
    let times = |end: usize, v: u32| ring.iter().filter(|edge| edge[end] == v).count();
    ring.len() >= 3 && (ring.iter()).all(|&[from, _]| times(0, from) == 1 && times(1, from) == 1)
}

fn is_embedded(vertices: &[Vec3], v: usize, ring: &[[u32; 2]]) -> bool {
    let spoke = |w: u32| vertices[w as usize] - vertices[v];
    let normal = |&[a, b]: &[u32; 2]| spoke(a).cross(&spoke(b));
    let n: Vec3 = ring.iter().map(normal).sum();
    let keeps_orientation = |edge: &[u32; 2]| {
        let volume = normal(edge).dot(&n);
        let [a, b] = edge.map(|w| spoke(w).norm_squared());
        volume > 0.0
            && volume * volume
                > MIN_RELATIVE_VOLUME * MIN_RELATIVE_VOLUME * a * b * n.norm_squared()
    };
    if !ring.iter().all(keeps_orientation) {
        return false;
    }
    // Any direction at a right angle to n will do for the ray.
    let across = n.cross(&Vec3::ith(n.iamin(), 1.0));
    let is_above = |w: u32| spoke(w).dot(&across) >= 0.0;
    let crossings = (ring.iter()).filter(|[a, b]| !is_above(*a) && is_above(*b));
    crossings.count() == 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::random::{Purpose, stream};
    use crate::mesh::intersections::triangles_intersect;
    use crate::mesh::{FaceId, shapes};
    use rand::RngExt;

    /// Whether any two triangles around `v` intersect, by exact predicates.
    fn intersect(mesh: &TriMesh, v: usize) -> bool {
        let around: Vec<FaceId> = FaceId::first(mesh.triangles.len())
            .filter(|t| mesh.triangles[t.index()].contains(&(v as u32)))
            .collect();
        let triangle = |t: FaceId| (mesh.corner_ids(t), mesh.corners(t.index()));
        around.iter().any(|&s| {
            around.iter().any(|&t| {
                let ((i, p), (j, q)) = (triangle(s), triangle(t));
                s < t && triangles_intersect(i, &p, j, &q)
            })
        })
    }

    #[test]
    fn no_vertex_is_certain_whose_triangles_intersect() {
        let mut random = stream(5, Purpose::Measure);
        let (mut certain, mut doubted, mut intersecting) = (0, 0, 0);
        for jolt in [0.0, 0.3, 1.0, 2.0, 4.0] {
            let mut mesh = shapes::torus(9.0, 3.0, 24, 12);
            for v in &mut mesh.vertices {
                *v += Vec3::from_fn(|_, _| random.random_range(-1.0..1.0) * jolt);
            }
            for (v, embedded) in embedded_fans(&mesh).into_iter().enumerate() {
                let meet = intersect(&mesh, v);
                assert!(!(embedded && meet), "{jolt}: {v}");
                certain += usize::from(embedded);
                doubted += usize::from(!embedded);
                intersecting += usize::from(meet);
            }
        }
        assert!(certain > 600 && doubted > 300 && intersecting > 200);
    }

    #[test]
    fn every_vertex_of_a_smooth_surface_is_certain() {
        let mesh = shapes::torus(9.0, 3.0, 40, 20);
        assert!(embedded_fans(&mesh).into_iter().all(|embedded| embedded));
    }

    /// Flat rings of six around vertex 0 that keep their orientation but go round twice, or do not close.
    #[test]
    fn rings_that_go_round_twice_or_stay_open_are_doubted() {
        let around = |turns: f64, closed: bool| {
            let count = 6;
            let corner = |k: u32| {
                let angle = std::f64::consts::TAU * turns * f64::from(k) / f64::from(count);
                Vec3::new(angle.cos(), angle.sin(), 0.1 * f64::from(k))
            };
            let mut vertices = vec![Vec3::zeros()];
            vertices.extend((0..count).map(corner));
            let last = if closed { count } else { count - 1 };
            TriMesh {
                vertices,
                triangles: (0..last).map(|k| [0, k + 1, (k + 1) % count + 1]).collect(),
            }
        };
        assert!(embedded_fans(&around(1.0, true))[0]);
        assert!(!embedded_fans(&around(1.0, false))[0]);
        assert!(!embedded_fans(&around(2.0, true))[0]);
    }
}
