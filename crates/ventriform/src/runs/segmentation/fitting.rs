//! Fits of templates to one volume, with one search for the organ.

use super::built_in;
use super::error::SegmentationError;
use super::named_template::{NamedTemplate, RefusedTemplate};
use crate::base::progress::{ConcurrentParts, Monitor};
use crate::heart::deform::{DeformError, DeformParameters, OrganPosition, WallEdge};
use crate::heart::fit::{Fit, fit_at};
use crate::heart::judge::{Evidence, consensus};
use crate::heart::model::Template;
use crate::image::locate::{Hints, LocateError};
use crate::image::volume::Volume;
use crate::parameters::ParameterError;
use rayon::prelude::*;

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
    position: Result<OrganPosition, DeformError>,
}

impl OrganSearch {
    /// A search for a ventricle that found it at `position`.
    pub(crate) fn of_ventricle(position: OrganPosition) -> Self {
        Self {
            done: Some(Done {
                of_ventricle: true,
                position: Ok(position),
            }),
        }
    }

    /// The position of the organ of `template` in `volume`. Volume and parameters must be the same
    /// in all calls.
    ///
    /// # Errors
    /// [`DeformError`] where the organ is not found, in this search or an earlier one of the
    /// same kind.
    pub fn position(
        &mut self,
        volume: &Volume,
        template: &Template,
        parameters: &DeformParameters,
        monitor: &Monitor,
    ) -> Result<&OrganPosition, DeformError> {
        let of_ventricle = template.cup.is_some();
        let done = match self.done.take().filter(|d| d.of_ventricle == of_ventricle) {
            Some(done) => done,
            None => Done {
                of_ventricle,
                position: OrganPosition::find(volume, template, parameters, monitor),
            },
        };
        self.done
            .insert(done)
            .position
            .as_ref()
            .map_err(Clone::clone)
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
        let position = self.position(volume, template, parameters, monitor)?;
        fit_at(position, volume, template, parameters, monitor)
    }
}

/// The figures of one template's fit.
#[derive(Debug, Clone, PartialEq)]
pub struct RankedTemplate {
    /// The template's name.
    pub name: String,
    /// The figure that templates are ranked by ([`Judgement::confidence`](crate::heart::judge::Judgement::confidence)), by
    /// this fit alone.
    pub confidence: f64,
    /// Figure that decides between equals ([`Fit::merit`]).
    pub merit: f64,
    /// Share of area whose sensors see an edge, 0..=1.
    pub active: f64,
    /// Root mean square of the strain.
    pub strain: f64,
    /// Weighted rms distance to the edges, mm.
    pub residual: f64,
    /// The figures behind the confidence; ventricles only.
    pub evidence: Option<Evidence>,
}

/// The model in which the fits to several scans together have the greatest confidence, if all can have it; `candidates` are
/// those of each scan.
pub(crate) fn common_template(candidates: &[&[RankedTemplate]]) -> Option<String> {
    let (first, others) = candidates.split_first()?;
    let together = first.iter().filter_map(|own| {
        let in_others = others.iter().map(|fitted| {
            let same = fitted.iter().find(|other| other.name == own.name);
            Some(same?.confidence)
        });
        let sum: f64 = in_others.sum::<Option<f64>>()?;
        Some((own.confidence + sum, &own.name))
    });
    let best = together.max_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, name)| name.clone())
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
    /// For each built-in heart the place of its fit in `fits`; `None` where it failed.
    pub built_in: Vec<Option<usize>>,
}

impl Trials {
    /// Leaves out the fits of the built-in hearts for that reason.
    fn leave_out_built_in(&mut self, reason: &DeformError) {
        let found: Vec<usize> = self.built_in.drain(..).flatten().collect();
        for place in found.into_iter().rev() {
            self.fits.remove(place);
            let name = self.candidates.remove(place).name;
            let reason = format!("other built-in hearts found no wall there: {reason}");
            self.refused.push(RefusedTemplate { name, reason });
        }
    }

    /// The fit of the template with the name `kept`, or else the fit with the greatest confidence, of equals the one
    /// with the greatest merit, of those the first, as the built-in hearts' fits judge it, and its place; `None`
    /// without such a fit.
    pub fn best(&self, kept: Option<&str>, edge: WallEdge) -> Option<(usize, Fit)> {
        let may_be = |n: &usize| kept.is_none_or(|name| self.candidates[*n].name == name);
        let rank = |n: usize| (self.candidates[n].confidence, self.candidates[n].merit);
        let best = (0..self.fits.len()).rev().filter(may_be).max_by(|a, b| {
            let ((a, merit), (b, other)) = (rank(*a), rank(*b));
            a.total_cmp(&b).then(merit.total_cmp(&other))
        })?;
        let fit = &self.fits[best];
        let members: Vec<Option<&Fit>> = self
            .built_in
            .iter()
            .map(|place| place.map(|n| &self.fits[n]))
            .collect();
        let own = self.built_in.iter().position(|n| *n == Some(best));
        let judgement = match members.len() {
            0 => fit.judgement.clone(),
            _ => consensus::judgement(fit, &members, own, edge),
        };
        let model = fit.model.clone();
        Some((best, Fit { model, judgement }))
    }

    /// The error about a template to keep that was not fitted.
    pub fn not_fitted(&self, name: &str) -> SegmentationError {
        let failed = self.refused.iter().find(|refused| refused.name == name);
        let message = match failed {
            Some(refused) => format!("{name} could not be fitted: {}", refused.reason),
            None => format!("{name} is not among the fitted models"),
        };
        let fitted: Vec<&str> = self.candidates.iter().map(|c| c.name.as_str()).collect();
        ParameterError {
            field: "kept_model".into(),
            message,
            fix: format!("Give one of {}, or leave it out.", fitted.join(", ")),
        }
        .into()
    }
}

/// The fit that `auto` keeps without further models: of the built-in hearts, to the heart in `volume`,
/// searched before if it has to be.
///
/// # Errors
/// As [`try_all`].
pub fn fit_built_in(
    volume: &Volume,
    parameters: &DeformParameters,
    search: &mut OrganSearch,
    monitor: &Monitor,
) -> Result<Fit, SegmentationError> {
    let templates = built_in::templates(monitor)?;
    let trials = try_all(volume, &templates, parameters, search, monitor)?;
    let best = trials.best(None, parameters.edge);
    best.map_or(Err(SegmentationError::NoTemplate), |(_, fit)| Ok(fit))
}

/// Fits every template to the organ in `volume`. Where half of the built-in hearts find no wall, or more,
/// the fits of the others are left out: they took something else for one.
///
/// Where no heart is found and no hint says where it is, the walls that infarcts leave are tried, and very large hearts.
/// They are judged as the others are; their place is always doubted.
///
/// # Errors
/// Where the organ is not found, no template can be fitted (the first one's error), or the caller
/// asked for an end.
pub fn try_all(
    volume: &Volume,
    templates: &[NamedTemplate],
    parameters: &DeformParameters,
    search: &mut OrganSearch,
    monitor: &Monitor,
) -> Result<Trials, SegmentationError> {
    let usual = fit_all(volume, templates, parameters, search, monitor);
    let refused = matches!(
        usual,
        Err(SegmentationError::NotFound(LocateError::NoHeart { .. }))
    );
    if !refused || parameters.hints.centre.is_some() {
        return usual;
    }
    let hints = Hints {
        infarcted: true,
        ..parameters.hints.clone()
    };
    let infarcted = DeformParameters {
        hints,
        ..parameters.clone()
    };
    let mut again = OrganSearch::default();
    let found = fit_all(volume, templates, &infarcted, &mut again, monitor);
    monitor.check()?;
    if found.is_ok() {
        *search = again;
        return found;
    }
    usual
}

/// Fits every template to the organ in `volume`, by one search.
fn fit_all(
    volume: &Volume,
    templates: &[NamedTemplate],
    parameters: &DeformParameters,
    search: &mut OrganSearch,
    monitor: &Monitor,
) -> Result<Trials, SegmentationError> {
    let mut trials = Trials::default();
    let mut first = None;
    let mut wall_less = Vec::new();
    let outcomes = fit_side_by_side(volume, templates, parameters, search, monitor)?;
    for (named, outcome) in templates.iter().zip(outcomes) {
        let NamedTemplate { name, built_in, .. } = named;
        let name = name.clone();
        match outcome {
            Ok(fit) => {
                if *built_in {
                    trials.built_in.push(Some(trials.fits.len()));
                }
                trials.candidates.push(RankedTemplate {
                    name,
                    confidence: fit.judgement.confidence,
                    merit: fit.merit(),
                    active: fit.model.active,
                    strain: fit.model.strain.sqrt(),
                    residual: fit.model.residual,
                    evidence: fit.judgement.evidence,
                });
                trials.fits.push(fit);
            }
            Err(error) => {
                monitor.check()?;
                if *built_in {
                    trials.built_in.push(None);
                    if let DeformError::Localise(LocateError::NoHeart { .. }) = error {
                        wall_less.push(error.clone());
                    }
                }
                let reason = error.to_string();
                trials.refused.push(RefusedTemplate { name, reason });
                first.get_or_insert(error);
            }
        }
    }
    if 2 * wall_less.len() >= trials.built_in.len()
        && let Some(error) = wall_less.into_iter().next()
    {
        trials.leave_out_built_in(&error);
        first = Some(error);
    }
    match first {
        Some(error) if trials.fits.is_empty() => Err(error.into()),
        _ => Ok(trials),
    }
}

/// The fit of each template to the organ in `volume`, in the order of the templates, as many at once as there are
/// threads. Each is the same as alone.
///
/// # Errors
/// Where the organ is not found.
fn fit_side_by_side(
    volume: &Volume,
    templates: &[NamedTemplate],
    parameters: &DeformParameters,
    search: &mut OrganSearch,
    monitor: &Monitor,
) -> Result<Vec<Result<Fit, DeformError>>, DeformError> {
    let parts = ConcurrentParts::new(monitor, templates.len());
    let mut fits = Vec::with_capacity(templates.len());
    // Neighbours of one kind share one search.
    for alike in templates.chunk_by(|a, b| a.template.cup.is_some() == b.template.cup.is_some()) {
        let position = search.position(volume, &alike[0].template, parameters, monitor)?;
        let before = fits.len();
        fits.par_extend(alike.par_iter().enumerate().map(|(index, named)| {
            let part = parts.part(before + index);
            fit_at(
                position,
                volume,
                &named.template,
                parameters,
                &part.monitor(),
            )
        }));
    }
    Ok(fits)
}
