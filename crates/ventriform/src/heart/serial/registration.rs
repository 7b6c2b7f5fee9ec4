//! The rigid motion of a heart from one scan to another.
//!
//! In: the images of two scans and the walls fitted in them by one model. Out: the [`Registration`]: where a point of the
//! first scan lies in the later one.
//!
//! 1. The rigid motion that maps the nodes of one wall to those of the other best, in the sense of least squares.
//! 2. From there, the motion at which both images, blurred alike, correlate best over the places about the first wall: steps
//!    along and about three axes, tried in turn and halved where none helps, up to 20 mm and 20 degrees.
//!
//! Guaranteed: the correlation is never less than that of step 1.
//!
//! Not guaranteed: a heart that changed its shape has no rigid motion; the one that is found is a mean.

use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
use crate::base::geometry::rotation::PointAlignment;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::model::wall::{RAY_COLUMNS, VentricleWall};
use crate::image::grid::Volume;
use crate::image::grid::field::Field;
use crate::mesh::TriMesh;
use nalgebra::Rotation3;

/// Blur of both images, sigma in mm: other filters and noise matter less.
const BLUR_MM: f64 = 4.0;
/// How far beyond the wall places are taken on either side, and how far they lie apart, mm.
const BESIDE_MM: f64 = 9.0;
const APART_MM: f64 = 3.0;
/// Every so manieth ray of a row is taken.
const COLUMN_STEP: usize = 3;
/// How far the images may turn and shift the heart from where the nodes put it. A heart that looks alike from all sides would
/// turn about its axis for nothing, and the mean of the walls' nodes would collapse.
const FARTHEST_TURN_DEGREES: f64 = 20.0;
const FARTHEST_SHIFT_MM: f64 = 20.0;
/// The first and the last step, mm and degrees.
const FIRST_STEP: f64 = 4.0;
const LAST_STEP: f64 = 0.1;

/// A turn about the origin, and then a shift, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidMotion {
    /// The turn.
    pub turn: Rotation3<f64>,
    /// The shift, LPS mm.
    pub shift_mm: Vec3,
}

impl RigidMotion {
    /// That which leaves everything where it is.
    pub fn none() -> Self {
        Self {
            turn: Rotation3::identity(),
            shift_mm: Vec3::zeros(),
        }
    }

    /// The motion that maps the points `from` to the points `to` best.
    pub fn between(from: &[Vec3], to: &[Vec3]) -> Self {
        let found = PointAlignment::between(from, to);
        let turn = Rotation3::from_matrix_unchecked(found.turn);
        Self {
            turn,
            shift_mm: found.to - turn * found.from,
        }
    }

    /// Where a point comes to lie.
    pub fn point(&self, p: &Vec3) -> Vec3 {
        self.turn * p + self.shift_mm
    }

    /// Where a direction comes to point.
    pub fn direction(&self, d: &Vec3) -> Vec3 {
        self.turn * d
    }

    /// The motion back.
    pub fn inverse(&self) -> Self {
        let turn = self.turn.inverse();
        Self {
            turn,
            shift_mm: -(turn * self.shift_mm),
        }
    }

    /// The angle of the turn, degrees.
    pub fn degrees(&self) -> f64 {
        self.turn.angle().to_degrees()
    }

    /// This motion, and then a small one about `centre`: shifts along the axes, mm, and turns about them, degrees.
    fn nudged(&self, centre: &Vec3, by: &[f64; 6]) -> Self {
        let [x, y, z, a, b, c] = *by;
        let small = Rotation3::new(Vec3::new(a, b, c).map(f64::to_radians));
        let turn = small * self.turn;
        let shift_mm = small * (self.shift_mm - centre) + centre + Vec3::new(x, y, z);
        Self { turn, shift_mm }
    }
}

/// A heart in its scan.
#[derive(Debug, Clone, Copy)]
pub struct PlacedHeart<'a> {
    /// The scan.
    pub image: &'a Volume,
    /// The wall as it looks.
    pub mesh: &'a TriMesh,
    /// The same seen from the long axis.
    pub wall: &'a VentricleWall,
}

/// Where a heart lies against that of the first scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Registration {
    /// From the first scan to this one.
    pub motion: RigidMotion,
    /// How far the middle of the heart moved, mm.
    pub moved_mm: f64,
    /// Correlation of both images about the wall at that motion.
    pub correlation: f64,
}

impl Registration {
    /// That of the first scan itself.
    pub fn none() -> Self {
        Self {
            motion: RigidMotion::none(),
            moved_mm: 0.0,
            correlation: 1.0,
        }
    }
}

/// The registration of `later` to `first`. Both walls have the nodes of one model.
///
/// # Errors
/// [`Cancelled`].
pub fn registered(
    first: &PlacedHeart<'_>,
    later: &PlacedHeart<'_>,
    monitor: &Monitor,
) -> Result<Registration, Cancelled> {
    let places = places_about(first.wall);
    let blurred = |heart: &PlacedHeart<'_>| {
        let mut region = Aabb::around(&heart.mesh.vertices);
        let room = Vec3::repeat(BESIDE_MM + 4.0 * BLUR_MM + 20.0);
        region.min -= room;
        region.max += room;
        Field::cut_out(heart.image, Some(&region), BLUR_MM, monitor)
    };
    let (here, there) = (blurred(first)?, blurred(later)?);
    let seen: Vec<f64> = places.iter().map(|p| here.at(p)).collect();
    let likeness = |motion: &RigidMotion| {
        let other: Vec<f64> = places.iter().map(|p| there.at(&motion.point(p))).collect();
        correlation(&seen, &other)
    };
    let mut motion = RigidMotion::between(&first.mesh.vertices, &later.mesh.vertices);
    let middle = first.mesh.vertices.iter().sum::<Vec3>() / first.mesh.vertices.len() as f64;
    let centre = motion.point(&middle);
    let start = motion;
    let is_near = |motion: &RigidMotion| {
        let turned = (motion.turn * start.turn.inverse()).angle().to_degrees();
        let shifted = (motion.point(&middle) - centre).norm();
        turned <= FARTHEST_TURN_DEGREES && shifted <= FARTHEST_SHIFT_MM
    };
    let (mut best, mut step) = (likeness(&motion), FIRST_STEP);
    while step > LAST_STEP {
        monitor.check()?;
        let mut better = false;
        for axis in 0..6 {
            for side in [step, -step] {
                let mut by = [0.0; 6];
                by[axis] = side;
                let tried = motion.nudged(&centre, &by);
                if !is_near(&tried) {
                    continue;
                }
                let found = likeness(&tried);
                if found > best {
                    (best, motion, better) = (found, tried, true);
                }
            }
        }
        if !better {
            step /= 2.0;
        }
    }
    Ok(Registration {
        motion,
        moved_mm: (motion.point(&middle) - middle).norm(),
        correlation: best,
    })
}

/// Places in the wall and beside it, LPS mm.
fn places_about(wall: &VentricleWall) -> Vec<Vec3> {
    let rays = wall.rays.iter().enumerate();
    let rays = rays.filter(|(index, _)| (index % RAY_COLUMNS).is_multiple_of(COLUMN_STEP));
    rays.filter_map(|(_, ray)| Some((ray, ray.wall?)))
        .flat_map(|(ray, [inner, outer])| {
            let from = (inner - BESIDE_MM).max(0.0);
            let count = ((outer + BESIDE_MM - from) / APART_MM) as usize;
            (0..=count).map(move |n| ray.start + ray.direction * (from + APART_MM * n as f64))
        })
        .collect()
}

/// The correlation of two lists of values; 0 where one of them is constant.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().max(1) as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / n;
    let (x, y) = (mean(a), mean(b));
    let [mut both, mut of_a, mut of_b] = [0.0; 3];
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (a - x, b - y);
        both += a * b;
        of_a += a * a;
        of_b += b * b;
    }
    let spread = (of_a * of_b).sqrt();
    if spread > 0.0 { both / spread } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Vec<Vec3> {
        (0..40)
            .map(|n| {
                let t = f64::from(n);
                Vec3::new(
                    30.0 * t.sin(),
                    20.0 * (1.7 * t).cos(),
                    40.0 * (0.3 * t).sin(),
                )
            })
            .collect()
    }

    #[test]
    fn a_motion_is_found_and_undone() {
        let turn = Rotation3::new(Vec3::new(0.1, -0.2, 0.15));
        let motion = RigidMotion {
            turn,
            shift_mm: Vec3::new(12.0, -7.0, 3.0),
        };
        let from = points();
        let to: Vec<Vec3> = from.iter().map(|p| motion.point(p)).collect();
        let found = RigidMotion::between(&from, &to);
        assert!((found.turn.matrix() - turn.matrix()).norm() < 1e-12);
        assert!((found.shift_mm - motion.shift_mm).norm() < 1e-10);
        let back = motion.inverse();
        for (p, q) in from.iter().zip(&to) {
            assert!((back.point(q) - p).norm() < 1e-10);
        }
        assert!((motion.degrees() - turn.angle().to_degrees()).abs() < 1e-12);
    }

    /// A turn about a point leaves it where it is.
    #[test]
    fn nudges_turn_about_the_middle_of_the_heart() {
        let motion = RigidMotion {
            turn: Rotation3::new(Vec3::new(0.0, 0.1, 0.0)),
            shift_mm: Vec3::new(5.0, 0.0, -2.0),
        };
        let middle = Vec3::new(40.0, -30.0, 20.0);
        let centre = motion.point(&middle);
        let turned = motion.nudged(&centre, &[0.0, 0.0, 0.0, 3.0, -4.0, 2.0]);
        assert!((turned.point(&middle) - centre).norm() < 1e-10);
        let shifted = motion.nudged(&centre, &[1.0, 2.0, 3.0, 0.0, 0.0, 0.0]);
        let by = shifted.point(&middle) - centre;
        assert!((by - Vec3::new(1.0, 2.0, 3.0)).norm() < 1e-10);
    }

    #[test]
    fn correlation_is_of_likeness_whatever_the_scale() {
        let a: Vec<f64> = (0..50).map(|n| f64::from(n).sin()).collect();
        let scaled: Vec<f64> = a.iter().map(|x| 3.0 * x + 7.0).collect();
        let opposite: Vec<f64> = a.iter().map(|x| -x).collect();
        assert!((correlation(&a, &scaled) - 1.0).abs() < 1e-12);
        assert!((correlation(&a, &opposite) + 1.0).abs() < 1e-12);
        assert_eq!(correlation(&a, &[2.0; 50]), 0.0);
    }
}
