//! Prints the figures that the confidence of a fit is calibrated on.
//!
//! `cargo run --release -p ventriform-evaluation --bin confidence -- FOLDER...` segments
//! `CASE/spect.nii.gz` of every case in the folders with the built-in hearts, once for each wall. Each
//! case gives one line: its name, the Jaccard index of the apparent wall with `lv_expert_img.nii.gz` and
//! of the anatomical wall with `lv_truth.nii.gz` (`-` without a fit), then, as JSON, for each wall the
//! confidence, flags and distance of the contours, and the report's evidence, each heart's chances, volumes, the polar
//! segments, the nodes (apparent and anatomical place, strength of the edge, way from apex to rim,
//! distance from the other hearts' fits) and the triangles, or the reason where no heart was found.

use std::error::Error;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde_json::{Value, json};
use ventriform::base::progress::Monitor;
use ventriform::heart::deform::WallEdge;
use ventriform::heart::judge::confidence::of_agreement;
use ventriform::heart::judge::{Evidence, Flag};
use ventriform::image::grid::agreement::compare;
use ventriform::image::volume::given_mask::{MaskChoice, read_mask};
use ventriform::image::volume::{ReadLimits, VolumeFile};
use ventriform::parameters::FitParameters;
use ventriform::results::report::object;
use ventriform::runs::segmentation::{SegmentationOrder, SegmentedVolume, from_files};

type Result<T> = std::result::Result<T, Box<dyn Error + Send + Sync>>;

fn main() -> Result<()> {
    let mut cases: Vec<PathBuf> = Vec::new();
    for folder in std::env::args().skip(1) {
        for entry in std::fs::read_dir(&folder)? {
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
    let file = |name: &str| [VolumeFile::at(case.join(name))];
    let with_edge = |edge| {
        let mut parameters = FitParameters::default();
        parameters.deform.edge = edge;
        let files = file("spect.nii.gz");
        let order = SegmentationOrder::of_built_in_hearts(&files, &parameters);
        from_files(&order, &limits, &monitor)
    };
    let both = [WallEdge::Apparent, WallEdge::Anatomical];
    let [apparent, anatomical] = match both.map(with_edge) {
        [Ok(apparent), Ok(anatomical)] => [apparent, anatomical],
        [Err(error), _] | [_, Err(error)] => {
            return Ok(format!("{name}\t-\t-\t{}", json!(error.to_string())));
        }
    };
    let judged = |segmented: &SegmentedVolume, gold: &str| -> Result<(f64, Value)> {
        let (scan, made) = (&segmented.reading.volume, &segmented.segmentation);
        let gold = read_mask(&file(gold), &MaskChoice::default(), &limits, &monitor)?;
        let gold = gold.on((scan.shape, &scan.frame), false, &monitor)?.mask;
        let agreement = compare(&made.mask, &gold, scan.frame.spacing(), &monitor)?;
        let flags: Vec<&str> = made.fit.judgement.flags.iter().map(Flag::code).collect();
        Ok((
            agreement.jaccard,
            json!({
                "jaccard": agreement.jaccard,
                "contours_voxels": agreement.contours.map(|c| c.mean_voxels),
                "confidence": made.fit.judgement.confidence,
                "flags": flags,
            }),
        ))
    };
    let (of_apparent, of_anatomical) = (
        judged(&apparent, "lv_expert_img.nii.gz")?,
        judged(&anatomical, "lv_truth.nii.gz")?,
    );
    let made = &apparent.segmentation;
    let report = object(&apparent.report());
    let chances = |evidence: &Evidence| both.map(|edge| of_agreement(evidence, edge));
    let candidates: Vec<_> = (made.candidates.iter())
        .map(|c| json!({"template": c.name, "chances": c.evidence.as_ref().map(chances)}))
        .collect();
    let (model, judgement) = (&made.fit.model, &made.fit.judgement);
    let surfaces = model.surfaces.as_ref();
    let nodes: Vec<_> = surfaces.map_or_else(Vec::new, |s| {
        let places = (s.apparent.mesh.vertices.iter()).zip(&s.anatomical.mesh.vertices);
        let nodes = places.zip(&judgement.nodes);
        nodes
            .map(|((p, q), n)| json!([p.x, p.y, p.z, q.x, q.y, q.z, n.seen, n.way, n.spread]))
            .collect()
    });
    Ok(format!(
        "{name}\t{:.4}\t{:.4}\t{}",
        of_apparent.0,
        of_anatomical.0,
        json!({
            "apparent": of_apparent.1,
            "anatomical": of_anatomical.1,
            "evidence": report["evidence"],
            "localisation": report["localisation"],
            "chances": judgement.evidence.as_ref().map(chances),
            "candidates": candidates,
            "septal_overshoot": judgement.evidence.as_ref().map(|e| e.septal_overshoot),
            "place": judgement.position_confidence,
            "thickness_mm": report["thickness_mm"],
            "volumes_ml": report["volumes_ml"],
            "polar": report["polar"],
            "uncertainty_mm": judgement.uncertainty.as_ref().map(|u| [&u.apparent, &u.anatomical]),
            "nodes": nodes,
            "triangles": model.mesh.triangles,
        })
    ))
}
