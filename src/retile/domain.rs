//! The surface as the geodesic steps see it: lengths and neighbours, no positions needed.
//!
//! Every triangle lies flat in its own frame: corner 0 at the origin, corner 1 on the x axis,
//! corner 2 above it. Edge k joins corners k and k+1.

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
    /// A third of the area round every vertex, mm².
    pub vertex_areas: Vec<f64>,
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
        let mut vertex_areas = vec![0.0; vertices.len()];
        let mut area = 0.0;
        for t in &triangles {
            let p = t.map(|v| vertices[v as usize]);
            for k in 0..3 {
                lengths.push((p[(k + 1) % 3] - p[k]).norm());
            }
            let own = (p[1] - p[0]).cross(&(p[2] - p[0])).norm() / 2.0;
            area += own;
            for &v in t {
                vertex_areas[v as usize] += own / 3.0;
            }
        }
        Ok(Self {
            vertices,
            triangles,
            adjacency,
            outgoing,
            lengths,
            vertex_areas,
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

    /// The surface with every triangle cut in four at its edges' middles. Triangle t's
    /// children are 4t..4t+4, the corners' first, the middle one last.
    pub fn subdivided(&self) -> Self {
        let old = self.vertices.len();
        let mut vertices = self.vertices.clone();
        let mut middle = vec![u32::MAX; self.lengths.len()];
        for h in 0..self.lengths.len() as u32 {
            let twin = self.adjacency.twin(h);
            if h < twin {
                let [a, b] = self.ends(h);
                middle[h as usize] = vertices.len() as u32;
                middle[twin as usize] = vertices.len() as u32;
                vertices.push((self.vertices[a as usize] + self.vertices[b as usize]) / 2.0);
            }
        }
        debug_assert_eq!(vertices.len(), old + self.lengths.len() / 2);
        let triangles = self
            .triangles
            .iter()
            .enumerate()
            .flat_map(|(t, &corners)| {
                let middles = [0, 1, 2].map(|k| middle[3 * t + k]);
                children(corners, middles)
            })
            .collect();
        Self::new(vertices, triangles).expect("cutting in four keeps a closed manifold")
    }

    /// The two vertices of half-edge `h`.
    pub fn ends(&self, h: u32) -> [u32; 2] {
        let t = &self.triangles[h as usize / 3];
        [t[h as usize % 3], t[(h as usize + 1) % 3]]
    }
}

fn children([a, b, c]: [u32; 3], [ab, bc, ca]: [u32; 3]) -> [[u32; 3]; 4] {
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
}

/// The barycentric coordinates, in the triangle that was cut `levels` times, of a point given
/// in its descendant `triangle`; and that ancestor.
pub(crate) fn ancestor(triangle: u32, barycentric: [f64; 3], levels: u32) -> (u32, [f64; 3]) {
    let (mut t, mut b) = (triangle, barycentric);
    for _ in 0..levels {
        let [x, y, z] = b;
        b = match t % 4 {
            0 => [x + (y + z) / 2.0, y / 2.0, z / 2.0],
            1 => [x / 2.0, y + (x + z) / 2.0, z / 2.0],
            2 => [x / 2.0, y / 2.0, z + (x + y) / 2.0],
            _ => [(x + z) / 2.0, (x + y) / 2.0, (y + z) / 2.0],
        };
        t /= 4;
    }
    (t, b)
}

/// Where the third corner lies over a side of length `base` from the origin along x, `left`
/// and `right` away from the side's ends.
pub(crate) fn apex(base: f64, left: f64, right: f64) -> (f64, f64) {
    let x = (left * left + base * base - right * right) / (2.0 * base);
    (x, (left * left - x * x).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn subdivision_keeps_points_where_they_are() {
        let mesh = shapes::torus(9.0, 3.0, 12, 7);
        let coarse = Domain::new(mesh.vertices, mesh.triangles).unwrap();
        let fine = coarse.subdivided().subdivided();
        assert!((fine.area - coarse.area).abs() < 1e-9 * coarse.area);
        let position = |d: &Domain, t: u32, b: [f64; 3]| {
            let c = d.triangles[t as usize].map(|v| d.vertices[v as usize]);
            c[0] * b[0] + c[1] * b[1] + c[2] * b[2]
        };
        for t in 0..fine.triangles.len() as u32 {
            let b = [0.2, 0.5, 0.3];
            let (parent, c) = ancestor(t, b, 2);
            assert!((position(&fine, t, b) - position(&coarse, parent, c)).norm() < 1e-12);
        }
    }
}
