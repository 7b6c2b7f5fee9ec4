//! The figures that are followed over the years, and how their changes are judged.
//!
//! What matters is the program's choice: 5 points of the ejection fraction are the usual sign of a change in follow-up
//! (cardiotoxicity, therapy), the others are about as much of their usual range.

use super::calibration as constants;
use crate::heart::comparison::{ChangeError, ChangingFigure, by_difference, by_share};

/// The figures whose change is judged by the error of hearts that were scanned again.
pub const SERIAL_FIGURES: &[ChangingFigure] = &[
    by_difference("ef_percent", 5.0, constants::EF),
    by_share("edv_ml", 15.0, constants::EDV),
    by_share("esv_ml", 20.0, constants::ESV),
    by_share("cavity_ml", 15.0, constants::CAVITY),
    by_share("mass_g", 15.0, constants::MASS),
    by_difference("dark_percent", 5.0, constants::DARK),
    by_difference("motion_mm", 1.5, constants::MOTION),
    by_difference("thickening_percent", 10.0, constants::THICKENING),
    by_difference("phase_sd_degrees", 10.0, constants::PHASE_SD),
    by_difference("phase_bandwidth_degrees", 30.0, constants::PHASE_BANDWIDTH),
];

/// The error of the mean uptake of a segment, points.
pub fn segment_error() -> ChangeError {
    constants::SEGMENT_UPTAKE
}
