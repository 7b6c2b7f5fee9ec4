//! A caller's choice of a volume of a file, and the limits of a reader.

use super::VolumeError;
use crate::image::reconstruct::Reconstruction;
use crate::image::reconstruct::motion::ViewShift;

/// Which volume of the file to read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// Number of the volume, from 0, in a file that holds several: for NIfTI the dimensions beyond
    /// the third, the fourth fastest; for DICOM the gates, those of the first R-R interval first.
    /// Default `None`: the only volume, or the sum of the gates of a gated image, which is what
    /// the camera counted over the whole heart beat.
    pub frame: Option<usize>,
}

impl ReadOptions {
    /// The number of the volume to read from a file that holds `frames` volumes; `None` for the sum
    /// of all, if they are `gated`.
    ///
    /// # Errors
    /// [`VolumeError::FrameNeeded`] if the file holds several and none was asked for,
    /// [`VolumeError::FrameOutOfRange`] if the file has no such volume.
    pub(super) fn choose(self, frames: usize, gated: bool) -> Result<Option<usize>, VolumeError> {
        match self.frame {
            None if frames == 1 => Ok(Some(0)),
            None if gated => Ok(None),
            None => Err(VolumeError::FrameNeeded { frames, why: None }),
            Some(frame) if frame < frames => Ok(Some(frame)),
            Some(frame) => Err(VolumeError::FrameOutOfRange { frame, frames }),
        }
    }
}

/// How volumes are made of projections.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FromProjections {
    /// The reconstruction.
    pub reconstruction: Reconstruction,
    /// How far every view is shifted back, in the order of the reader's views; empty for not at all.
    pub shifts: Vec<ViewShift>,
}

impl From<Reconstruction> for FromProjections {
    fn from(reconstruction: Reconstruction) -> Self {
        Self {
            reconstruction,
            shifts: Vec::new(),
        }
    }
}

/// Upper bounds on what reading a file may cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReadLimits {
    /// Voxels of one volume. Default 2^28: one gibibyte of `f32`, twice a 512^3 volume.
    pub voxels: u64,
    /// Bytes of the unpacked file up to the last voxel that is read. Default 4 GiB.
    pub unpacked_bytes: u64,
    /// Files in a zip archive, and in a folder with those in it. Default 8192.
    pub files: u64,
    /// Levels of folders in a folder, the one given counted. Default 16.
    pub folder_levels: usize,
    /// Bytes of a file of a mesh, unpacked. Reading one takes up to eight times as much memory. Default 64 MiB: a
    /// million triangles in binary STL.
    pub mesh_bytes: u64,
}

impl ReadLimits {
    /// The limits where nothing else is set.
    pub const DEFAULT: Self = Self {
        voxels: 1 << 28,
        unpacked_bytes: 4 << 30,
        files: 8192,
        folder_levels: 16,
        mesh_bytes: 64 << 20,
    };
}

impl Default for ReadLimits {
    fn default() -> Self {
        Self::DEFAULT
    }
}
