//! Defects of a list of triangles that should be a closed manifold.

use super::ids::{FaceId, VertexId};

/// The property that keeps a triangle list from being a closed, oriented 2-manifold, and
/// where it is violated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum MeshDefect {
    /// A triangle names the same vertex twice.
    #[error("triangle {triangle} uses the same vertex twice")]
    DegenerateTriangle {
        /// The triangle.
        triangle: FaceId,
    },
    /// The edge belongs to one triangle only: the surface has a boundary there.
    #[error("the edge between vertices {} and {} belongs to one triangle only", edge[0], edge[1])]
    OpenEdge {
        /// The edge's vertices, the lower first.
        edge: [VertexId; 2],
    },
    /// Three or more triangles share the edge.
    #[error("the edge between vertices {} and {} belongs to more than two triangles", edge[0], edge[1])]
    NonManifoldEdge {
        /// The edge's vertices, the lower first.
        edge: [VertexId; 2],
    },
    /// Both triangles of the edge traverse it in the same direction.
    #[error("the triangles at the edge between vertices {} and {} have opposite orientations", edge[0], edge[1])]
    OrientationConflict {
        /// The edge's vertices, the lower first.
        edge: [VertexId; 2],
    },
    /// The triangles around the vertex form more than one cycle.
    #[error("vertex {vertex} joins more than one fan of triangles")]
    NonManifoldVertex {
        /// The vertex.
        vertex: VertexId,
    },
    /// No triangle uses the vertex.
    #[error("vertex {vertex} belongs to no triangle")]
    UnusedVertex {
        /// The vertex.
        vertex: VertexId,
    },
    /// Two triangles have the same three vertices.
    #[error("triangle {triangle} has the same three vertices as an earlier one")]
    DuplicateTriangle {
        /// The later triangle.
        triangle: FaceId,
    },
}
