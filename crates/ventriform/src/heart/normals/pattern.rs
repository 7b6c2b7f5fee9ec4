//! The patterns in which healthy hearts differ from their mean as a whole: attenuation, the apex's own uptake, the
//! position in the chest.
//!
//! The ratio of a healthy scan to the normal mean is 1 plus a sum of [`PATTERN_TERMS`] smooth functions of the place,
//! with coefficients that vary from person to person. Their covariance among the healthy is part of the limits. It is
//! the prior of a scan's own coefficients, so that what healthy people vary in is taken off before a place is called
//! low, while a defect, which no healthy person has, hardly is.

use crate::heart::polar::{RAY_COLUMNS, RAY_ROWS};
use nalgebra::{SMatrix, SVector};
use std::f64::consts::TAU;

/// Number of functions.
pub const PATTERN_TERMS: usize = 6;
/// Neighbouring places are not independent: as many of them count as one.
const CORRELATED_PLACES: f64 = 40.0;
/// Least share of the mean that a scan's pattern leaves.
const LEAST_SHARE: f64 = 0.3;

/// Coefficients of the functions.
pub type Coefficients = SVector<f64, PATTERN_TERMS>;
/// A matrix over the functions.
pub type TermMatrix = SMatrix<f64, PATTERN_TERMS, PATTERN_TERMS>;

/// The functions at a place. With the way r from apex (0) to base (1) and the angle a from lateral over anterior: 2 r
/// - 1, r cos a, r sin a, (2 r - 1)² - 1/3, r cos 2a, r sin 2a.
pub(super) fn terms_at(index: usize) -> Coefficients {
    let way = ((index / RAY_COLUMNS) as f64 + 0.5) / RAY_ROWS as f64;
    let angle = TAU * ((index % RAY_COLUMNS) as f64 + 0.5) / RAY_COLUMNS as f64;
    let along = 2.0 * way - 1.0;
    Coefficients::from([
        along,
        way * angle.cos(),
        way * angle.sin(),
        along * along - 1.0 / 3.0,
        way * (2.0 * angle).cos(),
        way * (2.0 * angle).sin(),
    ])
}

/// The share of the mean that a scan with these coefficients has at a place.
pub(super) fn share_at(index: usize, coefficients: &Coefficients) -> f64 {
    (1.0 + terms_at(index).dot(coefficients)).max(LEAST_SHARE)
}

/// A place's ratio to the mean, with its area (the mean over the places is 1) and its relative standard deviation.
pub(super) struct RatioAt {
    pub index: usize,
    pub ratio: f64,
    pub area: f64,
    pub relative_sd: f64,
}

/// Level and coefficients of these ratios, about `precision`, the inverse of the coefficients' covariance; `None`
/// without places, or if the level is not above 0.
pub(super) fn fitted(ratios: &[RatioAt], precision: &TermMatrix) -> Option<(f64, Coefficients)> {
    const UNKNOWNS_OF_FIT: usize = PATTERN_TERMS + 1;
    let mut system = SMatrix::<f64, UNKNOWNS_OF_FIT, UNKNOWNS_OF_FIT>::zeros();
    let mut right = SVector::<f64, UNKNOWNS_OF_FIT>::zeros();
    for at in ratios {
        let terms = terms_at(at.index);
        let row = SVector::<f64, UNKNOWNS_OF_FIT>::from_fn(
            |n, _| if n == 0 { 1.0 } else { terms[n - 1] },
        );
        let weight = at.area / (at.relative_sd * at.relative_sd * CORRELATED_PLACES);
        system += row * row.transpose() * weight;
        right += row * (weight * (at.ratio - 1.0));
    }
    for a in 0..PATTERN_TERMS {
        for b in 0..PATTERN_TERMS {
            system[(a + 1, b + 1)] += precision[(a, b)];
        }
    }
    let found = system.cholesky()?.solve(&right);
    let level = 1.0 + found[0];
    let coefficients = Coefficients::from_fn(|n, _| found[n + 1] / level);
    (level > 0.0).then_some((level, coefficients))
}
