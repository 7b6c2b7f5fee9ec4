//! The one triangle mesh, what is true of it, and small meshes to try things on.
//!
//! [`TriMesh`] is plain data: positions in millimetres (LPS) and index triples that run
//! counter-clockwise seen from outside. [`topology`] says whether it is a closed manifold;
//! [`adjacency`] walks it.

pub mod adjacency;
pub mod intersections;
pub mod shapes;
pub mod topology;

use crate::geometry::{Vec3, triangle};

/// A triangle mesh: positions (LPS, mm) and counter-clockwise index triples.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriMesh {
    /// Vertex positions in millimetres, patient frame LPS.
    pub vertices: Vec<Vec3>,
    /// Vertex indices of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl TriMesh {
    /// The three corner positions of triangle `t`.
    pub fn corners(&self, t: usize) -> [Vec3; 3] {
        self.triangles[t].map(|v| self.vertices[v as usize])
    }

    /// Twice the area times the outward unit normal of triangle `t`.
    pub fn area_normal(&self, t: usize) -> Vec3 {
        let [a, b, c] = self.corners(t);
        triangle::area_normal(&a, &b, &c)
    }

    /// Total area, mm².
    pub fn area(&self) -> f64 {
        (0..self.triangles.len())
            .map(|t| self.area_normal(t).norm() / 2.0)
            .sum()
    }

    /// Enclosed volume, mm³: positive where the triangles face outward (divergence theorem,
    /// taken about the first vertex to keep digits far from the origin).
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

    /// Area-weighted unit normal of every vertex; zero where a vertex has no area around it.
    pub fn vertex_normals(&self) -> Vec<Vec3> {
        let mut normals = vec![Vec3::zeros(); self.vertices.len()];
        for t in 0..self.triangles.len() {
            let n = self.area_normal(t);
            for v in self.triangles[t] {
                normals[v as usize] += n;
            }
        }
        for n in &mut normals {
            *n = n.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
        }
        normals
    }
}
