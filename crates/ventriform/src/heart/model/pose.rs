//! The pose of a template in a patient.
//!
//! A ventricle's pose takes one cup to another, in this order: the patient's own tilt in the
//! frame, the least turn from axis to axis, a roll about the axis; then lengths along the axis are
//! scaled by the ratio of the cups' lengths, lengths across it also by the ratio of their breadths.
//! Because the patient's tilt comes first, a heart that is tilted with its patient meets the same
//! side of the model as in an upright patient.

use crate::base::geometry::Vec3;
use crate::base::geometry::rotation::least_rotation;
use crate::image::locate::body::Blob;
use crate::image::locate::cup::{Cup, perpendicular};
use crate::mesh::TriMesh;
use nalgebra::{Rotation3, Unit};

/// The map from the template's frame to the patient's, a rotation with one scale along the long
/// axis and another across it.
#[derive(Debug, Clone, PartialEq)]
pub struct TemplatePose {
    from: Cup,
    to: Cup,
    turn: Rotation3<f64>,
}

impl TemplatePose {
    /// The pose of a ventricle: it takes the cup `from` to the cup `to` in a patient who is turned
    /// by `tilt` in the frame, with a further `roll` about the axis, radians.
    pub fn of_ventricle(from: &Cup, to: &Cup, tilt: &Rotation3<f64>, roll: f64) -> Self {
        let tilted = tilt * from.axis;
        let least = least_rotation(&tilted, &to.axis)
            // Opposite axes: half a turn about any direction across.
            .unwrap_or_else(|| {
                let (across, _) = perpendicular(&tilted);
                Rotation3::from_axis_angle(&Unit::new_normalize(across), std::f64::consts::PI)
            });
        let about = Rotation3::from_axis_angle(&Unit::new_normalize(to.axis), roll);
        Self {
            from: *from,
            to: *to,
            turn: about * least * tilt,
        }
    }

    /// The pose of any other organ: the template's centroid moved to the body's, scaled by the
    /// cube root of the volumes' ratio, not turned.
    pub fn of_body(mesh: &TriMesh, body: &Blob) -> Self {
        let centroid: Vec3 = mesh.vertices.iter().sum::<Vec3>() / mesh.vertices.len() as f64;
        let cup = |centre: Vec3, volume: f64| Cup {
            centre,
            axis: Vec3::z(),
            length: volume.cbrt(),
            breadth: 1.0,
        };
        let (from, to) = (cup(centroid, mesh.volume()), cup(body.centre, body.volume));
        Self::of_ventricle(&from, &to, &Rotation3::identity(), 0.0)
    }

    /// Isotropic scale: the cube root of the change of volume.
    pub fn scale(&self) -> f64 {
        let along = self.to.length / self.from.length;
        let across = along * self.to.breadth / self.from.breadth;
        (along * across * across).cbrt()
    }

    /// The rotation from the template to the patient.
    pub fn rotation(&self) -> &Rotation3<f64> {
        &self.turn
    }

    /// Where the pose takes a point of the template, LPS mm.
    pub fn apply(&self, p: &Vec3) -> Vec3 {
        let along = self.to.length / self.from.length;
        let across = along * self.to.breadth / self.from.breadth;
        let turned = self.turn * (p - self.from.centre);
        let share = turned.dot(&self.to.axis);
        self.to.centre + self.to.axis * (share * (along - across)) + turned * across
    }
}
