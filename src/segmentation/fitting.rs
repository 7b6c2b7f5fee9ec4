//! Fits of templates to one volume, with one search for the organ.

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
