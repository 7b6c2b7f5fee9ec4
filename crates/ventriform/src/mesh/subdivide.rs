//! Meshes with each triangle split in four at the midpoints of its edges.

use std::collections::BTreeMap;

use super::TriMesh;

/// A mesh made finer: the vertices of the coarse one first, then the midpoints of its edges.
#[derive(Debug, Clone, Default)]
pub struct Subdivided {
    /// The finer mesh; the same surface.
    pub mesh: TriMesh,
    /// Where its added vertices lie.
    pub midpoints: Midpoints,
}

/// The ends of the edges whose midpoints are the added vertices, in their order. An end may be an added vertex, of a
/// number less than the midpoint's own.
#[derive(Debug, Clone, Default)]
pub struct Midpoints(Vec<[u32; 2]>);

impl Midpoints {
    /// A figure of the coarse mesh's vertices at those of the finer one: at a midpoint the mean of both ends.
    pub fn at_vertices(&self, of_coarse: &[f64]) -> Vec<f64> {
        let mut values = of_coarse.to_vec();
        for [a, b] in &self.0 {
            values.push(f64::midpoint(values[*a as usize], values[*b as usize]));
        }
        values
    }
}

impl Subdivided {
    /// `mesh` as it is.
    pub fn not_yet(mesh: TriMesh) -> Self {
        Self {
            mesh,
            midpoints: Midpoints::default(),
        }
    }

    /// Each triangle in four.
    pub fn once_more(self) -> Self {
        let Self {
            mesh,
            midpoints: Midpoints(mut ends),
        } = self;
        let TriMesh {
            mut vertices,
            triangles,
        } = mesh;
        let mut middles: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
                let edge = [p.min(q), p.max(q)];
                *middles.entry(edge).or_insert_with(|| {
                    vertices.push((vertices[p as usize] + vertices[q as usize]) / 2.0);
                    ends.push(edge);
                    vertices.len() as u32 - 1
                })
            });
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        Self {
            mesh: TriMesh {
                vertices,
                triangles: finer,
            },
            midpoints: Midpoints(ends),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{shapes, topology};

    #[test]
    fn it_is_the_same_surface_and_carries_figures_along() {
        let coarse = shapes::cup(60.0, 30.0, 10.0, 12);
        let mut finer = Subdivided::not_yet(coarse.clone());
        for times in 1..=3 {
            finer = finer.once_more();
            let mesh = &finer.mesh;
            assert_eq!(mesh.triangles.len(), coarse.triangles.len() << (2 * times));
            assert!((mesh.volume() - coarse.volume()).abs() < 1e-9 * coarse.volume());
            assert!((mesh.area() - coarse.area()).abs() < 1e-9 * coarse.area());
            assert!(topology::check(mesh).is_ok());
            // A linear function of place is met exactly.
            let heights: Vec<f64> = coarse.vertices.iter().map(|v| v.z).collect();
            let heights = finer.midpoints.at_vertices(&heights);
            assert_eq!(heights.len(), mesh.vertices.len());
            for (height, vertex) in heights.iter().zip(&mesh.vertices) {
                assert!((height - vertex.z).abs() < 1e-9);
            }
        }
    }
}
