//! The parameters with which a reader's profile is learnt: those of the fits that it has a use for.

use super::with_fit::{BesideFit, WithFit};
use super::{ParameterError, ParameterSpec, Parameters};

/// A profile has no parameters beside those of the fits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CalibrationChoice;

impl Parameters for CalibrationChoice {
    type Draft = Self;

    const PARAMETER_SPECS: &'static [ParameterSpec<Self>] = &[];

    fn finish(choice: Self) -> Result<Self, ParameterError> {
        Ok(choice)
    }
}

const NO_LIMITS: &str = "no scan is compared with normal limits";

impl BesideFit for CalibrationChoice {
    const WORK_NOUN: &'static str = "a profile";
    const WITHOUT_USE: &'static [(&'static str, &'static str)] = &[
        ("model", "the built-in hearts are fitted"),
        ("expert", "the reader's masks are in the cohort"),
        ("reader", "it is what is learnt"),
        ("normals", NO_LIMITS),
        ("sex", NO_LIMITS),
        ("protocol", NO_LIMITS),
        ("tracer", NO_LIMITS),
        ("attenuation_corrected", NO_LIMITS),
    ];
}

/// Everything that determines a profile, apart from the files.
pub type CalibrationParameters = WithFit<CalibrationChoice>;

#[cfg(test)]
mod tests {
    use super::super::checks;
    use super::*;

    #[test]
    fn what_a_profile_has_no_use_for_is_refused_and_not_written() {
        checks::refuses_what_it_has_no_use_for::<CalibrationChoice>();
    }
}
