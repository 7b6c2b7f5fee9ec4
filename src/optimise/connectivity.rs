//! Triangles and their neighbours, kept in step while edges flip.
//!
//! Half-edges are numbered as in [`crate::mesh::adjacency`]: 3t + k runs from corner k of
//! triangle t to corner k + 1. A flip keeps the two triangles' indices and renumbers their
//! half-edges.

use crate::mesh::adjacency::{Adjacency, next, previous};
use crate::mesh::topology::Defect;

/// A closed, oriented, edge-manifold triangle list whose edges can be flipped.
#[derive(Debug, Clone)]
pub struct Connectivity {
    triangles: Vec<[u32; 3]>,
    twins: Vec<u32>,
    valence: Vec<u32>,
    outgoing: Vec<u32>,
}

/// The four corners of the configuration at a half-edge a→b: c is the apex on its own side,
/// d the one across.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quad {
    /// Origin of the half-edge.
    pub a: u32,
    /// Its target.
    pub b: u32,
    /// Third corner of its triangle.
    pub c: u32,
    /// Third corner of the triangle across.
    pub d: u32,
}

impl Quad {
    /// The two triangles after the flip, (c, a, d) and (d, b, c).
    pub fn flipped(&self) -> [[u32; 3]; 2] {
        [[self.c, self.a, self.d], [self.d, self.b, self.c]]
    }
}

impl Connectivity {
    /// Takes `triangles` over `vertices` vertices.
    ///
    /// # Errors
    /// The first [`Defect`] where they are not closed, oriented and edge-manifold, or leave a
    /// vertex unused.
    pub fn new(vertices: usize, triangles: Vec<[u32; 3]>) -> Result<Self, Defect> {
        let adjacency = Adjacency::new(&triangles)?;
        let twins = (0..3 * triangles.len() as u32)
            .map(|h| adjacency.twin(h))
            .collect();
        let mut valence = vec![0; vertices];
        for &v in triangles.iter().flatten() {
            valence[v as usize] += 1;
        }
        let outgoing = Adjacency::outgoing(&triangles, vertices)
            .into_iter()
            .enumerate()
            .map(|(v, h)| h.ok_or(Defect::UnusedVertex { vertex: v as u32 }))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            triangles,
            twins,
            valence,
            outgoing,
        })
    }

    /// The triangles.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The triangles, given away.
    pub fn into_triangles(self) -> Vec<[u32; 3]> {
        self.triangles
    }

    /// Number of vertices.
    pub fn vertices(&self) -> u32 {
        self.valence.len() as u32
    }

    /// Number of half-edges: three for each triangle, two for each edge.
    pub fn halfedges(&self) -> u32 {
        self.twins.len() as u32
    }

    /// One half-edge of every edge: the lower numbered.
    pub fn edges(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.halfedges()).filter(|&h| h < self.twin(h))
    }

    /// The half-edge against `h`.
    pub fn twin(&self, h: u32) -> u32 {
        self.twins[h as usize]
    }

    /// The lower numbered half-edge of `h`'s edge.
    pub fn edge(&self, h: u32) -> u32 {
        h.min(self.twin(h))
    }

    /// The vertex from which `h` runs.
    pub fn origin(&self, h: u32) -> u32 {
        self.triangles[h as usize / 3][h as usize % 3]
    }

    /// The vertex to which `h` runs.
    pub fn target(&self, h: u32) -> u32 {
        self.origin(next(h))
    }

    /// Number of triangles round `v`.
    pub fn valence(&self, v: u32) -> u32 {
        self.valence[v as usize]
    }

    /// The corners of the configuration at `h`.
    pub fn quad(&self, h: u32) -> Quad {
        Quad {
            a: self.origin(h),
            b: self.target(h),
            c: self.origin(previous(h)),
            d: self.origin(previous(self.twin(h))),
        }
    }

    /// The four sides of the configuration at `h` = a→b, as half-edges within its two
    /// triangles: b→c, c→a, a→d, d→b.
    pub fn sides(&self, h: u32) -> [u32; 4] {
        let g = self.twin(h);
        [next(h), previous(h), next(g), previous(g)]
    }

    /// The half-edges that leave `v`, in cyclic order.
    pub fn around(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        let first = self.outgoing[v as usize];
        let mut current = Some(first);
        std::iter::from_fn(move || {
            let this = current?;
            let following = self.twin(previous(this));
            current = (following != first).then_some(following);
            Some(this)
        })
    }

    /// The half-edge from the first vertex to the second, if an edge joins them.
    pub fn halfedge(&self, [u, v]: [u32; 2]) -> Option<u32> {
        self.around(u).find(|&h| self.target(h) == v)
    }

    /// Whether an edge joins `u` and `v`.
    pub fn joined(&self, u: u32, v: u32) -> bool {
        self.halfedge([u, v]).is_some()
    }

    /// Whether flipping `h` keeps the mesh a simplicial manifold: the new edge must not exist
    /// already, and its ends may not drop below valence 3.
    pub fn can_flip(&self, h: u32) -> bool {
        let Quad { a, b, c, d } = self.quad(h);
        self.valence(a) >= 4 && self.valence(b) >= 4 && c != d && !self.joined(c, d)
    }

    /// Flips the edge of `h`, which must pass [`Self::can_flip`]. The first triangle of
    /// [`Quad::flipped`] takes the place of `h`'s, the second that across; each has the new
    /// edge last.
    pub fn flip(&mut self, h: u32) {
        let Quad { a, b, c, d } = self.quad(h);
        let (t0, t1) = (h / 3, self.twin(h) / 3);
        let [bc, ca, ad, db] = self.sides(h).map(|s| self.twin(s));
        let [first, second] = self.quad(h).flipped();
        self.triangles[t0 as usize] = first;
        self.triangles[t1 as usize] = second;
        // A side may lie against another side of the same pair only where can_flip refuses.
        self.pair(3 * t0, ca);
        self.pair(3 * t0 + 1, ad);
        self.pair(3 * t1, db);
        self.pair(3 * t1 + 1, bc);
        self.pair(3 * t0 + 2, 3 * t1 + 2);
        for (v, leaving) in [(c, 3 * t0), (a, 3 * t0 + 1), (d, 3 * t1), (b, 3 * t1 + 1)] {
            self.outgoing[v as usize] = leaving;
        }
        self.valence[a as usize] -= 1;
        self.valence[b as usize] -= 1;
        self.valence[c as usize] += 1;
        self.valence[d as usize] += 1;
    }

    /// Takes back the flip that made the edge of `h`, if every later one has been taken back.
    /// Both triangles get their indices back, though perhaps begin at another corner: so an
    /// earlier flip's edge is found by its ends, not by its number.
    pub fn unflip(&mut self, h: u32) {
        // A flip turns the pair by a quarter: three more complete the turn.
        let t = h / 3;
        self.flip(h);
        self.flip(3 * t + 2);
        self.flip(3 * t + 2);
    }

    fn pair(&mut self, g: u32, h: u32) {
        self.twins[g as usize] = h;
        self.twins[h as usize] = g;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::random::{Purpose, stream};
    use crate::mesh::{shapes, topology};
    use rand::RngExt;

    #[test]
    fn flips_keep_a_closed_manifold_and_its_neighbours() {
        let mesh = shapes::icosphere(1.0, 2);
        let n = mesh.vertices.len();
        let mut connectivity = Connectivity::new(n, mesh.triangles).unwrap();
        let mut state = 7u32;
        let mut flips = 0;
        for _ in 0..3000 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let h = (state >> 8) % connectivity.halfedges();
            if connectivity.can_flip(h) {
                connectivity.flip(h);
                flips += 1;
            }
        }
        assert!(flips > 1000);
        let fresh = Connectivity::new(n, connectivity.triangles.clone()).unwrap();
        assert_eq!(fresh.twins, connectivity.twins);
        assert_eq!(fresh.valence, connectivity.valence);
        let census = topology::check_triangles(n, connectivity.triangles()).unwrap();
        assert_eq!(census.euler_characteristic, 2);
    }

    /// Chains of flips, each taken back last to first, also where they share triangles.
    #[test]
    fn flips_taken_back_leave_every_triangle_in_its_place() {
        let mesh = shapes::icosphere(1.0, 2);
        let mut connectivity = Connectivity::new(mesh.vertices.len(), mesh.triangles).unwrap();
        let from_lowest = |connectivity: &Connectivity| -> Vec<[u32; 3]> {
            let lowest = |t: &[u32; 3]| (0..3).min_by_key(|&k| t[k]).unwrap();
            let turned = |t: &[u32; 3]| [0, 1, 2].map(|k| t[(lowest(t) + k) % 3]);
            connectivity.triangles().iter().map(turned).collect()
        };
        let before = from_lowest(&connectivity);
        let mut random = stream(5, Purpose::Measure);
        for length in (1..=5).cycle().take(400) {
            let mut start = random.random_range(0..connectivity.halfedges());
            let mut made = Vec::new();
            while made.len() < length {
                if connectivity.can_flip(start) {
                    let Quad { a, c, d, .. } = connectivity.quad(start);
                    connectivity.flip(start);
                    made.push([c, d]);
                    // On in one of the two new triangles, or else at one of the ends.
                    let around: Vec<u32> = connectivity.around(a).collect();
                    start = around[random.random_range(0..around.len())];
                    start = [start, next(start)][random.random_range(0..2)];
                } else {
                    start = random.random_range(0..connectivity.halfedges());
                }
            }
            assert_ne!(from_lowest(&connectivity), before);
            while let Some(edge) = made.pop() {
                connectivity.unflip(connectivity.halfedge(edge).unwrap());
            }
            assert_eq!(from_lowest(&connectivity), before);
        }
        let again = Connectivity::new(mesh.vertices.len(), connectivity.triangles.clone());
        assert_eq!(again.unwrap().twins, connectivity.twins);
    }

    #[test]
    fn a_tetrahedron_has_nothing_to_flip() {
        let mesh = shapes::tetrahedron(1.0);
        let connectivity = Connectivity::new(4, mesh.triangles).unwrap();
        assert!((0..12).all(|h| !connectivity.can_flip(h)));
    }
}
