//! The start of a fit: the template posed in the patient, the image about it, the settings of the
//! sensors.

use super::error::DeformError;
use super::organ_position::OrganPosition;
use super::parameters::DeformParameters;
use super::sensors::{BlindSector, EdgeShift, SensorKind, SensorSettings};
use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
use crate::base::progress::Monitor;
use crate::heart::model::pose::TemplatePose;
use crate::heart::model::{Template, wall};
use crate::image::grid::Volume;
use crate::image::grid::field::Field;
use crate::image::locate::localisation::Localisation;
use crate::image::locate::patient_orientation::{OrientationSource, PatientOrientation};
use crate::mesh::TriMesh;
use nalgebra::Rotation3;

/// Distance of the wall's apparent edge from the edge that the sensors find, mm outward, on the
/// inner surface, the outer surface and the rim. Measured on simulated scans whose apparent edge
/// is known. The blur that is added before sampling moves the half-way point outward and the
/// steepest slope towards the centre of curvature. A change of any of them by 0.2 mm costs less
/// than 0.002 of Jaccard.
fn edge_shift(sensor: SensorKind) -> [f64; 3] {
    match sensor {
        SensorKind::HalfMaximum => [-1.7, -0.7, -0.75],
        SensorKind::Gradient | SensorKind::Unsigned | SensorKind::Level => [-0.6, 0.25, 0.25],
    }
}

/// The posed template, and the image to fit it to.
#[derive(Clone)]
pub struct FitSetup {
    /// Where the ventricle was found; `None` for other organs.
    pub localisation: Option<Localisation>,
    /// The patient's orientation in the frame.
    pub patient_orientation: PatientOrientation,
    /// Where the template goes.
    pub pose: TemplatePose,
    /// The template there, LPS mm.
    pub posed: TriMesh,
    /// Direction of the long axis; z for organs other than ventricles.
    pub axis: Vec3,
    /// The blurred image about the posed template.
    pub field: Field,
    /// The smoothness of the image about a ventricle, mm; `None` for other organs.
    pub smoothness_mm: Option<f64>,
    /// The length of the image's noise beside a ventricle, mm; `None` for other organs, and where it cannot be told.
    pub noise_length_mm: Option<f64>,
    /// Ends of the line that the inner surface faces, LPS mm.
    cavity_axis: [Vec3; 2],
    /// Typical value of the organ.
    uptake: f64,
    /// Where sensors see nothing.
    blind: Option<BlindSector>,
}

/// Half of the angle that the right ventricle's wall may take up beside the septum, degrees. Chosen
/// on the calibrating seeds (703 among them).
const RV_SECTOR_HALF_ANGLE_DEG: f64 = 65.0;

impl FitSetup {
    /// Poses `template` at `position` and blurs the image about it.
    ///
    /// # Errors
    /// [`DeformError::OtherOrgan`], [`DeformError::Cancelled`].
    pub fn new(
        position: &OrganPosition,
        volume: &Volume,
        template: &Template,
        parameters: &DeformParameters,
        monitor: &Monitor,
    ) -> Result<Self, DeformError> {
        let (localisation, pose, axis, cavity_axis, uptake) = match (position, &template.cup) {
            (
                OrganPosition::Ventricle {
                    found,
                    orientation,
                    in_place,
                    ..
                },
                Some(from),
            ) => {
                let to = found.cup;
                let roll = parameters.roll.to_radians();
                let (from, turn) = if *in_place {
                    (&to, Rotation3::identity())
                } else if orientation.source.is_stated() {
                    let turn = wall::turn_between(&from.axis, &to.axis, &orientation.superior);
                    (from, turn)
                } else {
                    (from, orientation.turn())
                };
                let pose = TemplatePose::of_ventricle(from, &to, &turn, roll);
                let inner_end = to.base() + to.axis * (0.6 * to.length);
                let ends = [to.base(), inner_end];
                (Some(found.clone()), pose, to.axis, ends, found.wall)
            }
            (OrganPosition::Body { blob, .. }, None) => {
                let pose = TemplatePose::of_body(&template.mesh, blob);
                (None, pose, Vec3::z(), [blob.centre; 2], blob.uptake)
            }
            _ => return Err(DeformError::OtherOrgan),
        };
        let mut posed = template.mesh.clone();
        posed.vertices.iter_mut().for_each(|p| *p = pose.apply(p));
        let mut region = Aabb::around(&posed.vertices);
        let border = Vec3::repeat(parameters.reach + 4.0 * parameters.blur + 15.0);
        region.min -= border;
        region.max += border;
        let picture = position.mask().unwrap_or(volume);
        let field = Field::cut_out(picture, Some(&region), parameters.blur, monitor)?;
        Ok(Self {
            localisation,
            patient_orientation: position.patient_orientation(),
            pose,
            posed,
            axis,
            cavity_axis,
            uptake,
            field,
            smoothness_mm: position.smoothness_mm(),
            noise_length_mm: position.noise_length_mm(),
            blind: None,
        })
    }

    /// The same with sensors that see nothing of the septum; `None` for other organs, and where the
    /// orientation is unknown.
    pub fn without_septum(&self) -> Option<Self> {
        let cup = self.localisation.as_ref()?.cup;
        if self.patient_orientation.source == OrientationSource::Unknown {
            return None;
        }
        let anterior = wall::anterior(&cup.axis, &self.patient_orientation.superior);
        Some(Self {
            blind: Some(BlindSector {
                centre: cup.centre,
                axis: cup.axis,
                middle: cup.axis.cross(&anterior),
                half_angle: RV_SECTOR_HALF_ANGLE_DEG,
            }),
            ..self.clone()
        })
    }

    /// The settings of sensors of `kind`.
    pub fn sensors(&self, parameters: &DeformParameters, kind: SensorKind) -> SensorSettings {
        let [inner, outer, rim] = match self.localisation {
            Some(_) => edge_shift(kind),
            None => [0.0; 3],
        };
        SensorSettings {
            kind,
            reach: parameters.reach,
            level: 0.5 * self.uptake,
            // The values of hotter neighbours are clipped: their slopes would outweigh the wall's.
            ceiling: 1.6 * self.uptake,
            shift: EdgeShift {
                inner: inner + parameters.margin,
                outer: outer + parameters.margin,
                rim: rim + parameters.margin,
                axis: self.cavity_axis,
            },
            blind: self.blind,
        }
    }
}
