//! Why there is no surface.

use super::marching_cubes::{self, MarchingCubesError};
use crate::base::progress::Cancelled;
use crate::mesh::topology::MeshDefect;

/// Why there is no surface.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// Asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Every voxel is NaN or infinite.
    #[error("the volume holds no finite value (all {voxels} voxels are NaN or infinite)")]
    NoFiniteVoxel {
        /// Number of voxels.
        voxels: usize,
    },
    /// All voxels are equal.
    #[error("every voxel of the volume has the value {value}: there is nothing to find")]
    Constant {
        /// The value.
        value: f32,
    },
    /// Nothing of the volume reaches the iso-value.
    #[error(
        "there is no surface at the iso-value {iso}: the volume's values run from {minimum} to {maximum}"
    )]
    NoSurface {
        /// The iso-value.
        iso: f64,
        /// Smallest value.
        minimum: f32,
        /// Largest value.
        maximum: f32,
    },
    /// A fraction outside (0, 1), an absolute value that is not finite.
    #[error("iso: {value} is not {expected}")]
    BadIso {
        /// The value given.
        value: f64,
        /// Values that would do.
        expected: &'static str,
    },
    /// `mask_smoothing` outside its range.
    #[error("mask_smoothing: {value} is not between 0 and 3 voxels")]
    BadSmoothing {
        /// The value given.
        value: f64,
    },
    /// The label does not occur, or the volume is not a label map.
    #[error(
        "isolate: no voxel carries the label {label}; the volume has {}",
        describe_labels(present)
    )]
    NoSuchLabel {
        /// The label asked for.
        label: i64,
        /// The values present and their voxel counts; empty if they are intensities.
        present: Vec<(i64, usize)>,
    },
    /// A label map of so many labels that none can be guessed, or of labels that 32-bit floats do not
    /// tell apart.
    #[error(
        "the volume is a label map with {}: it is not known which one is the object",
        describe_labels(present)
    )]
    LabelNeeded {
        /// The labels present and their voxel counts.
        present: Vec<(i64, usize)>,
    },
    /// The voxels are 32-bit floats, which cannot hold the label.
    #[error(
        "isolate: the label {label} is beyond 2^24 and no 32-bit float, of which the volume consists"
    )]
    InexactLabel {
        /// The label asked for.
        label: i64,
    },
    /// The seed or the box leaves the volume.
    #[error("isolate: voxel {voxel:?} is outside the volume of {shape:?} voxels")]
    OutsideVolume {
        /// The voxel given.
        voxel: [usize; 3],
        /// The volume's shape.
        shape: [usize; 3],
    },
    /// The box's first voxel lies behind its last.
    #[error("isolate: the box's first voxel {first:?} lies behind its last {last:?}")]
    EmptyBox {
        /// First voxel given.
        first: [usize; 3],
        /// Last voxel given.
        last: [usize; 3],
    },
    /// The hinted centre or region leaves no place to search.
    #[error("the hinted centre or region lies outside the volume")]
    HintOutside,
    /// The seed's voxel is below the iso-value.
    #[error("isolate: the seed {seed:?} has the value {value}, below the iso-value {iso}")]
    SeedOutside {
        /// The seed.
        seed: [usize; 3],
        /// Its value.
        value: f32,
        /// The iso-value.
        iso: f64,
    },
    /// The shape does not belong to the voxels.
    #[error("the volume's shape {shape:?} does not fit its {voxels} voxels")]
    BadShape {
        /// The shape.
        shape: [usize; 3],
        /// Number of values.
        voxels: usize,
    },
    /// The surface has more vertices than 32-bit indices can name.
    #[error(transparent)]
    TooManyVertices(#[from] marching_cubes::TooManyVertices),
    /// A mesh handed to [`from_mesh`](super::from_mesh) is not a closed manifold.
    #[error("the mesh is not a closed, oriented manifold: {0}")]
    NotClosed(#[from] MeshDefect),
    /// A mesh handed to [`from_mesh`](super::from_mesh) has coordinates that are not finite.
    #[error("vertex {vertex} is not finite")]
    BadVertex {
        /// Index of the vertex.
        vertex: usize,
    },
}

impl SurfaceError {
    /// The parameter that the error is about, by its name for users.
    pub fn field(&self) -> Option<&'static str> {
        match self {
            SurfaceError::NoSurface { .. } | SurfaceError::BadIso { .. } => Some("iso"),
            SurfaceError::BadSmoothing { .. } => Some("mask_smoothing"),
            SurfaceError::NoSuchLabel { .. }
            | SurfaceError::LabelNeeded { .. }
            | SurfaceError::InexactLabel { .. } => Some("label"),
            SurfaceError::EmptyBox { .. } => Some("box"),
            SurfaceError::OutsideVolume { .. } => Some("isolate"),
            SurfaceError::SeedOutside { .. } => Some("seed_point"),
            _ => None,
        }
    }
}

pub(super) fn describe_labels(present: &[(i64, usize)]) -> String {
    if present.is_empty() {
        return "no labels (its values are intensities)".into();
    }
    let shown: Vec<String> = present
        .iter()
        .take(40)
        .map(|(label, count)| format!("{label} ({count} voxels)"))
        .collect();
    let more = present.len().saturating_sub(40);
    if more > 0 {
        format!("labels {} and {more} more", shown.join(", "))
    } else {
        format!("labels {}", shown.join(", "))
    }
}

impl From<MarchingCubesError> for SurfaceError {
    fn from(error: MarchingCubesError) -> Self {
        match error {
            MarchingCubesError::Cancelled(e) => e.into(),
            MarchingCubesError::TooManyVertices(e) => e.into(),
        }
    }
}
