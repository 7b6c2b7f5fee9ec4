//! The turn of one polar map against another about the long axis.
//!
//! In: two maps. Out: the angle at which they differ least, or 0 where no other angle is significantly better: the
//! posture that both were named by is the better guess as long as the images do not contradict it. A difference
//! counts up to [`CAP_SD`] deviations of a usual pair, so that a defect in one of them does not decide.

use super::calibration::SIGNIFICANT_TURN_GAIN;
use super::noise::Noise;
use super::scale::{Sides, matched};
use crate::heart::model::wall::{RAY_COLUMNS, RAY_ROWS};
use crate::heart::normals::ScanPlaces;
use crate::heart::polar::{Pixel, PolarMap};

/// Greatest turn, degrees.
pub const MOST_DEGREES: f64 = 15.0;
/// Angles that are tried, each this far from the next, degrees.
const STEP_DEGREES: f64 = 1.5;
/// Standard deviations of the difference up to which a difference counts.
const CAP_SD: f64 = 2.5;

/// The turn of one map against another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    /// Counter-clockwise as the map is drawn, degrees; 0 where the maps do not ask for one.
    pub degrees: f64,
    /// Share by which the best angle lowers the mean squared difference.
    pub gain: f64,
    /// Correlation of the maps at that turn.
    pub correlation: f64,
}

impl Turn {
    /// The turn of the stress map against the rest map.
    pub(super) fn from_sides(sides: &Sides<'_>) -> Self {
        let rest = ScanPlaces::from_map(sides.rest);
        let squares = |degrees: f64| mean_square(sides, &rest, degrees);
        let posture = squares(0.0);
        let steps = (MOST_DEGREES / STEP_DEGREES) as i32;
        let best = (-steps..=steps)
            .map(|step| f64::from(step) * STEP_DEGREES)
            .map(|degrees| (degrees, squares(degrees)))
            .fold(
                (0.0, posture),
                |best, next| if next.1 < best.1 { next } else { best },
            );
        let gain = 1.0 - best.1 / posture;
        // At the end of the range, the best angle lies beyond it: the maps differ in something else.
        let inside = best.0.abs() < MOST_DEGREES;
        let degrees = if gain > SIGNIFICANT_TURN_GAIN && inside {
            best.0
        } else {
            0.0
        };
        Self {
            degrees,
            gain,
            correlation: correlation(sides.rest, &turned(sides.stress, degrees)),
        }
    }
}

/// Mean over the compared area of the squared difference at that turn, per cent of the reference.
fn mean_square(sides: &Sides<'_>, rest: &ScanPlaces, degrees: f64) -> f64 {
    let stress = ScanPlaces {
        uptake: turned(sides.stress, degrees),
        ..rest.clone()
    };
    let Some(scale) = matched(&stress, rest, sides.rest.reference, Noise::USUAL) else {
        return f64::INFINITY;
    };
    let (mut sum, mut area) = (0.0, 0.0);
    for (index, own) in rest.area.iter().enumerate() {
        let (Some(at_rest), Some(at_stress)) = (rest.uptake[index], stress.uptake[index]) else {
            continue;
        };
        let points = 100.0 * (at_rest - at_stress / scale.counts) / sides.rest.reference;
        sum += own * points.abs().min(CAP_SD * Noise::USUAL.points).powi(2);
        area += own;
    }
    sum / area
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heart::polar::tests::map_of;

    /// Uptake with a defect a fifth of the circle wide.
    fn uptake(degrees: f64) -> impl Fn(usize, usize) -> f64 {
        move |row, column| {
            let angle = 6.0 * (column as f64 + 0.5) - degrees;
            let away = ((angle - 90.0 + 180.0).rem_euclid(360.0) - 180.0).abs();
            let dark = 0.5 / (1.0 + ((away - 36.0) / 6.0).exp());
            100.0 * (1.0 - if row > 6 { dark } else { 0.0 })
        }
    }

    #[test]
    fn a_map_that_is_turned_is_turned_back() {
        let rest = map_of(uptake(0.0));
        for degrees in [-12.0, -6.0, 0.0, 9.0] {
            let stress = map_of(uptake(degrees));
            let found = Turn::from_sides(&Sides {
                stress: &stress,
                rest: &rest,
            });
            assert!(
                (found.degrees - degrees).abs() < 1.0,
                "{degrees}: {found:?}"
            );
            assert!(found.correlation > 0.98);
        }
    }

    /// A defect at stress alone is no turn.
    #[test]
    fn a_defect_in_one_map_turns_nothing() {
        let (stress, rest) = (map_of(uptake(0.0)), map_of(|_, _| 100.0));
        let found = Turn::from_sides(&Sides {
            stress: &stress,
            rest: &rest,
        });
        assert_eq!(found.degrees, 0.0);
    }

    #[test]
    fn a_turn_of_whole_columns_moves_columns() {
        let map = map_of(|row, column| (row * 100 + column) as f64);
        let moved = turned(&map, 12.0);
        assert_eq!(moved[3 * RAY_COLUMNS + 5], Some(307.0));
        assert_eq!(moved[3 * RAY_COLUMNS + 59], Some(301.0));
        assert_eq!(turned(&map, -3.0)[0], Some(29.5));
    }
}
