//! Validating the parameters of a job, the same way for every kind of work.

use crate::base::records::Failure;
use crate::jobs::GivenParameters;
use serde_json::{Map, Value};
use ventriform::parameters::{BesideFit, ParameterError, Parameters, WithFit};
use ventriform::runs::advice::Explain;

/// Validates `given` as parameters of type `P` and writes every default out.
pub(super) fn check<P: Parameters>(
    given: GivenParameters<'_>,
) -> Result<Map<String, Value>, Failure> {
    let parameters = match given {
        GivenParameters::Text(pairs) => P::from_pairs(texts(pairs)),
        GivenParameters::Json(object) => P::from_json(object),
    };
    written_out(parameters, P::to_json)
}

/// As [`check`], of work that fits models on its way.
pub(super) fn check_with_fit<C: BesideFit>(
    given: GivenParameters<'_>,
) -> Result<Map<String, Value>, Failure> {
    let parameters = match given {
        GivenParameters::Text(pairs) => WithFit::<C>::from_pairs(texts(pairs)),
        GivenParameters::Json(object) => WithFit::from_json(object),
    };
    written_out(parameters, WithFit::to_json)
}

fn texts(pairs: &[(String, String)]) -> impl Iterator<Item = (&str, &str)> {
    pairs
        .iter()
        .map(|(name, text)| (name.as_str(), text.as_str()))
}

fn written_out<P>(
    parameters: Result<P, ParameterError>,
    to_json: impl Fn(&P) -> Map<String, Value>,
) -> Result<Map<String, Value>, Failure> {
    let parameters = parameters.map_err(|error| error.explain())?;
    Ok(to_json(&parameters))
}
