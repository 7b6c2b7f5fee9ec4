//! The main figures of what jobs make, for lists: the reports have all.

use super::beat_report::BeatReport;
use super::comparison_report::ComparisonReport;
use super::fit_report::FittedVolumes;
use super::raised_flag::RaisedFlag;
use super::segmentation_report::{AgreementReport, CandidateReport, SegmentationReport};
use super::serial_report::SerialReport;
use crate::heart::comparison::Verdict;
use crate::heart::normals::{GroupSex, NormalGroup, NormalLimits};
use crate::heart::reader::{ReaderOffsets, ReaderProfile};
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
    pub sv_ml: Option<f64>,
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
    /// `edge`: the reader draws by distances from the edge that the image shows. `level`: where the image has a share of the
    /// polar map's reference.
    pub kind: String,
    /// The wall that is drawn from: `apparent` or `anatomical`.
    pub edge: String,
    /// Number of masks that it was learnt on.
    pub masks: usize,
    /// The distances that are applied, mm; `null` for a reader of kind `level`.
    pub offsets_mm: Option<ReaderOffsets>,
    /// The level that is applied, a share of the polar map's reference; `null` for a reader of kind `edge`.
    pub level: Option<f64>,
}

/// The main figures of a comparison of rest and stress; the report has all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ComparisonSummary {
    /// Ratio of the cavities, stress to rest (transient ischaemic dilation).
    pub tid: f64,
    /// Summed stress score, 0 to 68; `null` without normal limits, as for all scores.
    pub sss: Option<u32>,
    /// Summed rest score.
    pub srs: Option<u32>,
    /// Summed difference score.
    pub sds: Option<u32>,
    /// Share of the wall that loses uptake at stress.
    pub reversible_percent: f64,
    /// Its interval by noise, 5th and 95th percentile; not there in comparisons made before it existed.
    pub reversible_interval_percent: Option<[f64; 2]>,
    /// Whether wall loses uptake at stress; not there in the same ones.
    pub reversible_verdict: Option<Verdict>,
    /// Share of the wall below the threshold in both scans.
    pub fixed_percent: f64,
    /// Change of the ejection fraction from rest to stress, points; `null` unless both scans are gated.
    pub ef_change_points: Option<f64>,
    /// The lesser confidence of both fits, 0 to 1.
    pub confidence: f64,
    /// Reasons to look closer.
    pub flags: Vec<RaisedFlag>,
}

/// The main figures of a serial comparison, of its last scan against the first one; the report has all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SerialSummary {
    /// Number of scans.
    pub scans: usize,
    /// Change of the ejection fraction, points; `null` unless all scans are gated.
    pub ef_change_points: Option<f64>,
    /// Whether it changed.
    pub ef_change_verdict: Option<Verdict>,
    /// Share of the wall that lost uptake.
    pub worse_percent: f64,
    /// Whether wall lost uptake.
    pub worse_verdict: Verdict,
    /// Share of the wall that gained uptake.
    pub better_percent: f64,
    /// Whether wall gained uptake.
    pub better_verdict: Verdict,
    /// The least confidence of the fits, 0 to 1.
    pub confidence: f64,
    /// Reasons to look closer.
    pub flags: Vec<RaisedFlag>,
}

/// The content of normal limits; the file has all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct NormalsSummary {
    /// Whether the people are simulated. Such limits are for tests, not for patients.
    pub simulated: bool,
    /// What the people are, in words.
    pub people: String,
    /// SHA-256 of the limits, as reports name it.
    pub sha256: String,
    /// The version of the program that built them.
    pub program_version: String,
    /// One group for each kind of scan.
    pub groups: Vec<NormalGroupSummary>,
    /// Cases that are in no group.
    pub excluded: usize,
}

/// A group of normal limits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct NormalGroupSummary {
    /// `M`, `F` or `mixed`.
    pub sex: GroupSex,
    /// The protocol.
    pub protocol: String,
    /// The tracer.
    pub tracer: String,
    /// Whether attenuation was corrected.
    pub attenuation_corrected: bool,
    /// Number of people.
    pub cases: usize,
    /// Share of the wall below the limits of the others, mean over the people, per cent.
    pub mean_extent_percent: f64,
}

impl SerialSummary {
    /// The main figures of `report`.
    pub fn from_report(report: SerialReport) -> Self {
        let last = report.scans.len();
        let ef = report.change("ef_percent", 1, last);
        let pair = (report.pairs.iter()).find(|pair| [pair.earlier, pair.later] == [1, last]);
        let none = (0.0, Verdict::CannotTell);
        let (worse, better) = pair.map_or((none, none), |pair| {
            let worse = (pair.worse_percent, pair.worse_verdict);
            (worse, (pair.better_percent, pair.better_verdict))
        });
        Self {
            scans: last,
            ef_change_points: ef.map(|own| own.change),
            ef_change_verdict: ef.map(|own| own.verdict),
            worse_percent: worse.0,
            worse_verdict: worse.1,
            better_percent: better.0,
            better_verdict: better.1,
            confidence: (report.scans.iter()).fold(1.0, |least, scan| least.min(scan.confidence)),
            flags: report.flags,
        }
    }
}

impl ComparisonSummary {
    /// The main figures of `report`.
    pub fn from_report(report: ComparisonReport) -> Self {
        Self {
            tid: report.tid,
            sss: report.sss,
            srs: report.srs,
            sds: report.sds,
            reversible_percent: report.reversible_percent,
            reversible_interval_percent: report.reversible_interval_percent,
            reversible_verdict: report.reversible_verdict,
            fixed_percent: report.fixed_percent,
            ef_change_points: report.beat.and_then(|beat| beat.ef_change_points),
            confidence: report.stress.confidence.min(report.rest.confidence),
            flags: report.flags,
        }
    }
}

impl NormalsSummary {
    /// The content of `limits`.
    pub fn from_limits(limits: &NormalLimits) -> Self {
        let group = |group: &NormalGroup| NormalGroupSummary {
            sex: group.sex,
            protocol: group.protocol.clone(),
            tracer: group.tracer.clone(),
            attenuation_corrected: group.attenuation_corrected,
            cases: group.cases.len(),
            mean_extent_percent: group.leave_one_out.mean_extent_percent,
        };
        Self {
            simulated: limits.simulated,
            people: limits.people.clone(),
            sha256: limits.sha256.clone(),
            program_version: limits.program_version.clone(),
            groups: limits.groups.iter().map(group).collect(),
            excluded: limits.excluded.len(),
        }
    }
}

impl SegmentationSummary {
    /// The main figures of `report`, whose mesh has that many vertices.
    pub fn new(report: SegmentationReport, vertices: usize) -> Self {
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
    pub fn from_report(report: BeatReport) -> Self {
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
    pub fn from_profile(profile: &ReaderProfile) -> Self {
        let drawing = profile.drawing();
        Self {
            kind: profile.learnt.kind().as_str().to_owned(),
            edge: profile.edge.as_str().to_owned(),
            masks: profile.masks(),
            offsets_mm: drawing.offsets(),
            level: drawing.level(),
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
