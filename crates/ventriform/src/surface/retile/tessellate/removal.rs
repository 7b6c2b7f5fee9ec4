//! Step two: removes the old vertices, one by one.
//!
//! In: the mutual tessellation. Out: the same mesh without old vertices, or those that could not
//! be removed. The method works in rounds. Each round visits the remaining old vertices in
//! ascending order of valence, then number. A vertex with a neighbour that was removed in the
//! same round waits for the next, so that the surface is thinned out evenly and log n rounds
//! suffice. Every hole is closed by [`hole::close`] under the strictest [`Demand`]. After a round
//! without a removal the next step of the [`schedule`] applies: longer rings, triangles that may
//! turn, edge flips at the vertices that are stuck. After a removal the demand is strict again.
//!
//! Guaranteed: a hole is a disc and is closed by a disc whose inner edges are new, so the mesh
//! stays closed and oriented with the same genus and components, and an embedded surface stays
//! embedded. (An alternative, to allow intersections where nothing else helps and to repair them
//! by flips later, saved only 2 of 183 surfaces on which it was tried.)

use std::collections::BTreeMap;

use super::hole::{self, Demand};
use super::patchwork::{Patchwork, Star};
use crate::base::geometry::{Vec3, triangle};
use crate::base::progress::{Cancelled, Monitor};
use crate::mesh::intersections::triangles_intersect;
use crate::mesh::{FaceId, VertexId};

/// Vertices of higher valence wait until nothing else can be removed: their rings are long and
/// become shorter as neighbours are removed.
const HIGH_VALENCE: usize = 14;

/// Number of successive rounds with flips under each demand.
const MAX_FLIP_ROUNDS: usize = 12;

/// The limits of a round.
#[derive(Debug, Clone, Copy)]
struct RoundRules {
    /// The demand on triangles that close holes.
    demand: Demand,
    /// Whether vertices of high valence may be removed.
    any_valence: bool,
    /// The demand on flips before the round; `None` for no flips.
    flips: Option<Demand>,
}

/// The last step of the schedule without flips.
const LAST_WITHOUT_FLIPS: usize = 2;

/// The rules of the rounds, from strict to lenient. A round without a removal is followed by the
/// next step, one with a removal by a step without flips.
fn schedule() -> Vec<RoundRules> {
    let rules = |demand, any_valence, flips| RoundRules {
        demand,
        any_valence,
        flips,
    };
    let mut schedule = vec![
        rules(Demand::Smooth, false, None),
        rules(Demand::Smooth, true, None),
        rules(Demand::Embedded, true, None),
    ];
    for flips in [Demand::Smooth, Demand::Embedded] {
        schedule.extend([rules(Demand::Embedded, true, Some(flips)); MAX_FLIP_ROUNDS]);
    }
    schedule
}

/// Number of failed attempts to close a hole, per old vertex and in addition, after which the
/// schedule is only followed to its end. Without it the method would not end where walls are
/// thinner than the points' spacing. Of 145 surfaces on which it succeeded, the hardest took .85
/// attempts per old vertex.
const FAILED_ATTEMPTS: [usize; 2] = [2, 1000];

/// Removes all vertices from number `kept` on. Returns those that could not be removed,
/// ascending.
pub(super) fn remove_old_vertices(
    mesh: &mut Patchwork,
    kept: usize,
    monitor: &Monitor,
) -> Result<Vec<VertexId>, Cancelled> {
    let remaining: Vec<VertexId> = VertexId::first(mesh.positions.len()).skip(kept).collect();
    let mut removal = Removal {
        attempts_left: FAILED_ATTEMPTS[0] * remaining.len() + FAILED_ATTEMPTS[1],
        remaining,
        round: 0,
        touched: vec![0; mesh.positions.len()],
        failures: BTreeMap::new(),
    };
    let schedule = schedule();
    let mut step = 0;
    while let Some(rules) = schedule.get(step) {
        if let Some(demand) = rules.flips {
            flip_round(mesh, &removal.remaining, demand, step, monitor)?;
        }
        let before = removal.remaining.len();
        removal.run_round(mesh, *rules, monitor)?;
        if removal.remaining.is_empty() {
            break;
        }
        let progress = removal.remaining.len() < before && removal.attempts_left > 0;
        step = if progress {
            step.min(LAST_WITHOUT_FLIPS)
        } else {
            step + 1
        };
    }
    removal.remaining.sort_unstable();
    Ok(removal.remaining)
}

struct Removal {
    /// Old vertices that have not been removed yet.
    remaining: Vec<VertexId>,
    /// Number of attempts that may still fail.
    attempts_left: usize,
    round: u32,
    /// For each vertex the last round in which a neighbour was removed.
    touched: Vec<u32>,
    /// The last failure at each vertex.
    failures: BTreeMap<VertexId, FailedClosing>,
}

/// A hole that could not be closed, and what must change before another attempt.
struct FailedClosing {
    clock: u64,
    demand: Demand,
    blockers: Vec<FaceId>,
}

impl FailedClosing {
    /// Whether another attempt under `demand` would fail again.
    fn still_holds(&self, mesh: &Patchwork, star: &Star, demand: Demand) -> bool {
        demand <= self.demand
            && star.ring.iter().all(|&w| mesh.changed(w) <= self.clock)
            && self
                .blockers
                .iter()
                .all(|&t| mesh.replaced(t) <= self.clock)
    }
}

impl Removal {
    /// Tries to remove each of the remaining vertices once.
    fn run_round(
        &mut self,
        mesh: &mut Patchwork,
        rules: RoundRules,
        monitor: &Monitor,
    ) -> Result<(), Cancelled> {
        self.round += 1;
        self.remaining.sort_by_cached_key(|&v| (mesh.valence(v), v));
        let mut remaining = Vec::new();
        for v in std::mem::take(&mut self.remaining) {
            monitor.check()?;
            let waits = self.touched[v.index()] == self.round
                || (!rules.any_valence && mesh.valence(v) > HIGH_VALENCE);
            if waits || !self.remove(mesh, v, rules.demand) {
                remaining.push(v);
            }
        }
        self.remaining = remaining;
        Ok(())
    }

    /// Removes `v` if its hole can be closed. Returns whether it could.
    fn remove(&mut self, mesh: &mut Patchwork, v: VertexId, demand: Demand) -> bool {
        let star = mesh.star(v);
        let known = self.failures.get(&v);
        if known.is_some_and(|failure| failure.still_holds(mesh, &star, demand)) {
            return false;
        }
        match hole::close(mesh, &star, demand) {
            Ok(new) => mesh.replace(&star.triangles, &new),
            Err(blocked) => {
                self.attempts_left = self.attempts_left.saturating_sub(1);
                let failure = FailedClosing {
                    clock: mesh.clock(),
                    demand,
                    blockers: blocked.by,
                };
                self.failures.insert(v, failure);
                return false;
            }
        }
        for neighbour in star.ring {
            self.touched[neighbour.index()] = self.round;
        }
        true
    }
}

/// Flips one edge near every stuck vertex, if possible. In odd rounds (`turn`) other edges than
/// the spokes come first, chords and rim by turns, so that the same edges are not flipped back and
/// forth.
fn flip_round(
    mesh: &mut Patchwork,
    stuck: &[VertexId],
    demand: Demand,
    turn: usize,
    monitor: &Monitor,
) -> Result<(), Cancelled> {
    for &v in stuck {
        monitor.check()?;
        let ring = mesh.star(v).ring;
        let kinds = [spokes(v, &ring), chords(&ring), rim(&ring)];
        let first = if turn % 2 == 1 { 1 + turn / 2 % 2 } else { 0 };
        let best = (0..kinds.len())
            .find_map(|k| best_flip(mesh, &kinds[(first + k) % kinds.len()], demand));
        if let Some(flip) = best {
            mesh.replace(&flip.old, &flip.new);
        }
    }
    Ok(())
}

/// The flip that results in the best shapes, of those that the demand admits.
fn best_flip(mesh: &Patchwork, edges: &[[VertexId; 2]], demand: Demand) -> Option<EdgeFlip> {
    let mut flips: Vec<EdgeFlip> = edges
        .iter()
        .filter_map(|&[v, w]| EdgeFlip::new(mesh, v, w, demand))
        .collect();
    flips.sort_by(|f, g| g.shape.total_cmp(&f.shape).then(f.edge.cmp(&g.edge)));
    // The intersection test takes longest, so it comes last.
    flips.into_iter().find(|flip| !flip.intersects(mesh))
}

/// The edges from `v` to its ring: flipping one lowers the valence of `v`.
fn spokes(v: VertexId, ring: &[VertexId]) -> Vec<[VertexId; 2]> {
    ring.iter().map(|&w| [v, w]).collect()
}

/// The pairs of neighbours that may be joined by an edge outside the star, so that none inside
/// is possible. At the narrowest part of a handle such edges are the only obstacle.
fn chords(ring: &[VertexId]) -> Vec<[VertexId; 2]> {
    let m = ring.len();
    (0..m)
        .flat_map(|i| (i + 2..m).map(move |j| (i, j)))
        .filter(|(i, j)| (*i, *j) != (0, m - 1))
        .map(|(i, j)| [ring[i], ring[j]])
        .collect()
}

/// The edges opposite to `v`: flipping one changes the shape of the hole.
fn rim(ring: &[VertexId]) -> Vec<[VertexId; 2]> {
    let m = ring.len();
    (0..m).map(|i| [ring[i], ring[(i + 1) % m]]).collect()
}

/// A flip that keeps the topology.
struct EdgeFlip {
    old: [FaceId; 2],
    new: [[VertexId; 3]; 2],
    edge: [VertexId; 2],
    /// The smaller radius ratio 2r/R of the two new triangles.
    shape: f64,
}

impl EdgeFlip {
    /// The flip of edge `v w`, or `None` if it would change the topology or, under
    /// [`Demand::Smooth`], turn a triangle over. [`EdgeFlip::intersects`] tests intersections.
    fn new(mesh: &Patchwork, v: VertexId, w: VertexId, demand: Demand) -> Option<Self> {
        let (t0, c) = mesh.triangle_along(v, w)?;
        let (t1, d) = mesh.triangle_along(w, v)?;
        if c == d || mesh.has_edge(c, d) || mesh.valence(v) < 4 || mesh.valence(w) < 4 {
            return None;
        }
        let (old, new) = ([t0, t1], [[v, d, c], [w, c, d]]);
        let corners = new.map(|t| mesh.corners(t));
        let normal = |[a, b, c]: &[Vec3; 3]| triangle::area_normal(a, b, c);
        if demand == Demand::Smooth {
            let before = old.map(|t| normal(&mesh.corners(mesh.triangle(t))));
            let mean = before[0] + before[1];
            if corners.iter().any(|c| !(normal(c).dot(&mean) > 0.0)) {
                return None;
            }
        }
        let shape = corners
            .iter()
            .map(|[a, b, c]| triangle::radius_ratio(a, b, c))
            .fold(1.0, f64::min);
        Some(Self {
            old,
            new,
            edge: [v, w],
            shape,
        })
    }

    /// Whether the new triangles intersect others or each other.
    fn intersects(&self, mesh: &Patchwork) -> bool {
        let [s, t] = self.new;
        mesh.intersects(s, &self.old)
            || mesh.intersects(t, &self.old)
            || triangles_intersect(s, &mesh.corners(s), t, &mesh.corners(t))
    }
}

#[cfg(test)]
mod tests;
