//! The heart as images: how much of each voxel is wall or cavity, and its uptake, as means over phases.

use super::material::{MU_STEP, SPOKES};
use super::ventricle::{Phase, Ventricle};
use super::{Directions, Place, Vec3, breathing};
use crate::simulator::grid::{Beyond, Grid};
use std::ops::Range;

/// Largest distance of the points at which a heart is sampled, mm.
const LARGEST_STEP_MM: f64 = 2.0;
/// Rounding of the wall's edges, mm.
const EDGE_ROUNDING_MM: f64 = 1.5;
/// Rounding of the wall's end at the base, mm.
const RIM_ROUNDING_MM: f64 = 5.0;
/// Where the papillary muscles lie, theta in degrees.
const PAPILLARY_DEG: [f64; 2] = [40.0, 250.0];
/// Uptake of papillary muscles over that of the wall beside them.
const PAPILLARY_UPTAKE: f64 = 0.8;
/// Half width of a papillary muscle, mm.
const PAPILLARY_MM: f64 = 4.0;
/// From where to where along the wall they reach, mu in rad.
const PAPILLARY_MU: [f64; 2] = [0.65, 1.32];
/// Share of the way from the axis to the wall from which they fill the cavity.
const PAPILLARY_DEPTH: f64 = 0.66;

/// A heart in the patient.
#[derive(Debug, Clone)]
pub struct PlacedHeart {
    /// The left ventricle.
    pub ventricle: Ventricle,
    /// Its directions.
    pub directions: Directions,
    /// The coordinates' origin, RAS mm.
    pub origin: Vec3,
    right: RightVentricle,
    /// Length of the bent axis, mm.
    length_mm: f64,
    breath_mm: f64,
}

/// The right ventricle: an ellipsoid at the septum's side, less the left ventricle.
#[derive(Debug, Clone, Copy)]
struct RightVentricle {
    centre: [f64; 3],
    half_axes: [f64; 3],
    wall_mm: f64,
    base: f64,
}

/// Images of a heart: shares of the voxels, and uptake.
#[derive(Debug, Clone)]
pub struct HeartImages {
    /// Share that is wall.
    pub wall: Grid,
    /// Share that is cavity, with the papillary muscles.
    pub cavity: Grid,
    /// Uptake of both ventricles and their blood.
    pub uptake: Grid,
    /// Share that is the right ventricle's wall.
    pub right: Grid,
}

impl PlacedHeart {
    /// The heart whose long axis has its middle at `centre`.
    pub fn new(
        ventricle: Ventricle,
        directions: Directions,
        centre: &Vec3,
        breath_mm: f64,
    ) -> Self {
        let ends = ventricle.axis_points();
        let width = ventricle.half_width_mm();
        let right = RightVentricle {
            centre: [-0.92 * width, 0.10 * width, -2.0],
            half_axes: [
                0.95 * width,
                1.05 * width,
                0.56 * (ends.inner_apex - ends.base),
            ],
            wall_mm: ventricle.heart.rv_wall_mm,
            base: ends.base - 2.0,
        };
        let middle = f64::midpoint(ends.base, ends.outer_apex);
        let origin = centre - middle * directions.apex;
        let length_mm = ends.outer_apex.max(30.0);
        Self {
            ventricle,
            directions,
            origin,
            right,
            length_mm,
            breath_mm,
        }
    }

    /// The point on the long axis `z` mm from the coordinates' origin.
    pub fn on_axis(&self, z: f64) -> Vec3 {
        self.origin + z * self.directions.apex
    }

    /// The images of some phases at a place, blurred by breathing.
    pub fn images(&self, place: &Place, phases: Range<usize>) -> HeartImages {
        let factor = (place.step_mm / LARGEST_STEP_MM).ceil() as usize;
        let fine = place.finer(factor);
        let phases: Vec<Moment> = (self.ventricle.phases[phases].iter())
            .map(|phase| Moment::new(phase, &self.ventricle))
            .collect();
        let reach = Reach::new(self, &phases, fine.step_mm);
        let planes = Grid::from_samples(fine.shape, |at| {
            let point = self.directions.parts(&(fine.at(at) - self.origin));
            if reach.holds(&point) {
                self.sample(&point, &phases, fine.step_mm)
            } else {
                [0.0; 4]
            }
        });
        let kernel = breathing::kernel(self.breath_mm, place.step_mm);
        let [wall, cavity, uptake, right] = planes.map(|grid| {
            let mut grid = if factor > 1 {
                grid.binned(factor)
            } else {
                grid
            };
            if kernel.len() > 1 {
                grid.convolve(2, &kernel, Beyond::Zero);
            }
            grid
        });
        HeartImages {
            wall,
            cavity,
            uptake,
            right,
        }
    }

    /// Shares of wall and cavity, uptake, and share of right wall about a point, in lateral, anterior and apical mm.
    fn sample(&self, at: &[f64; 3], phases: &[Moment], step: f64) -> [f32; 4] {
        let heart = &self.ventricle.heart;
        let along = at[2] / self.length_mm;
        let [x, y] = [0, 1].map(|i| at[i] - heart.bend[i] * along * along);
        let (rho, theta) = (x.hypot(y), y.atan2(x));
        let mut sums = [0.0; 4];
        for moment in phases {
            let theta = theta - moment.twist * along;
            let near = moment.near(rho, at[2]);
            let mut outside = f64::INFINITY;
            if let Some(point) = near {
                let (out, parts) = self.left(&point, moment, theta, rho, step);
                outside = out;
                for (sum, part) in sums.iter_mut().zip(parts) {
                    *sum += part;
                }
            }
            if let Some((wall, blood)) = self.right.shares(at, moment.phase.way, outside, step) {
                sums[2] += wall * heart.rv_uptake + blood * heart.blood;
                sums[3] += wall;
            }
        }
        sums.map(|sum| (sum / phases.len() as f64) as f32)
    }

    /// How far a point lies outside of the wall, mm, and its shares of wall and cavity, and uptake.
    fn left(
        &self,
        point: &Near,
        moment: &Moment,
        theta: f64,
        rho: f64,
        step: f64,
    ) -> (f64, [f64; 3]) {
        let ventricle = &self.ventricle;
        let share = |inside_mm: f64| (0.5 + inside_mm / step).clamp(0.0, 1.0);
        let inner = moment.phase.inner.at(point.mu, theta);
        let within = (moment.phase.outer.at(point.mu, theta) - point.lambda) * point.mm;
        let from_cavity = (point.lambda - inner) * point.mm;
        let above_base = (ventricle.base_at(theta) - point.mu) * point.mm;
        let edges = smooth_min(from_cavity, within, EDGE_ROUNDING_MM);
        let wall = share(smooth_min(edges, above_base, RIM_ROUNDING_MM));
        let cavity = share((-from_cavity).min(above_base));
        if wall == 0.0 && cavity == 0.0 {
            return (-within, [0.0; 3]);
        }
        let uptake = ventricle.uptake.at(point.mu, theta);
        let mut sum = wall * uptake + cavity * ventricle.heart.blood;
        if ventricle.heart.papillaries && cavity > 0.0 {
            for muscle in PAPILLARY_DEG {
                let turned = (theta - muscle.to_radians() + std::f64::consts::PI)
                    .rem_euclid(std::f64::consts::TAU)
                    - std::f64::consts::PI;
                let inside = (PAPILLARY_MM - turned.abs() * rho)
                    .min((point.lambda - PAPILLARY_DEPTH * inner) * point.mm)
                    .min((point.mu - PAPILLARY_MU[0]) * point.mm)
                    .min((PAPILLARY_MU[1] - point.mu) * point.mm);
                let muscle = share(inside) * cavity;
                sum += muscle * (PAPILLARY_UPTAKE * uptake - ventricle.heart.blood);
            }
        }
        (-within, [wall, cavity, sum])
    }
}

impl Ventricle {
    /// mu of the base at theta, rad.
    pub fn base_at(&self, theta: f64) -> f64 {
        let count = self.base.len();
        let at = (theta / super::material::THETA_STEP).rem_euclid(count as f64);
        let low = (at as usize).min(count - 1);
        let share = at - low as f64;
        (1.0 - share) * self.base[low] + share * self.base[(low + 1) % count]
    }
}

/// Where a heart is, generously: a cylinder about the left ventricle, and the right one in its widest phase.
struct Reach<'a> {
    right: &'a RightVentricle,
    radius_mm: f64,
    low_mm: f64,
    high_mm: f64,
    step_mm: f64,
}

impl<'a> Reach<'a> {
    fn new(heart: &'a PlacedHeart, moments: &[Moment], step_mm: f64) -> Self {
        let base = heart.ventricle.base.iter().copied().fold(0.0, f64::max) + MU_STEP;
        let bend = heart.ventricle.heart.bend;
        let largest = |of: &dyn Fn(&Moment) -> f64| moments.iter().map(of).fold(f64::MIN, f64::max);
        let focal = |moment: &Moment| moment.phase.focal_mm;
        Self {
            right: &heart.right,
            radius_mm: largest(&|m| focal(m) * (m.far * m.far - 1.0).sqrt())
                + 2.0 * bend[0].hypot(bend[1])
                + 2.0 * step_mm,
            low_mm: -largest(&|m| -focal(m) * m.far * base.cos() - m.phase.shift_mm)
                - 2.0 * step_mm,
            high_mm: largest(&|m| focal(m) * m.far + m.phase.shift_mm) + 2.0 * step_mm,
            step_mm,
        }
    }

    fn holds(&self, at: &[f64; 3]) -> bool {
        let of_left =
            at[0].hypot(at[1]) < self.radius_mm && (self.low_mm..self.high_mm).contains(&at[2]);
        let radius2 = (0..3).map(|i| {
            let half = self.right.half_axes[i] + 3.0 * self.step_mm;
            ((at[i] - self.right.centre[i]) / half).powi(2)
        });
        of_left || radius2.sum::<f64>() < 1.0
    }
}

/// A phase, with what sampling needs.
struct Moment<'a> {
    phase: &'a Phase,
    /// Turn of the apex, rad.
    twist: f64,
    /// cosh of a lambda beyond the wall.
    far: f64,
}

/// A point near to the wall, in the phase's coordinates.
struct Near {
    lambda: f64,
    mu: f64,
    /// Millimetres of a change of lambda or mu by 1.
    mm: f64,
}

impl<'a> Moment<'a> {
    fn new(phase: &'a Phase, ventricle: &Ventricle) -> Self {
        // Beyond the base no ring is part of the wall; one ring more for what lies between.
        let end = ventricle.base.iter().copied().fold(0.0, f64::max) + 2.0 * MU_STEP;
        let rings = (end / MU_STEP) as usize;
        let wall = phase.outer.0.iter().take(rings * SPOKES);
        let margin = wall.copied().fold(0.0, f64::max) + 2.0 * MU_STEP;
        let twist = ventricle.heart.twist_deg.to_radians() * phase.way;
        Self {
            phase,
            twist,
            far: margin.cosh(),
        }
    }

    /// The coordinates of a point that is not far outside of the wall.
    fn near(&self, rho: f64, z: f64) -> Option<Near> {
        let d = self.phase.focal_mm;
        let z = z - self.phase.shift_mm;
        let [r1, r2] = [z + d, z - d].map(|z| (z * z + rho * rho).sqrt());
        let cosh = ((r1 + r2) / (2.0 * d)).max(1.0);
        if cosh > self.far {
            return None;
        }
        let cos = ((r1 - r2) / (2.0 * d)).clamp(-1.0, 1.0);
        Some(Near {
            lambda: cosh.acosh(),
            mu: cos.acos(),
            mm: (r1 * r2).sqrt(),
        })
    }
}

impl RightVentricle {
    /// Shares of wall and blood about a point, if there are any. `outside`: how far it lies outside of the left wall.
    fn shares(&self, at: &[f64; 3], way: f64, outside: f64, step: f64) -> Option<(f64, f64)> {
        let above = at[2] - self.base;
        if above < -step || outside < -step {
            return None;
        }
        let smaller = [1.0 - 0.13 * way, 1.0 - 0.13 * way, 1.0 - 0.07 * way];
        let axes = [0, 1, 2].map(|i| self.half_axes[i] * smaller[i]);
        let e = [0, 1, 2].map(|i| (at[i] - self.centre[i]) / axes[i]);
        let r = e.iter().map(|e| e * e).sum::<f64>().sqrt() + 1e-6;
        let slope = [0, 1, 2].map(|i| e[i] / axes[i]);
        let slope = slope.iter().map(|s| s * s).sum::<f64>().sqrt() / r + 1e-6;
        let inside = (1.0 - r) / slope;
        if inside < -step {
            return None;
        }
        let share = |mm: f64| (0.5 + mm / step).clamp(0.0, 1.0);
        let free = if outside.is_finite() {
            share(outside)
        } else {
            1.0
        };
        let whole = share(inside.min(above));
        let blood = share(inside - self.wall_mm) * whole;
        Some(((whole - blood) * free, blood * free))
    }
}

/// The smaller number, rounded where both are alike.
fn smooth_min(a: f64, b: f64, width: f64) -> f64 {
    let near = (width - (a - b).abs()).max(0.0) / width;
    a.min(b) - near * near * width * 0.25
}

#[cfg(test)]
mod tests;
