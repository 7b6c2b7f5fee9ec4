//! Surface models of the left ventricle (LV) from cardiac SPECT, and segmentations made with them.
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
//! All positions after [`volume`] are in one frame: millimetres in patient coordinates, LPS (x to the
//! patient's left, y to posterior, z to superior). See [`geometry::frame`].
//!
//! The modules are listed in the order in which a volume passes through them. The names that most
//! programs need are re-exported here.
//!
//! # Generate a model
//!
//! [`generate`] reads files; [`generate_from`] takes a [`Volume`], here a phantom. Volumes from
//! elsewhere are made with [`Volume::from_array`].
//!
//! ```
//! use ventriform::{Format, ModelParameters, Monitor, PhantomParameters};
//!
//! let quiet = Monitor::silent();
//! let small = PhantomParameters { shape: [48; 3], spacing_mm: [4.5; 3], ..Default::default() };
//! let scan = ventriform::phantom(&small, &quiet)?.volume;
//!
//! let parameters = ModelParameters::from_pairs([("points", "100")])?;
//! let model = ventriform::generate_from(&scan, &parameters, &quiet)?;
//! assert_eq!(model.mesh.vertices.len(), 100);
//! assert!(model.report.is_sound());
//!
//! let stl = ventriform::encode(Format::Stl, &model.mesh, &model.metadata())?;
//! assert_eq!(stl.len(), 84 + 50 * model.mesh.triangles.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Segment a volume
//!
//! [`segment`] finds the ventricle, deforms each template to fit it and keeps the best fit.
//!
//! ```
//! use ventriform::{ModelParameters, Monitor, NamedTemplate, Organ, PhantomParameters, Template};
//!
//! let quiet = Monitor::silent();
//! let patient = |seed| {
//!     let small = PhantomParameters {
//!         shape: [48; 3],
//!         spacing_mm: [4.5; 3],
//!         seed,
//!         ..Default::default()
//!     };
//!     ventriform::phantom(&small, &quiet)
//! };
//! let parameters = ModelParameters::from_pairs([("points", "100")])?;
//! let model = ventriform::generate_from(&patient(1)?.volume, &parameters, &quiet)?;
//! let templates = [NamedTemplate {
//!     name: "first patient".into(),
//!     template: Template::new(model.mesh, Organ::LeftVentricle, &quiet)?,
//!     built_in: false,
//! }];
//!
//! let scan = patient(2)?.volume;
//! let found = ventriform::segment(&scan, &templates, &Default::default(), None, &quiet)?;
//! assert_eq!(found.mask.shape, scan.shape);
//! let millilitres = found.mask.count() as f64 * scan.frame.voxel_volume() / 1000.0;
//! assert!((80.0..400.0).contains(&millilitres));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Measure
//!
//! A model comes with its figures in [`Model::report`]. [`compare`] measures the agreement of two
//! masks, and [`voxelise`] makes a mask of a closed mesh.
//!
//! ```
//! use ventriform::{Mask, ModelParameters, Monitor, PhantomParameters};
//!
//! let quiet = Monitor::silent();
//! let small = PhantomParameters { shape: [48; 3], spacing_mm: [4.5; 3], ..Default::default() };
//! let made = ventriform::phantom(&small, &quiet)?;
//! let parameters = ModelParameters::from_pairs([("points", "100")])?;
//! let model = ventriform::generate_from(&made.volume, &parameters, &quiet)?;
//! assert!(model.report.distance.mean_mm < 1.0);
//!
//! let frame = &made.truth.frame;
//! let wall = Mask {
//!     shape: made.truth.shape,
//!     voxels: made.truth.voxels.iter().map(|v| *v > 0.5).collect(),
//! };
//! let inside = ventriform::voxelise(&model.mesh, wall.shape, frame);
//! let agreement = ventriform::compare(&inside, &wall, frame.spacing(), &quiet)?;
//! assert!(agreement.dice > 0.6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod text;

pub mod geometry;

pub mod numeric;

pub mod mesh;
pub mod mesh_files;

pub mod progress;

pub mod grid;

pub mod draw;

pub mod volume;

pub mod locate;

pub mod surface;

pub mod retile;

pub mod optimise;

pub mod decimate;

pub mod model;

pub mod deform;

pub mod judge;

pub mod fit;

pub mod polar;

pub mod beat;

pub mod normals;

pub mod comparison;

pub mod reader;

pub mod parameters;

pub mod report;

pub mod export;

pub mod pipeline;

pub mod segmentation;

pub mod gated;

pub mod rest_stress;

pub mod evaluate;

pub use export::{Format, Metadata, encode};
pub use grid::agreement::{Agreement, compare};
pub use grid::voxelise::{Mask, voxelise};
pub use grid::{Affine, ArrayError, Volume};
pub use mesh::TriMesh;
pub use model::{Organ, Template};
pub use parameters::{FitParameters, ModelParameters};
pub use pipeline::{Model, generate, generate_from};
pub use progress::Monitor;
pub use segmentation::{NamedTemplate, Segmentation, SegmentationParameters, segment};
pub use volume::{PhantomParameters, ReadLimits, VolumeFile, phantom};
