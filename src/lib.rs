//! Ventriform makes surface models of the left ventricle (LV) from cardiac SPECT.
//!
//! ```text
//! volume ──> surface ──> retile ──> optimise ──> report ──> export
//! voxels     triangles   N points   flips, fit   figures    GLB, STL, JSON ...
//! ```
//!
//! A reconstructed volume goes in; Marching Cubes turns the ventricle's wall into a closed
//! triangle surface; re-tiling covers that surface with exactly N evenly spread points and
//! joins them to triangles (after Turk, SIGGRAPH 1992); greedy edge flips raise a four-term
//! fitness; the result is measured and written out. [`pipeline::generate`] is that sentence
//! as code. `jobs`, `store` and `http` serve it; nothing above them knows that they exist.
//!
//! Everything after [`volume`] lives in one frame: millimetres, patient coordinates, LPS
//! (x to the patient's left, y to posterior, z to superior). See [`geometry::frame`].
//!
//! The modules stand in the order in which a volume meets them.

pub mod geometry;
pub mod mesh;
pub mod numeric;
pub mod progress;

pub mod grid;

pub mod volume;

pub mod locate;

pub mod surface;

pub mod retile;

pub mod optimise;

pub mod decimate;

pub mod model;

pub mod deform;

pub mod polar;

pub mod report;

pub mod export;

pub mod parameters;
pub mod pipeline;

pub mod segmentation;

pub mod evaluate;

#[cfg(feature = "service")]
pub mod jobs;

#[cfg(feature = "service")]
pub mod work;

#[cfg(feature = "service")]
pub mod store;

#[cfg(feature = "service")]
pub mod config;

#[cfg(feature = "service")]
pub mod http;

#[cfg(feature = "service")]
pub mod cli;
