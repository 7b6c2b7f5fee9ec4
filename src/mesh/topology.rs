//! Is it a closed manifold, and of which kind?
//!
//! [`check`] demands and counts. A mesh passes when every edge belongs to exactly two
//! triangles that run through it in opposite directions, every vertex is used and has one
//! single cycle of triangles around it, and no triangle occurs twice. Positions are not
//! looked at: self-intersection is [`super::intersections`]' business.

use super::TriMesh;
use super::adjacency::Adjacency;
use crate::geometry::Vec3;

/// What keeps a triangle list from being a closed, oriented 2-manifold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Defect {
    /// A triangle names one vertex twice.
    #[error("triangle {triangle} uses a vertex twice")]
    DegenerateTriangle {
        /// Index of the triangle.
        triangle: u32,
    },
    /// Only one triangle lies at the edge: the surface has a hole.
    #[error("edge {edge:?} belongs to one triangle only")]
    OpenEdge {
        /// The edge's vertices, the lower index first.
        edge: [u32; 2],
    },
    /// Three or more triangles share the edge.
    #[error("edge {edge:?} belongs to more than two triangles")]
    NonManifoldEdge {
        /// The edge's vertices, the lower index first.
        edge: [u32; 2],
    },
    /// The two triangles of the edge run the same way through it.
    #[error("the triangles at edge {edge:?} are oriented against each other")]
    TurnedTriangles {
        /// The edge's vertices, the lower index first.
        edge: [u32; 2],
    },
    /// The triangles round the vertex form more than one cycle.
    #[error("vertex {vertex} joins more than one fan of triangles")]
    NonManifoldVertex {
        /// Index of the vertex.
        vertex: u32,
    },
    /// No triangle uses the vertex.
    #[error("vertex {vertex} belongs to no triangle")]
    UnusedVertex {
        /// Index of the vertex.
        vertex: u32,
    },
    /// Two triangles have the same three vertices.
    #[error("triangle {triangle} has the same three vertices as another one")]
    DoubledTriangle {
        /// Index of the later triangle.
        triangle: u32,
    },
}

/// The numbers of a closed manifold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Census {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of edges.
    pub edges: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// Connected components.
    pub components: usize,
    /// V - E + F: 2 for each sphere, less 2 for each handle.
    pub euler_characteristic: i64,
}

impl Census {
    /// Handles over all components.
    pub fn genus(&self) -> i64 {
        self.components as i64 - self.euler_characteristic / 2
    }
}

/// Demands that `mesh` is a closed, oriented 2-manifold, and counts it.
///
/// # Errors
/// The first [`Defect`] met.
pub fn check(mesh: &TriMesh) -> Result<Census, Defect> {
    check_triangles(mesh.vertices.len(), &mesh.triangles)
}

/// [`check`] for a triangle list over `vertices` vertices.
///
/// # Errors
/// The first [`Defect`] met.
pub fn check_triangles(vertices: usize, triangles: &[[u32; 3]]) -> Result<Census, Defect> {
    let adjacency = Adjacency::new(triangles)?;
    // Where every edge belongs to two triangles, a double lies across each of the three.
    let sorted = |t: u32| {
        let mut key = triangles[t as usize];
        key.sort_unstable();
        key
    };
    for t in 0..triangles.len() as u32 {
        let across = adjacency.neighbours(t)[0];
        if t < across && sorted(t) == sorted(across) {
            return Err(Defect::DoubledTriangle { triangle: across });
        }
    }
    let mut corners = vec![0u32; vertices];
    for &v in triangles.iter().flatten() {
        corners[v as usize] += 1;
    }
    let outgoing = Adjacency::outgoing(triangles, vertices);
    for (vertex, h) in outgoing.iter().enumerate() {
        let vertex_id = vertex as u32;
        let Some(h) = h else {
            return Err(Defect::UnusedVertex { vertex: vertex_id });
        };
        if adjacency.around(*h).count() != corners[vertex] as usize {
            return Err(Defect::NonManifoldVertex { vertex: vertex_id });
        }
    }
    let edges = 3 * triangles.len() / 2;
    Ok(Census {
        vertices,
        edges,
        triangles: triangles.len(),
        components: components(vertices, triangles)
            .iter()
            .max()
            .map_or(0, |m| *m as usize + 1),
        euler_characteristic: vertices as i64 - edges as i64 + triangles.len() as i64,
    })
}

/// The connected component of every vertex, numbered by lowest vertex.
pub fn components(vertices: usize, triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..vertices as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    for t in triangles {
        for k in 1..3 {
            let (a, b) = (root(&mut parent, t[0]), root(&mut parent, t[k]));
            // The lower index becomes the root, so that numbering follows the vertices.
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut number = vec![u32::MAX; vertices];
    let mut count = 0;
    (0..vertices as u32)
        .map(|v| {
            let r = root(&mut parent, v) as usize;
            if number[r] == u32::MAX {
                number[r] = count;
                count += 1;
            }
            number[r]
        })
        .collect()
}

/// Signed volume of each component, mm³: positive where it faces outward, negative where it
/// bounds a cavity. `component` gives that of every vertex, as [`components`] does.
pub fn component_volumes(vertices: &[Vec3], triangles: &[[u32; 3]], component: &[u32]) -> Vec<f64> {
    let count = component.iter().max().map_or(0, |c| *c as usize + 1);
    // About a vertex of its own, to keep digits far from the origin.
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
            Defect::OpenEdge { .. }
        ));
        assert!(matches!(
            with(&|t| t[0].swap(0, 1)),
            Defect::TurnedTriangles { .. }
        ));
        assert!(matches!(
            with(&|t| t.push(t[0])),
            Defect::NonManifoldEdge { .. }
        ));
        assert!(matches!(
            with(&|t| t[0][0] = t[0][1]),
            Defect::DegenerateTriangle { triangle: 0 }
        ));
        assert!(matches!(
            check_triangles(n + 1, &sphere.triangles).unwrap_err(),
            Defect::UnusedVertex { .. }
        ));
        // Two tetrahedra that share one vertex.
        let t = shapes::tetrahedron(1.0).triangles;
        let mut pair = t.clone();
        pair.extend(t.iter().map(|t| t.map(|v| if v == 0 { 0 } else { v + 3 })));
        assert_eq!(
            check_triangles(7, &pair).unwrap_err(),
            Defect::NonManifoldVertex { vertex: 0 }
        );
        // Two triangles glued back to back.
        assert!(matches!(
            check_triangles(3, &[[0, 1, 2], [0, 2, 1]]).unwrap_err(),
            Defect::DoubledTriangle { .. }
        ));
    }
}
