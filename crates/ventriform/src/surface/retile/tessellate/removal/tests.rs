//! Rounds of removals and flips, against their rules applied to lists of triangles.

use super::super::mutual::mutual_tessellation;
use super::super::test_surfaces::{awkward, jittered, patchwork, scattered};
use super::*;
use crate::mesh::ids::stored;
use crate::mesh::intersections::self_intersections;
use crate::mesh::{shapes, topology};
use std::collections::BTreeSet;

/// On a surface on which every hole can be closed, a round removes the vertices that the rule
/// names: in ascending order of valence, then number, each unless a neighbour went before.
#[test]
fn a_round_removes_the_vertices_of_lowest_valence_first() {
    let surface = shapes::icosphere(30.0, 3);
    // Many, so that some old vertices have too many neighbours for the first rounds.
    let points = scattered(&surface, 1500, 7);
    let triangles = mutual_tessellation(&surface.vertices, &surface.triangles, &points).unwrap();
    let positions: Vec<Vec3> = points
        .iter()
        .map(|p| p.position(&surface.vertices, &surface.triangles))
        .chain(surface.vertices.iter().copied())
        .collect();
    let mut mesh = Patchwork::new(positions, triangles, 5.0);
    let old: Vec<VertexId> = VertexId::first(mesh.positions.len())
        .skip(points.len())
        .collect();

    let mut order = old.clone();
    order.sort_by_key(|&v| (mesh.valence(v), v));
    let valences: BTreeSet<usize> = old.iter().map(|&v| mesh.valence(v)).collect();
    assert!(valences.len() > 4, "{valences:?}");
    assert!(valences.contains(&HIGH_VALENCE), "{valences:?}");
    assert!(valences.iter().any(|v| *v > HIGH_VALENCE), "{valences:?}");
    let (mut expected, mut waiting) = (Vec::new(), BTreeSet::new());
    for v in order {
        if !waiting.contains(&v) && mesh.valence(v) <= HIGH_VALENCE {
            waiting.extend(mesh.star(v).ring);
            expected.push(v);
        }
    }
    // Under another order other vertices go first.
    assert!(expected.len() < old.len() - 50);

    let mut removal = Removal {
        remaining: old.clone(),
        attempts_left: 1000,
        round: 0,
        touched: vec![0; mesh.positions.len()],
        failures: BTreeMap::new(),
    };
    let rules = schedule()[0];
    removal
        .run_round(&mut mesh, rules, &Monitor::silent())
        .unwrap();
    assert!(removal.failures.is_empty());
    let left: BTreeSet<VertexId> = removal.remaining.into_iter().collect();
    let gone: Vec<VertexId> = old.into_iter().filter(|v| !left.contains(v)).collect();
    expected.sort_unstable();
    assert_eq!(gone, expected);
}

/// From strict to lenient: no rule forbids what an earlier one allowed, and the first rules flip nothing.
#[test]
fn the_schedule_allows_more_and_more() {
    let schedule = schedule();
    let leniency = |rules: &RoundRules| (rules.demand, rules.any_valence, rules.flips);
    for pair in schedule.windows(2) {
        let (before, after) = (leniency(&pair[0]), leniency(&pair[1]));
        assert!(before.0 <= after.0 && before.1 <= after.1 && before.2 <= after.2);
    }
    let without: Vec<usize> = (0..schedule.len())
        .filter(|step| schedule[*step].flips.is_none())
        .collect();
    assert_eq!(without.last(), Some(&LAST_WITHOUT_FLIPS));
    assert!(
        without
            .windows(2)
            .all(|pair| leniency(&schedule[pair[0]]) < leniency(&schedule[pair[1]]))
    );
    for demand in [Demand::Smooth, Demand::Embedded] {
        let flips = schedule.iter().filter(|rules| rules.flips == Some(demand));
        assert_eq!(flips.count(), MAX_FLIP_ROUNDS);
    }
}

/// Every pair of vertices: a flip is offered exactly if the surface with the other diagonal is a closed manifold, it
/// intersects if that surface does, and it is smooth if the new triangles face as the old ones together.
#[test]
fn flips_keep_the_topology_and_tell_what_they_change() {
    let mut seen = [[0; 2]; 3];
    for surface in awkward() {
        let mesh = patchwork(&surface);
        let n = surface.vertices.len();
        for v in VertexId::first(n) {
            for w in VertexId::first(n) {
                let (a, b) = (v.0, w.0);
                let [t, u] = [[a, b], [b, a]].map(|[from, to]| {
                    surface
                        .triangles
                        .iter()
                        .position(|t| (0..3).any(|k| t[k] == from && t[(k + 1) % 3] == to))
                });
                let flip = EdgeFlip::new(&mesh, v, w, Demand::Embedded);
                let smooth = EdgeFlip::new(&mesh, v, w, Demand::Smooth);
                let (Some(t), Some(u)) = (t, u) else {
                    assert!(flip.is_none() && smooth.is_none());
                    continue;
                };
                let third = |t: usize| {
                    surface.triangles[t]
                        .into_iter()
                        .find(|c| *c != a && *c != b)
                };
                let (c, d) = (third(t).unwrap(), third(u).unwrap());
                let mut after = surface.clone();
                (after.triangles[t], after.triangles[u]) = ([a, d, c], [b, c, d]);
                let possible = topology::check(&after).is_ok();
                assert_eq!(flip.is_some(), possible);
                let normals = [t, u].map(|t| after.area_normal(t));
                let before = surface.area_normal(t) + surface.area_normal(u);
                let faces = possible && normals.iter().all(|n| n.dot(&before) > 0.0);
                assert_eq!(smooth.is_some(), faces);
                seen[0][usize::from(possible)] += 1;
                let Some(flip) = flip else { continue };
                seen[1][usize::from(faces)] += 1;
                assert_eq!(
                    flip.new.map(stored),
                    [after.triangles[t], after.triangles[u]]
                );
                assert_eq!(flip.old.map(FaceId::index), [t, u]);
                let intersects = !self_intersections(&after).is_empty();
                assert_eq!(flip.intersects(&mesh), intersects);
                seen[2][usize::from(intersects)] += 1;
                let shapes: Vec<f64> = after.radius_ratios().collect();
                assert!((flip.shape - shapes[t].min(shapes[u])).abs() < 1e-12);
            }
        }
    }
    assert!(seen.iter().flatten().all(|n| *n > 20), "{seen:?}");
}

#[test]
fn spokes_chords_and_rim_are_all_pairs_of_a_star() {
    let mesh = patchwork(&shapes::icosphere(30.0, 1));
    for v in VertexId::first(42) {
        let ring = mesh.star(v).ring;
        let sorted = |[a, b]: [VertexId; 2]| [a.min(b), a.max(b)];
        let mut all = Vec::new();
        for (edges, kind) in [(spokes(v, &ring), 0), (rim(&ring), 1), (chords(&ring), 2)] {
            for edge in edges {
                assert_eq!(kind == 0, edge.contains(&v));
                // On this surface no chord is an edge.
                assert_eq!(kind < 2, mesh.has_edge(edge[0], edge[1]));
                all.push(sorted(edge));
            }
        }
        let count = all.len();
        all.sort_unstable();
        all.dedup();
        let m = ring.len() + 1;
        assert_eq!((all.len(), count), (m * (m - 1) / 2, m * (m - 1) / 2));
        assert!(all.iter().flatten().all(|w| *w == v || ring.contains(w)));
    }
}

fn edges(mesh: &Patchwork) -> BTreeSet<[VertexId; 2]> {
    let triangles = mesh.live_triangles();
    let sides = triangles.flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]);
    sides.map(|[a, b]| [a.min(b), a.max(b)]).collect()
}

/// Where edges of all three kinds can be flipped, spokes come first in even rounds, and in every other odd round
/// the chords or the rim. Of edges of one kind the one is flipped that gives the best shapes.
#[test]
fn rounds_of_flips_begin_with_other_edges_in_turn() {
    let mut seen = 0;
    for surface in awkward() {
        for v in VertexId::first(surface.vertices.len()) {
            let before = patchwork(&surface);
            let ring = before.star(v).ring;
            let best = |edges: Vec<[VertexId; 2]>| {
                let flips = edges
                    .into_iter()
                    .filter_map(|[a, b]| EdgeFlip::new(&before, a, b, Demand::Embedded))
                    .filter(|flip| !flip.intersects(&before));
                flips.max_by(|f, g| f.shape.total_cmp(&g.shape).then(g.edge.cmp(&f.edge)))
            };
            let kinds = [spokes(v, &ring), chords(&ring), rim(&ring)].map(best);
            let [Some(spoke), Some(chord), Some(side)] = kinds else {
                continue;
            };
            seen += 1;
            for turn in 0..MAX_FLIP_ROUNDS {
                let mut mesh = patchwork(&surface);
                flip_round(&mut mesh, &[v], Demand::Embedded, turn, &Monitor::silent()).unwrap();
                let expected = match turn % 4 {
                    0 | 2 => spoke.edge,
                    1 => chord.edge,
                    _ => side.edge,
                };
                let [a, b] = expected;
                let gone: Vec<_> = edges(&before).difference(&edges(&mesh)).copied().collect();
                assert_eq!(gone, [[a.min(b), a.max(b)]], "{turn}");
            }
        }
    }
    assert!(seen > 5, "{seen}");
}

/// Without spokes that can be flipped, other edges are, whatever the round.
#[test]
fn a_round_of_flips_takes_what_there_is() {
    for surface in awkward() {
        for v in VertexId::first(surface.vertices.len()) {
            let before = patchwork(&surface);
            let ring = before.star(v).ring;
            let any = [spokes(v, &ring), chords(&ring), rim(&ring)]
                .concat()
                .into_iter()
                .filter_map(|[a, b]| EdgeFlip::new(&before, a, b, Demand::Smooth))
                .any(|flip| !flip.intersects(&before));
            for turn in 0..4 {
                let mut mesh = patchwork(&surface);
                flip_round(&mut mesh, &[v], Demand::Smooth, turn, &Monitor::silent()).unwrap();
                assert_eq!(mesh.clock(), u64::from(any));
            }
        }
    }
}

#[test]
fn a_failure_holds_until_its_ring_or_what_blocked_it_changes() {
    let mut mesh = patchwork(&shapes::icosphere(30.0, 2));
    let star = mesh.star(VertexId(0));
    let far = |mesh: &Patchwork, n: u32| {
        let v = VertexId(mesh.positions.len() as u32 - n);
        assert!(mesh.star(v).ring.iter().all(|w| !star.ring.contains(w)));
        mesh.star(v)
    };
    let remove = |mesh: &mut Patchwork, star: &Star| {
        let new = hole::close(mesh, star, Demand::Embedded).unwrap();
        mesh.replace(&star.triangles, &new);
    };
    let failure = |mesh: &Patchwork, demand, blockers| FailedClosing {
        clock: mesh.clock(),
        demand,
        blockers,
    };
    let blocked = failure(&mesh, Demand::Smooth, far(&mesh, 1).triangles);
    let free = failure(&mesh, Demand::Embedded, Vec::new());
    assert!(blocked.still_holds(&mesh, &star, Demand::Smooth));
    assert!(!blocked.still_holds(&mesh, &star, Demand::Embedded));
    assert!(free.still_holds(&mesh, &star, Demand::Smooth));
    assert!(free.still_holds(&mesh, &star, Demand::Embedded));
    let (first, second) = (far(&mesh, 1), far(&mesh, 40));
    remove(&mut mesh, &second);
    assert!(blocked.still_holds(&mesh, &star, Demand::Smooth));
    remove(&mut mesh, &first);
    assert!(!blocked.still_holds(&mesh, &star, Demand::Smooth));
    assert!(free.still_holds(&mesh, &star, Demand::Embedded));
    // A vertex next to one of the ring.
    let beside = mesh.star(star.ring[2]).ring;
    let beside = beside
        .into_iter()
        .find(|w| w.0 != 0 && !star.ring.contains(w));
    let beside = mesh.star(beside.unwrap());
    remove(&mut mesh, &beside);
    assert!(!free.still_holds(&mesh, &star, Demand::Embedded));
}

/// None of the last four vertices can go: each costs one attempt, and no other until something changes.
#[test]
fn a_hole_that_stays_blocked_is_tried_once() {
    let mut mesh = patchwork(&shapes::tetrahedron(1.0));
    let mut removal = Removal {
        remaining: Vec::new(),
        attempts_left: 10,
        round: 1,
        touched: vec![0; 4],
        failures: BTreeMap::new(),
    };
    for left in [9, 9, 9] {
        assert!(!removal.remove(&mut mesh, VertexId(2), Demand::Embedded));
        assert_eq!(removal.attempts_left, left);
    }
    assert_eq!(removal.touched, [0; 4]);
    assert!(!removal.remove(&mut mesh, VertexId(1), Demand::Smooth));
    assert!(!removal.remove(&mut mesh, VertexId(1), Demand::Embedded));
    assert_eq!(removal.attempts_left, 7);
    removal.attempts_left = 0;
    assert!(!removal.remove(&mut mesh, VertexId(3), Demand::Embedded));
    assert_eq!(removal.attempts_left, 0);
}

/// With nothing to keep a tetrahedron is left of a ball, and its vertices are named in ascending order.
#[test]
fn what_cannot_be_removed_is_named_in_order() {
    let surface = jittered(&shapes::icosphere(30.0, 2), 1.0, 3);
    let mut mesh = patchwork(&surface);
    let stuck = remove_old_vertices(&mut mesh, 0, &Monitor::silent()).unwrap();
    let mut left: Vec<VertexId> = mesh.live_triangles().flatten().collect();
    left.sort_unstable();
    left.dedup();
    assert_eq!(left.len(), 4);
    assert_eq!(stuck, left);
}
