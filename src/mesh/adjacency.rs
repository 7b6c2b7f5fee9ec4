//! Neighbours of triangles and vertices in a closed, oriented, edge-manifold mesh.
//!
//! Edge k of triangle t joins its corners k and k+1 (mod 3). A *half-edge* is the pair
//! (t, k), numbered 3t + k.

use super::topology::Defect;

/// For every half-edge the one that lies against it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Adjacency {
    twins: Vec<u32>,
}

/// The half-edge after `h` in its triangle.
pub fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// The half-edge before `h` in its triangle.
pub fn previous(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

impl Adjacency {
    /// Pairs the half-edges of `triangles`. Takes O(n) where few edges meet at a vertex, and
    /// four bytes for each index up to the highest; independent of thread count.
    ///
    /// # Errors
    /// The first [`Defect`] found unless every edge belongs to exactly two triangles that run
    /// through it in opposite directions.
    pub fn new(triangles: &[[u32; 3]]) -> Result<Self, Defect> {
        let halfedges = || {
            (0u32..).zip(triangles).flat_map(|(t, triangle)| {
                [0, 1, 2].map(|k| {
                    (
                        3 * t + k,
                        triangle[k as usize],
                        triangle[(k as usize + 1) % 3],
                    )
                })
            })
        };
        // A counting sort by the lower vertex; what stands together is then sorted by the upper.
        let highest = triangles.iter().flatten().max().map_or(0, |v| *v as usize);
        let mut ends = vec![0u32; highest + 1];
        for (h, a, b) in halfedges() {
            if a == b {
                return Err(Defect::DegenerateTriangle { triangle: h / 3 });
            }
            ends[a.min(b) as usize] += 1;
        }
        let mut begin = 0;
        for place in &mut ends {
            begin += std::mem::replace(place, begin);
        }
        let mut keyed = vec![(0u32, 0u32); 3 * triangles.len()];
        for (h, a, b) in halfedges() {
            let place = &mut ends[a.min(b) as usize];
            keyed[*place as usize] = (a.max(b), h);
            *place += 1;
        }
        let origin = |h: u32| triangles[h as usize / 3][h as usize % 3];
        let mut twins = vec![0; keyed.len()];
        let mut begin = 0;
        for (low, &end) in (0u32..).zip(&ends) {
            let around = &mut keyed[begin as usize..end as usize];
            begin = end;
            around.sort_unstable();
            for group in around.chunk_by(|x, y| x.0 == y.0) {
                let edge = [low, group[0].0];
                match *group {
                    [_] => return Err(Defect::OpenEdge { edge }),
                    [(_, g), (_, h)] if origin(g) != origin(h) => {
                        twins[g as usize] = h;
                        twins[h as usize] = g;
                    }
                    [_, _] => return Err(Defect::TurnedTriangles { edge }),
                    _ => return Err(Defect::NonManifoldEdge { edge }),
                }
            }
        }
        Ok(Self { twins })
    }

    /// The half-edge that runs against `h` in the neighbouring triangle.
    pub fn twin(&self, h: u32) -> u32 {
        self.twins[h as usize]
    }

    /// The triangles across the three edges of `t`, edge k's at place k.
    pub fn neighbours(&self, t: u32) -> [u32; 3] {
        [0, 1, 2].map(|k| self.twins[(3 * t + k) as usize] / 3)
    }

    /// The half-edges that leave the origin of `h`, counter-clockwise, beginning with `h`.
    /// One full turn if the vertex is a manifold one.
    pub fn around(&self, h: u32) -> impl Iterator<Item = u32> + '_ {
        let mut current = Some(h);
        std::iter::from_fn(move || {
            let this = current?;
            let following = self.twin(previous(this));
            current = (following != h).then_some(following);
            Some(this)
        })
    }

    /// One half-edge that leaves each of `vertices` vertices (the lowest numbered), or `None`
    /// for an unused vertex.
    pub fn outgoing(triangles: &[[u32; 3]], vertices: usize) -> Vec<Option<u32>> {
        let mut outgoing = vec![None; vertices];
        for (t, triangle) in triangles.iter().enumerate().rev() {
            for k in (0..3).rev() {
                outgoing[triangle[k] as usize] = Some((3 * t + k) as u32);
            }
        }
        outgoing
    }
}
