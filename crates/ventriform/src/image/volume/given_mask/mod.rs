//! Masks that somebody gives: an expert's, a reader's, a gold standard, a result of our own.
//!
//! Every command and every job that takes a mask reads it here. In go the files and what the caller
//! says of them ([`MaskChoice`]); out comes one structure on a grid of its own ([`GivenMask`]), and
//! from that the mask on the grid of a volume ([`GivenMask::on`]).
//!
//! 1. `structures`: what the file holds: the segments of a DICOM Segmentation, the
//!    labels of a map, the one object of a binary volume, or the voxels above one half of a
//!    probability map.
//! 2. `choice`: which of them is meant. A number or a name that the caller gives;
//!    otherwise the only one, or of the segments the one whose property codes say myocardium. Where
//!    several remain, they are refused with their list: the order in a file says nothing.
//! 3. `place`: the grids are compared by their frames. Voxels of one lattice are carried
//!    over one by one, however they are stored (turned, mirrored, cropped, padded); another lattice is
//!    refused with both geometries, or resampled if the caller asks.
//!
//! 4. `agree`: two of them are compared on the grid of one.
//!
//! A closed surface (STL, PLY, OBJ, VTK, VTP, glTF, our JSON) is a mask, too: it has one structure and no grid, and is
//! voxelised on the volume's, a voxel being inside where its centre is.
//!
//! Guaranteed: no voxel of another structure counts, also where segments overlap.

mod agree;
mod choice;
mod error;
mod geometry;
mod label;
mod place;
mod structures;

#[cfg(test)]
mod tests;

pub use agree::{MaskAgreement, MaskAgreementError};
pub use choice::MaskChoice;
pub use error::GivenMaskError;
pub use geometry::GridGeometry;
pub use label::MaskLabel;
pub use place::PlacedMask;
pub use structures::MaskStructure;

use super::read;
use super::{ReadLimits, ReadOptions, Volume, VolumeError, VolumeFile};
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::Monitor;
use crate::image::grid::voxelise::Mask;
use crate::mesh::TriMesh;

/// One structure of a file, on the file's grid.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenMask {
    /// Its voxels.
    pub mask: Mask,
    /// Voxel index to LPS millimetres.
    pub frame: VoxelToPatient,
    /// Which structure it is, for reports: `label 2`, `segment 1 (Left ventricle)`; `None` if the file
    /// holds nothing else.
    pub structure: Option<String>,
    /// The surface whose inside it is, LPS mm, if it was given as one; the voxels are then of a grid about it.
    pub surface: Option<TriMesh>,
}

impl GivenMask {
    /// The mask as a volume of 0 and 1.
    pub fn to_volume(&self) -> Volume {
        let value = |inside: &bool| f32::from(u8::from(*inside));
        Volume {
            shape: self.mask.shape,
            voxels: self.mask.voxels.iter().map(value).collect(),
            frame: self.frame.clone(),
            integral: true,
        }
    }

    /// The structure that `choice` names in a volume in memory.
    ///
    /// # Errors
    /// [`GivenMaskError`].
    pub fn of_volume(
        volume: &Volume,
        choice: &MaskChoice,
        monitor: &Monitor,
    ) -> Result<Self, GivenMaskError> {
        let held = structures::of_volume(volume, monitor)?;
        let chosen = choice::choose(&held, choice)?;
        let voxels = held.voxels(volume, chosen, monitor)?;
        Self::new(volume, voxels, held.describe(chosen))
    }

    fn new(
        volume: &Volume,
        voxels: Vec<bool>,
        structure: Option<String>,
    ) -> Result<Self, GivenMaskError> {
        if !voxels.contains(&true) {
            return Err(GivenMaskError::Empty);
        }
        Ok(Self {
            mask: Mask {
                shape: volume.shape,
                voxels,
            },
            frame: volume.frame.clone(),
            structure,
            surface: None,
        })
    }
}

/// Reads the mask that `choice` names from `files`.
///
/// # Errors
/// [`GivenMaskError`].
pub fn read_mask(
    files: &[VolumeFile],
    choice: &MaskChoice,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<GivenMask, GivenMaskError> {
    let unreadable = |error| match error {
        VolumeError::Cancelled(cancelled) => GivenMaskError::Cancelled(cancelled),
        VolumeError::FrameNeeded { frames, .. } => GivenMaskError::Volumes { frames },
        error => GivenMaskError::File(error),
    };
    let surface = read::surface(files, &choice.mesh, limits, monitor).map_err(unreadable)?;
    if let Some((surface, reading)) = surface {
        let held = structures::of_volume(&reading.volume, monitor)?;
        let chosen = choice::choose(&held, choice)?;
        let voxels = held.voxels(&reading.volume, chosen, monitor)?;
        let mut given = GivenMask::new(&reading.volume, voxels, held.describe(chosen))?;
        given.surface = Some(surface).filter(|_| chosen == 1);
        return Ok(given);
    }
    let segments = read::segments(files, limits, monitor).map_err(unreadable)?;
    if !segments.is_empty() {
        let held = structures::of_segments(&segments);
        let chosen = choice::choose(&held, choice)?;
        let segment = u16::try_from(chosen).unwrap_or_default();
        let reading = read::read_segment(files, segment, limits, monitor).map_err(unreadable)?;
        let carries = |v: f32| v == f32::from(segment);
        let voxels = structures::those(&reading.volume.voxels, carries, monitor)?;
        return GivenMask::new(&reading.volume, voxels, held.describe(chosen));
    }
    let reading = read::read(files, &ReadOptions::default(), limits, monitor);
    let reading = reading.map_err(unreadable)?;
    let frames = reading.facts.frames;
    if frames > 1 {
        return Err(GivenMaskError::Volumes { frames });
    }
    if !read::labels_are_rounded(&reading) {
        return GivenMask::of_volume(&reading.volume, choice, monitor);
    }
    let held = structures::of_labels(&reading.facts);
    let chosen = choice::choose(&held, choice)?;
    let voxels = read::voxels_of_label(files, &reading, chosen, limits, monitor);
    GivenMask::new(
        &reading.volume,
        voxels.map_err(unreadable)?,
        held.describe(chosen),
    )
}
