//! Surface models of the left ventricle (LV) from cardiac SPECT, and segmentations made with them.
//!
//! # A file to a model
//!
//! ```no_run
//! let scan = ventriform::open("scan.nii.gz")?;
//! let parameters = ventriform::ModelParameters::from_pairs([("points", "150")])?;
//! let model = ventriform::generate(&scan, &parameters)?;
//! let bytes = ventriform::encode(ventriform::Format::Glb, &model.mesh, &model.metadata())?;
//! std::fs::write("heart.glb", bytes)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`open`] takes NIfTI and DICOM files, folders and zip archives. Voxels in memory become a [`Scan`], too, here those
//! of a phantom; volumes from elsewhere are made with [`Volume::from_array`].
//!
//! ```
//! use ventriform::{ModelParameters, Monitor, PhantomParameters, Scan};
//!
//! let small = PhantomParameters { shape: [48; 3], spacing_mm: [4.5; 3], ..Default::default() };
//! let scan = Scan::try_from(ventriform::phantom(&small, &Monitor::silent())?.volume)?;
//!
//! let parameters = ModelParameters::from_pairs([("points", "100")])?;
//! let model = ventriform::generate(&scan, &parameters)?;
//! assert_eq!(model.mesh.vertices.len(), 100);
//! assert!(model.report.is_sound());
//! assert!(model.report.distance.mean_mm < 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # A patient to a mask
//!
//! [`segment`] finds the ventricle, fits the built-in hearts to it and keeps the best fit.
//!
//! ```
//! use ventriform::{FitParameters, Monitor, PhantomParameters, Scan};
//!
//! let small = PhantomParameters { shape: [48; 3], spacing_mm: [4.5; 3], ..Default::default() };
//! let volume = ventriform::phantom(&small, &Monitor::silent())?.volume;
//! let (shape, voxel_mm3) = (volume.shape, volume.frame.voxel_volume());
//!
//! let found = ventriform::segment(&Scan::try_from(volume)?, &FitParameters::default())?;
//! let mask = &found.segmentation.mask;
//! assert_eq!(mask.shape, shape);
//! let millilitres = mask.count() as f64 * voxel_mm3 / 1000.0;
//! assert!((80.0..400.0).contains(&millilitres));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Models of one's own, a reader's profile, normal limits, progress and cancelling: [`runs::segmentation::from_files`].
//!
//! # Two masks compared
//!
//! ```no_run
//! let (mask, expert) = (ventriform::open_mask("mask.nii.gz")?, ventriform::open_mask("expert.nii.gz")?);
//! let agreement = ventriform::measure(mask, expert)?;
//! println!("Jaccard {:.3}", agreement.jaccard);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`compare`] does it for masks in memory, and [`voxelise`] makes a mask of a closed mesh.
//!
//! # How it works
//!
//! ```text
//! volume ──> surface ──> retile ──> optimise ──> report ──> export
//! voxels     triangles   N points   flips, fit   figures    GLB, STL, JSON ...
//! ```
//!
//! A model is made in five steps: Marching Cubes extracts the wall of the ventricle as a closed
//! triangle surface; re-tiling covers that surface with exactly N evenly spread points and connects
//! them to triangles (after Turk, SIGGRAPH 1992); a least-squares fit and greedy edge flips raise a
//! four-term fitness; the result is measured and exported. A segmentation deforms a model to fit
//! another volume.
//!
//! All positions after [`image::volume`] are in one frame: millimetres in patient coordinates, LPS (x to the
//! patient's left, y to posterior, z to superior). See [`base::geometry::frame`].
//!
//! The modules are listed in the order in which a volume passes through them. The names that most
//! programs need are re-exported here.

pub mod base;

pub mod mesh;

pub mod image;

pub mod surface;

pub mod heart;

pub mod parameters;

pub mod results;

pub mod runs;

mod front;

pub use base::progress::Monitor;
pub use front::{Scan, generate, measure, open, open_mask, segment};
pub use heart::model::{Organ, Template};
pub use image::grid::agreement::{Agreement, compare};
pub use image::grid::voxelise::{Mask, voxelise};
pub use image::grid::{Affine, ArrayError, Volume};
pub use image::volume::{PhantomParameters, ReadLimits, VolumeFile, phantom};
pub use mesh::TriMesh;
pub use parameters::{FitParameters, ModelParameters, Parameters};
pub use results::export::{Format, Metadata, encode};
pub use runs::pipeline::Model;
pub use runs::segmentation::{
    NamedTemplate, Segmentation, SegmentationParameters, SegmentedVolume,
};

/// The examples of README.md, compiled as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
