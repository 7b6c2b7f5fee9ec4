//! The figures of a model.

use super::{Figure, Unit, figure};

/// The figures of a model.
pub const FIGURES: &[Figure] = &[
    figure(
        "mesh/vertices",
        "Points",
        Unit::ONE,
        0,
        "Number of the mesh's vertices.",
    )
    .flat_name("vertices"),
    figure(
        "mesh/triangles",
        "Triangles",
        Unit::ONE,
        0,
        "Number of the mesh's triangles.",
    )
    .detail()
    .flat_name("triangles"),
    figure(
        "distance/mean_mm",
        "Distance to the surface, mean",
        Unit::MILLIMETRE,
        2,
        "Mean distance between the model and the image's surface.",
    )
    .flat_name("distance_mean_mm"),
    figure(
        "distance/hausdorff_mm",
        "Hausdorff distance",
        Unit::MILLIMETRE,
        2,
        "Largest distance between the model and the image's surface.",
    )
    .flat_name("hausdorff_mm"),
    figure(
        "distance/hd95_mm",
        "Hausdorff distance, 95 %",
        Unit::MILLIMETRE,
        2,
        "95th percentile of the distance between the model and the image's surface.",
    ),
    figure(
        "distance/volume_ml",
        "Volume",
        Unit::MILLILITRE,
        1,
        "Volume that the model encloses.",
    ),
    figure(
        "distance/volume_error_percent",
        "Volume error",
        Unit::PERCENT,
        2,
        "Volume that the model encloses beyond that of the surface, in per cent of it.",
    )
    .signed()
    .flat_name("volume_error_percent"),
    figure(
        "shape/radius_ratio/mean",
        "Triangle shape 2r/R, mean",
        Unit::OF_ONE,
        3,
        "Twice the radius of the inscribed circle over that of the circumscribed one: 1 for equal sides.",
    )
    .flat_name("radius_ratio_mean"),
    figure(
        "shape/radius_ratio/min",
        "Triangle shape 2r/R, least",
        Unit::OF_ONE,
        3,
        "The same of the worst triangle.",
    )
    .flat_name("radius_ratio_min"),
    figure(
        "smoothness/dihedral_deg/mean",
        "Angle between neighbours, mean",
        Unit::DEGREE,
        1,
        "Mean angle between the normals of neighbouring triangles.",
    )
    .flat_name("dihedral_mean_deg"),
    figure(
        "mesh/self_intersections",
        "Self-intersections",
        Unit::ONE,
        0,
        "Pairs of triangles that cut through each other.",
    )
    .detail()
    .flat_name("self_intersections"),
    figure(
        "fitness/gain_percent",
        "Fitness gained by optimisation",
        Unit::PERCENT,
        1,
        "How much edge flips raise the four-term fitness.",
    )
    .signed(),
    figure(
        "timings_ms/total",
        "Time from voxels to the measured model",
        Unit::MILLISECOND,
        0,
        "Time of all stages.",
    ),
];
