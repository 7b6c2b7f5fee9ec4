//! Reads volumes from NIfTI and DICOM files, reconstructed ones or projections, and makes phantoms.
//!
//! In: files as a scanner, a workstation or a user wrote them. Out: voxel values as `f32`, an
//! invertible map from voxel indices to LPS millimetres, and the [`VolumeFacts`] that let a person
//! check what was read. The steps:
//!
//! 1. `source`: opens the file and unpacks gzip (also several members), counting every byte against
//!    the limits; `unpack` is a faster way for small files.
//! 2. `archive`, `folder` and `recognise`: finds the files in a zip archive or a folder, and determines
//!    the format by the content. A name only tells which `.img` belongs to a `.hdr` among many files.
//!    `foreign`: formats that are not read are named, with how to convert them.
//! 3. [`nifti`] or `dicom`: checks the header field by field.
//! 4. `decode`: decodes the voxels in portions directly into the result; of projections,
//!    [`reconstruct`](crate::image::reconstruct) makes them. `reconstructed`: as the caller says.
//! 5. `summary`: figures over the values, and whether they look like labels.
//!
//! Guaranteed: a file gives the values and positions that its standard assigns to them, or an error
//! with the name and value of the invalid field. Before memory is taken for a stated size, the file
//! must be large enough to hold it. Memory beyond the voxels stays under one mebibyte (two where volumes are taken for
//! gates), except for gzipped files of at most 16 MiB (packed and unpacked), which are held in memory whole.
//!
//! Not guaranteed: that the file's statements about the patient are true. Contradictions inside a
//! file appear as warnings.
//!
//! `array_file` reads volumes that are in memory already.
//!
//! `gate_files` reads files of one gate each as the gates of one study. `gate_look` tells whether volumes that are
//! taken for gates look like those of one beat, and which are none; `judged_gates` is the file without these.
//!
//! `surface_file` reads a closed surface (STL, PLY, OBJ, VTK, VTP, glTF) as the voxels inside it.
//!
//! [`given_mask`] reads masks: one structure of a label map, a segmentation or a binary volume.
//!
//! [`mod@phantom`] makes volumes with known ground truth, [`nifti::write()`] writes volumes to files,
//! and [`mod@preview`] draws them.
//!
//! ```
//! use ventriform::base::progress::Monitor;
//! use ventriform::image::volume::nifti::{self, StoredType};
//! use ventriform::image::volume::{self, PhantomParameters, ReadLimits, ReadOptions, VolumeFile};
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

mod archive;
mod array_file;
mod beat_evidence;
mod decode;
pub mod dicom;
pub mod error;
pub mod facts;
mod folder;
mod foreign;
mod gate_files;
mod gate_look;
mod gate_names;
mod gate_timing;
pub mod gates;
pub mod given_mask;
mod judged_gates;
mod left_out;
mod limits;
pub mod nifti;
mod open;
pub mod phantom;
pub mod preview;
mod provenance;
mod read;
mod recognise;
mod reconstructed;
mod segment;
mod source;
mod summary;
mod surface_file;
mod unpack;
mod values;

pub use crate::image::grid::Volume;
pub use error::VolumeError;
pub use facts::{
    AffineSource, ByteOrder, FileFormat, GateFacts, IntensitySummary, LabelCount, LengthUnit,
    VolumeFacts,
};
pub use gate_files::order_by_numbers;
pub use gate_names::{NamesSay, said_by_names};
pub use gate_timing::{GateTiming, RR_MS};
pub use gates::GatedReading;
pub use limits::{FromProjections, ReadLimits, ReadOptions};
pub use open::{Reading, describe};
pub use phantom::{Phantom, PhantomParameters, phantom};
pub use preview::{preview, preview_png};
pub use provenance::Provenance;
pub use read::{
    HeldGates, hold_gates, hold_same_voxels, inspect, labels_are_rounded, preview_files,
    provenance, read, read_gates, read_gates_with, read_segment, read_with, segments, surface,
    voxels_of_label,
};
pub use reconstructed::{Reconstructed, projections, reconstructed};
pub use segment::{Segment, SegmentCode};
pub use source::VolumeFile;
pub use summary::summarise;
pub use ventriform_dicom::values::{is_date, is_uid};
