//! Places, turns and sizes cups until they agree best with a picture.
//!
//! In: a blurred, coarse picture and [`Hints`]. Out: [`ScoredCup`]s, each at a local maximum of
//! its score.
//!
//! 1. Hollow balls of three sizes are correlated with the picture at every place; the local maxima
//!    ([`cavity_candidates`]) stay.
//! 2. At each of these, [`Cup`]s with 42 axis directions are tried, the promising ones in three
//!    lengths.
//! 3. The best ones are moved, turned and scaled until their score no longer rises; one that starts
//!    where another has ended is left out.
//!
//! Where a caller knows that there is a heart and none of them is clear, each is moved, turned and scaled once more
//! with a dark arc ([`infarcted`]).
//!
//! Correlation does not depend on how hot a structure is, so liver, gut or gallbladder win only
//! if they look like a cup. Two weak priors break ties: the long axis of the human heart in
//! the patient (left, anterior, inferior; at most 0.06 of correlation for each right angle
//! away from it) and the length of the heart.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::cavity_candidates;
use super::cup::{Cup, Pattern, perpendicular};
use super::hints::{DISTINCT_DISTANCE_MM, Hints};
use super::not_a_heart::{MIN_CORRELATION, MIN_HOLLOWNESS, NotAHeart};
use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::field::Field;
use crate::image::grid::volume::Volume;
use crate::mesh::shapes;

/// Voxels of the coarse picture, mm.
const COARSE_VOXEL_MM: f64 = 6.5;
/// The blur of the coarse picture, mm.
const COARSE_BLUR_MM: f64 = 4.0;
/// Mean direction base to apex over the simulated hearts; anatomy books agree (LPS).
const USUAL_AXIS: [f64; 3] = [0.64, -0.61, -0.44];
/// Loss of score from the usual axis to one at a right angle to it.
const AXIS_PRIOR: f64 = 0.06;
/// Mean length of hearts, mm, base plane to outer apex, and its logarithmic spread.
const USUAL_LENGTH: (f64, f64) = (75.0, 0.25);
/// Lengths tried first, mm.
const FIRST_LENGTHS_MM: [f64; 3] = [60.0, 74.0, 92.0];
/// Length tried as well where very large hearts are looked for, mm.
const VERY_LARGE_LENGTH_MM: f64 = 118.0;
/// Cups that are moved, turned and scaled.
const MOVED_CUPS: usize = 40;
/// Directions that are also tried with the other lengths.
const PROMISING_DIRECTIONS: usize = 14;
/// Half of the arc that an infarct of one territory takes up, and of two, degrees: a third of the circumference
/// each, the border of two blurred by the wall beside it.
const INFARCT_HALF_ARCS_DEG: [f64; 2] = [60.0, 100.0];
/// Directions tried for the middle of that arc.
const ARC_DIRECTIONS: i32 = 12;
/// By how much the best of so many patterns correlates better by chance. In scans without a heart the best score rises
/// by 0.05 to 0.15, about 20 infarcts of one or two territories mostly by 0.2 to 0.3 (simulator's seeds 4102 and 4202).
const CHANCE_CORRELATION: f64 = 0.1;

/// The picture that cups are compared with: of the whole volume, or of `region` (LPS mm).
///
/// # Errors
/// [`Cancelled`].
pub fn picture(
    volume: &Volume,
    region: Option<&Aabb>,
    monitor: &Monitor,
) -> Result<Field, Cancelled> {
    let mut field = Field::coarse(volume, region, COARSE_VOXEL_MM, monitor)?;
    field.blur(COARSE_BLUR_MM, monitor)?;
    Ok(field)
}

/// A cup and how well it agrees with the picture.
#[derive(Debug, Clone, Copy)]
pub struct ScoredCup {
    /// The place.
    pub cup: Cup,
    /// Correlation less the priors' share.
    pub score: f64,
    /// Correlation with the picture, -1..=1.
    pub correlation: f64,
    /// Mean value of the wall's middle.
    pub wall: f64,
    /// Share of the wall's brightness that the cavity lacks, 0..=1.
    pub hollowness: f64,
    /// Whether it is the wall that an infarct leaves: then `wall` and `hollowness` are those of what is left, and
    /// [`CHANCE_CORRELATION`] is taken off score and correlation.
    pub infarcted: bool,
}

impl ScoredCup {
    /// The reason against a ventricle that the cup itself shows, if any.
    pub fn refusal(&self) -> Option<NotAHeart> {
        let (correlation, hollowness) = (self.correlation, self.hollowness);
        if correlation < MIN_CORRELATION {
            Some(NotAHeart::Unlike { correlation })
        } else if hollowness < MIN_HOLLOWNESS {
            Some(NotAHeart::Solid { hollowness })
        } else {
            None
        }
    }
}

/// A search in one picture.
pub struct CupSearch<'a> {
    pub field: &'a Field,
    pub pattern: Pattern,
    pub hints: &'a Hints,
    /// Coordinates of a cup that are changed, of those of [`moved`].
    pub coordinates: usize,
}

impl<'a> CupSearch<'a> {
    /// A search by the whole pattern and in all coordinates.
    pub fn new(field: &'a Field, hints: &'a Hints) -> Self {
        Self {
            field,
            pattern: Pattern::default(),
            hints,
            coordinates: CUP_COORDINATES,
        }
    }

    /// The best cups of the whole picture, best first; none where the hints leave no place.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn everywhere(
        &self,
        brightest: f64,
        monitor: &Monitor,
    ) -> Result<Vec<ScoredCup>, Cancelled> {
        let places = cavity_candidates::places(self.field, self.hints, brightest, monitor)?;
        let directions = axis_directions();
        let starts: Vec<Vec<ScoredCup>> = places
            .par_iter()
            .map(|centre| {
                monitor.check()?;
                Ok(self.orient(*centre, &directions))
            })
            .collect::<Result<_, Cancelled>>()?;
        let mut starts = starts.concat();
        starts.sort_by(|a, b| b.score.total_cmp(&a.score));
        starts.truncate(MOVED_CUPS);
        let mut found: Vec<ScoredCup> = Vec::new();
        for start in &starts {
            monitor.check()?;
            // Neighbouring starts end at the same local maximum.
            let climbed = found.iter().any(|f| f.cup.is_near(&start.cup));
            if !climbed {
                found.push(self.climb(start));
            }
        }
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(found)
    }

    /// The best cup that a search from `centre` alone finds.
    pub fn around(&self, centre: Vec3) -> ScoredCup {
        let starts = self.orient(centre, &axis_directions());
        self.climb(&starts[0])
    }

    /// `cup` with its agreement with the picture.
    pub fn score(&self, cup: Cup) -> ScoredCup {
        let mut scratch = Vec::with_capacity(160);
        let found = cup.match_score(&self.pattern, self.field, &mut scratch);
        let length = ((cup.length / USUAL_LENGTH.0).ln() / USUAL_LENGTH.1).powi(2);
        let breadth = (cup.breadth.ln() / 0.15).powi(2);
        let mut score = found.correlation - 0.015 * (length + breadth);
        // A solid body also differs from its surroundings; a ventricle is hollow. NaN (both values
        // are 0) counts as not hollow at all.
        score -= 1.5 * (MIN_HOLLOWNESS - found.hollowness.max(-1.0)).max(0.0);
        match &self.hints.axis {
            Some(axis) => {
                let cos = cup.axis.dot(axis) / axis.norm();
                score -= 4.0 * (0.82 - cos).max(0.0);
            }
            None => score -= AXIS_PRIOR * (1.0 - cup.axis.dot(&Vec3::from(USUAL_AXIS))),
        }
        if let Some(centre) = &self.hints.centre {
            score -= 0.05 * ((cup.centre - centre).norm() - DISTINCT_DISTANCE_MM).max(0.0);
        }
        if let Some(region) = &self.hints.region {
            score -= 0.05 * region.squared_distance(&cup.centre).sqrt();
        }
        ScoredCup {
            cup,
            score,
            correlation: found.correlation,
            wall: found.wall,
            hollowness: found.hollowness,
            infarcted: false,
        }
    }

    /// The two best cups about `centre` among all directions and lengths.
    fn orient(&self, centre: Vec3, directions: &[Vec3]) -> Vec<ScoredCup> {
        let turned = |axis: Vec3, length: f64| {
            self.score(Cup {
                centre,
                axis,
                length,
                breadth: 1.0,
            })
        };
        let [short, usual, long] = FIRST_LENGTHS_MM;
        let mut best: Vec<ScoredCup> = directions.iter().map(|d| turned(*d, usual)).collect();
        best.sort_by(|a, b| b.score.total_cmp(&a.score));
        for n in 0..PROMISING_DIRECTIONS {
            let axis = best[n].cup.axis;
            best.extend([turned(axis, short), turned(axis, long)]);
            if self.hints.infarcted {
                best.push(turned(axis, VERY_LARGE_LENGTH_MM));
            }
        }
        best.sort_by(|a, b| b.score.total_cmp(&a.score));
        let first = best[0].cup.axis;
        let other = best.iter().find(|s| s.cup.axis.dot(&first) < 0.7).copied();
        std::iter::once(best[0]).chain(other).collect()
    }

    /// Pattern search: each of the coordinates is tried in both directions; steps are halved when
    /// none helps.
    pub fn climb(&self, start: &ScoredCup) -> ScoredCup {
        let mut best = *start;
        let mut step = 1.0;
        // Coordinates that did not help since the cup or the step last changed.
        let mut failed = 0;
        while step > 0.1 {
            let before = best.score;
            for coordinate in 0..self.coordinates {
                if failed == self.coordinates {
                    break;
                }
                let trials = [step, -step].into_iter();
                let mut trials = trials.map(|by| self.score(moved(&best.cup, coordinate, by)));
                match trials.find(|trial| trial.score > best.score) {
                    Some(trial) => (best, failed) = (trial, 0),
                    None => failed += 1,
                }
            }
            if best.score < before + 1e-4 {
                step /= 2.0;
                failed = 0;
            }
        }
        best
    }
}

/// The walls that infarcts leave: each of `found` again, moved, turned and scaled until it agrees best with a
/// ventricle of which an arc takes up next to nothing. Best first.
///
/// # Errors
/// [`Cancelled`].
pub fn infarcted(
    field: &Field,
    hints: &Hints,
    found: &[ScoredCup],
    monitor: &Monitor,
) -> Result<Vec<ScoredCup>, Cancelled> {
    let searches: Vec<Vec<CupSearch>> = INFARCT_HALF_ARCS_DEG
        .iter()
        .map(|half_width| {
            let middles =
                (0..ARC_DIRECTIONS).map(|n| TAU * f64::from(n) / f64::from(ARC_DIRECTIONS));
            let search = |middle| CupSearch {
                pattern: Pattern::infarcted(middle, half_width.to_radians()),
                ..CupSearch::new(field, hints)
            };
            middles.map(search).collect()
        })
        .collect();
    let climbed: Vec<Vec<ScoredCup>> = found
        .par_iter()
        .map(|start| {
            monitor.check()?;
            let best = |searches: &Vec<CupSearch>| {
                let scored = searches.iter().map(|s| (s, s.score(start.cup)));
                let best = scored.reduce(|a, b| if b.1.score > a.1.score { b } else { a });
                best.map(|(search, cup)| search.climb(&cup))
            };
            let climbed = searches.iter().filter_map(best);
            Ok(climbed
                .map(|cup| ScoredCup {
                    score: cup.score - CHANCE_CORRELATION,
                    correlation: cup.correlation - CHANCE_CORRELATION,
                    infarcted: true,
                    ..cup
                })
                .collect())
        })
        .collect::<Result<_, Cancelled>>()?;
    let mut found = climbed.concat();
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    Ok(found)
}

/// The axis directions that are tried.
fn axis_directions() -> Vec<Vec3> {
    shapes::icosphere(1.0, 1).vertices
}

/// Coordinates of a cup: see [`moved`].
pub const CUP_COORDINATES: usize = 7;

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
