//! The facts about a volume's file as JSON, by the names that reports use.

use crate::volume::{IntensitySummary, VolumeFacts};
use nalgebra::Matrix4;
use serde_json::{Value, json};

/// Format, grid, frame, intensities and warnings of the volume's file. Lengths in mm.
pub fn input(facts: &VolumeFacts) -> Value {
    json!({
        "format": facts.format.as_str(),
        "byte_order": facts.byte_order.as_str(),
        "compressed": facts.compressed,
        "data_type": facts.data_type,
        "scaling": facts.scaling.map(|(slope, intercept)| json!({
            "slope": slope,
            "intercept": intercept,
        })),
        "file_shape": facts.file_shape,
        "frames": facts.frames,
        "frame": facts.frame,
        "shape": facts.shape,
        "spacing_mm": facts.spacing_mm,
        "affine_lps": rows(&facts.affine_lps),
        "affine_ras": rows(&facts.affine_ras),
        "affine_source": facts.affine_source.as_str(),
        "unit": facts.unit.as_str(),
        "intensity": intensity(&facts.intensity),
        "warnings": facts.warnings,
    })
}

fn intensity(summary: &IntensitySummary) -> Value {
    let labels = summary.labels.as_ref().map(|labels| {
        let counts = labels
            .iter()
            .map(|l| json!({"label": l.label, "voxels": l.voxels}));
        counts.collect::<Vec<_>>()
    });
    json!({
        "minimum": summary.minimum,
        "maximum": summary.maximum,
        "mean": summary.mean,
        "sum": summary.sum,
        "finite_voxels": summary.finite,
        "missing_voxels": summary.missing,
        "integral": summary.integral,
        "labels": labels,
    })
}

fn rows(matrix: &Matrix4<f64>) -> Vec<Vec<f64>> {
    matrix
        .row_iter()
        .map(|row| row.iter().copied().collect())
        .collect()
}
