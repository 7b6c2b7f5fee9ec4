//! The wall itself, from the wall as it looks.
//!
//! Blur makes the wall of a ventricle look thicker than it is: the camera's point response, the
//! beating and the breathing move its apparent edges into the cavity and outward. In go the fitted
//! model, its [`VentricleWall`] and the image; out comes the model with its inner surface moved
//! outward and its outer surface moved inward ([`anatomical_mesh`]).
//!
//! 1. Each ray of the wall is described by eleven numbers (`describe`): thickness and inner radius
//!    of the whole wall, thickness, radius and uptake at the ray, and the way from apex to base.
//! 2. Two linear functions of these numbers ([`INNER`], [`OUTER`]) are the distances by which the
//!    two surfaces move along the ray.
//! 3. Every node moves along its ray by the distance interpolated between the two surfaces, which
//!    keeps the order of points along a ray, so that the surfaces cannot cross.
//!
//! The coefficients are a least-squares fit to simulated hearts whose walls are known. Two other
//! ways were tried on the same hearts and came out behind. A fixed shift of both surfaces makes
//! small hearts too thin. A forward model (the wall rendered, blurred and compared with the image)
//! cannot tell the width of the point response from the wall's thickness: its least residual lies
//! at the same width for all hearts, whatever their filter.
//!
//! Not guaranteed: a single heart's wall. Beating and breathing blur the wall as much as the camera
//! does and cannot be measured in an image that is not gated; the mean thickness of a heart scatters
//! by about 0.9 mm about the true one. No figure of the image that was tried tells the rest (14 of them on 65 hearts, each
//! left out): hollowness, uptake, thickness, strength of the edges and the like.

use super::blur_correction;
use crate::geometry::Vec3;
use crate::grid::field::Field;
use crate::mesh::TriMesh;
use crate::mesh::intersections::self_intersections;
use crate::model::wall::{COLUMNS, ROWS, VentricleWall};
use crate::numeric::order;

/// The numbers that describe a ray.
const TERMS: usize = 11;

/// Distance by which the inner surface moves outward, mm, for each number that describes a ray.
const INNER: [f64; TERMS] = [
    2.838, 0.526, 1.454, -1.673, 0.413, 0.403, 1.411, 0.545, -1.927, 3.921, -0.076,
];
/// Distance by which the outer surface moves outward, mm, likewise.
const OUTER: [f64; TERMS] = [
    -1.066, -0.223, -1.725, -0.026, -0.417, 0.619, -1.1, -0.075, -1.404, -1.183, -2.356,
];

/// A cavity that looks smaller than the first, ml, is as narrow as the blur: its edge hardly moves any
/// more when the cavity shrinks, and so the inner surface moves outward less, by the second, mm, times the logarithm
/// of the ratio.
const SMALL: (f64, f64) = (25.0, 0.94);
/// The outer surface moves outward more, the smaller the cavity looks: by the second, mm, times the logarithm of
/// the ratio of the first, ml, and the cavity.
const OF_SIZE: (f64, f64) = (68.0, 0.435);

/// The thickness that is left at least, mm.
const THINNEST: f64 = 4.0;

/// Standard deviations of the smoothing of thickness, radius and uptake, rows and columns.
const SMOOTHING: [f64; 2] = [1.5, 3.0];

/// `mesh`, whose apparent wall is `wall`, with its surfaces moved to the anatomical wall. `image` is
/// the blurred image about it. If the image's `resolution` is known (full width of a point at half its
/// maximum, mm), the mean loss of thickness is what a slab under that blur gains
/// ([`blur_correction::excess`]); otherwise it comes from the calibration. Where a direction has no
/// wall at all, the mesh stays.
pub fn anatomical_mesh(
    mesh: &TriMesh,
    wall: &VentricleWall,
    image: &Field,
    resolution: Option<f64>,
) -> TriMesh {
    let Some(shifts) = WallShifts::of(wall, image, resolution) else {
        return mesh.clone();
    };
    let moved = |share: f64| {
        let mut moved = mesh.clone();
        for p in &mut moved.vertices {
            *p += shifts.at(wall, p) * share;
        }
        moved
    };
    // Large triangles may still cut through a thin wall.
    [1.0, 0.75, 0.5, 0.25]
        .into_iter()
        .map(moved)
        .find(|moved| self_intersections(moved).is_empty())
        .unwrap_or_else(|| mesh.clone())
}

/// Where the wall begins and ends on each ray, and by how much its surfaces move outward, mm.
struct WallShifts {
    inner: RayMap,
    outer: RayMap,
    inner_shift: RayMap,
    outer_shift: RayMap,
}

impl WallShifts {
    fn of(wall: &VentricleWall, image: &Field, resolution: Option<f64>) -> Option<Self> {
        let side = |s: usize| RayMap::filled(|index| Some(wall.rays[index].wall?[s]));
        let (inner, outer) = (side(0)?, side(1)?);
        let uptake = RayMap::from_fn(|index| {
            let ray = &wall.rays[index];
            let middle = f64::midpoint(inner.0[index], outer.0[index]);
            image.at(&(ray.start + ray.direction * middle))
        });
        let numbers = describe(&inner, &outer, &uptake);
        let shift = |coefficients: &[f64; TERMS]| {
            RayMap::from_fn(|index| {
                let terms = coefficients.iter().zip(&numbers[index]);
                terms.map(|(c, x)| c * x).sum()
            })
        };
        let (mut inner_shift, mut outer_shift) = (shift(&INNER), shift(&OUTER));
        let of_size = shifts_of_size(wall.cavity_ml);
        for (shift, more) in [&mut inner_shift, &mut outer_shift]
            .into_iter()
            .zip(of_size)
        {
            shift.0.iter_mut().for_each(|x| *x += more);
        }
        if let Some(resolution) = resolution {
            let loss = mean_difference(&inner_shift, &outer_shift);
            let known = blur_correction::excess(mean_difference(&outer, &inner), resolution);
            let factor = if loss > 1e-3 { known / loss } else { 1.0 };
            for shift in [&mut inner_shift, &mut outer_shift] {
                shift.0.iter_mut().for_each(|x| *x *= factor);
            }
        }
        for index in 0..ROWS * COLUMNS {
            let thickness = outer.0[index] - inner.0[index];
            let less = inner_shift.0[index] - outer_shift.0[index];
            let most = (thickness - THINNEST).max(0.0);
            if less > most {
                inner_shift.0[index] *= most / less;
                outer_shift.0[index] *= most / less;
            }
        }
        Some(Self {
            inner,
            outer,
            inner_shift,
            outer_shift,
        })
    }

    /// The displacement of a point of the apparent wall, mm.
    fn at(&self, wall: &VentricleWall, point: &Vec3) -> Vec3 {
        let place = wall.place(point);
        let at = |map: &RayMap| map.at(place.row, place.column);
        let (inner, outer) = (at(&self.inner), at(&self.outer));
        let depth = ((place.distance - inner) / (outer - inner).max(1e-6)).clamp(0.0, 1.0);
        let shift = at(&self.inner_shift) * (1.0 - depth) + at(&self.outer_shift) * depth;
        place.direction * shift
    }
}

/// By how much more the inner and the outer surface of a heart move outward whose cavity looks like
/// `cavity` ml, mm.
fn shifts_of_size(cavity: f64) -> [f64; 2] {
    let size = cavity.max(1.0).ln();
    [
        -SMALL.1 * (SMALL.0.ln() - size).max(0.0),
        OF_SIZE.1 * (OF_SIZE.0.ln() - size),
    ]
}

fn mean_difference(a: &RayMap, b: &RayMap) -> f64 {
    let sum: f64 = a.0.iter().zip(&b.0).map(|(a, b)| a - b).sum();
    sum / a.0.len() as f64
}

/// The numbers that describe each ray, from the distances at which it enters and leaves the wall,
/// mm, and the image's value in the middle of the wall:
/// 1, thickness of the wall (median) less 15 mm, logarithm of its inner radius (median of the rays
/// across the axis and near them) over 15 mm and that squared, thickness at the ray less the median,
/// exp(-radius / 12 mm), the missing share of uptake and that squared, the way from apex to base
/// (less a half) and that squared, and exp(-way / 0.12).
fn describe(inner: &RayMap, outer: &RayMap, uptake: &RayMap) -> Vec<[f64; TERMS]> {
    let thickness = RayMap::from_fn(|i| outer.0[i] - inner.0[i]).smoothed();
    let radius = inner.smoothed();
    let uptake = uptake.smoothed();
    let usual = quantile_of(&thickness.0, 0.5);
    let size = (quantile_of(&radius.0[ROWS / 4 * COLUMNS..], 0.5).max(2.0) / 15.0).ln();
    let full = quantile_of(&uptake.0, 0.85);
    (0..ROWS * COLUMNS)
        .map(|index| {
            let way = ((index / COLUMNS) as f64 + 0.5) / ROWS as f64;
            let missing = if full > 0.0 {
                (1.0 - uptake.0[index] / full).clamp(0.0, 1.0)
            } else {
                0.0
            };
            [
                1.0,
                usual - 15.0,
                size,
                size * size,
                thickness.0[index] - usual,
                (-radius.0[index].max(2.0) / 12.0).exp(),
                missing,
                missing * missing,
                way - 0.5,
                (way - 0.5).powi(2),
                (-way / 0.12).exp(),
            ]
        })
        .collect()
}

/// A number for each ray.
struct RayMap(Vec<f64>);

impl RayMap {
    fn from_fn(value: impl FnMut(usize) -> f64) -> Self {
        Self((0..ROWS * COLUMNS).map(value).collect())
    }

    /// Rays without a value get that of the next ray of their column, towards the apex first. `None`
    /// if a column has no value at all.
    fn filled(value: impl Fn(usize) -> Option<f64>) -> Option<Self> {
        let mut map = Self(vec![0.0; ROWS * COLUMNS]);
        for column in 0..COLUMNS {
            let known = |row: usize| value(row * COLUMNS + column);
            for row in 0..ROWS {
                let apical = (0..=row).rev().find_map(known);
                let found = apical.or_else(|| (row..ROWS).find_map(known))?;
                map.0[row * COLUMNS + column] = found;
            }
        }
        Some(map)
    }

    /// Smoothed by a Gaussian along rows and columns. Columns are periodic; beyond the first and the
    /// last row the values there continue.
    fn smoothed(&self) -> Self {
        let [along, around] = SMOOTHING.map(|sigma| {
            let reach = (4.0 * sigma + 0.5) as i64;
            let weights: Vec<(i64, f64)> = (-reach..=reach)
                .map(|d| (d, (-0.5 * (d as f64 / sigma).powi(2)).exp()))
                .collect();
            let sum: f64 = weights.iter().map(|w| w.1).sum();
            weights
                .into_iter()
                .map(|(d, w)| (d, w / sum))
                .collect::<Vec<_>>()
        });
        let rows = Self::from_fn(|index| {
            let (row, column) = ((index / COLUMNS) as i64, index % COLUMNS);
            let value = |d: i64| {
                let row = (row + d).clamp(0, ROWS as i64 - 1) as usize;
                self.0[row * COLUMNS + column]
            };
            along.iter().map(|(d, w)| w * value(*d)).sum()
        });
        Self::from_fn(|index| {
            let (row, column) = (index / COLUMNS, (index % COLUMNS) as i64);
            let value = |d: i64| {
                let column = (column + d).rem_euclid(COLUMNS as i64) as usize;
                rows.0[row * COLUMNS + column]
            };
            around.iter().map(|(d, w)| w * value(*d)).sum()
        })
    }

    /// The value between rays, linear in row and column.
    fn at(&self, row: f64, column: f64) -> f64 {
        let row = row.clamp(0.0, ROWS as f64 - 1.0);
        let (low, left) = (row.floor().min(ROWS as f64 - 2.0), column.floor());
        let (up, right) = (row - low, column - left);
        let value = |r: usize, c: usize| {
            let column = (left as usize + c) % COLUMNS;
            self.0[(low as usize + r) * COLUMNS + column]
        };
        (1.0 - up) * ((1.0 - right) * value(0, 0) + right * value(0, 1))
            + up * ((1.0 - right) * value(1, 0) + right * value(1, 1))
    }
}

fn quantile_of(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    order::quantile(&sorted, share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_narrow_cavity_keeps_more_of_its_wall_and_a_usual_one_is_left_as_calibrated() {
        let [inner, outer] = shifts_of_size(12.0);
        assert!(inner < -0.5 && outer > 0.5);
        let [inner, outer] = shifts_of_size(OF_SIZE.0);
        assert_eq!((inner, outer), (0.0, 0.0));
        // The wall never gets thinner by it, the smaller the heart.
        let added: Vec<f64> = [300.0, 100.0, 60.0, 30.0, 20.0, 10.0, 5.0, 0.0]
            .map(shifts_of_size)
            .map(|[inner, outer]| outer - inner)
            .to_vec();
        assert!(added.is_sorted(), "{added:?}");
    }
}
