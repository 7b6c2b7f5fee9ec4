//! Data sets, read in one pass.
//!
//! In: the [`bytes`] of a file. Out: the [`attributes`] that a reader of images needs, and where the pixels are.
//!
//! 1. [`syntax`]: finds the data set, its encoding and the compression of its pixels.
//! 2. [`scan`]: one pass over the data set collects the attributes and finds the pixels. It follows at most 32 nested
//!    sequences and rejects lengths beyond the size of the file. Elements that a program wrote without knowing them,
//!    and values in another [`representation`] than the standard's are read, too.
//! 3. [`kind`]: what the object is.
//! 4. [`frames`]: the order of the frames of a Nuclear Medicine Image by its vectors; [`views`]: the same of
//!    projections; [`real_world`]: how stored numbers become values; [`fragments`]: which pieces of compressed pixels
//!    make a frame; [`volumes`]: which frames at one place belong to one volume.
//!
//! Guaranteed: no memory is taken for a stated length before the file was found long enough for it; at most 16 MiB of
//! values are held. Where the parser panics, the file is damaged.

pub mod attributes;
pub mod bytes;
mod error;
pub mod fragments;
pub mod frames;
pub mod kind;
pub mod real_world;
pub mod representation;
pub mod scan;
pub mod syntax;
mod unknown;
pub mod views;
pub mod volumes;

#[cfg(test)]
mod tests;

pub use error::ReadError;
