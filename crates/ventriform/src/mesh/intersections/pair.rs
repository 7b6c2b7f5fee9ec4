//! The exact intersection test of two triangles.
//!
//! Every decision is the sign of a determinant computed by Shewchuk's adaptive predicates
//! (1997), so the answer is exact for the stored coordinates. There are no special positions:
//! coplanar, touching and degenerate triangles (segments, points) are handled as closed sets.

use robust::{Coord, Coord3D, orient2d, orient3d};

use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
use crate::mesh::VertexId;

/// Whether the closed triangles `s` and `t` have more in common than the vertices and edges
/// that they share.
///
/// `s_ids` and `t_ids` are the vertices at the corners; equal ones mean a shared vertex.
/// - No shared vertex: any common point counts, including touching.
/// - One shared vertex: any other common point counts.
/// - A shared edge: they intersect if one is folded onto the other.
/// - Three shared vertices: they always intersect.
pub fn triangles_intersect(
    s_ids: [VertexId; 3],
    s: &[Vec3; 3],
    t_ids: [VertexId; 3],
    t: &[Vec3; 3],
) -> bool {
    let from_s = [0, 1, 2].map(|i| t_ids.contains(&s_ids[i]));
    match from_s.iter().filter(|shared| **shared).count() {
        0 => closed_triangles_meet(s, t),
        1 => {
            let i = from_s.iter().position(|shared| *shared).unwrap_or(0);
            let j = t_ids.iter().position(|v| *v == s_ids[i]).unwrap_or(0);
            meet_beyond_vertex(&turned(s, i), &turned(t, j))
        }
        2 => {
            // The corner that is not shared comes first.
            let i = from_s.iter().position(|shared| !*shared).unwrap_or(0);
            let j = (0..3).find(|&j| !s_ids.contains(&t_ids[j])).unwrap_or(0);
            let [a, u, v] = turned(s, i);
            meet_beyond_edge(&u, &v, &a, &t[j])
        }
        _ => true,
    }
}

fn turned(t: &[Vec3; 3], first: usize) -> [Vec3; 3] {
    [0, 1, 2].map(|k| t[(first + k) % 3])
}

/// For triangles without a shared vertex: if they meet, an edge of one meets the other.
fn closed_triangles_meet(s: &[Vec3; 3], t: &[Vec3; 3]) -> bool {
    if beside(s, t) || beside(t, s) {
        return false;
    }
    (0..3).any(|k| {
        let l = (k + 1) % 3;
        segment_meets_triangle(&s[k], &s[l], t) || segment_meets_triangle(&t[k], &t[l], s)
    })
}

/// Whether `t` lies strictly on one side of the plane of `s`.
fn beside(s: &[Vec3; 3], t: &[Vec3; 3]) -> bool {
    let first = side(s, &t[0]);
    first != 0 && side(s, &t[1]) == first && side(s, &t[2]) == first
}

/// For triangles whose first corners are a shared vertex. If two convex sets have that vertex and
/// another point in common, they have the segment in between; extended, it leaves one of the
/// triangles through the edge opposite to the vertex.
fn meet_beyond_vertex(s: &[Vec3; 3], t: &[Vec3; 3]) -> bool {
    let apart = |s: &[Vec3; 3], t: &[Vec3; 3]| {
        let first = side(s, &t[1]);
        first != 0 && side(s, &t[2]) == first
    };
    if plainly_apart(s, t) || apart(s, t) || apart(t, s) {
        return false;
    }
    opposite_edge_meets(s, t) || opposite_edge_meets(t, s)
}

/// Whether a plane through the shared first corner has one triangle on either side, by so much that
/// rounding cannot matter. So it is for most neighbours on a surface, and quicker to see than by
/// exact predicates.
fn plainly_apart(s: &[Vec3; 3], t: &[Vec3; 3]) -> bool {
    let from_vertex = |t: &[Vec3; 3]| [t[1] - t[0], t[2] - t[0]];
    let ([a, b], [c, d]) = (from_vertex(s), from_vertex(t));
    let (towards_s, towards_t) = (a + b, c + d);
    let normal = towards_s * towards_t.norm() - towards_t * towards_s.norm();
    // Rounding of the differences and of the product is less than 1e-15 of the lengths.
    let beyond = |v: Vec3| {
        let height = normal.dot(&v);
        height * height.abs() > 1e-20 * normal.norm_squared() * v.norm_squared()
    };
    beyond(a) && beyond(b) && beyond(-c) && beyond(-d)
}

fn opposite_edge_meets(s: &[Vec3; 3], t: &[Vec3; 3]) -> bool {
    let [v, a, b] = s;
    if is_collinear(s) {
        // The edge may contain the vertex itself, so only its ends are tested.
        return [a, b]
            .iter()
            .any(|end| *end != v && segment_meets_triangle(end, end, t));
    }
    segment_meets_triangle(a, b, t)
}

/// For the triangles `u v a` and `u v b`: they meet beyond `u v` only if they are coplanar with
/// `a` and `b` on the same side.
fn meet_beyond_edge(u: &Vec3, v: &Vec3, a: &Vec3, b: &Vec3) -> bool {
    if side(&[*u, *v, *a], b) != 0 {
        return false;
    }
    for axis in 0..3 {
        let (at_a, at_b) = (turn(axis, u, v, a), turn(axis, u, v, b));
        if at_a != 0 || at_b != 0 {
            return at_a == at_b;
        }
    }
    // Both are segments. If these lie on one line, their boxes decide.
    if !is_collinear(&[*u, *a, *b]) {
        return false;
    }
    let (s, t, edge) = (
        Aabb::around([u, v, a]),
        Aabb::around([u, v, b]),
        Aabb::around([u, v]),
    );
    s.min.sup(&t.min) != edge.min || s.max.inf(&t.max) != edge.max
}

/// Whether a closed segment, possibly a point, meets a closed triangle, possibly a segment or a
/// point.
fn segment_meets_triangle(p: &Vec3, q: &Vec3, t: &[Vec3; 3]) -> bool {
    let (at_p, at_q) = (side(t, p), side(t, q));
    if at_p * at_q > 0 {
        return false;
    }
    if at_p == 0 && at_q == 0 {
        return flat_segment_meets_triangle(p, q, t);
    }
    let [a, b, c] = t;
    let first = side(&[*p, *q, *a], b);
    let second = side(&[*p, *q, *b], c);
    if first * second < 0 {
        return false;
    }
    let third = side(&[*p, *q, *c], a);
    first * third >= 0 && second * third >= 0
}

/// [`segment_meets_triangle`] for a segment in the triangle's plane, or a degenerate triangle.
fn flat_segment_meets_triangle(p: &Vec3, q: &Vec3, t: &[Vec3; 3]) -> bool {
    let [a, b, c] = t;
    let edges = [(a, b), (b, c), (c, a)];
    let Some((axis, orientation)) = projection(t) else {
        return edges.iter().any(|(r, s)| segments_meet(p, q, r, s));
    };
    // A segment that meets no edge lies entirely inside or entirely outside.
    edges.iter().any(|(r, s)| {
        coplanar_segments_meet(axis, p, q, r, s).unwrap_or_else(|| boxes_meet(p, q, r, s))
    }) || edges
        .iter()
        .all(|(r, s)| turn(axis, r, s, p) == orientation)
}

/// An axis along which the triangle's projection has an area, and its orientation there. The
/// widest projection is tried first, since its sign is decided fastest.
fn projection([a, b, c]: &[Vec3; 3]) -> Option<(usize, i8)> {
    let widest = (b - a).cross(&(c - a)).iamax();
    (0..3)
        .map(|k| (widest + k) % 3)
        .map(|axis| (axis, turn(axis, a, b, c)))
        .find(|(_, turn)| *turn != 0)
}

/// Whether two closed segments meet.
fn segments_meet(p: &Vec3, q: &Vec3, r: &Vec3, s: &Vec3) -> bool {
    side(&[*p, *q, *r], s) == 0
        && (0..3)
            .find_map(|axis| coplanar_segments_meet(axis, p, q, r, s))
            .unwrap_or_else(|| boxes_meet(p, q, r, s))
}

/// Whether two closed coplanar segments meet, decided in the projection along `axis`; `None` if
/// they are collinear there.
fn coplanar_segments_meet(axis: usize, p: &Vec3, q: &Vec3, r: &Vec3, s: &Vec3) -> Option<bool> {
    let (of_r, of_s) = (turn(axis, p, q, r), turn(axis, p, q, s));
    if of_r * of_s > 0 {
        return Some(false);
    }
    let (of_p, of_q) = (turn(axis, r, s, p), turn(axis, r, s, q));
    // A triple that is not collinear shows that the projection keeps the common plane a plane.
    let seen = [of_r, of_s, of_p, of_q].iter().any(|turn| *turn != 0);
    seen.then_some(of_p * of_q <= 0)
}

/// Whether two collinear segments meet.
fn boxes_meet(p: &Vec3, q: &Vec3, r: &Vec3, s: &Vec3) -> bool {
    Aabb::around([p, q]).overlaps(&Aabb::around([r, s]))
}

fn is_collinear([a, b, c]: &[Vec3; 3]) -> bool {
    (0..3).all(|axis| turn(axis, a, b, c) == 0)
}

/// The side of the plane of `t` on which the point lies: -1, 0 or 1; 0 if `t` is degenerate.
fn side(t: &[Vec3; 3], p: &Vec3) -> i8 {
    let [a, b, c, d] = [&t[0], &t[1], &t[2], p].map(|p| Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    });
    sign(orient3d(a, b, c, d))
}

/// The orientation of `a b c` in the projection along `axis`: -1, 0 or 1.
fn turn(axis: usize, a: &Vec3, b: &Vec3, c: &Vec3) -> i8 {
    let [a, b, c] = [a, b, c].map(|p| Coord {
        x: p[(axis + 1) % 3],
        y: p[(axis + 2) % 3],
    });
    sign(orient2d(a, b, c))
}

fn sign(x: f64) -> i8 {
    i8::from(x > 0.0) - i8::from(x < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::random::{Purpose, stream};
    use crate::mesh::ids::typed;
    use rand::RngExt;

    /// Exact fractions.
    #[derive(Clone, Copy, PartialEq, Debug)]
    struct Fraction(i128, i128);

    impl Fraction {
        fn new(n: i128, d: i128) -> Self {
            let (mut a, mut b) = (n.abs(), d.abs());
            while b != 0 {
                (a, b) = (b, a % b);
            }
            let scale = a.max(1) * d.signum();
            Self(n / scale, d / scale)
        }
        fn sub(self, o: Self) -> Self {
            Self::new(self.0 * o.1 - o.0 * self.1, self.1 * o.1)
        }
        fn mul(self, o: Self) -> Self {
            Self::new(self.0 * o.0, self.1 * o.1)
        }
        fn div(self, o: Self) -> Self {
            Self::new(self.0 * o.1, self.1 * o.0)
        }
    }

    type Corners = [[i32; 3]; 3];

    /// The unique solution of the 5 equations in the chosen columns, by Gauss-Jordan.
    fn solve(columns: &[[i32; 5]]) -> Option<Vec<Fraction>> {
        let n = columns.len();
        let right = [0, 0, 0, 1, 1];
        let mut m: Vec<Vec<Fraction>> = (0..5)
            .map(|r| {
                let left = columns.iter().map(|c| c[r]);
                let row = left.chain([right[r]]);
                row.map(|x| Fraction::new(i128::from(x), 1)).collect()
            })
            .collect();
        for c in 0..n {
            let pivot = (c..5).find(|&r| m[r][c].0 != 0)?;
            m.swap(c, pivot);
            for r in 0..5 {
                if r != c && m[r][c].0 != 0 {
                    let factor = m[r][c].div(m[c][c]);
                    for k in c..=n {
                        m[r][k] = m[r][k].sub(factor.mul(m[c][k]));
                    }
                }
            }
        }
        let consistent = (n..5).all(|r| m[r][n].0 == 0);
        consistent.then(|| (0..n).map(|c| m[c][n].div(m[c][c])).collect())
    }

    /// The common points of two triangles by exact linear programming. They are the images of
    /// {λ, μ >= 0, Σλ = Σμ = 1, Σλs = Σμt}; the vertices of that polytope are its basic
    /// solutions, and the common set is the convex hull of their images.
    fn common_hull(s: &Corners, t: &Corners) -> Vec<[Fraction; 3]> {
        let columns: Vec<[i32; 5]> = (0..6)
            .map(|k| match k {
                0..3 => [s[k][0], s[k][1], s[k][2], 1, 0],
                _ => [-t[k - 3][0], -t[k - 3][1], -t[k - 3][2], 0, 1],
            })
            .collect();
        let mut hull = Vec::new();
        for subset in 1u32..64 {
            let chosen: Vec<usize> = (0..6).filter(|k| subset >> k & 1 == 1).collect();
            if chosen.len() > 5 {
                continue;
            }
            let picked: Vec<[i32; 5]> = chosen.iter().map(|&k| columns[k]).collect();
            let Some(x) = solve(&picked) else { continue };
            if x.iter().all(|x| x.0 >= 0) {
                hull.push([0, 1, 2].map(|axis| {
                    let mut sum = Fraction::new(0, 1);
                    for (&k, &x) in chosen.iter().zip(&x).filter(|(k, _)| **k < 3) {
                        let term = x.mul(Fraction::new(i128::from(-s[k][axis]), 1));
                        sum = sum.sub(term);
                    }
                    sum
                }));
            }
        }
        hull
    }

    fn on_segment(x: &[Fraction; 3], u: &[i32; 3], v: &[i32; 3]) -> bool {
        let whole = |n: i32| Fraction::new(i128::from(n), 1);
        let along: Vec<Option<Fraction>> = (0..3)
            .filter_map(|k| {
                let offset = x[k].sub(whole(u[k]));
                match v[k] - u[k] {
                    0 if offset.0 == 0 => None,
                    0 => Some(None),
                    step => Some(Some(offset.div(whole(step)))),
                }
            })
            .collect();
        let Some(first) = along.first() else {
            return true;
        };
        along.iter().all(|a| a == first)
            && first.is_some_and(|f| f.0 >= 0 && f.sub(whole(1)).0 <= 0)
    }

    fn intersect_exactly(s_ids: [u32; 3], s: &Corners, t_ids: [u32; 3], t: &Corners) -> bool {
        let shared: Vec<[i32; 3]> = (0..3)
            .filter(|&k| t_ids.contains(&s_ids[k]))
            .map(|k| s[k])
            .collect();
        common_hull(s, t).iter().any(|x| match shared[..] {
            [] => true,
            [v] => !on_segment(x, &v, &v),
            [u, v] => !on_segment(x, &u, &v),
            _ => true,
        })
    }

    #[test]
    fn agrees_with_exact_linear_programming_on_integer_triangles() {
        let mut rng = stream(1, Purpose::Measure);
        let mut seen = [[0; 2]; 3];
        for round in 0..9000 {
            // In small ranges coplanar, touching and degenerate pairs are frequent.
            let reach = [1, 2, 3, 8][round % 4];
            let flat = round % 5 == 0;
            let mut points = [[0i32; 3]; 6];
            for p in &mut points {
                for axis in 0..3 {
                    let fixed = flat && axis == round % 3;
                    p[axis] = if fixed {
                        1
                    } else {
                        rng.random_range(-reach..=reach)
                    };
                }
            }
            let shared = round % 3;
            let s_ids = [0, 1, 2];
            let mut t_ids = match shared {
                0 => [3, 4, 5],
                1 => [3, 1, 5],
                _ => [2, 4, 0],
            };
            t_ids.rotate_left(round % 7 % 3);
            let of = |ids: [u32; 3]| ids.map(|v| points[v as usize]);
            let real = |c: Corners| c.map(|p| Vec3::from(p.map(f64::from)));
            let (s, t) = (of(s_ids), of(t_ids));
            let expected = intersect_exactly(s_ids, &s, t_ids, &t);
            seen[shared][usize::from(expected)] += 1;
            let [i, j] = [s_ids, t_ids].map(typed);
            let found = triangles_intersect(i, &real(s), j, &real(t));
            assert_eq!(found, expected, "{s:?} {t:?} {t_ids:?}");
            let found = triangles_intersect(j, &real(t), i, &real(s));
            assert_eq!(found, expected, "{s:?} {t:?} {t_ids:?} exchanged");
        }
        // Both answers must occur for every kind of pair.
        assert!(seen.iter().flatten().all(|count| *count > 60), "{seen:?}");
    }

    #[test]
    fn decides_where_rounded_arithmetic_cannot() {
        // 1 - 2·third is exact for the double nearest to 1/3, so the tip lies in the plane
        // x + y + z = 1, and its neighbours one unit in the last place above and below it.
        let t = [Vec3::x(), Vec3::y(), Vec3::z()];
        let third = 1.0f64 / 3.0;
        let flat = 1.0 - 2.0 * third;
        for (z, expected) in [
            (flat.next_down(), true),
            (flat, true),
            (flat.next_up(), false),
        ] {
            let spike = [
                Vec3::new(third, third, z),
                Vec3::new(2.0, 2.0, 2.0),
                Vec3::new(3.0, 2.0, 2.0),
            ];
            assert_eq!(
                triangles_intersect(typed([0, 1, 2]), &t, typed([3, 4, 5]), &spike),
                expected
            );
        }
    }

    #[test]
    fn all_shared_is_an_intersection() {
        let t = [Vec3::x(), Vec3::y(), Vec3::z()];
        assert!(triangles_intersect(
            typed([0, 1, 2]),
            &t,
            typed([2, 1, 0]),
            &[t[2], t[1], t[0]]
        ));
    }
}
