//! Where the fit of a beat starts: the wall of the summed image, standing still.
//!
//! In: the anatomical wall that was fitted to the summed image, and that image. Out: for every node of the fields the
//! distances at which the wall begins and ends and the image's largest value on the way through it, and the rim.

use super::fields::{COLUMNS, Layout, ROW_SPACING_MM};
use crate::heart::model::wall::{self, RayCoordinates, VentricleWall};
use crate::image::grid::field::Field;

/// Length beyond the wall on both sides on which the largest value is sought, mm.
const PEAK_MARGIN_MM: f64 = 3.0;
/// Samples on the way through the wall.
const PEAK_SAMPLES: usize = 20;
/// Rays of the wall for each column of nodes.
const RAYS_PER_COLUMN: usize = wall::RAY_COLUMNS / COLUMNS;

/// The wall of the summed image at the nodes.
#[derive(Debug, Clone)]
pub(super) struct StillWall {
    /// Distances at which the ray of each node enters and leaves the wall, mm.
    pub walls: Vec<[f64; 2]>,
    /// Largest value of the image on the way through the wall at each node.
    pub peaks: Vec<f64>,
    /// Arc of the rim in each column, mm.
    pub rim: Vec<f64>,
}

impl StillWall {
    pub fn new(wall: &VentricleWall, layout: &Layout, image: &Field) -> Self {
        let coordinates = wall.coordinates();
        let rim: Vec<f64> = (0..COLUMNS).map(|column| rim_of(wall, column)).collect();
        let mut walls: Vec<[f64; 2]> = Vec::with_capacity(layout.nodes());
        for row in 0..layout.rows {
            for column in 0..COLUMNS {
                // Beyond the rim and where rays miss the wall, that of the row before.
                let before = walls.len().checked_sub(COLUMNS).map(|node| walls[node]);
                let usual = [0.6, 1.0].map(|share| share * coordinates.cap_radius);
                let met = met_at(wall, row, column, rim[column]);
                walls.push(met.or(before).unwrap_or(usual));
            }
        }
        let peaks = (walls.iter().enumerate())
            .map(|(node, ends)| peak(&coordinates, image, node, *ends))
            .collect();
        Self { walls, peaks, rim }
    }

    /// Distance of the middle of the wall at a node, mm.
    pub fn mid_wall(&self, node: usize) -> f64 {
        let [enters, leaves] = self.walls[node];
        f64::midpoint(enters, leaves)
    }
}

/// The rays about a column of nodes.
fn rays_of(column: usize) -> impl Iterator<Item = usize> {
    let first = column * RAYS_PER_COLUMN + wall::RAY_COLUMNS - RAYS_PER_COLUMN / 2;
    (first..first + RAYS_PER_COLUMN).map(|ray| ray % wall::RAY_COLUMNS)
}

fn rim_of(wall: &VentricleWall, column: usize) -> f64 {
    let arc = |ray: usize| {
        let met = |row: &usize| wall.rays[row * wall::RAY_COLUMNS + ray].wall.is_some();
        let rows = (0..wall::RAY_ROWS).rev().find(met).map_or(0, |row| row + 1);
        rows as f64 * wall.row_spacing
    };
    rays_of(column).map(arc).sum::<f64>() / RAYS_PER_COLUMN as f64
}

/// Mean distances of the wall on the rays about a node.
fn met_at(wall: &VentricleWall, row: usize, column: usize, rim: f64) -> Option<[f64; 2]> {
    let last = (rim / wall.row_spacing - 1.0).floor();
    let last = last.clamp(0.0, (wall::RAY_ROWS - 1) as f64);
    let at = (row as f64 * ROW_SPACING_MM / wall.row_spacing - 0.5).clamp(0.0, last);
    let (mut sum, mut weight) = ([0.0; 2], 0.0);
    for (row, share) in [(at.floor(), 1.0 - at.fract()), (at.ceil(), at.fract())] {
        for ray in rays_of(column) {
            if let Some([enters, leaves]) = wall.rays[row as usize * wall::RAY_COLUMNS + ray].wall {
                sum[0] += share * enters;
                sum[1] += share * leaves;
                weight += share;
            }
        }
    }
    (weight > 0.0).then(|| sum.map(|sum| sum / weight))
}

fn peak(
    coordinates: &RayCoordinates,
    image: &Field,
    node: usize,
    [enters, leaves]: [f64; 2],
) -> f64 {
    let arc = (node / COLUMNS) as f64 * ROW_SPACING_MM;
    let turn = (node % COLUMNS) as f64 / COLUMNS as f64;
    let (start, direction) = coordinates.ray(arc, turn, 1.0);
    let length = leaves - enters + 2.0 * PEAK_MARGIN_MM;
    (0..=PEAK_SAMPLES)
        .map(|n| enters - PEAK_MARGIN_MM + length * n as f64 / PEAK_SAMPLES as f64)
        .map(|distance| image.at(&(start + direction * distance)))
        .fold(0.0, f64::max)
}
