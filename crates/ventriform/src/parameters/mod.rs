//! The parameters of a model, of a fit, of a beat, of comparisons, of normal limits and of a reconstruction, by the names
//! that users give them.
//!
//! Tables, [`MODEL_SPECS`], [`FIT_SPECS`], [`BEAT_SPECS`], [`COMPARISON_SPECS`], [`SERIAL_SPECS`],
//! [`NORMALS_SPECS`] and [`RECONSTRUCTION_SPECS`], define names, types, ranges, defaults and help texts for the command line, query strings,
//! the JSON of jobs and the OpenAPI document. Text or JSON goes in; [`ModelParameters`], [`FitParameters`] or
//! [`WithFit`] come out, with every value of the right type and in its range, or a [`ParameterError`] with the name of
//! the first invalid parameter.

mod beat;
mod calibration;
#[cfg(test)]
mod checks;
mod comparison;
mod fit;
mod fit_specs;
mod groups;
mod input;
mod kind;
mod model;
mod normals;
mod reading;
mod reconstruction;
mod resolution;
#[cfg(feature = "schema")]
mod schema;
mod serial;
mod specs;
mod table;
mod with_fit;

pub use beat::{BEAT_SPECS, BeatChoice, GatedParameters, RR_MS};
pub use calibration::{CalibrationChoice, CalibrationParameters};
pub use comparison::{COMPARISON_SPECS, ComparisonChoice, ComparisonParameters};
pub use fit::{FitParameters, KnownPosition, MASS_G, MaskGrid};
pub use fit_specs::FIT_SPECS;
pub use input::RawValue;
pub use kind::Kind;
pub use model::ModelParameters;
pub use normals::{CohortCase, NORMALS_SPECS, NormalsChoice, NormalsParameters};
pub use reading::{GREATEST_SCORE, READING_SPECS, ReadingParameters, SegmentScores, StudyQuality};
pub use reconstruction::RECONSTRUCTION_SPECS;
pub use resolution::{ResolutionChoice, ResolutionParameters};
#[cfg(feature = "schema")]
pub use schema::schema_of;
pub use serial::{SERIAL_SPECS, SerialChoice, SerialParameters};
pub use specs::MODEL_SPECS;
pub use table::{ParameterSpec, Parameters};
pub use with_fit::{BesideFit, WithFit};

/// An invalid parameter, and what to give instead.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {message}")]
pub struct ParameterError {
    /// The parameter's name as given.
    pub field: String,
    /// The problem.
    pub message: String,
    /// A sentence with the valid values.
    pub fix: String,
}

/// The known name most similar to `name`, if any is similar enough.
pub fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    known
        .map(|k| (strsim::jaro_winkler(&name.to_lowercase(), k), k))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, k)| k)
}
