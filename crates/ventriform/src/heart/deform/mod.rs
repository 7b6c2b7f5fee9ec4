//! Fits a model to a patient: a spring-mass model with torsion and sensors.
//!
//! After Dornheim, Tönnies and Dixon (MICCAI 2005). A volume and a
//! [`Template`] go in. Out comes a [`FittedModel`]: the model in the patient's
//! position and shape, with the nodes and triangles of the template. [`judge`](crate::heart::judge) says how likely it is
//! right, and [`fit`](crate::heart::fit) does both.
//!
//! 1. [`organ_position`]: find the organ in the volume, once for all templates, and the patient's
//!    orientation ([`crate::image::locate`]).
//! 2. [`setup`]: pose the template there ([`crate::heart::model::pose`]), blur the image about it.
//! 3. [`align`]: move, turn, stretch and thicken the model as a whole.
//! 4. [`dynamics`]: deform it under [`elastic`] forces and [`sensors`] until it rests; where a person has pulled the
//!    contour, [`through`] the points that they set.
//! 5. [`attempt`]: count folds and self-intersections; if there are any, repeat step 4 with four
//!    times the stiffness, at most three times.
//! 6. [`base_plane`]: move the rim of a ventricle where anatomy and image together put it.
//! 7. [`anatomical`]: the wall itself from the wall as it looks, as thick as [`wall_thickness`] says.
//!
//! The edge that is fitted is the half-way point between the wall's ridge and the trough beside
//! it. It does not depend on uptake: a wall with half the uptake has its edge in the same place.
//! [`DeformParameters::margin`] moves it for readers who draw wider. Blur makes the wall look
//! thicker than it is; [`anatomical`] moves both surfaces of the fitted model to the wall itself,
//! and the fitted model keeps both ([`FittedModel::surfaces`]).
//!
//! Where the apex takes up no tracer, the stiffness keeps the model near the length of its pose,
//! and [`Flag::DarkApex`](crate::heart::judge::Flag::DarkApex) says that the length is not seen in the image.
//!
//! Guaranteed: the same volume, template and parameters give the same bytes; the connectivity is
//! the template's; without a heart in the volume there is an error and no result. Not guaranteed:
//! that the result has no self-intersections ([`FittedModel::self_intersections`] counts them,
//! [`Flag::Folded`](crate::heart::judge::Flag::Folded) reports them).

pub mod align;
pub mod anatomical;
pub mod attempt;
pub mod base_plane;
pub mod blur_correction;
mod calibration;
pub mod dynamics;
pub mod elastic;
pub mod error;
pub mod fitted_model;
pub mod organ_position;
pub mod parameters;
pub mod protocol_resolution;
pub mod ray_terms;
pub mod resolution_terms;
pub mod rim_frame;
pub mod rim_model;
pub mod sensors;
pub mod setup;
pub mod signal_end;
mod thickness_calibration;
pub mod through;
pub mod wall_thickness;

pub use error::DeformError;
pub use fitted_model::{FittedModel, WallSurface, WallSurfaces};
pub use organ_position::OrganPosition;
pub use parameters::{DeformParameters, Orbit, WallEdge};
pub use through::ThroughPoint;

use crate::base::progress::{Monitor, Stage};
use crate::heart::model::Template;
use attempt::Attempt;
use elastic::Stiffness;
use sensors::SensorKind;
use setup::FitSetup;

/// Fits `template`, posed as `setup` has it, to the image there.
///
/// # Errors
/// [`DeformError::Cancelled`].
pub fn fit(
    setup: &FitSetup,
    template: &Template,
    parameters: &DeformParameters,
    monitor: &Monitor,
) -> Result<FittedModel, DeformError> {
    // Far from the edge, the ridge and the trough beside a slope may belong to another structure:
    // the model is aligned by slopes.
    let far = match parameters.sensor {
        SensorKind::HalfMaximum => SensorKind::Gradient,
        kind => kind,
    };
    let aligned = if parameters.align {
        align::align(
            &setup.posed,
            &setup.axis,
            &setup.field,
            &setup.sensors(parameters, far),
            parameters.motion.last_reach,
            monitor,
        )?
    } else {
        setup.posed.clone()
    };
    let sides = setup.sensors(parameters, parameters.sensor).shift;
    through::check(&aligned, &sides, &parameters.through)?;
    monitor.report(Stage::Deform, 0.0)?;
    let attempt = Attempt::best(&aligned, template, setup, parameters, monitor)?;
    Ok(attempt.into_model(template, setup, &aligned, parameters, monitor)?)
}

/// Most nodes of a model with support springs, whose number grows with the square of the nodes.
const MAX_SUPPORTED_NODES: usize = 1000;

/// Refuses a model of more `nodes` than support springs are for, where there are any.
///
/// # Errors
/// [`DeformError::TooManyNodes`].
pub fn check_supports(nodes: usize, stiffness: &Stiffness) -> Result<(), DeformError> {
    let limit = MAX_SUPPORTED_NODES;
    if stiffness.support > 0.0 && nodes > limit {
        return Err(DeformError::TooManyNodes { nodes, limit });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_support_springs_limit_the_nodes() {
        let allowed = |nodes: usize, support: f64| {
            let stiffness = Stiffness {
                support,
                ..Stiffness::default()
            };
            check_supports(nodes, &stiffness).is_ok()
        };
        assert!(allowed(MAX_SUPPORTED_NODES, 0.5) && !allowed(MAX_SUPPORTED_NODES + 1, 0.5));
        assert!(allowed(MAX_SUPPORTED_NODES + 1, 0.0));
    }
}
