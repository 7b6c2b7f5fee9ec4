//! Where the muscle ends at the base, in the direction of every column.
//!
//! In: the largest values along the rays, and the rim of the anatomical wall. Out: the distance from the apex, in
//! rows, at which the muscle ends.
//!
//! 1. The image's end of a column: where its values fall below [`END_SHARE`] of the column's own level (its largest
//!    value in [`LEVEL_ROWS`]), seen from the base. A wall's end, blurred, has half of its height there, whatever the
//!    blur.
//! 2. The image's ends less the rim: a robust fit of a level and a tilt ([`TILT_TERMS`] numbers; columns far from it
//!    hardly count, [`OUTLIER_MM`]) says by how much the whole rim is off.
//! 3. A column whose image ends beyond the fit, or up to [`FOLLOWED_MM`] before it, ends where its image does. One
//!    that ends more than [`DEFECT_MM`] before it is dark, not short: a defect, which must show, so the muscle ends
//!    at the fit. In between it ends in between.
//! 4. The ends are smoothed over neighbouring columns.
//!
//! The three distances were chosen on simulated hearts and phantoms; docs/log/normals.md has their figures,
//! docs/normals.md those of hearts that took no part.
//!
//! Not guaranteed: a defect of half the base or more moves the fit itself.

use nalgebra::{SMatrix, SVector};
use std::f64::consts::TAU;

use crate::heart::model::wall::{RAY_COLUMNS, RAY_ROWS, VentricleWall};

/// Share of a column's level at which its image ends.
const END_SHARE: f64 = 0.5;
/// Rows whose largest value is a column's level.
const LEVEL_ROWS: std::ops::Range<usize> = 14..27;
/// Numbers of the fit: level, cosine and sine of the angle.
const TILT_TERMS: usize = 3;
/// Distance from the fit at which a column counts half, mm.
const OUTLIER_MM: f64 = 3.0;
/// Rounds of reweighting.
const REWEIGHTING_ROUNDS: usize = 60;
/// Distance before the fit up to which the image is followed, mm.
const FOLLOWED_MM: f64 = 2.0;
/// Distance before the fit from which a column is dark, not short, mm.
const DEFECT_MM: f64 = 5.0;
/// Standard deviation of the smoothing, columns.
const SMOOTHING_COLUMNS: f64 = 1.0;

/// The distance from the apex, in rows of `wall`, at which the muscle ends in every column. `largest` are the largest
/// values along its rays, row by row; `anatomical` is the anatomical wall of the same fit.
pub(super) fn muscle_ends(
    largest: &[f64],
    wall: &VentricleWall,
    anatomical: &VentricleWall,
) -> [f64; RAY_COLUMNS] {
    let coordinates = wall.coordinates();
    let focus = wall.along_axis(&coordinates.focus);
    let rows_of = |height: f64| (coordinates.cap_arc() + focus - height) / wall.row_spacing;
    let rims: [f64; RAY_COLUMNS] =
        std::array::from_fn(|column| anatomical.rims[column].map_or(RAY_ROWS as f64, rows_of));
    let apart_mm: [f64; RAY_COLUMNS] = std::array::from_fn(|column| {
        (image_end(largest, column) - rims[column]) * wall.row_spacing
    });
    let expected = fitted(&apart_mm);
    let taken: [f64; RAY_COLUMNS] = std::array::from_fn(|column| {
        let before = expected[column] - apart_mm[column];
        let share = if before > 0.0 {
            ((DEFECT_MM - before) / (DEFECT_MM - FOLLOWED_MM)).clamp(0.0, 1.0)
        } else {
            1.0
        };
        share * before
    });
    let taken = smoothed(&taken);
    std::array::from_fn(|column| {
        rims[column] + (expected[column] - taken[column]) / wall.row_spacing
    })
}

/// The distance from the apex, rows, at which a column's values fall below the share of its level, linear between the
/// rows; [`RAY_ROWS`] if the last row does not.
fn image_end(largest: &[f64], column: usize) -> f64 {
    let value = |row: usize| largest[row * RAY_COLUMNS + column];
    let level = LEVEL_ROWS.map(value).fold(f64::MIN, f64::max);
    let limit = END_SHARE * level;
    let bright = (0..RAY_ROWS).rev().find(|row| value(*row) >= limit);
    match bright {
        Some(row) if row + 1 < RAY_ROWS => {
            let fall = (value(row) - value(row + 1)).max(f64::MIN_POSITIVE);
            row as f64 + 0.5 + ((value(row) - limit) / fall).min(1.0)
        }
        _ => RAY_ROWS as f64,
    }
}

/// Level and tilt of these values of the columns, fitted robustly, at every column.
fn fitted(values: &[f64; RAY_COLUMNS]) -> [f64; RAY_COLUMNS] {
    let terms = |column: usize| {
        let (sin, cos) = (TAU * (column as f64 + 0.5) / RAY_COLUMNS as f64).sin_cos();
        SVector::<f64, TILT_TERMS>::new(1.0, cos, sin)
    };
    let mut sorted = *values;
    sorted.sort_by(f64::total_cmp);
    let mut found = SVector::<f64, TILT_TERMS>::new(sorted[RAY_COLUMNS / 2], 0.0, 0.0);
    for _ in 0..REWEIGHTING_ROUNDS {
        let mut system = SMatrix::<f64, TILT_TERMS, TILT_TERMS>::zeros();
        let mut right = SVector::<f64, TILT_TERMS>::zeros();
        for (column, value) in values.iter().enumerate() {
            let terms = terms(column);
            let odd = (value - terms.dot(&found)) / OUTLIER_MM;
            let weight = 1.0 / (1.0 + odd * odd);
            system += terms * terms.transpose() * weight;
            right += terms * (weight * value);
        }
        let Some(solver) = system.cholesky() else {
            break;
        };
        found = solver.solve(&right);
    }
    std::array::from_fn(|column| terms(column).dot(&found))
}

fn smoothed(values: &[f64; RAY_COLUMNS]) -> [f64; RAY_COLUMNS] {
    const REACH_COLUMNS: usize = 4;
    let weight = |step: usize| (-0.5 * (step as f64 / SMOOTHING_COLUMNS).powi(2)).exp();
    let all: f64 = weight(0) + 2.0 * (1..=REACH_COLUMNS).map(weight).sum::<f64>();
    std::array::from_fn(|column| {
        let at = |step: usize| {
            let ahead = values[(column + step) % RAY_COLUMNS];
            let behind = values[(column + RAY_COLUMNS - step) % RAY_COLUMNS];
            weight(step) * (ahead + behind)
        };
        (weight(0) * values[column] + (1..=REACH_COLUMNS).map(at).sum::<f64>()) / all
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_ends_where_its_values_pass_half_of_its_level() {
        let mut values = vec![100.0; RAY_ROWS * RAY_COLUMNS];
        for row in 29..RAY_ROWS {
            values[row * RAY_COLUMNS + 7] = 20.0;
        }
        assert!((image_end(&values, 7) - (28.5 + 50.0 / 80.0)).abs() < 1e-12);
        assert_eq!(image_end(&values, 8), RAY_ROWS as f64);
    }

    #[test]
    fn a_short_gap_hardly_moves_the_fit_and_a_tilt_is_followed() {
        let tilt =
            |column: usize| 2.0 + 5.0 * (TAU * (column as f64 + 0.5) / RAY_COLUMNS as f64).cos();
        let values = std::array::from_fn(|column| {
            tilt(column)
                - if (20..30).contains(&column) {
                    15.0
                } else {
                    0.0
                }
        });
        for (column, found) in fitted(&values).iter().enumerate() {
            assert!((found - tilt(column)).abs() < 1.0, "{column}: {found}");
        }
    }
}
