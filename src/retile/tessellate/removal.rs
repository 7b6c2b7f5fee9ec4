//! Step two: the old vertices go, one by one.
//!
//! In rounds: the vertices that are left are taken in ascending order of valence, then id; one
//! whose neighbour went in the same round waits for the next, so that the surface thins out
//! evenly and log n rounds suffice. Every hole is closed by [`hole::close`] under the
//! strictest [`Demand`]. A round without any removal steps down the [`ladder`]: longer rings,
//! triangles that may turn, edges flipped at the vertices that are stuck, and only then
//! triangles that may pierce each other. Any removal brings the strictest demand back.
//!
//! A hole is a disc and is closed by a disc whose inner edges are new: closedness, orientation,
//! genus and components cannot change. As long as the lowest demand is not needed, neither
//! can an embedded surface come to cut itself.

use super::hole::{self, Demand};
use super::patchwork::Patchwork;
use crate::geometry::triangle;
use crate::mesh::intersections::triangles_intersect;
use crate::progress::{Cancelled, Monitor};

/// Vertices of higher valence wait until nothing else moves: their rings are long, and they
/// shrink as the neighbours go.
const HIGH_VALENCE: usize = 14;

/// Rounds of flips that each demand gets without a removal in between.
const MOST_FLIP_ROUNDS: usize = 12;

/// What a round may do.
#[derive(Debug, Clone, Copy)]
struct Rung {
    demand: Demand,
    any_valence: bool,
    /// What flips must satisfy that precede the round, if there are any.
    flips: Option<Demand>,
}

/// From strict to lenient: a round without a removal steps down, a removal leads back up.
fn ladder() -> Vec<Rung> {
    let rung = |demand, any_valence, flips| Rung {
        demand,
        any_valence,
        flips,
    };
    let mut ladder = vec![
        rung(Demand::Smooth, false, None),
        rung(Demand::Smooth, true, None),
        rung(Demand::Embedded, true, None),
    ];
    for flips in [Demand::Smooth, Demand::Embedded] {
        ladder.extend([rung(Demand::Embedded, true, Some(flips)); MOST_FLIP_ROUNDS]);
    }
    ladder.push(rung(Demand::Topology, true, None));
    ladder.extend([rung(Demand::Topology, true, Some(Demand::Topology)); MOST_FLIP_ROUNDS]);
    ladder
}

/// Removes all vertices from `kept` on. Returns those that could not be removed, ascending.
pub(super) fn remove_old_vertices(
    mesh: &mut Patchwork,
    kept: u32,
    monitor: &Monitor,
) -> Result<Vec<u32>, Cancelled> {
    let mut left: Vec<u32> = (kept..mesh.positions.len() as u32).collect();
    let mut touched = vec![0u32; mesh.positions.len()];
    let ladder = ladder();
    let mut step = 0;
    for round in 1.. {
        let Some(rung) = ladder.get(step) else { break };
        if let Some(demand) = rung.flips {
            flip_round(mesh, &left, demand, step % MOST_FLIP_ROUNDS, monitor)?;
        }
        let before = left.len();
        left = remove_round(mesh, left, &mut touched, round, *rung, monitor)?;
        if left.is_empty() {
            break;
        }
        step = if left.len() < before { 0 } else { step + 1 };
    }
    left.sort_unstable();
    Ok(left)
}

/// One round over the vertices `left`; returns what is left after it.
fn remove_round(
    mesh: &mut Patchwork,
    mut left: Vec<u32>,
    touched: &mut [u32],
    round: u32,
    rung: Rung,
    monitor: &Monitor,
) -> Result<Vec<u32>, Cancelled> {
    left.sort_by_cached_key(|&v| (mesh.valence(v), v));
    let mut remaining = Vec::new();
    for (count, v) in left.into_iter().enumerate() {
        if count % 64 == 0 {
            monitor.check()?;
        }
        let waits =
            touched[v as usize] == round || (!rung.any_valence && mesh.valence(v) > HIGH_VALENCE);
        if waits || !remove(mesh, v, touched, round, rung.demand) {
            remaining.push(v);
        }
    }
    Ok(remaining)
}

fn remove(mesh: &mut Patchwork, v: u32, touched: &mut [u32], round: u32, demand: Demand) -> bool {
    let star = mesh.star(v);
    let Some(new) = hole::close(mesh, &star, demand) else {
        return false;
    };
    mesh.replace(&star.triangles, &new);
    for neighbour in star.ring {
        touched[neighbour as usize] = round;
    }
    true
}

/// Flips an edge at every stuck vertex that has one to flip. In odd rounds (`turn`) other edges
/// than the spokes come first, lest the same ones flip to and fro.
fn flip_round(
    mesh: &mut Patchwork,
    stuck: &[u32],
    demand: Demand,
    turn: usize,
    monitor: &Monitor,
) -> Result<(), Cancelled> {
    for &v in stuck {
        monitor.check()?;
        let ring = mesh.star(v).ring;
        let kinds = [spokes(v, &ring), chords(&ring), rim(&ring)];
        let first = if turn % 2 == 1 { 1 + turn / 2 % 2 } else { 0 };
        let best = (0..kinds.len()).find_map(|k| {
            kinds[(first + k) % kinds.len()]
                .iter()
                .filter_map(|&[a, b]| Flip::new(mesh, a, b, demand))
                .max_by(|f, g| f.shape.total_cmp(&g.shape).then(g.edge.cmp(&f.edge)))
        });
        if let Some(flip) = best {
            mesh.replace(&flip.old, &flip.new);
        }
    }
    Ok(())
}

/// The edges from `v` to its ring: flipping one lowers the valence of `v`.
fn spokes(v: u32, ring: &[u32]) -> Vec<[u32; 2]> {
    ring.iter().map(|&w| [v, w]).collect()
}

/// The pairs of neighbours that may be joined outside of the star, which forbids to join them
/// inside. On the throat of a handle nothing else is in the way.
fn chords(ring: &[u32]) -> Vec<[u32; 2]> {
    let m = ring.len();
    (0..m)
        .flat_map(|i| (i + 2..m).map(move |j| (i, j)))
        .filter(|(i, j)| (*i, *j) != (0, m - 1))
        .map(|(i, j)| [ring[i], ring[j]])
        .collect()
}

/// The edges opposite to `v`: flipping one changes the hole's form.
fn rim(ring: &[u32]) -> Vec<[u32; 2]> {
    let m = ring.len();
    (0..m).map(|i| [ring[i], ring[(i + 1) % m]]).collect()
}

/// An edge that may be flipped.
pub(super) struct Flip {
    pub(super) old: [u32; 2],
    pub(super) new: [[u32; 3]; 2],
    edge: [u32; 2],
    /// Worse radius ratio of the two new triangles.
    shape: f64,
}

impl Flip {
    /// The flip of edge `v w`, or `None` where it would break the mesh or the demand.
    pub(super) fn new(mesh: &Patchwork, v: u32, w: u32, demand: Demand) -> Option<Self> {
        let (t0, c) = mesh.triangle_along(v, w)?;
        let (t1, d) = mesh.triangle_along(w, v)?;
        if c == d || mesh.has_edge(c, d) || mesh.valence(v) < 4 || mesh.valence(w) < 4 {
            return None;
        }
        let (old, new) = ([t0, t1], [[v, d, c], [w, c, d]]);
        let corners = new.map(|t| mesh.corners(t));
        let normal = |[a, b, c]: &[crate::geometry::Vec3; 3]| triangle::area_normal(a, b, c);
        if demand == Demand::Smooth {
            let before = old.map(|t| normal(&mesh.corners(mesh.triangle(t))));
            let mean = before[0] + before[1];
            if corners.iter().any(|c| !(normal(c).dot(&mean) > 0.0)) {
                return None;
            }
        }
        let cuts = demand != Demand::Topology
            && (new.iter().any(|t| mesh.pierces(*t, &old))
                || triangles_intersect(new[0], &corners[0], new[1], &corners[1]));
        let shape = corners
            .iter()
            .map(|[a, b, c]| triangle::radius_ratio(a, b, c))
            .fold(1.0, f64::min);
        (!cuts).then_some(Self {
            old,
            new,
            edge: [v, w],
            shape,
        })
    }
}
