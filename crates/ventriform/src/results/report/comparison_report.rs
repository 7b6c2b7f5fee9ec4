//! The report of a comparison: what is written as `comparison.json`.
//!
//! Segments are counted from 1. Uptake is in per cent of the rest scan's reference, stress scaled to rest.

use super::fit_report::{LongAxis, Posture};
use super::input::FileFacts;
use super::json_number::round;
use super::perfusion_report::PerfusionReport;
use super::raised_flag::RaisedFlag;
use super::segmentation_report::Resolution;
use crate::heart::comparison::{PartFigures, Verdict, WhichScan};
use crate::heart::polar::PolarSummary;
use crate::image::grid::gates::GATE_COUNTS;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The report of a comparison of rest and stress. Intervals, verdicts and what is known of the noise are `null` where it
/// was made before they existed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ComparisonReport {
    /// Ratio of the cavities of the anatomical walls, stress to rest (transient ischaemic dilation), in the images of all gates.
    pub tid: f64,
    /// The interval of TID: that of an unchanged heart holds 1 in nine of ten pairs.
    pub tid_interval: Option<[f64; 2]>,
    /// Whether the cavity is larger at stress.
    pub tid_verdict: Option<Verdict>,
    /// Summed stress score, 0 to 68; `null` without normal limits, as for all scores.
    pub sss: Option<u32>,
    /// Its interval by noise, 5th and 95th percentile.
    pub sss_interval: Option<[f64; 2]>,
    /// Whether it is abnormal.
    pub sss_verdict: Option<Verdict>,
    /// Summed rest score.
    pub srs: Option<u32>,
    /// Its interval by noise, 5th and 95th percentile.
    pub srs_interval: Option<[f64; 2]>,
    /// Whether it is abnormal.
    pub srs_verdict: Option<Verdict>,
    /// Summed difference score: what the segments' scores at stress exceed those at rest by.
    pub sds: Option<u32>,
    /// Its interval by noise, 5th and 95th percentile.
    pub sds_interval: Option<[f64; 2]>,
    /// Whether it is abnormal.
    pub sds_verdict: Option<Verdict>,
    /// The summed scores in per cent of 68, in that order.
    pub summed_percent: Option<[f64; 3]>,
    /// Share of the wall that loses uptake at stress, each region as far as half of the depth of its loss.
    pub reversible_percent: f64,
    /// Its interval by noise: 5th and 95th percentile, as for the others.
    pub reversible_interval_percent: Option<[f64; 2]>,
    /// Whether wall loses uptake at stress.
    pub reversible_verdict: Option<Verdict>,
    /// Loss of uptake that noise does not explain, points: a region has to lose more somewhere to count.
    pub reversible_points: f64,
    /// What stress lacks in the regions that lose uptake, per cent of the whole wall's uptake at rest.
    pub lost_percent: Option<f64>,
    /// Share of the wall below the threshold in both scans.
    pub fixed_percent: f64,
    /// Its interval.
    pub fixed_interval_percent: Option<[f64; 2]>,
    /// Whether there is such wall.
    pub fixed_verdict: Option<Verdict>,
    /// Share of the wall that lacks uptake at rest beside stress (reverse redistribution).
    pub reverse_percent: Option<f64>,
    /// Its interval.
    pub reverse_interval_percent: Option<[f64; 2]>,
    /// Whether there is such wall.
    pub reverse_verdict: Option<Verdict>,
    /// Standard deviation of the smoothed difference by the noise of this pair, points.
    pub noise_points: Option<f64>,
    /// The least loss, per cent of the uptake at rest, that is found in nine of ten such pairs if it takes up a territory.
    pub detectable_percent: Option<f64>,
    /// Counts of the stress scan that are one count of the rest scan where nothing changed.
    pub scale: f64,
    /// Share of the wall by which stress was scaled.
    pub matched_percent: f64,
    /// Share of the wall with muscle in both scans.
    pub compared_percent: f64,
    /// How far the stress map is turned against the rest map, degrees.
    pub turn_degrees: f64,
    /// Correlation of both maps.
    pub correlation: f64,
    /// The 17 segments.
    pub segments: Vec<ComparedSegmentReport>,
    /// The walls of the three arteries; none if the orientation is unknown.
    pub territories: Vec<ComparedTerritoryReport>,
    /// What changed of the beat; `null` unless both scans are gated.
    pub beat: Option<BeatChange>,
    /// Why no beats were compared (`beat` is `null`), or no ejection fractions (`beat.ef_change_points` is `null`): one entry for each scan
    /// that is a reason. Empty where they were.
    pub no_beat: Vec<NoBeat>,
    /// The scan at stress.
    pub stress: ComparedScan,
    /// The scan at rest.
    pub rest: ComparedScan,
    /// Reasons to look closer.
    pub flags: Vec<RaisedFlag>,
    /// Sentences that a reader may take over into the impression; `null` where the report was made before they existed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub impression: Option<Vec<String>>,
    /// Every parameter, defaults written out.
    pub parameters: Map<String, Value>,
}

/// Uptake of a part of the wall at stress and at rest, means over its area.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct UptakeChange {
    /// At stress, scaled to rest; `null` where nothing can be compared, as for the others.
    pub stress_percent: Option<f64>,
    /// At rest.
    pub rest_percent: Option<f64>,
    /// Rest less stress, points: positive where stress lacks uptake.
    pub difference_points: Option<f64>,
    /// Share of its compared area that is reversible.
    pub reversible_percent: f64,
    /// Share of its compared area that is fixed.
    pub fixed_percent: f64,
}

/// A segment at stress and at rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = ComparedSegment))]
pub struct ComparedSegmentReport {
    /// Its number, 1 to 17.
    pub segment: usize,
    /// Its name.
    pub name: String,
    /// Its uptake.
    #[serde(flatten)]
    pub uptake: UptakeChange,
    /// Score at stress, 0 to 4.
    pub stress_score: Option<u8>,
    /// Score at rest.
    pub rest_score: Option<u8>,
    /// Change of motion from rest to stress, mm; `null` unless both scans are gated.
    pub motion_change_mm: Option<f64>,
    /// Interval of that change: in nine of ten pairs such intervals hold all 17 changes together.
    pub motion_change_interval_mm: Option<[f64; 2]>,
    /// Whether the motion changed.
    pub motion_change_verdict: Option<Verdict>,
    /// Change of thickening from rest to stress, points.
    pub thickening_change_points: Option<f64>,
    /// Its interval, likewise.
    pub thickening_change_interval_points: Option<[f64; 2]>,
    /// Whether the thickening changed.
    pub thickening_change_verdict: Option<Verdict>,
}

/// The wall of an artery at stress and at rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = ComparedTerritory))]
pub struct ComparedTerritoryReport {
    /// LAD, LCX or RCA.
    pub name: String,
    /// Its uptake.
    #[serde(flatten)]
    pub uptake: UptakeChange,
}

/// What changed of the beat from rest to stress.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct BeatChange {
    /// Ejection fraction at stress, per cent; `null` if the gates are no beat.
    pub stress_ef_percent: Option<f64>,
    /// Ejection fraction at rest.
    pub rest_ef_percent: Option<f64>,
    /// Change from rest to stress, points.
    pub ef_change_points: Option<f64>,
    /// Its interval.
    pub ef_change_interval_points: Option<[f64; 2]>,
    /// Whether it changed.
    pub ef_change_verdict: Option<Verdict>,
    /// End-diastolic volume at stress, ml.
    pub stress_edv_ml: f64,
    /// End-diastolic volume at rest.
    pub rest_edv_ml: f64,
    /// End-systolic volume at stress.
    pub stress_esv_ml: f64,
    /// End-systolic volume at rest.
    pub rest_esv_ml: f64,
    /// Change of the end-diastolic volume from rest to stress.
    pub edv_change_ml: Option<f64>,
    /// Its interval.
    pub edv_change_interval_ml: Option<[f64; 2]>,
    /// Whether it changed.
    pub edv_change_verdict: Option<Verdict>,
    /// Change of the end-systolic volume.
    pub esv_change_ml: Option<f64>,
    /// Its interval.
    pub esv_change_interval_ml: Option<[f64; 2]>,
    /// Whether it changed.
    pub esv_change_verdict: Option<Verdict>,
}

/// A scan of which no beat could be compared.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct NoBeat {
    /// The scan.
    pub scan: WhichScan,
    /// Why.
    pub code: NoBeatCode,
    /// The same in words.
    pub reason: String,
}

/// Why there is no beat.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum NoBeatCode {
    /// The scan is one volume, or volumes that nobody says are gates.
    NotGated,
    /// It has fewer gates than a beat is fitted to.
    FewGates,
    /// It has more.
    ManyGates,
    /// The gates show no beat: there is no ejection fraction.
    NoContraction,
}

impl NoBeat {
    /// Of a scan whose files hold no gates, or `gates` of them that no beat is fitted to.
    pub fn of_files(scan: WhichScan, gates: Option<usize>) -> Self {
        let [least, most] = [GATE_COUNTS.start(), GATE_COUNTS.end()];
        let (code, reason) = match gates {
            None => (
                NoBeatCode::NotGated,
                format!("the scan at {scan} is not gated"),
            ),
            Some(gates) => {
                let code = if gates < *least {
                    NoBeatCode::FewGates
                } else {
                    NoBeatCode::ManyGates
                };
                let reason = format!(
                    "the scan at {scan} has {gates} gates, and a beat is fitted to {least} to {most}"
                );
                (code, reason)
            }
        };
        Self { scan, code, reason }
    }

    /// Of a scan whose gates show no beat.
    pub fn of_gates(scan: WhichScan) -> Self {
        Self {
            scan,
            code: NoBeatCode::NoContraction,
            reason: format!("the gates at {scan} show no beat"),
        }
    }
}

/// One of both scans.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ComparedScan {
    /// The model that was fitted.
    pub template: String,
    /// Confidence of the fit, 0..=1.
    pub confidence: f64,
    /// Volume of the cavity of the anatomical wall.
    pub cavity_ml: f64,
    /// Volume of the anatomical wall's muscle.
    pub muscle_ml: f64,
    /// Full width at half maximum of the image's point response.
    pub resolution_mm: Option<Resolution>,
    /// The ventricle's long axis.
    pub long_axis: Option<LongAxis>,
    /// Which way is up in the patient.
    pub posture: Option<Posture>,
    /// Series Description, if the header has one.
    pub series_description: Option<String>,
    /// Whether attenuation was corrected; `null` where the header does not say.
    pub attenuation_corrected: Option<bool>,
    /// The tracer, if the header names one.
    pub radiopharmaceutical: Option<String>,
    /// Total dose by the header, MBq.
    pub injected_dose: Option<String>,
    /// Uptake of the wall, by its own reference.
    pub polar: Option<PolarSummary>,
    /// The wall's uptake beside normal limits, if some were given.
    pub perfusion: Option<PerfusionReport>,
    /// The interval of the share below the limit by noise, 5th and 95th percentile; `null` unless both scans have limits,
    /// as for the others.
    pub extent_interval_percent: Option<[f64; 2]>,
    /// Whether a twentieth of the wall or more is below the limit.
    pub extent_verdict: Option<Verdict>,
    /// The interval of the deficit score.
    pub deficit_interval_percent: Option<[f64; 2]>,
    /// Whether it is 5 per cent or more.
    pub deficit_verdict: Option<Verdict>,
    /// The file.
    pub input: FileFacts,
    /// Warnings about the file.
    pub warnings: Vec<String>,
}

impl UptakeChange {
    /// The figures, rounded.
    pub fn from_figures(figures: &PartFigures) -> Self {
        Self {
            stress_percent: figures.stress_percent.map(round),
            rest_percent: figures.rest_percent.map(round),
            difference_points: figures.difference_points.map(round),
            reversible_percent: round(figures.reversible_percent),
            fixed_percent: round(figures.fixed_percent),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::results::report::segmentation_report::tests::first_report;
    use serde_json::json;

    /// A report of two scans without beats and limits.
    pub(crate) fn first_comparison() -> ComparisonReport {
        let input = serde_json::to_value(first_report().input).unwrap();
        let scan = |cavity_ml: f64| {
            json!({
                "template": "heart", "confidence": 0.9, "cavity_ml": cavity_ml, "muscle_ml": 120.5, "input": input,
                "warnings": [],
            })
        };
        let uptake = json!({
            "stress_percent": 61.5, "rest_percent": 80.25, "difference_points": 18.75, "reversible_percent": 90.0,
            "fixed_percent": 1.5,
        });
        let of = |name: &str, value: &str| {
            let mut part = uptake.clone();
            part[name] = serde_json::from_str(value).unwrap();
            part["name"] = "LAD".into();
            part
        };
        let segments: Vec<Value> = (1..=17)
            .map(|number| of("segment", &number.to_string()))
            .collect();
        serde_json::from_value(json!({
            "tid": 1.125, "tid_interval": [1.0, 1.25], "tid_verdict": "cannot_tell", "reversible_percent": 12.5,
            "reversible_interval_percent": [9.0, 16.5], "reversible_verdict": "yes", "reversible_points": 18.5,
            "lost_percent": 4.25, "fixed_percent": 0.0, "fixed_interval_percent": [0.0, 1.5], "fixed_verdict": "no",
            "reverse_percent": 0.0, "reverse_interval_percent": [0.0, 4.0], "reverse_verdict": "no",
            "noise_points": 4.75, "detectable_percent": 19.0, "scale": 2.0,
            "matched_percent": 70.0, "compared_percent": 95.0, "turn_degrees": 0.0, "correlation": 0.9,
            "segments": segments, "territories": [of("name", "\"LAD\"")],
            "no_beat": [],
            "stress": scan(80.0), "rest": scan(71.0), "parameters": {},
            "flags": [{"code": "tid_uncertain", "reason": "A large defect blurs the ratio of the cavities."}],
        }))
        .unwrap()
    }

    #[test]
    fn a_reason_for_no_beat_says_which_scan_and_why() {
        let of = NoBeat::of_files;
        for (no_beat, code, said) in [
            (
                of(WhichScan::Rest, None),
                "not_gated",
                "at rest is not gated",
            ),
            (of(WhichScan::Stress, Some(4)), "few_gates", "has 4 gates"),
            (of(WhichScan::Stress, Some(48)), "many_gates", "6 to 32"),
            (
                NoBeat::of_gates(WhichScan::Stress),
                "no_contraction",
                "at stress show no beat",
            ),
        ] {
            assert!(no_beat.reason.contains(said), "{no_beat:?}");
            let written = serde_json::to_value(&no_beat).unwrap();
            assert_eq!(written["code"], code);
            assert_eq!(written["scan"], no_beat.scan.as_str());
            assert_eq!(serde_json::from_value::<NoBeat>(written).unwrap(), no_beat);
        }
    }
}
