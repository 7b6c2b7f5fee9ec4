//! The report of a comparison.

use super::hearts::{ComparedHeart, ComparedHearts};
use crate::base::numeric::decimals::round;
use crate::heart::comparison::beat_change::{
    EDV, EF, ESV, SEGMENT_MOTION, SEGMENT_THICKENING, answer, segment_answer,
};
use crate::heart::comparison::{Answer, ChangingFigure, WhichScan};
use crate::heart::normals::{Perfusion, summed_percent};
use crate::heart::polar::{PolarMap, PolarSummary};
use crate::image::volume::{HeldGates, Provenance};
use crate::results::report::impression;
use crate::results::report::{
    BeatChange, BeatReport, ComparedScan, ComparedSegmentReport, ComparedTerritoryReport,
    ComparisonReport, FileFacts, LongAxis, NoBeat, PerfusionReport, Posture, RaisedFlag,
    Resolution, UptakeChange,
};
use serde_json::{Map, Value};

fn score(perfusion: Option<&Perfusion>, segment: usize) -> Option<u8> {
    perfusion?.segments[segment - 1].score
}

/// The report's part about one of both scans; `scores` are its extent and its deficit score.
fn scan_report(heart: &ComparedHeart, scores: Option<[Answer; 2]>) -> ComparedScan {
    let segmentation = heart.segmentation();
    let model = &segmentation.fit.model;
    let scan = heart.provenance();
    let facts = heart.facts();
    let attenuation_corrected = scan.and_then(Provenance::attenuation_corrected);
    let limits = heart.perfusion().is_some();
    let summary = |map| PolarSummary::from_map(map).with_attenuation(attenuation_corrected, limits);
    ComparedScan {
        template: heart.template().to_owned(),
        confidence: round(segmentation.fit.judgement.confidence),
        cavity_ml: round(heart.cavity_ml()),
        muscle_ml: round(heart.muscle_ml()),
        resolution_mm: segmentation
            .resolution
            .map(|r| Resolution::new(r.value, r.given)),
        long_axis: model.cup.as_ref().map(LongAxis::from_cup),
        posture: model
            .patient_orientation
            .as_ref()
            .map(Posture::from_orientation),
        series_description: scan.and_then(|scan| scan.series_description.clone()),
        attenuation_corrected,
        radiopharmaceutical: scan.and_then(|scan| scan.radiopharmaceutical.clone()),
        injected_dose: scan.and_then(Provenance::injected_dose_mbq),
        polar: heart.map().map(summary),
        perfusion: (heart.perfusion().zip(heart.map()))
            .map(|(perfusion, map)| PerfusionReport::new(perfusion, map)),
        extent_interval_percent: scores.map(|[extent, _]| extent.interval.map(round)),
        extent_verdict: scores.map(|[extent, _]| extent.verdict),
        deficit_interval_percent: scores.map(|[_, deficit]| deficit.interval.map(round)),
        deficit_verdict: scores.map(|[_, deficit]| deficit.verdict),
        input: FileFacts::from_facts(facts),
        warnings: facts.warnings.clone(),
    }
}

/// Why no beats were compared, or no ejection fractions.
fn no_beat(hearts: &ComparedHearts) -> Vec<NoBeat> {
    let scans = [
        (WhichScan::Stress, &hearts.stress),
        (WhichScan::Rest, &hearts.rest),
    ];
    let reasons = scans.into_iter().zip(hearts.gates);
    let reasons = reasons.filter_map(|((scan, heart), held)| match held {
        HeldGates::NotGated => Some(NoBeat::of_files(scan, None)),
        HeldGates::OtherNumber { gates } => Some(NoBeat::of_files(scan, Some(gates))),
        HeldGates::Beat => {
            let still = heart
                .beat()
                .is_some_and(|own| own.beat.ef_percent.is_none());
            still.then(|| NoBeat::of_gates(scan))
        }
    });
    reasons.collect()
}

/// What changed from rest to stress of the beats [stress, rest], of a pair with this noise, points.
fn beat_change([stress, rest]: &[BeatReport; 2], noise: f64) -> BeatChange {
    let ends = |answer: Answer| answer.interval.map(round);
    let ef = rest.ef_percent.zip(stress.ef_percent);
    let ef = ef.map(|(rest, stress)| answer(&EF, [rest, stress], noise));
    // Without a beat there is no end of systole, either.
    let volume =
        |figure: &ChangingFigure, values: [f64; 2]| ef.map(|_| answer(figure, values, noise));
    let edv = volume(&EDV, [rest.edv_ml, stress.edv_ml]);
    let esv = volume(&ESV, [rest.esv_ml, stress.esv_ml]);
    BeatChange {
        stress_ef_percent: stress.ef_percent,
        rest_ef_percent: rest.ef_percent,
        ef_change_points: ef.map(|own| round(own.value)),
        ef_change_interval_points: ef.map(ends),
        ef_change_verdict: ef.map(|own| own.verdict),
        stress_edv_ml: stress.edv_ml,
        rest_edv_ml: rest.edv_ml,
        stress_esv_ml: stress.esv_ml,
        rest_esv_ml: rest.esv_ml,
        edv_change_ml: edv.map(|own| round(own.value)),
        edv_change_interval_ml: edv.map(ends),
        edv_change_verdict: edv.map(|own| own.verdict),
        esv_change_ml: esv.map(|own| round(own.value)),
        esv_change_interval_ml: esv.map(ends),
        esv_change_verdict: esv.map(|own| own.verdict),
    }
}

/// The report of `hearts`.
pub(super) fn comparison_report(
    hearts: &ComparedHearts,
    parameters: Map<String, Value>,
) -> ComparisonReport {
    let change = &hearts.change;
    let (answers, tid) = (&change.answers, hearts.tid_answer());
    let ends = |answer: &Answer| answer.interval.map(round);
    let beats = hearts.stress.beat().zip(hearts.rest.beat());
    let beats = beats.map(|(stress, rest)| [stress.report(), rest.report()]);
    let map = hearts.rest.map();
    let noise = change.noise.points;
    let moved = |segment: usize| {
        let [stress, rest] = beats.as_ref()?;
        let of = |report: &BeatReport| {
            let mut own = report.segments.iter();
            let found = own.find(|own| own.segment == segment)?;
            Some([found.motion_mm, found.thickening_percent])
        };
        let [stress, rest] = [of(stress)?, of(rest)?];
        let answer = |figure: &ChangingFigure, index: usize| {
            segment_answer(figure, [rest[index], stress[index]], noise)
        };
        Some([answer(&SEGMENT_MOTION, 0), answer(&SEGMENT_THICKENING, 1)])
    };
    let segments = change.segments.iter().map(|own| {
        let [motion, thickening] = moved(own.segment).map_or([None; 2], |both| both.map(Some));
        ComparedSegmentReport {
            segment: own.segment,
            name: map.map_or_else(String::new, |map| map.name_of(own.segment)),
            uptake: UptakeChange::from_figures(&own.figures),
            stress_score: score(hearts.stress.perfusion(), own.segment),
            rest_score: score(hearts.rest.perfusion(), own.segment),
            motion_change_mm: motion.map(|own| round(own.value)),
            motion_change_interval_mm: motion.as_ref().map(ends),
            motion_change_verdict: motion.map(|own| own.verdict),
            thickening_change_points: thickening.map(|own| round(own.value)),
            thickening_change_interval_points: thickening.as_ref().map(ends),
            thickening_change_verdict: thickening.map(|own| own.verdict),
        }
    });
    let scores = hearts.scores.as_ref();
    let sum = |answer: Answer| answer.value as u32;
    let summed = scores.map(|own| [own.sss, own.srs, own.sds].map(sum));
    let of_scan = |scan: usize| scores.map(|own| [own.extent[scan], own.deficit[scan]]);
    let oriented = map.is_some_and(PolarMap::is_oriented);
    let territories = change.territories.iter().filter(|_| oriented);
    let mut report = ComparisonReport {
        tid: round(hearts.tid()),
        tid_interval: Some(ends(&tid)),
        tid_verdict: Some(tid.verdict),
        sss: scores.map(|own| sum(own.sss)),
        sss_interval: scores.map(|own| ends(&own.sss)),
        sss_verdict: scores.map(|own| own.sss.verdict),
        srs: scores.map(|own| sum(own.srs)),
        srs_interval: scores.map(|own| ends(&own.srs)),
        srs_verdict: scores.map(|own| own.srs.verdict),
        sds: scores.map(|own| sum(own.sds)),
        sds_interval: scores.map(|own| ends(&own.sds)),
        sds_verdict: scores.map(|own| own.sds.verdict),
        summed_percent: summed.map(|sums| sums.map(|sum| round(summed_percent(sum)))),
        reversible_percent: round(answers.reversible.value),
        reversible_interval_percent: Some(ends(&answers.reversible)),
        reversible_verdict: Some(answers.reversible.verdict),
        reversible_points: round(change.limit_points()),
        lost_percent: Some(round(change.lost_percent)),
        fixed_percent: round(answers.fixed.value),
        fixed_interval_percent: Some(ends(&answers.fixed)),
        fixed_verdict: Some(answers.fixed.verdict),
        reverse_percent: Some(round(answers.reverse.value)),
        reverse_interval_percent: Some(ends(&answers.reverse)),
        reverse_verdict: Some(answers.reverse.verdict),
        noise_points: Some(round(change.noise.points)),
        detectable_percent: Some(round(answers.detectable_percent)),
        scale: round(change.scale),
        matched_percent: round(change.matched_percent),
        compared_percent: round(change.compared_percent),
        turn_degrees: round(change.turn.degrees),
        correlation: round(change.turn.correlation),
        segments: segments.collect(),
        territories: territories
            .map(|own| ComparedTerritoryReport {
                name: own.name.to_owned(),
                uptake: UptakeChange::from_figures(&own.figures),
            })
            .collect(),
        beat: beats.as_ref().map(|both| beat_change(both, noise)),
        no_beat: no_beat(hearts),
        stress: scan_report(&hearts.stress, of_scan(0)),
        rest: scan_report(&hearts.rest, of_scan(1)),
        flags: (hearts.flags.iter())
            .map(|flag| RaisedFlag::new(flag.code(), flag))
            .collect(),
        impression: None,
        parameters,
    };
    report.impression = Some(impression::of_comparison(&report));
    report
}
