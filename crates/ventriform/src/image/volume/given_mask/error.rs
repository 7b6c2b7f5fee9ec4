//! Why a mask cannot be used.

use super::geometry::GridGeometry;
use super::label::MaskLabel;
use super::structures::MaskStructure;
use crate::base::progress::Cancelled;
use crate::image::volume::VolumeError;

/// Most structures that an error lists.
const MOST_LISTED: usize = 40;

/// Why a mask cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GivenMaskError {
    /// The files hold no usable volume.
    #[error(transparent)]
    File(VolumeError),
    /// The file holds several volumes.
    #[error("the file holds {frames} volumes, and a mask is one")]
    Volumes {
        /// Their number.
        frames: usize,
    },
    /// No voxel belongs to the structure.
    #[error("the mask is empty")]
    Empty,
    /// The values are intensities.
    #[error(
        "the file is no mask: its values run from {minimum} to {maximum} and are neither labels nor \
         probabilities from 0 to 1"
    )]
    NotMask {
        /// Smallest value.
        minimum: f32,
        /// Largest value.
        maximum: f32,
    },
    /// Several structures may be meant.
    #[error(
        "which of these structures is the mask is not stated: {}",
        list(present)
    )]
    SeveralStructures {
        /// The structures.
        present: Vec<MaskStructure>,
    },
    /// The only structure is what the wall encloses.
    #[error(
        "the only structure of the mask is a cavity and not the wall: {}",
        list(present)
    )]
    OnlyCavity {
        /// The structure.
        present: Vec<MaskStructure>,
    },
    /// The structure that was named is not in the file.
    #[error("the mask has no structure {label}; it has {}", list(present))]
    NoSuchStructure {
        /// The structure that was asked for.
        label: MaskLabel,
        /// The structures there are.
        present: Vec<MaskStructure>,
    },
    /// The mask's voxels are not those of the volume.
    #[error("the mask has {mask} and the other grid {grid}: they are different grids")]
    OtherGrid {
        /// Grid of the mask.
        mask: Box<GridGeometry>,
        /// Grid to bring it to.
        grid: Box<GridGeometry>,
    },
    /// More than a hundredth of the mask lies outside the volume.
    #[error(
        "only {inside} of the mask's {all} voxels lie inside the volume: the headers place mask \
         and volume differently in the patient; the mask has {mask} and the other grid {grid}"
    )]
    Elsewhere {
        /// Mask voxels inside the volume.
        inside: usize,
        /// All mask voxels.
        all: usize,
        /// Grid of the mask.
        mask: Box<GridGeometry>,
        /// Grid to bring it to.
        grid: Box<GridGeometry>,
    },
    /// Both masks together take more voxels than are read.
    #[error("the box that holds both masks has {voxels} voxels; the limit is {limit}")]
    TooFarApart {
        /// Voxels of the box.
        voxels: u64,
        /// The limit.
        limit: u64,
    },
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl GivenMaskError {
    /// The error without what the file says in words: names of structures are left out, their numbers stay.
    #[must_use]
    pub fn without_header_text(&self) -> Self {
        let mut error = self.clone();
        match &mut error {
            Self::File(file) => *file = file.without_header_text(),
            Self::SeveralStructures { present }
            | Self::OnlyCavity { present }
            | Self::NoSuchStructure { present, .. } => {
                present
                    .iter_mut()
                    .for_each(|structure| structure.names.clear());
            }
            _ => {}
        }
        error
    }
}

fn list(present: &[MaskStructure]) -> String {
    if present.is_empty() {
        return "no labels".into();
    }
    let shown = present.iter().take(MOST_LISTED).map(ToString::to_string);
    let shown: Vec<String> = shown.collect();
    let more = present.len().saturating_sub(MOST_LISTED);
    match more {
        0 => shown.join(", "),
        _ => format!("{} and {more} more", shown.join(", ")),
    }
}
