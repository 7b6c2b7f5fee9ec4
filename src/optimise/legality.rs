//! Which flips are allowed.
//!
//! Topologically, [`Connectivity::can_flip`]; geometrically, [`replacement`]: the new pair may
//! not be degenerate, turn over, fold, or (with the guard) hold a sliver; and in space,
//! [`pierces`]: it may not cut through any other triangle, decided exactly.

use super::connectivity::{Connectivity, Quad};
use crate::geometry::{Vec3, triangle};
use crate::mesh::intersections::{IntersectionIndex, triangles_intersect};

/// A new pair may fold by as much as this, or as much as the old one did.
const MOST_FOLD: f64 = 120.0;

/// Twice a triangle's area over its longest edge squared, below which it counts as degenerate
/// and its normal as meaningless.
const LEAST_RELATIVE_AREA: f64 = 1e-9;

/// The two triangles that a flip would make, in the order of [`Quad::flipped`].
#[derive(Debug, Clone, Copy)]
pub struct Replacement {
    /// Their area normals.
    pub normals: [Vec3; 2],
    /// Their radius ratios 2r/R.
    pub radius_ratios: [f64; 2],
    /// The angle between the normals, radians.
    pub angle: f64,
}

/// The pair that replaces `quad`'s, or `None` where geometry forbids it. No new triangle may
/// have a radius ratio 2r/R below `guard` unless the old pair had one as low.
pub fn replacement(vertices: &[Vec3], quad: &Quad, guard: f64) -> Option<Replacement> {
    let corners = |t: [u32; 3]| t.map(|v| vertices[v as usize]);
    let normal = |[p, q, r]: &[Vec3; 3]| triangle::area_normal(p, q, r);
    let ratio = |[p, q, r]: &[Vec3; 3]| triangle::radius_ratio(p, q, r);
    let old = [[quad.a, quad.b, quad.c], [quad.b, quad.a, quad.d]].map(corners);
    let new = quad.flipped().map(corners);

    let normals = [normal(&new[0]), normal(&new[1])];
    let longest = |[p, q, r]: &[Vec3; 3]| {
        let squares = [(p - q), (q - r), (r - p)].map(|e| e.norm_squared());
        squares.into_iter().fold(0.0, f64::max)
    };
    let degenerate = |k: usize| !(normals[k].norm() > LEAST_RELATIVE_AREA * longest(&new[k]));
    if degenerate(0) || degenerate(1) {
        return None;
    }
    let old_normals = [normal(&old[0]), normal(&old[1])];
    let facing = old_normals[0] + old_normals[1];
    if !(normals[0].dot(&facing) > 0.0 && normals[1].dot(&facing) > 0.0) {
        return None;
    }
    let angle = triangle::angle_between(&normals[0], &normals[1]);
    if angle > MOST_FOLD.to_radians()
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

/// Whether the pair after flipping `h` would meet any other triangle in more than what they
/// share. `index` must hold the present triangles.
pub fn pierces(
    vertices: &[Vec3],
    connectivity: &Connectivity,
    index: &IntersectionIndex,
    h: u32,
) -> bool {
    let [first, second] = connectivity.quad(h).flipped();
    let corners = |t: [u32; 3]| t.map(|v| vertices[v as usize]);
    let (p, q) = (corners(first), corners(second));
    let old = [h / 3, connectivity.twin(h) / 3];
    index.pierces(first, &p, &old)
        || index.pierces(second, &q, &old)
        || triangles_intersect(first, &p, second, &q)
}

/// Whether any of the `changed` triangles, as they are now, meets another one in more than
/// what they share. `index` must hold all others.
pub fn have_pierced(
    vertices: &[Vec3],
    connectivity: &Connectivity,
    index: &IntersectionIndex,
    changed: &[u32],
) -> bool {
    let now = |t: u32| {
        let ids = connectivity.triangles()[t as usize];
        (ids, ids.map(|v| vertices[v as usize]))
    };
    changed.iter().enumerate().any(|(place, &t)| {
        let (ids, corners) = now(t);
        let meets = |s: &u32| {
            let (others, p) = now(*s);
            triangles_intersect(ids, &corners, others, &p)
        };
        index.pierces(ids, &corners, changed) || changed[..place].iter().any(meets)
    })
}

/// Tells `index` how the `changed` triangles look now.
pub fn reindex(
    vertices: &[Vec3],
    connectivity: &Connectivity,
    index: &mut IntersectionIndex,
    changed: &[u32],
) {
    for &t in changed {
        let ids = connectivity.triangles()[t as usize];
        index.set(t, ids, ids.map(|v| vertices[v as usize]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriMesh;

    /// A flat square of side 1 in the plane z = 0, its diagonal from a to b, apex c left of it
    /// and d right of it, with c raised by `height`.
    fn square(height: f64) -> (Vec<Vec3>, Quad) {
        let vertices = [
            [0.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, height],
            [1.0, 0.0, 0.0],
        ];
        let quad = Quad {
            a: 0,
            b: 1,
            c: 2,
            d: 3,
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
        // A roof: the ridge a b is 1 mm long, the eaves c and d lie 2 mm apart and 1 mm down.
        // The ridge folds by 90 degrees, the valley c d would by 127.
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
        // A tetrahedral tent over the square's middle, and a needle that ends just above
        // where the flipped edge would pass.
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
        let mut triangles = vec![[quad.a, quad.b, quad.c], [quad.b, quad.a, quad.d]];
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
            Connectivity::new(used, triangles.to_vec()).map(|c| {
                let index = IntersectionIndex::new(&mesh.vertices, c.triangles(), 0.5);
                pierces(&mesh.vertices, &c, &index, 0)
            })
        };
        assert!(test(&mesh, &mesh.triangles).unwrap());
        // The same without the needle: its vertices go, `below` moves up.
        let mut bare = mesh.clone();
        bare.vertices.drain(base as usize..below as usize);
        let moved: Vec<[u32; 3]> = mesh.triangles[..without]
            .iter()
            .map(|t| t.map(|v| if v == below { base } else { v }))
            .collect();
        assert!(!test(&bare, &moved).unwrap());
    }
}
