//! Evens out how the model bends, along the normals.
//!
//! A vertex's height is how far its neighbours' mean lies above it. Heights that change from
//! vertex to vertex are noise, or facets of the voxels, that the model has followed; where they
//! are all alike it is bent as evenly as a sphere. So every vertex is drawn along its normal to
//! where its height is its neighbours' mean: the umbrella operator applied twice (Kobbelt et al.,
//! Interactive Multi-Resolution Modeling on Arbitrary Meshes, 1998), which unlike applying it
//! once draws no sphere together.
//!
//! The neighbours count as being at rest during a round. That keeps the term to one vertex each.

use super::Model;
use super::equations::Element;
use crate::geometry::{Vec3, triangle};
use crate::optimise::connectivity::Connectivity;

/// Raising a vertex of valence 6 among others by 1 lowers its own height by 1 and raises each
/// of its neighbours' by a sixth.
const PER_HEIGHT: f64 = 6.0 / 7.0;

pub struct Bends<'a> {
    connectivity: &'a Connectivity,
    normals: Vec<Vec3>,
    /// How far each vertex is to move along its normal, mm.
    rises: Vec<f64>,
    weight: f64,
}

impl<'a> Bends<'a> {
    pub fn new(model: &'a Model) -> Self {
        let (vertices, connectivity) = (&model.vertices, &model.connectivity);
        let mut normals = vec![Vec3::zeros(); vertices.len()];
        for t in connectivity.triangles() {
            let [a, b, c] = t.map(|v| vertices[v as usize]);
            let normal = triangle::area_normal(&a, &b, &c);
            for &v in t {
                normals[v as usize] += normal;
            }
        }
        for normal in &mut normals {
            *normal = normal.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
        }
        let heights: Vec<f64> = (0..vertices.len())
            .map(|v| {
                let neighbours = connectivity
                    .around(v as u32)
                    .map(|h| connectivity.target(h));
                let sum: Vec3 = neighbours.map(|u| vertices[u as usize]).sum();
                let mean = sum / f64::from(connectivity.valence(v as u32));
                (mean - vertices[v]).dot(&normals[v])
            })
            .collect();
        let rises = (0..vertices.len())
            .map(|v| {
                let neighbours = connectivity
                    .around(v as u32)
                    .map(|h| connectivity.target(h));
                let sum: f64 = neighbours.map(|u| heights[u as usize]).sum();
                let mean = sum / f64::from(connectivity.valence(v as u32));
                PER_HEIGHT * (heights[v] - mean)
            })
            .collect();
        let weight = model.parameters.bend_weight * model.fineness / vertices.len() as f64;
        Self {
            connectivity,
            normals,
            rises,
            weight,
        }
    }

    /// Adds what triangle `t` has of its corners' terms: each corner's is spread over the
    /// triangles round it.
    pub fn add_to(&self, element: &mut Element, t: usize) {
        for (k, &v) in self.connectivity.triangles()[t].iter().enumerate() {
            let mut at_corner = [0.0; 3];
            at_corner[k] = 1.0;
            let (normal, rise) = (&self.normals[v as usize], self.rises[v as usize]);
            let weight = self.weight / f64::from(self.connectivity.valence(v));
            element.add_plane(&at_corner, normal, rise, weight);
        }
    }
}
