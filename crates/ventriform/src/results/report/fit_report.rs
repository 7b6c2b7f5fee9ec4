//! The parts of a segmentation's report that come from its fit.

use super::json_number::{or_nan, point, round};
use crate::base::geometry::Vec3;
use crate::base::numeric::order;
use crate::heart::deform::FittedModel;
use crate::heart::deform::base_plane::rim_deviation_mm;
use crate::heart::judge::{Evidence, Judgement, confidence, consensus};
use crate::heart::model::wall::VentricleWall;
use crate::image::locate::cup::Cup;
use crate::image::locate::localisation::Localisation;
use crate::image::locate::patient_orientation::PatientOrientation;
use serde::{Deserialize, Serialize};

/// Where the organ was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = Localisation))]
pub struct LocalisationReport {
    /// Its centre.
    pub centre: [f64; 3],
    /// Direction from base to apex.
    pub axis: [f64; 3],
    /// Its length, mm.
    pub length_mm: f64,
    /// Correlation with the shape sought.
    pub correlation: f64,
    /// Correlation of the next best place.
    pub runner_up: Option<f64>,
    /// Hollowness, 0 to 1.
    pub hollowness: f64,
    /// Confidence of the search, 0 to 1.
    pub confidence: f64,
}

/// Which way is up in the patient.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Posture {
    /// The direction to the head.
    pub superior: [f64; 3],
    /// Its source: `superior`, `anterior`, `body`, `frame` or `unknown`.
    pub source: String,
    /// Its angle to the scanner's axis.
    pub tilt_degrees: f64,
    /// Confidence of that, 0 to 1.
    pub confidence: f64,
}

/// Figures of a fit, and the fitted model's pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = Fit))]
pub struct FitReport {
    /// Why the motion ended.
    pub reason: String,
    /// Chance that a reader who draws the visible edge agrees with the mask by a Jaccard index of 0.75 or more, calibrated on
    /// simulated scans, 0 to 1; of other organs, half the share of the surface that sees an edge.
    pub confidence: f64,
    /// Chance that the true cavity is within 20 % of the anatomical one, calibrated on simulated scans, 0 to 1: how sure the
    /// *size* is, where `confidence` says how sure the *place* of the visible edge is; ventricles only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_confidence: Option<f64>,
    /// Steps of the motion.
    pub iterations: usize,
    /// Runs from different starts.
    pub runs: usize,
    /// Distance to the edges, weighted root mean square.
    #[serde(deserialize_with = "or_nan")]
    pub residual_mm: f64,
    /// Share of sensors that see an edge.
    pub active_sensors: f64,
    /// Root of the mean squared strain.
    pub strain: f64,
    /// Kinetic energy after each step.
    pub energy: Vec<f64>,
    /// Intersecting pairs of triangles.
    pub self_intersections: usize,
    /// Triangles that turned over.
    pub turned_triangles: usize,
    /// The ventricle's long axis.
    pub long_axis: Option<LongAxis>,
    /// Standard deviation of the height of the ventricle's rim, mm; where anatomy and image together put it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rim_uncertainty_mm: Option<f64>,
    /// Size relative to the model.
    pub scale: f64,
    /// Rotation of the model; row by row.
    pub rotation: [[f64; 3]; 3],
    /// How far each vertex moved, mm.
    pub displacement_mm: Vec<f64>,
}

/// The ends of a ventricle's long axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct LongAxis {
    /// Centre of the base.
    pub base: [f64; 3],
    /// The apex.
    pub apex: [f64; 3],
}

/// Volumes of a fitted model, millilitres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FittedVolumes {
    /// Of the wall that `edge` asks for, or of the whole organ.
    pub wall: f64,
    /// Of its cavity; ventricles only.
    pub cavity: Option<f64>,
    /// Of the wall as the blurred image shows it; ventricles only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub apparent: Option<WallVolumes>,
    /// Of the wall corrected for the blur; ventricles only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub anatomical: Option<WallVolumes>,
    /// Of nine of ten hearts, the true volumes of the wall corrected for the blur lie within these; ventricles only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub anatomical_interval: Option<VolumeIntervalsReport>,
}

/// Volumes of one wall, millilitres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct WallVolumes {
    /// Of the wall.
    pub wall: f64,
    /// Of the cavity.
    pub cavity: f64,
}

/// Least and greatest volumes of one wall, millilitres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = VolumeIntervals))]
pub struct VolumeIntervalsReport {
    /// Of the wall.
    pub wall: [f64; 2],
    /// Of the cavity.
    pub cavity: [f64; 2],
}

/// Thickness of both walls, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Thicknesses {
    /// Of the wall as the blurred image shows it.
    pub apparent: Thickness,
    /// Of the wall corrected for the blur.
    pub anatomical: Thickness,
    /// Of nine of ten hearts that look so, the true mean thickness lies within these.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub anatomical_interval: Option<[f64; 2]>,
}

/// Thickness of a wall, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Thickness {
    /// Its mean.
    pub mean: f64,
    /// Its standard deviation over the wall.
    pub spread: f64,
}

/// Standard deviation of the nodes' distance from the walls, millimetres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Uncertainties {
    /// From the wall as it looks.
    pub apparent: Uncertainty,
    /// From the wall itself.
    pub anatomical: Uncertainty,
}

/// Standard deviation of the nodes' distance from a wall, millimetres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Uncertainty {
    /// Median over the nodes.
    pub median: f64,
    /// 95th percentile over the nodes.
    pub percentile_95: f64,
    /// The greatest.
    pub greatest: f64,
}

/// The figures behind confidence and flags.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = Evidence))]
pub struct EvidenceReport {
    /// Share of sensors that see an edge.
    pub active_sensors: f64,
    /// Distance to the edges, weighted root mean square.
    #[serde(deserialize_with = "or_nan")]
    pub residual_mm: f64,
    /// Root of the mean squared strain.
    pub strain: f64,
    /// Share of the wall's brightness that the cavity lacks, 0 to 1.
    pub hollowness: f64,
    /// Volume of the cavity.
    pub cavity_ml: f64,
    /// Standard deviation of the wall's thickness.
    pub thickness_spread_mm: f64,
    /// Standard deviation of the distance from the axis to the middle of the wall, as a share of its mean.
    pub unroundness: f64,
    /// How far the middle of the wall lies off the axis, as a share of that mean.
    pub offset: f64,
    /// Length from rim to apex over the outer radius.
    pub slenderness: f64,
    /// Distance of the septum from the axis over that of the free wall.
    pub septal_bulge: f64,
    /// Share of the wall that takes up less than half as much as the bright wall does.
    #[serde(deserialize_with = "or_nan")]
    pub dark: f64,
    /// Share of the wall beside which something takes up more than that.
    #[serde(deserialize_with = "or_nan")]
    pub beside: f64,
    /// Mean correlation of image and wall in their projections; null where the orientation is unknown.
    pub agreement_of_views: Option<f64>,
    /// How much better two places of the wall in two runs of projections explain the image than one, as a share of what one leaves unexplained; null likewise.
    pub gain_of_two_places: Option<f64>,
    /// Distance of the two places along the bed; null likewise.
    pub displacement_mm: Option<f64>,
    /// Share of the projections that show the second place; null likewise.
    pub displaced_share: Option<f64>,
    /// Chance that the patient moved, 0 to 1.
    pub chance_of_motion: f64,
    /// Mean distance of the nodes from the fits of the other built-in hearts; null without them.
    pub template_spread_mm: Option<f64>,
}

impl LocalisationReport {
    pub(super) fn from_found(found: &Localisation) -> Self {
        Self {
            centre: point(&found.cup.centre),
            axis: point(&found.cup.axis),
            length_mm: round(found.cup.length),
            correlation: round(found.correlation),
            runner_up: found.runner_up.map(round),
            hollowness: round(found.hollowness),
            confidence: round(found.confidence),
        }
    }
}

impl Posture {
    pub(crate) fn from_orientation(orientation: &PatientOrientation) -> Self {
        Self {
            superior: point(&orientation.superior),
            source: orientation.source.as_str().to_owned(),
            tilt_degrees: round(orientation.tilt()),
            confidence: round(orientation.confidence),
        }
    }
}

impl FitReport {
    pub(super) fn new(fit: &FittedModel, judgement: &Judgement) -> Self {
        let turn = fit.rotation.matrix();
        let row = |r: usize| [0, 1, 2].map(|c| round(turn[(r, c)]));
        Self {
            reason: fit.reason.as_str().to_owned(),
            confidence: round(judgement.confidence),
            size_confidence: (judgement.volumes).map(|volumes| round(volumes.size_confidence)),
            iterations: fit.iterations,
            runs: fit.runs,
            residual_mm: round(fit.residual),
            active_sensors: round(fit.active),
            strain: round(fit.strain.sqrt()),
            energy: fit.energy.iter().map(|e| round(*e)).collect(),
            self_intersections: fit.self_intersections,
            turned_triangles: fit.turned_triangles,
            long_axis: fit.cup.as_ref().map(LongAxis::from_cup),
            rim_uncertainty_mm: fit
                .rim_evidence
                .as_ref()
                .map(|evidence| round(rim_deviation_mm(evidence))),
            scale: round(fit.scale),
            rotation: [0, 1, 2].map(row),
            displacement_mm: fit.displacements.iter().map(|d| round(d.norm())).collect(),
        }
    }
}

impl LongAxis {
    /// The axis of a ventricle's `cup`, rounded as in reports, LPS mm.
    pub fn from_cup(cup: &Cup) -> Self {
        Self {
            base: point(&cup.base()),
            apex: point(&cup.apex()),
        }
    }

    /// Base and apex, LPS mm.
    pub fn ends(&self) -> [Vec3; 2] {
        [self.base, self.apex].map(Vec3::from)
    }
}

impl FittedVolumes {
    pub(super) fn new(fit: &FittedModel, judgement: &Judgement) -> Self {
        let [apparent, anatomical] = match &fit.surfaces {
            Some(both) => [&both.apparent, &both.anatomical].map(|surface| {
                Some(WallVolumes {
                    wall: round(surface.wall_ml),
                    cavity: round(surface.wall.cavity_ml),
                })
            }),
            None => [None; 2],
        };
        Self {
            wall: round(fit.wall_ml),
            cavity: fit.wall.as_ref().map(|wall| round(wall.cavity_ml)),
            apparent,
            anatomical,
            anatomical_interval: judgement.volumes.map(|of| VolumeIntervalsReport {
                wall: of.wall_ml.map(round),
                cavity: of.cavity_ml.map(round),
            }),
        }
    }
}

impl Thicknesses {
    /// Those of a ventricle.
    pub(super) fn from_fit(fit: &FittedModel) -> Option<Self> {
        let both = fit.surfaces.as_ref()?;
        let of = |wall: &VentricleWall| Thickness {
            mean: round(wall.thickness),
            spread: round(wall.thickness_spread),
        };
        Some(Self {
            apparent: of(&both.apparent.wall),
            anatomical: of(&both.anatomical.wall),
            anatomical_interval: (both.thickness).map(|thickness| thickness.interval_mm.map(round)),
        })
    }
}

impl Uncertainties {
    /// Those of a ventricle.
    pub(super) fn from_judgement(judgement: &Judgement) -> Option<Self> {
        let both = judgement.uncertainty.as_ref()?;
        Some(Self {
            apparent: Uncertainty::over(&both.apparent)?,
            anatomical: Uncertainty::over(&both.anatomical)?,
        })
    }
}

impl Uncertainty {
    /// `None` without nodes.
    fn over(nodes: &[f64]) -> Option<Self> {
        let mut sorted = nodes.to_vec();
        sorted.sort_by(f64::total_cmp);
        Some(Self {
            greatest: round(*sorted.last()?),
            median: round(order::quantile(&sorted, 0.5)),
            percentile_95: round(order::quantile(&sorted, 0.95)),
        })
    }
}

impl EvidenceReport {
    /// The evidence of a ventricle.
    pub(super) fn from_judgement(judgement: &Judgement) -> Option<Self> {
        let e: &Evidence = judgement.evidence.as_ref()?;
        Some(Self {
            active_sensors: round(e.active),
            residual_mm: round(e.residual),
            strain: round(e.strain),
            hollowness: round(e.hollowness),
            cavity_ml: round(e.cavity_ml),
            thickness_spread_mm: round(e.thickness_spread),
            unroundness: round(e.unroundness),
            offset: round(e.offset),
            slenderness: round(e.slenderness),
            septal_bulge: round(e.septal_bulge),
            dark: round(e.dark),
            beside: round(e.beside),
            agreement_of_views: e.views.map(|v| round(v.agreement)),
            gain_of_two_places: e.views.map(|v| round(v.gain)),
            displacement_mm: e.views.map(|v| round(v.displacement)),
            displaced_share: e.views.map(|v| round(v.share)),
            chance_of_motion: round(confidence::of_motion(e)),
            template_spread_mm: consensus::spread(&judgement.nodes).map(round),
        })
    }
}
