//! The figures of a beat.

use super::code::own;
use super::{Figure, Group, Unit, figure};
use ventriform_dicom::write::code::{Code, dcm, loinc, sct};

/// Share of the end-diastolic volume that is ejected.
pub(super) const EJECTION_FRACTION: Code = sct("70822001", "Cardiac ejection fraction");

const PHASES: &str = "Phases of the wall";
const ARE_RELIABLE: &str = "phase/reliable";

/// The figures of a beat.
pub const FIGURES: &[Figure] = &[
    figure(
        "ef_percent",
        "Ejection fraction",
        Unit::PERCENT,
        0,
        "Share of the end-diastolic volume that a beat ejects.",
    )
    .short("EF")
    .within("ef_interval_percent")
    .coded(Group::Whole, EJECTION_FRACTION),
    figure(
        "edv_ml",
        "End-diastolic volume",
        Unit::MILLILITRE,
        0,
        "The largest volume of the cavity over the beat.",
    )
    .short("EDV")
    .within("edv_interval_ml")
    .coded(
        Group::EndDiastole,
        loinc("8821-1", "Left Ventricular ED Volume"),
    ),
    figure(
        "esv_ml",
        "End-systolic volume",
        Unit::MILLILITRE,
        0,
        "The smallest volume of the cavity over the beat.",
    )
    .short("ESV")
    .within("esv_interval_ml")
    .coded(
        Group::EndSystole,
        loinc("8823-7", "Left Ventricular ES Volume"),
    ),
    figure(
        "sv_ml",
        "Stroke volume",
        Unit::MILLILITRE,
        0,
        "Volume that a beat ejects: end diastole less end systole.",
    )
    .coded(Group::Whole, sct("90096001", "Stroke Volume")),
    figure(
        "mass_g",
        "Mass",
        Unit::GRAM,
        0,
        "Mass of the wall's muscle in the mean of the beat, at 1.05 g/ml.",
    )
    .coded(Group::Whole, dcm("122447", "Wall Mass")),
    figure(
        "rates/peak_ejection_edv_per_s",
        "Peak ejection rate",
        Unit::EDV_PER_SECOND,
        2,
        "Greatest rate at which the cavity empties.",
    )
    .coded(Group::Whole, dcm("122616", "Peak Ejection Rate")),
    figure(
        "rates/peak_filling_edv_per_s",
        "Peak filling rate",
        Unit::EDV_PER_SECOND,
        2,
        "Greatest rate at which the cavity fills.",
    )
    .coded(Group::Whole, dcm("122618", "Peak Filling Rate")),
    figure(
        "rates/time_to_peak_filling_ms",
        "Time to peak filling",
        Unit::MILLISECOND,
        0,
        "From end systole to the greatest rate of filling.",
    )
    .coded(
        Group::Whole,
        own(
            "PEAK-FILLING-MS",
            "Time from end systole to the peak filling rate",
        ),
    ),
    figure(
        "rr_ms",
        "R-R interval",
        Unit::MILLISECOND,
        0,
        "Length of a beat, as given or as the file states it.",
    )
    .detail(),
    figure(
        "phase/mean_degrees",
        "Mean phase",
        Unit::DEGREE,
        0,
        "Circular mean of the phases of the wall's thickening.",
    )
    .under(PHASES)
    .detail()
    .needs(ARE_RELIABLE)
    .coded(
        Group::Whole,
        own("PHASE-MEAN", "Mean phase of the wall's thickening"),
    ),
    figure(
        "phase/sd_degrees",
        "Standard deviation of the phases",
        Unit::DEGREE,
        0,
        "Spread of the phases over the wall: of a heart that contracts at once it is small.",
    )
    .under(PHASES)
    .needs(ARE_RELIABLE)
    .coded(
        Group::Whole,
        own("PHASE-SD", "Standard deviation of the phases"),
    ),
    figure(
        "phase/bandwidth_degrees",
        "Bandwidth of the phases, 95 %",
        Unit::DEGREE,
        0,
        "The smallest part of the cycle that holds 95 per cent of the wall's phases.",
    )
    .under(PHASES)
    .needs(ARE_RELIABLE)
    .coded(
        Group::Whole,
        own(
            "PHASE-BANDWIDTH",
            "Smallest arc with 95 per cent of the phases",
        ),
    ),
    figure(
        "phase/entropy_percent",
        "Entropy of the phases",
        Unit::PERCENT,
        0,
        "Entropy of the histogram of phases, in per cent of that of an even one.",
    )
    .under(PHASES)
    .detail()
    .needs(ARE_RELIABLE)
    .coded(Group::Whole, own("PHASE-ENTROPY", "Entropy of the phases")),
    figure(
        "phase/noise_degrees",
        "Scatter by noise alone",
        Unit::DEGREE,
        0,
        "Standard deviation that the noise of the gates alone gives the phases.",
    )
    .under(PHASES)
    .detail()
    .coded(
        Group::Whole,
        own("PHASE-NOISE", "Scatter of the phases by noise alone"),
    ),
];

/// The figures of a segment through the beat.
pub const SEGMENT_FIGURES: &[Figure] = &[
    figure(
        "motion_mm",
        "motion inward",
        Unit::MILLIMETRE,
        1,
        "Motion of the inner surface inward, end diastole to end systole.",
    )
    .coded(
        Group::Whole,
        sct(
            "60797005",
            "Cardiac wall motion, function (observable entity)",
        ),
    ),
    figure(
        "thickening_percent",
        "thickening",
        Unit::PERCENT,
        0,
        "Thickening of the wall, end diastole to end systole.",
    )
    .coded(Group::Whole, loinc("59092-7", "% Thickening")),
    figure(
        "thickening_counts_percent",
        "by counts",
        Unit::PERCENT,
        0,
        "Thickening by the counts of the wall: lower by what the image's filter takes.",
    )
    .coded(
        Group::Whole,
        own("THICKENING-COUNT", "Thickening by counts"),
    ),
    figure(
        "phase_degrees",
        "phase",
        Unit::DEGREE,
        0,
        "Phase of the greatest thickness.",
    )
    .coded(
        Group::Whole,
        own("PHASE", "Phase of the greatest thickness"),
    ),
];
