//! Writes the table of volumes from which `scripts/measure/calibrate_intervals.py` estimates the constants of
//! `crates/ventriform/src/heart/judge/volume_calibration.rs`.
//!
//! `cargo run --release -p ventriform-evaluation --bin volumes -- FOLDER... > TABLE` segments `CASE/spect.nii.gz` of every
//! case in the folders. TABLE has a row for each heart that is not refused: the folder's name, the case's, the volumes
//! of the anatomical wall and of its cavity, found and true (`params.json`, "result"), ml, the share of the wall that
//! is dark, the resolution, mm, the confidence, the mean thickness of the wall, found and true, its deviation and the
//! ends of its interval, mm, and what it follows from: how thick the wall looks, mm, and how large its cavity, ml, how
//! thick usual walls that look so are, and the length of the image's noise, mm.

use std::path::Path;

use rayon::prelude::*;
use serde_json::Value;
use ventriform::parameters::FitParameters;
use ventriform_evaluation::walls::Result;
use ventriform_evaluation::{cases, name_of};

fn main() -> Result<()> {
    let folders = std::env::args().skip(1).map(Into::into);
    let cases = cases(folders, "lv_truth.nii.gz")?;
    let rows: Vec<Option<String>> = cases
        .par_iter()
        .map(|(set, case)| row(set, case))
        .collect::<Result<_>>()?;
    println!(
        "set,case,wall,true_wall,cavity,true_cavity,dark,resolution_mm,confidence,\
         thickness,true_thickness,\
         thickness_sd,least_thickness,greatest_thickness,apparent_mm,apparent_cavity,usual_mm,noise_length_mm"
    );
    rows.iter().flatten().for_each(|row| println!("{row}"));
    Ok(())
}

/// The row of a case; `None` without a heart, or where the scan is refused.
fn row(set: &str, case: &Path) -> Result<Option<String>> {
    let truth: Value = serde_json::from_slice(&std::fs::read(case.join("params.json"))?)?;
    if truth["made"] == "none" {
        return Ok(None);
    }
    let truth = |name: &str| truth["result"][name].as_f64().unwrap_or(f64::NAN);
    let scan = ventriform::open(case.join("spect.nii.gz"))?;
    let Ok(made) = ventriform::segment(&scan, &FitParameters::default()) else {
        return Ok(None);
    };
    let fit = &made.segmentation.fit;
    let (Some(both), Some(evidence)) = (&fit.model.surfaces, &fit.judgement.evidence) else {
        return Ok(None);
    };
    let Some(thickness) = both.thickness else {
        return Ok(None);
    };
    let resolution = made.segmentation.resolution.map_or(f64::NAN, |r| r.value);
    Ok(Some(format!(
        "{set},{},{:.2},{:.2},{:.2},{:.2},{:.4},{resolution:.2},{:.3},{:.2},{:.2},{:.3},\
         {:.2},{:.2},{:.2},{:.2},{:.2},{:.3}",
        name_of(case),
        both.anatomical.wall_ml,
        truth("wall_ml"),
        both.anatomical.wall.cavity_ml,
        truth("cavity_ml"),
        evidence.dark,
        fit.judgement.confidence,
        both.anatomical.wall.thickness,
        truth("wall_thickness_mean_mm"),
        thickness.sd_mm,
        thickness.interval_mm[0],
        thickness.interval_mm[1],
        thickness.look.apparent_mm,
        thickness.look.cavity_ml,
        thickness.look.usual_mm,
        thickness.look.noise_length_mm.unwrap_or(f64::NAN),
    )))
}
