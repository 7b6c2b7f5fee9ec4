//! The parameters of a beat: its own, and those of the fit to the gates' sum.

use super::with_fit::{BesideFit, WithFit};
use super::{Kind, ParameterError, ParameterSpec, Parameters, groups};
use serde_json::json;

pub use crate::image::volume::RR_MS;

/// The parameters of a beat beside those of the fit to the gates' sum.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BeatChoice {
    /// Whether the volumes are gates although the file does not say so. Default `false`.
    pub gated: bool,
    /// The R-R interval, ms, within [`RR_MS`]. Default: as the file states it.
    pub rr_ms: Option<f64>,
}

impl BeatChoice {
    /// The parameter that lies outside of its range: name, value, least and greatest.
    pub fn out_of_range(&self) -> Option<(&'static str, f64, [f64; 2])> {
        let value = self.rr_ms.filter(|rr_ms| !RR_MS.contains(rr_ms))?;
        Some(("rr_ms", value, [*RR_MS.start(), *RR_MS.end()]))
    }
}

impl Parameters for BeatChoice {
    type Draft = Self;

    const PARAMETER_SPECS: &'static [ParameterSpec<Self>] = BEAT_SPECS;

    fn finish(choice: Self) -> Result<Self, ParameterError> {
        Ok(choice)
    }
}

/// Every parameter that only a beat has.
pub const BEAT_SPECS: &[ParameterSpec<BeatChoice>] = &[
    ParameterSpec {
        name: "gated",
        title: "Taken for gates",
        group: groups::MAIN,
        unit: "",
        kind: Kind::Switch,
        default: "false",
        summary: "Whether the volumes of the file are gates of one heart beat although its header says otherwise",
        read: |d, v| {
            d.gated = v.switch();
            Ok(())
        },
        write: |p| json!(p.gated),
    },
    ParameterSpec {
        name: "rr_ms",
        title: "R-R interval",
        group: groups::MAIN,
        unit: "ms",
        kind: Kind::Number {
            min: *RR_MS.start(),
            max: *RR_MS.end(),
        },
        default: "",
        summary: "The R-R interval, ms, from which rates of ejection and filling are computed. Default: as the file \
                  states it",
        read: |d, v| {
            d.rr_ms = Some(v.f64());
            Ok(())
        },
        write: |p| json!(p.rr_ms),
    },
];

impl BesideFit for BeatChoice {
    const WORK_NOUN: &'static str = "a beat";
    const WITHOUT_USE: &'static [(&'static str, &'static str)] = &[
        ("frame", "all gates are fitted together"),
        ("expert", NO_EXPERT),
        ("label", NO_EXPERT),
        ("resample", NO_EXPERT),
        ("mesh_unit", NO_EXPERT),
        ("mesh_frame", NO_EXPERT),
        ("reader", "readers draw one wall, not a beat"),
        ("edge", "a beat has the anatomical wall"),
        ("inner_through", "the gates follow the image"),
        ("outer_through", "the gates follow the image"),
        ("organ", "only the left ventricle has a beat"),
        ("mask_grid", "labels lie on the gates' grid"),
    ];
}

const NO_EXPERT: &str = "a beat is compared with no expert's mask";

/// Everything that determines a beat, apart from the files.
pub type GatedParameters = WithFit<BeatChoice>;

#[cfg(test)]
mod tests {
    use super::super::checks;
    use super::*;

    fn pairs(list: &[(&str, &str)]) -> Result<GatedParameters, ParameterError> {
        GatedParameters::from_pairs(list.iter().copied())
    }

    #[test]
    fn written_parameters_read_back_unchanged() {
        checks::read_back_unchanged::<BeatChoice>(&[&[], &[("gated", "true"), ("rr_ms", "850")]]);
        let both = pairs(&[("mass_g", "130"), ("axis", "0,0,-1"), ("template", "auto")]).unwrap();
        assert_eq!(GatedParameters::from_json(&both.to_json()).unwrap(), both);
    }

    #[test]
    fn the_table_states_the_defaults_of_the_code() {
        checks::table_states_defaults::<BeatChoice>();
    }

    #[test]
    fn what_a_beat_has_no_use_for_is_refused_and_not_written() {
        checks::refuses_what_it_has_no_use_for::<BeatChoice>();
    }

    #[test]
    fn wrong_names_and_values_are_refused_by_name() {
        for (name, text, fix) in [
            ("mas_g", "130", "`mass_g`"),
            ("rr", "850", "`rr_ms`"),
            ("mass_g", "19.9", "20 to 600"),
            ("rr_ms", "nan", "300 to 2500"),
            ("gated", "yes", "true or false"),
            ("centre", "1,2", "3 finite numbers"),
        ] {
            let refused = pairs(&[(name, text)]).unwrap_err();
            assert_eq!(refused.field, name);
            assert!(refused.fix.contains(fix), "{refused:?}");
        }
        let twice = pairs(&[("gated", "true"), ("gated", "true")]).unwrap_err();
        assert_eq!(twice.field, "gated");
    }

    #[test]
    fn the_table_allows_what_the_beat_allows() {
        for spec in BEAT_SPECS {
            let Kind::Number { min, max } = spec.kind else {
                continue;
            };
            for (value, fits) in [(min, true), (max, true), (max + 1e-6, false)] {
                let choice = pairs(&[(spec.name, &value.to_string())]).map(|given| given.choice);
                assert_eq!(choice.is_ok(), fits, "{} = {value}", spec.name);
                assert!(choice.map_or(true, |choice| choice.out_of_range().is_none()));
            }
        }
    }
}
