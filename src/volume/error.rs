//! Why a file did not become a volume.

use crate::progress::Cancelled;

/// What is wrong with a file. [`VolumeError::field`] names the field concerned.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum VolumeError {
    /// No file was given.
    #[error("no file was given")]
    NoFile,
    /// There is not a single byte.
    #[error("{file} is empty")]
    Empty {
        /// The file's name.
        file: String,
    },
    /// A known format which is not read.
    #[error("{file} is {format}, which is not read here")]
    Unsupported {
        /// The file's name.
        file: String,
        /// What it is.
        format: String,
        /// How to make a readable file of it.
        fix: &'static str,
    },
    /// A DICOM image of the right kind that shows no slices.
    #[error("{file} has the Image Type {image_type}: {reason}")]
    NotSlices {
        /// The file's name.
        file: String,
        /// Value 3 of Image Type (0008,0008).
        image_type: String,
        /// What it shows instead.
        reason: &'static str,
    },
    /// Nothing known.
    #[error("{file} is no volume known here: it begins with {start}")]
    Unrecognised {
        /// The file's name.
        file: String,
        /// Its first bytes, printable.
        start: String,
    },
    /// A header's field has a value that cannot be.
    #[error("{file}: {field} is {value}: {reason}")]
    Field {
        /// The file's name.
        file: String,
        /// The field as its standard calls it.
        field: &'static str,
        /// The offending value.
        value: String,
        /// What it must be.
        reason: String,
        /// Where the field stands in the (unpacked) file, if it has one place.
        byte: Option<u64>,
    },
    /// The file ends before what its header promises.
    #[error("{file} is cut off or its header lies: {needed} bytes needed, at most {found} there")]
    Truncated {
        /// The file's name.
        file: String,
        /// Bytes (unpacked) up to the last voxel.
        needed: u64,
        /// Bytes (unpacked) that are there, or that the packed file could hold at best.
        found: u64,
    },
    /// The compressed stream is damaged.
    #[error("{file} is damaged after {byte} unpacked bytes: {reason}")]
    Corrupt {
        /// The file's name.
        file: String,
        /// Bytes unpacked so far.
        byte: u64,
        /// The decoder's words.
        reason: String,
    },
    /// More than this service is set to read.
    #[error("{file} has {asked} {what}, the limit is {limit}")]
    TooLarge {
        /// The file's name.
        file: String,
        /// What there is too much of.
        what: &'static str,
        /// How much the file asks for.
        asked: u64,
        /// The limit.
        limit: u64,
    },
    /// Several volumes in one file and no word which one.
    #[error("the file holds {frames} frames: say which one")]
    FrameNeeded {
        /// How many there are; valid are 0..frames.
        frames: usize,
    },
    /// A frame that is not there.
    #[error("frame {frame} is not among the file's {frames} frames (the first one is 0)")]
    FrameOutOfRange {
        /// What was asked for.
        frame: usize,
        /// How many there are.
        frames: usize,
    },
    /// A `.hdr` without its `.img`.
    #[error("{file} is a NIfTI header whose voxels stand in a second file, which is missing")]
    ImageMissing {
        /// The header's name.
        file: String,
    },
    /// Several files that do not make one volume.
    #[error("{count} files were given, and they are not a .hdr/.img pair")]
    NotOneVolume {
        /// How many.
        count: usize,
    },
    /// A voxel's value cannot be held.
    #[error("{file}: voxel ({}, {}, {}) is {value}, beyond the range of 32-bit floats", .voxel[0], .voxel[1], .voxel[2])]
    Overflow {
        /// The file's name.
        file: String,
        /// Its index (i, j, k).
        voxel: [usize; 3],
        /// The value with slope and intercept applied.
        value: f64,
    },
    /// Every voxel is NaN or infinite.
    #[error("{file}: none of its voxels is a finite number")]
    NoFiniteVoxel {
        /// The file's name.
        file: String,
    },
    /// Memory for the voxels could not be had.
    #[error("no memory for {bytes} bytes of voxels")]
    Memory {
        /// How much was asked for.
        bytes: u64,
    },
    /// The operating system could not read the file.
    #[error("{file} could not be read: {reason}")]
    Io {
        /// The file's name.
        file: String,
        /// The system's words.
        reason: String,
    },
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl VolumeError {
    /// The header field or request parameter that the error is about.
    pub fn field(&self) -> Option<&'static str> {
        match self {
            VolumeError::Field { field, .. } => Some(field),
            VolumeError::NotSlices { .. } => Some("Image Type (0008,0008)"),
            VolumeError::FrameNeeded { .. } | VolumeError::FrameOutOfRange { .. } => Some("frame"),
            _ => None,
        }
    }
}
