//! Uptake of the tissue at every point of the patient.
//!
//! The origin of the patient frame is the middle of the torso at the height of the heart. The
//! coordinates of the LV are (toward the anterior wall, toward the septum, from apex to base), with
//! the origin half-way along the outer long axis.

use super::parameters::{PerfusionDefect, PhantomError, PhantomParameters};
use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::geometry::random::{Purpose, stream, uniform};
use crate::base::progress::{Cancelled, Monitor};
use nalgebra::{Matrix3, Rotation3, Unit};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Position of the centre of the array: between the middle of the torso and the heart, so that small
/// and large fields of view both contain the heart.
pub(super) const FIELD_CENTRE: Vec3 = Vec3::new(25.0, -20.0, 0.0);

/// Middle of the LV before the random shift.
const HEART_CENTRE_MM: Vec3 = Vec3::new(45.0, -35.0, 10.0);

/// Sub-voxels along each axis near the heart: partial volume in steps of 1/27.
const SUBVOXELS_PER_AXIS: usize = 3;

/// An ellipsoid with axes along those of the patient.
struct Ellipsoid {
    centre: Vec3,
    radii: Vec3,
}

impl Ellipsoid {
    const fn new(centre: [f64; 3], radii: [f64; 3]) -> Self {
        Self {
            centre: Vec3::new(centre[0], centre[1], centre[2]),
            radii: Vec3::new(radii[0], radii[1], radii[2]),
        }
    }

    fn holds(&self, p: &Vec3) -> bool {
        (p - self.centre).component_div(&self.radii).norm_squared() <= 1.0
    }
}

const LIVER_MM: Ellipsoid = Ellipsoid::new([-70.0, -10.0, -80.0], [95.0, 80.0, 55.0]);
const GUT_MM: [Ellipsoid; 2] = [
    Ellipsoid::new([45.0, -25.0, -95.0], [35.0, 25.0, 16.0]),
    Ellipsoid::new([90.0, 5.0, -105.0], [25.0, 30.0, 18.0]),
];
const LUNGS_MM: [Ellipsoid; 2] = [
    Ellipsoid::new([100.0, 15.0, 60.0], [50.0, 80.0, 120.0]),
    Ellipsoid::new([-85.0, 5.0, 60.0], [60.0, 85.0, 120.0]),
];
/// Half axes of the torso's cross-section, left-right and front-back.
const TORSO_HALF_AXES_MM: [f64; 2] = [170.0, 115.0];
/// Uptake of the lungs as a share of the torso's.
const LUNG_SHARE: f64 = 0.4;
/// Thickness of the right ventricle's wall.
const RV_WALL: f64 = 4.0;

/// Position and orientation of the LV, LPS millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeartPose {
    /// Outermost point of the apex.
    pub apex: Vec3,
    /// Where the long axis leaves the base.
    pub base: Vec3,
    /// Unit vector from base to apex.
    pub axis: Vec3,
    /// Unit vector perpendicular to the axis, toward the middle of the anterior wall.
    pub anterior: Vec3,
    /// Unit vector perpendicular to both, toward the middle of the septum.
    pub septal: Vec3,
}

/// The LV in its pose and everything around it.
pub(super) struct Anatomy<'a> {
    parameters: &'a PhantomParameters,
    centre: Vec3,
    /// Rows: anterior, septal, apex to base.
    to_heart: Matrix3<f64>,
    /// Direction of the basal slant, in (anterior, septal).
    slant: [f64; 2],
    outer: [f64; 2],
    inner: [f64; 2],
    /// Uptake of the wall by AHA segment.
    segments: [f64; 17],
}

/// The uptake at a point, by whether the point is in the wall of the LV.
enum Tissue {
    Wall(f64),
    Other(f64),
}

impl<'a> Anatomy<'a> {
    /// The patient of `parameters`, with the pose that the seed gives.
    pub(super) fn new(parameters: &'a PhantomParameters) -> Self {
        let p = parameters;
        let mut random = stream(p.seed, Purpose::PhantomShape);
        let mut symmetric = || 2.0 * uniform(&mut random) - 1.0;
        let shift = Vec3::from_fn(|_, _| symmetric()) * p.pose_spread_mm;
        let angle = symmetric() * p.pose_spread_deg.to_radians();
        let about = Vec3::from_fn(|_, _| symmetric());
        let slant = symmetric() * PI;
        let turn = match Unit::try_new(about, 1e-9) {
            Some(axis) => Rotation3::from_axis_angle(&axis, angle),
            None => Rotation3::identity(),
        };
        let to_base = turn * -Vec3::from(p.apex_direction).normalize();
        let (anterior, septal) = across(&to_base);
        let rows = [anterior, septal, to_base].map(|v| v.transpose());
        let long = p.length_mm - p.base_mm;
        let wide = p.width_mm / 2.0;
        Self {
            parameters,
            centre: HEART_CENTRE_MM + shift,
            to_heart: Matrix3::from_rows(&rows),
            slant: [slant.cos(), slant.sin()],
            outer: [wide, long],
            inner: [wide - p.wall_mm, long - p.wall_mm],
            segments: wall_uptake(&p.defects),
        }
    }

    /// The patient whose heart has shortened from that length; the apex lies where it lay.
    pub(super) fn contracted(parameters: &'a PhantomParameters, relaxed_length_mm: f64) -> Self {
        let mut anatomy = Self::new(parameters);
        let to_base = anatomy.to_heart.row(2).transpose();
        anatomy.centre -= (relaxed_length_mm - parameters.length_mm) / 2.0 * to_base;
        anatomy
    }

    /// Position and orientation of the LV.
    pub(super) fn pose(&self) -> HeartPose {
        let row = |r: usize| self.to_heart.row(r).transpose();
        let to_base = row(2);
        let half = self.parameters.length_mm / 2.0;
        HeartPose {
            apex: self.centre - half * to_base,
            base: self.centre + half * to_base,
            axis: -to_base,
            anterior: row(0),
            septal: row(1),
        }
    }

    /// Radius of a ball around the LV.
    fn reach(&self) -> f64 {
        let p = self.parameters;
        // The slanted base rises above the end of the axis by its tangent times half the width.
        let rise = (p.width_mm / 2.0) * p.base_tilt_deg.to_radians().tan();
        (p.length_mm / 2.0 + rise).hypot(p.width_mm / 2.0)
    }

    /// Checks that the LV lies inside the volume.
    ///
    /// # Errors
    /// [`PhantomError::TooSmall`].
    pub(super) fn check_fits(&self, p: &PhantomParameters) -> Result<(), PhantomError> {
        let off = self.centre - FIELD_CENTRE;
        let reach = self.extent();
        for axis in 0..3 {
            let span_mm = p.shape[axis] as f64 * p.spacing_mm[axis];
            let needed_mm = 2.0 * (off[axis].abs() + reach[axis]);
            if needed_mm > span_mm {
                return Err(PhantomError::TooSmall {
                    axis,
                    span_mm,
                    needed_mm,
                });
            }
        }
        Ok(())
    }

    /// Half the size along x, y, z of a box around the LV, taken as a cylinder of its length and width
    /// including the slant.
    fn extent(&self) -> Vec3 {
        let p = self.parameters;
        let wide = p.width_mm / 2.0;
        let long = p.length_mm / 2.0 + wide * p.base_tilt_deg.to_radians().tan();
        let axis = self.pose().axis;
        axis.map(|c| long * c.abs() + wide * (1.0 - c * c).max(0.0).sqrt())
    }

    /// The uptake of every voxel, and the mask of the wall.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub(super) fn render(
        &self,
        shape: [usize; 3],
        frame: &VoxelToPatient,
        monitor: &Monitor,
    ) -> Result<(Vec<f32>, Vec<f32>), Cancelled> {
        let slice = shape[0] * shape[1];
        let mut uptake = vec![0.0; slice * shape[2]];
        let mut wall = vec![0.0; slice * shape[2]];
        let slices = uptake.par_chunks_mut(slice).zip(wall.par_chunks_mut(slice));
        slices.enumerate().try_for_each(|(k, (uptake, wall))| {
            monitor.check()?;
            for (n, (u, w)) in uptake.iter_mut().zip(wall).enumerate() {
                let index = Vec3::new((n % shape[0]) as f64, (n / shape[0]) as f64, k as f64);
                (*u, *w) = self.voxel(&index, frame);
            }
            Ok(())
        })?;
        Ok((uptake, wall))
    }

    /// Mean uptake of a voxel, and 1 if the wall fills at least half of it, otherwise 0.
    fn voxel(&self, index: &Vec3, frame: &VoxelToPatient) -> (f32, f32) {
        let middle = frame.to_patient(index);
        let half_voxel = Vec3::from(frame.spacing()).norm() / 2.0;
        if (middle - self.centre).norm() > self.reach() + half_voxel {
            return (self.elsewhere(&middle) as f32, 0.0);
        }
        let (mut uptake, mut wall) = (0.0, 0);
        let s = SUBVOXELS_PER_AXIS;
        for part in 0..s.pow(3) {
            let offset = |n: usize| (n as f64 + 0.5) / s as f64 - 0.5;
            let step = Vec3::new(offset(part % s), offset(part / s % s), offset(part / s / s));
            match self.tissue(&frame.to_patient(&(index + step))) {
                Tissue::Wall(u) => {
                    uptake += u;
                    wall += 1;
                }
                Tissue::Other(u) => uptake += u,
            }
        }
        let filled = 2 * wall >= s.pow(3);
        (
            (uptake / s.pow(3) as f64) as f32,
            f32::from(u8::from(filled)),
        )
    }

    /// The tissue at `p`, which is near the heart.
    fn tissue(&self, p: &Vec3) -> Tissue {
        let parameters = self.parameters;
        let h = self.to_heart * (p - self.centre);
        // Height above the equator of the ellipsoid.
        let z = h.z + parameters.base_mm - parameters.length_mm / 2.0;
        let tilt = parameters.base_tilt_deg.to_radians().tan();
        let base = parameters.base_mm + tilt * (h.x * self.slant[0] + h.y * self.slant[1]);
        if z > base {
            return Tissue::Other(self.elsewhere(p));
        }
        let inside = |[wide, long]: [f64; 2]| {
            (h.x * h.x + h.y * h.y) / (wide * wide) + z * z / (long * long) <= 1.0
        };
        match (inside(self.outer), inside(self.inner)) {
            (true, false) => {
                let turns = h.y.atan2(h.x) / TAU;
                let along = (h.z / parameters.length_mm + 0.5).clamp(0.0, 1.0);
                let natural = parameters.variation.at(along, turns);
                Tissue::Wall(natural * self.segments[self.segment(&h) - 1])
            }
            (true, true) => Tissue::Other(parameters.blood),
            (false, _) => Tissue::Other(
                self.right_ventricle(&h, z)
                    .unwrap_or_else(|| self.elsewhere(p)),
            ),
        }
    }

    /// The AHA segment (1..=17) at LV coordinates `h`: quarters of the length from the apex, then
    /// sectors from the anterior wall toward the septum.
    fn segment(&self, h: &Vec3) -> usize {
        let along = h.z / self.parameters.length_mm + 0.5;
        let turns = h.y.atan2(h.x).rem_euclid(TAU) / TAU;
        let sector = |n: f64| (turns * n).round() as usize % n as usize;
        match along {
            a if a < 0.25 => 17,
            a if a < 0.5 => 13 + sector(4.0),
            a if a < 0.75 => 7 + sector(6.0),
            _ => 1 + sector(6.0),
        }
    }

    /// Uptake in the right ventricle, an ellipsoid next to the septum; `None` outside it.
    fn right_ventricle(&self, h: &Vec3, z: f64) -> Option<f64> {
        let p = self.parameters;
        if p.right_ventricle == 0.0 {
            return None;
        }
        let radii = Vec3::new(0.45 * p.width_mm, 0.7 * p.width_mm, 0.85 * self.outer[1]);
        let at = Vec3::new(h.x, h.y - 0.35 * p.width_mm, z);
        let inside = |shrink: f64| at.component_div(&radii.add_scalar(-shrink)).norm() <= 1.0;
        match (inside(0.0), inside(RV_WALL)) {
            (true, false) => Some(p.right_ventricle),
            (true, true) => Some(p.blood),
            (false, _) => None,
        }
    }

    /// Uptake outside the heart.
    fn elsewhere(&self, p: &Vec3) -> f64 {
        let parameters = self.parameters;
        if (p.x / TORSO_HALF_AXES_MM[0]).powi(2) + (p.y / TORSO_HALF_AXES_MM[1]).powi(2) > 1.0 {
            return 0.0;
        }
        if LIVER_MM.holds(p) {
            return parameters.liver;
        }
        if GUT_MM.iter().any(|loops| loops.holds(p)) {
            return parameters.gut;
        }
        if LUNGS_MM.iter().any(|lung| lung.holds(p)) {
            LUNG_SHARE * parameters.background
        } else {
            parameters.background
        }
    }
}

/// Unit vectors perpendicular to the axis toward the anterior wall (superior, as far as the axis
/// allows) and toward the septum (the patient's right).
fn across(to_base: &Vec3) -> (Vec3, Vec3) {
    let part = |v: Vec3| v - v.dot(to_base) * to_base;
    let up = part(Vec3::z());
    // For a vertical axis, the anterior wall is in front.
    let anterior = if up.norm() > 1e-3 {
        up.normalize()
    } else {
        part(-Vec3::y()).normalize()
    };
    // Points to the right if the apex is to the left and in front.
    let septal = anterior.cross(to_base);
    (anterior, septal)
}

/// Uptake by segment. Of several defects in a segment, the most severe one counts.
fn wall_uptake(defects: &[PerfusionDefect]) -> [f64; 17] {
    let mut uptake = [1.0_f64; 17];
    for defect in defects {
        let segment = &mut uptake[usize::from(defect.segment) - 1];
        *segment = segment.min(1.0 - defect.severity);
    }
    uptake
}
