//! A patient's segmentation from beginning to end: fit, mask, volumes, polar map, measures,
//! pictures.
//!
//! Several templates may be given: each is fitted, and the fit with the greatest
//! [`Fit::merit`](crate::deform::Fit::merit) is taken (the first of equals); the others'
//! figures are kept to say why. A template that cannot be fitted is left out with its reason,
//! unless none can. The organ is searched once for all of them.

mod built_in;
mod expert;
mod files;
mod fitting;
mod from_files;
mod report;
pub mod slices;

pub use expert::{ExpertError, on_grid};
pub use files::{NamedFile, OutcomeError};
pub use fitting::OrganSearch;
pub use from_files::{NamedMesh, Order, SegmentError, Segmented, from_files};
pub use report::{agreement_json, report_json};

use crate::deform::{DeformError, DeformParameters, Fit, fit_at};
use crate::grid::agreement::{Agreement, compare};
use crate::grid::voxelise::{Mask, voxelise};
use crate::model::Template;
use crate::polar::{self, PolarMap, PolarParameters};
use crate::progress::{Cancelled, Monitor, Stage};
use crate::segmentation::slices::Cut;
use crate::volume::Volume;

/// Parameters of [`segment`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SegmentationParameters {
    /// The fit's.
    pub deform: DeformParameters,
    /// The polar map's.
    pub polar: PolarParameters,
}

/// A template with the name under which the report speaks of it.
#[derive(Debug, Clone)]
pub struct NamedTemplate {
    /// The name.
    pub name: String,
    /// The template.
    pub template: Template,
}

/// One template's fit in figures.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// The template's name.
    pub name: String,
    /// What it is ranked by.
    pub merit: f64,
    /// Share of area with an edge.
    pub active: f64,
    /// Root of the mean squared strain.
    pub strain: f64,
    /// Weighted rms distance to the edges, mm.
    pub residual: f64,
}

/// A template that could not be fitted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refused {
    /// The template's name.
    pub name: String,
    /// Why.
    pub reason: String,
}

/// A segmented patient.
#[derive(Debug, Clone)]
pub struct Segmentation {
    /// The fitted model.
    pub fit: Fit,
    /// Its voxels on the input's grid.
    pub mask: Mask,
    /// The wall's uptake; ventricles only.
    pub polar: Option<PolarMap>,
    /// Against the expert's mask, where one was given.
    pub agreement: Option<Agreement>,
    /// Slices of the volume with the contours of fit and expert: a PNG.
    pub slices: Vec<u8>,
    /// Place of the taken template in `candidates`.
    pub chosen: usize,
    /// Every template fitted, in the order given.
    pub candidates: Vec<Candidate>,
    /// Templates that could not be fitted.
    pub refused: Vec<Refused>,
}

/// Why there is no segmentation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SegmentationError {
    /// No template was given.
    #[error("no model was given to fit")]
    NoTemplate,
    /// No template could be fitted; the first one's reason.
    #[error(transparent)]
    Deform(#[from] DeformError),
    /// The expert's mask cannot be used.
    #[error(transparent)]
    Expert(ExpertError),
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<ExpertError> for SegmentationError {
    fn from(error: ExpertError) -> Self {
        match error {
            ExpertError::Cancelled(cancelled) => cancelled.into(),
            other => SegmentationError::Expert(other),
        }
    }
}

/// Segments `volume` by the best of `templates`; measures against `expert` if given.
///
/// # Errors
/// [`SegmentationError`].
pub fn segment(
    volume: &Volume,
    templates: &[NamedTemplate],
    parameters: &SegmentationParameters,
    expert: Option<&Volume>,
    monitor: &Monitor,
) -> Result<Segmentation, SegmentationError> {
    let expert = expert.map(|e| on_grid(e, volume, monitor)).transpose()?;
    let Trials {
        mut fits,
        candidates,
        refused,
    } = try_all(volume, templates, &parameters.deform, monitor)?;
    let chosen = (0..fits.len())
        .rev()
        .max_by(|a, b| candidates[*a].merit.total_cmp(&candidates[*b].merit))
        .ok_or(SegmentationError::NoTemplate)?;
    let fit = fits.swap_remove(chosen);
    monitor.report(Stage::Polar, 0.0)?;
    let polar = fit
        .wall
        .as_ref()
        .map(|wall| polar::map(volume, wall, &parameters.polar));
    monitor.report(Stage::Report, 0.0)?;
    let mask = voxelise(&fit.mesh, volume.shape, &volume.frame);
    monitor.report(Stage::Report, 0.5)?;
    let agreement = match &expert {
        // One grid by construction: `on_grid` made the mask on the volume's.
        Some(expert) => compare(&mask, expert, volume.frame.spacing(), monitor).ok(),
        None => None,
    };
    monitor.report(Stage::Report, 0.8)?;
    let slices = slices::png(volume, &fit.mesh, &Cut::of(&fit), expert.as_ref(), monitor)?;
    monitor.report(Stage::Report, 1.0)?;
    Ok(Segmentation {
        fit,
        mask,
        polar,
        agreement,
        slices,
        chosen,
        candidates,
        refused,
    })
}

/// Every template's fit, or why there is none.
#[derive(Default)]
struct Trials {
    fits: Vec<Fit>,
    candidates: Vec<Candidate>,
    refused: Vec<Refused>,
}

fn try_all(
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
        let monitor = monitor.piece(index, templates.len());
        let name = name.clone();
        match fit_at(place, volume, template, parameters, &monitor) {
            Ok(fit) => {
                trials.candidates.push(Candidate {
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
                trials.refused.push(Refused { name, reason });
                first.get_or_insert(error);
            }
        }
    }
    match first {
        Some(error) if trials.fits.is_empty() => Err(error.into()),
        _ => Ok(trials),
    }
}
