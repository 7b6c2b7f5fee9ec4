//! Fits a template to a volume and judges the fit.
//!
//! 1. [`deform`](mod@crate::heart::deform) fits the template; [`judge`](mod@crate::heart::judge) says how likely it is right.
//! 2. Where the septum of the result bulges, both are done again without the septum's sensors, and the fit that is more
//!    likely right is kept: beside a septum without uptake, the right ventricle's wall looks like one.
//! 3. A ventricle that is more likely none is refused.
//!
//! Guaranteed: the same volume, template and parameters give the same bytes; without a heart in the volume there is
//! an error and no result.

use crate::base::progress::{Monitor, Stage};
use crate::heart::deform::setup::FitSetup;
use crate::heart::deform::{self, DeformError, DeformParameters, OrganPosition, check_supports};
use crate::heart::judge::{judge, refusal, septum};
use crate::heart::model::Template;
use crate::image::grid::Volume;

pub use crate::heart::judge::Fit;

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
    let position = OrganPosition::find(volume, template, parameters, monitor)?;
    fit_at(&position, volume, template, parameters, monitor)
}

/// Fits `template` to the organ at `position` in `volume`. [`OrganPosition::find`] must have found it in
/// this volume, by these parameters, for this template or another one of the same organ.
///
/// # Errors
/// [`DeformError`].
pub fn fit_at(
    position: &OrganPosition,
    volume: &Volume,
    template: &Template,
    parameters: &DeformParameters,
    monitor: &Monitor,
) -> Result<Fit, DeformError> {
    parameters.validate()?;
    check_supports(template.mesh.vertices.len(), &parameters.stiffness)?;
    monitor.report(Stage::Align, 0.0)?;
    let setup = FitSetup::new(position, volume, template, parameters, monitor)?;
    let fit_from = |setup: &FitSetup| -> Result<Fit, DeformError> {
        let model = deform::fit(setup, template, parameters, monitor)?;
        let judgement = judge(&model, setup, volume, template.organ, parameters, monitor)?;
        Ok(Fit { model, judgement })
    };
    let mut fit = fit_from(&setup)?;
    // The wall of a hot right ventricle beside a septum without uptake: the rest of the wall may decide.
    if septum::bulges(&fit)
        && let Some(blind) = setup.without_septum()
    {
        let other = fit_from(&blind)?;
        if septum::is_better_without(&other, &fit) {
            fit = other;
        }
    }
    refusal::require_heart(&fit.model, &fit.judgement, &parameters.hints)
        .map_err(|error| error.about(volume))?;
    monitor.report(Stage::Deform, 1.0)?;
    Ok(fit)
}
