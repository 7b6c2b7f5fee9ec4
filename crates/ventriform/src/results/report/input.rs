//! The facts about a volume's file, by the names that reports use.

use crate::image::volume::{IntensitySummary, LabelCount, VolumeFacts};
use nalgebra::Matrix4;
use serde::{Deserialize, Serialize};

/// The statements of a volume's file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FileFacts {
    /// File format.
    pub format: String,
    /// `little` or `big`.
    pub byte_order: String,
    /// Whether it was gzipped.
    pub compressed: bool,
    /// Data type in the file.
    pub data_type: String,
    /// How stored values become intensities, if they do not as they are.
    pub scaling: Option<Scaling>,
    /// Sizes of all dimensions in the file.
    pub file_shape: Vec<usize>,
    /// Frames in the file.
    pub frames: usize,
    /// The frame that was read, counted from 0.
    pub frame: Option<usize>,
    /// Voxels along i, j, k.
    pub shape: [usize; 3],
    /// Voxel spacing, millimetres.
    pub spacing_mm: [f64; 3],
    /// Maps a voxel index to LPS millimetres; row by row.
    pub affine_lps: [[f64; 4]; 4],
    /// Maps a voxel index to RAS millimetres; row by row.
    pub affine_ras: [[f64; 4]; 4],
    /// The part of the header that gave the affine.
    pub affine_source: String,
    /// The file's unit of length.
    pub unit: String,
    /// The voxel values after slope and intercept.
    pub intensity: IntensityFacts,
    /// Oddities of the file that do not prevent its use.
    pub warnings: Vec<String>,
}

/// intensity = slope × stored value + intercept.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Scaling {
    /// The slope.
    pub slope: f64,
    /// The intercept.
    pub intercept: f64,
}

/// A summary of voxel values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct IntensityFacts {
    /// Smallest finite value.
    pub minimum: f64,
    /// Largest finite value.
    pub maximum: f64,
    /// Mean of the finite values.
    pub mean: f64,
    /// Sum of the finite values.
    pub sum: f64,
    /// Voxels with a finite value.
    pub finite_voxels: u64,
    /// Voxels that are NaN or infinite.
    pub missing_voxels: u64,
    /// Whether all values are whole numbers.
    pub integral: bool,
    /// The labels, if the volume looks like a label map.
    pub labels: Option<Vec<LabelCount>>,
}

impl FileFacts {
    /// Format, grid, frame, intensities and warnings of the volume's file.
    pub fn from_facts(facts: &VolumeFacts) -> Self {
        Self {
            format: facts.format.as_str().to_owned(),
            byte_order: facts.byte_order.as_str().to_owned(),
            compressed: facts.compressed,
            data_type: facts.data_type.to_owned(),
            scaling: (facts.scaling).map(|(slope, intercept)| Scaling { slope, intercept }),
            file_shape: facts.file_shape.clone(),
            frames: facts.frames,
            frame: facts.frame,
            shape: facts.shape,
            spacing_mm: facts.spacing_mm,
            affine_lps: rows(&facts.affine_lps),
            affine_ras: rows(&facts.affine_ras),
            affine_source: facts.affine_source.as_str().to_owned(),
            unit: facts.unit.as_str().to_owned(),
            intensity: IntensityFacts::from_summary(&facts.intensity),
            warnings: facts.warnings.clone(),
        }
    }
}

impl IntensityFacts {
    fn from_summary(summary: &IntensitySummary) -> Self {
        Self {
            minimum: summary.minimum.into(),
            maximum: summary.maximum.into(),
            mean: summary.mean,
            sum: summary.sum,
            finite_voxels: summary.finite,
            missing_voxels: summary.missing,
            integral: summary.integral,
            labels: summary.labels.clone(),
        }
    }
}

fn rows(matrix: &Matrix4<f64>) -> [[f64; 4]; 4] {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}
