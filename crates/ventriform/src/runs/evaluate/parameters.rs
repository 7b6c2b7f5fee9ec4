//! Parameters of an evaluation.

use super::cohort::Cohort;
use super::error::EvaluateError;
use super::rows::Variant;
use super::sample::Sample;
use crate::heart::deform::DeformParameters;
use crate::heart::deform::elastic::SupportScaling;
use crate::parameters::{ModelParameters, ParameterError};

/// Parameters of [`evaluate`](super::evaluate).
#[derive(Debug, Clone, PartialEq)]
pub struct EvaluationParameters {
    /// Numbers of points of our models. Order and repetitions do not matter.
    pub points: Vec<usize>,
    /// Numbers of points of the reference model. Order and repetitions do not matter.
    pub reference_points: Vec<usize>,
    /// The variants of models to fit.
    pub variants: Vec<Variant>,
    /// The method that makes our models: a value of the model parameter `method`.
    pub method: String,
    /// Parameters of the fits.
    pub deform: DeformParameters,
    /// Cases that had a part in choosing the program's constants.
    pub in_sample: InSample,
    /// Whether to choose model, number of points and reader's profile for each case without it.
    pub leave_one_out: bool,
}

/// Cases that had a part in choosing the program's constants.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum InSample {
    /// All cases.
    All,
    /// Those of these names.
    Named(Vec<String>),
}

impl InSample {
    /// The label of figures of that case.
    pub fn sample(&self, case: &str) -> Sample {
        match self {
            InSample::Named(names) if !names.iter().any(|name| name == case) => Sample::HeldOut,
            _ => Sample::InSample,
        }
    }
}

impl EvaluationParameters {
    /// Checks everything that does not depend on the number of points.
    ///
    /// # Errors
    /// [`EvaluateError::ModelParameter`] for an unknown method, [`EvaluateError::FitParameter`]
    /// for a number out of range.
    pub fn validate(&self) -> Result<(), EvaluateError> {
        self.model_parameters(None)
            .map_err(EvaluateError::ModelParameter)?;
        self.deform.validate().map_err(EvaluateError::FitParameter)
    }

    /// The parameters of our model with that many points, or with the default number.
    ///
    /// # Errors
    /// [`ParameterError`] for an unknown method or a number of points out of range.
    pub fn model_parameters(
        &self,
        points: Option<usize>,
    ) -> Result<ModelParameters, ParameterError> {
        let mut pairs = vec![("method", self.method.clone())];
        pairs.extend(points.map(|n| ("points", n.to_string())));
        ModelParameters::from_pairs(pairs.iter().map(|(name, text)| (*name, text.as_str())))
    }

    /// The run's parameters by name, for the page of the results.
    pub(super) fn settings(&self, cohort: &Cohort) -> Vec<(String, String)> {
        let list = |numbers: &[usize]| {
            let texts: Vec<String> = ascending(numbers).iter().map(usize::to_string).collect();
            texts.join(", ")
        };
        let mut settings = vec![
            ("patients".to_owned(), cohort.patients.join(", ")),
            ("points".to_owned(), list(&self.points)),
            (
                "reference model".to_owned(),
                format!(
                    "Marching Cubes thinned out by quadric error (Garland and Heckbert 1997) to {} \
                     points: our stand-in for the paper's, which is not public",
                    list(&self.reference_points)
                ),
            ),
            ("method".to_owned(), self.method.clone()),
            (
                "program".to_owned(),
                format!("ventriform {}", env!("CARGO_PKG_VERSION")),
            ),
        ];
        let seen = match &self.in_sample {
            InSample::All => "all".to_owned(),
            InSample::Named(names) if names.is_empty() => "none".to_owned(),
            InSample::Named(names) => names.join(", "),
        };
        settings.push((
            "cases that the program's constants were chosen on (in-sample)".to_owned(),
            seen,
        ));
        if !self.deform.align {
            settings.push(("alignment as a whole".to_owned(), "left out".to_owned()));
        }
        let stiffness = &self.deform.stiffness;
        if stiffness.support > 0.0 {
            let scaling = match stiffness.support_scaling {
                SupportScaling::Fixed => "the same for every N",
                SupportScaling::PerNode => "scaled by 150/N",
            };
            let (k, radius) = (stiffness.support, stiffness.support_radius);
            settings.push((
                "support springs".to_owned(),
                format!("k = {k} up to {radius} mm, {scaling}"),
            ));
        }
        settings
    }
}

/// The numbers, each once, in ascending order.
pub fn ascending(numbers: &[usize]) -> Vec<usize> {
    let mut numbers = numbers.to_vec();
    numbers.sort_unstable();
    numbers.dedup();
    numbers
}
