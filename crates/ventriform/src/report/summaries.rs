//! The main figures of what jobs make, for lists: the reports have all.

use super::beat_report::BeatReport;
use super::fit_report::FittedVolumes;
use super::raised_flag::RaisedFlag;
use super::segmentation_report::{AgreementReport, CandidateReport, SegmentationReport};
use crate::reader::{ReaderOffsets, ReaderProfile};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The main figures of a model; the report has all.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ModelSummary {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// V - E + F.
    pub euler_characteristic: i64,
    /// Intersecting pairs of triangles.
    pub self_intersections: usize,
    /// Mean 2r/R of the triangles.
    pub radius_ratio_mean: f64,
    /// Smallest 2r/R.
    pub radius_ratio_min: f64,
    /// Mean angle between neighbours, degrees.
    pub dihedral_mean_deg: f64,
    /// Mean distance to the surface, mm.
    pub distance_mean_mm: f64,
    /// Largest distance to the surface, mm.
    pub hausdorff_mm: f64,
    /// Volume that the model encloses beyond that of the surface, percent of it.
    pub volume_error_percent: f64,
    /// The paper's fitness.
    pub fitness: f64,
}

/// The main figures of a segmentation; the report has all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SegmentationSummary {
    /// Name of the fitted model.
    pub template: String,
    /// Why that one was taken.
    pub choice: String,
    /// Models that were fitted.
    pub candidates: Vec<CandidateReport>,
    /// Why the motion ended.
    pub reason: String,
    /// Confidence that the fit is right, 0 to 1.
    pub confidence: f64,
    /// Volumes.
    pub volumes_ml: FittedVolumes,
    /// Agreement with the expert's mask.
    pub measures: Option<AgreementReport>,
    /// Reasons to look closer.
    pub flags: Vec<RaisedFlag>,
    /// Number of vertices of the fitted mesh.
    pub vertices: usize,
}

/// The main figures of a beat; the report has all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct BeatSummary {
    /// Name of the model that was fitted to the gates' sum.
    pub template: String,
    /// Confidence of that fit, 0 to 1.
    pub confidence: f64,
    /// Number of gates.
    pub gates: usize,
    /// The gate with the largest cavity, counted from 1.
    pub end_diastole_gate: usize,
    /// The gate with the smallest cavity.
    pub end_systole_gate: usize,
    /// End-diastolic volume.
    pub edv_ml: f64,
    /// End-systolic volume.
    pub esv_ml: f64,
    /// Stroke volume.
    pub sv_ml: f64,
    /// Ejection fraction; `null` if the gates are no beat.
    pub ef_percent: Option<f64>,
    /// Standard deviation of the wall's phases, degrees.
    pub phase_sd_degrees: f64,
    /// The smallest arc that holds 95 per cent of them, degrees.
    pub phase_bandwidth_degrees: f64,
    /// Whether the phases can be relied on.
    pub phase_reliable: bool,
    /// Reasons to look closer.
    pub flags: Vec<RaisedFlag>,
}

/// The main figures of a template.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct TemplateSummary {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// Enclosed volume, millilitres.
    pub volume_ml: f64,
    /// Length of its cup, mm; ventricles only.
    pub length_mm: Option<f64>,
    /// Assumptions about the mesh and changes of it, in sentences.
    pub warnings: Vec<String>,
}

/// Content of a reader's profile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ReaderSummary {
    /// The wall that the distances start from: `apparent` or `anatomical`.
    pub edge: String,
    /// Number of masks that it was learnt on.
    pub masks: usize,
    /// The distances that are applied, mm.
    pub offsets_mm: ReaderOffsets,
}

impl SegmentationSummary {
    /// The main figures of `report`, whose mesh has that many vertices.
    pub fn of(report: SegmentationReport, vertices: usize) -> Self {
        Self {
            template: report.template,
            choice: report.choice,
            candidates: report.candidates,
            reason: report.fit.reason,
            confidence: report.fit.confidence,
            volumes_ml: report.volumes_ml,
            measures: report.measures,
            flags: report.flags,
            vertices,
        }
    }
}

impl BeatSummary {
    /// The main figures of `report`.
    pub fn of(report: BeatReport) -> Self {
        Self {
            template: report.template,
            confidence: report.confidence,
            gates: report.gates.len(),
            end_diastole_gate: report.end_diastole_gate,
            end_systole_gate: report.end_systole_gate,
            edv_ml: report.edv_ml,
            esv_ml: report.esv_ml,
            sv_ml: report.sv_ml,
            ef_percent: report.ef_percent,
            phase_sd_degrees: report.phase.sd_degrees,
            phase_bandwidth_degrees: report.phase.bandwidth_degrees,
            phase_reliable: report.phase.reliable,
            flags: report.flags,
        }
    }
}

impl ReaderSummary {
    /// The main figures of `profile`.
    pub fn of(profile: &ReaderProfile) -> Self {
        Self {
            edge: profile.edge.as_str().to_owned(),
            masks: profile.masks(),
            offsets_mm: profile.offsets(),
        }
    }
}

/// A document as a JSON object, its fields in their order.
///
/// # Panics
/// If it is none, or has keys that are no text.
pub fn object(document: &impl Serialize) -> Map<String, Value> {
    match serde_json::to_value(document) {
        Ok(Value::Object(object)) => object,
        other => panic!("a document is an object: {other:?}"),
    }
}
