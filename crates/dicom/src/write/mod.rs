//! Objects, written.
//!
//! In: values by attribute. Out: the bytes of a file, Explicit VR Little Endian.
//!
//! 1. [`data_set`]: elements and sequences, encoded as the dictionary says.
//! 2. [`code`]: coded concepts; [`content`]: the items of a structured report's tree.
//! 3. [`image`], [`segmentation`] and [`surface`]: what is long in those objects.
//! 4. [`uid`]: identifiers that follow from what they identify.
//!
//! Guaranteed: the same elements give the same bytes. Not checked: whether an object has every attribute that its
//! class requires.

pub mod code;
pub mod content;
pub mod data_set;
pub mod image;
pub mod segmentation;
pub mod surface;
pub mod uid;

pub use data_set::EncodingError;
