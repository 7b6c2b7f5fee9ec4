//! The wall at one moment of the beat, as the rays of [`VentricleWall`](crate::heart::model::wall::VentricleWall) meet it.

use super::fields::{COLUMNS as NODE_COLUMNS, Layout, Nodes, WallState};
use crate::base::geometry::Vec3;
use crate::heart::model::wall::{RAY_COLUMNS, RAY_ROWS, RayCoordinates, area_vector};

/// Both surfaces of the wall at a moment; each ray follows the same muscle through the beat.
#[derive(Debug, Clone, PartialEq)]
pub struct WallMoment {
    /// Points of the inner surface, LPS mm, [`RAY_ROWS`] × [`RAY_COLUMNS`], apex first; also of rays beyond the rim.
    pub inner: Vec<Vec3>,
    /// Points of the outer surface, LPS mm.
    pub outer: Vec<Vec3>,
    /// Thickness along the rays, mm.
    pub thickness: Vec<f64>,
    /// Whether each ray lies apical of the rim.
    pub on: Vec<bool>,
}

impl WallMoment {
    pub(super) fn new(
        coordinates: &RayCoordinates,
        layout: &Layout,
        state: &WallState,
        rim: &[f64],
        row_spacing: f64,
    ) -> Self {
        let (mut inner, mut outer) = (Vec::new(), Vec::new());
        let (mut thickness, mut on) = (Vec::new(), Vec::new());
        for row in 0..RAY_ROWS {
            let arc = (row as f64 + 0.5) * row_spacing;
            for column in 0..RAY_COLUMNS {
                let turn = (column as f64 + 0.5) / RAY_COLUMNS as f64;
                let nodes = Nodes::at(layout.rows, arc, turn * NODE_COLUMNS as f64);
                let mid = nodes.value(&state.mid_wall);
                let thick = nodes.value(&state.thickness);
                let (start, direction) = coordinates.ray(arc, turn, state.stretch);
                inner.push(start + direction * (mid - thick / 2.0).max(0.0));
                outer.push(start + direction * (mid + thick / 2.0));
                thickness.push(thick);
                on.push(arc < nodes.rim(rim));
            }
        }
        Self {
            inner,
            outer,
            thickness,
            on,
        }
    }
}

/// The area vector (outward) that each point of a surface of [`RAY_ROWS`] × [`RAY_COLUMNS`] points stands for, mm².
pub(super) fn area_vectors(points: &[Vec3]) -> Vec<Vec3> {
    let at = |row: usize, column: usize| &points[row * RAY_COLUMNS + column];
    let of = |ray: usize| area_vector(at, ray / RAY_COLUMNS, ray % RAY_COLUMNS);
    let mut areas: Vec<Vec3> = (0..points.len()).map(of).collect();
    let middle = points.iter().sum::<Vec3>() / points.len() as f64;
    let outward: f64 = (points.iter().zip(&areas))
        .map(|(p, a)| a.dot(&(p - middle)))
        .sum();
    if outward < 0.0 {
        areas.iter_mut().for_each(|a| *a = -*a);
    }
    areas
}

/// Motion and thickening of each ray between two moments.
#[derive(Debug, Clone, PartialEq)]
pub struct Contraction {
    /// Motion of the inner surface along its inward normal, the shift of the whole outer surface taken off, mm.
    pub motion_mm: Vec<f64>,
    /// Thickening, per cent.
    pub thickening_percent: Vec<f64>,
    /// Area of the inner surface at the first moment, mm²; 0 beyond the rim.
    pub areas: Vec<f64>,
}

impl Contraction {
    /// From `before` (end diastole) to `after` (end systole).
    pub fn between(before: &WallMoment, after: &WallMoment) -> Self {
        let on = &before.on;
        let normals = area_vectors(&before.inner);
        let weight = |i: usize| if on[i] { normals[i].norm() } else { 0.0 };
        let total: f64 = (0..on.len()).map(weight).sum();
        let shift = (0..on.len())
            .map(|i| (after.outer[i] - before.outer[i]) * weight(i))
            .sum::<Vec3>()
            / total.max(1e-9);
        Self {
            motion_mm: (0..on.len())
                .map(|i| {
                    let normal = normals[i].try_normalize(1e-12).unwrap_or_default();
                    -(after.inner[i] - before.inner[i] - shift).dot(&normal)
                })
                .collect(),
            thickening_percent: (before.thickness.iter().zip(&after.thickness))
                .map(|(before, after)| 100.0 * (after / before - 1.0))
                .collect(),
            areas: (0..on.len()).map(weight).collect(),
        }
    }
}
