//! The left ventricle through the beat.
//!
//! In: [`Heart`]. Out: the inner and outer surface of the wall in every phase of the cycle ([`Phase`]), uptake,
//! contraction and delay of every material point.
//!
//! 1. The inner surface at end diastole is a spheroid with waves, scaled until its volume is the stated one; the outer
//!    one lies a stated thickness outside.
//! 2. A point contracts by the stated curve, later or less where the beat says so. A point without contraction keeps
//!    its thickness. How far the others go follows from the stated ejection fraction.
//! 3. Every column of the wall keeps its volume, so the muscle does; the outer surface follows from that.
//!
//! Guaranteed: volume at end diastole and ejection fraction, as integrals over the phases; the muscle's volume in every
//! phase. Not modelled: twist of the muscle within the wall, a tilting mitral plane.

use super::material::{
    self, Map, RINGS, SPOKES, aha_segment, column, metric, solve_column, volume,
};
use crate::simulator::curve::PeriodicCurve;
use crate::simulator::parameters::{Defect, Heart};
use crate::simulator::random::{Draws, Stream};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// How far the outer apex moves towards the base by end systole, mm.
const APEX_SHIFT_MM: f64 = 1.5;
/// mu over which the wall gets thinner and its uptake less towards the base, degrees.
const BASE_ZONE_DEG: f64 = 28.0;
/// Least lambda of the inner surface.
const LEAST_LAMBDA: f64 = 0.03;
/// Steps of the table of points without contraction.
const STILL_STEPS: usize = 6;

/// One phase of the cycle.
#[derive(Debug, Clone)]
pub struct Phase {
    /// Focal length, mm.
    pub focal_mm: f64,
    /// Where the coordinates' origin lies along the long axis, mm.
    pub shift_mm: f64,
    /// The way to end systole, 0 to 1, in the mean over the wall.
    pub way: f64,
    /// lambda of the inner surface.
    pub inner: Map,
    /// lambda of the outer surface.
    pub outer: Map,
}

/// A left ventricle.
#[derive(Debug, Clone)]
pub struct Ventricle {
    /// What it was made of.
    pub heart: Heart,
    /// mu of the base at each spoke, rad.
    pub base: Vec<f64>,
    /// Focal length at end diastole, mm.
    pub focal_mm: f64,
    /// lambda of the inner surface at end diastole.
    pub inner: Map,
    /// lambda of the outer surface at end diastole.
    pub outer: Map,
    /// Stated thickness at end diastole, mm.
    pub thickness_mm: Map,
    /// Uptake.
    pub uptake: Map,
    /// Uptake without defects.
    pub healthy_uptake: Map,
    /// AHA segment of each point.
    pub segment: Vec<usize>,
    /// 1 contracts wholly, 0 not.
    pub contraction: Map,
    /// How late, degrees of the cycle.
    pub delay: Map,
    /// The phases, evenly through the cycle.
    pub phases: Vec<Phase>,
}

/// Points on the long axis, mm along it.
#[derive(Debug, Clone, Copy)]
pub struct AxisPoints {
    /// The base.
    pub base: f64,
    /// The cavity's apex.
    pub inner_apex: f64,
    /// The wall's apex.
    pub outer_apex: f64,
}

impl Ventricle {
    /// The ventricle in `phases` phases of its cycle.
    pub fn new(heart: &Heart, phases: usize) -> Self {
        let mut made = Self::at_end_diastole(heart);
        made.phases = made.cycle(phases);
        made
    }

    /// The ventricle at end diastole, without any phase.
    pub fn at_end_diastole(heart: &Heart) -> Self {
        let base = base_of(heart);
        let relief = relief_of(heart);
        let wanted = thickness_of(heart, &base);
        let lambda = heart.ratio.atanh();
        let size = Size {
            heart,
            base: &base,
            relief: &relief,
            lambda,
        };
        let (focal, inner, outer) = size.solve(&wanted);
        let first = segments(&base, focal, &inner, &outer);

        let masks: Vec<Map> = (heart.defects.iter().enumerate())
            .map(|(number, defect)| defect_mask(defect, number, heart.field_seed, &first))
            .collect();
        let without = |share: fn(&Defect) -> f64| {
            Map::from_index(|at| {
                let each = heart.defects.iter().zip(&masks);
                each.map(|(defect, mask)| 1.0 - share(defect) * mask.0[at])
                    .product()
            })
        };
        let thinning = without(|d| d.thinning);
        let thickness = Map::from_index(|at| wanted.0[at] * thinning.0[at]);
        let (focal_mm, inner, outer) = size.solve(&thickness);
        let segment = segments(&base, focal_mm, &inner, &outer);

        let healthy_uptake = uptake_of(heart, &base);
        let loss = without(|d| d.severity);
        let uptake = Map::from_index(|at| (healthy_uptake.0[at] * loss.0[at]).max(0.0));
        let mut contraction = without(|d| d.akinesia);
        for region in &heart.beat.regions {
            let mask = smooth_mask(&segment, &region.segments);
            for (own, mask) in contraction.0.iter_mut().zip(&mask.0) {
                *own = *own * (1.0 - mask) + region.contraction * mask;
            }
        }
        let mut delay = Map::filled(0.0);
        for region in &heart.beat.delays {
            let mask = smooth_mask(&segment, &region.segments);
            for (own, mask) in delay.0.iter_mut().zip(&mask.0) {
                *own += region.degrees * mask;
            }
        }
        Self {
            heart: heart.clone(),
            base,
            focal_mm,
            inner,
            outer,
            thickness_mm: thickness,
            uptake,
            healthy_uptake,
            segment,
            contraction,
            delay,
            phases: Vec::new(),
        }
    }

    /// Volume of the muscle at end diastole, ml.
    pub fn muscle_ml(&self) -> f64 {
        let within = |lambda| volume(lambda, self.focal_mm, &self.base);
        (within(&self.outer) - within(&self.inner)) / 1000.0
    }

    /// Volume of the cavity in every phase, ml.
    pub fn cavity_ml(&self) -> Vec<f64> {
        let each = self.phases.iter();
        each.map(|p| volume(&p.inner, p.focal_mm, &self.base) / 1000.0)
            .collect()
    }

    /// Volume of the muscle in every phase, ml.
    pub fn wall_ml(&self) -> Vec<f64> {
        let outer = self
            .phases
            .iter()
            .map(|p| volume(&p.outer, p.focal_mm, &self.base) / 1000.0);
        outer
            .zip(self.cavity_ml())
            .map(|(outer, cavity)| outer - cavity)
            .collect()
    }

    /// Whether a point of the map is muscle.
    pub fn is_wall(&self, at: usize) -> bool {
        material::mu(at) < self.base[at % SPOKES]
    }

    /// Area of the inner surface at end diastole about each point; 0 beyond the base.
    pub fn areas(&self) -> Map {
        Map::from_index(|at| {
            let (mu, lambda) = (material::mu(at), self.inner.0[at]);
            let area = mu.sin() * self.focal_mm.powi(2) * lambda.sinh() * metric(lambda, mu);
            if self.is_wall(at) { area + 1e-12 } else { 0.0 }
        })
    }

    /// The mean over the phases of the ends of the long axis.
    pub fn axis_points(&self) -> AxisPoints {
        let mean = |z: &dyn Fn(&Phase) -> f64| {
            self.phases.iter().map(z).sum::<f64>() / self.phases.len() as f64
        };
        let at_base = |phase: &Phase| {
            let ends = (0..SPOKES).map(|spoke| {
                let ring = ((self.base[spoke] / material::MU_STEP).ceil() as usize).min(RINGS - 1);
                let lambda = phase.inner.0[ring * SPOKES + spoke];
                phase.focal_mm * lambda.cosh() * self.base[spoke].cos() + phase.shift_mm
            });
            ends.sum::<f64>() / SPOKES as f64
        };
        AxisPoints {
            base: mean(&at_base),
            inner_apex: mean(&|p| p.focal_mm * p.inner.ring_mean(0).cosh() + p.shift_mm),
            outer_apex: mean(&|p| p.focal_mm * p.outer.ring_mean(0).cosh() + p.shift_mm),
        }
    }

    /// Outer half width in the middle of the wall at end diastole, mm.
    pub fn half_width_mm(&self) -> f64 {
        self.focal_mm * self.outer.ring_mean(RINGS * 6 / 10).sinh()
    }

    fn cycle(&self, phases: usize) -> Vec<Phase> {
        let heart = &self.heart;
        let curve = PeriodicCurve::new(&heart.beat.curve.knots);
        let weights = Map::from_index(|at| {
            if self.is_wall(at) {
                material::mu(at).sin()
            } else {
                0.0
            }
        });
        let ways: Vec<Map> = (0..phases)
            .map(|phase| {
                let time = (phase as f64 + 0.5) / phases as f64 + heart.beat.offset;
                Map::from_index(|at| curve.at(time - self.delay.0[at] / 360.0).0)
            })
            .collect();
        let mean_ways: Vec<f64> = ways.iter().map(|way| way.mean(&weights)).collect();
        let shorter = 1.0 - heart.shorten * (heart.ef / 0.6).min(1.0);
        let still = self.still(shorter);
        let last = &still[STILL_STEPS];
        let focal = |way: f64| self.focal_mm * (1.0 + way * (shorter - 1.0));
        let resting: Vec<Map> = (mean_ways.iter())
            .map(|way| {
                let at = way.clamp(0.0, 1.0) * STILL_STEPS as f64;
                let low = (at as usize).min(STILL_STEPS - 1);
                let share = at - low as f64;
                let [a, b] = [&still[low], &still[low + 1]];
                Map::from_index(|k| a.0[k] + share * (b.0[k] - a.0[k]))
            })
            .collect();
        let inner = |phase: usize, amplitude: f64| {
            Map::from_index(|at| {
                let whole = self.inner.0[at] * (1.0 - amplitude) - last.0[at];
                let moved = self.contraction.0[at] * ways[phase].0[at] * whole;
                (resting[phase].0[at] + moved).max(LEAST_LAMBDA)
            })
        };
        let fraction = |amplitude: f64| {
            let volumes: Vec<f64> = (0..phases)
                .into_par_iter()
                .map(|p| volume(&inner(p, amplitude), focal(mean_ways[p]), &self.base))
                .collect();
            let largest = volumes.iter().copied().fold(0.0, f64::max);
            1.0 - volumes.iter().copied().fold(f64::MAX, f64::min) / largest
        };
        let (mut low, mut high) = (-0.1, 0.95);
        for _ in 0..26 {
            let middle = f64::midpoint(low, high);
            if fraction(middle) < heart.ef {
                low = middle;
            } else {
                high = middle;
            }
        }
        let amplitude = f64::midpoint(low, high);
        let apex = self.focal_mm * self.outer.ring_mean(0).cosh();
        (0..phases)
            .into_par_iter()
            .map(|phase| {
                let (inner, focal_mm) = (inner(phase, amplitude), focal(mean_ways[phase]));
                let outer = self.outer_of(&inner, focal_mm);
                let reach = focal_mm * outer.ring_mean(0).cosh();
                let way = mean_ways[phase];
                let shift_mm = apex - APEX_SHIFT_MM * way - reach;
                Phase {
                    focal_mm,
                    shift_mm,
                    way,
                    inner,
                    outer,
                }
            })
            .collect()
    }

    /// The outer surface about an inner one: every column has the volume that it has at end diastole.
    fn outer_of(&self, inner: &Map, focal_mm: f64) -> Map {
        let ratio = (self.focal_mm / focal_mm).powi(3);
        Map::from_index(|at| {
            let mu = material::mu(at);
            let own = column(self.outer.0[at], mu) - column(self.inner.0[at], mu);
            solve_column(inner.0[at], column(inner.0[at], mu) + own * ratio, mu)
        })
    }

    /// Inner surfaces that keep the wall's thickness while the focal length shortens, in steps from end diastole.
    fn still(&self, shorter: f64) -> Vec<Map> {
        let across = |inner: f64, outer: f64, mu: f64, focal: f64| {
            (outer - inner) * focal * metric(f64::midpoint(inner, outer), mu)
        };
        let of_step = |step: usize| {
            if step == 0 {
                return self.inner.clone();
            }
            let share = step as f64 / STILL_STEPS as f64;
            let focal = self.focal_mm * (1.0 + share * (shorter - 1.0));
            let ratio = (self.focal_mm / focal).powi(3);
            Map::from_index(|at| {
                let (mu, inner) = (material::mu(at), self.inner.0[at]);
                let wanted = across(inner, self.outer.0[at], mu, self.focal_mm);
                let own = (column(self.outer.0[at], mu) - column(inner, mu)) * ratio;
                let (mut low, mut high) = (inner - 0.02, inner + 0.25);
                for _ in 0..18 {
                    let middle = f64::midpoint(low, high);
                    let outer = solve_column(middle, column(middle, mu) + own, mu);
                    if across(middle, outer, mu, focal) > wanted {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                f64::midpoint(low, high)
            })
        };
        (0..=STILL_STEPS).into_par_iter().map(of_step).collect()
    }
}

/// mu of the base at each spoke, rad.
fn base_of(heart: &Heart) -> Vec<f64> {
    (0..SPOKES)
        .map(|spoke| {
            let theta = material::theta(spoke);
            let off = turned(theta - heart.memb_theta.to_radians()) / heart.memb_width.to_radians();
            let dip = heart.memb_dip * (-0.5 * off * off).exp();
            let waves = waves(&heart.base_modes, 1, |k, phase| (k * theta + phase).cos());
            (heart.mu_base - dip + waves).to_radians()
        })
        .collect()
}

/// How far the inner surface lies outside of the spheroid, mm.
fn relief_of(heart: &Heart) -> Map {
    Map::from_fn(|mu, theta| {
        let sin = mu.sin();
        let around = waves(&heart.modes_theta, 1, |k, phase| {
            sin.powf(k) * (k * theta + phase).cos()
        });
        let along = waves(&heart.modes_mu, 2, |k, phase| {
            0.5 * sin * ((k * mu + phase).cos() - phase.cos())
        });
        around + along - heart.septal_flat * sin * sin * septal(theta, 0.75)
    })
}

/// Thickness at end diastole without defects, mm.
fn thickness_of(heart: &Heart, base: &[f64]) -> Map {
    Map::from_index(|at| {
        let (mu, theta) = (material::mu(at), material::theta(at));
        let sin = mu.sin();
        let waves = waves(&heart.thick_modes, 1, |k, phase| {
            sin * (k * theta + phase).cos()
        });
        let share = 1.0
            - heart.apex_thin * near_apex(mu, 16.0)
            - heart.sept_thin * sin * septal(theta, 0.8)
            + heart.lat_thick * sin * theta.cos()
            + waves;
        let taper = 1.0 - heart.base_taper * (1.0 - from_base(mu, base[at % SPOKES])).powi(2);
        heart.h0 * share * taper
    })
}

/// Uptake without defects.
fn uptake_of(heart: &Heart, base: &[f64]) -> Map {
    Map::from_index(|at| {
        let (mu, theta) = (material::mu(at), material::theta(at));
        let waves = heart.uptake_modes.iter().map(|[amplitude, i, j, phase]| {
            amplitude * (i * mu).cos() * mu.sin().powf(*j) * (j * theta + phase).cos()
        });
        let near = 1.0 - from_base(mu, base[at % SPOKES]);
        let drop = 1.0 - heart.basal_drop * near.powf(1.5);
        (1.0 + waves.sum::<f64>()) * drop * (1.0 - 0.08 * near_apex(mu, 14.0))
    })
}

/// Sum of waves, whose harmonics count from `first`.
fn waves(modes: &[[f64; 2]], first: usize, wave: impl Fn(f64, f64) -> f64) -> f64 {
    let each = modes.iter().enumerate();
    each.map(|(n, [amplitude, phase])| amplitude * wave((n + first) as f64, *phase))
        .sum()
}

/// An angle in -pi to pi.
fn turned(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

/// 1 in the middle of the septum, less by a normal distribution of a width in rad.
fn septal(theta: f64, width: f64) -> f64 {
    (-0.5 * (turned(theta - PI) / width).powi(2)).exp()
}

/// 1 at the apex, less by a normal distribution of a width in degrees.
fn near_apex(mu: f64, width_deg: f64) -> f64 {
    (-0.5 * (mu.to_degrees() / width_deg).powi(2)).exp()
}

/// 0 at the base, 1 beyond its zone.
fn from_base(mu: f64, base: f64) -> f64 {
    ((base - mu) / BASE_ZONE_DEG.to_radians()).clamp(0.0, 1.0)
}

/// What the size of a ventricle follows from.
struct Size<'a> {
    heart: &'a Heart,
    base: &'a [f64],
    relief: &'a Map,
    lambda: f64,
}

impl Size<'_> {
    fn inner(&self, focal: f64) -> Map {
        Map::from_index(|at| {
            let mm = focal * metric(self.lambda, material::mu(at));
            (self.lambda + self.relief.0[at] / mm).max(0.06)
        })
    }

    /// Focal length, mm, inner and outer surface of the stated volume and a thickness.
    fn solve(&self, thickness_mm: &Map) -> (f64, Map, Map) {
        let (mut low, mut high) = (15.0, 120.0);
        for _ in 0..50 {
            let middle = f64::midpoint(low, high);
            if volume(&self.inner(middle), middle, self.base) > self.heart.edv_ml * 1000.0 {
                high = middle;
            } else {
                low = middle;
            }
        }
        let focal = f64::midpoint(low, high);
        let inner = self.inner(focal);
        let outer = Map::from_index(|at| {
            let (mu, inner) = (material::mu(at), inner.0[at]);
            let mut outer = inner + 0.2;
            for _ in 0..30 {
                let middle = f64::midpoint(inner, outer);
                outer = inner + thickness_mm.0[at] / (focal * metric(middle, mu));
            }
            outer
        });
        (focal, inner, outer)
    }
}

/// The AHA segment of each point.
fn segments(base: &[f64], focal: f64, inner: &Map, outer: &Map) -> Vec<usize> {
    let height = |at: usize| {
        let middle = f64::midpoint(inner.0[at], outer.0[at]);
        focal * middle.cosh() * material::mu(at).cos()
    };
    let ends = (0..SPOKES).map(|spoke| {
        let ring = ((base[spoke] / material::MU_STEP).ceil() as usize).min(RINGS - 1);
        height(ring * SPOKES + spoke)
    });
    let from = ends.sum::<f64>() / SPOKES as f64;
    let to = focal * inner.ring_mean(0).cosh();
    (0..RINGS * SPOKES)
        .map(|at| aha_segment((height(at) - from) / (to - from), material::theta(at)))
        .collect()
}

fn smooth_mask(segment: &[usize], wanted: &[usize]) -> Map {
    Map::from_index(|at| f64::from(u8::from(wanted.contains(&segment[at])))).smoothed(1.6)
}

/// 1 where a defect is, 0 elsewhere, with an irregular border.
fn defect_mask(defect: &Defect, number: usize, seed: u64, segment: &[usize]) -> Map {
    let plain = Map::from_index(|at| f64::from(u8::from(defect.segments.contains(&segment[at]))));
    let [up, round] = [defect.shift_mu, defect.shift_theta].map(f64::to_radians);
    let moved = Map::from_fn(|mu, theta| plain.at((mu - up).max(0.0), theta - round));
    let mut draws = Draws::new(seed + number as u64, Stream::Borders);
    let noise = Map((0..RINGS * SPOKES)
        .map(|_| draws.normal(0.0, 1.0))
        .collect())
    .smoothed(3.0);
    let squares: f64 = noise.0.iter().map(|n| n * n).sum();
    let sd = (squares / noise.0.len() as f64).sqrt();
    let soft = moved.smoothed(2.2);
    let rough = Map::from_index(|at| {
        let m = soft.0[at];
        let border = if m > 0.05 && m < 0.95 {
            0.1 * noise.0[at] / sd
        } else {
            0.0
        };
        ((m + border - 0.5) / 0.5 + 0.5).clamp(0.0, 1.0)
    });
    rough.smoothed(1.2)
}
