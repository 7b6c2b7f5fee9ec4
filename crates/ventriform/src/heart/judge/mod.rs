//! Judges a fitted model: how likely it is right, and what gives reason for a warning.
//!
//! In go a [`FittedModel`], the image that it was fitted to and the volume; out comes a [`Judgement`]. No other
//! image and no mask is needed.
//!
//! 1. [`evidence`]: figures of the wall as the sensors left it, before its base plane was put;
//!    [`motion`]: whether the projections of the image show the wall in two positions.
//! 2. [`confidence`]: the chances of a good fit, of motion and of a heart, by calibrated logistic models.
//! 3. [`flags`]: the warnings, by [`flag_rules`], among them [`values`] (no counts) and [`exchanged_axes`];
//!    [`uncertainty`] and [`volume_intervals`]: how far each node and the volumes may be off.
//! 4. [`septum`]: whether the fit is to be made again without the septum's sensors; [`refusal`]: whether it is a
//!    heart at all.
//! 5. [`consensus`]: of several models' fits to one volume, the judgement of the chosen one by all of them.
//!
//! Guaranteed: the model is not changed. Not guaranteed: that a wrong fit is noticed; docs/log/confidence.md has the
//! figures of hearts that were held out.

pub mod calibration;
pub mod confidence;
pub mod consensus;
mod dark_apex;
pub mod evidence;
pub mod exchanged_axes;
mod field_of_view;
mod fit;
mod flag_rules;
pub mod flags;
mod liver_side;
pub mod logistic;
pub mod motion;
mod node_terms;
pub mod refusal;
pub mod septum;
#[cfg(test)]
mod test_fits;
pub mod uncertainty;
mod uncertainty_calibration;
pub mod values;
mod volume_calibration;
pub mod volume_intervals;

pub use evidence::Evidence;
pub use fit::Fit;
pub use flags::Flag;
pub use uncertainty::{NodeEvidence, WallUncertainty};
pub use volume_intervals::VolumeIntervals;

use crate::base::progress::{Cancelled, Monitor};
use crate::heart::deform::setup::FitSetup;
use crate::heart::deform::{DeformParameters, FittedModel};
use crate::heart::model::Organ;
use crate::image::grid::Volume;
use crate::image::locate::patient_orientation::OrientationSource;
use evidence::Edges;
use motion::Views;

/// The chance that a fitted model is right, its reasons, and warnings.
#[derive(Debug, Clone)]
pub struct Judgement {
    /// Of a ventricle, the chance that a reader who draws the visible edge agrees with the mask by a Jaccard index of
    /// 0.75 or more, calibrated on simulated scans ([`confidence::of_agreement`]). Of other organs, half the share of
    /// the surface that sees an edge, at most 0.5.
    pub confidence: f64,
    /// Confidence of the model's position, 0 (a guess) to 1 ([`confidence::of_position`]).
    pub position_confidence: f64,
    /// The figures behind the confidence; ventricles only.
    pub evidence: Option<Evidence>,
    /// The figures behind the uncertainty of each node; empty for other organs.
    pub nodes: Vec<NodeEvidence>,
    /// Standard deviation of each node's distance from both walls, mm; ventricles only.
    pub uncertainty: Option<WallUncertainty>,
    /// Intervals about the volumes of the anatomical wall; ventricles only.
    pub volumes: Option<VolumeIntervals>,
    /// Warnings.
    pub flags: Vec<Flag>,
}

/// Judges `model`, fitted from `setup` by `parameters` to the `organ` in `volume`.
///
/// # Errors
/// [`Cancelled`].
pub fn judge(
    model: &FittedModel,
    setup: &FitSetup,
    volume: &Volume,
    organ: Organ,
    parameters: &DeformParameters,
    monitor: &Monitor,
) -> Result<Judgement, Cancelled> {
    let evidence = evidence_of(model, setup, volume, monitor)?;
    let position_confidence = confidence::of_position(model);
    let chance = match &evidence {
        Some(evidence) => confidence::of_agreement(evidence, parameters.edge),
        None => position_confidence.min(0.5),
    };
    let chance = confidence::in_view_of_search(chance, model);
    let ventricle = organ == Organ::LeftVentricle;
    let flags = flag_rules::flags(
        model,
        evidence.as_ref(),
        chance,
        volume,
        ventricle,
        parameters.orbit,
    );
    let confidence = flag_rules::limited(chance, &flags);
    let nodes = match (&model.sensed_wall, &model.localisation) {
        (Some(wall), Some(_)) => {
            uncertainty::node_evidence(model.apparent_mesh(), wall, &model.readings)
        }
        _ => Vec::new(),
    };
    let volumes = model
        .surfaces
        .as_ref()
        .zip(evidence.as_ref())
        .map(|(both, evidence)| {
            let anatomical = &both.anatomical;
            let (wall, thickness) = (&anatomical.wall, both.thickness.as_ref());
            VolumeIntervals::about(anatomical.wall_ml, wall.cavity_ml, evidence.dark, thickness)
        });
    Ok(Judgement {
        confidence,
        position_confidence,
        evidence,
        uncertainty: WallUncertainty::of_model(model, &nodes, confidence),
        volumes,
        nodes,
        flags,
    })
}

/// The evidence of a ventricle. The confidence is calibrated on the wall as the sensors left it.
fn evidence_of(
    model: &FittedModel,
    setup: &FitSetup,
    volume: &Volume,
    monitor: &Monitor,
) -> Result<Option<Evidence>, Cancelled> {
    let (Some(wall), Some(found)) = (&model.sensed_wall, &model.localisation) else {
        return Ok(None);
    };
    let edges = Edges {
        active: model.active,
        residual: model.residual,
        strain: model.strain.sqrt(),
    };
    let orientation = &setup.patient_orientation;
    let mesh = model.apparent_mesh();
    let views = match orientation.source {
        OrientationSource::Unknown => {
            Views::about_axis(mesh, &found.cup.axis, volume, found.wall, monitor)?
        }
        _ => Views::new(mesh, &orientation.superior, volume, found.wall, monitor)?,
    };
    let hollowness = found.hollowness;
    Ok(Evidence::new(wall, &edges, hollowness, &setup.field, views))
}
