//! Constants of the models of rim and wall. Written by `scripts/calibrate_walls.py`: do not edit.
//!
//! In: rims and walls of fits to simulated hearts, and the true ones. Out: the shape of the rim with its correction, and
//! the distances from the apparent to the anatomical wall.

use super::ray_terms::{RayTerms, SizeShift, SmoothnessShift};
use super::rim_model::{RimCorrection, RimHarmonic, RimShape};

/// Shape of the rims of hearts.
pub const RIM_SHAPE: RimShape = RimShape {
    mean: [
        RimHarmonic {
            cosine: -0.0638,
            sine: 0.0248,
        },
        RimHarmonic {
            cosine: 0.0188,
            sine: -0.0082,
        },
        RimHarmonic {
            cosine: -0.0038,
            sine: 0.0008,
        },
    ],
    precision: [
        [2029.0, 51.0, 1485.0, -24.0, -998.0, -454.0],
        [51.0, 2307.0, -383.0, 1555.0, 172.0, -110.0],
        [1485.0, -383.0, 6336.0, -677.0, 1556.0, -2108.0],
        [-24.0, 1555.0, -677.0, 4764.0, -220.0, 1541.0],
        [-998.0, 172.0, 1556.0, -220.0, 7487.0, -688.0],
        [-454.0, -110.0, -2108.0, 1541.0, -688.0, 8253.0],
    ],
};

/// The share of a rim's distance from its shape that is taken back.
pub const RIM_CORRECTION: RimCorrection = RimCorrection {
    intercept_mm: 0.784,
    slope: 0.95,
    bend_mm: 4.0,
    short_slope: 1.136,
    long_slope: 0.278,
    range_mm: [-12.0, 16.0],
};

/// Distance by which the inner surface moves outward, mm.
pub const INNER_SHIFT_MM: RayTerms = RayTerms {
    constant: 2.838,
    thickness: 0.526,
    ln_radius: 1.454,
    ln_radius_squared: -1.673,
    thickness_here: 0.413,
    narrowness_here: 0.403,
    missing_uptake: 1.411,
    missing_uptake_squared: 0.545,
    way: -1.927,
    way_squared: 3.921,
    nearness_to_apex: -0.076,
};

/// Distance by which the outer surface moves outward, mm.
pub const OUTER_SHIFT_MM: RayTerms = RayTerms {
    constant: -1.066,
    thickness: -0.223,
    ln_radius: -1.725,
    ln_radius_squared: -0.026,
    thickness_here: -0.417,
    narrowness_here: 0.619,
    missing_uptake: -1.1,
    missing_uptake_squared: -0.075,
    way: -1.404,
    way_squared: -1.183,
    nearness_to_apex: -2.356,
};

/// Distance by which the inner surface moves inward of that, where the cavity looks smaller: one as narrow as the blur
/// hardly moves its edge any more when it shrinks.
pub const NARROW_CAVITY_SHIFT: SizeShift = SizeShift {
    cavity_ml: 25.0,
    per_log_mm: 0.94,
};

/// Distance by which the outer surface moves outward of that, the more, the smaller the cavity looks.
pub const CAVITY_SIZE_SHIFT: SizeShift = SizeShift {
    cavity_ml: 68.0,
    per_log_mm: 0.435,
};

/// Distances by which both surfaces move outward of that, where the image is smoother than usual.
pub const SMOOTHNESS_SHIFT: SmoothnessShift = SmoothnessShift {
    usual_mm: 8.991,
    inner_per_log_mm: 4.379,
    outer_per_log_mm: -1.164,
    range_mm: [6.992, 12.157],
};
