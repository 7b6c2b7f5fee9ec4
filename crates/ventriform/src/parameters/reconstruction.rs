//! The parameters of a reconstruction of projections.

use super::table::{choice, integer, number, optional};
use super::{Kind, ParameterError, ParameterSpec, Parameters, groups};
use crate::image::reconstruct::{Filter, Method, Reconstruction};
use serde_json::json;

impl Parameters for Reconstruction {
    type Draft = Self;

    const PARAMETER_SPECS: &'static [ParameterSpec<Self>] = RECONSTRUCTION_SPECS;

    fn finish(draft: Self) -> Result<Self, ParameterError> {
        Ok(draft)
    }
}

/// Every parameter of a reconstruction, in the order in which its steps use them.
pub const RECONSTRUCTION_SPECS: &[ParameterSpec<Reconstruction>] = &[
    optional!(
        Integer usize, "energy_window", energy_window => energy_window, 1..=64, groups::MAIN, "",
        "Number of the energy window that is reconstructed, from 1. Default: that with the photopeak of \
         the radionuclide"
    ),
    number!(
        "axis_offset_mm",
        axis_offset_mm,
        -50.0..=50.0,
        "0",
        groups::MAIN,
        "mm",
        "How far the axis of rotation lies from the middle of the frames towards higher columns, mm"
    ),
    choice!(
        "method", method, "osem", groups::MAIN,
        "How the image is made: osem (ordered subsets expectation maximisation) or fbp (filtered back projection)",
        "osem" => Method::Osem,
        "fbp" => Method::Fbp,
    ),
    integer!(
        "iterations",
        iterations,
        1..=100,
        "3",
        groups::MAIN,
        "",
        "Iterations of OSEM over all subsets; more sharpen the image and its noise"
    ),
    integer!(
        "subsets",
        subsets,
        1..=64,
        "10",
        groups::MAIN,
        "",
        "Subsets of OSEM: the greatest number up to it that divides the number of views is taken, unless that is less \
         than half of it"
    ),
    choice!(
        "filter", filter, "butterworth", groups::MAIN,
        "What keeps noise out of the image: butterworth, gaussian or none",
        "butterworth" => Filter::Butterworth,
        "gaussian" => Filter::Gaussian,
        "none" => Filter::None,
    ),
    number!(
        "cut_off_per_cm",
        cut_off_per_cm,
        0.05..=5.0,
        "0.5",
        groups::MAIN,
        "1/cm",
        "Frequency of which the Butterworth filter leaves 71 %, cycles per cm"
    ),
    integer!(
        "filter_order",
        filter_order,
        1..=20,
        "5",
        groups::MAIN,
        "",
        "Order n of the Butterworth filter, which leaves 1 / sqrt(1 + (f / cut-off)^2n) of a frequency f"
    ),
    number!(
        "fwhm_mm",
        fwhm_mm,
        1.0..=50.0,
        "10",
        groups::MAIN,
        "mm",
        "Width of the Gaussian filter at half of its maximum, mm"
    ),
];

#[cfg(test)]
mod tests {
    use super::super::checks;
    use super::*;
    use crate::image::reconstruct::{
        AXIS_OFFSET_MM, CUT_OFF_PER_CM, FILTER_ORDER, FWHM_MM, ITERATIONS, SUBSETS,
    };

    #[test]
    fn written_parameters_read_back_unchanged() {
        checks::read_back_unchanged::<Reconstruction>(&[
            &[],
            &[
                ("method", "fbp"),
                ("filter", "gaussian"),
                ("fwhm_mm", "8.5"),
                ("energy_window", "2"),
            ],
            &[
                ("iterations", "5"),
                ("subsets", "6"),
                ("axis_offset_mm", "-2.5"),
            ],
        ]);
    }

    #[test]
    fn the_table_states_the_defaults_of_the_code() {
        checks::table_states_defaults::<Reconstruction>();
    }

    #[test]
    fn the_table_has_the_ranges_of_the_code() {
        for spec in RECONSTRUCTION_SPECS {
            let whole = |range: std::ops::RangeInclusive<usize>| Kind::Integer {
                min: *range.start() as u64,
                max: *range.end() as u64,
            };
            let numbers = |range: std::ops::RangeInclusive<f64>| Kind::Number {
                min: *range.start(),
                max: *range.end(),
            };
            let kind = match spec.name {
                "iterations" => whole(ITERATIONS),
                "subsets" => whole(SUBSETS),
                "filter_order" => whole(FILTER_ORDER),
                "cut_off_per_cm" => numbers(CUT_OFF_PER_CM),
                "fwhm_mm" => numbers(FWHM_MM),
                "axis_offset_mm" => numbers(AXIS_OFFSET_MM),
                _ => continue,
            };
            assert_eq!(spec.kind, kind, "{}", spec.name);
        }
    }

    #[test]
    fn wrong_names_and_values_are_refused_by_name() {
        for (name, text, fix) in [
            ("iteration", "3", "`iterations`"),
            ("iterations", "0", "1 to 100"),
            ("cut_off_per_cm", "nan", "0.05 to 5"),
            ("method", "mlem", "osem, fbp"),
            ("energy_window", "0", "1 to 64"),
        ] {
            let refused = Reconstruction::from_pairs([(name, text)]).unwrap_err();
            assert_eq!(refused.field, name);
            assert!(refused.fix.contains(fix), "{refused:?}");
        }
    }
}
