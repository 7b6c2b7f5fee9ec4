//! Why there is no beat.

use crate::base::progress::Cancelled;

/// Why the gates of a study give no beat.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BeatError {
    /// Too few or too many gates.
    #[error("the study has {found} gates; a beat needs {least} to {most}")]
    GateCount {
        /// Gates of the study.
        found: usize,
        /// Fewest gates that show a beat.
        least: usize,
        /// Most gates.
        most: usize,
    },
    /// A gate lies on another grid than the first one.
    #[error(
        "gate {gate} has {} voxels where gate 1 has {}, or lies elsewhere; give gates on one grid",
        shape_text(found),
        shape_text(first)
    )]
    OtherGrid {
        /// The gate, from 1.
        gate: usize,
        /// Its shape.
        found: [usize; 3],
        /// The first gate's shape.
        first: [usize; 3],
    },
    /// A gate holds nothing.
    #[error("gate {gate} holds no counts: its values add up to 0 or less")]
    EmptyGate {
        /// The gate, from 1.
        gate: usize,
    },
    /// The fitted model is not that of a ventricle.
    #[error("the fitted model has no long axis; a beat needs a model of a left ventricle")]
    NoVentricle,
    /// The work was cancelled.
    #[error("cancelled")]
    Cancelled,
}

impl From<Cancelled> for BeatError {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
}

fn shape_text(shape: &[usize; 3]) -> String {
    let [i, j, k] = shape;
    format!("{i} x {j} x {k}")
}
