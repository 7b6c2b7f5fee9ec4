//! The triangle mesh that all stages share: storage, connectivity, topology, intersections.
//!
//! [`TriMesh`] is plain data: positions in millimetres (LPS) and index triples,
//! counter-clockwise seen from outside. The other modules answer questions about it:
//!
//! - [`ids`]: index types for vertices, faces and half-edges;
//! - [`half_edges`]: neighbours, and edge flips;
//! - [`topology`]: whether it is a closed manifold, with how many components and handles;
//! - [`intersections`]: which of its triangles intersect, decided exactly;
//! - [`part`]: the parts of a ventricle's wall;
//! - [`subdivide`]: the same surface with smaller triangles;
//! - [`shapes`]: meshes with known properties, for tests and examples.

pub mod decimate;
pub mod files;

mod defect;
pub mod half_edges;
pub mod ids;
pub mod intersections;
pub mod part;
pub mod shapes;
pub mod subdivide;
pub mod topology;

pub use ids::{FaceId, HalfEdgeId, VertexId};

use crate::base::geometry::{Vec3, triangle};

/// A triangle mesh: vertex positions and index triples. Nothing about its topology is promised;
/// [`topology::check`] tells.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriMesh {
    /// Vertex positions in millimetres, patient frame LPS.
    pub vertices: Vec<Vec3>,
    /// Vertex indices of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl TriMesh {
    /// The corner indices of a face.
    pub fn corner_ids(&self, face: FaceId) -> [VertexId; 3] {
        ids::typed(self.triangles[face.index()])
    }

    /// The positions of the corners of triangle `t`, mm.
    pub fn corners(&self, t: usize) -> [Vec3; 3] {
        self.triangles[t].map(|v| self.vertices[v as usize])
    }

    /// The outward normal of triangle `t`, twice its area long, mm².
    pub fn area_normal(&self, t: usize) -> Vec3 {
        let [a, b, c] = self.corners(t);
        triangle::area_normal(&a, &b, &c)
    }

    /// The radius ratio 2r/R of each triangle, 0..=1.
    pub fn radius_ratios(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.triangles.len()).map(|t| {
            let [a, b, c] = self.corners(t);
            triangle::radius_ratio(&a, &b, &c)
        })
    }

    /// Total area, mm².
    pub fn area(&self) -> f64 {
        (0..self.triangles.len())
            .map(|t| self.area_normal(t).norm() / 2.0)
            .sum()
    }

    /// Enclosed volume, mm³, by the divergence theorem: positive if the triangles face outward.
    /// Computed relative to the first vertex, since far from the origin digits would cancel.
    pub fn volume(&self) -> f64 {
        let Some(origin) = self.vertices.first() else {
            return 0.0;
        };
        (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t).map(|p| p - origin);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum()
    }

    /// See [`vertex_normals`].
    pub fn vertex_normals(&self) -> Vec<Vec3> {
        vertex_normals(&self.vertices, &self.triangles)
    }
}

/// The unit normal of every vertex: the mean normal of the triangles around it, weighted by
/// area. Zero where they have no area.
pub fn vertex_normals(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut normals = vec![Vec3::zeros(); vertices.len()];
    for t in triangles {
        let [a, b, c] = t.map(|v| vertices[v as usize]);
        let normal = triangle::area_normal(&a, &b, &c);
        for &v in t {
            normals[v as usize] += normal;
        }
    }
    for n in &mut normals {
        *n = n.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
    }
    normals
}
