//! Finds the left ventricle in a whole volume.
//!
//! 1. A coarse picture (blocks of about 6.5 mm, blurred) of the whole volume.
//! 2. Hollow balls of three sizes are correlated with it at every place; local maxima stay.
//! 3. At each of these, [`Cup`]s of all axis directions are tried, the promising ones in three
//!    lengths.
//! 4. The best ones are moved, turned and scaled until their correlation stops to rise; one
//!    that starts where another has come to rest is left out.
//! 5. The best one is placed again by its basal half alone, as long as hearts of its radius are.
//!    If the apical wall then turns out to take up next to nothing, it stays there.
//!
//! Step 5 is for large infarctions of the apex. A cup that is correlated as a whole evades the
//! dark wall: it moves up to 20 mm basally, turns by up to 45 degrees until its apex lies on the
//! wall that is left, and becomes short and wide. But no coronary artery supplies the whole
//! circumference at the base. The ring of wall that is left there, and where it ends, say where
//! the axis is, and its radius how far the heart reaches: by the mean heart's proportions
//! (the simulated hearts' depart from them by 8 % of the length), because nothing else tells.
//!
//! Correlation does not care how hot a structure is, so liver, gut or gallbladder win only
//! if they look like a cup. Two weak priors break ties: the long axis of the human heart in
//! the patient (left, anterior, inferior; at most 0.06 of correlation for each right angle
//! away from it) and the length of the heart. Candidates that are closed at the base (stomach,
//! skull) are passed over. [`Localisation::confidence`] weighs the
//! correlation itself and its margin over the best candidate elsewhere.

use crate::geometry::Vec3;
use crate::geometry::bvh::Aabb;
use crate::grid::field::Field;
use crate::grid::volume::Volume;
use crate::locate::cavity_candidates as hollows;
use crate::locate::cup::{Cup, Pattern, perpendicular};
use crate::mesh::shapes;
use crate::progress::{Cancelled, Monitor};

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
    /// Uptake of the apical wall against the basal one, if it takes up next to nothing
    /// (less than 0.42): the place and the length are then told by the base.
    pub dark_apex: Option<f64>,
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
/// Cups that go on to the next step.
const STARTS: usize = 40;
/// Directions that are also tried with the other lengths.
const PROMISING: usize = 14;
/// Candidates nearer than this are the same one, mm.
pub(super) const DISTINCT: f64 = 25.0;
/// Below this correlation nothing is called a heart. Simulated and clinical hearts reach 0.76 to
/// 0.99; where the heart was erased from five scans, the best other structure had 0.61 to 0.66.
const NEEDED: f64 = 0.6;
/// Below this hollowness a body counts as solid. Hearts: 0.45 to 0.76; the others: 0.08 to 0.15.
const SOLID: f64 = 0.2;
/// Above this share of the wall's value the base counts as closed. Hearts: 0.2 to 0.7 (the
/// latter in a scan with a background of half the heart's uptake); spherical shells, brains
/// and stomachs: 1.0 and more.
const CLOSED: f64 = 0.85;
/// Below this share of the basal wall's uptake the apical wall does not show. Infarctions of the
/// whole apex: 0.20 to 0.40; one of 70 % severity: 0.48; other simulated hearts: 0.6 and more.
const UNSEEN: f64 = 0.42;

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
    let mut field = Field::coarse(volume, COARSE, monitor)?;
    field.blur(BLUR, monitor)?;
    let brightest = field.values().iter().fold(0f32, |a, b| a.max(*b));
    let darkest = field.values().iter().fold(f32::INFINITY, |a, b| a.min(*b));
    if !(brightest > 0.0 && brightest > darkest) {
        return Err(LocaliseError::Blank);
    }
    let places = hollows::places(&field, hints, f64::from(brightest), monitor)?;
    if places.is_empty() {
        return Err(LocaliseError::HintOutside);
    }
    let search = Search {
        field: &field,
        pattern: &Pattern::default(),
        hints,
        directions: &shapes::icosphere(1.0, 1).vertices,
        coordinates: COORDINATES,
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
        // Neighbouring places climb the same hill.
        let climbed = found.iter().any(|f| f.cup.is_near(&start.cup));
        if !climbed {
            found.push(search.climb(start));
        }
    }
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    let place = search.conclude(&found)?;
    Ok(search.by_base(place))
}

/// Moves `cup` to the nearest best agreement with `field`.
pub fn refine(field: &Field, cup: &Cup) -> Localisation {
    let search = Search {
        field,
        pattern: &Pattern::default(),
        hints: &Hints::default(),
        directions: &[],
        coordinates: COORDINATES,
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
    /// The axis directions that are tried.
    directions: &'a [Vec3],
    /// Coordinates of a cup that are changed, of those of [`moved`].
    coordinates: usize,
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
        let turned = |axis: Vec3, length: f64| {
            self.score(Cup {
                centre,
                axis,
                length,
                breadth: 1.0,
            })
        };
        let [short, usual, long] = LENGTHS;
        let mut best: Vec<Scored> = self.directions.iter().map(|d| turned(*d, usual)).collect();
        best.sort_by(|a, b| b.score.total_cmp(&a.score));
        for n in 0..PROMISING {
            let axis = best[n].cup.axis;
            best.extend([turned(axis, short), turned(axis, long)]);
        }
        best.sort_by(|a, b| b.score.total_cmp(&a.score));
        let first = best[0].cup.axis;
        let other = best.iter().find(|s| s.cup.axis.dot(&first) < 0.7).copied();
        std::iter::once(best[0]).chain(other).collect()
    }

    /// Places a cup whose apex does not show by its base.
    fn by_base(&self, place: Localisation) -> Localisation {
        let search = Search {
            pattern: &Pattern::basal(),
            // All but the breadth: radius and length go together.
            coordinates: COORDINATES - 1,
            ..*self
        };
        let basal = search.climb(&search.score(place.cup.in_proportion()));
        let uptake = basal.cup.apex_uptake(self.field);
        if uptake < UNSEEN {
            Localisation {
                cup: basal.cup,
                wall: basal.wall,
                dark_apex: Some(uptake),
                ..place
            }
        } else {
            place
        }
    }

    /// Pattern search: each of the coordinates is tried in both directions; steps
    /// halve when none helps.
    fn climb(&self, start: &Scored) -> Scored {
        let mut best = *start;
        let mut step = 1.0;
        while step > 0.1 {
            let before = best.score;
            for coordinate in 0..self.coordinates {
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
            dark_apex: None,
            runner_up: elsewhere.map(|e| e.correlation),
            confidence: quality * (0.4 + 0.6 * margin),
        }
    }
}

/// Coordinates of a cup: see [`moved`].
const COORDINATES: usize = 7;

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
