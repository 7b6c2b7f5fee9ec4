//! Fits a model to a patient.

pub mod align;
pub mod cup;
pub mod dynamics;
pub mod elastic;
pub mod field;
pub mod localise;
pub mod sensors;
pub mod system;
pub mod template;
pub mod voxelise;

use crate::geometry::bvh::Aabb;
use crate::geometry::Vec3;
use crate::mesh::TriMesh;
use crate::progress::Monitor;
use crate::volume::Volume;
use dynamics::{Motion, Moved};
use elastic::{Elastic, Stiffness};
use field::Field;
use localise::{Hints, Localisation, LocaliseError};
use sensors::{Look, SensorKind};
use template::{Pose, Template};

/// Parameters of [`fit`].
#[derive(Debug, Clone, PartialEq)]
pub struct DeformParameters {
    /// What is known of the place.
    pub hints: Hints,
    /// Stiffness of the model.
    pub stiffness: Stiffness,
    /// What the sensors look for. Default [`SensorKind::Gradient`].
    pub sensor: SensorKind,
    /// Reach of the sensors at first, mm. Default 10.
    pub reach: f64,
    /// Gaussian blur of the image, mm. Default 2.5.
    pub blur: f64,
    /// The reader's edge against the steepest slope, inner and outer, mm outward.
    pub shift: [f64; 2],
    /// Exponent of the sensors' weights.
    pub contrast: f64,
    /// How the model moves.
    pub motion: Motion,
}

impl Default for DeformParameters {
    fn default() -> Self {
        Self {
            hints: Hints::default(),
            stiffness: Stiffness::default(),
            sensor: SensorKind::Gradient,
            reach: 10.0,
            blur: 2.5,
            shift: [-0.6, 0.25],
            contrast: 1.0,
            motion: Motion {
                mass: 0.5,
                damping: 1.0,
                time_step: 1.0,
                last_reach: 7.0,
                narrowing: 0.85,
                tolerance: 0.03,
                max_iterations: 60,
            },
        }
    }
}

/// A fitted model.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Where the ventricle was found.
    pub localisation: Localisation,
    /// The posed template before the alignment.
    pub posed: TriMesh,
    /// After the alignment: the rest state of the motion.
    pub aligned: TriMesh,
    /// The motion and its result.
    pub moved: Moved,
}

/// Fits `template` to the ventricle in `volume`.
pub fn fit(
    volume: &Volume,
    template: &Template,
    parameters: &DeformParameters,
    monitor: &Monitor,
) -> Result<Fit, LocaliseError> {
    let localisation = localise::localise(volume, &parameters.hints, monitor)?;
    let cup = localisation.cup;
    let reach = cup.length + 40.0;
    let region = Aabb {
        min: cup.centre - Vec3::repeat(reach * 0.8),
        max: cup.centre + Vec3::repeat(reach * 0.8),
    };
    let field = Field::new(volume, Some(&region), parameters.blur);
    let pose = Pose::between(template.cup.as_ref().unwrap_or(&cup), &cup, 0.0);
    let mut posed = template.mesh.clone();
    posed.vertices.iter_mut().for_each(|p| *p = pose.apply(p));
    let look = Look {
        kind: parameters.sensor,
        reach: parameters.reach,
        level: 0.5 * localisation.wall,
        ceiling: 1.6 * localisation.wall,
        contrast: parameters.contrast,
        shift: sensors::Shift {
            inner: parameters.shift[0],
            outer: parameters.shift[1],
            axis: [cup.base(), cup.base() + cup.axis * (0.6 * cup.length)],
        },
    };
    let aligned = align::align(
        &posed,
        &cup.axis,
        &field,
        &look,
        parameters.motion.last_reach,
        monitor,
    )?;
    let body = Elastic::new(&aligned, &template.struts, parameters.stiffness);
    let near = Look {
        reach: (0.8 * parameters.reach).max(parameters.motion.last_reach),
        ..look
    };
    let moved = dynamics::run(&aligned, &body, &field, &near, &parameters.motion, monitor)?;
    Ok(Fit {
        localisation,
        posed,
        aligned,
        moved,
    })
}
