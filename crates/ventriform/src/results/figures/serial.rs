//! The figures of a serial comparison.

use super::beat::EJECTION_FRACTION;
use super::code::own;
use super::perfusion::DEFICIT_SCORE;
use super::segmentation::{DEFECT_EXTENT, MYOCARDIAL_PERFUSION};
use super::{Figure, Group, Unit, figure};

/// The figures of each scan, in the order of the trend sheet.
pub const SCAN_FIGURES: &[Figure] = &[
    figure(
        "ef_percent",
        "Ejection fraction",
        Unit::PERCENT,
        0,
        "Share of the end-diastolic volume that a beat ejects.",
    )
    .short("EF")
    .coded(Group::Whole, EJECTION_FRACTION),
    figure(
        "edv_ml",
        "End-diastolic volume",
        Unit::MILLILITRE,
        0,
        "The largest volume of the cavity over the beat.",
    )
    .short("EDV"),
    figure(
        "esv_ml",
        "End-systolic volume",
        Unit::MILLILITRE,
        0,
        "The smallest volume of the cavity over the beat.",
    )
    .short("ESV"),
    figure(
        "cavity_ml",
        "Cavity",
        Unit::MILLILITRE,
        0,
        "Volume of the cavity in the image of all gates.",
    )
    .short("cavity"),
    figure(
        "mass_g",
        "Mass",
        Unit::GRAM,
        0,
        "Mass of the muscle by the fit of the scan alone; the volumes of all scans stand on one common mass.",
    )
    .short("mass"),
    figure(
        "dark_percent",
        "Below the threshold",
        Unit::PERCENT,
        0,
        "Share of the wall below the threshold, a share of the scan's own maximum.",
    )
    .short("below the threshold")
    .coded(Group::Whole, DEFECT_EXTENT),
    figure(
        "extent_percent",
        "Below the limit",
        Unit::PERCENT,
        0,
        "Share of the wall below the normal limit.",
    )
    .short("extent"),
    figure(
        "deficit_percent",
        "Deficit score",
        Unit::PERCENT,
        1,
        "Mean score of the wall, in per cent of the greatest.",
    )
    .short("deficit")
    .coded(Group::Whole, DEFICIT_SCORE),
    figure(
        "summed_score",
        "Summed score",
        Unit::SUMMED_SCORE,
        0,
        "Sum of the segments' scores.",
    )
    .short("summed score"),
    figure(
        "motion_mm",
        "Motion",
        Unit::MILLIMETRE,
        1,
        "Inward motion from end diastole to end systole, the mean of the segments.",
    )
    .short("motion"),
    figure(
        "thickening_percent",
        "Thickening",
        Unit::PERCENT,
        0,
        "Thickening from end diastole to end systole, the mean of the segments.",
    )
    .short("thickening"),
    figure(
        "phase_sd_degrees",
        "Phase SD",
        Unit::DEGREE,
        0,
        "Standard deviation of the phases of the wall.",
    )
    .short("phase SD"),
    figure(
        "phase_bandwidth_degrees",
        "Phase bandwidth",
        Unit::DEGREE,
        0,
        "Width of the range that holds 95 % of the phases.",
    )
    .short("phase bandwidth"),
];

/// The figures of a pair of scans.
pub const PAIR_FIGURES: &[Figure] = &[
    figure(
        "worse_percent",
        "Worse",
        Unit::PERCENT,
        0,
        "Share of the wall that lost uptake, as far as half of the depth of the loss.",
    )
    .short("worse")
    .within("worse_interval_percent")
    .answered("worse_verdict")
    .coded(
        Group::Whole,
        own(
            "WORSE",
            "Share of the wall that lost uptake between two scans",
        ),
    ),
    figure(
        "better_percent",
        "Better",
        Unit::PERCENT,
        0,
        "Share of the wall that gained uptake.",
    )
    .short("better")
    .within("better_interval_percent")
    .answered("better_verdict")
    .coded(
        Group::Whole,
        own(
            "BETTER",
            "Share of the wall that gained uptake between two scans",
        ),
    ),
    figure(
        "dark_in_both_percent",
        "Below the threshold in both",
        Unit::PERCENT,
        0,
        "Share of the wall below the threshold in both scans.",
    ),
    figure(
        "lost_percent",
        "Uptake lost",
        Unit::PERCENT,
        1,
        "What the later scan lacks where uptake was lost, in per cent of the whole wall's uptake.",
    ),
    figure(
        "detectable_percent",
        "Least loss that would show",
        Unit::PERCENT,
        0,
        "The least loss of a territory that is found in nine of ten pairs with this noise.",
    ),
];

/// The figures of a segment of a pair.
pub const SEGMENT_FIGURES: &[Figure] = &[
    figure(
        "earlier_percent",
        "earlier",
        Unit::PERCENT,
        0,
        "Mean uptake in the earlier scan.",
    )
    .coded_mean(Group::Whole, MYOCARDIAL_PERFUSION),
    figure(
        "later_percent",
        "later",
        Unit::PERCENT,
        0,
        "Mean uptake in the later scan, scaled to the earlier one.",
    ),
    figure(
        "change_points",
        "change",
        Unit::POINT,
        0,
        "Uptake in the later scan less that in the earlier one.",
    )
    .signed()
    .answered("change_verdict"),
    figure(
        "motion_change_mm",
        "motion, change",
        Unit::MILLIMETRE,
        1,
        "Inward motion in the later scan less that in the earlier one.",
    )
    .signed(),
    figure(
        "thickening_change_points",
        "thickening, change",
        Unit::POINT,
        0,
        "Thickening in the later scan less that in the earlier one.",
    )
    .signed(),
];
