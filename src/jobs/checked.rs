//! Parameters as they come with a request, checked and with every default written out: the same
//! for every kind of work.

use super::{Failure, Fault};
use crate::parameters::{ParameterError, Parameters};
use serde_json::{Map, Value};

/// Parameters given as text.
pub(super) fn from_text<P: Parameters>(
    pairs: &[(String, String)],
) -> Result<Map<String, Value>, Failure> {
    let pairs = pairs
        .iter()
        .map(|(name, text)| (name.as_str(), text.as_str()));
    Ok(P::from_pairs(pairs).map_err(unusable)?.to_json())
}

/// Parameters given as JSON.
pub(super) fn from_json<P: Parameters>(
    object: &Map<String, Value>,
) -> Result<Map<String, Value>, Failure> {
    Ok(P::from_json(object).map_err(unusable)?.to_json())
}

/// A parameter that cannot be used, for whoever gave it.
pub(super) fn unusable(error: ParameterError) -> Failure {
    Failure::new(
        Fault::Request,
        "invalid-parameter",
        format!("`{}`: {}.", error.field, error.message),
    )
    .at(error.field)
    .fix(error.fix)
}
