//! A stored volume: its files by name and what its header says.

use super::Timestamp;
use serde::{Deserialize, Serialize};

/// One row of the catalogue of volumes.
#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    /// `vol_...`, from the content.
    pub id: String,
    /// Order of arrival.
    pub sequence: i64,
    /// When it was stored.
    pub created_at: Timestamp,
    /// Bytes of all files together.
    pub bytes: u64,
    /// The files' names within the volume's folder; never the names the client gave.
    pub files: Vec<String>,
    /// What the header says.
    pub facts: VolumeFacts,
}

/// What is known of a volume from reading it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VolumeFacts {
    /// `NIfTI-1`, `NIfTI-2` ...
    pub format: String,
    /// Whether it came gzipped.
    pub compressed: bool,
    /// Voxels along i, j, k of one frame.
    pub shape: [usize; 3],
    /// How many volumes of that shape the file holds.
    pub frames: usize,
    /// Voxel spacing along the first three axes, mm.
    pub spacing_mm: [f64; 3],
    /// Voxel index to millimetres in the patient frame LPS, row by row.
    pub affine: [[f64; 4]; 4],
    /// What the affine was taken from: `sform`, `qform`, `pixdim`.
    pub affine_source: String,
    /// The file's data type, such as `int16`.
    pub dtype: String,
    /// The values.
    pub intensity: Intensity,
    /// The labels, rising, where the volume looks like a label map.
    pub labels: Option<Vec<i64>>,
    /// What is odd about the file but does not keep it from use.
    pub warnings: Vec<String>,
}

/// A summary of voxel values, slope and intercept applied.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Intensity {
    /// Smallest finite value.
    pub min: f64,
    /// Largest finite value.
    pub max: f64,
    /// Mean of the finite values.
    pub mean: f64,
    /// Voxels that are no finite number.
    pub not_finite: u64,
}
