//! Holes in rough, thin and pinched surfaces, against all triangulations of their rings.

use super::super::test_surfaces::{awkward, jittered, patchwork, stacked};
use super::*;
use crate::mesh::ids::stored;
use crate::mesh::intersections::self_intersections;
use crate::mesh::{TriMesh, shapes, topology};

/// The cost of the cheapest triangulation of a convex polygon, by brute force.
fn brute_force(i: usize, j: usize, cost: &dyn Fn(usize, usize, usize) -> Option<f64>) -> f64 {
    if j < i + 2 {
        return 0.0;
    }
    (i + 1..j)
        .filter_map(|k| Some(cost(i, k, j)? + brute_force(i, k, cost) + brute_force(k, j, cost)))
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn dynamic_programming_finds_the_cheapest_triangulation() {
    for seed in 0..40usize {
        let m = 3 + seed % 7;
        let cost = move |i: usize, k: usize, j: usize| {
            let mixed = (i * 7919 + k * 104_729 + j * 1_299_709 + seed * 15_485_863) % 97;
            (mixed > 15).then_some(mixed as f64)
        };
        let expected = brute_force(0, m - 1, &cost);
        match cheapest(m, cost) {
            None => assert!(expected.is_infinite()),
            Some(triangles) => {
                assert_eq!(triangles.len(), m - 2);
                let sum: f64 = triangles
                    .iter()
                    .map(|t| {
                        let [i, k, j] = t.map(|v| v as usize);
                        cost(i, k, j).unwrap()
                    })
                    .sum();
                assert_eq!(sum, expected);
            }
        }
    }
}

/// As everywhere, ties go to the lower number.
#[test]
fn of_equally_cheap_triangulations_the_one_with_the_lowest_corners_counts() {
    for m in 3..9 {
        let triangles = cheapest(m, |_, _, _| Some(1.0)).unwrap();
        assert_eq!(triangles.len(), m - 2);
        assert!(
            triangles
                .iter()
                .all(|[i, k, j]| *k == i + 1 && *j == m as u32 - 1)
        );
    }
}

/// The cost of every triangle of a ring against its definition: the outer triangle of a side is looked for among
/// all triangles of the mesh.
#[test]
fn the_cost_counts_the_shape_and_the_angles_at_the_sides_of_the_hole() {
    let mut sphere = shapes::icosphere(30.0, 2);
    for (v, p) in sphere.vertices.iter_mut().enumerate() {
        *p *= 1.0 + 0.1 * (v as f64 * 1.7).sin();
    }
    let unit = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| sphere.vertices[v as usize]);
        triangle::area_normal(&a, &b, &c).normalize()
    };
    let mesh = Patchwork::new(sphere.vertices.clone(), sphere.triangles.clone(), 5.0);
    let mut seen = [false; 4];
    for v in [0u32, 3, 20, 50, 100] {
        let star = mesh.star(VertexId::from_index(v as usize));
        let hole = Hole::new(&mesh, &star, Demand::Embedded);
        let (ring, m) = (&star.ring, star.ring.len());
        let around = (0..sphere.triangles.len()).filter(|&t| sphere.triangles[t].contains(&v));
        let normal: Vec3 = around.map(|t| sphere.area_normal(t)).sum();
        let normal = normal.normalize();
        for (i, k, j) in all_triangles(m) {
            let corners = [i, k, j].map(|place| mesh.position(ring[place]));
            let [a, b, c] = corners;
            let n = triangle::area_normal(&a, &b, &c).normalize();
            let mut turned = 2.0 * (1.0 - n.dot(&normal));
            let mut sides = 0;
            for (from, to) in [(i, k), (k, j), (j, i)] {
                if (from + 1) % m == to {
                    let ends = [from, to].map(|place| ring[place].index() as u32);
                    let outer = sphere
                        .triangles
                        .iter()
                        .find(|t| ends.iter().all(|end| t.contains(end)) && !t.contains(&v));
                    turned += 1.0 - n.dot(&unit(outer.unwrap()));
                    sides += 1;
                }
            }
            seen[sides] = true;
            let expected = 1.0 / triangle::radius_ratio(&a, &b, &c).max(0.05) + 2.0 * turned;
            let cost = hole.cost(i, k, j, Demand::Embedded).unwrap();
            assert!(
                (cost - expected).abs() < 1e-9,
                "{i} {k} {j}: {cost} {expected}"
            );
        }
    }
    assert!(seen[..3].iter().all(|s| *s), "{seen:?}");
}

/// All triangulations of the corners `i` to `j` of a ring.
fn all_triangulations(i: u32, j: u32) -> Vec<Vec<RingTriangle>> {
    if j < i + 2 {
        return vec![Vec::new()];
    }
    let mut all = Vec::new();
    for k in i + 1..j {
        for left in all_triangulations(i, k) {
            for right in all_triangulations(k, j) {
                all.push([&left[..], &right, &[[i, k, j]]].concat());
            }
        }
    }
    all
}

/// Whether the surface with these triangles instead of the star of `v` keeps its topology, does not intersect
/// itself and satisfies the demand.
fn is_admissible(surface: &TriMesh, v: u32, new: &[[VertexId; 3]], demand: Demand) -> bool {
    let (star, rest): (Vec<[u32; 3]>, Vec<[u32; 3]>) =
        surface.triangles.iter().partition(|t| t.contains(&v));
    let new: Vec<[u32; 3]> = new.iter().map(|t| stored(*t)).collect();
    let normal = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| surface.vertices[v as usize]);
        triangle::area_normal(&a, &b, &c)
    };
    let mean = star.iter().map(normal).sum::<Vec3>().normalize();
    let is_smooth = |t: &[u32; 3]| {
        let n = normal(t).normalize();
        let beside = rest
            .iter()
            .filter(|other| t.iter().filter(|v| other.contains(v)).count() == 2);
        n.dot(&mean) >= MIN_FACING
            && beside
                .map(|other| n.dot(&normal(other).normalize()))
                .all(|cosine| cosine >= MIN_DIHEDRAL_COSINE)
    };
    // The last vertex takes the number of the one that is gone.
    let last = surface.vertices.len() as u32 - 1;
    let renamed = |t: &[u32; 3]| t.map(|c| if c == last { v } else { c });
    let mut vertices = surface.vertices.clone();
    vertices.swap_remove(v as usize);
    let after = TriMesh {
        vertices,
        triangles: rest.iter().chain(&new).map(renamed).collect(),
    };
    let before = topology::check(surface).expect("a closed surface");
    topology::check(&after).is_ok_and(|census| census.genus() == before.genus())
        && self_intersections(&after).is_empty()
        && (demand == Demand::Embedded || new.iter().all(is_smooth))
}

/// By trying all triangulations of the ring: what closes a hole is admissible, and a hole is blocked only if
/// nothing is.
#[test]
fn a_hole_is_closed_admissibly_if_any_triangulation_is_admissible() {
    let mut seen = [[0; 2]; 2];
    for surface in awkward() {
        let mesh = patchwork(&surface);
        for v in 0..surface.vertices.len() as u32 {
            let star = mesh.star(VertexId(v));
            if star.ring.len() > 7 {
                continue;
            }
            for demand in [Demand::Smooth, Demand::Embedded] {
                let closed = close(&mesh, &star, demand);
                match &closed {
                    Ok(new) => assert!(is_admissible(&surface, v, new, demand), "{v}"),
                    Err(blocked) => {
                        // What is in the way stands outside the star, and is named once.
                        assert!(blocked.by.is_sorted_by(|s, t| s < t));
                        assert!(blocked.by.iter().all(|t| !star.triangles.contains(t)));
                        let hole = Hole::new(&mesh, &star, demand);
                        let all = all_triangulations(0, star.ring.len() as u32 - 1);
                        let mut all = all.iter().map(|t| hole.vertices_of(t));
                        assert!(!all.any(|t| is_admissible(&surface, v, &t, demand)), "{v}");
                    }
                }
                seen[demand as usize][usize::from(closed.is_ok())] += 1;
            }
        }
    }
    assert!(seen.iter().flatten().all(|n| *n > 5), "{seen:?}");
}

/// The triangulation in space costs no more than any admissible one.
#[test]
fn the_best_triangulation_is_the_cheapest_admissible_one() {
    let mut compared = 0;
    for surface in awkward() {
        let mesh = patchwork(&surface);
        for v in 0..surface.vertices.len() as u32 {
            let star = mesh.star(VertexId(v));
            if star.ring.len() > 6 {
                continue;
            }
            let hole = Hole::new(&mesh, &star, Demand::Smooth);
            let cost = |triangles: &[RingTriangle]| -> f64 {
                let cost = |[i, k, j]: [u32; 3]| {
                    let [i, k, j] = [i, k, j].map(|place| place as usize);
                    hole.cost(i, k, j, Demand::Embedded).unwrap()
                };
                triangles.iter().map(|t| cost(*t)).sum()
            };
            let least = all_triangulations(0, star.ring.len() as u32 - 1)
                .iter()
                .filter(|t| is_admissible(&surface, v, &hole.vertices_of(t), Demand::Smooth))
                .map(|t| cost(t))
                .fold(f64::INFINITY, f64::min);
            let Ok(best) = hole.best_triangulation() else {
                continue;
            };
            let place = |w: VertexId| star.ring.iter().position(|r| *r == w).unwrap() as u32;
            let best: Vec<RingTriangle> = best.iter().map(|t| t.map(place)).collect();
            assert!((cost(&best) - least).abs() < 1e-9 * least, "{v}");
            compared += 1;
        }
    }
    assert!(compared > 100, "{compared}");
}

/// The table has a cost exactly for the triangles whose chords are new edges and which the demand allows.
#[test]
fn triangles_with_a_chord_that_is_an_edge_already_have_no_cost() {
    let mut kept = [0; 2];
    let large = (0..3).map(|seed| stacked(40, seed));
    for surface in awkward().into_iter().chain(large) {
        let mesh = patchwork(&surface);
        for v in VertexId::first(surface.vertices.len()) {
            let star = mesh.star(v);
            let m = star.ring.len();
            let hole = Hole::new(&mesh, &star, Demand::Embedded);
            let table = hole.cost_table();
            for (i, k, j) in all_triangles(m) {
                let is_free = |a: usize, b: usize| {
                    let ends = [a, b].map(|place| star.ring[place].index() as u32);
                    let joined = |t: &[u32; 3]| ends.iter().all(|end| t.contains(end));
                    (a + 1) % m == b || (b + 1) % m == a || !surface.triangles.iter().any(joined)
                };
                let allowed = is_free(i, k) && is_free(k, j) && is_free(j, i);
                let cost = allowed
                    .then(|| hole.cost(i, k, j, Demand::Embedded))
                    .flatten();
                assert_eq!(table[hole.place(i, k, j)], cost);
                kept[usize::from(cost.is_some())] += 1;
                let triangle = [i, k, j].map(|place| place as u32);
                let smooth = allowed && hole.cost(i, k, j, Demand::Smooth).is_some();
                assert_eq!(hole.admits_all(&[triangle]), smooth);
                assert_eq!(
                    hole.admits_all(&[[triangle[2], triangle[0], triangle[1]]]),
                    smooth
                );
            }
        }
    }
    assert!(kept.iter().all(|n| *n > 100), "{kept:?}");
}

/// The projection of the ring along the star's mean normal is divided by the Delaunay rule: no corner lies
/// inside the circle of a triangle that could see it.
#[test]
fn the_flat_triangulation_is_delaunay_in_the_plane_of_the_star() {
    let mut compared = 0;
    for seed in 0..6 {
        let surface = jittered(&shapes::icosphere(30.0, 2), 2.0, seed);
        let mesh = patchwork(&surface);
        for v in 0..surface.vertices.len() as u32 {
            let star = mesh.star(VertexId(v));
            let hole = Hole::new(&mesh, &star, Demand::Smooth);
            let around =
                (0..surface.triangles.len()).filter(|t| surface.triangles[*t].contains(&v));
            let normal = around
                .map(|t| surface.area_normal(t))
                .sum::<Vec3>()
                .normalize();
            let flat: Vec<Vec3> = star
                .ring
                .iter()
                .map(|w| mesh.position(*w) - normal * normal.dot(&mesh.position(*w)))
                .collect();
            let m = flat.len();
            let turn = |a: usize, b: usize, c: usize| {
                triangle::area_normal(&flat[a], &flat[b], &flat[c]).dot(&normal)
            };
            if !(0..m).all(|k| turn(k, (k + 1) % m, (k + 2) % m) > 0.0) {
                continue; // Only in a convex ring every corner can be seen.
            }
            let triangles = hole.flat_triangulation().unwrap();
            assert_eq!(triangles.len(), m - 2);
            for t in triangles {
                let [a, b, c] = t.map(|k| flat[k as usize]);
                let (ab, ac) = (b - a, c - a);
                let n = ab.cross(&ac);
                assert!(n.dot(&normal) > 0.0);
                let to_centre = n.cross(&ab) * ac.norm_squared() + ac.cross(&n) * ab.norm_squared();
                let to_centre = to_centre / (2.0 * n.norm_squared());
                for p in &flat {
                    assert!((p - a - to_centre).norm() > to_centre.norm() * (1.0 - 1e-9));
                }
                compared += 1;
            }
        }
    }
    assert!(compared > 500, "{compared}");
}

#[test]
fn triangles_that_intersect_the_mesh_or_each_other_are_found() {
    let mut seen = [[0; 2]; 2];
    for surface in awkward() {
        let mesh = patchwork(&surface);
        for v in VertexId::first(surface.vertices.len()) {
            let star = mesh.star(v);
            let m = star.ring.len();
            if !(4..=7).contains(&m) {
                continue;
            }
            let hole = Hole::new(&mesh, &star, Demand::Embedded);
            let rest: Vec<FaceId> = FaceId::first(surface.triangles.len())
                .filter(|t| !star.triangles.contains(t))
                .collect();
            for triangles in all_triangulations(0, m as u32 - 1) {
                let mut known = BTreeMap::new();
                let found = hole.intersecting(&triangles, &mut known);
                let new = hole.vertices_of(&triangles);
                let meet = |s: [VertexId; 3], t: [VertexId; 3]| {
                    triangles_intersect(s, &mesh.corners(s), t, &mesh.corners(t))
                };
                for (k, t) in triangles.iter().enumerate() {
                    let blocker = rest.iter().find(|r| meet(new[k], mesh.triangle(**r)));
                    let earlier = new[..k].iter().any(|other| meet(new[k], *other));
                    assert_eq!(known[t], blocker.copied());
                    assert_eq!(found.contains(t), blocker.is_some() || earlier);
                    seen[usize::from(blocker.is_some())][usize::from(earlier)] += 1;
                }
            }
        }
    }
    assert!(
        seen[0][0] > 100 && seen[1][0] > 100 && seen[0][1] > 10,
        "{seen:?}"
    );
}

#[test]
fn only_the_last_vertex_but_three_of_a_component_leaves_a_tetrahedron() {
    let four = shapes::tetrahedron(1.0);
    let more = stacked(6, 1);
    for surface in [&four, &more] {
        let mesh = patchwork(surface);
        for v in VertexId::first(surface.vertices.len()) {
            let star = mesh.star(v);
            let hole = Hole::new(&mesh, &star, Demand::Embedded);
            let m = star.ring.len() as u32;
            let fan: Vec<RingTriangle> = (1..m - 1).map(|k| [0, k, k + 1]).collect();
            let found = hole.closes_a_tetrahedron(&hole.vertices_of(&fan));
            assert_eq!(found, surface.vertices.len() == 4);
            if found {
                assert_eq!(hole.intersecting(&fan, &mut BTreeMap::new()), fan);
            }
        }
    }
}

/// Two cones over a ring of `m` vertices: the removed vertex is the first one.
fn double_cone(m: u32, tip: f64) -> TriMesh {
    let mut mesh = TriMesh::default();
    mesh.vertices.push(Vec3::z() * tip);
    for k in 0..m {
        let angle = std::f64::consts::TAU * f64::from(k) / f64::from(m);
        // Uneven, so that no circle has four corners.
        let radius = 10.0 + 0.1 * (7.0 * angle).sin();
        mesh.vertices
            .push(Vec3::new(angle.cos(), angle.sin(), 0.0) * radius);
        let (p, q) = (1 + k, 1 + (k + 1) % m);
        mesh.triangles.extend([[0, p, q], [m + 1, q, p]]);
    }
    mesh.vertices.push(-Vec3::z() * 10.0);
    mesh
}

#[test]
fn rings_up_to_the_longest_are_closed_in_space() {
    for (m, closed) in [(LONGEST_RING, true), (LONGEST_RING + 1, false)] {
        let mesh = patchwork(&double_cone(m as u32, 1.0));
        let star = mesh.star(VertexId(0));
        let best = Hole::new(&mesh, &star, Demand::Embedded).best_triangulation();
        match best {
            Ok(triangles) => assert!(closed && triangles.len() == m - 2),
            Err(blocked) => assert!(!closed && blocked.by.is_empty()),
        }
    }
}

fn all_triangles(m: usize) -> Vec<(usize, usize, usize)> {
    let mut all = Vec::new();
    for i in 0..m {
        for k in i + 1..m {
            all.extend((k + 1..m).map(|j| (i, k, j)));
        }
    }
    all
}
