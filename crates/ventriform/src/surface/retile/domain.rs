//! A closed surface with the tables for paths on it: connectivity and edge lengths.
//!
//! Every triangle has a flat frame of its own: corner 0 at the origin, corner 1 on the x axis,
//! corner 2 above it. Distances and directions along the surface follow from these frames and
//! from how they join at the edges; positions in space are not needed.

use super::SurfacePoint;
use crate::base::geometry::{Vec2, Vec3};
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    /// The flat triangles are those in space, counter-clockwise from the first corner at the origin.
    #[test]
    fn flat_triangles_keep_all_lengths() {
        let mesh = shapes::cup(60.0, 30.0, 10.0, 12);
        let domain = Domain::new(mesh.vertices.clone(), mesh.triangles.clone()).unwrap();
        assert!((domain.area - mesh.area()).abs() < 1e-9 * mesh.area());
        for t in 0..mesh.triangles.len() {
            let (space, flat) = (mesh.corners(t), domain.flat(FaceId(t as u32)));
            for k in 0..3 {
                let l = (k + 1) % 3;
                let exact = (space[l] - space[k]).norm();
                assert!(((flat[l] - flat[k]).norm() - exact).abs() < 1e-9);
                let h = FaceId(t as u32).half_edge(k);
                assert!((domain.length(h) - exact).abs() < 1e-12);
                let (x, y) = domain.apex(h);
                let along = (space[l] - space[k]) / exact;
                let beyond = space[(k + 2) % 3] - space[k];
                assert!((x - beyond.dot(&along)).abs() < 1e-9);
                assert!((y - beyond.cross(&along).norm()).abs() < 1e-9);
            }
            assert!(flat[0].norm() == 0.0 && flat[1].y == 0.0 && flat[2].y > 0.0);
        }
    }

    #[test]
    fn values_are_interpolated_as_positions_are() {
        let mesh = shapes::icosphere(8.0, 1);
        let domain = Domain::new(mesh.vertices.clone(), mesh.triangles.clone()).unwrap();
        let linear = |p: &Vec3| 2.0 * p.x - 3.0 * p.y + p.z + 1.0;
        let values: Vec<f64> = mesh.vertices.iter().map(linear).collect();
        let point = SurfacePoint {
            triangle: FaceId(7),
            barycentric: [0.2, 0.5, 0.3],
        };
        let corners = mesh.corners(7);
        let place = corners[0] * 0.2 + corners[1] * 0.5 + corners[2] * 0.3;
        assert!((point.position(&mesh.vertices, &mesh.triangles) - place).norm() < 1e-12);
        assert!((domain.interpolate(&values, &point) - linear(&place)).abs() < 1e-12);
    }
}
