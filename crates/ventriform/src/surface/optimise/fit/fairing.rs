//! Fairing: makes the dihedral angles of the model change evenly, along the vertex normals.
//!
//! The height of a vertex is the distance, along its normal, from the vertex to the mean of its
//! neighbours. Heights that differ from vertex to vertex are noise, or facets of the voxels,
//! that the model has followed; where all are alike the surface is as evenly curved as a
//! sphere. Each vertex is therefore pulled along its normal to where its height is the mean of
//! its neighbours' heights. That is the umbrella operator applied twice (Kobbelt et al.,
//! *Interactive multi-resolution modeling on arbitrary meshes*, SIGGRAPH 1998); unlike a single
//! application it does not shrink spheres.
//!
//! During a round the neighbours count as fixed, so each of these terms involves one vertex.

use super::FitState;
use super::equations::Element;
use crate::base::geometry::Vec3;
use crate::mesh::half_edges::HalfEdges;
use crate::mesh::{FaceId, VertexId, vertex_normals};
use crate::surface::optimise::{LeastSquaresParameters, Lengths};

/// The rise that corrects a unit difference of heights. Raising one vertex of valence 6 by 1
/// lowers its own height by 1 and raises that of each neighbour by a sixth.
const RISE_PER_HEIGHT: f64 = 6.0 / 7.0;

/// Weight of the fairing, as a multiple of the bend weight, per noise over edge length. Larger ones take
/// off more noise, but also more of the shape.
const PER_NOISE: f64 = 20.0;

/// The weight of even heights relative to squared distances. The smaller the triangles, the more of what
/// they can follow is facets of the voxels; and part of the noise is left on S, the more the noisier the
/// scan, and can be followed only by triangles that are small against it.
pub fn weight(parameters: &LeastSquaresParameters, lengths: &Lengths, noise: f64) -> f64 {
    let facets = (lengths.voxel / lengths.edge).min(1.0);
    parameters.bend_weight * (facets + PER_NOISE * noise / lengths.edge)
}

/// The fairing terms of one round.
pub struct Fairing<'a> {
    half_edges: &'a HalfEdges,
    /// Unit normal at each vertex.
    normals: Vec<Vec3>,
    /// Wanted motion of each vertex along its normal, mm.
    pub(super) rises: Vec<f64>,
    /// Weight of each vertex's term.
    weight: f64,
}

impl<'a> Fairing<'a> {
    /// The terms for the present state of the fit.
    pub fn new(state: &'a FitState) -> Self {
        let (vertices, half_edges) = (&state.vertices, &state.half_edges);
        let normals = vertex_normals(vertices, half_edges.triangles());
        let valence = |v: VertexId| f64::from(half_edges.valence(v));
        let heights: Vec<f64> = half_edges
            .vertices()
            .map(|v| {
                let neighbours = half_edges.neighbours(v);
                let sum: Vec3 = neighbours.map(|u| vertices[u.index()]).sum();
                (sum / valence(v) - vertices[v.index()]).dot(&normals[v.index()])
            })
            .collect();
        let rises = half_edges
            .vertices()
            .map(|v| {
                let neighbours = half_edges.neighbours(v);
                let sum: f64 = neighbours.map(|u| heights[u.index()]).sum();
                RISE_PER_HEIGHT * (heights[v.index()] - sum / valence(v))
            })
            .collect();
        let weight = state.fairness / vertices.len() as f64;
        Self {
            half_edges,
            normals,
            rises,
            weight,
        }
    }

    /// Adds the share of triangle `t` in the terms of its corners: each vertex's term is divided
    /// among the triangles around it.
    pub fn add_to(&self, element: &mut Element, t: FaceId) {
        for (k, v) in self.half_edges.corners(t).into_iter().enumerate() {
            let mut at_corner = [0.0; 3];
            at_corner[k] = 1.0;
            let (normal, rise) = (&self.normals[v.index()], self.rises[v.index()]);
            let weight = self.weight / f64::from(self.half_edges.valence(v));
            element.add_plane(&at_corner, normal, rise, weight);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Voxels and noise are each measured by the edges, and add up; voxels longer than the edges count as they do.
    #[test]
    fn facets_and_noise_add_to_the_weight() {
        let parameters = LeastSquaresParameters::default();
        let of = |voxel: f64, edge: f64, noise: f64| {
            weight(&parameters, &Lengths { voxel, edge }, noise) / parameters.bend_weight
        };
        assert!((of(2.0, 8.0, 0.0) - 0.25).abs() < 1e-12);
        assert!((of(9.0, 8.0, 0.0) - 1.0).abs() < 1e-12);
        for noise in [0.1, 0.4] {
            let more = of(2.0, 8.0, noise) - of(2.0, 8.0, 0.0);
            assert!((more - PER_NOISE * noise / 8.0).abs() < 1e-12);
        }
    }
}
