//! The reference surface S, prepared for distance queries.

use std::sync::Arc;

use super::fitness::Lengths;
use crate::base::geometry::bvh::Bvh;
use crate::base::geometry::{Vec3, triangle};
use crate::mesh::TriMesh;
use crate::surface::Surface;

/// The reference surface S with its search tree.
#[derive(Debug, Clone)]
pub struct Reference {
    /// S, LPS mm.
    pub mesh: TriMesh,
    /// Unit normal of every triangle of S; zero for a degenerate one.
    pub normals: Vec<Vec3>,
    /// Search tree over the triangles of S.
    pub bvh: Arc<Bvh>,
    /// Area of S, mm².
    pub area: f64,
    /// Smallest voxel spacing of the volume that S was extracted from, mm.
    pub spacing: f64,
    /// Standard deviation of the noise that was taken off S, mm.
    pub noise: f64,
}

impl Reference {
    /// Prepares `surface` for distance queries.
    pub fn new(surface: &Surface) -> Self {
        let mesh = surface.mesh.clone();
        let normals = (0..mesh.triangles.len())
            .map(|t| triangle::unit_normal(&mesh.corners(t)))
            .collect();
        let bvh = (surface.tree.clone())
            .unwrap_or_else(|| Arc::new(Bvh::new(&mesh.vertices, &mesh.triangles)));
        Self {
            area: mesh.area(),
            mesh,
            normals,
            bvh,
            spacing: surface.spacing,
            noise: surface.facts.noise.map_or(0.0, |noise| noise.offset_mm),
        }
    }

    /// The lengths to which the distances of a mesh of `triangles` triangles are related.
    pub fn lengths(&self, triangles: usize) -> Lengths {
        let each = self.area / triangles.max(1) as f64;
        Lengths {
            voxel: self.spacing,
            edge: (4.0 * each / 3f64.sqrt()).sqrt(),
        }
    }

    /// The distance from `point` to S, mm; infinite if S is empty.
    pub fn distance(&self, point: &Vec3) -> f64 {
        self.bvh
            .closest(point)
            .map_or(f64::INFINITY, |found| found.squared_distance.sqrt())
    }
}
