//! The report of a comparison: what is written as `comparison.json`.
//!
//! Segments are counted from 1. Uptake is in per cent of the rest scan's reference, stress scaled to rest.

use super::fit_report::Posture;
use super::input::FileFacts;
use super::json_number::round;
use super::perfusion_report::PerfusionReport;
use super::raised_flag::RaisedFlag;
use super::segmentation_report::Resolution;
use crate::comparison::{ComparedHeart, ComparedHearts, PartFigures, REVERSIBLE_POINTS};
use crate::normals::{Perfusion, summed_percent};
use crate::polar::PolarSummary;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The report of a comparison of rest and stress.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ComparisonReport {
    /// Ratio of the cavities of the anatomical walls, stress to rest (transient ischaemic dilation), in the images of all gates.
    pub tid: f64,
    /// Summed stress score, 0 to 68; `null` without normal limits, as for all scores.
    pub sss: Option<u32>,
    /// Summed rest score.
    pub srs: Option<u32>,
    /// Summed difference score: what the segments' scores at stress exceed those at rest by.
    pub sds: Option<u32>,
    /// The summed scores in per cent of 68, in that order.
    pub summed_percent: Option<[f64; 3]>,
    /// Share of the wall that loses more than `reversible_points` at stress.
    pub reversible_percent: f64,
    /// Loss of uptake at stress that counts as reversible, points: 2.5 standard deviations of the difference of two scans of an unchanged heart.
    pub reversible_points: f64,
    /// Share of the wall below the threshold in both scans.
    pub fixed_percent: f64,
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
    /// The scan at stress.
    pub stress: ComparedScan,
    /// The scan at rest.
    pub rest: ComparedScan,
    /// Reasons to look closer.
    pub flags: Vec<RaisedFlag>,
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
    /// Change of thickening from rest to stress, points.
    pub thickening_change_points: Option<f64>,
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
    /// End-diastolic volume at stress, ml.
    pub stress_edv_ml: f64,
    /// End-diastolic volume at rest.
    pub rest_edv_ml: f64,
    /// End-systolic volume at stress.
    pub stress_esv_ml: f64,
    /// End-systolic volume at rest.
    pub rest_esv_ml: f64,
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
    /// Which way is up in the patient.
    pub posture: Option<Posture>,
    /// Series Description, if the header has one.
    pub series_description: Option<String>,
    /// Whether attenuation was corrected; `null` where the header does not say.
    pub attenuation_corrected: Option<bool>,
    /// The tracer, if the header names one.
    pub radiopharmaceutical: Option<String>,
    /// Total dose as the header has it.
    pub injected_dose: Option<String>,
    /// Uptake of the wall, by its own reference.
    pub polar: Option<PolarSummary>,
    /// The wall's uptake beside normal limits, if some were given.
    pub perfusion: Option<PerfusionReport>,
    /// The file.
    pub input: FileFacts,
    /// Warnings about the file.
    pub warnings: Vec<String>,
}

fn score(perfusion: Option<&Perfusion>, segment: usize) -> Option<u8> {
    perfusion?.segments[segment - 1].score
}

impl UptakeChange {
    fn of(figures: &PartFigures) -> Self {
        Self {
            stress_percent: figures.stress_percent.map(round),
            rest_percent: figures.rest_percent.map(round),
            difference_points: figures.difference_points.map(round),
            reversible_percent: round(figures.reversible_percent),
            fixed_percent: round(figures.fixed_percent),
        }
    }
}

impl ComparedScan {
    fn of(heart: &ComparedHeart) -> Self {
        let segmentation = heart.segmentation();
        let model = &segmentation.fit.model;
        let scan = heart.provenance();
        let facts = heart.facts();
        Self {
            template: heart.template().to_owned(),
            confidence: round(segmentation.fit.judgement.confidence),
            cavity_ml: round(heart.cavity_ml()),
            muscle_ml: round(heart.muscle_ml()),
            resolution_mm: segmentation
                .resolution
                .map(|r| Resolution::new(r.value, r.given)),
            posture: model.patient_orientation.as_ref().map(Posture::of),
            series_description: scan.and_then(|scan| scan.series_description.clone()),
            attenuation_corrected: scan.and_then(|scan| scan.attenuation_corrected()),
            radiopharmaceutical: scan.and_then(|scan| scan.radiopharmaceutical.clone()),
            injected_dose: scan.and_then(|scan| scan.injected_dose.clone()),
            polar: heart.map().map(PolarSummary::of),
            perfusion: (heart.perfusion().zip(heart.map()))
                .map(|(perfusion, map)| PerfusionReport::of(perfusion, map)),
            input: FileFacts::of(facts),
            warnings: facts.warnings.clone(),
        }
    }
}

impl ComparisonReport {
    /// The figures of `hearts`.
    pub fn of(hearts: &ComparedHearts, parameters: Map<String, Value>) -> Self {
        let change = &hearts.change;
        let beats = hearts.stress.beat().zip(hearts.rest.beat());
        let beats = beats.map(|(stress, rest)| [stress.report(), rest.report()]);
        let map = hearts.rest.map();
        let motion = |segment: usize| {
            let [stress, rest] = beats.as_ref()?;
            let of = |report: &super::BeatReport| {
                let mut own = report.segments.iter();
                let found = own.find(|own| own.segment == segment)?;
                Some((found.motion_mm, found.thickening_percent))
            };
            let (stress, rest) = (of(stress)?, of(rest)?);
            Some((stress.0 - rest.0, stress.1 - rest.1))
        };
        let segments = change.segments.iter().map(|own| ComparedSegmentReport {
            segment: own.segment,
            name: map.map_or_else(String::new, |map| map.name_of(own.segment)),
            uptake: UptakeChange::of(&own.figures),
            stress_score: score(hearts.stress.perfusion(), own.segment),
            rest_score: score(hearts.rest.perfusion(), own.segment),
            motion_change_mm: motion(own.segment).map(|change| round(change.0)),
            thickening_change_points: motion(own.segment).map(|change| round(change.1)),
        });
        let summed =
            (hearts.stress.perfusion().zip(hearts.rest.perfusion())).map(|(stress, rest)| {
                let scores = |perfusion: &Perfusion| perfusion.segments.map(|own| own.score);
                let pairs = scores(stress).into_iter().zip(scores(rest));
                let more = pairs.filter_map(|(stress, rest)| Some(stress?.saturating_sub(rest?)));
                [
                    stress.summed_score,
                    rest.summed_score,
                    more.map(u32::from).sum(),
                ]
            });
        let oriented = map.is_some_and(crate::polar::PolarMap::is_oriented);
        let territories = change.territories.iter().filter(|_| oriented);
        Self {
            tid: round(hearts.tid()),
            sss: summed.map(|[sss, _, _]| sss),
            srs: summed.map(|[_, srs, _]| srs),
            sds: summed.map(|[_, _, sds]| sds),
            summed_percent: summed.map(|sums| sums.map(|sum| round(summed_percent(sum)))),
            reversible_percent: round(change.reversible_percent),
            reversible_points: REVERSIBLE_POINTS,
            fixed_percent: round(change.fixed_percent),
            scale: round(change.scale),
            matched_percent: round(change.matched_percent),
            compared_percent: round(change.compared_percent),
            turn_degrees: round(change.turn.degrees),
            correlation: round(change.turn.correlation),
            segments: segments.collect(),
            territories: territories
                .map(|own| ComparedTerritoryReport {
                    name: own.name.to_owned(),
                    uptake: UptakeChange::of(&own.figures),
                })
                .collect(),
            beat: beats.as_ref().map(|[stress, rest]| BeatChange {
                stress_ef_percent: stress.ef_percent,
                rest_ef_percent: rest.ef_percent,
                ef_change_points: stress
                    .ef_percent
                    .zip(rest.ef_percent)
                    .map(|(stress, rest)| round(stress - rest)),
                stress_edv_ml: stress.edv_ml,
                rest_edv_ml: rest.edv_ml,
                stress_esv_ml: stress.esv_ml,
                rest_esv_ml: rest.esv_ml,
            }),
            stress: ComparedScan::of(&hearts.stress),
            rest: ComparedScan::of(&hearts.rest),
            flags: (hearts.flags.iter())
                .map(|flag| RaisedFlag::new(flag.code(), flag))
                .collect(),
            parameters,
        }
    }
}
