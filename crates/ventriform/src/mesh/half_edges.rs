//! The half-edge structure of a closed, oriented triangle mesh, and edge flips on it.
//!
//! In: index triples in which every edge belongs to exactly two triangles that traverse it in
//! opposite directions. Out: for every half-edge the one on the other side of its edge (its
//! *twin*), for every vertex one outgoing half-edge and its valence. All walks over the mesh
//! follow from these and from the numbering of half-edges ([`HalfEdgeId`]).
//!
//! A flip replaces an edge by the other diagonal of its two triangles. It keeps the indices of
//! the two triangles and renumbers their half-edges; all tables stay those of a freshly built
//! structure (a test compares), except that `outgoing` may name another half-edge.
//!
//! Building takes O(n) where few edges meet at a vertex, and four bytes for each index up to
//! the highest. The result does not depend on the number of threads.

use super::defect::MeshDefect;
use super::ids::{FaceId, HalfEdgeId, VertexId, stored, typed};

/// A closed, oriented, edge-manifold triangle mesh without positions.
#[derive(Debug, Clone)]
pub struct HalfEdges {
    triangles: Vec<[u32; 3]>,
    twins: Vec<HalfEdgeId>,
    /// A half-edge that leaves each vertex: the lowest numbered until edges flip.
    outgoing: Vec<HalfEdgeId>,
    /// Number of triangles around each vertex.
    valences: Vec<u32>,
}

/// An edge from a to b with the third corners of its two triangles: c of the half-edge's own
/// triangle, d of its twin's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quad {
    /// Origin of the half-edge.
    pub a: VertexId,
    /// Target of the half-edge.
    pub b: VertexId,
    /// Third corner of the half-edge's triangle.
    pub c: VertexId,
    /// Third corner of the twin's triangle.
    pub d: VertexId,
}

impl Quad {
    /// The two triangles before the flip: (a, b, c) and (b, a, d).
    pub fn triangles(&self) -> [[VertexId; 3]; 2] {
        [[self.a, self.b, self.c], [self.b, self.a, self.d]]
    }

    /// The two triangles after the flip: (c, a, d) and (d, b, c).
    pub fn flipped(&self) -> [[VertexId; 3]; 2] {
        [[self.c, self.a, self.d], [self.d, self.b, self.c]]
    }
}

impl HalfEdges {
    /// Builds the structure of `triangles` over `vertices` vertices.
    ///
    /// # Errors
    /// The first [`MeshDefect`] found: a degenerate triangle, an edge without exactly two
    /// triangles of consistent orientation, or an unused vertex. Vertices that join several
    /// fans are not looked for; [`topology::check`](super::topology::check) does that.
    pub fn new(vertices: usize, triangles: Vec<[u32; 3]>) -> Result<Self, MeshDefect> {
        let twins = pair_half_edges(&triangles)?;
        let mut valences = vec![0; vertices];
        for &v in triangles.iter().flatten() {
            valences[v as usize] += 1;
        }
        let outgoing = lowest_outgoing(&triangles, vertices);
        let outgoing = VertexId::first(vertices)
            .zip(outgoing)
            .map(|(vertex, h)| h.ok_or(MeshDefect::UnusedVertex { vertex }))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            triangles,
            twins,
            outgoing,
            valences,
        })
    }

    /// The index triples of the triangles, as [`TriMesh`](super::TriMesh) stores them.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Returns the index triples and drops the rest.
    pub fn into_triangles(self) -> Vec<[u32; 3]> {
        self.triangles
    }

    /// All vertices, ascending.
    pub fn vertices(&self) -> impl DoubleEndedIterator<Item = VertexId> + Clone + use<> {
        VertexId::first(self.valences.len())
    }

    /// All faces, ascending.
    pub fn faces(&self) -> impl DoubleEndedIterator<Item = FaceId> + Clone + use<> {
        FaceId::first(self.triangles.len())
    }

    /// All half-edges, ascending: three for each face, two for each edge.
    pub fn half_edges(&self) -> impl DoubleEndedIterator<Item = HalfEdgeId> + Clone + use<> {
        HalfEdgeId::first(self.twins.len())
    }

    /// The lower numbered half-edge of every edge, ascending.
    pub fn edges(&self) -> impl Iterator<Item = HalfEdgeId> + '_ {
        self.half_edges().filter(|&h| h < self.twin(h))
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.valences.len()
    }

    /// Number of faces.
    pub fn face_count(&self) -> usize {
        self.triangles.len()
    }

    /// Number of half-edges.
    pub fn half_edge_count(&self) -> usize {
        self.twins.len()
    }

    /// The corners of a face, counter-clockwise seen from outside.
    pub fn corners(&self, face: FaceId) -> [VertexId; 3] {
        typed(self.triangles[face.index()])
    }

    /// The half-edge that runs along the same edge in the opposite direction.
    pub fn twin(&self, h: HalfEdgeId) -> HalfEdgeId {
        self.twins[h.index()]
    }

    /// The lower numbered half-edge of the edge that `h` belongs to.
    pub fn edge(&self, h: HalfEdgeId) -> HalfEdgeId {
        h.min(self.twin(h))
    }

    /// The two faces of the edge that `h` belongs to: the face of `h` first.
    pub fn faces_of(&self, h: HalfEdgeId) -> [FaceId; 2] {
        [h.face(), self.twin(h).face()]
    }

    /// The vertex that `h` leaves.
    pub fn origin(&self, h: HalfEdgeId) -> VertexId {
        VertexId(self.triangles[h.face().index()][h.corner()])
    }

    /// The vertex at which `h` ends.
    pub fn target(&self, h: HalfEdgeId) -> VertexId {
        self.origin(h.next())
    }

    /// Origin and target of `h`.
    pub fn ends(&self, h: HalfEdgeId) -> [VertexId; 2] {
        [self.origin(h), self.target(h)]
    }

    /// Both ends of the edge that `h` belongs to, the lower first: a name that flips of other
    /// edges do not change.
    pub fn edge_ends(&self, h: HalfEdgeId) -> [VertexId; 2] {
        let [u, v] = self.ends(h);
        [u.min(v), u.max(v)]
    }

    /// Number of triangles around `v`.
    pub fn valence(&self, v: VertexId) -> u32 {
        self.valences[v.index()]
    }

    /// The corners of the two triangles at the edge of `h`.
    pub fn quad(&self, h: HalfEdgeId) -> Quad {
        Quad {
            a: self.origin(h),
            b: self.target(h),
            c: self.origin(h.previous()),
            d: self.origin(self.twin(h).previous()),
        }
    }

    /// The four sides of the two triangles at `h` = a→b, as half-edges of these triangles:
    /// b→c, c→a, a→d, d→b.
    pub fn sides(&self, h: HalfEdgeId) -> [HalfEdgeId; 4] {
        let g = self.twin(h);
        [h.next(), h.previous(), g.next(), g.previous()]
    }

    /// The half-edges that leave `v`, counter-clockwise.
    pub fn around(&self, v: VertexId) -> impl Iterator<Item = HalfEdgeId> + '_ {
        self.around_from(self.outgoing[v.index()])
    }

    /// The half-edges that leave the origin of `first`, counter-clockwise, beginning with it.
    pub fn around_from(&self, first: HalfEdgeId) -> impl Iterator<Item = HalfEdgeId> + '_ {
        around(&self.twins, first)
    }

    /// The vertices that share an edge with `v`, counter-clockwise.
    pub fn neighbours(&self, v: VertexId) -> impl Iterator<Item = VertexId> + '_ {
        self.around(v).map(|h| self.target(h))
    }

    /// The half-edge from `u` to `v`, or `None` if no edge joins them.
    pub fn between(&self, [u, v]: [VertexId; 2]) -> Option<HalfEdgeId> {
        self.around(u).find(|&h| self.target(h) == v)
    }

    /// Whether flipping the edge of `h` keeps the mesh a simplicial manifold: the new edge must
    /// not exist yet, and the ends of the old one must keep at least three neighbours.
    pub fn can_flip(&self, h: HalfEdgeId) -> bool {
        let Quad { a, b, c, d } = self.quad(h);
        self.valence(a) >= 4 && self.valence(b) >= 4 && c != d && self.between([c, d]).is_none()
    }

    /// Flips the edge of `h`, which must pass [`can_flip`](Self::can_flip). The first triangle
    /// of [`Quad::flipped`] replaces that of `h`, the second that of its twin; in both the new
    /// edge is the last half-edge.
    pub fn flip(&mut self, h: HalfEdgeId) {
        let quad = self.quad(h);
        let [t0, t1] = self.faces_of(h);
        let [bc, ca, ad, db] = self.sides(h).map(|s| self.twin(s));
        let [first, second] = quad.flipped();
        self.triangles[t0.index()] = stored(first);
        self.triangles[t1.index()] = stored(second);
        let ([c_a, a_d, d_c], [d_b, b_c, c_d]) = (t0.half_edges(), t1.half_edges());
        // Two sides are twins of each other only where can_flip refuses.
        self.join(c_a, ca);
        self.join(a_d, ad);
        self.join(d_b, db);
        self.join(b_c, bc);
        self.join(d_c, c_d);
        let Quad { a, b, c, d } = quad;
        for (v, leaving) in [(c, c_a), (a, a_d), (d, d_b), (b, b_c)] {
            self.outgoing[v.index()] = leaving;
        }
        self.valences[a.index()] -= 1;
        self.valences[b.index()] -= 1;
        self.valences[c.index()] += 1;
        self.valences[d.index()] += 1;
    }

    /// Undoes the flip that made the edge of `h`; all later flips must have been undone before.
    /// Both triangles get their indices back but may begin at another corner, so an earlier
    /// flip's edge must be found by its ends, not by the number of a half-edge.
    pub fn unflip(&mut self, h: HalfEdgeId) {
        // A flip turns the pair of triangles by a quarter: three more complete the turn.
        let last = h.face().half_edge(2);
        self.flip(h);
        self.flip(last);
        self.flip(last);
    }

    fn join(&mut self, g: HalfEdgeId, h: HalfEdgeId) {
        self.twins[g.index()] = h;
        self.twins[h.index()] = g;
    }
}

/// The twin of every half-edge of `triangles`.
pub(super) fn pair_half_edges(triangles: &[[u32; 3]]) -> Result<Vec<HalfEdgeId>, MeshDefect> {
    let origin = |h: HalfEdgeId| triangles[h.face().index()][h.corner()];
    let half_edges = || {
        HalfEdgeId::first(3 * triangles.len()).map(|h| {
            let (from, to) = (origin(h), origin(h.next()));
            (h, from.min(to), from.max(to))
        })
    };
    // A counting sort by the lower vertex; each of its groups is then sorted by the upper one.
    let highest = triangles.iter().flatten().max().map_or(0, |v| *v as usize);
    let mut ends = vec![0u32; highest + 1];
    for (h, low, high) in half_edges() {
        if low == high {
            let triangle = h.face();
            return Err(MeshDefect::DegenerateTriangle { triangle });
        }
        ends[low as usize] += 1;
    }
    let mut begin = 0;
    for place in &mut ends {
        begin += std::mem::replace(place, begin);
    }
    let mut sorted = vec![(0u32, HalfEdgeId(0)); 3 * triangles.len()];
    for (h, low, high) in half_edges() {
        let place = &mut ends[low as usize];
        sorted[*place as usize] = (high, h);
        *place += 1;
    }
    let mut twins = vec![HalfEdgeId(0); sorted.len()];
    let mut begin = 0;
    for (low, &end) in (0u32..).zip(&ends) {
        let with_low = &mut sorted[begin as usize..end as usize];
        begin = end;
        with_low.sort_unstable();
        for group in with_low.chunk_by(|x, y| x.0 == y.0) {
            let edge = [VertexId(low), VertexId(group[0].0)];
            match *group {
                [_] => return Err(MeshDefect::OpenEdge { edge }),
                [(_, g), (_, h)] if origin(g) != origin(h) => {
                    twins[g.index()] = h;
                    twins[h.index()] = g;
                }
                [_, _] => return Err(MeshDefect::OrientationConflict { edge }),
                _ => return Err(MeshDefect::NonManifoldEdge { edge }),
            }
        }
    }
    Ok(twins)
}

/// The lowest numbered half-edge that leaves each of `vertices` vertices; `None` for an unused
/// vertex.
pub(super) fn lowest_outgoing(triangles: &[[u32; 3]], vertices: usize) -> Vec<Option<HalfEdgeId>> {
    let mut outgoing = vec![None; vertices];
    for (face, triangle) in FaceId::first(triangles.len()).zip(triangles).rev() {
        for k in (0..3).rev() {
            outgoing[triangle[k] as usize] = Some(face.half_edge(k));
        }
    }
    outgoing
}

/// The half-edges that leave the origin of `first`, counter-clockwise, beginning with it: one
/// full turn around a manifold vertex.
pub(super) fn around(
    twins: &[HalfEdgeId],
    first: HalfEdgeId,
) -> impl Iterator<Item = HalfEdgeId> + '_ {
    let mut current = Some(first);
    std::iter::from_fn(move || {
        let this = current?;
        let following = twins[this.previous().index()];
        current = (following != first).then_some(following);
        Some(this)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::random::{Purpose, stream};
    use crate::mesh::{shapes, topology};
    use rand::RngExt;

    #[test]
    fn flips_keep_a_closed_manifold_and_its_neighbours() {
        let mesh = shapes::icosphere(1.0, 2);
        let n = mesh.vertices.len();
        let mut half_edges = HalfEdges::new(n, mesh.triangles).unwrap();
        let mut state = 7u32;
        let mut flips = 0;
        for _ in 0..3000 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let h = HalfEdgeId((state >> 8) % half_edges.half_edge_count() as u32);
            if half_edges.can_flip(h) {
                half_edges.flip(h);
                flips += 1;
            }
        }
        assert!(flips > 1000);
        let fresh = HalfEdges::new(n, half_edges.triangles.clone()).unwrap();
        assert_eq!(fresh.twins, half_edges.twins);
        assert_eq!(fresh.valences, half_edges.valences);
        let census = topology::check_triangles(n, half_edges.triangles()).unwrap();
        assert_eq!(census.euler_characteristic, 2);
    }

    /// Chains of flips, undone last to first, also where they share triangles.
    #[test]
    fn undone_flips_leave_every_triangle_in_its_place() {
        let mesh = shapes::icosphere(1.0, 2);
        let mut half_edges = HalfEdges::new(mesh.vertices.len(), mesh.triangles).unwrap();
        let from_lowest = |half_edges: &HalfEdges| -> Vec<[u32; 3]> {
            let lowest = |t: &[u32; 3]| (0..3).min_by_key(|&k| t[k]).unwrap();
            let turned = |t: &[u32; 3]| [0, 1, 2].map(|k| t[(lowest(t) + k) % 3]);
            half_edges.triangles().iter().map(turned).collect()
        };
        let before = from_lowest(&half_edges);
        let count = half_edges.half_edge_count() as u32;
        let mut random = stream(5, Purpose::Measure);
        for length in (1..=5).cycle().take(400) {
            let mut start = HalfEdgeId(random.random_range(0..count));
            let mut made = Vec::new();
            while made.len() < length {
                if half_edges.can_flip(start) {
                    let Quad { a, c, d, .. } = half_edges.quad(start);
                    half_edges.flip(start);
                    made.push([c, d]);
                    // Continue in one of the two new triangles or at one of the ends.
                    let around: Vec<HalfEdgeId> = half_edges.around(a).collect();
                    start = around[random.random_range(0..around.len())];
                    start = [start, start.next()][random.random_range(0..2)];
                } else {
                    start = HalfEdgeId(random.random_range(0..count));
                }
            }
            assert_ne!(from_lowest(&half_edges), before);
            while let Some(edge) = made.pop() {
                half_edges.unflip(half_edges.between(edge).unwrap());
            }
            assert_eq!(from_lowest(&half_edges), before);
        }
        let again = HalfEdges::new(mesh.vertices.len(), half_edges.triangles.clone());
        assert_eq!(again.unwrap().twins, half_edges.twins);
    }

    #[test]
    fn a_tetrahedron_has_nothing_to_flip() {
        let mesh = shapes::tetrahedron(1.0);
        let half_edges = HalfEdges::new(4, mesh.triangles).unwrap();
        assert!(half_edges.half_edges().all(|h| !half_edges.can_flip(h)));
    }
}
