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

/// The rows of a reconstruction in the table of parameters that hold it under a path of fields.
macro_rules! reconstruction_rows {
    ($group:path, $($path:ident .)*) => {
        [
            optional!(
                Integer usize, "energy_window", $($path .)* energy_window => $($path .)* energy_window, 1..=64, $group, "",
                "Number of the energy window that is reconstructed, from 1. Default: that with the photopeak of \
                 the radionuclide"
            ),
            number!(
                "axis_offset_mm",
                $($path .)* axis_offset_mm,
                -50.0..=50.0,
                "0",
                $group,
                "mm",
                "How far the axis of rotation lies from the middle of the frames towards higher columns, mm"
            ),
            choice!(
                "reconstruction", $($path .)* method, "osem", $group,
                "How the image is made: osem (ordered subsets expectation maximisation) or fbp (filtered back projection)",
                "osem" => Method::Osem,
                "fbp" => Method::Fbp,
            ),
            integer!(
                "osem_iterations",
                $($path .)* iterations,
                1..=100,
                "3",
                $group,
                "",
                "Iterations of OSEM over all subsets; more sharpen the image and its noise"
            ),
            integer!(
                "osem_subsets",
                $($path .)* subsets,
                1..=64,
                "10",
                $group,
                "",
                "Subsets of OSEM: the greatest number up to it that divides the number of views is taken, unless that is \
                 less than half of it"
            ),
            choice!(
                "filter", $($path .)* filter, "butterworth", $group,
                "What keeps noise out of the image: butterworth, gaussian or none",
                "butterworth" => Filter::Butterworth,
                "gaussian" => Filter::Gaussian,
                "none" => Filter::None,
            ),
            number!(
                "filter_cut_off_per_cm",
                $($path .)* cut_off_per_cm,
                0.05..=5.0,
                "0.5",
                $group,
                "1/cm",
                "Frequency of which the Butterworth filter leaves 71 %, cycles per cm"
            ),
            integer!(
                "filter_order",
                $($path .)* filter_order,
                1..=20,
                "5",
                $group,
                "",
                "Order n of the Butterworth filter, which leaves 1 / sqrt(1 + (f / cut-off)^2n) of a frequency f"
            ),
            number!(
                "filter_fwhm_mm",
                $($path .)* fwhm_mm,
                1.0..=50.0,
                "10",
                $group,
                "mm",
                "Width of the Gaussian filter at half of its maximum, mm"
            ),
        ]
    };
}
pub(super) use reconstruction_rows;

/// Every parameter of a reconstruction, in the order in which its steps use them.
pub const RECONSTRUCTION_SPECS: &[ParameterSpec<Reconstruction>] =
    &reconstruction_rows!(groups::MAIN,);

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
                ("reconstruction", "fbp"),
                ("filter", "gaussian"),
                ("filter_fwhm_mm", "8.5"),
                ("energy_window", "2"),
            ],
            &[
                ("osem_iterations", "5"),
                ("osem_subsets", "6"),
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
                "osem_iterations" => whole(ITERATIONS),
                "osem_subsets" => whole(SUBSETS),
                "filter_order" => whole(FILTER_ORDER),
                "filter_cut_off_per_cm" => numbers(CUT_OFF_PER_CM),
                "filter_fwhm_mm" => numbers(FWHM_MM),
                "axis_offset_mm" => numbers(AXIS_OFFSET_MM),
                _ => continue,
            };
            assert_eq!(spec.kind, kind, "{}", spec.name);
        }
    }

    #[test]
    fn wrong_names_and_values_are_refused_by_name() {
        for (name, text, fix) in [
            ("osem_iteration", "3", "`osem_iterations`"),
            ("osem_iterations", "0", "1 to 100"),
            ("filter_cut_off_per_cm", "nan", "0.05 to 5"),
            ("reconstruction", "mlem", "osem, fbp"),
            ("energy_window", "0", "1 to 64"),
        ] {
            let refused = Reconstruction::from_pairs([(name, text)]).unwrap_err();
            assert_eq!(refused.field, name);
            assert!(refused.fix.contains(fix), "{refused:?}");
        }
    }
}
