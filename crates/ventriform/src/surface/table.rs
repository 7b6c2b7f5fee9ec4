//! The 256 cases of Marching Cubes, computed instead of listed.
//!
//! A cube has corners 0..8 (bit 0 of the number = x, bit 1 = y, bit 2 = z) and twelve edges:
//! edge `4a + m` runs along axis a, and m's two bits are the other two coordinates in
//! ascending order of axis. A *case* is the set of inside corners as a byte.
//!
//! Construction (Lorensen & Cline, SIGGRAPH 1987, with the face rule made consistent):
//! 1. On each face, walk the four corners counter-clockwise seen from outside. Every run of
//!    inside corners gives one directed segment between the two edges that bound the run.
//!    On an ambiguous face (inside corners on a diagonal) that *separates* the inside: the
//!    object is 6-connected, its background 26-connected.
//! 2. Neighbouring faces walk a shared edge in opposite directions, so each crossed edge has
//!    one segment coming in and one going out: the segments close to loops.
//! 3. Each loop is triangulated with the shortest chords of which none lies in a face of the
//!    cube. A chord in a face could also be chosen by the neighbouring cube: four triangles at
//!    one edge.
//!
//! 4. Where just two opposite corners are outside, the six inside ones form a ring (no square
//!    of the grid closes it), and the background passes through: the two loops are joined by
//!    a tunnel of six triangles instead of being capped.
//!
//! Guaranteed (all tested exhaustively): two neighbouring cubes agree on the face between
//! them, so the surface of any label volume that is empty on its border is a closed, oriented
//! 2-manifold, and its Euler characteristic is twice that of the 6-connected object.

use std::sync::LazyLock;

/// The most triangles that any case has.
pub const MOST_TRIANGLES: usize = 6;

/// The triangles of one case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Case {
    /// Number of triangles.
    pub count: u8,
    /// Edge numbers, three for each triangle; the first `3 * count` count. Counter-clockwise
    /// seen from the outside of the object.
    pub edges: [u8; 3 * MOST_TRIANGLES],
}

/// All cases, by the byte of inside corners.
pub static CUBE_CASES: LazyLock<[Case; 256]> =
    LazyLock::new(|| std::array::from_fn(|c| case(c as u8)));

/// The edge between two corners that differ in one bit.
pub const fn edge_between(a: u8, b: u8) -> u8 {
    match a ^ b {
        1 => (a >> 1) & 3,
        2 => 4 + ((a & 1) | ((a >> 1) & 2)),
        _ => 8 + (a & 3),
    }
}

/// The corners of face (`axis`, `side`), counter-clockwise seen from outside the cube.
fn face_corners(axis: u8, side: u8) -> [u8; 4] {
    let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
    let base = side << axis;
    // (u, v, axis) is right-handed: u to v turns counter-clockwise about +axis.
    if side == 1 {
        [base, base | u, base | u | v, base | v]
    } else {
        [base, base | v, base | u | v, base | u]
    }
}

/// For each crossed edge the edge that follows it in its loop.
fn successors(inside: u8) -> [Option<u8>; 12] {
    let mut next = [None; 12];
    for axis in 0..3 {
        for side in 0..2 {
            let corners = face_corners(axis, side);
            let is_inside = |i: usize| inside >> corners[i % 4] & 1 == 1;
            let edge = |i: usize| edge_between(corners[i % 4], corners[(i + 1) % 4]);
            for i in (0..4).filter(|&i| !is_inside(i) && is_inside(i + 1)) {
                // The run begins after edge i; it ends at the first way out.
                let end = (i + 1..i + 4)
                    .find(|&j| is_inside(j) && !is_inside(j + 1))
                    .unwrap_or(i);
                next[edge(i) as usize] = Some(edge(end));
            }
        }
    }
    next
}

/// Whether two edges of the cube lie in a common face.
fn share_face(a: u8, b: u8) -> bool {
    (0..3).any(|axis| {
        (0..2).any(|side| {
            let corners = face_corners(axis, side);
            let on_face =
                |e: u8| (0..4).any(|i| edge_between(corners[i], corners[(i + 1) % 4]) == e);
            on_face(a) && on_face(b)
        })
    })
}

/// The middle of an edge, in half voxels.
fn middle(edge: u8) -> [i32; 3] {
    let axis = (edge / 4) as usize;
    let (low, high) = (i32::from(edge & 1), i32::from(edge >> 1 & 1));
    let mut m = [0; 3];
    m[axis] = 1;
    let others = [[1, 2], [0, 2], [0, 1]][axis];
    m[others[0]] = 2 * low;
    m[others[1]] = 2 * high;
    m
}

/// The cheapest triangulation of `polygon[i..=j]` over the chord (i, j): total squared chord
/// length and triangles, or `None` where every one needs a chord in a face.
fn triangulate(polygon: &[u8], i: usize, j: usize) -> Option<(i32, Vec<[u8; 3]>)> {
    if j - i < 2 {
        return Some((0, Vec::new()));
    }
    let last = polygon.len() - 1;
    let chord = |a: usize, b: usize| -> Option<i32> {
        if b - a == 1 || (a == 0 && b == last) {
            return Some(0);
        }
        let (p, q) = (middle(polygon[a]), middle(polygon[b]));
        let length: i32 = (0..3).map(|r| (p[r] - q[r]).pow(2)).sum();
        (!share_face(polygon[a], polygon[b])).then_some(length)
    };
    (i + 1..j)
        .filter_map(|k| {
            let cost = chord(i, k)? + chord(k, j)?;
            let (left, mut triangles) = triangulate(polygon, i, k)?;
            let (right, more) = triangulate(polygon, k, j)?;
            triangles.extend(more);
            triangles.push([polygon[i], polygon[k], polygon[j]]);
            Some((cost + left + right, triangles))
        })
        .min_by_key(|(cost, _)| *cost)
}

/// The crossed edges of a case as directed loops.
fn loops(inside: u8) -> Vec<Vec<u8>> {
    let mut next = successors(inside);
    let mut loops = Vec::new();
    for start in 0..12u8 {
        let mut polygon = Vec::new();
        let mut edge = start;
        while let Some(following) = next[edge as usize].take() {
            polygon.push(edge);
            edge = following;
        }
        if !polygon.is_empty() {
            loops.push(polygon);
        }
    }
    loops
}

/// The band between two loops of three edges that face each other through the cube's middle:
/// each edge is joined to the two of the other loop that are nearest.
fn tunnel(a: &[u8], b: &[u8]) -> Vec<[u8; 3]> {
    // The edge of the other loop parallel to this one is the far one.
    let far = |e: u8, others: &[u8]| others.iter().position(|o| o / 4 == e / 4).unwrap_or(0);
    let near = |e: u8, next: u8, others: &[u8]| {
        let (f, g) = (far(e, others), far(next, others));
        others[3 - f - g]
    };
    let sides = |own: &[u8], others: &[u8]| -> Vec<[u8; 3]> {
        (0..3)
            .map(|i| {
                let (e, next) = (own[i], own[(i + 1) % 3]);
                [e, next, near(e, next, others)]
            })
            .collect()
    };
    let mut band = sides(a, b);
    band.extend(sides(b, a));
    band
}

fn case(inside: u8) -> Case {
    let loops = loops(inside);
    let outside = !inside;
    let opposite =
        outside.count_ones() == 2 && outside.reverse_bits() == outside && loops.len() == 2;
    let triangles = if opposite {
        tunnel(&loops[0], &loops[1])
    } else {
        loops
            .iter()
            .flat_map(|polygon| {
                let (_, triangles) = triangulate(polygon, 0, polygon.len() - 1).expect(
                    "every loop of a cube has a triangulation without chords in faces (tested)",
                );
                triangles
            })
            .collect()
    };
    let mut result = Case::default();
    for t in triangles {
        let at = 3 * usize::from(result.count);
        result.edges[at..at + 3].copy_from_slice(&t);
        result.count += 1;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn triangles(c: u8) -> Vec<[u8; 3]> {
        let case = &CUBE_CASES[c as usize];
        case.edges[..3 * usize::from(case.count)]
            .chunks(3)
            .map(|t| [t[0], t[1], t[2]])
            .collect()
    }

    /// Directed edges that have no partner inside the cube.
    fn boundary(c: u8) -> Vec<(u8, u8)> {
        let mut directed = BTreeMap::new();
        for t in triangles(c) {
            for k in 0..3 {
                *directed.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
            }
        }
        assert!(directed.values().all(|&n| n == 1), "case {c}");
        directed
            .keys()
            .copied()
            .filter(|&(a, b)| !directed.contains_key(&(b, a)))
            .collect()
    }

    #[test]
    fn every_case_uses_exactly_the_crossed_edges_and_ends_on_the_faces() {
        for c in 0..=255u8 {
            let mut used: Vec<u8> = triangles(c).into_iter().flatten().collect();
            used.sort_unstable();
            used.dedup();
            let mut crossed = Vec::new();
            for a in 0..8u8 {
                for bit in [1, 2, 4] {
                    let b = a | bit;
                    if a != b && (c >> a & 1) != (c >> b & 1) {
                        crossed.push(edge_between(a, b));
                    }
                }
            }
            crossed.sort_unstable();
            assert_eq!(used, crossed, "case {c}");
            for (a, b) in boundary(c) {
                assert!(
                    share_face(a, b),
                    "case {c}: open edge {a} {b} inside the cube"
                );
            }
            // A chord (an edge with both its triangles in this cube) never lies in a face.
            for t in triangles(c) {
                for k in 0..3 {
                    let (a, b) = (t[k], t[(k + 1) % 3]);
                    let open = boundary(c).contains(&(a, b));
                    assert!(open || !share_face(a, b), "case {c}: chord in a face");
                }
            }
        }
    }

    #[test]
    fn neighbouring_cubes_agree_on_every_shared_face() {
        for axis in 0..3u8 {
            let bit = 1 << axis;
            let on = |e: u8, side: u8| {
                let f = face_corners(axis, side);
                (0..4).any(|i| edge_between(f[i], f[(i + 1) % 4]) == e)
            };
            let across = |e: u8| {
                // The edge of the high face as seen from the next cube, on its low face.
                let f = face_corners(axis, 1);
                let i = (0..4)
                    .find(|&i| edge_between(f[i], f[(i + 1) % 4]) == e)
                    .unwrap();
                edge_between(f[i] & !bit, f[(i + 1) % 4] & !bit)
            };
            for c in 0..=255u8 {
                for d in 0..=255u8 {
                    let agree = (0..8u8)
                        .filter(|corner| corner & bit == 0)
                        .all(|corner| (c >> (corner | bit) & 1) == (d >> corner & 1));
                    if !agree {
                        continue;
                    }
                    let mut ours: Vec<_> = boundary(c)
                        .into_iter()
                        .filter(|&(a, b)| on(a, 1) && on(b, 1))
                        .map(|(a, b)| (across(b), across(a)))
                        .collect();
                    let mut theirs: Vec<_> = boundary(d)
                        .into_iter()
                        .filter(|&(a, b)| on(a, 0) && on(b, 0))
                        .collect();
                    ours.sort_unstable();
                    theirs.sort_unstable();
                    assert_eq!(ours, theirs, "axis {axis}, cases {c} and {d}");
                }
            }
        }
    }

    #[test]
    fn a_single_inside_corner_is_seen_from_outside() {
        let [t] = triangles(1)[..] else { panic!() };
        let [a, b, c] = t
            .map(|e| middle(e).map(f64::from))
            .map(crate::base::geometry::Vec3::from);
        assert!(crate::base::geometry::triangle::area_normal(&a, &b, &c).sum() > 0.0);
    }
}
