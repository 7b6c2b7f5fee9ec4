//! The parameters of a serial comparison: its own, and those of the fits to all scans.

use super::with_fit::{BesideFit, WithFit};
use super::{Kind, ParameterError, ParameterSpec, Parameters, groups};
use serde_json::json;

/// The parameters of a serial comparison beside those of the fits.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct SerialChoice {
    /// Ids of the volumes of the other scans, separated by commas, where a service stores them.
    pub others: Option<String>,
    /// Whether the volumes of the files are gates although the files do not say so. Default `false`.
    pub gated: bool,
    /// Whether the scans are of one patient although the headers say otherwise. Default `false`.
    pub same_patient: bool,
}

impl SerialChoice {
    /// The fields under which the volumes of the other scans are looked up, with their ids: `others[0]`, `others[1]`, ...
    pub fn named_volumes(others: &str) -> Vec<(String, String)> {
        let ids = others.split(',').enumerate();
        ids.map(|(n, id)| (format!("others[{n}]"), id.to_owned()))
            .collect()
    }
}

impl Parameters for SerialChoice {
    type Draft = Self;

    const PARAMETER_SPECS: &'static [ParameterSpec<Self>] = SERIAL_SPECS;

    fn finish(choice: Self) -> Result<Self, ParameterError> {
        Ok(choice)
    }
}

/// Every parameter that only a serial comparison has.
pub const SERIAL_SPECS: &[ParameterSpec<SerialChoice>] = &[
    ParameterSpec {
        name: "others",
        title: "Other scans",
        group: groups::MAIN,
        unit: "",
        kind: Kind::Stored {
            prefixes: &["vol_"],
            word: "",
            more: 18,
        },
        default: "",
        summary: "Ids of the volumes of the patient's other scans, separated by commas",
        read: |d, v| {
            d.others = Some(v.text().into());
            Ok(())
        },
        write: |p| json!(p.others),
    },
    ParameterSpec {
        name: "gated",
        title: "Taken for gates",
        group: groups::MAIN,
        unit: "",
        kind: Kind::Switch,
        default: "false",
        summary: "Whether the volumes of all files are gates of one heart beat although their headers say otherwise",
        read: |d, v| {
            d.gated = v.switch();
            Ok(())
        },
        write: |p| json!(p.gated),
    },
    ParameterSpec {
        name: "same_patient",
        title: "",
        group: groups::MAIN,
        unit: "",
        kind: Kind::Switch,
        default: "false",
        summary: "Whether all scans are of one patient although their headers name several, as after pseudonymisation",
        read: |d, v| {
            d.same_patient = v.switch();
            Ok(())
        },
        write: |p| json!(p.same_patient),
    },
];

const NO_EXPERT: &str = "a serial comparison has no expert's mask";
const EACH_SCAN: &str = "the heart lies elsewhere in each scan";

impl BesideFit for SerialChoice {
    const WORK_NOUN: &'static str = "a serial comparison";
    const WITHOUT_USE: &'static [(&'static str, &'static str)] = &[
        ("frame", "the gates of all scans are added up"),
        ("expert", NO_EXPERT),
        ("label", NO_EXPERT),
        ("resample", NO_EXPERT),
        ("mesh_unit", NO_EXPERT),
        ("mesh_frame", NO_EXPERT),
        ("reader", "a serial comparison draws no wall"),
        ("inner_through", EACH_SCAN),
        ("outer_through", EACH_SCAN),
        ("organ", "only left ventricles are compared"),
        ("mask_grid", "a serial comparison has no masks"),
        ("center", EACH_SCAN),
        ("seed_point", EACH_SCAN),
        ("box", EACH_SCAN),
        ("axis", EACH_SCAN),
        ("base", EACH_SCAN),
        ("segments_from", EACH_SCAN),
    ];
}

/// Everything that determines a serial comparison, apart from the files.
pub type SerialParameters = WithFit<SerialChoice>;

#[cfg(test)]
mod tests {
    use super::super::checks;
    use super::*;

    const FIRST: &str = "vol_2c26b46b68ffc68ff99b453c1d304134";

    #[test]
    fn written_parameters_read_back_unchanged() {
        let two = format!("{FIRST},{}", FIRST.replace('2', "3"));
        checks::read_back_unchanged::<SerialChoice>(&[
            &[],
            &[("gated", "true"), ("same_patient", "true")],
            &[("others", &two)],
        ]);
        checks::table_states_defaults::<SerialChoice>();
        let named = SerialChoice::named_volumes(&two);
        assert_eq!(named[0], ("others[0]".to_owned(), FIRST.to_owned()));
        assert_eq!(named.len(), 2);
    }

    #[test]
    fn other_scans_are_ids_of_volumes() {
        let of = |text: &str| SerialChoice::from_pairs([("others", text)]);
        assert!(of(FIRST).is_ok());
        let twice = format!("{FIRST},{FIRST}");
        for bad in [
            "",
            "mdl_2c26b46b68ffc68ff99b453c1d304134",
            "vol_2c,",
            &twice,
        ] {
            assert_eq!(of(bad).unwrap_err().field, "others", "{bad}");
        }
    }

    #[test]
    fn what_a_serial_comparison_has_no_use_for_is_refused_and_not_written() {
        checks::refuses_what_it_has_no_use_for::<SerialChoice>();
    }
}
