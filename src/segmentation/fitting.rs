//! Fits of templates to one volume, with one search for the organ.

use super::error::SegmentationError;
use super::templates::{NamedTemplate, RefusedTemplate};
use crate::deform::{DeformError, DeformParameters, Fit, OrganPlace, fit_at};
use crate::model::Template;
use crate::progress::Monitor;
use crate::volume::Volume;

/// The search for the organ in one volume: made for the first template, and again only for a
/// template of another kind (a ventricle is searched by its cavity, other organs by their
/// brightness).
#[derive(Debug, Default)]
pub struct OrganSearch {
    done: Option<Done>,
}

#[derive(Debug)]
struct Done {
    of_ventricle: bool,
    place: Result<OrganPlace, DeformError>,
}

impl OrganSearch {
    /// Where the organ of `template` lies in `volume`. Volume and parameters must be the same
    /// in all calls.
    ///
    /// # Errors
    /// [`DeformError`] where the organ is not found, in this search or an earlier one of the
    /// same kind.
    pub fn place(
        &mut self,
        volume: &Volume,
        template: &Template,
        parameters: &DeformParameters,
        monitor: &Monitor,
    ) -> Result<&OrganPlace, DeformError> {
        let of_ventricle = template.cup.is_some();
        let done = match self.done.take().filter(|d| d.of_ventricle == of_ventricle) {
            Some(done) => done,
            None => Done {
                of_ventricle,
                place: OrganPlace::find(volume, template, parameters, monitor),
            },
        };
        self.done.insert(done).place.as_ref().map_err(Clone::clone)
    }

    /// Fits `template` to the organ in `volume`, searched before if it has to be. Volume and
    /// parameters must be the same in all calls.
    ///
    /// # Errors
    /// [`DeformError`].
    pub fn fit(
        &mut self,
        volume: &Volume,
        template: &Template,
        parameters: &DeformParameters,
        monitor: &Monitor,
    ) -> Result<Fit, DeformError> {
        let place = self.place(volume, template, parameters, monitor)?;
        fit_at(place, volume, template, parameters, monitor)
    }
}

/// The figures of one template's fit.
#[derive(Debug, Clone, PartialEq)]
pub struct RankedTemplate {
    /// The template's name.
    pub name: String,
    /// The figure that templates are ranked by ([`Fit::merit`]).
    pub merit: f64,
    /// Share of area whose sensors see an edge, 0..=1.
    pub active: f64,
    /// Root mean square of the strain.
    pub strain: f64,
    /// Weighted rms distance to the edges, mm.
    pub residual: f64,
}

/// The fits of several templates.
#[derive(Debug, Default)]
pub struct Trials {
    /// The fits, in the order of the templates.
    pub fits: Vec<Fit>,
    /// Their figures.
    pub candidates: Vec<RankedTemplate>,
    /// Templates whose fit failed.
    pub refused: Vec<RefusedTemplate>,
}

/// Fits every template to the organ in `volume`.
///
/// # Errors
/// Where the organ is not found, no template can be fitted (the first one's error), or the caller
/// asked for an end.
pub fn try_all(
    volume: &Volume,
    templates: &[NamedTemplate],
    parameters: &DeformParameters,
    monitor: &Monitor,
) -> Result<Trials, SegmentationError> {
    let mut trials = Trials::default();
    let mut first = None;
    let mut search = OrganSearch::default();
    for (index, NamedTemplate { name, template }) in templates.iter().enumerate() {
        let place = search.place(volume, template, parameters, monitor)?;
        let monitor = monitor.part(index, templates.len());
        let name = name.clone();
        match fit_at(place, volume, template, parameters, &monitor) {
            Ok(fit) => {
                trials.candidates.push(RankedTemplate {
                    name,
                    merit: fit.merit(),
                    active: fit.active,
                    strain: fit.strain.sqrt(),
                    residual: fit.residual,
                });
                trials.fits.push(fit);
            }
            Err(error) => {
                monitor.check()?;
                let reason = error.to_string();
                trials.refused.push(RefusedTemplate { name, reason });
                first.get_or_insert(error);
            }
        }
    }
    match first {
        Some(error) if trials.fits.is_empty() => Err(error.into()),
        _ => Ok(trials),
    }
}
