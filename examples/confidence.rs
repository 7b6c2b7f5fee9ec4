//! Prints the figures that the confidence of a fit is calibrated on.
//!
//! `cargo run --release --example confidence -- FOLDER...` segments `CASE/spect.nii.gz` of every case
//! in the folders with the built-in hearts. Each case gives one line: its name, the Jaccard index of
//! the apparent wall with `lv_expert_img.nii.gz` and of the anatomical wall with `lv_truth.nii.gz`
//! (`-` without a fit), then, as JSON, the report's evidence, each heart's chances, flags and volumes, the
//! nodes (apparent and anatomical place, strength of the edge, way from apex to rim, distance from the
//! other hearts' fits) and the triangles, or the reason where no heart was found.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use rayon::prelude::*;
use serde_json::json;
use ventriform::deform::confidence::of_agreement;
use ventriform::deform::{Evidence, WallEdge};
use ventriform::grid::agreement::compare;
use ventriform::parameters::FitParameters;
use ventriform::progress::Monitor;
use ventriform::segmentation::{SegmentationOrder, from_files, on_grid, report_json};
use ventriform::volume::{self, ReadLimits, ReadOptions, VolumeFile};

fn main() -> Result<()> {
    let mut cases: Vec<PathBuf> = Vec::new();
    for folder in std::env::args().skip(1) {
        for entry in std::fs::read_dir(&folder).with_context(|| folder.clone())? {
            cases.push(entry?.path());
        }
    }
    cases.retain(|case| case.join("spect.nii.gz").exists());
    cases.sort();
    let lines: Vec<String> = cases
        .par_iter()
        .map(|case| line(case))
        .collect::<Result<_>>()?;
    println!("{}", lines.join("\n"));
    Ok(())
}

fn line(case: &Path) -> Result<String> {
    let name = case.file_name().map(|name| name.to_string_lossy());
    let name = name.unwrap_or_default();
    let monitor = Monitor::silent();
    let limits = ReadLimits::default();
    let parameters = FitParameters::default();
    let file = |name: &str| [VolumeFile::at(case.join(name))];
    let order = SegmentationOrder {
        volume: &file("spect.nii.gz"),
        expert: None,
        auto: true,
        models: Vec::new(),
        reader: None,
        parameters: &parameters,
    };
    let segmented = match from_files(&order, &limits, &monitor) {
        Ok(segmented) => segmented,
        Err(error) => return Ok(format!("{name}\t-\t-\t{}", json!(error.to_string()))),
    };
    let (scan, made) = (&segmented.reading.volume, &segmented.segmentation);
    let jaccard = |mask, gold: &str| -> Result<f64> {
        let gold = volume::read(&file(gold), &ReadOptions::default(), &limits, &monitor)?.volume;
        let gold = on_grid(&gold, scan, &monitor)?;
        Ok(compare(mask, &gold, scan.frame.spacing(), &monitor)?.jaccard)
    };
    let apparent = jaccard(&made.mask, "lv_expert_img.nii.gz")?;
    let anatomical = match &made.other_mask {
        Some(mask) => jaccard(mask, "lv_truth.nii.gz")?,
        None => f64::NAN,
    };
    let report = report_json(made);
    let both = [WallEdge::Apparent, WallEdge::Anatomical];
    let chances = |evidence: &Evidence| both.map(|edge| of_agreement(evidence, edge));
    let candidates: Vec<_> = (made.candidates.iter())
        .map(|c| json!({"template": c.name, "chances": c.evidence.as_ref().map(chances)}))
        .collect();
    let surfaces = made.fit.surfaces.as_ref();
    let nodes: Vec<_> = surfaces.map_or_else(Vec::new, |s| {
        let places = (s.apparent.mesh.vertices.iter()).zip(&s.anatomical.mesh.vertices);
        let nodes = places.zip(&made.fit.nodes);
        nodes
            .map(|((p, q), n)| json!([p.x, p.y, p.z, q.x, q.y, q.z, n.seen, n.way, n.spread]))
            .collect()
    });
    Ok(format!(
        "{name}\t{apparent:.4}\t{anatomical:.4}\t{}",
        json!({
            "evidence": report["evidence"],
            "confidence": made.fit.confidence,
            "chances": made.fit.evidence.as_ref().map(chances),
            "candidates": candidates,
            "place": made.fit.place_confidence(),
            "thickness_mm": report["wall_thickness_mm"],
            "flags": report["flags"],
            "volumes_ml": report["volumes_ml"],
            "uncertainty_mm": surfaces.map(|s| [&s.apparent.uncertainty, &s.anatomical.uncertainty]),
            "nodes": nodes,
            "triangles": made.fit.mesh.triangles,
        })
    ))
}
