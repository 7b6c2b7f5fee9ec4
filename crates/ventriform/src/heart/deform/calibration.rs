//! Constants of the models of rim and wall. Written by `scripts/measure/calibrate_walls.py`: do not edit.
//!
//! In: rims and walls of fits to simulated hearts, and the true ones. Out: the shape of the rim with its correction,
//! and the distances from the apparent to the anatomical wall.

use super::ray_terms::{RayTerms, SizeShift, SmoothnessShift};
use super::rim_model::{
    RimCorrection, RimDeviation, RimHarmonic, RimRegression, RimShape, RimTerms,
};

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

/// The rim's distance from where the sensors left it, by its shape and the ends of the signal.
pub const RIM_REGRESSION: RimRegression = RimRegression {
    terms: [
        RimTerms {
            constant: 3.368,
            length: -0.0275,
            by_shape: [1.09, -0.186, 0.138, 0.204, -0.1, 0.274, -0.093],
            of_heart: [0.046, -0.092, -0.004, -0.065, -0.054, -0.018, -0.177],
            of_direction: [0.28, -0.128, 0.214, 0.187, -0.073, -0.273, -0.011],
        },
        RimTerms {
            constant: -0.949,
            length: 0.0133,
            by_shape: [0.885, 0.549, -0.024, 0.05, -0.083, -0.3, 0.092],
            of_heart: [-0.127, 0.157, -0.002, -0.06, 0.0, 0.068, 0.026],
            of_direction: [-0.255, 0.279, -0.137, -0.092, 0.106, -0.055, -0.161],
        },
        RimTerms {
            constant: 0.788,
            length: -0.004,
            by_shape: [-0.005, -0.023, 0.331, 0.146, 0.211, -0.205, 0.548],
            of_heart: [0.051, 0.013, 0.108, -0.001, -0.078, 0.132, 0.015],
            of_direction: [0.067, -0.121, 0.131, -0.048, -0.018, -0.103, 0.141],
        },
        RimTerms {
            constant: 0.458,
            length: -0.0041,
            by_shape: [0.051, 0.058, 0.015, 0.225, -0.055, -0.102, -0.025],
            of_heart: [0.023, -0.048, -0.006, 0.166, -0.038, -0.11, 0.028],
            of_direction: [0.097, -0.069, 0.013, 0.065, -0.025, 0.054, 0.021],
        },
        RimTerms {
            constant: 0.031,
            length: 0.0033,
            by_shape: [0.297, -0.038, 0.189, -0.092, 0.187, 0.105, -0.023],
            of_heart: [-0.03, -0.036, -0.049, -0.032, 0.105, -0.016, 0.014],
            of_direction: [-0.034, 0.061, -0.026, -0.09, 0.049, 0.021, -0.095],
        },
        RimTerms {
            constant: -0.022,
            length: -0.0014,
            by_shape: [0.078, -0.11, -0.037, 0.072, 0.039, 0.169, -0.048],
            of_heart: [0.012, -0.002, -0.006, -0.07, 0.004, 0.135, 0.049],
            of_direction: [-0.017, 0.031, 0.011, -0.016, 0.028, 0.098, -0.12],
        },
        RimTerms {
            constant: 0.194,
            length: -0.0018,
            by_shape: [0.065, -0.026, 0.024, -0.004, -0.029, 0.215, 0.202],
            of_heart: [-0.014, -0.014, -0.001, 0.052, -0.074, 0.004, 0.098],
            of_direction: [-0.038, -0.041, 0.038, -0.029, -0.044, -0.01, -0.01],
        },
    ],
    length_range_mm: [50.2, 121.8],
    range_mm: [-12.0, 20.0],
};

/// Standard deviation of the height of a rim.
pub const RIM_DEVIATION: RimDeviation = RimDeviation {
    least_mm: 1.663,
    per_scatter: 0.787,
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
