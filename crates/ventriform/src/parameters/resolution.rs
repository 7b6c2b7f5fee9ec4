//! The parameters with which the resolution of a protocol is learnt: those of the fits that it has a use for.

use super::with_fit::{BesideFit, WithFit};
use super::{ParameterError, ParameterSpec, Parameters};

/// A resolution has no parameters beside those of the fits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ResolutionChoice;

impl Parameters for ResolutionChoice {
    type Draft = Self;

    const PARAMETER_SPECS: &'static [ParameterSpec<Self>] = &[];

    fn finish(choice: Self) -> Result<Self, ParameterError> {
        Ok(choice)
    }
}

const NO_EXPERT: &str = "no mask is compared";
const NO_LIMITS: &str = "no scan is compared with normal limits";
const EACH_SCAN: &str = "the heart lies elsewhere in each scan";

impl BesideFit for ResolutionChoice {
    const WORK_NOUN: &'static str = "the resolution of a protocol";
    const WITHOUT_USE: &'static [(&'static str, &'static str)] = &[
        ("model", "the built-in hearts are fitted"),
        ("kept_model", "the built-in hearts are fitted"),
        ("expert", NO_EXPERT),
        ("label", NO_EXPERT),
        ("resample", NO_EXPERT),
        ("mesh_unit", NO_EXPERT),
        ("mesh_frame", NO_EXPERT),
        ("reader", "no reader's wall is drawn"),
        ("resolution", "it is what is found"),
        ("normals", NO_LIMITS),
        ("sex", NO_LIMITS),
        ("protocol", NO_LIMITS),
        ("tracer", NO_LIMITS),
        ("attenuation_corrected", NO_LIMITS),
        ("organ", "only left ventricles have walls"),
        ("mask_grid", "no mask is written"),
        ("center", EACH_SCAN),
        ("seed_point", EACH_SCAN),
        ("box", EACH_SCAN),
        ("axis", EACH_SCAN),
        ("segments_from", EACH_SCAN),
    ];
}

/// Everything that determines a resolution, apart from the scans.
pub type ResolutionParameters = WithFit<ResolutionChoice>;

#[cfg(test)]
mod tests {
    use super::super::checks;
    use super::*;

    #[test]
    fn what_a_resolution_has_no_use_for_is_refused_and_not_written() {
        checks::refuses_what_it_has_no_use_for::<ResolutionChoice>();
    }
}
