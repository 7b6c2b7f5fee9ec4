//! Points that the wall's surface has to pass through, where a person has pulled the contour.
//!
//! In: the [`ThroughPoint`]s and the model as it moves. Out: stiff springs from each point to the place of the model
//! that is nearest to it on its side of the wall ([`holds`]), and sensors that do not see the edge about the point
//! ([`mute`]): the person has said that the edge that they see there is another one. The model's own springs carry what
//! lies between.
//!
//! Not guaranteed: that the surface passes exactly through a point. It ends within a millimetre of it unless points
//! contradict each other, or the model would fold.

use super::error::DeformError;
use super::sensors::{EdgeShift, SensorReading, WallSide};
use crate::base::geometry::Vec3;
use crate::base::geometry::triangle::closest_barycentric;
use crate::mesh::TriMesh;

/// A point of the apparent wall's surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThroughPoint {
    /// Whether the outer surface passes through it, or the inner one.
    pub outer: bool,
    /// Where, LPS mm.
    pub place: Vec3,
}

/// Most points of one side.
pub const MOST_THROUGH_POINTS: usize = 16;

/// Greatest distance of a point from the model before it is deformed, mm: farther ones belong to something else.
pub const MOST_THROUGH_MM: f64 = 40.0;

/// Stiffness of a hold relative to all sensors together.
pub(super) const HOLD_STIFFNESS: f64 = 0.3;

/// Distance from a point at which sensors see the edge by 40 % of their weight, mm: more than an edge of a model of 150
/// points, so that the wall bulges instead of rising to a tip.
const MUTED_RADIUS_MM: f64 = 14.0;

/// The place of the model that a point holds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hold {
    /// The triangle.
    pub triangle: usize,
    /// The place in it, barycentric.
    pub weights: [f64; 3],
    /// The point, LPS mm.
    pub place: Vec3,
    /// How far the model is from it, mm.
    pub distance: f64,
}

/// The nearest place of the model to each point, on its side of the wall.
pub(super) fn holds(mesh: &TriMesh, sides: &EdgeShift, points: &[ThroughPoint]) -> Vec<Hold> {
    if points.is_empty() {
        return Vec::new();
    }
    let side_of = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        let normal = mesh.area_normal(t);
        let normal = normal.try_normalize(0.0).unwrap_or(normal);
        sides.at(&((a + b + c) / 3.0), &normal).0
    };
    let of_triangles: Vec<WallSide> = (0..mesh.triangles.len()).map(side_of).collect();
    let nearest = |point: &ThroughPoint| {
        let wanted = if point.outer {
            WallSide::Outer
        } else {
            WallSide::Inner
        };
        let own = (0..mesh.triangles.len()).filter(|t| of_triangles[*t] == wanted);
        own.map(|triangle| {
            let [a, b, c] = mesh.corners(triangle);
            let weights = closest_barycentric(&point.place, &a, &b, &c);
            let nearest = a * weights[0] + b * weights[1] + c * weights[2];
            Hold {
                triangle,
                weights,
                place: point.place,
                distance: (nearest - point.place).norm(),
            }
        })
        .min_by(|a, b| a.distance.total_cmp(&b.distance))
    };
    points.iter().filter_map(nearest).collect()
}

/// Takes their weight from the sensors about the points, on the side of each.
pub(super) fn mute(readings: &mut [SensorReading], sides: &EdgeShift, points: &[ThroughPoint]) {
    // Hardly any fit has points: the side of each of thousands of sensors is only asked for where there are some.
    for point in points {
        for reading in &mut *readings {
            let (side, _) = sides.at(&reading.place, &reading.normal);
            if (side == WallSide::Outer) == point.outer {
                let away = (reading.place - point.place).norm() / MUTED_RADIUS_MM;
                reading.weight *= 1.0 - (-0.5 * away * away).exp();
            }
        }
    }
}

/// Checks that no point is far from the model.
///
/// # Errors
/// [`DeformError::PointTooFar`].
pub(super) fn check(
    mesh: &TriMesh,
    sides: &EdgeShift,
    points: &[ThroughPoint],
) -> Result<(), DeformError> {
    for (point, hold) in points.iter().zip(holds(mesh, sides, points)) {
        if hold.distance > MOST_THROUGH_MM {
            return Err(DeformError::PointTooFar {
                outer: point.outer,
                place: point.place,
                distance_mm: hold.distance,
                most_mm: MOST_THROUGH_MM,
            });
        }
    }
    Ok(())
}
