//! Fits a model to a patient: a spring-mass model with torsion and sensors.
//!
//! After Dornheim, Tönnies and Dixon (MICCAI 2005). A volume and a
//! [`Template`] go in. Out comes a [`Fit`]: the model in the patient's
//! place and shape, with the nodes and triangles of the template, and the figures needed to judge
//! it.
//!
//! 1. [`place`]: find the organ in the volume, once for all templates, and the patient's
//!    orientation ([`crate::locate`]).
//! 2. [`setup`]: pose the template there ([`crate::model::pose`]), blur the image about it.
//! 3. [`align`]: move, turn, stretch and thicken the model as a whole.
//! 4. [`dynamics`]: deform it under [`elastic`] forces and [`sensors`] until it rests.
//! 5. [`attempt`]: count folds and self-intersections; if there are any, repeat step 4 with four
//!    times the stiffness, at most three times.
//!    Where the septum of the result bulges, do steps 3 to 5 again without its sensors, and keep what is
//!    more likely right: beside a septum without uptake, the right ventricle's wall looks like one.
//! 6. [`rim`]: move the rim of a ventricle where anatomy and image together put it.
//! 7. [`fit`](mod@fit): measure the result; [`evidence`], [`confidence`]: how likely it is right;
//!    [`views`]: whether the projections of the image show the wall in two places;
//!    [`uncertainty`]: how far each node may be off; [`flags`]: what gives reason to doubt it.
//! 8. [`consensus`]: of several models' fits to one volume, judge the chosen one by all of them.
//!
//! The edge that is fitted is the half-way point between the wall's ridge and the trough beside
//! it. It does not depend on uptake: a wall with half the uptake has its edge in the same place.
//! [`DeformParameters::margin`] moves it for readers who draw wider. Blur makes the wall look
//! thicker than it is; [`anatomical`] moves both surfaces of the fitted model to the wall itself,
//! and the fit keeps both ([`Fit::surfaces`]).
//!
//! Where the apex takes up no tracer, the stiffness keeps the model near the length of its pose,
//! and [`Flag::DarkApex`] says that the length is not seen in the image.
//!
//! Guaranteed: the same volume, template and parameters give the same bytes; the connectivity is
//! the template's; without a heart in the volume there is an error and no result. Not guaranteed:
//! that the result has no self-intersections ([`Fit::self_intersections`] counts them,
//! [`Flag::Folded`] reports them).

pub mod align;
pub mod anatomical;
pub mod attempt;
pub mod blur_correction;
pub mod confidence;
pub mod consensus;
mod doubts;
pub mod dynamics;
pub mod elastic;
pub mod error;
pub mod evidence;
pub mod fit;
pub mod flags;
pub mod parameters;
pub mod place;
pub mod rim;
pub mod sensors;
pub mod setup;
#[cfg(test)]
mod test_fits;
pub mod uncertainty;
pub mod views;

pub use error::DeformError;
pub use evidence::Evidence;
pub use fit::{Fit, WallSurface, WallSurfaces};
pub use flags::Flag;
pub use parameters::{DeformParameters, WallEdge};
pub use place::OrganPlace;

use crate::grid::Volume;
use crate::model::Template;
use crate::progress::{Monitor, Stage};
use attempt::Attempt;
use elastic::Stiffness;
use sensors::SensorKind;
use setup::FitSetup;

/// Fits `template` to the organ in `volume`.
///
/// # Errors
/// [`DeformError`].
pub fn fit(
    volume: &Volume,
    template: &Template,
    parameters: &DeformParameters,
    monitor: &Monitor,
) -> Result<Fit, DeformError> {
    check_supports(template.mesh.vertices.len(), &parameters.stiffness)?;
    let place = OrganPlace::find(volume, template, parameters, monitor)?;
    fit_at(&place, volume, template, parameters, monitor)
}

/// Fits `template` to the organ at `place` in `volume`. [`OrganPlace::find`] must have found it in
/// this volume, by these parameters, for this template or another one of the same organ.
///
/// # Errors
/// [`DeformError`].
pub fn fit_at(
    place: &OrganPlace,
    volume: &Volume,
    template: &Template,
    parameters: &DeformParameters,
    monitor: &Monitor,
) -> Result<Fit, DeformError> {
    parameters.validate()?;
    check_supports(template.mesh.vertices.len(), &parameters.stiffness)?;
    monitor.report(Stage::Align, 0.0)?;
    let mut setup = FitSetup::new(place, volume, template, parameters, monitor)?;
    let mut fit = fit_from(&setup, volume, template, parameters, monitor)?;
    // The wall of a hot right ventricle beside a septum without uptake: the rest of the wall may tell.
    if doubts::bulges(&fit)
        && let Some(blind) = setup.clone().without_septum()
    {
        let other = fit_from(&blind, volume, template, parameters, monitor)?;
        if doubts::is_clearer(&other, &fit) {
            (fit, setup) = (other, blind);
        }
    }
    fit.require_wall(&parameters.hints)?;
    let fit = fit.with_surfaces(&setup.field, parameters, monitor)?;
    monitor.report(Stage::Deform, 1.0)?;
    Ok(fit)
}

/// The fit from a posed template, its wall as the sensors and the rim's shape put it.
fn fit_from(
    setup: &FitSetup,
    volume: &Volume,
    template: &Template,
    parameters: &DeformParameters,
    monitor: &Monitor,
) -> Result<Fit, DeformError> {
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
    monitor.report(Stage::Deform, 0.0)?;
    let attempt = Attempt::best(&aligned, template, setup, parameters, monitor)?;
    Ok(attempt.into_fit(volume, template, setup, &aligned, parameters, monitor)?)
}

/// Most nodes of a model with support springs, whose number grows with the square of the nodes.
const MAX_SUPPORTED_NODES: usize = 1000;

fn check_supports(nodes: usize, stiffness: &Stiffness) -> Result<(), DeformError> {
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
