//! Figures against normal limits beside the truth of simulated scans.
//!
//! ```sh
//! cargo run --release --package ventriform-evaluation --bin perfusion -- NORMALS FOLDER...
//! ```
//!
//! NORMALS is a file that `ventriform normals build` wrote. Every folder holds cohort.csv and, of every case, the
//! scan and params.json, as `simulate healthy` writes them: "result"."perfusion" with deficit_percent
//! and segment_deficit, a share for each segment. Prints a row for each case, then over all: area under the ROC curve
//! of the deficit score and of the area below 60 % of the scan's own maximum (defect or none), their correlation with
//! the true deficit, the wall beyond the limit in healthy hearts, how many single basal defects lie above every
//! healthy heart and in how many the segment that is dark has the lowest z of the basal ones, correlation of the
//! summed score with the truth's, and the share of segments within one of the truth's score.

use anyhow::{Context, Result, anyhow};
use rayon::prelude::*;
use serde_json::Value;
use std::path::{Path, PathBuf};
use ventriform::base::progress::Monitor;
use ventriform::heart::normals::{DEFICIT_OF_FULL_SCORE, NormalLimits, ScanKind};
use ventriform::image::volume::{ReadLimits, VolumeFile};
use ventriform::parameters::FitParameters;
use ventriform::runs::evaluate::normals::table::{self, CohortRow};
use ventriform::runs::segmentation::{SegmentationOrder, from_files};
use ventriform_evaluation::statistics::{area_under_curve, correlation, mean};

/// Share below normal at which a true score begins, as the simulator has it.
const TRUE_LIMIT: f64 = 0.15;

/// A case's figures beside the truth.
struct Row {
    case: String,
    healthy: bool,
    score: f64,
    extent: f64,
    below: f64,
    truth: f64,
    summed: [f64; 2],
    /// Score found and true, of every segment with a found one.
    segments: Vec<[f64; 2]>,
    /// Of a single basal defect, whether its segment has the lowest z of the basal ones.
    lowest_is_dark: Option<bool>,
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1).map(PathBuf::from);
    let normals = arguments
        .next()
        .ok_or_else(|| anyhow!("usage: perfusion NORMALS FOLDER..."))?;
    let limits = NormalLimits::from_json(&std::fs::read(&normals)?)?;
    let mut rows = Vec::new();
    println!("case,healthy,score,extent,below_60,true_deficit,summed,true_summed");
    for folder in arguments {
        let cases = table::read(&folder)?;
        let made: Vec<Result<Row>> = (cases.par_iter())
            .map(|case| row(&folder, case, &limits).with_context(|| case.case.clone()))
            .collect();
        for made in made {
            match made {
                Ok(row) => rows.push(row),
                Err(error) => eprintln!("left out: {error:#}"),
            }
        }
    }
    for row in &rows {
        println!(
            "{},{},{:.3},{:.2},{:.2},{:.2},{},{}",
            row.case,
            row.healthy,
            row.score,
            row.extent,
            row.below,
            row.truth,
            row.summed[0],
            row.summed[1]
        );
    }
    summary(&rows);
    Ok(())
}

fn row(folder: &Path, case: &CohortRow, limits: &NormalLimits) -> Result<Row> {
    let file = folder.join(&case.file);
    let parameters = FitParameters {
        scan: ScanKind {
            sex: Some(case.sex),
            protocol: Some(case.protocol.clone()),
            tracer: Some(case.tracer.clone()),
            attenuation_corrected: Some(case.attenuation_corrected),
        },
        ..FitParameters::default()
    };
    let files = [VolumeFile::at(&file)];
    let order = SegmentationOrder {
        normals: Some(limits),
        ..SegmentationOrder::of_built_in_hearts(&files, &parameters)
    };
    let made = from_files(&order, &ReadLimits::default(), &Monitor::silent())?;
    let found = made.perfusion.as_ref().context("no limits were applied")?;
    let below = made
        .segmentation
        .polar
        .as_ref()
        .context("no polar map")?
        .extent_percent;
    let facts = std::fs::read(file.with_file_name("params.json"))?;
    let facts: Value = serde_json::from_slice(&facts)?;
    let truth = &facts["result"]["perfusion"];
    let deficit_of = |segment: usize| {
        truth["segment_deficit"][segment.to_string()]
            .as_f64()
            .unwrap_or(0.0)
    };
    let true_score = |segment: usize| {
        let way = (deficit_of(segment) - TRUE_LIMIT) / (DEFICIT_OF_FULL_SCORE - TRUE_LIMIT);
        (4.0 * way.clamp(0.0, 1.0)).round()
    };
    let scored = found
        .segments
        .iter()
        .filter_map(|s| Some((s.segment, f64::from(s.score?))));
    let segments: Vec<[f64; 2]> = scored
        .map(|(segment, score)| [score, true_score(segment)])
        .collect();
    let lowest = found.segments[..6].iter().min_by(|a, b| {
        let z = |s: Option<f64>| s.unwrap_or(0.0);
        z(a.z).total_cmp(&z(b.z))
    });
    Ok(Row {
        case: case.case.clone(),
        healthy: case.healthy,
        score: found.deficit_percent,
        extent: found.extent_percent,
        below,
        truth: truth["deficit_percent"]
            .as_f64()
            .context("params.json has no deficit")?,
        summed: [
            f64::from(found.summed_score),
            (1..=17).map(true_score).sum(),
        ],
        segments,
        lowest_is_dark: basal_defect(&facts).and_then(|dark| Some(lowest?.segment == dark)),
    })
}

/// The segment of the only defect, if it is a basal one.
fn basal_defect(facts: &Value) -> Option<usize> {
    let defects = facts["heart"]["defects"].as_array()?;
    let [defect] = &defects[..] else { return None };
    match &defect["segments"].as_array()?[..] {
        [segment] => segment
            .as_u64()
            .filter(|s| (1..=6).contains(s))
            .map(|s| s as usize),
        _ => None,
    }
}

fn summary(rows: &[Row]) {
    let of = |healthy: bool, figure: fn(&Row) -> f64| -> Vec<f64> {
        rows.iter()
            .filter(|row| row.healthy == healthy)
            .map(figure)
            .collect()
    };
    let all = |figure: fn(&Row) -> f64| -> Vec<f64> { rows.iter().map(figure).collect() };
    let truth = all(|row| row.truth);
    for (name, figure) in [
        ("deficit score", (|row| row.score) as fn(&Row) -> f64),
        ("area below the threshold", |row| row.below),
    ] {
        println!(
            "{name}: AUC {:.3}, r with the true deficit {:.3}",
            area_under_curve(&of(false, figure), &of(true, figure)),
            correlation(&all(figure), &truth)
        );
    }
    let extents = of(true, |row| row.extent);
    let greatest = of(true, |row| row.score).into_iter().fold(0.0, f64::max);
    println!(
        "{} healthy, {} with defects; healthy wall beyond the limit {:.2} % in the mean, {:.2} % at most; greatest \
         healthy score {greatest:.3}",
        extents.len(),
        rows.len() - extents.len(),
        mean(&extents),
        extents.iter().fold(0.0, |a: f64, b| a.max(*b))
    );
    let basal: Vec<&Row> = rows
        .iter()
        .filter(|row| row.lowest_is_dark.is_some())
        .collect();
    println!(
        "{} single basal defects: {} with a score above every healthy heart's, {} whose segment is the lowest of the \
         basal ones",
        basal.len(),
        basal.iter().filter(|row| row.score > greatest).count(),
        basal
            .iter()
            .filter(|row| row.lowest_is_dark == Some(true))
            .count()
    );
    let pairs: Vec<[f64; 2]> = rows.iter().flat_map(|row| row.segments.clone()).collect();
    let within = |pairs: &[[f64; 2]]| {
        let near = pairs
            .iter()
            .filter(|pair| (pair[0] - pair[1]).abs() <= 1.0)
            .count();
        100.0 * near as f64 / pairs.len().max(1) as f64
    };
    let dark: Vec<[f64; 2]> = pairs.iter().copied().filter(|pair| pair[1] > 0.0).collect();
    println!(
        "summed score: r {:.3}; segments within 1: {:.1} % of {}, {:.1} % of the {} dark ones",
        correlation(&all(|row| row.summed[0]), &all(|row| row.summed[1])),
        within(&pairs),
        pairs.len(),
        within(&dark),
        dark.len()
    );
}
