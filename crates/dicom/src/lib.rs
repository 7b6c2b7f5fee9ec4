//! DICOM data sets read within bounds, their text and compressed pixels decoded, and objects written.
//!
//! In: the bytes of one file at a time. Out: the attributes that a reader of images needs ([`read`]), text
//! ([`characters`]) and stored numbers ([`codec`]); the other way round, objects ([`mod@write`]), and structured reports
//! among them as trees ([`report`]).
//!
//! A file may hold anything: whatever lengths, depths and sizes it states, memory and time stay bounded, and damage is
//! an error. The pass over a data set is that of dicom-rs; characters are decoded with the tables of `encoding_rs`, and
//! JPEG 2000 by `hayro-jpeg2000`.
//!
//! Not here: what the pixels show. Their place in the patient, which files make one volume, and what is measured in it
//! are left to the caller.

pub mod characters;
pub mod codec;
pub mod read;
pub mod report;
pub mod text;
pub mod values;
pub mod write;

pub use dicom_core::{PrimitiveValue, Tag, VR};
pub use dicom_dictionary_std::{tags, uids};
pub use dicom_encoding::transfer_syntax::Endianness;

/// The examples of README.md, compiled as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
