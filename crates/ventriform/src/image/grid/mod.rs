//! Values on a regular grid with its place in the patient.
//!
//! - [`volume`]: voxels and the map from voxel indices to LPS millimetres;
//! - [`survey`]: range, missing values, and whether a volume is a label map;
//! - [`blocks`]: means over blocks of voxels, a volume at low resolution;
//! - [`mod@blur`]: separable Gaussian blur;
//! - [`field`]: a blurred volume as a smooth function of position;
//! - [`size`]: whether the field is that of a scan of a chest;
//! - [`smoothness`], [`noise_length`]: the lengths over which an image's values and its noise change;
//! - [`labels`], [`components`]: sets of voxels, their topology and connected parts;
//! - [`voxelise`]: from a closed mesh to the mask of the voxels inside it;
//! - [`gates`]: how many volumes, and how alike in place, are the gates of one study;
//! - [`agreement`]: how well two masks agree (Jaccard, contour distance, Dice, Hausdorff).

pub mod agreement;
pub mod blocks;
pub mod blur;
pub mod components;
pub mod field;
pub mod gates;
pub mod labels;
pub mod noise_length;
pub mod size;
pub mod smoothness;
pub mod survey;
pub mod volume;
pub mod voxelise;

pub use volume::{Affine, ArrayError, Volume};
