//! Validating the parameters of a job, the same way for every kind of work.

use super::problems::Explain;
use crate::jobs::GivenParameters;
use crate::records::Failure;
use serde_json::{Map, Value};
use ventriform::parameters::Parameters;

/// Validates `given` as parameters of type `P` and writes every default out.
pub(super) fn check<P: Parameters>(
    given: GivenParameters<'_>,
) -> Result<Map<String, Value>, Failure> {
    let parameters = match given {
        GivenParameters::Text(pairs) => P::from_pairs(
            pairs
                .iter()
                .map(|(name, text)| (name.as_str(), text.as_str())),
        ),
        GivenParameters::Json(object) => P::from_json(object),
    };
    Ok(parameters.map_err(|error| error.explain())?.to_json())
}
