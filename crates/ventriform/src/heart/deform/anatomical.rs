//! The wall itself, from the wall as it looks.
//!
//! Blur makes the wall of a ventricle look thicker than it is: the camera's point response, the
//! beating and the breathing move its apparent edges into the cavity and outward. In go the fitted
//! model, its [`VentricleWall`] and the image; out comes the model with its inner surface moved
//! outward and its outer surface moved inward ([`anatomical_mesh`]).
//!
//! 1. Each ray of the wall is described by eleven numbers (`describe`): thickness and inner radius
//!    of the whole wall, thickness, radius and uptake at the ray, and the way from apex to base.
//! 2. Two linear functions of these numbers ([`INNER_SHIFT_MM`], [`OUTER_SHIFT_MM`]) are the distances by which the
//!    two surfaces move along the ray. In an image smoother than usual ([`smoothness`](crate::image::grid::smoothness)), both
//!    move farther ([`SMOOTHNESS_SHIFT`]).
//! 3. These distances are those of usual walls. The mean thickness is known from the wall's width as far as that tells it
//!    ([`wall_thickness`](super::wall_thickness)): all distances are scaled so that it is left.
//! 4. Where the muscle's volume is stated, they are scaled so that it is enclosed.
//! 5. Every node moves along its ray by the distance interpolated between the two surfaces, which
//!    keeps the order of points along a ray, so that the surfaces cannot cross.
//!
//! The coefficients are a least-squares fit to simulated hearts with usual walls, which are known;
//! `scripts/measure/calibrate_walls.py` estimates them again. Two other
//! ways were tried on the same hearts and came out behind. A fixed shift of both surfaces makes
//! small hearts too thin. A forward model (the wall rendered, blurred and compared with the image)
//! cannot tell the width of the point response from the wall's thickness: its least residual lies
//! at the same width for all hearts, whatever their filter.
//!
//! Not guaranteed: a single heart's wall. Beating and breathing blur the wall as much as the camera
//! does and cannot be measured in an image that is not gated; the mean thickness of a usual heart scatters
//! by about 1.2 mm about the true one. No figure of the image that was tried tells the rest (14 of them on 65 hearts,
//! each left out): hollowness, uptake, thickness, strength of the edges and the like.

use super::calibration::{
    CAVITY_SIZE_SHIFT, INNER_SHIFT_MM, NARROW_CAVITY_SHIFT, OUTER_SHIFT_MM, SMOOTHNESS_SHIFT,
};
use super::ray_terms::{RayTerms, SmoothnessShift};
use super::thickness_calibration::MEAN_THICKNESS_SHIFT_MM;
use super::wall_thickness::{WallLook, WallThickness};
use crate::base::geometry::Vec3;
use crate::base::numeric::order;
use crate::heart::model::wall::{RAY_COLUMNS, RAY_ROWS, VentricleWall};
use crate::image::grid::field::Field;
use crate::mesh::TriMesh;
use crate::mesh::intersections::self_intersections;

/// The thickness that is left at least, mm.
const MIN_THICKNESS_MM: f64 = 4.0;

/// Standard deviations of the smoothing of thickness, radius and uptake, rows and columns.
const SMOOTHING_SIGMA_RAYS: [f64; 2] = [1.5, 3.0];

/// An image about a wall, and what is known of its blur.
#[derive(Debug, Clone, Copy)]
pub struct BlurredImage<'a> {
    /// The image, blurred further for the sensors.
    pub field: &'a Field,
    /// Its smoothness, mm.
    pub smoothness_mm: Option<f64>,
    /// The length of its noise, mm.
    pub noise_length_mm: Option<f64>,
    /// The image's resolution (full width of a point at half its maximum, mm), if it is stated.
    pub resolution_mm: Option<f64>,
}

/// `mesh`, whose apparent wall is `wall`, with its surfaces moved to the anatomical wall, and what is known of that
/// wall's thickness. The wall encloses `muscle_ml`, if that is stated, as nearly as its thinnest places allow. Where a
/// direction has no wall at all, the mesh stays, and nothing is known.
pub fn anatomical_mesh(
    mesh: &TriMesh,
    wall: &VentricleWall,
    image: &BlurredImage<'_>,
    muscle_ml: Option<f64>,
) -> (TriMesh, Option<WallThickness>) {
    let Some(found) = WallShifts::new(wall, image) else {
        return (mesh.clone(), None);
    };
    let shifts = match muscle_ml {
        Some(muscle_ml) => found.enclosing(muscle_ml, mesh, wall),
        None => found,
    };
    // Large triangles may still cut through a thin wall.
    let moved = [1.0, 0.75, 0.5, 0.25]
        .into_iter()
        .map(|share| shifts.moved(mesh, wall, share))
        .find(|moved| self_intersections(moved).is_empty())
        .unwrap_or_else(|| mesh.clone());
    (moved, Some(shifts.thickness))
}

/// Factors of the shifts of a wall whose muscle is stated: from one that is thicker than it looks to one that is as thin
/// as walls can be.
const STATED_FACTORS: [f64; 2] = [-2.0, 6.0];
/// Halvings of that range.
const STATED_HALVINGS: usize = 24;

/// Beginning and end of the wall on each ray, and the distances by which its surfaces move outward, mm.
struct WallShifts {
    inner: RayMap,
    outer: RayMap,
    inner_shift: RayMap,
    outer_shift: RayMap,
    /// The mean thickness that the shifts leave.
    thickness: WallThickness,
}

impl WallShifts {
    fn new(wall: &VentricleWall, image: &BlurredImage<'_>) -> Option<Self> {
        let [inner, outer] = sides(wall)?;
        let rays = describe(&inner, &outer, &uptake(wall, [&inner, &outer], image.field));
        let shift =
            |coefficients: &RayTerms| RayMap::from_fn(|index| coefficients.dot(&rays[index]));
        let (mut inner_shift, mut outer_shift) = (shift(&INNER_SHIFT_MM), shift(&OUTER_SHIFT_MM));
        let of_size = shifts_of_size(wall.cavity_ml);
        let of_smoothness = image.smoothness_mm.map_or([0.0; 2], shifts_of_smoothness);
        for (shift, more) in [&mut inner_shift, &mut outer_shift]
            .into_iter()
            .zip(of_size.into_iter().zip(of_smoothness))
        {
            shift.0.iter_mut().for_each(|x| *x += more.0 + more.1);
        }
        let apparent_mm = mean_difference(&outer, &inner);
        let usual_loss_mm = mean_difference(&inner_shift, &outer_shift);
        let thickness = WallThickness::new(&WallLook {
            apparent_mm,
            cavity_ml: wall.cavity_ml,
            usual_mm: apparent_mm - usual_loss_mm + MEAN_THICKNESS_SHIFT_MM,
            noise_length_mm: image.noise_length_mm,
            resolution_mm: image.resolution_mm,
        });
        let loss_mm = (apparent_mm - (thickness.mean_mm - MEAN_THICKNESS_SHIFT_MM)).max(0.0);
        let factor = if usual_loss_mm > 1e-3 {
            loss_mm / usual_loss_mm
        } else {
            1.0
        };
        for shift in [&mut inner_shift, &mut outer_shift] {
            shift.0.iter_mut().for_each(|x| *x *= factor);
        }
        keep_thinnest([&inner, &outer], [&mut inner_shift, &mut outer_shift]);
        Some(Self {
            inner,
            outer,
            inner_shift,
            outer_shift,
            thickness,
        })
    }

    /// The same scaled so that `mesh`, moved by them, encloses `muscle_ml`.
    fn enclosing(&self, muscle_ml: f64, mesh: &TriMesh, wall: &VentricleWall) -> Self {
        let [mut thick, mut thin] = STATED_FACTORS;
        for _ in 0..STATED_HALVINGS {
            let factor = f64::midpoint(thick, thin);
            let enclosed_ml = self.times(factor).moved(mesh, wall, 1.0).volume() / 1000.0;
            if enclosed_ml > muscle_ml {
                thick = factor;
            } else {
                thin = factor;
            }
        }
        self.times(f64::midpoint(thick, thin))
    }

    /// The same times a factor that is known to be right.
    fn times(&self, factor: f64) -> Self {
        let scaled = |map: &RayMap| RayMap(map.0.iter().map(|x| factor * x).collect());
        let (mut inner_shift, mut outer_shift) =
            (scaled(&self.inner_shift), scaled(&self.outer_shift));
        keep_thinnest(
            [&self.inner, &self.outer],
            [&mut inner_shift, &mut outer_shift],
        );
        let look = self.thickness.look;
        let loss_mm = mean_difference(&inner_shift, &outer_shift);
        let mean_mm = look.apparent_mm - loss_mm + MEAN_THICKNESS_SHIFT_MM;
        Self {
            inner: self.inner.clone(),
            outer: self.outer.clone(),
            inner_shift,
            outer_shift,
            thickness: WallThickness::stated(mean_mm, look),
        }
    }

    /// `mesh` with its surfaces moved by a share of the shifts.
    fn moved(&self, mesh: &TriMesh, wall: &VentricleWall, share: f64) -> TriMesh {
        let mut moved = mesh.clone();
        for p in &mut moved.vertices {
            *p += self.at(wall, p) * share;
        }
        moved
    }

    /// The displacement of a point of the apparent wall, mm.
    fn at(&self, wall: &VentricleWall, point: &Vec3) -> Vec3 {
        let position = wall.position(point);
        let at = |map: &RayMap| map.at(position.row, position.column);
        let (inner, outer) = (at(&self.inner), at(&self.outer));
        let depth = ((position.distance - inner) / (outer - inner).max(1e-6)).clamp(0.0, 1.0);
        let shift = at(&self.inner_shift) * (1.0 - depth) + at(&self.outer_shift) * depth;
        position.direction * shift
    }
}

/// Reduces the shifts of the rays on which less than the least thickness would be left of the wall, both by the same
/// factor; to 0 where the wall is thinner already.
fn keep_thinnest([inner, outer]: [&RayMap; 2], [inner_shift, outer_shift]: [&mut RayMap; 2]) {
    for index in 0..RAY_ROWS * RAY_COLUMNS {
        let thickness = outer.0[index] - inner.0[index];
        let less = inner_shift.0[index] - outer_shift.0[index];
        let most = (thickness - MIN_THICKNESS_MM).max(0.0);
        if less > most {
            inner_shift.0[index] *= most / less;
            outer_shift.0[index] *= most / less;
        }
    }
}

/// By how much more the inner and the outer surface of a heart move outward whose cavity looks like
/// `cavity` ml, mm.
fn shifts_of_size(cavity: f64) -> [f64; 2] {
    let size = cavity.max(1.0).ln();
    [
        -NARROW_CAVITY_SHIFT.per_log_mm * (NARROW_CAVITY_SHIFT.cavity_ml.ln() - size).max(0.0),
        CAVITY_SIZE_SHIFT.per_log_mm * (CAVITY_SIZE_SHIFT.cavity_ml.ln() - size),
    ]
}

/// By how much more the inner and the outer surface move outward in an image of this smoothness, mm.
fn shifts_of_smoothness(smoothness_mm: f64) -> [f64; 2] {
    let SmoothnessShift {
        usual_mm,
        inner_per_log_mm,
        outer_per_log_mm,
        range_mm: [least, greatest],
    } = SMOOTHNESS_SHIFT;
    let smoother = (smoothness_mm.clamp(least, greatest) / usual_mm).ln();
    [inner_per_log_mm * smoother, outer_per_log_mm * smoother]
}

fn mean_difference(a: &RayMap, b: &RayMap) -> f64 {
    let sum: f64 = a.0.iter().zip(&b.0).map(|(a, b)| a - b).sum();
    sum / a.0.len() as f64
}

/// The numbers that describe each ray of the apparent `wall`; `image` is the blurred image about it. `None` where a
/// direction has no wall at all.
pub fn ray_terms(wall: &VentricleWall, image: &Field) -> Option<Vec<RayTerms>> {
    let [inner, outer] = sides(wall)?;
    Some(describe(
        &inner,
        &outer,
        &uptake(wall, [&inner, &outer], image),
    ))
}

/// The distances at which the rays enter and leave the wall, mm.
fn sides(wall: &VentricleWall) -> Option<[RayMap; 2]> {
    let side = |s: usize| RayMap::filled(|index| Some(wall.rays[index].wall?[s]));
    Some([side(0)?, side(1)?])
}

/// The value of the image in the middle of the wall.
fn uptake(wall: &VentricleWall, [inner, outer]: [&RayMap; 2], image: &Field) -> RayMap {
    RayMap::from_fn(|index| {
        let ray = &wall.rays[index];
        let middle = f64::midpoint(inner.0[index], outer.0[index]);
        image.at(&(ray.start + ray.direction * middle))
    })
}

/// The numbers that describe each ray, from the distances at which it enters and leaves the wall,
/// mm, and the image's value in the middle of the wall.
fn describe(inner: &RayMap, outer: &RayMap, uptake: &RayMap) -> Vec<RayTerms> {
    let thickness = RayMap::from_fn(|i| outer.0[i] - inner.0[i]).smoothed();
    let radius = inner.smoothed();
    let uptake = uptake.smoothed();
    let usual = quantile_of(&thickness.0, 0.5);
    let size = (quantile_of(&radius.0[RAY_ROWS / 4 * RAY_COLUMNS..], 0.5).max(2.0) / 15.0).ln();
    let full = quantile_of(&uptake.0, 0.85);
    (0..RAY_ROWS * RAY_COLUMNS)
        .map(|index| {
            let way = ((index / RAY_COLUMNS) as f64 + 0.5) / RAY_ROWS as f64;
            let missing = if full > 0.0 {
                (1.0 - uptake.0[index] / full).clamp(0.0, 1.0)
            } else {
                0.0
            };
            RayTerms {
                constant: 1.0,
                thickness: usual - 15.0,
                ln_radius: size,
                ln_radius_squared: size * size,
                thickness_here: thickness.0[index] - usual,
                narrowness_here: (-radius.0[index].max(2.0) / 12.0).exp(),
                missing_uptake: missing,
                missing_uptake_squared: missing * missing,
                way: way - 0.5,
                way_squared: (way - 0.5).powi(2),
                nearness_to_apex: (-way / 0.12).exp(),
            }
        })
        .collect()
}

/// A number for each ray.
#[derive(Clone)]
struct RayMap(Vec<f64>);

impl RayMap {
    fn from_fn(value: impl FnMut(usize) -> f64) -> Self {
        Self((0..RAY_ROWS * RAY_COLUMNS).map(value).collect())
    }

    /// Rays without a value get that of the next ray of their column, towards the apex first. `None`
    /// if a column has no value at all.
    fn filled(value: impl Fn(usize) -> Option<f64>) -> Option<Self> {
        let mut map = Self(vec![0.0; RAY_ROWS * RAY_COLUMNS]);
        for column in 0..RAY_COLUMNS {
            let known = |row: usize| value(row * RAY_COLUMNS + column);
            for row in 0..RAY_ROWS {
                let apical = (0..=row).rev().find_map(known);
                let found = apical.or_else(|| (row..RAY_ROWS).find_map(known))?;
                map.0[row * RAY_COLUMNS + column] = found;
            }
        }
        Some(map)
    }

    /// Smoothed by a Gaussian along rows and columns. Columns are periodic; beyond the first and the
    /// last row the values there continue.
    fn smoothed(&self) -> Self {
        let [along, around] = SMOOTHING_SIGMA_RAYS.map(|sigma| {
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
            let (row, column) = ((index / RAY_COLUMNS) as i64, index % RAY_COLUMNS);
            let value = |d: i64| {
                let row = (row + d).clamp(0, RAY_ROWS as i64 - 1) as usize;
                self.0[row * RAY_COLUMNS + column]
            };
            along.iter().map(|(d, w)| w * value(*d)).sum()
        });
        Self::from_fn(|index| {
            let (row, column) = (index / RAY_COLUMNS, (index % RAY_COLUMNS) as i64);
            let value = |d: i64| {
                let column = (column + d).rem_euclid(RAY_COLUMNS as i64) as usize;
                rows.0[row * RAY_COLUMNS + column]
            };
            around.iter().map(|(d, w)| w * value(*d)).sum()
        })
    }

    /// The value between rays, linear in row and column.
    fn at(&self, row: f64, column: f64) -> f64 {
        let row = row.clamp(0.0, RAY_ROWS as f64 - 1.0);
        let (low, left) = (row.floor().min(RAY_ROWS as f64 - 2.0), column.floor());
        let (up, right) = (row - low, column - left);
        let value = |r: usize, c: usize| {
            let column = (left as usize + c) % RAY_COLUMNS;
            self.0[(low as usize + r) * RAY_COLUMNS + column]
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

    /// The value 1 on one ray, 0 elsewhere.
    fn impulse(row: usize, column: usize) -> RayMap {
        RayMap::from_fn(|index| f64::from(u8::from(index == row * RAY_COLUMNS + column)))
    }

    #[test]
    fn smoothing_spreads_by_its_deviations_and_goes_round_the_wall() {
        let level = RayMap::from_fn(|_| 7.0).smoothed();
        assert!(level.0.iter().all(|v| (v - 7.0).abs() < 1e-9));
        let (row, column) = (RAY_ROWS / 2, 1);
        let spread = impulse(row, column).smoothed();
        assert!((spread.0.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        let (mut along, mut around) = (0.0, 0.0);
        for (index, v) in spread.0.iter().enumerate() {
            let rows = (index / RAY_COLUMNS) as f64 - row as f64;
            let columns = (index % RAY_COLUMNS) as f64 - column as f64;
            let half = RAY_COLUMNS as f64 / 2.0;
            let columns = (columns + half).rem_euclid(RAY_COLUMNS as f64) - half;
            along += v * rows * rows;
            around += v * columns * columns;
        }
        assert!(
            (along.sqrt() - SMOOTHING_SIGMA_RAYS[0]).abs() < 0.02,
            "{along}"
        );
        assert!(
            (around.sqrt() - SMOOTHING_SIGMA_RAYS[1]).abs() < 0.02,
            "{around}"
        );
    }

    #[test]
    fn a_map_is_linear_between_rays_and_goes_round() {
        let map = RayMap::from_fn(|index| {
            10.0 * (index / RAY_COLUMNS) as f64 + (index % RAY_COLUMNS) as f64
        });
        for (row, column) in [(0.0, 0.0), (3.25, 7.5), (30.75, 12.0), (31.0, 58.25)] {
            assert!((map.at(row, column) - (10.0 * row + column)).abs() < 1e-9);
        }
        // Beyond the ends the values there; between the last column and the first one both.
        assert_eq!((map.at(-4.0, 5.0), map.at(99.0, 5.0)), (5.0, 315.0));
        assert!((map.at(0.0, 59.25) - 0.75 * 59.0).abs() < 1e-9);
    }

    #[test]
    fn the_least_thickness_is_left_on_every_ray() {
        let looks = |index: usize| 1.0 + (index % 23) as f64;
        let (inner, outer) = (
            RayMap::from_fn(|_| 20.0),
            RayMap::from_fn(|i| 20.0 + looks(i)),
        );
        let mut inner_shift = RayMap::from_fn(|_| 4.0);
        let mut outer_shift = RayMap::from_fn(|_| -2.0);
        keep_thinnest([&inner, &outer], [&mut inner_shift, &mut outer_shift]);
        for index in 0..RAY_ROWS * RAY_COLUMNS {
            let (more, less) = (inner_shift.0[index], -outer_shift.0[index]);
            let left = looks(index) - more - less;
            let expected = (looks(index) - 6.0).max(MIN_THICKNESS_MM.min(looks(index)));
            assert!((left - expected).abs() < 1e-9, "{left} {expected}");
            assert!((more - 2.0 * less).abs() < 1e-9, "{more} {less}");
        }
    }

    #[test]
    fn rays_that_miss_the_wall_take_the_next_value_of_their_column() {
        let known = |index: usize| match (index / RAY_COLUMNS, index % RAY_COLUMNS) {
            (row, 4) if row < 3 || row == 9 => None,
            (row, column) => Some((100 * row + column) as f64),
        };
        let map = RayMap::filled(known).unwrap();
        let at = |row: usize, column: usize| map.0[row * RAY_COLUMNS + column];
        assert_eq!((at(0, 4), at(2, 4), at(9, 4)), (304.0, 304.0, 804.0));
        assert_eq!((at(0, 5), at(9, 3)), (5.0, 903.0));
        assert!(RayMap::filled(|index| (index % RAY_COLUMNS != 4).then_some(1.0)).is_none());
    }

    /// A wall of 14 mm about a cavity of 18 mm radius, whose uptake halves at a quarter of its columns.
    #[test]
    fn rays_are_described_by_what_the_wall_is_like() {
        let inner = RayMap::from_fn(|_| 18.0);
        let outer = RayMap::from_fn(|_| 32.0);
        let dark = RAY_COLUMNS / 4..RAY_COLUMNS / 2;
        let uptake = RayMap::from_fn(|i| {
            if dark.contains(&(i % RAY_COLUMNS)) {
                2.0
            } else {
                4.0
            }
        });
        let numbers = describe(&inner, &outer, &uptake);
        let size = 1.2f64.ln();
        for (row, column) in [(0, 0), (10, 50), (31, 22)] {
            let way = (row as f64 + 0.5) / RAY_ROWS as f64;
            let missing = if column == 22 { 0.5 } else { 0.0 };
            let wanted = [
                1.0,
                -1.0,
                size,
                size * size,
                0.0,
                (-1.5f64).exp(),
                missing,
                missing * missing,
                way - 0.5,
                (way - 0.5) * (way - 0.5),
                (-way / 0.12).exp(),
            ];
            let found = numbers[row * RAY_COLUMNS + column].values();
            for (found, wanted) in found.into_iter().zip(wanted) {
                assert!((found - wanted).abs() < 0.02, "{found} {wanted}");
            }
        }
    }

    /// Of a usual wall, uniform in uptake, blur took some on both sides everywhere: the inner surface moves
    /// outward, the outer one inward, together by 2 to 6 mm; where uptake is missing the blur hides more of the
    /// cavity, and a wall that looks thicker than the rest is thinned by more.
    #[test]
    fn the_wall_itself_lies_within_the_wall_as_it_looks() {
        let level = |value: f64| RayMap::from_fn(|_| value);
        let shifts = |inner: &RayMap, outer: &RayMap, uptake: &RayMap, index: usize| {
            let numbers = describe(inner, outer, uptake)[index];
            [INNER_SHIFT_MM, OUTER_SHIFT_MM].map(|coefficients| coefficients.dot(&numbers))
        };
        for (inner, outer) in [(15.0, 30.0), (20.0, 34.0), (26.0, 42.0)] {
            let of = |row| shifts(&level(inner), &level(outer), &level(1.0), row * RAY_COLUMNS);
            let all @ [apex, middle, rim] = [0, RAY_ROWS / 2, RAY_ROWS - 1].map(of);
            for [i, o] in all {
                assert!(
                    i > 0.0 && o < 0.0 && (2.0..10.0).contains(&(i - o)),
                    "{i} {o}"
                );
            }
            // The inner surface moves most at the apex, the outer one at both ends of the wall.
            assert!(
                apex[0] > rim[0] + 1.0 && (apex[1] - rim[1]).abs() < 1.2,
                "{apex:?} {rim:?}"
            );
            assert!(rim[1] < middle[1] - 0.6, "{rim:?} {middle:?}");
        }
        let index = RAY_ROWS / 2 * RAY_COLUMNS + 30;
        let usual = shifts(&level(20.0), &level(34.0), &level(1.0), index);
        let thick = RayMap::from_fn(|i| {
            if (i % RAY_COLUMNS).abs_diff(30) < 12 {
                37.0
            } else {
                34.0
            }
        });
        let thicker = shifts(&level(20.0), &thick, &level(1.0), index);
        assert!(
            thicker[0] > usual[0] + 0.8 && thicker[1] < usual[1] - 0.8,
            "{usual:?} {thicker:?}"
        );
        let all_thick = shifts(&level(20.0), &level(38.0), &level(1.0), index);
        assert!(all_thick[0] > usual[0] + 1.0 && all_thick[1] < usual[1] - 0.5);
        let larger = shifts(&level(30.0), &level(44.0), &level(1.0), index);
        assert!((larger[0] - usual[0]).abs() < 0.6);
        assert!(larger[1] < usual[1] - 0.3, "{usual:?} {larger:?}");
        let defect = RayMap::from_fn(|i| {
            if (i % RAY_COLUMNS).abs_diff(30) < 12 {
                0.5
            } else {
                1.0
            }
        });
        let dark = shifts(&level(20.0), &level(34.0), &defect, index);
        assert!(
            dark[0] > usual[0] + 0.5 && dark[1] < usual[1] - 0.3,
            "{usual:?} {dark:?}"
        );
    }

    /// The mean wall that is left has the thickness that was found, and the blurrier the image, the less is left; no wall
    /// gets thinner than the least thickness.
    #[test]
    fn the_thickness_that_was_found_is_left_and_some_wall_everywhere() {
        use crate::base::geometry::frame::VoxelToPatient;
        use crate::base::progress::Monitor;
        use crate::image::grid::Volume;
        use crate::image::locate::cup::Cup;
        use crate::mesh::shapes;
        let cup = Cup {
            centre: Vec3::new(0.0, 0.0, -25.0),
            axis: -Vec3::z(),
            length: 70.0,
            breadth: 1.0,
        };
        let centre = Vec3::new(0.0, 0.0, -30.0);
        let frame = VoxelToPatient::centred([40; 3], [3.0; 3], centre).unwrap();
        let image = Field::new(&Volume::sampled([40; 3], frame, |_| 1.0), None, 0.0);
        let of = |thickness: f64, resolution_mm: Option<f64>| {
            let mesh = shapes::cup(70.0, 30.0, thickness, 48);
            let wall = VentricleWall::new(&mesh, &cup, &Vec3::y(), &Monitor::silent()).unwrap();
            let image = BlurredImage {
                field: &image,
                smoothness_mm: None,
                noise_length_mm: None,
                resolution_mm,
            };
            WallShifts::new(&wall, &image).unwrap()
        };
        let left = [13.0, 15.0].map(|resolution| {
            let shifts = of(17.0, Some(resolution));
            let mean = |map: &RayMap| map.0.iter().sum::<f64>() / map.0.len() as f64;
            let loss = mean(&shifts.inner_shift) - mean(&shifts.outer_shift);
            let left = mean(&shifts.outer) - mean(&shifts.inner) - loss;
            let found = shifts.thickness.mean_mm - MEAN_THICKNESS_SHIFT_MM;
            assert!((left - found).abs() < 1e-6, "{left} {found}");
            left
        });
        assert!(left[1] < left[0] && left[0] < 17.0, "{left:?}");
        let thin = of(6.0, None);
        for index in 0..RAY_ROWS * RAY_COLUMNS {
            let before = thin.outer.0[index] - thin.inner.0[index];
            let loss = thin.inner_shift.0[index] - thin.outer_shift.0[index];
            let left = before - loss;
            assert!(
                left > MIN_THICKNESS_MM.min(before) - 1e-9,
                "{left} of {before}"
            );
        }
    }

    /// The smoother the image, the more of the wall is blur, as far as was calibrated.
    #[test]
    fn a_smoother_image_takes_more_of_the_wall() {
        let loss = |smoothness_mm: f64| {
            let [inner, outer] = shifts_of_smoothness(smoothness_mm);
            inner - outer
        };
        let [least, greatest] = SMOOTHNESS_SHIFT.range_mm;
        let usual = SMOOTHNESS_SHIFT.usual_mm;
        assert!(least < usual && usual < greatest);
        assert!(loss(least) < 0.0 && loss(greatest) > 0.0);
        assert_eq!(loss(usual), 0.0);
        assert_eq!(loss(2.0 * greatest), loss(greatest));
        assert_eq!(loss(0.0), loss(least));
    }

    #[test]
    fn a_narrow_cavity_keeps_more_of_its_wall_and_a_usual_one_is_left_as_calibrated() {
        let [inner, outer] = shifts_of_size(12.0);
        assert!(inner < -0.5 && outer > 0.5);
        let [inner, outer] = shifts_of_size(CAVITY_SIZE_SHIFT.cavity_ml);
        assert_eq!((inner, outer), (0.0, 0.0));
        // The wall never gets thinner by it, the smaller the heart.
        let added: Vec<f64> = [300.0, 100.0, 60.0, 30.0, 20.0, 10.0, 5.0, 0.0]
            .map(shifts_of_size)
            .map(|[inner, outer]| outer - inner)
            .to_vec();
        assert!(added.is_sorted(), "{added:?}");
    }
}
