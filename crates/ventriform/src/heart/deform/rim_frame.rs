//! Directions about a ventricle's long axis, and its rim in each of them.
//!
//! In: the axis of a fitted cup and the direction in which the patient's head lies. Out: the height at which a mesh
//! begins in each direction ([`RimFrame::heights`]), and the mesh with its rim moved along the axis
//! ([`RimFrame::stretched`]).

use std::f64::consts::TAU;

use crate::base::geometry::Vec3;
use crate::heart::model::wall::{HalfPlane, anterior, rim_height};
use crate::image::locate::cup::Cup;
use crate::mesh::TriMesh;

/// Directions about the axis: from lateral over anterior, septal and inferior.
pub const RIM_DIRECTIONS: usize = 30;

/// Angle of the middle of a direction, from lateral over anterior.
pub(super) fn rim_angle(direction: usize) -> f64 {
    TAU * (direction as f64 + 0.5) / RIM_DIRECTIONS as f64
}

/// Length of wall next to the rim that is stretched, mm.
pub const STRETCHED_LENGTH_MM: f64 = 25.0;

/// The long axis, and the directions about it.
pub(super) struct RimFrame {
    pub(super) centre: Vec3,
    pub(super) axis: Vec3,
    lateral: Vec3,
    anterior: Vec3,
}

impl RimFrame {
    pub(super) fn new(cup: &Cup, superior: &Vec3) -> Self {
        let anterior = anterior(&cup.axis, superior);
        Self {
            centre: cup.centre,
            axis: cup.axis,
            lateral: anterior.cross(&cup.axis),
            anterior,
        }
    }

    /// Height of a point, mm from the cup's centre towards the apex.
    pub(super) fn along(&self, p: &Vec3) -> f64 {
        (p - self.centre).dot(&self.axis)
    }

    /// 0..[`RIM_DIRECTIONS`]; direction n lies at n.
    pub(super) fn direction(&self, p: &Vec3) -> f64 {
        let r = p - self.centre;
        let angle = r.dot(&self.anterior).atan2(r.dot(&self.lateral));
        (angle / TAU * RIM_DIRECTIONS as f64 - 0.5).rem_euclid(RIM_DIRECTIONS as f64)
    }

    /// Unit vector across the axis in the middle of a direction.
    pub(super) fn outward(&self, direction: usize) -> Vec3 {
        let (sin, cos) = rim_angle(direction).sin_cos();
        self.lateral * cos + self.anterior * sin
    }

    /// `mesh` with its rim, which has these heights, moved towards the base by `shifts` mm.
    pub(super) fn stretched(&self, mesh: &TriMesh, rim: &[f64], shifts: &[f64]) -> TriMesh {
        let mut moved = mesh.clone();
        for p in &mut moved.vertices {
            let direction = self.direction(p);
            let above = self.along(p) - between(rim, direction);
            let share = (1.0 - above / STRETCHED_LENGTH_MM).clamp(0.0, 1.0);
            *p -= self.axis * (share * between(shifts, direction));
        }
        moved
    }

    /// The height at which the mesh begins in each direction, mm from the cup's centre towards the apex. `None` if
    /// there is a direction without any.
    pub(super) fn heights(&self, mesh: &TriMesh) -> Option<Vec<f64>> {
        (0..RIM_DIRECTIONS)
            .map(|direction| {
                let (sin, cos) = rim_angle(direction).sin_cos();
                let plane = HalfPlane {
                    axis: self.axis,
                    outward: self.outward(direction),
                    aside: self.anterior * cos - self.lateral * sin,
                };
                rim_height(mesh, &self.centre, &plane)
            })
            .collect()
    }
}

/// The value at a direction, linear between the given ones.
fn between(values: &[f64], direction: f64) -> f64 {
    let (low, share) = (direction.floor(), direction.fract());
    let at = |n: usize| values[n % RIM_DIRECTIONS];
    at(low as usize) * (1.0 - share) + at(low as usize + 1) * share
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_between_directions_are_linear_and_go_round() {
        let mut values = [1.0; RIM_DIRECTIONS];
        (values[0], values[RIM_DIRECTIONS - 1], values[7]) = (5.0, 3.0, 2.0);
        let last = (RIM_DIRECTIONS - 1) as f64;
        for (at, value) in [
            (0.0, 5.0),
            (0.25, 4.0),
            (last, 3.0),
            (last + 0.75, 4.5),
            (6.5, 1.5),
        ] {
            assert!((between(&values, at) - value).abs() < 1e-12, "{at}");
        }
    }
}
