//! A reconstructed volume: voxels and the map that puts them into the patient.
//!
//! In go files as a scanner, a workstation or a colleague wrote them; out come voxel values as
//! `f32`, an invertible map from voxel indices to LPS millimetres, and the [`VolumeFacts`] that
//! tell a person what was understood of the file. The way of a file:
//!
//! 1. `source`: opened, unpacked where gzipped (several members too), every byte counted
//!    against the limits; `unpack` is the fast way for small files;
//! 2. `recognise`: told by its content, never by its name;
//! 3. [`nifti`] or `dicom`: header checked field by field;
//! 4. `decode`: the voxels, in portions, straight into their final place;
//! 5. `summary`: what values there are, and whether they look like labels.
//!
//! Guaranteed: a file gives the values and positions that its standard assigns to them, or an
//! error naming field and value. No size that a file states is believed before the file has
//! shown that it can hold it; memory beyond the voxels themselves stays under a mebibyte, except
//! for gzipped files of at most 16 MiB (packed and unpacked), which are held whole.
//! Not guaranteed: that the file's own statement about the patient is true. Contradictions
//! inside a file are told as warnings.
//!
//! [`mod@phantom`] makes volumes of known truth, [`nifti::write()`] puts volumes into files, and
//! [`mod@preview`] draws them.
//!
//! ```
//! use ventriform::progress::Monitor;
//! use ventriform::volume::nifti::{self, StoredType};
//! use ventriform::volume::{self, PhantomParameters, ReadLimits, ReadOptions, VolumeFile};
//!
//! let quiet = Monitor::silent();
//! let small = PhantomParameters { shape: [48; 3], spacing_mm: [4.5; 3], ..Default::default() };
//! let made = volume::phantom(&small, &quiet)?;
//! let bytes = nifti::write(&made.volume, StoredType::Float32, true)?;
//!
//! let file = VolumeFile::in_memory("lv.nii.gz", bytes);
//! let reading = volume::read(&[file], &ReadOptions::default(), &ReadLimits::default(), &quiet)?;
//! assert_eq!(reading.volume.voxels, made.volume.voxels);
//! assert!(reading.facts.warnings.is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod decode;
mod dicom;
pub mod error;
pub mod facts;
pub mod nifti;
pub mod phantom;
pub mod preview;
mod read;
mod recognise;
mod source;
mod summary;
mod unpack;

pub use crate::grid::Volume;
pub use error::VolumeError;
pub use facts::{
    AffineSource, ByteOrder, Format, IntensitySummary, LabelCount, LengthUnit, VolumeFacts,
};
pub use phantom::{Phantom, PhantomParameters, phantom};
pub use preview::{GrayImage, preview, preview_png};
pub use read::{ReadLimits, ReadOptions, Reading, inspect, read};
pub use source::VolumeFile;
pub use summary::summarise;
