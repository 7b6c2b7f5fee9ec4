//! Exact distances by brute force, to test the exact geodesics against.
//!
//! From every vertex and every given point, all sequences of triangles that a ray can pass up to
//! a certain length are unfolded, which gives everything that a straight line reaches. A
//! shortest path is a chain of such lines from vertex to vertex (shortest paths in the complete
//! graph). No code is shared with the windows: an unfolded triangle is stored as the positions
//! of its corners.

use crate::base::geometry::Vec2;
use crate::mesh::{FaceId, HalfEdgeId, VertexId};
use crate::surface::retile::SurfacePoint;
use crate::surface::retile::domain::Domain;

/// Largest number of triangles in one strip.
const MAX_STRIP_TRIANGLES: usize = 40;

/// Exact distances between all `points`, in their order.
pub(super) fn distances(domain: &Domain, points: &[SurfacePoint]) -> Vec<Vec<f64>> {
    let vertices = domain.vertices.len();
    let nodes = vertices + points.len();
    let longest = upper_bound(domain);
    let mut direct = vec![vec![f64::INFINITY; nodes]; nodes];
    for (node, seen) in direct.iter_mut().enumerate() {
        seen[node] = 0.0;
        let mut search = StripSearch {
            domain,
            points,
            longest,
            seen,
        };
        if node < vertices {
            for h in domain.half_edges.around(VertexId::from_index(node)) {
                let flat = from_corner(domain, h);
                search.look(h.face(), flat, None, None, 0);
            }
        } else {
            for (t, weights) in containing(domain, &points[node - vertices]) {
                let mut flat = domain.flat(t);
                let here = flat[0] * weights[0] + flat[1] * weights[1] + flat[2] * weights[2];
                flat.iter_mut().for_each(|c| *c -= here);
                search.look(t, flat, None, None, 0);
            }
        }
    }
    // Lines to a point are lines from it. Then follow the paths that turn at vertices.
    for i in 0..nodes {
        for j in 0..i {
            let least = direct[i][j].min(direct[j][i]);
            (direct[i][j], direct[j][i]) = (least, least);
        }
    }
    for via in 0..vertices {
        for i in 0..nodes {
            for j in 0..nodes {
                let bent = direct[i][via] + direct[via][j];
                direct[i][j] = direct[i][j].min(bent);
            }
        }
    }
    direct[vertices..]
        .iter()
        .map(|row| row[vertices..].to_vec())
        .collect()
}

/// An upper bound of all distances: the largest distance along edges plus two edges.
fn upper_bound(domain: &Domain) -> f64 {
    let n = domain.vertices.len();
    let mut way = vec![vec![f64::INFINITY; n]; n];
    for h in domain.half_edges.half_edges() {
        let [a, b] = domain.half_edges.ends(h).map(VertexId::index);
        way[a][b] = domain.length(h);
        way[a][a] = 0.0;
    }
    for via in 0..n {
        for i in 0..n {
            for j in 0..n {
                way[i][j] = way[i][j].min(way[i][via] + way[via][j]);
            }
        }
    }
    let edge = domain.lengths.iter().copied().fold(0.0, f64::max);
    way.iter().flatten().copied().fold(0.0, f64::max) + 2.0 * edge
}

/// The triangles that contain a point, with its coordinates there: two if it lies on an edge.
/// (A point on a vertex has the distances of that vertex, from which all triangles are searched.)
fn containing(domain: &Domain, point: &SurfacePoint) -> Vec<(FaceId, [f64; 3])> {
    let mut found = vec![(point.triangle, point.barycentric)];
    if let Some(k) = (0..3).find(|&k| point.barycentric[k] == 0.0) {
        let twin = domain.half_edges.twin(point.triangle.half_edge(k).next());
        let mut weights = [0.0; 3];
        weights[twin.corner()] = point.barycentric[(k + 2) % 3];
        weights[twin.next().corner()] = point.barycentric[(k + 1) % 3];
        found.push((twin.face(), weights));
    }
    found
}

/// The triangle of `h` with the origin of `h` at 0, in the triangle's own order of corners.
fn from_corner(domain: &Domain, h: HalfEdgeId) -> [Vec2; 3] {
    let (x, y) = domain.apex(h);
    let k = h.corner();
    let mut corners = [Vec2::zeros(); 3];
    corners[(k + 1) % 3] = Vec2::new(domain.length(h), 0.0);
    corners[(k + 2) % 3] = Vec2::new(x, y);
    corners
}

struct StripSearch<'a> {
    domain: &'a Domain,
    points: &'a [SurfacePoint],
    longest: f64,
    seen: &'a mut [f64],
}

impl StripSearch<'_> {
    /// Records everything in triangle `t`, unfolded around the viewer at 0, that lies between the
    /// two rays of `view`, and continues through all its edges except the one of entry.
    fn look(
        &mut self,
        t: FaceId,
        flat: [Vec2; 3],
        view: Option<[Vec2; 2]>,
        entry: Option<usize>,
        depth: usize,
    ) {
        let in_view = |p: &Vec2| match view {
            None => true,
            Some([right, left]) => {
                let slack = 1e-9 * p.norm();
                right.perp(p) >= -slack * right.norm() && p.perp(&left) >= -slack * left.norm()
            }
        };
        let vertices = self.domain.vertices.len();
        let ids = self.domain.half_edges.corners(t);
        for k in 0..3 {
            if in_view(&flat[k]) {
                let slot = &mut self.seen[ids[k].index()];
                *slot = slot.min(flat[k].norm());
            }
        }
        for (i, p) in self
            .points
            .iter()
            .enumerate()
            .filter(|(_, p)| p.triangle == t)
        {
            let [u, v, w] = p.barycentric;
            let at = flat[0] * u + flat[1] * v + flat[2] * w;
            if in_view(&at) {
                let slot = &mut self.seen[vertices + i];
                *slot = slot.min(at.norm());
            }
        }
        if depth == MAX_STRIP_TRIANGLES {
            return;
        }
        for k in (0..3).filter(|&k| Some(k) != entry) {
            let (a, b) = (flat[k], flat[(k + 1) % 3]);
            // Seen from inside, a is to the right of b.
            let area = a.perp(&b);
            if !(area > 1e-12 * a.norm() * b.norm()) {
                continue;
            }
            let [mut right, mut left] = [a, b];
            if let Some([r, l]) = view {
                if r.perp(&right) < 0.0 {
                    right = r;
                }
                if left.perp(&l) < 0.0 {
                    left = l;
                }
            }
            if !(right.perp(&left) > 1e-13 * right.norm() * left.norm()) {
                continue;
            }
            let nearest = {
                let edge = b - a;
                let s = (-a.dot(&edge) / edge.norm_squared()).clamp(0.0, 1.0);
                (a + edge * s).norm()
            };
            if nearest > self.longest {
                continue;
            }
            let twin = self.domain.half_edges.twin(t.half_edge(k));
            let (across, l) = (twin.face(), twin.corner());
            // The twin runs from b to a.
            let (x, y) = self.domain.apex(twin);
            let axis = (a - b) / self.domain.length(twin);
            let mut unfolded = [Vec2::zeros(); 3];
            unfolded[l] = b;
            unfolded[(l + 1) % 3] = a;
            unfolded[(l + 2) % 3] = b + axis * x + Vec2::new(-axis.y, axis.x) * y;
            self.look(across, unfolded, Some([right, left]), Some(l), depth + 1);
        }
    }
}
