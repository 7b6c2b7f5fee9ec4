//! The parameters of normal limits that are built: their own, and those of the fits to the scans.

use super::with_fit::{BesideFit, WithFit};
use super::{Kind, ParameterError, ParameterSpec, Parameters, groups};
use crate::heart::normals::Sex;
use serde::{Deserialize, Serialize};
use serde_json::json;

/// The parameters of normal limits beside those of the fits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct NormalsChoice {
    /// Whether men and women are one group. Default `false`.
    pub mixed: bool,
}

impl Parameters for NormalsChoice {
    type Draft = Self;

    const PARAMETER_SPECS: &'static [ParameterSpec<Self>] = NORMALS_SPECS;

    fn finish(choice: Self) -> Result<Self, ParameterError> {
        Ok(choice)
    }
}

/// Every parameter that only normal limits have.
pub const NORMALS_SPECS: &[ParameterSpec<NormalsChoice>] = &[ParameterSpec {
    name: "mixed",
    title: "",
    group: groups::MAIN,
    unit: "",
    kind: Kind::Switch,
    default: "false",
    summary: "Whether men and women are one group, where there are too few of each",
    read: |d, v| {
        d.mixed = v.switch();
        Ok(())
    },
    write: |p| json!(p.mixed),
}];

const NO_EXPERT: &str = "limits are compared with no expert's mask";
const EACH_SCAN: &str = "the heart lies elsewhere in each scan";
const STATED_BY_TABLE: &str = "the cohort's table states it for each scan";

impl BesideFit for NormalsChoice {
    const WORK_NOUN: &'static str = "normal limits";
    const WITHOUT_USE: &'static [(&'static str, &'static str)] = &[
        ("model", "the built-in hearts are fitted"),
        ("kept_model", "the built-in hearts are fitted"),
        ("frame", "the gates of a scan are added up"),
        ("expert", NO_EXPERT),
        ("label", NO_EXPERT),
        ("resample", NO_EXPERT),
        ("mesh_unit", NO_EXPERT),
        ("mesh_frame", NO_EXPERT),
        ("reader", "limits draw no wall"),
        ("normals", "they are what is built"),
        ("sex", STATED_BY_TABLE),
        ("protocol", STATED_BY_TABLE),
        ("tracer", STATED_BY_TABLE),
        ("attenuation_corrected", STATED_BY_TABLE),
        ("inner_through", EACH_SCAN),
        ("outer_through", EACH_SCAN),
        ("organ", "only left ventricles have normal limits"),
        ("mask_grid", "limits have no masks"),
        ("center", EACH_SCAN),
        ("seed_point", EACH_SCAN),
        ("box", EACH_SCAN),
        ("axis", EACH_SCAN),
        ("segments_from", EACH_SCAN),
    ];
}

/// A row of a cohort's table whose scan a service stores.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct CohortCase {
    /// Its name, once in the table; not a person's, as the limits repeat it.
    #[cfg_attr(
        feature = "schema",
        schema(min_length = 1, max_length = 200, example = "n01")
    )]
    pub case: String,
    /// Id of the volume; gates of one beat for figures of beats.
    #[cfg_attr(feature = "schema", schema(pattern = "^vol_[0-9a-f]{1,64}$"))]
    pub volume: String,
    /// The person's sex.
    pub sex: Sex,
    /// Kind of stress or rest, camera and filter, in words: people of one group have the same.
    #[cfg_attr(
        feature = "schema",
        schema(min_length = 1, max_length = 200, example = "rest")
    )]
    pub protocol: String,
    /// The tracer; `simulated` in it marks the limits as simulated.
    #[cfg_attr(
        feature = "schema",
        schema(min_length = 1, max_length = 200, example = "Tc-99m tetrofosmin")
    )]
    pub tracer: String,
    /// Whether attenuation was corrected.
    pub attenuation_corrected: bool,
    /// Whether the person is healthy. Others are left out, unless they are the scan at rest of a healthy one.
    #[serde(default = "healthy")]
    #[cfg_attr(feature = "schema", schema(default = true))]
    pub healthy: bool,
    /// Of a scan at stress, the case that is the same person at rest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(max_length = 200))]
    pub rest_case: Option<String>,
}

fn healthy() -> bool {
    true
}

/// Everything that determines normal limits, apart from the scans and their table.
pub type NormalsParameters = WithFit<NormalsChoice>;

#[cfg(test)]
mod tests {
    use super::super::checks;
    use super::*;

    #[test]
    fn written_parameters_read_back_unchanged() {
        checks::read_back_unchanged::<NormalsChoice>(&[&[], &[("mixed", "true")]]);
        checks::table_states_defaults::<NormalsChoice>();
    }

    #[test]
    fn what_limits_have_no_use_for_is_refused_and_not_written() {
        checks::refuses_what_it_has_no_use_for::<NormalsChoice>();
    }
}
