//! The parameters of a comparison: its own, and those of the fits to both scans.

use super::fit_specs::{NAME_PATTERN, direction, point, scan_name, through_points};
use super::table::titled;
use super::with_fit::{BesideFit, WithFit};
use super::{FitParameters, Kind, ParameterError, ParameterSpec, Parameters, groups};
use crate::base::geometry::Vec3;
use crate::heart::comparison::WhichScan;
use crate::heart::deform::ThroughPoint;
use crate::heart::deform::through::MOST_THROUGH_POINTS;
use serde_json::{Map, Value, json};

/// The parameters of a comparison beside those of the fits to both scans.
#[derive(Debug, Clone, PartialEq, Default)]
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
    /// The user's correction of the fit to the scan at stress.
    pub stress_correction: Correction,
    /// The user's correction of the fit to the scan at rest.
    pub rest_correction: Correction,
}

/// A user's correction of the fit to one scan. All places are in its frame, LPS mm.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Correction {
    /// A point in the cavity.
    pub center: Option<Vec3>,
    /// Direction from base to apex, of any length.
    pub axis: Option<Vec3>,
    /// A point of the ventricle's base.
    pub base: Option<Vec3>,
    /// Direction from the long axis to the wall that segments are counted from as the anterior one.
    pub segments_from: Option<Vec3>,
    /// Points that the wall's surface passes through.
    pub through: Vec<ThroughPoint>,
}

impl Correction {
    /// The parameters of a fit that a correction states, by their names in its table.
    const CORRECTED_PARAMETERS: [&str; 6] = [
        "center",
        "axis",
        "base",
        "segments_from",
        "inner_through",
        "outer_through",
    ];

    /// Puts the correction into the parameters of the fit to its scan.
    pub fn correct(&self, parameters: &mut FitParameters) {
        let position = &mut parameters.position;
        position.centre = self.center.or(position.centre);
        position.axis = self.axis.or(position.axis);
        parameters.deform.base = self.base.or(parameters.deform.base);
        parameters.segments_from = self.segments_from.or(parameters.segments_from);
        parameters.deform.through.extend_from_slice(&self.through);
    }
}

impl ComparisonChoice {
    /// The correction of the fit to a scan.
    pub fn correction(&self, scan: WhichScan) -> &Correction {
        match scan {
            WhichScan::Stress => &self.stress_correction,
            WhichScan::Rest => &self.rest_correction,
        }
    }

    /// The corrections among the parameters of an earlier `fit` to a scan, as parameters of a comparison.
    pub fn corrections_of(fit: &Map<String, Value>, scan: WhichScan) -> Map<String, Value> {
        let stated = |name: &str| {
            Some(fit.get(name)?)
                .filter(|value| !value.is_null())
                .cloned()
        };
        let of_scan = |name: &str| Some((format!("{}_{name}", scan.as_str()), stated(name)?));
        Correction::CORRECTED_PARAMETERS
            .into_iter()
            .filter_map(of_scan)
            .collect()
    }
}

impl Parameters for ComparisonChoice {
    type Draft = Self;

    const PARAMETER_SPECS: &'static [ParameterSpec<Self>] = COMPARISON_SPECS;

    fn finish(choice: Self) -> Result<Self, ParameterError> {
        Ok(choice)
    }
}

/// A row for a place or a direction in one scan: name, field, how the numbers are read, unit, summary.
macro_rules! in_scan {
    ($name:literal, $($field:ident).+, $read:expr, $unit:literal, $summary:literal) => {
        ParameterSpec {
            name: $name,
            title: "",
            group: groups::PLACE,
            unit: $unit,
            kind: Kind::Numbers { count: 3 },
            default: "",
            summary: $summary,
            read: |d, v| {
                d.$($field).+ = Some($read(v.numbers())?);
                Ok(())
            },
            write: |p| json!(p.$($field).+.map(|v| [v.x, v.y, v.z])),
        }
    };
}

/// A point that any three numbers are.
fn stated_point(list: &[f64]) -> Result<Vec3, String> {
    Ok(point(list))
}

/// Every parameter that only a comparison has.
pub const COMPARISON_SPECS: &[ParameterSpec<ComparisonChoice>] = &[
    ParameterSpec {
        name: "rest",
        title: "",
        group: groups::MAIN,
        unit: "",
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
        title: "Protocol at stress",
        group: groups::LIMITS_GROUP,
        unit: "",
        kind: Kind::Text {
            pattern: NAME_PATTERN,
            example: "stress",
        },
        default: "",
        summary: "The protocol of the scan at stress, as the normal limits name it. Default: the only one with the \
                  word stress in its name",
        read: |d, v| {
            d.stress_protocol = Some(scan_name(v.text())?);
            Ok(())
        },
        write: |p| json!(p.stress_protocol),
    },
    ParameterSpec {
        name: "rest_protocol",
        title: "Protocol at rest",
        group: groups::LIMITS_GROUP,
        unit: "",
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
        title: "Taken for gates",
        group: groups::MAIN,
        unit: "",
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
        title: "",
        group: groups::BOTH_SCANS,
        unit: "",
        kind: Kind::Switch,
        default: "false",
        summary: "Whether both scans are of one patient although their headers name two, as after pseudonymisation",
        read: |d, v| {
            d.same_patient = v.switch();
            Ok(())
        },
        write: |p| json!(p.same_patient),
    },
    titled(
        "Centre at stress",
        in_scan!(
            "stress_center",
            stress_correction.center,
            stated_point,
            "mm",
            "A point in the cavity in the scan at stress, x,y,z in LPS millimetres: the search stays within 25 mm of it. \
         Default: the heart is searched for"
        ),
    ),
    titled(
        "Axis at stress",
        in_scan!(
            "stress_axis",
            stress_correction.axis,
            direction,
            "",
            "Direction from base to apex in the scan at stress, x,y,z in LPS, of any length: the search stays within 35 \
         degrees of it"
        ),
    ),
    titled(
        "Base plane at stress",
        in_scan!(
            "stress_base",
            stress_correction.base,
            stated_point,
            "mm",
            "A point of the ventricle's base in the scan at stress, x,y,z in LPS millimetres: the rim of the wall is put \
         there. Default: where image and anatomy put it"
        ),
    ),
    titled(
        "Segments from, at stress",
        in_scan!(
            "stress_segments_from",
            stress_correction.segments_from,
            direction,
            "",
            "Direction from the long axis to the wall that segments are counted from in the scan at stress, x,y,z in LPS. \
         Default: the anterior wall"
        ),
    ),
    through_points!(
        "stress_inner_through",
        "Inner surface through, at stress",
        stress_correction.through,
        false,
        "Points that the wall's inner surface passes through in the scan at stress, x,y,z in LPS millimetres"
    ),
    through_points!(
        "stress_outer_through",
        "Outer surface through, at stress",
        stress_correction.through,
        true,
        "Points that the wall's outer surface passes through in the scan at stress"
    ),
    titled(
        "Centre at rest",
        in_scan!(
            "rest_center",
            rest_correction.center,
            stated_point,
            "mm",
            "A point in the cavity in the scan at rest, x,y,z in LPS millimetres: the search stays within 25 mm of it. \
         Default: the heart is searched for"
        ),
    ),
    titled(
        "Axis at rest",
        in_scan!(
            "rest_axis",
            rest_correction.axis,
            direction,
            "",
            "Direction from base to apex in the scan at rest, x,y,z in LPS, of any length: the search stays within 35 \
         degrees of it"
        ),
    ),
    titled(
        "Base plane at rest",
        in_scan!(
            "rest_base",
            rest_correction.base,
            stated_point,
            "mm",
            "A point of the ventricle's base in the scan at rest, x,y,z in LPS millimetres: the rim of the wall is put \
         there. Default: where image and anatomy put it"
        ),
    ),
    titled(
        "Segments from, at rest",
        in_scan!(
            "rest_segments_from",
            rest_correction.segments_from,
            direction,
            "",
            "Direction from the long axis to the wall that segments are counted from in the scan at rest, x,y,z in LPS. \
         Default: the anterior wall"
        ),
    ),
    through_points!(
        "rest_inner_through",
        "Inner surface through, at rest",
        rest_correction.through,
        false,
        "Points that the wall's inner surface passes through in the scan at rest, x,y,z in LPS millimetres"
    ),
    through_points!(
        "rest_outer_through",
        "Outer surface through, at rest",
        rest_correction.through,
        true,
        "Points that the wall's outer surface passes through in the scan at rest"
    ),
];

const NO_EXPERT: &str = "a comparison has no expert's mask";
const ONE_SCAN: &str =
    "the heart lies elsewhere in each of both scans: `stress_center`, `rest_center` and their like";

impl BesideFit for ComparisonChoice {
    const WORK_NOUN: &'static str = "a comparison";
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
        ("base", ONE_SCAN),
        ("segments_from", ONE_SCAN),
        ("inner_through", ONE_SCAN),
        ("outer_through", ONE_SCAN),
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
    use super::super::checks;
    use super::*;

    #[test]
    fn written_parameters_read_back_unchanged() {
        checks::read_back_unchanged::<ComparisonChoice>(&[
            &[],
            &[("gated", "true"), ("same_patient", "true")],
            &[("rest", "vol_0123"), ("rest_protocol", "rest 2 d")],
            &[("stress_protocol", "stress")],
            &[("stress_center", "1,2,3"), ("rest_base", "0,-1,2.5")],
            &[("rest_axis", "0,0,2"), ("stress_segments_from", "0,-1,0")],
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
    fn corrections_of_earlier_fits_are_those_of_the_comparison() {
        let corrected = [
            ("center", "1,2,3"),
            ("axis", "0,0,2"),
            ("base", "0,-1,2.5"),
            ("segments_from", "0,1,0"),
            ("inner_through", "1,2,3,4,5,6"),
            ("outer_through", "7,8,9"),
        ];
        let fit = FitParameters::from_pairs(corrected).unwrap();
        for scan in WhichScan::ALL {
            let given = ComparisonChoice::corrections_of(&fit.to_json(), scan);
            assert_eq!(given.len(), corrected.len());
            let read = ComparisonParameters::from_json(&given).unwrap();
            let mut again = FitParameters::default();
            read.choice.correction(scan).correct(&mut again);
            assert_eq!(again, fit);
            let other = match scan {
                WhichScan::Stress => WhichScan::Rest,
                WhichScan::Rest => WhichScan::Stress,
            };
            assert_eq!(read.choice.correction(other), &Correction::default());
        }
        let none =
            ComparisonChoice::corrections_of(&FitParameters::default().to_json(), WhichScan::Rest);
        assert!(none.is_empty());
    }

    #[test]
    fn what_a_comparison_has_no_use_for_is_refused_and_not_written() {
        checks::refuses_what_it_has_no_use_for::<ComparisonChoice>();
    }
}
