//! A patient's segmentation from beginning to end: fit, mask, volumes, polar map, measures.
//!
//! Several templates may be given: each is fitted, and the fit with the greatest
//! [`Fit::merit`](crate::deform::Fit::merit) is taken; the others' figures are kept to say
//! why.

mod expert;
mod report;

pub use expert::{ExpertError, on_grid};
pub use report::{agreement_json, report_json};

use crate::deform::template::Template;
use crate::deform::voxelise::{Mask, voxelise};
use crate::deform::{DeformError, DeformParameters, Fit, fit};
use crate::evaluate::masks::{Agreement, compare};
use crate::polar::{self, PolarMap, PolarParameters};
use crate::progress::Monitor;
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
    /// Place of the taken template in `candidates`.
    pub chosen: usize,
    /// Every template tried, in the order given.
    pub candidates: Vec<Candidate>,
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
    Expert(#[from] ExpertError),
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
    let expert = expert.map(|e| on_grid(e, volume)).transpose()?;
    let mut fits: Vec<Fit> = Vec::new();
    for named in templates {
        fits.push(fit(volume, &named.template, &parameters.deform, monitor)?);
    }
    let candidates: Vec<Candidate> = fits
        .iter()
        .zip(templates)
        .map(|(fit, named)| Candidate {
            name: named.name.clone(),
            merit: fit.merit(),
            active: fit.active,
            strain: fit.strain.sqrt(),
            residual: fit.residual,
        })
        .collect();
    let chosen = (0..fits.len())
        .max_by(|a, b| candidates[*a].merit.total_cmp(&candidates[*b].merit))
        .ok_or(SegmentationError::NoTemplate)?;
    let fit = fits.swap_remove(chosen);
    let mask = voxelise(&fit.mesh, volume.shape, &volume.frame);
    let agreement = match &expert {
        // One grid by construction: `on_grid` made the mask on the volume's.
        Some(expert) => compare(&mask, expert, volume.frame.spacing()).ok(),
        None => None,
    };
    let polar = fit
        .wall
        .as_ref()
        .map(|wall| polar::map(volume, wall, &parameters.polar));
    Ok(Segmentation {
        fit,
        mask,
        polar,
        agreement,
        chosen,
        candidates,
    })
}

/// A mask as a volume of 0 and 1 in the place of `like`.
pub fn mask_volume(mask: &Mask, like: &Volume) -> Volume {
    Volume {
        shape: mask.shape,
        voxels: mask
            .voxels
            .iter()
            .map(|v| f32::from(u8::from(*v)))
            .collect(),
        frame: like.frame.clone(),
        integral: true,
    }
}
