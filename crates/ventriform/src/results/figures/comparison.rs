//! The figures of a comparison of rest and stress.

use super::beat::EJECTION_FRACTION;
use super::code::own;
use super::perfusion::{DEFICIT_SCORE, REST_SCORE, SEGMENT_SCORE, STRESS_SCORE};
use super::segmentation::{DEFECT_EXTENT, MYOCARDIAL_PERFUSION, VOLUME};
use super::{Figure, Group, Unit, figure};
use ventriform_dicom::write::code::{Code, loinc, sct};

const REVERSIBLE_SHARE: Code = own("REVERSIBLE", "Share that loses uptake at stress");
const FIXED_SHARE: Code = own("FIXED", "Share below the threshold in both scans");

const MATCHED: &str = "How both scans were matched";
const BEAT: &str = "The beat at stress and at rest";

/// The figures of a comparison.
pub const FIGURES: &[Figure] = &[
    figure(
        "tid",
        "TID, cavity at stress over that at rest",
        Unit::ONE,
        2,
        "Transient ischaemic dilation: the ratio of the cavities in the images of all gates.",
    )
    .short("TID")
    .within("tid_interval")
    .answered("tid_verdict")
    .coded(
        Group::Whole,
        sct(
            "428832008",
            "Transient ischemic dilatation ratio of left ventricular cavity",
        ),
    ),
    figure(
        "reversible_percent",
        "Reversible",
        Unit::PERCENT,
        0,
        "Share of the wall that loses uptake at stress, as far as half of the depth of the loss.",
    )
    .short("reversible")
    .within("reversible_interval_percent")
    .answered("reversible_verdict")
    .coded(Group::Whole, REVERSIBLE_SHARE),
    figure(
        "fixed_percent",
        "Fixed",
        Unit::PERCENT,
        0,
        "Share of the wall below the threshold in both scans.",
    )
    .short("fixed")
    .within("fixed_interval_percent")
    .answered("fixed_verdict")
    .coded(Group::Whole, FIXED_SHARE),
    figure(
        "reverse_percent",
        "Reverse redistribution",
        Unit::PERCENT,
        0,
        "Share of the wall that lacks uptake at rest beside stress.",
    )
    .within("reverse_interval_percent")
    .answered("reverse_verdict")
    .detail()
    .coded(
        Group::Whole,
        own("REVERSE", "Share that lacks uptake at rest beside stress"),
    ),
    figure(
        "lost_percent",
        "Uptake lost at stress",
        Unit::PERCENT,
        1,
        "What stress lacks in the regions that lose uptake, in per cent of the whole wall's uptake at rest.",
    )
    .coded(
        Group::Whole,
        own("LOST", "Uptake lost at stress, share of the wall's uptake at rest"),
    ),
    figure(
        "detectable_percent",
        "Least loss that would show",
        Unit::PERCENT,
        0,
        "The least loss of a territory that is found in nine of ten pairs with this noise.",
    )
    .coded(
        Group::Whole,
        own("DETECTABLE", "Least loss of a territory that is found nine times in ten"),
    ),
    figure(
        "sss",
        "SSS, summed stress score",
        Unit::SUMMED_SCORE,
        0,
        "Sum of the segments' scores at stress.",
    )
    .short("SSS")
    .within("sss_interval")
    .answered("sss_verdict")
    .coded(Group::Stress, STRESS_SCORE),
    figure(
        "srs",
        "SRS, summed rest score",
        Unit::SUMMED_SCORE,
        0,
        "Sum of the segments' scores at rest.",
    )
    .short("SRS")
    .within("srs_interval")
    .answered("srs_verdict")
    .coded(Group::Rest, REST_SCORE),
    figure(
        "sds",
        "SDS, summed difference score",
        Unit::SUMMED_SCORE,
        0,
        "What the segments' scores at stress exceed those at rest by.",
    )
    .short("SDS")
    .within("sds_interval")
    .answered("sds_verdict")
    .coded(Group::Whole, loinc("82644-6", "Summed difference score")),
    figure(
        "beat/stress_ef_percent",
        "Ejection fraction at stress",
        Unit::PERCENT,
        0,
        "Share of the end-diastolic volume that a beat ejects at stress.",
    )
    .under(BEAT)
    .coded(Group::Stress, EJECTION_FRACTION),
    figure(
        "beat/rest_ef_percent",
        "Ejection fraction at rest",
        Unit::PERCENT,
        0,
        "Share of the end-diastolic volume that a beat ejects at rest.",
    )
    .under(BEAT)
    .coded(Group::Rest, EJECTION_FRACTION),
    figure(
        "beat/ef_change_points",
        "Change of the ejection fraction",
        Unit::POINT,
        0,
        "Ejection fraction at stress less that at rest.",
    )
    .short("EF change")
    .within("beat/ef_change_interval_points")
    .answered("beat/ef_change_verdict")
    .signed()
    .under(BEAT)
    .detail()
    .coded(
        Group::Whole,
        own("EF-CHANGE", "Ejection fraction at stress less that at rest"),
    ),
    figure(
        "beat/stress_edv_ml",
        "End-diastolic volume at stress",
        Unit::MILLILITRE,
        0,
        "The largest volume of the cavity over the beat at stress.",
    )
    .under(BEAT)
    .detail(),
    figure(
        "beat/rest_edv_ml",
        "End-diastolic volume at rest",
        Unit::MILLILITRE,
        0,
        "The largest volume of the cavity over the beat at rest.",
    )
    .under(BEAT)
    .detail(),
    figure(
        "beat/stress_esv_ml",
        "End-systolic volume at stress",
        Unit::MILLILITRE,
        0,
        "The smallest volume of the cavity over the beat at stress.",
    )
    .under(BEAT)
    .detail(),
    figure(
        "beat/rest_esv_ml",
        "End-systolic volume at rest",
        Unit::MILLILITRE,
        0,
        "The smallest volume of the cavity over the beat at rest.",
    )
    .under(BEAT)
    .detail(),
    figure(
        "beat/edv_change_ml",
        "Change of the end-diastolic volume",
        Unit::MILLILITRE,
        0,
        "End-diastolic volume at stress less that at rest.",
    )
    .within("beat/edv_change_interval_ml")
    .answered("beat/edv_change_verdict")
    .signed()
    .under(BEAT)
    .detail(),
    figure(
        "beat/esv_change_ml",
        "Change of the end-systolic volume",
        Unit::MILLILITRE,
        0,
        "End-systolic volume at stress less that at rest.",
    )
    .within("beat/esv_change_interval_ml")
    .answered("beat/esv_change_verdict")
    .signed()
    .under(BEAT)
    .detail(),
    figure(
        "compared_percent",
        "Wall with muscle in both scans",
        Unit::PERCENT,
        0,
        "Share of the wall that was compared.",
    )
    .under(MATCHED)
    .detail(),
    figure(
        "matched_percent",
        "Wall by which stress was scaled",
        Unit::PERCENT,
        0,
        "Share of the wall that is taken for unchanged.",
    )
    .under(MATCHED)
    .detail(),
    figure(
        "scale",
        "Counts of stress for one at rest",
        Unit::ONE,
        2,
        "Counts of the stress scan that are one count of the rest scan where nothing changed.",
    )
    .under(MATCHED)
    .detail(),
    figure(
        "reversible_points",
        "Loss that counts as reversible",
        Unit::POINT,
        0,
        "The least loss in smoothed maps that the noise of this pair does not explain.",
    )
    .under(MATCHED)
    .detail(),
    figure(
        "noise_points",
        "Noise of the difference",
        Unit::POINT,
        1,
        "Standard deviation of the smoothed difference by the noise of both scans.",
    )
    .under(MATCHED)
    .detail()
    .coded(
        Group::Whole,
        own("NOISE", "Standard deviation of the difference by noise"),
    ),
    figure(
        "turn_degrees",
        "Stress map turned by",
        Unit::DEGREE,
        0,
        "How far the stress map is turned against the rest map.",
    )
    .under(MATCHED)
    .detail(),
    figure(
        "correlation",
        "Correlation of both maps",
        Unit::ONE,
        2,
        "Correlation of uptake at stress and at rest over the wall.",
    )
    .under(MATCHED)
    .detail(),
];

/// The figures of each of both scans.
pub const SCAN_FIGURES: &[Figure] = &[
    figure(
        "cavity_ml",
        "Cavity",
        Unit::MILLILITRE,
        0,
        "Volume of the cavity in the image of all gates.",
    )
    .coded(
        Group::Whole,
        own("CAVITY", "Volume of the cavity, all gates"),
    ),
    figure(
        "muscle_ml",
        "Muscle",
        Unit::MILLILITRE,
        0,
        "Volume of the wall's muscle in the image of all gates.",
    )
    .coded(Group::Whole, VOLUME),
    figure(
        "perfusion/extent_percent",
        "Below the limit",
        Unit::PERCENT,
        0,
        "Share of the wall below the normal limit.",
    )
    .within("extent_interval_percent")
    .answered("extent_verdict")
    .coded(Group::Whole, DEFECT_EXTENT),
    figure(
        "polar/extent_percent",
        "Below the threshold",
        Unit::PERCENT,
        0,
        "Share of the wall below the threshold, a share of the scan's own maximum.",
    )
    .unless("perfusion")
    .coded(Group::Whole, DEFECT_EXTENT),
    figure(
        "perfusion/deficit_percent",
        "Deficit score",
        Unit::PERCENT,
        1,
        "Mean score of the wall, in per cent of the greatest.",
    )
    .within("deficit_interval_percent")
    .answered("deficit_verdict")
    .coded(Group::Whole, DEFICIT_SCORE),
];

const AT_STRESS: Figure = figure(
    "stress_percent",
    "stress",
    Unit::PERCENT,
    0,
    "Uptake at stress, scaled to rest.",
);
const AT_REST: Figure = figure("rest_percent", "rest", Unit::PERCENT, 0, "Uptake at rest.");
const DIFFERENCE: Figure = figure(
    "difference_points",
    "rest less stress",
    Unit::POINT,
    0,
    "Uptake at rest less that at stress: positive where stress lacks uptake.",
)
.signed();
const REVERSIBLE: Figure = figure(
    "reversible_percent",
    "reversible",
    Unit::PERCENT,
    0,
    "Share of its compared area that loses uptake at stress.",
)
.coded(Group::Whole, REVERSIBLE_SHARE);
const FIXED: Figure = figure(
    "fixed_percent",
    "fixed",
    Unit::PERCENT,
    0,
    "Share of its compared area below the threshold in both scans.",
);

/// The figures of an artery's territory.
pub const TERRITORY_FIGURES: &[Figure] = &[
    AT_STRESS,
    AT_REST,
    DIFFERENCE,
    REVERSIBLE,
    FIXED.coded(Group::Whole, FIXED_SHARE),
];

/// The figures of a segment.
pub const SEGMENT_FIGURES: &[Figure] = &[
    AT_STRESS.coded_mean(Group::Stress, MYOCARDIAL_PERFUSION),
    AT_REST.coded_mean(Group::Rest, MYOCARDIAL_PERFUSION),
    DIFFERENCE.coded(
        Group::Whole,
        own("DIFFERENCE", "Uptake at rest less that at stress"),
    ),
    REVERSIBLE.needs("difference_points"),
    FIXED.needs("difference_points").detail(),
    figure(
        "stress_score",
        "score at stress",
        Unit::SCORE,
        0,
        "Score at stress, 0 normal to 4 absent.",
    )
    .coded(Group::Stress, SEGMENT_SCORE),
    figure(
        "rest_score",
        "score at rest",
        Unit::SCORE,
        0,
        "Score at rest, 0 normal to 4 absent.",
    )
    .coded(Group::Rest, SEGMENT_SCORE),
    figure(
        "motion_change_mm",
        "motion, change",
        Unit::MILLIMETRE,
        1,
        "Motion inward at stress less that at rest.",
    )
    .within("motion_change_interval_mm")
    .answered("motion_change_verdict")
    .signed(),
    figure(
        "thickening_change_points",
        "thickening, change",
        Unit::POINT,
        0,
        "Thickening at stress less that at rest.",
    )
    .within("thickening_change_interval_points")
    .answered("thickening_change_verdict")
    .signed(),
];
