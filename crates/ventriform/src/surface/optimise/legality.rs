//! Which edge flips are allowed.
//!
//! Three tests, from cheap to costly: topology ([`HalfEdges::can_flip`]); geometry
//! ([`replacement`]: the new triangles may not be degenerate, turned over, folded or, with the
//! guard, slivers); and intersections ([`flip_intersects`]: the new triangles may not intersect
//! any other one, decided exactly).

use crate::base::geometry::{Vec3, triangle};
use crate::mesh::half_edges::{HalfEdges, Quad};
use crate::mesh::intersections::{IntersectionIndex, triangles_intersect};
use crate::mesh::{FaceId, HalfEdgeId, VertexId};

/// Largest dihedral angle of a new pair of triangles, degrees, unless the old one's was larger.
const MAX_DIHEDRAL: f64 = 120.0;

/// Twice a triangle's area over its squared longest edge, below which it counts as degenerate
/// and its normal as meaningless.
const MIN_RELATIVE_AREA: f64 = 1e-9;

/// The two triangles that a flip would make, in the order of [`Quad::flipped`].
#[derive(Debug, Clone, Copy)]
pub struct Replacement {
    /// Their area normals, mm².
    pub normals: [Vec3; 2],
    /// Their radius ratios 2r/R.
    pub radius_ratios: [f64; 2],
    /// The dihedral angle between them, radians.
    pub angle: f64,
}

/// The triangles that a flip would make of those of `quad`, or `None` if geometry forbids it.
/// No new triangle may have a radius ratio 2r/R below `guard` unless an old one was as bad.
pub fn replacement(vertices: &[Vec3], quad: &Quad, guard: f64) -> Option<Replacement> {
    let normal = |[p, q, r]: &[Vec3; 3]| triangle::area_normal(p, q, r);
    let ratio = |[p, q, r]: &[Vec3; 3]| triangle::radius_ratio(p, q, r);
    let old = quad.triangles().map(|t| positions(vertices, t));
    let new = quad.flipped().map(|t| positions(vertices, t));

    let normals = [normal(&new[0]), normal(&new[1])];
    let longest = |[p, q, r]: &[Vec3; 3]| {
        let squares = [(p - q), (q - r), (r - p)].map(|e| e.norm_squared());
        squares.into_iter().fold(0.0, f64::max)
    };
    let degenerate = |k: usize| !(normals[k].norm() > MIN_RELATIVE_AREA * longest(&new[k]));
    if degenerate(0) || degenerate(1) {
        return None;
    }
    let old_normals = [normal(&old[0]), normal(&old[1])];
    let facing = old_normals[0] + old_normals[1];
    if !(normals[0].dot(&facing) > 0.0 && normals[1].dot(&facing) > 0.0) {
        return None;
    }
    let angle = triangle::angle_between(&normals[0], &normals[1]);
    if angle > MAX_DIHEDRAL.to_radians()
        && angle > triangle::angle_between(&old_normals[0], &old_normals[1])
    {
        return None;
    }
    let radius_ratios = [ratio(&new[0]), ratio(&new[1])];
    let old_worst = ratio(&old[0]).min(ratio(&old[1]));
    if radius_ratios[0].min(radius_ratios[1]) < old_worst.min(guard) {
        return None;
    }
    Some(Replacement {
        normals,
        radius_ratios,
        angle,
    })
}

/// Whether the two triangles after flipping `h` would intersect each other or any other triangle
/// in more than shared vertices and edges. `index` must contain the present triangles.
pub fn flip_intersects(
    vertices: &[Vec3],
    half_edges: &HalfEdges,
    index: &IntersectionIndex,
    h: HalfEdgeId,
) -> bool {
    let [first, second] = half_edges.quad(h).flipped();
    let (p, q) = (positions(vertices, first), positions(vertices, second));
    let old = half_edges.faces_of(h);
    index.intersects(first, &p, &old)
        || index.intersects(second, &q, &old)
        || triangles_intersect(first, &p, second, &q)
}

/// Whether any of the `changed` triangles, as they are now, intersects another triangle in more
/// than shared vertices and edges. `index` must contain all others.
pub fn any_intersects(
    vertices: &[Vec3],
    half_edges: &HalfEdges,
    index: &IntersectionIndex,
    changed: &[FaceId],
) -> bool {
    let now = |t: FaceId| {
        let ids = half_edges.corners(t);
        (ids, positions(vertices, ids))
    };
    changed.iter().enumerate().any(|(place, &t)| {
        let (ids, corners) = now(t);
        let intersects = |s: &FaceId| {
            let (others, p) = now(*s);
            triangles_intersect(ids, &corners, others, &p)
        };
        index.intersects(ids, &corners, changed) || changed[..place].iter().any(intersects)
    })
}

/// Updates the `changed` triangles in `index`.
pub fn reindex(
    vertices: &[Vec3],
    half_edges: &HalfEdges,
    index: &mut IntersectionIndex,
    changed: &[FaceId],
) {
    for &t in changed {
        let ids = half_edges.corners(t);
        index.set(t, ids, positions(vertices, ids));
    }
}

/// The positions of three vertices.
fn positions(vertices: &[Vec3], corners: [VertexId; 3]) -> [Vec3; 3] {
    corners.map(|v| vertices[v.index()])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriMesh;
    use crate::mesh::ids::stored;

    /// A square of side 1 in the plane z = 0 with the diagonal from a to b, corner c to its left,
    /// raised by `height`, and corner d to its right.
    fn square(height: f64) -> (Vec<Vec3>, Quad) {
        let vertices = [
            [0.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, height],
            [1.0, 0.0, 0.0],
        ];
        let quad = Quad {
            a: VertexId(0),
            b: VertexId(1),
            c: VertexId(2),
            d: VertexId(3),
        };
        (vertices.map(Vec3::from).to_vec(), quad)
    }

    #[test]
    fn a_flat_square_may_flip() {
        let (vertices, quad) = square(0.0);
        let new = replacement(&vertices, &quad, 0.9).unwrap();
        assert!(new.angle.abs() < 1e-12);
        assert!(new.normals.iter().all(|n| (n.z - 1.0).abs() < 1e-12));
    }

    #[test]
    fn turned_folded_flat_and_thin_pairs_are_refused() {
        let (mut vertices, quad) = square(0.0);
        // Not convex: c lies beyond a, seen from d.
        vertices[2] = Vec3::new(-0.5, -0.1, 0.0);
        assert!(replacement(&vertices, &quad, 0.0).is_none());
        // The new triangle (c, a, d) has no area.
        vertices[2] = Vec3::new(-0.5, 0.0, 0.0);
        assert!(replacement(&vertices, &quad, 0.0).is_none());
        // It has next to none, and its normal does not count.
        vertices[2] = Vec3::new(-0.5, 1e-10, 0.0);
        assert!(replacement(&vertices, &quad, 0.0).is_none());
        vertices[2] = Vec3::new(-0.5, 1e-7, 0.0);
        assert!(replacement(&vertices, &quad, 0.0).is_some());
        // A roof: the ridge a b is 1 mm long, the eaves c and d are 2 mm apart and 1 mm lower.
        // The dihedral angle at the ridge is 90 degrees, at the valley c d it would be 127.
        let roof = [
            [-0.5, 0.0, 0.0],
            [0.5, 0.0, 0.0],
            [0.0, 1.0, -1.0],
            [0.0, -1.0, -1.0],
        ];
        assert!(replacement(&roof.map(Vec3::from), &quad, 0.0).is_none());
        let lower = roof.map(|[x, y, z]| Vec3::new(x, y, 0.8 * z));
        assert!(replacement(&lower, &quad, 0.0).is_some());
        // A flat kite: flipping its short diagonal makes slivers.
        let (mut vertices, _) = square(0.0);
        vertices[2] = Vec3::new(-0.5, 1.5, 0.0);
        vertices[3] = Vec3::new(1.5, -0.5, 0.0);
        vertices[0] = Vec3::new(0.35, 0.35, 0.0);
        vertices[1] = Vec3::new(0.65, 0.65, 0.0);
        assert!(replacement(&vertices, &quad, 0.0).is_some());
        assert!(replacement(&vertices, &quad, 0.6).is_none());
    }

    #[test]
    fn a_flip_into_another_part_of_the_mesh_is_refused() {
        // A thin tetrahedron whose tip lies just above the middle of the square, where the
        // flipped edge would pass.
        let (mut vertices, quad) = square(0.6);
        vertices[3].z = 0.6;
        let base = vertices.len() as u32;
        let tip = Vec3::new(0.5, 0.5, 0.3);
        let away = [[0.4, 0.5, 2.0], [0.6, 0.45, 2.0], [0.55, 0.6, 2.0]];
        vertices.extend(away.map(Vec3::from));
        vertices.push(tip);
        let needle = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]].map(|t| t.map(|v| v + base));
        // The square is closed from below by its mirror image far down.
        let below = vertices.len() as u32;
        vertices.push(Vec3::new(0.5, 0.5, -3.0));
        let mut triangles = quad.triangles().map(stored).to_vec();
        for [p, q] in [[1, 2], [2, 0], [0, 3], [3, 1]] {
            triangles.push([q, p, below]);
        }
        let without = triangles.len();
        triangles.extend(needle);
        let mesh = TriMesh {
            vertices,
            triangles,
        };
        let test = |mesh: &TriMesh, triangles: &[[u32; 3]]| {
            let used = triangles.iter().flatten().max().map_or(0, |v| v + 1) as usize;
            HalfEdges::new(used, triangles.to_vec()).map(|half_edges| {
                let index = IntersectionIndex::new(&mesh.vertices, half_edges.triangles(), 0.5);
                flip_intersects(&mesh.vertices, &half_edges, &index, HalfEdgeId(0))
            })
        };
        assert!(test(&mesh, &mesh.triangles).unwrap());
        // Without the needle: its vertices are removed, so `below` moves up.
        let mut bare = mesh.clone();
        bare.vertices.drain(base as usize..below as usize);
        let moved: Vec<[u32; 3]> = mesh.triangles[..without]
            .iter()
            .map(|t| t.map(|v| if v == below { base } else { v }))
            .collect();
        assert!(!test(&bare, &moved).unwrap());
    }
}
