//! Where the wall's edge is: sensors that look along the model's normals.
//!
//! Every triangle carries [`PER_TRIANGLE`] sensors, each in the middle of one of its equal
//! parts, so that a sensor speaks for the same share of area as its triangle's others and
//! the sum over all does not depend on the number of nodes. A sensor reads the image along
//! the normal, `reach` millimetres to both sides, and looks for the steepest fall outward
//! (direction-weighted gradient): score(t) = max(0, -df/dn) · exp(-t²/2(reach/2)²). Its
//! target is the score's maximum, its weight how strong that is against the others.
//!
//! A perfusion defect has no edge, so its sensors have next to no weight and the shape
//! carries the wall through. An organ that touches the heart has its own edges farther out,
//! which the Gaussian makes faint.

use super::field::Field;
use crate::geometry::Vec3;
use crate::mesh::TriMesh;

/// Sensors on each triangle: the centroids of its nine congruent parts.
pub const PER_TRIANGLE: usize = 9;

/// Distance of the readings along a profile, mm.
const STEP: f64 = 1.0;
/// Half the distance between the readings of a difference quotient, in steps.
const HALF: usize = 2;

/// Sensors on the rim look this many times as far along their normals as the others: how far
/// the wall reaches basally differs between patients more than its radius does.
const RIM_REACH: f64 = 1.75;

/// What a sensor looks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SensorKind {
    /// The steepest fall outward.
    Gradient,
    /// The steepest change, whichever way.
    Unsigned,
    /// The crossing of the value in [`Look::level`], downward on the way out.
    Level,
}

/// How far and how the sensors look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// What to look for.
    pub kind: SensorKind,
    /// Half-length of the profile, mm.
    pub reach: f64,
    /// The value that [`SensorKind::Level`] looks for.
    pub level: f64,
    /// Value above which the image is cut off before its slope is taken.
    pub ceiling: f64,
    /// What is added to the offsets.
    pub shift: Shift,
}

/// The edge that a reader draws, against the steepest slope of the blurred image, mm
/// outward. Blur moves the steepest slope of a curved edge towards the centre of curvature:
/// into the cavity on the inner side, into the wall on the outer one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shift {
    /// Where the surface faces the long axis.
    pub inner: f64,
    /// Where it faces away from it.
    pub outer: f64,
    /// Two ends of the axis that the surface is said to face.
    pub axis: [Vec3; 2],
}

impl Shift {
    /// Whether the surface there looks out of the base.
    fn is_rim(&self, place: &Vec3, normal: &Vec3) -> bool {
        let along = self.axis[1] - self.axis[0];
        let length = along.norm();
        length > 0.0
            && normal.dot(&along) < -0.6 * length
            && (place - self.axis[0]).dot(&along) < 0.5 * length * length
    }

    /// The shift of an edge seen there.
    fn at(&self, place: &Vec3, normal: &Vec3) -> f64 {
        let along = self.axis[1] - self.axis[0];
        let length = along.norm_squared();
        let share = if length > 0.0 {
            ((place - self.axis[0]).dot(&along) / length).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let towards = self.axis[0] + along * share - place;
        let facing = normal.dot(&towards) / towards.norm().max(f64::MIN_POSITIVE);
        if facing > 0.0 {
            self.inner * facing
        } else {
            -self.outer * facing
        }
    }
}

/// One sensor's answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Place of the sensor, mm.
    pub place: Vec3,
    /// Outward unit normal there.
    pub normal: Vec3,
    /// Distance to the edge along the normal, mm; outward positive.
    pub offset: f64,
    /// 0..=1; 0 where nothing was seen.
    pub weight: f64,
    /// Share of the model's area; the shares sum to 1.
    pub share: f64,
}

/// Barycentric coordinates of the sensors.
pub fn barycentric() -> [[f64; 3]; PER_TRIANGLE] {
    let mut out = [[0.0; 3]; PER_TRIANGLE];
    let mut next = 0;
    // Small triangles of a threefold subdivision: six upright ones, three turned ones.
    for a in 0..3 {
        for b in 0..(3 - a) {
            out[next] = centroid(a, b, 1);
            next += 1;
        }
    }
    for a in 0..2 {
        for b in 0..(2 - a) {
            out[next] = centroid(a, b, 2);
            next += 1;
        }
    }
    out
}

fn centroid(a: usize, b: usize, shift: usize) -> [f64; 3] {
    let u = (a as f64 + shift as f64 / 3.0) / 3.0;
    let v = (b as f64 + shift as f64 / 3.0) / 3.0;
    [1.0 - u - v, u, v]
}

/// Lets all sensors look. Ordered by triangle, [`PER_TRIANGLE`] each.
pub fn read(mesh: &TriMesh, field: &Field, look: &Look) -> Vec<Reading> {
    let normals = mesh.vertex_normals();
    let weights = barycentric();
    let total = mesh.area() * 2.0 * PER_TRIANGLE as f64;
    let mut profile = Profile::new(look);
    let mut rim = Profile::new(&Look {
        reach: look.reach * RIM_REACH,
        ..*look
    });
    let mut readings = Vec::with_capacity(mesh.triangles.len() * PER_TRIANGLE);
    let mut scores = Vec::with_capacity(readings.capacity());
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let share = mesh.area_normal(t).norm() / total;
        let corners = mesh.corners(t);
        let sides = triangle.map(|v| normals[v as usize]);
        for w in &weights {
            let place = corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2];
            let normal = (sides[0] * w[0] + sides[1] * w[1] + sides[2] * w[2])
                .try_normalize(0.0)
                .unwrap_or_else(Vec3::zeros);
            let eye = if look.shift.is_rim(&place, &normal) {
                &mut rim
            } else {
                &mut profile
            };
            let (offset, score) = eye.look(field, &place, &normal);
            let offset = offset + look.shift.at(&place, &normal);
            scores.push(score);
            readings.push(Reading {
                place,
                normal,
                offset,
                weight: score,
                share,
            });
        }
    }
    scores.sort_by(f64::total_cmp);
    let strong = scores[scores.len() * 9 / 10];
    for r in &mut readings {
        r.weight = if strong > 0.0 {
            (r.weight / strong).min(1.0)
        } else {
            0.0
        };
    }
    readings
}

/// Scratch for one profile.
struct Profile {
    look: Look,
    half: usize,
    values: Vec<f64>,
    slopes: Vec<f64>,
}

impl Profile {
    fn new(look: &Look) -> Self {
        Self {
            look: *look,
            half: (look.reach / STEP).ceil().max(1.0) as usize,
            values: Vec::new(),
            slopes: Vec::new(),
        }
    }

    /// Distance to the edge and its score (slope, image units per mm, times nearness).
    fn look(&mut self, field: &Field, place: &Vec3, normal: &Vec3) -> (f64, f64) {
        let reach = self.half + HALF;
        let start = field.to_index(place);
        let step = field.step(normal) * STEP;
        self.values.clear();
        self.values.extend((0..=2 * reach).map(|s| {
            let t = s as f64 - reach as f64;
            field.at_index(&(start + step * t)).min(self.look.ceiling)
        }));
        if self.look.kind == SensorKind::Level {
            return self.crossing(reach);
        }
        let spread = 2.0 * (self.look.reach / 2.0).powi(2);
        self.slopes.clear();
        self.slopes.extend((0..=2 * self.half).map(|s| {
            let slope = (self.values[s] - self.values[s + 2 * HALF]) / (2.0 * HALF as f64 * STEP);
            match self.look.kind {
                SensorKind::Unsigned => slope.abs(),
                _ => slope.max(0.0),
            }
        }));
        let score = |s: usize| {
            let t = (s as f64 - self.half as f64) * STEP;
            self.slopes[s] * (-t * t / spread).exp()
        };
        let mut best = 0;
        for s in 1..self.slopes.len() {
            if score(s) > score(best) {
                best = s;
            }
        }
        let seen = score(best);
        // The Gaussian has chosen the hill, but it also pulls the summit towards the sensor:
        // climb on the slope itself.
        let top = climb(&self.slopes, best);
        let offset = top as f64 - self.half as f64 + parabola(&self.slopes, top);
        (offset * STEP, seen)
    }

    /// The nearest outward fall through the level.
    fn crossing(&self, reach: usize) -> (f64, f64) {
        let level = self.look.level;
        let mut best: Option<(f64, f64)> = None;
        for (s, pair) in self.values.windows(2).enumerate() {
            if pair[0] >= level && pair[1] < level {
                let t = s as f64 - reach as f64 + (pair[0] - level) / (pair[0] - pair[1]);
                if best.is_none_or(|b| t.abs() < b.0.abs()) {
                    best = Some((t, pair[0] - pair[1]));
                }
            }
        }
        let (t, slope) = best.unwrap_or((0.0, 0.0));
        let spread = 2.0 * (self.look.reach / 2.0).powi(2);
        (
            t * STEP,
            slope / STEP * (-t * STEP * t * STEP / spread).exp(),
        )
    }
}

/// The local maximum above `start`.
fn climb(values: &[f64], start: usize) -> usize {
    let mut top = start;
    loop {
        let right = (top + 1).min(values.len() - 1);
        let left = top.saturating_sub(1);
        let next = if values[right] > values[left] {
            right
        } else {
            left
        };
        if values[next] > values[top] {
            top = next;
        } else {
            return top;
        }
    }
}

/// Where between its neighbours the maximum of a parabola lies, -0.5..=0.5.
fn parabola(scores: &[f64], best: usize) -> f64 {
    if best == 0 || best + 1 == scores.len() {
        return 0.0;
    }
    let (a, b, c) = (scores[best - 1], scores[best], scores[best + 1]);
    let bend = a - 2.0 * b + c;
    if bend < 0.0 {
        (0.5 * (a - c) / bend).clamp(-0.5, 0.5)
    } else {
        0.0
    }
}
