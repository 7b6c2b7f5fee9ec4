//! Step two: the old vertices go, one by one.
//!
//! In rounds: the vertices that are left are taken in ascending order of valence, then id; one
//! whose neighbour went in the same round waits for the next, so that the surface thins out
//! evenly and log n rounds suffice. Every hole is closed by [`hole::close`] under the
//! strictest [`Demand`]. A round without any removal first lifts the limit of valence, then
//! flips an edge at every vertex that is stuck, which lowers its valence, and then lowers the
//! demand; any removal brings the strictest demand back.
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

/// What a round may do; on failure the next one of the ladder.
#[derive(Debug, Clone, Copy)]
struct Rung {
    demand: Demand,
    any_valence: bool,
    flip_rounds: usize,
}

impl Rung {
    const FIRST: Self = Self {
        demand: Demand::Smooth,
        any_valence: false,
        flip_rounds: 0,
    };

    /// The next rung, after a round without a removal; `flipped` says whether the flips that
    /// precede it changed anything.
    fn next(self, flipped: bool) -> Option<Self> {
        if !self.any_valence {
            return Some(Self {
                any_valence: true,
                ..self
            });
        }
        if flipped && self.flip_rounds < MOST_FLIP_ROUNDS {
            return Some(Self {
                flip_rounds: self.flip_rounds + 1,
                ..self
            });
        }
        let demand = match self.demand {
            Demand::Smooth => Demand::Embedded,
            Demand::Embedded => Demand::Topology,
            Demand::Topology => return None,
        };
        Some(Self {
            demand,
            any_valence: true,
            flip_rounds: 0,
        })
    }
}

/// Removes all vertices from `kept` on. Returns those that could not be removed, ascending.
pub(super) fn remove_old_vertices(
    mesh: &mut Patchwork,
    kept: u32,
    monitor: &Monitor,
) -> Result<Vec<u32>, Cancelled> {
    let mut left: Vec<u32> = (kept..mesh.positions.len() as u32).collect();
    let mut touched = vec![0u32; mesh.positions.len()];
    let mut rung = Rung::FIRST;
    for round in 1.. {
        let before = left.len();
        left = remove_round(mesh, left, &mut touched, round, rung, monitor)?;
        if left.is_empty() {
            break;
        }
        if left.len() < before {
            rung = Rung::FIRST;
            continue;
        }
        let flipped = rung.any_valence && flip_round(mesh, &left, rung.demand, monitor)?;
        match rung.next(flipped) {
            Some(next) => rung = next,
            None => break,
        }
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

/// Flips the best legal edge at every stuck vertex; says whether there was any.
fn flip_round(
    mesh: &mut Patchwork,
    stuck: &[u32],
    demand: Demand,
    monitor: &Monitor,
) -> Result<bool, Cancelled> {
    let mut flipped = false;
    for &v in stuck {
        monitor.check()?;
        if mesh.valence(v) < 4 {
            continue;
        }
        let best = mesh
            .star(v)
            .ring
            .iter()
            .filter_map(|&w| Flip::new(mesh, v, w, demand))
            .max_by(|f, g| f.shape.total_cmp(&g.shape).then(g.edge.cmp(&f.edge)));
        if let Some(flip) = best {
            mesh.replace(&flip.old, &flip.new);
            flipped = true;
        }
    }
    Ok(flipped)
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
