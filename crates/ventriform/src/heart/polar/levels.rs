//! The four levels of the wall along the long axis: basal, mid, apical, apex.

use crate::base::geometry::Vec3;
use crate::heart::model::wall::{RAY_COLUMNS, RAY_ROWS, VentricleWall, area_vector};

/// A part of the wall along the long axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// Beyond the end of the cavity.
    Apex,
    /// The third next to the end of the cavity.
    Apical,
    /// The middle third.
    Mid,
    /// The third next to the rim.
    Basal,
}

impl Level {
    /// Every level, from the apex on.
    pub const ALL: [Level; 4] = [Level::Apex, Level::Apical, Level::Mid, Level::Basal];
}

/// Shares of the way from the rim (0) to the end of the cavity (1) at which the levels end.
const LEVEL_ENDS: [f64; 4] = [1.0, 2.0 / 3.0, 1.0 / 3.0, 0.0];

/// Where each column of rays passes from one level to the next.
#[derive(Debug, Clone, PartialEq)]
pub struct Levels {
    /// For every column, the distance from the apex in rows at which each of [`Level::ALL`] ends; row n
    /// reaches from n to n + 1. Ascending.
    ends: Vec<[f64; 4]>,
}

impl Levels {
    /// Apex to row 4, then three levels of equal height, in every column.
    #[cfg(test)]
    pub(super) fn even() -> Self {
        let rows = super::RAY_ROWS as f64;
        let ends = [1.0, 2.0, 3.0].map(|n| 4.0 + n * (rows - 4.0) / 3.0);
        Self {
            ends: vec![[4.0, ends[0], ends[1], ends[2]]; RAY_COLUMNS],
        }
    }

    /// The levels of a wall with this middle, by rim and cavity of the `anatomical` wall.
    pub(super) fn new(middle: &MiddleSurface, anatomical: &VentricleWall) -> Self {
        let [rim, _] = anatomical.extent;
        let length = (anatomical.cavity_end() - rim).max(1e-6);
        let ends = (0..RAY_COLUMNS).map(|column| {
            let share = |row: usize| {
                let along = anatomical.along_axis(middle.at(row, column));
                (along - rim) / length
            };
            // The share falls from apex to base; where a wall bends back, it stays.
            let mut least = f64::INFINITY;
            let shares: Vec<f64> = (0..RAY_ROWS)
                .map(|row| {
                    least = least.min(share(row));
                    least
                })
                .collect();
            LEVEL_ENDS.map(|end| row_of(&shares, end))
        });
        Self {
            ends: ends.collect(),
        }
    }

    /// For every column, the distance from the apex in rows at which each of [`Level::ALL`] ends.
    pub(super) fn ends(&self) -> &[[f64; 4]] {
        &self.ends
    }

    /// The level of a pixel, by the middle of its row. Beyond the plane of the rim it is basal.
    pub fn of_pixel(&self, row: usize, column: usize) -> Level {
        let middle = row as f64 + 0.5;
        let passed = self.ends[column]
            .iter()
            .filter(|end| middle >= **end)
            .count();
        Level::ALL[passed.min(3)]
    }

    /// The distance from the map's centre, as a share of its radius, of a place `rows` from the apex,
    /// if the levels end at the shares `rings`. At most 1.
    pub(super) fn share(&self, rows: f64, column: usize, rings: &[f64; 4]) -> f64 {
        let (mut from, mut inner) = (0.0, 0.0);
        for (end, outer) in self.ends[column].iter().zip(rings) {
            if rows <= *end {
                let way = (rows - from) / (end - from).max(1e-9);
                return inner + (outer - inner) * way;
            }
            (from, inner) = (*end, *outer);
        }
        1.0
    }
}

/// The distance from the apex in rows at which falling `shares`, taken in the middle of each row, pass
/// `end`; linear beyond the first and the last.
fn row_of(shares: &[f64], end: f64) -> f64 {
    let next = shares.iter().position(|share| *share < end);
    let above = next.unwrap_or(shares.len() - 1).clamp(1, shares.len() - 1) - 1;
    let fall = (shares[above] - shares[above + 1]).max(1e-6);
    (above as f64 + 0.5 + (shares[above] - end) / fall).clamp(0.0, 2.0 * RAY_ROWS as f64)
}

/// The surface midway through the wall, one point for each ray.
pub(super) struct MiddleSurface(Vec<Vec3>);

impl MiddleSurface {
    /// A ray that misses the wall gets the distance of the nearest ray of its column that does not.
    pub fn from_wall(wall: &VentricleWall) -> Self {
        let distance = |row: usize, column: usize| {
            let [enters, leaves] = wall.rays[row * RAY_COLUMNS + column].wall?;
            Some(f64::midpoint(enters, leaves))
        };
        let points = (0..RAY_ROWS * RAY_COLUMNS).map(|index| {
            let (row, column) = (index / RAY_COLUMNS, index % RAY_COLUMNS);
            let apical = (0..=row).rev().find_map(|row| distance(row, column));
            let found = apical.or_else(|| (row..RAY_ROWS).find_map(|row| distance(row, column)));
            let ray = &wall.rays[index];
            ray.start + ray.direction * found.unwrap_or(0.0)
        });
        Self(points.collect())
    }

    /// The point of a ray, LPS mm.
    pub fn at(&self, row: usize, column: usize) -> &Vec3 {
        &self.0[row * RAY_COLUMNS + column]
    }

    /// The area that a ray stands for, mm².
    pub fn area(&self, row: usize, column: usize) -> f64 {
        area_vector(|row, column| self.at(row, column), row, column).norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_between_two_ends_are_shared_out_evenly() {
        let levels = Levels {
            ends: vec![[4.0, 12.0, 20.0, 28.0]],
        };
        let rings = [0.25, 0.5, 0.75, 1.0];
        for (rows, share) in [
            (0.0, 0.0),
            (2.0, 0.125),
            (8.0, 0.375),
            (28.0, 1.0),
            (31.0, 1.0),
        ] {
            assert!((levels.share(rows, 0, &rings) - share).abs() < 1e-12);
        }
        let found = [3, 4, 12, 27, 31].map(|row| levels.of_pixel(row, 0));
        let expected = [
            Level::Apex,
            Level::Apical,
            Level::Mid,
            Level::Basal,
            Level::Basal,
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn a_level_ends_where_the_falling_share_passes_its_end() {
        let shares: Vec<f64> = (0..RAY_ROWS).map(|row| 1.1 - 0.04 * row as f64).collect();
        assert!((row_of(&shares, 1.0) - 3.0).abs() < 1e-9);
        // Beyond the last row.
        assert!((row_of(&shares, -0.3) - 35.5).abs() < 1e-9);
    }
}
