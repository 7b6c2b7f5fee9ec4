//! Self-intersections of a mesh.
//!
//! In: a mesh. Out: the pairs of its triangles that have more in common than shared vertices
//! and edges. Candidates are the pairs whose bounding boxes overlap, without those at a vertex whose
//! triangles are seen not to intersect ([`fans`]); each is decided exactly
//! (see [`triangles_intersect`]), so an empty list proves that the mesh is embedded in space.
//! This is stricter than MeshLab's filter, which works in floating point with tolerances and
//! never reports a pair that shares an edge.
//!
//! [`IntersectionIndex`] answers the same question for single triangles while a mesh changes.

mod fans;
mod index;
mod pair;

use std::convert::Infallible;

use rayon::prelude::*;

use super::{FaceId, TriMesh};
use crate::base::geometry::bvh::Bvh;

pub use index::IntersectionIndex;
pub use pair::triangles_intersect;

/// Fewest leaves of the tree per parallel task.
const LEAVES_PER_TASK: usize = 32;

/// The pairs of triangles that intersect in more than shared vertices and edges: each pair
/// ascending, the list sorted. Touching and coplanar overlap count.
///
/// Takes O(n log n + pairs) on surfaces. The result does not depend on the number of threads.
/// Positions must be finite.
pub fn self_intersections(mesh: &TriMesh) -> Vec<[FaceId; 2]> {
    self_intersections_by(mesh, &Bvh::new(&mesh.vertices, &mesh.triangles))
}

/// [`self_intersections`] with the tree over the triangles of `mesh`.
pub fn self_intersections_by(mesh: &TriMesh, tree: &Bvh) -> Vec<[FaceId; 2]> {
    let Ok(pairs) = self_intersections_while(mesh, tree, || Ok::<(), Infallible>(()));
    pairs
}

/// [`self_intersections_by`] of a mesh so large that the search takes long: ends soon after `go_on` returns an
/// error, with that.
///
/// # Errors
/// The error of `go_on`.
pub fn self_intersections_while<E: Send>(
    mesh: &TriMesh,
    tree: &Bvh,
    go_on: impl Fn() -> Result<(), E> + Sync,
) -> Result<Vec<[FaceId; 2]>, E> {
    go_on()?;
    let embedded = fans::embedded_fans(mesh);
    let corners = |t: FaceId| (mesh.corner_ids(t), mesh.corners(t.index()));
    let found: Result<Vec<_>, E> = (tree.leaves().into_par_iter())
        .with_min_len(LEAVES_PER_TASK)
        .map(|leaf| {
            go_on()?;
            let mut found = Vec::new();
            tree.for_each_pair_from(leaf, |s, t| {
                let [of_s, of_t] = [s, t].map(|t| mesh.triangles[t as usize]);
                if (of_s.iter()).any(|v| of_t.contains(v) && embedded[*v as usize]) {
                    return;
                }
                let (s, t) = (FaceId(s), FaceId(t));
                let ((s_ids, s_corners), (t_ids, t_corners)) = (corners(s), corners(t));
                if triangles_intersect(s_ids, &s_corners, t_ids, &t_corners) {
                    found.push([s, t]);
                }
            });
            Ok(found)
        })
        .collect();
    let mut found = found?.concat();
    found.sort_unstable();
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::mesh::shapes;

    #[test]
    fn embedded_surfaces_have_none() {
        for mesh in [
            shapes::icosphere(10.0, 3),
            shapes::torus(9.0, 3.0, 40, 20),
            shapes::cup(60.0, 30.0, 1.0, 48),
        ] {
            assert_eq!(self_intersections(&mesh), Vec::<[FaceId; 2]>::new());
        }
    }

    #[test]
    fn agrees_with_a_test_of_all_pairs() {
        // A torus whose tube is thicker than its ring passes through itself.
        let mesh = shapes::torus(2.0, 3.0, 30, 20);
        let mut expected = Vec::new();
        let triangle = |t: FaceId| (mesh.corner_ids(t), mesh.corners(t.index()));
        for s in FaceId::first(mesh.triangles.len()) {
            for t in FaceId::first(mesh.triangles.len()).filter(|t| s < *t) {
                let ((i, p), (j, q)) = (triangle(s), triangle(t));
                if triangles_intersect(i, &p, j, &q) {
                    expected.push([s, t]);
                }
            }
        }
        assert!(expected.len() > 20);
        assert_eq!(self_intersections(&mesh), expected);
    }

    #[test]
    fn a_vertex_pulled_through_the_opposite_side_is_found() {
        let mut mesh = shapes::icosphere(10.0, 2);
        mesh.vertices[0] *= -1.3;
        let pairs = self_intersections(&mesh);
        assert!(!pairs.is_empty());
        assert!(
            pairs
                .iter()
                .all(|pair| { pair.iter().any(|t| mesh.triangles[t.index()].contains(&0)) })
        );
    }

    #[test]
    fn a_triangle_folded_flat_onto_its_neighbour_is_found() {
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
        assert_eq!(self_intersections(&fold), vec![[FaceId(0), FaceId(1)]]);
    }
}
