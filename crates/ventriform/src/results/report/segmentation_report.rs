//! The report of a segmentation: what is written as `report.json`, read again for pages and DICOM
//! objects, and described in the OpenAPI document.
//!
//! A report is stored and may be read by a later version than the one that wrote it: a field that is
//! added is an `Option` or has `#[serde(default)]`.

use super::fit_report::{
    EvidenceReport, FitReport, FittedVolumes, LocalisationReport, LongAxis, Posture, Thicknesses,
    Uncertainties,
};
use super::input::FileFacts;
use super::json_number::{or_nan, round};
use super::perfusion_report::PerfusionReport;
use super::projections_report::ProjectionsReport;
use super::raised_flag::RaisedFlag;
use crate::base::geometry::Vec3;
use crate::heart::judge::Fit;
use crate::heart::model::MYOCARDIAL_DENSITY_G_PER_ML;
use crate::heart::polar::PolarSummary;
use crate::heart::reader::{ReaderOffsets, ReaderProfile};
use crate::image::grid::agreement::Agreement;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The report of a segmentation. Lengths are millimetres in the patient frame LPS.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SegmentationReport {
    /// Name of the fitted model.
    pub template: String,
    /// Why that one was taken.
    pub choice: String,
    /// Models that were fitted.
    pub candidates: Vec<CandidateReport>,
    /// Models that could not be fitted.
    pub refused: Vec<RefusedTemplateReport>,
    /// Where the organ was found.
    pub localisation: Option<LocalisationReport>,
    /// Which way is up in the patient.
    pub posture: Option<Posture>,
    /// Figures of the fit.
    pub fit: FitReport,
    /// The figures behind confidence and flags; ventricles only.
    pub evidence: Option<EvidenceReport>,
    /// Volumes.
    pub volumes_ml: FittedVolumes,
    /// Mass of the myocardium, g, from the anatomical wall; ventricles only.
    pub mass_g: Option<f64>,
    /// Of nine of ten hearts, the true mass lies within these, g; ventricles only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_interval_g: Option<[f64; 2]>,
    /// Mean thickness of the wall that `edge` asks for; ventricles only.
    pub wall_thickness_mm: Option<f64>,
    /// Thickness of both walls; ventricles only.
    pub thickness_mm: Option<Thicknesses>,
    /// Standard deviation of the nodes' distance from the walls; ventricles only.
    pub uncertainty_mm: Option<Uncertainties>,
    /// Full width at half maximum of the image's point response; ventricles only.
    pub resolution_mm: Option<Resolution>,
    /// The reader's profile that the shown wall was drawn by.
    pub reader: Option<AppliedReaderReport>,
    /// Agreement with the expert's mask.
    pub measures: Option<AgreementReport>,
    /// Uptake of the wall; ventricles only.
    pub polar: Option<PolarSummary>,
    /// The wall's uptake beside normal limits, if some were given.
    pub perfusion: Option<PerfusionReport>,
    /// The projections that slices were reconstructed of, if they were reconstructed here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub projections: Option<ProjectionsReport>,
    /// Reasons to look closer.
    pub flags: Vec<RaisedFlag>,
    /// Sentences that a reader may take over into the impression; `null` where the report was made before they existed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub impression: Option<Vec<String>>,
    /// Which voxels the mask holds.
    pub mask_rule: String,
    /// Every parameter, defaults written out.
    #[cfg_attr(feature = "schema", schema(value_type = crate::parameters::FitParameters))]
    pub parameters: Map<String, Value>,
    /// The volume's file.
    pub input: FileFacts,
    /// Warnings about the volume's file.
    pub warnings: Vec<String>,
}

/// One model's fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = Candidate))]
pub struct CandidateReport {
    /// The model's name.
    pub template: String,
    /// Its confidence by its own figures, by which templates are ranked.
    #[serde(deserialize_with = "or_nan")]
    pub confidence: f64,
    /// Figure that decides between equals.
    pub merit: f64,
    /// Share of the surface along which an edge is seen.
    pub active: f64,
    /// Root of the mean squared strain.
    pub strain: f64,
    /// Distance to the edges, weighted root mean square.
    #[serde(deserialize_with = "or_nan")]
    pub residual_mm: f64,
}

/// A model that could not be fitted.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = RefusedTemplate))]
pub struct RefusedTemplateReport {
    /// The model's name.
    pub template: String,
    /// Why.
    pub reason: String,
}

/// Full width at half maximum of the image's point response.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Resolution {
    /// Millimetres.
    pub value: f64,
    /// `given` as a parameter, or `estimated` from the image.
    pub source: String,
}

/// The reader's profile that a wall was drawn by.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = AppliedReader))]
pub struct AppliedReaderReport {
    /// Its name.
    pub name: String,
    /// SHA-256 of the profile, hexadecimal.
    pub sha256: String,
    /// `edge`: by distances from the edge that the image shows. `level`: where the image has a share of the polar map's
    /// reference.
    pub kind: String,
    /// The wall that was drawn from.
    pub edge: String,
    /// Number of masks that it was learnt on.
    pub masks: usize,
    /// The distances, mm; `null` for a reader of kind `level`.
    pub offsets_mm: Option<ReaderOffsets>,
    /// The level, a share of the polar map's reference; `null` for a reader of kind `edge`.
    pub level: Option<f64>,
    /// Share of the movement that was applied: 1 unless the surface would intersect itself.
    pub share_applied: f64,
}

/// A mask against an expert's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = Agreement))]
pub struct AgreementReport {
    /// Jaccard index.
    pub jaccard: f64,
    /// Mean contour distance, voxels.
    pub contour_distance_voxels: Option<f64>,
    /// The same in mm.
    pub contour_distance_mm: Option<f64>,
    /// Dice index.
    pub dice: f64,
    /// Hausdorff distance.
    pub hausdorff_mm: Option<f64>,
    /// Its 95th percentile.
    pub hausdorff95_mm: Option<f64>,
    /// Volume of the mask.
    pub volume_ml: f64,
    /// Volume of the expert's mask.
    pub expert_volume_ml: f64,
    /// How much larger the mask is, ml.
    pub volume_difference_ml: f64,
    /// How much larger the mask is, percent.
    pub volume_difference_percent: Option<f64>,
}

/// The parts of a [`SegmentationReport`] beside the fit.
#[derive(Debug)]
pub struct SegmentationParts {
    /// Name of the fitted model.
    pub template: String,
    /// Why that one was taken.
    pub choice: String,
    /// Models that were fitted.
    pub candidates: Vec<CandidateReport>,
    /// Models that could not be fitted.
    pub refused: Vec<RefusedTemplateReport>,
    /// The image's resolution; ventricles only.
    pub resolution: Option<Resolution>,
    /// The reader's profile that the wall was drawn by.
    pub reader: Option<AppliedReaderReport>,
    /// Agreement with the expert's mask.
    pub measures: Option<AgreementReport>,
    /// Uptake of the wall; ventricles only.
    pub polar: Option<PolarSummary>,
    /// The wall's uptake beside normal limits.
    pub perfusion: Option<PerfusionReport>,
    /// The projections that slices were reconstructed of.
    pub projections: Option<ProjectionsReport>,
    /// Every parameter by its name, defaults written out.
    pub parameters: Map<String, Value>,
    /// Facts about the volume's file.
    pub input: FileFacts,
    /// Warnings about the volume's file and the expert's mask.
    pub warnings: Vec<String>,
}

impl SegmentationReport {
    /// Joins the figures of `fit` to the other parts.
    pub fn new(fit: &Fit, parts: SegmentationParts) -> Self {
        let (fit, judgement) = (&fit.model, &fit.judgement);
        let anatomical = fit.surfaces.as_ref().map(|both| &both.anatomical);
        Self {
            template: parts.template,
            choice: parts.choice,
            candidates: parts.candidates,
            refused: parts.refused,
            localisation: fit
                .localisation
                .as_ref()
                .map(LocalisationReport::from_found),
            posture: fit
                .patient_orientation
                .as_ref()
                .map(Posture::from_orientation),
            fit: FitReport::new(fit, judgement),
            evidence: EvidenceReport::from_judgement(judgement),
            volumes_ml: FittedVolumes::new(fit, judgement),
            mass_g: anatomical.map(|surface| round(MYOCARDIAL_DENSITY_G_PER_ML * surface.wall_ml)),
            mass_interval_g: (judgement.volumes).map(|intervals| {
                let grams = |wall_ml: f64| round(MYOCARDIAL_DENSITY_G_PER_ML * wall_ml);
                intervals.wall_ml.map(grams)
            }),
            wall_thickness_mm: fit.wall.as_ref().map(|wall| round(wall.thickness)),
            thickness_mm: Thicknesses::from_fit(fit),
            uncertainty_mm: Uncertainties::from_judgement(judgement),
            resolution_mm: parts.resolution,
            reader: parts.reader,
            measures: parts.measures,
            polar: parts.polar,
            perfusion: parts.perfusion,
            projections: parts.projections,
            flags: (judgement.flags.iter())
                .map(|flag| RaisedFlag::new(flag.code(), flag))
                .collect(),
            impression: None,
            mask_rule: "a voxel belongs to the mask if its centre lies inside the surface".into(),
            parameters: parts.parameters,
            input: parts.input,
            warnings: parts.warnings,
        }
    }

    /// The parameter `organ`.
    pub fn organ(&self) -> &str {
        let organ = self.parameters.get("organ").and_then(Value::as_str);
        organ.unwrap_or("generic")
    }

    /// Whether the organ is a left ventricle.
    pub fn is_ventricle(&self) -> bool {
        self.organ() == "left_ventricle"
    }

    /// Which of the two walls of a ventricle the fit shows.
    pub fn edge(&self) -> &str {
        let edge = self.parameters.get("edge").and_then(Value::as_str);
        edge.unwrap_or("apparent")
    }

    /// Of a ventricle, the long axis and the direction to the patient's head, LPS: the frame's, if the report
    /// states none.
    pub fn axes(&self) -> Option<(LongAxis, Vec3)> {
        let superior = self.posture.as_ref().map(|posture| posture.superior.into());
        Some((self.fit.long_axis?, superior.unwrap_or_else(Vec3::z)))
    }
}

impl Resolution {
    /// A resolution of `value` mm; `given` if the caller stated it.
    pub fn new(value: f64, given: bool) -> Self {
        let source = if given { "given" } else { "estimated" };
        Self {
            value: round(value),
            source: source.to_owned(),
        }
    }
}

impl CandidateReport {
    /// These figures, rounded as in reports.
    #[must_use]
    pub fn rounded(self) -> Self {
        Self {
            template: self.template,
            confidence: round(self.confidence),
            merit: round(self.merit),
            active: round(self.active),
            strain: round(self.strain),
            residual_mm: round(self.residual_mm),
        }
    }
}

impl AppliedReaderReport {
    /// The profile called `name`, by which the wall was moved, reduced to the share `applied`.
    pub fn new(name: &str, profile: &ReaderProfile, applied: f64) -> Self {
        let drawing = profile.drawing();
        Self {
            name: name.to_owned(),
            sha256: profile.sha256(),
            kind: profile.learnt.kind().as_str().to_owned(),
            edge: profile.edge.as_str().to_owned(),
            masks: profile.masks(),
            offsets_mm: drawing.offsets(),
            level: drawing.level(),
            share_applied: round(applied),
        }
    }
}

impl AgreementReport {
    /// The measures of two masks; distances are `None` where a mask is empty.
    pub fn from_agreement(agreement: &Agreement) -> Self {
        let contours = agreement.contours;
        let [volume, expert] = agreement.volumes_ml;
        Self {
            jaccard: agreement.jaccard,
            contour_distance_voxels: contours.map(|c| c.mean_voxels),
            contour_distance_mm: contours.map(|c| c.mean_mm),
            dice: agreement.dice,
            hausdorff_mm: contours.map(|c| c.hausdorff_mm),
            hausdorff95_mm: contours.map(|c| c.hausdorff95_mm),
            volume_ml: round(volume),
            expert_volume_ml: round(expert),
            volume_difference_ml: round(volume - expert),
            volume_difference_percent: (expert > 0.0)
                .then(|| round(100.0 * (volume / expert - 1.0))),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use serde_json::json;

    /// A report of an organ without cavity.
    pub(crate) fn first_report() -> SegmentationReport {
        let one = [1.0, 0.0, 0.0, 0.0];
        serde_json::from_value(json!({
            "template": "mdl_1",
            "choice": "mdl_1 was the only model fitted",
            "candidates": [{"template": "mdl_1", "confidence": null, "merit": 0.5, "active": 0.9, "strain": 0.1, "residual_mm": null}],
            "refused": [],
            "localisation": null,
            "fit": {
                "reason": "at_rest", "confidence": 0.5, "iterations": 12, "runs": 1, "residual_mm": 0.5,
                "active_sensors": 0.9, "strain": 0.1, "energy": [2.0], "self_intersections": 0,
                "turned_triangles": 0, "long_axis": null, "scale": 1.0, "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
                "displacement_mm": [1.5],
            },
            "volumes_ml": {"wall": 12.25, "cavity": null},
            "wall_thickness_mm": null,
            "measures": null,
            "polar": null,
            "flags": [],
            "mask_rule": "a voxel belongs to the mask if its centre lies inside the surface",
            "parameters": {},
            "input": {
                "format": "NIfTI-1", "byte_order": "little", "compressed": true, "data_type": "float32",
                "scaling": null, "file_shape": [4, 5, 6], "frames": 1, "frame": null, "shape": [4, 5, 6],
                "spacing_mm": [3.0, 3.0, 3.0], "affine_lps": [one, one, one, one], "affine_ras": [one, one, one, one],
                "affine_source": "sform", "unit": "mm", "warnings": [],
                "intensity": {
                    "minimum": 0.0, "maximum": 1.0, "mean": 0.5, "sum": 60.0, "finite_voxels": 120,
                    "missing_voxels": 0, "integral": false, "labels": null,
                },
            },
            "warnings": [],
            "a_later_version": 1,
        }))
        .expect("what it lacks may be missing")
    }

    #[test]
    fn what_is_not_a_number_is_null_and_reads_back() {
        let report = first_report();
        assert!(
            report.candidates[0].residual_mm.is_nan() && report.candidates[0].confidence.is_nan()
        );
        let written = serde_json::to_value(&report).unwrap();
        assert_eq!(written["candidates"][0]["residual_mm"], Value::Null);
        let again: SegmentationReport = serde_json::from_value(written.clone()).unwrap();
        assert_eq!(serde_json::to_value(&again).unwrap(), written);
    }
}
