//! Constants of the mean thickness of walls. Written by `scripts/measure/calibrate_thickness.py`: do not edit.
//!
//! In: widths of walls of simulated hearts, and their true thickness. Out: the image's resolution by its noise.

use super::resolution_terms::ResolutionTerms;

/// True mean thickness of usual walls less the mean over the rays of what the calibration of walls leaves, mm.
pub(super) const MEAN_THICKNESS_SHIFT_MM: f64 = 0.46;

/// The part of a wall's mean thickness that a slab has which looks as wide.
pub(super) const SLAB_SHARE: f64 = 0.86;

/// The resolution of an image.
pub(super) const RESOLUTION: ResolutionTerms = ResolutionTerms {
    usual_mm: 14.56,
    per_squared_noise_length: 0.261,
    per_log_cavity: -0.28,
    sd_mm: 1.15,
    sd_without_noise_mm: 1.52,
    range_mm: [1.2, 5.3],
};
