//! A gated study from beginning to end: files in, the beat's report and files out.
//!
//! 1. [`GatedOrder`]: the files, the models for the gates' sum, and the parameters.
//! 2. [`from_files`](mod@from_files) reads the gates ([`crate::image::volume::read_gates`]), checks and scales them
//!    ([`GatedStudy`](crate::heart::beat::GatedStudy)), segments their sum as
//!    [`segmentation`](mod@crate::runs::segmentation) does, and fits one wall to all gates ([`crate::heart::beat`]).
//! 3. [`GatedHeart::report`] is the report; [`GatedHeart::files`] are the files written,
//!    [`GatedHeart::page`] a page of them for people.

mod error;
mod files;
mod from_files;
mod names;
mod order;
mod pictures;

pub use error::GatedError;
pub(crate) use from_files::{FittedSum, fitted_sum};
pub use from_files::{GatedHeart, beat_figures, from_files};
pub use names::{FILE_NAMES, GATE_FILE_PATTERN, end_mesh, gate_labels, is_gate_mesh};
pub use order::GatedOrder;
