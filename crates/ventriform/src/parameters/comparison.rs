//! The parameters of a comparison: its own, and those of the fits to both scans.

use super::fit_specs::{NAME_PATTERN, scan_name};
use super::with_fit::{BesideFit, WithFit};
use super::{Kind, ParameterError, ParameterSpec, Parameters};
use serde_json::json;

/// The parameters of a comparison beside those of the fits to both scans.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ComparisonChoice {
    /// Id of the volume with the scan at rest, where a service stores it.
    pub rest: Option<String>,
    /// The protocol of the scan at stress, as the normal limits name it. Default: the only one with the word `stress`
    /// in its name.
    pub stress_protocol: Option<String>,
    /// The protocol of the scan at rest. Default: the only one with the word `rest`.
    pub rest_protocol: Option<String>,
    /// Whether the volumes of the files are gates although the files do not say so. Default `false`.
    pub gated: bool,
    /// Whether the scans are of one patient although the headers say otherwise. Default `false`.
    pub same_patient: bool,
}

impl Parameters for ComparisonChoice {
    type Draft = Self;

    const SPECS: &'static [ParameterSpec<Self>] = COMPARISON_SPECS;

    fn finish(choice: Self) -> Result<Self, ParameterError> {
        Ok(choice)
    }
}

/// Every parameter that only a comparison has.
pub const COMPARISON_SPECS: &[ParameterSpec<ComparisonChoice>] = &[
    ParameterSpec {
        name: "rest",
        kind: Kind::Stored {
            prefixes: &["vol_"],
            word: "",
            more: 0,
        },
        default: "",
        summary: "Id of the volume with the scan at rest",
        read: |d, v| {
            d.rest = Some(v.text().into());
            Ok(())
        },
        write: |p| json!(p.rest),
    },
    ParameterSpec {
        name: "stress_protocol",
        kind: Kind::Text {
            pattern: NAME_PATTERN,
            example: "stress",
        },
        default: "",
        summary: "The protocol of the scan at stress, as the normal limits name it. Default: the only one with the word \
                  stress in its name",
        read: |d, v| {
            d.stress_protocol = Some(scan_name(v.text())?);
            Ok(())
        },
        write: |p| json!(p.stress_protocol),
    },
    ParameterSpec {
        name: "rest_protocol",
        kind: Kind::Text {
            pattern: NAME_PATTERN,
            example: "rest",
        },
        default: "",
        summary: "The protocol of the scan at rest. Default: the only one with the word rest in its name",
        read: |d, v| {
            d.rest_protocol = Some(scan_name(v.text())?);
            Ok(())
        },
        write: |p| json!(p.rest_protocol),
    },
    ParameterSpec {
        name: "gated",
        kind: Kind::Switch,
        default: "false",
        summary: "Whether the volumes of both files are gates of one heart beat although their headers say otherwise",
        read: |d, v| {
            d.gated = v.switch();
            Ok(())
        },
        write: |p| json!(p.gated),
    },
    ParameterSpec {
        name: "same_patient",
        kind: Kind::Switch,
        default: "false",
        summary: "Whether both scans are of one patient although their headers name two, as after pseudonymisation",
        read: |d, v| {
            d.same_patient = v.switch();
            Ok(())
        },
        write: |p| json!(p.same_patient),
    },
];

const NO_EXPERT: &str = "a comparison has no expert's mask";
const ONE_SCAN: &str = "the heart lies elsewhere in each of both scans";

impl BesideFit for ComparisonChoice {
    const WORK: &'static str = "a comparison";
    const WITHOUT_USE: &'static [(&'static str, &'static str)] = &[
        ("frame", "the gates of both scans are added up"),
        ("expert", NO_EXPERT),
        ("label", NO_EXPERT),
        ("resample", NO_EXPERT),
        ("mesh_unit", NO_EXPERT),
        ("mesh_frame", NO_EXPERT),
        ("reader", "a comparison draws no wall"),
        ("organ", "only left ventricles are compared"),
        ("mask_grid", "a comparison has no masks"),
        ("center", ONE_SCAN),
        ("seed_point", ONE_SCAN),
        ("box", ONE_SCAN),
        ("axis", ONE_SCAN),
        ("segments_from", ONE_SCAN),
        (
            "protocol",
            "each scan has its own: `stress_protocol`, `rest_protocol`",
        ),
    ];
}

/// Everything that determines a comparison, apart from the files.
pub type ComparisonParameters = WithFit<ComparisonChoice>;

#[cfg(test)]
mod tests {
    use super::super::{FIT_SPECS, checks};
    use super::*;

    #[test]
    fn written_parameters_read_back_unchanged() {
        checks::read_back_unchanged::<ComparisonChoice>(&[
            &[],
            &[("gated", "true"), ("same_patient", "true")],
            &[("rest", "vol_0123"), ("rest_protocol", "rest 2 d")],
            &[("stress_protocol", "stress")],
        ]);
        checks::table_states_defaults::<ComparisonChoice>();
        let given = [("same_patient", "true"), ("superior", "0,0,1")];
        let both = ComparisonParameters::from_pairs(given).unwrap();
        assert_eq!(
            ComparisonParameters::from_json(&both.to_json()).unwrap(),
            both
        );
    }

    #[test]
    fn what_a_comparison_has_no_use_for_is_refused_and_not_written() {
        let written = ComparisonParameters::default().to_json();
        for (name, why) in ComparisonChoice::WITHOUT_USE {
            assert!(FIT_SPECS.iter().any(|spec| spec.name == *name), "{name}");
            assert!(!written.contains_key(*name), "{name}");
            let refused = ComparisonParameters::from_pairs([(*name, "1")]).unwrap_err();
            assert_eq!(refused.field, *name);
            assert!(refused.message.contains(why), "{refused}");
        }
    }
}
