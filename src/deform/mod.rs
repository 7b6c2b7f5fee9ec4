//! Fits a model to a patient.

pub mod cup;
pub mod field;
pub mod localise;
