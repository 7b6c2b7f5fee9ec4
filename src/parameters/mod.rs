//! The parameters of a model and of a fit by the names that users give them.
//!
//! One table for each, [`SPECS`] and [`FIT_SPECS`], is the single source of names, types,
//! ranges, defaults and words for the command line, the query string, the JSON of a job and
//! the OpenAPI document. A value is read and checked here once; past this module
//! [`ModelParameters`] and [`FitParameters`] are right by construction.

mod fit;
mod fit_specs;
mod input;
mod model;
mod specs;
mod table;

pub use fit::{FitParameters, Place};
pub use fit_specs::FIT_SPECS;
pub use input::Input;
pub use model::ModelParameters;
pub use specs::SPECS;
pub use table::{Kind, ParameterSpec, Parameters};

/// A parameter that cannot be used, and what to do about it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {message}")]
pub struct ParameterError {
    /// The parameter's name as given.
    pub field: String,
    /// What is wrong with it.
    pub message: String,
    /// What would be right.
    pub fix: String,
}

/// The known name most like `name`, if any is like it at all.
pub fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    known
        .map(|k| (strsim::jaro_winkler(&name.to_lowercase(), k), k))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, k)| k)
}
