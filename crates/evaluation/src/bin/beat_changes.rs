//! Changes of the beat from rest to stress beside the truth of simulated gated pairs.
//!
//! ```sh
//! cargo run --release --package ventriform-evaluation --bin beat_changes -- PAIR... > TABLE
//! ```
//!
//! Every PAIR is a folder with stress/gated.nii.gz, rest/gated.nii.gz, the params.json of both and pair.json, as the
//! simulator of pairs writes them. TABLE has a row for each pair and figure, and for each segment, with the columns of the
//! program `serials`: rest is the earlier scan. `scripts/measure/calibrate_comparison.py` estimates from it how much the
//! figures differ by themselves.

use anyhow::{Result, anyhow};
use serde_json::Value;
use std::path::Path;
use ventriform::heart::beat::{Beat, SegmentMotion};
use ventriform::heart::comparison::Answer;
use ventriform::heart::comparison::beat_change::{
    EDV, EF, ESV, SEGMENT_MOTION, SEGMENT_THICKENING, answer, segment_answer,
};
use ventriform::parameters::ComparisonParameters;
use ventriform_evaluation::{compared, print_table};

fn main() {
    print_table(
        "series,kind,figure,earlier,later,true_earlier,true_later,noise_points,change,low,high,verdict",
        rows,
    );
}

fn read(path: &Path) -> Result<Value> {
    Ok(serde_json::from_slice(&std::fs::read(path)?)?)
}

fn rows(folder: &Path) -> Result<Vec<String>> {
    let pair = read(&folder.join("pair.json"))?;
    let truth = |scan: &str| Ok(read(&folder.join(scan).join("params.json"))?["result"].clone());
    let truth: [Result<Value>; 2] = ["rest", "stress"].map(truth);
    let [rest_truth, stress_truth] = truth;
    let truth = [rest_truth?, stress_truth?];
    let mut parameters = ComparisonParameters::default();
    parameters.choice.gated = true;
    let made = compared(folder, "gated.nii.gz", &parameters)?;
    let beats = made.rest.beat().zip(made.stress.beat());
    let (rest, stress) = beats.ok_or_else(|| anyhow!("there are no beats"))?;
    let beats = [&rest.beat, &stress.beat];
    let noise = made.change.noise.points;
    let [name, kind] = ["pair", "kind"].map(|field| pair[field].as_str().unwrap_or_default());
    let row = |label: &str, values: [f64; 2], truth: [f64; 2], own: Answer| {
        format!(
            "{name},{kind},{label},{},{},{},{},{noise},{},{},{},{}",
            values[0],
            values[1],
            truth[0],
            truth[1],
            own.value,
            own.interval[0],
            own.interval[1],
            own.verdict.as_str().replace(' ', "_")
        )
    };
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let mut rows = Vec::new();
    for figure in [&EF, &EDV, &ESV] {
        let found = beats.map(|beat| of_beat(beat, figure.place));
        let (Some(earlier), Some(later)) = (found[0], found[1]) else {
            continue;
        };
        let known = truth.each_ref().map(|own| match figure.place {
            "ef_percent" => 100.0 * number(&own["ef"]),
            place => number(&own[place]),
        });
        let values = [earlier, later];
        rows.push(row(
            figure.place,
            values,
            known,
            answer(figure, values, noise),
        ));
    }
    for (index, rest) in rest.beat.segments.iter().enumerate() {
        let stress = &stress.beat.segments[index];
        for figure in [&SEGMENT_MOTION, &SEGMENT_THICKENING] {
            let of = |own: &SegmentMotion| match figure.place {
                "motion_mm" => own.motion_mm,
                _ => own.thickening_percent,
            };
            let known = truth
                .each_ref()
                .map(|own| number(&own["segments"][rest.segment - 1][figure.place]));
            if known.iter().all(|own| own.is_finite()) {
                let label = format!("segment_{}", figure.place);
                let values = [of(rest), of(stress)];
                rows.push(row(
                    &label,
                    values,
                    known,
                    segment_answer(figure, values, noise),
                ));
            }
        }
    }
    Ok(rows)
}

fn of_beat(beat: &Beat, place: &str) -> Option<f64> {
    match place {
        "ef_percent" => beat.ef_percent,
        "edv_ml" => Some(beat.end_diastole.cavity_ml),
        _ => Some(beat.end_systole.cavity_ml),
    }
}
