//! The fit of one scan of several: by itself, and again from the common heart.

use super::error::SerialError;
use super::order::SerialOrder;
use crate::base::progress::Monitor;
use crate::heart::deform::{DeformParameters, OrganPosition};
use crate::heart::fit::Fit;
use crate::heart::model::{MYOCARDIAL_DENSITY_G_PER_ML, Template};
use crate::heart::serial::{CommonHeart, PlacedHeart, RigidMotion};
use crate::image::grid::Volume;
use crate::image::volume::{AffineSource, Provenance, ReadLimits, VolumeFacts, VolumeFile};
use crate::parameters::{BeatChoice, FitParameters};
use crate::runs::gated::{FittedSum, GatedOrder, fitted_sum};
use crate::runs::rest_stress::ComparedHeart;
use crate::runs::segmentation::{
    self, NamedTemplate, OrganSearch, RankedTemplate, Segmentation, SegmentationError,
    SegmentationOrder, SegmentationParameters, SegmentedVolume, heart_figures, judged_by_normals,
    segment_at,
};

/// Factor of the stiffness of a fit from the common heart, which has the patient's own shape: the less the model follows
/// noise, the less unchanged hearts differ; the stiffer it is, the less of a true change it follows (docs/log/serial.md).
const REFIT_STIFFNESS: f64 = 8.0;

/// A scan that was fitted by itself.
pub(super) enum ScanFit {
    /// From an image that is not gated.
    Still(Box<SegmentedVolume>),
    /// From gates.
    Gated(Box<FittedSum>),
}

impl ScanFit {
    /// The fit of the scan in `files`, counted `number` from 1, to the sum of its gates if it is `gated`; by the model
    /// `kept` or else that with the greatest confidence.
    pub fn of_files(
        order: &SerialOrder<'_>,
        (number, files): (usize, &[VolumeFile]),
        gated: bool,
        kept: Option<&str>,
        limits: &ReadLimits,
        monitor: &Monitor<'_>,
    ) -> Result<Self, SerialError> {
        let own = order.parameters.fit.clone();
        let parameters = FitParameters {
            kept_model: kept.map(str::to_owned).or(own.kept_model),
            ..own
        };
        if gated {
            let order = gated_order(order, files, &parameters);
            let made = fitted_sum(&order, limits, monitor)
                .map_err(|error| SerialError::of_gated(number, error))?;
            return Ok(Self::Gated(Box::new(made)));
        }
        let order = SegmentationOrder {
            volume: files,
            expert: None,
            auto: order.auto,
            models: order.models.clone(),
            reader: None,
            normals: None,
            parameters: &parameters,
        };
        let made = segmentation::from_files(&order, limits, monitor)
            .map_err(|error| SerialError::of_segmentation(number, error))?;
        Ok(Self::Still(Box::new(made)))
    }

    /// The image that was fitted.
    pub fn image(&self) -> &Volume {
        match self {
            Self::Still(made) => &made.reading.volume,
            Self::Gated(made) => &made.study.sum,
        }
    }

    /// Voxels that are held of it, gates included.
    pub fn voxels(&self) -> u64 {
        let gates = match self {
            Self::Still(_) => 0,
            Self::Gated(made) => made.study.gates.len(),
        };
        (self.image().voxels.len() * (1 + gates)) as u64
    }

    /// Its segmentation.
    pub fn segmentation(&self) -> &Segmentation {
        match self {
            Self::Still(made) => &made.segmentation,
            Self::Gated(made) => &made.segmentation,
        }
    }

    /// The models that were fitted.
    pub fn candidates(&self) -> &[RankedTemplate] {
        &self.segmentation().candidates
    }

    /// The name of the model that was kept.
    pub fn template(&self) -> &str {
        let segmentation = self.segmentation();
        &segmentation.candidates[segmentation.chosen].name
    }

    /// The heart in its scan; `None` unless it is a ventricle with a wall.
    pub fn placed(&self) -> Option<PlacedHeart<'_>> {
        let apparent = &self.segmentation().fit.model.surfaces.as_ref()?.apparent;
        Some(PlacedHeart {
            image: self.image(),
            mesh: &apparent.mesh,
            wall: &apparent.wall,
        })
    }

    /// Volume of the muscle, ml; `None` unless it is a ventricle with a wall.
    pub fn muscle_ml(&self) -> Option<f64> {
        let surfaces = self.segmentation().fit.model.surfaces.as_ref()?;
        Some(surfaces.anatomical.wall_ml)
    }

    fn origin(&self) -> (&VolumeFacts, Option<&Provenance>) {
        match self {
            Self::Still(made) => (&made.reading.facts, made.reading.provenance.as_ref()),
            Self::Gated(made) => (&made.reading.facts, made.reading.provenance()),
        }
    }

    /// The heart fitted again from the common one, to which `motion` takes the first scan. It is judged as the fit by
    /// itself is. `None` where no wall is found from there: the fit by itself stays.
    fn again(
        &self,
        common: &CommonHeart,
        motion: &RigidMotion,
        parameters: &FitParameters,
        monitor: &Monitor<'_>,
    ) -> Result<Option<Segmentation>, SegmentationError> {
        let (facts, scan) = self.origin();
        let own = common.in_scan(motion);
        let first = self.segmentation();
        let Some(position) = OrganPosition::of_fitted(&first.fit.model, own.cup, own.superior)
        else {
            return Ok(None);
        };
        let source: AffineSource = facts.affine_source;
        let how = SegmentationParameters {
            deform: DeformParameters {
                base: own.base,
                muscle_ml: Some(own.muscle_ml),
                stiffness: parameters.deform.stiffness.times(REFIT_STIFFNESS),
                ..parameters.on(self.image(), source, scan)?
            },
            polar: parameters.polar,
            kept_model: None,
            segments_from: parameters.segments_from,
            reader: None,
        };
        let template = NamedTemplate {
            name: self.template().to_owned(),
            template: Template::of_cup(own.mesh, own.cup, monitor)?,
            built_in: false,
        };
        let search = OrganSearch::of_ventricle(position);
        let made = segment_at(search, self.image(), &[template], &how, None, monitor);
        monitor.check()?;
        let judgement = first.fit.judgement.clone();
        Ok(made.ok().map(|made| Segmentation {
            fit: Fit {
                model: made.fit.model,
                judgement,
            },
            ..made
        }))
    }

    /// The heart as it is compared: fitted again from the common one, with its beat if it is gated. Whether it was fitted
    /// again stands beside it.
    pub fn compared(
        self,
        order: &SerialOrder<'_>,
        number: usize,
        common: &CommonHeart,
        motion: &RigidMotion,
        monitor: &Monitor<'_>,
    ) -> Result<(ComparedHeart, bool), SerialError> {
        let parameters = FitParameters {
            mass_g: Some(common.muscle_ml * MYOCARDIAL_DENSITY_G_PER_ML),
            ..order.parameters.fit.clone()
        };
        let of_fit = |error| SerialError::of_segmentation(number, error);
        let again = self
            .again(common, motion, &parameters, monitor)
            .map_err(of_fit)?;
        let fitted_again = again.is_some();
        let heart = match self {
            Self::Still(mut made) => {
                if let Some(again) = again {
                    made.segmentation = again;
                }
                let judged = |limits| {
                    let figures = heart_figures(&made.segmentation);
                    let scan = made.reading.provenance.as_ref();
                    judged_by_normals(&made.segmentation, &figures, scan, &parameters, limits)
                };
                let judged = order.normals.map(judged).transpose();
                made.perfusion = judged.map_err(of_fit)?;
                ComparedHeart::Still(made)
            }
            Self::Gated(mut made) => {
                if let Some(again) = again {
                    made.segmentation = again;
                }
                let own = gated_order(order, &[], &parameters);
                let beat = (made.beat(&own, monitor))
                    .map_err(|error| SerialError::of_gated(number, error))?;
                ComparedHeart::Beating(Box::new(beat))
            }
        };
        Ok((heart, fitted_again))
    }
}

fn gated_order<'a>(
    order: &'a SerialOrder<'_>,
    gates: &'a [VolumeFile],
    parameters: &'a FitParameters,
) -> GatedOrder<'a> {
    GatedOrder {
        gates,
        auto: order.auto,
        models: order.models.clone(),
        normals: order.normals,
        parameters,
        choice: BeatChoice {
            gated: order.parameters.choice.gated,
            ..BeatChoice::default()
        },
    }
}
