//! The left ventricle as a cup: the shape that the search compares the picture with.
//!
//! A surface of revolution about the long axis. Radii are those of the blurred wall's middle
//! as shares of the length from the base plane to the outer apex, the mean of 19 simulated
//! hearts (`lv_apparent` of the cohort; standard deviation 0.02 to 0.04 of the length).
//! [`Cup::match_score`] samples a [`Field`] along the wall, in the cavity and outside and
//! correlates the samples with those of a healthy ventricle.

use std::f64::consts::TAU;

use crate::base::geometry::Vec3;
use crate::image::grid::field::Field;

/// Middle of the wall: (share of the length behind the base plane, share as radius).
pub(super) const WALL_PROFILE: [(f64, f64, usize); 6] = [
    (0.05, 0.350, 12),
    (0.22, 0.350, 12),
    (0.40, 0.345, 12),
    (0.56, 0.320, 12),
    (0.71, 0.272, 8),
    (0.83, 0.196, 6),
];

/// Share of the length at which the middle of the wall crosses the axis at the apex.
pub(super) const APEX_SHARE: f64 = 0.91;

/// Rings up to this share of the length are basal: segments 1 to 6 and most of 7 to 12.
const BASAL_RING_SHARE: f64 = 0.6;
/// The wall has ended at this share of the length before the base plane.
const WALL_END_SHARE: f64 = 0.18;

/// The point on the axis about which poses turn and scale.
pub(super) const PIVOT_SHARE: f64 = 0.45;

/// Place, direction and size of a left ventricle in the patient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cup {
    /// Point on the axis in the middle of the cavity, LPS mm.
    pub centre: Vec3,
    /// Unit vector from base to apex.
    pub axis: Vec3,
    /// Base plane to outer apex, mm.
    pub length: f64,
    /// Radius against that of the mean heart of this length.
    pub breadth: f64,
}

/// One sample of the image.
#[derive(Clone, Copy)]
struct Sample {
    /// Share of the length along the axis, from the centre towards the apex.
    along: f64,
    /// Share of the length away from the axis.
    across: f64,
    /// Cosine and sine of the angle about the axis.
    round: (f64, f64),
    /// Millimetres outward from that place (the wall's blurred half and a gap).
    outward: f64,
    /// The outward direction: its part across the axis (the rest points along).
    tilt: (f64, f64),
    expected: f64,
    weight: f64,
}

/// The samples of a cup of unit size, and what they are expected to show.
pub struct Pattern(Vec<Sample>);

/// Values of the cavity and the surroundings of a healthy heart, wall = 1.
const HEALTHY_CAVITY_VALUE: f64 = 0.40;
const HEALTHY_OUTSIDE_VALUE: f64 = 0.25;
/// The samples outside lie this far from the middle of the wall, mm.
const OUTSIDE_DISTANCE_MM: f64 = 17.0;

impl Default for Pattern {
    /// All samples of wall, cavity and surroundings.
    fn default() -> Self {
        let mut samples = Vec::new();
        for (row, &(along, across, count)) in WALL_PROFILE.iter().enumerate() {
            let at = Sample {
                along: along - PIVOT_SHARE,
                across,
                round: (1.0, 0.0),
                outward: 0.0,
                tilt: (1.0, 0.0),
                expected: 1.0,
                weight: across * 0.5 / count as f64,
            };
            ring(&mut samples, count, row, &at);
            let next = WALL_PROFILE
                .get(row + 1)
                .map_or((APEX_SHARE, 0.0), |m| (m.0, m.1));
            let (rise, fall) = (next.0 - along, across - next.1);
            let norm = rise.hypot(fall);
            let outside = Sample {
                outward: OUTSIDE_DISTANCE_MM,
                tilt: (rise / norm, fall / norm),
                expected: HEALTHY_OUTSIDE_VALUE,
                weight: at.weight * 0.7,
                ..at
            };
            ring(&mut samples, count, row, &outside);
        }
        let tip = Sample {
            along: APEX_SHARE - PIVOT_SHARE,
            across: 0.0,
            round: (1.0, 0.0),
            outward: 0.0,
            tilt: (0.0, 1.0),
            expected: 1.0,
            weight: 0.04,
        };
        samples.push(Sample {
            outward: OUTSIDE_DISTANCE_MM,
            expected: HEALTHY_OUTSIDE_VALUE,
            ..tip
        });
        samples.push(tip);
        for (along, across, count, weight) in [
            (-0.05, 0.0, 1, 0.05),
            (0.15, 0.0, 1, 0.05),
            (0.35, 0.0, 1, 0.05),
            (0.55, 0.0, 1, 0.05),
            (0.00, 0.15, 6, 0.10),
            (0.20, 0.13, 6, 0.10),
            (0.45, 0.11, 6, 0.08),
        ] {
            let at = Sample {
                along: along - PIVOT_SHARE,
                across,
                expected: HEALTHY_CAVITY_VALUE,
                weight: weight / count as f64,
                ..tip
            };
            ring(&mut samples, count, 0, &at);
        }
        Self(samples)
    }
}

/// Value of a wall without uptake, wall = 1: blood, and what blur and scatter bring there.
const INFARCTED_WALL_VALUE: f64 = 0.35;

impl Pattern {
    /// The samples of a ventricle whose wall takes up next to nothing within `half_width` of the direction `middle`
    /// about the axis (radians, from the first of [`perpendicular`]'s vectors to the second). The tip of the wall is
    /// left out: it belongs to all territories.
    pub fn infarcted(middle: f64, half_width: f64) -> Self {
        let mut samples = Self::default().0;
        samples.retain(|s| s.expected < 1.0 || s.across > 0.0);
        let (sin, cos) = middle.sin_cos();
        let dark = |s: &Sample| s.round.0 * cos + s.round.1 * sin >= half_width.cos();
        for s in samples.iter_mut().filter(|s| s.expected == 1.0) {
            if dark(s) {
                s.expected = INFARCTED_WALL_VALUE;
            }
        }
        Self(samples)
    }

    /// The samples of the basal half: the wall's rings, their cavity and surroundings, and the end
    /// of the wall at the base. For hearts whose apex does not show.
    pub fn basal() -> Self {
        let basal = |s: &Sample| s.along + PIVOT_SHARE < BASAL_RING_SHARE;
        let mut samples = Self::default().0;
        samples.retain(basal);
        let beyond = Sample {
            along: -WALL_END_SHARE - PIVOT_SHARE,
            across: WALL_PROFILE[0].1,
            round: (1.0, 0.0),
            outward: 0.0,
            tilt: (1.0, 0.0),
            expected: HEALTHY_OUTSIDE_VALUE,
            weight: 0.15 / 12.0,
        };
        ring(&mut samples, 12, 0, &beyond);
        Self(samples)
    }
}

/// Appends `count` copies of `at` round the axis; odd rows lie in the gaps of the even ones.
fn ring(samples: &mut Vec<Sample>, count: usize, row: usize, at: &Sample) {
    let stagger = 0.5 * (row % 2) as f64;
    samples.extend((0..count).map(|step| {
        let (sin, cos) = (TAU * (step as f64 + stagger) / count as f64).sin_cos();
        Sample {
            round: (cos, sin),
            ..*at
        }
    }));
}

impl Cup {
    /// The point on the axis where the base plane cuts it.
    pub fn base(&self) -> Vec3 {
        self.centre - self.axis * (PIVOT_SHARE * self.length)
    }

    /// The outer apex.
    pub fn apex(&self) -> Vec3 {
        self.centre + self.axis * ((1.0 - PIVOT_SHARE) * self.length)
    }

    /// Whether a search that starts at `other` would find this place again: 12 mm and 25
    /// degrees, about half of what the search moves in its first steps.
    pub fn is_near(&self, other: &Self) -> bool {
        (self.centre - other.centre).norm() < 12.0 && self.axis.dot(&other.axis) > 0.906
    }

    /// Weighted correlation, -1..=1, of the image with a ventricle at this place. Hot
    /// neighbours are cut off at 1.3 times the wall's mean, so that they do not dominate the
    /// correlation.
    pub fn match_score(&self, pattern: &Pattern, field: &Field, scratch: &mut Vec<f64>) -> Match {
        let (e1, e2) = perpendicular(&self.axis);
        let centre = field.to_index(&self.centre);
        let (axis, e1, e2) = (field.step(&self.axis), field.step(&e1), field.step(&e2));
        scratch.clear();
        let (mut wall, mut cavity) = (Mean::default(), Mean::default());
        for s in &pattern.0 {
            let along = s.along * self.length + s.outward * s.tilt.1;
            let across = s.across * self.length * self.breadth + s.outward * s.tilt.0;
            let (cos, sin) = s.round;
            let value = field
                .at_index(&(centre + axis * along + e1 * (across * cos) + e2 * (across * sin)));
            scratch.push(value);
            if s.expected == 1.0 {
                wall.add(s.weight, value);
            } else if s.expected == HEALTHY_CAVITY_VALUE {
                cavity.add(s.weight, value);
            }
        }
        let wall = wall.value();
        let cap = 1.3 * wall;
        let mut m = Moments::default();
        for (s, value) in pattern.0.iter().zip(scratch.iter()) {
            m.add(s.weight, s.expected, value.min(cap));
        }
        Match {
            correlation: m.correlation(),
            wall,
            hollowness: 1.0 - cavity.value() / wall,
        }
    }

    /// The brightness across the base, wall = 1: the brightest of the discs about the axis
    /// from 0.3 of the length behind the base plane to 0.2 before it. A ventricle is open
    /// there (blood, atrium, lung); a stomach, a skull or a ball is closed there.
    pub fn lid(&self, field: &Field, wall: f64) -> f64 {
        let (e1, e2) = perpendicular(&self.axis);
        let disc = |along: f64| {
            let centre = self.base() + self.axis * (along * self.length);
            let ring = (0..6).map(|n| {
                let (sin, cos) = (TAU * f64::from(n) / 6.0).sin_cos();
                field.at(&(centre + (e1 * cos + e2 * sin) * (0.12 * self.length)))
            });
            (field.at(&centre) + ring.sum::<f64>()) / 7.0
        };
        let brightest = (-6..=4)
            .map(|n| disc(0.05 * f64::from(n)))
            .fold(f64::NEG_INFINITY, f64::max);
        brightest / wall
    }
}

/// Running sums of a weighted mean.
#[derive(Default)]
struct Mean {
    sum: f64,
    weight: f64,
}

impl Mean {
    fn add(&mut self, weight: f64, value: f64) {
        self.sum += weight * value;
        self.weight += weight;
    }

    fn value(&self) -> f64 {
        self.sum / self.weight
    }
}

/// Agreement of a cup with the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// Weighted correlation, -1..=1.
    pub correlation: f64,
    /// Mean value along the middle of the wall.
    pub wall: f64,
    /// Share of the wall's brightness that the cavity lacks: 0 for a solid body, 1 for an empty one.
    pub hollowness: f64,
}

/// Running weighted sums of two variables.
#[derive(Debug, Clone, Copy, Default)]
pub struct Moments {
    w: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Moments {
    /// Adds one pair.
    pub fn add(&mut self, w: f64, x: f64, y: f64) {
        self.w += w;
        self.x += w * x;
        self.y += w * y;
        self.xx += w * x * x;
        self.xy += w * x * y;
        self.yy += w * y * y;
    }

    /// Adds many pairs with the same `x`, whose weights sum to 1, by the mean of their `y` and of
    /// its square.
    pub fn add_group(&mut self, x: f64, mean: f64, square: f64) {
        self.w += 1.0;
        self.x += x;
        self.y += mean;
        self.xx += x * x;
        self.xy += x * mean;
        self.yy += square;
    }

    /// Pearson's coefficient; 0 where either variable is constant.
    pub fn correlation(&self) -> f64 {
        let xx = self.xx - self.x * self.x / self.w;
        let yy = self.yy - self.y * self.y / self.w;
        let xy = self.xy - self.x * self.y / self.w;
        // A constant image has rounding for its variance, that of f32 where sums were f32.
        if yy > 1e-6 * self.yy {
            xy / (xx * yy).sqrt()
        } else {
            0.0
        }
    }
}

/// Two unit vectors that complete `axis` to a right-handed frame.
pub fn perpendicular(axis: &Vec3) -> (Vec3, Vec3) {
    let helper = Vec3::ith(axis.iamin(), 1.0);
    let e1 = axis.cross(&helper).normalize();
    (e1, axis.cross(&e1))
}
