//! The figures of a scan beside normal limits.

use super::code::own;
use super::segmentation::DEFECT_EXTENT;
use super::{Figure, Group, Unit, figure};
use ventriform_dicom::write::code::{Code, loinc};

/// Mean score of the wall against normal limits.
pub const DEFICIT_SCORE: Code = own("DEFICIT", "Deficit score against normal limits");
/// Score of a segment.
pub const SEGMENT_SCORE: Code = own("SCORE", "Perfusion score, 0 normal to 4 absent");
/// Sum of the scores of a scan at stress.
pub const STRESS_SCORE: Code = loinc("82648-7", "Summed stress score");
/// Sum of the scores of a scan at rest.
pub const REST_SCORE: Code = own("SRS", "Summed rest score");
/// The sum of scores of a part of the wall, or of a scan whose state is not known.
pub const SUMMED_SCORE: Code = own("SUMMED-SCORE", "Summed score");

/// The figures of a wall beside normal limits.
pub const FIGURES: &[Figure] = &[
    figure(
        "extent_percent",
        "Below the limit",
        Unit::PERCENT,
        1,
        "Share of the wall whose uptake is below the normal limit.",
    )
    .coded(Group::Whole, DEFECT_EXTENT),
    figure(
        "deficit_percent",
        "Deficit score",
        Unit::PERCENT,
        1,
        "Mean score of the wall, in per cent of the greatest; TPD-like, not comparable with QPS's.",
    )
    .coded(Group::Whole, DEFICIT_SCORE),
    figure(
        "severity",
        "Mean depth below the limit",
        Unit::DEVIATION,
        1,
        "How far the wall below the limit is from the normal mean.",
    )
    .coded(
        Group::Whole,
        own("SEVERITY", "Mean |z| of the wall below the normal limit"),
    ),
    figure(
        "summed_score",
        "Summed score",
        Unit::SUMMED_SCORE,
        0,
        "Sum of the scores of the 17 segments.",
    )
    .coded(Group::Whole, SUMMED_SCORE),
    figure(
        "summed_percent",
        "Summed score, relative",
        Unit::PERCENT,
        0,
        "Sum of the scores of the 17 segments, in per cent of 68.",
    )
    .detail(),
];

/// The figures of an artery's territory.
pub const TERRITORY_FIGURES: &[Figure] = &[
    figure(
        "extent_percent",
        "below the limit",
        Unit::PERCENT,
        1,
        "Share of its wall below the normal limit.",
    )
    .coded(Group::Whole, DEFECT_EXTENT),
    figure(
        "deficit_percent",
        "deficit score",
        Unit::PERCENT,
        1,
        "Mean score of its wall, in per cent of the greatest.",
    )
    .coded(Group::Whole, DEFICIT_SCORE),
    figure(
        "summed_score",
        "summed score",
        Unit::SCORE,
        0,
        "Sum of its segments' scores.",
    )
    .coded(Group::Whole, SUMMED_SCORE),
];

/// The figures of a segment.
pub const SEGMENT_FIGURES: &[Figure] = &[
    figure(
        "z",
        "mean z",
        Unit {
            symbol: "",
            ..Unit::DEVIATION
        },
        1,
        "Standard deviations from the normal mean, negative below.",
    )
    .signed()
    .coded(
        Group::Whole,
        own("Z", "Mean z, negative below the normal mean"),
    ),
    figure(
        "score",
        "score",
        Unit::SCORE,
        0,
        "Score, 0 normal to 4 absent.",
    )
    .coded(Group::Whole, SEGMENT_SCORE),
    figure(
        "extent_percent",
        "below the limit",
        Unit::PERCENT,
        1,
        "Share of its area below the normal limit.",
    )
    .needs("z")
    .coded(Group::Whole, DEFECT_EXTENT),
    figure(
        "deficit_percent",
        "deficit score",
        Unit::PERCENT,
        1,
        "Mean score of its wall, in per cent of the greatest.",
    )
    .detail()
    .needs("z")
    .coded(Group::Whole, DEFICIT_SCORE),
];
