//! A ventricle's place as a cup, and how sure that is.
//!
//! In: every cup that [`cup_search`] found in a volume. Out: the
//! [`Localisation`] of the best one, or of the best one near a place that was decided on.
//!
//! Candidates that are closed at the base (stomach, skull) are left out.
//! [`Localisation::confidence`] combines the correlation with its margin over the best candidate
//! elsewhere. Where the apical wall does not show, [`apex`] places the cup by its base.

use super::apex;
use super::cup::Cup;
use super::cup_search::{self, CupSearch, ScoredCup};
use super::error::LocateError;
use super::hints::{DISTINCT_DISTANCE_MM, Hints};
use super::not_a_heart::{MAX_LID_SHARE, MIN_CORRELATION, NotAHeart};
use crate::base::geometry::Vec3;
use crate::base::progress::Monitor;
use crate::image::grid::field::Field;
use crate::image::grid::volume::Volume;

/// The ventricle's place and how sure that is.
#[derive(Debug, Clone, PartialEq)]
pub struct Localisation {
    /// The place.
    pub cup: Cup,
    /// Correlation of the cup with the image, -1..=1.
    pub correlation: f64,
    /// Mean value of the wall's middle in the image's unit.
    pub wall: f64,
    /// Share of the brightness of the wall, or of what an infarct left of it, that the cavity lacks, 0..=1.
    pub hollowness: f64,
    /// Uptake of the apical wall against the basal one, if the apical wall does not show (less than
    /// 0.42): place and length then come from the base.
    pub dark_apex: Option<f64>,
    /// The best correlation at a place more than 25 mm away, if there was a candidate; none was looked for where rays
    /// and cup agree on the heart.
    pub runner_up: Option<f64>,
    /// Whether an infarct left only a part of the wall to tell the place.
    pub infarcted: bool,
    /// 0 (a guess) to 1; at most 0.5 where only a part of the wall tells the place.
    pub confidence: f64,
}

/// Greatest confidence of a position found by a part of the wall: it is always flagged.
const OF_A_PART: f64 = 0.5;

/// Every cup found in a volume, best first, and the picture that they were found in.
pub(super) struct Cups {
    field: Field,
    hints: Hints,
    found: Vec<ScoredCup>,
}

impl Cups {
    /// Searches the whole of `volume`.
    ///
    /// # Errors
    /// [`LocateError::Blank`], [`LocateError::NoCandidate`], [`LocateError::HintOutside`] or
    /// [`LocateError::Cancelled`].
    pub fn everywhere(
        volume: &Volume,
        hints: &Hints,
        monitor: &Monitor,
    ) -> Result<Self, LocateError> {
        let (field, brightest) = picture(volume, monitor)?;
        let search = CupSearch::new(&field, hints);
        let found = search.everywhere(f64::from(brightest), monitor)?;
        if found.is_empty() {
            let hinted = hints.centre.is_some() || hints.region.is_some();
            return Err(if hinted {
                LocateError::HintOutside
            } else {
                LocateError::NoCandidate
            });
        }
        Ok(Self {
            field,
            hints: hints.clone(),
            found,
        })
    }

    /// The one cup that a search from `centre` (LPS mm) finds in `volume`.
    ///
    /// # Errors
    /// [`LocateError::Blank`] or [`LocateError::Cancelled`].
    fn around(volume: &Volume, centre: Vec3, monitor: &Monitor) -> Result<Self, LocateError> {
        let (field, _) = picture(volume, monitor)?;
        let hints = Hints::default();
        let found = vec![CupSearch::new(&field, &hints).around(centre)];
        Ok(Self {
            field,
            hints,
            found,
        })
    }

    /// The one cup `found` in `field`, where that is known to be the heart.
    pub fn one(field: Field, hints: &Hints, found: ScoredCup) -> Self {
        Self {
            field,
            hints: hints.clone(),
            found: vec![found],
        }
    }

    /// Adds the walls that infarcts leave ([`cup_search::infarcted`]).
    ///
    /// # Errors
    /// [`LocateError::Cancelled`].
    pub fn add_infarcted(&mut self, monitor: &Monitor) -> Result<(), LocateError> {
        let infarcted = cup_search::infarcted(&self.field, &self.hints, &self.found, monitor)?;
        self.found.extend(infarcted);
        self.found.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(())
    }

    /// Leaves only the walls that infarcts leave ([`cup_search::infarcted`]).
    ///
    /// # Errors
    /// [`LocateError::Cancelled`].
    pub fn infarcted(self, monitor: &Monitor) -> Result<Self, LocateError> {
        let found = cup_search::infarcted(&self.field, &self.hints, &self.found, monitor)?;
        Ok(Self { found, ..self })
    }

    /// The best cup that is open at the base, among those whose centre is `admitted`.
    ///
    /// # Errors
    /// [`LocateError::NoHeart`] where there is none, or something speaks against it and no
    /// hinted centre overrules that.
    pub fn best(&self, admitted: impl Fn(&Vec3) -> bool) -> Result<&ScoredCup, LocateError> {
        let admitted = |s: &&ScoredCup| admitted(&s.cup.centre);
        let first = self.found.iter().find(admitted).unwrap_or(&self.found[0]);
        let best = self.found.iter().filter(admitted).find(|s| self.is_open(s));
        let (candidate, reason) = match best {
            Some(best) => match best.refusal().filter(|_| self.hints.centre.is_none()) {
                None => return Ok(best),
                Some(refusal) => (best, refusal),
            },
            None => {
                let lid = first.cup.lid(&self.field, first.wall);
                (first, NotAHeart::Closed { lid })
            }
        };
        Err(LocateError::NoHeart {
            centre: candidate.cup.centre.into(),
            correlation: candidate.correlation,
            reason,
            size: None,
        })
    }

    /// The score of the best cup, if that is a ventricle's and correlates [clearly](super::CLEAR_CORRELATION).
    pub fn clear_score(&self) -> Option<f64> {
        let best = self.best(|_| true).ok();
        let clear = best.filter(|best| best.correlation >= super::CLEAR_CORRELATION);
        clear.map(|best| best.score)
    }

    /// The greatest value of the picture.
    pub fn brightest(&self) -> f64 {
        f64::from(greatest(&self.field))
    }

    /// Whether `cup` is open at the base, or a hinted centre overrules the question.
    fn is_open(&self, cup: &ScoredCup) -> bool {
        self.hints.centre.is_some() || cup.cup.lid(&self.field, cup.wall) <= MAX_LID_SHARE
    }

    /// The place of `best`, and how sure it is in view of the best cup elsewhere.
    pub fn localisation(&self, best: &ScoredCup) -> Localisation {
        let elsewhere = self
            .found
            .iter()
            .filter(|s| (s.cup.centre - best.cup.centre).norm() > DISTINCT_DISTANCE_MM)
            .find(|s| self.is_open(s));
        let place = report(best, elsewhere);
        if best.infarcted {
            // Where the dark arc holds the apex, the rest of the wall has determined the length already.
            return place;
        }
        match apex::by_base(&CupSearch::new(&self.field, &self.hints), &best.cup) {
            None => place,
            Some(dark) => Localisation {
                cup: dark.cup,
                wall: dark.wall,
                dark_apex: Some(dark.uptake),
                ..place
            },
        }
    }
}

fn report(best: &ScoredCup, elsewhere: Option<&ScoredCup>) -> Localisation {
    let quality = ((best.correlation - MIN_CORRELATION) / (0.8 - MIN_CORRELATION)).clamp(0.0, 1.0);
    let margin = elsewhere.map_or(1.0, |e| ((best.score - e.score) / 0.15).clamp(0.0, 1.0));
    let most = if best.infarcted { OF_A_PART } else { 1.0 };
    Localisation {
        cup: best.cup,
        correlation: best.correlation,
        wall: best.wall,
        hollowness: best.hollowness,
        dark_apex: None,
        runner_up: elsewhere.map(|e| e.correlation),
        infarcted: best.infarcted,
        confidence: (quality * (0.4 + 0.6 * margin)).min(most),
    }
}

/// The place of a model in the picture of the model alone, `volume`. There are no neighbours, so
/// the best cup of all is the model's.
///
/// # Errors
/// [`LocateError`].
pub fn of_model(volume: &Volume, monitor: &Monitor) -> Result<Localisation, LocateError> {
    let cups = Cups::everywhere(volume, &Hints::default(), monitor)?;
    Ok(cups.localisation(cups.best(|_| true)?))
}

/// As [`of_model`] for a model whose cavity lies about `middle` (LPS mm): the search starts there alone. Where the cup
/// that it finds is not [clear](super::CLEAR_CORRELATION), the whole picture is searched.
///
/// # Errors
/// [`LocateError`].
pub fn of_model_about(
    volume: &Volume,
    middle: Vec3,
    monitor: &Monitor,
) -> Result<Localisation, LocateError> {
    let cups = Cups::around(volume, middle, monitor)?;
    match cups.best(|_| true) {
        Ok(best) if best.correlation >= super::CLEAR_CORRELATION => Ok(cups.localisation(best)),
        _ => of_model(volume, monitor),
    }
}

/// The picture for cups of the whole of `volume`, and its greatest value.
fn picture(volume: &Volume, monitor: &Monitor) -> Result<(Field, f32), LocateError> {
    let field = cup_search::picture(volume, None, monitor)?;
    let brightest = greatest(&field);
    let darkest = field.values().iter().fold(f32::INFINITY, |a, b| a.min(*b));
    if !(brightest > 0.0 && brightest > darkest) {
        return Err(LocateError::Blank);
    }
    Ok((field, brightest))
}

fn greatest(field: &Field) -> f32 {
    field.values().iter().fold(0f32, |a, b| a.max(*b))
}

/// Moves `cup` to the nearest best agreement with `field`.
pub fn refine(field: &Field, cup: &Cup) -> Cup {
    let hints = Hints::default();
    let search = CupSearch::new(field, &hints);
    search.climb(&search.score(*cup)).cup
}
