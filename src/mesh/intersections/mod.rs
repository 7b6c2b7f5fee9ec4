//! Does a mesh cut through itself?
//!
//! A mesh comes in; the pairs of its triangles that meet in more than the vertices and edges
//! they share come out. Candidates are the pairs whose boxes overlap; each is decided exactly
//! (see [`triangles_intersect`]), so an empty answer is a proof that the mesh is embedded in
//! space. Stricter than MeshLab's filter, which works in floating point with tolerances and
//! never reports a pair that shares an edge.
//!
//! [`IntersectionIndex`] answers the same for one triangle more while the mesh changes.

mod index;
mod pair;

use rayon::prelude::*;

use super::TriMesh;
use crate::geometry::bvh::{Aabb, Bvh};

pub use index::IntersectionIndex;
pub use pair::triangles_intersect;

/// The pairs of triangles that meet in more than shared vertices and edges: each pair
/// ascending, the list sorted. Touching and coplanar overlap count.
///
/// Takes O(n log n + pairs) on surfaces; the same for every thread count. Positions must be
/// finite.
pub fn self_intersections(mesh: &TriMesh) -> Vec<[u32; 2]> {
    let bvh = Bvh::new(&mesh.vertices, &mesh.triangles);
    (0..mesh.triangles.len() as u32)
        .into_par_iter()
        .with_min_len(64)
        .flat_map_iter(|s| {
            let (ids, corners) = (mesh.triangles[s as usize], mesh.corners(s as usize));
            let mut met = Vec::new();
            bvh.for_each_overlapping(&Aabb::of(&corners), |t| {
                if s < t
                    && triangles_intersect(
                        ids,
                        &corners,
                        mesh.triangles[t as usize],
                        &mesh.corners(t as usize),
                    )
                {
                    met.push([s, t]);
                }
            });
            met.sort_unstable();
            met
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec3;
    use crate::mesh::shapes;

    #[test]
    fn embedded_surfaces_have_none() {
        for mesh in [
            shapes::icosphere(10.0, 3),
            shapes::torus(9.0, 3.0, 40, 20),
            shapes::cup(60.0, 30.0, 1.0, 48),
        ] {
            assert_eq!(self_intersections(&mesh), Vec::<[u32; 2]>::new());
        }
    }

    #[test]
    fn finds_what_a_search_through_all_pairs_finds() {
        // A torus whose tube is thicker than its ring passes through itself.
        let mesh = shapes::torus(2.0, 3.0, 30, 20);
        let mut expected = Vec::new();
        for s in 0..mesh.triangles.len() {
            for t in s + 1..mesh.triangles.len() {
                let (i, j) = (mesh.triangles[s], mesh.triangles[t]);
                if triangles_intersect(i, &mesh.corners(s), j, &mesh.corners(t)) {
                    expected.push([s as u32, t as u32]);
                }
            }
        }
        assert!(expected.len() > 20);
        assert_eq!(self_intersections(&mesh), expected);
    }

    #[test]
    fn a_vertex_pulled_through_the_opposite_side_is_noticed() {
        let mut mesh = shapes::icosphere(10.0, 2);
        mesh.vertices[0] *= -1.3;
        let pairs = self_intersections(&mesh);
        assert!(!pairs.is_empty());
        assert!(pairs.iter().all(|pair| {
            pair.iter()
                .any(|t| mesh.triangles[*t as usize].contains(&0))
        }));
    }

    #[test]
    fn a_triangle_folded_flat_onto_its_neighbour_is_noticed() {
        // A flat two-sided sheet: every triangle of the top lies on one of the bottom.
        let mut mesh = shapes::icosphere(1.0, 1);
        for v in &mut mesh.vertices {
            v.z = 0.0;
        }
        assert!(!self_intersections(&mesh).is_empty());
        let fold = TriMesh {
            vertices: [[0.0, 0.0], [2.0, 0.0], [1.0, 1.0], [1.0, 0.4]]
                .map(|[x, y]| Vec3::new(x, y, 0.0))
                .to_vec(),
            triangles: vec![[0, 1, 2], [1, 0, 3]],
        };
        assert_eq!(self_intersections(&fold), vec![[0, 1]]);
    }
}
