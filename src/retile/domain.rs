//! A closed surface with the tables for paths on it: connectivity and edge lengths.
//!
//! Every triangle has a flat frame of its own: corner 0 at the origin, corner 1 on the x axis,
//! corner 2 above it. Distances and directions along the surface follow from these frames and
//! from how they join at the edges; positions in space are not needed.

use super::SurfacePoint;
use crate::geometry::{Vec2, Vec3};
use crate::mesh::half_edges::HalfEdges;
use crate::mesh::topology::MeshDefect;
use crate::mesh::{FaceId, HalfEdgeId};

/// A closed triangle surface with its connectivity and edge lengths.
#[derive(Debug, Clone)]
pub(crate) struct Domain {
    /// Positions of the vertices, mm.
    pub vertices: Vec<Vec3>,
    /// Connectivity.
    pub half_edges: HalfEdges,
    /// Length of every half-edge, mm.
    pub lengths: Vec<f64>,
    /// Total area, mm².
    pub area: f64,
}

impl Domain {
    /// Prepares a closed manifold.
    ///
    /// # Errors
    /// The first [`MeshDefect`] of a mesh that is not one.
    pub fn new(vertices: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Result<Self, MeshDefect> {
        let half_edges = HalfEdges::new(vertices.len(), triangles)?;
        let mut lengths = Vec::with_capacity(half_edges.half_edge_count());
        let mut area = 0.0;
        for t in half_edges.triangles() {
            let p = t.map(|v| vertices[v as usize]);
            for k in 0..3 {
                lengths.push((p[(k + 1) % 3] - p[k]).norm());
            }
            area += (p[1] - p[0]).cross(&(p[2] - p[0])).norm() / 2.0;
        }
        Ok(Self {
            vertices,
            half_edges,
            lengths,
            area,
        })
    }

    /// The length of half-edge `h`, mm.
    pub fn length(&self, h: HalfEdgeId) -> f64 {
        self.lengths[h.index()]
    }

    /// The corners of triangle `t` in its own frame, mm.
    pub fn flat(&self, t: FaceId) -> [Vec2; 3] {
        let base = t.half_edge(0);
        let (x, y) = self.apex(base);
        [
            Vec2::zeros(),
            Vec2::new(self.length(base), 0.0),
            Vec2::new(x, y),
        ]
    }

    /// The third corner of the triangle of `h` in the frame in which `h` runs from the origin
    /// along the x axis, mm.
    pub fn apex(&self, h: HalfEdgeId) -> (f64, f64) {
        let [base, left, right] = [h, h.previous(), h.next()].map(|h| self.length(h));
        apex(base, left, right)
    }

    /// The value at a point, interpolated from values at the vertices.
    pub fn interpolate(&self, values: &[f64], point: &SurfacePoint) -> f64 {
        let corners = self.half_edges.corners(point.triangle);
        (0..3)
            .map(|k| point.barycentric[k] * values[corners[k].index()])
            .sum()
    }
}

/// The third corner over a side that runs from the origin along the x axis: `base` is the length
/// of the side, `left` and `right` are the distances of the corner from its start and end.
pub(crate) fn apex(base: f64, left: f64, right: f64) -> (f64, f64) {
    let x = (left * left + base * base - right * right) / (2.0 * base);
    (x, (left * left - x * x).max(0.0).sqrt())
}
