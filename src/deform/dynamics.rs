//! The motion of the model: implicit Euler steps until nothing moves.
//!
//! Node i has mass m_i = mass · area share, velocity v, and feels damping g, the elastic
//! forces and its sensors: Σ share · weight · (n n^T)(target - x), spread by barycentric
//! coordinates. A step of length dt solves
//!
//! ```text
//! (M/dt² + g M/dt + K + J^T W J) x' = (M/dt² + g M/dt) x + M v/dt + targets
//! ```
//!
//! Sensors look anew before every step; their reach falls step by step from far to near, and
//! then their answers are averaged until they are certain.
//! The implicit step is stable for any dt, so the motion ends because it has converged, or
//! because the limit of steps is reached, and the result says which.

use super::elastic::{Elastic, area_shares};
use super::sensors::{self, Look, PER_TRIANGLE, Reading};
use crate::geometry::Vec3;
use crate::grid::field::Field;
use crate::mesh::TriMesh;
use crate::numeric::conjugate_gradient::BlockMatrix;
use crate::progress::{Cancelled, Monitor};

/// Why the motion ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// No node moves farther than the tolerance any more.
    Converged,
    /// The energy has not fallen for 20 steps: sensors change their minds to and fro.
    Stalled,
    /// The limit of steps was reached first.
    MaxIterations,
    /// A position was no longer finite or left the neighbourhood; the last sound state is
    /// returned.
    Diverged,
}

impl StopReason {
    /// The name in reports.
    pub fn as_str(self) -> &'static str {
        match self {
            StopReason::Converged => "converged",
            StopReason::Stalled => "stalled",
            StopReason::MaxIterations => "max_iterations",
            StopReason::Diverged => "diverged",
        }
    }
}

/// How the model moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Mass of the whole model against a sensor force of 1 per mm, in units of dt². Default
    /// 0.1.
    pub mass: f64,
    /// Damping, 1/dt. Default 1.
    pub damping: f64,
    /// Step length. Default 1.
    pub time_step: f64,
    /// Reach of the sensors at the end, mm. Default 6.
    pub last_reach: f64,
    /// Factor of the reach from step to step. Default 0.85.
    pub narrowing: f64,
    /// Largest move of a node that counts as rest, mm. Default 0.04, a hundredth of a
    /// usual voxel.
    pub tolerance: f64,
    /// Limit of steps. Default 100.
    pub max_iterations: usize,
}

impl Default for Motion {
    fn default() -> Self {
        Self {
            mass: 0.1,
            damping: 1.0,
            time_step: 1.0,
            last_reach: 6.0,
            narrowing: 0.85,
            tolerance: 0.04,
            max_iterations: 100,
        }
    }
}

/// How the motion went.
#[derive(Debug, Clone)]
pub struct Moved {
    /// The model at rest.
    pub mesh: TriMesh,
    /// Why the motion ended.
    pub reason: StopReason,
    /// Steps made.
    pub iterations: usize,
    /// Largest move in the last step, mm.
    pub last_move: f64,
    /// Energy (elastic, sensors, motion) before each step, mm².
    pub energy: Vec<f64>,
    /// What the sensors see at the end.
    pub readings: Vec<Reading>,
}

/// Lets `body` move in `field` from `start`.
///
/// # Errors
/// [`Cancelled`].
pub fn run(
    start: &TriMesh,
    body: &Elastic,
    field: &Field,
    look: &Look,
    motion: &Motion,
    monitor: &Monitor,
) -> Result<Moved, Cancelled> {
    let mut state = State::new(start, body, motion);
    let mut memory = Memory::default();
    let mut reach = look.reach;
    let mut energies: Vec<f64> = Vec::new();
    let mut lowest = (f64::INFINITY, 0);
    let mut reason = StopReason::MaxIterations;
    let mut last_move = f64::INFINITY;
    for _ in 0..motion.max_iterations {
        monitor.check()?;
        let settled = reach <= motion.last_reach;
        if !memory.is_certain() {
            memory.hear(
                sensors::read(&state.mesh, field, &Look { reach, ..*look }, monitor)?,
                settled,
            );
        }
        let readings = memory.readings(&state.mesh);
        let energy =
            body.energy(&state.mesh.vertices) + sensor_energy(&readings) + state.kinetic_energy();
        energies.push(energy);
        let Some(farthest) = state.step(body, motion, &readings) else {
            reason = StopReason::Diverged;
            break;
        };
        last_move = farthest;
        reach = (reach * motion.narrowing).max(motion.last_reach);
        if settled && farthest < motion.tolerance {
            reason = StopReason::Converged;
            break;
        }
        let now = energies.len();
        if !settled || energy < lowest.0 * (1.0 - 1e-4) {
            lowest = (energy, now);
        } else if now - lowest.1 >= 20 {
            reason = StopReason::Stalled;
            break;
        }
    }
    let readings = sensors::read(&state.mesh, field, &Look { reach, ..*look }, monitor)?;
    Ok(Moved {
        mesh: state.mesh,
        reason,
        iterations: energies.len(),
        last_move,
        energy: energies,
        readings,
    })
}

/// What the sensors have said so far. Noise lets some of them waver between two edges for
/// ever; once the reach has come to its end, each new answer therefore counts less than the
/// one before it (1, 1/2, 1/3, ...: the mean of all answers), and after [`ANSWERS`] of them
/// the edges are known and the model comes to rest on them.
#[derive(Default)]
struct Memory {
    answers: Vec<Reading>,
    /// Mean edge point of each answer.
    edges: Vec<Vec3>,
    count: usize,
}

/// Answers after which the mean is taken for certain.
const ANSWERS: usize = 12;

impl Memory {
    fn is_certain(&self) -> bool {
        self.count >= ANSWERS
    }

    fn hear(&mut self, mut readings: Vec<Reading>, settled: bool) {
        self.count = if settled { self.count + 1 } else { 1 };
        let share = 1.0 / self.count as f64;
        if self.answers.is_empty() {
            self.answers.clone_from(&readings);
            self.edges = vec![Vec3::zeros(); readings.len()];
        }
        for (i, r) in readings.iter_mut().enumerate() {
            let edge = &mut self.edges[i];
            *edge += (r.place + r.normal * r.offset - *edge) * share;
            let before = self.answers[i].weight;
            r.weight = before + (r.weight - before) * share;
        }
        self.answers = readings;
    }

    /// The answers as seen from where the model is now.
    fn readings(&self, mesh: &TriMesh) -> Vec<Reading> {
        let weights = sensors::barycentric();
        let place = |i: usize| {
            let corners = mesh.corners(i / PER_TRIANGLE);
            let w = weights[i % PER_TRIANGLE];
            corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2]
        };
        let seen = |(i, r): (usize, &Reading)| {
            let place = place(i);
            Reading {
                place,
                offset: r.normal.dot(&(self.edges[i] - place)),
                ..*r
            }
        };
        self.answers.iter().enumerate().map(seen).collect()
    }
}

fn sensor_energy(readings: &[Reading]) -> f64 {
    readings
        .iter()
        .map(|r| 0.5 * r.share * r.weight * r.offset * r.offset)
        .sum()
}

/// Positions, velocities and what a step needs again and again.
struct State {
    mesh: TriMesh,
    velocity: Vec<Vec3>,
    masses: Vec<f64>,
    constant: BlockMatrix,
    matrix: BlockMatrix,
    /// For each triangle the slots of its nine pairs of corners.
    slots: Vec<[usize; 9]>,
    origin: Vec<Vec3>,
}

impl State {
    fn new(start: &TriMesh, body: &Elastic, motion: &Motion) -> Self {
        let nodes = start.vertices.len();
        let masses: Vec<f64> = area_shares(start).iter().map(|s| s * motion.mass).collect();
        let mut constant = BlockMatrix::with_pattern(nodes, body.pairs());
        body.add_matrix(&mut constant);
        let inertia = 1.0 / motion.time_step.powi(2) + motion.damping / motion.time_step;
        for (node, mass) in masses.iter().enumerate() {
            constant.add_mass(node as u32, mass * inertia);
        }
        let slots = start
            .triangles
            .iter()
            .map(|t| std::array::from_fn(|s| constant.slot(t[s / 3], t[s % 3])))
            .collect();
        Self {
            mesh: start.clone(),
            velocity: vec![Vec3::zeros(); nodes],
            masses,
            matrix: constant.clone(),
            constant,
            slots,
            origin: start.vertices.clone(),
        }
    }

    fn kinetic_energy(&self) -> f64 {
        let pairs = self.velocity.iter().zip(&self.masses);
        pairs.map(|(v, m)| 0.5 * m * v.norm_squared()).sum()
    }

    /// One step; the largest move, or `None` (and no step) where it leads nowhere sound.
    fn step(&mut self, body: &Elastic, motion: &Motion, readings: &[Reading]) -> Option<f64> {
        let dt = motion.time_step;
        let inertia = 1.0 / (dt * dt) + motion.damping / dt;
        let old = &self.mesh.vertices;
        let mut rhs: Vec<Vec3> = (0..old.len())
            .map(|i| (old[i] * inertia + self.velocity[i] / dt) * self.masses[i])
            .collect();
        body.add_targets(old, &mut rhs);
        self.matrix.copy_from(&self.constant);
        let weights = sensors::barycentric();
        for (t, group) in readings.chunks_exact(PER_TRIANGLE).enumerate() {
            let triangle = self.mesh.triangles[t];
            for (r, w) in group.iter().zip(&weights) {
                let pull = r.share * r.weight;
                let outer = r.normal * r.normal.transpose() * pull;
                for slot in 0..9 {
                    *self.matrix.at_mut(self.slots[t][slot]) += outer * (w[slot / 3] * w[slot % 3]);
                }
                let target = outer * (r.place + r.normal * r.offset);
                for corner in 0..3 {
                    rhs[triangle[corner] as usize] += target * w[corner];
                }
            }
        }
        let mut new = old.clone();
        self.matrix.solve(&rhs, &mut new, 1e-7, 60);
        let wild = |(p, o): (&Vec3, &Vec3)| !((p - o).norm() < 200.0);
        if new.iter().zip(&self.origin).any(wild) {
            return None;
        }
        let mut farthest = 0f64;
        for (i, p) in new.iter().enumerate() {
            let moved = p - self.mesh.vertices[i];
            farthest = farthest.max(moved.norm());
            self.velocity[i] = moved / dt;
        }
        self.mesh.vertices = new;
        Some(farthest)
    }
}
