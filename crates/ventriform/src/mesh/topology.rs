//! Checks that a mesh is a closed manifold, and counts its topology.
//!
//! In: index triples. Out: a [`Census`] (vertices, edges, triangles, components, Euler
//! characteristic), or the first [`MeshDefect`].
//!
//! A mesh passes if every edge belongs to exactly two triangles that traverse it in opposite
//! directions, every vertex is used and surrounded by a single cycle of triangles, and no
//! triangle occurs twice. Positions are not considered; self-intersection is the subject of
//! [`super::intersections`].

use super::TriMesh;
use super::half_edges::{around, lowest_outgoing, pair_half_edges};
use super::ids::{FaceId, VertexId};
use crate::base::geometry::Vec3;
use crate::base::numeric::disjoint_sets;

pub use super::defect::MeshDefect;

/// The counts of a closed manifold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Census {
    /// Number of vertices, V.
    pub vertices: usize,
    /// Number of edges, E.
    pub edges: usize,
    /// Number of triangles, F.
    pub triangles: usize,
    /// Number of connected components.
    pub components: usize,
    /// V - E + F: 2 for each component, less 2 for each handle.
    pub euler_characteristic: i64,
}

impl Census {
    /// Number of handles over all components.
    pub fn genus(&self) -> i64 {
        self.components as i64 - self.euler_characteristic / 2
    }
}

/// Checks that `mesh` is a closed, oriented 2-manifold and counts its topology.
///
/// # Errors
/// The first [`MeshDefect`] found.
pub fn check(mesh: &TriMesh) -> Result<Census, MeshDefect> {
    check_triangles(mesh.vertices.len(), &mesh.triangles)
}

/// [`check`] for a triangle list over `vertices` vertices.
///
/// # Errors
/// The first [`MeshDefect`] found.
pub fn check_triangles(vertices: usize, triangles: &[[u32; 3]]) -> Result<Census, MeshDefect> {
    let twins = pair_half_edges(triangles)?;
    // Every edge has two triangles, so a duplicate lies across each of its three edges.
    let sorted = |t: FaceId| {
        let mut key = triangles[t.index()];
        key.sort_unstable();
        key
    };
    for t in FaceId::first(triangles.len()) {
        let across = twins[t.half_edge(0).index()].face();
        if t < across && sorted(t) == sorted(across) {
            return Err(MeshDefect::DuplicateTriangle { triangle: across });
        }
    }
    let mut corners = vec![0u32; vertices];
    for &v in triangles.iter().flatten() {
        corners[v as usize] += 1;
    }
    let outgoing = lowest_outgoing(triangles, vertices);
    for (vertex, outgoing) in VertexId::first(vertices).zip(outgoing) {
        let Some(first) = outgoing else {
            return Err(MeshDefect::UnusedVertex { vertex });
        };
        if around(&twins, first).count() != corners[vertex.index()] as usize {
            return Err(MeshDefect::NonManifoldVertex { vertex });
        }
    }
    let edges = 3 * triangles.len() / 2;
    Ok(Census {
        vertices,
        edges,
        triangles: triangles.len(),
        components: component_count(&components(vertices, triangles)),
        euler_characteristic: vertices as i64 - edges as i64 + triangles.len() as i64,
    })
}

/// The connected component of every vertex, numbered in the order of their lowest vertices.
pub fn components(vertices: usize, triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut parent = disjoint_sets::singletons(vertices);
    for [a, b, c] in triangles {
        disjoint_sets::unite(&mut parent, *a, *b);
        disjoint_sets::unite(&mut parent, *a, *c);
    }
    disjoint_sets::set_numbers(&mut parent)
}

/// The number of components, given that of every vertex by [`components`].
pub fn component_count(component: &[u32]) -> usize {
    component.iter().max().map_or(0, |c| *c as usize + 1)
}

/// The Euler characteristic of each component of a closed mesh; `component` gives that of every
/// vertex, as [`components`] does.
pub fn component_characteristics(triangles: &[[u32; 3]], component: &[u32]) -> Vec<i64> {
    // V - E + F with 2E = 3F, doubled.
    let mut doubled = vec![0i64; component_count(component)];
    for &c in component {
        doubled[c as usize] += 2;
    }
    for corners in triangles {
        doubled[component[corners[0] as usize] as usize] -= 1;
    }
    doubled.into_iter().map(|d| d / 2).collect()
}

/// The signed volume of each component, mm³: positive where its triangles face outward,
/// negative where it bounds a cavity. `component` gives the component of every vertex, as
/// [`components`] does.
pub fn component_volumes(vertices: &[Vec3], triangles: &[[u32; 3]], component: &[u32]) -> Vec<f64> {
    let count = component_count(component);
    // Relative to a vertex of the component: far from the origin digits would cancel.
    let mut origin = vec![None; count];
    let mut volumes = vec![0.0; count];
    for t in triangles {
        let corners = t.map(|v| vertices[v as usize]);
        let c = component[t[0] as usize] as usize;
        let origin = *origin[c].get_or_insert(corners[0]);
        let [p, q, r] = corners.map(|p| p - origin);
        volumes[c] += p.dot(&q.cross(&r)) / 6.0;
    }
    volumes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn sphere_torus_and_cup_are_counted_right() {
        let sphere = check(&shapes::icosphere(1.0, 2)).unwrap();
        assert_eq!((sphere.euler_characteristic, sphere.genus()), (2, 0));
        assert_eq!(sphere.vertices, 162);
        let torus = check(&shapes::torus(3.0, 1.0, 12, 8)).unwrap();
        assert_eq!((torus.euler_characteristic, torus.genus()), (0, 1));
        let cup = check(&shapes::cup(60.0, 30.0, 10.0, 24)).unwrap();
        assert_eq!((cup.euler_characteristic, cup.components), (2, 1));
    }

    #[test]
    fn every_defect_is_found() {
        let sphere = shapes::icosphere(1.0, 1);
        let n = sphere.vertices.len();
        let with = |change: &dyn Fn(&mut Vec<[u32; 3]>)| {
            let mut triangles = sphere.triangles.clone();
            change(&mut triangles);
            check_triangles(n, &triangles).unwrap_err()
        };
        assert!(matches!(
            with(&|t| {
                t.pop();
            }),
            MeshDefect::OpenEdge { .. }
        ));
        assert!(matches!(
            with(&|t| t[0].swap(0, 1)),
            MeshDefect::OrientationConflict { .. }
        ));
        assert!(matches!(
            with(&|t| t.push(t[0])),
            MeshDefect::NonManifoldEdge { .. }
        ));
        assert!(matches!(
            with(&|t| t[0][0] = t[0][1]),
            MeshDefect::DegenerateTriangle {
                triangle: FaceId(0)
            }
        ));
        assert!(matches!(
            check_triangles(n + 1, &sphere.triangles).unwrap_err(),
            MeshDefect::UnusedVertex { .. }
        ));
        // Two tetrahedra that share one vertex.
        let t = shapes::tetrahedron(1.0).triangles;
        let mut pair = t.clone();
        pair.extend(t.iter().map(|t| t.map(|v| if v == 0 { 0 } else { v + 3 })));
        assert_eq!(
            check_triangles(7, &pair).unwrap_err(),
            MeshDefect::NonManifoldVertex {
                vertex: VertexId(0)
            }
        );
        // Two triangles glued back to back.
        assert!(matches!(
            check_triangles(3, &[[0, 1, 2], [0, 2, 1]]).unwrap_err(),
            MeshDefect::DuplicateTriangle { .. }
        ));
    }
}
