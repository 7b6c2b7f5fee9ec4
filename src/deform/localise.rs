//! Finds the left ventricle in a whole volume.
//!
//! 1. A coarse picture (blocks of about 6.5 mm, blurred) of the whole volume.
//! 2. Hollow balls of three sizes are correlated with it at every place; local maxima stay.
//! 3. At each of these, [`Cup`]s of all axis directions and three lengths are tried.
//! 4. The best ones are moved, turned and scaled until their correlation stops to rise.
//!
//! Correlation does not care how hot a structure is, so liver, gut or gallbladder win only
//! if they look like a cup. Two weak priors break ties: the long axis of the human heart in
//! the patient (left, anterior, inferior; at most 0.06 of correlation for each right angle
//! away from it) and the length of the heart. Candidates that are closed at the base (stomach,
//! skull) are passed over. [`Localisation::confidence`] weighs the
//! correlation itself and its margin over the best candidate elsewhere.

use super::cup::{Cup, Moments, Pattern, perpendicular};
use super::field::Field;
use crate::geometry::Vec3;
use crate::geometry::bvh::Aabb;
use crate::mesh::shapes;
use crate::progress::{Cancelled, Monitor};
use crate::volume::Volume;

/// What is known of the ventricle's place; everything may stay open.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Hints {
    /// A point in the cavity, LPS mm: the search keeps within 25 mm of it.
    pub centre: Option<Vec3>,
    /// Base to apex, LPS, any length: the search keeps within 35 degrees of it.
    pub axis: Option<Vec3>,
    /// The cavity's centre must lie in this box, LPS mm.
    pub region: Option<Aabb>,
}

/// The ventricle's place and how sure that is.
#[derive(Debug, Clone, PartialEq)]
pub struct Localisation {
    /// The place.
    pub cup: Cup,
    /// Correlation of the cup with the image, -1..=1.
    pub correlation: f64,
    /// Mean value of the wall's middle in the image's unit.
    pub wall: f64,
    /// How much darker the cavity is than the wall, 0..=1.
    pub hollowness: f64,
    /// The best correlation at a place more than 25 mm away, if there was a candidate.
    pub runner_up: Option<f64>,
    /// 0 (a guess) to 1.
    pub confidence: f64,
}

/// What speaks against a candidate.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NotAHeart {
    /// The image does not look like a cup there.
    #[error("correlates {correlation:.2} with a ventricle's wall ({NEEDED:.2} is needed)")]
    Unlike {
        /// Correlation with a cup.
        correlation: f64,
    },
    /// It has no cavity.
    #[error("is hollow by {hollowness:.2} ({SOLID:.2} is needed)")]
    Solid {
        /// 1 - cavity / wall.
        hollowness: f64,
    },
    /// It is closed at the base.
    #[error("is closed at the base: {lid:.2} of the wall's value there (at most {CLOSED:.2})")]
    Closed {
        /// Value across the base, wall = 1.
        lid: f64,
    },
    /// The fitted model found no wall.
    #[error(
        "has no wall: {:.0} % of the fitted surface see an edge, {residual:.1} mm from it in \
         the mean",
        100.0 * active
    )]
    Edgeless {
        /// Share of the fitted model's area that sees an edge.
        active: f64,
        /// Weighted rms distance of those edges, mm.
        residual: f64,
    },
}

/// Why no ventricle was found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LocaliseError {
    /// The volume holds one value only, or nothing finite and positive.
    #[error("the volume shows nothing: its values do not differ")]
    Blank,
    /// No place looks like a ventricle.
    #[error(
        "no heart found: the best candidate, at {centre:.0?} mm (LPS), {reason}. Give a centre to overrule"
    )]
    NoHeart {
        /// Best candidate's centre, LPS mm.
        centre: [f64; 3],
        /// Its correlation with a ventricle.
        correlation: f64,
        /// What speaks against it.
        reason: NotAHeart,
    },
    /// The hints leave no place to search.
    #[error("the hinted centre or region lies outside the volume")]
    HintOutside,
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Voxels of the coarse picture, mm.
const COARSE: f64 = 6.5;
/// Distance of the places where hollow balls are tried, mm.
const STRIDE: f64 = 8.0;
/// The blur of the coarse picture, mm.
const BLUR: f64 = 4.0;
/// Mean direction base to apex over the simulated hearts; anatomy books agree (LPS).
const USUAL_AXIS: [f64; 3] = [0.64, -0.61, -0.44];
/// Loss of score from the usual axis to one at a right angle to it.
const AXIS_PRIOR: f64 = 0.06;
/// Mean length of hearts, mm, base plane to outer apex, and its logarithmic spread.
const USUAL_LENGTH: (f64, f64) = (75.0, 0.25);
/// Lengths tried first, mm.
const LENGTHS: [f64; 3] = [60.0, 74.0, 92.0];
/// Places and cups that go on to the next step.
const PLACES: usize = 60;
const STARTS: usize = 40;
/// Candidates nearer than this are the same one, mm.
const DISTINCT: f64 = 25.0;
/// Below this correlation nothing is called a heart. Simulated and clinical hearts reach 0.76 to
/// 0.99; where the heart was erased from five scans, the best other structure had 0.61 to 0.66.
const NEEDED: f64 = 0.6;
/// Below this hollowness a body counts as solid. Hearts: 0.45 to 0.76; the others: 0.08 to 0.15.
const SOLID: f64 = 0.2;
/// Above this share of the wall's value the base counts as closed. Hearts: 0.2 to 0.7 (the
/// latter in a scan with a background of half the heart's uptake); spherical shells, brains
/// and stomachs: 1.0 and more.
const CLOSED: f64 = 0.85;

/// Searches `volume` for the left ventricle.
///
/// # Errors
/// [`LocaliseError`]; never a made-up place. A hinted centre overrules the least
/// correlation.
pub fn localise(
    volume: &Volume,
    hints: &Hints,
    monitor: &Monitor,
) -> Result<Localisation, LocaliseError> {
    let mut field = Field::coarse(volume, COARSE);
    field.blur(BLUR);
    let brightest = field.values().iter().fold(0f32, |a, b| a.max(*b));
    let darkest = field.values().iter().fold(f32::INFINITY, |a, b| a.min(*b));
    if !(brightest > 0.0 && brightest > darkest) {
        return Err(LocaliseError::Blank);
    }
    monitor.check()?;
    let places = places(&field, hints, f64::from(brightest));
    if places.is_empty() {
        return Err(LocaliseError::HintOutside);
    }
    let pattern = Pattern::default();
    let search = Search {
        field: &field,
        pattern: &pattern,
        hints,
    };
    let mut starts = Vec::new();
    for centre in places {
        monitor.check()?;
        starts.extend(search.orient(centre));
    }
    starts.sort_by(|a, b| b.score.total_cmp(&a.score));
    starts.truncate(STARTS);
    let mut found: Vec<Scored> = Vec::new();
    for start in &starts {
        monitor.check()?;
        found.push(search.climb(start));
    }
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    search.conclude(&found)
}

/// Moves `cup` to the nearest best agreement with `field`.
pub fn refine(field: &Field, cup: &Cup) -> Localisation {
    let pattern = Pattern::default();
    let search = Search {
        field,
        pattern: &pattern,
        hints: &Hints::default(),
    };
    let start = search.score(*cup);
    let best = search.climb(&start);
    search.report(&best, None)
}

#[derive(Debug, Clone, Copy)]
struct Scored {
    cup: Cup,
    score: f64,
    correlation: f64,
    wall: f64,
    hollowness: f64,
}

impl Scored {
    /// What speaks against a ventricle, of what the cup itself shows.
    fn doubt(&self) -> Option<NotAHeart> {
        let (correlation, hollowness) = (self.correlation, self.hollowness);
        if correlation < NEEDED {
            Some(NotAHeart::Unlike { correlation })
        } else if hollowness < SOLID {
            Some(NotAHeart::Solid { hollowness })
        } else {
            None
        }
    }
}

struct Search<'a> {
    field: &'a Field,
    pattern: &'a Pattern,
    hints: &'a Hints,
}

impl Search<'_> {
    fn score(&self, cup: Cup) -> Scored {
        let mut scratch = Vec::with_capacity(160);
        let found = cup.match_score(self.pattern, self.field, &mut scratch);
        let length = ((cup.length / USUAL_LENGTH.0).ln() / USUAL_LENGTH.1).powi(2);
        let breadth = (cup.breadth.ln() / 0.15).powi(2);
        let mut score = found.correlation - 0.015 * (length + breadth);
        // A solid body also stands out from its surroundings; a ventricle is hollow. NaN
        // (nothing there) is no body at all.
        score -= 1.5 * (SOLID - found.hollowness.max(-1.0)).max(0.0);
        match &self.hints.axis {
            Some(axis) => {
                let cos = cup.axis.dot(axis) / axis.norm();
                score -= 4.0 * (0.82 - cos).max(0.0);
            }
            None => score -= AXIS_PRIOR * (1.0 - cup.axis.dot(&Vec3::from(USUAL_AXIS))),
        }
        if let Some(centre) = &self.hints.centre {
            score -= 0.05 * ((cup.centre - centre).norm() - DISTINCT).max(0.0);
        }
        if let Some(region) = &self.hints.region {
            score -= 0.05 * region.squared_distance(&cup.centre).sqrt();
        }
        Scored {
            cup,
            score,
            correlation: found.correlation,
            wall: found.wall,
            hollowness: found.hollowness,
        }
    }

    /// The two best cups about `centre` among all directions and lengths.
    fn orient(&self, centre: Vec3) -> Vec<Scored> {
        let mut best: Vec<Scored> = Vec::new();
        for axis in shapes::icosphere(1.0, 1).vertices {
            for length in LENGTHS {
                best.push(self.score(Cup {
                    centre,
                    axis,
                    length,
                    breadth: 1.0,
                }));
            }
        }
        best.sort_by(|a, b| b.score.total_cmp(&a.score));
        let first = best[0].cup.axis;
        let other = best.iter().find(|s| s.cup.axis.dot(&first) < 0.7).copied();
        std::iter::once(best[0]).chain(other).collect()
    }

    /// Pattern search: each of the seven coordinates is tried in both directions; steps
    /// halve when none helps.
    fn climb(&self, start: &Scored) -> Scored {
        let mut best = *start;
        let mut step = 1.0;
        while step > 0.1 {
            let before = best.score;
            for coordinate in 0..7 {
                for sign in [1.0, -1.0] {
                    let trial = self.score(moved(&best.cup, coordinate, sign * step));
                    if trial.score > best.score {
                        best = trial;
                        break;
                    }
                }
            }
            if best.score < before + 1e-4 {
                step /= 2.0;
            }
        }
        best
    }

    fn conclude(&self, found: &[Scored]) -> Result<Localisation, LocaliseError> {
        let Some(first) = found.first() else {
            return Err(LocaliseError::HintOutside);
        };
        let overruled = self.hints.centre.is_some();
        let open = |s: &&Scored| overruled || s.cup.lid(self.field, s.wall) <= CLOSED;
        let best = found.iter().find(open);
        if let Some(reason) = best.map_or_else(
            || {
                let lid = first.cup.lid(self.field, first.wall);
                Some(NotAHeart::Closed { lid })
            },
            |best| best.doubt().filter(|_| !overruled),
        ) {
            let candidate = best.unwrap_or(first);
            return Err(LocaliseError::NoHeart {
                centre: candidate.cup.centre.into(),
                correlation: candidate.correlation,
                reason,
            });
        }
        let best = best.unwrap_or(first);
        let elsewhere = found
            .iter()
            .filter(|s| (s.cup.centre - best.cup.centre).norm() > DISTINCT)
            .find(open);
        Ok(self.report(best, elsewhere))
    }

    fn report(&self, best: &Scored, elsewhere: Option<&Scored>) -> Localisation {
        let quality = ((best.correlation - NEEDED) / (0.8 - NEEDED)).clamp(0.0, 1.0);
        let margin = elsewhere.map_or(1.0, |e| ((best.score - e.score) / 0.15).clamp(0.0, 1.0));
        Localisation {
            cup: best.cup,
            correlation: best.correlation,
            wall: best.wall,
            hollowness: best.hollowness,
            runner_up: elsewhere.map(|e| e.correlation),
            confidence: quality * (0.4 + 0.6 * margin),
        }
    }
}

/// `cup` with one of its seven coordinates changed by `amount` steps: centre (8 mm), axis
/// (0.2 rad), length and breadth (8 %).
fn moved(cup: &Cup, coordinate: usize, amount: f64) -> Cup {
    let mut cup = *cup;
    let (e1, e2) = perpendicular(&cup.axis);
    match coordinate {
        0 => cup.centre += cup.axis * (8.0 * amount),
        1 => cup.centre += e1 * (8.0 * amount),
        2 => cup.centre += e2 * (8.0 * amount),
        3 => cup.axis = (cup.axis + e1 * (0.2 * amount)).normalize(),
        4 => cup.axis = (cup.axis + e2 * (0.2 * amount)).normalize(),
        5 => cup.length *= (0.08 * amount).exp(),
        _ => cup.breadth *= (0.08 * amount).exp(),
    }
    cup
}

/// Where hollow balls fit best: local maxima of their correlation, best first.
fn places(field: &Field, hints: &Hints, brightest: f64) -> Vec<Vec3> {
    let padded = Padded::new(field);
    let balls: Vec<Ball> = [22.0, 27.0, 33.0]
        .iter()
        .map(|radius| Ball::new(*radius, field, &padded))
        .collect();
    let [nx, ny, nz] = field.shape();
    let mut scores = vec![f64::NEG_INFINITY; nx * ny * nz];
    let stride = [0, 1, 2].map(|a| {
        let n = (STRIDE / field.spacing()[a]).round();
        if n >= 1.0 { n as usize } else { 1 }
    });
    for k in (0..nz).step_by(stride[2]) {
        for j in (0..ny).step_by(stride[1]) {
            for i in (0..nx).step_by(stride[0]) {
                let p = field.to_patient(&Vec3::new(i as f64, j as f64, k as f64));
                if !admitted(&p, hints) {
                    continue;
                }
                let at = padded.index(i, j, k);
                scores[i + nx * (j + ny * k)] = balls
                    .iter()
                    .map(|ball| ball.correlation(&padded.values, at, 0.08 * brightest))
                    .fold(f64::NEG_INFINITY, f64::max);
            }
        }
    }
    let mut maxima: Vec<(f64, Vec3)> = Vec::new();
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let own = scores[i + nx * (j + ny * k)];
                if own > f64::NEG_INFINITY && is_maximum(&scores, [nx, ny, nz], [i, j, k], stride) {
                    let p = field.to_patient(&Vec3::new(i as f64, j as f64, k as f64));
                    maxima.push((own, p));
                }
            }
        }
    }
    maxima.sort_by(|a, b| b.0.total_cmp(&a.0));
    maxima.truncate(PLACES);
    let mut places: Vec<Vec3> = maxima.into_iter().map(|m| m.1).collect();
    places.extend(hints.centre);
    places
}

fn admitted(p: &Vec3, hints: &Hints) -> bool {
    let near = hints
        .centre
        .is_none_or(|centre| (p - centre).norm() <= DISTINCT);
    let inside = hints
        .region
        .as_ref()
        .is_none_or(|region| region.squared_distance(p) == 0.0);
    near && inside
}

fn is_maximum(
    scores: &[f64],
    [nx, ny, nz]: [usize; 3],
    [i, j, k]: [usize; 3],
    reach: [usize; 3],
) -> bool {
    let own = i + nx * (j + ny * k);
    for z in k.saturating_sub(reach[2])..(k + reach[2] + 1).min(nz) {
        for y in j.saturating_sub(reach[1])..(j + reach[1] + 1).min(ny) {
            for x in i.saturating_sub(reach[0])..(i + reach[0] + 1).min(nx) {
                let other = x + nx * (y + ny * z);
                // Equal neighbours: the first one counts.
                if scores[other] > scores[own] || (scores[other] == scores[own] && other < own) {
                    return false;
                }
            }
        }
    }
    true
}

/// The coarse picture with its border continued, so that every ball fits everywhere.
struct Padded {
    shape: [usize; 3],
    margin: [usize; 3],
    values: Vec<f32>,
}

/// The largest ball's outer samples, mm.
const REACH: f64 = 33.0 + 17.0;

impl Padded {
    fn new(field: &Field) -> Self {
        let inner = field.shape();
        let margin = [0, 1, 2].map(|a| (REACH / field.spacing()[a] * 1.5).ceil() as usize + 1);
        let shape = [0, 1, 2].map(|a| inner[a] + 2 * margin[a]);
        let clamped = |x: usize, a: usize| x.saturating_sub(margin[a]).min(inner[a] - 1);
        let mut values = Vec::with_capacity(shape.iter().product());
        for k in 0..shape[2] {
            for j in 0..shape[1] {
                let row = inner[0] * (clamped(j, 1) + inner[1] * clamped(k, 2));
                values.extend((0..shape[0]).map(|i| field.values()[row + clamped(i, 0)]));
            }
        }
        Self {
            shape,
            margin,
            values,
        }
    }

    fn index(&self, i: usize, j: usize, k: usize) -> usize {
        i + self.margin[0]
            + self.shape[0] * (j + self.margin[1] + self.shape[1] * (k + self.margin[2]))
    }
}

/// A hollow ball as lists of voxel offsets.
struct Ball {
    groups: [Vec<isize>; 3],
}

/// What the wall, the hollow and the outside of the ball show.
const EXPECTED: [f64; 3] = [1.0, 0.45, 0.3];

impl Ball {
    fn new(radius: f64, field: &Field, padded: &Padded) -> Self {
        let directions = shapes::icosphere(1.0, 1).vertices;
        let few = shapes::icosphere(1.0, 0).vertices;
        let offset = |p: &Vec3| {
            let step = field.step(p);
            let n = |a: usize| {
                let reach = padded.margin[a] as f64;
                step[a].round().clamp(-reach, reach) as isize
            };
            n(0) + padded.shape[0] as isize * (n(1) + padded.shape[1] as isize * n(2))
        };
        let shell = |directions: &[Vec3], r: f64| -> Vec<isize> {
            directions.iter().map(|d| offset(&(d * r))).collect()
        };
        let mut hollow = shell(&few, 0.4 * radius);
        hollow.push(0);
        Self {
            groups: [
                shell(&directions, radius),
                hollow,
                shell(&directions, radius + 17.0),
            ],
        }
    }

    fn correlation(&self, values: &[f32], at: usize, least: f64) -> f64 {
        let value = |o: isize| f64::from(values[at.wrapping_add_signed(o)]);
        let wall = &self.groups[0];
        let mean = wall.iter().map(|o| value(*o)).sum::<f64>() / wall.len() as f64;
        if mean < least {
            return f64::NEG_INFINITY;
        }
        let mut moments = Moments::default();
        for (group, expected) in self.groups.iter().zip(EXPECTED) {
            let weight = 1.0 / group.len() as f64;
            for o in group {
                moments.add(weight, expected, value(*o).min(1.3 * mean));
            }
        }
        moments.correlation()
    }
}
