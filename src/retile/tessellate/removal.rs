//! Step two: the old vertices go, one by one.
//!
//! In rounds: the vertices that are left are taken in ascending order of valence, then id; one
//! whose neighbour went in the same round waits for the next, so that the surface thins out
//! evenly and log n rounds suffice. Every hole is closed by [`hole::close`] under the
//! strictest [`Demand`]. A round without any removal steps down the [`ladder`]: longer rings,
//! triangles that may turn, edges flipped at the vertices that are stuck. Any removal brings the
//! strictest demand back.
//!
//! A hole is a disc and is closed by a disc whose inner edges are new: closedness, orientation,
//! genus and components cannot change. Nor can an embedded surface come to cut itself. (To let
//! triangles pierce each other where nothing else helps, and to mend that by flips afterwards, saved 2
//! of 183 surfaces that came to it.)

use std::collections::BTreeMap;

use super::hole::{self, Demand};
use super::patchwork::{Patchwork, Star};
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

/// The ladder's last rung without flips.
const NO_FLIPS: usize = 2;

/// From strict to lenient: a round without a removal steps down; a removal leads back to
/// where flips are not needed.
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
    ladder
}

/// Holes that may be tried in vain before the way back up the ladder is closed, for each old
/// vertex and to begin with. Where walls are thinner than the points' spacing there would be
/// no end to trying; of 145 surfaces that went well the hardest took .85 tries for each old vertex.
const PATIENCE: [usize; 2] = [2, 1000];

/// Removes all vertices from `kept` on. Returns those that could not be removed, ascending.
pub(super) fn remove_old_vertices(
    mesh: &mut Patchwork,
    kept: u32,
    monitor: &Monitor,
) -> Result<Vec<u32>, Cancelled> {
    let left: Vec<u32> = (kept..mesh.positions.len() as u32).collect();
    let mut removal = Removal {
        patience: PATIENCE[0] * left.len() + PATIENCE[1],
        left,
        round: 0,
        touched: vec![0; mesh.positions.len()],
        failures: BTreeMap::new(),
    };
    let ladder = ladder();
    let mut step = 0;
    while let Some(rung) = ladder.get(step) {
        if let Some(demand) = rung.flips {
            let turn = step % MOST_FLIP_ROUNDS;
            flip_round(mesh, &removal.left, demand, turn, monitor)?;
        }
        let before = removal.left.len();
        removal.run_round(mesh, *rung, monitor)?;
        if removal.left.is_empty() {
            break;
        }
        let progress = removal.left.len() < before && removal.patience > 0;
        step = if progress {
            step.min(NO_FLIPS)
        } else {
            step + 1
        };
    }
    removal.left.sort_unstable();
    Ok(removal.left)
}

struct Removal {
    /// Old vertices that are left.
    left: Vec<u32>,
    /// Holes that may still be tried in vain.
    patience: usize,
    round: u32,
    /// The round in which a neighbour of the vertex went last.
    touched: Vec<u32>,
    /// The last failure at each vertex.
    failures: BTreeMap<u32, Failure>,
}

/// A hole that could not be closed, and what would have to change for another try to be worth
/// its while.
struct Failure {
    clock: u64,
    demand: Demand,
    blockers: Vec<u32>,
}

impl Failure {
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
    /// One round over what is left.
    fn run_round(
        &mut self,
        mesh: &mut Patchwork,
        rung: Rung,
        monitor: &Monitor,
    ) -> Result<(), Cancelled> {
        self.round += 1;
        self.left.sort_by_cached_key(|&v| (mesh.valence(v), v));
        let mut remaining = Vec::new();
        for (count, v) in std::mem::take(&mut self.left).into_iter().enumerate() {
            if count % 64 == 0 {
                monitor.check()?;
            }
            let waits = self.touched[v as usize] == self.round
                || (!rung.any_valence && mesh.valence(v) > HIGH_VALENCE);
            if waits || !self.remove(mesh, v, rung.demand) {
                remaining.push(v);
            }
        }
        self.left = remaining;
        Ok(())
    }

    fn remove(&mut self, mesh: &mut Patchwork, v: u32, demand: Demand) -> bool {
        let star = mesh.star(v);
        let known = self.failures.get(&v);
        if known.is_some_and(|failure| failure.still_holds(mesh, &star, demand)) {
            return false;
        }
        match hole::close(mesh, &star, demand) {
            Ok(new) => mesh.replace(&star.triangles, &new),
            Err(blocked) => {
                self.patience = self.patience.saturating_sub(1);
                let failure = Failure {
                    clock: mesh.clock(),
                    demand,
                    blockers: blocked.by,
                };
                self.failures.insert(v, failure);
                return false;
            }
        }
        for neighbour in star.ring {
            self.touched[neighbour as usize] = self.round;
        }
        true
    }
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
        let best = (0..kinds.len())
            .find_map(|k| best_flip(mesh, &kinds[(first + k) % kinds.len()], demand));
        if let Some(flip) = best {
            mesh.replace(&flip.old, &flip.new);
        }
    }
    Ok(())
}

/// The flip that leaves the best shape, of those that the demand admits.
fn best_flip(mesh: &Patchwork, edges: &[[u32; 2]], demand: Demand) -> Option<Flip> {
    let mut flips: Vec<Flip> = edges
        .iter()
        .filter_map(|&[v, w]| Flip::new(mesh, v, w, demand))
        .collect();
    flips.sort_by(|f, g| g.shape.total_cmp(&f.shape).then(f.edge.cmp(&g.edge)));
    // Asked last, for it costs most.
    flips.into_iter().find(|flip| !flip.pierces(mesh))
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
struct Flip {
    old: [u32; 2],
    new: [[u32; 3]; 2],
    edge: [u32; 2],
    /// Worse radius ratio of the two new triangles.
    shape: f64,
}

impl Flip {
    /// The flip of edge `v w`, or `None` where it would break the mesh or, under
    /// [`Demand::Smooth`], turn a triangle. Piercing is [`Flip::pierces`]' business.
    fn new(mesh: &Patchwork, v: u32, w: u32, demand: Demand) -> Option<Self> {
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

    /// Whether the new triangles pierce others or each other.
    fn pierces(&self, mesh: &Patchwork) -> bool {
        let [s, t] = self.new;
        mesh.pierces(s, &self.old)
            || mesh.pierces(t, &self.old)
            || triangles_intersect(s, &mesh.corners(s), t, &mesh.corners(t))
    }
}
