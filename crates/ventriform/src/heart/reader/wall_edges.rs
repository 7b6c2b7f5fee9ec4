//! Where a fitted wall begins and ends about a point, by its rays.

use super::profile::ReaderOffsets;
use crate::base::geometry::Vec3;
use crate::heart::model::wall::{RAY_COLUMNS, RAY_ROWS, VentricleWall};

/// The thickness that is left at least, mm.
pub(super) const MIN_THICKNESS_MM: f64 = 3.0;

/// Beginning and end of the wall on each ray, mm; rays beyond the rim have those of the next ray of
/// their column.
pub(super) struct WallEdges(Vec<[f64; 2]>);

impl WallEdges {
    pub(super) fn from_wall(wall: &VentricleWall) -> Self {
        let mut edges = vec![[0.0, 0.0]; RAY_ROWS * RAY_COLUMNS];
        for column in 0..RAY_COLUMNS {
            let mut last = None;
            let known = |row: usize| wall.rays[row * RAY_COLUMNS + column].wall;
            let first = (0..RAY_ROWS).find_map(known);
            for row in 0..RAY_ROWS {
                last = known(row).or(last);
                edges[row * RAY_COLUMNS + column] =
                    last.or(first).unwrap_or([0.0, MIN_THICKNESS_MM]);
            }
        }
        Self(edges)
    }

    /// Beginning and end of the wall on the ray through a point.
    pub(super) fn about(&self, wall: &VentricleWall, point: &Vec3) -> [f64; 2] {
        let position = wall.position(point);
        self.at(position.row, position.column)
    }

    /// The displacement of a point of the wall by `offsets`, without that of the rim, mm.
    pub(super) fn shift(
        &self,
        wall: &VentricleWall,
        point: &Vec3,
        offsets: &ReaderOffsets,
    ) -> Vec3 {
        let position = wall.position(point);
        let [inner, outer] = self.at(position.row, position.column);
        let thickness = (outer - inner).max(1e-6);
        let thinner = offsets.endocardium - offsets.epicardium;
        let most = (thickness - MIN_THICKNESS_MM).max(0.0);
        let part = if thinner > most { most / thinner } else { 1.0 };
        let depth = ((position.distance - inner) / thickness).clamp(0.0, 1.0);
        let along = offsets.endocardium * (1.0 - depth) + offsets.epicardium * depth;
        // A point on the axis stays on it.
        let along = (part * along).max(-position.distance);
        position.direction * along
    }

    /// The edges between rays, linear in row and column.
    fn at(&self, row: f64, column: f64) -> [f64; 2] {
        let row = row.clamp(0.0, RAY_ROWS as f64 - 1.0);
        let (low, left) = (row.floor().min(RAY_ROWS as f64 - 2.0), column.floor());
        let (up, right) = (row - low, column - left);
        let value = |r: usize, c: usize, side: usize| {
            let column = (left as usize + c) % RAY_COLUMNS;
            self.0[(low as usize + r) * RAY_COLUMNS + column][side]
        };
        [0, 1].map(|side| {
            (1.0 - up) * ((1.0 - right) * value(0, 0, side) + right * value(0, 1, side))
                + up * ((1.0 - right) * value(1, 0, side) + right * value(1, 1, side))
        })
    }
}
