//! The turn of one polar map against another about the long axis.
//!
//! In: two maps. Out: the angle at which they agree best, or 0 where another angle is not significantly better. The posture that both were
//! named by is the better guess as long as the images do not contradict it.

use super::difference::Sides;
use crate::model::wall::{RAY_COLUMNS, RAY_ROWS};
use crate::polar::{Pixel, PolarMap};

/// Greatest turn, degrees.
pub const MOST_DEGREES: f64 = 15.0;
/// Angles that are tried, each this far from the next, degrees.
const STEP_DEGREES: f64 = 1.5;
/// Columns and rows in the width of a point of the image: the values of a map are no more independent than that.
const INDEPENDENT_PLACES: f64 = 24.0;
/// Quotient of the unexplained variances from which a turn is significant: that of an F test of one number at one per cent.
const SIGNIFICANT_F: f64 = 7.0;

/// How one map is turned against another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    /// Counter-clockwise as the map is drawn, degrees; 0 where the maps do not ask for one.
    pub degrees: f64,
    /// Correlation of the maps at that turn.
    pub correlation: f64,
}

impl Turn {
    /// The turn of the stress map against the rest map.
    pub(super) fn of(sides: &Sides<'_>) -> Self {
        let at = |degrees: f64| Self {
            degrees,
            correlation: correlation(sides.rest, &turned(sides.stress, degrees)),
        };
        let posture = at(0.0);
        let steps = (MOST_DEGREES / STEP_DEGREES) as i32;
        let best = (-steps..=steps)
            .map(|step| at(f64::from(step) * STEP_DEGREES))
            .fold(posture, |best, next| {
                if next.correlation > best.correlation {
                    next
                } else {
                    best
                }
            });
        let unexplained = |turn: &Self| 1.0 - turn.correlation.powi(2);
        let independent = (RAY_ROWS * RAY_COLUMNS) as f64 / INDEPENDENT_PLACES;
        let gain = unexplained(&posture) / unexplained(&best).max(1e-9) - 1.0;
        if gain * (independent - 2.0) > SIGNIFICANT_F {
            best
        } else {
            posture
        }
    }
}

/// The uptake of the muscle of `map` turned by `degrees`, linear between columns; `None` beside a place without muscle.
pub(super) fn turned(map: &PolarMap, degrees: f64) -> Vec<Option<f64>> {
    let columns = degrees / 360.0 * RAY_COLUMNS as f64;
    let share = columns - columns.floor();
    let left = columns.floor().rem_euclid(RAY_COLUMNS as f64) as usize;
    let uptake = |row: usize, column: usize| {
        let pixel = map.pixels[row * RAY_COLUMNS + column % RAY_COLUMNS];
        Some(pixel.filter(Pixel::is_muscle)?.max)
    };
    let places = (0..RAY_ROWS).flat_map(|row| (0..RAY_COLUMNS).map(move |column| (row, column)));
    places
        .map(|(row, column)| {
            let first = uptake(row, column + left);
            if share == 0.0 {
                return first;
            }
            Some((1.0 - share) * first? + share * uptake(row, column + left + 1)?)
        })
        .collect()
}

/// Correlation over the places with muscle in both, each by its area; 0 where there are none, or all are alike.
fn correlation(rest: &PolarMap, stress: &[Option<f64>]) -> f64 {
    let both: Vec<[f64; 3]> = (rest.pixels.iter().zip(stress))
        .filter_map(|(pixel, stress)| {
            let pixel = pixel.filter(Pixel::is_muscle)?;
            Some([pixel.area, pixel.max, (*stress)?])
        })
        .collect();
    let area: f64 = both.iter().map(|place| place[0]).sum();
    let mean = |n: usize| both.iter().map(|place| place[0] * place[n]).sum::<f64>() / area;
    let (x, y) = (mean(1), mean(2));
    let product = |n: usize, m: usize| {
        let centred = |place: &[f64; 3], n: usize| place[n] - if n == 1 { x } else { y };
        let terms = both.iter();
        terms
            .map(|place| place[0] * centred(place, n) * centred(place, m))
            .sum::<f64>()
    };
    let spread = (product(1, 1) * product(2, 2)).sqrt();
    if spread > 0.0 {
        product(1, 2) / spread
    } else {
        0.0
    }
}
