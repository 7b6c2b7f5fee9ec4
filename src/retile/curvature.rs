//! How much the surface bends.
//!
//! The curvature tensor of Cohen-Steiner & Morvan (2003): every edge contributes its signed
//! dihedral angle times its length, in the edge's direction, to its two vertices. The tensors,
//! per area, are averaged over neighbourhoods before their eigenvalues are taken, since a
//! voxel surface bends at every edge.

use nalgebra::Matrix3;

use super::domain::Domain;
use crate::geometry::triangle;

/// Umbrella averages of the tensors: a neighbourhood of some five rings.
const AVERAGES: usize = 10;

/// The larger principal curvature in magnitude at every vertex, 1/mm.
pub(crate) fn curvature(domain: &Domain) -> Vec<f64> {
    let mut tensors = edge_tensors(domain);
    let mut areas = domain.vertex_areas.clone();
    for _ in 0..AVERAGES {
        tensors = umbrella(domain, &tensors, Matrix3::zeros());
        areas = umbrella(domain, &areas, 0.0);
    }
    tensors
        .iter()
        .zip(&areas)
        .map(|(tensor, area)| {
            if *area > 0.0 {
                (tensor / *area).symmetric_eigenvalues().amax()
            } else {
                0.0
            }
        })
        .collect()
}

fn edge_tensors(domain: &Domain) -> Vec<Matrix3<f64>> {
    let normal = |t: u32| {
        let [a, b, c] = domain.triangles[t as usize].map(|v| domain.vertices[v as usize]);
        triangle::area_normal(&a, &b, &c)
    };
    let mut tensors = vec![Matrix3::zeros(); domain.vertices.len()];
    for h in 0..domain.lengths.len() as u32 {
        let twin = domain.adjacency.twin(h);
        if h > twin {
            continue;
        }
        let [a, b] = domain.ends(h);
        let edge = domain.vertices[b as usize] - domain.vertices[a as usize];
        let length = domain.lengths[h as usize];
        if !(length > 0.0) {
            continue;
        }
        let (n, m) = (normal(h / 3), normal(twin / 3));
        let angle = triangle::angle_between(&n, &m) * n.cross(&m).dot(&edge).signum();
        // Half of the edge lies at either vertex.
        let tensor = edge * edge.transpose() * (angle / (2.0 * length));
        tensors[a as usize] += tensor;
        tensors[b as usize] += tensor;
    }
    tensors
}

fn umbrella<T>(domain: &Domain, values: &[T], zero: T) -> Vec<T>
where
    T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f64, Output = T>,
{
    (0..values.len())
        .map(|v| {
            let (mut sum, mut count) = (zero, 0.0);
            for h in domain.adjacency.around(domain.outgoing[v]) {
                sum = sum + values[domain.ends(h)[1] as usize];
                count += 1.0;
            }
            values[v] * 0.5 + sum * (0.5 / count)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn spheres_bend_by_the_inverse_of_their_radius() {
        let mesh = shapes::icosphere(20.0, 4);
        let domain = Domain::new(mesh.vertices, mesh.triangles).unwrap();
        for k in curvature(&domain) {
            assert!((k * 20.0 - 1.0).abs() < 0.06, "{}", k * 20.0);
        }
    }

    #[test]
    fn a_thin_tube_bends_by_the_inverse_of_its_radius() {
        let mesh = shapes::torus(60.0, 5.0, 360, 30);
        let domain = Domain::new(mesh.vertices, mesh.triangles).unwrap();
        for k in curvature(&domain) {
            assert!((k * 5.0 - 1.0).abs() < 0.1, "{}", k * 5.0);
        }
    }
}
