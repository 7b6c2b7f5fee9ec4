//! Comparisons of rest and stress beside the truth of simulated pairs.
//!
//! ```sh
//! cargo run --release --package ventriform-evaluation --bin comparisons -- PAIR...
//! ```
//!
//! Every PAIR is a folder with stress/spect.nii.gz, rest/spect.nii.gz and pair.json, as the simulator of pairs writes
//! them. Prints a row for each pair, ready for scripts/measure/calibrate_comparison.py: the ratio of the cavities of
//! the anatomical wall and of the wall as it looks, that of the muscle, the deviation of the difference over the wall,
//! the reversible share, the territory that has most of it, and flags.

use anyhow::Result;
use serde_json::Value;
use std::ops::Range;
use std::path::Path;
use ventriform::heart::polar::{RAY_COLUMNS, RAY_ROWS};
use ventriform::parameters::ComparisonParameters;
use ventriform::runs::rest_stress::{ComparedHeart, ComparedHearts};
use ventriform_evaluation::{compared, print_table};

fn main() {
    print_table(
        "pair,kind,comparable,true_tid,tid,tid_apparent,muscle,resolution_stress,resolution_rest,turn,turn_gain,correlation,matched,\
         sd_points,smooth_points,fine_points,noise_points,sd_apical,sd_middle,sd_basal,largest_sds,detectable,reversible,reversible_low,reversible_high,true_reversible,territory,true_territory,fixed,verdict,flags",
        |folder| Ok(vec![row(folder)?]),
    );
}

fn row(folder: &Path) -> Result<String> {
    let truth: Value = serde_json::from_slice(&std::fs::read(folder.join("pair.json"))?)?;
    let made = compared(folder, "spect.nii.gz", &ComparisonParameters::default())?;
    let change = &made.change;
    let answer = change.answers.reversible;
    let apparent = |heart: &ComparedHeart| {
        let surfaces = heart.segmentation().fit.model.surfaces.as_ref();
        surfaces.map_or(f64::NAN, |both| both.apparent.wall.cavity_ml)
    };
    let worst = (change.territories.iter())
        .max_by(|a, b| {
            a.figures
                .reversible_percent
                .total_cmp(&b.figures.reversible_percent)
        })
        .filter(|worst| worst.figures.reversible_percent > 0.0);
    let mut flags: Vec<&str> = made.flags.iter().map(|flag| flag.code()).collect();
    flags.dedup();
    Ok(format!(
        "{},{},{},{},{:.3},{:.3},{:.3},{:.2},{:.2},{:.1},{:.3},{:.3},{:.0},{:.2},{},{},{:.1},{:.1},{:.1},{},{},{},{:.1},{},{}",
        truth["pair"].as_str().unwrap_or_default(),
        truth["kind"].as_str().unwrap_or_default(),
        truth["comparable"],
        truth["tid"],
        made.tid(),
        apparent(&made.stress) / apparent(&made.rest),
        made.stress.muscle_ml() / made.rest.muscle_ml(),
        made.stress.resolution_mm().unwrap_or(f64::NAN),
        made.rest.resolution_mm().unwrap_or(f64::NAN),
        change.turn.degrees,
        change.turn.gain,
        change.turn.correlation,
        change.matched_percent,
        deviation(&made, 0..RAY_ROWS),
        noise(&made),
        detected(&made),
        answer.value,
        answer.interval[0],
        answer.interval[1],
        truth["reversible_percent"],
        worst.map_or("", |worst| worst.name),
        truth["reversible"]["territory"]
            .as_str()
            .unwrap_or_default(),
        change.answers.fixed.value,
        answer.verdict.as_str().replace(' ', "_"),
        flags.join(" ")
    ))
}

/// The noise that was estimated, and the deviation of the difference in thirds of the map, points.
fn noise(made: &ComparedHearts) -> String {
    let noise = made.change.noise;
    format!(
        "{:.2},{:.2},{:.2},{:.2},{:.2},{:.2}",
        noise.smooth_points,
        noise.fine_points,
        noise.points,
        deviation(made, 0..8),
        deviation(made, 8..16),
        deviation(made, 16..RAY_ROWS)
    )
}

/// The greatest loss in deviations of the noise of its place, and the least loss that would show.
fn detected(made: &ComparedHearts) -> String {
    let change = &made.change;
    let places = change.difference_points.iter().enumerate();
    let losses = places.filter_map(|(index, own)| Some((*own)? / change.noise.at(index)));
    let largest = losses.fold(f64::MIN, f64::max);
    let answers = &change.answers;
    format!("{largest:.2},{:.1}", answers.detectable_percent)
}

/// Root mean square of the difference over the compared places of some rows, points.
fn deviation(made: &ComparedHearts, rows: Range<usize>) -> f64 {
    let places = &made.change.difference_points[rows.start * RAY_COLUMNS..rows.end * RAY_COLUMNS];
    let known: Vec<f64> = places.iter().flatten().copied().collect();
    (known.iter().map(|d| d * d).sum::<f64>() / known.len() as f64).sqrt()
}
