//! Simulated cardiac perfusion SPECT with a known truth.
//!
//! In: a kind of case and a seed. Out: a folder with images, masks and `params.json`, which states everything that was
//! drawn and what follows from it.
//!
//! ```text
//! kinds ──> parameters ──> anatomy ──> camera ──> reconstruct ──> case, study
//! a seed    numbers        uptake,     counts     images          files
//!                          attenuation
//! ```
//!
//! 1. A kind of case states some numbers and draws the others ([`draw`], [`kinds`]).
//! 2. The ventricle is a shape with a thickness of its own at every point; it beats with the volume of its muscle kept
//!    ([`anatomy::ventricle`]). It and the trunk are put on a grid of half the voxels' size, blurred by breathing
//!    ([`anatomy::heart`], [`anatomy::torso`]).
//! 3. A camera turns around: attenuation, resolution by distance, scatter, motion, Poisson counts ([`camera`]).
//! 4. Images are reconstructed as departments do ([`reconstruct`]).
//! 5. Truth is computed from the anatomy, not from images ([`truth`], [`reader`]).
//!
//! Guaranteed: the same seed gives the same bytes on any number of threads; each purpose has its own stream of random
//! numbers ([`random`]). Not modelled: beats of different length within a gate, a tilting mitral plane, papillary
//! muscles that move by themselves, gut that moves with the beat, a delay of the right ventricle, motion between gates,
//! scatter by the place where it happens.

pub mod anatomy;
pub mod camera;
pub mod case;
pub mod curve;
pub mod cut;
pub mod draw;
pub mod fft;
pub mod files;
pub mod gated;
pub mod grid;
pub mod healthy;
pub mod kinds;
pub mod pairs;
pub mod parameters;
pub mod random;
pub mod reader;
pub mod reconstruct;
pub mod scan;
pub mod serial;
pub mod study;
pub mod truth;
pub mod variants;
pub mod walls;

#[cfg(test)]
mod tests;
