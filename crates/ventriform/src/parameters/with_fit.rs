//! The parameters of work that fits models on its way: its own, and those of the fit that it has a use for.

use super::input::RawValue;
use super::table::{from_inputs, unknown};
use super::{FIT_SPECS, FitParameters, ParameterError, ParameterSpec, Parameters};
use serde_json::{Map, Value};

/// Parameters of work beside those of its fits.
pub trait BesideFit: Parameters + Default {
    /// The work, with its article.
    const WORK_NOUN: &'static str;
    /// Parameters of a fit that the work has no use for, and why.
    const WITHOUT_USE: &'static [(&'static str, &'static str)];
}

/// Everything that determines work, apart from the files.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WithFit<C> {
    /// The parameters of the fits.
    pub fit: FitParameters,
    /// The work's own.
    pub choice: C,
}

impl<C: BesideFit> WithFit<C> {
    /// The rows of the parameters of a fit that the work takes.
    pub fn fit_specs() -> impl Iterator<Item = &'static ParameterSpec<FitParameters>> {
        FIT_SPECS
            .iter()
            .filter(|spec| why_unused::<C>(spec.name).is_none())
    }

    /// Reads parameters given as text, from a query string or a command line.
    ///
    /// # Errors
    /// As [`Parameters::from_pairs`]; also for parameters of a fit that the work has no use for.
    pub fn from_pairs<'a>(
        pairs: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> Result<Self, ParameterError> {
        let pairs = pairs.into_iter();
        Self::from_each(pairs.map(|(name, text)| (name, RawValue::Text(text))))
    }

    /// Reads parameters given as a JSON object. Types are strict: `"130"` is not a number.
    ///
    /// # Errors
    /// As [`WithFit::from_pairs`].
    pub fn from_json(object: &Map<String, Value>) -> Result<Self, ParameterError> {
        let fields = object.iter();
        Self::from_each(fields.map(|(name, value)| (name.as_str(), RawValue::Json(value))))
    }

    /// Every parameter that is set, by name, including defaults. [`WithFit::from_json`] reads it back.
    pub fn to_json(&self) -> Map<String, Value> {
        let mut all = self.fit.to_json();
        all.retain(|name, _| why_unused::<C>(name).is_none());
        all.extend(self.choice.to_json());
        all
    }

    fn from_each<'a>(
        given: impl Iterator<Item = (&'a str, RawValue<'a>)>,
    ) -> Result<Self, ParameterError> {
        let (mut own, mut of_fit) = (Vec::new(), Vec::new());
        for (name, value) in given {
            if C::PARAMETER_SPECS.iter().any(|spec| spec.name == name) {
                own.push((name, value));
                continue;
            }
            if let Some(why) = why_unused::<C>(name) {
                return Err(ParameterError {
                    field: name.into(),
                    message: format!("{} has no use for it: {why}", C::WORK_NOUN),
                    fix: "Leave it out.".into(),
                });
            }
            let aliases = || FitParameters::NAME_ALIASES.iter().map(|(other, _)| *other);
            let mut known = Self::fit_specs().map(|spec| spec.name);
            if !known.any(|known| known == name) && !aliases().any(|alias| alias == name) {
                let names = Self::fit_specs().map(|spec| spec.name);
                let names = names.chain(C::PARAMETER_SPECS.iter().map(|spec| spec.name));
                return Err(unknown(name, &names.collect::<Vec<_>>(), aliases()));
            }
            of_fit.push((name, value));
        }
        Ok(Self {
            fit: from_inputs(of_fit.into_iter())?,
            choice: from_inputs(own.into_iter())?,
        })
    }
}

fn why_unused<C: BesideFit>(name: &str) -> Option<&'static str> {
    let unused = C::WITHOUT_USE.iter().find(|(unused, _)| *unused == name);
    unused.map(|(_, why)| *why)
}
