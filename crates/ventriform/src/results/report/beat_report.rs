//! The report of a beat: what is written as `beat.json`.
//!
//! Gates and segments are counted from 1. Phase 0 is the beginning of the first gate.

use super::fit_report::{LongAxis, Posture};
use super::input::FileFacts;
use super::json_number::{or_nan, round};
use super::perfusion_report::PerfusionReport;
use super::raised_flag::RaisedFlag;
use super::segmentation_report::Resolution;
use crate::heart::beat::phase::HISTOGRAM_BINS;
use crate::heart::beat::{Beat, Extreme, SegmentMotion};
use crate::heart::model::MYOCARDIAL_DENSITY_G_PER_ML;
use crate::image::volume::GateTiming;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The report of a beat. Volumes are millilitres, lengths millimetres, angles degrees of the cycle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct BeatReport {
    /// End-diastolic volume: the largest of the curve.
    pub edv_ml: f64,
    /// End-systolic volume: the smallest of the curve.
    pub esv_ml: f64,
    /// Stroke volume; `null` if the gates are no beat.
    pub sv_ml: Option<f64>,
    /// Ejection fraction, per cent; `null` if the gates are no beat (flag `no_contraction`).
    pub ef_percent: Option<f64>,
    /// Interval about EDV that holds the true volume of nine of ten hearts; `null` if the gates are no beat.
    pub edv_interval_ml: Option<[f64; 2]>,
    /// The same about ESV.
    pub esv_interval_ml: Option<[f64; 2]>,
    /// The same about EF; `null` if there is none.
    pub ef_interval_percent: Option<[f64; 2]>,
    /// Ejection fraction of the largest and the smallest gate, per cent: a gate is a mean over its width.
    pub ef_of_gates_percent: Option<f64>,
    /// The gate with the largest cavity.
    pub end_diastole_gate: usize,
    /// The gate with the smallest cavity.
    pub end_systole_gate: usize,
    /// When the curve is largest, degrees.
    pub end_diastole_degrees: f64,
    /// When the curve is smallest, degrees.
    pub end_systole_degrees: f64,
    /// Each gate, in the mean over its width.
    pub gates: Vec<GateReport>,
    /// The volume curve, gates' width taken off, at equal steps from the beginning of the first gate.
    pub curve: Vec<CurvePoint>,
    /// How fast the ventricle empties and fills; `null` with `no_rates` as the reason.
    pub rates: Option<RatesReport>,
    /// Why there are no rates.
    pub no_rates: Option<String>,
    /// Muscle of the wall in the mean of the beat.
    pub wall_ml: f64,
    /// Its mass, grams, at the density of muscle, 1.05 g/ml.
    pub mass_g: f64,
    /// Its greatest change over the beat, per cent.
    pub wall_swing_percent: f64,
    /// The wall's segments (AHA).
    pub segments: Vec<SegmentMotionReport>,
    /// Phases of the wall.
    pub phase: PhaseReport,
    /// The R-R interval, ms, as given or stated by the file.
    pub rr_ms: Option<f64>,
    /// What the file says of the beats.
    pub timing: TimingReport,
    /// The long axis of the summed image's wall.
    pub long_axis: Option<LongAxis>,
    /// Which way is up in the patient, by which the sides of the wall are named.
    pub posture: Option<Posture>,
    /// Full width at half maximum of a point in the gates.
    pub resolution_mm: Option<Resolution>,
    /// The model that was fitted to the gates' sum.
    pub template: String,
    /// Confidence of the fit to the gates' sum, 0..=1.
    pub confidence: f64,
    /// Steps of the joint fit.
    pub steps: usize,
    /// Reasons to look closer: of the fit to the gates' sum, of what the file and the caller say, then of the beat.
    pub flags: Vec<RaisedFlag>,
    /// Sentences that a reader may take over into the impression; `null` where the report was made before they existed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub impression: Option<Vec<String>>,
    /// Uptake and beat beside normal limits, if some were given.
    pub perfusion: Option<PerfusionReport>,
    /// Every parameter, defaults written out.
    pub parameters: Map<String, Value>,
    /// The file of the gates.
    pub input: FileFacts,
    /// Warnings about the files.
    pub warnings: Vec<String>,
}

/// A gate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct GateReport {
    /// Its number, from 1.
    pub gate: usize,
    /// The volume of the input that it is, counted from 0 as the parameter `frame` is.
    pub frame: usize,
    /// Volume of the cavity.
    pub cavity_ml: f64,
    /// Volume of the muscle.
    pub wall_ml: f64,
    /// The factor that brought the gate to the usual counts of a gate.
    pub counts_factor: f64,
}

/// A point of the volume curve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct CurvePoint {
    /// When.
    pub degrees: f64,
    /// Volume of the cavity.
    pub cavity_ml: f64,
}

/// How fast the ventricle empties and fills.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct RatesReport {
    /// Greatest rate of ejection, end-diastolic volumes per second.
    pub peak_ejection_edv_per_s: f64,
    /// Greatest rate of filling, end-diastolic volumes per second.
    pub peak_filling_edv_per_s: f64,
    /// From end systole to the greatest rate of filling.
    pub time_to_peak_filling_ms: f64,
}

/// A segment through the beat.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SegmentMotionReport {
    /// Its number, 1 to 17.
    pub segment: usize,
    /// Its name.
    pub name: String,
    /// Motion of the inner surface inward, end diastole to end systole.
    pub motion_mm: f64,
    /// Thickening, end diastole to end systole.
    pub thickening_percent: f64,
    /// The same by the counts of the wall, a second opinion: lower by what the image's filter takes; `null` where the
    /// wall has no counts.
    pub thickening_counts_percent: Option<f64>,
    /// Phase of the greatest thickness; `null` where the segment does not move.
    pub phase_degrees: Option<f64>,
}

/// Phases of the wall: of the first harmonic of the thickness, weighted by area and amplitude.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct PhaseReport {
    /// Circular mean.
    pub mean_degrees: f64,
    /// Standard deviation.
    pub sd_degrees: f64,
    /// The smallest arc that holds 95 per cent of the weight.
    pub bandwidth_degrees: f64,
    /// Entropy of the histogram as a share of that of an even one, per cent.
    pub entropy_percent: f64,
    /// How far the noise of the gates alone scatters the phases: of the standard deviation, the part that says nothing of the heart.
    #[serde(deserialize_with = "or_nan")]
    pub noise_degrees: f64,
    /// Whether enough of the wall moves, more than noise does, and the gates are a beat.
    pub reliable: bool,
    /// Share of the weight in equal bins from 0 to 360 degrees.
    pub histogram: Vec<f64>,
    /// Width of a bin.
    pub bin_degrees: f64,
}

/// What the file says of the beats.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct TimingReport {
    /// Length of a gate.
    pub frame_time_ms: Option<f64>,
    /// The R-R interval.
    pub nominal_interval_ms: Option<f64>,
    /// The shortest R-R interval accepted.
    pub low_rr_ms: Option<f64>,
    /// The longest R-R interval accepted.
    pub high_rr_ms: Option<f64>,
    /// Beats accepted.
    pub beats_accepted: Option<f64>,
    /// Beats rejected.
    pub beats_rejected: Option<f64>,
}

/// The parts of a [`BeatReport`] beside the beat.
#[derive(Debug)]
pub struct BeatParts {
    /// Names of the segments, 1 to 17.
    pub segment_names: Vec<String>,
    /// For each gate the volume of the input that it is, counted from 0.
    pub frames: Vec<usize>,
    /// The R-R interval, ms.
    pub rr_ms: Option<f64>,
    /// What the file says of the beats.
    pub timing: GateTiming,
    /// The long axis of the summed image's wall.
    pub long_axis: Option<LongAxis>,
    /// Which way is up in the patient.
    pub posture: Option<Posture>,
    /// The gates' resolution.
    pub resolution: Option<Resolution>,
    /// The model that was fitted to the gates' sum.
    pub template: String,
    /// Confidence of that fit.
    pub confidence: f64,
    /// Flags of that fit, and of what the file and the caller say of the beat.
    pub flags: Vec<RaisedFlag>,
    /// Uptake and beat beside normal limits.
    pub perfusion: Option<PerfusionReport>,
    /// Every parameter.
    pub parameters: Map<String, Value>,
    /// The file of the gates.
    pub input: FileFacts,
    /// Warnings about the files.
    pub warnings: Vec<String>,
}

impl BeatReport {
    /// Joins the figures of `beat` to the other parts.
    pub fn new(beat: &Beat, parts: BeatParts) -> Self {
        let walls: Vec<f64> = beat.curve.iter().map(|v| v.wall_ml).collect();
        let mean = beat.mean_wall_ml();
        let [least, most] = [f64::min, f64::max].map(|end| walls.iter().copied().reduce(end));
        let swing = most
            .zip(least)
            .map_or(f64::NAN, |(most, least)| most - least);
        let cavity = |extreme: &Extreme| beat.gates[extreme.gate].cavity_ml;
        let of_gates = 1.0 - cavity(&beat.end_systole) / cavity(&beat.end_diastole);
        let intervals = beat.intervals.as_ref();
        let raised = beat
            .flags
            .iter()
            .map(|flag| RaisedFlag::new(flag.code(), flag));
        let step = 360.0 / beat.curve.len() as f64;
        let names = &parts.segment_names;
        Self {
            edv_ml: round(beat.end_diastole.cavity_ml),
            esv_ml: round(beat.end_systole.cavity_ml),
            sv_ml: beat.stroke_ml().map(round),
            ef_percent: beat.ef_percent.map(round),
            edv_interval_ml: intervals.map(|of| of.edv_ml.map(round)),
            esv_interval_ml: intervals.map(|of| of.esv_ml.map(round)),
            ef_interval_percent: intervals.map(|of| of.ef_percent.map(round)),
            ef_of_gates_percent: beat.ef_percent.map(|_| round(100.0 * of_gates)),
            end_diastole_gate: beat.end_diastole.gate + 1,
            end_systole_gate: beat.end_systole.gate + 1,
            end_diastole_degrees: round(360.0 * beat.end_diastole.turns),
            end_systole_degrees: round(360.0 * beat.end_systole.turns),
            gates: (beat.gates.iter().zip(&beat.factors).enumerate())
                .map(|(gate, (volumes, factor))| GateReport {
                    gate: gate + 1,
                    frame: parts.frames.get(gate).copied().unwrap_or(gate),
                    cavity_ml: round(volumes.cavity_ml),
                    wall_ml: round(volumes.wall_ml),
                    counts_factor: round(*factor),
                })
                .collect(),
            curve: (beat.curve.iter().enumerate())
                .map(|(n, volumes)| CurvePoint {
                    degrees: round(step * n as f64),
                    cavity_ml: round(volumes.cavity_ml),
                })
                .collect(),
            rates: beat.rates.as_ref().ok().map(|rates| RatesReport {
                peak_ejection_edv_per_s: round(rates.peak_ejection_per_s),
                peak_filling_edv_per_s: round(rates.peak_filling_per_s),
                time_to_peak_filling_ms: round(rates.time_to_peak_filling_ms),
            }),
            no_rates: beat.rates.as_ref().err().cloned(),
            wall_ml: round(mean),
            mass_g: round(MYOCARDIAL_DENSITY_G_PER_ML * mean),
            wall_swing_percent: round(100.0 * swing / mean),
            segments: (beat.segments.iter())
                .map(|segment| SegmentMotionReport::new(segment, &names[segment.segment - 1]))
                .collect(),
            phase: PhaseReport {
                mean_degrees: round(beat.phases.mean_degrees),
                sd_degrees: round(beat.phases.sd_degrees),
                bandwidth_degrees: round(beat.phases.bandwidth_degrees),
                entropy_percent: round(beat.phases.entropy_percent),
                noise_degrees: round(beat.fit.phase_noise_degrees),
                reliable: beat.has_phases(),
                histogram: beat.phases.histogram.iter().copied().map(round).collect(),
                bin_degrees: round(360.0 / HISTOGRAM_BINS as f64),
            },
            rr_ms: parts.rr_ms.map(round),
            timing: TimingReport {
                frame_time_ms: parts.timing.frame_time_ms,
                nominal_interval_ms: parts.timing.rr_ms,
                low_rr_ms: parts.timing.low_rr_ms,
                high_rr_ms: parts.timing.high_rr_ms,
                beats_accepted: parts.timing.beats_accepted,
                beats_rejected: parts.timing.beats_rejected,
            },
            long_axis: parts.long_axis,
            posture: parts.posture,
            resolution_mm: parts.resolution,
            template: parts.template,
            confidence: round(parts.confidence),
            steps: beat.fit.steps,
            flags: parts.flags.into_iter().chain(raised).collect(),
            impression: None,
            perfusion: parts.perfusion,
            parameters: parts.parameters,
            input: parts.input,
            warnings: parts.warnings,
        }
    }
}

impl SegmentMotionReport {
    fn new(segment: &SegmentMotion, name: &str) -> Self {
        Self {
            segment: segment.segment,
            name: name.to_owned(),
            motion_mm: round(segment.motion_mm),
            thickening_percent: round(segment.thickening_percent),
            thickening_counts_percent: segment.thickening_counts_percent.map(round),
            phase_degrees: segment.phase_degrees.map(round),
        }
    }
}
