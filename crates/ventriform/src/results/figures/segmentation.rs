//! The figures of a segmentation.

use super::code::own;
use super::{Figure, Group, Unit, figure};
use ventriform_dicom::write::code::{Code, dcm, sct};

/// Volume, of whatever the group is about.
pub const VOLUME: Code = sct("118565006", "Volume");
/// Share of the wall with a defect.
pub const DEFECT_EXTENT: Code = sct(
    "427751006",
    "Extent of cardiac perfusion defect (observable entity)",
);
/// Uptake of a part of the wall.
pub const MYOCARDIAL_PERFUSION: Code = sct("251053005", "Myocardial perfusion (observable entity)");
const WALL_THICKNESS: Code = dcm("122445", "Wall Thickness");

const AS_THE_IMAGE_SHOWS_IT: &str = "As the blurred image shows it";

/// The heading of the measures against an expert's mask.
pub const AGAINST_THE_EXPERT: &str = "Against the expert";

/// The figures of a segmentation.
pub const FIGURES: &[Figure] = &[
    figure(
        "volumes_ml/anatomical/cavity",
        "Cavity",
        Unit::MILLILITRE,
        0,
        "Volume of the cavity within the anatomical wall, which is the wall without the image's blur.",
    )
    .within("volumes_ml/anatomical_interval/cavity")
    .flat_name("cavity_ml")
    .coded(Group::AnatomicalCavity, VOLUME),
    figure(
        "volumes_ml/cavity",
        "Cavity",
        Unit::MILLILITRE,
        0,
        "Volume of the cavity within the wall that was asked for.",
    )
    .not_shown_beside("volumes_ml/anatomical")
    .coded(Group::Cavity, VOLUME),
    figure(
        "volumes_ml/anatomical/wall",
        "Wall",
        Unit::MILLILITRE,
        0,
        "Volume of the anatomical wall, which is the wall without the image's blur.",
    )
    .within("volumes_ml/anatomical_interval/wall")
    .flat_name("wall_ml")
    .coded(Group::AnatomicalWall, VOLUME),
    figure(
        "volumes_ml/wall",
        "Volume",
        Unit::MILLILITRE,
        1,
        "Volume of the wall that was asked for, or of the organ.",
    )
    .not_shown_beside("volumes_ml/anatomical")
    .coded(Group::Whole, VOLUME),
    figure(
        "mass_g",
        "Mass",
        Unit::GRAM,
        0,
        "Mass of the anatomical wall's muscle, at 1.05 g/ml.",
    )
    .within("mass_interval_g")
    .coded(Group::Whole, sct("118538004", "Mass")),
    figure(
        "thickness_mm/anatomical/mean",
        "Thickness",
        Unit::MILLIMETRE,
        1,
        "Mean thickness of the anatomical wall.",
    )
    .within("thickness_mm/anatomical_interval")
    .coded_mean(Group::AnatomicalWall, WALL_THICKNESS),
    figure(
        "wall_thickness_mm",
        "Thickness",
        Unit::MILLIMETRE,
        1,
        "Mean thickness of the wall that was asked for.",
    )
    .not_shown_beside("thickness_mm")
    .coded_mean(Group::Whole, WALL_THICKNESS),
    figure(
        "polar/extent_percent",
        "Below the threshold",
        Unit::PERCENT,
        1,
        "Share of the wall whose uptake is below the threshold, a share of this scan's own maximum.",
    )
    .coded(Group::Whole, DEFECT_EXTENT),
    figure(
        "volumes_ml/apparent/cavity",
        "Cavity, apparent",
        Unit::MILLILITRE,
        0,
        "Volume of the cavity within the apparent wall, which is the wall as the blurred image shows it.",
    )
    .under(AS_THE_IMAGE_SHOWS_IT)
    .coded(Group::ApparentCavity, VOLUME),
    figure(
        "volumes_ml/apparent/wall",
        "Wall, apparent",
        Unit::MILLILITRE,
        0,
        "Volume of the apparent wall, which is the wall as the blurred image shows it.",
    )
    .under(AS_THE_IMAGE_SHOWS_IT)
    .coded(Group::ApparentWall, VOLUME),
    figure(
        "thickness_mm/apparent/mean",
        "Thickness, apparent",
        Unit::MILLIMETRE,
        1,
        "Mean thickness of the apparent wall.",
    )
    .under(AS_THE_IMAGE_SHOWS_IT)
    .coded_mean(Group::ApparentWall, WALL_THICKNESS),
    figure(
        "measures/jaccard",
        "Jaccard index (E_J)",
        Unit::OF_ONE,
        3,
        "Overlap with the expert's mask: the shared part over the union.",
    )
    .under(AGAINST_THE_EXPERT)
    .coded(
        Group::Whole,
        own("JACCARD", "Jaccard index with the expert's mask"),
    ),
    figure(
        "measures/dice",
        "Dice index",
        Unit::OF_ONE,
        3,
        "Overlap with the expert's mask: twice the shared part over the sum.",
    )
    .under(AGAINST_THE_EXPERT)
    .coded(
        Group::Whole,
        own("DICE", "Dice index with the expert's mask"),
    ),
    figure(
        "measures/contour_distance_voxels",
        "Contour distance (E_CD)",
        Unit::VOXEL,
        3,
        "Mean distance of the contours from the expert's, in voxels.",
    )
    .under(AGAINST_THE_EXPERT),
    figure(
        "measures/contour_distance_mm",
        "Contour distance",
        Unit::MILLIMETRE,
        2,
        "Mean distance of the contours from the expert's.",
    )
    .under(AGAINST_THE_EXPERT)
    .detail()
    .coded(
        Group::Whole,
        own("CONTOUR-MM", "Mean contour distance to the expert's mask"),
    ),
    figure(
        "measures/hausdorff_mm",
        "Hausdorff distance",
        Unit::MILLIMETRE,
        2,
        "Largest distance of the contours from the expert's.",
    )
    .under(AGAINST_THE_EXPERT)
    .detail()
    .coded(
        Group::Whole,
        own("HAUSDORFF-MM", "Hausdorff distance to the expert's mask"),
    ),
    figure(
        "measures/hausdorff95_mm",
        "Hausdorff distance, 95 %",
        Unit::MILLIMETRE,
        2,
        "95th percentile of the distance of the contours from the expert's.",
    )
    .under(AGAINST_THE_EXPERT),
    figure(
        "measures/volume_ml",
        "Volume of the mask",
        Unit::MILLILITRE,
        1,
        "Volume of the mask that is compared.",
    )
    .under(AGAINST_THE_EXPERT)
    .detail(),
    figure(
        "measures/expert_volume_ml",
        "Volume of the expert's mask",
        Unit::MILLILITRE,
        1,
        "Volume of the expert's mask.",
    )
    .under(AGAINST_THE_EXPERT)
    .detail(),
    figure(
        "measures/volume_difference_ml",
        "Volume difference",
        Unit::MILLILITRE,
        1,
        "How much larger the mask is than the expert's.",
    )
    .signed()
    .under(AGAINST_THE_EXPERT)
    .detail(),
    figure(
        "measures/volume_difference_percent",
        "Volume difference, relative",
        Unit::PERCENT,
        1,
        "How much larger the mask is than the expert's, in per cent of the expert's.",
    )
    .signed()
    .under(AGAINST_THE_EXPERT)
    .detail(),
];

/// The figures of a segment of the polar map.
pub const SEGMENT_FIGURES: &[Figure] = &[
    figure(
        "mean_percent",
        "mean",
        Unit::PERCENT,
        1,
        "Mean uptake, in per cent of the hottest quarter of this scan's own wall.",
    )
    .coded_mean(Group::Whole, MYOCARDIAL_PERFUSION),
    figure(
        "extent_percent",
        "below the threshold",
        Unit::PERCENT,
        1,
        "Share of its area below the threshold.",
    )
    .coded(Group::Whole, DEFECT_EXTENT),
];
