//! Limits from the maps of healthy people.
//!
//! 1. Every scan starts with the scale of its own median; mean and standard deviation follow from the scaled scans.
//! 2. Scale and pattern of every scan are matched to them ([`matched_places`]), and mean, deviation and the patterns'
//!    covariance follow from what is left, in [`MATCHING_ROUNDS`] rounds.
//! 3. The relative variance is smoothed over neighbouring places, because a dozen or two people tell that of one
//!    place badly, and is at least that of [`LEAST_RELATIVE_SD`]. It grows by 1/n, the variance of the mean.
//!
//! A place has limits if half of the people, and at least [`FEWEST_AT_A_PLACE`], have muscle there. Each person is
//! then judged by the limits of the others, and one whose wall lies beyond them by more than [`MOST_EXTENT_PERCENT`]
//! is left out: a defect that nobody knew of.

use super::document::{
    ExcludedCase, GlobalLimit, LeftOut, LimitMap, NormalCase, NormalGroup, Specificity,
};
use super::error::NormalsError;
use super::kind::GroupSex;
use super::matching::matched_places;
use super::pattern::{Coefficients, TermMatrix, share_at};
use super::perfusion::{HeartFigure, figures};
use super::place_limits::{PlaceLimits, ScanPlaces};
use super::sizes::FEWEST_CASES;
use crate::base::numeric::decimals::round;
use crate::base::numeric::order::{quantile, weighted_quantile};
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::polar::{MapGaussian, RAY_COLUMNS, RAY_ROWS};
use rayon::prelude::*;

/// Rounds of matching.
const MATCHING_ROUNDS: usize = 4;
/// Least standard deviation as a share of the mean.
const LEAST_RELATIVE_SD: f64 = 0.03;
/// The standard deviation of the first round, as a share of the mean.
const FIRST_RELATIVE_SD: f64 = 0.08;
/// Standard deviation of the smoothing of the variance, rows and columns: 25 mm.
const SMOOTHING_PLACES: [f64; 2] = [8.0, 9.5];
/// Rows and columns on either side that it takes in.
const SMOOTHING_REACH: [usize; 2] = [RAY_ROWS / 2, RAY_COLUMNS / 3];
/// Fewest people with muscle at a place that has limits.
const FEWEST_AT_A_PLACE: usize = 6;
/// Share of the wall beyond the others' limits from which a person is left out, per cent.
const MOST_EXTENT_PERCENT: f64 = 10.0;

/// A healthy person's scan.
#[derive(Debug, Clone)]
pub struct HealthyScan {
    /// Who.
    pub case: NormalCase,
    /// The wall.
    pub places: ScanPlaces,
    /// Figures of the heart.
    pub figures: Vec<HeartFigure>,
}

/// The kind of a group's scans.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct GroupKind {
    /// `M`, `F` or `mixed`.
    pub sex: GroupSex,
    /// The protocol.
    pub protocol: String,
    /// The tracer.
    pub tracer: String,
    /// Whether attenuation was corrected.
    pub attenuation_corrected: bool,
}

/// Why there is no group.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GroupError {
    /// The people make none.
    #[error(transparent)]
    Normals(#[from] NormalsError),
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// The group of these people, and those of them that are left out.
///
/// # Errors
/// [`NormalsError::TooFewCases`], [`GroupError::Cancelled`].
pub fn group_of(
    kind: &GroupKind,
    people: &[HealthyScan],
    monitor: &Monitor,
) -> Result<(NormalGroup, Vec<ExcludedCase>), GroupError> {
    let all: Vec<&HealthyScan> = people.iter().collect();
    enough(kind, all.len())?;
    let (kept, odd): (Vec<_>, Vec<_>) = (all.iter().copied().zip(left_out(&all, monitor)?))
        .partition(|(_, judged)| judged.extent_percent <= MOST_EXTENT_PERCENT);
    let excluded = odd.iter().map(|(person, judged)| ExcludedCase {
        case: person.case.case.clone(),
        reason: format!(
            "{:.1} % of the wall lies beyond the limits of the others; at most {MOST_EXTENT_PERCENT:.0} % is taken for \
             normal",
            judged.extent_percent
        ),
    });
    let excluded: Vec<ExcludedCase> = excluded.collect();
    let people: Vec<&HealthyScan> = kept.iter().map(|(person, _)| *person).collect();
    enough(kind, people.len())?;
    let judged = if excluded.is_empty() {
        kept.into_iter().map(|(_, judged)| judged).collect()
    } else {
        left_out(&people, monitor)?
    };
    let group = NormalGroup {
        sex: kind.sex,
        protocol: kind.protocol.clone(),
        tracer: kind.tracer.clone(),
        attenuation_corrected: kind.attenuation_corrected,
        cases: people.iter().map(|person| person.case.clone()).collect(),
        map: LimitMap::from(&limits_of(&places_of(&people), monitor)?),
        figures: figure_limits(&people),
        leave_one_out: specificity(judged),
    };
    Ok((group, excluded))
}

fn enough(kind: &GroupKind, cases: usize) -> Result<(), NormalsError> {
    if cases >= FEWEST_CASES {
        return Ok(());
    }
    Err(NormalsError::TooFewCases {
        group: format!(
            "sex {}, protocol {}, tracer {}",
            kind.sex.as_str(),
            kind.protocol,
            kind.tracer
        ),
        cases,
    })
}

fn places_of<'a>(people: &[&'a HealthyScan]) -> Vec<&'a ScanPlaces> {
    people.iter().map(|person| &person.places).collect()
}

/// Every person by the limits of the others.
fn left_out(people: &[&HealthyScan], monitor: &Monitor) -> Result<Vec<LeftOut>, GroupError> {
    let judged = people.par_iter().enumerate().map(|(index, person)| {
        let others: Vec<&ScanPlaces> = (people.iter().enumerate())
            .filter(|(other, _)| *other != index)
            .map(|(_, person)| &person.places)
            .collect();
        let found = figures(&person.places, &limits_of(&others, monitor)?)
            .ok_or(NormalsError::TooLittleWall { percent: 0.0 })?;
        Ok(LeftOut {
            case: person.case.case.clone(),
            extent_percent: round(found.extent_percent),
            deficit_percent: round(found.deficit_percent),
            summed_score: found.summed_score(),
        })
    });
    judged.collect()
}

fn specificity(cases: Vec<LeftOut>) -> Specificity {
    let mean = |of: fn(&LeftOut) -> f64| cases.iter().map(of).sum::<f64>() / cases.len() as f64;
    let mut deficits: Vec<f64> = cases.iter().map(|case| case.deficit_percent).collect();
    deficits.sort_by(f64::total_cmp);
    Specificity {
        mean_extent_percent: round(mean(|case| case.extent_percent)),
        mean_deficit_percent: round(mean(|case| case.deficit_percent)),
        deficit_percent_of_95: round(quantile(&deficits, 0.95)),
        cases,
    }
}

/// Mean, standard deviation and patterns of these scans. The mean's own mean over the places is 1.
///
/// # Errors
/// [`Cancelled`].
pub fn limits_of(scans: &[&ScanPlaces], monitor: &Monitor) -> Result<PlaceLimits, Cancelled> {
    let places = RAY_ROWS * RAY_COLUMNS;
    let people_at: Vec<usize> = (0..places)
        .map(|index| {
            scans
                .iter()
                .filter(|scan| scan.uptake[index].is_some())
                .count()
        })
        .collect();
    let fewest = FEWEST_AT_A_PLACE.max(scans.len().div_ceil(2));
    let known: Vec<bool> = people_at.iter().map(|people| *people >= fewest).collect();
    let only_known = |value: &dyn Fn(usize) -> f64| -> Vec<Option<f64>> {
        (0..places)
            .map(|index| known[index].then(|| value(index)))
            .collect()
    };
    let smoothing = MapGaussian::new(SMOOTHING_PLACES, SMOOTHING_REACH);
    let weights: Vec<f64> = (known.iter())
        .map(|known| f64::from(u8::from(*known)))
        .collect();
    let medians: Vec<f64> = scans.iter().map(|scan| median_uptake(scan)).collect();
    let mean = mean_at(places, |index| {
        (scans.iter().zip(&medians))
            .filter_map(move |(scan, median)| Some(scan.uptake[index]? / median))
    });
    let mut limits = PlaceLimits {
        mean: only_known(&|index| mean[index]),
        sd: only_known(&|index| FIRST_RELATIVE_SD * mean[index]),
        covariance: TermMatrix::zeros(),
    };
    for _ in 0..MATCHING_ROUNDS {
        let precision = limits.precision();
        let matched: Vec<(Vec<Option<f64>>, Option<Coefficients>)> = scans
            .iter()
            .map(|scan| {
                monitor.check()?;
                Ok(shares_of(scan, &limits, &precision))
            })
            .collect::<Result<_, Cancelled>>()?;
        let at = |index: usize| matched.iter().filter_map(move |(shares, _)| shares[index]);
        let factor = mean_at(places, at);
        let variance: Vec<f64> = (0..places)
            .map(|index| variance(at(index).collect()))
            .collect();
        let variance = smoothing.means(&variance, &weights);
        let patterns: Vec<&Coefficients> = matched
            .iter()
            .filter_map(|(_, pattern)| pattern.as_ref())
            .collect();
        let freedom = (patterns.len().max(2) - 1) as f64;
        let covariance = (patterns.iter()).fold(TermMatrix::zeros(), |sum, pattern| {
            sum + *pattern * pattern.transpose()
        }) / freedom;
        let mean: Vec<f64> = (0..places)
            .map(|index| limits.mean[index].unwrap_or(0.0) * factor[index])
            .collect();
        limits = PlaceLimits {
            mean: only_known(&|index| mean[index]),
            sd: only_known(&|index| mean[index] * variance[index].sqrt().max(LEAST_RELATIVE_SD)),
            covariance,
        };
    }
    let level = {
        let all: Vec<f64> = limits.mean.iter().flatten().copied().collect();
        all.iter().sum::<f64>() / all.len().max(1) as f64
    };
    let of_mean = |index: usize| (1.0 + 1.0 / people_at[index].max(1) as f64).sqrt();
    let scaled = |values: &[Option<f64>], factor: &dyn Fn(usize) -> f64| -> Vec<Option<f64>> {
        let values = values.iter().enumerate();
        values
            .map(|(index, value)| Some((*value)? * factor(index) / level))
            .collect()
    };
    Ok(PlaceLimits {
        mean: scaled(&limits.mean, &|_| 1.0),
        sd: scaled(&limits.sd, &of_mean),
        covariance: limits.covariance,
    })
}

/// The shares of the mean that a matched scan has at every place, its pattern taken off, and the pattern.
fn shares_of(
    scan: &ScanPlaces,
    limits: &PlaceLimits,
    precision: &TermMatrix,
) -> (Vec<Option<f64>>, Option<Coefficients>) {
    let compared = limits.compared(scan);
    let mut shares = vec![None; scan.uptake.len()];
    let Some(found) = matched_places(&compared, precision) else {
        return (shares, None);
    };
    for place in &compared {
        let pattern = share_at(place.index, &found.pattern) - 1.0;
        shares[place.index] = Some(place.uptake / found.counts / place.mean - pattern);
    }
    (shares, Some(found.pattern))
}

fn mean_at<I: Iterator<Item = f64>>(places: usize, values: impl Fn(usize) -> I) -> Vec<f64> {
    let mean = |index| {
        let (sum, number) = values(index).fold((0.0, 0), |(sum, n), value| (sum + value, n + 1));
        if number > 0 {
            sum / f64::from(number)
        } else {
            0.0
        }
    };
    (0..places).map(mean).collect()
}

/// The variance with n - 1 degrees of freedom; 0 for less than two values.
fn variance(values: Vec<f64>) -> f64 {
    let n = values.len() as f64;
    if n < 2.0 {
        return 0.0;
    }
    let mean = values.iter().sum::<f64>() / n;
    values
        .iter()
        .map(|value| (value - mean).powi(2))
        .sum::<f64>()
        / (n - 1.0)
}

/// The median of a scan's muscle by area; 1 without any.
fn median_uptake(scan: &ScanPlaces) -> f64 {
    let muscle = scan.uptake.iter().zip(&scan.area);
    let values = muscle.filter_map(|(uptake, area)| Some(((*uptake)?, *area)));
    weighted_quantile(values.collect(), 0.5)
        .filter(|value| *value > 0.0)
        .unwrap_or(1.0)
}

/// Limits of every figure that enough people have, in the order of their first appearance.
fn figure_limits(people: &[&HealthyScan]) -> Vec<GlobalLimit> {
    let mut names: Vec<(&str, Option<usize>)> = Vec::new();
    for own in people.iter().flat_map(|person| &person.figures) {
        if !names.contains(&(own.figure, own.segment)) {
            names.push((own.figure, own.segment));
        }
    }
    let limit = |(name, segment): (&str, Option<usize>)| {
        let figures = people.iter().flat_map(|person| &person.figures);
        let mut values: Vec<f64> = figures
            .filter(|own| own.figure == name && own.segment == segment && own.value.is_finite())
            .map(|own| own.value)
            .collect();
        let n = values.len();
        (n >= FEWEST_CASES).then(|| {
            values.sort_by(f64::total_cmp);
            GlobalLimit {
                figure: name.to_owned(),
                segment,
                n,
                mean: round(values.iter().sum::<f64>() / n as f64),
                low: round(quantile(&values, 0.025)),
                high: round(quantile(&values, 0.975)),
                sd: round(variance(values).sqrt()),
            }
        })
    };
    names.into_iter().filter_map(limit).collect()
}
