//! From a volume and templates to the fit, its mask, measures, polar map and slices.

use super::error::SegmentationError;
use super::fitting::{OrganSearch, RankedTemplate, Trials, try_all};
use super::named_template::{NamedTemplate, RefusedTemplate};
use super::order::NamedReader;
use super::slices::{self, Cut};
use crate::base::geometry::Vec3;
use crate::base::progress::{Monitor, Stage};
use crate::heart::deform::{DeformParameters, FittedModel, blur_correction};
use crate::heart::fit::Fit;
use crate::heart::judge::Judgement;
use crate::heart::polar::{self, PolarMap, PolarParameters};
use crate::heart::reader::{self, WallImage};
use crate::image::grid::agreement::{Agreement, compare};
use crate::image::grid::voxelise::{Mask, voxelise};
use crate::image::volume::Volume;

/// Parameters of [`segment`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SegmentationParameters {
    /// The fit's.
    pub deform: DeformParameters,
    /// The polar map's.
    pub polar: PolarParameters,
    /// Name of the template whose fit is kept. Default: that with the greatest confidence.
    pub kept_model: Option<String>,
    /// Direction from the long axis to the wall that is called anterior, LPS, any length. It is taken when the fit is
    /// done, so that only names of places follow it. Default: by the orientation that the fit starts from.
    pub segments_from: Option<Vec3>,
    /// The reader as whom to draw the wall. The profile must start from the wall that
    /// [`DeformParameters::edge`] asks for. Default: none.
    pub reader: Option<NamedReader>,
}

/// The segmentation of one volume.
#[derive(Debug, Clone)]
pub struct Segmentation {
    /// The fitted model.
    pub fit: Fit,
    /// The voxels inside it, on the volume's grid.
    pub mask: Mask,
    /// Of a ventricle, the voxels inside the wall that [`Segmentation::fit`] does not show.
    pub other_mask: Option<Mask>,
    /// The polar map of the wall's uptake; ventricles only.
    pub polar: Option<PolarMap>,
    /// The image's resolution; ventricles only.
    pub resolution: Option<ImageResolution>,
    /// The reader's profile that the fit's wall was drawn by.
    pub reader: Option<AppliedReader>,
    /// Agreement with the expert's mask, if one was given.
    pub agreement: Option<Agreement>,
    /// Slices of the volume with the contours of fit and expert, as a PNG file.
    pub slices: Vec<u8>,
    /// Index of the chosen template in `candidates`.
    pub chosen: usize,
    /// The templates that were fitted, in the order given.
    pub candidates: Vec<RankedTemplate>,
    /// Models that were not fitted, or whose fit failed.
    pub refused: Vec<RefusedTemplate>,
}

/// A reader's profile that was applied.
#[derive(Debug, Clone, PartialEq)]
pub struct AppliedReader {
    /// The profile.
    pub reader: NamedReader,
    /// The share of its movement that was applied: 1 unless the surface would intersect itself.
    pub share: f64,
}

/// The width of a point in the image, motion and filters included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageResolution {
    /// Full width at half maximum, mm.
    pub value: f64,
    /// Whether the caller stated it. Otherwise it is the blur by which a slab of the anatomical
    /// thickness looks as thick as the apparent wall.
    pub given: bool,
}

impl ImageResolution {
    fn new(model: &FittedModel, given: Option<f64>) -> Option<Self> {
        let surfaces = model.surfaces.as_ref()?;
        let estimated = || {
            let [thickness, apparent] =
                [&surfaces.anatomical, &surfaces.apparent].map(|s| s.wall.thickness);
            blur_correction::resolution_of(thickness, apparent)
        };
        Some(Self {
            value: given.unwrap_or_else(estimated),
            given: given.is_some(),
        })
    }
}

/// Segments `volume` by the best of `templates` and compares the mask with `expert`, on the same grid, if
/// given ([`GivenMask::on`](crate::image::volume::given_mask::GivenMask::on)).
///
/// # Errors
/// [`SegmentationError`].
pub fn segment(
    volume: &Volume,
    templates: &[NamedTemplate],
    parameters: &SegmentationParameters,
    expert: Option<&Mask>,
    monitor: &Monitor,
) -> Result<Segmentation, SegmentationError> {
    segment_at(
        OrganSearch::default(),
        volume,
        templates,
        parameters,
        expert,
        monitor,
    )
}

/// The same with the organ where `search` has it, if it has been searched there.
///
/// # Errors
/// [`SegmentationError`].
pub(crate) fn segment_at(
    mut search: OrganSearch,
    volume: &Volume,
    templates: &[NamedTemplate],
    parameters: &SegmentationParameters,
    expert: Option<&Mask>,
    monitor: &Monitor,
) -> Result<Segmentation, SegmentationError> {
    let trials = try_all(volume, templates, &parameters.deform, &mut search, monitor)?;
    let kept = parameters.kept_model.as_deref();
    let (chosen, fit) = match (trials.best(kept, parameters.deform.edge), kept) {
        (Some(best), _) => best,
        (None, Some(name)) => return Err(trials.not_fitted(name)),
        (None, None) => return Err(SegmentationError::NoTemplate),
    };
    let Trials {
        candidates,
        refused,
        ..
    } = trials;
    monitor.report(Stage::Polar, 0.0)?;
    let fit = match &parameters.segments_from {
        Some(anterior) => Fit {
            model: fit.model.counted_from(anterior, monitor)?,
            ..fit
        },
        None => fit,
    };
    // Uptake is sampled through the wall as it looks, whichever wall is shown.
    let polar = fit.model.surfaces.as_ref().map(|surfaces| {
        let [wall, anatomical] = [&surfaces.apparent, &surfaces.anatomical].map(|s| &s.wall);
        let source = fit.model.patient_orientation.map(|o| o.source);
        polar::map(volume, wall, anatomical, &parameters.polar)
            .counted_by(source.unwrap_or_default())
    });
    let (fit, reader) = match &parameters.reader {
        Some(reader) => {
            let Fit { model, judgement } = fit;
            let reference = polar.as_ref().map_or(0.0, |map| map.reference);
            let image = WallImage::about(&model, volume, reference, monitor)?;
            let drawn = reader::drawn(model, &reader.profile.drawing(), &image, monitor)?;
            let edge = parameters.deform.edge;
            let uncertainty = judgement.uncertainty;
            let judgement = Judgement {
                uncertainty: uncertainty.map(|all| all.carried_to(edge, &drawn.midpoints)),
                ..judgement
            };
            let (model, share) = (drawn.model, drawn.share);
            let reader = reader.clone();
            (
                Fit { model, judgement },
                Some(AppliedReader { reader, share }),
            )
        }
        None => (fit, None),
    };
    monitor.report(Stage::Report, 0.0)?;
    let voxels_in = |mesh| voxelise(mesh, volume.shape, &volume.frame, monitor);
    let mask = voxels_in(&fit.model.mesh)?;
    let other = fit.model.other_surface(parameters.deform.edge);
    let other_mask = other.map(|other| voxels_in(&other.mesh)).transpose()?;
    monitor.report(Stage::Report, 0.5)?;
    let agreement = match expert {
        // Both masks are on the volume's grid, so this fails only when cancelled.
        Some(expert) => compare(&mask, expert, volume.frame.spacing(), monitor).ok(),
        None => None,
    };
    monitor.report(Stage::Report, 0.8)?;
    let slices = slices::png(
        volume,
        &fit.model.mesh,
        &Cut::from_fit(&fit.model),
        expert,
        monitor,
    )?;
    monitor.report(Stage::Report, 1.0)?;
    Ok(Segmentation {
        resolution: ImageResolution::new(&fit.model, parameters.deform.resolution),
        fit,
        mask,
        other_mask,
        polar,
        reader,
        agreement,
        slices,
        chosen,
        candidates,
        refused,
    })
}
