//! The motion of the model: implicit Euler steps until nothing moves.
//!
//! In go the model, its elastic body, the image and the settings of the sensors; out comes the
//! model at rest ([`run`]).
//!
//! Node i has mass m_i = mass · area share and velocity v. Damping g, the elastic forces and the
//! forces of the sensors act on it: Σ share · weight · (n n^T)(target - x), distributed by
//! barycentric coordinates. A step of length dt solves
//!
//! ```text
//! (M/dt² + g M/dt + K + J^T W J) x' = (M/dt² + g M/dt) x + M v/dt + targets
//! ```
//!
//! Sensors are read before every step. Their reach falls step by step, and while it does a third of them is read; when
//! it has reached its least value, readings are averaged, sensors that hardly move keep the edge that they saw, and
//! after 12 readings the mean is fixed. The implicit step
//! is stable for any dt, so the motion ends at rest, where it stalls, or at the limit of steps
//! ([`StopReason`]).

use super::elastic::{Elastic, Turns};
use super::sensors::{self, Density, SensorReading, SensorSettings};
use super::through::{self, HOLD_STIFFNESS, Hold, ThroughPoint};
use crate::base::geometry::Vec3;
use crate::base::numeric::block_matrix::BlockMatrix;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::model::area_shares;
use crate::image::grid::field::Field;
use crate::mesh::TriMesh;
use nalgebra::Matrix3;

/// Why the motion ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// No node moved farther than the tolerance in the last step.
    Converged,
    /// The energy has not fallen for 20 steps: sensors alternate between two edges.
    Stalled,
    /// The limit of steps was reached first.
    MaxIterations,
    /// A node moved by more than 200 mm or was no longer finite; the last valid state is returned.
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

/// Parameters of the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Mass of the whole model relative to a sensor force of 1 per mm, in units of dt². Default
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
    /// Greatest displacement of a node in a step that counts as rest, mm. Default 0.04, a
    /// hundredth of a usual voxel.
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

/// Result of the motion.
#[derive(Debug, Clone)]
pub struct MotionResult {
    /// The model at rest.
    pub mesh: TriMesh,
    /// Why the motion ended.
    pub reason: StopReason,
    /// Steps made.
    pub iterations: usize,
    /// Greatest displacement of a node in the last step, mm.
    pub last_move: f64,
    /// Energy (elastic, sensors, motion) before each step, mm².
    pub energy: Vec<f64>,
    /// The sensors' readings at the end.
    pub readings: Vec<SensorReading>,
}

/// Moves `body` in `field` from `start` until it rests, with its surface through `points`.
///
/// # Errors
/// [`Cancelled`].
pub fn run(
    start: &TriMesh,
    body: &Elastic,
    field: &Field,
    settings: &SensorSettings,
    points: &[ThroughPoint],
    motion: &Motion,
    monitor: &Monitor,
) -> Result<MotionResult, Cancelled> {
    let mut state = MotionState::new(start, body, motion);
    let mut mean = SensorMean::default();
    let mut known = Vec::new();
    let mut reach = settings.reach;
    let mut energies: Vec<f64> = Vec::new();
    let mut lowest = (f64::INFINITY, 0);
    let mut reason = StopReason::MaxIterations;
    let mut last_move = f64::INFINITY;
    for _ in 0..motion.max_iterations {
        monitor.check()?;
        let settled = reach <= motion.last_reach;
        if !mean.is_fixed() {
            let settings = SensorSettings { reach, ..*settings };
            let density = if settled {
                Density::Full
            } else {
                Density::Third
            };
            let readings = if settled {
                sensors::read_again(&state.mesh, field, &settings, &mut known, monitor)?
            } else {
                sensors::read_some(&state.mesh, field, &settings, density, monitor)?
            };
            mean.add(readings, density, settled);
        }
        let mut readings = mean.readings(&state.mesh);
        through::mute(&mut readings, &settings.shift, points);
        let holds = through::holds(&state.mesh, &settings.shift, points);
        let turns = body.turns(&state.mesh.vertices);
        let energy = body.energy_of(&state.mesh.vertices, &turns)
            + sensor_energy(&readings)
            + hold_energy(&holds)
            + state.kinetic_energy();
        energies.push(energy);
        let pulls = Pulls {
            readings: &readings,
            density: mean.density,
            holds: &holds,
        };
        let Some(farthest) = state.step(body, &turns, motion, &pulls) else {
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
    // Where the motion has settled, most sensors have hardly moved since they were read.
    let readings = sensors::read_again(
        &state.mesh,
        field,
        &SensorSettings { reach, ..*settings },
        &mut known,
        monitor,
    )?;
    Ok(MotionResult {
        mesh: state.mesh,
        reason,
        iterations: energies.len(),
        last_move,
        energy: energies,
        readings,
    })
}

/// The mean of the sensors' readings. Noise lets some sensors alternate between two edges for
/// ever. When the reach is at its least, each new reading therefore counts less than the one
/// before it (1, 1/2, 1/3, ...: the mean of all); after [`SETTLED_READINGS`] of them the edges are
/// fixed, and the model comes to rest on them.
#[derive(Default)]
struct SensorMean {
    last: Vec<SensorReading>,
    /// Mean edge point of each sensor.
    edges: Vec<Vec3>,
    density: Density,
    count: usize,
}

/// Readings after which their mean is fixed.
const SETTLED_READINGS: usize = 12;

impl SensorMean {
    fn is_fixed(&self) -> bool {
        self.count >= SETTLED_READINGS
    }

    /// Adds readings of sensors of this density. Those that are not `settled`, and those of another density than
    /// before, are the mean by themselves.
    fn add(&mut self, mut readings: Vec<SensorReading>, density: Density, settled: bool) {
        let is_alike = !self.last.is_empty() && density == self.density;
        self.count = if settled && is_alike {
            self.count + 1
        } else {
            1
        };
        let share = 1.0 / self.count as f64;
        if !is_alike {
            self.last.clone_from(&readings);
            self.edges = vec![Vec3::zeros(); readings.len()];
            self.density = density;
        }
        for (i, r) in readings.iter_mut().enumerate() {
            let edge = &mut self.edges[i];
            *edge += (r.place + r.normal * r.offset - *edge) * share;
            let before = self.last[i].weight;
            r.weight = before + (r.weight - before) * share;
        }
        self.last = readings;
    }

    /// The mean readings, relative to where the model is now.
    fn readings(&self, mesh: &TriMesh) -> Vec<SensorReading> {
        let all = sensors::barycentric();
        let weights = self.density.sensors(&all);
        let place = |i: usize| {
            let corners = mesh.corners(i / weights.len());
            let w = weights[i % weights.len()];
            corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2]
        };
        let seen = |(i, r): (usize, &SensorReading)| {
            let place = place(i);
            SensorReading {
                place,
                offset: r.normal.dot(&(self.edges[i] - place)),
                ..*r
            }
        };
        self.last.iter().enumerate().map(seen).collect()
    }
}

fn sensor_energy(readings: &[SensorReading]) -> f64 {
    readings
        .iter()
        .map(|r| 0.5 * r.share * r.weight * r.offset * r.offset)
        .sum()
}

fn hold_energy(holds: &[Hold]) -> f64 {
    let squares = holds.iter().map(|hold| hold.distance.powi(2));
    0.5 * HOLD_STIFFNESS * squares.sum::<f64>()
}

/// What pulls the model in a step beside its own forces.
struct Pulls<'a> {
    readings: &'a [SensorReading],
    density: Density,
    holds: &'a [Hold],
}

/// Positions and velocities, and the parts of the equations that all steps share.
struct MotionState {
    mesh: TriMesh,
    velocity: Vec<Vec3>,
    masses: Vec<f64>,
    constant: BlockMatrix,
    matrix: BlockMatrix,
    /// For each triangle the slots of its nine pairs of corners.
    slots: Vec<[usize; 9]>,
    origin: Vec<Vec3>,
}

impl MotionState {
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

    /// Makes one step and returns the greatest displacement of a node, mm; `None` where the motion
    /// diverged, in which case the positions stay as they were.
    fn step(
        &mut self,
        body: &Elastic,
        turns: &Turns,
        motion: &Motion,
        pulls: &Pulls,
    ) -> Option<f64> {
        let dt = motion.time_step;
        let inertia = 1.0 / (dt * dt) + motion.damping / dt;
        let old = &self.mesh.vertices;
        let mut rhs: Vec<Vec3> = (0..old.len())
            .map(|i| (old[i] * inertia + self.velocity[i] / dt) * self.masses[i])
            .collect();
        body.add_targets(old, turns, &mut rhs);
        self.matrix.copy_from(&self.constant);
        let all = sensors::barycentric();
        let weights = pulls.density.sensors(&all);
        for (t, group) in pulls.readings.chunks_exact(weights.len()).enumerate() {
            let triangle = self.mesh.triangles[t];
            for (r, w) in group.iter().zip(weights) {
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
        for hold in pulls.holds {
            let (triangle, w) = (self.mesh.triangles[hold.triangle], hold.weights);
            for slot in 0..9 {
                let share = HOLD_STIFFNESS * w[slot / 3] * w[slot % 3];
                *self.matrix.at_mut(self.slots[hold.triangle][slot]) += Matrix3::identity() * share;
            }
            for corner in 0..3 {
                rhs[triangle[corner] as usize] += hold.place * (HOLD_STIFFNESS * w[corner]);
            }
        }
        let mut new = old.clone();
        self.matrix.solve(&rhs, &mut new, 1e-7, 60);
        let diverged = |(p, o): (&Vec3, &Vec3)| !((p - o).norm() < 200.0);
        if new.iter().zip(&self.origin).any(diverged) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heart::deform::elastic::Stiffness;
    use crate::mesh::shapes;

    fn body(mesh: &TriMesh) -> Elastic {
        Elastic::new(mesh, &[], Stiffness::default())
    }

    /// A step by the readings of all sensors.
    fn step(
        state: &mut MotionState,
        body: &Elastic,
        motion: &Motion,
        readings: &[SensorReading],
    ) -> Option<f64> {
        let turns = body.turns(&state.mesh.vertices);
        let pulls = Pulls {
            readings,
            density: Density::Full,
            holds: &[],
        };
        state.step(body, &turns, motion, &pulls)
    }

    /// A body in flight, which nothing deforms, is slowed by the damping alone: implicitly,
    /// v' = v / (1 + g dt).
    #[test]
    fn a_body_in_flight_is_slowed_by_the_damping() {
        let mesh = shapes::icosphere(20.0, 1);
        let body = body(&mesh);
        for time_step in [0.4, 1.0, 2.5] {
            let motion = Motion {
                mass: 3.0,
                damping: 0.6,
                time_step,
                ..Motion::default()
            };
            let mut state = MotionState::new(&mesh, &body, &motion);
            let velocity = Vec3::new(1.0, -2.0, 0.5);
            state.velocity = vec![velocity; mesh.vertices.len()];
            let energy = 0.5 * 3.0 * velocity.norm_squared();
            assert!((state.kinetic_energy() / energy - 1.0).abs() < 1e-9);
            let slowed = velocity / (1.0 + 0.6 * time_step);
            let farthest = step(&mut state, &body, &motion, &[]).unwrap();
            assert!((farthest - slowed.norm() * time_step).abs() < 1e-4);
            for ((p, q), v) in state
                .mesh
                .vertices
                .iter()
                .zip(&mesh.vertices)
                .zip(&state.velocity)
            {
                assert!((p - q - slowed * time_step).norm() < 1e-4);
                assert!((v - slowed).norm() < 1e-4);
            }
        }
    }

    fn readings(mesh: &TriMesh, offset: f64, weight: f64) -> Vec<SensorReading> {
        let mut readings = Vec::new();
        for t in 0..mesh.triangles.len() {
            let corners = mesh.corners(t);
            for w in sensors::barycentric() {
                let place = corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2];
                readings.push(SensorReading {
                    place,
                    normal: mesh.area_normal(t).normalize(),
                    offset,
                    weight,
                    share: 1.0 / (sensors::PER_TRIANGLE * mesh.triangles.len()) as f64,
                });
            }
        }
        readings
    }

    /// Sensors that all want the same shift get it, in many steps, against nothing but inertia.
    #[test]
    fn sensors_carry_the_body_to_their_edges() {
        let mesh = shapes::icosphere(20.0, 1);
        let body = body(&mesh);
        let motion = Motion::default();
        let shift = Vec3::new(3.0, 1.0, -2.0);
        let mut state = MotionState::new(&mesh, &body, &motion);
        for _ in 0..40 {
            let mut readings = readings(&mesh, 0.0, 0.8);
            for r in &mut readings {
                r.offset = r.normal.dot(&shift);
            }
            step(&mut state, &body, &motion, &readings).unwrap();
        }
        for (p, q) in state.mesh.vertices.iter().zip(&mesh.vertices) {
            assert!((p - q - shift).norm() < 1e-3, "{}", p - q);
        }
        let energy = sensor_energy(&readings(&mesh, -3.0, 0.5));
        assert!((energy - 0.5 * 0.5 * 9.0).abs() < 1e-9);
    }

    #[test]
    fn a_body_that_leaves_diverges_and_stays() {
        let mesh = shapes::icosphere(20.0, 1);
        let body = body(&mesh);
        let motion = Motion::default();
        let mut state = MotionState::new(&mesh, &body, &motion);
        state.velocity = vec![Vec3::new(300.0, 0.0, 0.0); mesh.vertices.len()];
        // Damping halves it: 150 mm in the first step, more than 200 after the next one.
        assert!(step(&mut state, &body, &motion, &[]).is_some());
        let before = state.mesh.vertices.clone();
        assert!(step(&mut state, &body, &motion, &[]).is_none());
        assert_eq!(state.mesh.vertices, before);
    }

    /// While the reach falls only the last reading counts, afterwards the mean of all since, as a place: the
    /// body may have moved meanwhile.
    #[test]
    fn readings_at_the_least_reach_are_averaged() {
        let mesh = shapes::icosphere(20.0, 1);
        let mut mean = SensorMean::default();
        mean.add(readings(&mesh, 5.0, 0.9), Density::Full, false);
        mean.add(readings(&mesh, 1.0, 0.2), Density::Full, true);
        let of = |mean: &SensorMean, mesh: &TriMesh| {
            let r = mean.readings(mesh)[17];
            (r.offset, r.weight)
        };
        let near = |(a, b): (f64, f64), (c, d): (f64, f64)| {
            assert!((a - c).abs() < 1e-9 && (b - d).abs() < 1e-9, "{a} {b}");
        };
        // The first reading at the least reach is the second of all.
        near(of(&mean, &mesh), (3.0, 0.55));
        mean.add(readings(&mesh, 3.0, 1.0), Density::Full, true);
        near(of(&mean, &mesh), (3.0, 0.7));
        mean.add(readings(&mesh, 7.0, 0.7), Density::Full, true);
        near(of(&mean, &mesh), (4.0, 0.7));
        let mut moved = mesh.clone();
        let normal = mesh.area_normal(17 / sensors::PER_TRIANGLE).normalize();
        moved.vertices.iter_mut().for_each(|p| *p += normal * 1.5);
        near(of(&mean, &moved), (2.5, 0.7));
        for _ in 0..SETTLED_READINGS - 5 {
            mean.add(readings(&mesh, 4.0, 0.7), Density::Full, true);
            assert!(!mean.is_fixed());
        }
        mean.add(readings(&mesh, 4.0, 0.7), Density::Full, true);
        assert!(mean.is_fixed());
    }
    /// The sensors that are read while the reach falls say nothing of the others: the first reading of all is the mean.
    #[test]
    fn readings_of_all_sensors_begin_the_mean_anew() {
        let mesh = shapes::icosphere(20.0, 1);
        let (all, count) = (sensors::PER_TRIANGLE, mesh.triangles.len());
        let third: Vec<SensorReading> = (readings(&mesh, 5.0, 0.9).into_iter().enumerate())
            .filter(|(n, _)| n % all >= 2 * all / 3)
            .map(|(_, reading)| reading)
            .collect();
        let mut mean = SensorMean::default();
        mean.add(third.clone(), Density::Third, false);
        let seen = mean.readings(&mesh);
        assert_eq!(seen.len(), all / 3 * count);
        for (seen, read) in seen.iter().zip(&third) {
            assert!((seen.place - read.place).norm() < 1e-9 && (seen.offset - 5.0).abs() < 1e-9);
        }
        mean.add(readings(&mesh, 1.0, 0.2), Density::Full, true);
        let seen = mean.readings(&mesh);
        assert_eq!(seen.len(), all * count);
        let is_new = |r: &SensorReading| (r.offset - 1.0).abs() < 1e-9 && r.weight == 0.2;
        assert!(seen.iter().all(is_new) && mean.count == 1);
    }
}
