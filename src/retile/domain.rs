//! The surface as the geodesic steps see it: lengths and neighbours, no positions needed.
//!
//! Every triangle lies flat in its own frame: corner 0 at the origin, corner 1 on the x axis,
//! corner 2 above it. Edge k joins corners k and k+1.

use super::SurfacePoint;
use crate::geometry::{Vec2, Vec3};
use crate::mesh::adjacency::Adjacency;
use crate::mesh::topology::Defect;

/// A closed triangle surface with the tables that walking on it needs.
#[derive(Debug, Clone)]
pub(crate) struct Domain {
    /// Positions, millimetres.
    pub vertices: Vec<Vec3>,
    /// Counter-clockwise corners.
    pub triangles: Vec<[u32; 3]>,
    /// Neighbours of half-edges.
    pub adjacency: Adjacency,
    /// A half-edge that leaves each vertex.
    pub outgoing: Vec<u32>,
    /// Length of every half-edge, millimetres.
    pub lengths: Vec<f64>,
    /// Total area, mm².
    pub area: f64,
}

impl Domain {
    /// Prepares a closed manifold.
    ///
    /// # Errors
    /// The first [`Defect`] where it is none.
    pub fn new(vertices: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Result<Self, Defect> {
        let adjacency = Adjacency::new(&triangles)?;
        let mut outgoing = Vec::with_capacity(vertices.len());
        for (v, h) in Adjacency::outgoing(&triangles, vertices.len())
            .into_iter()
            .enumerate()
        {
            outgoing.push(h.ok_or(Defect::UnusedVertex { vertex: v as u32 })?);
        }
        let mut lengths = Vec::with_capacity(3 * triangles.len());
        let mut area = 0.0;
        for t in &triangles {
            let p = t.map(|v| vertices[v as usize]);
            for k in 0..3 {
                lengths.push((p[(k + 1) % 3] - p[k]).norm());
            }
            area += (p[1] - p[0]).cross(&(p[2] - p[0])).norm() / 2.0;
        }
        Ok(Self {
            vertices,
            triangles,
            adjacency,
            outgoing,
            lengths,
            area,
        })
    }

    /// The corners of triangle `t` in its own frame.
    pub fn flat(&self, t: u32) -> [Vec2; 3] {
        let h = 3 * t as usize;
        let (x, y) = apex(self.lengths[h], self.lengths[h + 2], self.lengths[h + 1]);
        [
            Vec2::zeros(),
            Vec2::new(self.lengths[h], 0.0),
            Vec2::new(x, y),
        ]
    }

    /// A value given at every vertex, at a point.
    pub fn interpolate(&self, values: &[f64], point: &SurfacePoint) -> f64 {
        let corners = self.triangles[point.triangle as usize];
        (0..3)
            .map(|k| point.barycentric[k] * values[corners[k] as usize])
            .sum()
    }

    /// The two vertices of half-edge `h`.
    pub fn ends(&self, h: u32) -> [u32; 2] {
        let t = &self.triangles[h as usize / 3];
        [t[h as usize % 3], t[(h as usize + 1) % 3]]
    }
}

/// Where the third corner lies over a side of length `base` from the origin along x, `left`
/// and `right` away from the side's ends.
pub(crate) fn apex(base: f64, left: f64, right: f64) -> (f64, f64) {
    let x = (left * left + base * base - right * right) / (2.0 * base);
    (x, (left * left - x * x).max(0.0).sqrt())
}
